//! Axes, pen, limits, hold, abort: a state machine.
//!
//! [`Machine`] is the main loop's side. It takes a [`Path`], refuses it before anything moves if it
//! leads beyond the travel, and keeps the interrupt's queue filled. [`Pulser`] is the interrupt's
//! side; [`PulserState`] joins the two. The events are a function of path and settings, and of the
//! call of [`Machine::fill`] at which an order arrives: time is never read.
//!
//! Refused: orders that the state does not allow, settings that conflict, moves beyond the limits;
//! each leaves everything as it was.

mod homing;
mod kinematics;
mod path;
mod pulser;
mod settings;

use homing::Homing;
pub use homing::{Axis, Switches};
pub use kinematics::Kinematics;
pub use path::{JobSize, Path, TapePath, Target, TargetList};
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
    /// How long the rest takes at least, without what corners and bends cost.
    pub seconds_left: u32,
    /// The pen that the machine waits for, if it does.
    pub pen_wanted: Option<u8>,
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
    /// Whether the path has been read to its end.
    path_ended: bool,
    /// Whether the drivers are to be switched off once.
    sleep_due: bool,
    homing: Option<Homing>,
    /// The pen in the holder.
    pen: u8,
    /// The pen that comes next, and the first target that it draws.
    next_pen: Option<(u8, Target)>,
}

