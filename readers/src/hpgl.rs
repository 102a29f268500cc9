//! Reads HP-GL as a plan: what a plotter would draw of it, by the plotter's own interpreter.
//!
//! Nothing is clipped at the limits of a machine, which the file does not know; its own window
//! (`IW`) holds. What a plotter could only tell by a number that nobody asks for (`OE`) is told
//! here: an instruction that is not known or changes only how something looks is counted and named,
//! and one that would draw something else than it says is refused, with its line.

use super::arrange::Arrangement;
use super::counted;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::Plan;
use crate::lines::Origin;
use penup::hpgl::{
    Action, Dialect, ErrorNumber, FARTHEST, Interpreter, Point, Rectangle, Token, UNIT,
    UNITS_PER_MM,
};
use polygon::{MOST_VERTICES, Vertices};
use std::collections::BTreeMap;

mod polygon;

/// The format itself.
#[derive(Debug)]
pub(super) struct HpGl;

/// No limits but those of coordinates.
const LIMITS: Rectangle = Rectangle {
    least: Point { x: -FARTHEST, y: -FARTHEST },
    most: Point { x: FARTHEST, y: FARTHEST },
};

/// The most points of a file. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

/// The byte that stands for lost bytes at the port of a plotter.
const DAMAGED: u8 = 0xFF;

/// Instructions that choose the pen, the speed, and how lines, letters and fills look. If their
/// parameters are wrong they are counted, and the rest is drawn as before.
const STYLES: [&str; 22] = [
    "AP", "CA", "CS", "DI", "DR", "FS", "FT", "IM", "LA", "LT", "PT", "PW", "SA", "SI", "SL", "SP",
    "SR", "SS", "TL", "VS", "WU", "AS",
];

/// Instructions that a plotter takes without a word although something looks otherwise for it: they
/// define lines and fills, choose a pen of a group, draw a label that was sent before, or all of it
/// once more. Each has parameters, but for the label.
const WITHOUT_A_WORD: [&str; 6] = ["PB", "RF", "RP", "SG", "SV", "UL"];

/// Instructions that draw whether the pen is up or down, and those that draw while it is down.
const INKS: [&str; 14] =
    ["LB", "CI", "EA", "ER", "EW", "RA", "RR", "WG", "FP", "EP", "XT", "YT", "UC", "PE"];
const MOVES: [&str; 7] = ["PD", "PA", "PR", "AA", "AR", "AT", "RT"];

/// What a file says of its size.
#[derive(Debug, Default)]
struct Sizes {
    /// Whether it sets P1 and P2 (`IP`).
    has_corners: bool,
    /// Whether lengths and letters are parts of the distance between them (`SC`, `SR`).
    is_scaled: bool,
    has_relative_letters: bool,
    /// Whether something is drawn so without P1 and P2.
    is_guessed: bool,
}

impl Sizes {
    /// Follows the name of an instruction, and once more its first parameter.
    fn follow(&mut self, name: &str, has_parameters: bool) {
        match name {
            "IN" => *self = Self { is_guessed: self.is_guessed, ..Self::default() },
            "DF" => (self.is_scaled, self.has_relative_letters) = (false, false),
            "IP" => self.has_corners = has_parameters,
            "SC" => self.is_scaled = has_parameters,
            "SR" => self.has_relative_letters = true,
            "SI" => self.has_relative_letters = false,
            "LB" => self.is_guessed |= self.has_relative_letters && !self.has_corners,
            _ => {}
        }
    }
}

/// The state of reading a file: the interpreter, and the strokes drawn so far.
#[derive(Debug)]
struct Reader {
    interpreter: Box<Interpreter<Vertices>>,
    /// Where the pen has been, with or without ink.
    at: Point,
    /// The pen in the holder, from 1.
    pen: u32,
    /// The points of the stroke that is being drawn, and the byte of the file where it begins.
    stroke: Vec<Point>,
    begin: usize,
    /// The pen and the points in mm of each stroke, and the byte of the file where it begins.
    strokes: Vec<(u32, usize, Vec<[f64; 2]>)>,
    points: usize,
    /// The number of sheets of paper so far. Only the first is drawn.
    sheets: usize,
    /// The instructions that were not obeyed, with their count.
    unknown: BTreeMap<String, usize>,
    /// The byte where the label begins that the file does not end.
    endless: Option<usize>,
    /// The byte where the comment begins that the file does not end.
    endless_comment: Option<usize>,
    /// The byte where the first name in quotation marks begins that its line does not end.
    endless_name: Option<usize>,
    /// The byte where the polygon begins that is not complete.
    polygon: Option<usize>,
    sizes: Sizes,
    /// Whether the pen is put away (`SP0`), whether it is down, and whether it went somewhere.
    is_penless: bool,
    is_down: bool,
    has_gone: bool,
    /// The number of instructions that draw nothing, because there is no pen, and the byte at which
    /// the last of them begins.
    penless: (usize, usize),
}

