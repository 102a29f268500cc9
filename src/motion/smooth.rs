//! Plans speeds without kinks: the acceleration along the path changes no faster than the limit on
//! jerk.
//!
//! Time is divided into intervals of constant jerk. At the beginning of each, [`PathLimits::next`]
//! chooses the greatest acceleration for its end from which everything that is known ahead can
//! still be kept: the end of the path, corners, bends and feeds. Each limit is tested by itself: it
//! must be possible to brake to it as fast as acceleration and jerk allow, with no acceleration
//! left when it is reached. That suffices for all limits together, because braking harder than one
//! limit requires only makes the machine slower everywhere. So nothing depends on where blocks
//! begin or end, and acceleration continues through any number of short ones. At the greatest
//! speed, an interval lasts as long as the known path permits; a bend that is found later ends it.
//!
//! Within an interval the acceleration changes evenly until it reaches its limit, and then stays
//! there. So an interval of the hardest braking is never slower to brake than the tests assumed.
//! Where braking ends soon, intervals are shorter, so that speed and acceleration end together.
//!
//! An acceleration is represented by its *ramp*: the time for which the jerk has built it up, in
//! sixteenths of slices, negative for braking. Then all changes are polynomials in whole numbers.
//!
//! The file is longer than 500 lines, because the plan asks for distances and times of a ramp in
//! whole numbers, and both must round in the same way.

use super::limits::square;
use super::profile::Slice;
use super::{Limits, Lookahead, PathLength, SliceSpeed};
use crate::fixed::Millimetres;
use core::num::NonZeroU32;

/// The limit on jerk, in sixteenths of the jerk that is assumed for braking. The difference makes
/// up for the fact that the jerk changes only at the ends of intervals.
const MOST_GROWTH: i32 = 18;

/// Where slices are merged, a constant speed deviates from the exact position by no more than this,
/// in units of 2^-32 mm: 4 nm.
const MOST_DEVIATION: u64 = 1 << 14;

/// The greatest length of an interval at constant speed, in slices; about 0.1 s.
const LONGEST_CRUISE: u16 = 512;

/// The limit on jerk as the planner needs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct JerkLimit {
    /// The jerk that is assumed for braking, in units of 2^-40 mm per slice³, below 2^23.
    jerk: NonZeroU32,
    /// The longest ramp, 2^7 to 2^16. It is chosen so that neither the acceleration exceeds its
    /// limit nor the greatest speed is passed. It is a multiple of the length of an interval in
    /// slices, as all ramps are at the ends of intervals.
    longest: i32,
}

impl JerkLimit {
    /// The least value of the longest ramp, which is eight slices. The speed is not planned more
    /// often.
    const SHORTEST: u32 = 1 << 7;
    /// The greatest value of the longest ramp.
    const LONGEST: u64 = 1 << 16;

    /// Creates the limit from a jerk up to 1000 m/s³; `None` if it is 0, which means no limit.
    pub(super) fn new(
        jerk_m_per_s3: Millimetres,
        acceleration: SliceSpeed,
        fastest: SliceSpeed,
    ) -> Option<Self> {
        let bits = u64::from(jerk_m_per_s3.to_bits().unsigned_abs());
        // 2^-16 m/s³ to 2^-40 mm/slice³: bits * 1000 * 2^24 * (2^12 / 5^8 / 2^6)³, the twos
        // cancelled.
        let jerk = (((bits << 36) / const { 5u64.pow(10) }) << 9) / const { 5u64.pow(11) };
        let jerk = jerk * 16 / u64::from(MOST_GROWTH.unsigned_abs());
        let (acceleration, fastest) =
            (u64::from(acceleration.to_bits()), u64::from(fastest.to_bits()));
        // A jerk that would reach the limits within less than the shortest ramp is reduced.
        let most = (acceleration << 12) / u64::from(Self::SHORTEST);
        let jerk = jerk
            .min(most)
            .min((fastest << 16) / const { Self::SHORTEST as u64 * Self::SHORTEST as u64 });
        let limit = NonZeroU32::new(u32::try_from(jerk).unwrap_or(u32::MAX))?;
        let by_acceleration = (acceleration << 12) / jerk;
        let by_speed = ((fastest << 16) / jerk).isqrt();
        let longest = by_acceleration.min(by_speed).min(Self::LONGEST) as i32;
        let limit = Self { jerk: limit, longest };
        Some(Self { longest: longest - longest % i32::from(limit.slices()), ..limit })
    }

