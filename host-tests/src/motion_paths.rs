//! Paths on which speed is measured, and a function that draws each in one stroke.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use crate::{event_checker, event_checker::Run, pin_machine};
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Setting, Settings, Target, TargetList, Value};
use penup::step::Line;

/// The steps per millimetre of both axes.
pub const STEPS_PER_MM: f64 = 100.0;

/// The settings of a Cartesian machine with this maximum speed (mm/s) of both axes, acceleration
/// (mm/s²) and junction deviation (mm). `centripetal` tells whether curves are slowed down.
///
/// # Panics
/// Panics if the machine refuses the settings.
pub fn settings(speed: f64, acceleration: f64, deviation: f64, centripetal: bool) -> Settings {
    let mut settings = Settings::default();
    let values = [
        (Setting::StepsPerMmX, STEPS_PER_MM),
        (Setting::StepsPerMmY, STEPS_PER_MM),
        (Setting::MaxRateX, 32000.0),
        (Setting::MaxRateY, 32000.0),
        (Setting::TravelSpeed, speed * 60.0),
        (Setting::DrawSpeed, speed * 60.0),
        (Setting::AccelerationX, acceleration),
        (Setting::AccelerationY, acceleration),
        (Setting::JunctionDeviation, deviation),
        (Setting::Centripetal, f64::from(u8::from(centripetal))),
    ];
    for (setting, value) in values {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// Rounds points in millimetres to steps, and merges successive points that coincide.
pub fn steps(points: &[(f64, f64)]) -> Vec<PagePoint> {
    let mut rounded: Vec<_> = points
        .iter()
        .map(|&(x, y)| PagePoint {
            x: (x * STEPS_PER_MM).round() as i32,
            y: (y * STEPS_PER_MM).round() as i32,
        })
        .collect();
    rounded.dedup();
    rounded
}

/// Draws the points, checks the events, and returns the single run with the pen down.
///
/// # Panics
/// Panics if the machine refuses the path or the events violate a rule.
pub fn draw(points: &[PagePoint], settings: Settings, blocks: usize) -> Run {
    let targets: Vec<_> = points
        .iter()
        .enumerate()
        .map(|(index, &point)| Target { point, ink: (index > 0).then_some(LineType::Full) })
        .collect();
    let events = pin_machine::record(settings, &mut TargetList::new(&targets), blocks)
        .expect("within the travel");
    let verdict = event_checker::check(&events, &settings);
    assert_eq!(Some(&verdict.end), points.last());
    let mut inked = verdict.runs.into_iter().filter(|run| run.height > 0);
    let run = inked.next().expect("a stroke");
    assert_eq!(inked.count(), 0);
    let mut expected = Vec::new();
    for ends in points.windows(2) {
        let mut at = ends[0];
        for direction in Line::new(ends[0], ends[1]) {
            at = direction.from_point(at);
            expected.push(at);
        }
    }
    assert_eq!(run.points, expected, "the moves are those of the lines");
    run
}

/// The path length in mm at which the plan is when each move of the lines through `points` begins.
pub fn positions(points: &[PagePoint]) -> Vec<f64> {
    let mut start = 0.0;
    let mut positions = Vec::new();
    for ends in points.windows(2) {
        let (dx, dy) = (ends[1].x - ends[0].x, ends[1].y - ends[0].y);
        let length = f64::from(dx).hypot(f64::from(dy)) / STEPS_PER_MM;
        let moves = dx.abs().max(dy.abs());
        positions
            .extend((0..moves).map(|k| start + length * (f64::from(k) + 0.5) / f64::from(moves)));
        start += length;
    }
    positions
}

/// A circle around (50, 50), in mm.
pub fn circle(radius: f64, chords: u32) -> Vec<(f64, f64)> {
    (0..=chords)
        .map(|k| {
            let angle = f64::from(k) / f64::from(chords) * std::f64::consts::TAU;
            (50.0 + radius * angle.cos(), 50.0 + radius * angle.sin())
        })
        .collect()
}

/// A zigzag of ten lines in mm: x alternates between 10 and 60, and y grows by 5 for each line.
pub fn zigzag() -> Vec<(f64, f64)> {
    (0..=10)
        .map(|line| (if line % 2 == 0 { 10.0 } else { 60.0 }, 10.0 + 5.0 * f64::from(line)))
        .collect()
}

/// A five-pointed star of radius 30 mm, drawn in one stroke.
pub fn star() -> Vec<(f64, f64)> {
    (0..=5)
        .map(|k| {
            let angle = f64::from(k) * 2.0 / 5.0 * std::f64::consts::TAU;
            (50.0 + 30.0 * angle.sin(), 50.0 + 30.0 * angle.cos())
        })
        .collect()
}

/// A slowly growing spiral of 10,000 points at distances of 0.05 mm.
pub fn dense() -> Vec<(f64, f64)> {
    let mut angle = 0.0f64;
    (0..10_000)
        .map(|_| {
            let radius = 20.0 + angle / 2.0;
            angle += 0.05 / radius;
            (100.0 + radius * angle.cos(), 100.0 + radius * angle.sin())
        })
        .collect()
}
