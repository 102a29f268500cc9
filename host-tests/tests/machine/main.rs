//! Tests of jobs that run through the real interrupt code: hold, resume, abort, alarm, sleep.
//!
//! A test whose course is fixed is a [transcript](penup_host_tests::transcript): what the machine
//! is told, what it answers, and what the pins did. The others try any instant or any settings.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

mod spread_backlash;
mod commands;
mod disturbed;
mod fixtures;
mod homing;
mod pen;
mod pen_overlap;
mod shaping;
mod slow;
mod underrun;