    /// The length of an interval: 8 to 256 slices, a power of two, and about a 16th of the longest
    /// ramp.
    fn slices(self) -> u16 {
        1 << (self.longest / 170).clamp(8, 256).ilog2()
    }

    /// The length of the interval that begins in `state`, in slices. It is shorter where braking
    /// ends soon, so that speed and acceleration end together, and where the ramp is no multiple of
    /// a longer interval. The second value tells whether the latter shortened it.
    fn slices_from(self, state: State) -> (u16, bool) {
        let ramp = state.ramp.unsigned_abs();
        let ends_soon = |slices: u16| {
            let slices = u32::from(slices);
            state.ramp <= 0
                && state.speed > 0
                && slices > (ramp >> 8).max(2)
                && u64::from(state.speed)
                    < self.speed_shed(ramp + MOST_GROWTH.unsigned_abs() * slices) * 3 / 2
        };
        let mut slices = self.slices();
        while ends_soon(slices) {
            slices /= 2;
        }
        let mut is_uneven = false;
        while ramp & u32::from(slices - 1) != 0 {
            slices /= 2;
            is_uneven = true;
        }
        (slices, is_uneven)
    }

    /// The speed that is shed while a ramp of braking fades.
    fn speed_shed(self, ramp: u32) -> u64 {
        (u64::from(self.jerk.get()) * square(ramp.into())) >> 17
    }

    fn jerk(self) -> i64 {
        i64::from(self.jerk.get())
    }

    /// Returns the ramp after it has grown from `ramp` by `growth` in each of this many slices,
    /// limited to the longest ramp.
    fn grown(self, ramp: i32, growth: i32, slices: u16) -> i32 {
        (ramp + growth * i32::from(slices)).min(self.longest).max(-self.longest)
    }

    /// Returns what such a ramp adds to the speed.
    fn gain(self, ramp: i32, growth: i32, slices: u16) -> i64 {
        // These products are below 2^27; only intervals without a ramp are longer.
        let time = i32::from(slices);
        let end = ramp + growth * time;
        let twice_ramp = if end.abs() <= self.longest {
            (ramp + end) * time
        } else {
            self.sums(ramp, growth, time).twice_ramp
        };
        (self.jerk() * i64::from(twice_ramp)) >> 13
    }

    /// Returns the distance that such a ramp adds, in units of 2^-32 mm.
    fn gained_distance(self, ramp: i32, growth: i32, slices: u16) -> i64 {
        let time = i32::from(slices);
        let end = ramp + growth * time;
        let six_distances = if end.abs() <= self.longest {
            i64::from(time * time) * i64::from(2 * ramp + end)
        } else {
            self.sums(ramp, growth, time).six_distances
        };
        self.jerk() * six_distances / (6 << 12)
    }

    /// Returns the sums of a ramp that reaches the longest one. In the slice in which it does, it
    /// grows less.
    #[inline(never)] // It is rare.
    fn sums(self, ramp: i32, growth: i32, slices: i32) -> RampSums {
        let mut sums = RampSums::default();
        let longest = self.longest * growth.signum();
        let whole = (longest - ramp).checked_div(growth).unwrap_or(0).min(slices - 1).max(0);
        let last = ramp + growth * whole;
        sums.add(ramp, last, whole);
        sums.add(last, longest, 1);
        sums.add(longest, longest, slices - whole - 1);
        sums
    }

