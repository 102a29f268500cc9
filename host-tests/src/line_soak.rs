//! A line that damages bytes in both directions between the client and an emulated board, and a
//! soak that also sends noise, leaves in the middle of things, and measures how long the status is
//! waited for.
//!
//! The board draws the same small job again and again. Whatever the line does, a job that the
//! client reports as drawn must have left exactly its ink, at the very places: not one step may be
//! lost over the whole soak.

mod disturb;

use crate::damage::damaged;
use crate::emulated_jobs::{Line, bench_like};
use crate::ink::{Ink, inked};
use crate::random::Random;
use crate::whole_jobs::job_lines;
use penup::board_table::{BoardRow, PICO};
use penup_client::emulator::{EmulatedBoard, Emulator, Machine, Options, Pico, image_path};
use penup_client::link::{Answer, Link};
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_readers::lines::JobLine;
use std::collections::BTreeSet;
use std::error::Error;
use std::io;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// The longest time to an answer while steps run.
pub const ANSWER_LIMIT: Duration = Duration::from_millis(20);
/// The longest time to an answer while a sector of flash is erased, which nothing does while steps
/// run.
pub const ERASE_LIMIT: Duration = Duration::from_millis(420);
/// The maximum time to write a page of the Pico's flash, which happens behind each stroke.
const SLOWEST_PAGE: Duration = Duration::from_millis(3);
/// The emergency stop, after which nobody knows the position. The line makes none.
const STOP: u8 = 0xFD;
/// A pen that takes little time. Pulses for the servo come every 20 ms, so with less the pins show
/// the pen late.
const QUICK_PEN: [&str; 2] = ["$212=30", "$213=30"];
/// Gives a job up.
const ABORT: u8 = 0x18;

/// A board of either kind, whose waits can be read.
enum Board {
    Pico(Box<Pico>),
    Lm3s6965(Box<Emulator>),
}

impl Board {
    fn emulator(&mut self) -> &mut dyn EmulatedBoard {
        match self {
            Self::Pico(pico) => pico.as_mut(),
            Self::Lm3s6965(emulator) => emulator.as_mut(),
        }
    }

    /// How long each status since the last call was waited for, on the board's clock.
    fn take_waits(&mut self) -> Vec<Duration> {
        match self {
            Self::Pico(pico) => {
                let [first_bytes, _] = pico.take_status_waits();
                first_bytes
            }
            Self::Lm3s6965(emulator) => {
                let wait = |line: &String| {
                    let (_, rest) = line.split_once("status after ")?;
                    rest.split(' ').next()?.parse().ok().map(Duration::from_micros)
                };
                emulator.log_lines().iter().filter_map(wait).collect()
            }
        }
    }
}

/// What was done to a board.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Jobs that were drawn as they were sent.
    pub drawn: u32,
    /// Jobs that the client gave up with an error.
    pub refused: u32,
    /// Bytes that were damaged.
    pub damaged: u64,
    /// Bytes of noise.
    pub noise: u64,
    /// Senders that left in the middle of a line, of an upload, and of a job.
    pub left: u32,
    /// Statuses that were asked for while steps ran, and compared with the pins.
    pub asked: u32,
    /// The longest time to one of them.
    pub longest: Duration,
    /// The longest time to a status while flash was erased.
    pub longest_in_erase: Duration,
}

/// A board at the end of a line that may damage bytes.
pub struct DamagedLine {
    board: Board,
    /// One byte in this many is damaged; `None` for none.
    one_in: Option<u64>,
    random: Random,
    ink: Ink,
    machine: Machine,
    /// Where the machine was since the last status was asked for, in steps.
    way: BTreeSet<[i32; 2]>,
    /// What the client has not been given yet.
    heard: Vec<u8>,
    /// What has been done so far.
    pub counts: Counts,
}

