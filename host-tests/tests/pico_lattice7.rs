//! Tests the largest scene that the Raspberry Pi Pico must hold, from its upload to the last step.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard, Pico, PicoByUsb, image_path};
use penup_host_tests::emulated_jobs::{
    Line, assert_same_as_on_the_host, begin_on, events_until_idle,
};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;

/// 343 cubes are sent over USB. The effort for the order is small, because more takes too long in
/// the emulator.
#[test]
#[ignore = "takes minutes: `cargo xtask lattice7` runs it"]
fn of_343_cubes_the_pins_draw_what_the_host_draws() -> Result<(), Box<dyn Error>> {
    let settings = ["$eye=-21.37,-28.71,35.13", "$page=100x100", "$margin=5", "$effort=100"];
    let lines = job_lines("lattice7.obj", &settings);
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    // USB holds back data for which there is no room, so the test need not wait for answers, each
    // of which delays the emulator.
    let (plot, model) = lines.split_last().ok_or("no line")?;
    line.emulator
        .send(model.iter().map(|text| format!("{text}\n")).collect::<String>().as_bytes())?;
    for text in model {
        assert_eq!(line.hear()?, "ok", "{text}");
    }
    let mut line = begin_on(line, std::slice::from_ref(plot))?;
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}
