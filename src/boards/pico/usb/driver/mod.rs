//! Drives the RP2040's USB controller as a device with the endpoints of one serial port (data
//! sheet, section 4.1).
//!
//! [`Bus`] exchanges packets with the host, `buffers` is what program and controller share, and
//! `endpoints` has what is done with the buffers besides. Nothing here panics, waits for the host,
//! or needs an allocator or a lock: the interrupt handler calls it, or code that masks that
//! handler.
//!
//! The driver reaches the chip by the trait [`Controller`] alone, so the tests of the host run
//! these very files, on a controller made of plain memory.

mod buffers;
mod bus;
mod endpoints;

pub use self::buffers::{Buffers, FROM_0, FROM_PORT, TO_0, TO_PORT, buffer_of};
pub use self::bus::{Bus, Event, NOTICE, PACKET, PacketError};
pub use self::endpoints::MOST_DATA;

/// The registers of the controller that the driver uses, with the data sheet's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Register {
    /// The device's address.
    AddrEndp,
    /// Switches the controller on.
    MainCtrl,
    /// Connects the device to the bus, among others.
    SieCtrl,
    /// What has happened on the bus. Written ones clear.
    SieStatus,
    /// One bit for each buffer that the host has taken or filled. Written ones clear.
    BuffStatus,
    /// Lets endpoint 0 refuse packets, where its control words say so, until the next request.
    EpStallArm,
    /// To what the controller is connected.
    UsbMuxing,
    /// Whether the bus has power.
    UsbPwr,
    /// The interrupts that are due, enabled or not.
    Intr,
    /// The interrupts that are enabled.
    Inte,
}

/// A USB controller with the registers and the memory of the RP2040's.
pub trait Controller {
    /// Returns a register.
    fn get(&self, register: Register) -> u32;
    /// Writes a register.
    fn put(&self, register: Register, bits: u32);
    /// Returns a word of the controller's memory, which has 1024 of them.
    fn word(&self, index: usize) -> u32;
    /// Writes a word of the controller's memory.
    fn put_word(&self, index: usize, word: u32);
    /// Waits for at least so many cycles of the core.
    fn delay(&self, cycles: u32);
}
