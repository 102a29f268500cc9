//! Why a line of G-code that is well-formed was not carried out. The numbers are those of Grbl 1.1.

/// Why a line of G-code was refused. Nothing that the line asks for is done then.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BlockError {
    /// The number of this word must not be negative.
    Negative(u8),
    /// A jog has words that are not those of a jog.
    NotInAJog,
    /// Two words of one modal group, for example G20 and G21.
    ModalGroup,
    /// A jog or a move in inverse time (G93) has no F.
    NoFeed,
    /// The number of this word must be whole.
    NotWhole(u8),
    /// Two words that both use X, Y and Z, for example G0 and G92.
    AxisConflict,
    /// The word with this letter comes twice.
    Repeated(u8),
    /// A word needs X, Y or Z.
    NoAxis,
    /// The number after N is too large.
    LineNumber,
    /// A word with this letter is missing.
    Missing(u8),
    /// There are only the coordinate systems G54 to G59.
    NoSystem,
    /// G53 goes with G0 and G1 only.
    Absolute,
    /// X, Y or Z after G80.
    AxisAfterCancel,
    /// An arc has neither X nor Y.
    ArcNoAxis,
    /// There is no arc of this radius between these points.
    ArcRadius,
    /// An arc has neither I nor J, nor R.
    ArcNoOffset,
    /// No word uses the word with this letter.
    Unused(u8),
    /// G43.1 is for Z only.
    ToolAxis,
    /// The number after T is too large.
    ToolNumber,
    /// An arc outside the plane of X and Y.
    ArcPlane,
    /// An arc in inverse time (G93).
    InverseArc,
    /// M280 and M300 move the pen only if S does.
    ServoIsOff,
    /// A startup line that moves, waits, or changes what is kept.
    NotAtStart,
}
