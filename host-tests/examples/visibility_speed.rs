//! Times visibility on the lattices and a torus: `visibility_speed [NAME [RUNS [BYTES]]]`.

use penup::model::Elements;
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{Options, Scene, Unrounded, find_stretches, scratch_bytes};
use penup_host_tests::scene_files::{Model, Stretches, View};
use std::time::Instant;

fn main() -> std::io::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let only = arguments.next();
    let mut number = |otherwise: usize| {
        let given = arguments.next().and_then(|word| word.parse().ok());
        given.unwrap_or(otherwise)
    };
    let (runs, bytes) = (number(20), number(1 << 19));
    let lattices = (1..=7).map(|n| format!("lattice{n}"));
    for name in lattices.chain(["torus".to_string()]) {
        if only.as_ref().is_some_and(|only| *only != name) {
            continue;
        }
        let (model, view);
        if name == "torus" {
            model = Model::torus(80, 30);
            let (eye, at, up) = ([6.0, -7.0, 5.0], [0.0; 3], [0.0, 0.0, 1.0]);
            let projection = penup::geometry::Projection::Perspective;
            view = View::new(&model, eye, at, up, projection);
        } else {
            model = Model::example(&name)?;
            view = View::example(&name, &model)?;
        }
        let scene = Scene {
            vertices: &view.vertices,
            elements: Elements::new(&model.corners),
            projection: view.projection,
            unrounded: Unrounded::UNKNOWN,
        };
        let least = scratch_bytes(&scene);
        let mut words = vec![0u64; bytes.max(least) / 8];
        let mut best = f64::INFINITY;
        let mut count = 0;
        for _ in 0..runs {
            let mut stretches = Stretches(Vec::with_capacity(20_000));
            let start = Instant::now();
            let result = find_stretches(
                &scene,
                Options::default(),
                Scratch::new(&mut words),
                &mut NeverCancel,
                &mut stretches,
            );
            best = best.min(start.elapsed().as_secs_f64() * 1e3);
            assert!(result.is_ok(), "{result:?}");
            count = stretches.0.len();
        }
        println!("{name}: {best:.3} ms, {count} stretches, at least {least} bytes");
    }
    Ok(())
}
