//! Which pin does what.

use rp2040_hal::gpio::{FunctionPio0, FunctionPwm, FunctionSioOutput, FunctionUart, Pins, PullUp};

/// STEP_X, STEP_Y, DIR_X, DIR_Y and ENABLE are this one and the next four.
pub const FIRST_MOTOR_PIN: u32 = 2;

/// Hands the pins over to their peripherals, which must hold the levels to begin with.
pub fn set_up(pins: Pins) {
    pins.gpio0.into_function::<FunctionUart>();
    // With nothing connected the line rests, which is high; the pad would pull it down to a break.
    pins.gpio1.reconfigure::<FunctionUart, PullUp>();
    pins.gpio2.into_function::<FunctionPio0>();
    pins.gpio3.into_function::<FunctionPio0>();
    pins.gpio4.into_function::<FunctionPio0>();
    pins.gpio5.into_function::<FunctionPio0>();
    pins.gpio6.into_function::<FunctionPio0>();
    pins.gpio7.into_function::<FunctionPwm>();
    // GPIO 15 is left as it is: `usb` uses it for a millisecond (erratum E5) when a host resets
    // the bus, which needs GPIO 16 not to have the function 8.
    pins.gpio11.into_function::<FunctionSioOutput>();
    pins.gpio12.into_function::<FunctionSioOutput>();
    // The contacts.
    pins.gpio8.into_pull_up_input();
    pins.gpio9.into_pull_up_input();
    pins.gpio10.into_pull_up_input();
}
