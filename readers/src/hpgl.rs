//! Reads HP-GL as a plan: 40 plotter units in a millimetre, each pen number a pen.
//!
//! Read are `PU PD PA PR SP IN DF`, arcs and circles (`AA AR CI`), rectangles and wedges as their
//! outlines (`EA ER RA RR EW WG`), the scale (`IP SC RO`) and the encoded polylines of HP-GL/2
//! (`PE`). Speeds, line types and the like have no effect on a plan. Labels and what else would
//! ink are counted and said. The reader refuses numbers that it cannot read.

mod encoded;

use super::arrange::Arrangement;
use super::error::ReadError;
use super::format::{Contents, Format};
use super::plan::Plan;
use crate::lines::Origin;
use std::collections::BTreeMap;

/// The format itself.
#[derive(Debug)]
pub(super) struct HpGl;

/// The length of a plotter unit in mm.
const UNIT: f64 = 0.025;

/// The greatest distance between an arc and its chords, in plotter units: 0.005 mm.
const CHORD_ERROR: f64 = 0.2;

/// The corners P1 and P2 of an HP 7475A with a page of A4, in plotter units.
const CORNERS: [[f64; 2]; 2] = [[603.0, 521.0], [10603.0, 7721.0]];

/// The most points of a file. They take 160 MB.
const MOST_POINTS: usize = 10_000_000;

/// Instructions without effect on a plan.
const SILENT: &[&str] = &[
    "VS", "FS", "AS", "LT", "PT", "FT", "CP", "DT", "SI", "SR", "DI", "DR", "SL", "CS", "CA", "SS",
    "SA", "SM", "TL", "OI", "OS", "OE", "OH", "OP", "OA", "IM", "IW", "DC", "DP", "WU", "PW", "CR",
    "NP", "PC", "TR", "CO", "BP", "PS", "PG", "NR", "RP", "SV", "UL", "LA", "SD", "AD", "LO", "ES",
    "FI", "FN", "SB", "TD", "AC", "MC", "QL", "RF", "EC",
];

/// What a file has drawn so far.
#[derive(Debug)]
struct Plotter {
    /// The position in plotter units.
    at: [f64; 2],
    is_down: bool,
    is_relative: bool,
    pen: u32,
    corners: [[f64; 2]; 2],
    /// The user units at P1 and P2: least and greatest x, least and greatest y.
    scale: Option<[f64; 4]>,
    /// How many quarters of a turn the page is turned.
    quarters: u8,
    stroke: Vec<[f64; 2]>,
    /// The pen and the points of each stroke, in plotter units, and where it begins in the file.
    strokes: Vec<(u32, usize, Vec<[f64; 2]>)>,
    points: usize,
    /// The byte at which the present instruction begins.
    begin: usize,
    /// The instructions that were not obeyed, with their count.
    unknown: BTreeMap<String, usize>,
}

impl Plotter {
    fn new() -> Self {
        Self {
            at: [0.0; 2],
            is_down: false,
            is_relative: false,
            pen: 1,
            corners: CORNERS,
            scale: None,
            quarters: 0,
            stroke: Vec::new(),
            strokes: Vec::new(),
            points: 0,
            begin: 0,
            unknown: BTreeMap::new(),
        }
    }