    /// Returns speed over jerk, in squares of sixteenths of slices.
    fn scaled(self, speed: u32) -> i64 {
        ((u64::from(speed) << 16) / u64::from(self.jerk.get())) as i64
    }

    /// Returns the speed after the ramp has ended as soon as it can. A ramp that accelerates takes
    /// at least an interval to end. If less were assumed, a speed that cannot be kept would be
    /// allowed, and would rise and fall for ever.
    fn settled(self, state: State) -> u64 {
        let shortest = if state.ramp > 0 { 16 * i32::from(self.slices()) } else { 0 };
        let square = i64::from(state.ramp) * i64::from(state.ramp.abs().max(shortest));
        (i64::from(state.speed) + ((self.jerk() * square) >> 17)).max(0).unsigned_abs()
    }

    /// Returns the distance, in units of 2^-32 mm, from the speed and ramp of `from` to the speed
    /// `to` without a ramp, if the machine brakes as hard as the limits allow. If the ramp of
    /// `from` leads below `to` anyway, it is the distance until the speed `to` is passed. If `to`
    /// is never reached, the result has no meaning.
    pub(super) fn braking_distance(self, from: State, to: u32) -> u64 {
        let ramp = i64::from(from.ramp);
        let (from, to) = (self.scaled(from.speed) + 1, self.scaled(to));
        // The ramp at which braking begins to fade, if it does not exceed the longest one: v - u =
        // (2 peak² - ramp²) / 2.
        let longest = i64::from(self.longest);
        let square = from - to + ramp * ramp / 2;
        if ramp < 0 && square < ramp * ramp {
            let time =
                -ramp - (ramp * ramp - 2 * (from - to).max(0)).max(0).unsigned_abs().isqrt() as i64;
            return self.distance(from * time + time * time * (3 * ramp + time) / 6);
        }
        let peak = if square < longest * longest {
            square.max(1).unsigned_abs().isqrt() as i64
        } else {
            longest
        };
        let peak = peak.max(-ramp).max(1);
        let down = ramp + peak;
        let (first, second) = (from + (ramp * ramp - peak * peak) / 2, to + peak * peak / 2);
        let hold = (first - second + peak - 1).max(0) / peak;
        // Times below 2^22, speeds below 2^37, their product below 2^58.
        let curves = down * down * (3 * ramp - down) + peak * peak * peak;
        let distance = from * down + hold * ((first + second) / 2) + to * peak + curves / 6;
        self.distance(distance)
    }

    /// Returns an upper bound of the time, in sixteenths of ticks, until the machine comes to rest
    /// at this distance (2^-32 mm), if nothing but the speed `top` and that rest limits it.
    ///
    /// If the machine is never slower than some speed before it brakes to rest, it takes at most
    /// three times the distance over that speed, which is exact while braking fades. If it must
    /// brake to rest, it also takes no longer than with the present acceleration, which then fades,
    /// and no longer than the hardest braking plus three times the rest of the distance over the
    /// speed.
    #[cfg(feature = "pen-overlap")]
    #[inline(never)] // Only on travels: inlined, it would fill the cache.
    fn time_to_rest(self, from: State, distance: u64, top: SliceSpeed) -> u64 {
        let speed = from.speed.max(1);
        // Distances are below 2^46; the pen does not wait for anything further away yet.
        let over = |distance: u64, speed: u32| {
            (3 * (distance.min(1 << 45) << 16)).checked_div(speed.into()).unwrap_or(u64::MAX)
        };
        if speed > top.to_bits() {
            return over(distance, top.to_bits());
        }
        let rest = distance.saturating_sub(self.braking_distance(from, 0));
        if from.ramp < 0 && rest > distance / 8 {
            // It slows down to another speed.
            return over(distance, u32::try_from(self.settled(from)).unwrap_or(speed).min(speed));
        }
        let ramp = u64::from(from.ramp.unsigned_abs());
        let acceleration = (u64::from(self.jerk.get()) * ramp) >> 12;
        let by_ramp = match (u64::from(speed) << 16).checked_div(acceleration) {
            Some(time) if from.ramp < 0 => time + (ramp << 11),
            _ => u64::MAX,
        };
        let by_braking = self.braking_time(from).saturating_add(over(rest, speed));
        over(distance, speed).min(by_ramp).min(by_braking)
    }

