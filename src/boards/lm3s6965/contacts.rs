//! The contacts, which are on port C. The interrupt of the port wakes the main loop when a contact
//! changes.

use core::sync::atomic::Ordering;

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::machine::Contacts;

use super::registers::{GPIO_C, SYSTEM_CONTROL};
use super::{HAPPENED, ROW, critical};

mod offset {
    pub const BOTH_EDGES: usize = 0x408;
    pub const INTERRUPT_MASK: usize = 0x410;
    pub const INTERRUPT_CLEAR: usize = 0x41C;
    pub const PULL_DOWN: usize = 0x514;
    pub const DIGITAL_ENABLE: usize = 0x51C;
    /// In system control.
    pub const GPIO_CLOCKS: usize = 0x108;
}
const PORT_C_CLOCK: u32 = 1 << 2;
const LIMIT_X: u32 = 1 << ROW.pins.limit_x;
const LIMIT_Y: u32 = 1 << ROW.pins.limit_y;
const STOP: u32 = 1 << ROW.pins.stop;
const ALL: u32 = LIMIT_X | LIMIT_Y | STOP;

/// Makes the pins inputs with pull-down resistors.
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
    // Bits 2 to 9 of the address of the data register are its mask.
    let closed = GPIO_C.read((ALL << 2) as usize);
    Contacts { x: closed & LIMIT_X != 0, y: closed & LIMIT_Y != 0, stop: closed & STOP != 0 }
}

#[interrupt]
fn GPIOC() {
    GPIO_C.write(offset::INTERRUPT_CLEAR, ALL);
    HAPPENED.store(true, Ordering::Relaxed);
}
