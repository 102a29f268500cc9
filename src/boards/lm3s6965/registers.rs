//! The chip's registers.

use crate::boards::peripheral::Peripheral;
use crate::boards::pl011::Uart;

// SAFETY of all: the addresses are those of the LM3S6965's data sheet, table 3-1. None of these
// registers makes the chip write to memory.

/// System control, with the clocks. Used by `clock`, `pins`, `serial` and `steps` before interrupts
/// are on.
pub const SYSTEM_CONTROL: Peripheral = unsafe { Peripheral::at(0x400F_E000) };
/// Port A, whose pins 0 and 1 are the serial line. Used by `serial`.
pub const GPIO_A: Peripheral = unsafe { Peripheral::at(0x4000_4000) };
/// Port B, with the machine's pins. Used by `pins`.
pub const GPIO_B: Peripheral = unsafe { Peripheral::at(0x4000_5000) };
/// Port C, with the contacts. Used by `contacts`.
pub const GPIO_C: Peripheral = unsafe { Peripheral::at(0x4000_6000) };
/// The serial line. Used by `serial`.
pub const UART0: Uart = Uart(unsafe { Peripheral::at(0x4000_C000) });
/// The registers of the timer of the step events. Used by `steps`.
pub const TIMER1: Peripheral = unsafe { Peripheral::at(0x4003_1000) };
/// The timer of the pulses. Used by `steps`.
pub const TIMER2: Peripheral = unsafe { Peripheral::at(0x4003_2000) };
