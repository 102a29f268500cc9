//! The heights of the pen and the steps of its motor, which wait in a queue of their own beside the
//! words.

use penup::byte_queue::{ByteQueue, Consumer};
use rp2040_hal::pac::interrupt;
use static_cell::StaticCell;

use super::STATE;
use super::engine::FLAG;
use crate::boards::handler::Owned;
use crate::boards::pico::registers::{PIO0, Put};
use crate::boards::pico::{critical, pen, z_axis};

/// The number of slots in the queue, one of which stays empty. A height of the pen takes one slot,
/// and a step of its motor takes two.
pub const HEIGHTS: usize = 1024;
/// The bits of an entry that sets the pins of z instead of a height.
pub mod z_axis_levels {
    /// The bit that distinguishes such an entry from a height, which is at most 127.
    pub const MARK: u8 = 1 << 7;
    /// The bit that holds the level of the step pin.
    pub const STEP: u8 = 1;
    /// Set if the motor turns so that the pen goes down.
    pub const DOWN: u8 = 1 << 1;
}

/// The heights of the pen, and the levels of its motor's pins, that wait for their time.
pub static HEIGHT_QUEUE: StaticCell<ByteQueue<HEIGHTS>> = StaticCell::new();
/// The end of that queue from which the handler takes what is due.
pub static HEIGHTS_DUE: Owned<Consumer<'static>> = Owned::empty();

/// Processes the entries that are left in the queue. If two heights come faster than the interrupt,
/// one is left over, and the last one counts. Steps of the pen's motor, between which the interrupt
/// comes whatever else runs, are left over only where everything was discarded.
pub fn drain_heights() {
    critical::with_pen_masked(|| {
        // SAFETY: the handler that owns it is masked.
        if let Some(due) = unsafe { HEIGHTS_DUE.get() } {
            while let Some(height) = due.dequeue() {
                if height & z_axis_levels::MARK == 0 {
                    pen::set_height(height);
                }
            }
            z_axis::end_pulse();
        }
    });
}

/// Sets the direction of the motor of z, and makes a step if `step` is true.
fn set_z_axis(step: bool, down: bool) {
    z_axis::set(step, down != STATE.z_is_inverted());
    if step {
        STATE.count_z_step(down);
    }
}

/// The interrupt that the state machine causes at a word that moves the pen: takes one entry from
/// the queue and carries it out.
#[interrupt]
#[unsafe(link_section = ".data.in_ram")]
fn PIO0_IRQ_0() {
    PIO0.irq().put(FLAG);
    // SAFETY: this is the handler that owns it.
    if let Some(height) = unsafe { HEIGHTS_DUE.get() }.and_then(Consumer::dequeue) {
        if height & z_axis_levels::MARK == 0 {
            pen::set_height(height);
        } else {
            set_z_axis(height & z_axis_levels::STEP != 0, height & z_axis_levels::DOWN != 0);
        }
    }
}
