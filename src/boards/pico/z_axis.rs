//! The motor that lifts the pen, in addition to the servo or instead of it. The interrupt handler
//! of the pen's heights pulses it, at most a few thousand times a second.

use super::ROW;
use super::registers::{Put, SIO};

/// The bit of the step pin of the motor that lifts the pen.
const STEP: u32 = 1 << ROW.pins.step_z;
/// The bit of the direction pin of the motor that lifts the pen.
const DIRECTION: u32 = 1 << ROW.pins.dir_z;

/// Sets both pins low. They are outputs once they are handed over.
pub fn set_up() {
    SIO.gpio_out_clr().put(STEP | DIRECTION);
    SIO.gpio_oe_set().put(STEP | DIRECTION);
}

/// Sets the direction pin, high to lower the pen, and begins or ends a pulse.
pub fn set(step: bool, down: bool) {
    let level = |pin, high| match high {
        true => SIO.gpio_out_set().put(pin),
        false => SIO.gpio_out_clr().put(pin),
    };
    level(DIRECTION, down);
    level(STEP, step);
}

/// Ends the step pulse of the motor that lifts the pen.
pub fn end_pulse() {
    SIO.gpio_out_clr().put(STEP);
}
