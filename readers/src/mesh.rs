//! The lines of OBJ that describe a mesh: faces and edges between points, joined where they are
//! equal.

use super::error::ReadError;
use super::flat::Flat;
use super::format::Contents;
use crate::lines::{JobLine, Lines, Origin};
use crate::words::MOSTLY_FLAT;
use penup::protocol::LINE_LIMIT;
use std::collections::HashMap;
use std::fmt::Write as _;

/// The part of the edges that must be nearly flat for the user to be told about `--crease`.
const MOST: f64 = 0.6;

/// The greatest angle in degrees by which a nearly flat edge bends.
const NEARLY_FLAT: f64 = 30.0;

/// The number of edges from which on a mesh may be too fine to draw each of them.
const MANY_EDGES: usize = 100;

/// A coordinate as the file writes it. It keeps the precision of the file, so that no digits are
/// sent that the file does not have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Coordinate {
    /// Single precision.
    Single(f32),
    /// Double precision, or a decimal.
    Double(f64),
}

impl Coordinate {
    /// The value.
    pub(super) fn value(self) -> f64 {
        match self {
            Self::Single(value) => value.into(),
            Self::Double(value) => value,
        }
    }

    /// Whether it is a finite number.
    #[cfg(feature = "ply")]
    pub(super) fn is_finite(self) -> bool {
        self.value().is_finite()
    }

    /// The shortest decimal that is this number in its precision. It has no exponent.
    fn text(self) -> String {
        match self {
            // Negative zero is zero.
            Self::Single(value) => (value + 0.0).to_string(),
            Self::Double(value) => (value + 0.0).to_string(),
        }
    }
}

/// A point in space: x, y and z.
pub(super) type Point = [Coordinate; 3];

/// A mesh that grows by faces and edges.
#[derive(Debug, Default)]
pub(super) struct Mesh {
    /// The file, as the user named it.
    file: String,
    vertices: Vec<Point>,
    /// The number of each vertex, counted from 0, by the bits of its coordinates.
    numbers: HashMap<[u64; 3], u32>,
    /// The numbers of the corners of all elements, one after the other.
    corners: Vec<u32>,
    /// Where each element ends among the corners, and its number in the file, counted from 1.
    elements: Vec<(u32, u32)>,
    /// The number of faces with fewer than three different corners, which are left out.
    degenerate: usize,
    /// The number of edges between equal vertices, which are left out.
    #[cfg(feature = "ply")]
    points: usize,
}

impl Mesh {
    /// An empty mesh for the contents of a file.
    pub(super) fn new(file: String) -> Self {
        Self { file, ..Self::default() }
    }

    /// Whether nothing can be drawn.
    pub(super) fn is_empty(&self) -> bool {
        self.elements.is_empty()
    }

    /// The number of the vertex at this point, counted from 0, which is made if there is none.
    pub(super) fn vertex(&mut self, point: Point) -> u32 {
        let next = self.vertices.len() as u32; // below 2^32, as the bytes of the file are
        let key = point.map(|coordinate| (coordinate.value() + 0.0).to_bits());
        let number = *self.numbers.entry(key).or_insert(next);
        if number == next {
            self.vertices.push(point);
        }
        number
    }

    /// Adds the face of the file with this number, counted from 1, through these vertices. Corners
    /// that repeat the one before are left out, and a face that has fewer than three then.
    pub(super) fn face(&mut self, number: u32, corners: &[u32]) {
        let begin = self.corners.len();
        self.corners.extend_from_slice(corners);
        let mut end = begin;
        for index in begin..self.corners.len() {
            if end == begin || self.corners[end - 1] != self.corners[index] {
                self.corners[end] = self.corners[index];
                end += 1;
            }
        }
        while end > begin + 1 && self.corners[end - 1] == self.corners[begin] {
            end -= 1;
        }
        let is_face = end - begin >= 3;
        self.corners.truncate(if is_face { end } else { begin });
        if is_face {
            self.elements.push((self.corners.len() as u32, number));
        } else {
            self.degenerate += 1;
        }
    }

    /// Adds the edge of the file with this number, counted from 1, between two vertices.
    #[cfg(feature = "ply")]
    pub(super) fn edge(&mut self, number: u32, ends: [u32; 2]) {
        if ends[0] != ends[1] {
            self.corners.extend(ends);
            self.elements.push((self.corners.len() as u32, number));
        } else {
            self.points += 1;
        }
    }

    /// The corners of an element.
    fn corners(&self, index: usize) -> Option<(&[u32], u32)> {
        let (end, number) = *self.elements.get(index)?;
        let begin = index.checked_sub(1).and_then(|before| self.elements.get(before));
        let begin = begin.map_or(0, |(end, _)| *end);
        Some((self.corners.get(begin as usize..end as usize)?, number))
    }

    /// The line of OBJ that draws an element.
    fn face_line(&self, index: usize) -> Option<(String, u32)> {
        let (corners, number) = self.corners(index)?;
        let mut line = if corners.len() > 2 { "f" } else { "l" }.to_owned();
        for corner in corners {
            // Writing to a string cannot fail.
            let _ = write!(line, " {}", u64::from(*corner) + 1);
        }
        Some((line, number))
    }

