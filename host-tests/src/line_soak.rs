//! A line that damages bytes in both directions between the client and an emulated board, and a
//! soak that also sends noise, leaves in the middle of things, compares each status with the pins,
//! and measures how long it is waited for.
//!
//! The board draws the same small job again and again. Whatever the line does, a job that the
//! client reports as drawn must have left exactly its ink, at the very places: not one step may be
//! lost over the whole soak.

mod disturb;
mod flood;
mod leave;
mod watched;

pub use disturb::Disturbance;

use crate::damage::damaged;
use crate::emulated_jobs::{Line, bench_like};
use crate::ink::inked;
use crate::noise::STOP;
use crate::random::Random;
use crate::streamed_drawing::StreamedDrawing;
use crate::whole_jobs::job_lines;
use penup::board_table::{BoardRow, PICO};
use penup_client::emulator::{Emulator, Options, Pico, image_path};
use penup_client::link::{Answer, Link};
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_readers::lines::{JobLine, Lines as _};
use std::collections::BTreeSet;
use std::error::Error;
use std::io;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use watched::{Board, WatchedBoard, reported};

/// The longest time to an answer while steps run.
pub const ANSWER_LIMIT: Duration = Duration::from_millis(20);
/// The longest time to an answer while a sector of flash is erased, which nothing does while steps
/// run.
pub const ERASE_LIMIT: Duration = Duration::from_millis(420);
/// The maximum time to write a page of the Pico's flash, which happens behind each stroke.
const SLOWEST_PAGE: Duration = Duration::from_millis(3);
/// A pen that takes little time. Pulses for the servo come every 20 ms, so with less the pins show
/// the pen late.
const QUICK_PEN: [&str; 2] = ["$212=30", "$213=30"];
/// The client asks for the status this often while it draws, so that many are compared.
const OFTEN: Duration = Duration::from_millis(20);
/// Gives a job up.
const ABORT: u8 = 0x18;

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
    /// Senders that left in the middle of a line, of an upload, of a job, and of a drawing that was
    /// sent while it was drawn.
    pub left: [u32; 4],
    /// Statuses that were asked for while steps ran, and compared with the pins.
    pub asked: u32,
    /// Statuses of a machine that drew or held which came while the line damaged bytes, and were
    /// compared with the pins.
    pub asked_in_damage: u32,
    /// The longest time to one of them.
    pub longest: Duration,
    /// The longest time to a status while flash was erased.
    pub longest_in_erase: Duration,
}

/// A board at the end of a line that may damage bytes.
pub struct DamagedLine {
    row: &'static BoardRow,
    watched: WatchedBoard,
    /// One byte in this many is damaged; `None` for none.
    one_in: Option<u64>,
    random: Random,
    /// What the client has not been given yet.
    heard: Vec<u8>,
    /// The promise that was broken while the client listened. The client may have overheard it.
    broken: Option<String>,
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
        let mut line = Self {
            row,
            watched: WatchedBoard::new(board),
            one_in: None,
            random: Random::new(seed),
            heard: Vec::new(),
            broken: None,
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

    /// Returns the next line of the board, past the damage.
    fn hear(&mut self) -> Result<String, Box<dyn Error>> {
        loop {
            if let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                return Ok(String::from_utf8_lossy(&line).trim().to_owned());
            }
            let mut buffer = [0; 256];
            let count = self.watched.receive(&mut buffer, Duration::from_secs(120))?;
            if count == 0 {
                return Err("the board is silent".into());
            }
            self.heard.extend_from_slice(&buffer[..count]);
        }
    }

    /// Asks for the status, past the damage.
    fn status(&mut self) -> Result<String, Box<dyn Error>> {
        self.watched.send(b"?")?;
        loop {
            let line = self.hear()?;
            if line.starts_with('<') {
                return Ok(line);
            }
        }
    }

    /// Gives up whatever the board does, waits until it is idle, and checks where it is.
    fn recover(&mut self) -> Result<(), Box<dyn Error>> {
        self.come_to_rest()?;
        self.assert_at_rest()
    }

    /// Gives up whatever the board does, and waits until it is idle.
    fn come_to_rest(&mut self) -> Result<(), Box<dyn Error>> {
        self.watched.send(&[b'\n', ABORT])?;
        let begun = Instant::now();
        loop {
            let status = self.status()?;
            if status.starts_with("<Idle") {
                return Ok(());
            }
            if status.starts_with("<Alarm") {
                self.watched.send(b"$X\n")?;
            }
            if begun.elapsed() > Duration::from_secs(300) {
                return Err(format!("the machine does not come to rest: {status}").into());
            }
        }
    }