    /// The point in plotter units that these coordinates mean.
    fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.scale {
            None => [x, y],
            Some(_) => {
                let ([ax, ay], [kx, ky]) = self.user();
                [ax + x * kx, ay + y * ky]
            }
        }
    }

    /// Where user units begin, and how many plotter units one has.
    fn user(&self) -> ([f64; 2], [f64; 2]) {
        let Some([x1, x2, y1, y2]) = self.scale else { return ([0.0; 2], [1.0; 2]) };
        let [[px1, py1], [px2, py2]] = self.corners;
        let (kx, ky) = ((px2 - px1) / (x2 - x1), (py2 - py1) / (y2 - y1));
        ([px1 - x1 * kx, py1 - y1 * ky], [kx, ky])
    }

    /// A distance in plotter units.
    fn distance(&self, [dx, dy]: [f64; 2]) -> [f64; 2] {
        let (_, [kx, ky]) = self.user();
        [dx * kx, dy * ky]
    }

    fn end_stroke(&mut self) {
        if self.stroke.len() > 1 {
            self.strokes.push((self.pen, self.begin, std::mem::take(&mut self.stroke)));
        }
        self.stroke.clear();
    }

    fn go(&mut self, to: [f64; 2]) {
        if self.is_down {
            if self.stroke.is_empty() {
                self.stroke.push(self.at);
            }
            self.stroke.push(to);
            self.points += 1;
        }
        self.at = to;
    }

    /// Moves by pairs of coordinates.
    fn plot(&mut self, numbers: &[f64]) -> Result<(), String> {
        let (pairs, rest) = numbers.as_chunks();
        for &pair in pairs {
            let to = if self.is_relative {
                let [dx, dy] = self.distance(pair);
                [self.at[0] + dx, self.at[1] + dy]
            } else {
                self.point(pair)
            };
            self.go(to);
        }
        if rest.is_empty() { Ok(()) } else { Err("a coordinate has no partner".to_owned()) }
    }

    /// Goes along an arc about `centre` by `degrees`, counterclockwise.
    fn arc(&mut self, centre: [f64; 2], degrees: f64) -> Result<(), String> {
        let [x, y] = [self.at[0] - centre[0], self.at[1] - centre[1]];
        let radius = x.hypot(y);
        if radius <= 0.0 {
            return Ok(());
        }
        let most = 2.0 * (1.0 - CHORD_ERROR / radius.max(2.0 * CHORD_ERROR)).acos();
        let turn = degrees.to_radians();
        let chords = (turn.abs() / most).ceil().max(1.0);
        if chords > MOST_POINTS as f64 {
            return Err("the arc is too long".to_owned());
        }
        for index in 1..=chords as usize {
            let (sine, cosine) = (turn * index as f64 / chords).sin_cos();
            self.go([centre[0] + x * cosine - y * sine, centre[1] + x * sine + y * cosine]);
        }
        Ok(())
    }

    /// Draws a closed outline through these points, and returns to where the pen was.
    fn outline(&mut self, points: &[[f64; 2]]) {
        let (at, was_down) = (self.at, self.is_down);
        self.end_stroke();
        self.is_down = false;
        let closed = points.iter().chain(points.first());
        closed.for_each(|point| {
            self.go(*point);
            self.is_down = true;
        });
        self.end_stroke();
        (self.at, self.is_down) = (at, was_down);
    }

    fn rectangle(&mut self, [x, y]: [f64; 2]) {
        let [ax, ay] = self.at;
        self.outline(&[[ax, ay], [x, ay], [x, y], [ax, y]]);
    }

    /// Carries out an instruction with its numbers.
    fn instruction(&mut self, name: &str, numbers: &[f64]) -> Result<(), String> {
        let number = |index: usize| numbers.get(index).copied();
        let two = || Some([number(0)?, number(1)?]);
        let needs =
            |what: Option<[f64; 2]>| what.ok_or_else(|| format!("{name} needs two numbers"));
        match name {
            "PU" | "PD" => {
                let is_down = name == "PD";
                if !is_down {
                    self.end_stroke();
                }
                self.is_down = is_down;
                self.plot(numbers)?;
            }
            "PA" | "PR" => {
                self.is_relative = name == "PR";
                self.plot(numbers)?;
            }
            "SP" => {
                self.end_stroke();
                // Pen 0 puts the pen away.
                self.pen = number(0).filter(|pen| *pen >= 1.0).map_or(self.pen, |pen| pen as u32);
            }
            "IN" | "DF" => {
                self.end_stroke();
                let fresh = Self::new();
                self.is_relative = false;
                self.scale = None;
                if name == "IN" {
                    (self.at, self.is_down) = (fresh.at, false);
                    (self.corners, self.quarters, self.pen) = (fresh.corners, 0, 1);
                }
            }
            "IP" => {
                self.corners = match *numbers {
                    [] => CORNERS,
                    [x, y] => {
                        let [[ax, ay], [bx, by]] = self.corners;
                        [[x, y], [x + bx - ax, y + by - ay]]
                    }
                    [x1, y1, x2, y2] => [[x1, y1], [x2, y2]],
                    _ => return Err("IP needs two or four numbers".to_owned()),
                };
            }
            "SC" => {
                self.scale = match *numbers {
                    [] => None,
                    [x1, x2, y1, y2] if x1 != x2 && y1 != y2 => Some([x1, x2, y1, y2]),
                    // The kinds of HP-GL/2: equal units, and units from P1 on.
                    [x1, x2, y1, y2, kind, ..] if kind == 1.0 && x1 != x2 && y1 != y2 => {
                        Some(self.isotropic([x1, x2, y1, y2]))
                    }
                    [x1, kx, y1, ky, 2.0] if kx != 0.0 && ky != 0.0 => {
                        let [[px1, py1], [px2, py2]] = self.corners;
                        Some([x1, x1 + (px2 - px1) / kx, y1, y1 + (py2 - py1) / ky])
                    }
                    _ => return Err("SC needs four numbers, two and two different".to_owned()),
                };
            }
            "RO" => {
                let turn = number(0).unwrap_or(0.0).rem_euclid(360.0);
                if turn % 90.0 != 0.0 {
                    return Err("RO turns by 0, 90, 180 or 270".to_owned());
                }
                self.quarters = (turn / 90.0) as u8;
            }
            "AA" | "AR" => {
                let pair = needs(two())?;
                let degrees = number(2).ok_or("an arc needs an angle")?;
                let centre = if name == "AA" {
                    self.point(pair)
                } else {
                    let [dx, dy] = self.distance(pair);
                    [self.at[0] + dx, self.at[1] + dy]
                };
                self.arc(centre, degrees)?;
            }
            "CI" => {
                let radius = number(0).ok_or("CI needs a radius")?;
                let [radius, _] = self.distance([radius, 0.0]);
                let (centre, was_down) = (self.at, self.is_down);
                self.end_stroke();
                self.is_down = false;
                self.go([centre[0] + radius, centre[1]]);
                self.is_down = true;
                self.arc(centre, 360.0)?;
                self.end_stroke();
                (self.at, self.is_down) = (centre, was_down);
            }
            "EA" | "RA" => {
                let corner = self.point(needs(two())?);
                self.rectangle(corner);
            }
            "ER" | "RR" => {
                let [dx, dy] = self.distance(needs(two())?);
                self.rectangle([self.at[0] + dx, self.at[1] + dy]);
            }
            "EW" | "WG" => {
                let (Some(radius), Some(start), Some(sweep)) = (number(0), number(1), number(2))
                else {
                    return Err(format!("{name} needs three numbers"));
                };
                let [radius, _] = self.distance([radius, 0.0]);
                let (centre, was_down) = (self.at, self.is_down);
                let (sine, cosine) = start.to_radians().sin_cos();
                self.end_stroke();
                self.is_down = true;
                self.go([centre[0] + radius * cosine, centre[1] + radius * sine]);
                self.arc(centre, sweep)?;
                self.go(centre);
                self.end_stroke();
                (self.at, self.is_down) = (centre, was_down);
            }
            name if SILENT.contains(&name) => {}
            name => *self.unknown.entry(name.to_owned()).or_default() += 1,
        }
        if self.points > MOST_POINTS {
            return Err("the file has too many points: leave a part of it out".to_owned());
        }
        Ok(())
    }

    /// The scale with equal units on both axes, in the middle of P1 and P2.
    fn isotropic(&self, [x1, x2, y1, y2]: [f64; 4]) -> [f64; 4] {
        let [[px1, py1], [px2, py2]] = self.corners;
        let unit = ((px2 - px1) / (x2 - x1)).abs().min(((py2 - py1) / (y2 - y1)).abs());
        let widened = |from: f64, to: f64, length: f64| {
            let extra = (length.abs() / unit - (to - from).abs()) / 2.0 * (to - from).signum();
            [from - extra, to + extra]
        };
        let ([x1, x2], [y1, y2]) = (widened(x1, x2, px2 - px1), widened(y1, y2, py2 - py1));
        [x1, x2, y1, y2]
    }

    /// The place on the page in mm of a point in plotter units.
    fn on_page(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [x, y] = match self.quarters {
            1 => [-y, x],
            2 => [-x, -y],
            3 => [y, -x],
            _ => [x, y],
        };
        [x * UNIT, y * UNIT]
    }
}

