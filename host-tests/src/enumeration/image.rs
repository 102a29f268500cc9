//! Lower bounds: the *image problem* (Harrison 6.6 to 6.11).
//!
//! Give each odd point an implicit cost U so that no two together exceed the distance between them.
//! Every point is in one pair of a matching, so no matching costs less than the sum of all U. The
//! image problem is to make that sum large; it is the dual of the matching problem without its odd
//! sets.

use super::{Distances, set_of};
use penup::stage::{OutOfScratch, Scratch};

/// A feasible solution of the image problem: implicit costs of the points of `distances`.
///
/// Having one guarantees U_i + U_j <= d(i, j) for all i != j. Costs are counted in *halves* of the
/// distances' unit, for the best solutions have halves in them.
///
/// ```
/// use penup_host_tests::enumeration::{Distances, ImplicitCosts};
/// use penup::stage::Scratch;
/// let distances = Distances::new(4, &[4, 3, 3, 3, 3, 4]).unwrap();
/// let mut memory = [0; 8];
/// let mut scratch = Scratch::new(&mut memory);
/// let mut costs = ImplicitCosts::by_largest_minimum(distances, &mut scratch).unwrap();
/// costs.improve();
/// assert_eq!(costs.lower_bound(), 6);
/// ```
#[derive(Debug)]
pub struct ImplicitCosts<'a> {
    distances: Distances<'a>,
    halves: &'a mut [i64],
}

impl<'a> ImplicitCosts<'a> {
    /// No costs at all, the solution that all others begin with.
    ///
    /// # Errors
    /// [`OutOfScratch`] if the 8 bytes for each point do not fit.
    pub fn zero(distances: Distances<'a>, scratch: &mut Scratch<'a>) -> Result<Self, OutOfScratch> {
        Ok(Self { distances, halves: scratch.take(distances.count())? })
    }

    /// Method 1 (6.10.1): of the points that touch no segment of the image graph yet, raise the one
    /// whose least reduced distance is the rarest, then the largest, then the lowest numbered.
    ///
    /// Few segments of the image graph arise, so many points get a cost.
    ///
    /// # Errors
    /// [`OutOfScratch`] if the 8 bytes for each point do not fit.
    pub fn by_rarest_minimum(
        distances: Distances<'a>,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        Self::raise_in_turn(distances, scratch, |least, how_often| (64 - how_often, least))
    }

    /// Method 2 (6.10.3): the same, but raise the point whose least reduced distance is the
    /// largest.
    ///
    /// # Errors
    /// [`OutOfScratch`] if the 8 bytes for each point do not fit.
    pub fn by_largest_minimum(
        distances: Distances<'a>,
        scratch: &mut Scratch<'a>,
    ) -> Result<Self, OutOfScratch> {
        Self::raise_in_turn(distances, scratch, |least, _| least)
    }

    fn raise_in_turn<Merit: Ord>(
        distances: Distances<'a>,
        scratch: &mut Scratch<'a>,
        merit: impl Fn(i64, u32) -> Merit,
    ) -> Result<Self, OutOfScratch> {
        let costs = Self::zero(distances, scratch)?;
        loop {
            // The first of those with the greatest merit: the last of the reversed.
            let chosen = (0..distances.count())
                .rev()
                .filter_map(|point| {
                    let (least, how_often) = costs.least_reduced(point)?;
                    (least > 0).then(|| (merit(least, how_often), point, least))
                })
                .max_by(|(one, ..), (other, ..)| one.cmp(other));
            let Some((_, point, least)) = chosen else {
                return Ok(costs);
            };
            costs.halves[point] += least;
        }
    }

    /// The least reduced distance of a point and how often it occurs.
    fn least_reduced(&self, point: usize) -> Option<(i64, u32)> {
        let others = || (0..self.distances.count()).filter(move |&other| other != point);
        let least = others().map(|other| self.reduced(point, other)).min()?;
        let how_often = others().filter(|&other| self.reduced(point, other) == least).count();
        Some((least, how_often as u32))
    }

    /// Improves the solution (6.11) until no part of the image graph allows it.
    ///
    /// Where a part of the image graph can be labelled + and - so that no two adjacent points have
    /// the same sign, the costs of the larger side rise and those of the smaller fall by the same
    /// amount until a new segment arises. Harrison asks for a tree; a loop of even length allows
    /// the labels as well. A new segment joins two parts or makes an odd loop, so this ends within
    /// as many steps as there are points.
    pub fn improve(&mut self) {
        let all = set_of(self.distances.count());
        let mut unseen = all;
        while unseen != 0 {
            let part = self.label(unseen.trailing_zeros() as usize);
            if part.odd_loop || part.plus.count_ones() == part.minus.count_ones() {
                unseen &= !(part.plus | part.minus);
                continue;
            }
            let (rising, falling) = if part.plus.count_ones() > part.minus.count_ones() {
                (part.plus, part.minus)
            } else {
                (part.minus, part.plus)
            };
            let Some(step) = self.largest_step(rising, falling) else {
                return;
            };
            for point in members(rising) {
                self.halves[point] += step;
            }
            for point in members(falling) {
                self.halves[point] -= step;
            }
            unseen = all;
        }
    }

