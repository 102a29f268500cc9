//! The brake: a rule by which no step leaves faster than the machine can stop within the steps that
//! wait.
//!
//! If the planner is late, the queue runs empty while the machine moves. Therefore the step
//! interrupt keeps each interval above √(ℓ²/2as), where s is the length of the waiting steps along
//! the path, and ℓ is the length of one of them. A queue that contains the stopping distance is not
//! slowed at all, and one that runs empty becomes a ramp down to rest, on the path. When more steps
//! come, s grows by a step's length with each step, which is a ramp up. The squared speed is then
//! the lesser of two functions of the position: that of the plan and this one. Neither changes
//! faster than the acceleration allows. (The brake does not limit the jerk, because it is meant for
//! an exception.)
//!
//! Lengths are counted in units of 2a·4^k ticks², with k such that the longest step is just below
//! 2^16 units. Then the interval is 2^k·ℓ/√s ticks, which takes a product of 32 bits and a shift.
//!
//! The file is longer than 500 lines, because both sides of the rule are here: what the planner
//! says of each step, and what the interrupt does with it. One cannot be understood without the
//! other.

use super::limits::hypotenuse;
use super::{Limits, StepEvent};
use core::sync::atomic::{AtomicU32, Ordering};

/// The number of bits of an index into [`INVERSE_ROOTS`]. Between two entries the function is
/// interpolated.
const INDEX_BITS: u32 = 6;
const ENTRIES: usize = (1 << INDEX_BITS) + 1;
/// 2^15/√x for x from 1 to 4, in steps of 1/16. The entries below 1 are not used.
///
/// Nothing writes to the table. On the Pico it is atomic, because the linker then places it in RAM.
/// There the step interrupt needs everything that it reads, because it must not wait for the flash.
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

/// Returns the number of leading zeros of `number`, rounded down to an even number.
#[inline(always)]
fn pairs_of_leading_zeros(number: u32) -> u32 {
    // A Cortex-M0+ has no instruction for this, and the compiler's function lies in flash, for
    // which the step interrupt must not wait. The other cores have an instruction, which is
    // shorter.
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

/// Shorter lengths count as this many units. With a length of 0 the machine would never move.
const LEAST_LENGTH: u32 = 64;
const GREATEST_LENGTH: u32 = (1 << 16) - 1;
const MAX_EXPONENT: u32 = 16;
const RECIPROCAL_BITS: u32 = 36;

/// Returns the least ticks between two steps, both `length` units long, such that from the middle
/// between them the machine can come to rest within `reach` units.
///
/// `length` is at least [`LEAST_LENGTH`] and below 2^16, and `exponent` is at most
/// [`MAX_EXPONENT`].
#[inline(always)]
fn least_interval(length: u32, reach: u32, exponent: u32) -> u32 {
    // The machine comes to rest half a step after the last pulse.
    let reach = reach.max(length / 2);
    let zeros = pairs_of_leading_zeros(reach);
    // This is 1 to 4 in units of 2^-30.
    let scaled = reach << zeros;
    let index = (scaled >> (u32::BITS - INDEX_BITS)) as usize;
    let (here, next) = (inverse_root(index), inverse_root(index + 1));
    let part = (scaled >> 10) & 0xFFFF;
    let inverse_root = here - (((here - next) * part) >> 16);
    (length * inverse_root) >> (30 - zeros / 2 - exponent)
}

/// The unit in which lengths are counted, and the length from which on nothing is slowed. By
/// default there is no brake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BrakeRule {
    /// The number k of the unit of length, which is 2a·4^k ticks².
    exponent: u32,
    /// The number of units in 2^-32 mm, as a multiple of 2^-36.
    reciprocal: u64,
    /// The number of units within which any speed can be shed; 0 without a brake.
    top: u32,
}

impl BrakeRule {
    /// Converts the length of a step from 2^-32 mm to units. The result is even.
    #[cfg_attr(feature = "lm3s6965", inline(never))] // Its 64-bit product is long.
    pub fn step_length(self, length: u64) -> u32 {
        let units = length.saturating_mul(self.reciprocal) >> RECIPROCAL_BITS;
        (units as u32).clamp(LEAST_LENGTH, GREATEST_LENGTH) & !1
    }
}

/// Up to this number of steps a second, the planner keeps the queue full beside its other work.
const BUSY_RATE: u64 = 160_000;

/// For each of this many steps a second above [`BUSY_RATE`], the queue may lack one step without
/// slowing the machine. So it may be filled 2.5 ms later.
const LATE_RATE: u64 = 400;

/// Whether the board can exceed [`BUSY_RATE`]; the LM3S6965 cannot.
const MAY_BE_BUSY: bool = cfg!(not(feature = "lm3s6965"));

