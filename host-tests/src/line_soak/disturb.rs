//! The kinds of things that the soak does to a board.

use super::leave::Middle;
use super::{ANSWER_LIMIT, Board, DamagedLine, ERASE_LIMIT, Job};
use crate::noise::STOP;
use penup::board_table::{BoardRow, PICO};
use std::error::Error;
use std::time::Duration;

/// What the soak does to a board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disturbance {
    /// Draws over a line that damages one byte in so many.
    DamagedLine(u64),
    /// Sends random bytes.
    Noise,
    /// Asks for the status while flash is erased.
    Erasures,
    /// Sends something, and is gone in the middle of it.
    Gone(Middle),
    /// Asks for the status all the time while the board draws.
    Questions,
}

/// What a sender may leave in the middle of.
const MIDDLES: [Middle; 4] = [Middle::Line, Middle::Upload, Middle::Stream, Middle::Job];

/// The disturbances, each once.
const ALL: [Disturbance; 9] = [
    Disturbance::DamagedLine(30),
    Disturbance::DamagedLine(300),
    Disturbance::Noise,
    Disturbance::Erasures,
    Disturbance::Gone(Middle::Line),
    Disturbance::Gone(Middle::Upload),
    Disturbance::Gone(Middle::Stream),
    Disturbance::Gone(Middle::Job),
    Disturbance::Questions,
];

impl Disturbance {
    /// All that a board can be disturbed by, each once: only the Pico writes to a flash and takes
    /// strokes.
    pub fn all(row: &'static BoardRow) -> impl Iterator<Item = Self> {
        let is_of_pico = |it: &Self| matches!(it, Self::Erasures | Self::Gone(Middle::Stream));
        ALL.into_iter().filter(move |it| row == &PICO || !is_of_pico(it))
    }
}

impl DamagedLine {
    /// Draws the job over a line that damages one byte in so many.
    fn draw_damaged(&mut self, job: &Job, one_in: u64) -> Result<(), Box<dyn Error>> {
        self.damage_one_in(Some(one_in));
        let drawn = self.draw(job)?;
        self.damage_one_in(None);
        if drawn { self.assert_at_rest() } else { self.recover() }
    }

    /// Sends so many random bytes, reads what is said meanwhile, and waits until the machine rests.
    fn make_noise(&mut self, count: u64) -> Result<(), Box<dyn Error>> {
        let mut buffer = [0; 256];
        for _ in 0..count {
            let byte = self.random.below(256) as u8;
            self.watched.send(&[if byte == STOP { b'\n' } else { byte }])?;
            if self.random.once_in(50) {
                self.watched.receive(&mut buffer, Duration::from_millis(1))?;
            }
        }
        self.counts.noise += count;
        self.recover()?;
        self.hear_out()
    }

    /// Draws the job, asks for the status all the time, and compares it with the pins.
    fn ask(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        self.watched.take_ink()?;
        self.begin()?;
        self.order(&job.lines)?;
        self.watched.board.take_waits();
        // Each status is compared with the pins where it comes.
        while !self.status()?.starts_with("<Idle") {
            self.counts.asked += 1;
        }
        let longest = self.watched.board.take_waits().into_iter().max().unwrap_or_default();
        self.counts.longest = self.counts.longest.max(longest);
        if longest >= ANSWER_LIMIT {
            return Err(format!("the status came after {longest:?}").into());
        }
        if self.watched.take_ink()? != job.ink {
            return Err("another drawing".into());
        }
        Ok(())
    }

    /// Saves settings and a job in a flash whose sectors take 400 ms to erase, and asks for the
    /// status all the time.
    fn ask_while_flash_is_erased(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        let Board::Pico(pico) = &mut self.watched.board else { return Ok(()) };
        pico.set_erase_time(Duration::from_millis(400))?;
        self.begin()?;
        let (plot, model) = job.lines.split_last().ok_or("a job")?;
        self.order(model)?;
        self.watched.board.take_waits();
        let travel = format!("$130={}", 300 + self.random.below(100));
        for text in [&travel, plot] {
            self.watched.send(format!("{text}\n").as_bytes())?;
            loop {
                self.watched.send(b"?")?;
                if self.hear()? == "ok" {
                    break;
                }
            }
        }
        while !self.status()?.starts_with("<Run") {}
        let longest = self.watched.board.take_waits().into_iter().max().unwrap_or_default();
        self.counts.longest_in_erase = self.counts.longest_in_erase.max(longest);
        if longest >= ERASE_LIMIT {
            return Err(format!("the status came after {longest:?} while flash was erased").into());
        }
        if let Board::Pico(pico) = &mut self.watched.board {
            pico.set_erase_time(Duration::from_millis(45))?;
        }
        self.recover()
    }

    /// Disturbs the board.
    ///
    /// # Errors
    /// A promise is broken, or the emulator has ended.
    pub fn disturb(&mut self, job: &mut Job, by: Disturbance) -> Result<(), Box<dyn Error>> {
        let done = match by {
            Disturbance::DamagedLine(one_in) => self.draw_damaged(job, one_in),
            Disturbance::Noise => {
                let count = 200 + self.random.below(2000);
                self.make_noise(count)
            }
            Disturbance::Erasures => self.ask_while_flash_is_erased(job),
            Disturbance::Gone(middle) => self.leave(job, middle),
            Disturbance::Questions => self.ask(job),
        };
        match self.broken.take() {
            Some(broken) => Err(format!("{by:?}: {broken}").into()),
            None => done.map_err(|error| format!("{by:?}: {error}").into()),
        }
    }

    /// Disturbs it at random.
    ///
    /// # Errors
    /// As [`DamagedLine::disturb`].
    pub fn disturb_at_random(&mut self, job: &mut Job) -> Result<(), Box<dyn Error>> {
        let by = match self.random.below(9) {
            0..3 => Disturbance::DamagedLine(self.random.one_of(&[30, 100, 300, 1000])),
            3 => Disturbance::Noise,
            4 => Disturbance::Erasures,
            5..7 => Disturbance::Gone(self.random.one_of(&MIDDLES)),
            _ => Disturbance::Questions,
        };
        self.disturb(job, by)
    }
}
