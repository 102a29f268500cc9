//! A plotter made of plain memory, for tests: it answers like the protocol and misbehaves on demand.
//!
//! It is stricter than a real one: its queue of 256 bytes overflows for good, it takes one line for
//! each byte-read of the client, and it reports bytes that act at once inside a line.

use crate::link::Link;
use crate::protocol::{ABORT, PLOT};
use std::collections::VecDeque;
use std::io;
use std::time::Duration;

/// What a fake plotter does wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// Says nothing, ever.
    Silent,
    /// Says nothing after so many lines.
    SilentAfter(usize),
    /// Answers line N, from 1, with this error number.
    ErrorAt(usize, u16),
    /// Never answers line N, from 1, but is alive.
    LosesLine(usize),
    /// Starts again instead of answering line N, from 1.
    RestartsAt(usize),
    /// Is another firmware.
    NotPenup,
    /// Sends bytes that are no lines.
    Noise,
    /// Is in the middle of another job.
    Busy,
    /// Stops with this alarm in the middle of the drawing.
    AlarmWhileDrawing(u16),
    /// Does not confirm an abort, from the second on (the first opens the conversation).
    IgnoresAbort,
}

/// See the [module](self).
#[derive(Debug, Default)]
pub struct FakePlotter {
    /// What it does wrong.
    pub fault: Fault,
    /// Each line that it took, in order.
    pub lines: Vec<String>,
    /// Whether more was sent than its queue holds.
    pub overflowed: bool,
    /// The most lines that waited in its queue.
    pub most_waiting: usize,
    /// How often it was aborted.
    pub aborts: usize,
    /// How many strokes a drawing has.
    pub strokes: u64,
    /// Before which stroke, from 0, it waits for which pen.
    pub pen_before: Option<(u64, u8)>,
    /// Each pen that it was asked to change to.
    pub pens_asked: Vec<u8>,
    queue: Vec<u8>,
    output: VecDeque<u8>,
    drawn: Option<u64>,
}

impl FakePlotter {
    const QUEUE: usize = 256;

    /// A plotter with `fault` that draws three strokes.
    pub fn new(fault: Fault) -> Self {
        Self { fault, strokes: 3, ..Self::default() }
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
        let Some(drawn) = self.drawn else {
            let state = if self.fault == Fault::Busy { "Run" } else { "Idle" };
            return self.say(&format!("<{state}|MPos:0.000,0.000>"));
        };
        if let Some((stroke, pen)) = self.pen_before
            && stroke == drawn
        {
            let place = self.pens_asked.len();
            return self
                .say(&format!("<Hold:0|MPos:{place}.000,2.000|Pen:{pen}|Strokes:{drawn}/9>"));
        }
        self.say(&format!("<Run|MPos:1.000,2.000|Strokes:{drawn}/{}>", self.strokes));
        if let Fault::AlarmWhileDrawing(number) = self.fault {
            self.say(&format!("ALARM:{number}"));
        }
        self.drawn = (drawn < self.strokes).then_some(drawn + 1);
    }

    fn abort(&mut self) {
        self.aborts += 1;
        self.queue.clear();
        self.drawn = None;
        match self.fault {
            Fault::NotPenup => self.say("Grbl 1.1h ['$' for help]"),
            Fault::IgnoresAbort if self.aborts > 1 => {}
            _ => self.say("Grbl 1.1h [penup 0.1.0 '$' for help]"),
        }
    }

    fn take_line(&mut self, line: &str) {
        self.lines.push(line.to_owned());
        let number = self.lines.len();
        match self.fault {
            Fault::ErrorAt(bad, error) if bad == number => {
                self.say("[MSG:what it thinks of it]");
                self.say(&format!("error:{error}"));
                return;
            }
            Fault::LosesLine(lost) if lost == number => return,
            Fault::RestartsAt(bad) if bad == number => return self.abort(),
            _ => {}
        }
        if line == PLOT {
            self.drawn = Some(0);
        }
        self.say("ok");
    }

    fn work(&mut self) {
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
                b'?' => self.report(),
                ABORT => self.abort(),
                b'~' => self.pen_before = None,
                _ if self.queue.len() < Self::QUEUE => self.queue.push(byte),
                _ => self.overflowed = true,
            }
        }
        let waiting = self.queue.iter().filter(|&&byte| byte == b'\n').count();
        self.most_waiting = self.most_waiting.max(waiting);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.output.is_empty() {
            self.work();
        }
        if self.output.is_empty() {
            std::thread::sleep(patience);
        }
        let count = buffer.len().min(self.output.len());
        for (slot, byte) in buffer.iter_mut().zip(self.output.drain(..count)) {
            *slot = byte;
        }
        Ok(count)
    }

    /// The second time that it is asked for.
    fn change_pen(&mut self, pen: u8) -> io::Result<bool> {
        self.pens_asked.push(pen);
        Ok(self.pens_asked.len() == 2)
    }
}
