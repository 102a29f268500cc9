//! The settings of the drivers' pins on the Raspberry Pi Pico, at its pins.
#![cfg(feature = "emulator")]

use penup_client::emulator::{Pin, PinChange};
use penup_host_tests::emulated_jobs::Line;
use std::error::Error;
use std::time::Duration;

/// Moves, waits until the machine is idle, and returns the changes of the pins.
fn go(line: &mut Line, text: &str) -> Result<Vec<PinChange>, Box<dyn Error>> {
    assert_eq!(line.ask(text)?, "ok");
    assert_eq!(line.ask("G4 P0.3")?, "ok");
    Ok(line.emulator.pin_changes()?)
}

/// The changes of a pin.
fn of(changes: &[PinChange], pin: Pin) -> Vec<(bool, Duration)> {
    let of_pin = changes.iter().filter(|change| change.pin == pin);
    of_pin.map(|change| (change.high, change.at)).collect()
}

#[test]
fn step_pins_and_the_enable_pin_are_inverted_and_the_drivers_rest() -> Result<(), Box<dyn Error>> {
    let mut line = Line::open(&penup::board_table::PICO)?;
    line.emulator.pin_changes()?;
    let changes = go(&mut line, "G0 X1")?;
    let steps = of(&changes, Pin::StepX);
    assert_eq!((steps.len(), steps.first().map(|step| step.0)), (160, Some(true)));
    assert_eq!(of(&changes, Pin::Enable).first().map(|change| change.0), Some(false));

    // Each setting changes the level of its pins at once.
    assert_eq!(line.ask("$2=1")?, "ok");
    assert_eq!(line.ask("$4=1")?, "ok");
    line.ask("G4 P0")?;
    let changes = line.emulator.pin_changes()?;
    for pin in [Pin::StepX, Pin::Enable] {
        assert_eq!(of(&changes, pin).iter().map(|change| change.0).collect::<Vec<_>>(), [true]);
    }
    assert!(of(&changes, Pin::StepY).is_empty());

    // Pulses are low now, and as long as before.
    let changes = go(&mut line, "G0 X2 Y1")?;
    let steps = of(&changes, Pin::StepX);
    assert_eq!((steps.len(), steps.first().map(|step| step.0)), (160, Some(false)));
    for pulse in steps.chunks_exact(2) {
        let length = pulse[1].1.abs_diff(pulse[0].1);
        assert!((1900..=2300).contains(&length.as_nanos()), "{length:?}");
    }
    assert_eq!(of(&changes, Pin::StepY).first().map(|step| step.0), Some(true));
    assert!(of(&changes, Pin::Enable).is_empty(), "the drivers stay on");

    // The drivers are switched off after a rest, which is low now, and on again by a move.
    assert_eq!(line.ask("$1=50")?, "ok");
    line.ask("G0 X3")?;
    let mut enables = Vec::new();
    for _ in 0..200 {
        line.status()?;
        enables.extend(of(&line.emulator.pin_changes()?, Pin::Enable));
        if enables.last().is_some_and(|change| !change.0) {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(enables.last().map(|change| change.0), Some(false));
    let changes = go(&mut line, "G0 X2")?;
    assert_eq!(of(&changes, Pin::Enable).first().map(|change| change.0), Some(true));
    assert!(line.status()?.contains("MPos:2.000,1.000,"));
    Ok(())
}
