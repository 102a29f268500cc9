//! A simulated serial line at 115200 baud that corrupts bytes, between the client and a plotter in
//! memory.
//!
//! Time passes only in [`NoisyLine::receive`](Link::receive). The waits of the client therefore
//! take no real time, and every run is the same.

use crate::event_checker;
use crate::random::Random;
use crate::whole_jobs::Bench;
use penup::drawing::PagePoint;
use penup::plotter::Board;
use penup_client::link::{Answer, Link};
use std::collections::{BTreeSet, VecDeque};
use std::io;
use std::time::{Duration, Instant};

/// A fault that affects a byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// The byte and the following ones are lost, this many in total.
    Lost(usize),
    /// The byte arrives twice.
    Doubled,
    /// This byte arrives instead.
    Replaced(u8),
    /// This bit, counted from 0, is inverted.
    Flipped(u8),
    /// The byte and all following ones arrive this many milliseconds later.
    Late(u64),
}

/// The faults of one direction.
#[derive(Debug, Clone, Default)]
pub struct Damage {
    /// Single faults: the number of the byte, counted from 0, and its fault.
    pub faults: Vec<(usize, Fault)>,
    /// Random faults: one in this many bytes is affected, chosen by these numbers; `None` for no
    /// random faults.
    pub one_in: Option<(u64, Random)>,
}

/// The duration of a byte in microseconds, rounded up: ten bits at 115200 baud.
const BYTE_TIME: u64 = 87;

/// The time in microseconds after which a job counts as hanging.
const LONGEST: u64 = 3600 * 1_000_000;

/// One direction of the line.
#[derive(Debug, Default)]
struct Wire {
    damage: Damage,
    /// All bytes that were sent, before any fault.
    sent: Vec<u8>,
    lost: usize,
    /// The bytes in transit, each with its arrival time in microseconds.
    on_the_way: VecDeque<(u64, u8)>,
    /// The arrival time of the last of them.
    busy_until: u64,
}

impl Wire {
    fn send(&mut self, now: u64, bytes: &[u8]) {
        for &byte in bytes {
            let number = self.sent.len();
            self.sent.push(byte);
            self.busy_until = self.busy_until.max(now) + BYTE_TIME;
            if self.lost > 0 {
                self.lost -= 1;
                continue;
            }
            let fault = self.damage.faults.iter().find(|(at, _)| *at == number);
            let fault = fault.map(|(_, fault)| *fault).or_else(|| self.chance());
            let comes = match fault {
                None => [Some(byte), None],
                Some(Fault::Lost(count)) => {
                    self.lost = count - 1;
                    [None, None]
                }
                Some(Fault::Doubled) => [Some(byte), Some(byte)],
                Some(Fault::Replaced(other)) => [Some(other), None],
                Some(Fault::Flipped(bit)) => [Some(byte ^ 1 << bit), None],
                Some(Fault::Late(milliseconds)) => {
                    self.busy_until += 1000 * milliseconds;
                    [Some(byte), None]
                }
            };
            self.on_the_way.extend(comes.into_iter().flatten().map(|byte| (self.busy_until, byte)));
        }
    }

    /// Now and then chooses a random fault; real-time commands are not created.
    fn chance(&mut self) -> Option<Fault> {
        let (one_in, random) = self.damage.one_in.as_mut()?;
        (random.below(*one_in) == 0).then(|| match random.below(256) as u8 {
            b'?' | b'!' | b'~' | 0x18 | 0x80..=0xBF | 0xFB | 0xFD => Fault::Replaced(b'x'),
            other => Fault::Replaced(other),
        })
    }

    fn receive(&mut self, now: u64) -> Option<u8> {
        let is_out = self.on_the_way.front().is_some_and(|(due, _)| *due <= now);
        is_out.then(|| self.on_the_way.pop_front())?.map(|(_, byte)| byte)
    }
}

/// A plotter at the other end of a line that corrupts bytes.
pub struct NoisyLine {
    /// The plotter.
    pub bench: Bench,
    towards: Wire,
    back: Wire,
    /// The time since the start in microseconds.
    now: u64,
    began: Instant,
}

impl NoisyLine {
    /// Puts a plotter that has sent its greeting behind a line with these faults in each direction.
    pub fn new(mut bench: Bench, towards: Damage, back: Damage) -> Self {
        bench.heard();
        let wire = |damage| Wire { damage, ..Wire::default() };
        let (towards, back) = (wire(towards), wire(back));
        Self { bench, towards, back, now: 0, began: Instant::now() }
    }

    /// All bytes that the client and the plotter sent, before any fault.
    pub fn sent(&self) -> [&[u8]; 2] {
        [&self.towards.sent, &self.back.sent]
    }

    /// The simulated time since the start in seconds.
    pub fn seconds(&self) -> f64 {
        self.now as f64 / 1e6
    }

    /// All moves with the pen down so far.
    pub fn inked(&self) -> BTreeSet<(PagePoint, PagePoint)> {
        let settings = *self.bench.plotter.machine().settings();
        event_checker::check_pins_in_alarms(&self.bench.board.trace().changes(), &settings).inked
    }

    /// Lets a millisecond pass.
    fn pass(&mut self) {
        let end = self.now + 1000;
        while self.now < end {
            self.now += BYTE_TIME;
            if let Some(byte) = self.towards.receive(self.now) {
                self.bench.board.receive(&[byte]);
            }
            self.work();
        }
        self.bench.board.wait();
        self.work();
    }

    fn work(&mut self) {
        // Work that waits for the machine continues when time has passed.
        for _ in 0..8 {
            if !self.bench.plotter.poll(&mut self.bench.board) {
                break;
            }
        }
        self.back.send(self.now, &self.bench.board.take_sent());
    }
}

impl Link for NoisyLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.towards.send(self.now, bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let end = self.now + timeout.as_micros() as u64;
        if self.now > LONGEST {
            return Err(io::Error::other("the job does not end"));
        }
        loop {
            let mut count = 0;
            while let Some(slot) = buffer.get_mut(count)
                && let Some(byte) = self.back.receive(self.now)
            {
                *slot = byte;
                count += 1;
            }
            if count > 0 || self.now >= end {
                return Ok(count);
            }
            self.pass();
        }
    }

    fn change_pen(&mut self, _pen: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn now(&self) -> Instant {
        self.began + Duration::from_micros(self.now)
    }
}
