//! Tests the visible length of the example scenes against the results of an independent program.

use penup::model::Elements;
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{Options, Scene, Unrounded, find_stretches, scratch_bytes};
use penup_host_tests::scene_files::{Model, Stretches, View};

const TOTALS: [(&str, f64); 11] = [
    ("cube", 1.229612154),
    ("lblock", 2.332131383),
    ("notched", 3.378278153),
    ("lattice1", 0.933699504),
    ("lattice2", 3.386566447),
    ("lattice3", 6.449120968),
    ("lattice4", 9.690106152),
    ("lattice5", 13.113438728),
    ("lattice6", 16.541376850),
    ("lattice7", 20.054260790),
    ("interpen", 2.380382132),
];

#[test]
fn the_least_memory_is_what_the_documentation_says() -> std::io::Result<()> {
    for (name, bytes) in [("lattice5", 9176), ("lattice7", 24_992)] {
        let model = Model::example(name)?;
        let view = View::example(name, &model)?;
        let scene = Scene {
            vertices: &view.vertices,
            elements: Elements::new(&model.corners),
            projection: view.projection,
            unrounded: Unrounded::UNKNOWN,
        };
        assert_eq!(scratch_bytes(&scene), bytes, "{name}");
    }
    Ok(())
}

fn visible_length(name: &str, spare_bytes: usize) -> std::io::Result<f64> {
    let model = Model::example(name)?;
    let view = View::example(name, &model)?;
    let scene = Scene {
        vertices: &view.vertices,
        elements: Elements::new(&model.corners),
        projection: view.projection,
        unrounded: Unrounded::UNKNOWN,
    };
    let mut words = vec![0u64; (scratch_bytes(&scene) + spare_bytes) / 8];
    let mut stretches = Stretches::default();
    let result = find_stretches(
        &scene,
        Options::default(),
        Scratch::new(&mut words),
        &mut NeverCancel,
        &mut stretches,
    );
    assert!(result.is_ok(), "{result:?}");
    Ok(stretches
        .0
        .iter()
        .map(|stretch| {
            let [from, to] = [stretch.from, stretch.to].map(|at| view.image(stretch.ends, at));
            (from[0] - to[0]).hypot(from[1] - to[1])
        })
        .sum())
}

#[test]
fn the_visible_length_is_that_of_the_reference() -> std::io::Result<()> {
    for (name, total) in TOTALS {
        let length = visible_length(name, 1 << 17)?;
        assert!((length / total - 1.0).abs() < 1e-5, "{name}: {length} instead of {total}");
    }
    Ok(())
}

#[test]
fn the_least_memory_gives_the_same_picture() -> std::io::Result<()> {
    for name in ["notched", "lattice3", "interpen", "lattice5"] {
        assert_eq!(visible_length(name, 0)?, visible_length(name, 1 << 17)?);
    }
    Ok(())
}
