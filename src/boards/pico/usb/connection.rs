//! Connects the board after a host has reset the bus, as erratum RP2040-E5 requires.
//!
//! After a reset, revisions B0 and B1 of the chip take part in the bus only once it has been idle
//! (level J) for 800 microseconds. Behind a hub that carries packets for other devices the bus is
//! never idle for so long, and the host does not find the board. So the controller is shown an idle
//! bus when the reset is over. GPIO 15 is the only pin from which it can take the level of the wire
//! D+. The Pico SDK does the same in `rp2040_usb_device_enumeration_fix`.
//!
//! The reset counts as over as soon as the wires are read and are not both low. A moment later they
//! may be low again, since every packet ends like that. This is no problem: a packet was for
//! another device, and another reset would last longer than the board looks away. So the wires are
//! read only once. (The workaround of rp2040-hal asserts that they are still as they were, and the
//! board would restart in the middle of a job.)
//!
//! The workaround takes a millisecond in which the controller does not hear the bus. The host
//! leaves a device alone for ten milliseconds after a reset.

use super::super::registers::{Get, IO_BANK0, PADS_BANK0, Put, SYSINFO, USB};
use super::BUS_RESET;

/// How far the number of the chip is shifted right to give its revision, which is 1 for B0 and B1.
const REVISION_SHIFT: u32 = 28;
/// The first revision without the erratum.
const FIRST_SOUND_REVISION: u32 = 2;

/// Bits of the controller's registers.
mod controller {
    /// The bits of the status that hold the levels of the wires.
    pub const LINE: u32 = 3 << 2;
    /// Both wires are low: the host resets the bus.
    pub const BOTH_LOW: u32 = 0;
    /// The controller takes part in the bus.
    pub const CONNECTED: u32 = 1 << 16;
    /// The controller takes the levels of the wires from the wires themselves.
    pub const WIRES: u32 = 1 | 1 << 3;
    /// The controller takes the levels of the wires from pins of the chip that stand for them.
    pub const PINS: u32 = 1 << 2 | 1 << 3;
    /// The wire D+ is pulled up, which shows the host a device.
    pub const PULLS_UP: u32 = 1 << 1;
    /// The pull-up is as the program says, and not as the controller does.
    pub const OVERRIDES_PULL_UP: u32 = 1 << 2;
}

/// GPIO 15: its number, and bits of its registers.
mod pin {
    /// The number of this pin of the chip.
    pub const NUMBER: usize = 15;
    /// The bits that pull the pin up and down at once, so that it keeps its present level.
    pub const KEEPS: u32 = 1 << 2 | 1 << 3;
    /// The bits that choose the function of the pin.
    pub const FUNCTION: u32 = 0x1F;
    /// The function in which the pin stands for a wire of the bus.
    pub const IS_USB_WIRE: u32 = 8;
    /// The bits that say whether the pin is driven.
    pub const OUTPUT: u32 = 3 << 12;
    /// The value of the two bits at which the pin is not driven.
    pub const OUTPUT_OFF: u32 = 2 << 12;
    /// The pin reads as high, whatever its level is.
    pub const READS_HIGH: u32 = 3 << 16;
}

/// Watches for resets of the bus, and connects the board after each.
pub struct Connection {
    /// The original pad and control registers of the pin while the controller is shown an idle bus.
    before: Option<(u32, u32)>,
}

impl Connection {
    /// Makes the state before the first reset of the bus.
    pub const fn new() -> Self {
        Self { before: None }
    }

    /// Whether the driver may process the controller's interrupts. It may not from a reset of the
    /// bus until the board is connected again. Call it repeatedly until it returns true.
    pub fn is_ready(&mut self) -> bool {
        let status = USB.sie_status().get();
        let is_connected = status & controller::CONNECTED != 0;
        match self.before {
            Some((pad, control)) if is_connected => {
                show_wires(pad, control);
                self.before = None;
                true
            }
            Some(_) => false,
            None if is_connected || USB.intr().get() & BUS_RESET == 0 || is_sound() => true,
            None => {
                if status & controller::LINE != controller::BOTH_LOW {
                    self.before = Some(show_idle_bus());
                }
                false
            }
        }
    }
}

/// Whether the chip is of a revision without the erratum.
fn is_sound() -> bool {
    SYSINFO.chip_id().get() >> REVISION_SHIFT >= FIRST_SOUND_REVISION
}

/// Shows the controller D+ high, from GPIO 15, and D- low, because GPIO 16 has another function.
/// The wires stay pulled up, so that the host sees a device. Returns the pad and control registers
/// of the pin.
fn show_idle_bus() -> (u32, u32) {
    let (pads, controls) = (PADS_BANK0.gpio(pin::NUMBER), IO_BANK0.gpio(pin::NUMBER).gpio_ctrl());
    let (pad, control) = (pads.get(), controls.get());
    pads.put(pad | pin::KEEPS);
    // These writes are separate so that the controller never drives the pin.
    let control_off = control & !pin::OUTPUT | pin::OUTPUT_OFF;
    let control_wire = control_off & !pin::FUNCTION | pin::IS_USB_WIRE;
    controls.put(control_off);
    controls.put(control_wire);
    controls.put(control_wire | pin::READS_HIGH);
    USB.usbphy_direct().set(controller::PULLS_UP);
    USB.usbphy_direct_override().set(controller::OVERRIDES_PULL_UP);
    USB.usb_muxing().put(controller::PINS);
    (pad, control)
}

/// Shows the controller the wires again, and restores the pin.
fn show_wires(pad: u32, control: u32) {
    USB.usb_muxing().put(controller::WIRES);
    USB.usbphy_direct_override().clear(controller::OVERRIDES_PULL_UP);
    IO_BANK0.gpio(pin::NUMBER).gpio_ctrl().put(control);
    PADS_BANK0.gpio(pin::NUMBER).put(pad);
}
