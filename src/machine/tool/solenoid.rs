//! A solenoid that lowers the pen: one pin, two positions.

use super::Pen;
use core::convert::Infallible;
use embedded_hal::digital::{OutputPin, PinState};

/// A pen with two positions at one pin. The pin is high, and the pen down, from height 64 on.
#[derive(Debug)]
pub struct Solenoid<P>(pub P);

impl<P: OutputPin<Error = Infallible>> Pen for Solenoid<P> {
    #[inline]
    fn set_height(&mut self, height: u8) {
        let Ok(()) = self.0.set_state(PinState::from(height >= 64));
    }
}
