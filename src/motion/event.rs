//! The step event, which is one word, and the queue in which events wait for the step interrupt.

use super::brake::LengthStart;
use crate::step::Direction;
use crate::step::tape::Instruction;

/// An instruction to the step interrupt: levels of the pins, and the time until the next event.
///
/// | bits | of a move | of the pen |
/// |---|---|---|
/// | 0, 1 | pulse x, pulse y | height, bits 0 to 6 |
/// | 2, 3 | x, y counts down | |
/// | 4 | drivers on | |
/// | 5 | at rest afterwards; with a pulse: takes up backlash | |
/// | 6 | 0 | |
/// | 7 | 0 | 1 |
/// | 8–31 | ticks to the next event | the same |
///
/// A word with bit 6 set and bit 7 clear is of another kind. With bit 2 it is an event of the motor
/// that lifts the pen: bit 3 is a pulse, and bit 4 says that it counts down. Without bit 2 it is no
/// event, but tells how long the steps behind it are: see [`StepBrake`](super::StepBrake).
///
/// A change of direction is a separate event without a pulse, before the event with the pulse.
/// Waits longer than 2^24 - 1 ticks (0.67 s) take several events.
///
/// ```
/// use penup::motion::{EventKind, StepEvent};
/// let event = StepEvent::pen(100, 25_000);
/// assert_eq!(event.kind(), EventKind::Pen { height: 100 });
/// assert_eq!(event.ticks(), 25_000);
/// let event = StepEvent::levels(StepEvent::STEP_X | StepEvent::DOWN_Y, 500);
/// assert_eq!(event.step(), (1, 0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct StepEvent(u32);

/// A decoded [`StepEvent`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// Levels of the axes' pins: the low seven bits, see the constants of [`StepEvent`].
    Levels(u8),
    /// The pen goes to a height: 0 raised fully, 127 lowered fully.
    Pen {
        /// The height, 0 to 127.
        height: u8,
    },
    /// The motor that lifts the pen: its direction pin takes a level, and it may step.
    Lift {
        /// Whether the motor makes a step.
        step: bool,
        /// Whether it moves towards the paper.
        down: bool,
    },
}

impl StepEvent {
    /// A pulse on x.
    pub const STEP_X: u8 = 1;
    /// A pulse on y.
    pub const STEP_Y: u8 = 1 << 1;
    /// x counts down.
    pub const DOWN_X: u8 = 1 << 2;
    /// y counts down.
    pub const DOWN_Y: u8 = 1 << 3;
    /// The drivers hold the motors.
    pub const DRIVERS_ON: u8 = 1 << 4;
    /// Nothing moves after this event, so the queue may run empty. With a pulse: the motor takes up
    /// its backlash, and the pen stays where it is.
    pub const AT_REST: u8 = 1 << 5;
    /// The longest wait that one event can hold.
    pub const MAX_TICKS: u32 = (1 << 24) - 1;

    pub(crate) const PEN: u8 = 1 << 7;
    pub(crate) const LENGTH: u8 = 1 << 6;
    pub(crate) const LIFT: u8 = 1 << 2;
    const LIFT_STEP: u8 = 1 << 3;
    const LIFT_DOWN: u8 = 1 << 4;

    /// An event that sets the axes' pins to `levels` (an "or" of the constants) and lasts `ticks`,
    /// which are limited to [`StepEvent::MAX_TICKS`].
    pub const fn levels(levels: u8, ticks: u32) -> Self {
        Self::new(levels & !(Self::PEN | Self::LENGTH), ticks)
    }

    /// An event that sends the pen to `height` (0 to 127) and lasts `ticks`.
    pub const fn pen(height: u8, ticks: u32) -> Self {
        Self::new(height | Self::PEN, ticks)
    }

    /// An event that sets the direction of the motor that lifts the pen, makes a step if `step`,
    /// and lasts `ticks`.
    pub const fn lift(step: bool, down: bool, ticks: u32) -> Self {
        let step = if step { Self::LIFT_STEP } else { 0 };
        let down = if down { Self::LIFT_DOWN } else { 0 };
        Self::new(Self::LENGTH | Self::LIFT | step | down, ticks)
    }

    /// Whether the word is neither of a move nor of the height of the pen.
    #[inline(always)]
    pub const fn is_aside(self) -> bool {
        self.0 & (Self::PEN | Self::LENGTH) as u32 == Self::LENGTH as u32
    }

    /// Whether the word is no event, but describes those behind it.
    #[inline(always)]
    pub(crate) const fn is_told(self) -> bool {
        const ASIDE: u8 = StepEvent::PEN | StepEvent::LENGTH | StepEvent::LIFT;
        self.0 as u8 & ASIDE == Self::LENGTH
    }

    /// A word that tells the length of the steps behind it, in units below 2^16, and the first step
    /// to which that applies.
    pub(crate) const fn step_length(units: u32, start: LengthStart) -> Self {
        Self::new(Self::LENGTH, units | (start as u32) << 16)
    }

