use super::super::event::tests::Events;
use super::super::limits::tests::settings;
use super::super::shaping::{Resonance, ShaperKind};
use super::*;
use crate::fixed::Millimetres;
use std::vec::Vec;

/// The planned motion: the time of each run, and where it ends, in whole steps.
type Plan = Vec<(u32, [i32; 2])>;

/// Random numbers below a bound.
fn random(seed: u64) -> impl FnMut(u64) -> u64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move |bound| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 33) % bound
    }
}

/// Where the planned motion is at a time, in steps.
fn planned(plan: &Plan, axis: usize, mut time: f64) -> f64 {
    let mut from = 0.0;
    for &(lasts, to) in plan {
        let to = f64::from(to[axis]);
        if time < f64::from(lasts) {
            return from + (to - from) * (time / f64::from(lasts)).max(0.0);
        }
        time -= f64::from(lasts);
        from = to;
    }
    from
}

/// Shapes a motion through a queue that never fills.
fn shape(shaping: Shaping, plan: &Plan) -> Vec<(f64, [i32; 2])> {
    let limits = Limits::new(&settings()).expect("valid");
    let limits = limits.shaped(Some(shaping)).expect("slow");
    let (mut emitter, mut events) = (Emitter::new(&limits), Events::default());
    let mut shaper = Shaper::new();
    shaper.set_shaping(Some(shaping));
    emitter.hold(0, &mut events).expect("room");
    shaper.begin(PagePoint::default(), 0);
    let brake = BrakeRule::default();
    let mut now = 0u32;
    for &(time, to) in plan {
        shaper.add(time, to.map(|to| i64::from(to) << POSITION_BITS));
        now += time;
        let done = shaper.make_steps(&limits, brake, &mut emitter, &mut events);
        assert_eq!(done, Ok(true));
    }
    let [x, y] = plan.last().expect("a run").1;
    now += shaper.come_to_rest(PagePoint { x, y });
    assert_eq!(shaper.make_steps(&limits, brake, &mut emitter, &mut events), Ok(true));
    assert_eq!(shaper.time, now);
    assert_eq!(shaper.rest(&mut emitter, &mut events), Ok(true));
    assert!(shaper.is_resting());
    emitter.rest(now + (1 << 20), true, &mut events).expect("room");
    let (mut time, mut at, mut steps) = (0.0, [0, 0], Vec::new());
    for event in &events.0 {
        let (dx, dy) = event.step();
        if (dx, dy) != (0, 0) {
            at = [at[0] + dx, at[1] + dy];
            steps.push((time, at));
        }
        time += f64::from(event.ticks() << 4);
    }
    steps
}

/// A motion of up to 8,000 steps a second, which turns round and rests in between.
fn random_plan(random: &mut impl FnMut(u64) -> u64, moves_y: bool) -> Plan {
    let mut at = [0, 0];
    let mut plan = Plan::new();
    for _ in 0..60 {
        let time = RUN_TIME + random(3 * u64::from(RUN_TIME)) as u32;
        let most = u64::from(time / 50_000);
        let mut step = || (random(2 * most + 1) as i32 - most as i32) * i32::from(random(4) > 0);
        let by = [step(), if moves_y { step() } else { 0 }];
        at = [at[0] + by[0], at[1] + by[1]];
        plan.push((time, at));
    }
    plan
}

#[test]
fn the_steps_are_those_of_the_sum_of_delayed_copies() {
    for seed in 0..300 {
        let mut random = random(seed);
        let kind = [ShaperKind::Zv, ShaperKind::Zvd, ShaperKind::Ei][random(3) as usize];
        let mut hertz = || Millimetres::from_num(if random(6) == 0 { 0 } else { 9 + random(90) });
        let hertz = [hertz(), hertz()];
        let damping = Millimetres::from_num(0.1);
        let couples_axes = random(3) == 0;
        let resonance = Resonance { kind, hertz, damping };
        let shaping = Shaping::new(&resonance, couples_axes).expect("fits");
        let moves_y = random(3) > 0 || couples_axes;
        let plan = random_plan(&mut random, moves_y);
        let steps = shape(shaping, &plan);
        let end = steps.last().map_or([0, 0], |step| step.1);
        assert_eq!(end, plan[plan.len() - 1].1, "seed {seed}: no step is lost");
        let copies = shaping.weights_and_delays();
        let axis = |axis: usize, time: f64| -> f64 {
            let page = |time: f64| {
                let [a, b] = [0, 1].map(|motor| planned(&plan, motor, time));
                match (couples_axes, axis) {
                    (false, _) => [a, b][axis],
                    (true, 0) => (a + b) / 2.0,
                    (true, _) => (a - b) / 2.0,
                }
            };
            let copy = |&(weight, delay): &(f64, f64)| weight * page(time - delay * 4e8);
            copies[axis].iter().map(copy).sum()
        };
        for &(time, at) in &steps[..steps.len().saturating_sub(1)] {
            let [x, y] = [axis(0, time), axis(1, time)];
            let exact = if couples_axes { [x + y, x - y] } else { [x, y] };
            for (at, exact) in at.into_iter().zip(exact) {
                let off = (f64::from(at) - exact).abs();
                // The pins need some time for a change of direction.
                let most = if moves_y { 2.25 } else { 0.52 };
                assert!(off < most, "seed {seed}: {off} steps at {time}");
            }
        }
    }
}
