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

mod cut_positions;
mod homing;
mod job;
mod kinematics;
mod path;
mod pulser;
mod ring;
mod settings;
mod backlash;
mod segmenter;
mod status;
mod stream;

use backlash::Backlash;
pub use cut_positions::CutPositions;
use homing::Homing;
pub use homing::{Axis, Contacts, Switches};
pub use kinematics::{Anchors, Kinematics, SegmentEnd};
pub use path::{JobSize, Path, TapePath, Target, TargetList};
pub use pulser::{Axes, Pen, PinOrder, Pins, Pulser, PulserState, Solenoid, StepQueue, Tick};
pub use ring::EventRing;
use segmenter::Segmenter;
pub use settings::{SETTING_COUNT, SETTINGS, Setting, SettingError, SettingInfo, Settings, Value};
pub use status::Status;

use crate::drawing::PagePoint;
use crate::motion::{Block, PathLength, RunLengths, Runner};

/// What the machine is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// The machine is at rest and ready for a command.
    Idle,
    /// The machine draws a path, or moves that are sent one by one.
    Run,
    /// A feed hold: the machine slows down along the path, or it has stopped with the pen raised.
    Hold {
        /// Whether the machine has stopped. `false` while it still slows down.
        standing: bool,
    },
    /// The machine slows down to cancel the job; [`State::Idle`] follows.
    Abort,
    /// The machine makes moves that the user commands by hand (jogging).
    Jog,
    /// The machine is homing: it searches for the limit switches.
    Home,
    /// Check mode: jobs are measured, but not drawn.
    Check,
    /// The machine has stopped because of an alarm. [`Machine::unlock`] ends the alarm.
    Alarm(Alarm),
    /// The motors are switched off. [`Machine::unlock`] ends this state.
    Sleep,
}

/// The reason for an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Alarm {
    /// The emergency stop was pressed.
    EmergencyStop,
    /// A limit switch was pressed during a move.
    HardLimit,
    /// The machine has just started and does not know its position. [`Machine::home`] finds the
    /// position.
    NotHomed,
    /// Homing did not find the switch of this axis, or the switch stayed pressed.
    HomingFailed(Axis),
    /// The queue refused an event although it had reported room. This is a bug in the firmware.
    Queue,
    /// The watchdog restarted the board. This is a bug in the firmware.
    Restarted,
}

/// Why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineError {
    /// The command is not allowed in this state.
    State(State),
    /// A target lies beyond the travel.
    BeyondTravel {
        /// The index of the target, counted from 0.
        target: u32,
        /// How far the target lies beyond the travel of x, in millimetres; negative if it lies
        /// below 0.
        x: Value,
        /// How far the target lies beyond the travel of y, in millimetres; negative if it lies
        /// below 0.
        y: Value,
    },
    /// A move is longer than the motion planner can plan: 16 m.
    MoveTooLong {
        /// The index of the target, counted from 0.
        target: u32,
    },
}

/// The state of the plotter that the main loop owns.
#[derive(Debug)]
pub struct Machine<'m> {
    /// The settings in force.
    settings: Settings,
    /// What the machine is doing.
    state: State,
    /// The motion planner, which produces the events.
    runner: Runner<'m>,
    /// The state that is shared with the interrupt.
    pins: &'m PulserState,
    /// The position of the motors, in steps, at which the step counters of `pins` are 0.
    origin: PagePoint,
    /// How far the queue is planned ahead of the pins, in ticks.
    ahead_ticks: u32,
    /// The size of the present job, or of the last one.
    job: JobSize,
    /// The runner's totals of lengths and strokes when the job began.
    before: RunLengths,
    /// The move that is being cut into segments, if any.
    split: Option<Segmenter>,
    /// Where the motors are within their slack.
    slack: Backlash,
    /// Whether the path has been read to its end.
    path_ended: bool,
    /// Whether the drivers are still to be switched off because of [`Machine::sleep`].
    sleep_due: bool,
    /// The progress of homing; `None` if the machine is not homing.
    homing: Option<Homing>,
    /// The limit switches that were pressed when they were last observed.
    switches: Switches,
    /// Whether the emergency stop was pressed when it was last observed.
    stop_is_pressed: bool,
    /// Whether the moves are sent one by one.
    streaming: bool,
    /// Whether the last of these moves was drawn with the pen down.
    stream_is_inked: bool,
    /// The speed override, in percent of the speeds in the settings.
    percent: u8,
    /// The number of the pen in the holder, counted from 0.
    pen: u8,
    /// The pen to be inserted next, and the first target that it draws.
    next_pen: Option<(u8, Target)>,
}

