//! Tests of visibility against its definition, on random scenes full of degenerate cases.
//!
//! `PENUP_SCENES` sets the number of scenes; the default is 2,000.

use penup::geometry::Precision;
use penup::model::Elements;
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{EdgeParameter, Options, Scene, Unrounded, find_stretches, scratch_bytes};
use penup_host_tests::exact_visibility::{Piece, pieces};
use penup_host_tests::fraction::Fraction;
use penup_host_tests::random_scenes::{RandomScene, random_scene};
use penup_host_tests::scene_files::Stretches;
use penup_host_tests::wish::wish;

fn fraction(along: EdgeParameter) -> Fraction {
    Fraction::new(along.numerator, along.denominator)
}

fn library_pieces(random: &RandomScene, merged_blocks: bool, spare_bytes: usize) -> Vec<Piece> {
    // Vertices that were never rounded are their own positions, and knowing them changes nothing.
    let positions = random.vertices.iter().map(|vertex| [vertex.x, vertex.y, vertex.z]);
    let positions: Vec<[i32; 3]> = positions.collect();
    let scene = Scene {
        vertices: &random.vertices,
        elements: Elements::new(&random.corners),
        projection: random.projection,
        unrounded: match spare_bytes {
            0 => Unrounded::new(&positions, Precision::default(), 1),
            _ => Unrounded::UNKNOWN,
        },
    };
    let mut words = vec![0u64; (scratch_bytes(&scene) + spare_bytes) / 8];
    let mut stretches = Stretches::default();
    let result = find_stretches(
        &scene,
        Options { with_hidden: true, merged_blocks, ..Options::default() },
        Scratch::new(&mut words),
        &mut NeverCancel,
        &mut stretches,
    );
    assert!(result.is_ok(), "{result:?}");
    let piece = |stretch: &penup::visibility::Stretch| {
        (
            stretch.edge.unwrap_or_default(),
            fraction(stretch.from),
            fraction(stretch.to),
            stretch.visible,
        )
    };
    stretches.0.iter().map(piece).collect()
}

fn agree(seeds: impl Iterator<Item = u64>, merged_blocks: bool) {
    for seed in seeds {
        let random = random_scene(seed);
        let expected = pieces(random.projection, &random.vertices, &random.corners, merged_blocks);
        // Much memory, and the least: few pieces at a time, one cell.
        for spare_bytes in [1 << 14, 0] {
            let found = library_pieces(&random, merged_blocks, spare_bytes);
            let count = found.len().max(expected.len());
            for n in 0..count {
                assert_eq!(
                    found.get(n),
                    expected.get(n),
                    "piece {n} of seed {seed}, {spare_bytes} spare bytes: {random:?}"
                );
            }
        }
    }
}

fn scene_count() -> u64 {
    wish("PENUP_SCENES", 2000)
}

#[test]
fn the_first_half_of_the_random_scenes_agrees() {
    agree(0..scene_count() / 2, false);
}

#[test]
fn the_second_half_of_the_random_scenes_agrees() {
    agree(scene_count() / 2..scene_count(), false);
}

#[test]
fn merged_blocks_agree() {
    agree(0..scene_count(), true);
}
