//! The delay line of an input shaper: it takes the planned motion, and makes the steps of the sum
//! of its delayed copies.
//!
//! The plan is a sequence of [`Run`]s, in each of which both axes have a constant speed. So each
//! copy is such a sequence, too, and between two ends of runs of any copy (a [`Segment`]) the
//! shaped speed is constant. Positions are exact sums in whole numbers, the same on every machine:
//! once the last copy has come to rest, exactly the planned steps have been made.
//!
//! In a segment, the motor that is the faster one steps when it is half a step from its new
//! position. The other one steps at the same instants, if it is nearer to its next position by the
//! time that the faster one reaches its own. So a straight line has the moves of the incremental
//! algorithm, the steps follow each other evenly, and the brake of the interrupt can treat them as
//! any others. The faster motor is off by half a step, the slower one by up to a whole one, and by
//! up to 2 1/4 for a moment where the motors exchange these roles or turn round.
//!
//! Beside the room of the delay line this costs, at each end of a run of each copy, a few
//! multiplications and up to three divisions of 64 bits, and some additions for each step.

use super::emitter::{Emitter, MoveLevels};
use super::limits::hypotenuse;
use super::shaping::{RUN_TIME, RUNS, Shaping};
use super::{BrakeRule, EventQueue, Limits, StepEvent};
use crate::array::MapEach;
use crate::drawing::PagePoint;
use crate::step::Direction;

/// The number of fractional bits of a planned position in steps.
pub(super) const POSITION_BITS: u32 = 32;

/// A step in the unit of shaped positions, 2^-48.
const STEP: i64 = 1 << 48;

/// The fractional bits of times within a segment, below sixteenths of ticks.
const TIME_BITS: u32 = 8;

/// A planned motion at constant speed.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    /// In sixteenths of ticks.
    time: u32,
    /// The speed of each axis, in 2^-32 steps for each sixteenth of a tick.
    speeds: [i32; 2],
}

/// How far a copy has come.
#[derive(Debug, Clone, Copy, Default)]
struct Copied {
    weight: u32,
    /// The time until its current run ends, in sixteenths of ticks. Before its first run it is at
    /// rest for as long as it is delayed.
    left: u32,
    speed: i32,
    /// The number of its next run.
    next: u32,
}

/// A time in which the shaped speed is constant.
#[derive(Debug, Clone, Copy)]
struct Segment {
    /// In sixteenths of ticks.
    time: u32,
    /// The speed of each motor, in 2^-48 steps for each sixteenth of a tick.
    speeds: [i64; 2],
    /// The number of the faster motor.
    faster: usize,
    /// The time from the beginning of the segment to the next step of the faster motor, in
    /// sixteenths of ticks with [`TIME_BITS`] more.
    next: u64,
    /// The time from one of its steps to the next, in the same unit.
    interval: u64,
    /// Whether the brake knows how long its steps are.
    is_told: bool,
}

/// The delay line, and the state of the copies.
#[derive(Debug)]
pub(super) struct Shaper {
    shaping: Option<Shaping>,
    runs: [Run; RUNS],
    /// The number of runs since the machine was last at rest. The run with a number is at the
    /// number modulo [`RUNS`].
    end: u32,
    /// The time and the end of the run that is still growing, if it has begun.
    growing: Option<(u32, [i64; 2])>,
    /// Where the complete runs end, on the axes of the page, in 2^-32 steps.
    planned: [i64; 2],
    copies: [[Copied; 3]; 2],
    /// By how much the shaped position of each motor is ahead of its steps, in 2^-48 steps.
    ahead: [i64; 2],
    segment: Option<Segment>,
    /// The number of the motor that is faster in the segment, or nearly so.
    faster: usize,
    /// The faster motor and the part of its speed that the other has, in 1/256, for which the brake
    /// was told how long a step is.
    told: Option<(usize, u16)>,
    /// The time up to which steps were made, in sixteenths of ticks; wraps.
    time: u32,
    state: State,
}

