//! The session with a plotter: finds it, sends a drawing, and follows it until it is drawn.
//!
//! A session has no line of its own. Whoever has one, an emulated board or a serial port, passes in
//! what it received and the time, by [`Session::receive`] and [`Session::tick`], and sends what
//! [`Session::take_out`] returns. What the user should see comes by [`Session::take_events`].

mod replies;

use crate::delivery::Delivery;
use crate::event::Event;
use crate::number::Number;
use crate::options::{NamedValues, text_of};
use crate::phase::Phase;
use crate::sheet::Shared;
use crate::source::Source;
use crate::words::sentence;
use penup_job::Job;
use penup_job::machine_settings::AssignedSetting;
use penup_job::pen_lines::PenLines;
use penup_job::protocol::{
    ABORT, AS_SET, FASTER, GO_ON, GO_ON_AT_ORIGIN, HOLD, HOME, LAST_NUMBER, RESUME, ReplyReader,
    SETTINGS, SLOWER, STATUS_QUERY, STREAM, UNLOCK, numbered,
};
use penup_job::results::JobReport;
use penup_job::twin;
use penup_readers::lines::{JobLine, Lines};
use std::rc::Rc;
use wasm_bindgen::prelude::wasm_bindgen;

/// The time in ms between two questions for the status.
const QUERY_EVERY: f64 = 100.0;
/// The time in ms after which ctrl-X, or the first line number, is sent again.
const AGAIN_AFTER: f64 = 1000.0;
/// The longest time in ms until the plotter counts lines.
const OPEN_TIMEOUT: f64 = 15_000.0;
/// Makes coordinates absolute, which they are at first.
const ABSOLUTE: &str = "G90";
/// The longest time in ms between two ticks that counts. A computer that sleeps, or a browser that
/// lets a page wait, hears nothing meanwhile.
const LONGEST_TICK: f64 = 1000.0;

/// What is done by hand with a pen whose machine has told its settings.
#[derive(Debug, Clone, Copy)]
enum ByHand {
    PenDown,
    PenUp,
    /// A square with sides of so many mm.
    Square(f64),
}

/// The session.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Session {
    phase: Phase,
    /// The name of the phase that the user was told last.
    name: &'static str,
    /// When the phase began, and when something was last sent again in it, in ms.
    since: f64,
    repeated: f64,
    now: f64,
    last_tick: f64,
    /// The longest time in ms without a byte.
    silence: f64,
    reader: ReplyReader,
    /// The line being received, for what [`Reply`](penup_job::protocol::Reply) leaves out.
    raw: Vec<u8>,
    out: Vec<u8>,
    events: Vec<Event>,
    last_heard: f64,
    last_query: f64,
    messages: Vec<String>,
    delivery: Option<Delivery>,
    /// What is delivered next: what goes on with a job, once it is known that no computer has sent
    /// it, or the command that ends an alarm, once the plotter counts lines anew.
    next: Option<&'static str>,
    /// The number of the last accepted line.
    number: i32,
    /// The drawing that waits until the plotter is ready, and the checksums it must have.
    job: Option<Rc<dyn Lines>>,
    expected: Option<[u32; 2]>,
    contents: Option<[u32; 2]>,
    report: Option<JobReport>,
    strokes: u64,
    /// What is moved by hand once the plotter has told its settings, in the same lines twice.
    by_hand: ByHand,
    settings: Vec<String>,
    settings_before: Vec<String>,
    /// How often the plotter was asked again for what did not arrive whole.
    questions: u32,
    /// How many reports in succession say that the machine rests and that a job has stopped.
    stops: u32,
    /// Whether the plotter computes or finds its switches, as its last status says.
    reads_no_lines: bool,
    /// Equal reports of a machine that waits, one after the other.
    holds: (Option<u8>, String, u32),
    is_given_up: bool,
    /// Whether coordinates may be relative, because a test square was begun and has not ended.
    is_relative: bool,
    /// The speeds in percent of those in the settings, which not every status tells.
    percent: u16,
}

