//! The plotter as a state machine: axes, kinematics, pen, travel limits, homing, feed hold and
//! abort.
//!
//! [`Machine`] runs in the main loop. It takes a [`Path`] and measures it first, so that a path
//! that leaves the travel is refused before anything moves. Then it keeps the queue of the step
//! interrupt filled. [`Pulser`] runs in the step interrupt, and [`PulserState`] holds what the two
//! share. No code here reads a clock: the events depend only on the path, the settings, and the
//! call of [`Machine::fill`] at which a command arrives.
//!
//! The machine refuses commands that its state does not allow, settings that conflict, and moves
//! beyond the limits. A refused command changes nothing.

mod backlash;
mod configure;
#[cfg(feature = "spread-backlash")]
mod spread_backlash;
mod estimate;
#[cfg(feature = "driver-pins")]
mod drivers;
mod homing;
mod job;
mod kinematics;
mod path;
mod progress;
mod pulser;
mod segmenter;
mod settings;
mod state;
mod status;
mod steady;
mod stream;
mod stroke_ends;
mod stroke_log;
#[cfg(feature = "resume")]
mod stroke_points;
mod tool;
mod travel;

pub use homing::{Axis, Contacts, Switches};
#[cfg(feature = "early-ink")]
pub use job::Measured;
pub use kinematics::{Anchors, CutPositions, Kinematics, SegmentEnd};
#[cfg(any(feature = "stream", feature = "early-ink"))]
pub use path::PendingTarget;
pub use path::{JobSize, Path, TapePath, Target, TargetList};
pub use pulser::{Axes, EventRing, PinOrder, Pins, Pulser, PulserState, StepQueue, Tick};
pub use settings::{SETTINGS, Setting, SettingError, SettingInfo, Settings, Value};
pub use state::{Alarm, MachineError, State};
pub use status::Status;
pub use stroke_ends::StrokeEnds;
#[cfg(feature = "resume")]
pub use stroke_points::StrokePoints;
pub use tool::{Pen, Solenoid, servo};

use backlash::Backlash;
use homing::Homing;
use progress::Progress;
use segmenter::Segmenter;
use state::{Activity, Source};
use steady::Steady;
use stroke_log::StrokeLog;
#[cfg(feature = "resume")]
use stroke_points::StrokeRest;
use tool::Tool;

use crate::drawing::PagePoint;
use crate::motion::{Block, Runner, SpeedLimit};

/// The plotter as the main loop sees it: a state machine that turns jobs and commands into step
/// events.
#[derive(Debug)]
pub struct Machine<'m> {
    /// The numbered settings (`$100` and so on) in force.
    settings: Settings,
    /// What the machine is doing, with the data of that state.
    activity: Activity,
    /// The motion planner, which turns planned moves into step events.
    runner: Runner<'m>,
    /// The state that the step interrupt shares with the main loop: what it has done so far, and
    /// the orders to it.
    pins: &'m PulserState,
    /// The position of the motors, in steps, at which the step counters of `pins` are 0.
    origin: PagePoint,
    /// The time by which the queue is planned ahead of the pins, in ticks.
    ahead_ticks: u32,
    /// The size of the current or the last job, and its progress.
    progress: Progress,
    /// The move that is being cut into segments, if any.
    segmenter: Option<Segmenter>,
    /// The speed of the line that is being read, if lines have one speed.
    steady: Steady,
    /// How much of its backlash each motor has taken up.
    backlash: Backlash,
    /// The state of the backlash that is taken up while the pen draws.
    #[cfg(feature = "spread-backlash")]
    spread_backlash: spread_backlash::SpreadBacklash,
    /// The contacts that were pressed when they were last observed.
    contacts: Contacts,
    /// The speed override, in percent of the speeds in the settings.
    percent: u8,
    /// The override of moves with the pen up, in percent: 25, 50 or 100.
    rapid_percent: u8,
    /// The number of the pen in the holder, counted from 0.
    pen: u8,
    /// Whether nobody has said since the start which pen is in the holder.
    is_pen_assumed: bool,
    /// The progress of noting strokes of the job in flash.
    log: StrokeLog,
    /// The points within strokes at which the machine rests.
    #[cfg(feature = "resume")]
    points: StrokePoints,
    /// The progress of a rest within a stroke.
    #[cfg(feature = "resume")]
    rest: StrokeRest,
    /// The ticks of all events when the drivers were switched off at rest.
    #[cfg(feature = "driver-pins")]
    released_at: u32,
}

