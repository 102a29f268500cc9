//! Tests of bends of small radius: the acceleration towards the centre, measured from the events,
//! all along each of them.

use penup::board_table::{LM3S6965, PICO};
use penup_host_tests::half_circles::{HalfCircles, Straights};
use penup_host_tests::motion_cases::Case;
use penup_host_tests::motion_paths::draw;

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
