//! A board in memory that carries out step events as they are planned, without pins.
//!
//! The [`HostBoard`] of the library runs the interrupt code for each step and records each change
//! of a pin; that is for tests. A preview only asks where the pen goes and when, which the planned
//! events say as well, many times faster. All but the steps is the work of a [`HostBoard`].

use penup::boards::host::{CutFlash, HostBoard};
use penup::machine::{Contacts, EventRing, PulserState, Settings};
use penup::motion::{EventKind, EventQueue, StepEvent, StepTrain, TICKS_PER_SECOND};
use penup::plotter::{Board, NotStored, Record, Replies, Stored};
use penup::protocol::RealTime;
use penup::storage::LogProgress;
use penup_job::path::Run;
use penup_job::pins::PenHeights;
use penup_job::watch::PenPath;

/// A board in memory without pins.
pub struct PlannedBoard {
    board: HostBoard<'static>,
    /// The effects of carrying out the planned events.
    pub steps: Steps,
    /// The state that the machine shares with the pins.
    pub pins: &'static PulserState,
}

impl PlannedBoard {
    /// Makes a board at rest. `slice` is the time, in ticks, that passes in one turn of the main
    /// loop.
    pub fn new(slice: u64, queue_steps: u32) -> Self {
        // The memory is leaked because the plotter and the board borrow from it as long as the
        // process lives; there is only one per run.
        let ring = Box::leak(Box::new(EventRing::new()));
        let pins: &PulserState = Box::leak(Box::new(PulserState::new()));
        let board = HostBoard::new(ring, pins);
        pins.set_queue(queue_steps);
        Self { board, steps: Steps::new(pins, slice), pins }
    }

    /// Gives the board flash, which it does not have otherwise.
    pub fn set_flash(&mut self, flash: CutFlash) {
        self.board.set_flash(flash);
    }

    /// Takes the flash out of the board, as it is.
    pub fn take_flash(&mut self) -> Option<CutFlash> {
        self.board.take_flash()
    }

    /// Receives bytes by the serial line.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.board.receive(bytes);
    }

    /// Whether all received bytes have been read, and all real-time requests have been taken.
    pub fn has_read_all(&self) -> bool {
        self.board.has_read_all()
    }

    /// Returns the bytes that were sent and removes them.
    pub fn take_sent(&mut self) -> Vec<u8> {
        self.board.take_sent()
    }

    /// The time that has passed, in ticks.
    pub fn now(&self) -> u64 {
        self.steps.now
    }
}

impl Board for PlannedBoard {
    const NAME: &'static str = HostBoard::NAME;

    fn read_byte(&mut self) -> Option<(usize, u8)> {
        self.board.read_byte()
    }

    fn take_real_time(&mut self) -> RealTime {
        self.board.take_real_time()
    }

    fn write(&mut self, bytes: &[u8]) {
        self.board.write(bytes);
    }

    fn reply_to(&mut self, replies: Replies) {
        self.board.reply_to(replies);
    }

    fn queue(&mut self) -> &mut dyn EventQueue {
        self.steps.report();
        &mut self.steps
    }

    fn contacts(&mut self) -> Contacts {
        self.board.contacts()
    }

    fn step_now(&mut self) {
        self.board.step_now();
    }

    fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        self.board.save(record, parts)
    }

    fn save_with_room(
        &mut self,
        record: Record,
        parts: &[&[u8]],
        room: u32,
    ) -> Result<(), NotStored> {
        self.board.save_with_room(record, parts, room)
    }

    fn add(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        self.board.add(record, parts)
    }

    fn load_added(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        self.board.load_added(record, take);
    }

    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        self.board.load(record, take);
    }

    fn keeps_progress(&self) -> bool {
        self.board.keeps_progress()
    }

    fn begin_progress(&mut self, notes: &[u8], strokes: u32) -> Result<(), NotStored> {
        self.board.begin_progress(notes, strokes)
    }

    fn note_progress(&mut self, strokes: u32) -> Result<(), NotStored> {
        self.board.note_progress(strokes)
    }

    fn note_point(&mut self, points: u32) -> Result<(), NotStored> {
        self.board.note_point(points)
    }

    fn progress(&mut self, notes: &mut [u8]) -> Option<(usize, LogProgress)> {
        self.board.progress(notes)
    }

    fn invert_driver_pins(&mut self, steps: u8, enable: bool) {
        self.board.invert_driver_pins(steps, enable);
    }

    fn microseconds(&mut self) -> u32 {
        self.board.microseconds()
    }

    fn wait(&mut self) {
        self.steps.wait();
        self.steps.report();
        if self.pins.halt_is_due() {
            self.steps.halt();
        }
        // No events wait at the board in memory, but its clock must advance, and it must obey an
        // order to halt.
        self.board.pass(self.steps.now.saturating_sub(self.board.trace().now()));
    }
}

/// The path of the pen over time, and the other results that a preview reports of the steps.
pub struct Steps {
    pins: &'static PulserState,
    /// The time, in ticks, and how much of it passes in one turn of the main loop.
    now: u64,
    slice: u64,
    /// The time at which the next event begins.
    at: u64,
    /// The ticks of all events, which wrap.
    ticks: u32,
    /// The sums of all steps of x and y, and of those that took up backlash.
    sums: [i32; 2],
    backlash: [i32; 2],
    /// The levels of the pins apart from the pulses, once they are known, and the pen's height.
    levels: Option<u8>,
    height: Option<u8>,
    heights: PenHeights,
    /// How often the pen was lowered.
    pub falls: usize,
    job: Option<JobSteps>,
}

/// The results that are reported of the steps of a job.
struct JobSteps {
    path: PenPath,
    /// The number of motor steps. A simultaneous step of both axes counts once.
    steps: u64,
    /// The times, in ticks, of the first and the last change of a pin.
    span: Option<[u64; 2]>,
    /// Whether the pen was changed since the last change of a pin.
    waited: bool,
    /// The ticks for which the machine waited for pens.
    waits: u64,
}

impl Steps {
    fn new(pins: &'static PulserState, slice: u64) -> Self {
        Self {
            pins,
            now: 0,
            slice,
            at: 0,
            ticks: 0,
            sums: [0; 2],
            backlash: [0; 2],
            levels: None,
            height: None,
            heights: PenHeights::default(),
            falls: 0,
            job: None,
        }
    }

    /// A job begins, with these settings.
    pub fn begin(&mut self, settings: &Settings) {
        let step = 1.0 / settings.page_steps()[0].to_num::<f64>();
        let mut path = match self.job.take() {
            Some(job) => job.path,
            None => PenPath::new(step),
        };
        path.begin_again();
        self.job = Some(JobSteps { path, steps: 0, span: None, waited: false, waits: 0 });
        self.heights = PenHeights::of(settings);
    }

    /// The pen with this number, counted from 1, was put in.
    pub fn change_pen(&mut self, pen: u8) {
        if let Some(job) = &mut self.job {
            job.path.change_pen(pen);
            job.waited = true;
        }
    }

    /// The path of the pen in the present job.
    pub fn runs(&self) -> Vec<Run> {
        self.job.as_ref().map(|job| job.path.runs()).unwrap_or_default()
    }

    /// The number of motor steps in the present job, and the seconds from the first to the last
    /// change of a pin, without changes of pens by hand.
    pub fn totals(&self) -> (u64, f64) {
        let Some(job) = &self.job else { return (0, 0.0) };
        let ticks = job.span.map_or(0, |[begin, end]| end - begin - job.waits);
        (job.steps, ticks as f64 / f64::from(TICKS_PER_SECOND))
    }

    /// Tells the machine what was carried out.
    fn report(&mut self) {
        self.pins.report_backlash((self.backlash[0], self.backlash[1]));
        let drained = !self.pins.halt_is_due();
        self.pins.report((self.sums[0], self.sums[1]), self.ticks, drained);
    }

