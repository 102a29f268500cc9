//! A tour as a cycle of legs in which stretches can be reversed and swapped, and these changes
//! undone. A leg is a run of segments together with the direction in which the pen draws it.
//!
//! The cycle has no direction of its own: each leg of it may be named as it is drawn or flipped,
//! and [the next leg](Cycle::next) follows from that. An open path is a cycle with one leg more,
//! the *gap*. It has no stations; its distance from everything is 0.

use super::Leg;
use crate::array::MapEach;
use crate::index::Index;
use core::ops::Range;

// Why no index in this file can fail:
// * A leg has a number below `legs.len()`, because it is a chain of the network, or the gap, which
//   has the number after those. `places` is as long as `legs`.
// * `places` holds indices of `legs`: it begins with zeros, and nothing else is written to it.
// * The difference of two indices, in either direction, is below `legs.len()`. So a stretch that is
//   turned begins at an index, and is at most as long as the cycle. Where it passes the end of
//   `legs` it goes on at 0.

/// The cycle, and how it changed since it was last [settled](Cycle::settle).
pub(super) struct Cycle<'s, I> {
    /// The legs of the tour, in the order in which they are drawn.
    legs: &'s mut [Leg<I>],
    /// Where each leg is stored, by the number of its chain (see `network`): twice the index in
    /// `legs`, plus 1 if it is stored reversed. The gap has the number after those of the chains.
    places: &'s mut [I],
    /// The reversals since the cycle was last settled, so that they can be undone: the index of the
    /// first leg, and the number of legs.
    turns: &'s mut [[I; 2]],
    /// The number of turns in `turns`. Further turns are made but cannot be undone.
    turned: usize,
}

/// Where in a cycle a leg is stored, and in which direction. It is valid until the next reversal.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegPosition {
    /// The index of the leg among all legs of the cycle, as it is stored.
    index: usize,
    /// Whether the leg has the direction in which the cycle is stored.
    forward: bool,
}

/// A leg from which others are counted, in its direction.
#[derive(Debug, Clone, Copy)]
pub(super) struct Origin {
    /// The index of the leg, with its bits inverted if the leg does not run forward. This turns the
    /// order of the indices around.
    index: usize,
    /// The bits that are inverted: all or none.
    turned: usize,
}

impl Origin {
    /// Counts from the leg at a position.
    pub fn new(LegPosition { index, forward }: LegPosition) -> Self {
        let turned = usize::from(forward).wrapping_sub(1);
        Self { index: index ^ turned, turned }
    }
}

impl<'s, I: Index> Cycle<'s, I> {
    /// The number of reversals that can be remembered, and so undone.
    pub const MEMORY: usize = 256;

    /// Makes the cycle of `legs`, which contain each of the numbers `0..legs.len()` once. `places`
    /// must be as long as `legs`, and `turns` must have [`Cycle::MEMORY`] entries.
    pub fn new(legs: &'s mut [Leg<I>], places: &'s mut [I], turns: &'s mut [[I; 2]]) -> Self {
        for (index, leg) in legs.iter().enumerate() {
            places[leg.segment()] = place(index, *leg);
        }
        Self { legs, places, turns, turned: 0 }
    }

    /// Returns the number of legs of the tour, the gap included.
    pub fn len(&self) -> usize {
        self.legs.len()
    }

    /// Returns the leg that is stored at `index`.
    pub fn leg(&self, index: usize) -> Leg<I> {
        self.legs[index]
    }

    /// Returns at which index of the cycle a leg is stored, in either direction.
    fn index(&self, leg: Leg<I>) -> usize {
        (self.places[leg.segment()] >> 1).get()
    }

    /// Returns where in the cycle a leg is stored, and whether it is stored in the direction of
    /// `leg`.
    pub fn position(&self, leg: Leg<I>) -> LegPosition {
        let place = self.places[leg.segment()];
        LegPosition { index: (place >> 1).get(), forward: (place ^ leg.code()) & I::ONE == I::ZERO }
    }

    /// Returns the leg after the one at `position`, in the direction of that leg.
    pub fn after(&self, position: LegPosition) -> Leg<I> {
        let LegPosition { index, forward } = position;
        let last = self.legs.len() - 1;
        let (end, other_end) = if forward { (last, 0) } else { (0, last) };
        // A step back is a step of -1.
        let step = usize::from(forward).wrapping_mul(2).wrapping_sub(1);
        let leg = self.legs[if index == end { other_end } else { index.wrapping_add(step) }];
        Leg::from_code(leg.code() ^ if forward { I::ZERO } else { I::ONE })
    }

