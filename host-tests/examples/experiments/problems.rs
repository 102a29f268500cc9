//! The data: as random as Harrison's.

use penup::drawing::PagePoint;
use penup::order::length;
use penup_host_tests::enumeration::Distances;

/// How many instances of each problem there are.
pub const INSTANCES: u32 = 20;

/// RANDU, the generator of the IBM Scientific Subroutine Package that Harrison used.
#[derive(Debug, Clone)]
struct Randu(u32);

impl Randu {
    /// Harrison prints neither his matrices nor his seed. With this one the least costs are his up
    /// to 12 points (52, 56, 62, 87, 102). Up to 8 points the bounds and the heuristic's costs are
    /// his, too; at 10 the heuristic's cost is 87 and not 98, and from 12 on the bounds are not
    /// his.
    const SEED: u32 = 311_837_743;

    /// The first instance has that seed, the others have seeds of ours. All are odd, as RANDU
    /// needs.
    fn of_instance(instance: u32) -> Self {
        Self(Self::SEED.wrapping_add(instance.wrapping_mul(0x0765_4320)) & 0x7fff_ffff)
    }

    /// The next number from 0 to `limit` - 1.
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_mul(65539) & 0x7fff_ffff;
        ((u64::from(self.0) * u64::from(limit)) >> 31) as u32
    }
}

/// A pen-up problem with its own memory.
#[derive(Debug, Clone)]
pub struct Problem {
    pub count: usize,
    below_diagonal: Vec<u32>,
}

impl Problem {
    /// Distances from `least` to `least + range - 1`, each as likely, that need not meet the
    /// triangle inequality (7.1). The matrix of fewer points is a part of that of more, in one
    /// instance.
    pub fn of_matrix(instance: u32, count: usize, least: u32, range: u32) -> Self {
        let mut randu = Randu::of_instance(instance);
        let next = || least + randu.below(range);
        Self {
            count,
            below_diagonal: std::iter::repeat_with(next).take(count * (count - 1) / 2).collect(),
        }
    }

    /// The distances between points of a square page.
    pub fn of_points(instance: u32, count: usize) -> Self {
        let mut randu = Randu::of_instance(instance);
        let mut next = || randu.below(16_000) as i32;
        let random_point = || PagePoint { x: next(), y: next() };
        let points: Vec<PagePoint> = std::iter::repeat_with(random_point).take(count).collect();
        let rows = points.iter().enumerate();
        let below_diagonal =
            rows.flat_map(|(row, &a)| points[..row].iter().map(move |&b| length(a, b))).collect();
        Self { count, below_diagonal }
    }

    pub fn distances(&self) -> Distances<'_> {
        Distances::new(self.count, &self.below_diagonal).expect("an even number of points")
    }

    /// The longest of the `wanted` shortest distances.
    pub fn shortest(&self, wanted: usize) -> u32 {
        let mut sorted = self.below_diagonal.clone();
        sorted.sort_unstable();
        sorted[wanted - 1]
    }

    fn distance(&self, a: usize, b: usize) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        self.below_diagonal[high * (high - 1) / 2 + low]
    }

    /// The two nearest of the points that are not `paired`, and their distances; the second may be
    /// none.
    fn nearest(&self, point: usize, paired: &[bool]) -> [(u32, usize); 2] {
        let [mut first, mut second] = [(u32::MAX, point); 2];
        for other in (0..self.count).filter(|&other| other != point && !paired[other]) {
            let distance = self.distance(point, other);
            if distance < first.0 {
                (first, second) = ((distance, other), first);
            } else if distance < second.0 {
                second = (distance, other);
            }
        }
        [first, second]
    }

    /// What the pairs cost that Harrison's heuristic chooses (5.10.1), and nothing after it: the
    /// point whose second choice is worse than its first by the most is given its first, so to the
    /// end.
    pub fn cost_by_regret(&self) -> u64 {
        let mut paired = vec![false; self.count];
        let mut choices: Vec<[(u32, usize); 2]> =
            (0..self.count).map(|point| self.nearest(point, &paired)).collect();
        let mut cost = 0;
        for _ in 0..self.count / 2 {
            let regret = |point: &usize| choices[*point][1].0 - choices[*point][0].0;
            // The lowest number among equals.
            let unpaired = (0..self.count).rev().filter(|&point| !paired[point]);
            let Some(chooser) = unpaired.max_by_key(regret) else { break };
            let (distance, chosen) = choices[chooser][0];
            cost += u64::from(distance);
            (paired[chooser], paired[chosen]) = (true, true);
            for point in 0..self.count {
                let lost = choices[point].iter().any(|&(_, to)| to == chooser || to == chosen);
                if lost && !paired[point] {
                    choices[point] = self.nearest(point, &paired);
                }
            }
        }
        cost
    }
}
