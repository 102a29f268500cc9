//! Directions from which a model is seen, in a frame that follows what is up.

use penup_readers::sine_cosine;

/// A point or a direction in space.
pub type Vector = [f64; 3];

/// A direction from which a model is seen, in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Viewpoint {
    /// The angle about the vertical: -90 is in front, 0 on the right.
    pub azimuth: f64,
    /// The angle above the horizontal, -90 to 90.
    pub elevation: f64,
}

/// The views that have names.
pub const NAMED_VIEWS: [(&str, Viewpoint); 6] = [
    ("front", Viewpoint { azimuth: -90.0, elevation: 0.0 }),
    ("back", Viewpoint { azimuth: 90.0, elevation: 0.0 }),
    ("left", Viewpoint { azimuth: 180.0, elevation: 0.0 }),
    ("right", Viewpoint { azimuth: 0.0, elevation: 0.0 }),
    ("top", Viewpoint { azimuth: -90.0, elevation: 90.0 }),
    ("bottom", Viewpoint { azimuth: -90.0, elevation: -90.0 }),
];

/// One of the options that choose the eye by its direction. The flags of the command line and the
/// controls of the page are made from it.
#[derive(Debug, Clone, Copy)]
pub struct ViewOption {
    /// The name of the option, as in `--name`.
    pub name: &'static str,
    /// The placeholder for the value in the help; empty if the option takes none.
    pub value: &'static str,
    /// The text of the help.
    pub help: &'static str,
}

/// The side from which a model is seen, one of [`NAMED_VIEWS`].
pub const VIEW: ViewOption =
    ViewOption { name: "view", value: "SIDE", help: "See the model from this side" };
/// The angle about the vertical.
pub const AZIMUTH: ViewOption = ViewOption {
    name: "azimuth",
    value: "DEGREES",
    help: "See the model from this angle about the vertical, with any projection: -90 is in front, \
           0 on the right [default: -59]",
};
/// The angle above the horizontal.
pub const ELEVATION: ViewOption = ViewOption {
    name: "elevation",
    value: "DEGREES",
    help: "See the model from this angle above the horizontal, with any projection [default: 30]",
};
/// What is up in the file.
pub const Y_UP: ViewOption = ViewOption {
    name: "y-up",
    value: "",
    help: "The file has y up: the model stands upright, and its front is at positive z",
};

/// The greatest angle about the vertical, and above the horizontal, in degrees.
pub const MOST_DEGREES: [f64; 2] = [360.0, 90.0];

/// The plotter's own choice, a three-quarter view, as a direction where z is up.
pub const THREE_QUARTER: Vector = [0.45, -0.75, 0.5];

/// The distance of the plotter's own eye, in radii of the model.
const EYE_DISTANCE: f64 = 3.5;

impl Viewpoint {
    /// The direction that these values of the options choose; `None` if there are none. Where only
    /// one angle is given, the other is that of the three-quarter view.
    pub fn chosen(
        side: Option<&str>,
        azimuth: Option<f64>,
        elevation: Option<f64>,
    ) -> Option<Self> {
        let named = NAMED_VIEWS.iter().find(|(own, _)| Some(*own) == side);
        let usual = Self::three_quarter();
        match (named, azimuth, elevation) {
            (Some((_, view)), _, _) => Some(*view),
            (None, None, None) => None,
            (None, azimuth, elevation) => Some(Self {
                azimuth: azimuth.unwrap_or(usual.azimuth),
                elevation: elevation.unwrap_or(usual.elevation),
            }),
        }
    }

    /// The three-quarter view.
    pub fn three_quarter() -> Self {
        let [x, y, z] = THREE_QUARTER;
        Self { azimuth: y.atan2(x).to_degrees(), elevation: z.atan2(x.hypot(y)).to_degrees() }
    }

    /// The direction to the eye where z is up, of length 1.
    pub fn direction(self) -> Vector {
        let (sin_azimuth, cos_azimuth) = sine_cosine(self.azimuth);
        let (sin_elevation, cos_elevation) = sine_cosine(self.elevation);
        [cos_azimuth * cos_elevation, sin_azimuth * cos_elevation, sin_elevation]
    }

