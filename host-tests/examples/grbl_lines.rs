//! Sends the lines of Grbl 1.1 (`tests/grbl/lines.txt`) to an emulated board, `lm3s6965` or `pico`,
//! and prints how many are answered as Grbl does, and those that are not answered as listed.
//! `cargo xtask senders` runs it.
//!
//! The emulated time passes on its own, so rows that need the machine to be moving are left to the
//! test on the host.

use std::error::Error;
use std::time::{Duration, Instant};

use penup::board_table::BOARDS;
use penup_client::emulator::{EmulatedBoard, boot};
use penup_host_tests::grbl_lines::{agrees, rows};

/// How long a board is silent that has nothing more to say.
const SILENCE: Duration = Duration::from_millis(100);
/// How long a line may take.
const TIMEOUT: Duration = Duration::from_secs(30);

/// An emulated board, and what it has said.
struct Line {
    board: Box<dyn EmulatedBoard>,
    heard: String,
}

impl Line {
    /// Listens until `is_over`, or nothing comes for a while and `may_end`.
    fn listen(
        &mut self,
        is_over: impl Fn(&str) -> bool,
        may_end: bool,
    ) -> Result<(), Box<dyn Error>> {
        let (began, mut buffer) = (Instant::now(), [0; 256]);
        while !is_over(&self.heard) && began.elapsed() < TIMEOUT {
            let count = self.board.receive(&mut buffer, SILENCE)?;
            self.board.pin_changes()?;
            let bytes = buffer.get(..count).unwrap_or_default();
            self.heard += &String::from_utf8_lossy(bytes).replace('\r', "");
            if count == 0 && may_end {
                break;
            }
        }
        Ok(())
    }

    /// Sends a line and waits for its answer.
    fn say(&mut self, line: &str) -> Result<String, Box<dyn Error>> {
        self.heard.clear();
        self.board.send(line.as_bytes())?;
        self.listen(|heard| answers(heard) > 0, false)?;
        Ok(std::mem::take(&mut self.heard))
    }

    /// Brings the board into the state that it has when it is switched on.
    fn reset(&mut self) -> Result<(), Box<dyn Error>> {
        for _ in 0..2 {
            self.heard.clear();
            self.board.send(b"\x18")?;
            self.listen(|heard| heard.contains("Grbl 1.1"), false)?;
            self.listen(|_| false, true)?;
            let answer = self.say("$X\n")?;
            if !answer.contains("error") {
                let answer = self.say("$RST=*\n")?;
                if answer.contains("ok") {
                    break;
                }
            }
        }
        self.listen(|_| false, true)?;
        // The origin is where the machine stands.
        self.say("G53 G0 X0 Y0\n")?;
        self.say("$J=G53 Z0 F1000\n")?;
        self.say("G4 P0\n")?;
        self.heard.clear();
        self.board.send(b"\x18")?;
        self.listen(|heard| heard.contains("Grbl 1.1"), false)?;
        self.listen(|_| false, true)?;
        self.heard.clear();
        Ok(())
    }

    /// Sends what a row says, and returns the answers.
    fn answer(&mut self, sent: &str) -> Result<String, Box<dyn Error>> {
        let (mut rest, mut lines) = (sent, 0);
        self.heard.clear();
        while let Some(letter) = rest.chars().next() {
            rest = &rest[letter.len_utf8()..];
            match letter {
                '⏎' => {
                    lines += 1;
                    self.board.send(b"\n")?;
                    let expected = lines;
                    self.listen(|heard| answers(heard) >= expected, false)?;
                }
                '\\' if rest.starts_with('x') => {
                    let digits = rest.get(1..3).ok_or("two digits")?;
                    self.board.send(&[u8::from_str_radix(digits, 16)?])?;
                    rest = &rest[3..];
                }
                '\\' => {
                    self.listen(|_| false, true)?;
                    rest = &rest[1..];
                }
                letter => self.board.send(letter.encode_utf8(&mut [0; 4]).as_bytes())?,
            }
        }
        self.listen(|_| false, true)?;
        Ok(std::mem::take(&mut self.heard))
    }
}

/// How many lines have been answered.
fn answers(heard: &str) -> usize {
    heard.lines().filter(|line| *line == "ok" || line.starts_with("error:")).count()
}

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).ok_or("the board is missing")?;
    let row = BOARDS.into_iter().find(|row| row.name == name).ok_or("no such board")?;
    let mut line = Line { board: boot(row)?, heard: String::new() };
    line.listen(|heard| heard.contains("Grbl 1.1"), false)?;
    let (mut all, mut like_grbl, mut faults) = (0, 0, 0);
    for row in rows() {
        if !matches!(row.state, "idle" | "check" | "alarm" | "sleep") || row.sent.contains("\\w") {
            continue;
        }
        line.reset()?;
        match row.state {
            "check" => drop(line.say("$C\n")?),
            "sleep" => drop(line.say("$SLP\n")?),
            "alarm" => {
                line.board.send(b"\xFD")?;
                line.listen(|heard| heard.contains("ALARM:10\n"), false)?;
            }
            _ => {}
        }
        let heard = line.answer(row.sent)?;
        all += 1;
        like_grbl += usize::from(agrees(&heard, row.grbl));
        let expected = row.penup.unwrap_or(row.grbl);
        if agrees(&heard, expected) {
            println!("pass {} {}", row.state, row.sent);
        } else {
            faults += 1;
            let heard = heard.replace('\n', "⏎");
            println!("fail {} {}: expected {expected}, answered {heard}", row.state, row.sent);
        }
    }
    println!("version {like_grbl} of {all} as Grbl does, {faults} not as listed");
    Ok(())
}
