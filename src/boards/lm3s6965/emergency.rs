//! What this board does on panics and faults: see [`crate::boards::fault`].

use core::fmt;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;

use super::callers::Callers;
use super::registers::UART0;
use super::{Lm3s6965, pins, steps};
use crate::boards::fault::Fault;
use crate::boards::pl011::Uart;

impl Fault for Lm3s6965 {
    const UART: Uart = UART0;

    fn release() {
        steps::halt();
        pins::release();
    }

    #[inline(always)] // So that the calls begin with the handler's.
    fn cause(_: &PanicInfo, stack_start: usize) -> impl fmt::Display {
        Callers::new(stack_start)
    }

    fn reset() -> ! {
        SCB::sys_reset()
    }
}
