//! Finds the hidden lines of an OBJ file tile by tile, in as many bytes of memory as are given, and
//! prints what that costs, and whether the stretches are those of one search of the whole model:
//!
//!     cargo run --release -p penup-host-tests --example tile_counts -- FILE BYTES…
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "an example fails by panicking")]

use std::cell::Cell;
use std::time::Instant;

use penup::fixed::Decimal;
use penup::geometry::Vertex;
use penup::index::Index;
use penup::model::{Corner, Model, Position, no_undo};
use penup::stage::{NeverCancel, Scratch};
use penup::tiles::{ModelSource, Projected, Tiles};
use penup::view::{Camera, Lens, View, project_scene};
use penup::visibility::{
    EdgeParameter, Options, Scene, SinkFull, Stretch, StretchSink, Unrounded, find_stretches,
    scratch_bytes,
};

/// Collects stretches in a form that can be sorted.
#[derive(Default)]
struct Found(Vec<([u32; 2], [EdgeParameter; 2], bool, u8)>);

impl<I: Index> StretchSink<I> for Found {
    fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull> {
        let Stretch { edge, from, to, visible, pen, .. } = stretch;
        let edge = edge.map_or([u32::MAX; 2], |(a, b)| [a.into(), b.into()]);
        self.0.push((edge, [from, to], visible, pen));
        Ok(())
    }
}

/// A model whose reading is counted.
struct Counted<'m> {
    model: Projected<'m, u32>,
    corners: Cell<u64>,
    vertices: Cell<u64>,
}

impl ModelSource for Counted<'_> {
    fn corner_count(&self) -> usize {
        self.model.corner_count()
    }
    fn corner(&self, index: usize) -> Corner<u32> {
        self.corners.set(self.corners.get() + 1);
        self.model.corner(index)
    }
    fn pen(&self, corner: usize) -> u8 {
        self.model.pen(corner)
    }
    fn position(&self, vertex: u32) -> Option<Position> {
        self.model.position(vertex)
    }
    fn vertex(&self, vertex: u32) -> Vertex {
        self.vertices.set(self.vertices.get() + 1);
        self.model.vertex(vertex)
    }
}

/// Reads the vertices and faces of an OBJ file.
fn read(text: &str, model: &mut Model<'_, u32>) {
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let parts: Vec<Decimal> = words.map(|w| Decimal::parse(w).unwrap()).collect();
                model.add_vertex([parts[0], parts[1], parts[2]], &mut no_undo).unwrap();
            }
            Some("f") => {
                let number = |word: &str| word.split('/').next().unwrap().parse::<i32>().unwrap();
                let numbers: Vec<i32> = words.map(number).collect();
                model.add_face(numbers.into_iter(), &mut no_undo).unwrap();
            }
            _ => {}
        }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let text = std::fs::read_to_string(arguments.next().expect("a file")).unwrap();
    let mut positions = vec![Position::ORIGIN; 1 << 20];
    let mut corners = vec![<Corner<u32>>::ZERO; 1 << 22];
    let mut model = Model::new(&mut positions, &mut corners);
    read(&text, &mut model);
    let camera = Camera::automatic(&model, Lens::Perspective, None, None).unwrap();
    let view = View::new(&camera, &model).unwrap();
    let options = Options::default();
    let mut words = vec![0u64; 1 << 24];
    let mut scratch = Scratch::new(&mut words);
    let seen = project_scene(&view, &model, None, &mut scratch, &mut NeverCancel).unwrap();
    let precision = model.precision();
    let unrounded: Vec<_> = model.vertices().iter().map(|at| at.coordinates()).collect();
    let scene = Scene {
        vertices: seen.vertices,
        elements: seen.elements,
        projection: view.projection(),
        unrounded: Unrounded::new(&unrounded, precision, view.error_bound(precision.written)),
    };
    println!(
        "{} vertices, {} faces; one search needs {} bytes at least",
        model.vertices().len(),
        model.face_count(),
        scratch_bytes(&scene)
    );
    let mut whole = Found::default();
    let begin = Instant::now();
    find_stretches(&scene, options, scratch, &mut NeverCancel, &mut whole).unwrap();
    println!("whole: {} stretches, {:?}", whole.0.len(), begin.elapsed());
    whole.0.sort();
    for bytes in arguments {
        let bytes: usize = bytes.parse().expect("a number of bytes");
        let mut words = vec![0u64; bytes / 8];
        let mut scratch = Scratch::new(&mut words);
        let source = Counted {
            model: Projected::new(&model, &view),
            corners: Cell::default(),
            vertices: Cell::default(),
        };
        let parameters = source.model.parameters(precision);
        let begin = Instant::now();
        let mut found = Found::default();
        let mut tiles = Tiles::new(&source, parameters, options, &mut scratch, &mut NeverCancel)
            .unwrap()
            .expect("something is seen");
        let (mut count, mut most) = (0, 0);
        loop {
            let before = found.0.len();
            match tiles.follow_next::<u32>(scratch.reborrow(), &mut NeverCancel, &mut found) {
                Ok(true) => {}
                Ok(false) => break,
                Err(error) => {
                    println!("{bytes} bytes: {error:?} after {count} tiles");
                    return;
                }
            }
            count += 1;
            most = most.max(found.0.len() - before);
        }
        let time = begin.elapsed();
        found.0.sort();
        let same = if found.0 == whole.0 { "the same" } else { "NOT the same" };
        println!(
            "{bytes} bytes: {count} tiles, {most} stretches at most, {} corners read, {} vertices \
             projected, {time:?}, {same}",
            source.corners.get(),
            source.vertices.get()
        );
    }
}
