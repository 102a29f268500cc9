//! Picks the board's memory map and passes the link arguments.
fn main() {}
