//! Moves that come one by one: G-code, moves by hand, parking, and waits between them.

use super::{JobSize, Machine, MachineError, Setting, State, Switches, Target, Value};
use crate::drawing::PagePoint;
use crate::motion::{EventQueue, PathLength, PushError};

impl Machine<'_> {
    /// Appends a move, at most `feed` mm/min fast. The first of them begins a job that lasts until
    /// no more come. In [`State::Check`] it is only checked.
    ///
    /// # Errors
    /// See [`MachineError`], and [`MachineError::State`] without [`Machine::has_room`]; nothing is
    /// appended then.
    pub fn draw_to(&mut self, target: Target, feed: Option<Value>) -> Result<(), MachineError> {
        self.check_travel(0, target.point)?;
        self.begin_stream()?;
        if self.state == State::Check {
            return Ok(());
        }
        let length = self.append(target, feed)?;
        if self.state == State::Idle {
            self.state = State::Run;
        }
        if target.ink.is_some() {
            self.job.drawn += length;
        } else {
            self.job.travelled += length;
        }
        self.count_stroke(target.ink.is_some());
        Ok(())
    }

    /// Lowers the pen where it is, until the next move with the pen up.
    ///
    /// # Errors
    /// See [`Machine::draw_to`].
    pub fn lower_pen(&mut self) -> Result<(), MachineError> {
        self.begin_stream()?;
        if self.state == State::Check {
            return Ok(());
        }
        self.runner.push_dot().map_err(|_| MachineError::State(self.state))?;
        if self.state == State::Idle {
            self.state = State::Run;
        }
        self.count_stroke(true);
        Ok(())
    }

    /// Moves to `point` with the pen raised, at most `feed` mm/min fast.
    ///
    /// # Errors
    /// See [`MachineError`], and [`MachineError::State`] without [`Machine::has_room`]; nothing is
    /// appended then.
    pub fn jog(&mut self, point: PagePoint, feed: Option<Value>) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Jog) {
            return Err(MachineError::State(self.state));
        }
        self.check_travel(0, point)?;
        self.append(Target { point, ink: None }, feed)?;
        self.state = State::Jog;
        Ok(())
    }

    /// Gives the moves by hand up.
    pub fn cancel_jog(&mut self) {
        if self.state == State::Jog {
            self.abort();
        }
    }

    /// How many moves are planned ahead, at most.
    pub fn moves_ahead(&self) -> usize {
        self.runner.capacity()
    }

    /// Whether another move can be appended now.
    pub fn has_room(&self) -> bool {
        self.split.is_none() && !self.runner.is_full()
    }

    /// Whether a move that comes now has to wait for [`Machine::has_room`].
    pub fn is_streaming(&self) -> bool {
        match self.state {
            State::Run | State::Hold { .. } => self.streaming,
            state => state == State::Jog,
        }
    }

    /// Where all moves known lead, in steps of the page.
    pub fn end(&self) -> PagePoint {
        self.split.map_or(self.runner.page_end(), |split| split.end())
    }

    /// Where the pen is parked, in steps of the page.
    pub fn park(&self) -> PagePoint {
        let y = self.settings.steps_per_mm_y();
        PagePoint {
            x: self.settings.millimetres_as_steps(Setting::ParkX, Setting::StepsPerMmX),
            y: self.settings.millimetres_as_steps(Setting::ParkY, y),
        }
    }

    /// Waits for [`Machine::resume`].
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle.
    pub fn pause(&mut self) -> Result<(), MachineError> {
        if self.state != State::Idle {
            return Err(MachineError::State(self.state));
        }
        self.streaming = true;
        self.state = State::Hold { standing: true };
        Ok(())
    }

    /// Lets `ticks` pass at rest, at most [`StepEvent::MAX_TICKS`](crate::motion::StepEvent::MAX_TICKS).
    /// Nothing happens unless the machine is idle and the queue has room.
    pub fn dwell(&mut self, ticks: u32, queue: &mut dyn EventQueue) {
        let refused = self.state == State::Idle && self.runner.dwell(ticks, queue).is_err();
        if refused {
            self.alarm(super::Alarm::Queue);
        }
    }

    /// Speeds in percent of the settings.
    pub fn percent(&self) -> u8 {
        self.percent
    }

    /// The limit switches when last observed.
    pub fn switches(&self) -> Switches {
        self.switches
    }

    /// Whether the emergency stop was pressed when last observed.
    pub fn stop_is_pressed(&self) -> bool {
        self.stop_is_pressed
    }

    fn count_stroke(&mut self, inked: bool) {
        self.job.strokes += u32::from(inked && !self.stream_is_inked);
        self.stream_is_inked = inked;
    }

    /// Whether moves may come now; the first of them begins the job.
    fn begin_stream(&mut self) -> Result<(), MachineError> {
        match self.state {
            State::Check => {}
            State::Idle => {
                self.job = JobSize::default();
                self.before = self.runner.run();
                self.reset_ink_budget();
                self.streaming = true;
                self.stream_is_inked = false;
            }
            State::Run | State::Hold { .. } if self.streaming => {}
            state => return Err(MachineError::State(state)),
        }
        Ok(())
    }

    /// Its length, 2^-18 mm.
    fn append(&mut self, target: Target, feed: Option<Value>) -> Result<u64, MachineError> {
        let limit = feed.map_or(PathLength::MAX, |feed| self.runner.limits().feed(feed));
        match self.push(target, limit) {
            Ok(length) => Ok(length.to_bits().into()),
            Err(PushError::Full) => Err(MachineError::State(self.state)),
            Err(PushError::TooLong) => Err(MachineError::MoveTooLong { target: 0 }),
        }
    }
}
