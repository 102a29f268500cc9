//! A line, a dotted line, an arc as single steps in eight directions; the tape code.
//!
//! (skeleton)