impl<'m> Machine<'m> {
    /// A machine at rest at the page's origin with the pen raised. If the settings require homing,
    /// it starts in the alarm [`Alarm::NotHomed`].
    ///
    /// `blocks` is the memory of the look-ahead, at 24 bytes per block. It needs at least one
    /// block; 100 or more work well. `ahead_ticks` is how far the queue is planned ahead of the
    /// pins. The machine plans further ahead if it could otherwise not stop in time when the main
    /// loop is late. A feed hold takes effect after that delay. With `u32::MAX` only the size of
    /// the queue limits the planning.
    pub fn new(
        settings: Settings,
        blocks: &'m mut [Block],
        pins: &'m PulserState,
        ahead_ticks: u32,
    ) -> Self {
        let mut machine = Self {
            settings,
            state: if settings.is_on(Setting::Homing) {
                State::Alarm(Alarm::NotHomed)
            } else {
                State::Idle
            },
            runner: Runner::new(settings.limits(), settings.pen_positions(), blocks),
            pins,
            origin: PagePoint::default(),
            ahead_ticks,
            job: JobSize::default(),
            before: RunLengths::default(),
            split: None,
            slack: Backlash::default(),
            path_ended: true,
            sleep_due: false,
            homing: None,
            switches: Switches::default(),
            stop_is_pressed: false,
            streaming: false,
            stream_is_inked: false,
            percent: 100,
            pen: 0,
            next_pen: None,
        };
        machine.configure_pulser();
        machine.set_position(PagePoint::default());
        machine
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes a setting.
    ///
    /// # Errors
    /// See [`SettingError`]. On an error the setting keeps its old value.
    pub fn set(&mut self, setting: Setting, value: Value) -> Result<(), SettingError> {
        if !matches!(self.state, State::Idle | State::Check | State::Alarm(_)) || !self.is_stopped()
        {
            return Err(SettingError::Busy);
        }
        let (page, before) = (self.position(), self.settings.kinematics());
        let slack = self.slack_steps();
        self.settings.set(setting, value)?;
        self.resize_slack(slack);
        if self.settings.kinematics() != before {
            // The pen stays where it is, but the motors' coordinates for that position change.
            self.set_position(page);
        }
        self.take_settings();
        self.configure_pulser();
        Ok(())
    }

    /// Passes the limits, the pen positions and the override to the motion planner.
    fn take_settings(&mut self) {
        self.runner.set_limits(self.settings.limits(), self.settings.pen_positions());
        self.runner.set_override(self.percent);
    }

    /// What the machine is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Declares that the machine is at `page`, whatever position it had. The step counters of the
    /// pins keep their values; only their origin changes.
    fn set_position(&mut self, page: PagePoint) {
        self.set_motors(self.settings.kinematics().motors(page), page);
    }

    /// Does the same as [`Machine::set_position`], with the position given both for the motors and
    /// on the page.
    fn set_motors(&mut self, motors: PagePoint, page: PagePoint) {
        let (x, y) = self.pins.steps();
        self.origin = PagePoint { x: motors.x.wrapping_sub(x), y: motors.y.wrapping_sub(y) };
        self.split = None;
        let slack = self.find_slack();
        self.runner.set_lift(self.pins.lift());
        self.runner.set_position(motors, slack, page, self.pins.ticks());
    }

    /// Slows down along the path and raises the pen. A jog is ended instead. In other states
    /// nothing happens.
    pub fn hold(&mut self) {
        match self.state {
            State::Run => {
                self.runner.stop();
                self.state = State::Hold { standing: false };
            }
            State::Jog => self.abort(),
            _ => {}
        }
    }

    /// Pauses at the end of the current stroke. [`Machine::resume`] continues the job.
    pub fn pause_after_stroke(&mut self) {
        if self.state == State::Run {
            self.runner.stop_after_stroke();
        }
    }

    /// Scales the speeds to `percent` of the settings, with immediate effect. The value is clamped
    /// to 10 to 200. Neither speed is raised above the greater of the two speeds in the settings,
    /// those with the pen down and up.
    pub fn set_override(&mut self, percent: u8) {
        self.percent = percent.clamp(10, 200);
        if self.homing.is_none() {
            self.runner.set_override(self.percent);
        }
    }

    /// Lowers the pen where it was raised and continues the job. If the machine waited for a pen
    /// change, it continues with the next pen.
    pub fn resume(&mut self) {
        if matches!(self.state, State::Hold { .. }) {
            if self.state == (State::Hold { standing: true })
                && self.runner.is_at_rest()
                && let Some((pen, target)) = self.next_pen.take()
            {
                self.pen = pen;
                if self.push(target, PathLength::MAX).is_err() {
                    self.abort();
                    return;
                }
            }
            self.runner.resume();
            self.state = State::Run;
        }
    }

    /// Slows down, raises the pen and cancels the job. The position stays known. This also ends a
    /// feed hold, a jog and homing.
    pub fn abort(&mut self) {
        if matches!(self.state, State::Run | State::Hold { .. } | State::Jog | State::Home) {
            self.end_homing();
            self.next_pen = None;
            self.streaming = false;
            self.split = None;
            self.runner.stop();
            self.path_ended = true;
            self.state = State::Abort;
        }
    }

    /// Stops the pulses at once, raises the pen and enters the alarm. The position is where the
    /// pins stopped.
    pub fn alarm(&mut self, alarm: Alarm) {
        // Events that the interrupt has not begun to process must still be discarded by it.
        let waits = self.pins.is_drained() && !self.is_stopped();
        self.pins.halt();
        if waits {
            self.pins.fill();
        }
        self.end_homing();
        self.next_pen = None;
        self.split = None;
        self.forget_path(self.planned_position());
        self.runner.forget_pen();
        self.path_ended = true;
        self.streaming = false;
        self.sleep_due = false;
        self.state = State::Alarm(alarm);
    }

    /// Switches the motors off. [`Machine::unlock`] ends this state.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle.
    pub fn sleep(&mut self) -> Result<(), MachineError> {
        if self.state != State::Idle {
            return Err(MachineError::State(self.state));
        }
        self.sleep_due = true;
        self.state = State::Sleep;
        Ok(())
    }

    /// Switches check mode on or off. In check mode, jobs are measured but not drawn.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle or in check mode.
    pub fn check(&mut self, on: bool) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Check) {
            return Err(MachineError::State(self.state));
        }
        self.state = if on { State::Check } else { State::Idle };
        Ok(())
    }

    /// Ends an alarm or sleep. After an alarm, the position is the one that the step counters of
    /// the pins give.
    ///
    /// # Errors
    /// [`MachineError::State`] in other states, while the interrupt still empties its queue, while
    /// a motor still raises the pen, and while the emergency stop is pressed.
    pub fn unlock(&mut self) -> Result<(), MachineError> {
        match self.state {
            // The motors had no current, so the slack and the height of the pen are unknown.
            State::Sleep => {
                self.slack.forget();
                self.runner.forget_lift();
            }
            State::Alarm(alarm)
                if self.is_stopped()
                    && !self.stop_is_pressed
                    && !self.runner.is_pen_held(alarm == Alarm::Restarted) =>
            {
                self.set_motors(self.motors_now(), self.position());
                self.pins.release();
            }
            _ => return Err(MachineError::State(self.state)),
        }
        self.state = State::Idle;
        Ok(())
    }

    /// Whether every event has been processed, so that the pins are where the plan ends.
    pub fn is_stopped(&self) -> bool {
        self.pins.is_drained()
            && (self.pins.is_halted() || self.pins.ticks() == self.runner.ticks())
    }

    /// Passes pulse width, pin inversion and braking rule to the interrupt. Call it only while
    /// nothing moves.
    fn configure_pulser(&mut self) {
        self.pins.configure(
            self.settings.microseconds_as_ticks(Setting::StepPulse),
            self.settings.get(Setting::InvertDirections).saturating_to_num(),
        );
        let rule = self.settings.brake(self.pins.queue());
        self.runner.set_brake(rule);
        self.pins.brake().set_rule(rule);
    }
}
