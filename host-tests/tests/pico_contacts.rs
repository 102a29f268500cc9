//! Tests the Raspberry Pi Pico's limit switches and emergency stop, each with 5 ms of contact
//! bounce: the state and the report must be right, and no step may follow the stop.
#![cfg(feature = "emulator")]

use penup_client::emulator::{EmulatedBoard, Machine, Pico, PinChange, image_path};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

const LIMIT_X: u8 = 8;
const LIMIT_Y: u8 = 9;
const STOP: u8 = 10;
const BOUNCE: Duration = Duration::from_millis(5);

/// Starts a board with these settings.
fn start(settings: &[&str]) -> Result<Line<Pico>, Box<dyn Error>> {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for setting in settings {
        assert_eq!(line.ask(setting)?, "ok", "{setting}");
    }
    Ok(line)
}

/// Lets a machine move as the pins say.
fn follow(machine: &mut Machine, changes: Vec<PinChange>) {
    for change in changes {
        machine.change(change);
    }
}

/// Follows the pins until they have moved.
fn wait_for_steps(line: &mut Line<Pico>) -> Result<Machine, Box<dyn Error>> {
    let (mut machine, mut seen) = (Machine::default(), 0);
    while seen < 1000 {
        let changes = line.emulator.pin_changes()?;
        seen += changes.iter().filter(|change| change.is_step()).count();
        follow(&mut machine, changes);
        sleep(Duration::from_millis(5));
    }
    Ok(machine)
}

/// Checks that the status tells where the pins have moved the `machine`, at 80 steps per mm.
fn is_where_told(line: &mut Line<Pico>, machine: &Machine) -> TestResult {
    let (x, y) = machine.position();
    let status = line.status()?;
    let told = status.split(['|', '>']).find_map(|part| part.strip_prefix("MPos:"));
    let told = told.ok_or("no position")?.split(',').map(str::parse::<f64>);
    let told: Vec<f64> = told.collect::<Result<_, _>>()?;
    let is_same = |(told, pins): (&f64, i32)| (told * 80.0 - f64::from(pins)).abs() < 0.1;
    assert!(told.iter().zip([x, y]).all(is_same), "{x} {y}: {status}");
    Ok(())
}

/// Checks that the alarm is reported once, that the state is that of an alarm and that the report
/// contains its number. After the report, there must be no step, and the position that is told is
/// that of the pins, which have moved the `machine` up to now.
fn is_in_alarm(line: &mut Line<Pico>, number: u8, mut machine: Machine) -> TestResult {
    assert_eq!(line.hear()?, format!("ALARM:{number}"));
    let told_at = line.emulator.clock()?;
    // A line that is being processed is refused.
    let mut status = line.status()?;
    while !status.starts_with('<') {
        status = line.hear()?;
    }
    assert!(
        status.starts_with("<Alarm") && status.contains(&format!("|Alarm:{number}|")),
        "{status}"
    );
    let changes = line.emulator.pin_changes()?;
    let last_step = changes.iter().filter(|change| change.is_step()).map(|change| change.at).max();
    assert!(last_step.is_none_or(|last| last <= told_at), "{last_step:?} {told_at:?}");
    follow(&mut machine, changes);
    sleep(Duration::from_millis(100));
    assert!(line.status()?.starts_with("<Alarm"));
    assert!(!line.emulator.pin_changes()?.iter().any(|change| change.is_step()));
    is_where_told(line, &machine)
}

/// Closes a contact in the middle of a job.
fn stops_a_job(pin: u8, number: u8, settings: &[&str]) -> TestResult {
    let mut line = start(settings)?;
    for text in job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]) {
        assert_eq!(line.ask(&text)?, "ok", "{text}");
    }
    let machine = wait_for_steps(&mut line)?;
    line.emulator.bounce(pin, false, BOUNCE)?;
    is_in_alarm(&mut line, number, machine)
}

#[test]
fn a_limit_switch_stops_a_job() -> TestResult {
    stops_a_job(LIMIT_X, 1, &["$21=1"])
}

#[test]
fn the_emergency_stop_stops_a_job_and_is_reported_until_it_is_released() -> TestResult {
    let mut line = start(&[])?;
    assert_eq!(line.ask("$J=X400F6000")?, "ok");
    let machine = wait_for_steps(&mut line)?;
    line.emulator.bounce(STOP, false, BOUNCE)?;
    is_in_alarm(&mut line, 10, machine)?;
    assert!(line.status()?.contains("|Pn:E|"));
    // The board cannot be unlocked while the contact is pressed.
    assert!(line.ask("$X")?.starts_with("[MSG:"));
    assert!(line.hear()?.starts_with("error:"));
    line.emulator.bounce(STOP, true, BOUNCE)?;
    while line.status()?.contains("|Pn:") {}
    assert!(line.unlock()?);
    assert!(line.status()?.starts_with("<Idle"));
    assert!(!line.emulator.pin_changes()?.iter().any(|change| change.is_step()));
    // It continues from the position of the pins.
    assert_eq!(line.ask("$J=X0F6000")?, "ok");
    while !line.status()?.starts_with("<Idle|MPos:0.000,0.000,") {}
    Ok(())
}

