//! Draws a title in a vector font: Hershey Roman Simplex, with all letters of Latin-1 and Latin-9.
//!
//! A [`Title`] is a text and its size. It computes its width, so that it can be centred, and its
//! pen-down lines on the page, one after another. A [`TitleText`] owns a text. A character that is
//! not in the font is drawn as a box, and [`Title::unknown`] returns it.

use super::font::Glyph;
use super::{PAGE_LIMIT, PagePoint, StepsPerMillimetre};
use crate::fixed::{Millimetres, divide_rounding};

/// Height of the capitals in the font's units.
const CAPITAL_HEIGHT: i32 = 21;
/// Distance from the middle of a letter down to the baseline, in the font's units.
const BASELINE: i32 = 9;
/// How much higher an accent sits on a capital than on a small letter, in the font's units.
const ACCENT_RISE: i32 = 6;

/// The character that is drawn in place of one that is not in the font.
const BOX: char = '\u{FFFD}';

/// Letters with an accent: for each three characters, the letter, its base letter and the accent.
const ACCENTED: &str = "\
    ÀA\u{300}ÁA\u{301}ÂA\u{302}ÃA\u{303}ÄA\u{308}ÅA\u{30A}ÇC\u{327}ÈE\u{300}ÉE\u{301}ÊE\u{302}\
    ËE\u{308}ÌI\u{300}ÍI\u{301}ÎI\u{302}ÏI\u{308}ÑN\u{303}ÒO\u{300}ÓO\u{301}ÔO\u{302}ÕO\u{303}\
    ÖO\u{308}ÙU\u{300}ÚU\u{301}ÛU\u{302}ÜU\u{308}ÝY\u{301}ŸY\u{308}ŠS\u{30C}ŽZ\u{30C}àa\u{300}\
    áa\u{301}âa\u{302}ãa\u{303}äa\u{308}åa\u{30A}çc\u{327}èe\u{300}ée\u{301}êe\u{302}ëe\u{308}\
    ìı\u{300}íı\u{301}îı\u{302}ïı\u{308}ñn\u{303}òo\u{300}óo\u{301}ôo\u{302}õo\u{303}öo\u{308}\
    ùu\u{300}úu\u{301}ûu\u{302}üu\u{308}ýy\u{301}ÿy\u{308}šs\u{30C}žz\u{30C}";

/// A line of text and its size.
///
/// ```
/// use penup::drawing::Title;
/// use penup::fixed::Millimetres;
/// let title = Title { text: "Übersicht", height: Millimetres::from_num(5) };
/// assert_eq!(title.unknown(), None);
/// let steps = [Millimetres::from_num(80); 2];
/// let [left, baseline] = [10, 20].map(Millimetres::from_num);
/// let drawn = title.draw::<()>(left, baseline, steps, &mut |line| {
///     // Every line of these letters lies above the baseline.
///     assert!(line.iter().all(|point| point.x >= 800 && point.y >= 1600));
///     Ok(())
/// });
/// assert_eq!(drawn, Ok(()));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Title<'t> {
    /// The text, in composed letters or with combining accents.
    pub text: &'t str,
    /// Height of the capitals, in mm.
    pub height: Millimetres,
}

