//! The pen moves while the machine does ([`PenOverlap`]): it is told to go down before a travel
//! ends, and a travel begins before it is up.
//!
//! When the pen is to go down is counted back from where the travel ends at rest, so that end must
//! be known: all moves up to the next stroke wait. Without a limit on jerk it is known to the tick
//! when the machine will be there; with one, how much later it will be there at most. The pen goes
//! down no sooner than it was up.
//!
//! From then on the travel is carried out as it was planned: a stop waits for its end, and another
//! speed begins behind it. So the pen is down nowhere but where the stroke begins, and it is down
//! no earlier than it would be with a dwell at rest. Whatever stands there before the stroke begins
//! raises it again ([`Runner::stand`]).

use super::{Pace, PenPositions, Plan, Progress, Runner};
use crate::motion::lookahead::BlockKind;
use crate::motion::profile::{FRACTION_BITS, Profile};
use crate::motion::{EventQueue, PathLength, StepEvent};

/// For how long the pen moves while the machine does, in ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PenOverlap {
    /// At most so long before a travel ends, the pen is told to go down: not longer than it takes.
    pub down_ticks: u32,
    /// So long before the pen is up, a travel begins: not longer than its dwell.
    pub up_ticks: u32,
}

/// What the pen does beside the motion. Times are sixteenths of ticks.
#[derive(Debug, Clone, Copy)]
pub(super) struct PenTiming {
    /// Until the pen, which was told to go up, is up.
    rising: u32,
    /// Until it is to go down, if the end of the travel in work is known.
    until_lowered: Option<u64>,
    /// It was told to go down on the way.
    lowering: Option<Lowering>,
}

/// A pen on its way down, while the machine is on its way to the stroke.
#[derive(Debug, Clone, Copy)]
struct Lowering {
    /// When it was told last.
    since: u32,
    /// The greatest speed of the travel that was in force then.
    top: Pace,
}

impl PenTiming {
    /// The pen does nothing beside the motion.
    pub(super) const fn new() -> Self {
        Self { rising: 0, until_lowered: None, lowering: None }
    }

    /// So much time passes, which was planned.
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

    /// Whether a pen that is not down stays so while motors take up their slack.
    #[inline(always)]
    pub(super) fn stays_raised(pen: &PenPositions, is_down: Option<bool>) -> bool {
        pen.overlap != PenOverlap::default() && is_down != Some(true)
    }

    /// Whether the pen, or the next height of its ramp, is due.
    #[inline(always)]
    pub(super) fn is_due(&self) -> bool {
        self.until_lowered == Some(0) && self.rising == 0
    }

    /// Whether the pen was told to go down on the way, so that the travel goes on as planned.
    #[inline(always)]
    pub(super) fn is_lowering(&self) -> bool {
        self.lowering.is_some()
    }

    /// The greatest speed of the travel in work, if another is in force by now.
    #[inline(always)]
    pub(super) fn travel_top(&self, travel: Pace) -> Pace {
        self.lowering.map_or(travel, |lowering| lowering.top)
    }
}

impl Runner<'_> {
    /// How long the travels behind the piece in work are until the machine is at rest, 2^-18 mm,
    /// and how long it takes after that until a stroke begins: motors may have slack to take up
    /// there. `None` if no stroke is known, or if the machine may be slower in between.
    fn way_to_stroke(&self) -> Option<(u64, u64)> {
        if self.course.as_ref().is_some_and(|course| !course.is_last_piece()) {
            return Some((0, 0));
        }
        let is_smooth = self.limits.jerk.is_some();
        let (mut way, mut time) = (0, 0u64);
        for block in self.lookahead.in_order() {
            if block.ink.is_some() && block.kind == BlockKind::Line {
                return Some((way, time));
            }
            let is_slower = is_smooth && block.limit() < self.travel.stopping_distance;
            if is_slower || (time > 0 && block.kind != BlockKind::Slack) {
                return None;
            }
            if block.kind == BlockKind::Slack {
                let (from, to) = (Pace::REST, PathLength::ZERO);
                let profile = Profile::new(&self.limits, from, block.length, self.travel, to);
                time = time.saturating_add(profile.time_left(&self.limits)).max(1);
            } else {
                way += u64::from(block.length.to_bits());
            }
        }
        None
    }

    /// How long it takes at most until the travel in work is at rest where a stroke begins, by the
    /// plan that has just been made; `None` if that is not known.
    fn time_to_stroke(&self) -> Option<u64> {
        let (way, later) = self.way_to_stroke()?;
        let time = match self.plan.as_ref()? {
            Plan::Profile(profile) => {
                let exit = profile.exit();
                // Braking from there to rest takes just that way: v/a.
                let brakes = u64::from(exit.stopping_distance.to_bits()) == way;
                let slices = (u64::from(exit.speed.to_bits()) << 16)
                    .checked_div(self.limits.acceleration.to_bits().into())?;
                brakes.then(|| profile.time_left(&self.limits).saturating_add(slices))?
            }
            Plan::Interval(interval) => {
                let room = self.course.as_ref()?.room();
                interval.time_to_rest(room.saturating_add(way << 14), self.travel.speed)
            }
        };
        Some(time.saturating_add(later))
    }

    /// A plan has been made, of an `inked` piece or a travel, from rest or not.
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

    /// Looks when the pen is to go down on the travel that has just been planned. Where it has to
    /// wait for the pen, a short travel begins later: the pen may then go down on the way.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
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

    /// Tells the pen to go down, or one height further on its ramp, midway to the next move, which
    /// is one of the slice in work. If that leaves no room, it waits for another slice.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn lower_on_the_way(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
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
        let top = self.timing.travel_top(self.travel);
        self.timing.lowering = Some(Lowering { since, top });
        self.timing.until_lowered =
            (next != height).then(|| u64::from(self.pen.ramp_ticks) << FRACTION_BITS);
        self.pen_height = Some(next);
        // On its way it is neither up nor down.
        self.pen_is_down = None;
        Ok(())
    }

    /// The machine stands where the stroke begins. Returns whether the pen has reached its height,
    /// told on the way, and how long ago, in ticks; else its ramp goes on when its time has come.
    pub(super) fn lowered_on_the_way(&mut self, down: bool) -> Option<u32> {
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

    /// The dwell with which the machine waits for the pen to be up. What is left of it passes
    /// beside the motion.
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

    /// Stands for so long, below 2^28.
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
