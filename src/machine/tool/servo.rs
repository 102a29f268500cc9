//! A hobby servo that moves the pen: it is told a height by the width of a pulse. A board repeats
//! the pulse with its own timer and changes the width in [`Pen::set_height`](super::Pen).

/// The time from one pulse to the next, in microseconds.
pub const PERIOD_MICROSECONDS: u32 = 20_000;

/// The width of the pulse for a height of the pen, in microseconds: from 1 ms when the pen is
/// raised (height 0) to 2 ms when it is lowered (height 127).
///
/// ```
/// use penup::machine::servo;
/// assert_eq!(servo::pulse_microseconds(0), 1000);
/// assert_eq!(servo::pulse_microseconds(127), 2016);
/// ```
#[inline(always)] // The Pico calls it from an interrupt that needs no flash.
pub const fn pulse_microseconds(height: u8) -> u32 {
    1000 + 8 * height as u32
}
