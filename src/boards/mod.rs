//! The boards: pins, timers, serial lines and storage of each.
//!
//! Each board implements [`penup::plotter::Board`]. The boards' modules are the only ones with
//! `unsafe` code, and each such block states the contract that it meets. `take` returns the board
//! that the firmware is built for; it works only once. The board's clock, pins and capacities are
//! those of its row in the library's table, [`penup::board_table`].

mod fault;
#[allow(dead_code, reason = "not every board needs all of it")]
mod handler;
mod line;
#[allow(dead_code, reason = "not every board needs all of it")]
mod peripheral;
#[allow(dead_code, reason = "not every board needs all of it")]
mod pl011;

#[cfg(feature = "lm3s6965")]
mod lm3s6965;
#[cfg(feature = "lm3s6965")]
use lm3s6965::{self as board, Lm3s6965 as ThisBoard};
#[cfg(feature = "pico")]
mod pico;
#[cfg(feature = "pico")]
use pico::{self as board, Pico as ThisBoard};

pub use board::take;