    /// Lets time pass: as long as the steps took, or a slice if there were none.
    fn wait(&mut self) {
        if self.at > self.now {
            self.now = self.at;
        } else {
            self.now += self.slice;
            self.at = self.now;
        }
    }

    /// The pins stop, and the pen goes up.
    fn halt(&mut self) {
        self.set_pen(self.heights.up);
    }

    fn set_pen(&mut self, height: u8) {
        if self.height.replace(height) == Some(height) {
            return;
        }
        let down = self.heights.is_down(height);
        self.falls += usize::from(down);
        let at = self.at;
        if let Some(job) = &mut self.job {
            job.path.set_pen(down);
            job.note_change([at; 2]);
        }
    }

    /// Carries out any event but a step.
    #[inline(never)]
    fn carry_out(&mut self, event: StepEvent) {
        match event.kind() {
            EventKind::Pen { height } => self.set_pen(height),
            EventKind::Lift { step, .. } => {
                let end = self.at + if step { u64::from(self.pins.pulse_ticks()) } else { 0 };
                if let Some(job) = &mut self.job {
                    job.note_change([self.at, end]);
                }
            }
            EventKind::Levels(levels) => {
                let (x, y) = event.pulses();
                self.backlash =
                    [self.backlash[0].wrapping_add(x), self.backlash[1].wrapping_add(y)];
                let pulses = (x, y) != (0, 0);
                let others = levels & LEVELS;
                let changes = self.levels.replace(others) != Some(others);
                let end = self.at + if pulses { u64::from(self.pins.pulse_ticks()) } else { 0 };
                if let Some(job) = &mut self.job {
                    job.steps += u64::from(pulses);
                    if changes || pulses {
                        job.note_change([self.at, end]);
                    }
                }
            }
        }
    }

    #[inline]
    fn take(&mut self, event: StepEvent) {
        if event.is_step() {
            let (x, y) = event.step();
            self.sums = [self.sums[0].wrapping_add(x), self.sums[1].wrapping_add(y)];
            self.levels = Some(event.to_bits() as u8 & LEVELS);
            if let Some(job) = &mut self.job {
                job.path.step(x, y);
                job.steps += 1;
                job.note_change([self.at, self.at + u64::from(self.pins.pulse_ticks())]);
            }
        } else {
            self.carry_out(event);
        }
        self.at += u64::from(event.ticks());
        self.ticks = self.ticks.wrapping_add(event.ticks());
    }
}

/// The bits of an event that are levels of pins and no pulses.
const LEVELS: u8 = StepEvent::DOWN_X | StepEvent::DOWN_Y | StepEvent::DRIVERS_ON;

impl JobSteps {
    /// A pin has changed, from the first of these times to the second.
    #[inline]
    fn note_change(&mut self, [at, end]: [u64; 2]) {
        let [begin, last] = self.span.unwrap_or([at; 2]);
        if self.waited {
            self.waited = false;
            self.waits += at - last;
        }
        self.span = Some([begin, end]);
    }
}

impl EventQueue for Steps {
    fn room(&self) -> usize {
        if self.at >= self.now + self.slice { 0 } else { usize::MAX }
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.take(event);
        Ok(())
    }

    fn push_train(&mut self, train: &mut StepTrain, count: u32) -> Result<(), StepEvent> {
        train.push_each(count, |event| {
            self.take(event);
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup::machine::{Setting, Value};

    /// A servo may be mounted such that a lower height lifts the pen.
    #[test]
    fn a_halt_lifts_a_pen_of_any_heights() {
        for [up, down] in [[0_u8, 127], [100, 20]] {
            let mut settings = Settings::default();
            for (setting, height) in [(Setting::PenUpHeight, up), (Setting::PenDownHeight, down)] {
                settings.set(setting, Value::from_num(height)).expect("a height");
            }
            let mut board = PlannedBoard::new(1, 100);
            board.steps.begin(&settings);
            board.steps.set_pen(down);
            board.steps.halt();
            let height = board.steps.height.expect("a height");
            assert!(!PenHeights::of(&settings).is_down(height), "{up} {down}: {height}");
        }
    }
}
