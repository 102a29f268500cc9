//! The contacts, which are on port C. The interrupt of the port wakes the main loop when a contact
//! changes.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::machine::Contacts;

use super::registers::{GPIO_C, SYSTEM_CONTROL};
use super::{HAPPENED, ROW, critical};
use crate::boards::peripheral::Offset;

/// The registers of the port that are used here, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register that says, by one bit for each pin, which pins cause an interrupt at rising and
    /// at falling edges.
    pub const BOTH_EDGES: Offset = Offset::new(0x408);
    /// The register that says, by one bit for each pin, which pins may cause an interrupt at all.
    pub const INTERRUPT_MASK: Offset = Offset::new(0x410);
    /// The register that clears the interrupt of a pin when the pin's bit is written to it.
    pub const INTERRUPT_CLEAR: Offset = Offset::new(0x41C);
    /// The register that says, by one bit for each pin, which pins read low where nothing is
    /// connected.
    pub const PULL_DOWN: Offset = Offset::new(0x514);
    /// The register that says, by one bit for each pin, which pins are digital.
    pub const DIGITAL_ENABLE: Offset = Offset::new(0x51C);
    /// The register of system control that switches the clocks of the ports on.
    pub const GPIO_CLOCKS: Offset = Offset::new(0x108);
}
/// The bit that switches the clock of port C on.
const PORT_C_CLOCK: u32 = 1 << 2;
/// The bit of the limit switch of x.
const LIMIT_X: u32 = 1 << ROW.pins.limit_x;
/// The bit of the limit switch of y.
const LIMIT_Y: u32 = 1 << ROW.pins.limit_y;
/// The bit of the emergency stop.
const STOP: u32 = 1 << ROW.pins.stop;
/// The bits of all contacts.
const ALL: u32 = LIMIT_X | LIMIT_Y | STOP;

/// Makes the pins of the contacts inputs with pull-down resistors, and enables their interrupt.
pub fn set_up(nvic: &mut NVIC) {
    SYSTEM_CONTROL.set_bits(offset::GPIO_CLOCKS, PORT_C_CLOCK);
    // The port responds three cycles after its clock is on; this read takes longer.
    SYSTEM_CONTROL.read(offset::GPIO_CLOCKS);
    GPIO_C.set_bits(offset::PULL_DOWN, ALL);
    GPIO_C.set_bits(offset::DIGITAL_ENABLE, ALL);
    GPIO_C.set_bits(offset::BOTH_EDGES, ALL);
    GPIO_C.write(offset::INTERRUPT_CLEAR, ALL);
    GPIO_C.set_bits(offset::INTERRUPT_MASK, ALL);
    critical::enable(nvic, Interrupt::GPIOC, critical::CLOCK_PRIORITY);
}

/// The contacts that are closed; their pins are high.
pub fn read() -> Contacts {
    let closed = GPIO_C.read(Offset::of_pins(ALL as u8));
    Contacts { x: closed & LIMIT_X != 0, y: closed & LIMIT_Y != 0, stop: closed & STOP != 0 }
}

/// The interrupt for a change of a contact. It only wakes the main loop, which reads the contacts.
#[interrupt]
fn GPIOC() {
    GPIO_C.write(offset::INTERRUPT_CLEAR, ALL);
    HAPPENED.store(true, Ordering::Relaxed);
}
