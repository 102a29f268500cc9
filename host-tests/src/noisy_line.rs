//! A serial line at 115200 baud that damages bytes, between the client and a plotter of plain
//! memory.
//!
//! Time passes only in [`NoisyLine::receive`](Link::receive), so what the client waits for costs
//! no time of the test, and a run is the same every time.

use crate::event_checker;
use crate::whole_jobs::Bench;
use penup::drawing::PagePoint;
use penup::plotter::Board;
use penup_client::link::Link;
use std::collections::{BTreeSet, VecDeque};
use std::io;
use std::time::{Duration, Instant};

/// Numbers that look random, the same in every run.
#[derive(Debug, Clone)]
pub struct Random(pub u64);

impl Random {
    /// One of 0 to `bound` - 1.
    pub fn below(&mut self, bound: u64) -> u64 {
        // Knuth's MMIX.
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) % bound
    }
}

/// What becomes of a byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It and as many after it as make up this number are lost.
    Lost(usize),
    /// It comes twice.
    Doubled,
    /// Another byte comes in its place.
    Replaced(u8),
    /// One of its bits, from 0, is another one.
    Flipped(u8),
    /// It and all after it come so many milliseconds later.
    Late(u64),
}

/// Which bytes of one direction are damaged.
#[derive(Debug, Clone, Default)]
pub struct Damage {
    /// Single faults: the number of the byte, from 0, and what becomes of it.
    pub faults: Vec<(usize, Fault)>,
    /// Of so many bytes one is damaged, chosen by these numbers; `None` for no such damage.
    pub one_in: Option<(u64, Random)>,
}

/// Microseconds that a byte takes, rounded up: ten bits at 115200 baud.
const BYTE_TIME: u64 = 87;

/// A job that has not ended after so many microseconds hangs.
const LONGEST: u64 = 3600 * 1_000_000;

/// One direction.
#[derive(Debug, Default)]
struct Wire {
    damage: Damage,
    /// All bytes that were sent, as they were sent.
    sent: Vec<u8>,
    lost: usize,
    /// Bytes on their way, with the time in microseconds when they come out.
    on_the_way: VecDeque<(u64, u8)>,
    /// When the last of them comes out.
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

    /// A byte that does not act at once, now and then.
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

/// A plotter at the other end of a line that damages bytes.
pub struct NoisyLine {
    /// The plotter.
    pub bench: Bench,
    towards: Wire,
    back: Wire,
    /// Microseconds since it was switched on.
    now: u64,
    began: Instant,
}

impl NoisyLine {
    /// A plotter that was switched on and greeted, behind a line with this damage on the way
    /// there and back.
    pub fn new(mut bench: Bench, towards: Damage, back: Damage) -> Self {
        bench.heard();
        let wire = |damage| Wire { damage, ..Wire::default() };
        let (towards, back) = (wire(towards), wire(back));
        Self { bench, towards, back, now: 0, began: Instant::now() }
    }

    /// All bytes that the client sent, and all that the plotter did, as they were sent.
    pub fn sent(&self) -> [&[u8]; 2] {
        [&self.towards.sent, &self.back.sent]
    }

    /// Seconds of the line's time since it was switched on.
    pub fn seconds(&self) -> f64 {
        self.now as f64 / 1e6
    }

    /// Every move with the pen down so far.
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
        // What waits for the machine goes on when time has passed.
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

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        let end = self.now + patience.as_micros() as u64;
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

    fn change_pen(&mut self, _pen: u8) -> io::Result<bool> {
        Ok(true)
    }

    fn now(&self) -> Instant {
        self.began + Duration::from_micros(self.now)
    }
}
