//! How long the handlers of the emulated Pico run, and how long it masks interrupts.

use super::process::State;
use super::record::TIME_INTERRUPTS;
use super::{EmulatorError, Pico};
use crate::emulator::{EmulatedBoard as _, TIMEOUT};
use std::collections::BTreeMap;
use std::io;
use std::time::Duration;

/// The longest times since the measurement began, on the board's clock.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct InterruptTimes {
    /// The longest run of each handler, with the handlers that interrupt it, by the number of its
    /// exception: 16 more than that of its interrupt.
    pub handlers: BTreeMap<u8, Duration>,
    /// The longest time for which each interrupt was masked, by its number, or by
    /// [`InterruptTimes::ALL`] or [`InterruptTimes::ALL_FOR_FLASH`] where the core's own mask kept
    /// all of them away.
    pub masks: BTreeMap<u8, Duration>,
}

impl InterruptTimes {
    /// The number under which [`InterruptTimes::masks`] has the core's mask of all interrupts.
    pub const ALL: u8 = 255;
    /// The same where the core has waited meanwhile for the flash to be erased or written.
    pub const ALL_FOR_FLASH: u8 = 254;
}

impl Pico {
    /// From now on, measures how long handlers run and how long interrupts are masked. Earlier
    /// measurements are forgotten. It makes the emulator a little slower.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn time_interrupts(&mut self) -> io::Result<()> {
        self.send(TIME_INTERRUPTS, 1, 0)
    }

    /// Returns the longest times since [`Pico::time_interrupts`], which must have been called.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn interrupt_times(&mut self) -> Result<InterruptTimes, EmulatorError> {
        {
            let mut state = self.shared.lock();
            state.interrupt_times = InterruptTimes::default();
            state.knows_interrupt_times = false;
        }
        self.send(TIME_INTERRUPTS, 0, 0)?;
        let waits = |state: &mut State| !state.knows_interrupt_times && !state.ended;
        let mut state = self.shared.wait_while(TIMEOUT, waits);
        if state.knows_interrupt_times {
            return Ok(std::mem::take(&mut state.interrupt_times));
        }
        drop(state);
        Err(EmulatorError::Ended { said: self.said() })
    }
}