    /// Returns the time that the braking of [`JerkLimit::braking_distance`] to rest takes, in
    /// sixteenths of ticks; the greatest number if the ramp only has to end.
    #[cfg(feature = "pen-overlap")]
    fn braking_time(self, from: State) -> u64 {
        let (ramp, speed) = (i64::from(from.ramp), self.scaled(from.speed) + 1);
        let square = speed + ramp * ramp / 2;
        if ramp < 0 && square < ramp * ramp {
            return u64::MAX;
        }
        let peak = square.max(1).unsigned_abs().isqrt() as i64;
        let peak = peak.min(self.longest.into()).max(-ramp).max(1);
        // The speed that is left to be shed at the peak.
        let left = (speed + ramp * ramp / 2 - peak * peak + peak - 1).max(0);
        let hold = left.unsigned_abs().checked_div(peak.unsigned_abs()).unwrap_or(0);
        let ramps = (ramp + 2 * peak).max(0).unsigned_abs();
        (ramps + hold) << 12
    }

    /// Converts a product of scaled speed and sixteenths of slices to units of 2^-32 mm.
    fn distance(self, scaled: i64) -> u64 {
        ((scaled.max(0).unsigned_abs() >> 8) * u64::from(self.jerk.get())) >> 12
    }
}

/// The sums of a ramp over some time.
#[derive(Debug, Default)]
struct RampSums {
    /// Twice the sum of the ramp over the slices.
    twice_ramp: i32,
    /// Six times the sum of that sum.
    six_distances: i64,
}

impl RampSums {
    /// Adds a ramp that changes evenly between two values within this many slices.
    #[inline]
    fn add(&mut self, from: i32, to: i32, slices: i32) {
        let time = i64::from(slices);
        self.six_distances +=
            3 * i64::from(self.twice_ramp) * time + time * time * i64::from(2 * from + to);
        self.twice_ramp += (from + to) * slices;
    }
}

/// The state of motion of the plan at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct State {
    /// The speed, in units of 2^-32 mm per slice.
    pub(super) speed: u32,
    /// The acceleration as a ramp: see the module documentation.
    pub(super) ramp: i32,
}

/// An interval of constant jerk, cut into slices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    limit: JerkLimit,
    /// The state at the beginning of the interval.
    from: State,
    /// What each slice adds to the ramp: the jerk in sixteenths of that of [`JerkLimit`].
    growth: i8,
    /// The number of slices that are merged into one.
    stride: u8,
    /// The length of the interval in slices.
    slices: u16,
    /// The number of slices that were returned.
    done: u16,
    /// The speed after these slices.
    speed: u32,
    /// The rest of a slice that was cut at the end of a block.
    rest: Slice,
}

impl Interval {
    fn new(limit: JerkLimit, from: State, growth: i32, slices: u16) -> Self {
        let last = limit.grown(from.ramp, growth, slices);
        let longest = u64::from(from.ramp.unsigned_abs().max(last.unsigned_abs()));
        let acceleration = (u64::from(limit.jerk.get()) * longest) >> 12;
        let is_straight =
            |slices: &u32| acceleration * u64::from(slices * slices) <= MOST_DEVIATION * 8;
        let strides = [Slice::most(from.speed), 8, 4, 2];
        let stride = strides.into_iter().find(is_straight).unwrap_or(1);
        let (growth, stride, speed) = (growth as i8, stride as u8, from.speed);
        Self { limit, from, growth, stride, slices, done: 0, speed, rest: Slice::default() }
    }

