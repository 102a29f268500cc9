//! The values of those options that are more than a number: their types, and the parsers of those
//! that have a form of their own.

use crate::drawing::LineType;
use crate::fixed::SixDecimals;
use crate::protocol::{CommandError, PENS, choice, numbers, trim, whole};
use crate::text::split_once;
use crate::view::Lens;
use core::fmt;

/// The projection by which the model is drawn (`$projection`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProjectionChoice {
    /// A projection from the eye, through a lens.
    Lens(Lens),
    /// A parallel projection along a given direction, in degrees. The options eye and angles are
    /// not used.
    Axonometric {
        /// Angle from the x axis towards the y axis, in degrees. -90 is the view from the front.
        azimuth: f64,
        /// Angle of the direction above the xy plane, in degrees.
        elevation: f64,
    },
}

impl Default for ProjectionChoice {
    fn default() -> Self {
        Self::Lens(Lens::Perspective)
    }
}

impl ProjectionChoice {
    /// The forms of the value. The last four choose a direction.
    pub(super) const WORDS: &[&str] = &[
        "perspective",
        "orthographic",
        "cavalier",
        "cabinet",
        "oblique,ANGLE,RATIO",
        "isometric",
        "dimetric",
        "trimetric",
        "axonometric,AZIMUTH,ELEVATION",
    ];

    /// Parses one of these forms.
    pub(super) fn parse(value: &str) -> Result<Self, CommandError> {
        let (name, rest) = match split_once(value, b',') {
            Some((name, rest)) => (trim(name), Some(rest)),
            None => (value, None),
        };
        let oblique = |angle, ratio| Self::Lens(Lens::Oblique { angle, ratio });
        let axonometric = |azimuth, elevation| Self::Axonometric { azimuth, elevation };
        Ok(match (name, rest) {
            ("perspective", None) => Self::Lens(Lens::Perspective),
            ("orthographic", None) => Self::Lens(Lens::Orthographic),
            ("cavalier", None) => oblique(45.0, 1.0),
            ("cabinet", None) => oblique(45.0, 0.5),
            ("oblique", Some(rest)) => {
                let [angle, ratio] = numbers(rest)?;
                if !(0.0..=2.0).contains(&ratio) || libm::fabs(angle) > 360.0 {
                    return Err(CommandError::NumberOutOfRange);
                }
                oblique(angle, ratio)
            }
            // All three axes are foreshortened equally: the elevation is atan(1 / sqrt 2).
            ("isometric", None) => axonometric(-45.0, 35.264_389_682_754_654),
            // The x, y and z axes are foreshortened in the ratio 1 : 1/2 : 1. On the page, x and y
            // lie at some 7 and 41 degrees to the horizontal.
            ("dimetric", None) => axonometric(-69.295_188_945_364_57, 19.471_220_634_490_69),
            ("trimetric", None) => axonometric(-60.0, 25.0),
            ("dimetric" | "trimetric" | "axonometric", Some(rest)) => {
                let [azimuth, elevation] = numbers(rest)?;
                if libm::fabs(azimuth) > 360.0 || libm::fabs(elevation) > 90.0 {
                    return Err(CommandError::NumberOutOfRange);
                }
                axonometric(azimuth, elevation)
            }
            _ => return Err(CommandError::NotAChoice { choices: Self::WORDS }),
        })
    }

    /// Writes the value in one of these forms, the directions and the oblique ones with numbers.
    pub(super) fn show(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, [first, second]) = match *self {
            Self::Lens(Lens::Perspective) => return formatter.write_str("perspective"),
            Self::Lens(Lens::Orthographic) => return formatter.write_str("orthographic"),
            Self::Lens(Lens::Oblique { angle, ratio }) => ("oblique", [angle, ratio]),
            Self::Axonometric { azimuth, elevation } => ("axonometric", [azimuth, elevation]),
        };
        write!(formatter, "{name},{},{}", SixDecimals(first), SixDecimals(second))
    }
}

/// The part of the model that decides which lines are hidden (`$see`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum VisibilityMode {
    /// Faces of any kind hide what is behind them.
    #[default]
    Faces,
    /// Nothing hides anything: the model is drawn as a wire frame.
    Wire,
    /// The vertices are those of one convex solid. Faces and edges are derived from them.
    Vertices,
    /// The vertices and edges are those of one convex solid. Its faces are derived from them.
    Edges,
}

/// The treatment of hidden lines (`$hidden`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HiddenLines {
    /// Hidden lines are not drawn.
    #[default]
    Erased,
    /// Hidden lines are drawn with this line type. With full lines, like the visible ones, the
    /// result is a wire frame.
    Drawn(LineType),
    /// Hidden lines are drawn with this pen, counted from 0.
    Pen(u8),
}

impl HiddenLines {
    /// The word for hidden lines that are drawn like visible ones.
    const SHOWN: &str = "shown";

    /// The forms of the value: the line types other than the full one are among them by name.
    pub(super) const WORDS: &[&str] = &{
        const TYPES: usize = LineType::ALL.len();
        let mut words = ["erased"; TYPES + 3];
        let mut code = 1;
        while code < TYPES {
            words[code] = LineType::ALL[code].name();
            code += 1;
        }
        (words[TYPES], words[TYPES + 1], words[TYPES + 2]) = (Self::SHOWN, "pen", "pen,NUMBER");
        words
    };

    /// Parses one of these forms.
    pub(super) fn parse(value: &str) -> Result<Self, CommandError> {
        if let Some(number) = value.strip_prefix("pen,") {
            return match whole(number)? {
                number @ 1..=PENS => Ok(Self::Pen(number as u8 - 1)),
                _ => Err(CommandError::NumberOutOfRange),
            };
        }
        choice(value, Self::WORDS)?;
        Ok(match (value, LineType::named(value)) {
            (_, Some(line_type)) => Self::Drawn(line_type),
            (Self::SHOWN, None) => Self::Drawn(LineType::Full),
            // The first pen draws the visible lines, so this is the second.
            ("pen", None) => Self::Pen(1),
            _ => Self::Erased,
        })
    }

    /// Writes the value in one of these forms.
    pub(super) fn show(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Erased => "erased",
            Self::Drawn(LineType::Full) => Self::SHOWN,
            Self::Drawn(line_type) => line_type.name(),
            Self::Pen(pen) => return write!(formatter, "pen,{}", pen + 1),
        })
    }
}
