//! One speed along each line of a drawing ([`Setting::SteadySpeed`]), so that the ink is even.
//!
//! A line is what lies between two ends or sharp corners of a stroke. Before its first move is
//! planned, all of it is looked at, up to [`MOST_MOVES`] moves of it; a longer line has a speed for
//! every this many moves.

use super::{Machine, Path, Setting, Target};
use crate::motion::{SpeedLimit, SteadySpeed};

/// The most moves of a line that are looked at together. On the Pico that takes some 20 ms, in
/// which the machine draws what was planned before.
const MOST_MOVES: u32 = 1000;

/// The speed of the line that is being read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Steady {
    /// How many moves of it have not been read yet.
    moves: u32,
    /// The speed of this line.
    limit: SpeedLimit,
}

impl Machine<'_> {
    /// Returns the limit of the speed for the move to `target`, which was read from `path` last.
    pub(super) fn steady_limit(&mut self, path: &mut dyn Path, target: Target) -> SpeedLimit {
        if target.ink.is_none() || !self.settings.is_on(Setting::SteadySpeed) {
            self.steady.moves = 0;
            return SpeedLimit::NONE;
        }
        if self.steady.moves == 0 {
            self.steady = self.line_ahead(path, target);
        }
        self.steady.moves -= 1;
        self.steady.limit
    }

    /// Looks at the line that begins with the move to `target`.
    #[inline(never)] // Drawings without one speed never come here: it would only fill the cache.
    fn line_ahead(&self, path: &mut dyn Path, target: Target) -> Steady {
        let mut line = SteadySpeed::new(self.runner.limits(), self.runner.page_end());
        line.add(target.point);
        path.look_ahead(&mut |next| {
            next.ink == target.ink && line.moves() < MOST_MOVES && line.add(next.point)
        });
        Steady { moves: line.moves().max(1), limit: line.limit() }
    }
}
