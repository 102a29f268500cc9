//! The plane of an entity, which may be drawn from any side: DXF gives the direction that is up.

use super::curves::Affine;

/// A vector in space.
type Vector = [f64; 3];

/// The plane of an entity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    /// The directions of its x and y, and of what is up.
    axes: [Vector; 3],
}

impl Plane {
    /// The plane to which `up` stands upright. Its x follows from `up` by the rule of the format:
    /// across the y of the world if `up` is nearly its z, and else across its z.
    pub(super) fn of(up: Vector) -> Self {
        let up = unit(up).unwrap_or([0.0, 0.0, 1.0]);
        let is_near = up[0].abs() < 1.0 / 64.0 && up[1].abs() < 1.0 / 64.0;
        let other = if is_near { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let x = unit(cross(other, up)).unwrap_or([1.0, 0.0, 0.0]);
        Self { axes: [x, cross(up, x), up] }
    }

    /// Returns the map of a drawing in this plane, at this height above the origin of the plane, to
    /// its view from above.
    pub(super) fn seen(self, height: f64) -> Affine {
        let [x, y, up] = self.axes;
        Affine([x[0], x[1], y[0], y[1], up[0] * height, up[1] * height])
    }

    /// Turns `vector` by a quarter turn about the upward direction.
    pub(super) fn turned(self, vector: Vector) -> Vector {
        cross(self.axes[2], vector)
    }
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The vector with the length 1; `None` if it has none.
fn unit(vector: Vector) -> Option<Vector> {
    let length = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
    (length > 1e-12).then(|| vector.map(|part| part / length))
}
