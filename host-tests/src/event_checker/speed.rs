//! Checks speed, acceleration and jerk along the path.

use super::Run;
use penup::drawing::PagePoint;
use penup::machine::{Setting, Settings, Target};
use penup::step::Line;

/// The maximum acceleration along the path, in mm/s², over windows of at least `window` seconds.
///
/// `positions` are the path lengths (mm) of the plan at the start of each move, and `times` are the
/// times of these starts. The speed between two moves is assigned to the time midway between them,
/// which is exact for constant acceleration.
pub fn greatest_acceleration(times: &[f64], positions: &[f64], window: f64) -> f64 {
    let speeds: Vec<(f64, f64)> = times
        .windows(2)
        .zip(positions.windows(2))
        .map(|(t, s)| ((t[0] + t[1]) / 2.0, (s[1] - s[0]) / (t[1] - t[0])))
        .collect();
    let mut greatest = 0.0f64;
    let mut first = 0;
    for (index, &(time, speed)) in speeds.iter().enumerate() {
        while first < index && speeds[first + 1].0 <= time - window {
            first += 1;
        }
        let (before, slower) = speeds[first];
        if time - before >= window {
            greatest = greatest.max((speed - slower).abs() / (time - before));
        }
    }
    greatest
}

/// The maximum jerk along the path, in mm/s³. The windows are so long that a jerk of `about`
/// (mm/s³) can be determined to 8 % in spite of the errors of the positions: 4 nm each, which is a
/// tick at 100 mm/s.
///
/// `positions` and `times` are as in [`greatest_acceleration`]. Six times the third divided
/// difference of the positions at four times is a weighted mean of the jerk between the first and
/// the last of them. The four times are at least a third of the window apart.
pub fn greatest_jerk(times: &[f64], positions: &[f64], about: f64) -> f64 {
    // The weights of the positions add up to 8 divided by the cube of a third of the window.
    let third = (8.0 * 4e-6 / (0.08 * about)).cbrt();
    let mut greatest = 0.0f64;
    let mut knots = [0; 4];
    for first in 0..times.len() {
        knots[0] = first;
        for k in 1..4 {
            knots[k] = knots[k].max(knots[k - 1]);
            while knots[k] < times.len() && times[knots[k]] < times[knots[k - 1]] + third {
                knots[k] += 1;
            }
            if knots[k] == times.len() {
                return greatest;
            }
        }
        let mut differences = knots.map(|knot| positions[knot]);
        for order in 1..4 {
            for k in 0..4 - order {
                let time = times[knots[k + order]] - times[knots[k]];
                differences[k] = (differences[k + 1] - differences[k]) / time;
            }
        }
        greatest = greatest.max(6.0 * differences[0].abs());
    }
    greatest
}

/// The path length (mm) of the plan along `targets` from the origin at the start of each move, and
/// the point that the move leads to. The machine must be Cartesian.
fn plan(targets: &[Target], settings: &Settings) -> Vec<(f64, PagePoint)> {
    let [x, y] = settings.page_steps().map(|steps| steps.to_num::<f64>());
    let (mut at, mut start) = (PagePoint::default(), 0.0);
    let mut moves = Vec::new();
    for target in targets {
        let (dx, dy) = (target.point.x - at.x, target.point.y - at.y);
        let length = (f64::from(dx) / x).hypot(f64::from(dy) / y);
        let count = f64::from(dx.abs().max(dy.abs()));
        let mut position = start + length * 0.5 / count;
        for direction in Line::new(at, target.point) {
            at = direction.from_point(at);
            moves.push((position, at));
            position += length / count;
        }
        start += length;
    }
    moves
}

/// The maximum acceleration of `runs` as a part of the limit. The runs follow `targets` from the
/// origin. It is measured over any 5 ms, or over the time needed to determine it to 4 %.
///
/// # Panics
/// Panics if a run leaves the path.
pub fn acceleration_ratio(runs: &[Run], targets: &[Target], settings: &Settings) -> f64 {
    let plan = plan(targets, settings);
    let mut rest = plan.as_slice();
    let ratios = runs.iter().map(|run| {
        let positions = places_of(run, &mut rest);
        let limit = acceleration(settings);
        greatest_acceleration(&run.times, &positions, acceleration_window(limit)) / limit
    });
    ratios.fold(0.0, f64::max)
}