    /// Returns the leg before the one at `position`, in the direction of that leg.
    pub fn before(&self, position: LegPosition) -> Leg<I> {
        self.after(LegPosition { forward: !position.forward, ..position }).flipped()
    }

    /// Returns the leg after `leg`, in the direction of `leg`.
    pub fn next(&self, leg: Leg<I>) -> Leg<I> {
        self.after(self.position(leg))
    }

    /// Returns the leg before `leg`, in the direction of `leg`.
    pub fn previous(&self, leg: Leg<I>) -> Leg<I> {
        self.before(self.position(leg))
    }

    /// Returns how many legs after `from` the position of `to` comes, in the direction of `from`.
    pub fn legs_between(&self, from: LegPosition, to: LegPosition) -> usize {
        self.legs_after(Origin::new(from), to.index)
    }

    /// Returns how many legs after `origin` the leg at `index` comes.
    #[inline]
    fn legs_after(&self, origin: Origin, index: usize) -> usize {
        let between = (index ^ origin.turned).wrapping_sub(origin.index);
        // No processor foresees whether it is negative, so there is no branch.
        let negative = (between.cast_signed() >> (usize::BITS - 1)).cast_unsigned();
        between.wrapping_add(negative & self.legs.len())
    }

    /// Returns whether `leg` runs in the direction of `origin`, and how many moves come between
    /// that after `origin` and that before `leg`.
    #[inline]
    pub fn moves_between(&self, origin: Origin, leg: Leg<I>) -> (bool, usize) {
        let place = self.places[leg.segment()];
        let differs = usize::from((place ^ leg.code()) & I::ONE != I::ZERO);
        let onward = differs ^ (origin.turned & 1) ^ 1;
        let origin = Origin { index: origin.index.wrapping_add(onward), ..origin };
        (onward != 0, self.legs_after(origin, (place >> 1).get()))
    }

    /// Returns how many legs after `from` the leg `to` comes, in the direction of `from`.
    pub fn steps(&self, from: Leg<I>, to: Leg<I>) -> usize {
        self.legs_between(self.position(from), self.position(to))
    }

    /// Reverses the stretch after `a` up to `c`: makes `… a, c … b, d …` from `… a, b … c, d …`,
    /// with the legs `b` to `c` flipped. `a` and `c` must have the same direction. Returns the
    /// number of legs that were moved.
    pub fn turn(&mut self, a: Leg<I>, c: Leg<I>) -> usize {
        let inner = self.steps(a, c);
        let (index_a, index_c) = (self.index(a), self.index(c));
        let outer = self.legs.len() - inner;
        let after = |index: usize| if index + 1 == self.legs.len() { 0 } else { index + 1 };
        // To reverse the rest of the cycle instead gives the same cycle, so the shorter stretch is
        // reversed.
        let (begin, count) = match (self.position(a).forward, inner <= outer) {
            (true, true) => (after(index_a), inner),
            (true, false) => (after(index_c), outer),
            (false, true) => (index_c, inner),
            (false, false) => (index_a, outer),
        };
        self.turn_around(begin, count);
        if let Some(turn) = self.turns.get_mut(self.turned) {
            *turn = [I::new(begin), I::new(count)];
            self.turned += 1;
        }
        count
    }

    /// Returns how many legs a turn moves that makes `inner` legs go the other way.
    pub fn turned_by(&self, inner: usize) -> usize {
        inner.min(self.legs.len() - inner)
    }

    /// Swaps two neighbouring stretches: makes `… a, d … e, b … c, f …` from `… a, b … c, d … e, f
    /// …`. `a`, `d` and `e` must have the same direction. Returns the number of legs that were
    /// moved.
    pub fn swap(&mut self, a: Leg<I>, d: Leg<I>, e: Leg<I>) -> usize {
        if I::HAS_ROOM
            && let Some(moved) = self.swap_at_once(a, d, e)
        {
            return moved;
        }
        let b = self.next(a);
        self.turn(a, e) + self.turn(a, d.flipped()) + self.turn(e, b.flipped())
    }

    /// As [`Self::swap`], with each leg moved once. The three turns are remembered as if they had
    /// been made. `None` if they do not all concern the same slice.
    fn swap_at_once(&mut self, a: Leg<I>, d: Leg<I>, e: Leg<I>) -> Option<usize> {
        let (count, last) = (self.steps(a, e), self.steps(d, e) + 1);
        if 2 * count > self.legs.len() {
            // The first turn would reverse the rest of the cycle.
            return None;
        }
        let first = count - last;
        let forward = self.position(a).forward;
        let begin = if forward { self.index(a) + 1 } else { self.index(e) };
        let stretch = self.legs.get_mut(begin..begin + count)?;
        let turns = self.turns.get_mut(self.turned..self.turned + 3)?;
        stretch.rotate_left(if forward { first } else { last });
        // In the direction of `a`, the stretch that was last comes first.
        let (last_begin, first_begin) =
            if forward { (begin, begin + last) } else { (begin + first, begin) };
        let made = [(begin, count), (last_begin, last), (first_begin, first)];
        for (turn, (begin, count)) in turns.iter_mut().zip(made) {
            *turn = [I::new(begin), I::new(count)];
        }
        self.turned += 3;
        self.note(begin..begin + count);
        Some(2 * count)
    }

