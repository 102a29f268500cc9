//! Holds down the number of panics that the boards' images can still reach.
#![cfg(feature = "emulator")]
#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup_client::emulator::image_path;
use penup_host_tests::panic_calls::{PanicCall, panic_calls};
use std::collections::BTreeMap;

/// The greatest numbers of calls of panic functions, for each room of `src/` on the LM3S6965 and on
/// the Pico. A room that is missing has none. A number that
/// has fallen is lowered here.
const MOST: [(&str, [usize; 2]); 16] = [
    ("boards", [2, 19]),
    ("convex", [37, 153]),
    // On the Pico other calls are inlined since its image is optimized a little less, by which all
    // of it has 80 fewer.
    ("curve", [8, 26]),
    ("drawing", [4, 11]),
    ("fixed.rs", [4, 5]),
    ("lib.rs", [0, 2]),
    ("machine", [2, 10]),
    ("model", [10, 39]),
    // The Pico has one more since the pen moves on the way: a profile is also made there.
    ("motion", [6, 16]),
    ("order", [48, 325]),
    // The Pico has two more since the main loop reads HP-GL: divisions that are inlined there.
    ("plotter", [6, 3]),
    // The Pico has one more since losses are marked apart from damaged bytes.
    ("protocol", [3, 4]),
    // The Pico sorts the vertices of a tile.
    ("stage.rs", [0, 27]),
    ("step", [3, 10]),
    ("view", [2, 10]),
    ("visibility", [26, 188]),
];

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
