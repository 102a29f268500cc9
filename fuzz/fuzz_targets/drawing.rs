//! Drawings, from their lines to the pins.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::drawing(input));