    /// Returns the next slice, or as much of it as fits `room` (in units of 2^-32 mm); `None` at
    /// the end of the interval or without room. It merges at most `most` ordinary slices.
    #[inline(never)] // Without a limit of jerk, it would only fill the cache.
    pub(super) fn next_slice(&mut self, room: u64, most: u32) -> Option<Slice> {
        if room == 0 {
            return None;
        }
        // The rest of a slice is completed to a whole one.
        let missing =
            (u32::from(self.stride).min(most) * Slice::TIME).saturating_sub(self.rest.time);
        let slices = ((missing / Slice::TIME) as u16).min(self.slices - self.done);
        let is_even = self.growth == 0 && self.from.ramp == 0;
        if slices > 0 && (is_even || self.rest.distance == 0) {
            let before = self.speed;
            self.done += slices;
            if !is_even {
                self.speed = self.speed_after(self.done);
            }
            let stays_at_rest = before == 0 && self.speed == 0 && self.growth <= 0;
            if !stays_at_rest {
                let slices = u32::from(slices);
                // The sums fit, because speeds are at most 0.09 mm per slice.
                self.rest.distance += before.midpoint(self.speed) * slices;
                self.rest.time += Slice::TIME * slices;
            }
        }
        if self.rest.time == 0 {
            return None;
        }
        let mut slice = core::mem::take(&mut self.rest);
        if u64::from(slice.distance) > room {
            // The room is less than the distance, so the result is less than the time.
            let time = (u64::from(slice.time) * room / u64::from(slice.distance)) as u32;
            let distance = room as u32;
            self.rest = Slice { distance: slice.distance - distance, time: slice.time - time };
            slice = Slice { distance, time };
        }
        Some(slice)
    }

    /// [`JerkLimit::time_to_rest`], from the end of the last slice returned.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn time_to_rest(&self, distance: u64, top: SliceSpeed) -> u64 {
        self.limit.time_to_rest(self.state(), distance, top)
    }

    /// Whether this is a cruise: an interval at constant speed that is longer than others.
    pub(super) fn is_cruise(&self) -> bool {
        self.slices > self.limit.slices()
    }

    /// Whether the acceleration changes within the interval, so that it must not be cut short.
    pub(super) fn changes(&self) -> bool {
        self.growth != 0
    }

    /// The state at the end of the last slice returned.
    pub(super) fn state(&self) -> State {
        let ramp = self.limit.grown(self.from.ramp, self.growth.into(), self.done);
        State { speed: self.speed, ramp: if self.speed == 0 { 0 } else { ramp } }
    }

    fn speed_after(&self, slices: u16) -> u32 {
        let gain = self.limit.gain(self.from.ramp, self.growth.into(), slices);
        // The limits keep the speed below 2^32.
        (i64::from(self.from.speed) + gain).max(0) as u32
    }
}

/// What a plan does about a limit that came too late to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Late {
    /// It keeps every limit.
    MustBeKept,
    /// It passes such a limit too fast, and settles below it.
    MayBePassed,
}

/// The limits on the path ahead that a plan has to keep.
#[derive(Debug)]
pub(super) struct PathLimits<'a, 'm> {
    pub(super) limits: &'a Limits,
    pub(super) jerk: JerkLimit,
    /// The greatest speed. If the machine is already faster, it slows down gradually. With 0 it
    /// brakes to rest.
    pub(super) top: SliceSpeed,
    /// The distance to the end of the current piece, in units of 2^-32 mm.
    pub(super) room: u64,
    /// The greatest stopping distance that bends allow until there.
    pub(super) curve_limit: PathLength,
    /// Whether `top` is valid only until there, because blocks have limits of their own.
    pub(super) top_ends: bool,
    /// The blocks after that; `None` if the path ends there at rest.
    pub(super) beyond: Option<&'a Lookahead<'m>>,
}

