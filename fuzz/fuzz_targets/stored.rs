//! Settings and jobs that another version kept in flash.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::stored(input));
