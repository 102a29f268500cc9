//! The plotter's tape of Harrison 1.4: twelve instructions, two to a row of eight holes.
//!
//! The tape is the most compact form of a job, with half a byte for each move. Three do-nothing
//! instructions after each pen up, pen down and stop give the pen time to move. [`encode`] inserts
//! them, and [`Decoder`] skips them.

use super::{Chords, Direction};
use crate::drawing::PagePoint;

/// One instruction of the tape, coded in four bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Instruction {
    /// Code 0: does nothing for the time of one instruction.
    Nothing,
    /// Codes 1 to 8: one move; the code is the number of its direction.
    Move(Direction),
    /// Code 9: raises the pen.
    PenUp,
    /// Code 10: lowers the pen.
    PenDown,
    /// Code 11: the tape ends.
    Stop,
}

/// The number of do-nothing instructions after pen up, pen down and stop.
const PAUSE: u8 = 3;

impl Instruction {
    /// The four-bit code of the instruction.
    pub const fn code(self) -> u8 {
        match self {
            Self::Nothing => 0,
            Self::Move(direction) => direction as u8,
            Self::PenUp => 9,
            Self::PenDown => 10,
            Self::Stop => 11,
        }
    }

    /// The instruction with this code; `None` for 12 and more.
    pub fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Nothing),
            9 => Some(Self::PenUp),
            10 => Some(Self::PenDown),
            11 => Some(Self::Stop),
            _ => Direction::ALL
                .into_iter()
                .find(|&direction| direction as u8 == code)
                .map(Self::Move),
        }
    }
}

/// Encodes instructions as the rows of a tape. A stop is added at the end if the instructions
/// contain none. The first instruction of a row is in the high four bits.
///
/// ```
/// use penup::step::tape::{Instruction, encode};
/// use penup::step::Line;
/// let line = Line::by(3, 1).map(Instruction::Move);
/// let tape: Vec<u8> = encode([Instruction::PenDown].into_iter().chain(line)).collect();
/// assert_eq!(tape, [0xA0, 0x00, 0x32, 0x3B, 0x00, 0x00]);
/// ```
pub fn encode(instructions: impl IntoIterator<Item = Instruction>) -> impl Iterator<Item = u8> {
    let mut instructions = instructions.into_iter();
    let mut stopped = false;
    let mut pause = 0;
    let mut next = move || {
        if pause > 0 {
            pause -= 1;
            return Some(Instruction::Nothing);
        }
        if stopped {
            return None;
        }
        let instruction = instructions.next().unwrap_or(Instruction::Stop);
        stopped = instruction == Instruction::Stop;
        if !matches!(instruction, Instruction::Nothing | Instruction::Move(_)) {
            pause = PAUSE;
        }
        Some(instruction)
    };
    core::iter::from_fn(move || {
        let first = next()?.code();
        let second = next().unwrap_or(Instruction::Nothing).code();
        Some(first << 4 | second)
    })
}

/// The error that a tape is damaged: one of its codes is no instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BadCode {
    /// The index of the row, from 0.
    pub row: u32,
    /// The code that means no instruction: from 12 to 15.
    pub code: u8,
}

/// Reads a tape. It yields the moves and pen instructions up to the stop or the end of the tape.
///
/// A bad code ends the tape, too; [`Decoder::damage`] reports it.
#[derive(Debug, Clone)]
pub struct Decoder<I> {
    /// The rows still to be read.
    rows: I,
    /// The number of rows read so far; it wraps.
    row: u32,
    /// The second code of the row that was read last, if it has not been used yet.
    second: Option<u8>,
    /// Whether a stop or a bad code has ended the tape.
    ended: bool,
    /// The bad code that ended the tape, if there was one.
    damage: Option<BadCode>,
}

impl<I: Iterator<Item = u8>> Decoder<I> {
    /// Creates a decoder that reads `rows`.
    pub const fn new(rows: I) -> Self {
        Self { rows, row: 0, second: None, ended: false, damage: None }
    }

    /// The bad code that ended the tape too early, if there was one.
    pub const fn damage(&self) -> Option<BadCode> {
        self.damage
    }

    /// Whether a stop has ended the tape.
    pub const fn has_stopped(&self) -> bool {
        self.ended && self.damage.is_none()
    }

    /// The number of instructions that are not read yet, as those behind the stop, and that are
    /// neither nothing nor a stop. Codes that mean no instruction count, too.
    ///
    /// ```
    /// use penup::step::tape::Decoder;
    /// let mut decoder = Decoder::new([0x33, 0xB0, 0x2B].into_iter());
    /// assert_eq!(decoder.by_ref().count(), 2);
    /// assert!(decoder.has_stopped());
    /// assert_eq!(decoder.count_rest(), 1);
    /// ```
    pub fn count_rest(mut self) -> usize {
        let codes = core::iter::from_fn(|| self.next_code()).map(Instruction::from_code);
        let is_idle =
            |it: &Option<Instruction>| matches!(it, Some(Instruction::Nothing | Instruction::Stop));
        codes.filter(|it| !is_idle(it)).count()
    }

    /// The next four-bit code, or `None` at the end of the rows.
    fn next_code(&mut self) -> Option<u8> {
        if let Some(second) = self.second.take() {
            return Some(second);
        }
        let row = self.rows.next()?;
        self.row = self.row.wrapping_add(1);
        self.second = Some(row & 15);
        Some(row >> 4)
    }
}

