//! No step leaves faster than the machine can stop within the steps that wait.
//!
//! Should the planner be late, the queue runs dry at speed. So the step interrupt keeps each interval
//! above √(ℓ²/2as): s is what the steps that wait come to along the path, ℓ the length of one of
//! them. A queue that holds the stopping distance is not slowed at all; one that runs dry is a ramp
//! down to rest, on the path. When more comes, s grows by a step's length a step, which is a ramp up.
//! The squared speed is then the lesser of two functions of the place, the plan's and this one, and
//! neither changes faster than the acceleration allows.
//!
//! Lengths are counted in units of 2a·4^k ticks², with k such that the longest step is just below
//! 2^16 of them: then the interval is 2^k·ℓ/√s ticks, one product of 32 bits and a shift.

use super::limits::hypotenuse;
use super::{Limits, PathLength};
use core::sync::atomic::{AtomicU32, Ordering};

/// The root's interval is between two of these.
const INDEX_BITS: u32 = 6;
const ENTRIES: usize = (1 << INDEX_BITS) + 1;
/// 2^15/√x, x from 1 to 4, at every 16th; the numbers below 1 are not used.
const INVERSE_ROOTS: [u16; ENTRIES] = {
    let mut table = [0; ENTRIES];
    let mut index = ENTRIES / 4;
    while index < ENTRIES {
        // The root of 2^30/(index/16), times √1.
        table[index] = ((1u64 << 34) / index as u64).isqrt() as u16;
        index += 1;
    }
    table
};

/// Lengths below this many units count as this many: 0 would never move.
const LEAST_LENGTH: u32 = 64;
const GREATEST_LENGTH: u32 = (1 << 16) - 1;
const MAX_EXPONENT: u32 = 16;
const RECIPROCAL_BITS: u32 = 36;

/// The least ticks from one step to the next, both `length` units long, if the machine can be
/// brought to rest within `reach` units from the middle between them.
///
/// `length` is at least [`LEAST_LENGTH`] and below 2^16, `exponent` at most [`MAX_EXPONENT`].
#[inline(always)]
fn least_interval(length: u32, reach: u32, exponent: u32) -> u32 {
    // The machine stands half a step behind the last pulse.
    let reach = reach.max(length / 2);
    let zeros = reach.leading_zeros() & !1;
    // 1 to 4 in units of 2^-30.
    let scaled = reach << zeros;
    let index = (scaled >> (u32::BITS - INDEX_BITS)) as usize;
    let (here, next) = (u32::from(INVERSE_ROOTS[index]), u32::from(INVERSE_ROOTS[index + 1]));
    let part = (scaled >> 10) & 0xFFFF;
    let inverse_root = here - (((here - next) * part) >> 16);
    (length * inverse_root) >> (30 - zeros / 2 - exponent)
}

/// The unit of lengths, and from where on nothing is slowed. By default there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrakeRule {
    exponent: u32,
    /// Units in 2^-32 mm, in units of 2^-36.
    reciprocal: u64,
    top: u32,
}

impl BrakeRule {
    /// A step of so many 2^-32 mm, in units: even.
    pub fn step_length(self, length: u64) -> u32 {
        let units = length.saturating_mul(self.reciprocal) >> RECIPROCAL_BITS;
        (units as u32).clamp(LEAST_LENGTH, GREATEST_LENGTH) & !1
    }
}

/// What there is for steps to wait in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueSize {
    /// How many wait at least when it is full; 0 for no end.
    pub steps: u32,
    /// Steps a second up to which each of them can be looked at.
    pub greatest_rate: u32,
}

impl QueueSize {
    /// A queue without end.
    pub const ENDLESS: Self = Self { steps: 0, greatest_rate: u32::MAX };
}

