//! Axes, kinematics, pen, limits, homing, hold, abort: a state machine.
//!
//! [`Machine`] is the main loop's side. It takes a [`Path`], refuses it before anything moves if it
//! leads beyond the travel, and keeps the interrupt's queue filled. [`Pulser`] is the interrupt's
//! side; [`PulserState`] joins the two. The events are a function of path and settings, and of the
//! call of [`Machine::fill`] at which an order arrives: time is never read.
//!
//! Refused: orders that the state does not allow, settings that conflict, moves beyond the limits;
//! each leaves everything as it was.

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

/// What the machine does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Ready.
    Idle,
    /// Draws.
    Run,
    /// Slows down on the path, or stands there with the pen raised.
    Hold {
        /// Whether it stands.
        standing: bool,
    },
    /// Slows down to give the job up; then [`State::Idle`].
    Abort,
    /// Moves by hand.
    Jog,
    /// Looks for the switches.
    Home,
    /// Jobs are measured, not drawn.
    Check,
    /// Stopped; needs [`Machine::unlock`].
    Alarm(Alarm),
    /// Motors off; needs [`Machine::unlock`].
    Sleep,
}

/// Why the machine stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Alarm {
    /// The emergency stop.
    EmergencyStop,
    /// A limit switch.
    HardLimit,
    /// The machine starts without knowing where it is; [`Machine::home`] finds out.
    NotHomed,
    /// A switch was not found, or stayed pressed.
    HomingFailed(Axis),
    /// The queue refused an event although it had room: a fault of the program.
    Queue,
    /// The watchdog started the board again: a fault of the program.
    Restarted,
}

/// Why an order was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineError {
    /// The state does not allow it.
    State(State),
    /// A target lies beyond the travel.
    BeyondTravel {
        /// Which target, from 0.
        target: u32,
        /// Millimetres beyond x (negative: below 0).
        x: Value,
        /// Millimetres beyond y.
        y: Value,
    },
    /// A move is longer than motion can plan: 16 m.
    MoveTooLong {
        /// Which target, from 0.
        target: u32,
    },
}

/// The main loop's side of the plotter.
#[derive(Debug)]
pub struct Machine<'m> {
    settings: Settings,
    state: State,
    runner: Runner<'m>,
    pins: &'m PulserState,
    /// The motors' position where the pins' count is 0.
    origin: PagePoint,
    ahead_ticks: u32,
    job: JobSize,
    /// The runner's lengths and strokes when the job began.
    before: RunLengths,
    /// The move that is being cut into pieces.
    split: Option<Segmenter>,
    slack: Backlash,
    /// Whether the path has been read to its end.
    path_ended: bool,
    /// Whether the drivers are to be switched off once.
    sleep_due: bool,
    homing: Option<Homing>,
    /// What was pressed when last observed.
    switches: Switches,
    stop_is_pressed: bool,
    /// Whether the moves come one by one, and whether the last of them was inked.
    streaming: bool,
    stream_is_inked: bool,
    /// Speeds in percent of the settings.
    percent: u8,
    /// The pen in the holder.
    pen: u8,
    /// The pen that comes next, and the first target that it draws.
    next_pen: Option<(u8, Target)>,
}

impl<'m> Machine<'m> {
    /// A machine at rest at the page's origin, pen raised; in alarm if it must be homed first.
    ///
    /// `blocks` is the look-ahead (24 bytes each; one at least, 100 or more serve well). `ahead_ticks` is how far
    /// the queue is planned ahead of the pins, or further if the machine could not stop within that
    /// should the main loop be late; so late a hold takes effect. `u32::MAX` for no bound but the queue's.
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
    /// See [`SettingError`]; the old value stays then.
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
            // The pen stays where it is; the motors count otherwise.
            self.set_position(page);
        }
        self.take_settings();
        self.configure_pulser();
        Ok(())
    }

    fn take_settings(&mut self) {
        self.runner.set_limits(self.settings.limits(), self.settings.pen_positions());
        self.runner.set_override(self.percent);
    }

    /// What it does.
    pub fn state(&self) -> State {
        self.state
    }

    /// The machine stands at `page`, whatever it thought: the pins' count starts from there.
    fn set_position(&mut self, page: PagePoint) {
        self.set_motors(self.settings.kinematics().motors(page), page);
    }

    fn set_motors(&mut self, motors: PagePoint, page: PagePoint) {
        let (x, y) = self.pins.steps();
        self.origin = PagePoint { x: motors.x.wrapping_sub(x), y: motors.y.wrapping_sub(y) };
        self.split = None;
        let slack = self.find_slack();
        self.runner.set_lift(self.pins.lift());
        self.runner.set_position(motors, slack, page, self.pins.ticks());
    }

    /// Slows down on the path and raises the pen. Ends moves by hand; nothing happens in other states.
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

    /// Pauses as soon as the stroke in work ends; [`Machine::resume`] goes on.
    pub fn pause_after_stroke(&mut self) {
        if self.state == State::Run {
            self.runner.stop_after_stroke();
        }
    }

    /// Scales the speeds to `percent` of the settings, 10 to 200, at once; never above the greater
    /// of the two.
    pub fn set_override(&mut self, percent: u8) {
        self.percent = percent.clamp(10, 200);
        if self.homing.is_none() {
            self.runner.set_override(self.percent);
        }
    }

    /// Lowers the pen where it was raised and goes on; with the next pen, if the machine waited for
    /// it.
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

    /// Slows down, raises the pen, forgets the job, keeps the position. Ends a hold and a jog, too.
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

    /// Stops the pulses at once and raises the pen. The position is where the pins stopped.
    pub fn alarm(&mut self, alarm: Alarm) {
        // What the interrupt has not begun with yet it has still to throw away.
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

    /// Switches the motors off.
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

    /// Whether jobs are measured only.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle or checks.
    pub fn check(&mut self, on: bool) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Check) {
            return Err(MachineError::State(self.state));
        }
        self.state = if on { State::Check } else { State::Idle };
        Ok(())
    }

    /// Leaves alarm and sleep. After an alarm the position is what the pins counted.
    ///
    /// # Errors
    /// [`MachineError::State`] in other states, while the interrupt still empties its queue, while a
    /// motor still raises the pen, and while the emergency stop is pressed.
    pub fn unlock(&mut self) -> Result<(), MachineError> {
        match self.state {
            // The motors were off.
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

    /// Whether every event has been worked off: the pins stand where the plan does.
    pub fn is_stopped(&self) -> bool {
        self.pins.is_drained()
            && (self.pins.is_halted() || self.pins.ticks() == self.runner.ticks())
    }

    /// While nothing moves.
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
