//! The example scenes and a simple camera in `f64`, for tests that need no more than that.

use penup::geometry::{COORDINATE_LIMIT, EdgeParameter, Projection, Vertex};
use penup::model::Corner;
use penup::protocol::Command;
use penup::visibility::{SinkFull, Stretch, StretchSink};
use std::path::PathBuf;

/// A point or direction in space.
pub type Vector = [f64; 3];

/// The path of a file of the `scenes` directory.
pub fn scene(file: &str) -> PathBuf {
    penup_client::workspace::root().join("scenes").join(file)
}

/// What an OBJ text holds, as the library's own parser reads it.
#[derive(Debug, Clone, Default)]
pub struct ObjText {
    /// The positions of the vertices.
    pub vertices: Vec<Vector>,
    /// The faces and polylines in the order of the file.
    pub elements: Vec<ObjElement>,
}

/// A face or a polyline of an OBJ text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjElement {
    /// Whether it is a face.
    pub is_face: bool,
    /// The indices of its vertices, counted from 0.
    pub vertices: Vec<usize>,
}

impl ObjText {
    /// Reads an OBJ text whose indices are positive. Other lines than `v`, `f` and `l` are skipped.
    ///
    /// # Panics
    /// Panics at a line that the library refuses, and at an index that is not positive.
    pub fn read(text: &str) -> Self {
        let mut read = Self::default();
        for line in text.lines() {
            let (is_face, numbers) = match Command::parse(line) {
                Ok(Command::Vertex(position)) => {
                    read.vertices.push(position.map(|coordinate| coordinate.to_f64()));
                    continue;
                }
                Ok(Command::Face(numbers)) => (true, numbers),
                Ok(Command::Polyline(numbers)) => (false, numbers),
                Ok(_) => continue,
                Err(refusal) => panic!("{line}: {refusal}"),
            };
            let index = |number: i32| usize::try_from(number - 1).expect("a positive index");
            let vertices = numbers.iter().map(index).collect();
            read.elements.push(ObjElement { is_face, vertices });
        }
        read
    }
}

/// The vertices and elements of an OBJ file.
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// The positions of the vertices.
    pub vertices: Vec<Vector>,
    /// The corners of every face and bar.
    pub corners: Vec<Corner>,
}

impl Model {
    /// Adds a face or, if there are two vertices, a bar.
    pub fn add(&mut self, element: &[usize]) {
        let of_bar = element.len() == 2;
        for (n, &vertex) in element.iter().enumerate() {
            let last = n + 1 == element.len();
            self.corners.push(Corner::new(vertex as u16, of_bar, last));
        }
    }

    /// Reads the vertices, faces and polylines of an OBJ text.
    pub fn from_obj(text: &str) -> Self {
        let ObjText { vertices, elements } = ObjText::read(text);
        let mut model = Self { vertices, corners: Vec::new() };
        elements.iter().for_each(|element| model.add(&element.vertices));
        model
    }

    /// Reads a scene of the `scenes` directory.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn example(name: &str) -> std::io::Result<Self> {
        Ok(Self::from_obj(&std::fs::read_to_string(scene(&format!("{name}.obj")))?))
    }

    /// A torus of radii 2 and 1, made of `around` by `across` quadrilaterals.
    pub fn torus(around: usize, across: usize) -> Self {
        let mut model = Self::default();
        for n in 0..around * across {
            let turn =
                |part: usize, whole: usize| std::f64::consts::TAU * part as f64 / whole as f64;
            let (u, v) = (turn(n / across, around), turn(n % across, across));
            let radius = 2.0 + v.cos();
            model.vertices.push([radius * u.cos(), radius * u.sin(), v.sin()]);
        }
        for n in 0..around * across {
            let (i, j) = (n / across, n % across);
            let at = |i: usize, j: usize| i % around * across + j % across;
            model.add(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        model
    }
}

/// A view of a model, and the scales that it was made with.
#[derive(Debug, Clone)]
pub struct View {
    /// The vertices in view coordinates, rounded.
    pub vertices: Vec<Vertex>,
    /// The projection onto the page.
    pub projection: Projection,
    scale: f64,
    depth_scale: f64,
    origin: [f64; 2],
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|part| part / length)
}

impl View {
    /// Creates the view of the model from `eye` towards `at`.
    pub fn new(model: &Model, eye: Vector, at: Vector, up: Vector, projection: Projection) -> Self {
        let forward = unit(minus(at, eye));
        let right = unit(cross(forward, up));
        let upward = cross(right, forward);
        let seen: Vec<Vector> = model
            .vertices
            .iter()
            .map(|&vertex| minus(vertex, eye))
            .map(|d| [dot(d, right), dot(d, upward), dot(d, forward)])
            .collect();
        let largest = |parts: &[usize]| {
            parts.iter().flat_map(|&n| seen.iter().map(move |v| v[n].abs())).fold(1e-9, f64::max)
        };
        let limit = f64::from(COORDINATE_LIMIT);
        let (scale, depth_scale) = (limit / largest(&[0, 1]), limit / largest(&[2]));
        let vertices = seen
            .iter()
            .map(|v| Vertex {
                x: (v[0] * scale).round() as i32,
                y: (v[1] * scale).round() as i32,
                z: (v[2] * depth_scale).round() as i32,
            })
            .collect();
        Self {
            vertices,
            projection,
            scale,
            depth_scale,
            origin: [dot(eye, right), dot(eye, upward)].map(|part| -part),
        }
    }

    /// Creates the view of an example with its camera in `scenes/cameras.json`.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn example(name: &str, model: &Model) -> std::io::Result<Self> {
        let text = std::fs::read_to_string(scene("cameras.json"))?;
        let entry = &text[text.find(&format!("\"{name}\"")).unwrap_or(0)..];
        let vector = |key: &str| -> Vector {
            let list = &entry[entry.find(key).unwrap_or(0)..];
            let list = &list[list.find('[').unwrap_or(0) + 1..list.find(']').unwrap_or(0)];
            let numbers: Vec<f64> = list
                .split(',')
                .filter_map(|word| word.trim().trim_matches('"').parse().ok())
                .collect();
            [numbers[0], numbers[1], numbers[2]]
        };
        Ok(Self::new(
            model,
            vector("\"eye\""),
            vector("\"at\""),
            vector("\"up\""),
            Projection::Perspective,
        ))
    }

    /// The ratio of the scale of depth to that of width and height.
    pub fn depth_stretch(&self) -> (u32, u32) {
        let ratio = self.depth_scale / self.scale;
        ((ratio * 4096.0).round() as u32, 4096)
    }

    /// The image of the model's origin in a parallel view.
    pub fn image_of_origin(&self) -> [f64; 2] {
        self.origin
    }

    /// The image of a point along an edge, on the image plane at distance 1 or in model units.
    pub fn image(&self, (p, q): (Vertex, Vertex), along: EdgeParameter) -> [f64; 2] {
        let s = along.numerator as f64 / along.denominator as f64;
        let part = |a: i32, b: i32| f64::from(a) + s * (f64::from(b) - f64::from(a));
        let depth = match self.projection {
            Projection::Perspective => part(p.z, q.z) / self.depth_scale,
            Projection::Parallel => 1.0,
        };
        [part(p.x, q.x), part(p.y, q.y)].map(|at| at / self.scale / depth)
    }
}

/// A sink that records all stretches.
#[derive(Debug, Clone, Default)]
pub struct Stretches(pub Vec<Stretch>);

impl StretchSink for Stretches {
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull> {
        self.0.push(stretch);
        Ok(())
    }
}
