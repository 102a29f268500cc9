//! Random scenes, seen through a real camera from a generic eye point: houses with windows, boxes
//! that overlap, boxes that touch.
//!
//! Each scene is made on a grid of whole numbers, on which coplanarity is decided exactly. It is
//! then written as a file would be: as whole numbers, with one or two decimals, or rotated in space
//! by a rational rotation and rounded to four or more decimals. The library reads these texts, so
//! it sees rounded numbers such as any modeller writes.

use crate::random::Random;
use penup::fixed::Decimal;
use penup::geometry::{Precision, Projection, Vertex};
use penup::model::{Corner, Model, Position, no_undo};
use penup::stage::{NeverCancel, Scratch};
use penup::view::{Camera, Lens, Pose, View, project_scene};

/// A point of the grid.
pub type GridPoint = [i32; 3];

/// The number of kinds of scenes; the seed modulo this number chooses one.
pub const KINDS: u64 = 5;

/// A scene on the grid and in view coordinates.
#[derive(Debug, Clone)]
pub struct CameraScene {
    /// The exact position of each vertex on the grid, before any rounding.
    pub grid: Vec<GridPoint>,
    /// The coordinates of the `v` lines as a file contains them.
    pub texts: Vec<[String; 3]>,
    /// The corners of each face, as indices of vertices from 0.
    pub faces: Vec<Vec<usize>>,
    /// The vertices in view coordinates.
    pub vertices: Vec<Vertex>,
    /// The corners of the faces after the library welded the vertices.
    pub corners: Vec<Corner>,
    /// The vertices in the model's unit.
    pub positions: Vec<[i32; 3]>,
    /// The error bound of these positions.
    pub precision: Precision,
    /// Twice the error bound of a view coordinate.
    pub view_error: u32,
    /// The kind of projection.
    pub projection: Projection,
}

/// Collects faces between points of the grid.
#[derive(Debug, Default)]
struct Builder {
    grid: Vec<GridPoint>,
    faces: Vec<Vec<usize>>,
}

impl Builder {
    fn add_face(&mut self, points: &[GridPoint]) {
        let first = self.grid.len();
        self.grid.extend_from_slice(points);
        self.faces.push((first..self.grid.len()).collect());
    }

    fn add_box(&mut self, low: GridPoint, high: GridPoint) {
        let first = self.grid.len();
        for n in 0..8 {
            let at = |axis: usize| if n >> axis & 1 == 0 { low[axis] } else { high[axis] };
            self.grid.push([at(0), at(1), at(2)]);
        }
        for face in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            self.faces.push(face.iter().map(|n| first + n).collect());
        }
    }

    /// Adds a rectangle with sides along `u` and `v` in the plane through `origin`. `from` and `to`
    /// are its corners as fractions of these vectors.
    fn add_window(
        &mut self,
        origin: GridPoint,
        u: GridPoint,
        v: GridPoint,
        from: [i32; 2],
        to: [i32; 2],
    ) {
        let at =
            |i: i32, j: i32| [0, 1, 2].map(|axis: usize| origin[axis] + u[axis] * i + v[axis] * j);
        let corners =
            [at(from[0], from[1]), at(to[0], from[1]), at(to[0], to[1]), at(from[0], to[1])];
        self.add_face(&corners);
    }
}

/// Two different numbers from 0 to `most` in increasing order.
fn span(random: &mut Random, most: i32) -> [i32; 2] {
    let from = random.between(0, most - 1);
    [from, random.between(from + 1, most)]
}

