//! Speeds without kinks: acceleration along the path changes no faster than the limit on jerk.
//!
//! Time goes in intervals of constant jerk. At the beginning of each, [`Road::next`] takes the
//! greatest acceleration for its end from which all that is known ahead can still be kept: the end
//! of the path, corners, bends, feeds. Every limit is looked at by itself: braking to it as fast as
//! acceleration and jerk let it, and without acceleration in the end, must be possible before it
//! stands. That is enough for all of them together, since who brakes harder than one limit asks is
//! slower everywhere. So nothing is bound to where blocks begin or end: acceleration runs on
//! through any number of short ones. At the greatest speed an interval lasts as long as what is
//! known lets it; a bend that is found later ends it.
//!
//! Within an interval acceleration grows evenly until it is at its limit, and stays there. So an
//! interval of the hardest braking is nowhere behind the braking that was reckoned with. Where
//! braking ends soon, intervals are shorter, so that speed and acceleration end together.
//!
//! An acceleration is told by its *ramp*: for how long the jerk has built it up, in sixteenths of
//! slices, negative for braking. Then all changes are polynomials in whole numbers.

use super::limits::square;
use super::profile::Slice;
use super::{Limits, Lookahead, PathLength, SliceSpeed};
use crate::fixed::Millimetres;
use core::num::NonZeroU32;

/// The limit in sixteenths of the jerk with which braking is reckoned: the difference makes up for
/// changes at the ends of intervals only.
const MOST_GROWTH: i32 = 18;

/// Where slices are taken together, a constant speed leaves the place that the acceleration leads
/// to by no more than this, 2^-32 mm: 4 nm.
const MOST_DEVIATION: u64 = 1 << 14;

/// Slices, about 0.1 s: a cruise is not looked after more often than that.
const LONGEST_CRUISE: u16 = 512;

/// The limit on jerk as the planner needs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct JerkLimit {
    /// With which braking is reckoned, 2^-40 mm per slice³, below 2^23.
    jerk: NonZeroU32,
    /// The longest ramp, 2^7 to 2^16: no acceleration beyond the limit, nor beyond what the
    /// greatest speed leaves time for. A multiple of the slices of an interval, as all ramps are at
    /// its ends.
    longest: i32,
}

impl JerkLimit {
    /// The least longest ramp: eight slices. The speed is not looked after more often.
    const SHORTEST: u32 = 1 << 7;
    const LONGEST: u64 = 1 << 16;

    /// `None` for no limit, 0. Jerks up to 1000 m/s³.
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
        // A jerk that builds all up within less than the shortest ramp is of no use.
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

    /// How long an interval is, 8 to 256 slices: a power of two, about a 16th of the longest ramp.
    fn slices(self) -> u16 {
        1 << (self.longest / 170).clamp(8, 256).ilog2()
    }

    /// How long the interval from there on is. It is shorter where braking ends soon, so that speed
    /// and acceleration end together, and as long as the ramp is no multiple of a longer one. The
    /// second value tells whether that is the only reason.
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

    /// The speed that is shed while a ramp of braking ends.
    fn speed_shed(self, ramp: u32) -> u64 {
        (u64::from(self.jerk.get()) * square(ramp.into())) >> 17
    }

    fn jerk(self) -> i64 {
        i64::from(self.jerk.get())
    }

    /// The ramp after so many slices in which it grows from `ramp` by `growth` a slice, until it is
    /// as long as it may be.
    fn grown(self, ramp: i32, growth: i32, slices: u16) -> i32 {
        (ramp + growth * i32::from(slices)).min(self.longest).max(-self.longest)
    }

    /// What such a ramp adds to the speed.
    fn gain(self, ramp: i32, growth: i32, slices: u16) -> i64 {
        // Below 2^27: without a ramp, intervals may be longer.
        let time = i32::from(slices);
        let end = ramp + growth * time;
        let twice_ramp = if end.abs() <= self.longest {
            (ramp + end) * time
        } else {
            self.sums(ramp, growth, time).twice_ramp
        };
        (self.jerk() * i64::from(twice_ramp)) >> 13
    }

    /// The way that it adds, 2^-32 mm.
    fn gained_way(self, ramp: i32, growth: i32, slices: u16) -> i64 {
        let time = i32::from(slices);
        let end = ramp + growth * time;
        let six_ways = if end.abs() <= self.longest {
            i64::from(time * time) * i64::from(2 * ramp + end)
        } else {
            self.sums(ramp, growth, time).six_ways
        };
        self.jerk() * six_ways / (6 << 12)
    }