impl Reader {
    fn new() -> Self {
        let mut interpreter = Box::new(Interpreter::with_buffer(Vertices::default()));
        interpreter.initialize(Point::default(), LIMITS);
        Self {
            interpreter,
            at: Point::default(),
            pen: 1,
            stroke: Vec::new(),
            begin: 0,
            strokes: Vec::new(),
            points: 0,
            sheets: 1,
            unknown: BTreeMap::new(),
            endless: None,
            endless_comment: None,
            endless_name: None,
            polygon: None,
            sizes: Sizes::default(),
            is_penless: false,
            is_down: false,
            has_gone: false,
            penless: (0, usize::MAX),
        }
    }

    fn end_stroke(&mut self) {
        if !self.stroke.is_empty() {
            let mm = |units: i64| units as f64 / (UNIT * UNITS_PER_MM) as f64;
            let points = self.stroke.drain(..).map(|point| [mm(point.x), mm(point.y)]);
            self.strokes.push((self.pen, self.begin, points.collect()));
        }
    }

    /// Begins a stroke at the byte `begin` of the file, unless the present one ends there on the
    /// page.
    fn begin_at(&mut self, at: Point, begin: usize) {
        if self.stroke.last() != Some(&at) {
            self.end_stroke();
            self.stroke.push(at);
            self.begin = begin;
        }
        self.at = at;
    }

    /// Takes a byte of the instruction that begins at the byte `begin` of the file, and draws what
    /// results from it.
    fn push(&mut self, byte: u8, begin: usize) -> Result<(), String> {
        self.interpreter.push(byte);
        while let Some(action) = self.interpreter.next_action() {
            if matches!(action, Action::Line(_) | Action::Dot(_)) {
                self.sizes.is_guessed |= self.sizes.is_scaled && !self.sizes.has_corners;
            }
            match action {
                Action::Initialize => {
                    self.end_stroke();
                    (self.is_penless, self.is_down) = (false, false);
                    self.interpreter.initialize(self.at, LIMITS);
                }
                Action::Line([_, at]) | Action::Dot(at) if self.sheets > 1 => self.at = at,
                Action::Line([from, to]) => {
                    self.begin_at(from, begin);
                    self.stroke.push(to);
                    self.at = to;
                }
                Action::Dot(at) => self.begin_at(at, begin),
                Action::Go(at) => {
                    self.end_stroke();
                    self.has_gone = true;
                    self.at = at;
                }
                Action::Pen(pen) => {
                    self.end_stroke();
                    // Pen 0 puts the pen away, and the interpreter draws nothing then.
                    self.is_penless = pen == 0;
                    self.pen = if pen > 0 { pen.into() } else { self.pen };
                }
                Action::Sheet => {
                    self.end_stroke();
                    self.sheets += 1;
                }
                // Nobody has asked.
                Action::Answer(_) | Action::Nothing => continue,
            }
            self.points += 1;
            if self.points > MOST_POINTS {
                return Err("the file has too many points: leave a part of it out".to_owned());
            }
        }
        Ok(())
    }

    /// Refuses the file because of an error in the instruction, or counts the error.
    fn judge(&mut self, error: ErrorNumber, name: &str) -> Result<(), String> {
        let name = if name.is_empty() { "without a name" } else { name };
        match error {
            ErrorNumber::WrongCount if !STYLES.contains(&name) => {
                Err(format!("error 2 of HP-GL: {name} has a wrong number of parameters"))
            }
            ErrorNumber::BadParameter if !STYLES.contains(&name) => Err(format!(
                "error 3 of HP-GL: a parameter of {name} is no number, or out of its range"
            )),
            ErrorNumber::Overflow => Err(format!(
                "error 6 of HP-GL: {name} leads beyond {} plotter units",
                FARTHEST / UNIT
            )),
            ErrorNumber::BufferOverflow => Err(format!(
                "error 7 of HP-GL: the polygon has more than {MOST_VERTICES} points, with those \
                 that close its parts: divide it"
            )),
            _ => {
                *self.unknown.entry(name.to_owned()).or_default() += 1;
                Ok(())
            }
        }
    }
}