/// Reads the whole file. Returns the reason for a refusal and the byte where it stands.
fn read(bytes: &[u8]) -> Result<Plotter, (usize, String)> {
    let mut plotter = Plotter::new();
    let mut at = 0;
    let mut terminator = 0x03;
    while let Some(&byte) = bytes.get(at) {
        if byte == 0x1B {
            // ESC . letter numbers : is an order to the interface, ESC % 0 B begins HP-GL.
            at += 2;
            let end = match bytes.get(at - 1) {
                Some(b'.') if matches!(bytes.get(at), Some(b'(' | b')' | b'Y' | b'Z' | b'K')) => 0,
                Some(b'.') => {
                    let rest = bytes.get(at..).unwrap_or_default();
                    let is_part =
                        |byte: &u8| byte.is_ascii_digit() || b";@HIMNPQRTA".contains(byte);
                    rest.iter().position(|byte| !is_part(byte)).unwrap_or(rest.len())
                }
                _ => {
                    let rest = bytes.get(at..).unwrap_or_default();
                    rest.iter().position(u8::is_ascii_uppercase).unwrap_or(rest.len())
                }
            };
            at += end + 1;
            continue;
        }
        let Some(second) = bytes.get(at + 1).filter(|_| byte.is_ascii_alphabetic()) else {
            at += 1;
            continue;
        };
        let name = [byte, *second].map(|byte| char::from(byte.to_ascii_uppercase()));
        let name: String = name.iter().collect();
        plotter.begin = at;
        let begin = at;
        at += 2;
        let rest = bytes.get(at..).unwrap_or_default();
        let find = |is_end: &dyn Fn(u8) -> bool| {
            rest.iter().position(|byte| is_end(*byte)).unwrap_or(rest.len())
        };
        let refused = |reason| (begin, reason);
        match name.as_str() {
            "LB" | "BL" | "WD" => {
                *plotter.unknown.entry("LB".to_owned()).or_default() += 1;
                at += find(&|byte| byte == terminator) + 1;
            }
            "DT" => {
                terminator = match rest.first() {
                    None | Some(b';') => 0x03,
                    Some(byte) => *byte,
                };
                at += find(&|byte| byte == b';') + 1;
            }
            "PE" => {
                let end = find(&|byte| byte == b';');
                plotter.polyline(&rest[..end]).map_err(refused)?;
                at += end + 1;
            }
            _ => {
                let end = find(&|byte| byte == b';' || byte.is_ascii_alphabetic() || byte == 0x1B);
                let numbers = numbers(&rest[..end]).map_err(refused)?;
                plotter.instruction(&name, &numbers).map_err(refused)?;
                at += end;
            }
        }
    }
    plotter.end_stroke();
    Ok(plotter)
}