impl<'m> Machine<'m> {
    /// A machine at rest at the page's origin, pen raised; in alarm if it must be homed first.
    ///
    /// `blocks` is the look-ahead (24 bytes each; 100 or more serve well). `ahead_ticks` is how far
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
            path_ended: true,
            sleep_due: false,
            homing: None,
            pen: 0,
            next_pen: None,
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
        let done = JobSize {
            strokes: run.strokes.wrapping_sub(self.before.strokes),
            drawn: run.drawn - self.before.drawn,
            travelled: run.travelled - self.before.travelled,
        };
        Status {
            state: self.state,
            position: self.position(),
            job: self.job,
            done,
            seconds_left: self.seconds_left(done),
            pen_wanted: self.next_pen.map(|(pen, _)| pen),
        }
    }

    fn seconds_left(&self, done: JobSize) -> u32 {
        let at_speed = |length: u64, speed: Setting| {
            // 2^-18 mm over 2^-16 mm/min, in milliseconds.
            let speed = u64::from(self.settings.get(speed).to_bits().unsigned_abs());
            (length >> 2).saturating_mul(60_000) / speed.max(1)
        };
        let strokes = u64::from(self.job.strokes.saturating_sub(done.strokes));
        let dwell = self.settings.get(Setting::PenUpDwell).saturating_to_num::<u64>()
            + self.settings.get(Setting::PenDownDwell).saturating_to_num::<u64>();
        let milliseconds = at_speed(self.job.drawn.saturating_sub(done.drawn), Setting::DrawSpeed)
            + at_speed(self.job.travelled.saturating_sub(done.travelled), Setting::TravelSpeed)
            + strokes * dwell;
        u32::try_from(milliseconds / 1000).unwrap_or(u32::MAX)
    }

    /// Where the pins are, in steps of the page.
    pub fn position(&self) -> PagePoint {
        let (x, y) = self.pins.steps();
        let motors =
            PagePoint { x: self.origin.x.wrapping_add(x), y: self.origin.y.wrapping_add(y) };
        self.settings.kinematics().page(motors)
    }

    /// Where the events planned so far lead, in steps of the page.
    pub fn planned_position(&self) -> PagePoint {
        self.settings.kinematics().page(self.runner.position())
    }

    /// The machine stands at `page`, whatever it thought: the pins' count starts from there.
    fn set_position(&mut self, page: PagePoint) {
        let motors = self.settings.kinematics().motors(page);
        let (x, y) = self.pins.steps();
        self.origin = PagePoint { x: motors.x.wrapping_sub(x), y: motors.y.wrapping_sub(y) };
        self.runner.set_position(motors, self.pins.ticks());
    }

    fn push(&mut self, target: Target) -> Result<(), PushError> {
        self.runner.push(self.settings.kinematics().motors(target.point), target.ink)
    }

    /// The length of a step of x and of y is its setting; this is the position in millimetres.
    pub fn position_mm(&self) -> [Value; 2] {
        let point = self.position();
        let mm = |steps: i32, setting: Setting| {
            let steps_per_mm = i64::from(self.settings.get(setting).to_bits());
            let bits = (i64::from(steps) << (2 * Value::FRAC_NBITS)) / steps_per_mm.max(1);
            Value::from_bits(bits.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
        };
        [mm(point.x, Setting::StepsPerMmX), mm(point.y, self.settings.steps_per_mm_y())]
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
            self.fill_pen();
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
        match self.push(Target { point, ink: None }) {
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
            if queue.room() < Runner::ROOM || ahead >= self.greatest_ahead() {
                return;
            }
            match self.runner.produce(queue) {
                Ok(Progress::More) => {}
                Ok(progress) => self.stand(progress),
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

    /// Pauses as soon as the stroke in work ends; [`Machine::resume`] goes on.
    pub fn pause_after_stroke(&mut self) {
        if self.state == State::Run {
            self.runner.stop_after_stroke();
        }
    }

    /// Scales the speeds to `percent` of the settings, 10 to 100, from the next line on.
    pub fn set_override(&mut self, percent: u8) {
        self.runner.set_override(percent);
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
                if self.push(target).is_err() {
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
            self.runner.stop();
            self.path_ended = true;
            self.state = State::Abort;
        }
    }

    /// Stops the pulses at once and raises the pen. The position is where the pins stopped.
    pub fn alarm(&mut self, alarm: Alarm) {
        self.pins.halt();
        self.end_homing();
        self.next_pen = None;
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
                self.set_position(self.position());
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
        ) || self.homing.is_some_and(|homing| !homing.stands)
    }

    fn greatest_ahead(&self) -> u32 {
        // A switch is to stop the machine soon: 10 ms.
        if self.homing.is_some() { self.ahead_ticks.min(250_000) } else { self.ahead_ticks }
    }

    fn stand(&mut self, progress: Progress) {
        match self.state {
            State::Hold { .. } | State::Run
                if progress == Progress::Stopped || self.next_pen.is_some() =>
            {
                if self.state == State::Run {
                    self.fill_pen();
                }
                self.state = State::Hold { standing: true };
            }
            State::Home => {
                self.runner.forget_path();
                if let Some(homing) = &mut self.homing {
                    homing.stands = true;
                }
            }
            _ => {
                self.next_pen = None;
                self.runner.forget_path();
                self.state = State::Idle;
            }
        }
    }

    /// The pause after so much ink counts from here.
    fn fill_pen(&mut self) {
        let metres = u64::from(self.settings.get(Setting::InkBeforePause).to_bits().unsigned_abs());
        // 2^-16 m to 2^-18 mm.
        self.runner.stop_after_ink((metres > 0).then_some(metres * 4000));
    }

    fn read_targets(&mut self, path: &mut dyn Path) {
        while !self.path_ended && self.next_pen.is_none() && !self.runner.is_full() {
            match path.next_target() {
                Some(target) if path.pen() != self.pen => {
                    self.next_pen = Some((path.pen(), target));
                    self.runner.end_path();
                }
                // Measured at the start, so it fits.
                Some(target) => {
                    if self.push(target).is_err() {
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
        let kinematics = self.settings.kinematics();
        let mut at = self.runner.end();
        let mut inked = false;
        let mut number = 0u32;
        while let Some(Target { point, ink }) = path.next_target() {
            self.check_travel(number, point)?;
            let point = kinematics.motors(point);
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
                let steps = self.settings.millimetres_as_steps(travel, steps_per_mm);
                (0, steps.min(PAGE_LIMIT))
            } else {
                (-PAGE_LIMIT, PAGE_LIMIT)
            };
            at.saturating_sub(at.clamp(least, most))
        };
        let x = beyond(point.x, Setting::TravelX, Setting::StepsPerMmX);
        let y = beyond(point.y, Setting::TravelY, self.settings.steps_per_mm_y());
        if (x, y) == (0, 0) { Ok(()) } else { Err(MachineError::BeyondTravel { target, x, y }) }
    }

    fn configure_pulser(&self) {
        self.pins.configure(
            self.settings.microseconds_as_ticks(Setting::StepPulse),
            self.settings.get(Setting::InvertDirections).saturating_to_num(),
        );
    }
}
