//! Commands that are sent one by one: moves of G-code, jogging, parking, dwells and pauses.

use super::{JobSize, Machine, MachineError, Setting, State, Switches, Target, Value};
use crate::drawing::PagePoint;
use crate::motion::{EventQueue, PathLength, PushError};

impl Machine<'_> {
    /// Appends a move at a speed of at most `feed` mm/min. The first such move begins a job, which
    /// lasts until no more moves come. In [`State::Check`] the move is only checked.
    ///
    /// # Errors
    /// See [`MachineError`]. If [`Machine::has_room`] is false, the error is
    /// [`MachineError::State`]. On an error nothing is appended.
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

    /// Lowers the pen where it is. It stays down until the next move with the pen up.
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

    /// Jogs: moves to `point` with the pen raised, at a speed of at most `feed` mm/min.
    ///
    /// # Errors
    /// See [`MachineError`]. If [`Machine::has_room`] is false, the error is
    /// [`MachineError::State`]. On an error nothing is appended.
    pub fn jog(&mut self, point: PagePoint, feed: Option<Value>) -> Result<(), MachineError> {
        if !matches!(self.state, State::Idle | State::Jog) {
            return Err(MachineError::State(self.state));
        }
        self.check_travel(0, point)?;
        self.append(Target { point, ink: None }, feed)?;
        self.state = State::Jog;
        Ok(())
    }

    /// Cancels the jog, if there is one.
    pub fn cancel_jog(&mut self) {
        if self.state == State::Jog {
            self.abort();
        }
    }

    /// The greatest number of moves that are planned ahead.
    pub fn moves_ahead(&self) -> usize {
        self.runner.capacity()
    }

    /// Whether another move can be appended now.
    pub fn has_room(&self) -> bool {
        self.split.is_none() && !self.runner.is_full()
    }

    /// Whether a move that is sent now has to wait until [`Machine::has_room`] is true.
    pub fn is_streaming(&self) -> bool {
        match self.state {
            State::Run | State::Hold { .. } => self.streaming,
            state => state == State::Jog,
        }
    }

    /// The position where all moves known so far end, in steps of the page.
    pub fn end(&self) -> PagePoint {
        self.split.map_or(self.runner.page_end(), |split| split.end())
    }

    /// The position where the pen is parked, in steps of the page.
    pub fn park(&self) -> PagePoint {
        let y = self.settings.steps_per_mm_y();
        PagePoint {
            x: self.settings.millimetres_as_steps(Setting::ParkX, Setting::StepsPerMmX),
            y: self.settings.millimetres_as_steps(Setting::ParkY, y),
        }
    }

    /// Pauses until [`Machine::resume`] is called.
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

    /// Dwells: lets `ticks` pass at rest, at most
    /// [`StepEvent::MAX_TICKS`](crate::motion::StepEvent::MAX_TICKS). Nothing happens unless the
    /// machine is idle. A dwell that the queue refuses raises
    /// [`Alarm::Queue`](super::Alarm::Queue).
    pub fn dwell(&mut self, ticks: u32, queue: &mut dyn EventQueue) {
        let refused = self.state == State::Idle && self.runner.dwell(ticks, queue).is_err();
        if refused {
            self.alarm(super::Alarm::Queue);
        }
    }

    /// The speed override, in percent of the speeds in the settings.
    pub fn percent(&self) -> u8 {
        self.percent
    }

    /// The state of the limit switches when they were last observed.
    pub fn switches(&self) -> Switches {
        self.switches
    }

    /// Whether the emergency stop was pressed when last observed.
    pub fn stop_is_pressed(&self) -> bool {
        self.stop_is_pressed
    }

    /// Counts a new stroke of the job where the pen goes down.
    fn count_stroke(&mut self, inked: bool) {
        self.job.strokes += u32::from(inked && !self.stream_is_inked);
        self.stream_is_inked = inked;
    }

    /// Checks whether moves are accepted in this state. The first of them begins the job.
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

    /// Appends a move and returns its length in units of 2^-18 mm.
    fn append(&mut self, target: Target, feed: Option<Value>) -> Result<u64, MachineError> {
        let limit = feed.map_or(PathLength::MAX, |feed| self.runner.limits().feed(feed));
        match self.push(target, limit) {
            Ok(length) => Ok(length.to_bits().into()),
            Err(PushError::Full) => Err(MachineError::State(self.state)),
            Err(PushError::TooLong) => Err(MachineError::MoveTooLong { target: 0 }),
        }
    }
}
