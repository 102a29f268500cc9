//! Texts: their lines, where these stand, and the strokes of their letters.
//!
//! All texts are drawn in the plotter's own stroke font, whatever font the file names. Position,
//! height, width, slant, direction and alignment are those of the file. Of the codes within a
//! paragraph text, breaks, heights, fractions and letters count; colours, fonts and lines below
//! letters are left out.

use super::curves::Affine;
use super::document::{Entity, LineError};
use super::space::Plane;
use crate::plan::Point;
use penup::drawing::Title;
use penup::fixed::Millimetres;

/// The height of capitals in units of the font.
const CAPITAL: f64 = 21.0;
/// The distance by which the lowest letters reach below their line, as a part of the height.
const DEPTH: f64 = 1.0 / 3.0;
/// The distance of the lines of a paragraph, as a part of the height.
const LEADING: f64 = 5.0 / 3.0;
/// A space at which no line is broken.
const UNBROKEN: &str = "\u{A0}";
/// The most letters of a piece. Its width in units of the font is below 2^15.
const MOST_LETTERS: usize = 1000;

/// A run of letters of one height.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    text: String,
    /// The height of capitals, in units of the file.
    height: f64,
}

impl Run {
    /// The width in units of the file.
    fn width(&self) -> f64 {
        self.title().width().to_num::<f64>() * self.height / CAPITAL
    }

    /// The letters in units of the font, each of which is a step.
    fn title(&self) -> Title<'_> {
        Title { text: &self.text, height: Millimetres::from_num(CAPITAL) }
    }

    /// The strokes of the letters, in units of the file, from the beginning of their line.
    fn strokes(&self) -> Vec<Vec<Point>> {
        let mut strokes: Vec<Vec<Point>> = Vec::new();
        let steps = [Millimetres::from_num(1); 2];
        let none = Millimetres::from_num(0);
        let drawn = self.title().draw(none, none, steps, &mut |line| {
            let [from, to] = line
                .map(|point| [point.x, point.y].map(|at| f64::from(at) * self.height / CAPITAL));
            match strokes.last_mut() {
                Some(stroke) if stroke.last() == Some(&from) => stroke.push(to),
                _ => strokes.push(vec![from, to]),
            }
            Ok::<(), std::convert::Infallible>(())
        });
        // Nothing above is an error.
        drawn.map_or(Vec::new(), |()| strokes)
    }
}

/// The text of an entity, as strokes.
#[derive(Debug, Default)]
pub(super) struct Writing {
    /// The strokes of all letters, where and how they stand before the plane of the entity.
    pub(super) strokes: Vec<Vec<Point>>,
    /// The letters that are not in the font, which are drawn as boxes.
    pub(super) unknown: usize,
}

impl Writing {
    /// Writes a line so that its beginning comes to the origin of `place`.
    fn write(&mut self, line: &[Run], place: Affine) {
        let mut at = 0.0;
        for run in line {
            self.unknown += run.text.chars().filter(|it| !penup::drawing::is_in_font(*it)).count();
            for stroke in run.strokes() {
                let points = stroke.into_iter().map(|[x, y]| place.apply([x + at, y]));
                self.strokes.push(points.collect());
            }
            at += run.width();
        }
    }
}

