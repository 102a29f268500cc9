//! Puts moves and pen changes on the time line: least intervals, direction set-up, long waits.

use super::profile::FRACTION_BITS;
use super::{EventQueue, Limits, StepEvent};
use crate::step::Direction;

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

    /// Whether an event waits for the time of the next.
    pub(super) fn is_open(&self) -> bool {
        self.pending.is_some()
    }

    /// One move at `time`, or later if the pins need longer. Returns when.
    #[inline]
    pub(super) fn step(
        &mut self,
        direction: Direction,
        mut time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        time = whole_ticks(time);
        let (pulses, axes, directions) = levels(direction);
        let wanted = (self.directions & !axes) | directions;
        if wanted != self.directions {
            self.directions = wanted;
            let at = time.wrapping_sub(self.setup);
            let at = self.put(self.holding(), at, queue)?;
            time = later(time, at.wrapping_add(self.setup));
            // The pending event pulses nothing, so no pause is due after it.
            self.hand_over(time, queue)?;
            self.pending = Some((StepEvent::levels(self.level_bits() | pulses, 0), time));
            return Ok(time);
        }
        self.put(StepEvent::levels(self.level_bits() | pulses, 0), time, queue)
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

/// Pulse bits, the direction bits of the axes that move, and their levels.
#[inline]
fn levels(direction: Direction) -> (u8, u8, u8) {
    const TABLE: [(u8, u8, u8); 9] = {
        let mut table = [(0, 0, 0); 9];
        let mut number = 0;
        while number < 8 {
            let direction = Direction::ALL[number];
            let (dx, dy) = direction.delta();
            let mut pulses = 0;
            let mut axes = 0;
            let mut down = 0;
            if dx != 0 {
                pulses |= StepEvent::STEP_X;
                axes |= StepEvent::DOWN_X;
            }
            if dy != 0 {
                pulses |= StepEvent::STEP_Y;
                axes |= StepEvent::DOWN_Y;
            }
            if dx < 0 {
                down |= StepEvent::DOWN_X;
            }
            if dy < 0 {
                down |= StepEvent::DOWN_Y;
            }
            table[direction as usize] = (pulses, axes, down);
            number += 1;
        }
        table
    };
    TABLE[direction as usize]
}
