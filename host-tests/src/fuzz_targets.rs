//! What the fuzzers do with bytes: each target reads hostile bytes as one part of penup would, and
//! panics if that part breaks a promise.
//!
//! The folder `fuzz/` wraps each target for `cargo fuzz`, which looks for new inputs on nightly
//! Rust. The test `fuzz_corpus` replays the inputs that it kept, and random ones, on every run. The
//! tests are built with checks for overflow, so a value that wraps is found, too.

mod drawing;
mod edits;
pub mod files;
mod gcode;
mod hpgl;
mod scene;
pub mod sender;
pub mod session;
pub mod stored;
pub mod usb;

pub use drawing::fuzz as drawing;
pub use edits::fuzz as edits;
pub use files::fuzz as files;
pub use gcode::fuzz as gcode;
pub use hpgl::fuzz as hpgl;
pub use scene::fuzz as scene;
pub use sender::fuzz as sender;
pub use session::fuzz as session;
pub use stored::fuzz as stored;
pub use usb::fuzz as usb;

/// A target: its name, which is that of its corpus, and the function that takes the input.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 10] = [
    ("session", session),
    ("gcode", gcode),
    ("edits", edits),
    ("hpgl", hpgl),
    ("files", files),
    ("stored", stored),
    ("sender", sender),
    ("scene", scene),
    ("drawing", drawing),
    ("usb", usb),
];