impl DamagedLine {
    /// Boots a board, and waits for its greeting.
    ///
    /// # Errors
    /// It does not start.
    pub fn start(row: &'static BoardRow, seed: u64) -> Result<Self, Box<dyn Error>> {
        let image = image_path(row.name);
        let board = if row == &PICO {
            let mut pico = Line::to(Box::new(Pico::start(&image)?))?.emulator;
            pico.set_page_time(SLOWEST_PAGE)?;
            Board::Pico(pico)
        } else {
            let started = Emulator::start(&image, Options::default())?;
            Board::Lm3s6965(Line::to(Box::new(started))?.emulator)
        };
        let (random, ink) = (Random::new(seed), Ink::default());
        let mut line = Self {
            board,
            one_in: None,
            random,
            ink,
            machine: Machine::default(),
            way: BTreeSet::new(),
            heard: Vec::new(),
            counts: Counts::default(),
        };
        line.order(&QUICK_PEN.map(str::to_owned))?;
        Ok(line)
    }

    /// From now on, damages one byte in so many.
    pub fn damage_one_in(&mut self, count: Option<u64>) {
        self.one_in = count;
    }

    /// The bytes that arrive: some are lost, doubled, changed in one bit, or replaced.
    fn damage(&mut self, bytes: &[u8]) -> Vec<u8> {
        let fault = |byte: u8, random: &mut Random, arrived: &mut Vec<u8>| {
            let other = match random.below(4) {
                0 => return,
                1 => {
                    arrived.push(byte);
                    byte
                }
                2 => byte ^ 1 << random.below(8),
                _ => random.below(256) as u8,
            };
            arrived.push(if other == STOP { b'x' } else { other });
        };
        let (arrived, count) = damaged(bytes, self.one_in, &mut self.random, fault);
        self.counts.damaged += u64::from(count);
        arrived
    }

    /// Follows the pins up to now.
    fn follow(&mut self) -> Result<(), Box<dyn Error>> {
        for change in self.board.emulator().pin_changes()? {
            self.ink.change(change);
            self.machine.change(change);
            let (x, y) = self.machine.position();
            self.way.insert([x, y]);
        }
        Ok(())
    }

    /// The points of ink since the last call, each once.
    fn take_ink(&mut self) -> Result<BTreeSet<[i32; 2]>, Box<dyn Error>> {
        self.follow()?;
        let points = self.ink.points().iter().copied().collect();
        self.ink.forget();
        Ok(points)
    }

