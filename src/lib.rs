//! penup: firmware for a pen plotter that computes the whole drawing itself.
//!
//! It receives a solid, a frame of bars, a curve or a line drawing over a serial line. On the
//! microcontroller it projects the model, removes hidden lines, chooses the pen-up moves, orders
//! the strokes, plans the speeds, and pulses the stepper motors and the pen. It uses no heap, and
//! no floating point in any decision. It computes the same bits on every machine.
//!
//! The modules are listed in the order in which the data passes through them. Each may use those
//! above it, never those below it.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "host"))]
extern crate std;

pub mod checksum;
pub mod fixed;
pub mod stage;

pub mod geometry;
pub mod curve;
pub mod model;
pub mod view;
pub mod visibility;
pub mod convex;
pub mod drawing;
pub mod order;
pub mod step;
pub mod motion;
pub mod machine;
pub mod storage;
pub mod protocol;
pub mod plotter;

/// The board that consists of memory only, for programs on a host. The boards for real hardware
/// belong to the firmware binary.
#[cfg(feature = "host")]
pub mod boards {
    pub mod host;
}