    /// Labels the part of the image graph that holds `root`.
    fn label(&self, root: usize) -> Part {
        let mut part = Part { plus: 1 << root, minus: 0, odd_loop: false };
        let mut open = part.plus;
        while open != 0 {
            let point = open.trailing_zeros() as usize;
            open &= open - 1;
            let near = self.image_graph_at(point);
            let (same, opposite) = if part.plus >> point & 1 != 0 {
                (part.plus, &mut part.minus)
            } else {
                (part.minus, &mut part.plus)
            };
            part.odd_loop |= near & same != 0;
            open |= near & !same & !*opposite;
            *opposite |= near & !same;
        }
        part
    }

    /// How far the costs of `rising` may rise while those of `falling` fall: δ = min(δ+, δr).
    fn largest_step(&self, rising: u64, falling: u64) -> Option<i64> {
        let others = set_of(self.distances.count()) & !rising & !falling;
        let pairs = members(rising).flat_map(|point| {
            let rest = members(rising & !(1 << point)).map(move |other| (point, other, 2));
            rest.chain(members(others).map(move |other| (point, other, 1)))
        });
        // Costs of one part are all whole or all halves, so the reduced distance of two of its
        // points is a whole unit, and half of it a whole number of halves.
        pairs.map(|(point, other, share)| self.reduced(point, other) / share).min()
    }

    /// The distances that the costs are of.
    pub fn distances(&self) -> Distances<'a> {
        self.distances
    }

    /// The implicit costs, in halves of a unit.
    pub fn halves(&self) -> &[i64] {
        self.halves
    }

    /// Twice the sum of the costs.
    pub fn sum_in_halves(&self) -> i64 {
        self.halves.iter().sum()
    }

    /// What no matching can go below: the sum of the costs rounded up to a whole unit (6.6).
    pub fn lower_bound(&self) -> u64 {
        // Never negative: the methods begin at zero and every step adds.
        self.sum_in_halves().unsigned_abs().div_ceil(2)
    }

    /// δC: the distance of two points less their implicit costs, in halves; 0 or more.
    pub fn reduced(&self, a: usize, b: usize) -> i64 {
        2 * i64::from(self.distances.get(a, b)) - self.halves[a] - self.halves[b]
    }

    /// The points that `point` is linked to in the *image graph*, one bit each: those at a reduced
    /// distance of 0.
    pub fn image_graph_at(&self, point: usize) -> u64 {
        (0..self.distances.count())
            .filter(|&other| other != point && self.reduced(point, other) == 0)
            .fold(0, |near, other| near | 1 << other)
    }

    /// Harrison's criterion for optimality (6.7): the reduced distances of `pairs` are zero and all
    /// others are not.
    ///
    /// The first half alone proves the matching optimal, the second that no other is as good; so
    /// the criterion fails on many an optimum (6.8.2).
    pub fn meets_criterion(&self, pairs: &[[u8; 2]]) -> bool {
        let paired = |point: usize| {
            pairs.iter().fold(0u64, |set, &[a, b]| match point {
                _ if point == usize::from(a) => set | 1 << b,
                _ if point == usize::from(b) => set | 1 << a,
                _ => set,
            })
        };
        (0..self.distances.count()).all(|point| self.image_graph_at(point) == paired(point))
    }
}

/// A connected part of the image graph, its points labelled.
struct Part {
    plus: u64,
    minus: u64,
    /// Two adjacent points have the same sign.
    odd_loop: bool,
}

/// The numbers of the bits that are set, ascending.
pub(super) fn members(mut set: u64) -> impl Iterator<Item = usize> + Clone {
    core::iter::from_fn(move || {
        let lowest = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        lowest
    })
}

#[cfg(test)]
mod tests {
    use super::super::EXAMPLE_6_10;
    use super::*;

    type Method<'a> =
        fn(Distances<'a>, &mut Scratch<'a>) -> Result<ImplicitCosts<'a>, OutOfScratch>;