#[wasm_bindgen]
impl Session {
    /// A session that gives the plotter up after `silence` ms without a byte.
    #[wasm_bindgen(constructor)]
    pub fn new(silence: f64) -> Self {
        crate::note_faults();
        Self {
            phase: Phase::Closed,
            name: "closed",
            since: 0.0,
            repeated: 0.0,
            now: 0.0,
            last_tick: 0.0,
            silence,
            reader: ReplyReader::default(),
            raw: Vec::new(),
            out: Vec::new(),
            events: Vec::new(),
            last_heard: 0.0,
            last_query: 0.0,
            messages: Vec::new(),
            delivery: None,
            next: None,
            number: 0,
            job: None,
            expected: None,
            contents: None,
            report: None,
            strokes: 0,
            by_hand: ByHand::PenUp,
            settings: Vec::new(),
            settings_before: Vec::new(),
            questions: 0,
            stops: 0,
            reads_no_lines: false,
            holds: (None, String::new(), 0),
            is_given_up: false,
            is_relative: false,
            percent: 100,
        }
    }

    /// Begins to look for the plotter, over a line that was just opened, at the time `now` in ms.
    pub fn connect(&mut self, now: f64) {
        (self.now, self.last_tick, self.last_heard) = (now, now, now);
        self.reader = ReplyReader::default();
        self.raw.clear();
        self.enter(Phase::Finding);
        self.query();
    }

    /// The line is closed: what was begun is lost to this session.
    pub fn close(&mut self) {
        (self.delivery, self.job, self.next) = (None, None, None);
        self.out.clear();
        self.enter(Phase::Closed);
    }

    /// Draws the file `name` with `options`, a JSON array of pairs of name and value, as soon as
    /// the plotter is ready. If the file `is_read`, the `bytes` are what `penup-page-files` made of
    /// it.
    ///
    /// # Errors
    /// A sentence for the user that says why nothing is sent.
    pub fn plot(
        &mut self,
        name: &str,
        bytes: Vec<u8>,
        is_read: bool,
        options: &str,
    ) -> Result<(), String> {
        if !matches!(self.phase, Phase::Finding | Phase::Greeting | Phase::Numbering | Phase::Ready)
        {
            return Err("The plotter is busy: wait until it is done, or give it up.".to_owned());
        }
        let source = Source::read(name, bytes, is_read)?;
        let settings = NamedValues::parse(options)?.settings_for(&source)?;
        let job: Rc<dyn Lines> = Rc::new(Job::new(Shared(source.lines), &settings));
        self.expected = twin::contents_of::<Number>(&*job, job.count());
        self.job = Some(job);
        self.begin_job();
        Ok(())
    }

    /// Slows the machine down on its path and raises the pen.
    pub fn hold(&mut self) {
        self.out.push(HOLD);
    }

    /// Goes on after a hold, or with the pen that the plotter asked for.
    pub fn resume(&mut self) {
        self.holds = (None, String::new(), 0);
        self.out.push(RESUME);
    }

    /// Changes all speeds by a tenth of those in the settings: `faster` if `by` is positive,
    /// slower if it is negative. 0 is as set.
    pub fn override_speed(&mut self, by: i32) {
        self.out.push(match by {
            0 => AS_SET,
            by if by > 0 => FASTER,
            _ => SLOWER,
        });
    }

