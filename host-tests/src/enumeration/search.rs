//! Implicit enumeration: all divisions, but for those whose bound says that they hold nothing
//! better (Harrison 6.13 to 6.16).

use super::division::{Assignment, Division, SubProblems};
use super::image::members;
use super::work_counter::WorkCounter;
use super::{Effort, EnumerationError, Options, Sets, SubProblem, Target, set_of};
use penup::stage::{OutOfScratch, Scratch};

/// The search for better and better matchings.
pub(super) struct Search<'a, 's, 'p> {
    sub_problems: SubProblems<'a>,
    options: Options,
    work_counter: &'s mut WorkCounter<'p>,
    improved: &'s mut dyn FnMut(u64),
    /// The sum of the implicit costs of the image problem, in halves.
    base: i64,
    /// No matching costs less.
    floor: u64,
    /// A matching must cost less to be of interest.
    best: u64,
    /// A matching is taken if its reduced cost is no more, in halves.
    limit: i64,
    pairs: &'s mut [[u8; 2]],
    trial: &'a mut [[u8; 2]],
    assignment: Assignment<'a>,
    /// For each point those it may be paired with, in the order in which they are tried.
    candidates: &'a mut [u8],
    /// For each pair of the trial where in `candidates` it is.
    tried: &'a mut [u8],
    /// The reduced cost of the trial up to each pair.
    total: &'a mut [i64],
    pub effort: Effort,
}

/// What is known before the search.
pub(super) struct Known {
    pub base: i64,
    pub floor: u64,
    /// Only cheaper matchings are looked for.
    pub best: u64,
}

impl<'a, 's, 'p> Search<'a, 's, 'p> {
    /// `pairs` is written when something better is found.
    pub fn new(
        sub_problems: SubProblems<'a>,
        known: Known,
        options: Options,
        pairs: &'s mut [[u8; 2]],
        scratch: &mut Scratch<'a>,
        work_counter: &'s mut WorkCounter<'p>,
        improved: &'s mut dyn FnMut(u64),
    ) -> Result<Self, OutOfScratch> {
        let Known { base, floor, best } = known;
        let count = sub_problems.count();
        let candidates: &mut [u8] = scratch.take(count * count)?;
        for (point, row) in candidates.chunks_exact_mut(count.max(1)).enumerate() {
            for (place, other) in row.iter_mut().zip(0..) {
                *place = other;
            }
            if options.sorted {
                row.sort_unstable_by_key(|&other| {
                    (sub_problems.reduced(point, usize::from(other)), other)
                });
            }
        }
        Ok(Self {
            options,
            work_counter,
            improved,
            base,
            floor,
            best,
            limit: 0,
            pairs,
            trial: scratch.take(count / 2)?,
            assignment: Assignment::new(count, scratch)?,
            candidates,
            tried: scratch.take(count / 2)?,
            total: scratch.take(count / 2 + 1)?,
            sub_problems,
            effort: Effort::default(),
        })
    }

    /// Searches; what no matching can go below then, and what the best costs (or the `best` that
    /// was known).
    pub fn run(mut self) -> Result<(u64, u64, Effort), EnumerationError> {
        while self.floor < self.best {
            self.aim();
            self.enumerate()?;
            // Nothing costs as little as was aimed at.
            self.floor = self.floor.max(self.aim() + 1);
            if self.options.target == Target::Chopped {
                break;
            }
        }
        Ok((self.floor.min(self.best), self.best, self.effort))
    }

    /// Chooses what a matching may cost to be taken, and says it.
    fn aim(&mut self) -> u64 {
        let better = self.best.saturating_sub(1);
        let cost = match self.options.target {
            Target::Better => better,
            Target::Chopped | Target::ChoppedAndBacktracked => {
                (self.floor + (self.best - self.floor) / 2).min(better)
            }
        };
        self.limit = 2 * cost as i64 - self.base;
        cost
    }

