//! Tests a delayed main loop: the Pico loses no step, brakes along the path, and continues.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{self, EmulatedBoard, Pin, PinChange, image_path};
use penup_host_tests::emulated_jobs::{Line, begin_on};
use penup_host_tests::event_checker::greatest_acceleration;
use penup_host_tests::step_edges::{FASTEST, of_changes, planned};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;

/// The number of steps over which the speed is measured, so that the length of a tick matters
/// little.
const SPAN: usize = 32;
/// The time in seconds from which the machine stands still, and the number of steps before it over
/// which it stopped.
const PAUSE: f64 = 0.0002;
const LAST: usize = 8;

/// Draws the diagonal while the main loop is stalled for this many hundredths of a second at each
/// of these positions, in steps of x, and `disturbance` is sent to the board. Returns the changes
/// of the pins and the last status.
///
/// # Panics
/// Panics if the steps differ from the planned ones.
fn disturbed(
    settings: &[&str],
    stalls: &[(u32, u8)],
    disturbance: &[u8],
) -> Result<(Vec<PinChange>, String), Box<dyn Error>> {
    let lines = job_lines("diagonal.obj", settings);
    let pico = emulator::Pico::start(&image_path("pico"))?;
    let mut line = Line::to(Box::new(pico))?;
    for &(position, hundredths) in stalls {
        line.emulator.stall_at(position, hundredths)?;
    }
    let mut line = begin_on(line, &lines)?;
    line.emulator.send(disturbance)?;
    let status = loop {
        let status = line.status()?;
        if status.starts_with("<Idle") {
            break status;
        }
    };
    let changes = line.emulator.pin_changes()?;
    let (edges, planned) = (of_changes(&changes), planned(&PICO, &lines));
    assert!(
        edges.iter().map(|edge| (edge.0, edge.1)).eq(planned.iter().map(|edge| (edge.0, edge.1))),
        "other steps than those planned"
    );
    Ok((changes, status))
}

/// The times of the steps of x, in seconds.
fn steps_of_x(changes: &[PinChange]) -> Vec<f64> {
    let rises = changes.iter().filter(|change| change.pin == Pin::StepX && change.high);
    rises.map(|change| change.at.as_secs_f64()).collect()
}

/// The maximum acceleration over 32 steps, or the maximum deceleration to rest over 8, in steps/s²,
/// and the number of standstills.
fn hardest(x: &[f64]) -> (f64, usize) {
    let square = |from: usize, to: usize| ((to - from) as f64 / (x[to] - x[from])).powi(2);
    let pause = |from: usize, to: usize| (from..to).any(|at| x[at + 1] - x[at] > PAUSE);
    let (mut worst, mut pauses) = (0.0f64, 0);
    for at in 2 * SPAN..x.len() - 1 {
        let (first, middle) = (at - 2 * SPAN, at - SPAN);
        if !pause(first, at) {
            let change = square(middle, at) - square(first, middle);
            worst = worst.max(change.abs() / (2.0 * SPAN as f64));
        }
        if pause(at, at + 1) && !pause(at - LAST, at) {
            pauses += 1;
            worst = worst.max(square(at - LAST, at) / (2.0 * LAST as f64));
        }
    }
    (worst, pauses)
}

/// The deceleration in steps/s² with the settings of [`FASTEST`] when the queue runs dry. The speed
/// is that from which 32767 mm/s² stop within 13/16 of the ring, and the machine brakes within a
/// quarter of that. Each axis has 1/√2 of it.
fn hardest_allowed() -> f64 {
    32_767.0 * 4.0 * 4000.0 / 2f64.sqrt()
}

#[test]
fn lists_do_not_stop_half_a_million_steps_a_second_with_a_jerk() -> Result<(), Box<dyn Error>> {
    let (changes, _) = disturbed(&FASTEST, &[], b"$\n$\n")?;
    let (worst, pauses) = hardest(&steps_of_x(&changes));
    println!("{pauses} pauses, {:.3} of the limit", worst / hardest_allowed());
    // There, eight steps at a time are decelerated equally, which makes a staircase: up to 1.7
    // where the main loop is late. A stop between two steps would be 30.
    assert!(worst <= 2.5 * hardest_allowed(), "{worst:.0} steps/s²");
    Ok(())
}

/// The ring lasts 4 ms, and the stop takes 1.5 ms.
#[test]
fn half_a_million_steps_a_second_are_braked_within_what_the_ring_holds()
-> Result<(), Box<dyn Error>> {
    let (changes, status) = disturbed(&FASTEST, &[(40_000, 5), (100_000, 20)], b"")?;
    let (worst, pauses) = hardest(&steps_of_x(&changes));
    println!("{pauses} pauses, {:.3} of the limit, {status}", worst / hardest_allowed());
    assert!(status.contains("|Late:2"), "{status}");
    // This includes the standstill in which the pen is lowered.
    assert_eq!(pauses, 3);
    // As above, this includes the standstill in which the pen is lowered.
    assert!(worst <= 2.5 * hardest_allowed(), "{worst:.0} steps/s²");
    Ok(())
}

/// At 150 mm/s and 2000 mm/s², the machine stops within 5.6 mm; the ring holds three times as much.
#[test]
fn a_main_loop_that_stands_still_brakes_within_the_acceleration_set() -> Result<(), Box<dyn Error>>
{
    let settings = [
        "$110=12000",
        "$111=12000",
        "$120=2000",
        "$121=2000",
        "$201=9000",
        "$202=9000",
        "$page=130x130",
        "$margin=5",
    ];
    let (changes, status) = disturbed(&settings, &[(3_000, 40), (6_500, 40)], b"")?;
    assert!(status.contains("|Late:2"), "{status}");
    let pen = |down: bool| {
        changes.iter().position(|change| change.pin == Pin::Pen && change.high == down)
    };
    let down = pen(true).ok_or("the pen is never down")?;
    let up = changes.iter().rposition(|change| change.pin == Pin::Pen && !change.high);
    let times = steps_of_x(&changes[down..up.ok_or("the pen is never raised")?]);
    // x and y step at once, by 1/80 mm each.
    let positions: Vec<f64> =
        (0..times.len()).map(|step| step as f64 * 2f64.sqrt() / 80.0).collect();
    assert_eq!(times.len(), 8_000);
    let pauses = times.windows(2).filter(|pair| pair[1] - pair[0] > 0.1).count();
    assert_eq!(pauses, 2);
    // The acceleration from rest to rest, over any 5 ms.
    let measured = greatest_acceleration(&times, &positions, 0.005);
    println!("{measured:.0} mm/s²");
    assert!(measured > 1_000.0 && measured <= 1.05 * 2_000.0, "{measured} mm/s²");
    Ok(())
}
