//! Checks the vertices as points: their range, which of them coincide, and what they span.

use super::exact::{Plane, Point};
use super::{Eye, POSITION_LIMIT, SolidError};
use crate::array::MapEach;
use crate::geometry::Precision;
use crate::index::Index;
use crate::model::Corner;
use crate::stage::heap_sort_by_key;

// No indexing of points by the number of a vertex can fail, because each number is below
// `points.len()`: the lists of numbers are made by counting the points and then only become
// shorter, and `from_edges` refuses ends of edges that are no vertices before it hands any to a
// function here. An axis is 0, 1 or 2.

/// Returns the longest side of the bounding box of the points.
pub(super) fn largest_extent(points: impl Iterator<Item = Point> + Clone) -> u32 {
    let extent = |axis: usize| {
        let along = points.clone().map(|point| point[axis]);
        let low = along.clone().min().unwrap_or(0);
        let high = along.max().unwrap_or(0);
        high.abs_diff(low)
    };
    [0, 1, 2].map(extent).into_iter().max().unwrap_or(0)
}

/// Returns the eye moved towards the middle of the points at `numbers`, as the precision requires:
/// by the angle that an edge of a tenth of the extent of the solid may turn if its ends are off by
/// the precision.
pub(super) fn drawn_in_eye<I: Index>(
    eye: Eye,
    points: &[Point],
    numbers: &[I],
    precision: Precision,
) -> Eye {
    let tolerance = precision.written.saturating_mul(16);
    let corners = numbers.iter().map(|number| points[number.get()]);
    // At most 2^14, and at least 1, so the division below cannot fail.
    let count = numbers.len().max(1) as i64;
    let mean = |axis: usize| {
        let sum: i64 = corners.clone().map(|point| i64::from(point[axis])).sum();
        (sum / count) as i32
    };
    eye.drawn_in([0, 1, 2].map_each(mean), largest_extent(corners.clone()), tolerance)
}

/// What a set of different points spans, with the numbers of points that prove it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Span<I> {
    /// All points lie on one line.
    Line,
    /// All points lie in one plane; these three are not in line.
    Plane([I; 3]),
    /// The points span a solid; these four are not in one plane.
    Space([I; 4]),
}

/// Checks that there are not too many points and that every position is in range.
pub(super) fn check<I: Index>(points: &[Point]) -> Result<(), SolidError> {
    if points.len() > <Corner<I>>::VERTEX_NUMBER_LIMIT {
        return Err(SolidError::TooManyVertices);
    }
    let out_of_range = |point: &Point| {
        point.iter().any(|part| part.unsigned_abs() > POSITION_LIMIT.unsigned_abs())
    };
    match points.iter().position(out_of_range) {
        Some(vertex) => Err(SolidError::PositionOutOfRange { vertex: vertex as u32 }),
        None => Ok(()),
    }
}

/// Sorts `numbers` by position and keeps only the least of those at the same position. Returns how
/// many are left.
pub(super) fn weld<I: Index>(points: &[Point], numbers: &mut [I]) -> usize {
    heap_sort_by_key(numbers, |number| (points.get(number.get()), *number));
    let mut kept = 0;
    for at in 0..numbers.len() {
        // `kept` grows by 1 at most in each round, so it is at most `at`.
        let number = numbers[at];
        let same_place = kept > 0 && points[numbers[kept - 1].get()] == points[number.get()];
        if !same_place {
            numbers[kept] = number;
            kept += 1;
        }
    }
    kept
}

/// Finds out whether the points at `numbers` lie on one line, in one plane or neither. They are all
/// different, and there are at least four.
pub(super) fn span<I: Index>(points: &[Point], numbers: &[I]) -> Span<I> {
    let point = |number: I| points[number.get()];
    let [a, b, ..] = *numbers else { return Span::Line };
    let mut off_line = numbers
        .iter()
        .copied()
        .filter(|c| !Plane::through(point(a), point(b), point(*c)).is_degenerate());
    let Some(c) = off_line.next() else {
        return Span::Line;
    };
    let plane = Plane::through(point(a), point(b), point(c));
    let mut off_plane = numbers.iter().copied().filter(|d| plane.height(point(*d)) != 0);
    match off_plane.next() {
        Some(d) => Span::Space([a, b, c, d]),
        None => Span::Plane([a, b, c]),
    }
}

/// Returns the vertex that stands for all those at the position of `number`. `welded` holds one for
/// each position.
pub(super) fn first_at_place<I: Index>(points: &[Point], welded: &[I], number: I) -> I {
    let position = points[number.get()];
    // The search finds an index of `welded`.
    welded
        .binary_search_by_key(&position, |other| points[other.get()])
        .map_or(number, |at| welded[at])
}