    /// The faces of OBJ lines whose corners are absolute numbers or count back; `None` if a line is
    /// of another form.
    pub(super) fn of_lines(lines: &dyn Lines) -> Option<Self> {
        let mut mesh = Self::default();
        let mut numbers = Vec::new();
        for line in lines.in_order() {
            let mut words = line.sent.split(' ');
            match words.next() {
                Some("v") => {
                    let mut number = || words.next()?.parse().ok().map(Coordinate::Double);
                    numbers.push(mesh.vertex([number()?, number()?, number()?]));
                }
                Some("f") => {
                    let corner = |word: &str| {
                        let number: i64 = word.split('/').next()?.parse().ok()?;
                        let back = if number < 0 { numbers.len() as i64 } else { -1 };
                        numbers.get(usize::try_from(number + back).ok()?).copied()
                    };
                    let corners = words.map(corner).collect::<Option<Vec<u32>>>()?;
                    mesh.face(0, &corners);
                }
                _ => {}
            }
        }
        Some(mesh)
    }

    /// Says that most edges are nearly flat, if they are.
    pub(super) fn crease_note(&self) -> Option<String> {
        self.flat_part().is_some_and(|part| part >= MOST).then(|| MOSTLY_FLAT.to_owned())
    }

    /// The part of the inner edges that bend by less than [`NEARLY_FLAT`]; `None` if there are few.
    fn flat_part(&self) -> Option<f64> {
        let mut normals: HashMap<[u32; 2], [f64; 3]> = HashMap::new();
        let (mut flat, mut inner) = (0usize, 0usize);
        let least = NEARLY_FLAT.to_radians().cos();
        for index in 0..self.elements.len() {
            let (corners, _) = self.corners(index)?;
            if corners.len() < 3 {
                continue;
            }
            let normal = self.normal(corners);
            for (at, &a) in corners.iter().enumerate() {
                let b = corners[(at + 1) % corners.len()];
                if let Some(other) = normals.insert([a.min(b), a.max(b)], normal) {
                    inner += 1;
                    let cosine: f64 = (0..3).map(|axis| normal[axis] * other[axis]).sum();
                    // Faces need not all turn the same way.
                    flat += usize::from(cosine.abs() >= least);
                }
            }
        }
        (inner >= MANY_EDGES).then(|| flat as f64 / inner as f64)
    }

    /// The direction across a face, of length 1; 0 if the face has no area.
    fn normal(&self, corners: &[u32]) -> [f64; 3] {
        let at = |corner: u32| self.vertices[corner as usize].map(Coordinate::value);
        let mut sum = [0.0; 3];
        for (index, &corner) in corners.iter().enumerate() {
            let ([ax, ay, az], [bx, by, bz]) =
                (at(corner), at(corners[(index + 1) % corners.len()]));
            sum[0] += (ay - by) * (az + bz);
            sum[1] += (az - bz) * (ax + bx);
            sum[2] += (ax - bx) * (ay + by);
        }
        let length = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
        if length > 0.0 { sum.map(|part| part / length) } else { sum }
    }

    /// Ends the mesh.
    ///
    /// # Errors
    /// There is no face, or one with so many corners that no line holds them.
    pub(super) fn finish(self) -> Result<Contents, ReadError> {
        let refused =
            |file: &str, reason: String| Err(ReadError::Content { file: file.to_owned(), reason });
        if self.is_empty() {
            return refused(&self.file, "there is no face to draw in it".to_owned());
        }
        for index in 0..self.elements.len() {
            if let Some((line, number)) = self.face_line(index)
                && line.len() > LINE_LIMIT
            {
                let reason = format!("face {number} has too many corners: divide it");
                return refused(&self.file, reason);
            }
        }
        let mut notes = Vec::new();
        if self.degenerate > 0 {
            let count = super::counted(self.degenerate, ["face is", "faces are"]);
            notes.push(format!("{count} not drawn, for want of three different corners"));
        }
        #[cfg(feature = "ply")]
        if self.points > 0 {
            let count = super::counted(self.points, ["edge has", "edges have"]);
            notes.push(format!("{count} no length, and nothing is drawn of that"));
        }
        notes.extend(self.crease_note());
        notes.extend(super::capacity(self.vertices.len()));
        let bounds = Flat::of(&self).bounds(&self);
        Ok(Contents { bounds, notes, ..Contents::of(self) })
    }
}

impl Lines for Mesh {
    fn count(&self) -> usize {
        self.vertices.len() + self.elements.len()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        if let Some(point) = self.vertices.get(index) {
            let [x, y, z] = point.map(Coordinate::text);
            return Some(JobLine::command(format!("v {x} {y} {z}")));
        }
        let (sent, number) = self.face_line(index - self.vertices.len())?;
        let origin = Origin {
            file: self.file.clone(),
            line: number as usize,
            text: format!("{} {number}", if sent.starts_with('f') { "face" } else { "edge" }),
        };
        Some(JobLine { sent, origin: Some(origin) })
    }
}
