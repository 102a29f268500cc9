//! Clips lines to the part of the page that may be drawn on.
//!
//! It is used where parts of the image may lie far off the page; see
//! [`PageMap::fit_field`](super::PageMap::fit_field).

use super::{Page, PagePoint, StepsPerMillimetre};
use crate::array::MapEach;
use crate::curve::Fine;
use crate::fixed::{divide_rounding, product};

/// The part of a page inside its margins (and above its foot), in 1/256 steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    /// The lower left corner.
    low: Fine,
    /// The upper right corner.
    high: Fine,
}

impl Window {
    /// Makes the window of a page: the area inside its margins and above the title.
    pub fn new(page: &Page, steps: StepsPerMillimetre) -> Self {
        let to_fine = |bits: i64, axis: usize| {
            // The product has 32 fraction bits, of which 8 are kept.
            (bits * i64::from(steps[axis].to_bits())) >> 24
        };
        let far = [page.width, page.height]
            .map(|side| i64::from(side.to_bits()) - i64::from(page.margin.to_bits()));
        Self {
            low: [0, 1].map_each(|axis: usize| to_fine(page.first(axis), axis)),
            high: [0, 1].map_each(|axis: usize| to_fine(far[axis], axis)),
        }
    }

    /// Returns the part of a line that may be drawn, which is inside the window, in steps (Liang
    /// and Barsky, 1984), or `None` if no part is. Coordinates must be within ±2^40.
    pub fn clip(&self, [from, to]: [Fine; 2]) -> Option<[PagePoint; 2]> {
        let along = [0, 1].map_each(|axis: usize| to[axis] - from[axis]);
        // The parameters at which the line enters and leaves, as ratios of numbers below 2^42.
        let (mut enter, mut leave) = ((0, 1), (1, 1));
        let later = |a: (i64, i64), b: (i64, i64)| product(a.0, b.1) > product(b.0, a.1);
        for axis in [0, 1] {
            // A point has two coordinates, so no indexing by `axis` can fail.
            // How far the line runs outwards across a border, and how far inside its start lies.
            for (outward, inside) in [
                (-along[axis], from[axis] - self.low[axis]),
                (along[axis], self.high[axis] - from[axis]),
            ] {
                if outward == 0 && inside < 0 {
                    return None;
                }
                if outward < 0 && later((-inside, -outward), enter) {
                    enter = (-inside, -outward);
                }
                if outward > 0 && later(leave, (inside, outward)) {
                    leave = (inside, outward);
                }
            }
        }
        if later(enter, leave) {
            return None;
        }
        let at = |(part, whole): (i64, i64)| {
            let [x, y] = [0, 1].map_each(|axis: usize| {
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
    use std::string::String;
    use std::vec::Vec;

    fn window() -> Window {
        let [width, height, margin, steps] = [100, 60, 10, 10].map(Millimetres::from_num);
        Window::new(&Page { width, height, margin, foot: Millimetres::ZERO }, [steps; 2])
    }

    /// The sides of a character of a picture, in steps. The window has 17 by 9 characters; its
    /// corners are at the first and the last of them.
    const CELL: i32 = 50;

    /// What is left of the line between two points, in steps: `a` where it begins, `b` where it
    /// ends, and `*` between them. A line that is a point is an `o`.
    fn picture(ends: [[i64; 2]; 2]) -> String {
        let mut rows = [[' '; 17]; 9];
        if let Some(clipped) = window().clip(ends.map(|end| end.map(|steps| steps * 256))) {
            let [a, b] = clipped.map(|PagePoint { x, y }| {
                assert_eq!([x % CELL, y % CELL], [0, 0], "an end between two characters");
                [x / CELL - 2, y / CELL - 2]
            });
            let length = (b[0] - a[0]).abs().max((b[1] - a[1]).abs());
            for at in 0..=length {
                let [x, y] = [0, 1].map(|axis: usize| {
                    let moved = 2 * at * (b[axis] - a[axis]) + length;
                    a[axis] + moved.checked_div_euclid(2 * length).unwrap_or(0)
                });
                let ink = match at {
                    0 if length == 0 => 'o',
                    0 => 'a',
                    _ if at == length => 'b',
                    _ => '*',
                };
                rows[8 - y as usize][x as usize] = ink;
            }
        }
        let text: Vec<String> = rows.iter().map(|row| row.iter().collect()).collect();
        text.iter().map(|row| row.trim_end()).collect::<Vec<_>>().join("\n")
    }

    /// Asserts that clipping a line leaves what the picture shows of the window.
    #[track_caller]
    fn assert_clipped(ends: [[i64; 2]; 2], expected: [&str; 9]) {
        assert_eq!(picture(ends), expected.map(str::trim_end).join("\n"), "{ends:?}");
    }

    #[test]
    fn what_is_inside_stays() {
        let whole = [
            "               *b",
            "             **  ",
            "           **    ",
            "         **      ",
            "       **        ",
            "     **          ",
            "   **            ",
            " **              ",
            "a                ",
        ];
        assert_clipped([[100, 100], [900, 500]], whole);
        assert_clipped(
            [[300, 200], [300, 200]],
            [
                "                 ",
                "                 ",
                "                 ",
                "                 ",
                "                 ",
                "                 ",
                "    o            ",
                "                 ",
                "                 ",
            ],
        );
    }

    #[test]
    fn what_is_outside_goes() {
        for outside in [
            [[99, 0], [99, 600]],
            [[0, 501], [1000, 501]],
            [[0, 300], [90, 590]],
            [[950, 400], [900, 600]],
        ] {
            assert_clipped(outside, [""; 9]);
        }
    }

    #[test]
    fn a_line_across_is_cut_at_both_borders_either_way() {
        let ends = [[-700, 300], [1_000_900, 300]];
        let across = [
            "                 ",
            "                 ",
            "                 ",
            "                 ",
            "a***************b",
            "                 ",
            "                 ",
            "                 ",
            "                 ",
        ];
        assert_clipped(ends, across);
        let back = across.map(|row| row.chars().rev().collect::<String>());
        assert_clipped([ends[1], ends[0]], back.each_ref().map(String::as_str));
    }

    #[test]
    fn a_line_that_leaves_by_another_border_is_cut_there() {
        // From the corner of the page along the diagonal to a point far away.
        assert_clipped(
            [[0, 0], [4_000_000_000, 2_000_000_000]],
            [
                "                 ",
                "               *b",
                "             **  ",
                "           **    ",
                "         **      ",
                "       **        ",
                "     **          ",
                "   **            ",
                "  a              ",
            ],
        );
        assert_clipped(
            [[500, 300], [500, -9000]],
            [
                "                 ",
                "                 ",
                "                 ",
                "                 ",
                "        a        ",
                "        *        ",
                "        *        ",
                "        *        ",
                "        b        ",
            ],
        );
    }
}