/// Adds a house with a gabled roof, and windows as faces in its walls and in its roof.
fn house(random: &mut Random, builder: &mut Builder) {
    let (length, width, height, rise) = (
        16 * random.between(3, 9),
        16 * random.between(2, 6),
        16 * random.between(2, 5),
        8 * random.between(1, 8),
    );
    let (half, top) = (width / 2, height + rise);
    builder.add_face(&[[0, 0, 0], [0, width, 0], [length, width, 0], [length, 0, 0]]);
    builder.add_face(&[[0, 0, 0], [length, 0, 0], [length, 0, height], [0, 0, height]]);
    builder.add_face(&[
        [length, width, 0],
        [0, width, 0],
        [0, width, height],
        [length, width, height],
    ]);
    for x in [0, length] {
        builder.add_face(&[
            [x, 0, 0],
            [x, width, 0],
            [x, width, height],
            [x, half, top],
            [x, 0, height],
        ]);
    }
    builder.add_face(&[[0, 0, height], [length, 0, height], [length, half, top], [0, half, top]]);
    builder.add_face(&[
        [length, width, height],
        [0, width, height],
        [0, half, top],
        [length, half, top],
    ]);
    let (long, wide, tall) = (length / 8, width / 8, height / 8);
    for _ in 0..random.between(2, 6) {
        let (i, j) = (span(random, 8), span(random, 8));
        let (origin, u, v) = match random.between(0, 5) {
            0 => ([0, 0, 0], [long, 0, 0], [0, 0, tall]),
            1 => ([0, width, 0], [long, 0, 0], [0, 0, tall]),
            2 => ([0, 0, 0], [0, wide, 0], [0, 0, tall]),
            3 => ([length, 0, 0], [0, wide, 0], [0, 0, tall]),
            4 => ([0, 0, height], [long, 0, 0], [0, half / 8, rise / 8]),
            _ => ([0, width, height], [long, 0, 0], [0, -half / 8, rise / 8]),
        };
        builder.add_window(origin, u, v, [i[0], j[0]], [i[1], j[1]]);
    }
    // Some houses have a chimney that passes through the roof, or a porch against the wall.
    match random.between(0, 3) {
        0 => {
            let (x, y) = (random.between(1, length - 9), random.between(1, width - 9));
            builder.add_box([x, y, height - 5], [x + 8, y + 8, top + 7]);
        }
        1 => {
            let [from, to] = span(random, 8);
            builder.add_box([from * long, -20, 0], [to * long, 0, random.between(2, 8) * tall]);
        }
        _ => {}
    }
}

fn fill(random: &mut Random, builder: &mut Builder, kind: u64) {
    match kind {
        0 => house(random, builder),
        // Boxes of equal height that overlap.
        1 => {
            let height = 4 * random.between(2, 20);
            let mut low = [0, 0];
            for _ in 0..random.between(2, 3) {
                let size = [4 * random.between(5, 20), 4 * random.between(5, 20)];
                builder.add_box([low[0], low[1], 0], [low[0] + size[0], low[1] + size[1], height]);
                low = [0, 1].map(|n: usize| low[n] + random.between(1, size[n] - 1));
            }
        }
        // Boxes of unequal sizes that stand on each other.
        2 => {
            let (mut low, mut size) = ([0, 0], [0; 2].map(|_| 4 * random.between(10, 30)));
            let mut floor = 0;
            for _ in 0..random.between(2, 4) {
                let top = floor + 4 * random.between(2, 15);
                builder.add_box([low[0], low[1], floor], [low[0] + size[0], low[1] + size[1], top]);
                floor = top;
                for n in 0..2 {
                    // Often flush with one side of the box below.
                    let shift = if random.once_in(2) { 0 } else { random.between(-8, 8) };
                    low[n] += shift;
                    size[n] = random.between(8, size[n].max(9));
                }
            }
        }
        // Boxes of unequal sizes side by side, flush in front or at the foot.
        3 => {
            let mut x = 0;
            for _ in 0..random.between(2, 4) {
                let size = [0; 3].map(|_| 2 * random.between(4, 30));
                let (y, z) = match random.between(0, 3) {
                    0 => (0, 0),
                    1 => (0, random.between(-6, 6)),
                    2 => (random.between(-6, 6), 0),
                    _ => (random.between(-6, 6), random.between(-6, 6)),
                };
                builder.add_box([x, y, z], [x + size[0], y + size[1], z + size[2]]);
                x += size[0];
            }
        }
        // Boxes that overlap, with some faces in one plane.
        _ => {
            for _ in 0..random.between(2, 3) {
                let mut low = [0; 3].map(|_| random.between(0, 30));
                let mut high = low.map(|low| low + 4 * random.between(4, 12));
                for n in 0..3 {
                    if random.once_in(3) {
                        low[n] = 0;
                    } else if random.once_in(3) {
                        high[n] = 60;
                    }
                }
                builder.add_box(low, high);
            }
        }
    }
}

