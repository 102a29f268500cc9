//! The entry point of the firmware, which is the same for every board.
#![no_std]
#![no_main]

mod boards;

#[cfg(not(any(feature = "log-semihosting", feature = "log-rtt")))]
compile_error!("say where the log goes: --features log-semihosting (emulator) or log-rtt");

#[cfg(feature = "log-rtt")]
use defmt_rtt as _;
#[cfg(all(feature = "log-semihosting", not(feature = "log-rtt")))]
use defmt_semihosting as _;

/// Starts the board and runs the plotter on it, for as long as there is power.
#[cortex_m_rt::entry]
fn main() -> ! {
    let (mut board, memory, pins) = boards::take();
    penup::plotter::run(&mut board, memory, pins)
}
