//! HP-GL, the language of Hewlett-Packard's plotters, in the dialect of the HP 7475A.
//!
//! [`Dialect`] follows the bytes of a serial port and tells where HP-GL begins and ends, and which
//! of its bytes are text. [`Session`] holds what has been received of it, answers the instructions
//! to the interface (`ESC .`), and hands the other bytes to its [`Interpreter`]. That one turns
//! them, byte by byte, into [`Action`]s: lines, dots, moves with the pen up, pens and answers. An
//! instruction is never kept as a whole: a pair of coordinates is drawn as it comes, so an
//! instruction may have any length.
//!
//! Errors are not reported by themselves, as on the HP 7475A. They set a number that `OE` or
//! `ESC.E` asks for. What comes after lost bytes is not drawn until the pen's position is known
//! again.

mod coordinates;
mod dialect;
mod encoded;
mod handshake;
mod interpreter;
mod label;
mod line_type;
mod number;
mod outline;
mod parser;
mod polygon;
mod query;
mod session;
#[cfg(test)]
mod tests;

pub use coordinates::{FARTHEST, Point, Rectangle, UNIT, UNITS_PER_MM};
pub use dialect::{Beginning, Dialect, Token};
pub use interpreter::{ANSWER_BYTES, Action, Answer, ErrorNumber, Interpreter};
pub use polygon::{PolygonBuffer, VERTICES as POLYGON_POINTS, Vertex};
pub use session::{RECEIVED_BYTES, Session};

/// The byte that stands for lost or damaged bytes among received ones.
const DAMAGED: u8 = 0xFF;

/// The byte that begins an instruction to the interface.
const ESCAPE: u8 = 0x1B;

/// The byte that ends a label unless `DT` has chosen another one (ETX).
const LABEL_END: u8 = 0x03;