impl<'m> Machine<'m> {
    /// A machine at rest at the page's origin with the pen raised. If the settings require homing,
    /// it starts in the alarm [`Alarm::NotHomed`].
    ///
    /// `blocks` is the memory of the look-ahead, at 52 bytes per block, or 56 with the
    /// feature `spread-backlash`. It needs at least one
    /// block; 100 or more work well. `ahead_ticks` is how far the queue is planned ahead of the
    /// pins. The machine plans further ahead if it could otherwise not stop in time when the main
    /// loop is late. A feed hold takes effect after that delay. With `u32::MAX` only the size of
    /// the queue limits the planning.
    ///
    /// The machine is never faster than it could stop within the queue of `pins`, whatever the
    /// settings say: see [`Machine::held_to`].
    pub fn new(
        settings: Settings,
        blocks: &'m mut [Block],
        pins: &'m PulserState,
        ahead_ticks: u32,
    ) -> Self {
        let mut machine = Self {
            settings,
            activity: if settings.is_on(Setting::Homing) {
                Activity::Alarm(Alarm::NotHomed)
            } else {
                Activity::Idle
            },
            runner: Runner::new(settings.limits(pins.queue()), Tool::positions(&settings), blocks),
            pins,
            origin: PagePoint::default(),
            ahead_ticks,
            progress: Progress::default(),
            log: StrokeLog::default(),
            #[cfg(feature = "resume")]
            points: StrokePoints::default(),
            #[cfg(feature = "resume")]
            rest: StrokeRest::default(),
            segmenter: None,
            steady: Steady::default(),
            backlash: Backlash::default(),
            #[cfg(feature = "spread-backlash")]
            spread_backlash: Default::default(),
            contacts: Contacts::default(),
            percent: 100,
            rapid_percent: 100,
            pen: 0,
            is_pen_assumed: true,
            #[cfg(feature = "driver-pins")]
            released_at: 0,
        };
        machine.configure_pulser();
        machine.reset_ink_budget();
        machine.set_position(PagePoint::default());
        machine
    }

    /// Returns the settings by which the machine works at present.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns what the machine is doing.
    pub fn state(&self) -> State {
        self.activity.state()
    }

    /// Returns the error for a command that the current state does not allow.
    fn refusal(&self) -> MachineError {
        MachineError::State(self.state())
    }

    /// Declares that the machine is at `page`, whatever position it had. The step counters of the
    /// pins keep their values; only their origin changes.
    fn set_position(&mut self, page: PagePoint) {
        self.set_motors(self.settings.kinematics().motors(page), page);
    }

    /// Declares where the machine is, whatever position it had: at `motors` in steps of the motors,
    /// which is `page` on the page.
    fn set_motors(&mut self, motors: PagePoint, page: PagePoint) {
        #[cfg(feature = "spread-backlash")]
        self.settle_backlash_at_pins();
        let (x, y) = self.pins.steps();
        self.origin = PagePoint { x: motors.x.wrapping_sub(x), y: motors.y.wrapping_sub(y) };
        self.segmenter = None;
        #[cfg(feature = "spread-backlash")]
        self.forget_shift();
        let backlash = self.correct_backlash();
        self.runner.set_lift(self.pins.z());
        self.runner.set_position(motors, backlash, page, self.pins.ticks());
        #[cfg(feature = "spread-backlash")]
        self.restart_spread_backlash();
    }

    /// Slows down along the path and raises the pen. A jog is ended instead. In other states
    /// nothing happens.
    pub fn hold(&mut self) {
        match self.activity {
            Activity::Run(source) => {
                self.runner.stop();
                self.activity = Activity::Hold { stopped: false, source };
            }
            Activity::Jog => self.abort(),
            _ => {}
        }
    }

    /// Pauses at the end of the current stroke. [`Machine::resume`] continues the job.
    pub fn pause_after_stroke(&mut self) {
        if let Activity::Run(_) = self.activity {
            self.runner.stop_after_stroke();
        }
    }

    /// Scales the feeds, and the speeds of the settings, to `percent`, with immediate effect. The
    /// value is clamped to 10 to 200. No speed is raised above the greater of the two in the
    /// settings, those with the pen down and up.
    pub fn set_override(&mut self, percent: u8) {
        self.percent = percent.clamp(10, 200);
        self.apply_override();
    }

    /// Passes the overrides to the motion planner. Homing and jogs have none.
    fn apply_override(&mut self) {
        let (percent, rapid_percent) = match self.activity {
            Activity::Home(_) | Activity::Jog => (100, 100),
            _ => (self.percent, self.rapid_percent),
        };
        self.runner.set_override(percent, rapid_percent);
    }

    /// Scales the speed of moves with the pen up further, to `percent`, with immediate effect. The
    /// value is clamped to 25 to 100.
    pub fn set_rapid_override(&mut self, percent: u8) {
        self.rapid_percent = percent.clamp(25, 100);
        self.set_override(self.percent);
    }

    /// Lowers the pen where it was raised and continues the job. If the machine waited for a pen
    /// change, it continues with the next pen.
    pub fn resume(&mut self) {
        let Activity::Hold { mut source, .. } = self.activity else { return };
        if let Source::PenChange { pen, first } = source
            && self.pen_wanted().is_some()
        {
            self.steady = Steady::default();
            self.set_pen(pen);
            source = Source::Path;
            match self.push(first, SpeedLimit::NONE) {
                Ok(length) => self.pass_point(first, length),
                Err(_) => {
                    self.abort();
                    return;
                }
            }
        }
        self.runner.resume();
        self.activity = Activity::Run(source);
    }

