//! The vector font of titles and labels: Hershey Roman Simplex, with all letters of Latin-1 and
//! Latin-9 (see `font/LICENCE.txt`).
//!
//! [`Glyph::find`] returns the shape of a letter, and [`Glyph::point`] the points of its strokes.
//!
//! The font's file has a line for each letter: the letter, its left and its right side, and then
//! its points of two characters each, with x to the right and y *down*, counted from `R`. ` R`
//! lifts the pen (James Hurt's format). Capitals reach from 12 units above to 9 units below the
//! middle of the letter. The compiler packs three of these pairs into a word, so that the font
//! takes 3.6 KB of flash.

use crate::array::MapEach;
use core::cmp::Ordering;

/// The font as text, one line for each letter (see the module documentation).
const FONT: &[u8] = include_str!("font/simplex.txt").as_bytes();

/// The number of letters and accents in the font, which is the number of lines of its file.
const GLYPHS: usize = 158;
/// The number of pairs of characters behind the letters: the sides of all letters, and the points.
const PAIRS: usize = 2183;

/// The least characters of the first and of the second number of a pair.
const LEAST: [u8; 2] = *b"?B";
/// The greatest characters of the first and of the second number of a pair.
const GREATEST: [u8; 2] = *b"`b";
/// How many different second numbers there are.
const SECONDS: u32 = (GREATEST[1] - LEAST[1]) as u32 + 1;
/// How many different pairs there are. The first one, 0, lifts the pen.
const KINDS: u32 = ((GREATEST[0] - LEAST[0]) as u32 + 1) * SECONDS + 1;
/// How many pairs a word holds.
const PER_WORD: usize = 3;
const _: () = assert!(KINDS.checked_pow(PER_WORD as u32).is_some());

/// The font as the board stores it.
struct Packed {
    /// The letters in ascending order.
    letters: [u16; GLYPHS],
    /// The number of the pair with which each letter begins, and the end of the last.
    starts: [u16; GLYPHS + 1],
    /// The pairs, three to a word, the first one in the lowest place.
    words: [u32; PAIRS.div_ceil(PER_WORD)],
}

static PACKED: Packed = pack();

/// Packs the font when the library is compiled. A font that does not fit does not compile.
const fn pack() -> Packed {
    let mut packed = Packed {
        letters: [0; GLYPHS],
        starts: [0; GLYPHS + 1],
        words: [0; PAIRS.div_ceil(PER_WORD)],
    };
    let (mut glyph, mut pair, mut at) = (0, 0, 0);
    while at < FONT.len() {
        // UTF-8: the letters take one to three bytes.
        let (letter, length) = match FONT[at] {
            byte @ ..0x80 => (byte as u16, 1),
            byte @ ..0xE0 => ((byte as u16 & 0x1F) << 6 | next(at + 1), 2),
            byte => ((byte as u16 & 0xF) << 12 | next(at + 1) << 6 | next(at + 2), 3),
        };
        assert!(glyph == 0 || packed.letters[glyph - 1] < letter, "the letters are not sorted");
        packed.letters[glyph] = letter;
        packed.starts[glyph] = pair as u16;
        at += length;
        while FONT[at] != b'\n' {
            let kind = match [FONT[at], FONT[at + 1]] {
                [b' ', b'R'] => 0,
                [first, second] => {
                    assert!(LEAST[0] <= first && first <= GREATEST[0], "beyond the range");
                    assert!(LEAST[1] <= second && second <= GREATEST[1], "beyond the range");
                    (first - LEAST[0]) as u32 * SECONDS + (second - LEAST[1]) as u32 + 1
                }
            };
            packed.words[pair / PER_WORD] += kind * KINDS.pow((pair % PER_WORD) as u32);
            pair += 1;
            at += 2;
        }
        at += 1;
        glyph += 1;
    }
    assert!(glyph == GLYPHS && pair == PAIRS, "another number of letters or points");
    packed.starts[GLYPHS] = pair as u16;
    packed
}

/// The six bits of a byte that continues a letter of UTF-8.
const fn next(at: usize) -> u16 {
    FONT[at] as u16 & 0x3F
}

/// The shape of one letter of the font.
#[derive(Debug, Clone, Copy)]
pub(super) struct Glyph {
    /// The number of the first of its pairs, which holds its sides. Its points follow.
    first: usize,
    /// The number of its points.
    points: usize,
}

impl Glyph {
    /// Finds a letter in the font by binary search.
    pub(super) fn find(letter: char) -> Option<Self> {
        let (mut low, mut high) = (0, GLYPHS);
        while low < high {
            let middle = (low + high) / 2;
            match u32::from(*PACKED.letters.get(middle)?).cmp(&u32::from(letter)) {
                Ordering::Less => low = middle + 1,
                Ordering::Greater => high = middle,
                Ordering::Equal => {
                    let [first, end] = [PACKED.starts.get(middle)?, PACKED.starts.get(middle + 1)?]
                        .map_each(|at| usize::from(*at));
                    return Some(Self { first, points: end - first - 1 });
                }
            }
        }
        None
    }

    /// The x of the letter's left and of its right side, measured from its middle in the font's
    /// units; negative to the left.
    pub(super) fn sides(&self) -> [i32; 2] {
        pair(self.first).unwrap_or_default()
    }

    /// The point with this index, measured from the middle of the letter in the font's units: to
    /// the right and down. `Some(None)` where the pen is lifted, `None` behind the last point.
    pub(super) fn point(&self, index: usize) -> Option<Option<[i32; 2]>> {
        (index < self.points).then(|| pair(self.first + 1 + index))
    }
}

/// The pair with this number, counted from the middle of the letter; `None` where the pen is
/// lifted.
fn pair(number: usize) -> Option<[i32; 2]> {
    let word = *PACKED.words.get(number / PER_WORD)?;
    let mut above = word;
    for _ in 0..number % PER_WORD {
        above /= KINDS;
    }
    let kind = (above % KINDS).checked_sub(1)?;
    let offset = |value: u32, axis: usize| value as i32 + i32::from(LEAST[axis]) - i32::from(b'R');
    Some([offset(kind / SECONDS, 0), offset(kind % SECONDS, 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The points of each letter, read again from the file as it stands.
    #[test]
    fn every_letter_has_the_points_of_the_file() {
        let text = core::str::from_utf8(FONT).unwrap();
        for line in text.lines() {
            let mut rest = line.chars();
            let letter = rest.next().unwrap();
            let bytes = rest.as_str().as_bytes();
            let offset = |byte: u8| i32::from(byte) - i32::from(b'R');
            let mut pairs = bytes.chunks(2).map(|pair| match *pair {
                [b' ', b'R'] => None,
                [first, second] => Some([offset(first), offset(second)]),
                _ => panic!("{letter}: half a pair"),
            });
            let glyph = Glyph::find(letter).unwrap();
            assert_eq!(Some(Some(glyph.sides())), pairs.next(), "{letter}");
            for index in 0..glyph.points + 3 {
                assert_eq!(glyph.point(index), pairs.next(), "{letter}, point {index}");
            }
        }
        assert_eq!(text.lines().count(), GLYPHS);
        assert!(Glyph::find('→').is_none());
        assert!(Glyph::find('\u{10041}').is_none());
    }
}
