//! The times at which the step pins rise and fall, as planned and on an emulated board.

use crate::emulated_jobs::bench_like;
use penup::board_table::BoardRow;
use penup::boards::host::{Change, Stamped};
use penup_client::emulator::{Pin, PinChange};
use std::time::Duration;

/// A step pin, its new level, and the time of the change.
pub type Edge = (Pin, bool, Duration);

/// Settings with which a diagonal is drawn at 435,000 steps per second: the machine is held to what
/// the Pico's ring holds at the greatest acceleration.
pub const FASTEST: [&str; 12] = [
    "$0=0.5",
    "$100=4000",
    "$101=4000",
    "$110=32767",
    "$111=32767",
    "$120=32767",
    "$121=32767",
    "$201=10000",
    "$202=10000",
    "$page=45x45",
    "$fit=on",
    "$margin=5",
];

const TICK: Duration = Duration::from_nanos(40);

/// The duration in ticks of an iteration of the host's main loop, which is short because the queue
/// is.
const TURN_TICKS: u64 = 2_500;

/// The planned edges of a job, with the capacities of `board`.
pub fn planned(board: &'static BoardRow, lines: &[String]) -> Vec<Edge> {
    let mut bench = bench_like(board);
    for line in lines {
        bench.say(&format!("{line}\n"));
    }
    while bench.plotter.poll(&mut bench.board) || !bench.plotter.machine().is_stopped() {
        bench.board.pass(TURN_TICKS);
    }
    let (mut x, mut y) = (false, false);
    let mut edge = |stamped: &Stamped| {
        let (pin, level, high) = match stamped.change {
            Change::StepX(high) => (Pin::StepX, &mut x, high),
            Change::StepY(high) => (Pin::StepY, &mut y, high),
            _ => return None,
        };
        let at = Duration::from_nanos(stamped.time * TICK.as_nanos() as u64);
        (std::mem::replace(level, high) != high).then_some((pin, high, at))
    };
    bench.board.trace().changes().iter().filter_map(&mut edge).collect()
}

/// The edges of the step pins among `changes`.
pub fn of_changes(changes: &[PinChange]) -> Vec<Edge> {
    let is_step = |pin| matches!(pin, Pin::StepX | Pin::StepY);
    changes.iter().filter(|c| is_step(c.pin)).map(|c| (c.pin, c.high, c.at)).collect()
}

/// Checks that there are more than `least` planned edges, and that each edge has its planned time
/// since the first one, within `tolerance`.
///
/// # Panics
/// Panics at the first edge that does not.
pub fn assert_in_time(planned: &[Edge], pins: &[Edge], least: usize, tolerance: Duration) {
    assert!(planned.len() > least, "{} edges", planned.len());
    assert_eq!(planned.len(), pins.len());
    let (first_planned, first) = (planned[0].2, pins[0].2);
    for (number, (planned, pin)) in planned.iter().zip(pins).enumerate() {
        assert_eq!((planned.0, planned.1), (pin.0, pin.1), "edge {number}");
        let (due, came) = (planned.2 - first_planned, pin.2 - first);
        assert!(due.abs_diff(came) <= tolerance, "edge {number} at {came:?}, not {due:?}");
    }
}