/// What the shaper is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// All copies are at rest, and the steps are those of the plan.
    Resting,
    Moving,
    /// The plan is at rest, and the copies come to it.
    ComingToRest,
}

/// Returns the numbers of the faster motor, 0 or 1, and of the other one. The compiler sees that
/// they are in range.
fn roles(faster: usize) -> [usize; 2] {
    if faster == 0 { [0, 1] } else { [1, 0] }
}

impl Shaper {
    /// A shaper at rest.
    pub(super) const fn new() -> Self {
        Self {
            shaping: None,
            runs: [Run { time: 0, speeds: [0; 2] }; RUNS],
            end: 0,
            growing: None,
            planned: [0; 2],
            copies: [[Copied { weight: 0, left: 0, speed: 0, next: 0 }; 3]; 2],
            ahead: [0; 2],
            segment: None,
            faster: 0,
            told: None,
            time: 0,
            state: State::Resting,
        }
    }

    /// Adopts another shaping, or none. Nothing may move.
    pub(super) fn set_shaping(&mut self, shaping: Option<Shaping>) {
        self.shaping = shaping;
        self.forget();
    }

    /// Forgets all that is planned.
    pub(super) fn forget(&mut self) {
        self.state = State::Resting;
        self.segment = None;
        self.told = None;
        self.growing = None;
        self.end = 0;
        self.ahead = [0; 2];
    }

    /// Whether motion is shaped.
    #[inline(always)]
    pub(super) fn is_on(&self) -> bool {
        self.shaping.is_some()
    }

    /// Whether all copies are at rest.
    #[inline(always)]
    pub(super) fn is_resting(&self) -> bool {
        self.state == State::Resting
    }

    /// The axes of the page for the positions of the motors, both in the same unit. On a machine
    /// whose motors move both axes, the unit becomes half as large.
    fn axes(&self, [a, b]: [i64; 2]) -> [i64; 2] {
        if self.couples_axes() { [a + b, a - b] } else { [a, b] }
    }

    fn couples_axes(&self) -> bool {
        self.shaping.is_some_and(|shaping| shaping.couples_axes())
    }

    /// Begins at rest: at the position of the motors `at`, in steps, and at `time`, in sixteenths
    /// of ticks.
    pub(super) fn begin(&mut self, at: PagePoint, time: u32) {
        let Some(shaping) = self.shaping else { return };
        self.forget();
        self.planned = self.axes(position(at));
        self.time = time;
        self.copies = [0, 1].map_each(|axis| {
            let mut copies = [Copied::default(); 3];
            for (copy, pulse) in copies.iter_mut().zip(shaping.copies(axis)) {
                *copy = Copied { weight: pulse.weight, left: pulse.delay, ..Copied::default() };
            }
            copies
        });
        self.state = State::Moving;
    }

    /// Adds a planned motion that takes `time`, in sixteenths of ticks, and leads the motors to
    /// `to`, in 2^-32 steps. Short ones become one run.
    pub(super) fn add(&mut self, time: u32, to: [i64; 2]) {
        let so_far = self.growing.map_or(0, |(time, _)| time);
        let time = so_far.saturating_add(time);
        self.growing = Some((time, self.axes(to)));
        if time >= RUN_TIME {
            self.end_run();
        }
    }

    /// Completes the run that is growing, if the delay line has room for it. Otherwise it goes on
    /// growing: the shaping was refused if that were ever needed.
    fn end_run(&mut self) {
        let copies = self.copies.iter().flatten().filter(|copy| copy.weight > 0);
        let first = copies.map(|copy| copy.next).min().unwrap_or(self.end);
        if (self.end - first) as usize >= RUNS {
            return;
        }
        let Some((time, to)) = self.growing.take() else { return };
        let mut run = Run { time, speeds: [0; 2] };
        for ((speed, planned), to) in run.speeds.iter_mut().zip(&mut self.planned).zip(to) {
            // Less than 2^-12 steps are left over, for the next run.
            let exact = (to - *planned).checked_div_euclid(time.into()).unwrap_or(0);
            *speed = exact.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
            *planned += i64::from(*speed) * i64::from(time);
        }
        self.runs[self.end as usize % RUNS] = run;
        self.end += 1;
    }