impl<I: Iterator<Item = u8>> Iterator for Decoder<I> {
    type Item = Instruction;

    fn next(&mut self) -> Option<Instruction> {
        while !self.ended {
            let code = self.next_code()?;
            match Instruction::from_code(code) {
                Some(Instruction::Nothing) => {}
                Some(Instruction::Stop) => self.ended = true,
                Some(instruction) => return Some(instruction),
                None => {
                    self.damage = Some(BadCode { row: self.row.wrapping_sub(1), code });
                    self.ended = true;
                }
            }
        }
        None
    }
}

/// The lines of a tape. Each item is the end of a line and whether the pen is down. Drawn, the
/// lines give the moves of the tape.
#[derive(Debug, Clone)]
pub struct TapeLines<I> {
    /// The lines up to the next change of the pen.
    chords: Chords<Run<I>>,
    /// Whether the pen is down.
    inked: bool,
}

/// The points of the tape up to the next change of the pen.
#[derive(Debug, Clone)]
struct Run<I> {
    /// The instructions still to be read.
    instructions: I,
    /// The present point.
    at: PagePoint,
    /// The new state of the pen, after an instruction that changes it; `true` is down.
    change: Option<bool>,
}

impl<I: Iterator<Item = Instruction>> Iterator for Run<I> {
    type Item = PagePoint;

    fn next(&mut self) -> Option<PagePoint> {
        while self.change.is_none() {
            match self.instructions.next()? {
                Instruction::Move(direction) => {
                    self.at = direction.from_point(self.at);
                    return Some(self.at);
                }
                Instruction::PenUp => self.change = Some(false),
                Instruction::PenDown => self.change = Some(true),
                Instruction::Nothing | Instruction::Stop => {}
            }
        }
        None
    }
}

impl<I: Iterator<Item = Instruction>> TapeLines<I> {
    /// The lines of `instructions`, starting at `from` with the pen up.
    pub fn new(from: PagePoint, instructions: I) -> Self {
        let run = Run { instructions, at: from, change: None };
        Self { chords: Chords::new(from, run), inked: false }
    }
}

impl<I: Iterator<Item = Instruction>> Iterator for TapeLines<I> {
    type Item = (PagePoint, bool);

    fn next(&mut self) -> Option<(PagePoint, bool)> {
        loop {
            if let Some(end) = self.chords.next() {
                return Some((end, self.inked));
            }
            self.inked = self.chords.points.change.take()?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::step::Line;
    use std::vec::Vec;

    #[test]
    fn codes() {
        for code in 0..=255 {
            assert!(Instruction::from_code(code).is_none_or(|known| known.code() == code));
            assert_eq!(Instruction::from_code(code).is_some(), code < 12);
        }
    }

    #[test]
    fn what_is_encoded_is_decoded() {
        let mut job = std::vec![Instruction::PenDown];
        job.extend(Line::by(14, 9).map(Instruction::Move));
        job.push(Instruction::PenUp);
        job.extend(Line::by(-3, 1).map(Instruction::Move));
        let tape: Vec<u8> = encode(job.iter().copied()).collect();
        // 17 moves and 3 times 1 + 3 instructions, half a byte each, rounded up.
        assert_eq!(tape.len(), 15);
        let mut decoder = Decoder::new(tape.into_iter());
        assert_eq!(decoder.by_ref().collect::<Vec<_>>(), job);
        assert_eq!(decoder.damage(), None);
    }

    #[test]
    fn nothing_after_the_stop_counts_and_damage_is_reported() {
        let after_stop = Decoder::new([0x1B, 0x22].into_iter());
        assert_eq!(after_stop.collect::<Vec<_>>(), [Instruction::Move(Direction::Up)]);
        let mut damaged = Decoder::new([0x00, 0x3D, 0x11].into_iter());
        assert_eq!(damaged.by_ref().count(), 1);
        assert_eq!(damaged.damage(), Some(BadCode { row: 1, code: 13 }));
        assert_eq!(encode([]).collect::<Vec<_>>(), [0xB0, 0x00]);
        assert_eq!(Decoder::new([].into_iter()).next(), None);
    }

    #[test]
    fn the_lines_of_a_tape_give_its_moves() {
        let mut job = Vec::new();
        for (dx, dy, pen) in [
            (40, 13, Instruction::PenDown),
            (-5, 7, Instruction::PenUp),
            (0, 9, Instruction::PenUp),
            (100, 100, Instruction::PenDown),
        ] {
            job.push(pen);
            job.extend(Line::by(dx, dy).map(Instruction::Move));
        }
        let mut at = PagePoint::default();
        let mut again = std::vec![false; 0];
        let mut moves = Vec::new();
        for (end, inked) in TapeLines::new(at, job.iter().copied()) {
            for direction in Line::new(at, end) {
                moves.push(Instruction::Move(direction));
                again.push(inked);
            }
            at = end;
        }
        let expected: Vec<_> =
            job.iter().copied().filter(|i| matches!(i, Instruction::Move(_))).collect();
        assert_eq!(moves, expected);
        assert_eq!(again.iter().filter(|inked| **inked).count(), 140);
        assert_eq!(at, PagePoint { x: 135, y: 129 });
    }
}
