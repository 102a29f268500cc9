//! Assigns the pins to their functions.

use rp2040_hal::gpio::{FunctionPio0, FunctionPwm, FunctionSioOutput, FunctionUart, Pins, PullUp};

/// The first of five consecutive pins: STEP_X, STEP_Y, DIR_X, DIR_Y and ENABLE.
pub const FIRST_MOTOR_PIN: u32 = 2;

/// Hands the pins over to their peripherals, which must already hold the initial levels.
pub fn set_up(pins: Pins) {
    pins.gpio0.into_function::<FunctionUart>();
    // If nothing is connected, the pull-up keeps the line at rest, which is high. The default of
    // the pad would pull it low, which is a break.
    pins.gpio1.reconfigure::<FunctionUart, PullUp>();
    pins.gpio2.into_function::<FunctionPio0>();
    pins.gpio3.into_function::<FunctionPio0>();
    pins.gpio4.into_function::<FunctionPio0>();
    pins.gpio5.into_function::<FunctionPio0>();
    pins.gpio6.into_function::<FunctionPio0>();
    pins.gpio7.into_function::<FunctionPwm>();
    // GPIO 15 is left unchanged. `usb` uses it for a millisecond (erratum E5) when a host resets
    // the bus. For this, GPIO 16 must not have function 8.
    pins.gpio11.into_function::<FunctionSioOutput>();
    pins.gpio12.into_function::<FunctionSioOutput>();
    // The contacts are inputs with pull-up resistors.
    pins.gpio8.into_pull_up_input();
    pins.gpio9.into_pull_up_input();
    pins.gpio10.into_pull_up_input();
}
