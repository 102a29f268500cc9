//! Reads G-code as a plan: what the pen draws, not how the machine of the program moved.
//!
//! [`Interpreter`] follows the modes of the program and gives its moves, each with the signals that
//! may lift a pen. [`signals`] decides on the whole program which of them does.
//!
//! Where the pen is put down and lifted without a move between, it draws a dot, as by `PD;PU;` of
//! HP-GL.
//!
//! Arcs become chords within [`CHORD_ERROR`]. Words without a meaning for a plan are counted. The
//! reader refuses arcs that do not exist, numbers that it cannot read, a word that is twice in a
//! line, and what would change where the pen goes in a way that it does not follow: subprograms,
//! loops, splines, turned coordinates.
//!
//! A move in the coordinates of the machine (`G53`) goes to a place that only the machine knows, as
//! to where it parks. It is not drawn; along z it lifts the pen. Ink that would begin at such a
//! place is refused.
//!
//! The file is longer than 500 lines, because all words of a line are read together: each depends
//! on the modes that the others set.

mod extruder;
mod moves;
mod pens;
mod signals;
mod systems;
mod text;

use super::arrange::Arrangement;
use super::counted;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::Plan;
use crate::lines::Origin;
use extruder::Extruder;
use moves::{Move, Moves, Signals};
use pens::Changes;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use systems::{Systems, chosen};
use text::{Line, parse};

/// The format itself.
#[derive(Debug)]
pub(super) struct GCode;

/// The greatest distance between an arc and its chords, in mm: less than half a usual step.
const CHORD_ERROR: f64 = 0.005;

/// The motion of the cycles that drill holes (`G81` and others).
const DRILLING: u8 = 80;

