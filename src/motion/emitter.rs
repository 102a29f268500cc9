//! Converts moves and pen changes with their times to step events. It observes the least intervals
//! and the set-up time of directions, and splits long waits.

use super::lift::LiftStep;
use super::profile::FRACTION_BITS;
use super::{EventQueue, Limits, StepEvent, StepTrain};
use crate::step::{Direction, Line};

/// Builds events. The last one is kept back until the time of the next is known, because it lasts
/// until then.
///
/// Times are in sixteenths of ticks and wrap; they are rounded down to whole ticks here. Two calls
/// are less than 2^31 sixteenths (5 s) apart.
#[derive(Debug)]
pub struct Emitter {
    /// The least time between two pulses, in sixteenths of ticks.
    least_interval: u32,
    /// The time from a change of direction to the pulse, in sixteenths of ticks.
    setup: u32,
    /// The levels of the direction pins.
    directions: u8,
    /// The event that is kept back, and its time.
    pending: Option<(StepEvent, u32)>,
    /// The ticks of all events handed over; wraps.
    ticks: u32,
}

impl Emitter {
    /// The room in the queue that one call may need.
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

    /// The ticks of all events handed over; wraps.
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Whether the last event was a move.
    pub(super) fn has_stepped(&self) -> bool {
        self.pending.is_some_and(|(event, _)| event.is_step())
    }

    /// Whether an event is kept back.
    pub(super) fn is_open(&self) -> bool {
        self.pending.is_some()
    }

    /// Makes a move at `time`, or later if the pins need longer. Returns the time of the move.
    #[inline]
    pub(super) fn step(
        &mut self,
        levels: MoveLevels,
        mut time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        time = whole_ticks(time);
        if self.reverses(levels) {
            self.directions = (self.directions & !levels.axes()) | levels.directions();
            let at = time.wrapping_sub(self.setup);
            let at = self.put(self.holding(), at, queue)?;
            time = later(time, at.wrapping_add(self.setup));
            // The pending event pulses nothing, so no pause is due after it.
            self.hand_over(time, queue)?;
            self.pending = Some((StepEvent::levels(self.level_bits() | levels.pulses(), 0), time));
            return Ok(time);
        }
        self.put(StepEvent::levels(self.level_bits() | levels.pulses(), 0), time, queue)
    }

    /// Whether the move needs other levels at the direction pins.
    pub(super) fn reverses(&self, levels: MoveLevels) -> bool {
        (self.directions ^ levels.0) & levels.axes() != 0
    }

    /// Makes some moves of `line` at the times of `train` after `start`, or later if the pins need
    /// longer. The moves must not [reverse](Emitter::reverses) an axis, must follow [another
    /// move](Emitter::has_stepped), and must not be faster than [`Emitter::keeps_up`] allows.
    pub(super) fn steps(
        &mut self,
        start: u32,
        train: Train,
        line: &mut Line,
        levels: LineLevels,
        queue: &mut dyn EventQueue,
    ) -> Result<TrainResult, StepEvent> {
        let Some((event, since)) = self.pending else {
            return Ok(TrainResult::default());
        };
        let level_bits = self.level_bits();
        let event_of =
            |levels: MoveLevels| StepEvent::levels(level_bits | levels.pulses(), 0).to_bits();
        // All times are counted from here, which is a whole tick.
        let due = whole_ticks(train.due(start, 0));
        let late = later(due, since.wrapping_add(self.least_interval)).wrapping_sub(due);
        let begin = whole_ticks(start).wrapping_add(late);
        let ahead = since.wrapping_sub(begin).cast_signed() >> FRACTION_BITS;
        let [balance, gain, loss] = line.rule();
        let mut steps = StepTrain {
            time: train.first + ((start - whole_ticks(start)) << Train::BITS_BELOW),
            interval: train.interval,
            before: ahead.cast_unsigned(),
            event: event.to_bits(),
            straight: event_of(levels.straight),
            diagonal: event_of(levels.diagonal),
            balance,
            gain,
            loss,
            diagonals: 0,
        };
        if train.count > 0 {
            queue.push_train(&mut steps, train.count as u32)?;
        }
        line.go_on(steps.balance, train.count);
        let last = begin.wrapping_add(steps.before << FRACTION_BITS);
        self.ticks = self.ticks.wrapping_add(last.wrapping_sub(since) >> FRACTION_BITS);
        self.pending = Some((StepEvent::from_bits(steps.event), last));
        let diagonals = steps.diagonals as usize;
        Ok(TrainResult { late, diagonals })
    }

    /// Makes some moves of `line`, like [`Emitter::steps`], but one by one and without its
    /// conditions.
    pub(super) fn single_steps(
        &mut self,
        start: u32,
        train: Train,
        line: &mut Line,
        levels: LineLevels,
        queue: &mut dyn EventQueue,
    ) -> Result<TrainResult, StepEvent> {
        let mut stepped = TrainResult::default();
        for number in 0..train.count as u32 {
            let is_diagonal = line.next_is_diagonal();
            stepped.diagonals += usize::from(is_diagonal);
            let due = whole_ticks(train.due(start, number)).wrapping_add(stepped.late);
            let levels = if is_diagonal { levels.diagonal } else { levels.straight };
            let at = self.step(levels, due, queue)?;
            stepped.late = stepped.late.wrapping_add(at.wrapping_sub(due));
        }
        Ok(stepped)
    }

    /// Whether the pins keep up with the intervals of a train.
    pub(super) fn keeps_up(&self, train: &Train) -> bool {
        // Rounded down to whole ticks, an interval may lose one.
        (train.interval >> Train::BITS_BELOW) & !((1 << FRACTION_BITS) - 1) >= self.least_interval
    }

