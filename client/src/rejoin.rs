//! A plotter at a serial port that may vanish and come back: a cable that was pulled, a computer
//! that slept.
//!
//! While the plotter is gone, its clock stands still for the program, so that no time runs out;
//! what is sent is lost, as on a bad cable, and sent again by the rules for damaged lines. The port
//! is opened again as soon as it is there, and the plotter is asked until it answers.
//!
//! A plotter at a USB port greets whoever opens the port, as it does after a start. So a greeting
//! is left out if the first report of the plotter's state tells that it has not started again: its
//! job goes on, or it still knows of one. An alarm tells itself what has happened.

use crate::stderr;
use penup_job::protocol::Reply;
use std::cell::Cell;
use std::collections::VecDeque;
use std::io::{self, Read as _};
use std::time::{Duration, Instant};

/// The time without a byte after which a plotter that was asked is gone.
const SILENCE: Duration = Duration::from_secs(3);

/// The time between two attempts to reach the plotter.
const PAUSE: Duration = Duration::from_millis(250);

/// How long the first report is waited for behind the first byte of an opened port, and the most
/// bytes before it.
const INTRODUCTION: Duration = Duration::from_secs(2);
const LONGEST_INTRODUCTION: usize = 1 << 12;

/// A generous limit: sending a full receive window takes about 25 ms.
const LONGEST_WRITE: Duration = Duration::from_secs(2);

/// The longest search for the port of the plotter.
const LONGEST_SEARCH: Duration = Duration::from_secs(30);

/// If a wait takes this much longer than it should, or so much passes between two calls, the
/// computer was asleep.
const SLEEP: Duration = Duration::from_secs(2);

/// The stream of bytes of an open port.
pub trait Wire: io::Read + io::Write {
    /// Sets the longest time that a call of `read` or `write` takes.
    ///
    /// # Errors
    /// The port is gone.
    fn set_io_timeout(&mut self, timeout: Duration) -> io::Result<()>;
}

impl Wire for Box<dyn serialport::SerialPort> {
    fn set_io_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        Ok(self.set_timeout(timeout)?)
    }
}

/// The time outside, which goes on while the computer sleeps.
pub trait Clock {
    /// The time now. It may leap, because the computer slept.
    fn now(&self) -> Instant;

    /// Waits so long.
    fn sleep(&self, time: Duration);
}

/// The clock of this computer.
#[derive(Debug, Clone, Copy, Default)]
pub struct ComputerClock;

impl Clock for ComputerClock {
    fn now(&self) -> Instant {
        Instant::now()
    }

    fn sleep(&self, time: Duration) {
        std::thread::sleep(time);
    }
}

/// Opens the port of the plotter again; `None` while it is not there.
pub type Open<W> = Box<dyn FnMut() -> Option<W> + Send>;

/// The reasons why a plotter is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Why {
    Port,
    Silence,
}

/// The time since which the plotter is lost, and why.
#[derive(Debug, Clone, Copy)]
struct LostPlotter {
    since: Instant,
    why: Why,
    last_attempt: Instant,
}

/// A port, and what is done when the plotter at its other end is gone.
///
/// All its times but `seen` are those of a clock that stands still while the computer sleeps.
pub struct Rejoining<W, C = ComputerClock> {
    clock: C,
    /// The time outside when it was last asked for.
    seen: Cell<Instant>,
    /// How long the computer slept in all.
    slept: Cell<Duration>,
    wire: Option<W>,
    open: Open<W>,
    /// The longest time for which the plotter is waited for; none if the caller has not asked for
    /// it.
    limit: Option<Duration>,
    is_quiet: bool,
    gone: Option<LostPlotter>,
    /// How long the plotter was gone in all.
    lost: Duration,
    /// When the last byte came; `None` before the first.
    heard: Option<Instant>,
    /// When the plotter was first asked for something since then.
    asked: Option<Instant>,
    /// What came since the port was opened again, and when that began; `None` once the first report
    /// has come.
    introduction: Option<(Vec<u8>, Option<Instant>)>,
    /// What was received and is still to be passed on.
    received: VecDeque<u8>,
}

impl<W: Wire> Rejoining<W> {
    /// Takes an open port. It does not wait for a plotter that is gone until [`Rejoining::wait`]
    /// says so.
    pub fn new(wire: W, open: Open<W>) -> Self {
        Self::with_clock(wire, open, ComputerClock)
    }
}

impl<W: Wire, C: Clock> Rejoining<W, C> {
    /// As [`Rejoining::new`], with another clock.
    pub fn with_clock(wire: W, open: Open<W>, clock: C) -> Self {
        let seen = Cell::new(clock.now());
        Self {
            clock,
            seen,
            slept: Cell::new(Duration::ZERO),
            wire: Some(wire),
            open,
            limit: None,
            is_quiet: false,
            gone: None,
            lost: Duration::ZERO,
            heard: None,
            asked: None,
            introduction: None,
            received: VecDeque::new(),
        }
    }

