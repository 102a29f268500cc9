//! A board whose every status is compared with its pins.
//!
//! The statuses are those that the board says, before the line behind it damages any byte. So it
//! does not matter who has asked for one, and whether it arrives.

use crate::ink::Ink;
use penup_client::emulator::{EmulatedBoard, Emulator, Machine, Pico};
use std::collections::{BTreeSet, VecDeque};
use std::error::Error;
use std::time::Duration;

/// A board of either kind, whose waits can be read.
pub(super) enum Board {
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
    pub fn take_waits(&mut self) -> Vec<Duration> {
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

/// A board whose statuses are compared with its pins.
pub(super) struct WatchedBoard {
    pub board: Board,
    ink: Ink,
    machine: Machine,
    /// Where the machine was, in steps, since the first of the questions that may not be answered
    /// yet. The last position is where it is.
    way: Vec<[i32; 2]>,
    /// For each of these questions, which position of the way was the last before it. The board
    /// may answer several questions by one status, and each status answers one at least. So as many
    /// of them are answered as statuses have come, or more.
    asked: VecDeque<usize>,
    /// The line that the board has begun to say.
    line: Vec<u8>,
    /// The last status.
    status: String,
    /// Whether statuses are compared. Noise may change the settings by which a position is told.
    pub compares: bool,
    /// How many steps the machine has made.
    pub steps: u64,
    /// How many statuses of a machine that draws were compared.
    pub judged: u32,
}

impl WatchedBoard {
    /// Takes a board that has not moved, and whose last line is complete.
    pub fn new(board: Board) -> Self {
        Self {
            board,
            ink: Ink::default(),
            machine: Machine::default(),
            way: vec![[0, 0]],
            asked: VecDeque::new(),
            line: Vec::new(),
            status: String::new(),
            compares: true,
            steps: 0,
            judged: 0,
        }
    }

    /// Sends bytes to the board.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
        // Grbl's question, and those of grblHAL.
        let questions = bytes.iter().filter(|byte| matches!(byte, b'?' | 0x80 | 0x87)).count();
        if questions > 0 {
            self.follow()?;
            let last = self.way.len() - 1;
            self.asked.extend(std::iter::repeat_n(last, questions));
        }
        Ok(self.board.emulator().send(bytes)?)
    }

    /// Waits for bytes, and returns how many came. A status among them is compared with the pins.
    ///
    /// # Errors
    /// It tells another position than the pins, nobody has asked for it, or the emulator has ended.
    pub fn receive(
        &mut self,
        buffer: &mut [u8],
        timeout: Duration,
    ) -> Result<usize, Box<dyn Error>> {
        let count = self.board.emulator().receive(buffer, timeout)?;
        for &byte in &buffer[..count] {
            self.line.push(byte);
            if byte != b'\n' {
                continue;
            }
            let line = std::mem::take(&mut self.line);
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            // A status that an abort cuts short has no end.
            if line.starts_with('<') && line.ends_with('>') {
                self.judge(line)?;
            }
        }
        Ok(count)
    }

    fn judge(&mut self, status: String) -> Result<(), Box<dyn Error>> {
        self.follow()?;
        let Some(from) = self.asked.pop_front() else {
            return Err(format!("nobody has asked for {status}").into());
        };
        if !self.compares {
            self.status = status;
            self.forget_way();
            return Ok(());
        }
        let told = reported(&status).ok_or_else(|| format!("no position in {status}"))?;
        if !self.way[from..].contains(&told) {
            let way: BTreeSet<_> = self.way[from..].iter().collect();
            return Err(format!("{status} is not on {way:?}").into());
        }
        self.judged += u32::from(status.starts_with("<Run") || status.starts_with("<Hold"));
        self.status = status;
        self.forget_way();
        Ok(())
    }

    /// Forgets what was before the first question that may not be answered yet.
    fn forget_way(&mut self) {
        let first = self.asked.front().copied().unwrap_or(self.way.len() - 1);
        self.way.drain(..first);
        self.asked.iter_mut().for_each(|last| *last -= first);
    }

    /// From now on, takes all questions so far for answered.
    pub fn forget_questions(&mut self) {
        self.asked.clear();
        self.forget_way();
    }

    /// Follows the pins up to now.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn follow(&mut self) -> Result<(), Box<dyn Error>> {
        for change in self.board.emulator().pin_changes()? {
            self.ink.change(change);
            self.machine.change(change);
            let (x, y) = self.machine.position();
            if self.way.last() != Some(&[x, y]) {
                self.way.push([x, y]);
                self.steps += 1;
            }
        }
        if self.asked.is_empty() {
            self.forget_way();
        }
        Ok(())
    }

    /// The points of ink since the last call, each once.
    ///
    /// # Errors
    /// As [`WatchedBoard::follow`].
    pub fn take_ink(&mut self) -> Result<BTreeSet<[i32; 2]>, Box<dyn Error>> {
        self.follow()?;
        let points = self.ink.points().iter().copied().collect();
        self.ink.forget();
        Ok(points)
    }

    /// Where the pins have brought the machine, in steps.
    ///
    /// # Errors
    /// As [`WatchedBoard::follow`].
    pub fn position(&mut self) -> Result<[i32; 2], Box<dyn Error>> {
        self.follow()?;
        self.ink.points();
        Ok(self.ink.position())
    }

    /// Whether the machine draws or holds according to the last status.
    pub fn is_drawing(&self) -> bool {
        self.status.starts_with("<Run") || self.status.starts_with("<Hold")
    }
}

/// The position in steps that a status reports for a machine of 80 steps per millimetre.
pub(super) fn reported(status: &str) -> Option<[i32; 2]> {
    let (_, rest) = status.split_once("MPos:")?;
    let mut numbers = rest.split([',', '|', '>']).map(str::parse::<f64>);
    let steps = |millimetres: f64| (millimetres * 80.0).round() as i32;
    Some([steps(numbers.next()?.ok()?), steps(numbers.next()?.ok()?)])
}

#[cfg(test)]
mod tests {
    use super::reported;

    #[test]
    fn a_position_is_read_in_steps() {
        assert_eq!(reported("<Run|MPos:1.500,-0.013,0.000|Left:3>"), Some([120, -1]));
        assert_eq!(reported("<Idle|MPos:0.000,2.000>"), Some([0, 160]));
        assert_eq!(reported("<Idle|WPos:0.000,2.000>"), None);
    }
}
