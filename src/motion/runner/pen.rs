//! Lets the pen move while the machine does ([`PenOverlap`]): the pen is told to go down before a
//! travel ends, and a travel begins before the pen is up.
//!
//! The time at which the pen is told to go down is counted back from the end of the travel, where
//! the machine is at rest. So that end must be known, which means that all moves up to the next
//! stroke are in the look-ahead. Without a limit on jerk, the time of arrival is known to the tick;
//! with one, an upper bound is known. The pen never goes down before it has been up.
//!
//! From then on the travel is completed as it was planned: a stop waits for its end, and a change
//! of speed takes effect after it. So the pen touches the paper only where the stroke begins, and
//! no earlier than it would with a dwell at rest. If the machine comes to rest before the stroke
//! begins, the pen is raised again ([`Runner::come_to_rest`]).

use super::{PathSpeed, PenPositions, Plan, Progress, Runner};
use crate::motion::lookahead::BlockKind;
use crate::motion::profile::{FRACTION_BITS, Profile};
use crate::motion::{EventQueue, PathLength, StepEvent};

/// How long the pen moves while the machine does, in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PenOverlap {
    /// How long before the end of a travel the pen is told to go down, at most. No longer than the
    /// pen takes.
    pub down_ticks: u32,
    /// How long before the pen is up a travel begins. No longer than the dwell after raising.
    pub up_ticks: u32,
}

/// What the pen does while the machine moves. Times are in sixteenths of ticks.
#[derive(Debug, Clone, Copy)]
pub(super) struct PenTiming {
    /// The time until a pen that was told to go up is up.
    rising: u32,
    /// The time until the pen is to be told to go down, if the end of the current travel is known.
    until_lowered: Option<u64>,
    /// Set once the pen was told to go down during a travel.
    lowering: Option<Lowering>,
}

/// A pen that goes down while the machine still travels to the stroke.
#[derive(Debug, Clone, Copy)]
struct Lowering {
    /// The time at which the pen was last told to move.
    since: u32,
    /// The greatest speed of the travel that was in force then.
    top: PathSpeed,
}

impl PenTiming {
    /// The pen does nothing while the machine moves.
    pub(super) const fn new() -> Self {
        Self { rising: 0, until_lowered: None, lowering: None }
    }

    /// Counts down by a planned `time`.
    #[inline(always)]
    pub(super) fn pass(&mut self, time: u32) {
        if self.rising > 0 || self.until_lowered.is_some() {
            self.count_down(time);
        }
    }

    #[inline(never)] // Only on travels: inlined, it would fill the cache.
    fn count_down(&mut self, time: u32) {
        self.rising = self.rising.saturating_sub(time);
        self.until_lowered = self.until_lowered.map(|left| left.saturating_sub(time.into()));
    }

    /// Whether a pen that is not down stays raised while motors take up their backlash.
    #[inline(always)]
    pub(super) fn stays_raised(pen: &PenPositions, is_down: Option<bool>) -> bool {
        pen.overlap != PenOverlap::default() && is_down != Some(true)
    }

    /// Whether it is time to tell the pen to go down, or to the next height of its ramp.
    #[inline(always)]
    pub(super) fn is_due(&self) -> bool {
        self.until_lowered == Some(0) && self.rising == 0
    }

    /// Whether the pen was told to go down during the current travel, which is then completed as
    /// planned.
    #[inline(always)]
    pub(super) fn is_lowering(&self) -> bool {
        self.lowering.is_some()
    }

    /// The greatest speed of the current travel, which may differ from the one that is now in force
    /// (`travel`).
    #[inline(always)]
    pub(super) fn travel_top(&self, travel: PathSpeed) -> PathSpeed {
        self.lowering.map_or(travel, |lowering| lowering.top)
    }
}