/// The letters of a `TEXT` or an `ATTRIB`; `None` if it has no height.
pub(super) fn line(entity: &Entity<'_>) -> Result<Option<Writing>, LineError> {
    let height = entity.number(40, 0.0)?;
    let text = plain(entity.raw(1).unwrap_or_default());
    if height <= 0.0 || text.chars().count() > MOST_LETTERS {
        return Ok(None);
    }
    let run = [Run { text, height }];
    let width = run[0].width();
    let across = entity.number(72, 0.0)? as i64;
    // The vertical alignment has the code 74 in attributes, and 73 elsewhere.
    let upward = entity.number(if entity.kind == "ATTRIB" { 74 } else { 73 }, 0.0)? as i64;
    let [first, second] = [entity.point(10)?, entity.point(11)?];
    let has_second = entity.text(11).is_some();
    let mut factor = entity.number(41, 1.0)?;
    let mut size = 1.0;
    let mut angle = entity.number(50, 0.0)?.to_radians();
    let mut at = if has_second && (across, upward) != (0, 0) { second } else { first };
    if matches!(across, 3 | 5) && has_second {
        // The text fills the way between two points; 3 keeps the form of the letters.
        let baseline = [second[0] - first[0], second[1] - first[1]];
        (at, angle) = (first, baseline[1].atan2(baseline[0]));
        factor = baseline[0].hypot(baseline[1]) / width.max(f64::MIN_POSITIVE);
        size = if across == 3 { factor } else { 1.0 };
    }
    let begin = match across {
        1 | 4 => -width * factor / 2.0,
        2 => -width * factor,
        _ => 0.0,
    };
    let base = match (across, upward) {
        (4, _) | (_, 2) => -height / 2.0,
        (_, 1) => height * DEPTH,
        (_, 3) => -height,
        _ => 0.0,
    };
    let flags = entity.number(71, 0.0)? as i64;
    let [mirrored, turned_over] = [2, 4].map(|flag| if flags & flag == 0 { 1.0 } else { -1.0 });
    let slant = entity.number(51, 0.0)?.to_radians().tan();
    let letters = Affine([factor, 0.0, slant * size, size, begin, base * size]);
    let flipped = Affine([mirrored, 0.0, 0.0, turned_over, 0.0, 0.0]);
    let mut writing = Writing::default();
    let (sine, cosine) = angle.sin_cos();
    let placed = Affine([cosine, sine, -sine, cosine, at[0], at[1]]);
    writing.write(&run, placed.after(flipped).after(letters));
    Ok(Some(writing))
}

/// The letters of an `MTEXT`; `None` if it has no height.
pub(super) fn paragraph(entity: &Entity<'_>, plane: Plane) -> Result<Option<Writing>, LineError> {
    let height = entity.number(40, 0.0)?;
    if height <= 0.0 {
        return Ok(None);
    }
    // Long texts are divided among pairs with the code 3, before the end with the code 1.
    let is_text = |code: i32| matches!(code, 1 | 3);
    let texts = entity.pairs.iter().filter(|pair| is_text(pair.code)).map(|pair| pair.raw);
    let (width, mut lines) = (entity.number(41, 0.0)?, Vec::new());
    for line in paragraphs(&texts.collect::<String>(), height) {
        wrap(line, width, &mut lines);
    }
    let longest = lines.iter().flatten().map(|run| run.text.chars().count()).max();
    if longest.is_some_and(|letters| letters > MOST_LETTERS) {
        return Ok(None);
    }
    // The angle and the direction of x exclude each other; the last one given counts.
    let last = entity.pairs.iter().rfind(|pair| matches!(pair.code, 50 | 11));
    let angle = if last.is_some_and(|pair| pair.code == 11) {
        let [x, y] = entity.point(11)?;
        y.atan2(x)
    } else {
        entity.number(50, 0.0)?.to_radians()
    };
    let attachment = (entity.number(71, 1.0)? as i64).clamp(1, 9) - 1;
    let spacing = entity.number(44, 1.0)?;
    let heights: Vec<f64> = (lines.iter())
        .map(|line| line.iter().map(|run| run.height).fold(0.0, f64::max))
        .map(|most| if most > 0.0 { most } else { height })
        .collect();
    let first = heights.first().copied().unwrap_or(height);
    let below: f64 = heights.iter().skip(1).map(|height| height * LEADING * spacing).sum();
    let mut base = match attachment / 3 {
        0 => -first,
        1 => (first + below) / 2.0 - first,
        _ => below + heights.last().unwrap_or(&height) * DEPTH,
    };
    let (sine, cosine) = angle.sin_cos();
    let up = plane.turned([cosine, sine, 0.0]);
    let [x, y] = entity.point(10)?;
    let place = Affine([cosine, sine, up[0], up[1], x, y]);
    let mut writing = Writing::default();
    for (number, (line, height)) in lines.iter().zip(&heights).enumerate() {
        if number > 0 {
            base -= height * LEADING * spacing;
        }
        let width: f64 = line.iter().map(Run::width).sum();
        let begin = -width * (attachment % 3) as f64 / 2.0;
        writing.write(line, place.after(Affine([1.0, 0.0, 0.0, 1.0, begin, base])));
    }
    Ok(Some(writing))
}