    /// The plan is at rest at the position of the motors `at`, in steps. Returns the time until all
    /// copies are there, in sixteenths of ticks; 0 if it has been told before.
    pub(super) fn come_to_rest(&mut self, at: PagePoint) -> u32 {
        let (State::Moving, Some(shaping)) = (self.state, self.shaping) else { return 0 };
        self.state = State::ComingToRest;
        let to = position(at);
        if self.growing.is_some() {
            self.end_run();
        }
        let mut passed = 0;
        // The rest of a step, if the plan rests between two steps, then what is left of rounding.
        for time in [RUN_TIME, RUN_TIME / 64, shaping.longest()] {
            if time > 0 {
                self.growing = Some((time, self.axes(to)));
                self.end_run();
                passed += time;
            }
        }
        passed
    }

    /// Makes the steps that are planned, as far as the queue has room. Returns whether all are
    /// made.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) fn make_steps(
        &mut self,
        limits: &Limits,
        brake: BrakeRule,
        emitter: &mut Emitter,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        loop {
            let Some(mut segment) = self.segment.take().or_else(|| self.next_segment()) else {
                return Ok(true);
            };
            while segment.next < u64::from(segment.time) << TIME_BITS {
                if queue.room() < Emitter::ROOM {
                    self.segment = Some(segment);
                    return Ok(false);
                }
                if !segment.is_told {
                    segment.is_told = true;
                    self.tell_length(&segment, limits, brake, emitter, queue)?;
                }
                let steps = self.steps_at(&segment);
                let time = self.time.wrapping_add((segment.next >> TIME_BITS) as u32);
                self.make(steps, time, emitter, queue)?;
                segment.next += segment.interval;
            }
            if queue.room() < Emitter::ROOM {
                self.segment = Some(segment);
                return Ok(false);
            }
            for (ahead, speed) in self.ahead.iter_mut().zip(segment.speeds) {
                *ahead += speed * i64::from(segment.time);
            }
            self.time = self.time.wrapping_add(segment.time);
            emitter.split_long_wait(self.time, queue)?;
        }
    }

    /// Ends the motion once all copies are at rest. The slower motor may have a step left to make.
    /// Returns whether that is done; otherwise the queue has no room.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    pub(super) fn rest(
        &mut self,
        emitter: &mut Emitter,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        loop {
            // Rounded to the nearest position.
            let left = self.ahead.map_each(|ahead| ((ahead >> 47) + 1) >> 1);
            if left == [0; 2] {
                self.forget();
                return Ok(true);
            }
            if queue.room() < Emitter::ROOM {
                return Ok(false);
            }
            let steps = left.map_each(|left| left.signum() as i32);
            self.make(steps, self.time, emitter, queue)?;
        }
    }

    /// Makes at most one step of each motor.
    fn make(
        &mut self,
        [x, y]: [i32; 2],
        time: u32,
        emitter: &mut Emitter,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        if let Some(direction) = Direction::from_delta(x, y) {
            emitter.step(MoveLevels::of(direction), time, queue)?;
        }
        for (ahead, step) in self.ahead.iter_mut().zip([x, y]) {
            *ahead -= i64::from(step) * STEP;
        }
        Ok(())
    }

    /// Goes on to the next segment, if all copies have a run for it.
    fn next_segment(&mut self) -> Option<Segment> {
        let mut speeds = [0i64; 2];
        let mut time = u32::MAX;
        for (axis, copies) in self.copies.iter_mut().enumerate() {
            for copy in copies.iter_mut().filter(|copy| copy.weight > 0) {
                while copy.left == 0 {
                    if copy.next == self.end {
                        return None;
                    }
                    let run = self.runs[copy.next as usize % RUNS];
                    (copy.left, copy.speed) = (run.time, run.speeds[axis]);
                    copy.next += 1;
                }
                time = time.min(copy.left);
                speeds[axis] += i64::from(copy.weight) * i64::from(copy.speed);
            }
        }
        for copy in self.copies.iter_mut().flatten() {
            copy.left = copy.left.saturating_sub(time);
        }
        // The weights are half as large where both motors move both axes.
        let speeds = self.axes(speeds);
        let sizes = speeds.map_each(i64::unsigned_abs);
        let [faster, other] = roles(self.faster);
        // Where both are equally fast, their roles stay, so that the steps follow each other
        // evenly: while the other one falls behind by no more than a quarter of a step in this
        // segment.
        let quarter = STEP.unsigned_abs() / 4;
        let lags = self.ahead[other].unsigned_abs() > 3 * quarter;
        let excess = sizes[other].saturating_sub(sizes[faster]);
        if excess > 0 && (lags || excess.saturating_mul(time.into()) > quarter) {
            self.faster = other;
        }
        let [faster, _] = roles(self.faster);
        let way = STEP / 2 - speeds[faster].signum() * self.ahead[faster];
        let way = way.max(0).cast_unsigned() << TIME_BITS;
        let next = way.checked_div(sizes[faster]).unwrap_or(u64::MAX);
        let mut interval = u64::MAX;
        if next < u64::from(time) << TIME_BITS {
            let step = STEP.cast_unsigned() << TIME_BITS;
            interval = step.checked_div(sizes[faster]).unwrap_or(u64::MAX);
        }
        Some(Segment { time, speeds, faster, next, interval, is_told: false })
    }

    /// Tells how long the path is from one step of a segment to the next, if the direction differs
    /// from the one for which that was told last.
    fn tell_length(
        &mut self,
        segment: &Segment,
        limits: &Limits,
        brake: BrakeRule,
        emitter: &Emitter,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        let [faster, slower] = roles(segment.faster);
        let sizes = segment.speeds.map_each(i64::unsigned_abs);
        // In 1/256, so that the length, which is off by less than 1 %, stays the same on a line.
        let ratio = (sizes[slower] << 8).checked_div(sizes[faster]).unwrap_or(0).min(1 << 8) as u16;
        let is_told =
            self.told.is_some_and(|(axis, told)| axis == faster && told.abs_diff(ratio) < 3);
        if is_told {
            return Ok(());
        }
        self.told = Some((faster, ratio));
        let lengths = limits.step_length.map_each(|length| u64::from(length.to_bits()));
        let length = hypotenuse(lengths[faster], (lengths[slower] * u64::from(ratio)) >> 8);
        // A step of one of two motors that move both axes moves the pen by 1/√2 of a step.
        let length = if self.couples_axes() { (length * 46_341) >> 16 } else { length };
        queue.set_step_length(brake.step_length(length), emitter.has_stepped())
    }

    /// The step of each motor when the faster one makes its next step.
    fn steps_at(&self, segment: &Segment) -> [i32; 2] {
        let Segment { speeds, faster, next, interval, .. } = *segment;
        let [faster, slower] = roles(faster);
        // No more than this time and half an interval passes, in which it moves by a step at most.
        let time = ((next + interval / 2) >> TIME_BITS).cast_signed();
        let ahead = self.ahead[slower] + speeds[slower] * time;
        let mut steps = [0; 2];
        steps[faster] = speeds[faster].signum() as i32;
        if speeds[slower] >= 0 && ahead > STEP / 2 {
            steps[slower] = 1;
        } else if speeds[slower] <= 0 && ahead < -STEP / 2 {
            steps[slower] = -1;
        }
        steps
    }
}

/// The position in 2^-32 steps.
fn position(at: PagePoint) -> [i64; 2] {
    [at.x, at.y].map_each(|steps| i64::from(steps) << POSITION_BITS)
}

#[cfg(test)]
mod tests;
