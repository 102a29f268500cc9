//! A title in a vector font: the Hershey Roman Simplex, with all letters of Latin-1 and Latin-9.
//!
//! A [`Title`] is a text and its size; it gives its width, so that it can be centred, and its pen-down
//! lines on the page, one after the other. Nothing is stored: the font stays in flash (5 KB, see
//! `font/LICENCE.txt`) and is read as it is drawn. A character that the font lacks becomes a box, and
//! [`Title::unknown`] tells it.
//!
//! The font's file has a line for each letter: the letter, its left and right side, then points two
//! characters each, x right and y *down*, counted from `R`; ` R` lifts the pen (James Hurt's format).
//! Capitals reach from 12 above to 9 below the letter's middle.

use super::{PAGE_LIMIT, PagePoint, StepsPerMillimetre};
use crate::fixed::{Millimetres, divide_rounding};

const FONT: &str = include_str!("font/simplex.txt");

/// Height of the capitals in the font's units.
const CAPITAL_HEIGHT: i32 = 21;
/// From a letter's middle down to the baseline, in the font's units.
const BASELINE: i32 = 9;
/// How much higher an accent sits on a capital than on a small letter, in the font's units.
const ACCENT_RISE: i32 = 6;

/// What stands for a character that the font lacks.
const BOX: char = '\u{FFFD}';

/// Letters that are another letter with an accent: three characters for each.
const ACCENTED: &str = "\
    ÀA\u{300}ÁA\u{301}ÂA\u{302}ÃA\u{303}ÄA\u{308}ÅA\u{30A}ÇC\u{327}ÈE\u{300}ÉE\u{301}ÊE\u{302}ËE\u{308}\
    ÌI\u{300}ÍI\u{301}ÎI\u{302}ÏI\u{308}ÑN\u{303}ÒO\u{300}ÓO\u{301}ÔO\u{302}ÕO\u{303}ÖO\u{308}ÙU\u{300}\
    ÚU\u{301}ÛU\u{302}ÜU\u{308}ÝY\u{301}ŸY\u{308}ŠS\u{30C}ŽZ\u{30C}àa\u{300}áa\u{301}âa\u{302}ãa\u{303}\
    äa\u{308}åa\u{30A}çc\u{327}èe\u{300}ée\u{301}êe\u{302}ëe\u{308}ìı\u{300}íı\u{301}îı\u{302}ïı\u{308}\
    ñn\u{303}òo\u{300}óo\u{301}ôo\u{302}õo\u{303}öo\u{308}ùu\u{300}úu\u{301}ûu\u{302}üu\u{308}ýy\u{301}\
    ÿy\u{308}šs\u{30C}žz\u{30C}";

/// A line of text and its size.
///
/// ```
/// use penup::drawing::Title;
/// use penup::fixed::Millimetres;
/// let title = Title { text: "Übersicht", height: Millimetres::from_num(5) };
/// assert_eq!(title.unknown(), None);
/// let steps = [Millimetres::from_num(80); 2];
/// let lines = title.lines(Millimetres::from_num(10), Millimetres::from_num(20), steps);
/// // Every line of the letters lies above the baseline, at 20 mm.
/// assert!(lines.flatten().all(|point| point.x >= 800 && point.y >= 1600));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Title<'t> {
    /// What it says, in composed letters or with combining accents.
    pub text: &'t str,
    /// Of the capitals.
    pub height: Millimetres,
}

impl<'t> Title<'t> {
    /// How wide it is, the space beside the first and last letter included; at most the largest length.
    pub fn width(&self) -> Millimetres {
        let units = placed(self.text).last().map_or(0, |letter| letter.end);
        let bits = i64::from(units) * i64::from(self.height.to_bits()) / i64::from(CAPITAL_HEIGHT);
        Millimetres::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
    }

    /// How far its lowest letters reach below the baseline.
    pub fn depth(&self) -> Millimetres {
        self.height / 3
    }

    /// The first character that the font lacks.
    pub fn unknown(&self) -> Option<char> {
        self.text.chars().flat_map(decomposed).find(|letter| Glyph::find(*letter).is_none())
    }

