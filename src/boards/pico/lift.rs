//! The motor that lifts the pen, beside or instead of the servo: the handler of the pen's heights pulses it, a few
//! thousand steps a second at most.

use super::registers::SIO;

const STEP: u32 = 1 << 11;
const DIRECTION: u32 = 1 << 12;

mod offset {
    pub const SET: usize = 0x14;
    pub const CLEAR: usize = 0x18;
    pub const ENABLE_OUTPUT: usize = 0x24;
}

/// Both pins low, and outputs once they are handed over.
pub fn set_up() {
    SIO.write(offset::CLEAR, STEP | DIRECTION);
    SIO.write(offset::ENABLE_OUTPUT, STEP | DIRECTION);
}

/// A direction, high to lower the pen; a pulse begins or ends.
pub fn set(step: bool, down: bool) {
    let level = |pin, high| SIO.write(if high { offset::SET } else { offset::CLEAR }, pin);
    level(DIRECTION, down);
    level(STEP, step);
}

/// No pulse.
pub fn end_pulse() {
    SIO.write(offset::CLEAR, STEP);
}