    /// What a word made by [`StepEvent::step_length`] tells.
    #[inline(always)]
    pub(crate) const fn told_length(self) -> (u32, LengthStart) {
        let start = match self.0 >> 24 {
            0 => LengthStart::Next,
            1 => LengthStart::AfterNext,
            _ => LengthStart::Anew,
        };
        (self.0 >> 8 & 0xFFFF, start)
    }

    const SKIP_NEXT: u32 = 1 << 31;

    /// A word that tells that the next pulse does not count as a step along the path.
    pub(crate) const fn skip_next() -> Self {
        Self(Self::SKIP_NEXT | Self::LENGTH as u32)
    }

    /// Whether the word was made by [`StepEvent::skip_next`].
    #[inline(always)]
    pub(crate) const fn skips_next(self) -> bool {
        self.0 & Self::SKIP_NEXT != 0
    }

    const fn new(flags: u8, ticks: u32) -> Self {
        let ticks = if ticks > Self::MAX_TICKS { Self::MAX_TICKS } else { ticks };
        Self(ticks << 8 | flags as u32)
    }

    /// The event as the word that a board feeds to a state machine by DMA.
    pub const fn to_bits(self) -> u32 {
        self.0
    }

    /// The event that a word represents.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Ticks from the start of this event to the start of the next.
    pub const fn ticks(self) -> u32 {
        self.0 >> 8
    }

    /// Decodes the event.
    #[inline(always)] // Not a call in the step interrupt.
    pub const fn kind(self) -> EventKind {
        let flags = self.0 as u8;
        if flags & Self::PEN != 0 {
            EventKind::Pen { height: flags & !Self::PEN }
        } else if self.is_aside() {
            let (step, down) = (flags & Self::LIFT_STEP != 0, flags & Self::LIFT_DOWN != 0);
            EventKind::Lift { step, down }
        } else {
            EventKind::Levels(flags)
        }
    }

    /// What the event adds to the position along x and y; nothing where the motors take up their
    /// backlash.
    pub const fn step(self) -> (i32, i32) {
        if self.takes_up_backlash() { (0, 0) } else { self.pulses() }
    }

    /// The step of each motor, with its sign.
    pub const fn pulses(self) -> (i32, i32) {
        match self.kind() {
            EventKind::Pen { .. } | EventKind::Lift { .. } => (0, 0),
            EventKind::Levels(levels) => (
                axis_step(levels, Self::STEP_X, Self::DOWN_X),
                axis_step(levels, Self::STEP_Y, Self::DOWN_Y),
            ),
        }
    }

    /// Whether the event is a step by which motors take up their backlash.
    pub const fn takes_up_backlash(self) -> bool {
        let pulses = (Self::STEP_X | Self::STEP_Y) as u32;
        self.0 & pulses != 0 && self.0 & (Self::PEN | Self::AT_REST) as u32 == Self::AT_REST as u32
    }

    /// Whether the event is a step along the path.
    pub const fn is_step(self) -> bool {
        let pulses = (Self::STEP_X | Self::STEP_Y) as u32;
        self.0 & pulses != 0 && self.0 & (Self::PEN | Self::AT_REST) as u32 == 0
    }

    /// What a tape would hold of the event: a move, or the pen going up (height below 64) or down.
    pub fn instruction(self) -> Option<Instruction> {
        match self.kind() {
            EventKind::Pen { height } if height < 64 => Some(Instruction::PenUp),
            EventKind::Pen { .. } => Some(Instruction::PenDown),
            EventKind::Lift { .. } => None,
            EventKind::Levels(_) => {
                let (dx, dy) = self.step();
                Direction::from_delta(dx, dy).map(Instruction::Move)
            }
        }
    }

    pub(crate) const fn with_ticks(self, ticks: u32) -> Self {
        Self::new(self.0 as u8, ticks)
    }
}

const fn axis_step(levels: u8, pulse: u8, down: u8) -> i32 {
    if levels & pulse == 0 {
        0
    } else if levels & down == 0 {
        1
    } else {
        -1
    }
}

/// Steps at even intervals along a line.
///
/// Times are in units of 2^-15 ticks from an arbitrary origin. Events are words without their
/// ticks. A step is handed over when the next one is known, because it lasts until then. A board
/// may make the words of its queue directly from the fields, as [`StepTrain::push_each`] does.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct StepTrain {
    /// The time of the next step.
    pub time: u32,
    /// The time from each step to the next, never shorter than two pulses.
    pub interval: u32,
    /// The time of the step that has not been handed over, in whole ticks.
    pub before: u32,
    /// The event of the step that has not been handed over.
    pub event: u32,
    /// The event of a straight step of the train.
    pub straight: u32,
    /// The event of a diagonal step of the train.
    pub diagonal: u32,
    /// The decision variable of the line: if it is positive, the next step is diagonal.
    pub balance: i32,
    /// What a straight step adds to `balance`.
    pub gain: i32,
    /// What a diagonal step subtracts from `balance`.
    pub loss: i32,
    /// The number of diagonal steps so far.
    pub diagonals: u32,
}

impl StepTrain {
    /// The number of bits of times and intervals that are fractions of a tick.
    pub const FRACTION_BITS: u32 = 15;

