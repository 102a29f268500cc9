//! How deep the boards' stacks become, for docs/memory.md: `cargo xtask stack` builds the images
//! and runs this.

use penup_client::emulator::Stack;
use penup_host_tests::heaviest_jobs::{on_the_lm3s6965, on_the_pico};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    println!("| board | after | deepest stack so far, bytes | of |");
    println!("|---|---|---|---|");
    on_the_lm3s6965(|job, stack| row("lm3s6965", job, stack))?;
    on_the_pico(|job, stack, _| row("pico", job, stack))
}

fn row(board: &str, job: &str, Stack { size, deepest }: Stack) {
    println!("| {board} | {job} | {deepest} | {size} |");
}
