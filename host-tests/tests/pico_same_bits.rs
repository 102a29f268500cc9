//! Tests that a job's steps and pen moves at the Raspberry Pi Pico's pins are identical, one by
//! one, to those of the library on the host.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup::boards::host::Change;
use penup_client::emulator::Pin;
use penup_host_tests::emulated_jobs::{
    PEN_ON_A_MOTOR, assert_same_as_on_the_host, begin, bench_like, compare, events_until_idle,
    give_up, stop_at_once,
};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

#[test]
fn a_concave_solid_in_perspective() -> Result<(), Box<dyn Error>> {
    let camera = ["$eye=5.5,9,5", "$at=2,1.5,1", "$page=80x80", "$margin=5"];
    compare(&PICO, "notched.obj", &camera)
}

#[test]
fn many_parts_with_many_odd_points() -> Result<(), Box<dyn Error>> {
    compare(&PICO, "lattice2.obj", &["$page=60x80", "$margin=5"])
}

#[test]
fn a_motor_lifts_the_pen() -> Result<(), Box<dyn Error>> {
    let settings = [&PEN_ON_A_MOTOR[..], &["$page=80x80", "$margin=5"]].concat();
    compare(&PICO, "notched.obj", &settings)
}

/// The times at which step pulses begin, in microseconds.
fn pulses(changes: impl IntoIterator<Item = (bool, f64)>) -> Vec<f64> {
    changes.into_iter().filter(|change| change.0).map(|change| change.1).collect()
}

/// Draws a job on the Pico and on the host: how many strokes it has, how many pulses, and by how
/// many microseconds the Pico was late where it noted one.
///
/// # Panics
/// Every pulse comes as long after the one before; only where the pen has just been raised, the
/// board may first note in its flash that the stroke is drawn.
fn draw_in_time(lines: &[String]) -> Result<(usize, usize, f64), Box<dyn Error>> {
    let mut line = begin(&PICO, lines)?;
    let (mut steps, mut lowered) = (Vec::new(), 0);
    loop {
        let idle = line.status()?.starts_with("<Idle");
        for change in line.emulator.pin_changes()? {
            match change.pin {
                Pin::StepX | Pin::StepY => {
                    steps.push((change.high, change.at.as_nanos() as f64 / 1000.0));
                }
                // The servo follows with its next pulse.
                Pin::Pen => lowered += usize::from(change.high),
                _ => {}
            }
        }
        if idle {
            break;
        }
        std::thread::sleep(Duration::from_millis(200));
    }
    let at_the_pins = pulses(steps);

    let mut bench = bench_like(&PICO);
    for text in lines {
        bench.say(&format!("{text}\n"));
    }
    bench.finish();
    let changes = bench.board.trace().changes();
    let on_the_host = pulses(changes.iter().filter_map(|stamped| match stamped.change {
        Change::StepX(high) | Change::StepY(high) => Some((high, stamped.time as f64 / 25.0)),
        _ => None,
    }));
    let orders = changes.iter().filter(|stamped| matches!(stamped.change, Change::Pen(127)));
    assert_eq!(lowered, orders.count());
    assert_eq!(at_the_pins.len(), on_the_host.len());
    let mut noted = 0.0f64;
    for (number, pair) in on_the_host.windows(2).enumerate() {
        let host = pair[1] - pair[0];
        let late = at_the_pins[number + 1] - at_the_pins[number] - host;
        assert!(late > -1.0, "pulse {number}: {late} us");
        if late >= 1.0 {
            assert!(host > 5000.0 && late < 20_000.0, "pulse {number}: {late} us");
            noted = noted.max(late);
        }
    }
    Ok((lowered, on_the_host.len(), noted))
}

#[test]
fn the_pen_moves_while_the_machine_does() -> Result<(), Box<dyn Error>> {
    for jerk in ["$204=0", "$204=30"] {
        let overlap = ["$224=150", "$225=150", jerk, "$page=80x80", "$margin=5"];
        let (strokes, _, noted) = draw_in_time(&job_lines("notched.obj", &overlap))?;
        println!("{jerk}: {strokes} strokes, noted within {noted} us");
    }
    Ok(())
}

