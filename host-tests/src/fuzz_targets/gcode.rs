//! G-code, with arcs.

use super::session::begun_by;

/// Lets a plotter that has been told its units receive the input as G-code, with the orders to the
/// bench that `session` knows. The promises are those of `session`.
pub fn fuzz(input: &[u8]) {
    let beginning = b"G21G90G17\nM3S1000\nG1F3000X1Y1\n";
    begun_by(beginning, input);
}
