//! The sub-problems: every matching divides the points into lower ends P and higher ends Q, and a
//! division is an assignment problem of half the order (Harrison 6.3, 6.4, 6.16).

use super::image::{ImplicitCosts, members};
use super::work_counter::WorkCounter;
use super::{EnumerationError, set_of};
use penup::stage::{OutOfScratch, Scratch};

/// A set of matchings: those in which the points of `p` are the lower ends of their pairs and those
/// of `q` the higher ends. One bit for each point.
///
/// The points of `p` and `q` come before all others. If there are others, this is a set of
/// sub-problems (6.16); if there are none, it is one sub-problem (6.3). As the ends are told apart,
/// every matching is in one sub-problem and no more (6.13).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    /// Lower ends.
    pub p: u64,
    /// Higher ends.
    pub q: u64,
}

impl Division {
    /// The points that are neither.
    fn open(self, count: usize) -> u64 {
        set_of(count) & !(self.p | self.q)
    }

    /// The points that `point` may be paired with.
    fn partners(self, point: usize) -> u64 {
        let above: u64 = !0 << point << 1;
        if self.p >> point & 1 != 0 {
            !self.p & above
        } else if self.q >> point & 1 != 0 {
            self.p & !above
        } else {
            !self.q & !(1 << point)
        }
    }
}

/// A lower bound of all matchings in `division` (6.4, and 6.16 if points are open); `None` if there
/// are none.
///
/// To the costs of the image problem it adds others by rows and columns: each point of P, of Q and
/// of the rest in turn takes what the distances still allow. A matching pairs P only with the rest,
/// so they allow more than in the image problem.
///
/// # Errors
/// [`OutOfScratch`] if 8 n² + 16 n bytes do not fit.
///
/// ```
/// use penup_host_tests::enumeration::{Distances, Division, ImplicitCosts, division_bound};
/// use penup::stage::Scratch;
/// let distances = Distances::new(4, &[1, 5, 6, 7, 8, 1]).unwrap();
/// let mut memory = [0; 32];
/// let mut scratch = Scratch::new(&mut memory);
/// let costs = ImplicitCosts::zero(distances, &mut scratch).unwrap();
/// let crossed = Division { p: 0b0011, q: 0b1100 };
/// assert_eq!(division_bound(&costs, crossed, scratch).unwrap(), Some(13));
/// ```
pub fn division_bound(
    costs: &ImplicitCosts<'_>,
    division: Division,
    mut scratch: Scratch<'_>,
) -> Result<Option<u64>, OutOfScratch> {
    let mut sub_problems = SubProblems::new(costs, &mut scratch)?;
    let added = sub_problems.bound(division, i64::MAX);
    Ok(added.map(|added| (costs.sum_in_halves() + added).unsigned_abs().div_ceil(2)))
}

/// The reduced distances, and which pairs are looked at.
pub(super) struct SubProblems<'a> {
    count: usize,
    /// Row by row, in halves.
    reduced: &'a mut [i64],
    /// For each point those it may be paired with at all.
    near: &'a mut [u64],
    /// Implicit costs of a division.
    added: &'a mut [i64],
}

