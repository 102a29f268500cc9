//! Assigns the pins to their functions. The table of the boards has the pins of the machine.

use super::registers::{IO_BANK0, Put as _};
use penup::board_table::Pins;
use rp2040_hal::gpio::{DynBankId, DynFunction, DynPinId, DynPullType, DynSioConfig, new_pin};

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

/// Hands the pins over to their peripherals, which must already hold the initial levels. The pins
/// must be out of reset.
///
/// GPIO 15 is left unchanged. `usb` uses it for a millisecond (erratum E5) when a host resets the
/// bus. For this, GPIO 16 must not have function 8.
pub fn hand_over() {
    let [sends, receives] = UART_PINS;
    give(sends, DynFunction::Uart, None);
    // If nothing is connected, the pull-up keeps the line at rest, which is high. The default of
    // the pad would pull it low, which is a break.
    give(receives, DynFunction::Uart, Some(DynPullType::Up));
    for number in FIRST_MOTOR_PIN..=PINS.enable {
        give(number, DynFunction::Pio0, None);
    }
    give(PINS.pen, DynFunction::Pwm, None);
    give(PINS.step_z, DynFunction::Sio(DynSioConfig::Output), None);
    give(PINS.dir_z, DynFunction::Sio(DynSioConfig::Output), None);
    for number in [PINS.limit_x, PINS.limit_y, PINS.stop] {
        give(number, DynFunction::Sio(DynSioConfig::Input), Some(DynPullType::Up));
    }
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

/// Gives a pin a function, and changes its pull resistors if `pull` says so.
fn give(number: u8, function: DynFunction, pull: Option<DynPullType>) {
    // SAFETY: it runs once, at set-up, and nothing else has the pins.
    let mut pin = unsafe { new_pin(DynPinId { bank: DynBankId::Bank0, num: number }) };
    if let Some(pull) = pull {
        pin.set_pull_type(pull);
    }
    // It fails only if the pin lacks the function, and then the machine does not move.
    let _ = pin.try_set_function(function);
}