    /// What a ramp comes to that becomes the longest: in the slice in which it does, it grows less.
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

    /// Speed over jerk, in squares of sixteenths of slices.
    fn scaled(self, speed: u32) -> i64 {
        ((u64::from(speed) << 16) / u64::from(self.jerk.get())) as i64
    }

    /// How fast it is when the ramp has ended as soon as it can. One that builds speed up does not
    /// end within less than an interval: to reckon with less would let a speed that cannot be kept
    /// rise and fall for ever.
    fn settled(self, state: State) -> u64 {
        let shortest = if state.ramp > 0 { 16 * i32::from(self.slices()) } else { 0 };
        let square = i64::from(state.ramp) * i64::from(state.ramp.abs().max(shortest));
        (i64::from(state.speed) + ((self.jerk() * square) >> 17)).max(0).unsigned_abs()
    }

    /// How far it is, 2^-32 mm, from the speed and ramp of `from` to the speed `to` and no ramp,
    /// braking as hard as the limits let it; to `to` alone, if the ramp of a faster `from` leads on
    /// to a slower speed. If `to` is never passed, nothing of use.
    pub(super) fn braking_distance(self, from: State, to: u32) -> u64 {
        let ramp = i64::from(from.ramp);
        let (from, to) = (self.scaled(from.speed) + 1, self.scaled(to));
        // The ramp at which to turn, if none is too long: v - u = (2 peak² - ramp²) / 2.
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
        let way = from * down + hold * ((first + second) / 2) + to * peak + curves / 6;
        self.distance(way)
    }

    /// How long it takes at most, in sixteenths of ticks, to come to rest after such a way
    /// (2^-32 mm), on which nothing but the speed `top` and that rest limits the machine.
    ///
    /// While it is never slower than some speed before it brakes to that rest, it takes no longer
    /// than three times the way over that speed: just so long while braking fades. Where it must
    /// brake to rest, it also takes no longer than at the present acceleration, which then fades;
    /// and no longer than the hardest braking, and three times the rest of the way over the speed.
    #[cfg(feature = "pen-overlap")]
    #[inline(never)] // Only on travels: inlined, it would fill the cache.
    fn time_to_rest(self, from: State, way: u64, top: SliceSpeed) -> u64 {
        let speed = from.speed.max(1);
        // Ways are below 2^46; what is further away is not waited for yet.
        let over = |way: u64, speed: u32| {
            (3 * (way.min(1 << 45) << 16)).checked_div(speed.into()).unwrap_or(u64::MAX)
        };
        if speed > top.to_bits() {
            return over(way, top.to_bits());
        }
        let rest = way.saturating_sub(self.braking_distance(from, 0));
        if from.ramp < 0 && rest > way / 8 {
            // It slows down to another speed.
            return over(way, u32::try_from(self.settled(from)).unwrap_or(speed).min(speed));
        }
        let ramp = u64::from(from.ramp.unsigned_abs());
        let acceleration = (u64::from(self.jerk.get()) * ramp) >> 12;
        let by_ramp = match (u64::from(speed) << 16).checked_div(acceleration) {
            Some(time) if from.ramp < 0 => time + (ramp << 11),
            _ => u64::MAX,
        };
        let by_braking = self.braking_time(from).saturating_add(over(rest, speed));
        over(way, speed).min(by_ramp).min(by_braking)
    }

    /// How long the braking of [`JerkLimit::braking_distance`] to rest takes, in sixteenths of
    /// ticks; the greatest number where the ramp has only to end.
    #[cfg(feature = "pen-overlap")]
    fn braking_time(self, from: State) -> u64 {
        let (ramp, speed) = (i64::from(from.ramp), self.scaled(from.speed) + 1);
        let square = speed + ramp * ramp / 2;
        if ramp < 0 && square < ramp * ramp {
            return u64::MAX;
        }
        let peak = square.max(1).unsigned_abs().isqrt() as i64;
        let peak = peak.min(self.longest.into()).max(-ramp).max(1);
        // What is left to be shed at the peak.
        let left = (speed + ramp * ramp / 2 - peak * peak + peak - 1).max(0);
        let hold = left.unsigned_abs().checked_div(peak.unsigned_abs()).unwrap_or(0);
        let ramps = (ramp + 2 * peak).max(0).unsigned_abs();
        (ramps + hold) << 12
    }

