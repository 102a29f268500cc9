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
use std::collections::VecDeque;
use std::io::{self, Read as _};
use std::time::{Duration, Instant};

/// The time without a byte after which a plotter that was asked is gone.
const SILENCE: Duration = Duration::from_secs(3);

/// The time between two attempts to reach the plotter.
const PAUSE: Duration = Duration::from_millis(250);

/// How long the first report is waited for behind an opened port, and the most bytes before it.
const INTRODUCTION: Duration = Duration::from_secs(2);
const LONGEST_INTRODUCTION: usize = 1 << 12;

/// If a wait takes this much longer than it should, the computer was asleep.
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
pub struct Rejoining<W> {
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
    /// Whether the plotter was asked for something since then.
    is_asked: bool,
    /// What came since the port was opened again, and when that was; `None` once the first report
    /// has come.
    introduction: Option<(Vec<u8>, Instant)>,
    /// What was received and is still to be passed on.
    received: VecDeque<u8>,
}

impl<W: Wire> Rejoining<W> {
    /// Takes an open port. It does not wait for a plotter that is gone until [`Rejoining::wait`]
    /// says so.
    pub fn new(wire: W, open: Open<W>) -> Self {
        Self {
            wire: Some(wire),
            open,
            limit: None,
            is_quiet: false,
            gone: None,
            lost: Duration::ZERO,
            heard: None,
            is_asked: false,
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
        let now = self.gone.map_or_else(Instant::now, |gone| gone.since);
        now.checked_sub(self.lost).unwrap_or(now)
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
        self.is_asked = true;
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
            self.lost += gone.since.elapsed();
            self.limit = None;
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(wire) = &mut self.wire else { return Err(gone_for_good()) };
        // This is a generous limit: sending a full receive window takes about 25 ms.
        wire.set_io_timeout(Duration::from_secs(2))?;
        wire.write_all(bytes)
    }

    /// Waits up to `timeout` for bytes, and for a plotter that is gone. Returns 0 if none came.
    ///
    /// # Errors
    /// The port is gone, and is not waited for any longer.
    pub fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if !self.received.is_empty() {
            return self.received.read(buffer);
        }
        let begin = Instant::now();
        if self.gone.is_some() {
            self.look_for(timeout)?;
            if self.wire.is_none() {
                return Ok(0);
            }
        }
        match self.read(buffer, timeout) {
            Ok(0) => {
                self.note_silence(begin, timeout);
                self.introduce(buffer, 0)
            }
            Ok(count) => {
                self.join();
                (self.heard, self.is_asked) = (Some(Instant::now()), false);
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
        let Some((kept, since)) = &mut self.introduction else { return Ok(count) };
        kept.extend_from_slice(buffer.get(..count).unwrap_or_default());
        let is_over = since.elapsed() > INTRODUCTION || kept.len() > LONGEST_INTRODUCTION;
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
        match wire.read(buffer) {
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

    /// Notices that the plotter has fallen silent, or that the computer slept.
    fn note_silence(&mut self, begin: Instant, timeout: Duration) {
        let slept = begin.elapsed().saturating_sub(timeout);
        if slept > SLEEP {
            self.lost += slept;
            self.heard = self.heard.map(|heard| heard + slept);
        }
        let is_silent = self.heard.is_some_and(|heard| heard.elapsed() > SILENCE);
        if self.gone.is_none() && self.is_asked && is_silent && self.may_wait() {
            self.leave(Why::Silence);
        }
    }

    /// The plotter is gone from now on.
    fn leave(&mut self, why: Why) {
        let now = Instant::now();
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
            self.lost += gone.since.elapsed();
            self.say("the plotter is back");
        }
    }

    /// Tries to reach the plotter again, after a pause since the last time.
    fn look_for(&mut self, timeout: Duration) -> io::Result<()> {
        let Some(mut gone) = self.gone else { return Ok(()) };
        if self.limit.is_some_and(|limit| gone.since.elapsed() > limit) {
            return Err(match gone.why {
                Why::Port => gone_for_good(),
                Why::Silence => {
                    io::Error::new(io::ErrorKind::TimedOut, "the plotter does not answer any more")
                }
            });
        }
        if gone.last_attempt.elapsed() < PAUSE {
            if self.wire.is_none() {
                std::thread::sleep(timeout);
            }
            return Ok(());
        }
        gone.last_attempt = Instant::now();
        self.gone = Some(gone);
        // The line end terminates what is left of a line that was cut.
        let question: &[u8] = if self.wire.is_none() { b"\n?" } else { b"?" };
        if self.wire.is_none() {
            self.wire = (self.open)();
            self.introduction = self.wire.is_some().then(|| (Vec::new(), Instant::now()));
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
mod tests {
    use super::{Rejoining, Why, Wire, without_greeting};
    use crate::error::Error;
    use crate::link::{Answer, Link};
    use crate::sender::{Sender, Timeouts};
    use penup_job::protocol::ABORT;
    use std::collections::VecDeque;
    use std::io;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Mutex, PoisonError};
    use std::time::{Duration, Instant};

    /// A plotter that draws, and answers each question for its status until it falls silent.
    #[derive(Clone, Default)]
    struct Drawing {
        heard: Arc<Mutex<Vec<u8>>>,
        said: VecDeque<u8>,
        is_silent: Arc<AtomicBool>,
    }

    impl io::Write for Drawing {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.heard.lock().unwrap_or_else(PoisonError::into_inner).extend(bytes);
            if bytes.contains(&b'?') && !self.is_silent.load(Ordering::Relaxed) {
                self.said.extend(b"<Run|MPos:1.000,2.000,0.000>\r\n");
            }
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl io::Read for Drawing {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            if self.said.is_empty() {
                std::thread::sleep(Duration::from_millis(1));
                return Err(io::ErrorKind::TimedOut.into());
            }
            self.said.read(buffer)
        }
    }

    impl Wire for Drawing {
        fn set_io_timeout(&mut self, _: Duration) -> io::Result<()> {
            Ok(())
        }
    }

    /// A port whose plotter is lost for this reason at the next moment.
    struct Port {
        port: Rejoining<Drawing>,
        lost: Arc<Mutex<Option<Why>>>,
    }

    impl Link for Port {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.port.send(bytes, bytes.contains(&ABORT))
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
            if let Some(why) = self.lost.lock().unwrap_or_else(PoisonError::into_inner).take() {
                self.port.leave(why);
            }
            self.port.receive(buffer, timeout)
        }

        fn now(&self) -> Instant {
            self.port.now()
        }

        fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
            Ok(Answer::Yes)
        }
    }

    /// Begins to follow a plotter that is lost then, and does something. Returns the outcome, what
    /// the plotter has heard, and how long it took.
    fn while_lost<T>(
        why: Why,
        interrupt: &AtomicBool,
        act: impl FnOnce(Sender<'_>) -> T,
    ) -> (T, Vec<u8>, Duration) {
        let plotter = Drawing::default();
        let (heard, is_silent) = (plotter.heard.clone(), plotter.is_silent.clone());
        let mut port = Rejoining::new(plotter, Box::new(|| None));
        port.wait(Duration::from_secs(300), true);
        let lost = Arc::new(Mutex::new(None));
        let mut port = Port { port, lost: lost.clone() };
        let begin = Instant::now();
        let (sender, _) =
            Sender::join(&mut port, Timeouts::default(), interrupt).expect("a plotter");
        is_silent.store(true, Ordering::Relaxed);
        *lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(why);
        let outcome = act(sender);
        let heard = heard.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (outcome, heard, begin.elapsed())
    }

    /// The limit of the waiting is 300 s, in which the clock of the conversation stands still.
    const SOON: Duration = Duration::from_secs(20);

    #[test]
    fn a_plotter_that_is_silent_is_told_to_stop_all_the_same() {
        let interrupt = AtomicBool::new(false);
        let (error, heard, time) = while_lost(Why::Silence, &interrupt, |mut sender| {
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    std::thread::sleep(Duration::from_millis(200));
                    interrupt.store(true, Ordering::Relaxed);
                });
                sender.status().expect_err("it is silent")
            })
        });
        assert!(matches!(error, Error::InterruptedUnconfirmed), "{error}");
        assert!(heard.contains(&ABORT));
        assert!(time < SOON, "{time:?}");
    }

