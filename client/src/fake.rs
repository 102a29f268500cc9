//! A simulated plotter for tests, which follows the protocol and misbehaves on demand.
//!
//! It is stricter than a real plotter. Bytes that overflow its queue of 256 bytes are lost and
//! reported, it executes at most one line for each read of the client, and it acts on real-time
//! bytes even inside a line. Time passes only while the client waits for bytes.

use crate::link::{Answer, Link, UserRequest};
use penup::checksum::CRC_16;
use penup::machine::Settings;
use penup::protocol::{CommandError, Label, Named, Numbering, Received};
use penup_job::protocol::{
    ABORT, AGAIN, BUILD, CLEAR, END, FASTER, HOLD, MODEL, PAUSE_AFTER_STROKE, PLOT, RESUME,
    SETTINGS, SLOWER,
};
use penup_job::twin;
use penup_readers::lines::JobLine;
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

/// The way in which a fake plotter misbehaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fault {
    /// The plotter behaves correctly.
    #[default]
    None,
    /// Never sends anything.
    Silent,
    /// Sends nothing after it has accepted this number of lines.
    SilentAfter(usize),
    /// Answers line N, counted from 1, with this error number.
    ErrorAt(usize, u16),
    /// Loses line N, counted from 1, when it arrives for the first time.
    LosesLine(usize),
    /// Loses line N, counted from 1, whenever it arrives.
    NeverTakesLine(usize),
    /// Loses and regains its power instead of accepting line N, counted from 1.
    RestartsAt(usize),
    /// Is aborted instead of accepting line N, counted from 1, when that arrives for the first
    /// time.
    AbortedAt(usize),
    /// Does not support numbered lines, as older firmware.
    WithoutNumbers,
    /// Holds a different model than it was sent.
    HoldsOther,
    /// Reports a wrong checksum of the model the first time that it is asked.
    SaysOther,
    /// Runs firmware other than penup.
    NotPenup,
    /// Sends bytes that form no lines.
    Noise,
    /// Is busy with another job.
    Busy,
    /// Stops with this alarm number in the middle of the drawing.
    AlarmWhileDrawing(u16),
    /// Does not confirm the second and later aborts; the first opens the conversation.
    IgnoresAbort,
    /// Is unplugged when the second abort is sent.
    GoneAtAbort,
    /// Works, but nobody is there to put in a pen.
    LeftAlone,
    /// Is locked after this alarm.
    Locked(u16),
}

/// The state of a simulated plotter; see the [module](self).
#[derive(Debug, Default)]
pub struct FakePlotter {
    /// The way in which the plotter misbehaves.
    pub fault: Fault,
    /// The lines of a job that it accepted, in order, since the last clearing.
    pub lines: Vec<String>,
    /// Whether more bytes were sent than its queue holds.
    pub overflowed: bool,
    /// The maximum number of lines that waited in its queue at once.
    pub most_waiting: usize,
    /// The number of aborts.
    pub aborts: usize,
    /// The number of strokes of every drawing.
    pub strokes: u64,
    /// The stroke, counted from 0, before which it waits for a pen, and the number of that pen.
    pub pen_before: Option<(u64, u8)>,
    /// The pens that the client was asked to change to, in order.
    pub requested_pens: Vec<u8>,
    /// The stroke, counted from 0, before which a feed hold occurs.
    pub hold_before: Option<u64>,
    /// The user's successive answers to the question whether to resume. When they are used up,
    /// nobody answers.
    pub user: VecDeque<Answer>,
    /// The number of vertices that it says it can hold.
    pub most_vertices: usize,
    /// What the user asks for by keys, in order, each after this number of strokes.
    pub keys: VecDeque<(u64, UserRequest)>,
    /// The speeds in percent of those in its settings.
    pub percent: u16,
    /// The states in which it stood after it was told to hold, counted.
    pub holds: usize,
    /// How many of the next bytes that hold or resume are lost on the line.
    pub lost_bytes: usize,
    /// How many of them are lost after it was told to hold.
    pub lost_after_holds: usize,
    /// The number of status reports that it sends while it computes the picture. Meanwhile it reads
    /// no lines.
    pub reports_while_computing: usize,
    /// Whether it answers the line that asks for the picture before it computes it, as it does with
    /// a picture that it draws part by part.
    pub answers_first: bool,
    /// The time that it takes to answer a status query while it computes.
    pub answer_delay: Duration,
    queue: Vec<u8>,
    output: VecDeque<u8>,
    /// The line that asked for the picture, while it computes.
    plot: Option<Label>,
    /// When the answer to a status query is due, while it computes.
    answer_due: Option<Duration>,
    drawn: Option<u64>,
    /// The number of strokes of the last drawing, for the reports after its end.
    finished: u64,
    is_held: bool,
    /// The number of status reports since the last key.
    reports: u32,
    numbering: Numbering,
    clock: Duration,
    began: Option<Instant>,
    is_fault_over: bool,
}

impl FakePlotter {
    const QUEUE: usize = 256;

