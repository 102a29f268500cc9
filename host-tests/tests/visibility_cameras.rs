//! Tests of visibility against the exact picture of random scenes that a real camera sees.
//!
//! The scenes are houses with windows as faces in their walls, boxes of equal height that overlap,
//! and boxes of unequal sizes that stand on each other or side by side. Each is written as whole
//! numbers, as hundredths, or rotated in space with a few decimals. `PENUP_SCENES` sets the number
//! of scenes; the default is 2,000.

#![allow(clippy::panic, clippy::expect_used, reason = "a test fails by panicking")]

use penup::geometry::{Projection, Vertex};
use penup::model::Elements;
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{
    EdgeParameter, Options, Scene, Stretch, Unrounded, find_stretches, scratch_bytes,
};
use penup_host_tests::camera_scenes::{CameraScene, KINDS, camera_scene};
use penup_host_tests::exact_picture::{Picture, Ratio, Seam, compare};
use penup_host_tests::scene_files::Stretches;
use penup_host_tests::wish::wish;
use std::cmp::Ordering;

fn found(scene: &CameraScene, merged_blocks: bool, spare_bytes: usize) -> Vec<Stretch> {
    let seen = Scene {
        vertices: &scene.vertices,
        elements: Elements::new(&scene.corners),
        projection: scene.projection,
        unrounded: Unrounded::new(&scene.positions, scene.precision, scene.view_error),
    };
    let mut words = vec![0u64; (scratch_bytes(&seen) + spare_bytes) / 8];
    let mut stretches = Stretches::default();
    let options =
        Options { with_hidden: true, with_seams: true, merged_blocks, ..Options::default() };
    let scratch = Scratch::new(&mut words);
    let result = find_stretches(&seen, options, scratch, &mut NeverCancel, &mut stretches);
    assert!(result.is_ok(), "{result:?}");
    stretches.0
}

fn ratio(along: EdgeParameter) -> Ratio {
    (along.numerator.into(), along.denominator.into())
}

/// The position on the page of a point along a line, in units of the view's scale.
fn on_page(scene: &CameraScene, ends: [Vertex; 2], at: Ratio) -> [f64; 2] {
    let share = at.0 as f64 / at.1 as f64;
    let part = |of: fn(&Vertex) -> i32| {
        let [p, q] = [0, 1].map(|n: usize| f64::from(of(&ends[n])));
        p + share * (q - p)
    };
    let w = match scene.projection {
        Projection::Perspective => part(|v| v.z) / f64::from(1 << 19),
        Projection::Parallel => 1.0,
    };
    [part(|v| v.x) / w, part(|v| v.y) / w]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Describes how the seams differ from the expected ones, if they do.
fn seams_differ(scene: &CameraScene, found: &[Stretch], expected: &[Seam]) -> Option<String> {
    let found: Vec<[[f64; 2]; 2]> = found
        .iter()
        .filter(|stretch| stretch.edge.is_none())
        .map(|stretch| {
            let ends = [stretch.ends.0, stretch.ends.1];
            [stretch.from, stretch.to].map(|along| on_page(scene, ends, ratio(along)))
        })
        .collect();
    let expected: Vec<[[f64; 2]; 2]> = expected
        .iter()
        .flat_map(|seam| {
            let pieces = seam.visible.iter();
            pieces.map(|(from, to)| [*from, *to].map(|at| on_page(scene, seam.ends, at)))
        })
        .collect();
    let length = |all: &[[[f64; 2]; 2]]| all.iter().map(|[a, b]| distance(*a, *b)).sum::<f64>();
    // Seams end where rounding puts them: some units of a page that is a million wide.
    let near = 40.0;
    let (has, wants) = (length(&found), length(&expected));
    let is_beside = |[a, b]: &[[f64; 2]; 2], all: &[[[f64; 2]; 2]]| {
        distance(*a, *b) < near
            || all.iter().any(|[c, d]| {
                let reach = distance(*c, *d).max(1.0);
                [a, b].iter().all(|at| distance(**at, *c) + distance(**at, *d) < reach + near)
            })
    };
    if (has - wants).abs() > near * (1 + expected.len()) as f64 {
        return Some(format!("seams of {has} in place of {wants}"));
    }
    let stray = found.iter().find(|piece| !is_beside(piece, &expected))?;
    Some(format!("a seam where none is: {stray:?}"))
}

/// Describes how the picture of a seed differs from the expected one, if it does.
fn differs(seed: u64, merged: bool) -> Option<String> {
    let scene = camera_scene(seed);
    let picture = Picture::new(&scene);
    let expected = picture.pieces(merged);
    // Much memory, or the least: few pieces at a time, one cell.
    let spare_bytes = if seed % 4 == 3 { 0 } else { 1 << 14 };
    let found = found(&scene, merged, spare_bytes);
    let of_edges: Vec<_> = found.iter().filter_map(|s| s.edge.map(|edge| (edge, s))).collect();
    for n in 0..of_edges.len().max(expected.len()) {
        let same = match (of_edges.get(n), expected.get(n)) {
            (Some((edge, found)), Some((ends, from, to, visible))) => {
                edge == ends
                    && found.visible == *visible
                    && compare(ratio(found.from), *from) == Ordering::Equal
                    && compare(ratio(found.to), *to) == Ordering::Equal
            }
            _ => false,
        };
        if !same {
            return Some(format!(
                "piece {n}: {:?} in place of {:?}",
                of_edges.get(n),
                expected.get(n)
            ));
        }
    }
    seams_differ(&scene, &found, &picture.seams(merged))
}

fn scene_count() -> u64 {
    wish("PENUP_SCENES", 2000)
}

/// Compares every second scene, with separate and merged blocks alternately.
fn agree(odd: u64) {
    let mut wrong = vec![(0, 0); 2 * KINDS as usize];
    let mut first = None;
    for seed in (0..scene_count()).filter(|seed| seed % 2 == odd) {
        for merged in [false, true] {
            let count = &mut wrong[(2 * (seed % KINDS) + u64::from(merged)) as usize];
            count.1 += 1;
            if let Some(words) = differs(seed, merged) {
                count.0 += 1;
                first.get_or_insert_with(|| format!("seed {seed}, merged {merged}: {words}"));
            }
        }
    }
    assert!(
        first.is_none(),
        "{}; of each kind, separate and merged: {wrong:?}",
        first.unwrap_or_default()
    );
}

#[test]
fn even_scenes_agree_with_the_exact_picture() {
    agree(0);
}

#[test]
fn odd_scenes_agree_with_the_exact_picture() {
    agree(1);
}