impl Limits {
    /// The rule for a `queue` of steps that are at most `longer` times as long as a diagonal one, on a
    /// machine that is never faster than the stopping distance `fastest`.
    ///
    /// It brakes as hard as the machine accelerates, or harder if it must in order to stop within
    /// 13/16 of the queue. Both by 1/32, so that it never slows a plan that is in time.
    pub fn brake(&self, fastest: PathLength, longer: u64, queue: QueueSize) -> BrakeRule {
        if self.step_rate(self.speed(fastest)) > u64::from(queue.greatest_rate) {
            return BrakeRule::default();
        }
        let acceleration = u64::from(self.acceleration.to_bits());
        let fastest = u64::from(fastest.to_bits());
        // 2^-18 mm; below 2^20 steps of at most 1 mm.
        let held = (u64::from(self.least_move.to_bits()) * u64::from(queue.steps) / 16 * 13) >> 14;
        let harder = (acceleration * fastest).checked_div(held).unwrap_or(0);
        let braking = (acceleration + acceleration / 32).max(harder).clamp(1, u64::from(u32::MAX));
        let [x, y] = self.step_length.map(|step| u64::from(step.to_bits()));
        let longest_step = longer * hypotenuse(x, y);
        // The unit is 2^(2k-23) times the acceleration per slice.
        let too_long = |&k: &u32| (longest_step << 7) >> (2 * k) >= braking;
        let exponent = (0..MAX_EXPONENT).find(|k| !too_long(k)).unwrap_or(MAX_EXPONENT);
        let reciprocal = (1u64 << 59).checked_div(braking << (2 * exponent)).unwrap_or(1);
        // Below 2^46 units of 2^-32 mm: 16 m.
        let stop = (fastest * acceleration / braking) << 14;
        let top = (u128::from(stop) * u128::from(reciprocal)) >> RECIPROCAL_BITS;
        BrakeRule { exponent, reciprocal, top: top.min(1 << 30) as u32 }
    }
}

/// What the main loop tells the interrupt that takes the steps.
#[derive(Debug, Default)]
pub struct BrakeOrders {
    /// Units of all steps that were put into the queue; wraps.
    queued: AtomicU32,
    exponent: AtomicU32,
    /// Units in which any speed can be shed; 0 as long as there is no rule.
    top: AtomicU32,
}

impl BrakeOrders {
    /// No rule: nothing is slowed.
    pub const fn new() -> Self {
        Self { queued: AtomicU32::new(0), exponent: AtomicU32::new(0), top: AtomicU32::new(0) }
    }

    /// Only while no step waits.
    pub fn set_rule(&self, rule: BrakeRule) {
        self.exponent.store(rule.exponent, Ordering::Relaxed);
        self.top.store(rule.top, Ordering::Relaxed);
    }

    /// Whether there is a rule.
    #[inline]
    pub fn is_on(&self) -> bool {
        self.top.load(Ordering::Relaxed) != 0
    }

    /// Steps of so many units were put into the queue.
    #[inline]
    pub fn add(&self, units: u32) {
        let queued = self.queued.load(Ordering::Relaxed);
        self.queued.store(queued.wrapping_add(units), Ordering::Relaxed);
    }
}

/// A step of the queue, in units, all even.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StepWay {
    /// From the middle before it to the middle behind it: what it adds to the queue.
    pub around: u32,
    /// From its pulse to the next.
    pub behind: u32,
}

/// How long the steps of a queue are, in units.
#[derive(Debug, Default)]
pub struct StepLength {
    /// From the last step to the next.
    before: u32,
    /// From the next step to the one behind it.
    behind: u32,
    /// From there on.
    later: u32,
}

impl StepLength {
    /// The steps from the next one on are so long, or from the one behind it on: from the last step of
    /// the old length to the first of the new one it is half of both.
    #[inline]
    pub fn set(&mut self, units: u32, after_next: bool) {
        self.behind = if after_next { ((self.later + units) / 2) & !1 } else { units };
        self.later = units;
    }

    /// Of the steps told of last.
    #[inline]
    pub fn last(&self) -> u32 {
        self.later
    }

    /// The next step.
    #[inline(always)]
    pub fn step(&mut self) -> StepWay {
        let before = core::mem::replace(&mut self.before, self.behind);
        self.behind = self.later;
        StepWay { around: (before + self.before) / 2, behind: self.before }
    }
}

/// Where the queue's other end is. Of the interrupt.
#[derive(Debug, Default)]
pub struct Brake {
    /// Units of all steps taken; wraps.
    taken: u32,
    /// Units in which the machine could stop from the speed that it may have.
    reach: u32,
}

impl Brake {
    /// A step was taken. The least ticks from it to the next; 0 if any are enough.
    #[inline(always)]
    pub fn step(&mut self, step: StepWay, orders: &BrakeOrders) -> u32 {
        self.skip(step.around);
        let top = orders.top.load(Ordering::Relaxed);
        // From rest it takes a step to the middle behind the first pulse.
        let reach = if self.reach == 0 { step.behind } else { self.reach + step.around };
        self.reach = reach.min(self.waiting(orders)).min(top);
        if self.reach == top {
            return 0;
        }
        least_interval(step.behind, self.reach, orders.exponent.load(Ordering::Relaxed))
    }

