//! The boards: pins, timers, serial lines and storage of each.
//!
//! Each board implements [`penup::plotter::Board`]. The boards' modules are the only ones with
//! `unsafe` code, and each such block states the contract that it meets. `take` returns the board
//! that the firmware is built for; it works only once.

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
