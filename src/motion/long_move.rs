//! Finds the corner that short moves hide: each of them turns so little, for its length, that
//! rounding could explain it, but the long moves on both sides have different directions.

use super::junction::{self, Corner, Heading};
use super::{Limits, PathLength};

/// The last move that is long enough to have a direction, whatever rounding does, and the short
/// moves behind it, which may hide a corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct LongMove {
    heading: Heading,
    length: PathLength,
    /// The total length of the short moves behind it.
    gap: PathLength,
}

impl LongMove {
    /// A move is long from this many times what rounding can explain on.
    const LEAST: u32 = 4;
    /// The short moves behind it may be this many times as long in all.
    const MOST_GAP: u32 = 8;

    /// Whether a move of this `length` is a short one.
    pub(super) fn is_short(length: PathLength, limits: &Limits) -> bool {
        length.to_bits() < Self::LEAST * limits.rounding.to_bits()
    }

    /// Appends a short move behind it. Returns `None` if there are too many of them.
    pub(super) fn followed_by(self, length: PathLength, limits: &Limits) -> Option<Self> {
        let gap = self.gap.saturating_add(length);
        let is_near = gap.to_bits() <= Self::MOST_GAP * limits.rounding.to_bits();
        is_near.then_some(Self { gap, ..self })
    }

    /// Puts a long move in the place of the `last` one. Returns the corner before it, which is
    /// `corner` if short moves hide none.
    pub(super) fn replace(
        last: &mut Option<Self>,
        heading: Heading,
        length: PathLength,
        corner: Corner,
        limits: &Limits,
    ) -> Corner {
        let next = Self { heading, length, gap: PathLength::ZERO };
        last.replace(next).map_or(corner, |before| before.corner(&next, corner, limits))
    }

    /// The corner between it and the `next` long move, before which there is also the corner
    /// `after` the short moves.
    fn corner(&self, next: &Self, after: Corner, limits: &Limits) -> Corner {
        if self.gap == 0 {
            return after;
        }
        let shorter = self.length.min(next.length);
        let hidden = junction::corner(limits, self.heading, next.heading, shorter, self.gap);
        Corner { limit: hidden.limit.min(after.limit), is_sharp: hidden.is_sharp || after.is_sharp }
    }
}
