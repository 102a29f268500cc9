//! Scenes of triangles and bars, against the exact model.
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| penup_host_tests::fuzz_targets::scene(input));
