//! The chip's registers.

use crate::boards::peripheral::Peripheral;
use crate::boards::pl011::Uart;

// SAFETY of all: the address map of the RP2040's data sheet, 2.2; none reaches into memory.

/// The reset controller, which holds peripherals in reset. Used at set-up, before interrupts are
/// on.
const RESETS: Peripheral = unsafe { Peripheral::at(0x4000_C000) };
/// The serial line. Used by `serial`.
pub const UART0: Uart = Uart(unsafe { Peripheral::at(0x4003_4000) });
/// The chip's identification. Used by `usb`.
pub const SYSTEM_INFORMATION: Peripheral = unsafe { Peripheral::at(0x4000_0000) };
/// The functions of the pins. Used by `usb`, for GPIO 15 only.
pub const BANK_0_CONTROLS: Peripheral = unsafe { Peripheral::at(0x4001_4000) };
/// The pads of the pins. Used by `usb`, for GPIO 15 only.
pub const BANK_0_PADS: Peripheral = unsafe { Peripheral::at(0x4001_C000) };
/// The PWM unit for the servo. Used by `pen`.
pub const PWM: Peripheral = unsafe { Peripheral::at(0x4005_0000) };
/// The timer that counts microseconds. Used by `clock`.
pub const TIMER: Peripheral = unsafe { Peripheral::at(0x4005_4000) };
/// The pins' levels. Used by `contacts` and `lift`.
pub const SIO: Peripheral = unsafe { Peripheral::at(0xD000_0000) };
/// The power-on state machine, which selects what a reset affects. Used by `emergency`.
pub const PSM: Peripheral = unsafe { Peripheral::at(0x4001_0000) };
/// The watchdog. Used by `emergency`.
pub const WATCHDOG: Peripheral = unsafe { Peripheral::at(0x4005_8000) };
/// Direct memory access. `steps` uses channel 0, and `serial` uses channels 1 and 2.
pub const DMA: Peripheral = unsafe { Peripheral::at(0x5000_0000) };
/// Programmable input and output. `steps` uses its state machine 0.
pub const PIO0: Peripheral = unsafe { Peripheral::at(0x5020_0000) };

/// The registers of the core: the masks of the interrupts, and the address of the vector table.
/// Used by `critical`.
pub const SYSTEM: Peripheral = unsafe { Peripheral::at(0xE000_E000) };
/// The USB controller. Used by `usb` in addition to its driver.
pub const USB: Peripheral = unsafe { Peripheral::at(0x5011_0000) };

/// Bits of the reset register.
pub mod reset {
    pub const DMA: u32 = 1 << 2;
    pub const PIO0: u32 = 1 << 10;
    pub const PWM: u32 = 1 << 14;
    pub const TIMER: u32 = 1 << 21;
    pub const UART0: u32 = 1 << 22;
}

/// Resets the peripherals of `bits`, so that their registers have their initial values, and waits
/// until they run.
pub fn restart(bits: u32) {
    const RESET_DONE: usize = 0x8;
    const SET: usize = 0x2000;
    const CLEAR: usize = 0x3000;
    RESETS.write(SET, bits);
    RESETS.write(CLEAR, bits);
    while RESETS.read(RESET_DONE) & bits != bits {}
}
