//! Reads G-code as a plan: what the pen draws, not how the machine of the program moved.
//!
//! [`Interpreter`] follows the modes of the program and gives its moves, each with the signals that
//! may lift a pen. [`signals`] decides on the whole program which of them does.
//!
//! Arcs become chords within [`CHORD_ERROR`]. Words without a meaning for a plan are counted. The
//! reader refuses arcs that do not exist, and numbers that it cannot read.

mod moves;
mod signals;

use super::arrange::Arrangement;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::Plan;
use crate::lines::Origin;
use moves::{Moves, Signals};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The format itself.
#[derive(Debug)]
pub(super) struct GCode;

/// The greatest distance between an arc and its chords, in mm: less than half a usual step.
const CHORD_ERROR: f64 = 0.005;

/// The most points of a program. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The modes of a program, and the moves that it has made so far.
#[derive(Debug)]
struct Interpreter {
    /// The number of the mode G0 to G3.
    motion: u8,
    is_relative: bool,
    /// Whether I and J are positions (G90.1) rather than distances.
    has_absolute_centres: bool,
    /// The length of the unit in mm.
    unit: f64,
    /// The origin that G92 has set, which is added to coordinates.
    origin: [f64; 3],
    height: f64,
    signals: Signals,
    moves: Moves,
    /// Whether a height was given as such, and not as a distance.
    has_absolute_heights: bool,
    /// The words that were not obeyed, with their count and the first line.
    unknown: BTreeMap<String, (usize, usize)>,
}

/// The reason why a line is refused, as text.
type RefusalText = String;

impl Interpreter {
    fn new() -> Self {
        Self {
            motion: 0,
            is_relative: false,
            has_absolute_centres: false,
            unit: 1.0,
            origin: [0.0; 3],
            height: 0.0,
            signals: Signals::default(),
            moves: Moves::from([0.0; 2]),
            has_absolute_heights: false,
            unknown: BTreeMap::new(),
        }
    }

    fn skip(&mut self, word: String, line: usize) {
        self.unknown.entry(word).or_insert((0, line)).0 += 1;
    }

    /// Carries out a line. Returns whether the program continues after it.
    fn line(&mut self, text: &str, number: usize) -> Result<bool, RefusalText> {
        let text = without_comments(text);
        let text = text.trim();
        // A block delete, a mark of the beginning or end, or a setting of the machine.
        if text.starts_with(['/', '%', '$']) || text.is_empty() {
            return Ok(true);
        }
        let words = words(text)?;
        let value = |letter| words.iter().find(|(own, _)| *own == letter).map(|(_, value)| *value);
        let (mut moves, mut sets_position, mut goes_on) = (true, false, true);
        let mut servo = false;
        for &(letter, value) in &words {
            // Codes have at most one decimal, as G91.1.
            let code = (value * 10.0).round() as i64;
            match (letter, code) {
                ('G', 0 | 10 | 20 | 30) => self.motion = (code / 10) as u8,
                ('G', 200) => self.unit = 25.4,
                ('G', 210) => self.unit = 1.0,
                ('G', 900) => self.is_relative = false,
                ('G', 910) => self.is_relative = true,
                ('G', 901) => self.has_absolute_centres = true,
                ('G', 911) => self.has_absolute_centres = false,
                ('G', 920) => (moves, sets_position) = (false, true),
                ('G', 921) => self.origin = [0.0; 3],
                ('G', 180 | 190) => return Err("arcs in other planes are not drawn".to_owned()),
                // A dwell, offsets and the places of the machine.
                ('G', 40 | 100 | 280 | 281 | 300 | 301) => moves = false,
                ('G', 170 | 400 | 490 | 540..=590 | 610 | 640 | 800 | 940) => {}
                ('M', 30 | 40) => self.signals.spindle = Some(true),
                ('M', 50) => self.signals.spindle = Some(false),
                ('M', 2800 | 3000) => servo = true,
                ('M', 20 | 300) => goes_on = false,
                ('M', 0 | 10 | 60 | 70 | 80 | 90 | 170 | 180 | 840 | 1060 | 1070) => {}
                ('G' | 'M', _) => self.skip(format!("{letter}{value}"), number),
                ('X' | 'Y' | 'Z' | 'I' | 'J' | 'R' | 'F' | 'N' | 'P' | 'S' | 'T' | 'E', _) => {}
                (letter, _) => self.skip(letter.to_string(), number),
            }
        }
        if servo {
            self.signals.servo = value('S').or(self.signals.servo);
        } else if let Some(power) = value('S') {
            self.signals.power = Some(power);
        }
        if sets_position {
            for (axis, letter) in ['X', 'Y', 'Z'].into_iter().enumerate() {
                let now = if axis < 2 { self.moves.at()[axis] } else { self.height };
                if let Some(value) = value(letter) {
                    self.origin[axis] = now - value * self.unit;
                }
            }
        }
        if moves {
            self.advance(&value, number)?;
        }
        Ok(goes_on)
    }