    /// Adds another way to open the port, which is used if the port is no longer there.
    pub fn also_open(&mut self, mut other: Open<W>)
    where
        W: 'static,
    {
        let mut first = std::mem::replace(&mut self.open, Box::new(|| None));
        self.open = Box::new(move || first().or_else(&mut *other));
    }

    /// The open port.
    pub fn into_wire(self) -> Option<W> {
        self.wire
    }

    /// From now on, waits so long for a plotter that has answered and is gone. Says so on the
    /// standard error unless the user wants quiet.
    pub fn wait(&mut self, limit: Duration, is_quiet: bool) {
        self.limit = Some(limit).filter(|limit| !limit.is_zero());
        self.is_quiet = is_quiet;
    }

    /// The time as a conversation counts it: it stands still while the plotter is gone.
    pub fn now(&self) -> Instant {
        let awake = self.awake(Duration::ZERO);
        let now = self.gone.map_or(awake, |gone| gone.since);
        now.checked_sub(self.lost).unwrap_or(now)
    }

    /// The time without that for which the computer slept. Since the time was last asked for, no
    /// more may have passed than `expected` and a little.
    fn awake(&self, expected: Duration) -> Instant {
        let now = self.clock.now();
        let passed = now.saturating_duration_since(self.seen.replace(now));
        let slept = passed.saturating_sub(expected);
        if slept > SLEEP {
            self.slept.set(self.slept.get() + slept);
        }
        now.checked_sub(self.slept.get()).unwrap_or(now)
    }

    /// How long the computer was awake since then.
    fn since(&self, time: Instant) -> Duration {
        self.awake(Duration::ZERO).saturating_duration_since(time)
    }

    /// Sends all of `bytes`. While the plotter is gone they are lost, unless `must_arrive`: then a
    /// plotter that is gone is not waited for any longer, so that time passes again, and a port
    /// that is open carries them although nothing answers.
    ///
    /// # Errors
    /// The port is gone and is not waited for, or the bytes must arrive.
    pub fn send(&mut self, bytes: &[u8], must_arrive: bool) -> io::Result<()> {
        if self.gone.is_some() && !must_arrive {
            return Ok(());
        }
        self.stop_waiting();
        let now = self.awake(Duration::ZERO);
        self.asked.get_or_insert(now);
        match self.write(bytes) {
            Err(_) if self.may_wait() && !must_arrive => {
                self.leave(Why::Port);
                Ok(())
            }
            result => result,
        }
    }

    /// No longer waits for a plotter that is gone.
    fn stop_waiting(&mut self) {
        if let Some(gone) = self.gone.take() {
            self.lost += self.since(gone.since);
            self.limit = None;
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(wire) = &mut self.wire else { return Err(gone_for_good()) };
        wire.set_io_timeout(LONGEST_WRITE)?;
        let written = wire.write_all(bytes);
        self.awake(LONGEST_WRITE);
        written
    }

    /// Waits up to `timeout` for bytes, and for a plotter that is gone. Returns 0 if none came.
    ///
    /// # Errors
    /// The port is gone, and is not waited for any longer.
    pub fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if !self.received.is_empty() {
            return self.received.read(buffer);
        }
        // What passed outside before is no part of the waiting.
        self.awake(Duration::ZERO);
        if self.gone.is_some() {
            self.look_for(timeout)?;
            if self.wire.is_none() {
                return Ok(0);
            }
        }
        match self.read(buffer, timeout) {
            Ok(0) => {
                self.note_silence();
                self.introduce(buffer, 0)
            }
            Ok(count) => {
                self.join();
                (self.heard, self.asked) = (Some(self.awake(Duration::ZERO)), None);
                self.introduce(buffer, count)
            }
            Err(_) if self.may_wait() => {
                self.leave(Why::Port);
                Ok(0)
            }
            Err(error) => Err(error),
        }
    }

