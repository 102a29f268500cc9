//! Access to the chip's registers, as its PAC (`rp2040_hal::pac`) describes them.
//!
//! The PAC's own types belong to one owner each. Interrupt handlers and the main loop share these
//! peripherals, so each constant here gives access to one of them, and its comment says which
//! modules use it.

use core::ops::Deref;

use rp2040_hal::pac;
use rp2040_hal::pac::generic::{Readable, Reg, RegisterSpec, Writable};

use crate::boards::peripheral::Peripheral;
use crate::boards::pl011::Uart;

/// Access to the registers of a peripheral whose register block is a `B`.
pub struct Registers<B>(*const B);

impl<B> Registers<B> {
    /// Gives access to the register block at the address `block`.
    ///
    /// # Safety
    /// A register block of this type lies at the address, and its registers may be read and written
    /// at any time by the code that has it.
    const unsafe fn at(block: *const B) -> Self {
        Self(block)
    }
}

impl<B> Deref for Registers<B> {
    type Target = B;

    #[inline(always)]
    fn deref(&self) -> &B {
        // SAFETY: the contract of `at`. The fields of a register block are cells.
        unsafe { &*self.0 }
    }
}

/// Access to the registers of a peripheral that reaches into memory by itself, or changes what the
/// core reads there. Safe code cannot write to them.
pub struct Guarded<B>(Registers<B>);

impl<B> Guarded<B> {
    /// Gives access to all registers.
    ///
    /// # Safety
    /// The registers are only read, or what is written to them makes the chip read and write
    /// nothing but registers of peripherals and memory that Rust shares with it as atomics, and
    /// leaves what Rust reads as it is.
    #[inline(always)]
    pub unsafe fn registers(&self) -> &B {
        &self.0
    }
}

/// Gives registers a method that reads all their bits.
pub trait Get {
    /// Returns the bits of the register.
    fn get(&self) -> u32;
}

impl<R: Readable + RegisterSpec<Ux = u32>> Get for Reg<R> {
    #[inline(always)]
    fn get(&self) -> u32 {
        self.read().bits()
    }
}

/// Gives registers methods that write their bits.
pub trait Put {
    /// Writes all bits of the register.
    fn put(&self, bits: u32);
    /// Sets `bits` of the register in one write, by its alias (data sheet, 2.1.2). The core's own
    /// registers and those of SIO have none.
    fn set(&self, bits: u32);
    /// Clears `bits` of the register in one write, by its alias, as [`Put::set`] sets them.
    fn clear(&self, bits: u32);
}

impl<R: Writable + RegisterSpec<Ux = u32>> Put for Reg<R> {
    #[inline(always)]
    fn put(&self, bits: u32) {
        // SAFETY: the contract of `Registers::at`.
        unsafe { self.as_ptr().write_volatile(bits) };
    }

    #[inline(always)]
    fn set(&self, bits: u32) {
        // SAFETY: the contract of `Registers::at`, which also covers the aliases of the register.
        unsafe { self.as_ptr().byte_add(0x2000).write_volatile(bits) };
    }

    #[inline(always)]
    fn clear(&self, bits: u32) {
        // SAFETY: the contract of `Registers::at`, which also covers the aliases of the register.
        unsafe { self.as_ptr().byte_add(0x3000).write_volatile(bits) };
    }
}

// SAFETY of all: the PAC has the addresses. None of these registers makes the chip reach into
// memory that Rust knows, except those that are guarded.

/// The reset controller, which holds peripherals in reset. Used at set-up, before interrupts are
/// on.
const RESETS: Registers<pac::resets::RegisterBlock> = unsafe { Registers::at(pac::RESETS::PTR) };
/// The serial line, as the PL011 that several chips have. Used by `serial`.
pub const UART0: Uart = Uart(unsafe { Peripheral::at(0x4003_4000) });
/// The chip's identification. Used by `usb`.
pub const SYSINFO: Registers<pac::sysinfo::RegisterBlock> =
    unsafe { Registers::at(pac::SYSINFO::PTR) };
