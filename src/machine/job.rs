//! Runs a job: measures the path, reads its targets, fills the event queue, and stops where the
//! path or the user demands it.

#[cfg(feature = "early-ink")]
use super::Tool;
use super::estimate::Estimate;
#[cfg(feature = "early-ink")]
use super::estimate::even_milliseconds;
use super::homing::Homing;
use super::progress::Progress;
use super::state::{Activity, Source};
use super::steady::Steady;
use super::{Alarm, JobSize, Machine, MachineError, Path, Setting, Target};
use crate::drawing::PagePoint;
use crate::motion::{EventQueue, Progress as RunnerProgress, Runner};

/// The longest time that one turn of the main loop may take: 20 ms, while it writes to the serial
/// line.
const LATE_TICKS: u32 = crate::motion::TICKS_PER_SECOND / 50;

/// The progress of measuring a path.
#[derive(Debug)]
pub struct Measured {
    /// The size of that part, without the time.
    size: JobSize,
    /// The end of the measured part.
    at: PagePoint,
    /// Whether the measured part ends with the pen down.
    inked: bool,
    /// The number of the pen, from 0.
    pen: u8,
    /// The estimated duration of the measured part.
    estimate: Estimate,
    /// The number of targets.
    targets: u32,
}

impl Machine<'_> {
    /// Measures the path from the machine's present position. If all of it can be drawn, the
    /// machine begins to draw it. In check mode the path is only measured.
    ///
    /// # Errors
    /// See [`MachineError`]. On an error nothing moves.
    pub fn start(&mut self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        let (Activity::Idle | Activity::Check) = self.activity else { return Err(self.refusal()) };
        let size = self.measure(path)?;
        if let Activity::Idle = self.activity {
            self.begin_job(size, Source::Path);
        }
        Ok(size)
    }

    /// Begins to draw the rest of a path, as [`Machine::start`] does. The progress is that of the
    /// whole path, whose size [`Machine::measure_whole`] has returned.
    ///
    /// # Errors
    /// See [`MachineError`]. On an error nothing moves.
    #[cfg(feature = "resume")]
    pub fn start_rest(
        &mut self,
        rest: &mut dyn Path,
        whole: JobSize,
    ) -> Result<JobSize, MachineError> {
        let size = self.start(rest)?;
        if let Activity::Run(_) = self.activity {
            self.progress = Progress::begin_rest(whole, size, self.runner.run());
        }
        Ok(size)
    }

    /// The size of a path that begins at the machine's present position.
    ///
    /// # Errors
    /// See [`MachineError`].
    #[cfg(feature = "resume")]
    pub fn measure_whole(&self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        self.measure(path)
    }

    /// Begins a job whose targets will come while it is drawn. It has this size, and all targets
    /// lie between these least and greatest coordinates, in steps of the page.
    ///
    /// # Errors
    /// See [`MachineError`]. On an error nothing moves.
    #[cfg(feature = "stream")]
    pub fn start_streamed(
        &mut self,
        size: JobSize,
        [least, greatest]: [PagePoint; 2],
    ) -> Result<(), MachineError> {
        let Activity::Idle = self.activity else { return Err(self.refusal()) };
        self.check_travel(0, least)?;
        self.check_travel(0, greatest)?;
        // No move is longer than the diagonal of where the pen is and where it will go.
        let at = self.runner.page_end();
        let (dx, dy) =
            (greatest.x.max(at.x) - least.x.min(at.x), greatest.y.max(at.y) - least.y.min(at.y));
        let length = self.runner.limits().length(dx, dy);
        length.ok_or(MachineError::MoveTooLong { target: 0 })?;
        self.begin_job(size, Source::Path);
        Ok(())
    }

    /// Adds `more` to the size of the job that is being drawn, of which more has been computed. The
    /// time for it is estimated here.
    #[cfg(feature = "tiles")]
    pub fn grow_job(&mut self, more: JobSize) {
        let milliseconds = super::estimate::even_milliseconds(&self.settings, more);
        self.progress.grow(JobSize { milliseconds, ..more });
    }

    /// Whether the machine, which has drawn all targets that have come, has to wait for more. If
    /// so, it waits with the pen raised.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn stops_for_late_path(&mut self, path: &dyn Path, progress: RunnerProgress) -> bool {
        let Some(late) = path.late().filter(|_| self.activity.reads_path()) else { return false };
        // After a hold the machine is already at rest.
        if progress != RunnerProgress::Done {
            return false;
        }
        self.activity.set_source(Source::PendingTarget(late));
        if late.within_stroke {
            self.interrupt_stroke();
        }
        true
    }

    /// Whether the machine still waits for a path that is late.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    #[inline(always)] // It is called in every turn of the main loop.
    fn waits_for_path(&mut self, path: &mut dyn Path) -> bool {
        let Activity::Run(Source::PendingTarget(late)) = self.activity else { return false };
        self.waits_for_late(path, late)
    }

    /// Continues if the next targets have come. Returns whether they have not come yet.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn waits_for_late(&mut self, path: &mut dyn Path, late: super::PendingTarget) -> bool {
        if path.late().is_some() {
            return true;
        }
        let mut draws = false;
        path.look_ahead(&mut |next| {
            draws = next.ink.is_some();
            false
        });
        if late.within_stroke && draws {
            // The motion planner will count the rest of the stroke as another one.
            self.progress.go_on_with_stroke();
        } else if late.within_stroke {
            self.complete_stroke();
        }
        self.activity.set_source(Source::Path);
        false
    }

    /// Begins a job of this size, whose moves come from `source`.
    pub(super) fn begin_job(&mut self, size: JobSize, source: Source) {
        self.end_log();
        #[cfg(feature = "resume")]
        self.begin_points(0);
        self.progress = Progress::begin(size, self.runner.run());
        // Moves that are sent one by one may stop and go on, so their ink is counted on.
        if !matches!(source, Source::Stream) {
            self.reset_ink_budget();
        }
        self.steady = Steady::default();
        self.activity = Activity::Run(source);
    }

    /// Keeps the queue of step events filled. It reads targets while there is room for more planned
    /// moves, and appends events while the queue has room and the plan is not too far ahead of the
    /// pins. Call it often.
    pub fn fill(&mut self, path: &mut dyn Path, queue: &mut dyn EventQueue) {
        self.runner.follow_lift(self.pins.ticks());
        #[cfg(feature = "spread-backlash")]
        if self.spreads_backlash() {
            self.pass_begun_reversals();
        }
        if let Activity::Alarm(alarm) = self.activity {
            return self.raise_pen(alarm, queue);
        }
        if self.pins.is_halted() {
            return;
        }
        if let Activity::Sleep { drivers_on } = &mut self.activity
            && core::mem::take(drivers_on)
            && self.runner.release_drivers(queue).is_err()
        {
            self.alarm(Alarm::Queue);
        }
        #[cfg(any(feature = "stream", feature = "early-ink"))]
        if self.waits_for_path(path) {
            return;
        }
        while self.activity.is_moving() {
            self.read_targets(path);
            if self.waits_for_log() {
                return;
            }
            #[cfg(feature = "resume")]
            if self.rests_in_stroke(queue) {
                return;
            }
            #[cfg(feature = "spread-backlash")]
            if self.runner.waits_for_reversals() {
                return;
            }
            let ahead = self.runner.ticks().wrapping_sub(self.pins.ticks());
            if queue.room() < Runner::ROOM || self.is_far_enough(ahead) {
                return;
            }
            // Where nothing follows for now, the pen would be raised behind the line.
            #[cfg(feature = "spread-backlash")]
            if self.owes_backlash() && self.runner.has_run_all() {
                self.push_backlash_due();
            }
            match self.runner.produce(queue) {
                Ok(RunnerProgress::More) => {}
                Ok(progress) => {
                    #[cfg(any(feature = "stream", feature = "early-ink"))]
                    if self.stops_for_late_path(path, progress) {
                        return;
                    }
                    self.after_stop(progress);
                    self.pause_at_switch(queue);
                }
                Err(_) => self.alarm(Alarm::Queue),
            }
        }
    }

    /// During an alarm, a motor that holds the pen down raises it as soon as the queue is empty.
    /// After a restart the motors had no current, so they are switched off again afterwards.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn raise_pen(&mut self, alarm: Alarm, queue: &mut dyn EventQueue) {
        let restarted = alarm == Alarm::Restarted;
        if self.pins.is_halted() {
            if !self.runner.is_pen_held(restarted) || !self.pins.is_drained() {
                return;
            }
            self.set_motors(self.motors_now(), self.position());
            self.pins.release();
        }
        while self.runner.is_pen_held(restarted) && queue.room() >= Runner::ROOM {
            let raised = match self.runner.raise_pen(queue) {
                Ok(RunnerProgress::Done) if restarted => self.runner.release_drivers(queue),
                raised => raised.map(|_| ()),
            };
            if raised.is_err() {
                return self.alarm(Alarm::Queue);
            }
        }
    }

    /// Whether a plan that is `ahead` ticks (1/25,000,000 s) ahead of the pins is long enough for
    /// now.
    fn is_far_enough(&self, ahead: u32) -> bool {
        // During homing, a switch must stop the machine soon, so little is planned ahead.
        let is_homing = matches!(self.activity, Activity::Home(_));
        let enough = if is_homing { LATE_TICKS } else { self.ahead_ticks };
        // If the plan covered less than the time to stop, the machine would slow down whenever the
        // main loop is late by that much.
        ahead >= enough && ahead >= self.runner.stopping_ticks().saturating_add(LATE_TICKS)
    }

    /// Changes the state after the runner has planned the machine to a stop, for the reason
    /// `progress`.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn after_stop(&mut self, progress: RunnerProgress) {
        match self.activity {
            // Where moves are sent one by one, a stroke may be over because the next move is late.
            Activity::Run(source) | Activity::Hold { source, .. }
                if progress == RunnerProgress::Stopped
                    || matches!(source, Source::PenChange { .. })
                    || (matches!(source, Source::Stream) && self.runner.pauses()) =>
            {
                if let Activity::Run(_) = self.activity {
                    self.reset_ink_budget();
                }
                self.activity = Activity::Hold { stopped: true, source };
            }
            Activity::Home(homing) => {
                self.forget_path(self.planned_position());
                self.activity = Activity::Home(Homing { is_stopped: true, ..homing });
            }
            _ => {
                if let Activity::Run(Source::PathEnd)
                | Activity::Hold { source: Source::PathEnd, .. } = self.activity
                {
                    self.progress.complete(self.runner.run());
                    self.complete_log();
                }
                let page = match progress {
                    RunnerProgress::Done => self.runner.page_end(),
                    _ => self.planned_position(),
                };
                self.forget_path(page);
                self.end_motion(Activity::Idle);
            }
        }
    }

    /// Stands for a while after a move of homing, so that a switch that bounces comes to rest.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn pause_at_switch(&mut self, queue: &mut dyn EventQueue) {
        let ticks = self.settings.milliseconds_as_ticks(Setting::HomingDebounce);
        let is_homing = matches!(self.activity, Activity::Home(Homing { is_stopped: true, .. }));
        if !is_homing || ticks == 0 {
            return;
        }
        // An event lasts 0.67 s at most, and the setting allows a second.
        let half = ticks.div_ceil(2);
        if self.runner.dwell(half, queue).is_err() || self.runner.dwell(half, queue).is_err() {
            self.alarm(Alarm::Queue);
        }
    }

    /// Restarts the count of the ink after which the machine pauses ([`Setting::InkBeforePause`]).
    pub fn reset_ink_budget(&mut self) {
        let metres = u64::from(self.settings.get(Setting::InkBeforePause).to_bits().unsigned_abs());
        // Converts units of 2^-16 m to units of 2^-18 mm.
        self.runner.stop_after_ink((metres > 0).then_some(metres * 4000));
    }

    /// Reads targets from the path while the look-ahead has room for their moves.
    fn read_targets(&mut self, path: &mut dyn Path) {
        if self.segmenter.is_some() {
            self.push_segments();
        }
        while self.activity.reads_path() && self.has_room() && self.reads_on() {
            match path.next_target() {
                Some(first) if path.pen() != self.pen => {
                    self.end_targets(Source::PenChange { pen: path.pen(), first });
                }
                // The whole path was measured at the start, so every move fits.
                Some(target) => {
                    let limit = self.steady_limit(path, target);
                    match self.push(target, limit) {
                        Ok(length) => self.pass_point(target, length),
                        Err(_) => self.abort(),
                    }
                }
                #[cfg(any(feature = "stream", feature = "early-ink"))]
                None if path.late().is_some() => return,
                None => self.end_targets(Source::PathEnd),
            }
        }
    }

    /// Records that no more targets come before the machine is at rest. Then its moves come from
    /// `source`.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn end_targets(&mut self, source: Source) {
        self.activity.set_source(source);
        #[cfg(feature = "spread-backlash")]
        self.push_backlash_due();
        self.runner.end_path();
    }

    /// Computes the size of the job and checks every target against the travel.
    fn measure(&self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        path.rewind();
        let mut measured = self.begin_measuring();
        while self.measure_next(path, &mut measured)? {}
        path.rewind();
        Ok(self.end_measuring(measured))
    }

    /// Begins to measure a path that starts at the machine's present position.
    // Without the feature it has only one caller, into which it is inlined.
    #[cfg_attr(not(feature = "early-ink"), inline(always))]
    #[cfg_attr(feature = "early-ink", inline(never))]
    pub fn begin_measuring(&self) -> Measured {
        Measured {
            size: JobSize::default(),
            at: self.runner.page_end(),
            inked: false,
            pen: self.pen,
            estimate: Estimate::default(),
            targets: 0,
        }
    }

    /// Reads the next target of a path, checks it against the travel and measures the move to it.
    /// Returns whether there was one.
    ///
    /// # Errors
    /// See [`MachineError`].
    #[cfg_attr(not(feature = "early-ink"), inline(always))]
    #[cfg_attr(feature = "early-ink", inline(never))]
    pub fn measure_next(
        &self,
        path: &mut dyn Path,
        measured: &mut Measured,
    ) -> Result<bool, MachineError> {
        let Some(Target { point, ink }) = path.next_target() else { return Ok(false) };
        let Measured { size, at, inked, pen, estimate, targets } = measured;
        self.check_travel(*targets, point)?;
        let (dx, dy) = (point.x - at.x, point.y - at.y);
        let length = self
            .runner
            .limits()
            .length(dx, dy)
            .ok_or(MachineError::MoveTooLong { target: *targets })?;
        let length = u64::from(length.to_bits());
        estimate.add(&self.settings, (dx, dy), ink.is_some(), length);
        if ink.is_some() {
            size.drawn += length;
            // A change of the pen begins a new stroke, even where the last stroke ended.
            size.strokes += u32::from(!*inked || path.pen() != *pen);
        } else {
            size.travelled += length;
        }
        (*inked, *pen) = (ink.is_some(), path.pen());
        *at = point;
        *targets = targets.saturating_add(1);
        Ok(true)
    }

    /// Returns the size of the path that was measured.
    #[cfg_attr(not(feature = "early-ink"), inline(always))]
    #[cfg_attr(feature = "early-ink", inline(never))]
    pub fn end_measuring(&self, Measured { mut size, estimate, .. }: Measured) -> JobSize {
        size.milliseconds = estimate.end(&self.settings);
        size
    }

    /// Gives the job that has begun its size, which was not known before.
    #[cfg(feature = "early-ink")]
    pub fn set_job_size(&mut self, size: JobSize) {
        self.progress.set_size(size);
    }

    /// Lets the job that has begun be longer than what was measured of it, by this many strokes of
    /// this length together in 2^-18 mm, until [`Machine::set_job_size`] tells its true size. They
    /// are assumed to lie and to take as long as those before.
    #[cfg(feature = "early-ink")]
    pub fn expect_more(&mut self, strokes: u32, drawn: u64) {
        let size = self.progress.size();
        let travelled = (size.travelled * u64::from(strokes)).checked_div(size.strokes.into());
        let rest = JobSize { strokes, drawn, travelled: travelled.unwrap_or(0), milliseconds: 0 };
        let [before, more] = [size, rest].map(|size| even_milliseconds(&self.settings, size));
        let milliseconds = size.milliseconds.saturating_mul(more).checked_div(before);
        self.progress.set_size(JobSize {
            strokes: size.strokes.saturating_add(strokes),
            drawn: size.drawn + drawn,
            travelled: size.travelled + rest.travelled,
            milliseconds: size.milliseconds + milliseconds.unwrap_or(0),
        });
    }

    /// Whether the machine could go from anywhere to anywhere between these least and greatest
    /// coordinates, and from where it is, so that it refuses no order of strokes there.
    #[cfg(feature = "early-ink")]
    pub fn takes_any_path(&self, [least, greatest]: [PagePoint; 2]) -> bool {
        let at = self.runner.page_end();
        let (dx, dy) =
            (greatest.x.max(at.x) - least.x.min(at.x), greatest.y.max(at.y) - least.y.min(at.y));
        [least, greatest].into_iter().all(|point| self.check_travel(0, point).is_ok())
            && self.runner.limits().length(dx, dy).is_some()
    }

    /// Whether pen and motors move one after the other, so that what the machine does before a
    /// stop does not depend on what comes behind it.
    #[cfg(feature = "early-ink")]
    pub fn moves_apart(&self) -> bool {
        Tool::moves_apart(&self.settings)
    }

    /// Checks whether the pen may move to `point`. `target` is the index of the target, for the
    /// error.
    ///
    /// # Errors
    /// [`MachineError::BeyondTravel`] with the index `target`.
    pub fn check_travel(&self, target: u32, point: PagePoint) -> Result<(), MachineError> {
        let [x, y] = self.settings.beyond_travel(point);
        if x == 0 && y == 0 { Ok(()) } else { Err(MachineError::BeyondTravel { target, x, y }) }
    }
}
