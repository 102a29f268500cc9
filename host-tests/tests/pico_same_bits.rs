//! The same bits everywhere: a job's steps and pen moves from the Raspberry Pi Pico's pins are those
//! of the library on the host, one by one.
#![cfg(feature = "emulator")]

use penup_client::machines::Board::Pico;
use penup_host_tests::emulated_jobs::{PEN_ON_A_MOTOR, compare, give_up, stop_at_once};
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
fn a_motor_lifts_the_pen() -> Result<(), Box<dyn Error>> {
    let settings = [&PEN_ON_A_MOTOR[..], &["$page=80x80", "$margin=5"]].concat();
    compare(Pico, "notched.obj", &settings)
}

#[test]
fn a_motor_raises_the_pen_after_an_emergency_stop() -> Result<(), Box<dyn Error>> {
    stop_at_once(Pico)
}

#[test]
fn ctrl_x_stops_the_steps_raises_the_pen_and_knows_the_position() -> Result<(), Box<dyn Error>> {
    give_up(Pico)
}