/// The functions of the pins. Used by `pins`, and by `usb` for GPIO 15 only.
pub const IO_BANK0: Registers<pac::io_bank0::RegisterBlock> =
    unsafe { Registers::at(pac::IO_BANK0::PTR) };
/// The pads of the pins. Used by `pins`, and by `usb` for GPIO 15 only.
pub const PADS_BANK0: Registers<pac::pads_bank0::RegisterBlock> =
    unsafe { Registers::at(pac::PADS_BANK0::PTR) };
/// The PWM unit for the servo. Used by `pen`.
pub const PWM: Registers<pac::pwm::RegisterBlock> = unsafe { Registers::at(pac::PWM::PTR) };
/// The timer that counts microseconds. Used by `clock`.
pub const TIMER: Registers<pac::timer::RegisterBlock> = unsafe { Registers::at(pac::TIMER::PTR) };
/// The pins' levels and the divider. Used by `pins`, `contacts`, `z_axis` and `divider`.
pub const SIO: Registers<pac::sio::RegisterBlock> = unsafe { Registers::at(pac::SIO::PTR) };
/// The power-on state machine, which selects what a reset affects. Used by `emergency`.
pub const PSM: Registers<pac::psm::RegisterBlock> = unsafe { Registers::at(pac::PSM::PTR) };
/// The registers of the watchdog, which restarts the chip if the program hangs. Used by
/// `emergency`.
pub const WATCHDOG: Registers<pac::watchdog::RegisterBlock> =
    unsafe { Registers::at(pac::WATCHDOG::PTR) };
/// Direct memory access. `steps` uses channel 0, and `serial` uses channels 1 and 2.
pub const DMA: Guarded<pac::dma::RegisterBlock> = Guarded(unsafe { Registers::at(pac::DMA::PTR) });
/// Programmable input and output. `steps` uses its state machine 0.
pub const PIO0: Registers<pac::pio0::RegisterBlock> = unsafe { Registers::at(pac::PIO0::PTR) };
/// The core's own registers: the masks of the interrupts, and the address of the vector table. Used
/// by `critical`.
pub const PPB: Guarded<pac::ppb::RegisterBlock> = Guarded(unsafe { Registers::at(pac::PPB::PTR) });
/// The USB controller. Used by `usb`.
pub const USB: Registers<pac::usbctrl_regs::RegisterBlock> =
    unsafe { Registers::at(pac::USBCTRL_REGS::PTR) };
/// The USB controller's memory, of 1024 words, which Rust has for nothing else. Used by `usb`.
pub const USB_MEMORY: Peripheral = unsafe { Peripheral::at(0x5010_0000) };
/// The serial line to the flash chip. Used by `flash`, while nothing else reads the flash.
pub const SSI: Guarded<pac::xip_ssi::RegisterBlock> =
    Guarded(unsafe { Registers::at(pac::XIP_SSI::PTR) });
/// The pins of the serial line to the flash chip. Used by `flash`, while nothing else reads the
/// flash.
pub const IO_QSPI: Registers<pac::io_qspi::RegisterBlock> =
    unsafe { Registers::at(pac::IO_QSPI::PTR) };

/// The bits of the peripherals in the reset register.
pub mod reset {
    /// The bit of the DMA controller.
    pub const DMA: u32 = 1 << 2;
    /// The bit of the first block of programmable input and output.
    pub const PIO0: u32 = 1 << 10;
    /// The bit of the PWM unit.
    pub const PWM: u32 = 1 << 14;
    /// The bit of the chip's identification.
    pub const SYSINFO: u32 = 1 << 19;
    /// The bit of the timer.
    pub const TIMER: u32 = 1 << 21;
    /// The bit of the first UART.
    pub const UART0: u32 = 1 << 22;
    /// The bit of the USB controller.
    pub const USBCTRL: u32 = 1 << 24;
}

/// Resets the peripherals of `bits`, so that their registers have their initial values, and waits
/// until they run.
pub fn restart(bits: u32) {
    RESETS.reset().set(bits);
    RESETS.reset().clear(bits);
    while RESETS.reset_done().get() & bits != bits {}
}
