//! The optimum of the pen-up problem as Harrison found it (chapter 6): bounds and implicit
//! enumeration.
//!
//! Given the distances between an even number of odd points, [`optimum`] pairs them so that the sum
//! is the least, and proves it:
//!
//! 1. [`ImplicitCosts`]: a solution of the image problem, improved, gives a lower bound;
//! 2. the least that must be added to the image graph to make it hold a domino graph gives a
//!    matching, an upper bound;
//! 3. if they differ, all divisions of the points into lower and higher ends are gone through, each
//!    an assignment problem ([`Division`]), but for those whose lower bound is no better than the
//!    best matching. [`Options`] holds his variants.
//!
//! The order of strokes does not use it: it is the slow, independent check of the exact matching,
//! and it repeats Harrison's experiments (chapter 7; docs/experiments.md). 18 points take some
//! million instructions; 36 took a hundred million, 32 others eight hundred: count on some 40
//! points, and on an abort beyond. Refused: an odd number of points or more than
//! [`Distances::POINT_LIMIT`].

mod division;
mod domino;
mod image;
mod search;
mod work_counter;

pub use division::{Division, division_bound};
pub use domino::domino_matching;
pub use image::ImplicitCosts;

use division::SubProblems;
use penup::stage::{Aborted, Cancel, OutOfScratch, Scratch};
use search::{Known, Search};
use work_counter::WorkCounter;

/// The distances between an even number of points.
#[derive(Debug, Clone, Copy)]
pub struct Distances<'a> {
    count: usize,
    below_diagonal: &'a [u32],
}

/// Why these are not the distances of a pen-up problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DistancesError {
    /// An odd number of points cannot be paired.
    OddCount,
    /// More than [`Distances::POINT_LIMIT`] points.
    TooManyPoints,
    /// Not n(n-1)/2 distances, but so many are needed.
    WrongLength(usize),
}

impl<'a> Distances<'a> {
    /// A set of points is the bits of a word.
    pub const POINT_LIMIT: usize = 64;

    /// `below_diagonal` holds, for each of `count` points, its distances to those before it:
    /// d(1,0), d(2,0), d(2,1), d(3,0), …
    ///
    /// # Errors
    /// See [`DistancesError`].
    ///
    /// ```
    /// use penup_host_tests::enumeration::{Distances, DistancesError};
    /// assert_eq!(Distances::new(4, &[1, 2, 3, 4, 5, 6])?.get(1, 3), 5);
    /// assert_eq!(Distances::new(4, &[1]).unwrap_err(), DistancesError::WrongLength(6));
    /// # Ok::<(), DistancesError>(())
    /// ```
    pub fn new(count: usize, below_diagonal: &'a [u32]) -> Result<Self, DistancesError> {
        if count > Self::POINT_LIMIT {
            return Err(DistancesError::TooManyPoints);
        }
        if !count.is_multiple_of(2) {
            return Err(DistancesError::OddCount);
        }
        let length = count * count.saturating_sub(1) / 2;
        if below_diagonal.len() != length {
            return Err(DistancesError::WrongLength(length));
        }
        Ok(Self { count, below_diagonal })
    }

    /// How many points there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many pairs of points there are.
    pub fn pair_count(&self) -> usize {
        self.below_diagonal.len()
    }

    /// The distance between two different points, each below [`Self::count`].
    pub fn get(&self, a: usize, b: usize) -> u32 {
        let (low, high) = (a.min(b), a.max(b));
        self.below_diagonal[high * (high - 1) / 2 + low]
    }

    /// The sum of the distances of `pairs`.
    pub fn cost(&self, pairs: &[[u8; 2]]) -> u64 {
        pairs.iter().map(|&[a, b]| u64::from(self.get(usize::from(a), usize::from(b)))).sum()
    }
}

/// The variants of the enumeration. The result is the same with all but
/// [`Reach::NoLongerThanStart`], [`Reach::NoLongerThan`] and [`Target::Chopped`], which may miss
/// the optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Where the search begins.
    pub start: Start,
    /// Which distances are looked at.
    pub reach: Reach,
    /// Whether those of each point are tried in ascending order (7.8).
    pub sorted: bool,
    /// How a sub-problem is searched.
    pub sub_problem: SubProblem,
    /// Whether sets of sub-problems are skipped together.
    pub sets: Sets,
    /// How much better the next matching must be.
    pub target: Target,
}

