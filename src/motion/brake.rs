//! No step leaves faster than the machine can stop within the steps that wait.
//!
//! Should the planner be late, the queue runs dry at speed. So the step interrupt keeps each
//! interval above √(ℓ²/2as): s is what the steps that wait come to along the path, ℓ the length of
//! one of them. A queue that holds the stopping distance is not slowed at all; one that runs dry is
//! a ramp down to rest, on the path. When more comes, s grows by a step's length a step, which is a
//! ramp up. The squared speed is then the lesser of two functions of the place, the plan's and this
//! one, and neither changes faster than the acceleration allows. (It does not keep the jerk: it is
//! for what should not happen.)
//!
//! Lengths are counted in units of 2a·4^k ticks², with k such that the longest step is just below
//! 2^16 of them: then the interval is 2^k·ℓ/√s ticks, one product of 32 bits and a shift.

use super::limits::hypotenuse;
use super::{Limits, StepEvent};
use core::sync::atomic::{AtomicU32, Ordering};

/// The root's interval is between two of these.
const INDEX_BITS: u32 = 6;
const ENTRIES: usize = (1 << INDEX_BITS) + 1;
/// 2^15/√x, x from 1 to 4, at every 16th; the numbers below 1 are not used.
///
/// Nothing writes it. It is atomic on the Pico because the linker then places it in RAM, where the
/// step interrupt has to have everything that it reads: its flash may keep it waiting.
static INVERSE_ROOTS: [Entry; ENTRIES] = {
    let mut table = [const { entry(0) }; ENTRIES];
    let mut index = ENTRIES / 4;
    while index < ENTRIES {
        // The root of 2^30/(index/16), times √1.
        table[index] = entry(((1u64 << 34) / index as u64).isqrt() as u16);
        index += 1;
    }
    table
};

#[cfg(feature = "pico")]
type Entry = core::sync::atomic::AtomicU16;

#[cfg(feature = "pico")]
const fn entry(value: u16) -> Entry {
    Entry::new(value)
}

#[cfg(feature = "pico")]
#[inline(always)]
fn inverse_root(index: usize) -> u32 {
    u32::from(INVERSE_ROOTS[index].load(Ordering::Relaxed))
}

#[cfg(not(feature = "pico"))]
type Entry = u16;

#[cfg(not(feature = "pico"))]
const fn entry(value: u16) -> Entry {
    value
}

#[cfg(not(feature = "pico"))]
#[inline(always)]
fn inverse_root(index: usize) -> u32 {
    u32::from(INVERSE_ROOTS[index])
}

/// How many of the upper bits are 0, one less if they are odd in number.
#[inline(always)]
fn pairs_of_leading_zeros(number: u32) -> u32 {
    // A Cortex-M0+ has no instruction for it, and the compiler's function lies in the flash that
    // the step interrupt must not wait for. The others have one, which is shorter.
    if cfg!(any(feature = "pico", test)) {
        let (mut number, mut zeros) = (number, 0);
        for bits in [16, 8, 4, 2] {
            if number >> (u32::BITS - bits) == 0 {
                number <<= bits;
                zeros += bits;
            }
        }
        zeros
    } else {
        number.leading_zeros() & !1
    }
}

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
    let zeros = pairs_of_leading_zeros(reach);
    // 1 to 4 in units of 2^-30.
    let scaled = reach << zeros;
    let index = (scaled >> (u32::BITS - INDEX_BITS)) as usize;
    let (here, next) = (inverse_root(index), inverse_root(index + 1));
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

/// Up to so many steps a second, the planner keeps the queue full beside its other work.
const BUSY_RATE: u64 = 160_000;

/// For each so many steps a second above that rate, the queue may lack a step without slowing the
/// machine: it may be filled 2.5 ms later.
const LATE_RATE: u64 = 400;

/// The LM3S6965 does not make so many.
const MAY_BE_BUSY: bool = cfg!(not(feature = "lm3s6965"));

impl Limits {
    /// The least braking, as an acceleration per slice, that sheds the greatest speed within the
    /// steps of a `queue` that a busy planner keeps full. The speeds are such that the machine
    /// stops within 13/16 of all.
    fn least_braking(&self, queue: u32) -> u64 {
        let rate = self.step_rate(self.draw_speed.max(self.travel_speed));
        let late = rate.saturating_sub(BUSY_RATE) / LATE_RATE;
        let queue = u64::from(queue);
        let steps = (queue / 16 * 13).saturating_sub(late).max(queue / 64 * 13);
        let held = (u64::from(self.least_move.to_bits()) * steps) >> 14;
        let speed = u64::from(self.acceleration.to_bits()) * u64::from(self.top.to_bits());
        speed.checked_div(held).unwrap_or(0)
    }