/// Two curves that turn round in x and y, and a line between two of their ends.
const LOOPS: [&str; 18] = [
    "v 0 0 0",
    "v 12 2 0",
    "v 2 6 0",
    "v 14 8 0",
    "v 4 12 0",
    "v 16 14 0",
    "v 20 0 0",
    "v 30 4 0",
    "v 22 8 0",
    "v 18 16 0",
    "cstype bspline",
    "deg 2",
    "curv 0 4 1 2 3 4 5 6",
    "parm u 0 0 0 1 2 3 4 4 4",
    "end",
    "curv 0 2 7 8 9 10",
    "parm u 0 0 0 1 2 2 2",
    "end",
];

#[test]
fn backlash_is_taken_up_while_the_pen_draws_curves() -> Result<(), Box<dyn Error>> {
    let job = |settings: &[&str]| -> Vec<String> {
        let lines = LOOPS.iter().chain(&["l 6 10", "$fit=on", "$page=50x40", "$margin=5"]);
        lines.chain(settings).chain(&["$plot"]).map(|line| (*line).to_owned()).collect()
    };
    let (strokes, without, _) = draw_in_time(&job(&[]))?;
    let (same, with, _) = draw_in_time(&job(&["$235=0.1", "$236=0.1", "$237=0.3"]))?;
    assert_eq!(strokes, same);
    println!("{strokes} strokes, {without} pulses, {with} with backlash");
    assert!(with > without + 40, "backlash is taken up: {with} {without}");
    Ok(())
}

/// With different shapers on a CoreXY machine, and as fast as motion is shaped, 40,000 steps a
/// second.
#[test]
fn shaped_motion_has_the_same_steps_at_the_same_times() -> Result<(), Box<dyn Error>> {
    let slow = ["$230=1", "$227=12", "$228=31", "$226=2", "$page=30x25"];
    let fast = [
        "$100=400",
        "$101=400",
        "$120=4000",
        "$121=4000",
        "$201=5990",
        "$202=5990",
        "$238=0",
        "$227=25",
        "$228=20",
        "$226=3",
        "$page=40x30",
    ];
    for settings in [&slow[..], &fast] {
        let lines = LOOPS.iter().chain(&["l 6 10", "$fit=on", "$margin=5"]);
        let job = lines.chain(settings).chain(&["$plot"]).map(|line| (*line).to_owned());
        let (strokes, pulses, noted) = draw_in_time(&job.collect::<Vec<_>>())?;
        println!("{settings:?}: {strokes} strokes, {pulses} pulses, noted within {noted} us");
        assert!(pulses > 4_000, "{pulses}");
    }
    Ok(())
}

#[test]
fn a_motor_raises_the_pen_after_an_emergency_stop() -> Result<(), Box<dyn Error>> {
    stop_at_once(&PICO)
}

#[test]
fn curves_on_a_plan() -> Result<(), Box<dyn Error>> {
    compare(&PICO, "isobars.obj", &["$fit=on", "$page=60x60", "$margin=5", "$effort=100"])
}

#[test]
fn curves_in_space() -> Result<(), Box<dyn Error>> {
    compare(
        &PICO,
        "isobars.obj",
        &["$projection=isometric", "$page=60x60", "$margin=5", "$effort=100"],
    )
}

#[test]
fn a_title_below_a_solid() -> Result<(), Box<dyn Error>> {
    let title = ["$title=Caf\\xE9 \\u{2013} 3 %", "$title-size=4", "$page=80x80", "$margin=5"];
    compare(&PICO, "octahedron.obj", &title)
}

#[test]
fn three_pens_chosen_by_name() -> Result<(), Box<dyn Error>> {
    let square = ["v 10 10 0", "v 60 10 0", "v 60 60 0", "v 10 60 0"];
    let pens = ["usemtl blue", "l 1 2", "usemtl red", "l 2 3", "usemtl pen5", "l 3 4", "$plot"];
    let lines: Vec<String> = square.iter().chain(&pens).map(|line| (*line).to_owned()).collect();
    let mut line = begin(&PICO, &lines)?;
    for pen in [2, 5] {
        assert_eq!(line.hear()?, format!("[MSG:put in pen {pen}, then send ~]"));
        line.emulator.send(b"~")?;
    }
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}

#[test]
fn ctrl_x_stops_the_steps_raises_the_pen_and_knows_the_position() -> Result<(), Box<dyn Error>> {
    give_up(&PICO)
}
