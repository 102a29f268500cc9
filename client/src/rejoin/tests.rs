//! Tests of a plotter at a port that vanishes and comes back.

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
    let (sender, _) = Sender::join(&mut port, Timeouts::default(), interrupt).expect("a plotter");
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