impl<'a> SubProblems<'a> {
    pub fn new(costs: &ImplicitCosts<'_>, scratch: &mut Scratch<'a>) -> Result<Self, OutOfScratch> {
        let count = costs.distances().count();
        let reduced = scratch.take(count * count)?;
        let (near, added) = (scratch.take(count)?, scratch.take(count)?);
        for (a, row) in reduced.chunks_exact_mut(count.max(1)).enumerate() {
            near[a] = set_of(count) & !(1 << a);
            for b in members(near[a]) {
                row[b] = costs.reduced(a, b);
            }
        }
        Ok(Self { count, reduced, near, added })
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn reduced(&self, a: usize, b: usize) -> i64 {
        self.reduced[a * self.count + b]
    }

    /// Those that `point` may be paired with at all.
    pub fn near(&self, point: usize) -> u64 {
        self.near[point]
    }

    /// Keeps only the pairs that `keep` says (6.15).
    pub fn retain(&mut self, keep: impl Fn(usize, usize) -> bool) {
        for (a, near) in self.near.iter_mut().enumerate() {
            *near = members(*near).filter(|&b| keep(a, b)).fold(0, |set, b| set | 1 << b);
        }
    }

    /// What the matchings in `division` cost beyond the image problem at the least, in halves;
    /// `None` if there are none, or once it is plain that they cost more than `limit`.
    pub fn bound(&mut self, division: Division, limit: i64) -> Option<i64> {
        self.added.fill(0);
        let mut sum = 0;
        for set in [division.p, division.q, division.open(self.count)] {
            for point in members(set) {
                let row = &self.reduced[point * self.count..][..self.count];
                let partners = members(division.partners(point) & self.near[point]);
                let least = partners.map(|other| row[other] - self.added[other]).min()?;
                self.added[point] = least;
                sum += least;
                if sum > limit {
                    return None;
                }
            }
        }
        Some(sum)
    }
}

/// The best matching of one sub-problem, found by solving its assignment problem (7.5).
///
/// Harrison used Silver's algorithm; this is the one of shortest augmenting paths, n³.
pub(super) struct Assignment<'a> {
    /// Dual costs of P and Q; those at 0 belong to nobody.
    p_cost: &'a mut [i64],
    q_cost: &'a mut [i64],
    slack: &'a mut [i64],
    /// Who of P has a place of Q, 1 on; 0 for nobody.
    holder: &'a mut [u8],
    before: &'a mut [u8],
}

impl<'a> Assignment<'a> {
    pub fn new(count: usize, scratch: &mut Scratch<'a>) -> Result<Self, OutOfScratch> {
        let places = count / 2 + 1;
        let (p_cost, q_cost) = (scratch.take(places)?, scratch.take(places)?);
        let (slack, holder) = (scratch.take(places)?, scratch.take(places)?);
        Ok(Self { p_cost, q_cost, slack, holder, before: scratch.take(places)? })
    }