/// The instruction to which the current byte belongs.
#[derive(Debug, Default)]
struct Instruction {
    /// The first letter of the next instruction, and its byte of the file, if the second letter has
    /// not come yet.
    letter: Option<(usize, u8)>,
    /// The first byte of the instruction.
    begin: usize,
    name: String,
    /// Whether a digit or a sign has followed the name.
    has_parameters: bool,
}

impl Instruction {
    /// Follows a byte of an instruction. Returns whether the name is complete by it, or the first
    /// parameter begins.
    fn follow(&mut self, at: usize, byte: u8) -> bool {
        match self.letter.take() {
            _ if !byte.is_ascii_alphabetic() => {
                let is_number = byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'.');
                return is_number && !std::mem::replace(&mut self.has_parameters, true);
            }
            None => self.letter = Some((at, byte)),
            Some((begin, first)) => {
                self.begin = begin;
                self.name = [first, byte]
                    .map(|byte| char::from(byte.to_ascii_uppercase()))
                    .into_iter()
                    .collect();
                self.has_parameters = false;
                return true;
            }
        }
        false
    }

    /// Whether it is one of [`WITHOUT_A_WORD`], and has the parameters that it needs.
    fn is_without_a_word(&self) -> bool {
        WITHOUT_A_WORD.contains(&self.name.as_str()) && self.has_parameters == (self.name != "PB")
    }
}

/// Reads the whole file. Returns the reason for a refusal and the byte where it stands.
fn read(bytes: &[u8]) -> Result<Reader, (usize, String)> {
    let (mut reader, mut dialect) = (Reader::new(), Dialect::new());
    // A file need not begin as HP-GL by a serial line does.
    for byte in *b"IN;" {
        dialect.take(byte);
    }
    let mut instruction = Instruction::default();
    // The byte where the name in quotation marks begins.
    let mut name_from = None;
    for (at, &byte) in bytes.iter().chain(b"\n;").enumerate() {
        // The end of the file ends its last instruction, but is not a letter of a label.
        let ends_with_semicolon = dialect.is_in_data() || dialect.is_in_comment();
        if at == bytes.len() && dialect.is_in_text() && !ends_with_semicolon {
            reader.endless = Some(instruction.begin);
            break;
        }
        let before = dialect;
        let token = dialect.take(byte);
        let name = instruction.name.as_str();
        match (before.is_in_comment(), dialect.is_in_comment()) {
            (false, true) => name_from = (byte == b'"').then_some(at),
            (true, false) if byte != b'"' => {
                reader.endless_name = reader.endless_name.or(name_from.take());
            }
            _ => {}
        }
        match token {
            Token::Control => continue,
            // In a label it is a letter of Latin-1; in texts that are not drawn it is nothing.
            Token::Text if byte == DAMAGED && !matches!(name, "PE" | "DT" | "SM") => {
                dialect = before;
                let letter = if name == "LB" { "ÿ" } else { "" };
                for byte in letter.bytes() {
                    reader.push(byte, instruction.begin).map_err(|why| (instruction.begin, why))?;
                }
                continue;
            }
            Token::Code | Token::Text if byte == DAMAGED => {
                return Err((at, "the byte 0xFF is no HP-GL: is the file damaged?".to_owned()));
            }
            Token::Leaves | Token::Line | Token::Begins(_) => {
                return Err((at, "a line that begins with $ ends HP-GL: remove it".to_owned()));
            }
            Token::Code | Token::Text => {}
        }
        if token == Token::Code {
            // The first letter of the next instruction ends this one; the second begins it.
            if instruction.follow(at, byte) {
                reader.sizes.follow(&instruction.name, instruction.has_parameters);
                reader.is_down = match instruction.name.as_str() {
                    "PD" => true,
                    "PU" => false,
                    _ => reader.is_down,
                };
                if instruction.is_without_a_word() {
                    *reader.unknown.entry(instruction.name.clone()).or_default() += 1;
                }
            }
        }
        let begin = instruction.begin;
        let refused = |reason| (begin, reason);
        reader.push(byte, begin).map_err(refused)?;
        let name = instruction.name.as_str();
        let draws = INKS.contains(&name) || reader.is_down && MOVES.contains(&name);
        if std::mem::take(&mut reader.has_gone) && reader.is_penless && draws {
            let (count, last) = reader.penless;
            reader.penless = (count + usize::from(last != begin), begin);
        }
        let is_in_polygon = reader.interpreter.is_in_polygon();
        reader.polygon = is_in_polygon.then(|| reader.polygon.unwrap_or(begin));
        if let Some(error) = reader.interpreter.take_error() {
            let name = instruction.name.clone();
            reader.judge(error, &name).map_err(refused)?;
        }
    }
    if reader.endless.is_none() && dialect.is_in_text() {
        reader.endless_comment = Some(instruction.begin);
    }
    reader.end_stroke();
    Ok(reader)
}