/// Writes the quotient of two whole numbers with this number of decimals.
fn text(numerator: i64, denominator: i64, decimals: u32) -> String {
    let power = 10i64.pow(decimals);
    let scaled = (2 * numerator.abs() * power + denominator) / (2 * denominator);
    let sign = if numerator < 0 && scaled != 0 { "-" } else { "" };
    if decimals == 0 {
        return format!("{sign}{scaled}");
    }
    let width = decimals as usize;
    let text = format!("{sign}{}.{:0width$}", scaled / power, scaled % power);
    // Some modellers omit trailing zeros and others do not; the result must be the same.
    if scaled % 3 == 0 { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A random rational rotation: the rows times their common divisor, and the divisor (Euler,
/// Rodrigues).
fn rotation(random: &mut Random) -> ([[i64; 3]; 3], i64) {
    let [a, b, c, d] = [0; 4].map(|_| i64::from(random.between(-9, 9)));
    let norm = a * a + b * b + c * c + d * d;
    if norm == 0 {
        return ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 1);
    }
    let rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ];
    (rows, norm)
}

/// Writes the coordinates of the `v` lines.
fn write(random: &mut Random, grid: &[GridPoint]) -> Vec<[String; 3]> {
    let upright = ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], 1);
    let (divisor, decimals, (rows, norm)) = match random.between(0, 5) {
        0 => (1, 0, upright),
        1 => (10, 1, upright),
        2 => (100, 2, upright),
        // Sixteen units of the grid are one unit of the model.
        3 => (16, random.between(4, 7) as u32, rotation(random)),
        _ => (16, 6, rotation(random)),
    };
    grid.iter()
        .map(|point| {
            rows.map(|row| {
                let sum = (0..3).map(|n| row[n] * i64::from(point[n])).sum();
                text(sum, divisor * norm, decimals)
            })
        })
        .collect()
}

/// A random direction of approximately length 1, which is never parallel to an axis.
fn direction(random: &mut Random) -> [f64; 3] {
    loop {
        let at = [0; 3].map(|_| f64::from(random.between(-99_991, 99_991)) / 100_003.0);
        let length = at.iter().map(|part| part * part).sum::<f64>().sqrt();
        if (0.2..1.0).contains(&length) {
            return at.map(|part| part / length);
        }
    }
}

/// Generates the scene of a seed and lets the library read and project it.
///
/// # Panics
/// Panics if the library refuses the scene.
pub fn camera_scene(seed: u64) -> CameraScene {
    let mut random = Random::new(seed ^ 0x0CA3_E2A5);
    let random = &mut random;
    let mut builder = Builder::default();
    fill(random, &mut builder, seed % KINDS);
    let texts = write(random, &builder.grid);
    let (mut vertices, mut corners) = ([Position::ORIGIN; 200], [<Corner>::ZERO; 400]);
    let mut model = Model::new(&mut vertices, &mut corners);
    for point in &texts {
        let point = [0, 1, 2]
            .map(|n: usize| Decimal::parse(&point[n]).expect("it was written as a number"));
        model.add_vertex(point, &mut no_undo).expect("there is room");
    }
    for face in &builder.faces {
        let numbers = face.iter().map(|number| *number as i32 + 1);
        model.add_face(numbers, &mut no_undo).expect("there is room");
    }
    let unit = (-f64::from(model.fraction_bits())).exp2();
    let (low, high) = model.bounds().expect("there are vertices");
    let (low, high) = (low.coordinates(), high.coordinates());
    let middle = [0, 1, 2].map(|n: usize| f64::from(low[n] / 2 + high[n] / 2) * unit);
    let size = (0..3).map(|n| f64::from(high[n] - low[n]) * unit).fold(0.0, f64::max);
    let distance = size * f64::from(random.between(150, 500)) / 100.0;
    let towards = direction(random);
    let eye = [0, 1, 2].map(|n: usize| middle[n] + distance * towards[n]);
    let lens = if random.once_in(3) { Lens::Orthographic } else { Lens::Perspective };
    let camera = Camera { pose: Pose::Towards { eye, at: middle, up: None }, lens };
    let view = View::new(&camera, &model).expect("the eye is outside");
    let mut words = vec![0; 4096];
    let mut scratch = Scratch::new(&mut words);
    let seen =
        project_scene(&view, &model, None, &mut scratch, &mut NeverCancel).expect("there is room");
    assert!(!seen.is_cut && seen.degenerate_faces == 0, "nothing is behind the eye, or flat");
    let precision = model.precision();
    CameraScene {
        grid: builder.grid,
        texts,
        faces: builder.faces,
        vertices: seen.vertices.to_vec(),
        corners: seen.elements.corners().to_vec(),
        positions: model.vertices().iter().map(|position| position.coordinates()).collect(),
        precision,
        view_error: view.error_bound(precision.written),
        projection: view.projection(),
    }
}
