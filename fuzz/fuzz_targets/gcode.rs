//! G-code with arcs, real-time bytes and contacts at any time, for a small plotter.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::gcode(input));