    fn solve<'a>(below: &'a [u32], memory: &'a mut [u64], method: Method<'a>) -> ImplicitCosts<'a> {
        let distances = Distances::new(6, below).unwrap();
        method(distances, &mut Scratch::new(memory)).unwrap()
    }

    fn segments(costs: &ImplicitCosts<'_>) -> u32 {
        (0..6).map(|point| costs.image_graph_at(point).count_ones()).sum::<u32>() / 2
    }

    #[test]
    fn example_6_10_2_method_1() {
        let mut memory = [0; 6];
        let costs = solve(&EXAMPLE_6_10, &mut memory, ImplicitCosts::by_rarest_minimum);
        assert_eq!(costs.halves(), [4, 0, 4, 2, 2, 0]);
        assert_eq!(costs.lower_bound(), 6);
        assert_eq!(segments(&costs), 6, "twelve zeros in the matrix");
    }

    /// The text adds up to 7 because it writes 2 for U_2, which it has just found to be 1. The
    /// optimum is 6.
    #[test]
    fn example_6_10_4_method_2() {
        let mut memory = [0; 6];
        let costs = solve(&EXAMPLE_6_10, &mut memory, ImplicitCosts::by_largest_minimum);
        assert_eq!(costs.halves(), [6, 2, 2, 0, 2, 0]);
        assert_eq!(costs.lower_bound(), 6);
        assert_eq!(segments(&costs), 7, "fourteen zeros in the matrix");
    }

    #[test]
    fn example_6_8_1_meets_the_criterion() {
        let mut memory = [0; 6];
        let below = [6, 3, 5, 5, 2, 5, 6, 8, 6, 5, 7, 9, 7, 6, 2];
        let costs = solve(&below, &mut memory, ImplicitCosts::by_rarest_minimum);
        assert_eq!(costs.halves(), [6, 4, 0, 0, 4, 0]);
        assert_eq!(costs.lower_bound(), 7);
        assert!(costs.meets_criterion(&[[0, 2], [1, 3], [4, 5]]));
        assert!(!costs.meets_criterion(&[[0, 1], [2, 3], [4, 5]]));
    }

    #[test]
    fn example_6_8_2_is_optimal_but_fails_the_criterion() {
        let mut halves = [4, 2, 2, 2, 4, 0];
        let below = [6, 4, 2, 3, 3, 7, 7, 4, 6, 4, 2, 1, 5, 3, 2];
        let distances = Distances::new(6, &below).unwrap();
        let costs = ImplicitCosts { distances, halves: &mut halves };
        let optimum = [[0, 3], [1, 2], [4, 5]];
        assert_eq!(costs.lower_bound(), distances.cost(&optimum));
        assert!(!costs.meets_criterion(&optimum));
        let printed =
            [[9, 3, 1, 0, 3, 0], [3, 9, 0, 1, 1, 0], [1, 0, 9, 5, 3, 4], [0, 1, 5, 9, 1, 2]];
        for (row, reduced) in printed.iter().enumerate() {
            for (column, &units) in reduced.iter().enumerate().filter(|&(column, _)| column != row)
            {
                assert_eq!(costs.reduced(row, column), 2 * units, "{row} {column}");
            }
        }
    }

    #[test]
    fn example_6_11_improves_a_tree_by_halves() {
        // δC and U as printed; C = δC + U_i + U_j.
        let mut halves = [4, 2, 2, 4, 2, 0];
        let reduced = [1, 3, 0, 4, 0, 3, 2, 0, 2, 1, 0, 0, 4, 3, 4];
        let mut below = [0; 15];
        let mut next = 0;
        for row in 1..6 {
            for column in 0..row {
                below[next] = reduced[next] + (halves[row] + halves[column]) as u32 / 2;
                next += 1;
            }
        }
        let distances = Distances::new(6, &below).unwrap();
        let mut costs = ImplicitCosts { distances, halves: &mut halves };
        assert_eq!(costs.lower_bound(), 7);
        costs.improve();
        assert_eq!(costs.lower_bound(), 8);
        assert_eq!(costs.halves(), [3, 1, 3, 5, 3, 1]);
        assert_eq!(costs.image_graph_at(1), 0b111100);
        assert_eq!(costs.image_graph_at(3), 0b010010, "a loop of three points now");
    }

    #[test]
    fn two_points_are_their_own_bound() {
        let mut memory = [0; 2];
        let distances = Distances::new(2, &[u32::MAX]).unwrap();
        let mut scratch = Scratch::new(&mut memory);
        let mut costs = ImplicitCosts::by_rarest_minimum(distances, &mut scratch).unwrap();
        costs.improve();
        assert_eq!(costs.lower_bound(), u64::from(u32::MAX));
    }
}
