//! How a machine that shakes answers shaped motion and other motion.

use super::{Smoothed, and, deviation, drawn, shaper};
use crate::fixtures::{ink, point, to};
use penup::machine::{Setting, Target};
use std::f64::consts::TAU;

/// A mass on a spring, as what is between a motor and the pen.
struct Resonator {
    /// The frequency in 1/s, times 2π, and the damping ratio.
    speed: f64,
    damping: f64,
    /// How far the mass is from the motor, and its speed beside that of the motor: mm, mm/s.
    off: f64,
    moving: f64,
}

impl Resonator {
    fn new(hertz: f64) -> Self {
        Self { speed: TAU * hertz, damping: 0.05, off: 0.0, moving: 0.0 }
    }

    /// Lets time pass while the motor has a constant speed, in seconds.
    fn pass(&mut self, seconds: f64) {
        let damped = self.speed * (1.0 - self.damping * self.damping).sqrt();
        let decay = self.damping * self.speed;
        let (sine, cosine) = (damped * seconds).sin_cos();
        let shrunk = (-decay * seconds).exp();
        let other = (self.moving + decay * self.off) / damped;
        let off = shrunk * (self.off * cosine + other * sine);
        let turned = shrunk * (other * damped * cosine - self.off * damped * sine);
        (self.off, self.moving) = (off, turned - decay * off);
    }
}

/// Steps per millimetre of the zigzag: so many that single steps hardly move what shakes.
const FINE: f64 = 320.0;

/// The length of a leg of the zigzag along x and along y, in mm.
const LEG: [f64; 2] = [30.0, 51.961_524];

/// A zigzag of 20 legs of 60 mm, with corners of 60°.
fn zigzag() -> Vec<Target> {
    let corner = |number: u32| {
        let [x, y] = [LEG[0] * f64::from(number), 1.0 + LEG[1] * f64::from(number % 2)];
        let at = point((x * FINE).round() as i32, (y * FINE).round() as i32);
        if number == 0 { to(at.x, at.y) } else { ink(at.x, at.y) }
    };
    (0..=20).map(corner).collect()
}

/// Half of how far a motion wiggles about the straight line that fits it best.
fn wiggle(motion: &[(f64, f64)]) -> f64 {
    let count = motion.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| motion.iter().map(of).sum::<f64>() / count;
    let (time, place) = (mean(|at| at.0), mean(|at| at.1));
    let square: f64 = motion.iter().map(|at| (at.0 - time).powi(2)).sum();
    let slope = motion.iter().map(|at| (at.0 - time) * (at.1 - place)).sum::<f64>() / square;
    let off = motion.iter().map(|at| at.1 - place - slope * (at.0 - time));
    let ends = off.fold([f64::MAX, f64::MIN], |ends, off| [ends[0].min(off), ends[1].max(off)]);
    (ends[1] - ends[0]) / 2.0
}