    /// Scaled speed times sixteenths of slices, as 2^-32 mm.
    fn distance(self, scaled: i64) -> u64 {
        ((scaled.max(0).unsigned_abs() >> 8) * u64::from(self.jerk.get())) >> 12
    }
}

/// What a ramp comes to over some time.
#[derive(Debug, Default)]
struct RampSums {
    /// Twice the sum of the ramp over the slices.
    twice_ramp: i32,
    /// Six times the sum of that sum.
    six_ways: i64,
}

impl RampSums {
    /// The ramp goes evenly from one to another in so many slices.
    #[inline]
    fn add(&mut self, from: i32, to: i32, slices: i32) {
        let time = i64::from(slices);
        self.six_ways +=
            3 * i64::from(self.twice_ramp) * time + time * time * i64::from(2 * from + to);
        self.twice_ramp += (from + to) * slices;
    }
}

/// How the plan moves at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct State {
    /// 2^-32 mm per slice.
    pub(super) speed: u32,
    /// See the module.
    pub(super) ramp: i32,
}

/// An interval of constant jerk, cut into slices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    limit: JerkLimit,
    from: State,
    /// Added to the ramp by each slice: sixteenths of the jerk of [`JerkLimit`].
    growth: i8,
    /// So many slices are one.
    stride: u8,
    slices: u16,
    done: u16,
    /// When so many are done.
    speed: u32,
    /// What is left of a slice that the end of a block cut.
    rest: Slice,
}

impl Interval {
    fn new(limit: JerkLimit, from: State, growth: i32, slices: u16) -> Self {
        let last = limit.grown(from.ramp, growth, slices);
        let longest = u64::from(from.ramp.unsigned_abs().max(last.unsigned_abs()));
        let acceleration = (u64::from(limit.jerk.get()) * longest) >> 12;
        let is_straight =
            |slices: &u32| acceleration * u64::from(slices * slices) <= MOST_DEVIATION * 8;
        let stride = [Slice::MOST, 4, 2].into_iter().find(is_straight).unwrap_or(1);
        let (growth, stride, speed) = (growth as i8, stride as u8, from.speed);
        Self { limit, from, growth, stride, slices, done: 0, speed, rest: Slice::default() }
    }

    /// The next slice, or as much of it as there is `room` for (2^-32 mm); `None` at the end of the
    /// interval or without room.
    #[inline(never)] // Without a limit of jerk, it would only fill the cache.
    pub(super) fn next_slice(&mut self, room: u64) -> Option<Slice> {
        if room == 0 {
            return None;
        }
        // What is left of one is made up to a whole.
        let missing = (u32::from(self.stride) * Slice::TIME).saturating_sub(self.rest.time);
        let slices = ((missing / Slice::TIME) as u16).min(self.slices - self.done);
        let is_even = self.growth == 0 && self.from.ramp == 0;
        if slices > 0 && (is_even || self.rest.distance == 0) {
            let before = self.speed;
            self.done += slices;
            self.speed = self.speed_after(self.done);
            let stands = before == 0 && self.speed == 0 && self.growth <= 0;
            if !stands {
                let slices = u32::from(slices);
                // Speeds are at most 0.09.
                self.rest.distance += before.midpoint(self.speed) * slices;
                self.rest.time += Slice::TIME * slices;
            }
        }
        if self.rest.time == 0 {
            return None;
        }
        let mut slice = core::mem::take(&mut self.rest);
        if u64::from(slice.distance) > room {
            // Less than the distance, and so than the time.
            let time = (u64::from(slice.time) * room / u64::from(slice.distance)) as u32;
            let distance = room as u32;
            self.rest = Slice { distance: slice.distance - distance, time: slice.time - time };
            slice = Slice { distance, time };
        }
        Some(slice)
    }

    /// See [`JerkLimit::time_to_rest`], from where the last slice given ends.
    #[cfg(feature = "pen-overlap")]
    pub(super) fn time_to_rest(&self, way: u64, top: SliceSpeed) -> u64 {
        self.limit.time_to_rest(self.state(), way, top)
    }

    /// Whether it is longer than others.
    pub(super) fn is_cruise(&self) -> bool {
        self.slices > self.limit.slices()
    }

    /// Whether the acceleration changes in it, so that it must not be cut short.
    pub(super) fn changes(&self) -> bool {
        self.growth != 0
    }

