//! Random scenes with small whole coordinates, so that degenerate cases are common.
//!
//! Every face is plane and does not intersect itself. The same seed gives the same scene.

use crate::random::Random;
use penup::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use penup::model::Corner;

/// A point or vector in space.
pub type Triple = [i32; 3];

fn plus(a: Triple, b: Triple) -> Triple {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn times(a: Triple, by: i32) -> Triple {
    a.map(|part| part * by)
}

/// A scene in view coordinates.
#[derive(Debug, Clone)]
pub struct RandomScene {
    /// The vertices, within the coordinate range of the library.
    pub vertices: Vec<Vertex>,
    /// The corners of all faces and bars.
    pub corners: Vec<Corner>,
    /// The kind of projection.
    pub projection: Projection,
}

/// Simple polygons in the plane, convex and concave.
const SHAPES: [&[[i32; 2]]; 8] = [
    &[[0, 0], [2, 0], [2, 2], [0, 2]],
    &[[0, 0], [2, 0], [0, 2]],
    &[[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]],
    &[[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]],
    &[[0, 0], [2, 0], [4, 0], [4, 2], [2, 2], [0, 2]],
    &[[0, 0], [2, 1], [4, 0], [3, 2], [4, 4], [2, 3], [0, 4], [1, 2]],
    &[[0, 1], [1, 0], [2, 0], [3, 1], [3, 2], [2, 3], [1, 3], [0, 2]],
    &[[0, 0], [4, 0], [4, 1], [1, 1], [1, 2], [4, 2], [4, 3], [0, 3]],
];

#[derive(Debug, Default)]
struct Builder {
    points: Vec<Triple>,
    elements: Vec<Vec<usize>>,
}

impl Builder {
    fn add(&mut self, random: &mut Random, points: &[Triple], faces: &[Vec<usize>]) {
        let first = self.points.len();
        self.points.extend_from_slice(points);
        for face in faces {
            let mut face: Vec<usize> = face.iter().map(|n| first + n).collect();
            if random.once_in(8) {
                face.reverse();
            }
            let turn = random.between(0, face.len() as i32 - 1) as usize;
            face.rotate_left(turn);
            self.elements.push(face);
        }
    }

    /// Adds a prism over one of the shapes, whose base lies in the plane of two directions and
    /// which extends along a third.
    fn add_prism(
        &mut self,
        random: &mut Random,
        base: Triple,
        steps: [Triple; 3],
        shape: &[[i32; 2]],
    ) {
        let count = shape.len();
        let bottom =
            shape.iter().map(|at| plus(base, plus(times(steps[0], at[0]), times(steps[1], at[1]))));
        let mut points: Vec<Triple> = bottom.collect();
        for n in 0..count {
            points.push(plus(points[n], steps[2]));
        }
        let mut faces: Vec<Vec<usize>> = (0..count)
            .map(|n| vec![n, (n + 1) % count, (n + 1) % count + count, n + count])
            .collect();
        faces.push((0..count).rev().collect());
        faces.push((count..2 * count).collect());
        // Sometimes a face is missing, so that the prism is open.
        if random.once_in(5) {
            let missing = random.between(0, faces.len() as i32 - 1) as usize;
            faces.remove(missing);
        }
        self.add(random, &points, &faces);
    }

    fn add_box(&mut self, random: &mut Random, base: Triple, size: Triple) {
        let steps = [[size[0], 0, 0], [0, size[1], 0], [0, 0, size[2]]];
        self.add_prism(random, base, steps, &[[0, 0], [1, 0], [1, 1], [0, 1]]);
    }

    fn add_face(&mut self, random: &mut Random, points: &[Triple]) {
        self.add(random, points, &[(0..points.len()).collect()]);
    }

    fn add_bar(&mut self, a: Triple, b: Triple) {
        if a != b {
            let first = self.points.len();
            self.points.extend_from_slice(&[a, b]);
            self.elements.push(vec![first, first + 1]);
        }
    }

    /// Merges equal points into one vertex.
    fn weld(&mut self) {
        let points = self.points.clone();
        let first = |n: usize| points.iter().position(|point| *point == points[n]).unwrap_or(n);
        for element in &mut self.elements {
            for number in element.iter_mut() {
                *number = first(*number);
            }
        }
    }
}

fn triple(random: &mut Random, reach: i32) -> Triple {
    [0; 3].map(|_| random.between(-reach, reach))
}

fn step(random: &mut Random, reach: i32) -> Triple {
    loop {
        let step = triple(random, reach);
        if step != [0; 3] {
            return step;
        }
    }
}

/// Three independent directions: parallel to the axes, perpendicular to each other, or oblique.
fn frame(random: &mut Random) -> [Triple; 3] {
    random.one_of(&[
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 1, 0], [-1, 1, 0], [0, 0, 1]],
        [[1, 0, 1], [0, 1, 0], [-1, 0, 1]],
        [[1, 2, 2], [2, 1, -2], [2, -2, 1]],
        [[1, 1, 1], [1, -1, 0], [1, 1, -2]],
        [[1, 0, 1], [0, 1, 1], [1, 1, 0]],
        [[2, 1, 0], [0, 1, 1], [1, 0, 3]],
    ])
}

