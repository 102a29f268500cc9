//! Axes, pen, limits, hold, abort: a state machine.
//!
//! [`Machine`] is the main loop's side. It takes a [`Path`], refuses it before anything moves if it
//! leads beyond the travel, and keeps the interrupt's queue filled. [`Pulser`] is the interrupt's
//! side; [`PulserState`] joins the two. The events are a function of path and settings, and of the
//! call of [`Machine::fill`] at which an order arrives: time is never read.
//!
//! Refused: orders that the state does not allow, settings that conflict, moves beyond the limits;
//! each leaves everything as it was.

mod path;
mod pulser;
mod settings;

pub use path::{JobSize, Path, Target, TargetList};
pub use pulser::{Pen, Pins, Pulser, PulserState, Solenoid};
pub use settings::{SETTING_COUNT, SETTINGS, Setting, SettingError, SettingInfo, Settings, Value};

use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::motion::{Block, EventQueue, Progress, PushError, RunLengths, Runner};

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
    /// The queue refused an event although it had room: a fault of the program.
    Queue,
}

/// Why an order was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum MachineError {
    /// The state does not allow it.
    State(State),
    /// A target lies beyond the travel, by so many steps.
    BeyondTravel {
        /// Which target, from 0.
        target: u32,
        /// Steps beyond x (negative: below 0).
        x: i32,
        /// Steps beyond y.
        y: i32,
    },
    /// A move is longer than motion can plan: 16 m.
    MoveTooLong {
        /// Which target, from 0.
        target: u32,
    },
}

/// A report for the status line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// What the machine does.
    pub state: State,
    /// Where the pins are, in steps.
    pub position: PagePoint,
    /// The job's size; zero if none was started.
    pub job: JobSize,
    /// What of it is planned already: at most the queue ahead of the pins.
    pub done: JobSize,
}

/// The main loop's side of the plotter.
#[derive(Debug)]
pub struct Machine<'m> {
    settings: Settings,
    state: State,
    runner: Runner<'m>,
    pins: &'m PulserState,
    /// The machine's position where the pins' count is 0.
    origin: PagePoint,
    ahead_ticks: u32,
    job: JobSize,
    /// The runner's lengths and strokes when the job began.
    before: RunLengths,
    /// Whether the path has been read to its end.
    path_ended: bool,
    /// Whether the drivers are to be switched off once.
    sleep_due: bool,
}

impl<'m> Machine<'m> {
    /// A machine at rest at the page's origin, pen raised.
    ///
    /// `blocks` is the look-ahead (20 bytes each; 100 or more serve well). `ahead_ticks` is how far
    /// the queue may be planned ahead of the pins, and so how late a hold takes effect;
    /// `u32::MAX` for no bound but the queue's.
    pub fn new(
        settings: Settings,
        blocks: &'m mut [Block],
        pins: &'m PulserState,
        ahead_ticks: u32,
    ) -> Self {
        let machine = Self {
            settings,
            state: State::Idle,
            runner: Runner::new(settings.limits(), settings.pen_positions(), blocks),
            pins,
            origin: PagePoint::default(),
            ahead_ticks,
            job: JobSize::default(),
            before: RunLengths::default(),
            path_ended: true,
            sleep_due: false,
        };
        machine.configure_pulser();
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
        if !matches!(self.state, State::Idle | State::Check | State::Alarm(_)) || !self.stands() {
            return Err(SettingError::Busy);
        }
        self.settings.set(setting, value)?;
        self.runner.set_limits(self.settings.limits(), self.settings.pen_positions());
        self.configure_pulser();
        Ok(())
    }

    /// What it does.
    pub fn state(&self) -> State {
        self.state
    }

    /// Where it is, and how far the job is.
    pub fn status(&self) -> Status {
        let run = self.runner.run();
        Status {
            state: self.state,
            position: self.position(),
            job: self.job,
            done: JobSize {
                strokes: run.strokes.wrapping_sub(self.before.strokes),
                drawn: run.drawn - self.before.drawn,
                travelled: run.travelled - self.before.travelled,
            },
        }
    }

