//! The deepest stack over the heaviest jobs leaves a margin.
#![cfg(feature = "emulator")]

use penup_client::emulator::Stack;
use penup_host_tests::heaviest_jobs::{on_the_lm3s6965, on_the_pico};
use std::error::Error;

/// What no job may use: an interrupt may find the stack deeper than these jobs have it.
const MARGIN: usize = 1024;

fn leaves_a_margin(job: &str, Stack { size, deepest }: Stack) {
    assert!(deepest > 1000, "{job}: {deepest} bytes, which is no stack of a job");
    assert!(deepest + MARGIN <= size, "{job}: {deepest} of {size} bytes");
}

#[test]
fn of_the_lm3s6965() -> Result<(), Box<dyn Error>> {
    on_the_lm3s6965(leaves_a_margin)
}

#[test]
fn of_the_pico() -> Result<(), Box<dyn Error>> {
    on_the_pico(leaves_a_margin)
}
