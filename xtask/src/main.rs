//! Set-up, build, emulate, flash, size.

fn main() {}
