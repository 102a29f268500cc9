//! A tour as a cycle of legs that can be cut, turned and joined again, and back.
//!
//! The cycle has no direction of its own: every leg of it may be named as it is drawn or flipped,
//! and what comes [next](Cycle::next) follows from that. An open path is a cycle with one leg more,
//! the *gap*, from nowhere to nowhere, no distance from anywhere.

use super::Leg;

/// The cycle and how it came to be since it was last [settled](Cycle::settle).
pub(super) struct Cycle<'s> {
    legs: &'s mut [Leg],
    /// Where each chain (or the gap) stands.
    place: &'s mut [u16],
    /// The turns since: where they begin, and how many legs they turn.
    turns: &'s mut [[u16; 2]],
    turned: usize,
}

/// How a leg stands in a cycle: until the next turn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stand {
    place: usize,
    /// Whether the leg goes the way in which the cycle is stored.
    pub forward: bool,
}

impl<'s> Cycle<'s> {
    /// Turns that can be taken back.
    pub const MEMORY: usize = 256;

    /// The cycle of `legs`, which number all of `0..legs.len()`; `place` is as long, `turns` has
    /// place for [`Cycle::MEMORY`].
    pub fn new(legs: &'s mut [Leg], place: &'s mut [u16], turns: &'s mut [[u16; 2]]) -> Self {
        for (at, leg) in (0..).zip(legs.iter()) {
            place[leg.segment()] = at;
        }
        Self { legs, place, turns, turned: 0 }
    }

    /// How many legs there are.
    pub fn len(&self) -> usize {
        self.legs.len()
    }

    /// The leg that stands at `index`.
    pub fn leg(&self, index: usize) -> Leg {
        self.legs[index]
    }

    fn place(&self, leg: Leg) -> usize {
        usize::from(self.place[leg.segment()])
    }

    /// How `leg` stands in the cycle.
    pub fn stand(&self, leg: Leg) -> Stand {
        let place = self.place(leg);
        Stand { place, forward: self.legs[place] == leg }
    }

    /// The leg after the one that stands there, the way that it goes.
    pub fn after(&self, stand: Stand) -> Leg {
        let last = self.legs.len() - 1;
        let place = stand.place;
        if stand.forward {
            self.legs[if place == last { 0 } else { place + 1 }]
        } else {
            self.legs[if place == 0 { last } else { place - 1 }].flipped()
        }
    }

    /// The leg before the one that stands there, the way that it goes.
    pub fn before(&self, stand: Stand) -> Leg {
        self.after(Stand { forward: !stand.forward, ..stand }).flipped()
    }

    /// The leg after `leg`, the way that `leg` goes.
    pub fn next(&self, leg: Leg) -> Leg {
        self.after(self.stand(leg))
    }

    /// The leg before `leg`, the way that `leg` goes.
    pub fn previous(&self, leg: Leg) -> Leg {
        self.before(self.stand(leg))
    }

    /// How many legs after `from` the place of `to` comes, the way that the leg of `from` goes.
    pub fn way(&self, from: Stand, to: Stand) -> usize {
        let (begin, end) =
            if from.forward { (from.place, to.place) } else { (to.place, from.place) };
        if end >= begin { end - begin } else { end + self.legs.len() - begin }
    }

    /// How many legs after `from` the leg `to` comes, the way that `from` goes.
    pub fn steps(&self, from: Leg, to: Leg) -> usize {
        self.way(self.stand(from), self.stand(to))
    }

    /// From `… a, b … c, d …` makes `… a, c … b, d …`, `b` to `c` flipped. `a` and `c` go the same
    /// way. Returns how many legs it moved.
    pub fn turn(&mut self, a: Leg, c: Leg) -> usize {
        let inner = self.steps(a, c);
        let (place_a, place_c) = (self.place(a), self.place(c));
        let outer = self.legs.len() - inner;
        let after = |place: usize| if place + 1 == self.legs.len() { 0 } else { place + 1 };
        // Turning the rest instead gives the same cycle.
        let (begin, count) = match (self.stand(a).forward, inner <= outer) {
            (true, true) => (after(place_a), inner),
            (true, false) => (after(place_c), outer),
            (false, true) => (place_c, inner),
            (false, false) => (place_a, outer),
        };
        self.turn_around(begin, count);
        if let Some(turn) = self.turns.get_mut(self.turned) {
            *turn = [begin as u16, count as u16];
            self.turned += 1;
        }
        count
    }

    /// From `… a, b … c, d … e, f …` makes `… a, d … e, b … c, f …`. `a`, `d` and `e` go the same
    /// way. Returns how many legs it moved.
    pub fn swap(&mut self, a: Leg, d: Leg, e: Leg) -> usize {
        let b = self.next(a);
        self.turn(a, e) + self.turn(a, d.flipped()) + self.turn(e, b.flipped())
    }

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

    fn set(&mut self, place: usize, leg: Leg) {
        self.legs[place] = leg;
        self.place[leg.segment()] = place as u16;
    }

    /// How many turns have been taken since it was settled.
    pub fn turned(&self) -> usize {
        self.turned
    }

    /// Whether a few more turns can be remembered.
    pub fn can_turn(&self) -> bool {
        self.turned + 16 <= self.turns.len()
    }

    /// Takes back the turns after the first `count`.
    pub fn take_back(&mut self, count: usize) {
        while self.turned > count {
            self.turned -= 1;
            let [begin, count] = self.turns[self.turned];
            self.turn_around(usize::from(begin), usize::from(count));
        }
    }

    /// The cycle is good as it is: the turns need not be remembered.
    pub fn settle(&mut self) {
        self.turned = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cycle from leg 0 on, drawn as it was at first, flipped legs negative.
    fn picture(cycle: &Cycle<'_>) -> [i8; 6] {
        let mut leg = Leg::new(0, false);
        [(); 6].map(|()| {
            let number = leg.segment() as i8;
            let shown = if leg.reversed() { -number } else { number };
            leg = cycle.next(leg);
            shown
        })
    }

    fn with_cycle(test: impl Fn(&mut Cycle<'_>, &dyn Fn(u16) -> Leg)) {
        let mut legs = [0, 1, 2, 3, 4, 5].map(|number| Leg::new(number, false));
        let (mut place, mut turns) = ([0; 6], [[0; 2]; Cycle::MEMORY]);
        let mut cycle = Cycle::new(&mut legs, &mut place, &mut turns);
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
