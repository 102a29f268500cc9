//! Computes the convex polygon that encloses points as seen from a viewpoint. It is used for the
//! outline of the solid and for the outline of the points of one face as seen from straight above
//! it.
//!
//! Harrison turns a line of sight around the page (3.2.1), starting from the point with the least
//! y. Here the polygon grows point by point instead, which needs no page. So it works for an eye so
//! near that part of the solid is behind it, and it detects whether the eye is inside the solid.

use super::exact::{Point, Viewpoint};
use crate::array::{MapEach, rotate_left};
use crate::index::Index;

// Why no index in this file can fail:
// * A corner is a number of `points`, because the callers make a polygon from such numbers only,
//   and enclose such numbers only.
// * `count` is at least 3: it begins with 3, and `enclose` makes it `count - replaced + 2` with
//   `replaced` below `count`. So there is no division by zero either.
// * `count` is at most the length of `corners`. The callers give room for each different number
//   that they enclose, those of the triangle included, and these are 3 at least. No number is among
//   the corners twice: a turn is the exact sign of a determinant, so the polygon is convex, and a
//   point that is a corner already is beyond none of its sides, and is not added.

/// The corners of the polygon in counter-clockwise order, no three of them in line on the page.
#[derive(Debug)]
pub(super) struct Polygon<'s, I> {
    /// The vertex numbers of the corners, followed by unused room.
    corners: &'s mut [I],
    /// How many entries of `corners` are in use, from the first on.
    count: usize,
}

/// The error that there are points on all sides of the viewpoint, so that they have no outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Surrounded;

impl<'s, I: Index> Polygon<'s, I> {
    /// Creates the triangle of three points that are not in line on the page. `room` must hold as
    /// many corners as the polygon can ever have, at least three.
    pub(super) fn triangle(
        room: &'s mut [I],
        points: &[Point],
        viewpoint: &Viewpoint,
        [a, b, c]: [I; 3],
    ) -> Self {
        let [p, q, r] = [a, b, c].map_each(|number| points[number.get()]);
        let ordered = if viewpoint.turn(p, q, r) > 0 { [a, b, c] } else { [a, c, b] };
        room[..3].copy_from_slice(&ordered);
        Self { corners: room, count: 3 }
    }

    /// Returns the vertex numbers of the corners, in order.
    pub(super) fn corners(&self) -> &[I] {
        &self.corners[..self.count]
    }

    /// Ends the polygon and gives the memory of its corners back.
    pub(super) fn into_room(self) -> &'s mut [I] {
        self.corners
    }

    /// Rotates the list of corners so that it begins with `corner`, if that is a corner.
    pub(super) fn begin_with(&mut self, corner: I) {
        let corners = &mut self.corners[..self.count];
        if let Some(at) = corners.iter().position(|number| *number == corner) {
            rotate_left(corners, at);
        }
    }

    /// Extends the polygon, if necessary, so that it encloses one more point.
    ///
    /// # Errors
    /// Returns [`Surrounded`] if there are points on all sides of the viewpoint.
    pub(super) fn enclose(
        &mut self,
        points: &[Point],
        viewpoint: &Viewpoint,
        number: I,
    ) -> Result<(), Surrounded> {
        let count = self.count;
        let corners = &mut self.corners[..];
        let new = points[number.get()];
        let side = |edge: usize| {
            let from = points[corners[edge].get()];
            let to = points[corners[(edge + 1) % count].get()];
            viewpoint.turn(from, to, new)
        };
        // The sides beyond which the point lies are consecutive: from `start` up to `end`, around
        // the polygon.
        let (mut start, mut end) = (None, None);
        let first_is_beyond = side(0) < 0;
        let mut last_is_beyond = first_is_beyond;
        for edge in 1..count {
            let is_beyond = side(edge) < 0;
            match (last_is_beyond, is_beyond) {
                (false, true) => start = Some(edge),
                (true, false) => end = Some(edge),
                _ => {}
            }
            last_is_beyond = is_beyond;
        }
        if (start, end) == (None, None) {
            return if first_is_beyond { Err(Surrounded) } else { Ok(()) };
        }
        // `start` is below `count`, and `end` is at most `count`.
        let (mut start, mut end) = (start.unwrap_or(0), end.unwrap_or(count));
        // A neighbouring side in line with the point is replaced too, as otherwise a corner would
        // remain in the middle of a side.
        let before = (start + count - 1) % count;
        let mut replaced = (end + count - start) % count;
        if side(before) == 0 {
            start = before;
            replaced += 1;
        }
        if side(end % count) == 0 {
            end += 1;
            replaced += 1;
        }
        debug_assert_eq!((start + replaced) % count, end % count);
        if replaced >= count {
            return Err(Surrounded);
        }
        rotate_left(&mut corners[..count], start);
        // Sides 0 to `replaced` - 1 are replaced by two sides that meet in the new point. As many
        // corners as before are left, one more, or fewer; there is room for them (see above).
        corners.copy_within(replaced..count, 2);
        corners[1] = number;
        self.count = count - replaced + 2;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Eye;
    use super::*;

    const FROM_ABOVE: Viewpoint = Viewpoint { eye: Eye::Towards([0, 0, 1]), inside: None };

    #[test]
    fn points_on_sides_and_inside_are_no_corners_in_any_order() {
        let points = [
            [0, 0, 0],
            [2, 0, 0],
            [4, 0, 0],
            [4, 2, 0],
            [4, 4, 0],
            [2, 4, 0],
            [0, 4, 0],
            [0, 2, 0],
            [2, 2, 0],
        ];
        // Every rotation and both directions of every start.
        for start in 0..9u16 {
            for step in [1, 2, 4, 5, 7, 8] {
                let order = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(|i| (start + i * step) % 9);
                let [a, b, c] = [order[0], order[1], order[2]];
                let [p, q, r] = [a, b, c].map(|number| points[usize::from(number)]);
                if FROM_ABOVE.turn(p, q, r) == 0 {
                    continue;
                }
                let mut room = [0; 9];
                let mut polygon = Polygon::triangle(&mut room, &points, &FROM_ABOVE, [a, b, c]);
                for number in &order[3..] {
                    assert_eq!(polygon.enclose(&points, &FROM_ABOVE, *number), Ok(()));
                }
                polygon.begin_with(0);
                assert_eq!(polygon.corners(), [0, 2, 4, 6], "{order:?}");
            }
        }
    }

    #[test]
    fn a_viewpoint_among_the_points_is_noticed() {
        let points = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1], [-1, 0, 0]];
        let viewpoint = Viewpoint { eye: Eye::At([0, 0, 0]), inside: None };
        let mut room = [0u16; 5];
        let mut polygon = Polygon::triangle(&mut room, &points, &viewpoint, [0, 1, 2]);
        assert_eq!(polygon.enclose(&points, &viewpoint, 3), Err(Surrounded));
        assert_eq!(polygon.enclose(&points, &viewpoint, 4), Err(Surrounded));
        assert_eq!(polygon.corners().len(), 3);
    }
}
