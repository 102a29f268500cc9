//! Tests that the heaviest jobs leave a margin of the stack, and that the main loop of the Pico
//! looks often enough at what is asked in real time meanwhile. Other input is in `pico_looks`.
#![cfg(feature = "emulator")]

use penup_client::emulator::Stack;
use penup_host_tests::heaviest_jobs::{on_the_lm3s6965, on_the_pico};
use penup_host_tests::looks::{COMPUTED, assert_bounded};
use std::error::Error;

/// The number of bytes that no job may use, because an interrupt may occur when the stack is deeper
/// than in these jobs.
const MARGIN: usize = 1024;

fn leaves_a_margin(job: &str, Stack { size, deepest }: Stack) {
    println!("{job}: {deepest} of {size} bytes");
    assert!(deepest > 1000, "{job}: {deepest} bytes, which is no stack of a job");
    assert!(deepest + MARGIN <= size, "{job}: {deepest} of {size} bytes");
}

#[test]
fn of_the_lm3s6965() -> Result<(), Box<dyn Error>> {
    on_the_lm3s6965(leaves_a_margin)
}

#[test]
fn of_the_pico() -> Result<(), Box<dyn Error>> {
    on_the_pico(|job, stack, gaps| {
        leaves_a_margin(job, stack);
        assert_bounded(COMPUTED, job, gaps);
    })
}