    /// Goes on with the job that a loss of power or a reset has stopped. The machine is homed
    /// first, unless the user has put the pen at the origin. Of a job that a computer sent while it
    /// was drawn the plotter keeps no strokes, so it is asked first whether it is one.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    pub fn go_on(&mut self, is_at_origin: bool) -> Result<(), String> {
        self.begin_lines(vec![STREAM.to_owned()])?;
        self.next = Some(if is_at_origin { GO_ON_AT_ORIGIN } else { GO_ON });
        self.is_given_up = false;
        self.enter(Phase::Starting);
        Ok(())
    }

    /// Draws a square with sides of this many `mm` to the right of the pen and above it.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    pub fn test_square(&mut self, mm: f64) -> Result<(), String> {
        self.begin_by_hand(ByHand::Square(mm))
    }

    /// Lowers the pen where it stands, or raises it.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    pub fn move_pen_by_hand(&mut self, is_down: bool) -> Result<(), String> {
        self.begin_by_hand(if is_down { ByHand::PenDown } else { ByHand::PenUp })
    }

    /// Gives the drawing up: the machine stops with the pen up.
    pub fn give_up(&mut self) {
        self.is_given_up = true;
        (self.delivery, self.job, self.next) = (None, None, None);
        self.out.push(ABORT);
        self.enter(Phase::Greeting);
    }

    /// Sends a line by hand, such as `$H`, `$X` or a jog.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    pub fn command(&mut self, text: &str) -> Result<(), String> {
        let cure = [UNLOCK, HOME].into_iter().find(|cure| *cure == text);
        if cure.is_some() && self.phase == Phase::Alarm {
            // Once lines have had numbers, the plotter refuses those that have none.
            (self.delivery, self.next) = (None, cure);
            self.begin_numbers();
            self.enter(Phase::Alarm);
            return Ok(());
        }
        self.begin_lines(vec![text.to_owned()])?;
        self.enter(Phase::Commanding);
        Ok(())
    }

    /// Takes `bytes` that the plotter sent, at the time `now` in ms.
    pub fn receive(&mut self, bytes: &[u8], now: f64) {
        self.now = now;
        if !bytes.is_empty() {
            self.last_heard = now;
        }
        for &byte in bytes {
            self.raw.push(byte);
            if let Some(reply) = self.reader.push(byte) {
                let raw = String::from_utf8_lossy(&std::mem::take(&mut self.raw)).into_owned();
                self.take(&reply, raw.trim());
            } else if matches!(byte, b'\n' | b'\r') || self.raw.len() > 512 {
                self.raw.clear();
            }
        }
    }

    /// Lets the time pass until `now`, in ms.
    pub fn tick(&mut self, now: f64) {
        self.now = now;
        self.leave_out(now - self.last_tick - LONGEST_TICK);
        self.last_tick = now;
        if self.phase == Phase::Closed {
            return;
        }
        if now - self.last_query >= QUERY_EVERY {
            self.query();
        }
        let waits = !matches!(self.phase, Phase::Ready | Phase::Alarm);
        if waits && now - self.last_heard > self.silence {
            let seconds = self.silence / 1000.0;
            self.fail(format!(
                "The plotter does not answer: {seconds} s without a byte. Is it powered, is it the \
                 right port, and does it run penup at 115200 baud?"
            ));
            self.close();
            return;
        }
        self.repeat();
        if let Some(mut delivery) = self.delivery.take() {
            let outcome = delivery.tick(now, self.reads_no_lines, &mut self.out);
            self.delivery = Some(delivery);
            self.settle(outcome);
        }
    }

    /// The bytes to send to the plotter since the last call.
    pub fn take_out(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    /// What has happened since the last call: a JSON array of objects, each with its `kind`.
    pub fn take_events(&mut self) -> String {
        text_of(&std::mem::take(&mut self.events))
    }
}