impl Options {
    /// Harrison's standard algorithm (7.2).
    pub const STANDARD: Self = Self {
        start: Start::DominoGraph,
        reach: Reach::All,
        sorted: false,
        sub_problem: SubProblem::Pairings,
        sets: Sets::None,
        target: Target::Better,
    };
}

impl Default for Options {
    /// What was found the fastest.
    fn default() -> Self {
        Self { reach: Reach::Useful, sorted: true, sets: Sets::FromDepth(1), ..Self::STANDARD }
    }
}

/// The matching that is to be improved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// That of the domino graph (6.12).
    DominoGraph,
    /// None: any matching that costs no more than this will do (7.6).
    NoMoreThan(u64),
}

/// Which distances are looked at (6.15).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// All.
    All,
    /// Those that a matching better than the start can hold, by their reduced distances.
    Useful,
    /// None longer than the longest in the matching of the domino graph. (Harrison: than the
    /// longest segment added to the image graph; but then the matching itself might be out of
    /// reach.)
    NoLongerThanStart,
    /// None longer than this.
    NoLongerThan(u32),
}

/// How a sub-problem is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SubProblem {
    /// Pairing by pairing (6.13).
    Pairings,
    /// As an assignment problem, for its best matching at once (7.5).
    Assignment,
}

/// Whether sets of sub-problems are skipped together (6.16).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sets {
    /// No.
    None,
    /// A bound is taken when there are so many lower ends: the subset grouping depth.
    AtDepth(u8),
    /// And for each point after that.
    FromDepth(u8),
}

/// How much better the next matching must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Better than the best.
    Better,
    /// Better than the middle of the best and the lower bound: binary chopping (6.14). Ends when
    /// there is none, with a better lower bound.
    Chopped,
    /// The same again with the better lower bound until the two are equal (6.14.1).
    ChoppedAndBacktracked,
}

/// The best matching that was found, and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Optimum<'a> {
    /// The pairs, the lower point first, ascending.
    pub pairs: &'a [[u8; 2]],
    /// The sum of their distances.
    pub cost: u64,
    /// No matching costs less; equal to `cost` if this is proved the optimum.
    pub proved: u64,
    /// The bounds before the search.
    pub lower_bounds: LowerBounds,
    /// What the matching of the domino graph costs.
    pub upper_bound: u64,
    /// What the search did.
    pub effort: Effort,
}

impl Optimum<'_> {
    /// Whether no matching costs less.
    pub fn is_proved(&self) -> bool {
        self.proved == self.cost
    }
}

/// Lower bounds by the image problem, rounded up to whole units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LowerBounds {
    /// By method 1 ([`ImplicitCosts::by_rarest_minimum`]).
    pub rarest_minimum: u64,
    /// By method 2 ([`ImplicitCosts::by_largest_minimum`]).
    pub largest_minimum: u64,
    /// The better of the two after [`ImplicitCosts::improve`].
    pub improved: u64,
}

/// What a search did. All zero if the bounds met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Bounds of sets of sub-problems.
    pub sets: u64,
    /// Sets that were skipped.
    pub sets_skipped: u64,
    /// Sub-problems reached.
    pub sub_problems: u64,
    /// Those of them that their bound did not rule out.
    pub examined: u64,
    /// Pairs tried or assignment problems begun.
    pub nodes: u64,
    /// Better matchings found.
    pub improvements: u32,
}

/// Why there is no optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EnumerationError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The user gave up.
    Aborted,
    /// No matching costs as little as [`Start::NoMoreThan`], or none is within [`Reach`].
    NoneSoCheap,
}

impl From<OutOfScratch> for EnumerationError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}

impl From<Aborted> for EnumerationError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