/// Draws the zigzag at 100 mm/s and 800 mm/s². Returns its time in seconds, the greatest amplitude
/// in mm with which a machine shakes along x or y between two stops, at full speed, and after the
/// last one, and how far the line is off, in mm.
fn ringing(hertz: f64, changes: &[(Setting, f64)]) -> [f64; 3] {
    let base = [
        (Setting::StepsPerMmX, FINE),
        (Setting::StepsPerMmY, FINE),
        (Setting::DrawSpeed, 6000.0),
        (Setting::TravelX, 1000.0),
        // It stops in each corner.
        (Setting::JunctionDeviation, 0.0),
    ];
    let settings = and(&base, changes);
    let targets = zigzag();
    let (runs, seconds) = drawn(&settings, &targets);
    let off = deviation(&runs, &targets, settings.kinematics()) / FINE;
    let run = runs.iter().find(|run| run.height == 127).expect("a stroke");
    let mut greatest = 0.0f64;
    for axis in [0, 1] {
        let first = targets[0].point;
        let knots = Smoothed::new(run, axis, [first.x, first.y][axis]).knots;
        let knots = &knots[1..knots.len() - 1];
        let mut resonator = Resonator::new(hertz);
        let (mut speed, mut time) = (0.0, knots[0].0);
        // When the mass is where in the middle of the current leg, in seconds and mm.
        let mut middle: Vec<(f64, f64)> = Vec::new();
        for pair in knots.windows(2) {
            let ((t0, p0), (t1, p1)) = (pair[0], pair[1]);
            resonator.pass(t0 - time);
            let next = (p1 - p0) / (t1 - t0) / FINE;
            resonator.moving -= next - speed;
            (speed, time) = (next, t0);
            // The first copy and the last one are at full speed there.
            let part = ((p0 - knots[0].1) / FINE / LEG[axis]).rem_euclid(1.0);
            if (0.45..0.7).contains(&part) {
                middle.push((t0, p0 / FINE + resonator.off));
            } else if !middle.is_empty() {
                greatest = greatest.max(wiggle(&core::mem::take(&mut middle)));
            }
        }
        resonator.moving += speed;
        let after = |_| {
            resonator.pass(0.001);
            resonator.off
        };
        let after: Vec<f64> = (0..200).map(after).collect();
        let [least, most] =
            [f64::min, f64::max].map(|of| after.iter().copied().reduce(of).expect("an instant"));
        greatest = greatest.max((most - least) / 2.0);
    }
    [seconds, greatest, off]
}

#[test]
fn after_each_stop_of_a_zigzag_less_than_a_tenth_of_the_ringing_is_left() {
    println!("| Hz | shaper | `$238` | time | left | off by |");
    // Of all limits on jerk from 1 to 30 m/s³ in steps of 0.25, these are the fastest ones that
    // leave a tenth.
    for (hertz, jerk) in [(10.0, 8.75), (20.0, 5.75)] {
        let [plain, without, _] = ringing(hertz, &[]);
        println!("| {hertz} | none | | {plain:.2} s | {without:.4} mm | |");
        for (kind, name) in [(1, "ZV"), (2, "ZVD"), (3, "EI")] {
            // With a lesser one the legs are too short for the full speed.
            for allowed in [0.0, if kind == 1 { 0.25 } else { 0.5 }] {
                let [seconds, left, off] = ringing(hertz, &shaper(kind, [hertz; 2], allowed));
                println!(
                    "| {hertz} | {name} | {allowed} | {seconds:.2} s | {left:.4} mm | {off:.3} mm |"
                );
                // EI leaves half of that by design, beside which a step, 3 µm, shows.
                let step = if kind == 3 { 0.5 / FINE } else { 0.0 };
                assert!(left < 0.1 * without + step, "{hertz} {name}: {left} of {without}");
                if allowed > 0.0 {
                    assert!(off < allowed + 1.5 / FINE, "{hertz} {name}: {off}");
                } else {
                    // Only the last copy, behind the one stop at which the pen moves, and that at
                    // the beginning of the stroke.
                    assert!(seconds - plain < 0.3, "{hertz} {name}: {seconds} {plain}");
                }
            }
        }
        let [seconds, left, _] = ringing(hertz, &[(Setting::Jerk, jerk)]);
        println!("| {hertz} | jerk {jerk} m/s3 | | {seconds:.2} s | {left:.4} mm | |");
        assert!(left < 0.1 * without, "{hertz}, jerk: {left} of {without}");
        let [shaped, ..] = ringing(hertz, &shaper(1, [hertz; 2], 0.0));
        assert!(shaped < seconds, "shaped motion is faster: {shaped} {seconds}");
    }
}

#[test]
fn a_frequency_that_is_off_by_a_tenth_is_shaped_as_well() {
    let [_, without, _] = ringing(20.0, &[]);
    for (kind, part) in [(1, 0.35), (2, 0.1), (3, 0.1)] {
        let [_, left, _] = ringing(20.0, &shaper(kind, [22.0; 2], 0.0));
        assert!(left < part * without, "{kind}: {left} of {without}");
    }
}
