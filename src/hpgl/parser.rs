//! Takes the bytes of instructions, and carries each instruction out at its end.

use super::coordinates::{Point, UNIT, UNITS_PER_MM};
use super::dialect::Comment;
use super::interpreter::{ErrorNumber, Interpreter, Step};
use super::line_type::{LineStyle, PatternLength};
use super::number::Parsed;
use super::outline::{Chord, sine_and_cosine};
use super::polygon::PolygonBuffer;
use super::{DAMAGED, LABEL_END, dialect};

/// How the next byte is interpreted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    /// An instruction.
    Code,
    /// The text of a label.
    Label,
    /// A text that is not drawn.
    Skipped,
    /// A comment, a name in quotation marks, or a line of PJL.
    Comment(Comment),
    /// The byte that ends labels.
    Terminator,
    /// The byte that is drawn at each point.
    Symbol,
    /// An encoded polyline.
    Encoded,
}

/// Instructions that have no effect on what is drawn, or that penup carries out in its own way.
#[rustfmt::skip]
const WITHOUT_EFFECT: &[[u8; 2]] = &[
    *b"AC", *b"AD", *b"AP", *b"AS", *b"BP", *b"CM", *b"CR", *b"CV", *b"DC", *b"DP", *b"EC",
    *b"FI", *b"FN", *b"FS", *b"GM", *b"GC", *b"GP", *b"IM", *b"KY", *b"LA", *b"MC", *b"MG", *b"NP",
    *b"NR", *b"PB", *b"PC", *b"PS", *b"PW", *b"QL", *b"RF", *b"RP", *b"SB", *b"SG", *b"SV", *b"TD",
    *b"TR", *b"UL", *b"WU",
];

impl<B: PolygonBuffer> Interpreter<B> {
    /// Takes a byte of HP-GL without instructions to the interface. Before the next byte, take all
    /// that [`Interpreter::next_action`] returns.
    pub fn push(&mut self, byte: u8) {
        if byte == DAMAGED {
            self.lose();
        }
        match self.mode {
            Mode::Code => self.push_code(byte),
            Mode::Label => self.push_text(byte),
            Mode::Skipped if byte == self.text.terminator => self.mode = Mode::Code,
            Mode::Comment(ref mut comment) => {
                if comment.ends_with(byte) {
                    self.mode = Mode::Code;
                    // A semicolon or a line end also ends the instruction.
                    if byte != b'"' {
                        self.push_code(byte);
                    }
                }
            }
            Mode::Skipped => {}
            Mode::Terminator => {
                self.text.terminator = dialect::terminator(byte);
                // A number may follow.
                (self.mode, self.name) = (Mode::Code, *b"DT");
            }
            Mode::Symbol => {
                self.text.symbol = if matches!(byte, b'!'..=b':' | b'<'..=b'~') { byte } else { 0 };
                self.mode = Mode::Code;
            }
            Mode::Encoded => {
                if self.push_encoded(byte) {
                    self.mode = Mode::Code;
                }
            }
        }
    }

    /// Takes a byte of an instruction.
    fn push_code(&mut self, byte: u8) {
        if byte.is_ascii_alphabetic() {
            let byte = byte.to_ascii_uppercase();
            if self.letter == 0 {
                self.end_instruction();
                self.letter = byte;
            } else {
                let first = core::mem::take(&mut self.letter);
                self.begin_instruction([first, byte]);
            }
            return;
        }
        if core::mem::take(&mut self.letter) != 0 {
            self.fail(ErrorNumber::Unknown);
        }
        match byte {
            b'0'..=b'9' | b'.' | b'+' | b'-' => {
                let before = self.number.push(byte);
                self.take_number(before);
            }
            b';' => self.end_instruction(),
            b'\n' | b'\r' => self.end_line(),
            b'@' => {
                self.end_instruction();
                self.mode = Mode::Comment(Comment::LINE);
            }
            DAMAGED => self.forget_instruction(),
            _ => {
                let number = self.number.end();
                self.take_number(number);
                if byte == b'"' && dialect::takes_name(self.name) {
                    self.mode = Mode::Comment(Comment::NAME);
                }
            }
        }
    }

