//! The kinds of things that the soak does to a board.

use super::{ANSWER_LIMIT, Board, DamagedLine, ERASE_LIMIT, Job, STOP, reported};
use std::collections::BTreeSet;
use std::error::Error;
use std::time::Duration;

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
            self.board.emulator().send(&[if byte == STOP { b'\n' } else { byte }])?;
            if self.random.once_in(50) {
                self.board.emulator().receive(&mut buffer, Duration::from_millis(1))?;
            }
        }
        self.counts.noise += count;
        self.recover()?;
        // What is left on the line is none of the next sender's answers.
        while self.board.emulator().receive(&mut buffer, Duration::from_millis(300))? > 0 {}
        self.heard.clear();
        Ok(())
    }

    /// Leaves in the middle of a line, of an upload, or of a job.
    fn leave(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        self.counts.left += 1;
        let (plot, model) = job.lines.split_last().ok_or("a job")?;
        match self.random.below(3) {
            0 => self.board.emulator().send(b"v 1 2")?,
            1 => {
                self.begin()?;
                let count = self.random.below(model.len() as u64) as usize;
                self.order(&model[..count])?;
            }
            _ => {
                self.take_ink()?;
                self.begin()?;
                self.order(model)?;
                self.board.emulator().send(format!("{plot}\n").as_bytes())?;
                while !self.status()?.starts_with("<Run") {}
                // The board draws on by itself.
                while !self.status()?.starts_with("<Idle") {}
                if self.take_ink()? != job.ink {
                    return Err("a job whose sender has left is another drawing".into());
                }
            }
        }
        self.assert_at_rest()
    }

    /// Draws the job, asks for the status all the time, and compares it with the pins.
    fn ask(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        self.take_ink()?;
        self.begin()?;
        self.order(&job.lines)?;
        self.board.take_waits();
        loop {
            self.follow()?;
            let (x, y) = self.machine.position();
            self.way = BTreeSet::from([[x, y]]);
            let status = self.status()?;
            self.follow()?;
            if status.starts_with("<Idle") {
                break;
            }
            let told = reported(&status).ok_or("no position")?;
            if !self.way.contains(&told) {
                return Err(format!("{status} is not on {:?}", self.way).into());
            }
            self.counts.asked += 1;
        }
        let longest = self.board.take_waits().into_iter().max().unwrap_or_default();
        self.counts.longest = self.counts.longest.max(longest);
        if longest >= ANSWER_LIMIT {
            return Err(format!("the status came after {longest:?}").into());
        }
        if self.take_ink()? != job.ink {
            return Err("another drawing".into());
        }
        Ok(())
    }

    /// Saves settings and a job in a flash whose sectors take 400 ms to erase, and asks for the
    /// status all the time.
    fn ask_while_flash_is_erased(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        let Board::Pico(pico) = &mut self.board else { return Ok(()) };
        pico.set_erase_time(Duration::from_millis(400))?;
        self.begin()?;
        let (plot, model) = job.lines.split_last().ok_or("a job")?;
        self.order(model)?;
        self.board.take_waits();
        let travel = format!("$130={}", 300 + self.random.below(100));
        for text in [&travel, plot] {
            self.board.emulator().send(format!("{text}\n").as_bytes())?;
            loop {
                self.board.emulator().send(b"?")?;
                if self.hear()? == "ok" {
                    break;
                }
            }
        }
        while !self.status()?.starts_with("<Run") {}
        let longest = self.board.take_waits().into_iter().max().unwrap_or_default();
        self.counts.longest_in_erase = self.counts.longest_in_erase.max(longest);
        if longest >= ERASE_LIMIT {
            return Err(format!("the status came after {longest:?} while flash was erased").into());
        }
        if let Board::Pico(pico) = &mut self.board {
            pico.set_erase_time(Duration::from_millis(45))?;
        }
        self.recover()
    }

    /// Does one of five kinds of things to the board: draws over a damaged line, makes noise, asks
    /// while flash is erased, leaves, or asks while it draws.
    ///
    /// # Errors
    /// A promise is broken, or the emulator has ended.
    pub fn disturb(&mut self, job: &Job, kind: u64) -> Result<(), Box<dyn Error>> {
        match kind {
            0 => {
                let one_in = [30, 100, 300, 1000][self.random.below(4) as usize];
                self.draw_damaged(job, one_in)
            }
            1 => {
                let count = 200 + self.random.below(2000);
                self.make_noise(count)
            }
            2 => self.ask_while_flash_is_erased(job),
            3 => self.leave(job),
            _ => self.ask(job),
        }
    }

    /// Does one of them, at random.
    ///
    /// # Errors
    /// As [`DamagedLine::disturb`].
    pub fn disturb_at_random(&mut self, job: &Job) -> Result<(), Box<dyn Error>> {
        let kind = [0, 0, 0, 1, 2, 3, 3, 4, 4][self.random.below(9) as usize];
        self.disturb(job, kind)
    }
}
