//! Pins, timer, serial line and storage of each board.
//!
//! A board implements [`penup::plotter::Board`], and its module is the only place for `unsafe`:
//! each block there states the contract that it meets. `take` gives the board that the firmware is
//! built for, once.

#[cfg(all(feature = "lm3s6965", target_os = "none"))]
mod lm3s6965;
#[cfg(all(feature = "lm3s6965", target_os = "none"))]
pub use lm3s6965::take;