    /// Goes through the divisions: of each next point, first that it is a lower end, then that it
    /// is a higher one.
    fn enumerate(&mut self) -> Result<(), EnumerationError> {
        let count = self.sub_problems.count();
        let half = count as u32 / 2;
        let (mut division, mut decided) = (Division { p: 1, q: 0 }, 1);
        loop {
            let complete = division.p.count_ones() == half;
            if complete {
                let whole = Division { p: division.p, q: set_of(count) & !division.p };
                self.examine(whole)?;
                if self.best <= self.floor {
                    return Ok(());
                }
            }
            if !complete && self.promises(division)? {
                division.p |= 1 << decided;
                decided += 1;
                continue;
            }
            loop {
                decided -= 1;
                if decided == 0 {
                    return Ok(());
                }
                let point = 1 << decided;
                division.q &= !point;
                if division.p & point != 0 {
                    division.p &= !point;
                    // Each higher end needs a lower one before it.
                    if division.p.count_ones() > division.q.count_ones() {
                        division.q |= point;
                        decided += 1;
                        break;
                    }
                }
            }
        }
    }

    /// Whether a set of sub-problems may hold what is looked for.
    fn promises(&mut self, set: Division) -> Result<bool, EnumerationError> {
        let depth = set.p.count_ones();
        let looked_at = match self.options.sets {
            Sets::None => false,
            Sets::AtDepth(at) => depth == u32::from(at) && set.p > set.q,
            Sets::FromDepth(from) => depth >= u32::from(from),
        };
        if !looked_at {
            return Ok(true);
        }
        self.effort.sets += 1;
        self.work_counter.work(self.sub_problems.count() as u32)?;
        let promising = self.sub_problems.bound(set, self.limit).is_some();
        self.effort.sets_skipped += u64::from(!promising);
        Ok(promising)
    }

    fn examine(&mut self, division: Division) -> Result<(), EnumerationError> {
        self.effort.sub_problems += 1;
        self.work_counter.work(self.sub_problems.count() as u32)?;
        if self.sub_problems.bound(division, self.limit).is_none() {
            return Ok(());
        }
        self.effort.examined += 1;
        match self.options.sub_problem {
            SubProblem::Pairings => self.try_pairings(division),
            SubProblem::Assignment => self.assign(division),
        }
    }

    fn assign(&mut self, division: Division) -> Result<(), EnumerationError> {
        self.effort.nodes += 1;
        let Self { sub_problems, work_counter, trial, .. } = self;
        let cost =
            self.assignment.solve(sub_problems, division, self.limit, work_counter, trial)?;
        if let Some(cost) = cost {
            self.take(cost);
        }
        Ok(())
    }

    /// Pairs the points of P with those of Q, from the lowest on, as long as that stays cheap
    /// enough.
    fn try_pairings(&mut self, division: Division) -> Result<(), EnumerationError> {
        let (count, half) = (self.sub_problems.count(), self.trial.len());
        for (pair, point) in self.trial.iter_mut().zip(members(division.p)) {
            pair[0] = point as u8;
        }
        let mut free = division.q;
        let mut level = 0;
        self.tried[0] = 0;
        loop {
            let point = usize::from(self.trial[level][0]);
            let place = usize::from(self.tried[level]);
            let Some(&other) = self.candidates[point * count..][..count].get(place) else {
                if level == 0 {
                    return Ok(());
                }
                level -= 1;
                free |= 1 << self.trial[level][1];
                continue;
            };
            self.tried[level] += 1;
            let other = usize::from(other);
            if other <= point || (free & self.sub_problems.near(point)) >> other & 1 == 0 {
                continue;
            }
            self.effort.nodes += 1;
            self.work_counter.work(1)?;
            let total = self.total[level] + self.sub_problems.reduced(point, other);
            if total > self.limit {
                if self.options.sorted {
                    // All after it cost more.
                    self.tried[level] = count as u8;
                }
                continue;
            }
            self.trial[level][1] = other as u8;
            if level + 1 == half {
                self.take(total);
                if self.best <= self.floor {
                    return Ok(());
                }
                continue;
            }
            free &= !(1 << other);
            level += 1;
            self.total[level] = total;
            self.tried[level] = 0;
        }
    }

    /// Makes the trial the best.
    fn take(&mut self, reduced_cost: i64) {
        self.pairs.copy_from_slice(self.trial);
        self.best = ((self.base + reduced_cost) / 2) as u64;
        self.effort.improvements += 1;
        (self.improved)(self.best);
        self.aim();
    }
}