impl Title<'_> {
    /// Returns the width in mm, including the space beside the first and the last letter; at most
    /// the greatest representable length.
    pub fn width(&self) -> Millimetres {
        let mut line = TypeLine::default();
        for letter in self.text.chars() {
            line.set(letter, &mut |_| {});
        }
        let bits =
            i64::from(line.end) * i64::from(self.height.to_bits()) / i64::from(CAPITAL_HEIGHT);
        Millimetres::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
    }

    /// Returns how far its lowest letters reach below the baseline, in mm.
    pub fn depth(&self) -> Millimetres {
        self.height / 3
    }

    /// Returns the distance from the baseline up to the drawing, in mm: the height of the capitals,
    /// and as much again for accents and a gap.
    pub fn rise(&self) -> Millimetres {
        self.height * 2
    }

    /// Returns the first character that is not in the font.
    pub fn unknown(&self) -> Option<char> {
        self.text.chars().find(|letter| !is_in_font(*letter))
    }

    /// Calls `each` with each of its straight lines on the page, letter by letter, and in order
    /// within each stroke.
    ///
    /// The text begins at `left`, and `baseline` is its baseline, both in mm. Coordinates beyond
    /// ±2^20 steps are moved to that limit.
    ///
    /// # Errors
    /// Returns the first error that `each` returns.
    pub fn draw<E>(
        &self,
        left: Millimetres,
        baseline: Millimetres,
        steps: StepsPerMillimetre,
        each: &mut dyn FnMut([PagePoint; 2]) -> Result<(), E>,
    ) -> Result<(), E> {
        // A product of millimetres and steps per millimetre is in units of 2^-32 steps.
        let on_axis = |origin: Millimetres, units: i32, axis: usize| {
            // The length is below 2^63. A product that saturates is beyond the page anyway.
            let length = i64::from(origin.to_bits()) * i64::from(CAPITAL_HEIGHT)
                + i64::from(units) * i64::from(self.height.to_bits());
            let steps = length.saturating_mul(steps[axis].to_bits().into());
            let limit = i128::from(PAGE_LIMIT);
            let rounded = divide_rounding(steps.into(), i128::from(CAPITAL_HEIGHT) << 32);
            rounded.clamp(-limit, limit) as i32
        };
        let mut line = TypeLine::default();
        let mut outcome = Ok(());
        for letter in self.text.chars() {
            line.set(letter, &mut |Placed { glyph, x, rise }| {
                let mut before = None;
                let mut index = 0;
                while let Some(point) = glyph.point(index) {
                    index += 1;
                    let point_on_page = point.map(|[right, down]| PagePoint {
                        x: on_axis(left, x + right, 0),
                        y: on_axis(baseline, rise + BASELINE - down, 1),
                    });
                    if let (Some(from), Some(to), Ok(())) = (before, point_on_page, &outcome) {
                        outcome = each([from, to]);
                    }
                    before = point_on_page;
                }
            });
        }
        outcome
    }
}

/// Whether the font has a letter, and its accent if it has one.
pub fn is_in_font(letter: char) -> bool {
    let (base, accent) = decomposed(letter);
    Glyph::find(base).is_some() && accent.is_none_or(|accent| Glyph::find(accent).is_some())
}

/// A short text that is stored in the value itself.
///
/// ```
/// use penup::drawing::TitleText;
/// assert_eq!(TitleText::new("Café".chars()).unwrap().as_str(), "Café");
/// assert_eq!(TitleText::new(core::iter::repeat_n('x', 81)), None);
/// assert_eq!(TitleText::default().as_str(), "");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TitleText {
    /// The text in UTF-8.
    bytes: [u8; TitleText::LIMIT],
    /// The number of bytes in use.
    length: u8,
}

impl TitleText {
    /// The longest text, in bytes of UTF-8.
    pub const LIMIT: usize = 80;

    /// Makes a text of `letters`, or returns `None` if they need more than [`TitleText::LIMIT`]
    /// bytes.
    // Not inlined, so that its variables take no stack while a job is computed.
    #[inline(never)]
    pub fn new(letters: impl Iterator<Item = char>) -> Option<Self> {
        let mut text = Self::default();
        for letter in letters {
            let start = usize::from(text.length);
            let free = text.bytes.get_mut(start..start + letter.len_utf8())?;
            text.length += letter.encode_utf8(free).len() as u8;
        }
        Some(text)
    }

    /// Returns the text as a string.
    pub fn as_str(&self) -> &str {
        // Only whole letters were stored, so the bytes are valid UTF-8.
        let bytes = self.bytes.get(..usize::from(self.length)).unwrap_or(&[]);
        core::str::from_utf8(bytes).unwrap_or("")
    }
}

impl Default for TitleText {
    /// Returns the empty text.
    fn default() -> Self {
        Self { bytes: [0; Self::LIMIT], length: 0 }
    }
}

/// The strokes of a single letter or of its accent, for those who place letters by themselves.
///
/// ```
/// use penup::drawing::LetterStrokes;
/// let [letter, accent] = LetterStrokes::of('I');
/// assert!(accent.is_none());
/// assert_eq!(letter.unwrap().line(0), Some(Some([[0, 21], [0, 0]])));
/// assert_eq!(letter.unwrap().line(1), None);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LetterStrokes {
    /// The shape of the letter or the accent.
    glyph: Glyph,
    /// How far it is raised above its normal height.
    rise: i32,
}

impl LetterStrokes {
    /// The height of the capitals, in the font's units.
    pub const CAPITAL_HEIGHT: i32 = CAPITAL_HEIGHT;

