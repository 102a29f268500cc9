//! Tests that the pen of the emulated Raspberry Pi Pico begins before the order of the other
//! strokes is known, and that the pins then draw what the host draws.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{
    EmulatedBoard, Machine, MachineEventKind, Pico, PicoByUsb, image_path,
};
use penup_host_tests::emulated_jobs::{Line, assert_same_as_on_the_host};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;

#[test]
fn the_pen_begins_before_the_order_is_known() -> Result<(), Box<dyn Error>> {
    // The drawing comes right behind a move, which the board must begin by itself then.
    let options = ["$212=20", "$213=20", "$page=40x40", "$margin=5", "$J=G91 X2 F1200"];
    let lines = job_lines("lattice4.obj", &options);
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    let text: String = lines.iter().map(|text| format!("{text}\n")).collect();
    line.emulator.send(text.as_bytes())?;
    for text in &lines[1..] {
        assert_eq!(line.hear()?, "ok", "before {text}");
    }
    // The last line is answered when the order is known. Until then the status is asked for.
    let (mut machine, mut events) = (Machine::default(), Vec::new());
    let mut downs_before = None;
    loop {
        let heard = line.status()?;
        for change in line.emulator.pin_changes()? {
            events.extend(machine.change(change).map(|event| event.kind));
        }
        if heard == "ok" {
            let is_down =
                |event: &&MachineEventKind| **event == MachineEventKind::Pen { down: true };
            downs_before = Some(events.iter().filter(is_down).count());
        } else if downs_before.is_some() && heard.starts_with("<Idle") {
            break;
        } else {
            assert!(heard.starts_with("<Run|"), "{heard}");
        }
    }
    events.extend(machine.last().map(|event| event.kind));
    assert!(downs_before >= Some(2), "no stroke is drawn while the order is computed");
    assert_same_as_on_the_host(&PICO, &lines, &events);
    Ok(())
}
