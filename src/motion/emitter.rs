//! Puts moves and pen changes on the time line: least intervals, direction set-up, long waits.

use super::lift::LiftStep;
use super::profile::FRACTION_BITS;
use super::{EventQueue, Limits, StepEvent};
use crate::step::Direction;

/// As many moves are worked out together: a small core then has registers for each part of the work.
pub(super) const BATCH: usize = 32;

/// Builds events. The last one is kept back until the time of the next is known.
///
/// Times are sixteenths of ticks that wrap, cut to whole ticks here; two calls lie less than 2^31
/// of them (5 s) apart.
#[derive(Debug)]
pub struct Emitter {
    /// Sixteenths of ticks.
    least_interval: u32,
    /// Sixteenths of ticks.
    setup: u32,
    /// Level of the direction pins.
    directions: u8,
    pending: Option<(StepEvent, u32)>,
    /// Of all events handed over; wraps.
    ticks: u32,
}

impl Emitter {
    /// Room in the queue that one call may need.
    pub const ROOM: usize = 4;

    pub(super) fn new(limits: &Limits) -> Self {
        Self {
            least_interval: limits.least_interval() << FRACTION_BITS,
            setup: limits.setup_ticks << FRACTION_BITS,
            directions: 0,
            pending: None,
            ticks: 0,
        }
    }

    pub(super) fn set_limits(&mut self, limits: &Limits) {
        self.least_interval = limits.least_interval() << FRACTION_BITS;
        self.setup = limits.setup_ticks << FRACTION_BITS;
    }

    /// Ticks of all events handed over; wraps.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Whether the last event was a move.
    pub(super) fn has_stepped(&self) -> bool {
        self.pending.is_some_and(|(event, _)| event.is_step())
    }

    /// Whether an event waits for the time of the next.
    pub(super) fn is_open(&self) -> bool {
        self.pending.is_some()
    }

    /// One move at `time`, or later if the pins need longer. Returns when.
    #[inline]
    pub(super) fn step(
        &mut self,
        levels: MoveLevels,
        mut time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        time = whole_ticks(time);
        if self.turns(levels) {
            self.directions = (self.directions & !levels.axes) | levels.directions;
            let at = time.wrapping_sub(self.setup);
            let at = self.put(self.holding(), at, queue)?;
            time = later(time, at.wrapping_add(self.setup));
            // The pending event pulses nothing, so no pause is due after it.
            self.hand_over(time, queue)?;
            self.pending = Some((StepEvent::levels(self.level_bits() | levels.pulses, 0), time));
            return Ok(time);
        }
        self.put(StepEvent::levels(self.level_bits() | levels.pulses, 0), time, queue)
    }

    /// Whether the move needs other levels at the direction pins.
    pub(super) fn turns(&self, levels: MoveLevels) -> bool {
        (self.directions ^ levels.directions) & levels.axes != 0
    }

    /// Some moves, each one of two kinds that do not [turn](Emitter::turns), after
    /// [another](Emitter::has_stepped). Each takes place at its time in whole ticks, or later if the pins
    /// need longer. Returns by how much later the last one is.
    #[inline(never)] // On its own it stays in the registers of a small core.
    pub(super) fn steps(
        &mut self,
        times: &[u32],
        kinds: &[u8],
        levels: [MoveLevels; 2],
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        let Some((mut event, mut since)) = self.pending else {
            return Ok(0);
        };
        let level_bits = self.level_bits();
        let kinds_of_event =
            levels.map(|move_levels| StepEvent::levels(level_bits | move_levels.pulses, 0));
        let mut events = [event; BATCH];
        let (least_interval, began) = (self.least_interval, since);
        let mut late = 0u32;
        for ((next, &time), &kind) in events.iter_mut().zip(times).zip(kinds) {
            let planned = time.wrapping_add(late);
            let at = later(planned, since.wrapping_add(least_interval));
            late = late.wrapping_add(at.wrapping_sub(planned));
            *next = event.with_ticks(at.wrapping_sub(since) >> FRACTION_BITS);
            event = kinds_of_event[usize::from(kind & 1)];
            since = at;
        }
        queue.push_steps(&events[..times.len().min(BATCH)])?;
        self.ticks = self.ticks.wrapping_add(since.wrapping_sub(began) >> FRACTION_BITS);
        self.pending = Some((event, since));
        Ok(late)
    }

