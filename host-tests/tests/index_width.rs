//! The width of the numbers, 16 bits on boards and 32 on a computer, changes no result.

use penup::index::Index;
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{
    Crease, EdgeParameter, Options, Scene, SinkFull, Stretch, StretchSink, Unrounded,
    find_stretches, scratch_bytes,
};
use penup_host_tests::random_scenes::{RandomScene, random_scene};
use proptest::prelude::*;

/// A stretch in numbers whose width does not matter: the edge, where it begins and ends, whether it
/// is visible, and the pen.
type Plain = (Option<[u32; 2]>, [i32; 6], [EdgeParameter; 2], bool, u8);

/// Collects stretches.
#[derive(Default)]
struct Found(Vec<Plain>);

impl<I: Index> StretchSink<I> for Found {
    fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull> {
        let Stretch { edge, ends: (p, q), from, to, visible, pen } = stretch;
        let edge = edge.map(|(a, b)| [a.into(), b.into()]);
        self.0.push((edge, [p.x, p.y, p.z, q.x, q.y, q.z], [from, to], visible, pen));
        Ok(())
    }
}

/// The stretches of a scene that is numbered with `I`. `spare` bytes are added to the least memory.
fn stretches<I: Index>(random: &RandomScene, options: Options, spare: usize) -> Vec<Plain> {
    let widened = |corner: &Corner| {
        let vertex = I::new(corner.vertex().into());
        Corner::new(vertex, corner.of_bar(), corner.is_last())
    };
    let corners: Vec<Corner<I>> = random.corners.iter().map(widened).collect();
    let scene = Scene {
        vertices: &random.vertices,
        elements: Elements::new(&corners),
        projection: random.projection,
        unrounded: Unrounded::UNKNOWN,
    };
    let mut words = vec![0u64; (scratch_bytes(&scene) + spare) / 8];
    let mut found = Found::default();
    let scratch = Scratch::new(&mut words);
    let result = find_stretches(&scene, options, scratch, &mut NeverCancel, &mut found);
    assert!(result.is_ok(), "{result:?}");
    found.0
}

proptest! {
    #[test]
    fn hidden_lines_are_the_same(
        seed in any::<u64>(),
        [with_hidden, with_seams, merged_blocks, with_crease] in any::<[bool; 4]>(),
        spare in prop::sample::select(vec![0usize, 200, 1 << 14]),
    ) {
        let random = random_scene(seed);
        let crease = with_crease.then_some(Crease { cosine: 1 << 14, depth_stretch: (1, 1) });
        let options = Options { with_hidden, with_seams, merged_blocks, crease };
        let narrow = stretches::<u16>(&random, options, spare);
        prop_assert_eq!(narrow, stretches::<u32>(&random, options, spare));
    }
}
