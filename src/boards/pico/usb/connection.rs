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

use super::super::registers::{BANK_0_CONTROLS, BANK_0_PADS, SYSTEM_INFORMATION, USB};
use super::{BUS_RESET, INTERRUPTS};

/// The number of the chip; its revision is in the highest bits, 1 for B0 and B1.
const CHIP: usize = 0;
const REVISION_SHIFT: u32 = 28;
const FIRST_SOUND_REVISION: u32 = 2;

/// Registers of the controller and their bits. Bits written to the `SET` or `CLEAR` address of a
/// register are set or cleared in it.
mod controller {
    const SET: usize = 0x2000;
    const CLEAR: usize = 0x3000;
    pub const STATUS: usize = 0x50;
    pub const LINE: u32 = 3 << 2;
    pub const BOTH_LOW: u32 = 0;
    pub const CONNECTED: u32 = 1 << 16;
    /// Selects where the controller takes the levels of the wires from.
    pub const SOURCE: usize = 0x74;
    pub const WIRES: u32 = 1 | 1 << 3;
    pub const PINS: u32 = 1 << 2 | 1 << 3;
    pub const SET_DIRECT: usize = 0x7C + SET;
    pub const PULLS_UP: u32 = 1 << 1;
    pub const SET_OVERRIDE: usize = 0x80 + SET;
    pub const CLEAR_OVERRIDE: usize = 0x80 + CLEAR;
    pub const OVERRIDES_PULL_UP: u32 = 1 << 2;
}

/// GPIO 15: its registers, and their bits.
mod pin {
    pub const PAD: usize = 0x40;
    /// Both pulls at once keep the present level.
    pub const KEEPS: u32 = 1 << 2 | 1 << 3;
    pub const CONTROL: usize = 0x7C;
    pub const FUNCTION: u32 = 0x1F;
    pub const IS_USB_WIRE: u32 = 8;
    pub const OUTPUT: u32 = 3 << 12;
    pub const OUTPUT_OFF: u32 = 2 << 12;
    pub const READS_HIGH: u32 = 3 << 16;
}

/// Tracks the resets of the bus.
pub struct Connection {
    /// The original pad and control registers of the pin while the controller is shown an idle bus.
    before: Option<(u32, u32)>,
}

impl Connection {
    pub const fn new() -> Self {
        Self { before: None }
    }

    /// Whether the driver may process the controller's interrupts. It may not from a reset of the
    /// bus until the board is connected again. Call it repeatedly until it returns true.
    pub fn is_ready(&mut self) -> bool {
        let status = USB.read(controller::STATUS);
        let is_connected = status & controller::CONNECTED != 0;
        match self.before {
            Some((pad, control)) if is_connected => {
                show_wires(pad, control);
                self.before = None;
                true
            }
            Some(_) => false,
            None if is_connected || USB.read(INTERRUPTS) & BUS_RESET == 0 || is_sound() => true,
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
    SYSTEM_INFORMATION.read(CHIP) >> REVISION_SHIFT >= FIRST_SOUND_REVISION
}

/// Shows the controller D+ high, from GPIO 15, and D- low, because GPIO 16 has another function.
/// The wires stay pulled up, so that the host sees a device. Returns the pad and control registers
/// of the pin.
fn show_idle_bus() -> (u32, u32) {
    let (pad, control) = (BANK_0_PADS.read(pin::PAD), BANK_0_CONTROLS.read(pin::CONTROL));
    BANK_0_PADS.write(pin::PAD, pad | pin::KEEPS);
    // These writes are separate so that the controller never drives the pin.
    let control_off = control & !pin::OUTPUT | pin::OUTPUT_OFF;
    let control_wire = control_off & !pin::FUNCTION | pin::IS_USB_WIRE;
    BANK_0_CONTROLS.write(pin::CONTROL, control_off);
    BANK_0_CONTROLS.write(pin::CONTROL, control_wire);
    BANK_0_CONTROLS.write(pin::CONTROL, control_wire | pin::READS_HIGH);
    USB.write(controller::SET_DIRECT, controller::PULLS_UP);
    USB.write(controller::SET_OVERRIDE, controller::OVERRIDES_PULL_UP);
    USB.write(controller::SOURCE, controller::PINS);
    (pad, control)
}

/// Shows the controller the wires again, and restores the pin.
fn show_wires(pad: u32, control: u32) {
    USB.write(controller::SOURCE, controller::WIRES);
    USB.write(controller::CLEAR_OVERRIDE, controller::OVERRIDES_PULL_UP);
    BANK_0_CONTROLS.write(pin::CONTROL, control);
    BANK_0_PADS.write(pin::PAD, pad);
}
