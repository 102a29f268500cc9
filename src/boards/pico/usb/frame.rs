//! Tracks the position within a frame of the bus, for erratum RP2040-E15.
//!
//! A frame lasts a millisecond. If the host asks for a packet so late in the frame that the hub
//! cuts off the acknowledgement, the chip's USB controller may hang until it is reset. So no buffer
//! is made available to the host at the end of a frame; TinyUSB does not do so in the last 200
//! microseconds either. The beginning of a frame is known only from the controller's interrupt,
//! which is on only while something waits to be sent. This delays a packet by at most some 0.5 ms
//! when nothing was sent before, and later packets not at all.

use core::sync::atomic::{AtomicBool, Ordering};

use super::super::clock;
use super::super::registers::{Get, Put, USB};

/// The bit of the interrupt that comes at the beginning of a frame.
const BEGAN: u32 = 1 << 17;

/// The time from the beginning of one USB frame to that of the next, in microseconds.
const LENGTH: u32 = 1000;
/// The part of a frame, in microseconds, in which a buffer may be made available. 100 microseconds
/// allow for the time between reading the clock and writing to the buffer, and for a late
/// interrupt.
const SAFE: u32 = 700;

/// Whether interrupts have been masked for long since the controller was last looked at, so that
/// the interrupt of a frame may be late.
static WERE_MASKED: AtomicBool = AtomicBool::new(false);

/// Notes that interrupts are masked for long. Call it while they are.
pub fn note_masked() {
    WERE_MASKED.store(true, Ordering::Relaxed);
}

/// Knows how far the present frame of the bus has come.
pub struct Frame {
    /// Whether the frame interrupt is on.
    is_followed: bool,
    /// The time at which the last frame began, in microseconds; `None` if it is not known.
    began: Option<u32>,
}

impl Frame {
    /// Makes the state before the first frame, with the interrupt off.
    pub const fn new() -> Self {
        Self { is_followed: false, began: None }
    }

    /// Records the beginning of a frame, if there was one. Call it whenever the controller may have
    /// an interrupt.
    pub fn follow(&mut self) {
        if !self.is_followed || USB.intr().get() & BEGAN == 0 {
            return;
        }
        clear_interrupt();
        if WERE_MASKED.load(Ordering::Relaxed) {
            // This frame may have begun long ago. The next one tells the time.
            WERE_MASKED.store(false, Ordering::Relaxed);
            self.began = None;
            return;
        }
        let now = clock::microseconds();
        self.began = match self.began {
            // The interrupt may have come late, but not the frame: the chip's crystal is as exact
            // as the host's.
            Some(last) if now.wrapping_sub(last) < 2 * LENGTH - LENGTH / 10 => {
                Some(last.wrapping_add(now.wrapping_sub(last).min(LENGTH + 1)))
            }
            // Interrupts were masked for a long time, so it is unknown to which frame this one
            // belongs.
            Some(_) => None,
            None => Some(now),
        };
    }

    /// Whether a buffer may be made available now. If not, the next interrupt will ask again.
    pub fn may_send(&mut self) -> bool {
        if !self.is_followed {
            self.is_followed = true;
            // An interrupt flag from before the interrupt was enabled says nothing about the time.
            self.began = None;
            clear_interrupt();
            WERE_MASKED.store(false, Ordering::Relaxed);
            USB.inte().set(BEGAN);
        }
        self.began.is_some_and(|began| clock::microseconds().wrapping_sub(began) < SAFE)
    }

    /// Switches the frame interrupts off, because nothing waits to be sent.
    pub fn stop(&mut self) {
        if self.is_followed {
            self.is_followed = false;
            USB.inte().clear(BEGAN);
        }
    }
}

/// Clears the frame interrupt, by reading the number of the frame.
fn clear_interrupt() {
    USB.sof_rd().get();
}
