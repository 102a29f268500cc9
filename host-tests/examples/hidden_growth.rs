//! Times of the search for hidden lines as meshes grow, with the numbers of a computer:
//! `hidden_growth [KIND FACES [seams] [all-cores]]`, KIND being `icosphere` or `terrain`, or
//! `hidden_growth FILE.obj [seams] [all-cores]`. Without arguments, both kinds from 5,000 to 1.3
//! million faces, without and with seams, each on one core and on all.
//!
//! `valgrind --tool=callgrind --toggle-collect='*find_stretches*'` counts the instructions of one.

#![allow(clippy::expect_used, clippy::panic, reason = "a wrong argument ends the program")]
use penup::geometry::Projection;
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch, SinkFull};
use penup::visibility::{
    Options, Scene, Stretch, StretchSink, Unrounded, find_stretches, scratch_bytes, threads,
};
use penup_host_tests::meshes::{Mesh, icosphere, terrain};
use penup_host_tests::scene_files::{Model, ObjElement, ObjText, View};
use std::time::Instant;

/// Counts the stretches.
struct Count(usize);

impl StretchSink<u32> for Count {
    fn stretch(&mut self, _: Stretch<u32>) -> Result<(), SinkFull> {
        self.0 += 1;
        Ok(())
    }
}

fn make(kind: &str, faces: usize) -> Mesh {
    match kind {
        "icosphere" => icosphere(faces),
        "terrain" => terrain(faces),
        _ => panic!("icosphere or terrain, not {kind}"),
    }
}

/// Reads an OBJ file, and moves and scales it so that it fits the view of the other meshes.
fn read(file: &str) -> Mesh {
    let text = ObjText::read(&std::fs::read_to_string(file).expect("an OBJ file"));
    let parts = |axis: usize| text.vertices.iter().map(move |vertex| vertex[axis]);
    let low = [0, 1, 2].map(|axis| parts(axis).fold(f64::INFINITY, f64::min));
    let high = [0, 1, 2].map(|axis| parts(axis).fold(f64::NEG_INFINITY, f64::max));
    let largest = [0, 1, 2].map(|axis| high[axis] - low[axis]).into_iter().fold(0.0, f64::max);
    let fit = |vertex: &[f64; 3]| {
        [0, 1, 2].map(|axis| (2.0 * vertex[axis] - low[axis] - high[axis]) / largest)
    };
    let numbers = |element: &ObjElement| element.vertices.iter().map(|&n| n as u32).collect();
    Mesh {
        vertices: text.vertices.iter().map(fit).collect(),
        faces: text.elements.iter().filter(|element| element.is_face).map(numbers).collect(),
    }
}

fn run(kind: &str, mesh: Mesh, with_seams: bool, on_all_cores: bool) {
    let Mesh { vertices, faces: triangles } = mesh;
    let model = Model { vertices, corners: Vec::new() };
    let (eye, at, up) = ([2.3, -3.1, 1.9], [0.0; 3], [0.0, 0.0, 1.0]);
    let view = View::new(&model, eye, at, up, Projection::Perspective);
    let corners_of = |face: &Vec<u32>| -> Vec<_> {
        let corner = |(n, &vertex)| Corner::<u32>::new(vertex, false, n + 1 == face.len());
        face.iter().enumerate().map(corner).collect()
    };
    let corners: Vec<_> = triangles.iter().flat_map(corners_of).collect();
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
    if let [kind, rest @ ..] = &arguments[..] {
        let has = |option: &str| rest.iter().any(|given| given == option);
        let mesh = if kind.ends_with(".obj") {
            read(kind)
        } else {
            let faces = rest.first().and_then(|faces| faces.parse().ok());
            make(kind, faces.expect("a number of faces"))
        };
        run(kind, mesh, has("seams"), has("all-cores"));
        return;
    }
    for kind in ["icosphere", "terrain"] {
        for faces in [5_000, 20_000, 80_000, 320_000, 1_300_000] {
            for with_seams in [false, true] {
                let mesh = make(kind, faces);
                run(kind, mesh.clone(), with_seams, false);
                run(kind, mesh, with_seams, true);
            }
        }
    }
}