impl Limits {
    /// Returns the least deceleration, per slice, that sheds the greatest speed within the steps of
    /// a `queue` that a busy planner keeps full. The settings guarantee that the machine stops
    /// within 13/16 of a full queue.
    fn least_braking(&self, queue: u32) -> u64 {
        let rate = self.step_rate(self.draw_speed.max(self.travel_speed));
        let late = rate.saturating_sub(BUSY_RATE) / LATE_RATE;
        let queue = u64::from(queue);
        let steps = (queue / 16 * 13).saturating_sub(late).max(queue / 64 * 13);
        let held = (u64::from(self.least_move.to_bits()) * steps) >> 14;
        let speed = u64::from(self.acceleration.to_bits()) * u64::from(self.top.to_bits());
        speed.checked_div(held).unwrap_or(0)
    }

    /// Returns the rule for a `queue` of steps that are at most `longer` times as long as a
    /// diagonal one.
    ///
    /// The brake decelerates by 1/32 more than the machine accelerates, so that it never slows a
    /// plan that is in time. Only above `BUSY_RATE` it may decelerate more, up to four times as
    /// much, and at half as much again where motion is shaped: where the copies of both axes
    /// accelerate at different times, each axis keeps the acceleration, but both together may have
    /// √2 times as much.
    pub fn brake(&self, longer: u64, queue: u32) -> BrakeRule {
        let acceleration = u64::from(self.acceleration.to_bits());
        let harder = if MAY_BE_BUSY { self.least_braking(queue) } else { 0 };
        #[cfg(feature = "input-shaping")]
        let harder = if self.shaping.is_some() { harder.max(acceleration * 3 / 2) } else { harder };
        let braking = (acceleration + acceleration / 32).max(harder).clamp(1, u64::from(u32::MAX));
        let [x, y] = self.step_length.map(|step| u64::from(step.to_bits()));
        let longest_step = longer * hypotenuse(x, y);
        // The unit of length is 2^(2k-23) times the acceleration per slice.
        let too_long = |&k: &u32| (longest_step << 7) >> (2 * k) >= braking;
        let exponent = (0..MAX_EXPONENT).find(|k| !too_long(k)).unwrap_or(MAX_EXPONENT);
        let reciprocal = (1u64 << 59).checked_div(braking << (2 * exponent)).unwrap_or(1);
        // This is below 2^46 units of 2^-32 mm, which are 16 m.
        let top = u64::from(self.top.to_bits()) * acceleration;
        let stop = top.checked_div(braking).unwrap_or(0) << 14;
        let top = (u128::from(stop) * u128::from(reciprocal)) >> RECIPROCAL_BITS;
        BrakeRule { exponent, reciprocal, top: top.min(1 << 30) as u32 }
    }
}

/// What the main loop and the step interrupt share about the brake.
#[derive(Debug, Default)]
pub struct BrakeOrders {
    /// The length of all steps that were put into the queue, in units; wraps.
    queued: AtomicU32,
    /// The length of all steps that were taken from the queue or discarded, in units; wraps. The
    /// interrupt writes it.
    taken: AtomicU32,
    /// [`BrakeRule::exponent`].
    exponent: AtomicU32,
    /// [`BrakeRule::top`]: the units within which any speed can be shed; 0 without a rule.
    top: AtomicU32,
}

impl BrakeOrders {
    /// Without a rule, so that nothing is slowed.
    pub const fn new() -> Self {
        Self {
            queued: AtomicU32::new(0),
            taken: AtomicU32::new(0),
            exponent: AtomicU32::new(0),
            top: AtomicU32::new(0),
        }
    }

    /// Sets the rule. No step may wait.
    pub fn set_rule(&self, rule: BrakeRule) {
        self.exponent.store(rule.exponent, Ordering::Relaxed);
        self.top.store(rule.top, Ordering::Relaxed);
    }

    /// Whether there is a rule.
    #[inline]
    pub fn is_on(&self) -> bool {
        self.top.load(Ordering::Relaxed) != 0
    }

    /// Counts steps of `units` in all that were put into the queue.
    #[inline]
    pub fn add(&self, units: u32) {
        let queued = self.queued.load(Ordering::Relaxed);
        self.queued.store(queued.wrapping_add(units), Ordering::Relaxed);
    }

    /// The length of all steps that were put into the queue, in units; wraps.
    #[inline]
    pub fn queued(&self) -> u32 {
        self.queued.load(Ordering::Relaxed)
    }

    /// Sets the length of all steps that were put into the queue, in units.
    #[inline]
    pub fn set_queued(&self, units: u32) {
        self.queued.store(units, Ordering::Relaxed);
    }

    /// Records that all waiting steps were discarded. Only the main loop calls it, while the
    /// interrupt takes nothing.
    pub fn forget(&self) {
        self.queued.store(self.taken.load(Ordering::Relaxed), Ordering::Relaxed);
    }

