//! The rows of the errors of lines of G-code. The numbers are those of Grbl 1.1.

use super::{Row, error};
use crate::protocol::BlockError;

#[inline(never)] // Its callers share one copy of the code.
pub(super) fn explain_block(refusal: &BlockError, row: Row<'_>) {
    let letter = char::from;
    match refusal {
        BlockError::Negative(word) => {
            row(error(4, "negative number"), format_args!("{} is not negative", letter(*word)))
        }
        BlockError::NotInAJog => row(
            error(16, "not a word of a jog"),
            format_args!("a jog has X, Y, Z, F and G20, G21, G90, G91, G53"),
        ),
        BlockError::ModalGroup => row(
            error(21, "two words of one group"),
            format_args!("two words of the line exclude each other: send them in two lines"),
        ),
        BlockError::NoFeed => row(
            error(22, "no speed, or one too low"),
            format_args!("it takes F above 0, as in F1000, on the same line"),
        ),
        BlockError::NotWhole(word) => row(
            error(23, "not a whole number"),
            format_args!("there is no such {}: its number is whole", letter(*word)),
        ),
        BlockError::AxisConflict => row(
            error(24, "two orders in a line"),
            format_args!("the line orders two things, one behind the other: send two lines"),
        ),
        BlockError::Repeated(word) => {
            row(error(25, "word repeated"), format_args!("{} comes twice", letter(*word)))
        }
        BlockError::NoAxis => {
            row(error(26, "X, Y or Z is missing"), format_args!("it takes X, Y or Z"))
        }
        BlockError::LineNumber => {
            row(error(27, "line number too large"), format_args!("N goes up to 9999999"))
        }
        BlockError::Missing(word) => {
            row(error(28, "a word is missing"), format_args!("it takes {}", letter(*word)))
        }
        BlockError::NoSystem => row(
            error(29, "no such coordinate system"),
            format_args!("there are G54 to G59, which are P1 to P6 of G10"),
        ),
        BlockError::Absolute => {
            row(error(30, "G53 without G0 or G1"), format_args!("G53 goes with G0 and G1 only"))
        }
        BlockError::AxisAfterCancel => row(
            error(31, "X, Y or Z after G80"),
            format_args!("send G0 or G1 first: G80 has ended the moves"),
        ),
        BlockError::ArcNoAxis => {
            row(error(32, "an arc without X and Y"), format_args!("an arc takes X or Y"))
        }
        BlockError::ArcRadius => row(
            error(34, "radius too small"),
            format_args!("the ends are further apart than twice R"),
        ),
        BlockError::ArcNoOffset => {
            row(error(35, "an arc without a centre"), format_args!("an arc takes I or J, or R"))
        }
        BlockError::Unused(word) => row(
            error(36, "a word is not used"),
            format_args!("nothing in the line uses {}", letter(*word)),
        ),
        BlockError::ToolAxis => {
            row(error(37, "G43.1 takes Z"), format_args!("G43.1 takes Z, and no X or Y"))
        }
        BlockError::ToolNumber => {
            row(error(38, "tool number too large"), format_args!("T goes up to 255"))
        }
        BlockError::ArcPlane => {
            row(error(20, ""), format_args!("arcs are drawn in G17, not in G18 or G19"))
        }
        BlockError::InverseArc => {
            row(error(20, ""), format_args!("an arc takes F in mm/min: send G94 first"))
        }
        BlockError::ServoIsOff => row(
            error(20, ""),
            format_args!("if S moves the pen, set $206=3, and $216 to an S between up and down"),
        ),
        BlockError::NotAtStart => row(
            error(20, ""),
            format_args!("a line of the start sets modes, such as G20 G91: it does not move"),
        ),
    }
}