    /// Writes the best matching of `division` into `pairs` and returns its reduced cost in halves;
    /// `None` if all cost more than `limit`.
    pub fn solve(
        &mut self,
        sub_problems: &SubProblems<'_>,
        division: Division,
        limit: i64,
        work_counter: &mut WorkCounter<'_>,
        pairs: &mut [[u8; 2]],
    ) -> Result<Option<i64>, EnumerationError> {
        let too_much = limit + 1;
        let cost = |p: usize, q: usize| {
            let allowed = p < q && sub_problems.near(p) >> q & 1 != 0;
            if allowed { sub_problems.reduced(p, q).min(too_much) } else { too_much }
        };
        self.p_cost.fill(0);
        self.q_cost.fill(0);
        self.holder.fill(0);
        let nth = |set: u64, place: u8| members(set).nth(usize::from(place) - 1).unwrap_or(0);
        for row in 1..=division.p.count_ones() as u8 {
            self.holder[0] = row;
            self.slack.fill(i64::MAX);
            let (mut place, mut tree) = (0usize, 1u64);
            while self.holder[place] != 0 {
                work_counter.work(pairs.len() as u32 / 4)?;
                let holder = self.holder[place];
                let p = nth(division.p, holder);
                let (mut step, mut next) = (i64::MAX, 0);
                for (column, q) in (1..).zip(members(division.q)) {
                    if tree >> column & 1 != 0 {
                        continue;
                    }
                    let slack = cost(p, q) - self.p_cost[usize::from(holder)] - self.q_cost[column];
                    if slack < self.slack[column] {
                        self.slack[column] = slack;
                        self.before[column] = place as u8;
                    }
                    if self.slack[column] < step {
                        (step, next) = (self.slack[column], column);
                    }
                }
                for column in 0..=pairs.len() {
                    if tree >> column & 1 != 0 {
                        self.p_cost[usize::from(self.holder[column])] += step;
                        self.q_cost[column] -= step;
                    } else {
                        self.slack[column] -= step;
                    }
                }
                place = next;
                tree |= 1 << place;
            }
            while place != 0 {
                let before = usize::from(self.before[place]);
                self.holder[place] = self.holder[before];
                place = before;
            }
            // What the rows so far cost, and no more can undo it.
            if -self.q_cost[0] > limit {
                return Ok(None);
            }
        }
        let matched = members(division.q).zip(self.holder.iter().skip(1));
        for (pair, (q, &holder)) in pairs.iter_mut().zip(matched) {
            *pair = [nth(division.p, holder) as u8, q as u8];
        }
        pairs.sort_unstable();
        Ok(Some(-self.q_cost[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Distances;
    use super::*;
    use penup::stage::NeverCancel;

    const EXAMPLE_6_4_1: [[u32; 4]; 4] = [[2, 2, 1, 3], [4, 3, 6, 5], [3, 2, 1, 8], [1, 4, 3, 5]];
    const HALVES: Division = Division { p: 0b0000_1111, q: 0b1111_0000 };

    /// The matrix E of the example as a quarter of that of eight points. All other distances are 0:
    /// they must not count.
    fn example_6_4_1() -> [u32; 28] {
        let mut below = [0; 28];
        for (p, row) in EXAMPLE_6_4_1.iter().enumerate() {
            for (q, &distance) in row.iter().enumerate() {
                let higher = q + 4;
                below[higher * (higher - 1) / 2 + p] = distance;
            }
        }
        below
    }

    #[test]
    fn example_6_4_1_has_the_bound_8() {
        let below = example_6_4_1();
        let mut memory = [0; 200];
        let mut scratch = Scratch::new(&mut memory);
        let costs = ImplicitCosts::zero(Distances::new(8, &below).unwrap(), &mut scratch).unwrap();
        let mut sub_problems = SubProblems::new(&costs, &mut scratch).unwrap();
        assert_eq!(sub_problems.bound(HALVES, 100), Some(16));
        assert_eq!(sub_problems.added, [2, 6, 2, 2, 0, 0, 0, 4], "a = 1 3 1 1, b = 0 0 0 2");
        assert_eq!(sub_problems.bound(HALVES, 15), None);
        assert_eq!(division_bound(&costs, HALVES, scratch), Ok(Some(8)));
    }

    #[test]
    fn the_assignment_of_example_6_4_1_is_solved() {
        let below = example_6_4_1();
        let mut memory = [0; 200];
        let mut scratch = Scratch::new(&mut memory);
        let costs = ImplicitCosts::zero(Distances::new(8, &below).unwrap(), &mut scratch).unwrap();
        let sub_problems = SubProblems::new(&costs, &mut scratch).unwrap();
        let mut assignment = Assignment::new(8, &mut scratch).unwrap();
        let mut cancel = NeverCancel;
        let mut work_counter = WorkCounter::new(&mut cancel);
        let mut pairs = [[0; 2]; 4];
        let cost = assignment.solve(&sub_problems, HALVES, 16, &mut work_counter, &mut pairs);
        assert_eq!(cost, Ok(Some(16)), "3 + 3 + 1 + 1, as little as the bound");
        assert_eq!(pairs, [[0, 7], [1, 5], [2, 6], [3, 4]]);
        let cost = assignment.solve(&sub_problems, HALVES, 15, &mut work_counter, &mut pairs);
        assert_eq!(cost, Ok(None));
    }

    #[test]
    fn a_higher_end_needs_a_lower_one_below_it() {
        let mut memory = [0; 100];
        let mut scratch = Scratch::new(&mut memory);
        let distances = Distances::new(4, &[1; 6]).unwrap();
        let costs = ImplicitCosts::zero(distances, &mut scratch).unwrap();
        let none_below = Division { p: 0b0110, q: 0b1001 };
        assert_eq!(division_bound(&costs, none_below, scratch), Ok(None));
    }

    #[test]
    fn open_points_may_be_paired_with_each_other() {
        let mut memory = [0; 200];
        let mut scratch = Scratch::new(&mut memory);
        // 0-1 and 2-3 cost 1, all else 9.
        let distances = Distances::new(4, &[1, 9, 9, 9, 9, 1]).unwrap();
        let costs = ImplicitCosts::zero(distances, &mut scratch).unwrap();
        let one_apart = Division { p: 0b0001, q: 0 };
        assert_eq!(division_bound(&costs, one_apart, scratch.reborrow()), Ok(Some(2)));
        let two_apart = Division { p: 0b0011, q: 0 };
        assert_eq!(division_bound(&costs, two_apart, scratch), Ok(Some(18)));
    }
}
