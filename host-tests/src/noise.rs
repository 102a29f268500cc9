//! Random bytes for a plotter, half of them made of what lines are made of.

use crate::random::Random;

/// The emergency stop, after which nobody knows the position. Noise has none.
pub const STOP: u8 = 0xFD;

/// After so many bytes a machine is brought to rest.
pub const PIECE: u64 = 50_000;

/// How many bytes [`some`] returns.
pub const FEW: u64 = 50;

/// A few bytes of noise, among them real-time bytes. About every other time they are letters of
/// G-code, digits and line ends.
pub fn some(random: &mut Random) -> Vec<u8> {
    let letters = random.once_in(2);
    let byte = |_| match random.below(256) as u8 {
        STOP => b'\n',
        byte if letters => b"G0123X.-YIJRMZFS$=?\n\n"[usize::from(byte) % 21],
        byte => byte,
    };
    (0..FEW).map(byte).collect()
}