    /// Begins an instruction after its two letters.
    fn begin_instruction(&mut self, name: [u8; 2]) {
        self.forget_instruction();
        match &name {
            b"LB" => {
                self.mode = Mode::Label;
                self.partial = (0, 0);
            }
            b"BL" | b"WD" => {
                self.mode = Mode::Skipped;
                self.fail(ErrorNumber::Unknown);
            }
            b"CO" => self.mode = Mode::Comment(Comment::BEGUN),
            b"DT" => self.mode = Mode::Terminator,
            b"SM" => self.mode = Mode::Symbol,
            b"PE" => {
                self.mode = Mode::Encoded;
                self.begin_polyline();
            }
            _ => self.name = name,
        }
        if dialect::resets_terminator(name) {
            self.text.terminator = LABEL_END;
        }
        // PD alone makes a dot, which is known at its end only.
        if &name == b"PU" {
            self.is_down = false;
        }
    }

    /// Whether each pair of coordinates of the instruction is drawn as soon as it comes.
    fn draws_pairs(&self) -> bool {
        matches!(&self.name, b"PU" | b"PD" | b"PA" | b"PR")
    }

    /// Takes a number of the instruction.
    fn take_number(&mut self, number: Parsed) {
        match number {
            Parsed::None => return,
            Parsed::Bad => {
                self.is_bad = true;
                self.fail(ErrorNumber::BadParameter);
            }
            Parsed::Value(value) => {
                if let Some(slot) = self.numbers.get_mut(self.count) {
                    *slot = value;
                }
            }
        }
        self.count = self.count.saturating_add(1);
        if !self.draws_pairs() || self.count < 2 {
            return;
        }
        let [x, y, ..] = self.numbers;
        self.count = 0;
        self.has_pairs = true;
        self.set_pen_and_mode();
        if core::mem::take(&mut self.is_bad) {
            self.overflow();
            return self.fail(ErrorNumber::BadParameter);
        }
        self.go(Point { x, y }, self.is_relative);
    }

    /// Puts in force what the name of `PD`, `PA` or `PR` says.
    fn set_pen_and_mode(&mut self) {
        match &self.name {
            b"PD" => self.is_down = true,
            b"PA" => self.is_relative = false,
            b"PR" => self.is_relative = true,
            _ => {}
        }
    }

    /// Ends a line, which ends an instruction; but coordinates may go on in the next line. So it is
    /// known only there whether `PD` makes a dot.
    fn end_line(&mut self) {
        if !self.draws_pairs() {
            return self.end_instruction();
        }
        let number = self.number.end();
        self.take_number(number);
    }

    /// Ends the instruction and carries it out.
    fn end_instruction(&mut self) {
        let number = self.number.end();
        self.take_number(number);
        let (name, count) = (self.name, self.count);
        let numbers = self.numbers;
        let given = numbers.get(..count.min(numbers.len())).unwrap_or(&[]);
        if name == [0; 2] {
            if count > 0 {
                self.fail(ErrorNumber::Unknown);
            }
        } else if self.draws_pairs() {
            let was_down = self.is_down;
            self.set_pen_and_mode();
            if count > 0 {
                self.fail(ErrorNumber::WrongCount);
            } else if !self.has_pairs && self.is_down && !was_down && !self.is_lost {
                // In a polygon nothing is drawn yet.
                if !self.polygon.is_open {
                    self.add(Step::Dot);
                }
            }
        } else if !self.is_bad
            && let Err(error) = self.carry_out(name, given)
        {
            self.fail(error);
        }
        self.forget_instruction();
    }

    /// Forgets the name and the numbers of the instruction.
    pub(super) fn forget_instruction(&mut self) {
        let _ = self.number.end();
        (self.name, self.count) = ([0; 2], 0);
        (self.has_pairs, self.is_bad) = (false, false);
    }