    /// Passes `count` bytes of the buffer on. Behind an opened port they are kept back until the
    /// first report has come, or too long for it to come.
    fn introduce(&mut self, buffer: &mut [u8], count: usize) -> io::Result<usize> {
        let now = self.awake(Duration::ZERO);
        let Some((kept, begun)) = &mut self.introduction else { return Ok(count) };
        kept.extend_from_slice(buffer.get(..count).unwrap_or_default());
        if kept.is_empty() {
            return Ok(0);
        }
        let passed = now.saturating_duration_since(*begun.get_or_insert(now));
        let is_over = passed > INTRODUCTION || kept.len() > LONGEST_INTRODUCTION;
        if !is_over && first_report(kept).is_none() {
            return Ok(0);
        }
        self.received = without_greeting(kept).collect();
        self.introduction = None;
        self.received.read(buffer)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let Some(wire) = &mut self.wire else { return Err(gone_for_good()) };
        wire.set_io_timeout(timeout)?;
        let read = wire.read(buffer);
        self.awake(timeout);
        match read {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(0),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(0),
            // A port that is ready to be read but has no data is disconnected.
            Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
            result => result,
        }
    }

    /// Whether a plotter that is gone is waited for.
    fn may_wait(&self) -> bool {
        self.limit.is_some() && self.heard.is_some()
    }

    /// Notices that the plotter has fallen silent.
    fn note_silence(&mut self) {
        let is_silent = self.asked.is_some_and(|asked| self.since(asked) > SILENCE);
        if self.gone.is_none() && is_silent && self.may_wait() {
            self.leave(Why::Silence);
        }
    }

    /// The plotter is gone from now on.
    fn leave(&mut self, why: Why) {
        let now = self.awake(Duration::ZERO);
        let since = self.gone.map_or(now, |gone| gone.since);
        let is_new = self.gone.is_none();
        self.gone = Some(LostPlotter { since, why, last_attempt: now });
        if why == Why::Port {
            // The port is closed, because as long as it is open, a plotter that comes back gets
            // another name.
            self.wire = None;
        }
        if is_new {
            let limit = self.limit.unwrap_or_default().as_secs();
            self.say(&match why {
                Why::Port => format!("the port of the plotter is gone: waiting up to {limit} s"),
                Why::Silence => format!("the plotter does not answer: waiting up to {limit} s"),
            });
        }
    }

    /// The plotter is back.
    fn join(&mut self) {
        if let Some(gone) = self.gone.take() {
            self.lost += self.since(gone.since);
            self.say("the plotter is back");
        }
    }

    /// Tries to reach the plotter again, after a pause since the last time.
    fn look_for(&mut self, timeout: Duration) -> io::Result<()> {
        let Some(mut gone) = self.gone else { return Ok(()) };
        if self.limit.is_some_and(|limit| self.since(gone.since) > limit) {
            return Err(match gone.why {
                Why::Port => gone_for_good(),
                Why::Silence => {
                    io::Error::new(io::ErrorKind::TimedOut, "the plotter does not answer any more")
                }
            });
        }
        if self.since(gone.last_attempt) < PAUSE {
            if self.wire.is_none() {
                self.clock.sleep(timeout);
                self.awake(timeout);
            }
            return Ok(());
        }
        gone.last_attempt = self.awake(Duration::ZERO);
        self.gone = Some(gone);
        // The line end terminates what is left of a line that was cut.
        let question: &[u8] = if self.wire.is_none() { b"\n?" } else { b"?" };
        if self.wire.is_none() {
            self.wire = (self.open)();
            self.awake(LONGEST_SEARCH);
            self.introduction = self.wire.is_some().then(|| (Vec::new(), None));
        }
        if self.wire.is_some() && self.write(question).is_err() {
            self.leave(Why::Port);
        }
        Ok(())
    }

    fn say(&self, text: &str) {
        if !self.is_quiet {
            stderr::say(&format!("penup: {text}"));
        }
    }
}

/// The first whole line that reports a state.
fn first_report(bytes: &[u8]) -> Option<&[u8]> {
    let whole = bytes.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
    whole.map(<[u8]>::trim_ascii).find(|line| line.starts_with(b"<"))
}

/// The bytes, without a greeting if the first report tells that the plotter has not started again,
/// or has stopped with an alarm.
fn without_greeting(bytes: &[u8]) -> impl Iterator<Item = u8> {
    let report = first_report(bytes).map(String::from_utf8_lossy);
    let goes_on = match report.map(|report| Reply::parse(&report)) {
        Some(Reply::Status(status)) => {
            let knows_job = status.strokes.is_some_and(|(_, all)| all > 0);
            knows_job || matches!(status.state.as_str(), "Run" | "Hold" | "Alarm")
        }
        _ => false,
    };
    let lines = bytes.split_inclusive(|byte| *byte == b'\n');
    let kept = lines.filter(move |line| !(goes_on && line.trim_ascii().starts_with(b"Grbl ")));
    kept.flatten().copied()
}

fn gone_for_good() -> io::Error {
    io::Error::new(
        io::ErrorKind::BrokenPipe,
        "the port of the plotter is gone; once it is back, `penup watch` follows the job",
    )
}

#[cfg(test)]
mod job_tests;
#[cfg(test)]
mod tests;