    /// Counts steps of `units` in all that were taken. Only the interrupt calls it.
    #[inline(always)]
    pub(super) fn take(&self, units: u32) {
        let taken = self.taken.load(Ordering::Relaxed);
        self.taken.store(taken.wrapping_add(units), Ordering::Relaxed);
    }

    /// The length of the steps that wait, in units. It is negative for a moment, when a step is
    /// already in the queue but not yet in the sum.
    #[inline(always)]
    pub(super) fn waiting(&self) -> i32 {
        let queued = self.queued.load(Ordering::Relaxed);
        queued.wrapping_sub(self.taken.load(Ordering::Relaxed)).cast_signed()
    }
}

/// The distances around a step of the queue, in units. Both are even.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StepDistances {
    /// From the middle before the step to the middle after it, which is what the step contributes
    /// to the length of the queue.
    pub around: u32,
    /// From the pulse of the step to the next pulse.
    pub behind: u32,
}

/// The lengths of the next steps of a queue, in units.
#[derive(Debug, Default)]
pub struct StepLength {
    /// The distance from the last step to the next one.
    before: u32,
    /// The distance from the next step to the one after it.
    behind: u32,
    /// The distance between all later steps.
    later: u32,
}

impl StepLength {
    /// No length is known yet.
    pub const fn new() -> Self {
        Self { before: 0, behind: 0, later: 0 }
    }

    /// Sets the length of the steps from the next one on, or from the one after it on
    /// (`after_next`). The distance between the last step of the old length and the first of the
    /// new one is the mean of both. The first length that is ever set is also that of the step
    /// before.
    #[inline]
    pub fn set(&mut self, units: u32, after_next: bool) {
        self.set_from(units, self.start(after_next));
    }

    /// Returns from where on a new length applies.
    pub(crate) fn start(&self, after_next: bool) -> LengthStart {
        match (self.later, after_next) {
            (0, _) => LengthStart::Anew,
            (_, false) => LengthStart::Next,
            (_, true) => LengthStart::AfterNext,
        }
    }

    /// Sets the length of the steps from `start` on.
    pub(crate) fn set_from(&mut self, units: u32, start: LengthStart) {
        self.behind = units;
        match start {
            LengthStart::Next => {}
            LengthStart::AfterNext => self.behind = ((self.later + units) / 2) & !1,
            LengthStart::Anew => self.before = units,
        }
        self.later = units;
    }

    /// The length that was set last; 0 if none was.
    #[inline]
    pub fn last(&self) -> u32 {
        self.later
    }

    /// The distances of each step to come, if they are all the same.
    pub fn steady(&self) -> Option<StepDistances> {
        let StepLength { before, behind, later } = *self;
        (before == behind && behind == later)
            .then_some(StepDistances { around: later, behind: later })
    }

    /// Returns the distances of the next step, and moves on to the one after it.
    #[inline(always)]
    pub fn step(&mut self) -> StepDistances {
        let before = core::mem::replace(&mut self.before, self.behind);
        self.behind = self.later;
        StepDistances { around: (before + self.before) / 2, behind: self.before }
    }
}

/// The first step to which a new length applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LengthStart {
    /// The next step.
    Next,
    /// The step after the next one.
    AfterNext,
    /// The next step, and no length was known before.
    Anew,
}

/// The state of the brake in the step interrupt.
#[derive(Debug, Default)]
pub struct Brake {
    /// The units within which the machine can stop from the speed that it may have.
    reach: u32,
}

impl Brake {
    /// The machine is at rest.
    pub const fn new() -> Self {
        Self { reach: 0 }
    }

    /// Counts a step that was taken. Returns the least ticks from it to the next one; 0 if it need
    /// not be slowed.
    #[inline(always)]
    pub fn step(&mut self, step: StepDistances, orders: &BrakeOrders) -> u32 {
        orders.take(step.around);
        if self.move_on(step, orders.waiting(), orders) {
            return 0;
        }
        self.least_ticks(step, orders)
    }

    /// Moves past a step that has been counted. Returns whether the machine can stop from any
    /// speed.
    #[inline(always)]
    fn move_on(&mut self, step: StepDistances, waiting: i32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        // From rest, the first pulse leads to the middle after it.
        let reach = if self.reach == 0 { step.behind } else { self.reach + step.around };
        self.reach = reach.min(waiting.max(0).cast_unsigned()).min(top);
        self.reach == top
    }

    #[inline(always)]
    fn least_ticks(&self, step: StepDistances, orders: &BrakeOrders) -> u32 {
        least_interval(step.behind, self.reach, orders.exponent.load(Ordering::Relaxed))
    }

