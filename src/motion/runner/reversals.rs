//! Records where motors with backlash reverse, in events that the pins may not have reached yet.
//!
//! The steps that take up backlash while the pen draws look like all other steps. So the reversals
//! must be known to tell how much of its backlash a motor has taken up at a given instant.

use super::{BlockKind, Runner};
use crate::drawing::PagePoint;
use crate::motion::PathLength;
use heapless::Deque;

/// The most reversals that may wait for the pins. When this many wait, the planner waits, too.
const MAX_REVERSALS: usize = 16;

/// The part of a move that takes up backlash while the pen draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BacklashTakeUp {
    /// Whether a motor reverses at the beginning of the move.
    pub reverses: bool,
    /// By how much the path of the motors is longer than what the pen draws.
    pub extra: PathLength,
}

impl BacklashTakeUp {
    /// Returns the kind of the block of such a move, where `kind` is that of the move without it,
    /// and the extra length of its path.
    pub(super) fn of_block(self, kind: BlockKind) -> (BlockKind, PathLength) {
        (if self.reverses { BlockKind::Reversal } else { kind }, self.extra)
    }
}

/// The reversal of a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reversal {
    /// The ticks of all events before the reversal; wraps.
    ticks: u32,
    /// For each motor, the sum of all its steps before the reversal, including those that took up
    /// backlash at rest; wraps.
    pub motors: [i32; 2],
}

impl Reversal {
    /// Records a reversal after events of this many `ticks`, at this position and with this
    /// backlash taken up at rest.
    pub(super) fn new(ticks: u32, position: PagePoint, backlash: PagePoint) -> Self {
        Self { ticks, motors: sum(position, backlash) }
    }

    /// Whether the pins have begun the reversal, if all events that they have begun lasted `ticks`.
    pub fn has_begun(&self, ticks: u32) -> bool {
        ticks.wrapping_sub(self.ticks).cast_signed() > 0
    }
}

/// Returns the sum of all steps of each motor.
fn sum(position: PagePoint, backlash: PagePoint) -> [i32; 2] {
    [position.x.wrapping_add(backlash.x), position.y.wrapping_add(backlash.y)]
}

/// The reversals that the pins have not begun yet, in their order.
#[derive(Debug, Default)]
pub(super) struct Reversals {
    /// Whether reversals are recorded at all.
    are_recorded: bool,
    waiting: Deque<Reversal, MAX_REVERSALS>,
}

impl Reversals {
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn add(&mut self, reversal: Reversal) {
        if self.are_recorded {
            // There is room, because the planner waits when the list is full.
            let added = self.waiting.push_back(reversal);
            debug_assert!(added.is_ok());
        }
    }

    pub(super) fn clear(&mut self) {
        self.waiting.clear();
    }
}

impl Runner<'_> {
    /// Chooses whether reversals are recorded. It may only be called while nothing moves.
    pub fn record_reversals(&mut self, keep: bool) {
        self.reversals.are_recorded = keep;
    }

    /// Whether the pins must make progress before more can be planned.
    pub fn waits_for_reversals(&self) -> bool {
        self.reversals.waiting.is_full()
    }

    /// The reversals that the pins have not begun yet, in their order.
    pub fn reversals(&self) -> impl Iterator<Item = Reversal> {
        self.reversals.waiting.iter().copied()
    }

    /// Removes and returns the first reversal in the list, if the pins have begun it.
    pub fn next_begun_reversal(&mut self, ticks: u32) -> Option<Reversal> {
        let reversal = self.reversals.waiting.front().filter(|reversal| reversal.has_begun(ticks));
        if reversal.is_some() { self.reversals.waiting.pop_front() } else { None }
    }

    /// The sum of all steps of each motor in the events so far; wraps.
    pub fn motor_steps(&self) -> [i32; 2] {
        sum(self.position, self.backlash)
    }

    /// The sum of all steps of each motor in the blocks so far; wraps.
    pub fn motor_steps_end(&self) -> [i32; 2] {
        sum(self.end, self.backlash_end)
    }

    /// Says what part of the next appended move takes up backlash while the pen draws.
    pub fn set_backlash_take_up(&mut self, backlash_take_up: BacklashTakeUp) {
        self.backlash_take_up = backlash_take_up;
    }

    /// Whether the path ends within a full line that may be continued.
    pub fn is_in_line(&self) -> bool {
        self.last.is_some_and(|last| last.ink == Some(crate::drawing::LineType::Full))
    }
}
