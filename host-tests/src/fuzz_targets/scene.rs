//! Triangles and bars in front of the eye.

use crate::exact_visibility::{Piece, pieces};
use crate::fraction::Fraction;
use crate::scene_files::Stretches;
use penup::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{EdgeParameter, Options, Scene, Unrounded, find_stretches, scratch_bytes};

/// The most vertices and the most elements. The exact model takes a second for more.
const MOST: usize = 12;

/// Compares the hidden lines of a scene with those of the exact model.
///
/// The first byte holds options: the lowest bit is the projection, the next joins blocks that
/// touch, the next two choose the scale, and the next chooses the least memory. The second byte is
/// the number of vertices, of which each takes three bytes, signed coordinates. Each further group
/// of three bytes is a triangle between those vertices, or a bar if two of the three are the same.
pub fn fuzz(input: &[u8]) {
    let [options, count, rest @ ..] = input else { return };
    let (points, elements) = rest.split_at(rest.len().min(3 * (3 + usize::from(*count) % MOST)));
    let points: Vec<[i32; 3]> = points.chunks_exact(3).map(point).collect();
    let projection = if options & 1 == 0 { Projection::Perspective } else { Projection::Parallel };
    let Some(nearest) = points.iter().map(|point| point[2]).min() else { return };
    // In perspective all must lie in front of the eye.
    let back = if projection == Projection::Perspective { 1 - nearest } else { 0 };
    let scale =
        [1, 1000, COORDINATE_LIMIT / 256, COORDINATE_LIMIT / 257][usize::from(options >> 2 & 3)];
    let vertices: Vec<Vertex> = points
        .iter()
        .map(|[x, y, z]| Vertex::new(x * scale, y * scale, (z + back) * scale))
        .collect();
    let mut corners = Vec::new();
    for element in elements.chunks_exact(3).take(MOST) {
        let mut element: Vec<u16> =
            element.iter().map(|byte| u16::from(*byte) % points.len() as u16).collect();
        element.dedup();
        if element.first() == element.last() {
            element.pop();
        }
        if element.len() >= 2 {
            let (last, of_bar) = (element.len() - 1, element.len() == 2);
            let corner = |(n, vertex): (usize, &u16)| Corner::new(*vertex, of_bar, n == last);
            corners.extend(element.iter().enumerate().map(corner));
        }
    }
    let merged_blocks = options & 2 != 0;
    let spare_bytes = if options & 16 == 0 { 1 << 14 } else { 0 };
    let expected = pieces(projection, &vertices, &corners, merged_blocks);
    let scene = Scene {
        vertices: &vertices,
        elements: Elements::new(&corners),
        projection,
        unrounded: Unrounded::UNKNOWN,
    };
    assert_eq!(found(&scene, merged_blocks, spare_bytes), expected);
}

/// Three signed coordinates.
fn point(bytes: &[u8]) -> [i32; 3] {
    [0, 1, 2].map(|axis: usize| i32::from(bytes[axis].cast_signed()))
}

/// The pieces that the library finds.
fn found(scene: &Scene<'_>, merged_blocks: bool, spare_bytes: usize) -> Vec<Piece> {
    let mut words = vec![0u64; (scratch_bytes(scene) + spare_bytes) / 8];
    let mut stretches = Stretches::default();
    let options = Options { with_hidden: true, merged_blocks, ..Options::default() };
    let result =
        find_stretches(scene, options, Scratch::new(&mut words), &mut NeverCancel, &mut stretches);
    assert!(result.is_ok(), "{result:?}");
    let fraction = |along: EdgeParameter| Fraction::new(along.numerator, along.denominator);
    let piece = |stretch: &penup::visibility::Stretch| {
        let edge = stretch.edge.unwrap_or_default();
        (edge, fraction(stretch.from), fraction(stretch.to), stretch.visible)
    };
    stretches.0.iter().map(piece).collect()
}
