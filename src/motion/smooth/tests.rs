use super::*;
use crate::motion::limits::tests::settings;
use crate::motion::{MotionSettings, SLICE_TICKS};

/// mm/s, mm/s², m/s³; mm per slice at 1 mm/s.
const SLICE: f64 = SLICE_TICKS as f64 / 25e6;

fn limit(speed: f64, acceleration: f64, jerk: f64) -> JerkLimit {
    let limit = JerkLimit::new(
        Millimetres::from_num(jerk),
        SliceSpeed::from_num(acceleration * SLICE * SLICE),
        SliceSpeed::from_num(speed * SLICE),
    );
    limit.expect("a limit")
}

#[test]
fn the_longest_ramp_is_that_of_acceleration_or_speed() {
    assert_eq!(
        JerkLimit::new(Millimetres::ZERO, SliceSpeed::MAX, SliceSpeed::from_num(0.01)),
        None
    );
    let reckoned = 16.0 / 18.0;
    for (speed, acceleration, jerk, seconds) in [
        (100.0, 200.0, 2.0, 200.0 / (2000.0 * reckoned)),
        (50.0, 800.0, 0.5, (50.0f64 / (500.0 * reckoned)).sqrt()),
        (50.0, 200.0, 1000.0, 8.0 * SLICE),
        (500.0, 800.0, 0.1, 4096.0 * SLICE),
    ] {
        let limit = limit(speed, acceleration, jerk);
        let longest = f64::from(limit.longest) / 16.0 * SLICE;
        assert!((longest / seconds - 1.0).abs() < 0.01, "{jerk}: {longest} s, not {seconds} s");
        assert_eq!(limit.longest % i32::from(limit.slices()), 0);
    }
}

/// The distance, mm, from a speed, mm/s, and ramp, braking as hard as possible for `first`
/// slices and then less and less; and the speed then.
fn braked(limit: JerkLimit, from: State, hard: f64) -> (f64, f64) {
    let jerk = f64::from(limit.jerk.get()) / 2f64.powi(40) / SLICE.powi(3);
    let (mut speed, mut distance) = (f64::from(from.speed) / 2f64.powi(32) / SLICE, 0.0);
    let longest = f64::from(limit.longest) / 16.0 * SLICE;
    let (mut ramp, mut time, step) = (f64::from(from.ramp) / 16.0 * SLICE, 0.0, 1e-5);
    loop {
        ramp = if time < hard { (ramp - step).max(-longest) } else { ramp + step };
        if (time >= hard && ramp >= 0.0) || speed < 0.0 {
            return (speed, distance);
        }
        speed += jerk * ramp * step;
        distance += speed * step;
        time += step;
    }
}

#[test]
fn the_braking_distance_is_that_of_the_hardest_braking() {
    for (top, acceleration, jerk) in
        [(50.0, 200.0, 0.5), (100.0, 1000.0, 10.0), (80.0, 300.0, 90.0)]
    {
        let limit = limit(top, acceleration, jerk);
        for ramp in [-0.9, -0.5, 0.0, 0.4, 1.0] {
            for to in [0.0, 0.1, 0.5] {
                let ramp = (f64::from(limit.longest) * ramp) as i32;
                let speed = (0.9 * top * SLICE * 2f64.powi(32)) as u32;
                let from = State { speed, ramp };
                let to = to * top;
                // The time of hard braking after which the speed settles at `to`, by bisection.
                let (mut short, mut long) = (0.0, 10.0);
                if braked(limit, from, 0.0).0 < to {
                    continue;
                }
                for _ in 0..30 {
                    let middle = (short + long) / 2.0;
                    if braked(limit, from, middle).0 > to { short = middle } else { long = middle }
                }
                let expected = braked(limit, from, long).1;
                let scaled = (to * SLICE * 2f64.powi(32)) as u32;
                let distance = limit.braking_distance(from, scaled) as f64 / 2f64.powi(32);
                assert!(
                    (distance - expected).abs() < 0.01 * expected + 0.01,
                    "{distance} mm, not {expected}"
                );
            }
        }
    }
}

#[test]
fn at_the_top_the_speed_stays_for_long_intervals() {
    for jerk in [100, 10, 1] {
        let jerk_m_per_s3 = Millimetres::from_num(jerk);
        let limits = Limits::new(&MotionSettings { jerk_m_per_s3, ..settings() });
        let limits = limits.expect("valid");
        let (mut state, mut room) = (State::default(), 100u64 << 32);
        let mut tops = std::vec::Vec::new();
        while room > 0 {
            let jerk = limits.jerk.expect("a limit");
            let (top, curve_limit) = (limits.draw_speed, PathLength::MAX);
            let path_limits = PathLimits {
                limits: &limits,
                jerk,
                top,
                room,
                curve_limit,
                top_ends: false,
                beyond: None,
            };
            let mut interval = path_limits.next(state);
            while let Some(slice) = interval.next_slice(room, Slice::MOST) {
                room -= u64::from(slice.distance);
            }
            state = interval.state();
            if u64::from(state.speed) * 100 > u64::from(top.to_bits()) * 99 && state.ramp == 0 {
                tops.push((state.speed, interval.slices));
            }
        }
        assert!(tops.windows(2).all(|two| two[0].0 == two[1].0), "{jerk}: {tops:?}");
        // Some 80 mm at 50 mm/s are 1.6 s.
        assert!((4..60).contains(&tops.len()), "{jerk}: {tops:?}");
    }
}

#[test]
fn a_slice_cut_short_goes_on_as_long_and_as_far() {
    let limit = limit(50.0, 200.0, 5.0);
    let from = State { speed: 30_000_000, ramp: 1000 };
    let interval = Interval::new(limit, from, 7, limit.slices());
    let all = |room: u64| {
        let mut interval = interval;
        core::iter::from_fn(|| interval.next_slice(room, Slice::MOST))
            .map(|slice| (u64::from(slice.distance), u64::from(slice.time)))
            .fold((0, 0), |sum, slice| (sum.0 + slice.0, sum.1 + slice.1))
    };
    assert_eq!(all(u64::MAX), all(10_000_019));
    assert_eq!(all(0), (0, 0));
}