    /// Its straight lines on the page, letter by letter, each stroke's in order.
    ///
    /// The text begins at `left` and stands on `baseline`. What passes ±2^20 steps is moved there.
    pub fn lines(
        &self,
        left: Millimetres,
        baseline: Millimetres,
        steps: StepsPerMillimetre,
    ) -> impl Iterator<Item = [PagePoint; 2]> + Clone + use<'t> {
        let height = i128::from(self.height.to_bits());
        // Millimetres times steps for each are units of 2^-32 step.
        let on_axis = move |origin: Millimetres, units: i32, axis: usize| {
            let length = i128::from(origin.to_bits()) * i128::from(CAPITAL_HEIGHT)
                + i128::from(units) * height;
            let steps = length * i128::from(steps[axis].to_bits());
            let limit = i128::from(PAGE_LIMIT);
            let rounded = divide_rounding(steps, i128::from(CAPITAL_HEIGHT) << 32);
            rounded.clamp(-limit, limit) as i32
        };
        placed(self.text).flat_map(move |letter| {
            letter.glyph.lines().map(move |line| {
                line.map(|[x, y]| PagePoint {
                    x: on_axis(left, letter.x + x, 0),
                    y: on_axis(baseline, letter.rise + BASELINE - y, 1),
                })
            })
        })
    }
}

/// The shape of one letter.
#[derive(Debug, Clone, Copy)]
struct Glyph {
    left: i32,
    right: i32,
    points: &'static [u8],
}

impl Glyph {
    fn find(letter: char) -> Option<Self> {
        let line = FONT.lines().find_map(|line| line.strip_prefix(letter))?;
        match line.as_bytes() {
            [left, right, points @ ..] => {
                Some(Self { left: offset(*left), right: offset(*right), points })
            }
            _ => None,
        }
    }

    /// Its straight lines in the font's units.
    fn lines(self) -> impl Iterator<Item = [[i32; 2]; 2]> + Clone {
        let points = || {
            self.points.chunks_exact(2).map(|point| match point {
                [b' ', _] => None,
                [x, y] => Some([offset(*x), offset(*y)]),
                _ => None,
            })
        };
        points().zip(points().skip(1)).filter_map(|(from, to)| Some([from?, to?]))
    }
}

fn offset(byte: u8) -> i32 {
    i32::from(byte) - i32::from(b'R')
}

/// A letter in its place, in the font's units.
#[derive(Debug, Clone, Copy)]
struct Placed {
    glyph: Glyph,
    /// Of its middle line, from the beginning of the text.
    x: i32,
    /// Above where it would be by itself.
    rise: i32,
    /// Where the next letter begins.
    end: i32,
}

/// The letters side by side, each accent over the letter before it.
fn placed(text: &str) -> impl Iterator<Item = Placed> + Clone {
    let nothing = Glyph { left: 0, right: 0, points: &[] };
    // The end of the text so far; the middle of the last letter and the rise of an accent on it.
    text.chars().flat_map(decomposed).scan((0i32, 0, 0), move |(end, middle, rise), letter| {
        let glyph = Glyph::find(letter).or_else(|| Glyph::find(BOX)).unwrap_or(nothing);
        if is_accent(letter) {
            let rise = if letter == '\u{327}' { 0 } else { *rise };
            return Some(Placed { glyph, x: *middle, rise, end: *end });
        }
        let x = end.saturating_sub(glyph.left);
        *end = x.saturating_add(glyph.right);
        *middle = x;
        *rise = if letter.is_uppercase() { ACCENT_RISE } else { 0 };
        Some(Placed { glyph, x, rise: 0, end: *end })
    })
}

fn is_accent(letter: char) -> bool {
    ('\u{300}'..='\u{36F}').contains(&letter)
}

