//! Times of the search for hidden lines as meshes grow, with the numbers of a computer:
//! `hidden_growth [KIND FACES [seams]]`, KIND being `icosphere` or `terrain`. Without arguments,
//! both kinds from 5,000 to 1.3 million faces, without and with seams, each on one core and on all.
//!
//! `valgrind --tool=callgrind --toggle-collect='*find_stretches*'` counts the instructions of one.

#![allow(clippy::expect_used, clippy::panic, reason = "a wrong argument ends the program")]
use penup::geometry::Projection;
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch, SinkFull};
use penup::visibility::{
    Options, Scene, Stretch, StretchSink, Unrounded, find_stretches, scratch_bytes, threads,
};
use penup_host_tests::scene_files::{Model, Vector, View};
use std::collections::HashMap;
use std::time::Instant;

/// Triangles between vertices.
struct Mesh {
    vertices: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
}

/// Divides each side of an icosahedron by two until there are at least so many faces.
fn icosphere(faces: usize) -> Mesh {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for [one, long] in [[1.0, golden], [1.0, -golden], [-1.0, golden], [-1.0, -golden]] {
        vertices.extend([[0.0, one, long], [one, long, 0.0], [long, 0.0, one]]);
    }
    let distance = |a: Vector, b: Vector| -> f64 {
        (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>()
    };
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let near = |p: usize, q: usize| distance(vertices[p], vertices[q]) < 4.1;
                if near(a, b) && near(b, c) && near(c, a) {
                    triangles.push([a, b, c].map(|vertex| vertex as u32));
                }
            }
        }
    }
    let unit = |at: Vector| at.map(|part| part / distance(at, [0.0; 3]).sqrt());
    vertices.iter_mut().for_each(|vertex| *vertex = unit(*vertex));
    while triangles.len() < faces {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [a, b] = [a, b].map(|vertex| vertices[vertex as usize]);
                vertices.push(unit([a[0] + b[0], a[1] + b[1], a[2] + b[2]]));
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Mesh { vertices, triangles }
}

/// Hills over a square, of about so many triangles.
fn terrain(faces: usize) -> Mesh {
    let side = (faces as f64 / 2.0).sqrt().round() as u32;
    let mut vertices = Vec::new();
    for row in 0..=side {
        for column in 0..=side {
            let [x, y] = [column, row].map(|at| f64::from(at) / f64::from(side) * 2.0 - 1.0);
            let z = 0.15 * (7.0 * x).sin() * (5.0 * y).cos() + 0.05 * (23.0 * x + 17.0 * y).sin();
            vertices.push([x, y, z]);
        }
    }
    let mut triangles = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let at = row * (side + 1) + column;
            triangles.push([at, at + 1, at + side + 2]);
            triangles.push([at, at + side + 2, at + side + 1]);
        }
    }
    Mesh { vertices, triangles }
}

/// Counts the stretches.
struct Count(usize);

impl StretchSink<u32> for Count {
    fn stretch(&mut self, _: Stretch<u32>) -> Result<(), SinkFull> {
        self.0 += 1;
        Ok(())
    }
}

fn run(kind: &str, faces: usize, with_seams: bool, on_all_cores: bool) {
    let make = match kind {
        "icosphere" => icosphere,
        "terrain" => terrain,
        _ => panic!("icosphere or terrain, not {kind}"),
    };
    let Mesh { vertices, triangles } = make(faces);
    let model = Model { vertices, corners: Vec::new() };
    let (eye, at, up) = ([2.3, -3.1, 1.9], [0.0; 3], [0.0, 0.0, 1.0]);
    let view = View::new(&model, eye, at, up, Projection::Perspective);
    let corner = |(number, &vertex): (usize, &u32)| Corner::<u32>::new(vertex, false, number == 2);
    let corners: Vec<_> = triangles.iter().flat_map(|t| t.iter().enumerate().map(corner)).collect();
    let scene = Scene {
        vertices: &view.vertices,
        elements: Elements::new(&corners),
        projection: view.projection,
        unrounded: Unrounded::UNKNOWN,
    };
    let mut words = vec![0u64; scratch_bytes(&scene) / 8 + 16 * triangles.len()];
    let options = Options { with_seams, ..Options::default() };
    let mut count = Count(0);
    let start = Instant::now();
    let scratch = Scratch::new(&mut words);
    let find = if on_all_cores { threads::find_stretches } else { find_stretches };
    find(&scene, options, scratch, &mut NeverCancel, &mut count).expect("stretches");
    let (seconds, faces) = (start.elapsed().as_secs_f64(), triangles.len());
    let seams = if with_seams { ", with seams" } else { "" };
    let cores = if on_all_cores { ", on all cores" } else { "" };
    println!("{kind}, {faces} faces{seams}{cores}: {seconds:.3} s, {} stretches", count.0);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [kind, faces, rest @ ..] = &arguments[..] {
        run(kind, faces.parse().expect("a number of faces"), !rest.is_empty(), false);
        return;
    }
    for kind in ["icosphere", "terrain"] {
        for faces in [5_000, 20_000, 80_000, 320_000, 1_300_000] {
            for with_seams in [false, true] {
                run(kind, faces, with_seams, false);
                run(kind, faces, with_seams, true);
            }
        }
    }
}
