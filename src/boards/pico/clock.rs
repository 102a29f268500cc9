//! The time, and the millisecond interrupt that wakes the main loop and samples the contacts.

use cortex_m::peripheral::NVIC;
use rp2040_hal::pac::{Interrupt, interrupt};

use super::registers::{Get, Put, TIMER};
use super::{contacts, critical, serial};

/// The clock frequency in cycles per second.
pub const HERTZ: u32 = super::ROW.clock_hertz;

/// The bit that stands for the timer's first alarm, which causes this module's interrupt, in the
/// registers that enable, show and clear the timer's interrupts.
const ALARM_0: u32 = 1;
/// The time from one interrupt of this module to the next, in microseconds.
const MILLISECOND: u32 = 1000;

/// Starts the millisecond interrupt. From now on it wakes the main loop, which keeps the queue of
/// steps full.
pub fn start(nvic: &mut NVIC) {
    TIMER.inte().put(ALARM_0);
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
        TIMER.alarm0().put(target);
        let left = target.wrapping_sub(microseconds());
        if (1..=MILLISECOND).contains(&left) {
            return;
        }
    }
}

/// The microseconds since the start; the count wraps.
pub fn microseconds() -> u32 {
    TIMER.timerawl().get()
}

/// The millisecond interrupt. It samples the contacts, has received bytes read, and wakes the main
/// loop.
#[interrupt]
fn TIMER_IRQ_0() {
    TIMER.intr().put(ALARM_0);
    contacts::sample();
    serial::request_read();
    schedule();
}

defmt::timestamp!("{=u32:us}", microseconds());
