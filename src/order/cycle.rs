//! A tour as a cycle of legs in which stretches can be reversed and swapped, and these changes
//! undone. A leg is a run of segments together with the direction in which the pen draws it.
//!
//! The cycle has no direction of its own: each leg of it may be named as it is drawn or flipped,
//! and [the next leg](Cycle::next) follows from that. An open path is a cycle with one leg more,
//! the *gap*. It has no stations; its distance from everything is 0.

use super::Leg;
use crate::index::Index;

/// The cycle, and how it changed since it was last [settled](Cycle::settle).
pub(super) struct Cycle<'s, I> {
    /// The legs of the tour, in the order in which they are drawn.
    legs: &'s mut [Leg<I>],
    /// The index in `legs` of each leg, by the number of its chain (see `network`); the gap has the
    /// number after those of the chains.
    index: &'s mut [I],
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
    pub forward: bool,
}

impl<'s, I: Index> Cycle<'s, I> {
    /// The number of reversals that can be remembered, and so undone.
    pub const MEMORY: usize = 256;

    /// Makes the cycle of `legs`, which contain each of the numbers `0..legs.len()` once. `index`
    /// must be as long as `legs`, and `turns` must have [`Cycle::MEMORY`] entries.
    pub fn new(legs: &'s mut [Leg<I>], index: &'s mut [I], turns: &'s mut [[I; 2]]) -> Self {
        for (at, leg) in I::all().zip(legs.iter()) {
            index[leg.segment()] = at;
        }
        Self { legs, index, turns, turned: 0 }
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
        self.index[leg.segment()].get()
    }

    /// Returns where in the cycle a leg is stored, and whether it is stored in the direction of
    /// `leg`.
    pub fn position(&self, leg: Leg<I>) -> LegPosition {
        let index = self.index(leg);
        LegPosition { index, forward: self.legs[index] == leg }
    }

    /// Returns the leg after the one at `position`, in the direction of that leg.
    pub fn after(&self, position: LegPosition) -> Leg<I> {
        let last = self.legs.len() - 1;
        let index = position.index;
        if position.forward {
            self.legs[if index == last { 0 } else { index + 1 }]
        } else {
            self.legs[if index == 0 { last } else { index - 1 }].flipped()
        }
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
        let (begin, end) =
            if from.forward { (from.index, to.index) } else { (to.index, from.index) };
        if end >= begin { end - begin } else { end + self.legs.len() - begin }
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

    /// Swaps two neighbouring stretches: makes `… a, d … e, b … c, f …` from `… a, b … c, d … e, f
    /// …`. `a`, `d` and `e` must have the same direction. Returns the number of legs that were
    /// moved.
    pub fn swap(&mut self, a: Leg<I>, d: Leg<I>, e: Leg<I>) -> usize {
        let b = self.next(a);
        self.turn(a, e) + self.turn(a, d.flipped()) + self.turn(e, b.flipped())
    }

    /// Reverses `count` legs from index `begin` on, and flips each.
    fn turn_around(&mut self, begin: usize, count: usize) {
        let all = self.legs.len();
        let (mut low, mut high) = (begin, begin + count - 1);
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

    /// Stores `leg` at an index, and notes where it is.
    fn set(&mut self, index: usize, leg: Leg<I>) {
        self.legs[index] = leg;
        self.index[leg.segment()] = I::new(index);
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
        while self.turned > count {
            self.turned -= 1;
            let [begin, count] = self.turns[self.turned];
            self.turn_around(begin.get(), count.get());
        }
    }

    /// Accepts the cycle as it is: earlier reversals can no longer be undone.
    pub fn settle(&mut self) {
        self.turned = 0;
    }
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
}
