//! The time, and the millisecond interrupt that wakes the main loop and samples the contacts.

use cortex_m::peripheral::NVIC;
use rp2040_hal::pac::{Interrupt, interrupt};

use super::registers::TIMER;
use super::{contacts, critical, serial};

/// The clock frequency in cycles per second.
pub const HERTZ: u32 = 125_000_000;

mod offset {
    pub const ALARM_0: usize = 0x10;
    pub const TIME_LOW: usize = 0x28;
    pub const INTERRUPT: usize = 0x34;
    pub const INTERRUPT_ENABLE: usize = 0x38;
}
const ALARM_0: u32 = 1;
const MILLISECOND: u32 = 1000;

/// Starts the millisecond interrupt. From now on it wakes the main loop, which keeps the queue of
/// steps full.
pub fn start(nvic: &mut NVIC) {
    TIMER.write(offset::INTERRUPT_ENABLE, ALARM_0);
    critical::enable(nvic, Interrupt::TIMER_IRQ_0, critical::CLOCK_PRIORITY);
    schedule();
}

/// Sets the alarm to one millisecond from now.
///
/// The alarm comes when the time equals its target, so an alarm that is set too late comes after 71
/// minutes. Other interrupts may come between reading the time and setting the alarm, and last
/// longer than a millisecond. Then the alarm is set again. If the first one came in between, there
/// is one interrupt too many.
fn schedule() {
    loop {
        let target = microseconds().wrapping_add(MILLISECOND);
        TIMER.write(offset::ALARM_0, target);
        let left = target.wrapping_sub(microseconds());
        if (1..=MILLISECOND).contains(&left) {
            return;
        }
    }
}

/// The microseconds since the start; the count wraps.
pub fn microseconds() -> u32 {
    TIMER.read(offset::TIME_LOW)
}

#[interrupt]
fn TIMER_IRQ_0() {
    TIMER.write(offset::INTERRUPT, ALARM_0);
    contacts::look();
    serial::look_soon();
    schedule();
}

defmt::timestamp!("{=u32:us}", microseconds());