    /// Carries out an instruction with its numbers.
    fn carry_out(&mut self, name: [u8; 2], numbers: &[i64]) -> Result<(), ErrorNumber> {
        let number = |index: usize| numbers.get(index).copied().ok_or(ErrorNumber::WrongCount);
        let pair = || Ok(Point { x: number(0)?, y: number(1)? });
        let at_most = |count: usize| {
            if numbers.len() > count { Err(ErrorNumber::WrongCount) } else { Ok(()) }
        };
        let bad = ErrorNumber::BadParameter;
        // Shapes that begin where the pen is need a known position.
        let is_drawn_apart = matches!(
            &name,
            b"EA" | b"EP" | b"ER" | b"EW" | b"FP" | b"RA" | b"RR" | b"WG" | b"XT" | b"YT"
        );
        let is_shape = is_drawn_apart || matches!(&name, b"AA" | b"AR" | b"CI" | b"PM");
        if self.is_lost && is_shape {
            return Ok(());
        }
        // A polygon is made of lines, arcs and circles alone.
        if self.polygon.is_open && is_drawn_apart {
            return Err(ErrorNumber::Unknown);
        }
        let chord = |index: usize| match numbers.get(index) {
            None => Ok(None),
            Some(0) => Err(ErrorNumber::BadParameter),
            Some(angle) if !self.bounds_deviation => Ok(Some(Chord::Angle(*angle))),
            Some(distance) => {
                let distance = self.frame.length(Point { x: *distance, y: 0 });
                Ok(Some(Chord::Off(distance.ok_or(ErrorNumber::Overflow)?.x)))
            }
        };
        match &name {
            b"IN" => self.add(Step::Initialize),
            b"DF" => self.set_defaults(),
            b"SP" => self.choose_pen(numbers.first().map_or(0, |pen| pen / UNIT))?,
            b"VS" => {
                let speed = numbers.first().copied().unwrap_or(0);
                if speed != 0 && !(UNIT / 1000..=128 * UNIT).contains(&speed) {
                    return Err(bad);
                }
                self.speed = speed;
            }
            b"IP" => {
                if !self.frame.set_corners(numbers) {
                    return Err(ErrorNumber::WrongCount);
                }
                self.has_new_corners = true;
            }
            b"SC" => {
                if !matches!(numbers.len(), 0 | 4 | 5 | 7) {
                    return Err(ErrorNumber::WrongCount);
                }
                let before = self.frame;
                if !self.frame.set_scale(numbers) {
                    self.frame = before;
                    return Err(bad);
                }
            }
            b"IW" => {
                let corners = match *numbers {
                    [] => None,
                    [x1, y1, x2, y2] => Some([Point { x: x1, y: y1 }, Point { x: x2, y: y2 }]),
                    _ => return Err(ErrorNumber::WrongCount),
                };
                self.frame.set_window(corners).ok_or(bad)?;
            }
            b"RO" => {
                let degrees = numbers.first().copied().unwrap_or(0);
                let quarters = degrees / (90 * UNIT);
                if degrees % (90 * UNIT) != 0 || !(0..4).contains(&quarters) {
                    return Err(bad);
                }
                at_most(1)?;
                self.frame.rotate(quarters as u8);
            }
            b"AA" | b"AR" => {
                let (point, sweep, chord) = (pair()?, number(2)?, chord(3)?);
                at_most(4)?;
                let center = if &name == b"AA" {
                    self.frame.position(point)
                } else {
                    self.frame.distance(point).and_then(|distance| distance.plus(self.at))
                };
                self.text.advanced = Point::default();
                let center = center.ok_or(ErrorNumber::Overflow)?;
                if self.polygon.is_open {
                    self.add_arc(center, sweep, chord);
                } else {
                    self.arc(center, sweep, chord);
                }
            }
            b"CI" => {
                let (radius, chord) = (number(0)?, chord(1)?);
                at_most(2)?;
                let radius = self.frame.distance(Point { x: radius, y: 0 });
                let radius = radius.ok_or(ErrorNumber::Overflow)?;
                if self.polygon.is_open {
                    self.add_circle(radius, chord);
                } else {
                    self.circle(radius, chord);
                }
            }
            b"EA" | b"RA" => {
                let corner = pair()?;
                at_most(2)?;
                let corner = self.frame.position(corner).ok_or(ErrorNumber::Overflow)?;
                if &name == b"EA" {
                    self.rectangle(corner);
                } else {
                    self.fill_rectangle(corner)?;
                }
            }
            b"ER" | b"RR" => {
                let offset = pair()?;
                at_most(2)?;
                let corner = self.frame.distance(offset).and_then(|offset| offset.plus(self.at));
                let corner = corner.ok_or(ErrorNumber::Overflow)?;
                if &name == b"ER" {
                    self.rectangle(corner);
                } else {
                    self.fill_rectangle(corner)?;
                }
            }
            b"EW" | b"WG" => {
                let (radius, start, sweep, chord) = (number(0)?, number(1)?, number(2)?, chord(3)?);
                at_most(4)?;
                let angle = sine_and_cosine(start as f64 / 65536.0);
                let radius = self.frame.distance(Point { x: radius, y: 0 }.rotated(angle));
                let radius = radius.ok_or(ErrorNumber::Overflow)?;
                if &name == b"EW" {
                    self.wedge(radius, sweep, chord);
                } else {
                    self.fill_wedge(radius, sweep, chord)?;
                }
            }
            b"CT" => match *numbers {
                [] | [0] => self.bounds_deviation = false,
                [UNIT] => self.bounds_deviation = true,
                [_] => return Err(bad),
                _ => return Err(ErrorNumber::WrongCount),
            },
            b"PM" => self.polygon_mode(numbers)?,
            b"EP" => {
                at_most(0)?;
                self.edge_polygon();
            }
            b"FP" => {
                at_most(1)?;
                // Parts that lie in others are holes; HP-GL/2 knows another way, 1.
                if numbers.first().is_some_and(|kind| *kind != 0) {
                    return Err(bad);
                }
                self.fill_polygon()?;
            }
            b"FT" => self.choose_fill(numbers)?,
            b"PT" => self.choose_thickness(numbers)?,
            b"XT" | b"YT" => {
                at_most(0)?;
                if !self.is_lost {
                    self.tick(&name == b"XT");
                }
            }
            b"TL" => {
                at_most(2)?;
                self.ticks = match *numbers {
                    [] => [UNIT / 2; 2],
                    [forth] => [forth, 0],
                    [forth, back, ..] => [forth, back],
                };
            }
            b"LT" => self.choose_line_type(numbers)?,
            b"SI" | b"SR" | b"DI" | b"DR" | b"SL" => self.choose_text_style(&name, numbers)?,
            b"CP" => match *numbers {
                [] => self.control_letter(b'\r', true),
                [columns, lines] => self.space([columns, lines]),
                _ => return Err(ErrorNumber::WrongCount),
            },
            b"CA" | b"CS" => {
                let set = numbers.first().copied().unwrap_or(0) / UNIT;
                at_most(1)?;
                if !matches!(set, 0..=4 | 6..=9 | 30..=39) {
                    return Err(ErrorNumber::UnknownSet);
                }
            }
            b"SA" | b"SS" => at_most(0)?,
            // Labels begin where the pen is. Others would have to be known whole before they begin.
            b"LO" => match *numbers {
                [] | [UNIT] => {}
                _ => return Err(ErrorNumber::Unknown),
            },
            // The terminator is not drawn, which is what the mode 1 asks for.
            b"DT" => match *numbers {
                [] | [UNIT] => {}
                [_] => return Err(bad),
                _ => return Err(ErrorNumber::WrongCount),
            },
            [b'O', letter] => {
                at_most(0)?;
                if !self.query(*letter) {
                    return Err(ErrorNumber::Unknown);
                }
            }
            b"AF" | b"AH" | b"FR" | b"PG" => self.end_sheet(),
            name if WITHOUT_EFFECT.contains(name) => {}
            _ => return Err(ErrorNumber::Unknown),
        }
        Ok(())
    }

