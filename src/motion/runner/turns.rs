//! Where motors turned round that have slack, in events that the pins may not have reached.
//!
//! Without them it would not be known how much of its slack a motor has taken up at an instant: the
//! steps that take it up on the way are steps as others.

use super::{BlockKind, Runner};
use crate::drawing::PagePoint;
use crate::motion::PathLength;
use heapless::Deque;

/// How many turns may wait for the pins. With so many the planner waits, too.
const MOST_TURNS: usize = 16;

/// How a move takes up slack on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OnTheWay {
    /// Whether a motor turns round with it.
    pub turns: bool,
    /// How much longer its steps are than what the pen draws.
    pub extra: PathLength,
}

impl OnTheWay {
    /// What the block of such a move is.
    pub(super) fn of_block(self, kind: BlockKind) -> (BlockKind, PathLength) {
        (if self.turns { BlockKind::Turn } else { kind }, self.extra)
    }
}

/// Where the motors turned round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// Of all events before; wraps.
    ticks: u32,
    /// The sum of all steps of each motor, those that took up slack at rest included; wraps.
    pub motors: [i32; 2],
}

impl Turn {
    pub(super) fn new(ticks: u32, position: PagePoint, slack: PagePoint) -> Self {
        Self { ticks, motors: sum(position, slack) }
    }

    /// Whether the pins have begun it once they have begun events of so many `ticks` in all.
    pub fn has_begun(&self, ticks: u32) -> bool {
        ticks.wrapping_sub(self.ticks).cast_signed() > 0
    }
}

/// All steps of each motor.
fn sum(position: PagePoint, slack: PagePoint) -> [i32; 2] {
    [position.x.wrapping_add(slack.x), position.y.wrapping_add(slack.y)]
}

/// The turns that wait for the pins, in their order.
#[derive(Debug, Default)]
pub(super) struct Turns {
    /// Whether they matter at all.
    are_kept: bool,
    waiting: Deque<Turn, MOST_TURNS>,
}

impl Turns {
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn add(&mut self, turn: Turn) {
        if self.are_kept {
            // There is room, or the planner would wait.
            let added = self.waiting.push_back(turn);
            debug_assert!(added.is_ok());
        }
    }

    pub(super) fn clear(&mut self) {
        self.waiting.clear();
    }
}

impl Runner<'_> {
    /// Whether turns matter, while nothing moves.
    pub fn keep_turns(&mut self, keep: bool) {
        self.turns.are_kept = keep;
    }

    /// Whether the pins must move on before more is planned.
    pub fn waits_for_turns(&self) -> bool {
        self.turns.waiting.is_full()
    }

    /// The turns that wait for the pins, in their order.
    pub fn turns(&self) -> impl Iterator<Item = Turn> {
        self.turns.waiting.iter().copied()
    }

    /// The first turn that waits, if the pins have begun it; it waits no more.
    pub fn next_turn_begun(&mut self, ticks: u32) -> Option<Turn> {
        let turn = self.turns.waiting.front().filter(|turn| turn.has_begun(ticks));
        if turn.is_some() { self.turns.waiting.pop_front() } else { None }
    }

    /// All steps of each motor so far; they wrap.
    pub fn motor_steps(&self) -> [i32; 2] {
        sum(self.position, self.slack)
    }

    /// All steps of each motor of the blocks so far; they wrap.
    pub fn motor_steps_end(&self) -> [i32; 2] {
        sum(self.end, self.slack_end)
    }

    /// Tells how the next move that is appended takes up slack on the way.
    pub fn set_on_the_way(&mut self, on_the_way: OnTheWay) {
        self.on_the_way = on_the_way;
    }

    /// Whether a full line goes on as such.
    pub fn is_in_line(&self) -> bool {
        self.last.is_some_and(|(_, _, ink)| ink == Some(crate::drawing::LineType::Full))
    }
}