impl PathLimits<'_, '_> {
    /// Returns the next interval.
    ///
    /// If no acceleration is allowed, the machine brakes. From rest, if not even the least
    /// acceleration is allowed, it creeps, because the remaining distance is less than a start and
    /// a stop take.
    #[inline(never)] // Without a limit of jerk, it would only fill the cache.
    pub(super) fn next(&self, from: State) -> Interval {
        let jerk = self.jerk;
        let (mut slices, is_uneven) = jerk.slices_from(from);
        // The hardest braking reaches the longest ramp as soon as it can.
        let hardest = if from.ramp > -jerk.longest { -MOST_GROWTH } else { 0 };
        let mut least = hardest;
        let room = (jerk.longest - from.ramp).checked_div(slices.into()).unwrap_or(0);
        let greatest = MOST_GROWTH.min(room);
        // If not even the hardest braking keeps a limit that came too late, braking ends as soon
        // as it leads below that limit. Otherwise it would continue to rest and end with a jerk.
        for late in [Late::MustBeKept, Late::MayBePassed] {
            let mut most = greatest;
            if self.allows(from, most, slices, late) {
                least = most;
            }
            while most - least > 1 {
                let middle = (least + most) >> 1;
                if self.allows(from, middle, slices, late) {
                    least = middle;
                } else {
                    most = middle;
                }
            }
            if least > hardest || self.allows(from, hardest, slices, late) {
                break;
            }
        }
        // A little less is chosen where that makes the next interval longer.
        if is_uneven
            && least > -MOST_GROWTH
            && (from.ramp.checked_div(slices.into()).unwrap_or(0) + least) & 1 != 0
        {
            least -= 1;
        }
        if from.speed == 0 && least <= 0 {
            let distance = jerk.gained_distance(0, 1, slices).unsigned_abs();
            let speed = distance.checked_div(slices.into()).unwrap_or(0) as u32;
            let speed = speed.min(self.top.to_bits()).max(1);
            return Interval::new(jerk, State { speed, ramp: 0 }, 0, slices);
        }
        // At the greatest speed, which nothing ahead can raise, the interval is as long as
        // possible.
        if from.ramp == 0 && least == 0 && self.settled(from, 1, slices).is_none() {
            if let Some(interval) = self.nearer_to_top(from, slices) {
                return interval;
            }
            let goes_on = |slices: u16| {
                let distance = u64::from(from.speed) * u64::from(slices);
                !self.top_ends || distance <= self.room
            };
            while slices < LONGEST_CRUISE
                && goes_on(2 * slices)
                && self.allows(from, 0, 2 * slices, Late::MustBeKept)
            {
                slices *= 2;
            }
        }
        Interval::new(jerk, from, least, slices)
    }

