use super::super::limits::tests::settings;
use super::*;
use crate::motion::TICKS_PER_SECOND;

fn limits() -> Limits {
    Limits::new(&settings()).expect("valid")
}

/// 0.01 mm.
const STEP: u64 = (1 << 32) / 100;

#[test]
fn leading_zeros_are_counted_in_pairs() {
    for shift in 0..32 {
        for number in [1 << shift, u32::MAX >> shift] {
            let zeros = pairs_of_leading_zeros(number);
            assert_eq!(zeros, number.leading_zeros() & !1, "{number}");
        }
    }
}

#[test]
fn an_interval_is_that_of_the_speed_that_can_be_shed() {
    let limits = limits();
    let rule = limits.brake(1, u32::MAX);
    let length = rule.step_length(STEP);
    for steps in 1..=300u32 {
        let ticks = least_interval(length, steps * length, rule.exponent);
        // 200 mm/s² and a 32nd more.
        let speed = (2.0 * 206.25 * 0.01 * f64::from(steps)).sqrt();
        let expected = 0.01 / speed * f64::from(TICKS_PER_SECOND);
        assert!((f64::from(ticks) / expected - 1.0).abs() < 0.001, "{steps} {ticks} {expected}");
    }
}

#[test]
fn the_longest_and_the_shortest_steps_there_are_fit() {
    for (steps_per_mm, acceleration) in [(2, 10), (2, 32767), (4000, 10), (4000, 32767)] {
        let mut settings = settings();
        let value = crate::fixed::Millimetres::from_num;
        settings.steps_per_mm = [value(steps_per_mm); 2];
        settings.motor_steps_per_mm = value(steps_per_mm);
        settings.draw_mm_per_min = value(600);
        settings.travel_mm_per_min = value(600);
        settings.acceleration_mm_per_s2 = value(acceleration);
        let limits = Limits::new(&settings).expect("valid");
        let step = u64::from(limits.step_length[0].to_bits());
        let rule = limits.brake(1, u32::MAX);
        let length = rule.step_length(step);
        let ticks = least_interval(length, length, rule.exponent);
        let mm = 1.0 / f64::from(steps_per_mm);
        let braking = f64::from(acceleration) * 33.0 / 32.0;
        let expected = (mm / 2.0 / braking).sqrt() * f64::from(TICKS_PER_SECOND);
        assert!((f64::from(ticks) / expected - 1.0).abs() < 0.01, "{ticks} {expected}");
    }
}

#[test]
fn a_queue_that_runs_dry_is_a_ramp_to_rest_and_one_that_fills_is_a_ramp_up() {
    let limits = limits();
    let rule = limits.brake(1, u32::MAX);
    let orders = BrakeOrders::new();
    let (mut brake, mut steps) = (Brake::default(), StepLength::default());
    let length = rule.step_length(STEP);
    steps.set(length, false);
    orders.add(101 * length);
    assert_eq!(brake.step(steps.step(), &orders), 0, "no rule");
    orders.set_rule(rule);
    let squared_speed = |ticks: u32| 1.0 / f64::from(ticks).powi(2);
    let unit = squared_speed(least_interval(length, length, rule.exponent));
    let mut came = 0;
    for step in 1..=100 {
        let reach = squared_speed(brake.step(steps.step(), &orders)) / unit;
        let expected = f64::from(step).min(f64::from(100 - step)).max(0.5);
        assert!((reach / expected - 1.0).abs() < 0.003, "{step}: {reach}, not {expected}");
        came += 1;
    }
    assert_eq!(came, 100);
    orders.add(50 * length);
    let reach = squared_speed(brake.step(steps.step(), &orders)) / unit;
    assert!((reach - 1.0).abs() < 0.003, "{reach}");
}

/// The brake of an interrupt without time, and the same orders for [`Brake`].
struct Both {
    orders: [BrakeOrders; 2],
    in_pieces: StepBrake,
    whole: Brake,
    length: StepLength,
}

impl Both {
    fn new(rule: BrakeRule) -> Self {
        let orders = [BrakeOrders::new(), BrakeOrders::new()];
        orders.iter().for_each(|orders| orders.set_rule(rule));
        let (whole, length) = (Brake::new(), StepLength::new());
        Self { orders, in_pieces: StepBrake::new(), whole, length }
    }

    fn add(&self, units: u32) {
        self.orders.iter().for_each(|orders| orders.add(units));
    }

    fn tell(&mut self, units: u32, start: LengthStart) {
        self.in_pieces.tell(StepEvent::step_length(units, start));
        assert_eq!(self.in_pieces.work(&self.orders[0]), (false, 0));
        self.length.set_from(units, start);
    }

    /// A pulse of the first brake, and the least ticks behind it.
    fn pulse(&mut self) -> u32 {
        let orders = &self.orders[0];
        let (mut is_due, mut least) = (self.in_pieces.step(orders), 0);
        for _ in 0..4 {
            if is_due {
                (is_due, least) = self.in_pieces.work(orders);
            }
        }
        assert!(!is_due, "there is an end of the work");
        least
    }
}