/// The acceleration of both axes, in mm/s².
fn acceleration(settings: &Settings) -> f64 {
    settings.get(Setting::AccelerationX).min(settings.get(Setting::AccelerationY)).to_num()
}

/// The window in seconds over which an acceleration (mm/s²) is measured. It suits two speeds, each
/// of a step of 12.5 µm at 50 mm/s between positions that are exact to 4 nm.
pub fn acceleration_window(acceleration: f64) -> f64 {
    f64::max(0.005, 0.064 / (0.04 * acceleration))
}

/// The positions of the moves of `run`, which are the next ones of `plan`.
///
/// # Panics
/// Panics if the run leaves the path.
fn places_of(run: &Run, plan: &mut &[(f64, PagePoint)]) -> Vec<f64> {
    let (moves, later) = plan.split_at(run.points.len());
    *plan = later;
    let (positions, points): (Vec<f64>, Vec<PagePoint>) = moves.iter().copied().unzip();
    assert_eq!(run.points, points, "off the path");
    positions
}

/// The worst of some runs, each as a part of its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Ratios {
    /// The acceleration over any 5 ms, or over the time needed to determine it to 4 %.
    pub acceleration: f64,
    /// The jerk; 0 where it has no limit.
    pub jerk: f64,
    /// The speed beside a rest, as a part of what the acceleration reaches on two moves.
    pub rest: f64,
}

/// Measures `runs`, which follow `targets` from the origin, from rest to rest between two moves of
/// the pen. `cut` tells that an alarm ended the last run.
///
/// # Panics
/// Panics if a run leaves the path.
pub fn speed_ratios(runs: &[Run], targets: &[Target], settings: &Settings, cut: bool) -> Ratios {
    let acceleration = acceleration(settings);
    let jerk = 1000.0 * settings.get(Setting::Jerk).to_num::<f64>();
    let plan = plan(targets, settings);
    let mut rest = plan.as_slice();
    let mut worst = Ratios::default();
    for (number, run) in runs.iter().enumerate() {
        let positions = places_of(run, &mut rest);
        let window = acceleration_window(acceleration);
        let measured = greatest_acceleration(&run.times, &positions, window);
        worst.acceleration = worst.acceleration.max(measured / acceleration);
        if jerk > 0.0 {
            let measured = greatest_jerk(&run.times, &positions, jerk);
            worst.jerk = worst.jerk.max(measured / jerk);
        }
        let mut beside_rest = |times: [f64; 2], positions: [f64; 2]| {
            let length = positions[1] - positions[0];
            let speed = length / (times[1] - times[0]);
            // The standstill is at most one move before the first of them.
            worst.rest = worst.rest.max(speed / (2.0 * acceleration * 2.0 * length).sqrt());
        };
        let is_cut = cut && runs[number + 1..].iter().all(|later| later.points.is_empty());
        if let (&[a, b, ..], &[s, t, ..]) = (&run.times[..], &positions[..]) {
            beside_rest([a, b], [s, t]);
        }
        if let (&[.., a, b], &[.., s, t], false) = (&run.times[..], &positions[..], is_cut) {
            beside_rest([a, b], [s, t]);
        }
    }
    worst
}

/// Checks that `runs` follow `targets` from the origin, from rest to rest between two moves of the
/// pen. `cut` tells that an alarm ended the last run.
///
/// # Panics
/// Panics if a run leaves the path; if the acceleration over any 5 ms, or over the time needed to
/// determine it to 4 %, exceeds 1.05 times the limit; if the jerk, where it is limited, exceeds 1.1
/// times the limit; and if a run does not begin or end at rest.
pub fn check_speed(runs: &[Run], targets: &[Target], settings: &Settings, cut: bool) {
    let ratios = speed_ratios(runs, targets, settings, cut);
    assert!(ratios.acceleration <= 1.05, "{ratios:?}");
    assert!(ratios.jerk <= 1.1, "{ratios:?}");
    assert!(ratios.rest <= 1.05, "{ratios:?}");
}