/// Generates the scene of a seed.
pub fn random_scene(seed: u64) -> RandomScene {
    let mut random = Random::new(seed);
    let random = &mut random;
    let mut builder = Builder::default();
    match seed % 10 {
        // Boxes at random positions, which may pass through each other.
        0 => {
            for _ in 0..random.between(1, 3) {
                let base = triple(random, 4);
                let size = [0; 3].map(|_| random.between(1, 4));
                builder.add_box(random, base, size);
            }
        }
        // Triangles and quadrilaterals at random positions.
        1 => {
            for _ in 0..random.between(2, 8) {
                let (a, b, c) = (triple(random, 4), step(random, 4), step(random, 4));
                let mut face = vec![a, plus(a, b), plus(plus(a, b), c)];
                if random.once_in(2) {
                    face.push(plus(a, c));
                }
                builder.add_face(random, &face);
            }
        }
        // A lattice of cubes, parallel to the axes or oblique.
        2 => {
            let frame = frame(random);
            let counts = [random.between(1, 2), random.between(1, 2), random.between(1, 3)];
            let base = triple(random, 2);
            let gap = random.between(1, 3);
            for n in 0..counts[0] * counts[1] * counts[2] {
                let position =
                    [n % counts[0], n / counts[0] % counts[1], n / counts[0] / counts[1]];
                let at = (0..3)
                    .fold(base, |at, axis| plus(at, times(frame[axis], position[axis] * gap)));
                builder.add_prism(random, at, frame, &[[0, 0], [1, 0], [1, 1], [0, 1]]);
            }
        }
        // Building blocks that share faces, edges and corners.
        3 => {
            for _ in 0..random.between(2, 4) {
                let base = [0; 3].map(|_| random.between(-1, 1) * 2);
                let size = [0; 3].map(|_| random.between(1, 2) * 2);
                builder.add_box(random, base, size);
            }
        }
        // Prisms over convex and concave shapes.
        4 | 5 => {
            for _ in 0..random.between(1, 2) {
                let (base, frame) = (triple(random, 3), frame(random));
                let shape = random.one_of(&SHAPES);
                builder.add_prism(random, base, frame, shape);
            }
        }
        // Walls one behind the other, many of which are seen edge-on.
        6 => {
            for _ in 0..random.between(2, 6) {
                let base = triple(random, 2);
                let frame = frame(random);
                let (a, b) =
                    (times(frame[0], random.between(1, 3)), times(frame[1], random.between(1, 3)));
                builder.add_face(
                    random,
                    &[base, plus(base, a), plus(plus(base, a), b), plus(base, b)],
                );
            }
        }
        // Pyramids over shapes.
        7 => {
            for _ in 0..random.between(1, 3) {
                let (base, frame) = (triple(random, 3), frame(random));
                let shape = random.one_of(&SHAPES[..2]);
                let mut points: Vec<Triple> = shape
                    .iter()
                    .map(|at| plus(base, plus(times(frame[0], at[0]), times(frame[1], at[1]))))
                    .collect();
                points.push(plus(base, plus(frame[2], triple(random, 2))));
                let count = shape.len();
                let mut faces: Vec<Vec<usize>> =
                    (0..count).map(|n| vec![n, (n + 1) % count, count]).collect();
                faces.push((0..count).collect());
                builder.add(random, &points, &faces);
            }
        }
        // Flat shapes in one plane or in parallel planes, one on top of the other.
        8 => {
            let frame = frame(random);
            for _ in 0..random.between(2, 4) {
                let shape = random.one_of(&SHAPES);
                let base = plus(
                    times(frame[2], random.between(0, 1)),
                    plus(
                        times(frame[0], random.between(-2, 2)),
                        times(frame[1], random.between(-2, 2)),
                    ),
                );
                let face: Vec<Triple> = shape
                    .iter()
                    .map(|at| plus(base, plus(times(frame[0], at[0]), times(frame[1], at[1]))))
                    .collect();
                builder.add_face(random, &face);
            }
        }
        // A mixture of everything.
        _ => {
            let size = [0; 3].map(|_| random.between(1, 3));
            builder.add_box(random, [0, 0, 0], size);
            let (base, frame) = (triple(random, 2), frame(random));
            builder.add_prism(random, base, frame, SHAPES[1]);
            for _ in 0..3 {
                let (a, b, c) = (triple(random, 3), step(random, 3), step(random, 3));
                builder.add_face(random, &[a, plus(a, b), plus(a, c)]);
            }
        }
    }
    for _ in 0..random.between(0, 3) {
        let (a, b) = (triple(random, 5), triple(random, 5));
        builder.add_bar(a, b);
    }
    if random.once_in(2) {
        builder.weld();
    }
    finish(random, &builder)
}

/// Places the scene in front of the eye, and scales it to the full coordinate range or leaves it
/// small.
fn finish(random: &mut Random, builder: &Builder) -> RandomScene {
    let projection = random.one_of(&[Projection::Perspective, Projection::Parallel]);
    let nearest = builder.points.iter().map(|point| point[2]).min().unwrap_or(0);
    let back = match projection {
        Projection::Perspective => random.between(1, 6) - nearest,
        Projection::Parallel => random.between(-4, 4),
    };
    let moved: Vec<Triple> =
        builder.points.iter().map(|point| plus(*point, [0, 0, back])).collect();
    let largest = moved.iter().flatten().map(|part| part.abs()).max().unwrap_or(1).max(1);
    let most = COORDINATE_LIMIT / largest;
    let scales = [random.one_of(&[1, most, most / 3]), random.one_of(&[1, most, most / 2 + 1])];
    let vertices = moved
        .iter()
        .map(|point| Vertex::new(point[0] * scales[0], point[1] * scales[0], point[2] * scales[1]))
        .collect();
    let mut corners = Vec::new();
    for element in &builder.elements {
        for (n, &vertex) in element.iter().enumerate() {
            let last = n + 1 == element.len();
            corners.push(Corner::new(vertex as u16, element.len() == 2, last));
        }
    }
    RandomScene { vertices, corners, projection }
}