    /// `SP`, and the pens of `PE`: the pen with this number is needed.
    pub(super) fn choose_pen(&mut self, number: i64) -> Result<(), ErrorNumber> {
        let pen = u8::try_from(number).ok().filter(|pen| *pen <= 32);
        self.add(Step::Pen(pen.ok_or(ErrorNumber::BadParameter)?));
        Ok(())
    }

    /// `LT`: how lines are drawn.
    fn choose_line_type(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
        let [number, rest @ ..] = numbers else {
            self.line = LineStyle::SOLID;
            return Ok(());
        };
        let kind = (number / UNIT).unsigned_abs();
        let length = match *rest {
            [] => self.line.length,
            // The third number is of HP-GL/2: 0 for percent, 1 for mm.
            [percent] | [percent, 0] if percent > 0 && percent <= 127 * UNIT => {
                PatternLength::Percent(percent)
            }
            [mm, UNIT] if mm > 0 && mm <= 1000 * UNIT => PatternLength::Units(mm * UNITS_PER_MM),
            [_] | [_, _] => return Err(ErrorNumber::BadParameter),
            _ => return Err(ErrorNumber::WrongCount),
        };
        match u8::try_from(kind) {
            Ok(kind @ 0..=6) => {
                self.line = LineStyle::chosen(kind, length);
                Ok(())
            }
            _ => Err(ErrorNumber::BadParameter),
        }
    }
}