/// The letter without its accent, and the accent.
fn decomposed(letter: char) -> impl Iterator<Item = char> + Clone {
    let mut rest = ACCENTED.chars();
    let parts = core::iter::from_fn(|| Some([rest.next()?, rest.next()?, rest.next()?]))
        .find(|[composed, ..]| *composed == letter && !letter.is_ascii());
    let (base, accent) = parts.map_or((letter, None), |[_, base, accent]| (base, Some(accent)));
    core::iter::once(base).chain(accent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::string::String;
    use std::vec::Vec;

    fn mm(length: i32) -> Millimetres {
        Millimetres::from_num(length)
    }

    /// One step to a unit of the font, the baseline at 0.
    fn drawn(text: &str) -> Vec<[(i32, i32); 2]> {
        let title = Title { text, height: mm(CAPITAL_HEIGHT) };
        let lines = title.lines(mm(0), mm(0), [mm(1); 2]);
        lines.map(|line| line.map(|point| (point.x, point.y))).collect()
    }

    fn width(text: &str) -> i32 {
        Title { text, height: mm(CAPITAL_HEIGHT) }.width().to_num()
    }

    /// Rows of the letter's lines, `#` where one passes.
    fn picture(text: &str) -> String {
        let mut dots = BTreeSet::new();
        for [from, to] in drawn(text) {
            for part in 0..=64 {
                let along = |a: i32, b: i32| (a * (64 - part) + b * part + 32).div_euclid(64);
                dots.insert((along(from.0, to.0) / 2, along(from.1, to.1).div_euclid(3)));
            }
        }
        let rows = (-2..=9).rev().map(|row| -> String {
            let line: String = (0..width(text) / 2)
                .map(|column| if dots.contains(&(column, row)) { '#' } else { ' ' })
                .collect();
            String::from(line.trim_end()) + "\n"
        });
        rows.collect()
    }

    #[test]
    fn letters_look_like_themselves() {
        let expected = [
            "               #",
            "             ###",
            "    #      #######",
            "    ##     #",
            "   ###     #",
            "   #  #    #         ######",
            "  #   ##   #####    #     #",
            " #######   #        #",
            " #     ##  #        ##    #",
            "##      #  #######   #####",
            "                      ###",
            "                     ####",
        ];
        let found = picture("AÉç");
        assert!(found.lines().eq(expected), "\n{found}");
    }

    #[test]
    fn all_of_latin_1_and_latin_9_is_there() {
        let latin_1 = (' '..='~').chain('\u{A0}'..='ÿ');
        let text: String = latin_1.chain("ŠšŽžŒœŸ€".chars()).chain("‘’“”–—…".chars()).collect();
        assert_eq!(Title { text: &text, height: mm(5) }.unknown(), None);
        for letter in text.chars().filter(|letter| !letter.is_whitespace()) {
            let mut buffer = [0; 4];
            let letter: &str = letter.encode_utf8(&mut buffer);
            let lines = drawn(letter);
            assert!(!lines.is_empty(), "{letter}");
            for (x, y) in lines.into_iter().flatten() {
                assert!((-2..=width(letter) + 2).contains(&x), "{letter}: x {x}");
                assert!((-7..=33).contains(&y), "{letter}: y {y}");
            }
        }
    }

    #[test]
    fn an_unknown_character_is_a_box_and_is_told() {
        let title = Title { text: "a→b", height: mm(5) };
        assert_eq!(title.unknown(), Some('→'));
        assert_eq!(drawn("→"), drawn("\u{FFFD}"));
        assert_eq!(drawn("→").len(), 4);
        assert_eq!(drawn("\u{7}").len(), 4);
    }

    #[test]
    fn widths_add_up_and_nothing_is_nothing() {
        assert_eq!((width(""), drawn("").len()), (0, 0));
        assert_eq!(width("Ab c"), width("A") + width("b") + width(" ") + width("c"));
        assert_eq!(width("é"), width("e"));
        let half = Title { text: "Width", height: mm(5) };
        assert_eq!(half.width(), Title { height: mm(10), ..half }.width() / 2);
        let long = "W".repeat(10_000);
        assert_eq!(Title { text: &long, height: mm(30_000) }.width(), Millimetres::MAX);
    }

    #[test]
    fn an_accent_may_come_by_itself() {
        assert_eq!(drawn("e\u{301}"), drawn("é"));
        assert_eq!(drawn("E\u{301}"), drawn("É"));
        assert_eq!(drawn("\u{301}").len(), 1);
    }

    #[test]
    fn a_title_is_placed_and_scaled_in_millimetres() {
        let title = Title { text: "I", height: mm(21) };
        let ends: Vec<_> = title.lines(mm(100), mm(50), [mm(10), mm(20)]).flatten().collect();
        let middle = 1000 + 10 * width("I") / 2;
        let expected = [PagePoint { x: middle, y: 1420 }, PagePoint { x: middle, y: 1000 }];
        assert_eq!(ends, expected);
        let far = Title { text: "I", height: Millimetres::MAX };
        let limits = far.lines(mm(0), Millimetres::MAX, [mm(32_000); 2]).flatten();
        assert!(limits.into_iter().all(|point| point.y == PAGE_LIMIT));
    }
}