    /// Creates a plotter with `fault` whose drawings have three strokes.
    pub fn new(fault: Fault) -> Self {
        Self {
            fault,
            strokes: 3,
            percent: 100,
            most_vertices: 4000,
            began: Some(Instant::now()),
            ..Self::default()
        }
    }

    /// Begins to draw what a client has sent that is gone.
    pub fn draw_on(&mut self) {
        self.drawn = Some(0);
    }

    fn say(&mut self, line: &str) {
        let silent = match self.fault {
            Fault::Silent => true,
            Fault::SilentAfter(count) => self.lines.len() > count,
            _ => false,
        };
        if !silent {
            self.output.extend(line.as_bytes());
            self.output.extend(b"\r\n");
        }
    }

    fn report(&mut self) {
        self.reports += 1;
        let Some(drawn) = self.drawn else {
            if let Fault::Locked(number) = self.fault {
                return self.say(&format!("<Alarm|MPos:0.000,0.000|Alarm:{number}>"));
            }
            let state = if self.fault == Fault::Busy { "Run" } else { "Idle" };
            let all = self.finished;
            return self.say(&format!(
                "<{state}|MPos:0.000,0.000|Drawn:{all}/{all}|Ink:{all}/{all}|Left:0>"
            ));
        };
        let all = self.strokes;
        if self.is_held {
            return self.say(&format!("<Hold:0|MPos:4.000,2.000|Drawn:{drawn}/{all}>"));
        }
        if let Some((stroke, pen)) = self.pen_before
            && stroke == drawn
        {
            let position = self.requested_pens.len();
            return self
                .say(&format!("<Hold:0|MPos:{position}.000,2.000|Pen:{pen}|Drawn:{drawn}/9>"));
        }
        if self.hold_before == Some(drawn) {
            return self.say(&format!("<Hold:0|MPos:3.000,2.000|Drawn:{drawn}/9>"));
        }
        let (done, left) = (10 * drawn, all - drawn);
        let speed = match self.percent {
            100 => String::new(),
            percent => format!("|Ov:{percent},100,100"),
        };
        self.say(&format!(
            "<Run|MPos:1.000,2.000{speed}|Drawn:{drawn}/{all}|Ink:{done}/{}|Left:{left}>",
            10 * all
        ));
        if let Fault::AlarmWhileDrawing(number) = self.fault {
            self.say(&format!("ALARM:{number}"));
        }
        self.drawn = (drawn < self.strokes).then_some(drawn + 1);
        self.finished = self.strokes;
    }

    fn abort(&mut self) {
        self.aborts += 1;
        self.queue.clear();
        (self.drawn, self.is_held) = (None, false);
        self.numbering = Numbering::default();
        match self.fault {
            Fault::NotPenup => self.say("Grbl 1.1h ['$' for help]"),
            Fault::IgnoresAbort if self.aborts > 1 => {}
            _ => self.say("Grbl 1.1h [penup 0.1.0 '$' for help]"),
        }
    }

    fn take_line(&mut self, line: &str) {
        if matches!(self.fault, Fault::WithoutNumbers | Fault::NotPenup) {
            return self.say(if line.is_empty() { "ok" } else { "error:1" });
        }
        let coming = self.lines.len() + 1;
        let is_other = |word| line.contains(word);
        let is_of_job =
            line.starts_with('N') && !["M110", MODEL, CLEAR, SETTINGS].into_iter().any(is_other);
        match self.fault {
            Fault::NeverTakesLine(lost) if is_of_job && lost == coming => return,
            Fault::LosesLine(lost) if is_of_job && lost == coming && !self.is_fault_over => {
                self.is_fault_over = true;
                return;
            }
            Fault::AbortedAt(bad) if is_of_job && bad == coming && !self.is_fault_over => {
                self.is_fault_over = true;
                return self.abort();
            }
            Fault::RestartsAt(bad) if is_of_job && bad == coming => {
                self.lines.clear();
                return self.abort();
            }
            _ => {}
        }
        match self.numbering.receive(Ok(line)) {
            Received::Line(MODEL, label) => {
                self.report_contents();
                self.reply(Ok(()), label);
            }
            Received::Line(SETTINGS, label) => {
                for (info, value) in Settings::default().iter() {
                    self.say(&format!("${}={value}", info.number()));
                }
                self.reply(Ok(()), label);
            }
            Received::Line(CLEAR, label) => {
                self.lines.clear();
                self.reply(Ok(()), label);
            }
            Received::Line("" | END | BUILD, label) => self.reply(Ok(()), label),
            Received::Line(text, label) => {
                self.lines.push(text.to_owned());
                let outcome = match self.fault {
                    Fault::ErrorAt(bad, error) if bad == coming => {
                        self.say("[MSG:what it thinks of it]");
                        Err(CommandError::RefusedBefore(error))
                    }
                    _ => Ok(()),
                };
                if text == PLOT && self.reports_while_computing > 0 {
                    self.plot = Some(label);
                    if !self.answers_first {
                        return;
                    }
                } else if text == PLOT || text == AGAIN {
                    self.drawn = Some(0);
                }
                self.numbering.note(label, outcome);
                self.reply(outcome, label);
            }
            Received::Answer(outcome, label) => self.reply(outcome, label),
        }
    }

