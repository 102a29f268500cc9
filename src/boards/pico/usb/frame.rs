//! Where in a frame of the bus we are, for erratum RP2040-E15.
//!
//! A frame lasts a millisecond. If the host asks for a packet so late in it that the hub cuts the
//! acknowledgement off, the chip's USB controller may hang until it is reset. That is why no buffer
//! is made available to the host in the last 200 microseconds of a frame; TinyUSB keeps to the same
//! rule. The instant at which a frame begins is known only from the controller's interrupt, which
//! is on only while something waits to be sent: that costs a packet some 0.5 ms at most when
//! nothing was sent before, and nothing later.

use super::super::clock;
use super::super::registers::USB;

/// The frame's number; reading it clears the interrupt.
const NUMBER: usize = 0x48;
/// The interrupts as they are, masked or not.
const RAW: usize = 0x8C;
/// Bits that are written here are set in the mask of interrupts, or cleared in it.
const ENABLE: usize = 0x2090;
const DISABLE: usize = 0x3090;
const BEGAN: u32 = 1 << 17;

/// In microseconds.
const LENGTH: u32 = 1000;
/// What a buffer may be made available in. 100 microseconds are for the time between the look at
/// the clock and the write to the buffer, and for an interrupt that came late.
const SAFE: u32 = 700;

/// Follows the frames.
pub struct Frame {
    is_followed: bool,
    /// When the last one began, by the clock of microseconds; none if that is not known.
    began: Option<u32>,
}

impl Frame {
    pub const fn new() -> Self {
        Self { is_followed: false, began: None }
    }

    /// Takes the beginning of a frame in, if there was one. To be called whenever the controller
    /// may have an interrupt.
    pub fn look(&mut self) {
        if !self.is_followed || USB.read(RAW) & BEGAN == 0 {
            return;
        }
        USB.read(NUMBER);
        let now = clock::microseconds();
        self.began = match self.began {
            // The interrupt may have come late, but not the frame: the chip's crystal is as exact
            // as the host's.
            Some(last) if now.wrapping_sub(last) < 2 * LENGTH - LENGTH / 10 => {
                Some(last.wrapping_add(now.wrapping_sub(last).min(LENGTH + 1)))
            }
            // Interrupts were masked for long: this one is of a frame that nobody knows.
            Some(_) => None,
            None => Some(now),
        };
    }

    /// Whether a buffer may be made available now. If not, the next interrupt asks again.
    pub fn lets_send(&mut self) -> bool {
        if !self.is_followed {
            self.is_followed = true;
            // What came before the interrupt was on says nothing of the time.
            self.began = None;
            USB.read(NUMBER);
            USB.write(ENABLE, BEGAN);
        }
        self.began.is_some_and(|began| clock::microseconds().wrapping_sub(began) < SAFE)
    }

    /// Nothing waits to be sent: no interrupts of frames any more.
    pub fn leave(&mut self) {
        if self.is_followed {
            self.is_followed = false;
            USB.write(DISABLE, BEGAN);
        }
    }
}