    /// Slows down, raises the pen and cancels the job. The position stays known. This also ends a
    /// feed hold, a jog and homing. Homing that began in an alarm, or that has homed one axis,
    /// stops at once and ends in [`Alarm::NotHomed`], because the position is unknown.
    pub fn abort(&mut self) {
        if let Activity::Home(Homing { is_lost: true, .. }) = self.activity {
            return self.alarm(Alarm::NotHomed);
        }
        if matches!(
            self.activity,
            Activity::Run(_) | Activity::Hold { .. } | Activity::Jog | Activity::Home(_)
        ) {
            self.segmenter = None;
            self.limit_log();
            self.runner.stop();
            self.activity = Activity::Abort;
        }
    }

    /// Stops the pulses at once, raises the pen and enters the alarm. The position is where the
    /// pins stopped.
    pub fn alarm(&mut self, alarm: Alarm) {
        self.pins.halt();
        if let Activity::Sleep { .. } = self.activity {
            self.forget_what_needs_current();
        }
        self.end_log();
        self.segmenter = None;
        self.forget_path(self.planned_position());
        self.runner.forget_pen();
        self.end_motion(Activity::Alarm(alarm));
    }

    /// Switches the motors off. [`Machine::wake`] and [`Machine::unlock`] end this state.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle.
    pub fn sleep(&mut self) -> Result<(), MachineError> {
        let Activity::Idle = self.activity else { return Err(self.refusal()) };
        self.activity = Activity::Sleep { drivers_on: true };
        Ok(())
    }

    /// Ends sleep, if the machine is asleep. If the settings require homing, that ends in
    /// [`Alarm::NotHomed`], because motors without current may have been turned.
    pub fn wake(&mut self) {
        match self.activity {
            Activity::Sleep { .. } if self.settings.is_on(Setting::Homing) => {
                self.alarm(Alarm::NotHomed);
            }
            // It is not refused in this state.
            Activity::Sleep { .. } => {
                let _ = self.unlock();
            }
            _ => {}
        }
    }

    /// Switches check mode on or off. In check mode, jobs are measured but not drawn.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle or in check mode.
    pub fn check(&mut self, on: bool) -> Result<(), MachineError> {
        let (Activity::Idle | Activity::Check) = self.activity else { return Err(self.refusal()) };
        self.activity = if on { Activity::Check } else { Activity::Idle };
        Ok(())
    }

    /// Ends an alarm or sleep. After an alarm, the position is the one that the step counters of
    /// the pins give.
    ///
    /// # Errors
    /// [`MachineError::State`] in other states, while the interrupt still empties its queue, while
    /// a motor still raises the pen, and while the emergency stop is pressed.
    pub fn unlock(&mut self) -> Result<(), MachineError> {
        match self.activity {
            Activity::Sleep { .. } => self.forget_what_needs_current(),
            Activity::Alarm(alarm) => {
                self.release_pins(alarm)?;
                if alarm == Alarm::Restarted {
                    self.forget_what_needs_current();
                }
            }
            _ => return Err(self.refusal()),
        }
        self.activity = Activity::Idle;
        Ok(())
    }

    /// Lets the pins move again after an alarm, from where they are.
    ///
    /// # Errors
    /// See [`Machine::unlock`].
    fn release_pins(&mut self, alarm: Alarm) -> Result<(), MachineError> {
        let is_held = self.runner.is_pen_held(alarm == Alarm::Restarted);
        if !self.is_stopped() || self.contacts.stop || is_held {
            return Err(self.refusal());
        }
        self.set_motors(self.motors_now(), self.position());
        self.pins.release();
        Ok(())
    }

    /// Forgets on which side of its backlash each motor is, and the height of a pen that a motor
    /// lifts: the motors have had no current, so they may have been turned.
    fn forget_what_needs_current(&mut self) {
        self.forget_backlash();
        self.runner.forget_lift();
    }

    /// Declares that the pen has been put at the page's origin by hand.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle and at rest.
    #[cfg(feature = "resume")]
    pub fn declare_origin(&mut self) -> Result<(), MachineError> {
        if !matches!(self.activity, Activity::Idle) || !self.is_stopped() {
            return Err(self.refusal());
        }
        self.forget_backlash();
        self.set_position(PagePoint::default());
        Ok(())
    }

    /// Whether every step event has been carried out, so that the pins are where the plan ends.
    pub fn is_stopped(&self) -> bool {
        self.pins.is_drained()
            && (self.pins.is_halted() || self.pins.ticks() == self.runner.ticks())
    }
}

#[cfg(test)]
mod tests;
