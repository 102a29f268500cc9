use penup_host_tests::half_circles::{HalfCircles, Straights};
use penup_host_tests::motion_cases::Case;
use penup_host_tests::motion_paths::draw;
fn main() {
    let (mut total, mut all_jerk) = (0.0, 0.0);
    for straights in [Straights::Whole, Straights::Chords, Straights::None] {
        for radius in [0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.5, 4.0] {
            let mut worst = [[0.0f64; 8]; 2];
            let mut secs = [0.0f64; 2];
            let mut ideal = [0.0f64; 2];
            let mut who = [None; 2];
            for chord in [0.03, 0.05, 0.1, 0.15] {
                if chord > radius {
                    continue;
                }
                for blocks in [16, 128] {
                    for angle in [0.0, 0.3, 1.07, 2.5] {
                        for (speed, acceleration) in [(50.0, 200.0), (30.0, 3000.0)] {
                            for jerk in [0.0, 100_000.0] {
                                let path = HalfCircles {
                                    radius,
                                    chord,
                                    straights,
                                    angle,
                                    left: angle < 1.0,
                                };
                                let (points, places) = path.points();
                                let case = Case { speed, acceleration, jerk, deviation: 0.127 };
                                let run = draw(&points, case.settings(), blocks);
                                let kind = usize::from(blocks == 128);
                                secs[kind] += run.seconds;
                                total += run.seconds;
                                if jerk > 0.0 {
                                    all_jerk += run.seconds;
                                }
                                ideal[kind] += 0.0;
                                let measured = path.measure(&points, &places, &run);
                                for (slot, value) in worst[kind].iter_mut().zip(measured) {
                                    let value = value / acceleration;
                                    if value > *slot {
                                        *slot = value;
                                        who[kind] = Some((chord, angle, acceleration, jerk));
                                    }
                                }
                            }
                        }
                    }
                }
            }
            for kind in 0..2 {
                println!(
                    "{straights:?} R {radius} blocks {}: {:.2?} {:.3} s {:?}",
                    [16, 128][kind],
                    worst[kind],
                    secs[kind],
                    who[kind]
                );
            }
        }
    }
    println!("total {total:.3} jerk {all_jerk:.3}");
}
