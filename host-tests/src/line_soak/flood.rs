//! Megabytes of noise.

use super::{ABORT, DamagedLine};
use crate::noise::{FEW, PIECE, some};
use penup_job::protocol::{LAST_NUMBER, numbered};
use std::error::Error;
use std::time::Duration;

/// How often [`FEW`] bytes are sent at once.
const AT_ONCE: u64 = 10;

/// What came of noise.
#[derive(Debug, Clone, Copy, Default)]
pub struct Flood {
    /// Steps that the machine has made.
    pub steps: u64,
    /// Pieces that have changed a setting, such as the direction of a motor, so that the pins tell
    /// no position any more. The board is started anew behind them.
    pub set: u32,
}

impl DamagedLine {
    /// Sends so many bytes of noise. Behind each piece of it the board is brought to rest, answers
    /// `?`, and knows where the pins have brought it.
    ///
    /// # Errors
    /// A promise is broken, or the emulator has ended.
    pub fn flood(&mut self, count: u64) -> Result<Flood, Box<dyn Error>> {
        let (mut left, mut flood) = (count, Flood::default());
        self.begin()?;
        let settings = self.settings()?;
        while left > 0 {
            let before = self.watched.steps;
            let piece = left.min(PIECE);
            left -= piece;
            // Noise may change how a position is told.
            self.watched.compares = false;
            // The noise comes to a machine that moves.
            let [x, y] = [(); 2].map(|()| self.random.below(60));
            self.watched.send(format!("G0X{x}Y{y}\n").as_bytes())?;
            self.send_noise(piece)?;
            self.wait_for_end_of_noise()?;
            self.come_to_rest()?;
            self.hear_out()?;
            self.begin()?;
            if self.settings()? != settings {
                flood.set += 1;
                let started = Self::start(self.row, self.random.next_number())?;
                *self = Self { counts: self.counts, ..started };
                self.begin()?;
                continue;
            }
            self.watched.compares = true;
            self.assert_at_rest()?;
            flood.steps += self.watched.steps - before;
        }
        Ok(flood)
    }

    /// Sends so many bytes of noise, and reads what is said meanwhile.
    fn send_noise(&mut self, count: u64) -> Result<(), Box<dyn Error>> {
        let mut buffer = [0; 4096];
        for _ in 0..count.div_ceil(FEW * AT_ONCE) {
            let bytes: Vec<u8> = (0..AT_ONCE).flat_map(|_| some(&mut self.random)).collect();
            self.watched.send(&bytes)?;
            self.counts.noise += bytes.len() as u64;
            while self.watched.receive(&mut buffer, Duration::ZERO)? > 0 {}
        }
        Ok(())
    }

    /// Waits until the board has taken all the noise: until it answers a line with a number. The
    /// noise may have questions, whose answers come before.
    fn wait_for_end_of_noise(&mut self) -> Result<(), Box<dyn Error>> {
        let mut buffer = [0; 4096];
        for number in 1_000..1_100 {
            let question = numbered(Some(number), LAST_NUMBER);
            self.watched.send(&[b"\n", &[ABORT][..], question.as_bytes(), b"\n"].concat())?;
            let answer = format!(" N{number}*");
            let mut heard = Vec::new();
            loop {
                let count = self.watched.receive(&mut buffer, Duration::from_secs(1))?;
                heard.extend_from_slice(&buffer[..count]);
                if String::from_utf8_lossy(&heard).contains(&answer) {
                    return Ok(());
                }
                // The question, or its answer, was lost.
                if count == 0 {
                    break;
                }
                let rest = heard.len().saturating_sub(100);
                heard.drain(..rest);
            }
        }
        Err("the board does not answer behind noise".into())
    }

    /// The settings, as the board lists them.
    fn settings(&mut self) -> Result<Vec<String>, Box<dyn Error>> {
        self.watched.send(b"$$\n")?;
        let mut settings = Vec::new();
        loop {
            match self.hear()? {
                line if line == "ok" => return Ok(settings),
                line if line.starts_with("error") => return Err(line.into()),
                line => settings.push(line),
            }
        }
    }
}