    /// Moves to the coordinates of a line.
    fn advance(
        &mut self,
        value: &impl Fn(char) -> Option<f64>,
        number: usize,
    ) -> Result<(), RefusalText> {
        let (unit, is_relative, origin) = (self.unit, self.is_relative, self.origin);
        let target = |letter, axis: usize, now: f64| match value(letter) {
            None => now,
            Some(value) if is_relative => now + value * unit,
            Some(value) => origin[axis] + value * unit,
        };
        if value('Z').is_some() {
            let before = self.height;
            self.height = target('Z', 2, self.height);
            self.has_absolute_heights |= !is_relative;
            if self.height != before {
                self.signals.growth = Some((self.height - before).signum());
            }
            self.signals.height = Some(self.height);
        }
        let at = self.moves.at();
        let to = [target('X', 0, at[0]), target('Y', 1, at[1])];
        let is_arc = self.motion >= 2 && ['I', 'J', 'R'].into_iter().any(|it| value(it).is_some());
        if value('X').is_none() && value('Y').is_none() && !is_arc {
            return Ok(());
        }
        let mut points = Vec::new();
        if self.motion >= 2 {
            self.arc(to, value, &mut points)?;
        }
        points.push(to);
        if self.moves.point_count() + points.len() > MOST_POINTS {
            return Err("the program has too many points: leave a part of it out".to_owned());
        }
        self.moves.push(number, self.motion == 0, self.signals, &points);
        Ok(())
    }

    /// Adds the points within an arc from here to `to`.
    fn arc(
        &self,
        to: [f64; 2],
        value: &impl Fn(char) -> Option<f64>,
        points: &mut Vec<[f64; 2]>,
    ) -> Result<(), RefusalText> {
        let from = self.moves.at();
        let clockwise = self.motion == 2;
        let centre = if let Some(radius) = value('R') {
            let radius = radius * self.unit;
            let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
            let chord = dx.hypot(dy);
            // Rounded ends may lie a little too far apart.
            if chord == 0.0 || chord > 2.0 * radius.abs() + 0.01 {
                return Err("there is no such arc: its ends do not fit its radius".to_owned());
            }
            let height = (radius * radius - chord * chord / 4.0).max(0.0).sqrt() / chord;
            let side = if clockwise == (radius > 0.0) { height } else { -height };
            [from[0] + dx / 2.0 + dy * side, from[1] + dy / 2.0 - dx * side]
        } else {
            let offset = |letter, axis: usize| match value(letter) {
                Some(value) if self.has_absolute_centres => self.origin[axis] + value * self.unit,
                Some(value) => from[axis] + value * self.unit,
                None => from[axis],
            };
            [offset('I', 0), offset('J', 1)]
        };
        let radius = distance(from, centre);
        if radius == 0.0 || (distance(to, centre) - radius).abs() > 0.005 * radius + 0.5 {
            return Err("there is no such arc: its ends are not equally far from its centre".into());
        }
        let angle = |point: [f64; 2]| (point[1] - centre[1]).atan2(point[0] - centre[0]);
        let begin = angle(from);
        let turn = if clockwise { begin - angle(to) } else { angle(to) - begin };
        // An arc back to its beginning is a whole circle.
        let turn = match turn.rem_euclid(TAU) {
            turn if turn < 1e-9 || distance(from, to) < 1e-9 => TAU,
            turn => turn,
        };
        let most = 2.0 * (1.0 - CHORD_ERROR / radius.max(2.0 * CHORD_ERROR)).acos();
        let chords = (turn / most).ceil().max(1.0);
        if self.moves.point_count() as f64 + chords > MOST_POINTS as f64 {
            return Err("the arc is too large".to_owned());
        }
        let sign = if clockwise { -1.0 } else { 1.0 };
        points.extend((1..chords as usize).map(|index| {
            let angle = begin + sign * turn * index as f64 / chords;
            [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()]
        }));
        Ok(())
    }
}

