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
    /// Harrison's dotted line.
    Dotted = 1,
    /// A line of dashes, each three dots long.
    Dashed = 2,
}

/// What the other modules need to know about a line type.
struct Row {
    line_type: LineType,
    /// The name by which a user chooses the type.
    name: &'static str,
    /// The lengths, in dots, of a dash, a gap, a dash, a gap and so on, which repeat along the
    /// line. The first dash is drawn once more at the end. A solid line has none.
    dashes: &'static [u8],
    /// Where lines overlap, the type with the lower number is drawn.
    precedence: u8,
}

/// The line types, in the order of their codes.
const ROWS: [Row; 3] = [
    Row { line_type: LineType::Full, name: "full", dashes: &[], precedence: 0 },
    Row { line_type: LineType::Dotted, name: "dotted", dashes: &[1, 1], precedence: 1 },
    Row { line_type: LineType::Dashed, name: "dashed", dashes: &[3, 3], precedence: 2 },
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

    /// The number of bits of a code in a packed line.
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

    /// Returns the lengths of a dash, a gap, a dash, a gap and so on, in dots. They repeat along
    /// the line, which ends with the first dash. A full line has none.
    ///
    /// Their sum is even, the first of them is odd, and those after the first read the same
    /// backwards. So a line looks the same from both ends; see [`crate::step::Pattern`].
    pub const fn dashes(self) -> &'static [u8] {
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
        let Row { line_type, dashes, precedence, .. } = ROWS[code];
        assert!(line_type as usize == code, "the rows are in the order of their codes");
        let mut other = 0;
        while other < code {
            assert!(ROWS[other].precedence != precedence, "two types have one precedence");
            other += 1;
        }
        let (mut at, mut sum) = (0, 0);
        while at < dashes.len() {
            assert!(dashes[at] > 0, "a dash or gap has no length");
            assert!(dashes[at] == dashes[(dashes.len() - at) % dashes.len()], "not symmetric");
            sum += dashes[at] as u32;
            at += 1;
        }
        assert!(sum % 2 == 0 && dashes.len() % 2 == 0, "there are as many gaps as dashes");
        assert!(dashes.is_empty() || dashes[0] % 2 == 1, "the first dash is an odd length");
        code += 1;
    }
};
