//! HP-GL.

use super::session::begun_by;

/// Lets a plotter receive the input as HP-GL, with the orders to the bench that `session` knows.
/// The promises are those of `session`.
pub fn fuzz(input: &[u8]) {
    begun_by(b"$hpgl\nIN;SP1;", input);
}