/// The line without comments in parentheses or after a semicolon, and without a checksum.
fn without_comments(text: &str) -> String {
    let mut kept = String::new();
    let mut is_within = false;
    for letter in text.chars() {
        match letter {
            ';' | '*' if !is_within => break,
            '(' => is_within = true,
            ')' => is_within = false,
            letter if !is_within => kept.push(letter),
            _ => {}
        }
    }
    kept
}

/// The words of a line: letters in capitals and their numbers.
fn words(text: &str) -> Result<Vec<(char, f64)>, RefusalText> {
    let letters: Vec<char> = text.chars().filter(|letter| !letter.is_whitespace()).collect();
    let mut words = Vec::new();
    let mut rest = letters.as_slice();
    while let [letter, after @ ..] = rest {
        let is_number = |letter: &char| letter.is_ascii_digit() || "+-.".contains(*letter);
        let end = after.iter().position(|it| !is_number(it)).unwrap_or(after.len());
        let (number, next) = after.split_at(end);
        let number: String = number.iter().collect();
        if !letter.is_ascii_alphabetic() {
            return Err(format!("\"{letter}\" is no word of G-code"));
        }
        // Marlin's commands may have letters without a number.
        let value = if number.is_empty() { Ok(0.0) } else { number.parse() };
        let value = value.map_err(|_| format!("\"{letter}{number}\" is no number"))?;
        words.push((letter.to_ascii_uppercase(), value));
        rest = next;
    }
    Ok(words)
}

impl Format for GCode {
    fn name(&self) -> &'static str {
        "G-code"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["gcode", "nc", "ngc", "gc"]
    }

    /// Whether the first lines are G-code and at least one of them moves.
    fn recognises(&self, beginning: &[u8]) -> bool {
        let Ok(text) = std::str::from_utf8(&beginning[..beginning.len().min(4096)]) else {
            return false;
        };
        let mut interpreter = Interpreter::new();
        // The last line may be cut.
        let mut lines: Vec<&str> = text.lines().collect();
        if lines.len() > 1 {
            lines.pop();
        }
        let is_read = |(index, line): (usize, &&str)| interpreter.line(line, index).is_ok();
        lines.iter().enumerate().all(is_read)
            && interpreter.unknown.keys().all(|word| word.starts_with(['G', 'M']))
            && interpreter.moves.len() > 0
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let text = String::from_utf8_lossy(&bytes);
        let mut interpreter = Interpreter::new();
        let origin = |index: usize, line: &str| Origin {
            file: file.clone(),
            line: index + 1,
            text: line.chars().take(Origin::MOST_SHOWN + 1).collect(),
        };
        for (index, line) in text.lines().enumerate() {
            if line.contains('\0') {
                return Err(ReadError::NotText { origin: origin(index, line), kind: "G-code" });
            }
            match interpreter.line(line, index + 1) {
                Ok(true) => {}
                Ok(false) => break,
                Err(reason) => return Err(ReadError::Line { origin: origin(index, line), reason }),
            }
        }
        let mut plan = Plan::new(file.clone());
        let drawn = signals::inked(&interpreter.moves, interpreter.has_absolute_heights);
        let mut pairs = interpreter.moves.iter().zip(drawn).filter(|(_, draws)| *draws).peekable();
        let mut lines = (1..).zip(text.lines());
        while let Some((first, _)) = pairs.next() {
            let mut points = first.points.to_vec();
            while let Some((next, _)) = pairs.next_if(|(it, _)| points.last() == it.points.first())
            {
                points.extend_from_slice(&next.points[1..]);
            }
            let line = lines.find(|(number, _)| *number == first.line);
            plan.begin(first.line as usize, line.map_or("", |(_, text)| text));
            plan.draw(points, None, 1);
        }
        let notes: Vec<String> = interpreter
            .unknown
            .iter()
            .map(|(word, (count, line))| match count {
                1 => format!("{word} has no meaning for a drawing (line {line})"),
                _ => format!(
                    "{count} words {word} have no meaning for a drawing (the first in line {line})"
                ),
            })
            .collect();
        if plan.is_empty() {
            let mut reason = "there is nothing to draw in this G-code".to_owned();
            notes.iter().for_each(|note| reason += &format!("; {note}"));
            return Err(ReadError::Content { file, reason });
        }
        Ok(plan.contents(None, notes))
    }
}

#[cfg(test)]
mod tests;
