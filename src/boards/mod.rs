//! Pins, timer, serial line and storage of each board.
//!
//! A board implements [`penup::plotter::Board`], and its module is the only place for `unsafe`:
//! each block there states the contract that it meets. `take` gives the board that the firmware is
//! built for, once.

#[cfg(feature = "lm3s6965")]
mod divide;
mod fault;
mod handler;
mod line;
#[cfg(feature = "lm3s6965")]
mod memory;
mod peripheral;
mod pl011;

#[cfg(feature = "lm3s6965")]
mod lm3s6965;
#[cfg(feature = "lm3s6965")]
pub use lm3s6965::take;
#[cfg(feature = "pico")]
mod pico;
#[cfg(feature = "pico")]
pub use pico::take;
