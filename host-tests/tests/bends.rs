//! Tests of bends of small radius: the acceleration towards the centre, measured from the events,
//! all along each of them.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::board_table::{LM3S6965, PICO};
use penup_host_tests::half_circles::{HalfCircles, Straights};
use penup_host_tests::motion_cases::{Case, in_bends, random_curve};
use penup_host_tests::motion_paths::{draw, positions, steps};
use penup_host_tests::random::Random;

/// The radius is known to a few percent only where it is a few steps: of 10 steps, one may be
/// rounding. So these figures are measured, and the limit is 1.
#[test]
fn half_circles_keep_the_acceleration_from_their_first_chord_to_their_last() {
    for (radius, most) in [(0.1, 1.25), (0.15, 1.15), (0.2, 1.15), (0.3, 1.1), (0.5, 1.1)] {
        for straights in [Straights::Whole, Straights::Chords, Straights::None] {
            for chord in [0.03, 0.05, 0.1, 0.15].into_iter().filter(|&chord| chord <= radius) {
                for (angle, left) in [(0.0, true), (0.3, false), (1.07, true), (2.5, false)] {
                    let path = HalfCircles { radius, chord, straights, angle, left };
                    let (points, places) = path.points();
                    for (speed, acceleration) in [(50.0, 200.0), (30.0, 3000.0)] {
                        for jerk in [0.0, 100_000.0] {
                            let case = Case { speed, acceleration, jerk, deviation: 0.127 };
                            for blocks in [LM3S6965.memory.blocks, PICO.memory.blocks] {
                                let run = draw(&points, case.settings(), blocks);
                                let measured = path.measure(&points, &places, &run);
                                let eighths = measured.map(|eighth| eighth / acceleration);
                                assert!(
                                    eighths.iter().all(|&eighth| eighth <= most),
                                    "{path:?} {case:?} {blocks}: {eighths:.2?}"
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

/// At these seeds a bend was passed too fast, because a circle through points far apart, which only
/// blurred a narrower one, became known too late where the blocks are few.
#[test]
fn few_blocks_pass_bends_as_the_whole_path_does() {
    for seed in [6759, 7536] {
        let mut random = Random::new(seed);
        let case = Case::random(&mut random, [2.7, 5.9]);
        let blocks = random.between(2, 129) as usize;
        let (points, bends) = random_curve(&mut random);
        for case in [case, Case { jerk: 0.0, ..case }] {
            let [few, all] = [blocks, points.len()].map(|blocks| {
                in_bends(case, &points, &bends, &draw(&points, case.settings(), blocks))
            });
            assert!(few <= 1.3 * all.max(1.0), "{seed} {case:?} {blocks}: {few:.2}, not {all:.2}");
        }
    }
}

/// The greatest squared speed within 0.05 mm of the corner between two lines of 40 mm, as a part of
/// what the junction deviation allows there. `gap` steps cut the corner, and the lines may be in
/// chords of this length; 0 is none.
fn at_corner(degrees: f64, gap: u32, chord: f64, case: Case, blocks: usize) -> f64 {
    const SIDE: f64 = 40.0;
    let turn = degrees.to_radians();
    let chords = if chord > 0.0 { (SIDE / chord) as u32 } else { 1 };
    let mut path = vec![(100.0, 100.0)];
    let mut corner = 0;
    for (angle, length, count) in [
        (0.37, SIDE, chords),
        (0.37 + turn / 2.0, 0.0107 * f64::from(gap), u32::from(gap > 0)),
        (0.37 + turn, SIDE, chords),
    ] {
        let (x, y) = path[path.len() - 1];
        corner = if angle < 0.37 + turn { path.len() - 1 + count as usize } else { corner };
        for number in 1..=count {
            let along = length * f64::from(number) / f64::from(count);
            path.push((x + along * angle.cos(), y + along * angle.sin()));
        }
    }
    let points = steps(&path);
    let [place] = steps(&path[corner..=corner])[..] else { panic!("one point") };
    let run = draw(&points, case.settings(), blocks);
    let positions = positions(&points);
    let at = run.points.iter().position(|point| *point == place).expect("on the path");
    let (first, last) = (at - 2, at + 2);
    let speed = (positions[last] - positions[first]) / (run.times[last] - run.times[first]);
    let cosine = (turn / 2.0).cos();
    speed * speed * (1.0 - cosine) / (case.acceleration * case.deviation * cosine)
}

/// A corner of a few steps is as slow as without them, but for what those steps round it and what
/// the speed changes over the four steps measured.
#[test]
fn a_single_step_hides_no_corner() {
    for (speed, acceleration, deviation) in [(100.0, 800.0, 0.05), (50.0, 200.0, 0.127)] {
        for jerk in [0.0, 100_000.0] {
            let case = Case { speed, acceleration, jerk, deviation };
            for blocks in [LM3S6965.memory.blocks, PICO.memory.blocks] {
                for (degrees, most) in [(60.0, 3.1), (94.0, 2.1), (120.0, 3.1), (150.0, 6.5)] {
                    for chord in [0.0, 0.1, 0.3] {
                        for gap in [1, 2, 3, 5, 8, 10] {
                            let part = at_corner(degrees, gap, chord, case, blocks);
                            let what = format!("{case:?} {blocks} {degrees} {chord} {gap}");
                            assert!(part <= most, "{what}: {part:.2}");
                        }
                    }
                }
            }
        }
    }
}