impl Format for HpGl {
    fn name(&self) -> &'static str {
        "HP-GL"
    }

    fn extensions(&self) -> &'static [&'static str] {
        &["hpgl", "plt", "hpg", "hgl"]
    }

    /// The file begins with an instruction that HP-GL files begin with, or with an escape.
    fn recognises(&self, beginning: &[u8]) -> bool {
        let text = beginning.trim_ascii_start();
        let begins =
            [&b"IN;"[..], b"in;", b";IN;", b"\x03IN;", b"DF;", b"PU;", b"SP1;", b"\x1B.", b"\x1B%"];
        begins.iter().any(|begin| text.starts_with(begin))
    }

    fn read(&self, file: String, bytes: Vec<u8>, _: &Arrangement) -> Result<Contents, ReadError> {
        let line_of = |at: usize| bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
        let text_at = |at: usize| {
            let text: Vec<u8> = bytes[at..].iter().copied().take(Origin::MOST_SHOWN + 1).collect();
            let end = text.iter().skip(2).position(|byte| matches!(byte, b';' | b'\n'));
            let end = end.map_or(text.len(), |end| end + 2);
            String::from_utf8_lossy(&text[..end]).into_owned()
        };
        let reader = read(&bytes).map_err(|(at, reason)| ReadError::Line {
            origin: Origin { file: file.clone(), line: line_of(at), text: text_at(at) },
            reason,
        })?;
        let mut plan = Plan::new(file.clone());
        let (mut line, mut counted_to) = (1, 0);
        for (pen, begin, points) in reader.strokes {
            line += bytes[counted_to..begin].iter().filter(|byte| **byte == b'\n').count();
            counted_to = begin;
            plan.begin(line, &text_at(begin));
            match points.split_first() {
                Some((dot, rest)) if rest.iter().all(|point| point == dot) => {
                    plan.draw_dot(*dot, None, pen, pen);
                }
                _ => plan.draw(points, None, pen),
            }
        }
        let mut notes: Vec<String> = Vec::new();
        for (name, count) in &reader.unknown {
            notes.push(match count {
                1 => format!("1 instruction {name} is not obeyed"),
                count => format!("{count} instructions {name} are not obeyed"),
            });
        }
        if reader.sizes.is_guessed {
            notes.push(
                "the size depends on P1 and P2, which the file does not set (IP): they are taken \
                 to be those of an HP 7475A with A4 paper"
                    .to_owned(),
            );
        }
        if reader.penless.0 > 0 {
            let count = counted(reader.penless.0, ["instruction draws", "instructions draw"]);
            notes.push(format!("{count} nothing, because SP0 has put the pen away"));
        }
        if reader.sheets > 1 {
            notes.push(format!(
                "the file fills {} sheets of paper (PG), and only the first one is drawn: make a \
                 file of each",
                reader.sheets
            ));
        }
        if let Some(begin) = reader.polygon {
            notes.push(format!(
                "the polygon that begins in line {} has no end (PM2): all moves that follow it are \
                 its points, and are not drawn",
                line_of(begin)
            ));
        }
        if let Some(begin) = reader.endless {
            notes.push(format!(
                "the label that begins in line {} has no end (the byte 3): all that follows it is \
                 drawn as text",
                line_of(begin)
            ));
        }
        if let Some(begin) = reader.endless_comment {
            notes.push(format!(
                "the comment that begins in line {} has no end (another \"): all that follows it \
                 is left out",
                line_of(begin)
            ));
        }
        if let Some(begin) = reader.endless_name {
            notes.push(format!(
                "the name that begins in line {} has no end (another \"): all that follows it in \
                 its line is left out",
                line_of(begin)
            ));
        }
        if plan.is_empty() {
            let mut reason = "there is nothing to draw in this HP-GL".to_owned();
            notes.iter().for_each(|note| reason += &format!("; {note}"));
            return Err(ReadError::Content { file, reason });
        }
        Ok(plan.contents(None, notes))
    }
}

#[cfg(test)]
mod tests;
