//! The servo of the pen. It gets a pulse every 20 ms, from 1 ms when the pen is raised to 2 ms when
//! it is lowered.

use super::ROW;
use super::registers::{self, PWM, Put, reset};

/// The slice whose output B is the pin of the pen.
const SLICE: usize = ROW.pins.pen as usize / 2;
const _: () = assert!(ROW.pins.pen % 2 == 1 && SLICE < 8, "output B of a slice");

/// The divider that makes the unit a microsecond; the register counts sixteenths.
const DIVIDER: u32 = (super::clock::HERTZ / 1_000_000) << 4;
const PERIOD: u32 = 20_000;
const RAISED: u32 = 1000;
const ENABLE: u32 = 1;

/// Starts the pulses with the pen raised.
pub fn set_up() {
    registers::restart(reset::PWM);
    PWM.ch(SLICE).div().put(DIVIDER);
    PWM.ch(SLICE).top().put(PERIOD - 1);
    set_height(0);
    PWM.ch(SLICE).csr().put(ENABLE);
}

/// Moves the pen to `height`, from 0 (fully raised) to 127, with the next pulse.
pub fn set_height(height: u8) {
    // Each unit of height takes 8 µs, so the lowest height takes 2016 µs.
    let pulse = RAISED + 8 * u32::from(height);
    PWM.ch(SLICE).cc().put(pulse << 16);
}
