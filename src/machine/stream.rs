//! Commands that are sent one by one: moves of G-code, jogging, parking, dwells and pauses.

#[cfg(feature = "hpgl")]
use super::State;
use super::state::{Activity, Source};
use super::{JobSize, Machine, MachineError, Setting, Switches, Target, Value};
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::motion::{EventQueue, PushError, SpeedLimit};

impl Machine<'_> {
    /// Appends a move at a speed of at most `feed` mm/min. The first such move begins a job, which
    /// lasts until no more moves come. In check mode the move is only checked.
    ///
    /// # Errors
    /// See [`MachineError`]. If [`Machine::has_room`] is false, the error is
    /// [`MachineError::State`]. On an error nothing is appended.
    pub fn draw_to(&mut self, target: Target, feed: Option<Value>) -> Result<(), MachineError> {
        self.check_travel(0, target.point)?;
        self.check_feed(feed)?;
        if self.is_checking_stream()? {
            return Ok(());
        }
        let length = self.append(target, feed)?;
        self.begin_stream();
        self.progress.add_move(target, length);
        Ok(())
    }

    /// Lowers the pen where it is. It stays down until the next move with the pen up.
    ///
    /// # Errors
    /// See [`Machine::draw_to`].
    pub fn lower_pen(&mut self) -> Result<(), MachineError> {
        if self.is_checking_stream()? {
            return Ok(());
        }
        self.runner.push_dot().map_err(|_| self.refusal())?;
        self.begin_stream();
        self.progress.add_stroke(true);
        Ok(())
    }

    /// Jogs: moves to `point` with the pen raised, at a speed of at most `feed` mm/min, which no
    /// override scales.
    ///
    /// # Errors
    /// See [`MachineError`]. If [`Machine::has_room`] is false, the error is
    /// [`MachineError::State`]. On an error nothing is appended.
    pub fn jog(&mut self, point: PagePoint, feed: Option<Value>) -> Result<(), MachineError> {
        let (Activity::Idle | Activity::Jog) = self.activity else { return Err(self.refusal()) };
        self.check_travel(0, point)?;
        self.check_feed(feed)?;
        self.append(Target { point, ink: None }, feed)?;
        if let Activity::Idle = self.activity {
            self.activity = Activity::Jog;
            self.apply_override();
        }
        Ok(())
    }

    /// Checks that a `feed` in mm/min is one that can be held.
    ///
    /// # Errors
    /// [`MachineError::TooSlow`].
    pub fn check_feed(&self, feed: Option<Value>) -> Result<(), MachineError> {
        let is_too_slow = feed.is_some_and(|feed| feed < SpeedLimit::LEAST_FEED);
        if is_too_slow { Err(MachineError::TooSlow) } else { Ok(()) }
    }

    /// Cancels the jog, if there is one.
    pub fn cancel_jog(&mut self) {
        if let Activity::Jog = self.activity {
            self.abort();
        }
    }

    /// Returns the greatest number of moves that are planned ahead.
    pub fn moves_ahead(&self) -> usize {
        self.runner.capacity()
    }

    /// How many more moves can be planned ahead now.
    pub fn free_moves(&self) -> usize {
        self.runner.room()
    }

    /// Whether another move can be appended to the plan now.
    pub fn has_room(&self) -> bool {
        self.segmenter.is_none() && !self.runner.is_full()
    }

    /// Whether moves are carried out as they come, one line at a time. The next one has to wait
    /// until [`Machine::has_room`] is true.
    pub fn is_streaming(&self) -> bool {
        matches!(self.activity, Activity::Jog) || self.activity.is_stream()
    }

    /// Whether the last move known so far is drawn and ends at this position of the page.
    #[cfg(feature = "hpgl")]
    pub fn draws_to(&self, point: PagePoint) -> bool {
        self.segmenter.is_none() && self.runner.inks_to(point)
    }

    /// Whether it is known where the pen will be: neither does a jog run, nor a job that is not
    /// sent move by move.
    #[cfg(feature = "hpgl")]
    pub fn knows_end(&self) -> bool {
        match self.state() {
            State::Jog | State::Abort | State::Home => false,
            State::Run | State::Hold { .. } => self.activity.is_stream(),
            _ => true,
        }
    }

    /// The position where all moves known so far end, in steps of the page.
    pub fn end(&self) -> PagePoint {
        self.segmenter.map_or(self.runner.page_end(), |segmenter| segmenter.end())
    }

    /// The greatest coordinates to which the pen may go, in steps of the page. The least are 0.
    pub fn travel(&self) -> PagePoint {
        let PagePoint { x, y } = self.settings.page_point([Setting::TravelX, Setting::TravelY]);
        PagePoint { x: x.min(PAGE_LIMIT), y: y.min(PAGE_LIMIT) }
    }

    /// The number of the pen in the holder, counted from 0.
    pub fn pen(&self) -> u8 {
        self.pen
    }

    /// Declares that the pen with this number, counted from 0, is in the holder.
    pub fn set_pen(&mut self, pen: u8) {
        self.pen = pen;
        self.is_pen_assumed = false;
    }

    /// Lets the next stroke ask for its pen if nobody has said since the start which one is in the
    /// holder: the first one is assumed to be then, but a job that has stopped may have left
    /// another one. With `always` it asks even if somebody has.
    #[cfg(feature = "resume")]
    pub fn forget_pen(&mut self, always: bool) {
        if always || self.is_pen_assumed {
            self.pen = u8::MAX;
        }
    }

    /// The position where the pen is parked, in steps of the page.
    pub fn park(&self) -> PagePoint {
        self.settings.page_point([Setting::ParkX, Setting::ParkY])
    }

    /// Pauses until [`Machine::resume`] is called.
    ///
    /// # Errors
    /// [`MachineError::State`] unless the machine is idle.
    pub fn pause(&mut self) -> Result<(), MachineError> {
        let Activity::Idle = self.activity else { return Err(self.refusal()) };
        self.activity = Activity::Hold { stopped: true, source: Source::Stream };
        Ok(())
    }

    /// Dwells: lets `ticks` pass at rest, at most
    /// [`StepEvent::MAX_TICKS`](crate::motion::StepEvent::MAX_TICKS). Nothing happens unless the
    /// machine is idle. A dwell that the queue refuses raises
    /// [`Alarm::Queue`](super::Alarm::Queue).
    pub fn dwell(&mut self, ticks: u32, queue: &mut dyn EventQueue) {
        let is_idle = matches!(self.activity, Activity::Idle);
        if is_idle && self.runner.dwell(ticks, queue).is_err() {
            self.alarm(super::Alarm::Queue);
        }
    }

    /// The speed override, in percent of the speeds in the settings.
    pub fn percent(&self) -> u8 {
        self.percent
    }

    /// The override of moves with the pen up, in percent, besides the speed override.
    pub fn rapid_percent(&self) -> u8 {
        self.rapid_percent
    }

    /// The state of the limit switches when they were last observed.
    pub fn switches(&self) -> Switches {
        self.contacts.switches()
    }

    /// Whether the emergency stop was pressed when last observed.
    pub fn stop_is_pressed(&self) -> bool {
        self.contacts.stop
    }

    /// Whether moves are only checked.
    ///
    /// # Errors
    /// [`MachineError::State`] if this state does not accept moves that are sent one by one.
    fn is_checking_stream(&self) -> Result<bool, MachineError> {
        match self.activity {
            Activity::Check => Ok(true),
            Activity::Idle => Ok(false),
            _ if self.activity.is_stream() => Ok(false),
            _ => Err(self.refusal()),
        }
    }

    /// Begins the job after its first move was appended.
    fn begin_stream(&mut self) {
        if let Activity::Idle = self.activity {
            self.begin_job(JobSize::default(), Source::Stream);
        }
    }

    /// Adds a straight move to the end of the path that is being drawn, at a speed of at most
    /// `feed` mm/min (`None` for no such limit). Returns its length in units of 2^-18 mm.
    fn append(&mut self, target: Target, feed: Option<Value>) -> Result<u64, MachineError> {
        let limit = feed.map_or(SpeedLimit::NONE, SpeedLimit::of_feed);
        match self.push(target, limit) {
            Ok(length) => Ok(length.to_bits().into()),
            Err(PushError::Full) => Err(self.refusal()),
            Err(PushError::TooLong) => Err(MachineError::MoveTooLong { target: 0 }),
        }
    }
}
