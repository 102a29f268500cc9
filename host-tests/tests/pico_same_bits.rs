//! The same bits everywhere: a job's steps and pen moves from the Raspberry Pi Pico's pins are those
//! of the library on the host, one by one.
#![cfg(feature = "emulator")]

use penup_client::machines::Board::Pico;
use penup_host_tests::emulated_jobs::{compare, give_up};
use std::error::Error;

#[test]
fn a_concave_solid_in_perspective() -> Result<(), Box<dyn Error>> {
    let camera = ["$eye=5.5,9,5", "$at=2,1.5,1", "$page=80x80", "$margin=5"];
    compare(Pico, "notched.obj", &camera)
}

#[test]
fn many_parts_with_many_odd_points() -> Result<(), Box<dyn Error>> {
    compare(Pico, "lattice2.obj", &["$page=60x80", "$margin=5"])
}

#[test]
fn ctrl_x_stops_the_steps_raises_the_pen_and_knows_the_position() -> Result<(), Box<dyn Error>> {
    give_up(Pico)
}
