//! The servo of the pen, whose pulses a PWM slice repeats.

use super::ROW;
use super::registers::{self, Get, PWM, Put, reset};
use penup::machine::servo;

/// The slice whose output B is the pin of the pen.
const SLICE: usize = ROW.pins.pen as usize / 2;
const _: () = assert!(ROW.pins.pen % 2 == 1 && SLICE < 8, "output B of a slice");

/// Divides the clock so that the PWM slice counts microseconds. The register for it holds
/// sixteenths.
const DIVIDER: u32 = (super::clock::HERTZ / 1_000_000) << 4;
/// The bit that lets the slice run.
const ENABLE: u32 = 1;

/// Prepares the slice, which makes no pulse yet. The servo stays where it is until the settings are
/// read, which say at what height the pen is raised.
pub fn set_up() {
    registers::restart(reset::PWM);
    PWM.ch(SLICE).div().put(DIVIDER);
    PWM.ch(SLICE).top().put(servo::PERIOD_MICROSECONDS - 1);
}

/// Begins the pulses, with the pen at `height`.
pub fn begin(height: u8) {
    set_height(height);
    PWM.ch(SLICE).csr().put(ENABLE);
}

/// Whether the servo gets pulses.
pub fn is_driven() -> bool {
    PWM.ch(SLICE).csr().get() & ENABLE != 0
}

/// Moves the pen to `height`, from 0 to 127, with the next pulse.
pub fn set_height(height: u8) {
    PWM.ch(SLICE).cc().put(servo::pulse_microseconds(height) << 16);
}