/// The most points of a program. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;
const TOO_MANY: &str = "the program has too many points: leave a part of it out";

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A text whose lines all end with a line feed, also those that ended with a carriage return alone,
/// without a mark of its encoding.
fn with_line_ends(text: Cow<'_, str>) -> Cow<'_, str> {
    let text = match text.strip_prefix('\u{FEFF}') {
        Some(rest) => Cow::Owned(rest.to_owned()),
        None => text,
    };
    let mut ends = text.match_indices('\r').map(|(at, _)| text.as_bytes().get(at + 1));
    match ends.any(|next| next.is_some_and(|next| *next != b'\n')) {
        true => Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n")),
        false => text,
    }
}

/// The modes of a program, and the moves that it has made so far.
#[derive(Debug)]
struct Interpreter {
    /// The number of the mode G0 to G3, or [`DRILLING`].
    motion: u8,
    is_relative: bool,
    /// Whether I and J are positions (G90.1) rather than distances.
    has_absolute_centres: bool,
    /// The length of the unit in mm.
    unit: f64,
    systems: Systems,
    /// What G92 has added to heights.
    lift: f64,
    /// What G92 has added last to heights, which `G92.3` adds again.
    kept_lift: f64,
    height: f64,
    signals: Signals,
    /// The signals after the line before, the line that set them, and whether a move followed it.
    held: (Signals, usize, bool),
    moves: Moves,
    /// Whether a height was given as such, and not as a distance.
    has_absolute_heights: bool,
    extruder: Extruder,
    changes: Changes,
    /// For x and y, the line of the `G53` or `G28` after which the position is not known.
    unplaced: [Option<u32>; 2],
    /// For x and y, whether the pen is at the home of the machine (`G28`).
    is_at_home: [bool; 2],
    /// For x and y, where home lies in the drawing, in mm. It is known if the program has set its
    /// coordinates there before the first move.
    home: [Option<f64>; 2],
    /// The number of moves along x or y by `G53`, and the line of the first.
    machine_moves: (usize, usize),
    /// The number of lines that begin with `/`, and the first of them.
    optional: (usize, usize),
    /// The words that were not obeyed, with their count and the first line.
    unknown: BTreeMap<String, (usize, usize)>,
}

/// Whether the S of these words is the power of the spindle, and not a temperature, the speed of a
/// fan or the time of a dwell. `is_setting` tells whether an unknown word stands before the
/// coordinates.
fn is_power(words: &[(char, f64)], is_setting: bool) -> bool {
    let has = |word: (char, f64)| words.contains(&word);
    let is_other = is_setting || has(('G', 4.0)) || has(('M', 106.0));
    has(('M', 3.0)) || has(('M', 4.0)) || !is_other
}

/// Checks that no word is more than once among those of a line, and no motion beside another. A
/// letter may belong to each of several codes (G, M).
fn refuse_repeated(words: &[(char, f64)]) -> Result<(), RefusalText> {
    let refused = |what: &str| {
        Err(format!("{what} in the line, which Grbl refuses, too: give each move its own line"))
    };
    let is_motion = |word: &&(char, f64)| word.0 == 'G' && [0.0, 1.0, 2.0, 3.0].contains(&word.1);
    if words.iter().filter(is_motion).count() > 1 {
        return refused("two motions (G0 to G3) are");
    }
    let mut words = words.iter().filter(|(letter, _)| !matches!(letter, 'G' | 'M'));
    while let Some((letter, _)) = words.next() {
        if words.clone().any(|(other, _)| other == letter) {
            return refused(&format!("{letter} is more than once"));
        }
    }
    Ok(())
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
            systems: Systems::new(),
            lift: 0.0,
            kept_lift: 0.0,
            height: 0.0,
            signals: Signals::default(),
            held: (Signals::default(), 0, true),
            moves: Moves::from([0.0; 2]),
            has_absolute_heights: false,
            extruder: Extruder::default(),
            changes: Changes::default(),
            unplaced: [None; 2],
            is_at_home: [false; 2],
            home: [None; 2],
            machine_moves: (0, 0),
            optional: (0, 0),
            unknown: BTreeMap::new(),
        }
    }

    fn skip(&mut self, word: String, line: usize) {
        self.unknown.entry(word).or_insert((0, line)).0 += 1;
    }

    /// Says which words were not obeyed, and which moves go to places of the machine.
    fn notes(&self) -> impl Iterator<Item = String> {
        let machine_moves = match self.machine_moves {
            (0, _) => None,
            (1, line) => Some(format!(
                "1 move goes to a place of the machine (G53 in line {line}), which is not known \
                 here, and is not drawn"
            )),
            (count, line) => Some(format!(
                "{count} moves go to places of the machine (G53, the first in line {line}), which \
                 are not known here, and are not drawn"
            )),
        };
        let unknown = self.unknown.iter().map(|(word, (count, line))| match count {
            1 => format!("{word} has no meaning for a drawing (line {line})"),
            _ => format!(
                "{count} words {word} have no meaning for a drawing (the first in line {line})"
            ),
        });
        let optional = match self.optional {
            (0, _) => None,
            (1, line) => Some(format!("line {line} begins with / and is drawn, as Grbl draws it")),
            (count, line) => Some(format!(
                "{count} lines begin with / and are drawn, as Grbl draws them (the first is line \
                 {line})"
            )),
        };
        machine_moves.into_iter().chain(optional).chain(unknown)
    }

    /// Carries out a line, and notes where the pen may have been put down and lifted without a
    /// move. Returns whether the program continues after it.
    fn line(&mut self, text: &str, number: usize) -> Result<bool, RefusalText> {
        let (before, is_placed) = (self.moves.len(), self.unplaced == [None; 2]);
        let goes_on = self.obey(text, number)?;
        let (held, line, has_moved) = self.held;
        let moves = self.moves.len() > before;
        self.held = if held.lifts_as(&self.signals) {
            (self.signals, line, has_moved || moves)
        } else {
            if !has_moved && is_placed {
                if self.moves.touches().len() >= MOST_POINTS {
                    return Err(TOO_MANY.to_owned());
                }
                self.moves.touch(line, held, before);
            }
            (self.signals, number, moves)
        };
        Ok(goes_on)
    }

    /// Carries out a line. Returns whether the program continues after it.
    fn obey(&mut self, text: &str, number: usize) -> Result<bool, RefusalText> {
        self.signals.choice.follow(text);
        let words = match parse(text)? {
            Line::Words(words) => words,
            Line::Skipped => return Ok(true),
            Line::Optional(rest) => {
                self.optional.0 += 1;
                if self.optional.0 == 1 {
                    self.optional.1 = number;
                }
                return self.obey(&rest, number);
            }
            Line::Pause => {
                self.changes.pause(number);
                return Ok(true);
            }
            Line::Servo(level) => {
                self.signals.servo = Some(level);
                return Ok(true);
            }
            Line::Command(name) => {
                self.skip(name, number);
                return Ok(true);
            }
        };
        let value = |letter| words.iter().find(|(own, _)| *own == letter).map(|(_, value)| *value);
        let (mut moves, mut sets_position, mut goes_on) = (true, false, true);
        let (mut sets_system, mut goes_home, mut changes_tool) = (false, None, false);
        let (mut servo, mut of_machine) = (false, false);
        let (mut is_move, mut is_setting, mut has_place) = (false, false, false);
        for &(letter, value) in &words {
            // Codes have at most one decimal, as G91.1.
            let code = (value * 10.0).round() as i64;
            match (letter, code) {
                ('G', 0 | 10 | 20 | 30) => {
                    (self.motion, is_move) = ((code / 10) as u8, true);
                }
                ('G', 530) => of_machine = true,
                ('G', 200) => self.unit = 25.4,
                ('G', 210) => self.unit = 1.0,
                ('G', 900) => self.is_relative = false,
                ('G', 910) => self.is_relative = true,
                ('G', 901) => self.has_absolute_centres = true,
                ('G', 911) => self.has_absolute_centres = false,
                ('G', 920) => (moves, sets_position) = (false, true),
                ('G', 921 | 922) => {
                    let forgets = code == 921;
                    self.systems.unset(forgets, &(format!("{letter}{value}"), number));
                    self.lift = 0.0;
                    if forgets {
                        self.kept_lift = 0.0;
                    }
                }
                ('G', 923) => {
                    self.systems.restore(&(format!("{letter}{value}"), number));
                    self.lift = self.kept_lift;
                }
                ('G', 180 | 190) => return Err("arcs in other planes are not drawn".to_owned()),
                // The end of a shift.
                ('G', 520) if !words.iter().any(|it| matches!(it.0, 'X' | 'Y') && it.1 != 0.0) => {
                    moves = false;
                }
                ('G', 50..=52 | 60..=62 | 160 | 510 | 511 | 520 | 541 | 680) => {
                    return Err(format!(
                        "{letter}{value} changes where the pen goes in a way that is not read: let \
                         the program that wrote this file write lines and arcs only"
                    ));
                }
                ('M', 970 | 980) | ('G', 650 | 660) => {
                    return Err(format!(
                        "{letter}{value} calls a subprogram, which is not followed: let the \
                         program that wrote this file write it without subprograms"
                    ));
                }
                // Drilling moves to the hole as by G0; its Z and R are depths.
                ('G', 730 | 810..=890) => {
                    (self.motion, is_move) = (DRILLING, true);
                    self.skip(format!("{letter}{value}"), number);
                }
                // The radius of the cutter is that of the pen, which is none.
                ('G', 410 | 420) => self.skip(format!("{letter}{value}"), number),
                ('G', 800) => self.motion = 0,
                ('M', 820) => self.extruder.is_relative = false,
                ('M', 830) => self.extruder.is_relative = true,
                ('G', 540 | 550 | 560 | 570 | 580 | 590..=593) => {
                    let by = (format!("{letter}{value}"), number);
                    self.systems.choose(chosen(code), self.moves.len() == 0, &by);
                }
                ('G', 100) => (moves, sets_system) = (false, true),
                ('G', 280 | 300) => (moves, goes_home) = (false, Some(code == 280)),
                // A dwell, a retraction, and the places of the machine.
                ('G', 40 | 110 | 281 | 301) => moves = false,
                ('G', 170 | 400 | 430 | 490 | 610 | 640 | 940) => {}
                ('M', 30 | 40) => self.signals.spindle = Some(true),
                ('M', 50) => self.signals.spindle = Some(false),
                ('M', 2800 | 3000 | 3400) => servo = true,
                ('M', 20 | 300) => goes_on = false,
                ('M', 0 | 10) => self.changes.pause(number),
                ('M', 60) => changes_tool = true,
                ('M', 70 | 80) => self.signals.coolant = Some(true),
                ('M', 90) => self.signals.coolant = Some(false),
                ('M', 1060) => self.signals.fan = Some(!words.contains(&('S', 0.0))),
                ('M', 1070) => self.signals.fan = Some(false),
                ('M', 170 | 180 | 840) => {}
                // Modes of speed and of cycles, and the ends of modes that are refused.
                ('G', 150 | 500 | 690 | 930 | 950 | 960 | 970 | 980 | 990) => {
                    self.skip(format!("{letter}{value}"), number);
                }
                ('G' | 'M', _) => {
                    is_setting |= !has_place;
                    self.skip(format!("{letter}{value}"), number);
                }
                ('X' | 'Y', _) => has_place = true,
                ('Z' | 'I' | 'J' | 'R' | 'F' | 'N' | 'P' | 'S' | 'T' | 'E' | 'H', _) => {}
                // Beside G10, wherever it stands.
                ('L', _) if words.contains(&('G', 10.0)) => {}
                (letter, _) => self.skip(letter.to_string(), number),
            }
        }
        if !is_setting || is_move {
            refuse_repeated(&words)?;
        }
        if servo {
            self.signals.servo = value('S').or(self.signals.servo);
        } else if let Some(power) = value('S').filter(|_| is_power(&words, is_setting)) {
            self.signals.power = Some(power);
        }
        if moves && !is_setting {
            self.signals.choice.call(&words);
        }
        if changes_tool {
            self.changes.put_in(&mut self.signals.choice, number);
        }
        if let Some(is_home) = goes_home {
            self.go_home(is_home, &value, number);
        }
        if sets_system {
            self.set_system(&value, number)?;
        }
        if sets_position {
            self.set_origin(&value, number);
        }
        if sets_position && let Some(value) = value('E') {
            self.extruder.set(value);
        }
        // X and Y behind an unknown word, as M201, are no coordinates.
        if !moves || is_setting && !is_move {
            return Ok(goes_on);
        }
        if of_machine {
            self.go_to_machine_place(&value, number)?;
        } else {
            self.advance(&value, number)?;
        }
        Ok(goes_on)
    }

    /// Moves to the home of the machine (`is_home`) or to its other place (`G30`) along the axes
    /// that a line names, or all. Before the first move, that is where the drawing begins.
    fn go_home(&mut self, is_home: bool, value: &impl Fn(char) -> Option<f64>, number: usize) {
        let all = ['X', 'Y', 'Z'].into_iter().all(|letter| value(letter).is_none());
        let is_first = self.moves.len() == 0;
        for (axis, letter) in ['X', 'Y'].into_iter().enumerate() {
            if all || value(letter).is_some() {
                self.is_at_home[axis] = is_home;
                let line = u32::try_from(number).unwrap_or(u32::MAX);
                self.unplaced[axis] = (!is_first).then_some(line).or(self.unplaced[axis]);
            }
        }
        // In a program without heights, no other one would follow.
        let has_height = !is_first && self.signals.height.is_some();
        self.signals.is_parked |= value('Z').is_some() && has_height;
    }

    /// Moves to coordinates of the machine, which are no place of the drawing.
    fn go_to_machine_place(
        &mut self,
        value: &impl Fn(char) -> Option<f64>,
        number: usize,
    ) -> Result<(), RefusalText> {
        if self.motion > 1 {
            return Err("G53 is for G0 and G1 only".to_owned());
        }
        self.signals.is_parked |= value('Z').is_some();
        let mut moves = false;
        for (axis, letter) in ['X', 'Y'].into_iter().enumerate() {
            if value(letter).is_some() {
                self.unplaced[axis] = Some(u32::try_from(number).unwrap_or(u32::MAX));
                self.is_at_home[axis] = false;
                moves = true;
            }
        }
        if moves {
            let (count, first) = self.machine_moves;
            self.machine_moves = (count + 1, if count == 0 { number } else { first });
        }
        Ok(())
    }

    /// Moves to the coordinates of a line.
    fn advance(
        &mut self,
        value: &impl Fn(char) -> Option<f64>,
        number: usize,
    ) -> Result<(), RefusalText> {
        let (unit, is_relative) = (self.unit, self.is_relative);
        // Beside M, E is no way of the extruder.
        let pushes = value('E').filter(|_| value('M').is_none());
        let extrudes = pushes.is_some_and(|to| self.extruder.advance(to, is_relative));
        self.signals.extrudes = extrudes;
        let drills = self.motion == DRILLING;
        if let Some(to) = value('Z').filter(|_| !drills) {
            if self.signals.is_parked && is_relative {
                let line = u32::try_from(number).unwrap_or(u32::MAX);
                self.signals.unknown_height.get_or_insert(line);
            } else {
                (self.signals.is_parked, self.signals.unknown_height) = (false, None);
            }
            let before = self.height;
            self.height = to * unit + if is_relative { before } else { self.lift };
            self.has_absolute_heights |= !is_relative;
            if self.height != before {
                self.signals.growth = Some((self.height - before).signum());
            }
            self.signals.height = Some(self.height);
        }
        let at = self.moves.at();
        let target = |letter, axis: usize| match value(letter) {
            None => Ok(at[axis]),
            Some(value) if is_relative => Ok(at[axis] + value * unit),
            Some(value) => self.systems.place(axis, value * unit),
        };
        let to = [target('X', 0)?, target('Y', 1)?];
        let is_arc = matches!(self.motion, 2 | 3)
            && ['I', 'J', 'R'].into_iter().any(|it| value(it).is_some());
        if value('X').is_none() && value('Y').is_none() && !is_arc {
            return Ok(());
        }
        self.signals.unplaced = self.unplaced[0].or(self.unplaced[1]);
        for (axis, letter) in ['X', 'Y'].into_iter().enumerate() {
            if value(letter).is_some() {
                self.is_at_home[axis] = false;
                if !is_relative {
                    self.unplaced[axis] = None;
                }
            }
        }
        let mut points = Vec::new();
        if matches!(self.motion, 2 | 3) {
            self.arc(to, value, &mut points)?;
        }
        points.push(to);
        if self.moves.point_count() + points.len() > MOST_POINTS {
            return Err(TOO_MANY.to_owned());
        }
        let is_rapid = self.motion == 0 || drills;
        self.moves.push(number, is_rapid, self.signals, &points);
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
                Some(value) if self.has_absolute_centres => {
                    self.systems.place(axis, value * self.unit)
                }
                Some(value) => Ok(from[axis] + value * self.unit),
                None => Ok(from[axis]),
            };
            [offset('I', 0)?, offset('J', 1)?]
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
        // P is the number of turns, each of which comes to the end of the arc. 0 counts as 1.
        let turns = value('P').map_or(1.0, |turns| turns.max(1.0));
        if turns.fract() != 0.0 || value('P').is_some_and(|turns| turns < 0.0) {
            return Err("P of an arc is a number of turns, so it is whole and not below 0".into());
        }
        let turn = turn + (turns - 1.0) * TAU;
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
        let text = with_line_ends(text.into());
        let mut interpreter = Interpreter::new();
        // The last line may be cut.
        let mut lines: Vec<&str> = text.lines().collect();
        if lines.len() > 1 {
            lines.pop();
        }
        let is_read = |(index, line): (usize, &&str)| interpreter.line(line, index).is_ok();
        lines.iter().enumerate().all(is_read)
            && interpreter.unknown.keys().all(|word| {
                word.starts_with('$')
                    || word
                        .strip_prefix(['G', 'M'])
                        .is_some_and(|rest| rest.starts_with(|it: char| it.is_ascii_digit()))
            })
            && interpreter.moves.len() > 0
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let text = with_line_ends(String::from_utf8_lossy(&bytes));
        let mut interpreter = Interpreter::new();
        let origin = |index: usize, line: &str| Origin {
            file: file.clone(),
            line: index + 1,
            text: line.chars().take(Origin::MOST_SHOWN + 1).collect(),
        };
        let mut lines = text.lines().enumerate();
        let (mut end, mut marks) = (None, 0);
        for (index, line) in lines.by_ref() {
            if line.contains('\0') {
                return Err(ReadError::NotText { origin: origin(index, line), kind: "G-code" });
            }
            // The first % begins a program, and the second ends it.
            marks += usize::from(line.trim_start().starts_with('%'));
            if marks > 1 {
                end = Some(("the second %", index + 1));
                break;
            }
            match interpreter.line(line, index + 1) {
                Ok(true) => {}
                Ok(false) => {
                    end = Some(("M2 or M30", index + 1));
                    break;
                }
                Err(reason) => return Err(ReadError::Line { origin: origin(index, line), reason }),
            }
        }
        let is_code = |line: &str| !matches!(parse(line), Ok(Line::Skipped));
        let behind = lines.filter(|(_, line)| is_code(line)).count();
        let mut plan = Plan::new(file.clone());
        let Interpreter { moves, signals, has_absolute_heights, .. } = &interpreter;
        let mut inked = signals::inked(moves, signals, *has_absolute_heights);
        let drawn = moves.iter().zip(&inked.draws).filter(|(_, draws)| **draws);
        let place = |(it, _): (Move<'_>, _)| Some((it.line as usize, it.signals.unplaced?));
        let unplaced = drawn.filter_map(place).next();
        if let Some((number, by)) = unplaced {
            let line = text.lines().nth(number - 1).unwrap_or_default();
            let reason = format!(
                "the pen would draw from a place of the machine (line {by}), which is not known \
                 here: let the program move to an X and a Y of the drawing before"
            );
            return Err(ReadError::Line { origin: origin(number - 1, line), reason });
        }
        if let Some((number, by)) = signals::unknown_height(&interpreter.moves) {
            let line = text.lines().nth(number - 1).unwrap_or_default();
            let reason = format!(
                "the Z of line {by} is a distance from a height of the machine, so it is not known \
                 here whether the pen is down: let the program give that height in the coordinates \
                 of the drawing (G90)"
            );
            return Err(ReadError::Line { origin: origin(number - 1, line), reason });
        }
        let mut notes: Vec<String> = extruder::note(&interpreter.moves).into_iter().collect();
        if !notes.is_empty() {
            // Temperatures, fans and the like.
            interpreter.unknown.retain(|word, _| word.starts_with('G'));
        }
        notes.extend(inked.note.take());
        notes.extend(interpreter.changes.draw(&interpreter.moves, inked, &text, &mut plan));
        notes.extend(interpreter.notes());
        if let Some((by, end)) = end.filter(|_| behind > 0) {
            let lines = counted(behind, ["line is", "lines are"]);
            notes.push(format!(
                "{lines} not drawn, behind the end of the program ({by} in line {end})"
            ));
        }
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