/// A letter that stands behind `%%`, and what it takes of the text; `None` for what is not drawn,
/// such as the begin of a line below letters.
fn percent(rest: &str) -> Option<(Option<char>, usize)> {
    let code = rest.get(..3).and_then(|digits| digits.parse::<u32>().ok());
    if let Some(code) = code {
        return Some((char::from_u32(code), 3));
    }
    let letter = rest.chars().next()?;
    let drawn = match letter.to_ascii_lowercase() {
        'd' => Some('°'),
        'p' => Some('±'),
        'c' => Some('Ø'),
        '%' => Some('%'),
        'u' | 'o' | 'k' => None,
        _ => return None,
    };
    Some((drawn, 1))
}

/// A text of one line, with the letters that its codes stand for.
fn plain(text: &str) -> String {
    let (mut letters, mut rest) = (String::new(), text);
    while let Some(letter) = rest.chars().next() {
        let behind = &rest[letter.len_utf8()..];
        if let Some((drawn, taken)) = rest.strip_prefix("%%").and_then(percent) {
            letters.extend(drawn);
            rest = &rest[2 + taken..];
        } else if let Some((drawn, taken)) = rest.strip_prefix("\\U+").and_then(hexadecimal) {
            letters.push(drawn);
            rest = &rest[3 + taken..];
        } else {
            letters.push(if letter == '\t' { ' ' } else { letter });
            rest = behind;
        }
    }
    letters
}

/// The letter with the number in the first four places.
fn hexadecimal(rest: &str) -> Option<(char, usize)> {
    let number = u32::from_str_radix(rest.get(..4)?, 16).ok()?;
    Some((char::from_u32(number).unwrap_or(char::REPLACEMENT_CHARACTER), 4))
}

/// The lines of a paragraph text, before they are wrapped.
fn paragraphs(text: &str, height: f64) -> Vec<Vec<Run>> {
    let mut lines = vec![Vec::new()];
    let (mut heights, mut height) = (Vec::new(), height);
    let put = |lines: &mut Vec<Vec<Run>>, text: &str, height: f64| {
        let Some(line) = lines.last_mut() else { return };
        match line.last_mut() {
            Some(Run { text: before, height: same }) if *same == height => before.push_str(text),
            _ => line.push(Run { text: text.to_owned(), height }),
        }
    };
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let behind = &rest[letter.len_utf8()..];
        rest = behind;
        match letter {
            '{' => heights.push(height),
            '}' => height = heights.pop().unwrap_or(height),
            '^' => {
                // A control character, or the sign itself before a space.
                let code = behind.chars().next();
                rest = behind.get(code.map_or(0, char::len_utf8)..).unwrap_or_default();
                match code {
                    Some('J' | 'M') => lines.push(Vec::new()),
                    Some('I') => put(&mut lines, " ", height),
                    _ => put(&mut lines, "^", height),
                }
            }
            '%' => match behind.strip_prefix('%').and_then(percent) {
                Some((drawn, taken)) => {
                    rest = &behind[1 + taken..];
                    put(&mut lines, &String::from_iter(drawn), height);
                }
                None => put(&mut lines, "%", height),
            },
            '\\' => {
                let Some(code) = behind.chars().next() else { break };
                rest = &behind[code.len_utf8()..];
                let (value, after) = rest.split_once(';').unwrap_or((rest, ""));
                match code {
                    'P' | 'N' | 'X' => lines.push(Vec::new()),
                    '~' => put(&mut lines, UNBROKEN, height),
                    'L' | 'l' | 'O' | 'o' | 'K' | 'k' => {}
                    'H' => {
                        let (number, is_factor) = match value.strip_suffix(['x', 'X']) {
                            Some(number) => (number, true),
                            None => (value, false),
                        };
                        let number = number.trim().parse::<f64>().ok();
                        if let Some(number) = number.filter(|it| *it > 0.0 && *it < 1e9) {
                            height = if is_factor { height * number } else { number };
                        }
                        rest = after;
                    }
                    'S' => {
                        // A fraction is written in one line.
                        let fraction = value.replace(['^', '#'], "/").replace("/ ", "/");
                        put(&mut lines, fraction.trim_matches([' ', '/']), height);
                        rest = after;
                    }
                    'A' | 'C' | 'c' | 'F' | 'f' | 'Q' | 'T' | 'W' | 'p' => rest = after,
                    'U' if rest.starts_with('+') => match hexadecimal(&rest[1..]) {
                        Some((letter, taken)) => {
                            put(&mut lines, &letter.to_string(), height);
                            rest = &rest[1 + taken..];
                        }
                        None => put(&mut lines, "\\U", height),
                    },
                    other => put(&mut lines, &other.to_string(), height),
                }
            }
            '\t' => put(&mut lines, " ", height),
            letter => put(&mut lines, letter.encode_utf8(&mut [0; 4]), height),
        }
    }
    lines
}

