//! Runs a job: measures the path, reads its targets, fills the event queue, and stops where the
//! path or the user demands it.

use super::status::Estimate;
use super::{Alarm, JobSize, Kinematics, Machine, MachineError, Path, Setting, State, Target};
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::motion::{EventQueue, PathLength, Progress, Runner};

/// The longest time that one turn of the main loop may take: 20 ms, while it writes to the serial
/// line.
const LATE_TICKS: u32 = crate::motion::TICKS_PER_SECOND / 50;

impl Machine<'_> {
    /// Measures the path from the machine's present position. If all of it can be drawn, the
    /// machine begins to draw it. In [`State::Check`] the path is only measured.
    ///
    /// # Errors
    /// See [`MachineError`]. On an error nothing moves.
    pub fn start(&mut self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        if !matches!(self.state, State::Idle | State::Check) {
            return Err(MachineError::State(self.state));
        }
        let size = self.measure(path)?;
        if self.state == State::Idle {
            self.job = size;
            self.reset_ink_budget();
            self.before = self.runner.run();
            self.path_ended = false;
            self.state = State::Run;
        }
        Ok(size)
    }

    /// Keeps the queue filled. It reads targets while the look-ahead has room, and appends events
    /// while the queue has room and the plan is not too far ahead of the pins. Call it often.
    pub fn fill(&mut self, path: &mut dyn Path, queue: &mut dyn EventQueue) {
        self.runner.follow_lift(self.pins.ticks());
        if let State::Alarm(alarm) = self.state {
            return self.raise_pen(alarm, queue);
        }
        if self.pins.is_halted() {
            return;
        }
        if core::mem::take(&mut self.sleep_due) && self.runner.release_drivers(queue).is_err() {
            self.alarm(Alarm::Queue);
        }
        while self.is_moving() {
            self.read_targets(path);
            let ahead = self.runner.ticks().wrapping_sub(self.pins.ticks());
            if queue.room() < Runner::ROOM || self.is_far_enough(ahead) {
                return;
            }
            match self.runner.produce(queue) {
                Ok(Progress::More) => {}
                Ok(progress) => self.stand(progress),
                Err(_) => self.alarm(Alarm::Queue),
            }
        }
    }

    /// During an alarm, a motor that holds the pen down raises it as soon as the queue is empty.
    /// After a restart the motors had no current, so they are switched off again afterwards.
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
                Ok(Progress::Done) if restarted => self.runner.release_drivers(queue),
                raised => raised.map(|_| ()),
            };
            if raised.is_err() {
                return self.alarm(Alarm::Queue);
            }
        }
    }

    /// Whether there may be events to plan.
    fn is_moving(&self) -> bool {
        matches!(
            self.state,
            State::Run | State::Hold { standing: false } | State::Abort | State::Jog
        ) || self.homing.is_some_and(|homing| !homing.is_stopped)
    }

    /// Whether a plan that is `ahead` ticks ahead of the pins is long enough for now.
    fn is_far_enough(&self, ahead: u32) -> bool {
        // During homing, a switch must stop the machine soon, so little is planned ahead.
        let enough = if self.homing.is_some() { LATE_TICKS } else { self.ahead_ticks };
        // If the plan covered less than the time to stop, the machine would slow down whenever the
        // main loop is late by that much.
        ahead >= enough && ahead >= self.runner.stopping_ticks().saturating_add(LATE_TICKS)
    }

    /// Changes the state after the runner has planned the machine to a stop, for the reason
    /// `progress`.
    fn stand(&mut self, progress: Progress) {
        match self.state {
            State::Hold { .. } | State::Run
                if progress == Progress::Stopped || self.next_pen.is_some() =>
            {
                if self.state == State::Run {
                    self.reset_ink_budget();
                }
                self.state = State::Hold { standing: true };
            }
            State::Home => {
                self.forget_path(self.planned_position());
                if let Some(homing) = &mut self.homing {
                    homing.is_stopped = true;
                }
            }
            _ => {
                self.next_pen = None;
                self.streaming = false;
                let page = match progress {
                    Progress::Done => self.runner.page_end(),
                    _ => self.planned_position(),
                };
                self.forget_path(page);
                self.state = State::Idle;
            }
        }
    }

    /// Restarts the count of the ink after which the machine pauses.
    pub(super) fn reset_ink_budget(&mut self) {
        let metres = u64::from(self.settings.get(Setting::InkBeforePause).to_bits().unsigned_abs());
        // Converts units of 2^-16 m to units of 2^-18 mm.
        self.runner.stop_after_ink((metres > 0).then_some(metres * 4000));
    }

    /// Reads targets from the path while the look-ahead has room for their moves.
    fn read_targets(&mut self, path: &mut dyn Path) {
        if self.split.is_some() {
            self.push_pieces();
        }
        while !self.path_ended && self.next_pen.is_none() && self.has_room() {
            match path.next_target() {
                Some(target) if path.pen() != self.pen => {
                    self.next_pen = Some((path.pen(), target));
                    self.runner.end_path();
                }
                // The whole path was measured at the start, so every move fits.
                Some(target) => {
                    if self.push(target, PathLength::MAX).is_err() {
                        self.abort();
                    }
                }
                None => {
                    self.path_ended = true;
                    self.runner.end_path();
                }
            }
        }
    }

    /// Computes the size of the job and checks every target against the travel.
    fn measure(&self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        path.rewind();
        let mut size = JobSize::default();
        let mut at = self.runner.page_end();
        // A change of the pen begins a new stroke, even at the point where the last stroke ended.
        let (mut inked, mut pen) = (false, self.pen);
        let mut estimate = Estimate::default();
        let mut number = 0u32;
        while let Some(Target { point, ink }) = path.next_target() {
            self.check_travel(number, point)?;
            let (dx, dy) = (point.x - at.x, point.y - at.y);
            let length = self
                .runner
                .limits()
                .length(dx, dy)
                .ok_or(MachineError::MoveTooLong { target: number })?;
            let length = u64::from(length.to_bits());
            estimate.add(&self.settings, (dx, dy), ink.is_some(), length);
            if ink.is_some() {
                size.drawn += length;
                size.strokes += u32::from(!inked || path.pen() != pen);
            } else {
                size.travelled += length;
            }
            (inked, pen) = (ink.is_some(), path.pen());
            at = point;
            number = number.saturating_add(1);
        }
        path.rewind();
        size.milliseconds = estimate.end(&self.settings);
        Ok(size)
    }

    /// Checks whether the pen may move to `point`. `target` is the index of the target, for the
    /// error.
    ///
    /// # Errors
    /// [`MachineError::BeyondTravel`] with the index `target`.
    pub fn check_travel(&self, target: u32, point: PagePoint) -> Result<(), MachineError> {
        // A polargraph is always limited, because its belts cannot hold the pen above their
        // anchors.
        let limited = self.settings.is_on(Setting::SoftLimits)
            || matches!(self.settings.kinematics(), Kinematics::Polargraph(_));
        let beyond = |at: i32, travel: Setting, steps_per_mm: Setting| {
            let (least, most) = if limited {
                let steps = self.settings.millimetres_as_steps(travel, steps_per_mm);
                (0, steps.min(PAGE_LIMIT))
            } else {
                (-PAGE_LIMIT, PAGE_LIMIT)
            };
            let steps = at.saturating_sub(at.clamp(least, most));
            self.settings.steps_as_millimetres(steps, steps_per_mm)
        };
        let x = beyond(point.x, Setting::TravelX, Setting::StepsPerMmX);
        let y = beyond(point.y, Setting::TravelY, self.settings.steps_per_mm_y());
        if x == 0 && y == 0 { Ok(()) } else { Err(MachineError::BeyondTravel { target, x, y }) }
    }
}
