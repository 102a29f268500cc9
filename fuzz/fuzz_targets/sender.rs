//! Answers of a hostile plotter to the client.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::sender(input));