/// Finds the matching of the points of `distances` that costs the least.
///
/// `improved` is told the cost of each better matching as it is found. Takes 9 n² + 60 n bytes of
/// `scratch`, or a little more below 8 points.
///
/// # Errors
/// See [`EnumerationError`].
///
/// ```
/// use penup_host_tests::enumeration::{Distances, Options, optimum};
/// use penup::stage::{Scratch, NeverCancel};
/// let distances = Distances::new(4, &[1, 5, 6, 7, 8, 1]).unwrap();
/// let mut memory = [0; 128];
/// let scratch = Scratch::new(&mut memory);
/// let options = Options::default();
/// let best = optimum(distances, options, scratch, &mut NeverCancel, &mut |_| {}).unwrap();
/// assert_eq!((best.pairs, best.cost), (&[[0, 1], [2, 3]][..], 2));
/// assert!(best.is_proved());
/// ```
pub fn optimum<'a>(
    distances: Distances<'a>,
    options: Options,
    mut scratch: Scratch<'a>,
    cancel: &mut dyn Cancel,
    improved: &mut dyn FnMut(u64),
) -> Result<Optimum<'a>, EnumerationError> {
    let mut work_counter = WorkCounter::new(cancel);
    let pairs: &mut [[u8; 2]] = scratch.take(distances.count() / 2)?;
    let (costs, lower_bounds) = solve_image_problem(distances, &mut scratch)?;
    domino::match_by_domino_graph(&costs, scratch.reborrow(), &mut work_counter, pairs)?;
    let upper_bound = distances.cost(pairs);
    let best = match options.start {
        Start::NoMoreThan(cost) if !pairs.is_empty() => cost.saturating_add(1).min(WORST),
        _ => upper_bound,
    };
    let known = Known { base: costs.sum_in_halves(), floor: lower_bounds.improved, best };
    let longest = pairs.iter().map(|&pair| distances.cost(&[pair])).max().unwrap_or(0);
    let gap = 2 * best as i64 - known.base; // in halves
    let mut sub_problems = SubProblems::new(&costs, &mut scratch)?;
    let all_in_reach = match options.reach {
        Reach::All => true,
        Reach::Useful => {
            sub_problems.retain(|a, b| costs.reduced(a, b) <= gap - 2);
            true
        }
        Reach::NoLongerThanStart => {
            sub_problems.retain(|a, b| u64::from(distances.get(a, b)) <= longest);
            false
        }
        Reach::NoLongerThan(most) => {
            sub_problems.retain(|a, b| distances.get(a, b) <= most);
            false
        }
    };
    let search = Search::new(
        sub_problems,
        known,
        options,
        &mut *pairs,
        &mut scratch,
        &mut work_counter,
        improved,
    )?;
    let (proved, cost, effort) = search.run()?;
    if options.start != Start::DominoGraph && effort.improvements == 0 && !pairs.is_empty() {
        return Err(EnumerationError::NoneSoCheap);
    }
    let proved = if all_in_reach { proved } else { lower_bounds.improved };
    Ok(Optimum { pairs, cost, proved, lower_bounds, upper_bound, effort })
}

/// More than any matching costs.
const WORST: u64 = 1 << 40;

/// The best solution of the image problem by either method, and the bounds on the way.
///
/// # Errors
/// [`OutOfScratch`] if the 16 bytes for each point do not fit.
pub fn solve_image_problem<'a>(
    distances: Distances<'a>,
    scratch: &mut Scratch<'a>,
) -> Result<(ImplicitCosts<'a>, LowerBounds), OutOfScratch> {
    let mut rarest = ImplicitCosts::by_rarest_minimum(distances, scratch)?;
    let mut largest = ImplicitCosts::by_largest_minimum(distances, scratch)?;
    let mut bounds = LowerBounds {
        rarest_minimum: rarest.lower_bound(),
        largest_minimum: largest.lower_bound(),
        improved: 0,
    };
    rarest.improve();
    largest.improve();
    let better = if largest.sum_in_halves() > rarest.sum_in_halves() { largest } else { rarest };
    bounds.improved = better.lower_bound();
    Ok((better, bounds))
}

/// The first `count` points.
fn set_of(count: usize) -> u64 {
    u64::MAX.checked_shr((Distances::POINT_LIMIT - count) as u32).unwrap_or(0)
}

/// The matrix of 6.10.2 and 6.10.4, below the diagonal.
#[cfg(test)]
const EXAMPLE_6_10: [u32; 15] = [5, 4, 2, 3, 1, 5, 4, 3, 4, 2, 3, 4, 3, 4, 1];