    /// How the plan moves at the end of the last slice given.
    pub(super) fn state(&self) -> State {
        let ramp = self.limit.grown(self.from.ramp, self.growth.into(), self.done);
        State { speed: self.speed, ramp: if self.speed == 0 { 0 } else { ramp } }
    }

    fn speed_after(&self, slices: u16) -> u32 {
        let gain = self.limit.gain(self.from.ramp, self.growth.into(), slices);
        // The limits keep it below 2^32.
        (i64::from(self.from.speed) + gain).max(0) as u32
    }
}

/// What the plan has to keep.
#[derive(Debug)]
pub(super) struct Road<'a, 'm> {
    pub(super) limits: &'a Limits,
    pub(super) jerk: JerkLimit,
    /// Not to be passed, but not at once if it is passed already; 0 to brake to rest.
    pub(super) top: SliceSpeed,
    /// To the end of the piece in work, 2^-32 mm.
    pub(super) room: u64,
    /// Greatest stopping distance until there.
    pub(super) curve_limit: PathLength,
    /// What comes then; `None` if it ends there at rest.
    pub(super) beyond: Option<&'a Lookahead<'m>>,
}

impl Road<'_, '_> {
    /// The next interval.
    ///
    /// If nothing is allowed, it brakes. From rest, if not even the least acceleration is, it
    /// creeps: what is left is less than a start and a stop take.
    #[inline(never)] // Without a limit of jerk, it would only fill the cache.
    pub(super) fn next(&self, from: State) -> Interval {
        let jerk = self.jerk;
        let (mut slices, is_uneven) = jerk.slices_from(from);
        // The hardest braking is as hard as it may be, as soon as it can.
        let hardest = if from.ramp > -jerk.longest { -MOST_GROWTH } else { 0 };
        let mut least = hardest;
        let room = (jerk.longest - from.ramp).checked_div(slices.into()).unwrap_or(0);
        let mut most = MOST_GROWTH.min(room);
        if self.allows(from, most, slices) {
            least = most;
        }
        while most - least > 1 {
            let middle = (least + most) >> 1;
            if self.allows(from, middle, slices) {
                least = middle;
            } else {
                most = middle;
            }
        }
        // At the longest ramp, too: it would brake to rest, and end that with a jerk.
        if least == hardest && from.ramp < -MOST_GROWTH * i32::from(slices) && self.is_slow(from) {
            least = MOST_GROWTH;
        }
        // Where it makes the next interval longer, a little less.
        if is_uneven
            && least > -MOST_GROWTH
            && (from.ramp.checked_div(slices.into()).unwrap_or(0) + least) & 1 != 0
        {
            least -= 1;
        }
        if from.speed == 0 && least <= 0 {
            let way = jerk.gained_way(0, 1, slices).unsigned_abs();
            let speed = way.checked_div(slices.into()).unwrap_or(0).max(1) as u32;
            return Interval::new(jerk, State { speed, ramp: 0 }, 0, slices);
        }
        // As fast as it may be at all: nothing that comes can change that.
        if from.ramp == 0 && least == 0 && self.settled(from, 1, slices).is_none() {
            while slices < LONGEST_CRUISE && self.allows(from, 0, 2 * slices) {
                slices *= 2;
            }
        }
        Interval::new(jerk, from, least, slices)
    }