    /// The rule for a `queue` of steps that are at most `longer` times as long as a diagonal one.
    ///
    /// It brakes as hard as the machine accelerates, and by 1/32 harder, so that it never slows a
    /// plan that is in time. Only above `BUSY_RATE` it may brake harder still, up to four times
    /// as hard.
    pub fn brake(&self, longer: u64, queue: u32) -> BrakeRule {
        let acceleration = u64::from(self.acceleration.to_bits());
        let harder = if MAY_BE_BUSY { self.least_braking(queue) } else { 0 };
        let braking = (acceleration + acceleration / 32).max(harder).clamp(1, u64::from(u32::MAX));
        let [x, y] = self.step_length.map(|step| u64::from(step.to_bits()));
        let longest_step = longer * hypotenuse(x, y);
        // The unit is 2^(2k-23) times the acceleration per slice.
        let too_long = |&k: &u32| (longest_step << 7) >> (2 * k) >= braking;
        let exponent = (0..MAX_EXPONENT).find(|k| !too_long(k)).unwrap_or(MAX_EXPONENT);
        let reciprocal = (1u64 << 59).checked_div(braking << (2 * exponent)).unwrap_or(1);
        // Below 2^46 units of 2^-32 mm: 16 m.
        let top = u64::from(self.top.to_bits()) * acceleration;
        let stop = top.checked_div(braking).unwrap_or(0) << 14;
        let top = (u128::from(stop) * u128::from(reciprocal)) >> RECIPROCAL_BITS;
        BrakeRule { exponent, reciprocal, top: top.min(1 << 30) as u32 }
    }
}

/// What the main loop tells the interrupt that takes the steps.
#[derive(Debug, Default)]
pub struct BrakeOrders {
    /// Units of all steps that were put into the queue; wraps.
    queued: AtomicU32,
    /// Units of all steps that were taken from it, or thrown away; wraps. Of the interrupt.
    taken: AtomicU32,
    exponent: AtomicU32,
    /// Units in which any speed can be shed; 0 as long as there is no rule.
    top: AtomicU32,
}