    /// Returns the upward direction of the picture for a model with z up. It is z, except if the
    /// model is seen from above or below; then it is the direction to the back or to the front.
    pub fn up(self) -> Vector {
        let (sine, cosine) = sine_cosine(self.azimuth);
        match self.elevation {
            elevation if elevation >= 90.0 => [-cosine, -sine, 0.0],
            elevation if elevation <= -90.0 => [cosine, sine, 0.0],
            _ => [0.0, 0.0, 1.0],
        }
    }
}

/// Turns `vector` as the shortest turn does that brings z to `up`: so what stands upright where z
/// is up stands upright where `up` is. `None` if `up` has no direction.
///
/// ```
/// use penup_job::view::turned_upright;
/// // In a model with y up, the front is at positive z.
/// assert_eq!(turned_upright([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]), Some([0.0, 0.0, 1.0]));
/// ```
pub fn turned_upright(vector: Vector, up: Vector) -> Option<Vector> {
    let length = up.iter().map(|part| part * part).sum::<f64>().sqrt();
    if !length.is_normal() {
        return None;
    }
    let [ux, uy, uz] = up.map(|part| part / length);
    let [x, y, z] = vector;
    if uz < -1.0 + 1e-12 {
        return Some([x, -y, -z]);
    }
    // Rodrigues' formula for the turn about z × up, whose sine and cosine `up` holds.
    let across = x * ux + y * uy;
    let part = z - across / (1.0 + uz);
    let turned = [x + ux * part, y + uy * part, uz * z - across];
    // Adding zero turns a negative zero into a positive one.
    Some(turned.map(|part| part + 0.0))
}

/// The position of the eye that sees a model with these least and greatest coordinates from
/// `direction`, looking at `at` or at its middle, from as far as the plotter's own eye.
pub fn eye([low, high]: [Vector; 2], direction: Vector, at: Option<Vector>) -> Vector {
    let half = [0, 1, 2].map(|axis: usize| (high[axis] - low[axis]) / 2.0);
    let radius = half.iter().map(|part| part * part).sum::<f64>().sqrt();
    let distance = EYE_DISTANCE * if radius > 0.0 { radius } else { 1.0 };
    let at = at.unwrap_or([0, 1, 2].map(|axis: usize| low[axis] + half[axis]));
    [0, 1, 2].map(|axis: usize| at[axis] + distance * direction[axis])
}

/// Writes a position of a model of this size as the value of an option.
pub fn text(position: Vector, size: f64) -> String {
    // Nine digits of the size are more than a picture can show.
    let decimals = (9.0 - size.max(1e-9).log10().ceil()).clamp(0.0, 15.0) as usize;
    position.map(|part| format!("{part:.decimals$}")).join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_up_stays_up_and_lengths_stay() {
        let ups =
            [[0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [1.0, -2.0, 3.0]];
        for up in ups {
            let length = up.iter().map(|part: &f64| part * part).sum::<f64>().sqrt();
            let turned = turned_upright([0.0, 0.0, 1.0], up).expect("a direction");
            for axis in 0..3 {
                assert!((turned[axis] - up[axis] / length).abs() < 1e-12, "{up:?} {turned:?}");
            }
            let of = |vector| turned_upright(vector, up).expect("a direction");
            let (a, b) = (of([3.0, -1.0, 0.5]), of([0.2, 4.0, -2.0]));
            let dot: f64 = (0..3).map(|axis| a[axis] * b[axis]).sum();
            assert!((dot - (0.6 - 4.0 - 1.0)).abs() < 1e-9, "{up:?} {dot}");
        }
        assert_eq!(turned_upright([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]), Some([1.0, 2.0, 3.0]));
        assert_eq!(turned_upright([1.0, 2.0, 3.0], [0.0; 3]), None);
    }

    #[test]
    fn the_named_views_look_at_the_sides() {
        let sides = NAMED_VIEWS.map(|(name, view)| (name, view.direction(), view.up()));
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let minus = |vector: Vector| vector.map(|part| 0.0 - part);
        let expected = [
            ("front", minus(y), z),
            ("back", y, z),
            ("left", minus(x), z),
            ("right", x, z),
            ("top", z, y),
            ("bottom", minus(z), minus(y)),
        ];
        assert_eq!(sides, expected);
    }
}