impl Runner<'_> {
    /// Returns the length of the travels after the current piece until the machine is at rest, in
    /// units of 2^-18 mm, and how long it then takes until a stroke begins, because motors may have
    /// backlash to take up. `None` if no stroke is known, or if the machine may be slower in
    /// between than now, where its greatest speed is `top`.
    fn distance_to_stroke(&self, top: PathSpeed) -> Option<(u64, u64)> {
        if self.course.as_ref().is_some_and(|course| !course.is_last_piece()) {
            return Some((0, 0));
        }
        let is_smooth = self.limits.jerk.is_some();
        let (mut distance, mut time) = (0, 0u64);
        for block in self.lookahead.in_order() {
            if block.ink.is_some() && block.kind == BlockKind::Line {
                return Some((distance, time));
            }
            let is_slower = is_smooth && block.limit() < top.stopping_distance;
            if is_slower || (time > 0 && block.kind != BlockKind::Backlash) {
                return None;
            }
            if block.kind == BlockKind::Backlash {
                let (from, to) = (PathSpeed::REST, PathLength::ZERO);
                let profile = Profile::new(&self.limits, from, block.length, self.travel, to);
                time = time.saturating_add(profile.time_left(&self.limits)).max(1);
            } else {
                distance += u64::from(block.length.to_bits());
            }
        }
        None
    }

    /// Returns the greatest time until the current travel is at rest where a stroke begins,
    /// according to the plan that was just made; `None` if it is unknown.
    fn time_to_stroke(&mut self) -> Option<u64> {
        let top = self.current_top(false);
        let (distance, later) = self.distance_to_stroke(top)?;
        let time = match self.plan.as_ref()? {
            Plan::Profile { profile, .. } => {
                let exit = profile.exit();
                // If the stopping distance at the exit equals the remaining distance, the machine
                // brakes from there to rest, which takes v/a.
                let brakes = u64::from(exit.stopping_distance.to_bits()) == distance;
                let slices = (u64::from(exit.speed.to_bits()) << 16)
                    .checked_div(self.limits.acceleration.to_bits().into())?;
                brakes.then(|| profile.time_left(&self.limits).saturating_add(slices))?
            }
            Plan::Interval(interval) => {
                let room = self.course.as_ref()?.room();
                interval.time_to_rest(room.saturating_add(distance << 14), top.speed)
            }
        };
        Some(time.saturating_add(later))
    }

    /// Called after a plan has been made, for an `inked` piece or a travel, `at_rest` or not.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(always)]
    pub(super) fn planned(
        &mut self,
        inked: bool,
        at_rest: bool,
        queue: &mut dyn EventQueue,
    ) -> Result<Progress, StepEvent> {
        if !inked && self.pen.overlap != PenOverlap::default() {
            self.plan_pen(at_rest, queue)?;
        }
        Ok(Progress::More)
    }

    /// Determines when the pen is to go down on the travel that was just planned. A travel that is
    /// too short for this begins later, so that the pen may still go down during it.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Rarely called: inlined, it would fill the cache.
    fn plan_pen(&mut self, at_rest: bool, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        if self.timing.is_lowering() {
            return Ok(());
        }
        self.timing.until_lowered = None;
        let overlap = self.pen.overlap;
        if self.stopping {
            return Ok(());
        }
        let Some(time) = self.time_to_stroke() else {
            return Ok(());
        };
        let early = u64::from(overlap.down_ticks) << FRACTION_BITS;
        let rising = u64::from(self.timing.rising);
        let late = (rising + early).saturating_sub(time).min(rising) as u32;
        if at_rest && late > 0 && self.limits.jerk.is_none() {
            self.timing.rising -= late;
            self.wait(late, queue)?;
        }
        if early > 0 {
            self.timing.until_lowered = Some(time.saturating_sub(early));
        }
        Ok(())
    }

    /// Tells the pen to go down, or to the next height of its ramp. The event lies midway before
    /// the next move of the current slice. If there is no room for it, it waits for another slice.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Rarely called: inlined, it would fill the cache.
    pub(super) fn lower_while_moving(
        &mut self,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        let Some(due) = self.course.as_ref().and_then(|course| course.next_due()) else {
            return Ok(());
        };
        let height = self.pen.down_height;
        let from = self.pen_height.unwrap_or(self.pen.up_height);
        let next = self.next_height(from, height);
        let Some(time) = self.emitter.midway(self.now, self.now.wrapping_add(due)) else {
            return Ok(());
        };
        let since = self.emitter.pen(next, time, queue)?;
        let top = self.current_top(false);
        self.timing.lowering = Some(Lowering { since, top });
        self.timing.until_lowered =
            (next != height).then(|| u64::from(self.pen.ramp_ticks) << FRACTION_BITS);
        self.pen_height = Some(next);
        // While it moves it is neither up nor down.
        self.pen_is_down = None;
        Ok(())
    }

    /// Called at rest where the stroke begins. If the pen has been told its last height during the
    /// travel, returns how many ticks ago; otherwise waits until the next height of its ramp is
    /// due.
    pub(super) fn lowered_while_moving(&mut self, down: bool) -> Option<u32> {
        self.timing.until_lowered = None;
        let Lowering { since, .. } = self.timing.lowering.take()?;
        let passed = self.now.wrapping_sub(since) >> FRACTION_BITS;
        if !down {
            return None;
        }
        if self.pen_height == Some(self.pen.down_height) {
            return Some(passed);
        }
        let wait = self.pen.ramp_ticks.saturating_sub(passed);
        self.now = self.now.wrapping_add(wait << FRACTION_BITS);
        None
    }

    /// Returns the part of the dwell for which the machine waits until the pen is up. The rest
    /// passes while the machine moves.
    pub(super) fn begin_rising(&mut self, dwell: u32) -> u32 {
        let early = self.pen.overlap.up_ticks.min(dwell);
        self.timing.rising = early << FRACTION_BITS;
        dwell - early
    }

    /// Waits until the pen is up. Returns whether there was anything to wait for.
    ///
    /// # Errors
    /// The event that the queue refused.
    pub(super) fn wait_for_rising(
        &mut self,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        let rising = core::mem::take(&mut self.timing.rising);
        if rising > 0 {
            self.wait(rising, queue)?;
        }
        Ok(rising > 0)
    }

    /// Forgets what the pen does, which somebody else has raised.
    pub(super) fn forget_timing(&mut self) {
        self.timing = PenTiming::new();
    }

    /// Rests for this time, below 2^28.
    fn wait(&mut self, time: u32, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        self.now = self.now.wrapping_add(time);
        let at = self.emitter.hold(self.now, queue)?;
        self.advance_to(at);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{PEN, push};
    use super::*;
    use crate::drawing::LineType;
    use crate::motion::event::tests::Events;
    use crate::motion::limits::tests::settings;
    use crate::motion::{Block, EventKind, Limits};

    /// A runner that is to travel and then to draw a stroke. The pen may go down so long before.
    fn runner(blocks: &mut [Block], down_ticks: u32) -> Runner<'_> {
        let overlap = PenOverlap { down_ticks, up_ticks: 1_000_000 };
        let limits = Limits::new(&settings()).expect("valid");
        let mut runner = Runner::new(limits, PenPositions { down_ticks, overlap, ..PEN }, blocks);
        push(&mut runner, [3000, 0], None);
        push(&mut runner, [5000, 0], Some(LineType::Full));
        runner
    }

    #[test]
    fn the_pen_is_told_between_two_steps_and_not_just_behind_one() {
        for down_ticks in (6_000_000..9_000_000).step_by(33_370) {
            let mut blocks = [Block::EMPTY; 8];
            let (mut runner, mut events) = (runner(&mut blocks, down_ticks), Events::default());
            assert_eq!(runner.capacity(), 8);
            while runner.produce(&mut events) == Ok(Progress::More) {}
            let is_down = |event: &StepEvent| event.kind() == EventKind::Pen { height: 100 };
            let told = events.0.iter().position(is_down).expect("the pen goes down");
            let [before, pen, behind] = [told - 1, told, told + 1].map(|at| events.0[at]);
            assert!(before.is_step() && behind.is_step(), "while the machine moves");
            let (before, behind) = (f64::from(before.ticks()), f64::from(pen.ticks()));
            assert!(before > 0.9 * behind, "{down_ticks}: {before} {behind}");
        }
    }

    #[test]
    fn a_pen_that_somebody_else_has_raised_is_not_on_its_way_down() {
        let mut blocks = [Block::EMPTY; 8];
        let (mut runner, mut events) = (runner(&mut blocks, 1_500_000), Events::default());
        while !runner.timing.is_lowering() {
            assert_eq!(runner.produce(&mut events), Ok(Progress::More));
        }
        runner.forget_path(runner.page_end());
        runner.forget_pen();
        assert!(!runner.timing.is_lowering() && !runner.is_pen_up());
    }
}
