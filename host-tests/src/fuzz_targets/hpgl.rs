//! HP-GL.

use super::session;

/// Lets a plotter receive the input as HP-GL, with the orders to the bench that `session` knows.
/// The promises are those of `session`.
pub fn fuzz(input: &[u8]) {
    let beginning = b"$hpgl\n".iter().chain(b"IN;SP1;");
    session(&beginning.chain(input).copied().collect::<Vec<u8>>());
}
