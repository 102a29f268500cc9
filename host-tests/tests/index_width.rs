//! The width of the numbers, 16 bits on boards and 32 on a computer, changes no result.

use penup::geometry::{Projection, Vertex};
use penup::index::Index;
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{
    Crease, EdgeParameter, Options, Scene, SinkFull, Stretch, StretchSink, Unrounded,
    find_stretches, scratch_bytes,
};
use penup_host_tests::random::Random;
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
        let half = Crease { cosine: 1 << 19, depth_stretch: (1, 1), slants: [0; 2] };
        let crease = with_crease.then_some(half);
        let options = Options { with_hidden, with_seams, merged_blocks, crease };
        let narrow = stretches::<u16>(&random, options, spare);
        prop_assert_eq!(narrow, stretches::<u32>(&random, options, spare));
    }
}

/// Hexahedra, one behind the other and through each other, on a grid so coarse that their sides lie
/// on each other's lines. A computer does not test all faces of a solid against the edges behind
/// it, so some are turned inside out, and some have a face that is missing, turned over or there
/// twice, or a corner that is moved.
fn random_solids(seed: u64) -> RandomScene {
    const SIDES: [[u16; 4]; 6] =
        [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    let random = &mut Random::new(seed);
    let projection = random.one_of(&[Projection::Perspective, Projection::Parallel]);
    let lean = random.one_of(&[[0, 0], [1, 0], [1, -2]]);
    let (mut vertices, mut corners): (Vec<Vertex>, Vec<Corner>) = (Vec::new(), Vec::new());
    for _ in 0..random.between(1, 12) {
        let first = vertices.len() as u16;
        let low = [0; 3].map(|_| random.between(-5, 5));
        let size = [0; 3].map(|_| random.between(1, 4));
        for number in 0..8 {
            // The corners run around the bottom and then around the top.
            let shift = [i32::from(number % 4 % 3 != 0), number % 4 / 2, number / 4];
            let mut at = [0, 1, 2].map(|axis| low[axis] + shift[axis] * size[axis]);
            if random.once_in(40) {
                at[random.below(3) as usize] += 1;
            }
            let [x, y, z] = at;
            vertices.push(Vertex::new(
                10 * (x + lean[0] * z),
                10 * (y + lean[1] * z),
                100 + 10 * z,
            ));
        }
        let is_turned = random.once_in(3);
        for side in SIDES {
            let copies = if random.once_in(30) { random.between(0, 2) } else { 1 };
            for _ in 0..copies {
                let mut side = side.map(|vertex| first + vertex);
                if is_turned != random.once_in(40) {
                    side.reverse();
                }
                let end = |(number, vertex): (usize, u16)| Corner::new(vertex, false, number == 3);
                corners.extend(side.into_iter().enumerate().map(end));
            }
        }
    }
    RandomScene { vertices, corners, projection }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]
    #[test]
    fn hidden_lines_of_solids_are_the_same(
        seed in any::<u64>(),
        [with_hidden, with_seams, merged_blocks] in any::<[bool; 3]>(),
        spare in prop::sample::select(vec![0usize, 1000, 1 << 14]),
    ) {
        let random = random_solids(seed);
        let options = Options { with_hidden, with_seams, merged_blocks, crease: None };
        let narrow = stretches::<u16>(&random, options, spare);
        prop_assert_eq!(narrow, stretches::<u32>(&random, options, spare));
    }
}
