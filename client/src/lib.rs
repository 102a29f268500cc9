//! What the `penup` command is made of: sending, emulating, previewing, picturing.

pub mod fit;