    /// Notes where the legs of a range of indices are.
    fn note(&mut self, range: Range<usize>) {
        let mut place_forward = I::new(range.start) << 1;
        for leg in self.legs.get(range).unwrap_or(&[]) {
            self.places[leg.segment()] = place_forward | leg.code() & I::ONE;
            place_forward += I::ONE + I::ONE;
        }
    }

    /// Reverses `count` legs from index `begin` on, and flips each.
    fn turn_around(&mut self, begin: usize, count: usize) {
        let all = self.legs.len();
        let end = begin + count;
        if I::HAS_ROOM && end <= all {
            return self.turn_pairs(begin, end);
        }
        let (mut low, mut high) = (begin, end - 1);
        if high >= all {
            high -= all;
        }
        for _ in 0..count / 2 {
            let (first, last) = (self.legs[low].flipped(), self.legs[high].flipped());
            self.set(low, last);
            self.set(high, first);
            low = if low + 1 == all { 0 } else { low + 1 };
            high = if high == 0 { all - 1 } else { high - 1 };
        }
        if count % 2 == 1 {
            self.set(low, self.legs[low].flipped());
        }
    }

    /// As [`Self::turn_around`], for the legs from index `begin` to the one before `end`, which are
    /// one slice.
    fn turn_pairs(&mut self, begin: usize, end: usize) {
        let middle = begin + (end - begin) / 2;
        let (lows, highs) = self.legs[begin..end].split_at_mut(middle - begin);
        let (mut low_place, mut high_place) = (I::new(begin) << 1, I::new(end) << 1);
        for (low, high) in lows.iter_mut().zip(highs.iter_mut().rev()) {
            high_place -= I::ONE + I::ONE;
            // Both places change by the same bits: those in which the indices differ, and the
            // direction.
            let change = low_place ^ high_place ^ I::ONE;
            self.places[low.segment()] ^= change;
            self.places[high.segment()] ^= change;
            (*low, *high) = (high.flipped(), low.flipped());
            low_place += I::ONE + I::ONE;
        }
        if (end - begin) % 2 == 1 {
            self.set(middle, self.legs[middle].flipped());
        }
    }

    /// Stores `leg` at an index, and notes where it is.
    fn set(&mut self, index: usize, leg: Leg<I>) {
        self.legs[index] = leg;
        self.places[leg.segment()] = place(index, leg);
    }

    /// Returns how many reversals have been made since the cycle was last settled and can be
    /// undone.
    pub fn turned(&self) -> usize {
        self.turned
    }

    /// Whether there is memory to undo all the reversals of one more exchange.
    pub fn can_turn(&self) -> bool {
        self.turned + 16 <= self.turns.len()
    }

    /// Undoes all reversals after the first `count`.
    pub fn take_back(&mut self, count: usize) {
        if I::HAS_ROOM {
            return self.take_back_at_once(count);
        }
        while self.turned > count {
            self.turned -= 1;
            // There are never more turns than are kept.
            let [begin, count] = self.turns.get(self.turned).copied().unwrap_or_default();
            self.turn_around(begin.get(), count.get());
        }
    }

    /// As [`Self::take_back`], but a leg that several reversals have moved is noted once.
    fn take_back_at_once(&mut self, count: usize) {
        // The legs that were moved, but are still to be noted.
        let mut moved = 0..0;
        while self.turned > count {
            self.turned -= 1;
            let [begin, count] = self.turns[self.turned].map_each(Index::get);
            let range = begin..begin + count;
            let Some(stretch) = self.legs.get_mut(range.clone()) else {
                self.note(core::mem::take(&mut moved));
                self.turn_around(begin, count);
                continue;
            };
            // Several legs are reversed at once, and then flipped at once.
            stretch.reverse();
            for leg in stretch {
                *leg = leg.flipped();
            }
            if moved.end < range.start || range.end < moved.start {
                self.note(core::mem::replace(&mut moved, range));
            } else {
                moved = moved.start.min(range.start)..moved.end.max(range.end);
            }
        }
        self.note(moved);
    }