    /// Hands the next `count` steps over.
    ///
    /// # Errors
    /// The error of `push`.
    #[inline]
    pub fn push_each(
        &mut self,
        count: u32,
        mut push: impl FnMut(StepEvent) -> Result<(), StepEvent>,
    ) -> Result<(), StepEvent> {
        for _ in 0..count {
            let ticks = self.time >> Self::FRACTION_BITS;
            // Waits are below 2^24 ticks.
            push(StepEvent(self.event + (ticks.wrapping_sub(self.before) << 8)))?;
            self.before = ticks;
            // The time can wrap only after the last step.
            self.time = self.time.wrapping_add(self.interval);
            if self.balance > 0 {
                self.balance -= self.loss;
                self.event = self.diagonal;
                self.diagonals += 1;
            } else {
                self.balance += self.gain;
                self.event = self.straight;
            }
        }
        Ok(())
    }

    /// Replaces each of the three events by `turn` of it.
    #[inline]
    pub fn convert(&mut self, turn: impl Fn(u32) -> u32) {
        for event in [&mut self.event, &mut self.straight, &mut self.diagonal] {
            *event = turn(*event);
        }
    }
}

/// The destination of planned events: the interrupt's queue on a board, a recorder in tests.
pub trait EventQueue {
    /// How many more events fit.
    fn room(&self) -> usize;
    /// Appends an event.
    ///
    /// # Errors
    /// Hands the event back if the queue is full.
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent>;
    /// Appends the next `count` steps of a train, at least one. There must be room.
    ///
    /// # Errors
    /// Hands back the first event for which the queue has no room after all.
    fn push_train(&mut self, train: &mut StepTrain, count: u32) -> Result<(), StepEvent> {
        train.push_each(count, |event| self.push(event))
    }
    /// Tells the length of the steps that follow, in units of the [`BrakeRule`](super::BrakeRule),
    /// below 2^16. With `after_next`, the next step still has the old length. This takes as much
    /// room in the queue as an event.
    ///
    /// # Errors
    /// The word for which the queue has no room.
    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        let _ = (units, after_next);
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::vec::Vec;

    /// A queue that is never full.
    #[derive(Default)]
    pub(crate) struct Events(pub(crate) Vec<StepEvent>);

    impl EventQueue for Events {
        fn room(&self) -> usize {
            usize::MAX
        }
        fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
            self.0.push(event);
            Ok(())
        }
    }

    #[test]
    fn a_tape_holds_moves_and_whether_the_pen_is_up_or_down() {
        for height in 0..128u8 {
            let expected = if height < 64 { Instruction::PenUp } else { Instruction::PenDown };
            assert_eq!(StepEvent::pen(height, 7).instruction(), Some(expected), "{height}");
        }
        assert_eq!(StepEvent::lift(true, false, 7).instruction(), None);
        let up = StepEvent::levels(StepEvent::STEP_Y | StepEvent::DRIVERS_ON, 7);
        assert_eq!(up.instruction(), Some(Instruction::Move(Direction::Up)));
        let left = StepEvent::levels(StepEvent::STEP_X | StepEvent::DOWN_X, 7);
        assert_eq!(left.instruction(), Some(Instruction::Move(Direction::Left)));
        let backlash = StepEvent::levels(StepEvent::STEP_X | StepEvent::AT_REST, 7);
        assert_eq!(backlash.instruction(), None);
    }

    #[test]
    fn a_word_tells_one_thing() {
        let step = StepEvent::levels(StepEvent::STEP_X | StepEvent::DOWN_Y, 9);
        let direction = StepEvent::levels(StepEvent::DOWN_X | StepEvent::DRIVERS_ON, 9);
        let backlash =
            StepEvent::levels(StepEvent::STEP_Y | StepEvent::DOWN_Y | StepEvent::AT_REST, 9);
        let pen = StepEvent::pen(65, 9);
        let lift = StepEvent::lift(true, true, 9);
        for event in [step, direction, backlash, pen, lift] {
            assert!(!event.is_told() && event.ticks() == 9, "{event:?}");
            assert_eq!(event.is_step(), event == step, "{event:?}");
            assert_eq!(event.takes_up_backlash(), event == backlash, "{event:?}");
            assert_eq!(StepEvent::from_bits(event.to_bits()), event);
        }
        assert_eq!(step.step(), (1, 0));
        assert_eq!((backlash.step(), backlash.pulses()), ((0, 0), (0, -1)));
        assert_eq!([direction, pen, lift].map(StepEvent::pulses), [(0, 0); 3]);
        assert_eq!(pen.kind(), EventKind::Pen { height: 65 });
        for (step, down) in [(false, false), (false, true), (true, false), (true, true)] {
            assert_eq!(StepEvent::lift(step, down, 9).kind(), EventKind::Lift { step, down });
        }
        for start in [LengthStart::Next, LengthStart::AfterNext, LengthStart::Anew] {
            let told = StepEvent::step_length(0xABCD, start);
            assert!(told.is_told() && !told.skips_next());
            assert_eq!(told.told_length(), (0xABCD, start));
        }
        let skip = StepEvent::skip_next();
        assert!(skip.is_told() && skip.skips_next());
    }
}
