//! Tests of S-curves: the jerk, measured from the events, stays within its limit.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PagePoint};
use penup::machine::{Settings, State, Target, TargetList};
use penup::motion::StepEvent;
use penup_host_tests::event_checker;
use penup_host_tests::motion_cases::{Case, Orders, job};
use penup_host_tests::motion_optimum::{Limits, straight_seconds};
use penup_host_tests::motion_paths::{circle, dense, draw, settings, star, steps, zigzag};
use penup_host_tests::pin_machine;
use proptest::prelude::*;

fn events(points: &[PagePoint], ink: LineType, settings: Settings) -> Vec<StepEvent> {
    let targets: Vec<_> = points
        .iter()
        .enumerate()
        .map(|(index, &point)| Target { point, ink: (index > 0).then_some(ink) })
        .collect();
    pin_machine::record(settings, &mut TargetList::new(&targets), 128).expect("within the travel")
}

/// The FNV-1a hash of all words.
fn digest(events: &[StepEvent]) -> u64 {
    let bytes = events.iter().flat_map(|event| event.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// The expected hashes are those of the plotter since the version in which the moves of a slice are
/// evenly spaced, with the mark of rest on the dwell of a raised pen that came later. The second
/// changed once more when circles that turn by more than 63° no longer counted, and three when
/// slices of constant speed became longer and short chords in line became one block.
#[test]
fn without_a_jerk_limit_the_events_are_what_they_were() {
    let cases = [
        (circle(30.0, 100), LineType::Full, 50.0, 200.0, 0xa136_05ac_5038_09d2),
        (circle(3.0, 100), LineType::Full, 50.0, 200.0, 0xb658_c762_01a7_8f85),
        (zigzag(), LineType::Dashed, 50.0, 200.0, 0xc213_2d8b_c176_93eb),
        (star(), LineType::Full, 100.0, 3000.0, 0x583c_5973_f528_5f4b),
        (dense(), LineType::Full, 30.0, 1000.0, 0x505a_0b2c_c40e_9fd1),
    ];
    let differing: Vec<_> = cases
        .into_iter()
        .filter_map(|(path, ink, speed, acceleration, expected)| {
            let events = events(&steps(&path), ink, settings(speed, acceleration, 0.127, true));
            let digest = digest(&events);
            (digest != expected).then(|| format!("{digest:#x}, not {expected:#x}"))
        })
        .collect();
    assert!(differing.is_empty(), "{differing:#?}");
}

#[test]
fn known_paths_keep_every_limit_and_take_a_sane_time() {
    let line = |length: f64| vec![(10.0, 10.0), (10.0 + length, 10.0)];
    // Each a number of straights, or of curves of one speed: how many, how long, how fast.
    let paths = [
        ("zigzag", zigzag(), 10.0, 50.25, f64::INFINITY),
        ("star", star(), 5.0, 57.06, f64::INFINITY),
        ("circle 30", circle(30.0, 100), 1.0, 188.5, 30.0),
        ("circle 3", circle(3.0, 100), 1.0, 18.85, 3.0),
        ("circle 0.3", circle(0.3, 40), 1.0, 1.9, 0.3),
        ("dense", dense(), 1.0, 500.0, 20.0),
        ("short", line(0.5), 1.0, 0.5, f64::INFINITY),
        ("long", line(300.0), 1.0, 300.0, f64::INFINITY),
    ];
    for (name, path, count, length, radius) in paths {
        let points = steps(&path);
        for (speed, acceleration) in [(50.0f64, 200.0f64), (100.0, 1000.0), (30.0, 3000.0)] {
            for jerk in [500.0, 3000.0, 20_000.0, 100_000.0] {
                let case = Case { speed, acceleration, jerk, deviation: 0.127 };
                let run = draw(&points, case.settings(), 2000);
                case.check(name, &points, &run);
                let curve = (acceleration * radius).sqrt().min(speed);
                let least =
                    straight_seconds(length, Limits { speed: curve, ..case.limits() }, jerk);
                // Braking is planned with 16/18 of the jerk limit, and begins and ends with an
                // interval.
                let ramp = (acceleration / jerk).min((speed / jerk).sqrt());
                let most = count * (1.06 * least + 3.0 * (ramp / 16.0).max(0.0013));
                assert!(run.seconds <= most, "{name} {case:?}: {} s, not {most}", run.seconds);
            }
        }
    }
}

#[test]
fn dense_points_never_stop_it_with_a_short_look_ahead() {
    let points = steps(&dense());
    for (jerk, blocks) in [(500.0, 128), (3000.0, 128), (100_000.0, 128), (20_000.0, 12)] {
        let case = Case { speed: 50.0, acceleration: 200.0, jerk, deviation: 0.127 };
        let run = draw(&points, case.settings(), blocks);
        case.check("dense", &points, &run);
        // Blocks end each 0.05 mm; at the slowest of these speeds that is 20 ms.
        let moves = &run.times[400..run.times.len() - 400];
        let pause = moves.windows(2).map(|t| t[1] - t[0]).fold(0.0, f64::max);
        assert!(pause < 0.004, "{case:?}: {pause} s");
    }
}

/// A straight, as several chords or as one line, into a half circle and back.
fn bend(radius: f64, chord: f64, straight_in_chords: bool) -> Vec<(f64, f64)> {
    let mut path = vec![(10.0, 10.0)];
    let count = if straight_in_chords { (40.0 / chord) as usize } else { 1 };
    path.extend((1..=count).map(|index| (10.0 + 40.0 * index as f64 / count as f64, 10.0)));
    let chords = (std::f64::consts::PI * radius / chord).ceil();
    path.extend((1..=chords as usize).map(|index| {
        let (sine, cosine) = (std::f64::consts::PI * index as f64 / chords).sin_cos();
        (50.0 + radius * sine, 10.0 + radius * (1.0 - cosine))
    }));
    path.push((10.0, 10.0 + 2.0 * radius));
    path
}

/// The planner knows that a curve bends only after some of its points; a cruise must not last until
/// then.
#[test]
fn bends_behind_straights_are_seen_in_time() {
    for (radius, chord) in [(0.3, 0.05), (0.5, 0.05), (0.8, 0.1)] {
        for straight_in_chords in [false, true] {
            let points = steps(&bend(radius, chord, straight_in_chords));
            for (speed, acceleration) in [(30.0, 3000.0), (50.0, 3000.0)] {
                for jerk in [100_000.0, 400_000.0] {
                    let case = Case { speed, acceleration, jerk, deviation: 0.127 };
                    for blocks in [32, 128] {
                        let run = draw(&points, case.settings(), blocks);
                        let name = format!("{radius} {chord} {straight_in_chords} {blocks}");
                        case.check(&name, &points, &run);
                    }
                }
            }
        }
    }
}

/// A curve of the soak (its seed 73), in which a bend is found too late to be braked for. It is
/// braked for as hard as the limits let it, and no longer than it takes: braking went on at the
/// greatest acceleration until the machine stood, and its end there was a jerk of 2.3 times the
/// limit. How many chords, and by what angle each turns.
#[test]
fn a_bend_that_is_found_late_stops_nothing() {
    let curve = [
        (35, 0.0),
        (17, -0.017103349879940572),
        (1, -0.07458103991924962),
        (26, -0.028159789273917626),
        (2, 0.0),
        (1, 0.0072931692343833916),
        (8, 0.0034322073833288357),
        (13, -0.004110860698857175),
        (13, -0.04589045607446345),
        (34, -0.4338248196418906),
        (4, 0.07578181708789762),
        (3, -0.5),
        (27, 0.0),
        (38, -0.00837252440694301),
        (34, -0.06554517814019474),
    ];
    let chord = 32.934585594450255;
    let (mut x, mut y, mut heading) = (20_000.0f64, 20_000.0f64, 0.0f64);
    let mut points = vec![PagePoint { x: 20_000, y: 20_000 }];
    for (count, turn) in curve {
        for _ in 0..count {
            heading += turn;
            (x, y) = (x + chord * heading.cos(), y + chord * heading.sin());
            points.push(PagePoint { x: x.round() as i32, y: y.round() as i32 });
        }
    }
    let case = Case {
        speed: 107.20388147009999,
        acceleration: 399.521638160104,
        jerk: 4308.2697360269,
        deviation: 0.11193162879054035,
    };
    let nearness = case.measure(&points, &draw(&points, case.settings(), 60));
    assert!(nearness.jerk <= 1.1, "{nearness:?}");
}

/// Most of the points that show the bends come after the blocks that bend were begun. Of three or
/// more blocks: two, of which one is a single step, say too little (1.09 times the speed).
#[test]
fn a_few_blocks_are_enough_to_keep_the_limits_of_bends() {
    let turns =
        [(-7, 4), (0, 1), (5, 0), (3, -8), (0, -5), (4, -1), (0, 1), (1, 7), (2, 7), (-3, 8)];
    let mut points = vec![PagePoint { x: 2000, y: 2000 }];
    for (dx, dy) in turns {
        let last = points.last().expect("the first");
        points.push(PagePoint { x: last.x + dx, y: last.y + dy });
    }
    for blocks in 3..10 {
        for acceleration in [50.0, 200.0, 1000.0] {
            let case = Case { speed: 50.0, acceleration, jerk: 30_000.0, deviation: 0.001 };
            let run = draw(&points, case.settings(), blocks);
            case.check(&format!("{blocks} blocks"), &points, &run);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    #[test]
    fn random_paths_keep_every_limit(
        turns in prop::collection::vec((-300i32..300, -300i32..300), 1..60),
        scale in 1i32..40,
        speed in 5.0f64..120.0,
        acceleration in 50.0f64..5000.0,
        jerk in 500.0f64..100_000.0,
        deviation in 0.001f64..0.5,
        blocks in 2usize..130,
    ) {
        let mut at = PagePoint { x: 20_000, y: 20_000 };
        let mut points = vec![at];
        for (dx, dy) in turns {
            at = PagePoint { x: at.x + dx / scale, y: at.y + dy / scale };
            points.push(at);
        }
        points.dedup();
        prop_assume!(points.len() > 1);
        let case = Case { speed, acceleration, jerk, deviation };
        let run = draw(&points, case.settings(), blocks);
        case.check("random", &points, &run);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    /// The path turns back nearly into itself again and again, so that the speed is nearly 0 there
    /// and the acceleration, which goes on, must not be cut short.
    #[test]
    fn near_reversals_keep_every_limit(
        turns in prop::collection::vec((-300i32..300, -300i32..300, -3i32..4, -3i32..4), 1..30),
        scale in 1i32..40,
        speed in 5.0f64..120.0,
        acceleration in 50.0f64..5000.0,
        exponent in 2.7f64..5.9,
        deviation in 0.001f64..0.5,
        blocks in 2usize..130,
    ) {
        let mut at = PagePoint { x: 20_000, y: 20_000 };
        let mut points = vec![at];
        for (dx, dy, more_x, more_y) in turns {
            for (dx, dy) in [(dx, dy), (-dx + more_x, -dy + more_y)] {
                at = PagePoint { x: at.x + dx / scale, y: at.y + dy / scale };
                points.push(at);
            }
        }
        points.dedup();
        prop_assume!(points.len() > 1);
        let case = Case { speed, acceleration, jerk: 10f64.powf(exponent), deviation };
        let run = draw(&points, case.settings(), blocks);
        case.check("reversals", &points, &run);
    }
}

#[test]
fn straight_lines_take_the_time_of_the_exact_curve() {
    for length in [0.3, 3.0, 30.0, 300.0] {
        let points = steps(&[(10.0, 10.0), (10.0 + length, 10.0)]);
        for jerk in [1000.0, 10_000.0, 100_000.0] {
            for (speed, acceleration) in [(50.0, 200.0), (100.0, 1000.0), (30.0, 3000.0)] {
                let case = Case { speed, acceleration, jerk, deviation: 0.127 };
                let run = draw(&points, case.settings(), 128);
                let least = straight_seconds(length, case.limits(), jerk);
                assert!(run.seconds <= 1.05 * least, "{length} {case:?}: {} s", run.seconds);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn holds_overrides_feeds_and_aborts_keep_the_limits_too(
        orders in prop::collection::vec((0u64..150_000_000, 0u8..3, 10u8..200), 1..6),
        aborts: bool,
        // If the main loop is later than 2 ms, the machine may have to brake, and harder than the
        // limits if the queue is too short.
        turn_ticks in 5_000u64..50_000,
        feeds in prop::collection::vec(30u16..4000, 0..6),
        jerk in prop_oneof![1 => Just(0.0), 3 => 500.0f64..100_000.0],
        acceleration in 50.0f64..5000.0,
    ) {
        let case = Case { speed: 50.0, acceleration, jerk, deviation: 0.05 };
        let ratios = Orders { orders, aborts, turn_ticks, feeds }.measure(case);
        prop_assert!(ratios.acceleration <= 1.05, "{ratios:?}");
        prop_assert!(ratios.jerk <= 1.1, "{ratios:?}");
        prop_assert!(ratios.rest <= 1.05, "{ratios:?}");
    }
}

/// A stop ends on a whole step, where the brake of the step interrupt expects it to end. These are
/// the worst of 4,000 cases in which it ended anywhere: up to 1.11 times the acceleration.
#[test]
fn a_hold_keeps_the_acceleration_up_to_the_last_step() {
    for (acceleration, jerk, holds) in [
        (227.7, 0.0, [58_643_597, 65_845_745]),
        (228.1, 0.0, [84_863_706, 96_550_065]),
        (226.6, 0.0, [45_647_454, 47_691_454]),
        (220.0, 79_288.0, [40_510_414, 53_795_295]),
        (225.5, 52_700.0, [54_371_679, 71_654_714]),
    ] {
        for shift in 0..40 {
            let settings = Case { speed: 50.0, acceleration, jerk, deviation: 0.05 }.settings();
            let targets = job();
            let (mut path, mut first) = (TargetList::new(&targets), TargetList::new(&targets));
            let mut waiting = holds.map(|due: u64| due + shift * 37_813).into_iter().peekable();
            let trace = pin_machine::run(settings, &mut path, 20_000, &mut |turn| {
                if turn.now == 0 {
                    turn.machine.start(&mut first).expect("within the travel");
                }
                while waiting.next_if(|&due| turn.now >= due).is_some() {
                    turn.machine.hold();
                }
                let state = turn.machine.state();
                if state == (State::Hold { stopped: true }) && turn.machine.is_stopped() {
                    turn.machine.resume();
                }
                turn.machine.state() != State::Idle || !turn.machine.is_stopped()
            });
            let runs = event_checker::check_pins(&trace, &settings).runs;
            let ratio = event_checker::acceleration_ratio(&runs, &targets, &settings);
            assert!(ratio <= 1.03, "{acceleration} {jerk} {shift}: {ratio}");
        }
    }
}

/// A lower override makes the feeds of the lines just ahead too low to be reached in time. Then the
/// machine braked to rest, and ended there with up to 2.6 times the jerk.
#[test]
fn feeds_that_an_override_makes_late_are_braked_for_without_a_kink() {
    let (acceleration, jerk) = (1667.6, 46_611.0);
    let case = Case { speed: 50.0, acceleration, jerk, deviation: 0.05 };
    for feeds in [vec![3247, 2697], vec![3247], vec![2697], vec![600, 3000, 1200]] {
        for due in (60_000_000..80_000_000).step_by(499_999) {
            let orders = Orders {
                orders: vec![(due, 0, 24)],
                aborts: false,
                turn_ticks: 42_800,
                feeds: feeds.clone(),
            };
            let ratios = orders.measure(case);
            assert!(ratios.jerk <= 1.1 && ratios.acceleration <= 1.05, "{orders:?}: {ratios:?}");
        }
    }
}