    /// Accepts the cycle as it is: earlier reversals can no longer be undone.
    pub fn settle(&mut self) {
        self.turned = 0;
    }
}

/// Returns what [`Cycle::places`] holds of a leg that is stored at `index`.
fn place<I: Index>(index: usize, leg: Leg<I>) -> I {
    Leg::new(I::new(index), leg.reversed()).code()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers of the legs from leg 0 on, in its original direction; flipped legs are negative.
    fn picture(cycle: &Cycle<'_, u16>) -> [i8; 6] {
        let mut leg = Leg::new(0, false);
        [(); 6].map(|()| {
            let number = leg.segment() as i8;
            let shown = if leg.reversed() { -number } else { number };
            leg = cycle.next(leg);
            shown
        })
    }

    fn with_cycle(test: impl Fn(&mut Cycle<'_, u16>, &dyn Fn(u16) -> Leg)) {
        let mut legs = [0, 1, 2, 3, 4, 5].map(|number| Leg::new(number, false));
        let (mut index, mut turns) = ([0; 6], [[0; 2]; Cycle::<u16>::MEMORY]);
        let mut cycle = Cycle::new(&mut legs, &mut index, &mut turns);
        let leg = |number| Leg::new(number, false);
        test(&mut cycle, &leg);
    }

    #[test]
    fn a_turn_flips_what_lies_between_or_the_rest() {
        with_cycle(|cycle, leg| {
            cycle.turn(leg(0), leg(2));
            assert_eq!(picture(cycle), [0, -2, -1, 3, 4, 5]);
            cycle.turn(leg(0), leg(5));
            assert_eq!(picture(cycle), [0, -5, -4, -3, 1, 2]);
            cycle.turn(leg(4), leg(0).flipped());
            assert_eq!(picture(cycle), [0, -5, -2, -1, 3, 4]);
            cycle.take_back(0);
            assert_eq!(picture(cycle), [0, 1, 2, 3, 4, 5]);
        });
    }

    #[test]
    fn a_swap_flips_nothing() {
        with_cycle(|cycle, leg| {
            cycle.swap(leg(0), leg(2), leg(4));
            assert_eq!(picture(cycle), [0, 2, 3, 4, 1, 5]);
            cycle.swap(leg(5).flipped(), leg(4).flipped(), leg(4).flipped());
            assert_eq!(picture(cycle), [0, 2, 3, 1, 4, 5]);
            cycle.swap(leg(5), leg(2), leg(1));
            assert_eq!(picture(cycle), [0, 4, 5, 2, 3, 1]);
        });
    }

    /// Makes changes that look random and undoes some of them. Returns a number that depends on
    /// where all legs were after each.
    fn trace<I: Index>(all: usize) -> u64 {
        let mut legs = [(); 40].map(|()| Leg::new(I::ZERO, false));
        for (leg, number) in legs.iter_mut().zip(I::all()) {
            *leg = Leg::new(number, false);
        }
        let (mut places, mut turns) = ([I::ZERO; 40], [[I::ZERO; 2]; Cycle::<u16>::MEMORY]);
        let mut cycle = Cycle::new(&mut legs[..all], &mut places[..all], &mut turns);
        let (mut random, mut trace) = (1u64, 0u64);
        let mut below = |limit: usize| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 33) as usize % limit
        };
        for _ in 0..2000 {
            let first = cycle.leg(below(all));
            let a = if below(2) == 0 { first } else { first.flipped() };
            let inner = 2 + below(all - 2);
            let middle = 1 + below(inner - 1);
            let after = |count: usize| (0..count).fold(a, |leg, _| cycle.next(leg));
            let (d, e) = (after(middle + 1), after(inner));
            let moved = match below(4) {
                0 => cycle.turn(a, e),
                1 | 2 => cycle.swap(a, d, e),
                _ => {
                    cycle.take_back(below(cycle.turned() + 1));
                    0
                }
            };
            if !cycle.can_turn() {
                cycle.settle();
            }
            for index in 0..all {
                let leg = cycle.leg(index);
                assert_eq!(cycle.index(leg), index);
                assert!(cycle.position(leg).forward && !cycle.position(leg.flipped()).forward);
                let code = u64::from(leg.code().into());
                trace = trace.wrapping_mul(31).wrapping_add(code + (moved << 8) as u64);
            }
        }
        trace
    }

    /// On a computer several turns are made at once.
    #[test]
    fn the_width_of_the_numbers_changes_no_turn() {
        for all in 4..=40 {
            assert_eq!(trace::<u16>(all), trace::<u32>(all), "{all} legs");
        }
    }
}