/// Divides a line between words where it would be wider than `width`, which 0 does not bound.
fn wrap(line: Vec<Run>, width: f64, lines: &mut Vec<Vec<Run>>) {
    if width <= 0.0 || line.iter().map(Run::width).sum::<f64>() <= width {
        lines.push(line);
        return;
    }
    let (mut present, mut advance) = (Vec::<Run>::new(), 0.0);
    for Run { text, height } in line {
        for word in text.split_inclusive(' ') {
            let run = Run { text: word.to_owned(), height };
            // The space behind the last word of a line may reach beyond it.
            let seen = Run { text: word.trim_end_matches(' ').to_owned(), height }.width();
            if !present.is_empty() && advance + seen > width {
                lines.push(std::mem::take(&mut present));
                advance = 0.0;
            }
            advance += run.width();
            match present.last_mut() {
                Some(last) if last.height == height => last.text.push_str(word),
                _ => present.push(run),
            }
        }
    }
    lines.push(present);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The texts of the lines, with `|` where the height changes.
    fn shown(lines: &[Vec<Run>]) -> Vec<String> {
        let text = |run: &Run| match run.height {
            2.0 => run.text.clone(),
            height => format!("<{height}>{}", run.text),
        };
        lines.iter().map(|line| line.iter().map(text).collect::<Vec<_>>().join("|")).collect()
    }

    #[test]
    fn codes_stand_for_letters_breaks_and_heights() {
        assert_eq!(
            plain("%%c40 %%p0.1 90%%d 5%%% %%uA%%u %%065 \\U+00e9 %%"),
            "Ø40 ±0.1 90° 5% A A é %%"
        );
        for (text, lines) in [
            ("one\\Ptwo^Jthree", &["one", "two", "three"][..]),
            ("{\\fArial|b0|i0;\\C1;a}\\~\\{b\\}\\\\", &["a\u{A0}{b}\\"]),
            ("a{\\H1.5x;b}c\\H4;d", &["a|<3>b|c|<4>d"]),
            ("\\A1;\\S1/2; \\S+0.1^ -0.2; \\Lx\\l %%d\\U+00B2", &["1/2 +0.1/-0.2 x °²"]),
            ("\\pxqc;x\\W0.8;y\\", &["xy"]),
        ] {
            assert_eq!(shown(&paragraphs(text, 2.0)), lines, "{text}");
        }
        for text in ["\\", "\\H", "%", "%%", "^", "\\U+zz", "{{}}}", "\\S", "é\\é^é%%é"] {
            let _ = (paragraphs(text, 1.0), plain(text));
        }
    }

    #[test]
    fn lines_are_wrapped_between_words() {
        let wide = Run { text: "one two ".to_owned(), height: 2.0 }.width();
        let mut lines = Vec::new();
        wrap(paragraphs("one two three", 2.0).remove(0), wide, &mut lines);
        assert_eq!(shown(&lines), ["one two ", "three"]);
        lines.clear();
        wrap(paragraphs("one two three", 2.0).remove(0), 0.1, &mut lines);
        assert_eq!(shown(&lines), ["one ", "two ", "three"]);
    }
}
