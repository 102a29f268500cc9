//! Holds down the number of panics that the boards' images can still reach.
#![cfg(feature = "emulator")]
#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup_client::emulator::image_path;
use penup_host_tests::panic_calls::{PanicCall, panic_calls};
use std::collections::BTreeMap;

/// The greatest numbers of calls of panic functions, and of functions of libraries that call some,
/// for each room of `src/` on the LM3S6965 and on the Pico. A room that is missing has none: the
/// interrupt handlers and what they call, protocol, machine, motion, step, storage and boards must
/// have none. A number that has fallen is lowered here.
const MOST: [(&str, [usize; 2]); 11] = [
    // Those of `defmt`, which panics where a log begins within another one. None does.
    ("boards", [19, 9]),
    ("convex", [80, 147]),
    ("curve", [11, 19]),
    ("drawing", [13, 9]),
    ("geometry.rs", [1, 0]),
    ("model", [33, 45]),
    ("order", [98, 257]),
    // The corners of faces that are moved and listed, and of what is beside a place in a list.
    ("plotter", [6, 2]),
    // The exchange of two numbers while a list is sorted.
    ("stage.rs", [2, 0]),
    ("view", [15, 9]),
    ("visibility", [62, 159]),
];

/// Crates that the Pico's interrupt handler of USB called before it had a device of its own.
const REPLACED: [&str; 2] = ["usb-device", "usbd-serial"];

/// The room of `src/` that causes a call; `None` outside the project.
fn room(call: &PanicCall) -> Option<&str> {
    call.file.strip_prefix("src/")?.split('/').next()
}

#[test]
fn no_room_gains_a_panic() {
    let mut faults = Vec::new();
    for (column, board) in ["lm3s6965", "pico"].into_iter().enumerate() {
        let image = std::fs::read(image_path(board)).expect("the image is built");
        let calls = panic_calls(&image).expect("an image with debug information");
        assert!(calls.iter().any(|call| call.file.starts_with("src/order/")), "{board}: no lines");
        for call in &calls {
            if REPLACED.iter().any(|name| call.file.contains(name)) {
                faults.push(format!("{board}: {} {} is linked again", call.file, call.line));
            }
        }
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for room in calls.iter().filter_map(room) {
            *counts.entry(room).or_default() += 1;
        }
        for (room, count) in counts {
            let most =
                MOST.iter().find(|(name, _)| *name == room).map_or(0, |(_, most)| most[column]);
            if count > most {
                faults.push(format!("{board}: {room} has {count} calls where {most} are allowed"));
            }
        }
    }
    assert!(
        faults.is_empty(),
        "cargo xtask panics lists each call; prove each new one away:\n{}",
        faults.join("\n")
    );
}