    /// Returns the next line of the board, past the damage.
    fn hear(&mut self) -> Result<String, Box<dyn Error>> {
        loop {
            if let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                return Ok(String::from_utf8_lossy(&line).trim().to_owned());
            }
            let mut buffer = [0; 256];
            let count = self.board.emulator().receive(&mut buffer, Duration::from_secs(120))?;
            if count == 0 {
                return Err("the board is silent".into());
            }
            self.heard.extend_from_slice(&buffer[..count]);
        }
    }

    /// Asks for the status, past the damage.
    fn status(&mut self) -> Result<String, Box<dyn Error>> {
        self.board.emulator().send(b"?")?;
        loop {
            let line = self.hear()?;
            if line.starts_with('<') {
                return Ok(line);
            }
        }
    }

    /// Gives up whatever the board does, and waits until it is idle.
    fn recover(&mut self) -> Result<(), Box<dyn Error>> {
        self.board.emulator().send(&[b'\n', ABORT])?;
        let begun = Instant::now();
        loop {
            let status = self.status()?;
            if status.starts_with("<Idle") {
                break;
            }
            if status.starts_with("<Alarm") {
                self.board.emulator().send(b"$X\n")?;
            }
            if begun.elapsed() > Duration::from_secs(300) {
                return Err(format!("the machine does not come to rest: {status}").into());
            }
        }
        self.assert_at_rest()
    }

    /// Checks that the idle machine is where it says.
    fn assert_at_rest(&mut self) -> Result<(), Box<dyn Error>> {
        let status = self.status()?;
        self.follow()?;
        self.ink.points();
        let at = self.ink.position();
        if reported(&status) == Some(at) {
            Ok(())
        } else {
            Err(format!("{status} at {at:?}").into())
        }
    }

    /// Draws the job by the client's sender. Returns whether it was drawn; an error of the client
    /// is none here.
    fn draw(&mut self, job: &Job) -> Result<bool, Box<dyn Error>> {
        self.take_ink()?;
        let interrupt = AtomicBool::new(false);
        let drawn = Sender::open(self, Timeouts::default(), &interrupt).and_then(|mut sender| {
            let drawn = sender.stream(&job.sent, &mut Quiet).and_then(|()| sender.plot(&mut Quiet));
            sender.end();
            drawn
        });
        match drawn {
            Ok(()) => {
                let (ink, job) = (self.take_ink()?, &job.ink);
                if &ink != job {
                    let (ink, job) = (ink.len(), job.len());
                    return Err(format!("another drawing: {ink} points instead of {job}").into());
                }
                self.counts.drawn += 1;
                Ok(true)
            }
            Err(penup_client::error::Error::Link(error)) => Err(error.into()),
            Err(_) => {
                self.counts.refused += 1;
                Ok(false)
            }
        }
    }

    /// Sends lines one by one, without numbers.
    fn order(&mut self, lines: &[String]) -> Result<(), Box<dyn Error>> {
        for text in lines {
            self.board.emulator().send(format!("{text}\n").as_bytes())?;
            loop {
                let answer = self.hear()?;
                if answer == "ok" {
                    break;
                }
                if answer.starts_with("error") {
                    return Err(format!("{text}: {answer}").into());
                }
            }
        }
        Ok(())
    }

    /// Begins a conversation, whatever the last sender has left, and clears the model.
    fn begin(&mut self) -> Result<(), Box<dyn Error>> {
        self.board.emulator().send(&[ABORT])?;
        while !self.hear()?.starts_with("Grbl") {}
        self.order(&["$clear".to_owned()])
    }
}

impl Link for DamagedLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = self.damage(bytes);
        self.board.emulator().send(&bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        // A doubled byte needs a place.
        let most = buffer.len() / 2;
        let heard = if self.heard.is_empty() {
            let mut heard = vec![0; most];
            let count = self.board.emulator().receive(&mut heard, timeout)?;
            heard.truncate(count);
            heard
        } else {
            self.heard.drain(..most.min(self.heard.len())).collect()
        };
        let bytes = self.damage(&heard);
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    /// A damaged byte may have been a hold.
    fn ask_to_resume(&mut self, _: bool) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }
}

/// The position in steps that a status reports for a machine of 80 steps per millimetre.
fn reported(status: &str) -> Option<[i32; 2]> {
    let (_, rest) = status.split_once("MPos:")?;
    let mut numbers = rest.split([',', '|', '>']).map(str::parse::<f64>);
    let steps = |millimetres: f64| (millimetres * 80.0).round() as i32;
    Some([steps(numbers.next()?.ok()?), steps(numbers.next()?.ok()?)])
}

/// A job that is drawn again and again.
pub struct Job {
    /// Its lines, the last of which is `$plot`.
    lines: Vec<String>,
    /// The lines that the client's sender delivers before it plots.
    sent: Vec<JobLine>,
    /// The ink of the host.
    ink: BTreeSet<[i32; 2]>,
}

impl Job {
    /// A small job for a board.
    ///
    /// # Panics
    /// Panics if the host refuses a line.
    pub fn for_board(row: &'static BoardRow) -> Self {
        let lines = job_lines("interpen.obj", &["$page=30x30", "$margin=3"]);
        let mut bench = bench_like(row);
        for line in QUICK_PEN.iter().copied().chain(lines.iter().map(String::as_str)) {
            let answer = bench.say(&format!("{line}\n"));
            assert!(answer.ends_with("ok\n"), "{line}: {answer}");
        }
        bench.finish();
        let (points, _) = inked(&bench);
        let model = lines.iter().filter(|line| *line != "$plot").cloned();
        let sent = ["$clear".to_owned()].into_iter().chain(model).map(JobLine::command).collect();
        Self { sent, ink: points.into_iter().collect(), lines }
    }
}
