//! Clips lines to the part of the page that may be drawn on.
//!
//! It is used where parts of the image may lie far off the page; see
//! [`PageMap::fit_field`](super::PageMap::fit_field).

use super::{Page, PagePoint, StepsPerMillimetre};
use crate::curve::Fine;
use crate::fixed::{divide_rounding, product};

/// The part of a page inside its margins (and above its foot), in 1/256 steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    low: Fine,
    high: Fine,
}

impl Window {
    /// Makes the window of a page.
    pub fn new(page: &Page, steps: StepsPerMillimetre) -> Self {
        let to_fine = |bits: i64, axis: usize| {
            // The product has 32 fraction bits, of which 8 are kept.
            (bits * i64::from(steps[axis].to_bits())) >> 24
        };
        let far = [page.width, page.height]
            .map(|side| i64::from(side.to_bits()) - i64::from(page.margin.to_bits()));
        Self {
            low: [0, 1].map(|axis: usize| to_fine(page.first(axis), axis)),
            high: [0, 1].map(|axis: usize| to_fine(far[axis], axis)),
        }
    }

    /// Returns the part of a line that is inside the window, in steps (Liang and Barsky, 1984), or
    /// `None` if no part is. Coordinates must be within ±2^40.
    pub fn clip(&self, [from, to]: [Fine; 2]) -> Option<[PagePoint; 2]> {
        let along = [0, 1].map(|axis: usize| to[axis] - from[axis]);
        // The parameters at which the line enters and leaves, as ratios of numbers below 2^42.
        let (mut enter, mut leave) = ((0, 1), (1, 1));
        let later = |a: (i64, i64), b: (i64, i64)| product(a.0, b.1) > product(b.0, a.1);
        for axis in [0, 1] {
            for (way, room) in [
                (-along[axis], from[axis] - self.low[axis]),
                (along[axis], self.high[axis] - from[axis]),
            ] {
                if way == 0 && room < 0 {
                    return None;
                }
                if way < 0 && later((-room, -way), enter) {
                    enter = (-room, -way);
                }
                if way > 0 && later(leave, (room, way)) {
                    leave = (room, way);
                }
            }
        }
        if later(enter, leave) {
            return None;
        }
        let at = |(part, whole): (i64, i64)| {
            let [x, y] = [0, 1].map(|axis: usize| {
                let moved = product(along[axis], part) + product(from[axis], whole);
                divide_rounding(moved, i128::from(whole) << 8) as i32
            });
            PagePoint { x, y }
        };
        Some([at(enter), at(leave)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed::Millimetres;

    fn window() -> Window {
        let [width, height, margin, steps] = [100, 60, 10, 10].map(Millimetres::from_num);
        Window::new(&Page { width, height, margin, foot: Millimetres::ZERO }, [steps; 2])
    }

    fn clipped(ends: [[i64; 2]; 2]) -> Option<[[i32; 2]; 2]> {
        let fine = ends.map(|end| end.map(|steps| steps * 256));
        window().clip(fine).map(|ends| ends.map(|PagePoint { x, y }| [x, y]))
    }

    #[test]
    fn what_is_inside_stays_and_what_is_outside_goes() {
        assert_eq!(clipped([[100, 100], [900, 500]]), Some([[100, 100], [900, 500]]));
        assert_eq!(clipped([[300, 200], [300, 200]]), Some([[300, 200], [300, 200]]));
        for outside in [
            [[99, 0], [99, 600]],
            [[0, 501], [1000, 501]],
            [[0, 300], [90, 590]],
            [[950, 400], [900, 600]],
        ] {
            assert_eq!(clipped(outside), None, "{outside:?}");
        }
    }

    #[test]
    fn a_line_across_is_cut_at_both_borders_either_way() {
        let ends = [[-700, 300], [1_000_900, 300]];
        assert_eq!(clipped(ends), Some([[100, 300], [900, 300]]));
        assert_eq!(clipped([ends[1], ends[0]]), Some([[900, 300], [100, 300]]));
        // From the corner of the page along the diagonal to a point far away.
        assert_eq!(
            clipped([[0, 0], [4_000_000_000, 2_000_000_000]]),
            Some([[200, 100], [900, 450]])
        );
        assert_eq!(clipped([[500, 300], [500, -9000]]), Some([[500, 300], [500, 100]]));
    }
}