    /// Adds an event at `time` that changes nothing. It begins the sequence of events, or splits a
    /// long wait.
    pub(super) fn hold(&mut self, time: u32, queue: &mut dyn EventQueue) -> Result<u32, StepEvent> {
        self.put(self.holding(), time, queue)
    }

    /// Adds an event like [`Emitter::hold`], from which on nothing moves, so that the queue may run
    /// empty before the next one.
    pub(super) fn pause(
        &mut self,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        self.put(StepEvent::levels(self.level_bits() | StepEvent::AT_REST, 0), time, queue)
    }

    /// Splits the wait if the pending event is older than 2^22 ticks.
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

    /// Returns the middle between the last event and one at `time`, but not before `least`. The
    /// middle is far from both, because the pen of a board may move some microseconds late. `None`
    /// if an event there would delay the one at `time`.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn midway(&self, least: u32, time: u32) -> Option<u32> {
        let (_, since) = self.pending?;
        let middle = since.wrapping_add(time.wrapping_sub(since) / 2);
        let at = later(later(least, middle), since.wrapping_add(self.least_interval));
        let is_free = later(time, at.wrapping_add(self.least_interval)) == time;
        is_free.then_some(at)
    }

    /// Sends the pen to `height` at `time`.
    pub(super) fn pen(
        &mut self,
        height: u8,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        self.put(StepEvent::pen(height, 0), time, queue)
    }

    /// Carries out the next action of the pen's motor at `time`.
    pub(super) fn lift(
        &mut self,
        next: LiftStep,
        time: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<u32, StepEvent> {
        self.put(StepEvent::lift(next.step, next.down, 0), time, queue)
    }

    /// Ends the sequence of events at `time`. From then on nothing moves and the queue may run
    /// empty.
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

    /// Forgets the pending event after the queue was discarded. The events carried out lasted
    /// `ticks`.
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

    /// Hands over the pending event, which lasts `until` the next one.
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

/// The times of moves at even intervals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Train {
    /// The time until the first move, in units of 2^-15 ticks.
    pub(super) first: u32,
    /// The time from one move to the next, in units of 2^-15 ticks.
    pub(super) interval: u32,
    /// The number of moves; the last one is less than 2^17 ticks away.
    pub(super) count: usize,
}

impl Train {
    /// The number of fractional bits of a time that are below sixteenths of ticks.
    pub(super) const BITS_BELOW: u32 = StepTrain::FRACTION_BITS - FRACTION_BITS;

    /// The time at which a move is due, in sixteenths of ticks, if the train begins at `start`.
    pub(super) fn due(&self, start: u32, number: u32) -> u32 {
        let after = self.first.wrapping_add(self.interval.wrapping_mul(number));
        start.wrapping_add(after >> Self::BITS_BELOW)
    }
}

/// The result of making the moves of a [`Train`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct TrainResult {
    /// By how much the moves were delayed, in sixteenths of ticks.
    pub(super) late: u32,
    /// The number of diagonal moves.
    pub(super) diagonals: usize,
}

/// Rounds a time down to whole ticks.
pub(super) const fn whole_ticks(time: u32) -> u32 {
    time >> FRACTION_BITS << FRACTION_BITS
}

fn later(a: u32, b: u32) -> u32 {
    if (a.wrapping_sub(b)).cast_signed() < 0 { b } else { a }
}

/// The levels of the pins for the two kinds of moves of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineLevels {
    pub(super) straight: MoveLevels,
    pub(super) diagonal: MoveLevels,
}

/// The levels of the pins for a move: a pulse for each axis that steps, the level of its direction
/// pin where it counts down, and [`StepEvent::AT_REST`] where the move takes up backlash.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MoveLevels(u8);

impl MoveLevels {
    const PULSES: u8 = StepEvent::STEP_X | StepEvent::STEP_Y;
    const DIRECTIONS: u8 = StepEvent::DOWN_X | StepEvent::DOWN_Y;

    /// The levels for a move in `direction`.
    pub(super) fn of(direction: Direction) -> Self {
        /// The levels for all directions, indexed by their numbers.
        const ALL: [MoveLevels; 9] = {
            let mut all = [MoveLevels(0); 9];
            let mut index = 0;
            while index < Direction::ALL.len() {
                let direction = Direction::ALL[index];
                all[direction as usize] = MoveLevels::for_direction(direction);
                index += 1;
            }
            all
        };
        ALL[direction as usize]
    }

    const fn for_direction(direction: Direction) -> Self {
        let (dx, dy) = direction.delta();
        let x = match dx {
            0 => 0,
            1 => StepEvent::STEP_X,
            _ => StepEvent::STEP_X | StepEvent::DOWN_X,
        };
        let y = match dy {
            0 => 0,
            1 => StepEvent::STEP_Y,
            _ => StepEvent::STEP_Y | StepEvent::DOWN_Y,
        };
        Self(x | y)
    }

    /// The levels for the same move if it takes up backlash.
    pub(super) const fn for_backlash(self) -> Self {
        Self(self.0 | StepEvent::AT_REST)
    }

    /// The levels without those of the direction pins.
    const fn pulses(self) -> u8 {
        self.0 & !Self::DIRECTIONS
    }

    /// The levels of the direction pins.
    const fn directions(self) -> u8 {
        self.0 & Self::DIRECTIONS
    }

    /// The direction pins of the axes that step.
    const fn axes(self) -> u8 {
        // The direction pins are in the order of the pulses.
        (self.0 & Self::PULSES) * (StepEvent::DOWN_X / StepEvent::STEP_X)
    }
}
