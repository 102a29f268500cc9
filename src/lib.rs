//! penup: a pen plotter's firmware that does the thinking itself.
//!
//! It is sent a solid, a frame of bars, a curve or a line drawing over a serial line. On the
//! microcontroller it projects it, removes the hidden lines, chooses the pen-up moves, orders the
//! strokes, plans the speed and pulses the steppers and the pen. No heap, no floating point in any
//! decision, the same bits on every machine.
//!
//! The modules stand in the order in which the data passes through them. Each may use those above
//! it, never those below it.
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

/// The board made of plain memory. Those made of silicon belong to the firmware binary.
#[cfg(feature = "host")]
pub mod boards {
    pub mod host;
}
