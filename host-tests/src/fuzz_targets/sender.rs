//! A plotter that answers the client with anything.

use penup_client::link::{Answer, Link};
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_readers::lines::JobLine;
use std::io;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Draws a small job with a plotter that sends the input. The client must come to an end, with an
/// error in words or without one.
pub fn fuzz(input: &[u8]) {
    let mut link = Script { rest: input, start: Instant::now(), passed: Duration::ZERO };
    let job: Vec<JobLine> =
        ["$clear", "v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1 2 3"].map(JobLine::command).into();
    let interrupt = AtomicBool::new(false);
    let drawn = Sender::open(&mut link, Timeouts::default(), &interrupt).and_then(|mut sender| {
        sender.stream(&job, &mut Quiet)?;
        sender.plot(&mut Quiet)?;
        sender.end();
        Ok(())
    });
    if let Err(error) = drawn {
        assert!(!error.to_string().is_empty());
    }
}

/// A plotter whose answers are parts of the input, each of which ends with a zero byte. It sends
/// one whenever the client listens. When none is left, it is silent. Time passes only while the
/// client waits, a day at most.
struct Script<'i> {
    rest: &'i [u8],
    start: Instant,
    passed: Duration,
}

impl Link for Script<'_> {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.passed += timeout.max(Duration::from_millis(1));
        assert!(self.passed < Duration::from_secs(86_400), "the client never gives up");
        let end = self.rest.iter().position(|byte| *byte == 0).unwrap_or(self.rest.len());
        let count = end.min(buffer.len());
        buffer[..count].copy_from_slice(&self.rest[..count]);
        self.rest = &self.rest[count..];
        if count == end {
            self.rest = self.rest.get(1..).unwrap_or_default();
        }
        Ok(count)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn now(&self) -> Instant {
        self.start + self.passed
    }
}