    fn report_contents(&mut self) {
        let is_first = !std::mem::replace(&mut self.is_fault_over, true);
        let lines: Vec<JobLine> = self.lines.iter().map(JobLine::command).collect();
        let [mut model, options] = twin::contents(&lines, lines.len()).unwrap_or_default();
        let is_other = match self.fault {
            Fault::HoldsOther => true,
            Fault::SaysOther => is_first,
            _ => false,
        };
        model ^= u32::from(is_other);
        let limit = self.most_vertices;
        self.say(&format!("[MODEL:vertices 0 of {limit}]"));
        self.say(&format!("[MODEL:faces 0, bars 0, curves 0, corners 0 of {}]", 4 * limit));
        self.say(&format!("[MODEL:checksum {model:08X}, options {options:08X}]"));
    }

    /// Sends the reply to a line with a checksum.
    fn reply(&mut self, outcome: Result<(), CommandError>, label: Label) {
        let last = match outcome {
            Ok(()) => "ok".to_owned(),
            Err(refusal) => format!("error:{}", refusal.number()),
        };
        let checked = |text: String| format!("{text}*{:04X}", CRC_16.checksum(text.as_bytes()));
        match label.named {
            Named::Line(number) => return self.say(&checked(format!("{last} N{number}"))),
            Named::Last(number) => self.say(&checked(format!("Line: {number}"))),
            Named::Expected(number) => self.say(&checked(format!("Resend: {number}"))),
            Named::Nothing => {}
        }
        self.say(&last);
    }

    /// Answers a status query if it is due. After the last of these answers the picture is
    /// computed.
    fn compute(&mut self, label: Label) {
        if self.answer_due.is_none_or(|due| due > self.clock) {
            return;
        }
        self.answer_due = None;
        self.say("<Run|MPos:0.000,0.000|Stage:order>");
        self.reports_while_computing -= 1;
        if self.reports_while_computing == 0 {
            self.plot = None;
            self.drawn = Some(0);
            if !self.answers_first {
                self.numbering.note(label, Ok(()));
                self.reply(Ok(()), label);
            }
        }
    }

    fn work(&mut self) {
        if let Some(label) = self.plot {
            return self.compute(label);
        }
        if let Some(end) = self.queue.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = self.queue.drain(..=end).collect();
            self.take_line(String::from_utf8_lossy(&line).trim_end());
        }
    }
}

impl Link for FakePlotter {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for &byte in bytes {
            match byte {
                b'?' if self.fault == Fault::Noise => self.output.extend(b"\xFE\x00\x81"),
                b'?' if self.plot.is_some() => {
                    self.answer_due.get_or_insert(self.clock + self.answer_delay);
                }
                b'?' => self.report(),
                ABORT if self.fault == Fault::GoneAtAbort && self.aborts > 0 => {
                    self.aborts += 1;
                    return Err(io::ErrorKind::BrokenPipe.into());
                }
                ABORT => self.abort(),
                HOLD | PAUSE_AFTER_STROKE | RESUME if self.lost_bytes > 0 => self.lost_bytes -= 1,
                RESUME => {
                    (self.pen_before, self.hold_before) = (None, None);
                    self.is_held = false;
                }
                HOLD | PAUSE_AFTER_STROKE if self.drawn.is_some() => {
                    self.is_held = true;
                    self.holds += 1;
                    self.lost_bytes += std::mem::take(&mut self.lost_after_holds);
                }
                FASTER => self.percent += 10,
                SLOWER => self.percent -= 10,
                _ if self.queue.len() < Self::QUEUE => self.queue.push(byte),
                _ => self.overflowed = true,
            }
        }
        let waiting = self.queue.iter().filter(|&&byte| byte == b'\n').count();
        self.most_waiting = self.most_waiting.max(waiting);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.output.is_empty() {
            self.work();
        }
        if self.output.is_empty() {
            self.clock += timeout;
        }
        let count = buffer.len().min(self.output.len());
        for (slot, byte) in buffer.iter_mut().zip(self.output.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }

    /// The pen is in when the client is asked for the second time, if somebody is there.
    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.requested_pens.push(pen);
        Ok(match self.requested_pens.len() {
            _ if self.fault == Fault::LeftAlone => Answer::Nobody,
            2 => Answer::Yes,
            _ => Answer::NotYet,
        })
    }

    fn request(&mut self) -> Option<UserRequest> {
        // A user looks at what the last key did before the next one.
        let drawn = self.drawn.filter(|_| self.reports >= 3)?;
        let (_, request) = *self.keys.front().filter(|(stroke, _)| *stroke <= drawn)?;
        self.keys.pop_front();
        self.reports = 0;
        Some(request)
    }

    fn ask_to_resume(&mut self, _first: bool) -> io::Result<Answer> {
        Ok(self.user.pop_front().unwrap_or(Answer::Nobody))
    }

    fn now(&self) -> Instant {
        self.began.unwrap_or_else(Instant::now) + self.clock
    }
}