impl Session {
    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        (self.since, self.repeated) = (self.now, self.now);
        // What lasts a moment has no name.
        let Some(name) = phase.name() else { return };
        if self.name != name {
            self.name = name;
            self.events.push(Event::Phase { name });
        }
    }

    /// Leaves `slept` ms until now out of every time that is waited for, if there are any.
    fn leave_out(&mut self, slept: f64) {
        if slept <= 0.0 {
            return;
        }
        self.last_heard = (self.last_heard + slept).min(self.now);
        self.since = (self.since + slept).min(self.now);
        if let Some(delivery) = &mut self.delivery {
            delivery.leave_out(slept, self.now);
        }
    }

    /// Ends what was begun with a sentence for the user.
    fn fail(&mut self, text: String) {
        (self.delivery, self.job, self.next) = (None, None, None);
        self.messages.clear();
        self.events.push(Event::Failed { text });
    }

    /// Sends again what has had no effect for long.
    fn repeat(&mut self) {
        if self.now - self.repeated < AGAIN_AFTER {
            return;
        }
        match self.phase {
            Phase::Greeting => self.out.push(ABORT),
            Phase::Numbering => self.begin_numbers(),
            _ if self.next.is_some() && self.delivery.is_none() => self.begin_numbers(),
            _ => return,
        }
        self.repeated = self.now;
        if self.now - self.since > OPEN_TIMEOUT {
            self.fail(
                "What answers is not penup, or the line damages too many bytes. Is it the right \
                 port, and does the plotter run penup at 115200 baud?"
                    .to_owned(),
            );
            self.close();
        }
    }

    fn query(&mut self) {
        self.last_query = self.now;
        self.out.push(STATUS_QUERY);
    }

    fn begin_numbers(&mut self) {
        self.out.extend(format!("\n{}\n", numbered(Some(0), LAST_NUMBER)).bytes());
    }

    fn deliver(&mut self, lines: Rc<dyn Lines>) {
        self.messages.clear();
        self.delivery = Some(Delivery::new(lines, self.number, self.now));
    }

    /// Begins to send lines by hand.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    fn begin_lines(&mut self, lines: Vec<String>) -> Result<(), String> {
        if self.phase != Phase::Ready {
            return Err("The plotter is busy, or is not connected.".to_owned());
        }
        let lines: Vec<_> = lines.into_iter().map(JobLine::command).collect();
        self.deliver(Rc::new(lines));
        Ok(())
    }

    /// Delivers what comes next, if there is something, to a plotter that counts lines anew.
    fn begin_next(&mut self) {
        let Some(next) = self.next.take() else { return };
        self.number = 0;
        // An alarm may have left coordinates relative.
        let behind = [UNLOCK, HOME].contains(&next).then_some(ABSOLUTE);
        let mut lines = vec![JobLine::command(next)];
        lines.extend(behind.map(JobLine::command));
        self.deliver(Rc::new(lines));
    }

    /// Begins to ask for the settings that tell what lowers the pen, to move it by hand then.
    ///
    /// # Errors
    /// A sentence for the user: the session is doing something else.
    fn begin_by_hand(&mut self, what: ByHand) -> Result<(), String> {
        self.begin_lines(vec![SETTINGS.to_owned()])?;
        (self.by_hand, self.questions) = (what, 0);
        self.settings.clear();
        self.settings_before.clear();
        self.enter(Phase::Asking);
        Ok(())
    }

    /// Moves the pen by hand, once the settings are known.
    fn move_pen(&mut self) {
        let settings = self.settings.iter().filter_map(|line| AssignedSetting::told(line));
        let PenLines { down, up } = match PenLines::of(&settings.collect::<Vec<_>>()) {
            Ok(lines) => lines,
            Err(reason) => {
                self.fail(format!("{}.", sentence(reason)));
                return self.enter(Phase::Ready);
            }
        };
        let lines = match self.by_hand {
            ByHand::PenDown => vec![down],
            ByHand::PenUp => vec![up],
            ByHand::Square(mm) => {
                self.is_relative = true;
                // Where the pen is may be told in another unit, or not at all.
                let sides = [('X', mm), ('Y', mm), ('X', -mm), ('Y', -mm)];
                let sides = sides.map(|(axis, by)| format!("G21 G91 G1 {axis}{by:.3}"));
                let ends = [up, ABSOLUTE.to_owned()];
                [down].into_iter().chain(sides).chain(ends).collect()
            }
        };
        self.deliver(Rc::new(lines.into_iter().map(JobLine::command).collect::<Vec<_>>()));
        self.enter(Phase::Commanding);
    }

    fn begin_job(&mut self) {
        if self.phase == Phase::Ready
            && let Some(job) = self.job.clone()
        {
            self.is_given_up = false;
            self.deliver(job);
            self.enter(Phase::Sending);
        }
    }
}