    /// Takes several steps at once, `around` units in all, if none of them has to be slowed.
    /// `longest` is the greatest distance from one of them to the next, and `shortest` the fewest
    /// ticks. Returns whether they were taken.
    #[inline(always)] // Where the interrupt that asks for it lies.
    pub fn pass(&mut self, around: u32, longest: u32, shortest: u32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        let left = orders.waiting().max(0).cast_unsigned().saturating_sub(around);
        // Between these two states the reach is greater.
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

    /// Takes several steps at once, `around` units in all, and returns the least ticks from any of
    /// them to the next. Near rest, within 64 times the `longest` distance, the speed changes too
    /// much from step to step; there it returns `None` and takes nothing.
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

    /// Takes all steps at once that were put into the queue up to the sum `queued`, if enough steps
    /// wait after them. Returns whether it took them.
    #[inline(always)] // Where the interrupt that asks for it lies.
    pub fn pass_far(&mut self, queued: u32, orders: &BrakeOrders) -> bool {
        let top = orders.top.load(Ordering::Relaxed);
        let is_far = self.reach == top && orders.queued().wrapping_sub(queued) >= top;
        if is_far {
            orders.taken.store(queued, Ordering::Relaxed);
        }
        is_far
    }

    /// Records that all waiting steps were discarded.
    pub fn skip_all(&mut self, orders: &BrakeOrders) {
        orders.forget();
        self.reach = 0;
    }
}

/// The brake of an interrupt that comes with each step and has little time for it. What every step
/// needs is done by [`StepBrake::step`], and the rest is done in pieces by [`StepBrake::work`].
#[derive(Debug, Default)]
pub struct StepBrake {
    /// A step must be examined if no more than this many units wait.
    calm_above: i32,
    /// The work that has to be done, as the bits below; 0 for none.
    todo: u8,
    /// The distances of the current step, and of all steps to come if no work has to be done.
    distances: StepDistances,
    brake: Brake,
    length: StepLength,
    /// The last word that told a length.
    told: u32,
}

/// The number of steps after a change of length until all steps have the same distances. The lowest
/// bits of the work count them down.
const CHANGES: u8 = 3;
/// A word has told that a pulse is no step along the path, and this pulse is still to come.
const AHEAD: u8 = 1 << 3;
/// A word has told a new length.
const TOLD: u8 = 1 << 5;
/// The next step may have to be delayed.
const LOOK: u8 = 1 << 6;
/// The next pulse is no step along the path.
const SKIP: u8 = 1 << 7;

impl StepBrake {
    /// The machine is at rest, and no length is known.
    pub const fn new() -> Self {
        Self {
            calm_above: i32::MAX,
            todo: 0,
            distances: StepDistances { around: 0, behind: 0 },
            brake: Brake::new(),
            length: StepLength::new(),
            told: 0,
        }
    }

    /// Records that the machine is at rest, so that the next step is examined.
    pub fn rest(&mut self) {
        self.calm_above = i32::MAX;
    }

    /// Records that all waiting steps were discarded and the machine is at rest.
    pub fn stop(&mut self) {
        self.brake.reach = 0;
        self.rest();
    }

    /// Takes a word that is no event. Before the next event, [`StepBrake::work`] must be called.
    #[inline(always)]
    pub(crate) fn tell(&mut self, word: StepEvent) {
        if word.skips_next() {
            self.todo |= SKIP | AHEAD;
        } else {
            self.told = word.to_bits();
            self.todo = TOLD;
        }
    }

    /// Called at the end of the pulse of a step. Returns whether [`StepBrake::work`] must be called
    /// soon.
    #[inline(always)]
    pub fn step(&mut self, orders: &BrakeOrders) -> bool {
        self.todo != 0 || self.take(orders)
    }

    #[inline(always)]
    fn take(&mut self, orders: &BrakeOrders) -> bool {
        orders.take(self.distances.around);
        let waiting = orders.waiting();
        if waiting > self.calm_above {
            return false;
        }
        let is_calm = self.brake.move_on(self.distances, waiting, orders);
        self.calm_above = i32::MAX;
        if is_calm {
            // Without a rule, no units wait and no step is examined again.
            self.calm_above = orders.top.load(Ordering::Relaxed).cast_signed() - 1;
        } else {
            self.todo |= LOOK;
        }
        !is_calm
    }

    /// Does a piece of the work. Returns whether there is more, and the least ticks from the last
    /// step to the next as far as they are known.
    #[inline(always)]
    pub fn work(&mut self, orders: &BrakeOrders) -> (bool, u32) {
        let todo = self.todo;
        if todo & LOOK != 0 {
            self.todo = todo & !LOOK;
            return (false, self.brake.least_ticks(self.distances, orders));
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
        self.distances = self.length.step();
        self.todo = todo.saturating_sub(1);
        self.take(orders)
    }
}

#[cfg(test)]
mod tests;
