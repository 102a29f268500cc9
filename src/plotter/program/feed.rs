//! F, the speed of moves: in millimetres or inches per minute, or as one divided by the minutes of
//! a move.

use super::block::{AxisUse, Block};
use super::{Motion, Program, clamped};
use crate::fixed::Millimetres;
use crate::protocol::{BlockError, CommandError};

/// Stands for F where none has been given: the greatest number, because without F a move is as fast
/// as the settings allow. An F of 0 is another thing: no move can have it.
pub(super) const NO_FEED: Millimetres = Millimetres::MAX;

impl Program {
    /// The bound of the speed of the present move in mm/min, if there is one. It may be 0, which
    /// the machine refuses.
    pub(in crate::plotter) fn feed(&self) -> Option<Millimetres> {
        Some(self.move_feed).filter(|feed| *feed != NO_FEED)
    }

    /// Sets the speed of the line, and the units that it is given in.
    pub(super) fn set_feed(&mut self, block: &Block) -> Result<(), CommandError> {
        self.inches = block.inches.unwrap_or(self.inches);
        let was_inverse = self.inverse_time;
        self.inverse_time = block.inverse_time.unwrap_or(self.inverse_time);
        let motion = block.motion.unwrap_or(self.motion);
        if self.inverse_time {
            let is_feed = matches!(motion, Motion::Line | Motion::Arc(_));
            let feed = block.number(b'F').map(clamped).unwrap_or_default();
            if block.axis_use == AxisUse::Motion && is_feed && feed <= 0 {
                return Err(BlockError::NoFeed.into());
            }
            self.feed = feed;
        } else if let Some(feed) = block.number(b'F') {
            // A speed beyond the range of numbers is beyond every limit, too.
            self.feed = self.length(feed).unwrap_or(Millimetres::MAX);
        } else if was_inverse {
            self.feed = NO_FEED;
        }
        self.move_feed = self.feed;
        Ok(())
    }
}

/// The speed of a straight move in mm/min, where `feed` is one divided by its minutes; [`NO_FEED`]
/// if the move has no length.
pub(super) fn inverse_feed(
    from: [Millimetres; 2],
    to: [Millimetres; 2],
    feed: Millimetres,
) -> Millimetres {
    // The axes are 0 and 1, which both points have.
    // Differences are below 2^32 units of 2^-16 mm; halved, their squares are below 2^62.
    let half = |axis: usize| {
        (i64::from(to[axis].to_bits()) - i64::from(from[axis].to_bits())).unsigned_abs() / 2
    };
    let length = 2 * (half(0) * half(0) + half(1) * half(1)).isqrt();
    if length == 0 {
        return NO_FEED;
    }
    let bits = (u128::from(length) * u128::from(feed.to_bits().unsigned_abs())) >> 16;
    Millimetres::from_bits(i32::try_from(bits).unwrap_or(i32::MAX).max(1))
}