fn numbers(text: &[u8]) -> Result<Vec<f64>, String> {
    let text = String::from_utf8_lossy(text);
    let is_between = |letter: char| letter == ',' || letter.is_whitespace();
    let words = text.split(is_between).filter(|word| !word.is_empty());
    let number = |word: &str| word.parse().map_err(|_| format!("\"{word}\" is no number"));
    words.map(number).collect()
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
        let begins = [&b"IN;"[..], b"in;", b"DF;", b"PU;", b"SP1;", b"\x1B.", b"\x1B%"];
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
        let plotter = read(&bytes).map_err(|(at, reason)| ReadError::Line {
            origin: Origin { file: file.clone(), line: line_of(at), text: text_at(at) },
            reason,
        })?;
        let mut plan = Plan::new(file.clone());
        let (mut line, mut counted_to) = (1, 0);
        for (pen, begin, points) in &plotter.strokes {
            line += bytes[counted_to..*begin].iter().filter(|byte| **byte == b'\n').count();
            counted_to = *begin;
            plan.begin(line, text_at(*begin));
            plan.draw(points.iter().map(|point| plotter.on_page(*point)), None, *pen);
        }
        let mut notes: Vec<String> = Vec::new();
        for (name, count) in &plotter.unknown {
            notes.push(match (name.as_str(), count) {
                ("LB", 1) => "1 label is not drawn: convert text to paths".to_owned(),
                ("LB", count) => format!("{count} labels are not drawn: convert text to paths"),
                (name, 1) => format!("1 instruction {name} is not obeyed"),
                (name, count) => format!("{count} instructions {name} are not obeyed"),
            });
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
