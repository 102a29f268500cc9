//! Files of every format that the client reads.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::files(input));