#[test]
fn a_switch_within_the_way_of_a_move_by_hand_stops_it_there() -> TestResult {
    for (pin, jog) in [(LIMIT_X, "$J=G91X-50F3000"), (LIMIT_Y, "$J=G91Y-50F3000")] {
        // Where it stands is not known to be the corner.
        let mut line = start(&["$21=1", "$20=0"])?;
        line.emulator.fit_switch(pin, -800)?;
        let mut machine = Machine::default();
        assert_eq!(line.ask(jog)?, "ok");
        assert_eq!(line.hear()?, "ALARM:1");
        assert!(line.status()?.contains(if pin == LIMIT_X { "|Pn:X|" } else { "|Pn:Y|" }));
        for change in line.emulator.pin_changes()? {
            machine.change(change);
        }
        let (x, y) = machine.position();
        // The switch bounces for 5 ms, and two of three samples, a millisecond apart, must show it
        // closed. The stop is therefore at most 7 ms after the switch began to close, which is 28
        // steps at 4000 per second.
        assert!((-828..=-800).contains(&(x + y)), "{x} {y}");
        is_where_told(&mut line, &machine)?;
        sleep(Duration::from_millis(100));
        assert!(!line.emulator.pin_changes()?.iter().any(|change| change.is_step()));
    }
    Ok(())
}

const HOMING: [&str; 3] = ["$22=1", "$130=60", "$131=60"];

/// Homes with switches at these positions. Returns the final position of the machine.
fn home(x: i32, y: i32) -> Result<(i32, i32), Box<dyn Error>> {
    let mut line = start(&HOMING)?;
    line.emulator.fit_switch(LIMIT_X, x)?;
    line.emulator.fit_switch(LIMIT_Y, y)?;
    // If the switches are pressed, their first bounce is over.
    sleep(Duration::from_millis(200));
    line.status()?;
    assert_eq!(line.ask("$H")?, "ok");
    let status = line.status()?;
    assert!(status.starts_with("<Idle|MPos:0.000,0.000,"), "{status}");
    let mut machine = Machine::default();
    for change in line.emulator.pin_changes()? {
        machine.change(change);
    }
    Ok(machine.position())
}

/// Homing ends one pull-off, 160 steps, away from the switches, whether they are open or pressed at
/// the start.
#[test]
fn homing_finds_switches_that_bounce_from_either_side() -> TestResult {
    for (x, y) in [(-400, -240), (100, -200), (-300, 60)] {
        let (at_x, at_y) = home(x, y)?;
        // The second approach makes 80 steps a second.
        assert!((-2..=2).contains(&(at_x - x - 160)), "{at_x} for {x}");
        assert!((-2..=2).contains(&(at_y - y - 160)), "{at_y} for {y}");
    }
    Ok(())
}

#[test]
fn a_switch_that_is_stuck_or_never_found_fails_the_homing() -> TestResult {
    let mut line = start(&HOMING)?;
    line.emulator.bounce(LIMIT_X, false, BOUNCE)?;
    while !line.status()?.contains("|Pn:X|") {}
    line.emulator.send(b"$H\n")?;
    is_in_alarm(&mut line, 9, Machine::default())?;
    // The switch is never found: the search covers one and a half travels.
    let mut line = start(&HOMING)?;
    line.emulator.send(b"$H\n")?;
    is_in_alarm(&mut line, 9, Machine::default())
}

#[test]
fn the_emergency_stop_before_homing_and_during_it() -> TestResult {
    let mut line = start(&HOMING)?;
    line.emulator.send(b"$H\n")?;
    let machine = wait_for_steps(&mut line)?;
    line.emulator.bounce(STOP, false, BOUNCE)?;
    is_in_alarm(&mut line, 10, machine)?;
    // The line is refused, and so is another attempt.
    let mut line = start(&HOMING)?;
    line.emulator.bounce(STOP, false, BOUNCE)?;
    is_in_alarm(&mut line, 10, Machine::default())?;
    let refused = line.ask("$H")?;
    assert!(refused.starts_with("[MSG:"), "{refused}");
    assert!(line.hear()?.starts_with("error:"));
    assert!(!line.emulator.pin_changes()?.iter().any(|change| change.is_step()));
    Ok(())
}

/// The filters at the switches rise slowly; until then, the contacts read as closed.
#[test]
fn twenty_power_ups_with_slow_contacts_give_no_alarm() -> TestResult {
    let mut line = start(&[])?;
    for _ in 0..20 {
        line.emulator.cut_power()?;
        line.hear_greeting()?;
        let status = line.status()?;
        assert!(status.starts_with("<Idle") && !status.contains("|Pn:"), "{status}");
    }
    Ok(())
}

#[test]
fn a_stop_that_is_pressed_at_power_up_is_an_alarm() -> TestResult {
    let mut line = start(&[])?;
    line.emulator.drive(STOP, false)?;
    assert_eq!(line.hear()?, "ALARM:10");
    line.emulator.cut_power()?;
    while line.hear()? != "ALARM:10" {}
    assert!(line.status()?.contains("|Pn:E|"));
    Ok(())
}

#[test]
fn noise_that_a_single_look_sees_is_no_contact() -> TestResult {
    let mut line = start(&["$21=1"])?;
    for _ in 0..40 {
        for pin in [LIMIT_X, LIMIT_Y, STOP] {
            // Low for half of the time, in eight parts.
            line.emulator.bounce(pin, true, Duration::from_micros(900))?;
        }
        let until = line.emulator.clock()? + Duration::from_millis(25);
        while line.emulator.clock()? < until {
            sleep(Duration::from_millis(1));
        }
    }
    let status = line.status()?;
    assert!(status.starts_with("<Idle") && !status.contains("|Pn:"), "{status}");
    Ok(())
}

/// If it were pre-empted for longer than a millisecond, the clock would set its alarm to a time in
/// the past.
#[test]
fn a_clock_that_is_late_still_sees_the_stop() -> TestResult {
    let mut line = start(&[])?;
    for milliseconds in [1, 2, 40] {
        line.emulator.delay_alarm(milliseconds)?;
    }
    line.status()?;
    line.emulator.bounce(STOP, false, BOUNCE)?;
    is_in_alarm(&mut line, 10, Machine::default())
}
