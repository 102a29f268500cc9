//! The line types: how a segment is inked.
//!
//! A line type is a variant of [`LineType`] and its row in the table below, and nothing else. A
//! packed line, a segment, the removal of overlaps, the pattern of the pen and the option that
//! chooses the type ask this module.

/// How a segment is inked.
///
/// The number of a variant is its code, by which lines and segments store it. A job that a board
/// keeps in flash holds codes, so a code never changes its meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum LineType {
    /// A solid line.
    #[default]
    Full = 0,
    /// A dotted line, whose dots and gaps are equally long (Harrison).
    Dotted = 1,
    /// A line of dashes, each three dots long.
    Dashed = 2,
}

/// The row of a line type in the table: what the other modules need to know about it.
struct Row {
    /// The variant of [`LineType`] that the row describes.
    line_type: LineType,
    /// The name by which a user chooses the type.
    name: &'static str,
    /// The lengths of the dashes and gaps of this type of line.
    dashes: Dashes,
    /// Where lines overlap, the type with the lower number is drawn.
    precedence: u8,
}

/// The dashes and gaps of a line type, which repeat along a line.
///
/// They are chosen so that a line looks the same from both ends; see [`crate::step::Pattern`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dashes {
    /// The lengths of a dash, a gap, a dash, a gap and so on, in dots. After the last repetition
    /// the first dash ends the line. A solid line has none.
    pub lengths: &'static [u8],
    /// The sum of the lengths, which is even.
    pub period: u8,
    /// The least of the lengths, which limits how often they are repeated along a short line.
    pub shortest: u8,
}

impl Dashes {
    /// Checks the lengths when the library is compiled.
    const fn new(lengths: &'static [u8]) -> Self {
        let (mut at, mut period, mut shortest) = (0, 0, u8::MAX);
        while at < lengths.len() {
            let length = lengths[at];
            assert!(length > 0, "a dash or gap has no length");
            assert!(length == lengths[(lengths.len() - at) % lengths.len()], "not symmetric");
            period += length;
            shortest = if length < shortest { length } else { shortest };
            at += 1;
        }
        assert!(lengths.len().is_multiple_of(2), "there are not as many gaps as dashes");
        // With these lengths, the ends of dashes and gaps are never halfway between two moves.
        assert!(
            period.is_multiple_of(2) && (at == 0 || lengths[0] % 2 == 1),
            "a line has an even length"
        );
        Self { lengths, period, shortest }
    }
}

/// The line types, in the order of their codes.
const ROWS: [Row; 3] = [
    Row { line_type: LineType::Full, name: "full", dashes: Dashes::new(&[]), precedence: 0 },
    Row {
        line_type: LineType::Dotted,
        name: "dotted",
        dashes: Dashes::new(&[1, 1]),
        precedence: 1,
    },
    Row {
        line_type: LineType::Dashed,
        name: "dashed",
        dashes: Dashes::new(&[3, 3]),
        precedence: 2,
    },
];

impl LineType {
    /// All line types, in the order of their codes.
    pub const ALL: [Self; ROWS.len()] = {
        let mut all = [Self::Full; ROWS.len()];
        let mut code = 0;
        while code < all.len() {
            all[code] = ROWS[code].line_type;
            code += 1;
        }
        all
    };

    /// The number of bits that a packed line has for the code of its type.
    pub(super) const CODE_BITS: u32 = 4;

    /// Returns the code by which lines and segments store the type, below 16.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Returns the type with this code. A code that no type has is that of a full line.
    pub const fn from_code(code: u8) -> Self {
        if (code as usize) < Self::ALL.len() { Self::ALL[code as usize] } else { Self::Full }
    }

    /// Returns the name by which a user chooses the type.
    pub const fn name(self) -> &'static str {
        ROWS[self as usize].name
    }

    /// Returns the type with this name.
    ///
    /// ```
    /// use penup::drawing::LineType;
    /// assert_eq!(LineType::named("dashed"), Some(LineType::Dashed));
    /// assert_eq!(LineType::named("wavy"), None);
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|line_type| line_type.name() == name)
    }

    /// Returns the dashes and gaps of the type.
    pub const fn dashes(self) -> Dashes {
        ROWS[self as usize].dashes
    }

    /// Returns the rank of the type where lines overlap: the type with the lower number is drawn.
    pub(super) const fn precedence(self) -> u8 {
        ROWS[self as usize].precedence
    }
}

/// Checks the table when the library is compiled.
const _: () = {
    assert!(ROWS.len() <= 1 << LineType::CODE_BITS, "a code does not fit into a packed line");
    let mut code = 0;
    while code < ROWS.len() {
        let Row { line_type, precedence, .. } = ROWS[code];
        assert!(line_type as usize == code, "the rows are in the order of their codes");
        let mut other = 0;
        while other < code {
            assert!(ROWS[other].precedence != precedence, "two types have one precedence");
            other += 1;
        }
        code += 1;
    }
};