    #[test]
    fn a_conversation_ends_soon_although_the_plotter_is_gone() {
        for why in [Why::Port, Why::Silence] {
            let (_, _, time) = while_lost(why, &AtomicBool::new(false), |sender| sender.end());
            assert!(time < SOON, "{why:?}: {time:?}");
        }
    }

    #[test]
    fn a_greeting_is_left_out_where_a_job_goes_on() {
        let greeting = "\r\nGrbl 1.1h [penup 0.1.0 '$' for help]\r\n";
        let passed = |bytes: &str| {
            String::from_utf8(without_greeting(bytes.as_bytes()).collect()).expect("text")
        };
        for (report, goes_on) in [
            ("<Run|MPos:1,2,3>\r\n", true),
            ("ok\r\n<Hold:0|MPos:1,2,3>\r\n", true),
            ("<Idle|MPos:1,2,3>\r\n<Run|MPos:1,2,3>\r\n", false),
            ("<Run|MPos", false),
            // The job has ended while the port was away, or was given up.
            ("<Idle|MPos:1,2,3|Drawn:120/120|Ink:0/0|Left:0>\r\n", true),
            ("ALARM:10\r\n<Alarm|MPos:1,2,3|Alarm:10|Drawn:0/0>\r\n", true),
            // It has started again, and its flash knows of a job.
            ("<Idle|MPos:1,2,3|Stopped:3/9|Drawn:0/0>\r\n", false),
            ("", false),
        ] {
            let expected = format!("{}{report}", if goes_on { "\r\n" } else { greeting });
            assert_eq!(passed(&format!("{greeting}{report}")), expected, "{report}");
        }
    }
}
