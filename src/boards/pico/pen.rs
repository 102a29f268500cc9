//! The servo of the pen. It gets a pulse every 20 ms, from 1 ms when the pen is raised to 2 ms when
//! it is lowered.

use super::registers::{self, PWM, reset};

/// The registers of slice 3, whose output B is GPIO 7.
mod offset {
    const SLICE: usize = 3 * 0x14;
    pub const CONTROL: usize = SLICE;
    pub const DIVIDER: usize = SLICE + 0x4;
    pub const COMPARE: usize = SLICE + 0xC;
    pub const TOP: usize = SLICE + 0x10;
}
/// The divider that makes the unit a microsecond; the register counts sixteenths.
const DIVIDER: u32 = (super::clock::HERTZ / 1_000_000) << 4;
const PERIOD: u32 = 20_000;
const RAISED: u32 = 1000;
const ENABLE: u32 = 1;

/// Starts the pulses with the pen raised.
pub fn set_up() {
    registers::restart(reset::PWM);
    PWM.write(offset::DIVIDER, DIVIDER);
    PWM.write(offset::TOP, PERIOD - 1);
    set_height(0);
    PWM.write(offset::CONTROL, ENABLE);
}

/// Moves the pen to `height`, from 0 (fully raised) to 127, with the next pulse.
pub fn set_height(height: u8) {
    // Each unit of height takes 8 µs, so the lowest height takes 2016 µs.
    let pulse = RAISED + 8 * u32::from(height);
    PWM.write(offset::COMPARE, pulse << 16);
}