    /// The next interval if the speed is more than 1/128 below the greatest one, although no whole
    /// interval may begin to accelerate. That happens at low speeds, which the least growth of the
    /// acceleration changes by some mm/min.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn nearer_to_top(&self, from: State, slices: u16) -> Option<Interval> {
        let top = self.top.to_bits();
        if top.saturating_sub(from.speed) <= top >> 7 {
            return None;
        }
        // How the speed changes within one step is not seen.
        let exact = State { speed: top, ramp: 0 };
        let step = u64::from(self.limits.least_move.to_bits());
        if u64::from(top) * u64::from(slices) <= step
            && self.allows(exact, 0, slices, Late::MustBeKept)
        {
            return Some(Interval::new(self.jerk, exact, 0, slices));
        }
        let mut shorter = slices / 2;
        while shorter > 0 && !self.allows(from, 1, shorter, Late::MustBeKept) {
            shorter /= 2;
        }
        (shorter > 0).then(|| Interval::new(self.jerk, from, 1, shorter))
    }

    /// Returns the state after an interval of this growth, and the speed once the ramp has ended;
    /// `None` if that is too fast.
    fn settled(&self, from: State, growth: i32, slices: u16) -> Option<(State, u64)> {
        let speed = i64::from(from.speed) + self.jerk.gain(from.ramp, growth, slices);
        let ramp = self.jerk.grown(from.ramp, growth, slices);
        let after = if speed > 0 { State { speed: speed as u32, ramp } } else { State::default() };
        let settled = self.jerk.settled(after);
        (settled <= u64::from(self.top.to_bits())).then_some((after, settled))
    }

    /// Whether all limits are kept within an interval of this growth, and can be kept after it.
    fn allows(&self, from: State, growth: i32, slices: u16, late: Late) -> bool {
        let jerk = self.jerk;
        let Some((after, settled)) = self.settled(from, growth, slices) else {
            return false;
        };
        let distance = i64::from(from.speed) * i64::from(slices)
            + jerk.gained_distance(from.ramp, growth, slices);
        let distance = distance.max(0).unsigned_abs();
        let fastest = settled.max(after.speed.into());
        let exceeds =
            |speed: u64, limit: PathLength| speed * speed > self.limits.squared_speed(limit);
        let ends_below = |settled: u64, limit: PathLength| {
            after.ramp <= 0 && !exceeds(settled - settled / 128, limit)
        };
        let is_late = |place: u64, speed: u32| {
            late == Late::MayBePassed
                && from.speed > speed
                && jerk.braking_distance(from, speed) > place
        };
        let passes = |place: u64, limit: PathLength| {
            // The speed as if it were linear in the distance, which is too high where braking
            // fades.
            let change = i64::from(after.speed) - i64::from(from.speed);
            let part = change * (place >> 12).cast_signed() / (distance >> 12).max(1).cast_signed();
            let speed = (i64::from(from.speed) + part).unsigned_abs();
            let limit_speed = self.limits.speed(limit).to_bits();
            !exceeds(speed, limit)
                || (ends_below(jerk.settled(from), limit)
                    && (jerk.braking_distance(from, limit_speed) <= place
                        || is_late(place, limit_speed)))
        };
        let stop = jerk.braking_distance(after, 0);
        if let Some(blocks) = self.beyond {
            let left = (self.room + blocks.known()).saturating_sub(distance);
            if stop >> 14 > blocks.stopping_distance_at(left >> 14, self.limits) {
                return false;
            }
        }
        // None of the tested speeds exceeds this limit or a higher one. A machine that is faster
        // than the greatest speed brakes to that, and so keeps what is not below it.
        let fastest_tested = fastest.max(from.speed.into()).min(self.top.to_bits().into());
        let harmless = self.limits.least_limit(fastest_tested);
        let (enough, mut lowest) = (distance.saturating_add(stop), PathLength::MAX);
        let (mut begin, mut end, mut curve_limit) = (0, self.room, self.curve_limit);
        if let Some(blocks) = self.beyond
            && blocks.lowest_limit().min(curve_limit) >= harmless
        {
            return end + blocks.known() >= enough;
        }
        for block in self.beyond.map_or([&[][..]; 2], Lookahead::blocks).into_iter().flatten() {
            let limit = block.limit();
            if limit.min(curve_limit) >= harmless {
                if end >= enough {
                    return true;
                }
            } else if end < distance {
                if !passes(end, limit.min(curve_limit)) {
                    return false;
                }
            } else {
                if begin <= distance && exceeds(settled, curve_limit) {
                    return false;
                }
                if end >= enough {
                    return true;
                }
                // A limit after a lower one has no effect.
                if limit < lowest && exceeds(fastest, limit) {
                    lowest = limit;
                    let speed = self.limits.speed(limit).to_bits();
                    if end - distance < jerk.braking_distance(after, speed)
                        && !(ends_below(settled, limit) && is_late(end, speed))
                    {
                        return false;
                    }
                }
            }
            curve_limit = self.beyond.map_or(block.curve_limit, |ring| ring.limit_within(block));
            (begin, end) = (end, end + (u64::from(block.length.to_bits()) << 14));
        }
        if begin <= distance && exceeds(settled, curve_limit) {
            return false;
        }
        enough <= end
    }
}

#[cfg(test)]
mod tests;
