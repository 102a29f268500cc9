//! Harrison's experiments with the pen-up problem (chapter 7), each table beside his CPU seconds.
//!
//! The cost is counted in instructions executed, by valgrind's `callgrind`, so the tables are the
//! same whenever the same compiler made the program. Without valgrind it is counted in steps of the
//! search: bounds taken and pairs tried.
//!
//!     cargo run --release -p penup-host-tests --example experiments

#![allow(clippy::expect_used, reason = "an experiment that fails ends the program")]

mod meter;
mod problems;
mod table;
mod tables;

use meter::{MEASURE, Meter};
use std::fmt::Write;

fn main() {
    if std::env::args().any(|argument| argument == MEASURE) {
        tables::write_all(&mut Meter::Silent, &mut String::new()).expect("memory");
        return;
    }
    let mut meter = Meter::new();
    let mut page = String::new();
    let unit = match meter {
        Meter::Known(_) => "MI: millions of instructions, counted by callgrind.",
        Meter::Silent => {
            "steps: bounds taken and pairs tried. Install valgrind to count instructions."
        }
    };
    writeln!(
        page,
        "Harrison's experiments, chapter 7. s: his CPU seconds on an IBM 360/67.\n{unit}\n"
    )
    .and_then(|()| tables::write_all(&mut meter, &mut page))
    .expect("memory");
    print!("{page}");
}