    /// Nothing changes at `time`: begins the time line, or splits a long wait.
    pub(super) fn hold(&mut self, time: u32, queue: &mut dyn EventQueue) -> Result<u32, StepEvent> {
        self.put(self.holding(), time, queue)
    }

    /// If the pending event is older than 2^22 ticks, splits the wait.
    #[inline]
    pub(super) fn split_long_wait(
        &mut self,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        match self.pending {
            Some((_, since)) if time.wrapping_sub(since) > 1 << (22 + FRACTION_BITS) => {
                self.hold(time, queue).map(|_| ())
            }
            _ => Ok(()),
        }
    }

    /// The pen goes to `height` at `time`.
    pub(super) fn pen(
        &mut self,
        height: u8,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        self.put(StepEvent::pen(height, 0), time, queue)
    }

    /// The pen's motor does this at `time`.
    pub(super) fn lift(
        &mut self,
        next: LiftStep,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        self.put(StepEvent::lift(next.step, next.down, 0), time, queue)
    }

    /// Everything stands from `time` on and the queue may run dry.
    pub(super) fn rest(
        &mut self,
        time: u32,
        drivers_on: bool,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        let levels = if drivers_on { self.level_bits() } else { self.directions };
        let time = self.put(StepEvent::levels(levels | StepEvent::AT_REST, 0), time, queue)?;
        let after = time.wrapping_add(self.least_interval);
        self.hand_over(after, queue)?;
        Ok(after)
    }

    /// Forgets the pending event: the queue was thrown away, after `ticks`.
    pub(super) fn restart(&mut self, ticks: u32) {
        self.pending = None;
        self.ticks = ticks;
    }

    fn level_bits(&self) -> u8 {
        self.directions | StepEvent::DRIVERS_ON
    }

    fn holding(&self) -> StepEvent {
        StepEvent::levels(self.level_bits(), 0)
    }

    #[inline]
    fn put(
        &mut self,
        event: StepEvent,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        let time = whole_ticks(time);
        let time = match self.pending {
            Some((_, since)) => later(time, since.wrapping_add(self.least_interval)),
            None => time,
        };
        self.hand_over(time, queue)?;
        self.pending = Some((event, time));
        Ok(time)
    }

    /// Hands the pending event over; the next begins at `until`.
    #[inline]
    fn hand_over(&mut self, until: u32, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        if let Some((event, since)) = self.pending {
            let ticks = until.wrapping_sub(since) >> FRACTION_BITS;
            queue.push(event.with_ticks(ticks))?;
            self.ticks = self.ticks.wrapping_add(ticks);
            self.pending = None;
        }
        Ok(())
    }
}

/// Cuts the sixteenths.
pub(super) const fn whole_ticks(time: u32) -> u32 {
    time >> FRACTION_BITS << FRACTION_BITS
}

fn later(a: u32, b: u32) -> u32 {
    if (a.wrapping_sub(b)).cast_signed() < 0 { b } else { a }
}

/// What a move does to the pins.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MoveLevels {
    /// The axes that step, and whether they take up slack.
    pulses: u8,
    /// Their direction pins.
    axes: u8,
    /// Those of them that count down.
    directions: u8,
}

impl MoveLevels {
    /// Those of a move in `direction`.
    pub(super) const fn of(direction: Direction) -> Self {
        let (dx, dy) = direction.delta();
        let mut levels = Self { pulses: 0, axes: 0, directions: 0 };
        if dx != 0 {
            levels.pulses |= StepEvent::STEP_X;
            levels.axes |= StepEvent::DOWN_X;
        }
        if dy != 0 {
            levels.pulses |= StepEvent::STEP_Y;
            levels.axes |= StepEvent::DOWN_Y;
        }
        if dx < 0 {
            levels.directions |= StepEvent::DOWN_X;
        }
        if dy < 0 {
            levels.directions |= StepEvent::DOWN_Y;
        }
        levels
    }

    /// The same where the motors take up their slack.
    pub(super) const fn as_slack(self) -> Self {
        Self { pulses: self.pulses | StepEvent::AT_REST, ..self }
    }
}