    /// Takes some steps at once, `around` units in all, if they can go as planned: `longest` is the
    /// longest way behind one, `shortest` are the least ticks to the next.
    pub fn pass(&mut self, around: u32, longest: u32, shortest: u32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        let left = self.waiting(orders).saturating_sub(around);
        // In between it is further.
        let least = self.reach.min(left);
        let exponent = orders.exponent.load(Ordering::Relaxed);
        let is_calm = around == 0
            || least >= top
            || (least > 0 && least_interval(longest, least, exponent) <= shortest);
        if is_calm {
            self.skip(around);
            self.reach = (self.reach + around).min(left).min(top);
        }
        is_calm
    }

    /// Steps of so many units were thrown away.
    #[inline(always)]
    pub fn skip(&mut self, units: u32) {
        self.taken = self.taken.wrapping_add(units);
    }

    /// All steps were thrown away.
    pub fn skip_all(&mut self, orders: &BrakeOrders) {
        self.taken = orders.queued.load(Ordering::Relaxed);
        self.reach = 0;
    }

    /// Units of the steps that wait.
    #[inline(always)]
    fn waiting(&self, orders: &BrakeOrders) -> u32 {
        // Negative for a moment, between a step's way into the queue and its entry in the sum.
        let waiting = orders.queued.load(Ordering::Relaxed).wrapping_sub(self.taken);
        waiting.cast_signed().max(0).cast_unsigned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::tests::settings;
    use super::*;
    use crate::motion::TICKS_PER_SECOND;

    fn limits() -> Limits {
        Limits::new(&settings()).expect("valid")
    }

    fn queue(steps: u32) -> QueueSize {
        QueueSize { steps, ..QueueSize::ENDLESS }
    }

    /// 0.01 mm.
    const STEP: u64 = (1 << 32) / 100;

    #[test]
    fn an_interval_is_that_of_the_speed_that_can_be_shed() {
        let limits = limits();
        let rule = limits.brake(limits.top, 1, queue(0));
        let length = rule.step_length(STEP);
        for steps in 1..=300u32 {
            let ticks = least_interval(length, steps * length, rule.exponent);
            // 200 mm/s² and a 32nd more.
            let speed = (2.0 * 206.25 * 0.01 * f64::from(steps)).sqrt();
            let expected = 0.01 / speed * f64::from(TICKS_PER_SECOND);
            assert!(
                (f64::from(ticks) / expected - 1.0).abs() < 0.001,
                "{steps} {ticks} {expected}"
            );
        }
    }

    #[test]
    fn a_queue_too_short_to_stop_in_brakes_harder() {
        let limits = limits();
        // 100 mm/s: 25 mm, 2500 steps.
        let braking = |capacity| {
            let rule = limits.brake(limits.top, 1, queue(capacity));
            let length = rule.step_length(STEP);
            let slowest = least_interval(length, length, rule.exponent);
            let speed = 0.01 / f64::from(slowest) * f64::from(TICKS_PER_SECOND);
            speed * speed / 2.0 / 0.01
        };
        assert!((braking(0) - 206.25).abs() < 0.5);
        assert!((braking(5000) - 206.25).abs() < 0.5);
        // 10,000 mm²/s² over twice 812 steps.
        assert!((braking(1000) - 615.4).abs() < 1.0, "{}", braking(1000));
    }

    #[test]
    fn a_queue_that_is_too_fast_is_not_braked() {
        // 100 mm/s of 100 steps, but for rounding.
        let rule =
            |greatest_rate| limits().brake(limits().top, 1, QueueSize { steps: 0, greatest_rate });
        assert_eq!(rule(9_990), BrakeRule::default());
        assert_ne!(rule(10_000), BrakeRule::default());
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
            let rule = limits.brake(limits.top, 1, queue(600));
            let length = rule.step_length(step);
            let ticks = least_interval(length, length, rule.exponent);
            let mm = 1.0 / f64::from(steps_per_mm);
            let hardest = (100.0 / (2.0 * mm * 487.5)).max(f64::from(acceleration) * 33.0 / 32.0);
            let expected = (mm / 2.0 / hardest).sqrt() * f64::from(TICKS_PER_SECOND);
            assert!((f64::from(ticks) / expected - 1.0).abs() < 0.01, "{ticks} {expected}");
        }
    }

    #[test]
    fn a_queue_that_runs_dry_is_a_ramp_to_rest_and_one_that_fills_is_a_ramp_up() {
        let limits = limits();
        let rule = limits.brake(limits.top, 1, queue(0));
        let orders = BrakeOrders::new();
        let (mut brake, mut steps) = (Brake::default(), StepLength::default());
        let length = rule.step_length(STEP);
        steps.set(length, false);
        // The first is counted from the middle before it.
        orders.add(length / 2 + 100 * length);
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
}