    /// Whether a limit came too late to be kept, and braking that ends now leads below it. What is
    /// known is far more than a stop takes, so it is not that which asks for more.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn is_slow(&self, from: State) -> bool {
        self.beyond.is_some_and(|blocks| {
            let lowest = blocks.lowest_limit().min(self.curve_limit);
            let left = blocks.stopping_distance_at((self.room + blocks.known()) >> 14, self.limits);
            self.top > 0
                && lowest > 0
                && square(self.jerk.settled(from)) <= self.limits.squared_speed(lowest)
                && self.jerk.braking_distance(from, 0) >> 14 < left - left / 8
        })
    }

    /// How it moves after an interval of such a growth, and how fast it is when it has no ramp any
    /// more; `None` if that is too fast.
    fn settled(&self, from: State, growth: i32, slices: u16) -> Option<(State, u64)> {
        let speed = i64::from(from.speed) + self.jerk.gain(from.ramp, growth, slices);
        let ramp = self.jerk.grown(from.ramp, growth, slices);
        let after = if speed > 0 { State { speed: speed as u32, ramp } } else { State::default() };
        let settled = self.jerk.settled(after);
        (settled <= u64::from(self.top.to_bits())).then_some((after, settled))
    }

    /// Whether all limits can be kept after an interval of such a growth, and are kept in it.
    fn allows(&self, from: State, growth: i32, slices: u16) -> bool {
        let jerk = self.jerk;
        let Some((after, settled)) = self.settled(from, growth, slices) else {
            return false;
        };
        let way =
            i64::from(from.speed) * i64::from(slices) + jerk.gained_way(from.ramp, growth, slices);
        let way = way.max(0).unsigned_abs();
        let fastest = settled.max(after.speed.into());
        let exceeds =
            |speed: u64, limit: PathLength| speed * speed > self.limits.squared_speed(limit);
        let passes = |place: u64, limit: PathLength| {
            // Speed as if it were linear along the way: too much where braking fades.
            let change = i64::from(after.speed) - i64::from(from.speed);
            let part = change * (place >> 12).cast_signed() / (way >> 12).max(1).cast_signed();
            let speed = (i64::from(from.speed) + part).unsigned_abs();
            let settled = jerk.settled(from);
            !exceeds(speed, limit)
                || (after.ramp <= 0
                    && !exceeds(settled - settled / 128, limit)
                    && jerk.braking_distance(from, self.limits.speed(limit).to_bits()) <= place)
        };
        let stop = jerk.braking_distance(after, 0);
        if let Some(blocks) = self.beyond {
            let left = (self.room + blocks.known()).saturating_sub(way);
            if stop >> 14 > blocks.stopping_distance_at(left >> 14, self.limits) {
                return false;
            }
        }
        // No speed looked at is too fast for limits from this one on.
        let harmless = self.limits.least_limit(fastest.max(from.speed.into()));
        let (enough, mut lowest) = (way.saturating_add(stop), PathLength::MAX);
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
            } else if end < way {
                if !passes(end, limit.min(curve_limit)) {
                    return false;
                }
            } else {
                if begin <= way && exceeds(settled, curve_limit) {
                    return false;
                }
                if end >= enough {
                    return true;
                }
                // A limit behind a lower one does not bind.
                if limit < lowest && exceeds(fastest, limit) {
                    lowest = limit;
                    let limit = self.limits.speed(limit).to_bits();
                    if end - way < jerk.braking_distance(after, limit) {
                        return false;
                    }
                }
            }
            curve_limit = block.curve_limit;
            (begin, end) = (end, end + (u64::from(block.length.to_bits()) << 14));
        }
        if begin <= way && exceeds(settled, curve_limit) {
            return false;
        }
        enough <= end
    }
}

#[cfg(test)]
mod tests {
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

    /// The way, mm, from a speed, mm/s, and ramp, braking as hard as possible for `first` slices
    /// and then less and less; and the speed then.
    fn braked(limit: JerkLimit, from: State, hard: f64) -> (f64, f64) {
        let jerk = f64::from(limit.jerk.get()) / 2f64.powi(40) / SLICE.powi(3);
        let (mut speed, mut way) = (f64::from(from.speed) / 2f64.powi(32) / SLICE, 0.0);
        let longest = f64::from(limit.longest) / 16.0 * SLICE;
        let (mut ramp, mut time, step) = (f64::from(from.ramp) / 16.0 * SLICE, 0.0, 1e-5);
        loop {
            ramp = if time < hard { (ramp - step).max(-longest) } else { ramp + step };
            if (time >= hard && ramp >= 0.0) || speed < 0.0 {
                return (speed, way);
            }
            speed += jerk * ramp * step;
            way += speed * step;
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
                        if braked(limit, from, middle).0 > to {
                            short = middle
                        } else {
                            long = middle
                        }
                    }
                    let expected = braked(limit, from, long).1;
                    let scaled = (to * SLICE * 2f64.powi(32)) as u32;
                    let way = limit.braking_distance(from, scaled) as f64 / 2f64.powi(32);
                    assert!(
                        (way - expected).abs() < 0.01 * expected + 0.01,
                        "{way} mm, not {expected}"
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
                let road = Road { limits: &limits, jerk, top, room, curve_limit, beyond: None };
                let mut interval = road.next(state);
                while let Some(slice) = interval.next_slice(room) {
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
            core::iter::from_fn(|| interval.next_slice(room))
                .map(|slice| (u64::from(slice.distance), u64::from(slice.time)))
                .fold((0, 0), |sum, slice| (sum.0 + slice.0, sum.1 + slice.1))
        };
        assert_eq!(all(u64::MAX), all(10_000_019));
        assert_eq!(all(0), (0, 0));
    }
}