    /// Where the pins are, in steps.
    pub fn position(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) }
    }

    /// Where the events planned so far lead, in steps.
    pub fn planned_position(&self) -> PagePoint {
        self.runner.position()
    }

    /// The length of a step of x and of y is its setting; this is the position in millimetres.
    pub fn position_mm(&self) -> [Value; 2] {
        let point = self.position();
        let mm = |steps: i32, setting: Setting| {
            let steps_per_mm = i64::from(self.settings.get(setting).to_bits());
            let bits = (i64::from(steps) << (2 * Value::FRAC_NBITS)) / steps_per_mm.max(1);
            Value::from_bits(bits.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
        };
        [mm(point.x, Setting::StepsPerMmX), mm(point.y, Setting::StepsPerMmY)]
    }

    /// Measures the path from where the machine stands, and begins to draw it if all of it can be
    /// drawn (in [`State::Check`] it is only measured).
    ///
    /// # Errors
    /// See [`MachineError`]; nothing moves then.
    pub fn start(&mut self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        if !matches!(self.state, State::Idle | State::Check) {
            return Err(MachineError::State(self.state));
        }
        let size = self.measure(path)?;
        if self.state == State::Idle {
            self.job = size;
            self.before = self.runner.run();
            self.path_ended = false;
            self.state = State::Run;
        }
        Ok(size)
    }

    /// Moves to `point` with the pen raised.
    ///
    /// # Errors
    /// See [`MachineError`]; nothing moves then.
    pub fn jog(&mut self, point: PagePoint) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Jog) {
            return Err(MachineError::State(self.state));
        }
        self.check_travel(0, point)?;
        match self.runner.push(point, None) {
            Ok(()) => {
                self.state = State::Jog;
                Ok(())
            }
            Err(PushError::Full) => Err(MachineError::State(self.state)),
            Err(PushError::TooLong) => Err(MachineError::MoveTooLong { target: 0 }),
        }
    }

    /// Keeps the queue filled: reads targets while the look-ahead has room, hands over events while
    /// the queue has room and the plan is not too far ahead. Call it often.
    pub fn fill(&mut self, path: &mut dyn Path, queue: &mut dyn EventQueue) {
        if self.pins.is_halted() {
            return;
        }
        if core::mem::take(&mut self.sleep_due) && self.runner.release_drivers(queue).is_err() {
            self.alarm(Alarm::Queue);
        }
        while self.is_moving() {
            self.read_targets(path);
            let ahead = self.runner.ticks().wrapping_sub(self.pins.ticks());
            if queue.room() < Runner::ROOM || ahead >= self.ahead_ticks {
                return;
            }
            match self.runner.produce(queue) {
                Ok(Progress::More) => {}
                Ok(Progress::Done) => self.state = State::Idle,
                Ok(Progress::Stopped) => self.stand(),
                Err(_) => self.alarm(Alarm::Queue),
            }
        }
    }

    /// Slows down on the path and raises the pen. Nothing happens unless the machine draws.
    pub fn hold(&mut self) {
        if self.state == State::Run {
            self.runner.stop();
            self.state = State::Hold { standing: false };
        }
    }

    /// Lowers the pen where it was raised and goes on.
    pub fn resume(&mut self) {
        if matches!(self.state, State::Hold { .. }) {
            self.runner.resume();
            self.state = State::Run;
        }
    }

    /// Slows down, raises the pen, forgets the job, keeps the position. Ends a hold and a jog, too.
    pub fn abort(&mut self) {
        if matches!(self.state, State::Run | State::Hold { .. } | State::Jog) {
            self.runner.stop();
            self.path_ended = true;
            self.state = State::Abort;
        }
    }

    /// Stops the pulses at once and raises the pen. The position is where the pins stopped.
    pub fn alarm(&mut self, alarm: Alarm) {
        self.pins.halt();
        self.runner.forget_path();
        self.path_ended = true;
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
    /// [`MachineError::State`] in other states, and while the interrupt still empties its queue.
    pub fn unlock(&mut self) -> Result<(), MachineError> {
        match self.state {
            State::Sleep => {}
            State::Alarm(_) if self.pins.is_drained() => {
                let position = self.position();
                self.runner.set_position(position, self.pins.ticks());
                self.pins.release();
            }
            _ => return Err(MachineError::State(self.state)),
        }
        self.state = State::Idle;
        Ok(())
    }

    /// Whether every event has been worked off: the pins stand where the plan does.
    pub fn stands(&self) -> bool {
        self.pins.is_drained()
            && (self.pins.is_halted() || self.pins.ticks() == self.runner.ticks())
    }

    fn is_moving(&self) -> bool {
        matches!(
            self.state,
            State::Run | State::Hold { standing: false } | State::Abort | State::Jog
        )
    }

    fn stand(&mut self) {
        match self.state {
            State::Hold { .. } => self.state = State::Hold { standing: true },
            _ => {
                self.runner.forget_path();
                self.state = State::Idle;
            }
        }
    }

    fn read_targets(&mut self, path: &mut dyn Path) {
        while !self.path_ended && !self.runner.is_full() {
            match path.next_target() {
                // Measured at the start, so it fits.
                Some(target) => {
                    if self.runner.push(target.point, target.ink).is_err() {
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

    fn measure(&self, path: &mut dyn Path) -> Result<JobSize, MachineError> {
        path.rewind();
        let mut size = JobSize::default();
        let mut at = self.runner.end();
        let mut inked = false;
        let mut number = 0u32;
        while let Some(Target { point, ink }) = path.next_target() {
            self.check_travel(number, point)?;
            let length = self
                .runner
                .limits()
                .length(point.x - at.x, point.y - at.y)
                .ok_or(MachineError::MoveTooLong { target: number })?;
            let length = u64::from(length.to_bits());
            if ink.is_some() {
                size.drawn += length;
                size.strokes += u32::from(!inked);
            } else {
                size.travelled += length;
            }
            inked = ink.is_some();
            at = point;
            number = number.saturating_add(1);
        }
        path.rewind();
        Ok(size)
    }

    fn check_travel(&self, target: u32, point: PagePoint) -> Result<(), MachineError> {
        let beyond = |at: i32, travel: Setting, steps_per_mm: Setting| {
            let (least, most) = if self.settings.is_on(Setting::SoftLimits) {
                let steps = i64::from(self.settings.get(travel).to_bits())
                    * i64::from(self.settings.get(steps_per_mm).to_bits());
                let steps = steps >> (2 * Value::FRAC_NBITS);
                (0, steps.min(PAGE_LIMIT.into()) as i32)
            } else {
                (-PAGE_LIMIT, PAGE_LIMIT)
            };
            at.saturating_sub(at.clamp(least, most))
        };
        let x = beyond(point.x, Setting::TravelX, Setting::StepsPerMmX);
        let y = beyond(point.y, Setting::TravelY, Setting::StepsPerMmY);
        if (x, y) == (0, 0) { Ok(()) } else { Err(MachineError::BeyondTravel { target, x, y }) }
    }

    fn configure_pulser(&self) {
        self.pins.configure(
            self.settings.microseconds_as_ticks(Setting::StepPulse),
            self.settings.get(Setting::InvertDirections).saturating_to_num(),
        );
    }
}
