//! Half circles between straight lines, drawn and measured: how near the acceleration towards the
//! centre of a bend comes to the limit.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use crate::event_checker::Run;
use crate::motion_paths::{STEPS_PER_MM, positions};
use penup::drawing::PagePoint;
use std::f64::consts::{PI, TAU};

/// How the straight lines beside the half circles come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Straights {
    /// Each as one line.
    Whole,
    /// In chords as long as those of the half circles.
    Chords,
    /// There are none: each half circle bends the other way than the one before it.
    None,
}

/// Half circles that bend the same way or, without straights, in turn the one and the other way.
#[derive(Debug, Clone, Copy)]
pub struct HalfCircles {
    /// The radius, in mm.
    pub radius: f64,
    /// The length of a chord, in mm.
    pub chord: f64,
    /// The straights, each 12 mm long.
    pub straights: Straights,
    /// The direction of the first line, in radians.
    pub angle: f64,
    /// Whether the first half circle turns counter-clockwise.
    pub left: bool,
}

/// The number of half circles in a path.
const COUNT: usize = 4;

impl HalfCircles {
    /// The points in steps, and for each line between two whether a half circle has it and which
    /// part of that half circle is before its middle (0 to 1).
    pub fn points(self) -> (Vec<PagePoint>, Vec<Option<f64>>) {
        let Self { radius, chord, straights, mut angle, left } = self;
        let (mut x, mut y) = (150.0, 150.0);
        let point = |x: f64, y: f64| PagePoint {
            x: (x * STEPS_PER_MM).round() as i32,
            y: (y * STEPS_PER_MM).round() as i32,
        };
        let (mut points, mut places) = (vec![point(x, y)], Vec::new());
        let mut add = |x: f64, y: f64, place: Option<f64>| {
            let point = point(x, y);
            if points.last() != Some(&point) {
                points.push(point);
                places.push(place);
            }
        };
        let straight = |x: &mut f64, y: &mut f64, angle: f64, add: &mut dyn FnMut(f64, f64)| {
            let length = 12.0;
            let count = match straights {
                Straights::Whole => 1,
                Straights::Chords => (length / chord) as u32,
                Straights::None => 0,
            };
            for _ in 0..count {
                *x += length / f64::from(count) * angle.cos();
                *y += length / f64::from(count) * angle.sin();
                add(*x, *y);
            }
        };
        let mut turn = if left { 1.0 } else { -1.0 };
        for _ in 0..COUNT {
            straight(&mut x, &mut y, angle, &mut |x, y| add(x, y, None));
            // The centre is to the side.
            let (cx, cy) = (x - radius * turn * angle.sin(), y + radius * turn * angle.cos());
            let chords = (PI * radius / chord).ceil().max(3.0) as u32;
            let start = angle - turn * PI / 2.0;
            for index in 1..=chords {
                let at = start + turn * PI * f64::from(index) / f64::from(chords);
                (x, y) = (cx + radius * at.cos(), cy + radius * at.sin());
                add(x, y, Some((f64::from(index) - 0.5) / f64::from(chords)));
            }
            angle = (angle + turn * PI).rem_euclid(TAU);
            turn = if straights == Straights::None { -turn } else { turn };
        }
        straight(&mut x, &mut y, angle, &mut |x, y| add(x, y, None));
        (points, places)
    }

    /// The greatest acceleration towards the centre in each eighth of a half circle, in mm/s².
    pub fn measure(self, points: &[PagePoint], places: &[Option<f64>], run: &Run) -> [f64; 8] {
        let at = positions(points);
        let mut greatest = [0.0f64; 8];
        let mut first = 0;
        for (ends, place) in points.windows(2).zip(places) {
            let moves = (ends[1].x - ends[0].x).abs().max((ends[1].y - ends[0].y).abs()) as usize;
            if let Some(place) = place {
                let slot = &mut greatest[((place * 8.0) as usize).min(7)];
                for index in first.max(1)..first + moves {
                    let speed =
                        (at[index] - at[index - 1]) / (run.times[index] - run.times[index - 1]);
                    *slot = slot.max((speed - 0.1).max(0.0).powi(2) / self.radius);
                }
            }
            first += moves;
        }
        greatest
    }
}
