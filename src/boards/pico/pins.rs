//! Assigns the pins to their functions. The table of the boards has the pins of the machine.

use super::registers::{Get as _, IO_BANK0, PADS_BANK0, Put as _, SIO};
use penup::board_table::Pins;

/// The numbers of the machine's pins, from the table of the boards.
const PINS: Pins = super::ROW.pins;

/// The first of five consecutive pins: STEP_X, STEP_Y, DIR_X, DIR_Y and ENABLE.
pub const FIRST_MOTOR_PIN: u8 = PINS.step_x;
const _: () = assert!(
    PINS.step_y == FIRST_MOTOR_PIN + 1
        && PINS.dir_x == FIRST_MOTOR_PIN + 2
        && PINS.dir_y == FIRST_MOTOR_PIN + 3
        && PINS.enable == FIRST_MOTOR_PIN + 4
);

/// The pins on which UART0 sends and receives.
const UART_PINS: [u8; 2] = [0, 1];

/// The functions of a pin (data sheet, 2.19.2).
#[derive(Clone, Copy)]
enum Function {
    /// The serial line.
    Uart = 2,
    /// The servo's pulses.
    Pwm = 4,
    /// The program itself.
    Sio = 5,
    /// The state machine that makes the steps.
    Pio0 = 6,
    /// Nothing drives the pin.
    None = 31,
}

/// Hands the pins over to their peripherals, which must already hold the initial levels. The pins
/// must be out of reset.
///
/// GPIO 15 is left unchanged. `usb` uses it for a millisecond (erratum E5) when a host resets the
/// bus. For this, GPIO 16 must not have function 8.
pub fn hand_over() {
    let [sends, receives] = UART_PINS;
    give(sends, Function::Uart);
    // If nothing is connected, the pull-up keeps the line at rest, which is high. The default of
    // the pad would pull it low, which is a break.
    pull_up(receives);
    give(receives, Function::Uart);
    for number in FIRST_MOTOR_PIN..=PINS.enable {
        give(number, Function::Pio0);
    }
    give(PINS.pen, Function::Pwm);
    for number in [PINS.step_z, PINS.dir_z] {
        SIO.gpio_oe_set().put(1 << number);
        give(number, Function::Sio);
    }
    for number in [PINS.limit_x, PINS.limit_y, PINS.stop] {
        pull_up(number);
        SIO.gpio_oe_clr().put(1 << number);
        give(number, Function::Sio);
    }
}

/// Leaves the enable pin of the drivers to the resistor at it.
pub fn release_enable() {
    give(PINS.enable, Function::None);
}

/// Inverts the step pins of the motors in the mask `steps`, and the enable pin if `enable`.
/// Whatever drives these pins then drives them the other way, a fault included.
pub fn invert(steps: u8, enable: bool) {
    /// The bit of a pin's control register that inverts its output (data sheet, 2.19.6.1).
    const INVERT: u32 = 1 << 8;
    let is_inverted = [steps & 1 != 0, steps & 2 != 0, steps & 4 != 0, enable];
    let numbers = [PINS.step_x, PINS.step_y, PINS.step_z, PINS.enable];
    for (number, is_inverted) in numbers.into_iter().zip(is_inverted) {
        let control = IO_BANK0.gpio(number.into()).gpio_ctrl();
        if is_inverted {
            control.set(INVERT);
        } else {
            control.clear(INVERT);
        }
    }
}

/// Pulls a pin up, and no longer down.
fn pull_up(number: u8) {
    /// The bits of a pad that pull the pin down and up (data sheet, 2.19.6.3).
    const PULLS_DOWN: u32 = 1 << 2;
    const PULLS_UP: u32 = 1 << 3;
    if let Some(pad) = PADS_BANK0.gpio_iter().nth(number.into()) {
        pad.put(pad.get() & !PULLS_DOWN | PULLS_UP);
    }
}

/// Gives a pin a function. Its level can be read, whatever drives it.
fn give(number: u8, function: Function) {
    /// The bit of a pad that lets the pin be read.
    const INPUT: u32 = 1 << 6;
    /// The bits of the control register that choose the function.
    const FUNCTION: u32 = 0x1F;
    if let Some(pad) = PADS_BANK0.gpio_iter().nth(number.into()) {
        pad.set(INPUT);
    }
    if let Some(pin) = IO_BANK0.gpio_iter().nth(number.into()) {
        let control = pin.gpio_ctrl();
        control.put(control.get() & !FUNCTION | function as u32);
    }
}