#[test]
fn a_brake_that_works_in_pieces_slows_each_step_as_the_whole_one_does() {
    let rule = limits().brake(1, u32::MAX);
    let mut both = Both::new(rule);
    let length = rule.step_length(STEP);
    both.tell(length, LengthStart::Anew);
    both.add(400 * length);
    let mut slowed = 0;
    for step in 0..700 {
        match step {
            90 => both.tell((length / 2) & !1, LengthStart::Next),
            160 => both.tell(length, LengthStart::AfterNext),
            200 | 201 | 330 => {
                // A pulse that is none of a step.
                both.in_pieces.tell(StepEvent::skip_next());
                assert_eq!(both.in_pieces.work(&both.orders[0]), (false, 0));
                assert_eq!(both.pulse(), 0);
            }
            250..350 => both.add(2 * length),
            _ => {}
        }
        let whole = both.whole.step(both.length.step(), &both.orders[1]);
        assert_eq!(both.pulse(), whole, "{step}");
        let waiting = both.orders.each_ref().map(BrakeOrders::waiting);
        assert_eq!(waiting[0], waiting[1], "{step}");
        slowed += u32::from(whole > 0);
    }
    assert!(slowed > 200, "{slowed}");
}

#[test]
fn without_a_rule_a_brake_that_works_in_pieces_has_nothing_to_do() {
    let mut both = Both::new(BrakeRule::default());
    both.tell(64, LengthStart::Anew);
    for step in 0..100 {
        both.add(64);
        assert_eq!(both.pulse(), 0);
        assert!(step < 3 || !both.in_pieces.step(&both.orders[0]), "{step}");
        both.add(64);
    }
}

#[test]
fn steps_taken_at_once_leave_the_brake_as_steps_taken_one_by_one() {
    let rule = limits().brake(1, u32::MAX);
    let length = rule.step_length(STEP);
    let around = 4 * length;
    for evenly in [false, true] {
        let [at_once, singly] = [BrakeOrders::new(), BrakeOrders::new()];
        for orders in [&at_once, &singly] {
            orders.set_rule(rule);
            orders.add(900 * length);
        }
        let (mut some, mut one) = (Brake::new(), Brake::new());
        let step = StepDistances { around: length, behind: length };
        let mut taken_at_once = 0;
        for group in 0..220 {
            let least = if evenly {
                some.pass_evenly(around, length, &at_once)
            } else {
                some.pass(around, length, u32::MAX, &at_once).then_some(u32::MAX)
            };
            taken_at_once += u32::from(least.is_some());
            for _ in 0..4 {
                let ticks = one.step(step, &singly);
                match least {
                    Some(least) => assert!(ticks <= least, "{group}: {ticks} {least}"),
                    None => assert_eq!(some.step(step, &at_once), ticks, "{group}"),
                }
            }
            assert_eq!(some.reach, one.reach, "{group}");
            assert_eq!(at_once.waiting(), singly.waiting(), "{group}");
        }
        assert!(taken_at_once > 150, "{taken_at_once}");
        // Nothing waits then, and the next step is one from rest.
        some.skip_all(&at_once);
        assert_eq!(at_once.waiting(), 0);
        at_once.add(100 * length);
        let first = some.step(step, &at_once);
        assert_eq!(first, least_interval(length, length, rule.exponent));
    }
}

#[test]
fn steps_have_one_way_once_all_of_a_length_are_told() {
    let mut length = StepLength::new();
    length.set(64, false);
    assert_eq!(length.steady(), Some(StepDistances { around: 64, behind: 64 }));
    length.set(32, true);
    let mut steady = 0;
    for step in 0..5 {
        if let Some(way) = length.steady() {
            assert_eq!(length.step(), way);
            steady += 1;
        } else {
            assert!(step < 3, "{step}");
            length.step();
        }
    }
    assert!((2..5).contains(&steady), "{steady}");
}

#[test]
fn a_busy_planner_may_lack_the_steps_of_its_delay() {
    const QUEUE: u32 = 8192;
    for (steps_per_mm, mm_per_min) in [(300, 30_000), (600, 30_000), (800, 32_000)] {
        let mut settings = settings();
        let value = crate::fixed::Millimetres::from_num;
        settings.steps_per_mm = [value(steps_per_mm); 2];
        settings.motor_steps_per_mm = value(steps_per_mm);
        settings.draw_mm_per_min = value(mm_per_min);
        settings.travel_mm_per_min = value(mm_per_min);
        settings.acceleration_mm_per_s2 = value(5000);
        settings.pulse_ticks = 10;
        let limits = Limits::new(&settings).expect("valid");
        let speed = limits.draw_speed.to_num::<f64>() * f64::from(TICKS_PER_SECOND)
            / f64::from(crate::motion::SLICE_TICKS);
        let rate = f64::from(steps_per_mm) * speed;
        // 13/16 of the queue, less the steps of 2.5 ms above the rate; at least a quarter of
        // that.
        let late = (rate - 160_000.0).max(0.0) * 0.0025;
        let steps = (f64::from(QUEUE) * 13.0 / 16.0 - late).max(f64::from(QUEUE) * 13.0 / 64.0);
        let expected = speed * speed / 2.0 / (steps / f64::from(steps_per_mm));
        // From an acceleration in units of the settings'.
        let unit = 5000.0 / f64::from(limits.acceleration.to_bits());
        let braking = limits.least_braking(QUEUE) as f64 * unit;
        assert!((braking / expected - 1.0).abs() < 0.01, "{rate}: {braking} {expected}");
    }
}
