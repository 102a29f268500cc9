//! Faces and their vertices, and the ways to make solids of them.

use std::f64::consts::TAU;
use std::fmt::Write as _;

/// A point of a plane, in units of the scene.
pub type Point = [f64; 2];

/// The numbers of vertices around a loop, counterclockwise as seen from above.
pub type Loop = Vec<usize>;

/// A scene of faces, to be written as an OBJ file.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    vertices: Vec<[f64; 3]>,
    text: String,
}

/// A point on a circle around `centre`, at an angle in radians counterclockwise from the direction
/// of x.
pub fn polar(centre: Point, radius: f64, angle: f64) -> Point {
    [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()]
}

/// A circle of `count` points, the first of them at the angle `from`, in radians.
pub fn circle(centre: Point, radius: f64, count: usize, from: f64) -> Vec<Point> {
    (0..count).map(|n| polar(centre, radius, from + TAU * n as f64 / count as f64)).collect()
}

impl Mesh {
    /// Adds a vertex for each of `points`, all at the height `z`, and returns their numbers.
    pub fn level(&mut self, points: &[Point], z: f64) -> Loop {
        let first = self.vertices.len();
        self.vertices.extend(points.iter().map(|&[x, y]| [x, y, z]));
        (first..self.vertices.len()).collect()
    }

    /// Adds a face. Its corners run counterclockwise as seen from outside.
    pub fn face(&mut self, corners: impl IntoIterator<Item = usize>) {
        self.text += "f";
        for corner in corners {
            // Writing to a string cannot fail. OBJ counts from 1.
            let _ = write!(self.text, " {}", corner + 1);
        }
        self.text += "\n";
    }

    /// Adds the same face turned over.
    pub fn face_below(&mut self, corners: &[usize]) {
        self.face(corners.iter().rev().copied());
    }

    /// Joins two loops of as many vertices by quadrilaterals, whose outside is to the right of the
    /// way along `lower` if `upper` is above it.
    pub fn wall(&mut self, lower: &[usize], upper: &[usize]) {
        let count = lower.len();
        for n in 0..count {
            let next = (n + 1) % count;
            self.face([lower[n], lower[next], upper[next], upper[n]]);
        }
    }

    /// Adds a solid of revolution about a vertical axis. It begins with the loop `lowest`,
    /// continues with circles of `(radius, height)` that have as many vertices, and is closed on
    /// top. The circles begin at the angle `from`, in radians.
    pub fn turned(&mut self, centre: Point, lowest: &[usize], profile: &[(f64, f64)], from: f64) {
        let mut below = lowest.to_vec();
        for &(radius, z) in profile {
            let above = self.level(&circle(centre, radius, lowest.len(), from), z);
            self.wall(&below, &above);
            below = above;
        }
        self.face(below);
    }

    /// Adds a solid of revolution that stands at the height of the first circle of its profile. It
    /// has no underside there: it stands on something that is wider.
    pub fn revolved(&mut self, centre: Point, count: usize, profile: &[(f64, f64)]) {
        let [(radius, z), above @ ..] = profile else { return };
        let lowest = self.level(&circle(centre, *radius, count, 0.0), *z);
        self.turned(centre, &lowest, above, 0.0);
    }

    /// Adds a prism between two heights. It has an underside.
    pub fn prism(&mut self, outline: &[Point], low: f64, high: f64) {
        let (lower, upper) = (self.level(outline, low), self.level(outline, high));
        self.wall(&lower, &upper);
        self.face_below(&lower);
        self.face(upper);
    }

    /// Names the faces that follow.
    pub fn name(&mut self, name: &str) {
        let _ = writeln!(self.text, "o {name}");
    }

    /// The OBJ file, with `comment` in its first line. Coordinates are rounded to three decimals.
    pub fn obj(&self, comment: &str) -> String {
        let mut file = format!("# {comment}\n");
        for vertex in &self.vertices {
            // Adding zero turns a negative zero into a positive one.
            let [x, y, z] = vertex.map(|part| (part * 1000.0).round() / 1000.0 + 0.0);
            let _ = writeln!(file, "v {x:.3} {y:.3} {z:.3}");
        }
        file + &self.text
    }
}