    /// Checks that the idle machine is where it says.
    fn assert_at_rest(&mut self) -> Result<(), Box<dyn Error>> {
        let status = self.status()?;
        let at = self.watched.position()?;
        if reported(&status) == Some(at) {
            Ok(())
        } else {
            Err(format!("{status} at {at:?}").into())
        }
    }

    /// Draws the job by the client's sender. Returns whether it was drawn; an error of the client
    /// is none here.
    fn draw(&mut self, job: &Job) -> Result<bool, Box<dyn Error>> {
        self.watched.take_ink()?;
        let interrupt = AtomicBool::new(false);
        let timeouts = Timeouts { query: OFTEN, ..Timeouts::default() };
        let drawn = Sender::open(self, timeouts, &interrupt).and_then(|mut sender| {
            let drawn = sender.stream(&job.sent, &mut Quiet).and_then(|()| sender.plot(&mut Quiet));
            sender.end();
            drawn
        });
        match drawn {
            Ok(()) => {
                let (ink, job) = (self.watched.take_ink()?, &job.ink);
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
            self.watched.send(format!("{text}\n").as_bytes())?;
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

    /// Passes an error on by way of the client, and notes it.
    fn note<T>(&mut self, outcome: Result<T, Box<dyn Error>>) -> io::Result<T> {
        outcome.map_err(|error| {
            self.broken.get_or_insert_with(|| error.to_string());
            io::Error::other(error.to_string())
        })
    }

    /// Reads what is said until nothing is, because it is none of the next sender's answers.
    fn hear_out(&mut self) -> Result<(), Box<dyn Error>> {
        let mut buffer = [0; 256];
        while self.watched.receive(&mut buffer, Duration::from_millis(300))? > 0 {}
        self.heard.clear();
        Ok(())
    }

    /// Begins a conversation, whatever the last sender has left, and clears the model.
    fn begin(&mut self) -> Result<(), Box<dyn Error>> {
        self.watched.send(&[ABORT])?;
        while !self.hear()?.starts_with("Grbl") {}
        // Before the board reads the second line, it answers all questions before the first one.
        self.order(&["$clear".to_owned(), "$clear".to_owned()])?;
        self.watched.forget_questions();
        Ok(())
    }
}

impl Link for DamagedLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = self.damage(bytes);
        let sent = self.watched.send(&bytes);
        self.note(sent)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        // A doubled byte needs a place.
        let most = buffer.len() / 2;
        let heard = if self.heard.is_empty() {
            let mut heard = vec![0; most];
            let judged = self.watched.judged;
            let received = self.watched.receive(&mut heard, timeout);
            let count = self.note(received)?;
            if self.one_in.is_some() {
                self.counts.asked_in_damage += self.watched.judged - judged;
            }
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

/// A job that is drawn again and again.
pub struct Job {
    /// Its lines, the last of which is `$plot`.
    lines: Vec<String>,
    /// The lines that the client's sender delivers before it plots.
    sent: Vec<JobLine>,
    /// The ink of the host.
    ink: BTreeSet<[i32; 2]>,
    /// A drawing as strokes that are sent while they are drawn, and its ink, if the board takes
    /// strokes.
    streamed: Option<(StreamedDrawing, BTreeSet<[i32; 2]>)>,
}

impl Job {
    /// A small job for a board.
    ///
    /// # Panics
    /// Panics if the host refuses a line.
    pub fn for_board(row: &'static BoardRow) -> Self {
        let lines = job_lines("interpen.obj", &["$page=30x30", "$margin=3"]);
        let pen = QUICK_PEN.map(str::to_owned);
        let model = lines.iter().filter(|line| *line != "$plot").cloned();
        let sent = ["$clear".to_owned()].into_iter().chain(model).map(JobLine::command).collect();
        let streamed = (row == &PICO).then(|| {
            // It must have several lines of strokes.
            let lines = job_lines("lattice2.obj", &["$page=25x25", "$margin=3"]);
            let mut drawing = StreamedDrawing::of(&[&pen, &lines[..]].concat());
            let job: Vec<String> = drawing.from(0).in_order().map(|line| line.sent).collect();
            let ink = host_ink(row, drawing.settings.iter().chain(&job));
            (drawing, ink)
        });
        Self { sent, ink: host_ink(row, pen.iter().chain(&lines)), streamed, lines }
    }
}

/// The ink that a board in memory with the memory of `row` leaves.
fn host_ink<'l>(
    row: &'static BoardRow,
    lines: impl IntoIterator<Item = &'l String>,
) -> BTreeSet<[i32; 2]> {
    let mut bench = bench_like(row);
    for line in lines {
        let answer = bench.say(&format!("{line}\n"));
        assert!(answer.ends_with("ok\n"), "{line}: {answer}");
    }
    bench.finish();
    let (points, _) = inked(&bench);
    points.into_iter().collect()
}
