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
mod sample;
mod table;
mod tables;

use meter::{MEASURE, Meter};
use problems::INSTANCES;
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
            "MI: here steps, bounds taken and pairs tried. Install valgrind to count instructions."
        }
    };
    writeln!(
        page,
        "Harrison's experiments, chapter 7. s: his CPU seconds on an IBM 360/67.\n{unit}\n\n\
         He prints neither his matrices nor his seed, so the instances are ours: {INSTANCES} for \
         each n.\n\
         The first one has a seed with which his least costs come out up to n = 12. Up to n = 8 \
         his\n\
         bounds and heuristic costs come out, too; at n = 10 the heuristic finds 87 where he has \
         98,\n\
         and from n = 12 on the bounds differ, so those matrices are not his. A cell of ours is \
         the\n\
         median over all instances and, in brackets, the least and the greatest. His are of one.\n"
    )
    .and_then(|()| tables::write_all(&mut meter, &mut page))
    .expect("memory");
    print!("{page}");
}