    /// The letter and its accent, if it has one. A letter that is not in the font is a box.
    pub fn of(letter: char) -> [Option<Self>; 2] {
        let mut strokes = [None; 2];
        let mut free = strokes.iter_mut();
        TypeLine::default().set(letter, &mut |Placed { glyph, rise, .. }| {
            if let Some(slot) = free.next() {
                *slot = Some(Self { glyph, rise });
            }
        });
        strokes
    }

    /// The straight line from the point with this index to the next one, in the font's units: to
    /// the right of the letter's middle, and up from its baseline. `Some(None)` where the pen is
    /// lifted between the two, `None` behind the last line.
    pub fn line(&self, index: usize) -> Option<Option<[[i32; 2]; 2]>> {
        let point = |index: usize| {
            let point = self.glyph.point(index)?;
            Some(point.map(|[right, down]| [right, self.rise + BASELINE - down]))
        };
        let (from, to) = (point(index)?, point(index + 1)?);
        Some(from.zip(to).map(|(from, to)| [from, to]))
    }
}

/// A letter at its position in the text, in the font's units.
#[derive(Debug, Clone, Copy)]
struct Placed {
    /// The shape of the letter.
    glyph: Glyph,
    /// Distance of its vertical middle line from the beginning of the text.
    x: i32,
    /// How far it is raised above its normal height.
    rise: i32,
}

/// The state after the letters laid out so far, side by side, each accent above the letter before
/// it.
#[derive(Debug, Default)]
struct TypeLine {
    /// The x at which the next letter begins, from the beginning of the text in the font's units.
    end: i32,
    /// The x of the middle of the last letter, above which an accent is put.
    middle: i32,
    /// How far an accent on the last letter is raised.
    rise: i32,
}

impl TypeLine {
    /// Lays out a letter and its accent, or a box if the letter is not in the font.
    fn set(&mut self, letter: char, each: &mut dyn FnMut(Placed)) {
        let (base, accent) = decomposed(letter);
        for letter in [Some(base), accent].into_iter().flatten() {
            let Some(glyph) = Glyph::find(letter).or_else(|| Glyph::find(BOX)) else { continue };
            let mut rise = 0;
            if ('\u{300}'..='\u{36F}').contains(&letter) {
                rise = if letter == '\u{327}' { 0 } else { self.rise };
            } else {
                let [left, right] = glyph.sides();
                self.middle = self.end.saturating_sub(left);
                self.end = self.middle.saturating_add(right);
                self.rise = if letter.is_ascii_uppercase() { ACCENT_RISE } else { 0 };
            }
            each(Placed { glyph, x: self.middle, rise });
        }
    }
}

/// Splits a letter with an accent into the letter without it and the accent.
fn decomposed(letter: char) -> (char, Option<char>) {
    let mut rest = if letter.is_ascii() { "" } else { ACCENTED }.chars();
    while let (Some(composed), Some(base), accent) = (rest.next(), rest.next(), rest.next()) {
        if composed == letter {
            return (base, accent);
        }
    }
    (letter, None)
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

    fn lines(
        title: Title<'_>,
        left: Millimetres,
        baseline: Millimetres,
        steps: StepsPerMillimetre,
    ) -> Vec<[PagePoint; 2]> {
        let mut lines = Vec::new();
        let drawn: Result<(), ()> = title.draw(left, baseline, steps, &mut |line| {
            lines.push(line);
            Ok(())
        });
        assert_eq!(drawn, Ok(()));
        lines
    }

    /// The lines of `text` with one step for each unit of the font and the baseline at 0.
    fn drawn(text: &str) -> Vec<[(i32, i32); 2]> {
        let title = Title { text, height: mm(CAPITAL_HEIGHT) };
        let lines = lines(title, mm(0), mm(0), [mm(1); 2]);
        lines.into_iter().map(|line| line.map(|point| (point.x, point.y))).collect()
    }

    fn width(text: &str) -> i32 {
        Title { text, height: mm(CAPITAL_HEIGHT) }.width().to_num()
    }

    /// A picture of the text in rows, with `#` where a line passes.
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
        let ends = lines(title, mm(100), mm(50), [mm(10), mm(20)]).concat();
        let middle = 1000 + 10 * width("I") / 2;
        let expected = [PagePoint { x: middle, y: 1420 }, PagePoint { x: middle, y: 1000 }];
        assert_eq!(ends, expected);
        let far = Title { text: "I", height: Millimetres::MAX };
        let limits = lines(far, mm(0), Millimetres::MAX, [mm(32_000); 2]).concat();
        assert!(limits.into_iter().all(|point| point.y == PAGE_LIMIT));
    }
}
