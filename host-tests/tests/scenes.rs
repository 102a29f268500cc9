//! Tests that the scenes that a program makes are what it makes.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup_host_tests::gear_train;

/// `PENUP_WRITE_DOCUMENTS=1` writes the scene instead of comparing it.
#[test]
fn the_gears_are_those_of_their_generator() {
    let path = penup_client::workspace::root().join("scenes/gears.obj");
    let made = gear_train::obj();
    if std::env::var_os("PENUP_WRITE_DOCUMENTS").is_some() {
        return std::fs::write(&path, made).expect("scenes/gears.obj can be written");
    }
    let file = std::fs::read_to_string(&path).expect("scenes/gears.obj");
    assert!(
        file == made,
        "scenes/gears.obj is out of date; write it anew with \
         PENUP_WRITE_DOCUMENTS=1 cargo test -p penup-host-tests --test scenes"
    );
}
