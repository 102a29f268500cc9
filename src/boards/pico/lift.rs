//! The motor that lifts the pen, in addition to the servo or instead of it. The interrupt handler
//! of the pen's heights pulses it, at most a few thousand times a second.

use super::registers::SIO;

const STEP: u32 = 1 << 11;
const DIRECTION: u32 = 1 << 12;

mod offset {
    pub const SET: usize = 0x14;
    pub const CLEAR: usize = 0x18;
    pub const ENABLE_OUTPUT: usize = 0x24;
}

/// Sets both pins low. They are outputs once they are handed over.
pub fn set_up() {
    SIO.write(offset::CLEAR, STEP | DIRECTION);
    SIO.write(offset::ENABLE_OUTPUT, STEP | DIRECTION);
}

/// Sets the direction pin, high to lower the pen, and begins or ends a pulse.
pub fn set(step: bool, down: bool) {
    let level = |pin, high| SIO.write(if high { offset::SET } else { offset::CLEAR }, pin);
    level(DIRECTION, down);
    level(STEP, step);
}

/// Ends the pulse.
pub fn end_pulse() {
    SIO.write(offset::CLEAR, STEP);
}
