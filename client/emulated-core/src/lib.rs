//! Executes most instructions of a Cortex-M0+ many times as fast as rp2040js does.
//!
//! rp2040js compares each instruction with one pattern after the other, and asks for each address
//! what lies there. Here one `match` decides, and only RAM, flash and the divider are reached,
//! which do not depend on the time. Everything else, such as the other registers of the chip,
//! exceptions, most special registers and sleep, is left to rp2040js: its interpreter then executes
//! the instruction, before anything of it has been done here.
//!
//! `quick_core.mjs` of the client's emulator calls this as WebAssembly. The registers, RAM, flash
//! and the cache in front of it lie in the memory of WebAssembly, and rp2040js reads and writes
//! them there as well. The test `pico_core` compares both interpreters with random instructions.

mod cache;
mod chip;
mod execute;
#[cfg(target_arch = "wasm32")]
mod exports;

pub use cache::{Cache, MISS_CYCLES};
pub use chip::{Chip, Divider, FLASH_BYTES, Marks, RAM, RAM_BYTES, Shared};
