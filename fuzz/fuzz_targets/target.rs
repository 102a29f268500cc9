//! A fuzzer for the target that has the name of this program.
#![no_main]

use penup_host_tests::fuzz_targets::TARGETS;

libfuzzer_sys::fuzz_target!(|input: &[u8]| {
    let name = env!("CARGO_BIN_NAME");
    let (_, target) = TARGETS.iter().find(|(target, _)| *target == name).expect("a target");
    target(input);
});