impl BrakeOrders {
    /// No rule: nothing is slowed.
    pub const fn new() -> Self {
        Self {
            queued: AtomicU32::new(0),
            taken: AtomicU32::new(0),
            exponent: AtomicU32::new(0),
            top: AtomicU32::new(0),
        }
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

    /// Units of all steps that were put into the queue; wraps.
    #[inline]
    pub fn queued(&self) -> u32 {
        self.queued.load(Ordering::Relaxed)
    }

    /// So many are in it now.
    #[inline]
    pub fn set_queued(&self, units: u32) {
        self.queued.store(units, Ordering::Relaxed);
    }

    /// All that waited was thrown away. For the main loop, while the interrupt takes nothing.
    pub fn forget(&self) {
        self.queued.store(self.taken.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// Steps of so many units were taken. For the interrupt.
    #[inline(always)]
    pub(super) fn take(&self, units: u32) {
        let taken = self.taken.load(Ordering::Relaxed);
        self.taken.store(taken.wrapping_add(units), Ordering::Relaxed);
    }

    /// Units of the steps that wait. Negative for a moment, between a step's way into the queue and
    /// its entry in the sum.
    #[inline(always)]
    pub(super) fn waiting(&self) -> i32 {
        let queued = self.queued.load(Ordering::Relaxed);
        queued.wrapping_sub(self.taken.load(Ordering::Relaxed)).cast_signed()
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
    /// As before anything was told.
    pub const fn new() -> Self {
        Self { before: 0, behind: 0, later: 0 }
    }

    /// The steps from the next one on are so long, or from the one behind it on: from the last step
    /// of the old length to the first of the new one it is half of both. The first of all lengths
    /// is that of the step before, too.
    #[inline]
    pub fn set(&mut self, units: u32, after_next: bool) {
        self.set_from(units, self.start(after_next));
    }

    /// Where a new length begins.
    pub(crate) fn start(&self, after_next: bool) -> LengthStart {
        match (self.later, after_next) {
            (0, _) => LengthStart::Anew,
            (_, false) => LengthStart::Next,
            (_, true) => LengthStart::AfterNext,
        }
    }

    pub(crate) fn set_from(&mut self, units: u32, start: LengthStart) {
        self.behind = units;
        match start {
            LengthStart::Next => {}
            LengthStart::AfterNext => self.behind = ((self.later + units) / 2) & !1,
            LengthStart::Anew => self.before = units,
        }
        self.later = units;
    }

    /// Of the steps told of last; 0 if none were.
    #[inline]
    pub fn last(&self) -> u32 {
        self.later
    }

    /// The way of each step to come, if it is the same.
    pub fn steady(&self) -> Option<StepWay> {
        let StepLength { before, behind, later } = *self;
        (before == behind && behind == later).then_some(StepWay { around: later, behind: later })
    }

    /// The next step.
    #[inline(always)]
    pub fn step(&mut self) -> StepWay {
        let before = core::mem::replace(&mut self.before, self.behind);
        self.behind = self.later;
        StepWay { around: (before + self.before) / 2, behind: self.before }
    }
}

/// From where on steps have another length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LengthStart {
    /// From the next one.
    Next,
    /// From the one behind it.
    AfterNext,
    /// From the next one, and nothing is known of those before.
    Anew,
}

/// Where the queue's other end is. Of the interrupt.
#[derive(Debug, Default)]
pub struct Brake {
    /// Units in which the machine could stop from the speed that it may have.
    reach: u32,
}

impl Brake {
    /// As at rest.
    pub const fn new() -> Self {
        Self { reach: 0 }
    }

    /// A step was taken. The least ticks from it to the next; 0 if any are enough.
    #[inline(always)]
    pub fn step(&mut self, step: StepWay, orders: &BrakeOrders) -> u32 {
        orders.take(step.around);
        if self.move_on(step, orders.waiting(), orders) {
            return 0;
        }
        self.least_ticks(step, orders)
    }

    /// Past a step that has been counted. Whether the machine can stop from any speed.
    #[inline(always)]
    fn move_on(&mut self, step: StepWay, waiting: i32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        // From rest it takes a step to the middle behind the first pulse.
        let reach = if self.reach == 0 { step.behind } else { self.reach + step.around };
        self.reach = reach.min(waiting.max(0).cast_unsigned()).min(top);
        self.reach == top
    }

    #[inline(always)]
    fn least_ticks(&self, step: StepWay, orders: &BrakeOrders) -> u32 {
        least_interval(step.behind, self.reach, orders.exponent.load(Ordering::Relaxed))
    }

    /// Takes some steps at once, `around` units in all, if they can go as planned: `longest` is the
    /// longest way behind one, `shortest` are the least ticks to the next.
    #[inline(always)] // Where the interrupt that asks for it lies.
    pub fn pass(&mut self, around: u32, longest: u32, shortest: u32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        let left = orders.waiting().max(0).cast_unsigned().saturating_sub(around);
        // In between it is further.
        let least = self.reach.min(left);
        let exponent = orders.exponent.load(Ordering::Relaxed);
        let is_calm = around == 0
            || least >= top
            || (least > 0 && least_interval(longest, least, exponent) <= shortest);
        if is_calm {
            orders.take(around);
            self.reach = (self.reach + around).min(left).min(top);
        }
        is_calm
    }

    /// Takes some steps at once, `around` units in all, and none with fewer ticks to the next than
    /// it says. `None` and nothing taken near rest, where speed changes more from step to step:
    /// within 64 steps of the `longest` way.
    #[inline(always)] // Where the interrupt that asks for it lies.
    pub fn pass_evenly(&mut self, around: u32, longest: u32, orders: &BrakeOrders) -> Option<u32> {
        let top = orders.top.load(Ordering::Relaxed);
        let left = orders.waiting().max(0).cast_unsigned().saturating_sub(around);
        let least = self.reach.min(left).min(top);
        if least < 64 * longest {
            return None;
        }
        orders.take(around);
        self.reach = (self.reach + around).min(left).min(top);
        Some(least_interval(longest, least, orders.exponent.load(Ordering::Relaxed)))
    }

    /// Takes all steps at once that come before `queued` was the sum, if enough waits behind them.
    #[inline(always)] // As above.
    pub fn pass_far(&mut self, queued: u32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        let is_far = self.reach == top && orders.queued().wrapping_sub(queued) >= top;
        if is_far {
            orders.taken.store(queued, Ordering::Relaxed);
        }
        is_far
    }

    /// All steps were thrown away.
    pub fn skip_all(&mut self, orders: &BrakeOrders) {
        orders.forget();
        self.reach = 0;
    }
}

/// The brake of an interrupt that comes at each step and has no time to look closely at each: the
/// little that always has to be done is [`StepBrake::step`], and the rest comes in pieces.
#[derive(Debug, Default)]
pub struct StepBrake {
    /// With no more units waiting than these, a step must be looked at.
    calm_above: i32,
    /// What has to be done: see below; 0 for nothing.
    todo: u8,
    /// Of the present step, and of each to come unless something is to be done.
    way: StepWay,
    brake: Brake,
    length: StepLength,
    /// The word that tells another length.
    told: u32,
}

/// Steps to come until all have the same way.
const CHANGES: u8 = 3;
/// It was told that a pulse is none of a step, which is to come.
const AHEAD: u8 = 1 << 3;
/// A length was told.
const TOLD: u8 = 1 << 5;
/// It may be too soon for the next step.
const LOOK: u8 = 1 << 6;
/// The next pulse is none of a step.
const SKIP: u8 = 1 << 7;

impl StepBrake {
    /// As at rest, nothing told.
    pub const fn new() -> Self {
        Self {
            calm_above: i32::MAX,
            todo: 0,
            way: StepWay { around: 0, behind: 0 },
            brake: Brake::new(),
            length: StepLength::new(),
            told: 0,
        }
    }

    /// The machine rests. The next step will be looked at.
    pub fn rest(&mut self) {
        self.calm_above = i32::MAX;
    }

    /// All steps were thrown away, and the machine stands.
    pub fn stop(&mut self) {
        self.brake.reach = 0;
        self.rest();
    }

    /// Takes a word that is no event. [`StepBrake::work`] must be called before the next event.
    #[inline(always)]
    pub(crate) fn tell(&mut self, word: StepEvent) {
        if word.skips_next() {
            self.todo |= SKIP | AHEAD;
        } else {
            self.told = word.to_bits();
            self.todo = TOLD;
        }
    }

    /// The pulse of a step is over. Whether [`StepBrake::work`] must be called, soon.
    #[inline(always)]
    pub fn step(&mut self, orders: &BrakeOrders) -> bool {
        self.todo != 0 || self.take(orders)
    }

    #[inline(always)]
    fn take(&mut self, orders: &BrakeOrders) -> bool {
        orders.take(self.way.around);
        let waiting = orders.waiting();
        if waiting > self.calm_above {
            return false;
        }
        let is_calm = self.brake.move_on(self.way, waiting, orders);
        self.calm_above = i32::MAX;
        if is_calm {
            // Without a rule nothing waits, and nothing is looked at again.
            self.calm_above = orders.top.load(Ordering::Relaxed).cast_signed() - 1;
        } else {
            self.todo |= LOOK;
        }
        !is_calm
    }

    /// Does a piece of what has to be done. Whether there is more of it, and the least ticks from
    /// the last step to the next, as far as is known.
    #[inline(always)]
    pub fn work(&mut self, orders: &BrakeOrders) -> (bool, u32) {
        let todo = self.todo;
        if todo & LOOK != 0 {
            self.todo = todo & !LOOK;
            return (false, self.brake.least_ticks(self.way, orders));
        }
        (self.prepare(todo, orders), 0)
    }

    #[inline(never)]
    fn prepare(&mut self, todo: u8, orders: &BrakeOrders) -> bool {
        if todo & SKIP != 0 {
            self.todo = todo & !(if todo & AHEAD != 0 { AHEAD } else { SKIP });
            return false;
        }
        if todo & TOLD != 0 {
            let (units, start) = StepEvent::from_bits(self.told).told_length();
            self.length.set_from(units, start);
            self.todo = CHANGES;
            return false;
        }
        self.way = self.length.step();
        self.todo = todo.saturating_sub(1);
        self.take(orders)
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
            assert!(
                (f64::from(ticks) / expected - 1.0).abs() < 0.001,
                "{steps} {ticks} {expected}"
            );
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
            let step = StepWay { around: length, behind: length };
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
        assert_eq!(length.steady(), Some(StepWay { around: 64, behind: 64 }));
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
}
