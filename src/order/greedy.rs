//! Pairs the odd points greedily with regret (Harrison 5.10.1), and then improves the pairs by
//! exchanges.
//!
//! The regret of a point is how much farther its second choice is than its first. The point with
//! the greatest regret is given its first choice; this is repeated until all are paired. Then any
//! two pairs exchange partners while that shortens them. The result has no proved bound. Points are
//! numbered in the order of their x. Those that are too far apart by x or y alone are skipped
//! without computing a square root.

use super::OrderError;
use super::odd::OddPoints;
use super::remaining::Remaining;
use super::work_budget::WorkBudget;
use crate::index::Index;
use crate::stage::{OutOfScratch, Scratch};
use bytemuck::{Pod, Zeroable};
use core::cmp::Reverse;

/// The two nearest unpaired points of an unpaired point, and its regret.
///
/// The two points are a pair, whose second is [`Index::NONE`] if there is only one; the regret,
/// which takes no more bits, is how much farther the second is than the first, in 1/256 steps.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
struct Choice<P>([P; 2]);

impl<P: Copy> Choice<P> {
    /// Returns the nearest point and the second nearest.
    fn points<I: Index<Pair = P>>(&self) -> [I; 2] {
        I::halves(self.0[0])
    }
}

/// The [`Choice`] of a point with this width of numbers.
type ChoiceOf<I> = Choice<<I as Index>::Pair>;

/// A point first searches among those whose x differs by at most this many 1/256 steps (256 steps),
/// then within twice that, and so on.
const FIRST_REACH: u32 = 256 << 8;

/// Pairs all odd points, between which the pen will be lifted: `mate[i]` becomes the partner of odd
/// point `i`.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub(super) fn pair<I: Index>(
    odd: &OddPoints<'_, I>,
    scratch: &mut Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<(), OrderError> {
    mate.fill(I::NONE);
    with_regret(odd, scratch.reborrow(), work_budget, mate)?;
    if odd.has_free_ends() {
        free_the_longest(odd, mate);
    }
    let lengths: &mut [u32] = scratch.take(mate.len())?;
    for (point, (length, &partner)) in I::all().zip(lengths.iter_mut().zip(mate.iter())) {
        *length = odd.distance(point, partner);
    }
    let mut near = odd.remaining(scratch)?;
    while exchange(odd, &mut near, lengths, work_budget, mate)? {}
    Ok(())
}

/// The two nearest points found so far, each with its distance, in order of the distance and then
/// of the number.
struct Nearest<I>([(u32, I); 2]);

impl<I: Index> Nearest<I> {
    /// Nothing has been found yet.
    fn new() -> Self {
        Self([(u32::MAX, I::NONE); 2])
    }

    /// Takes another point into account, at this distance.
    fn add(&mut self, distance: u32, point: I) {
        let [first, second] = self.0;
        let new = (distance, point);
        if new < first {
            self.0 = [new, first];
        } else if new < second {
            self.0[1] = new;
        }
    }

    /// Returns the distance of the farther of the two points.
    fn farthest(&self) -> u32 {
        self.0[1].0
    }

    /// Returns the choice between the two.
    fn choice(&self) -> ChoiceOf<I> {
        let [first, second] = self.0;
        Choice([I::pair(first.1, second.1), (second.0 - first.0).into()])
    }
}

/// What makes pairing fast where there is memory for it. The pairs are the same without it.
struct Shortcuts<'s, I> {
    /// The unpaired points, and some that have been paired since.
    near: Remaining<'s, I>,
    /// A tournament of the points for the greatest regret: node k is the better of the nodes 2 k
    /// and 2 k + 1, and the points themselves follow the last node.
    winners: &'s mut [I],
    /// For each point, the first of the choices that name it, or [`Index::NONE`]. Choice 2 k is one
    /// of point k, and choice 2 k + 1 is its other.
    namers: &'s mut [I],
    /// For each choice, the next one that names the same point.
    next: &'s mut [I],
}

impl<'s, I: Index> Shortcuts<'s, I> {
    /// Makes them if there is memory for them.
    fn new(odd: &OddPoints<'_, I>, scratch: &mut Scratch<'s>) -> Option<Self> {
        let count = odd.real_count().get();
        let bytes = Remaining::<I>::bytes(count)
            + 2 * Scratch::bytes_for::<I>(count)
            + Scratch::bytes_for::<I>(2 * count);
        if !cfg!(feature = "many-strokes")
            || bytes > scratch.available_bytes()
            || 2 * count >= I::NONE.get()
        {
            return None;
        }
        let near = odd.remaining(scratch);
        let (winners, namers) = (scratch.take(count).ok()?, scratch.take(count).ok()?);
        namers.fill(I::NONE);
        Some(Self { near: near.ok()?, winners, namers, next: scratch.take(2 * count).ok()? })
    }

    /// Notes that a choice names `point`.
    fn name(&mut self, choice: usize, point: I) {
        // `point` may be `Index::NONE`, which nothing names.
        if let Some(first) = self.namers.get_mut(point.get())
            && let Some(next) = self.next.get_mut(choice)
        {
            *next = core::mem::replace(first, I::new(choice));
        }
    }

    /// Returns the point that wins at a node of the tournament.
    fn winner(&self, node: usize) -> usize {
        match self.winners.get(node) {
            Some(winner) => winner.get(),
            None => node - self.winners.len(),
        }
    }

    /// Decides a node of the tournament again.
    fn play(&mut self, node: usize, choices: &[ChoiceOf<I>], mate: &[I]) {
        let key = |point: usize| {
            let choice = choices.get(point).filter(|_| mate.get(point) == Some(&I::NONE))?;
            Some((choice.0[1], Reverse(point)))
        };
        let [left, right] = [self.winner(2 * node), self.winner(2 * node + 1)];
        if let Some(winner) = self.winners.get_mut(node) {
            *winner = I::new(if key(left) >= key(right) { left } else { right });
        }
    }

    /// Decides all nodes again in which a point takes part.
    fn replay(&mut self, point: I, choices: &[ChoiceOf<I>], mate: &[I]) {
        let mut node = (point.get() + self.winners.len()) / 2;
        while node > 0 {
            self.play(node, choices, mate);
            node /= 2;
        }
    }
}

/// Finds the two nearest unpaired points of `chooser`.
// No index from here on can fail: loops and `around` count points to `real_count`; `choices` has as
// many entries, and `mate` two more if there are free ends.
fn choose<I: Index>(
    odd: &OddPoints<'_, I>,
    mate: &[I],
    chooser: I,
    work_budget: &mut WorkBudget<'_>,
) -> Result<ChoiceOf<I>, OrderError> {
    let mut reach = FIRST_REACH;
    loop {
        let among = odd.around(chooser, reach);
        let is_everyone = among.len() == odd.real_count().get();
        work_budget.work(1 + among.len() as u32 / 32)?;
        let mut nearest = Nearest::new();
        for other in among {
            if other == chooser
                || mate[other.get()] != I::NONE
                || odd.least_distance(chooser, other) >= nearest.farthest()
            {
                continue;
            }
            work_budget.work(1)?;
            nearest.add(odd.distance(chooser, other), other);
        }
        // All points not yet looked at are farther than `reach`.
        if is_everyone || nearest.farthest() <= reach {
            return Ok(nearest.choice());
        }
        reach = reach.saturating_mul(2);
    }
}

/// Finds the same among the points of a grid.
fn choose_near<I: Index>(
    odd: &OddPoints<'_, I>,
    mate: &[I],
    chooser: I,
    near: &mut Remaining<'_, I>,
    work_budget: &mut WorkBudget<'_>,
) -> Result<ChoiceOf<I>, OrderError> {
    let mut nearest = Nearest::new();
    let mut looked_at = 1;
    near.search(odd.position(chooser), &mut |other| {
        looked_at += 1;
        if mate.get(other.get()) != Some(&I::NONE) {
            return None;
        }
        if other != chooser && odd.least_distance(chooser, other) <= nearest.farthest() {
            nearest.add(odd.distance(chooser, other), other);
        }
        Some(nearest.farthest())
    });
    work_budget.work(looked_at)?;
    Ok(nearest.choice())
}

/// Pairs the odd points, of which the one with the greatest regret chooses first. The regret is how
/// much worse its second choice is than its first.
fn with_regret<I: Index>(
    odd: &OddPoints<'_, I>,
    mut scratch: Scratch<'_>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<(), OrderError> {
    let count = odd.real_count();
    let choices: &mut [ChoiceOf<I>] = scratch.take(count.get())?;
    if let Some(shortcuts) = Shortcuts::new(odd, &mut scratch) {
        return with_shortcuts(odd, choices, shortcuts, work_budget, mate);
    }
    for (chooser, choice) in I::all().zip(choices.iter_mut()) {
        *choice = choose(odd, mate, chooser, work_budget)?;
    }
    for _ in 0..count.get() / 2 {
        let unmatched = |&point: &I| mate[point.get()] == I::NONE;
        // Among points of equal regret, the one with the lowest number is taken.
        let Some(chooser) =
            I::below(count).rev().filter(unmatched).max_by_key(|&point| choices[point.get()].0[1])
        else {
            break;
        };
        let chosen = choices[chooser.get()].points::<I>()[0];
        join(mate, chooser, chosen);
        work_budget.work(count.into() / 32)?;
        for point in I::below(count) {
            let [first, second] = choices[point.get()].points::<I>();
            let lost = |choice| choice == chooser || choice == chosen;
            if mate[point.get()] == I::NONE && (lost(first) || lost(second)) {
                choices[point.get()] = choose(odd, mate, point, work_budget)?;
            }
        }
    }
    Ok(())
}

/// Pairs the odd points in the same order with the help of `shortcuts`.
fn with_shortcuts<I: Index>(
    odd: &OddPoints<'_, I>,
    choices: &mut [ChoiceOf<I>],
    mut shortcuts: Shortcuts<'_, I>,
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<(), OrderError> {
    for (chooser, choice) in I::all().zip(choices.iter_mut()) {
        *choice = choose_near(odd, mate, chooser, &mut shortcuts.near, work_budget)?;
        for (which, point) in choice.points::<I>().into_iter().enumerate() {
            shortcuts.name(2 * chooser.get() + which, point);
        }
    }
    for node in (1..choices.len()).rev() {
        shortcuts.play(node, choices, mate);
    }
    for _ in 0..choices.len() / 2 {
        let chooser = shortcuts.winner(1);
        let Some(choice) = choices.get(chooser) else {
            break;
        };
        let (chooser, chosen) = (I::new(chooser), choice.points::<I>()[0]);
        join(mate, chooser, chosen);
        shortcuts.replay(chooser, choices, mate);
        shortcuts.replay(chosen, choices, mate);
        let lost = |point| point == chooser || point == chosen;
        for gone in [chooser, chosen] {
            let Some(namer) = shortcuts.namers.get_mut(gone.get()) else {
                continue;
            };
            let mut namer = core::mem::replace(namer, I::NONE);
            // The list ends with `Index::NONE`.
            while let Some(&next) = shortcuts.next.get(namer.get()) {
                let choice = namer.get();
                namer = next;
                let point = I::new(choice / 2);
                let Some(choices_of) = choices.get_mut(point.get()) else {
                    continue;
                };
                if mate.get(point.get()) != Some(&I::NONE) {
                    continue;
                }
                let old = choices_of.points::<I>();
                let mut new = old;
                if old.into_iter().any(lost) {
                    *choices_of = choose_near(odd, mate, point, &mut shortcuts.near, work_budget)?;
                    new = choices_of.points::<I>();
                    shortcuts.replay(point, choices, mate);
                }
                // A point that is still among the choices is named by the other of the two. If both
                // were lost, this one names the first new point, and the other the second.
                let [first, second] = new;
                let is_first_new = old.into_iter().all(lost) || !old.contains(&first);
                shortcuts.name(choice, if is_first_new { first } else { second });
            }
        }
    }
    Ok(())
}

/// Makes the ends of the longest move the start and the end of the path, so that this move is not
/// made.
fn free_the_longest<I: Index>(odd: &OddPoints<'_, I>, mate: &mut [I]) {
    let [start, end] = odd.free_ends();
    let longest = I::below(odd.real_count()).max_by_key(|&point| {
        let partner = mate[point.get()];
        odd.distance(point, partner)
    });
    if let Some(point) = longest {
        let partner = mate[point.get()];
        join(mate, point, start);
        join(mate, partner, end);
    }
}

/// Makes the points `a` and `b` partners, between which the pen will be lifted.
fn join<I: Index>(mate: &mut [I], a: I, b: I) {
    for (from, to) in [(a, b), (b, a)] {
        if let Some(mate) = mate.get_mut(from.get()) {
            *mate = to;
        }
    }
}

/// Tries once to exchange the partners of each point's pair and of another pair. `near` must hold
/// all points but the free ends, and `lengths` the length of each move at both of its points.
/// Returns whether anything became shorter.
///
/// Of two moves that become shorter in all, one of the new ones is shorter than an old one. So it
/// is enough to give each point a partner that is nearer than its own; of these exchanges, the one
/// that saves most is made.
fn exchange<I: Index>(
    odd: &OddPoints<'_, I>,
    near: &mut Remaining<'_, I>,
    lengths: &mut [u32],
    work_budget: &mut WorkBudget<'_>,
    mate: &mut [I],
) -> Result<bool, OrderError> {
    let mut improved = false;
    for a in I::below(odd.real_count()) {
        let mut looked_at = 1;
        let (Some(&b), Some(&own)) = (mate.get(a.get()), lengths.get(a.get())) else {
            break;
        };
        let mut best = (0, [I::NONE; 2]);
        near.search(odd.position(a), &mut |c| {
            looked_at += 1;
            let (&d, &other) = mate.get(c.get()).zip(lengths.get(c.get()))?;
            if c != a && c != b && odd.least_distance(a, c) < own {
                let now = own + other;
                // To be better than the best so far, the new moves must be shorter than this.
                let bound = now.saturating_sub(best.0);
                let then = sum_below(odd, [a, c, b, d], bound);
                if then < bound {
                    best = (now - then, [c, d]);
                }
            }
            Some(own)
        });
        let (gain, [c, d]) = best;
        if gain > 0 {
            for (from, to) in [(a, c), (b, d)] {
                join(mate, from, to);
                for end in [from, to] {
                    if let Some(length) = lengths.get_mut(end.get()) {
                        *length = odd.distance(from, to);
                    }
                }
            }
            improved = true;
        }
        work_budget.work(1 + looked_at / 4)?;
    }
    Ok(improved)
}

/// Returns the total length of two moves, from `a` to `b` and from `c` to `d`. If it is not below
/// `bound`, the result may be any number from `bound` on; in most cases this is found without a
/// square root.
fn sum_below<I: Index>(odd: &OddPoints<'_, I>, [a, b, c, d]: [I; 4], bound: u32) -> u32 {
    if odd.least_distance(a, b) + odd.least_distance(c, d) >= bound {
        return u32::MAX;
    }
    odd.distance(a, b).saturating_add(odd.distance(c, d))
}

impl From<crate::stage::Aborted> for OrderError {
    fn from(_: crate::stage::Aborted) -> Self {
        Self::Aborted
    }
}

impl From<OutOfScratch> for OrderError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}

#[cfg(test)]
mod tests {
    use super::super::network::Network;
    use super::*;
    use crate::drawing::{Drawing, PagePoint, Segment};
    use crate::stage::NeverCancel;
    use std::vec;
    use std::vec::Vec;

    /// Calls `test` with the ends of this many strokes within a square as odd points.
    fn with_strokes(
        strokes: u16,
        size: i32,
        seed: u32,
        test: impl FnOnce(&OddPoints<'_, u16>, &mut WorkBudget<'_>),
    ) {
        let mut state = seed;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as i32 % size
        };
        let points: Vec<PagePoint> =
            (0..2 * strokes).map(|_| PagePoint { x: random(), y: random() }).collect();
        let segments: Vec<Segment> =
            (0..strokes).map(|stroke| Segment::new(2 * stroke, 2 * stroke + 1)).collect();
        let mut memory = vec![0; 1 << 14];
        let mut scratch = Scratch::new(&mut memory);
        let drawing = Drawing { points: &points, segments: &segments };
        let network = Network::new(drawing, 0, Default::default(), &mut scratch).unwrap();
        let mut stations: Vec<u16> = (0..network.stations()).collect();
        stations.sort_by_key(|&station| (network.position(station).x, station));
        let odd = OddPoints::new(network, &stations, true);
        test(&odd, &mut WorkBudget::new(&mut NeverCancel));
    }

    #[test]
    fn more_memory_pairs_the_same_points() {
        // In a small square many points coincide and many distances are equal.
        for (strokes, size) in [(1, 9), (2, 3), (60, 12), (200, 5000), (150, 60)] {
            for seed in 0..20 {
                with_strokes(strokes, size, seed, |odd, work_budget| {
                    let pairs = [2 * usize::from(strokes), 1 << 14].map(|words| {
                        let mut memory = vec![0; words];
                        let mut mate = vec![u16::NONE; usize::from(odd.count())];
                        let scratch = Scratch::new(&mut memory);
                        with_regret(odd, scratch, &mut *work_budget, &mut mate).unwrap();
                        mate
                    });
                    assert_eq!(pairs[0], pairs[1], "{strokes} {size} {seed}");
                });
            }
        }
    }

    #[test]
    fn no_two_pairs_are_left_to_exchange() {
        for (seed, size) in (0..20).flat_map(|seed| [(seed, 5000), (seed, 30)]) {
            with_strokes(100, size, seed, |odd, work_budget| {
                let mut memory = vec![0; 1 << 14];
                let mut mate = vec![u16::NONE; usize::from(odd.count())];
                pair(odd, &mut Scratch::new(&mut memory), work_budget, &mut mate).unwrap();
                let length = |a, b| u64::from(odd.distance(a, b));
                for a in 0..odd.count() {
                    for c in 0..odd.count() {
                        let [b, d] = [a, c].map(|point| mate[usize::from(point)]);
                        assert_eq!(mate[usize::from(b)], a);
                        if a != c && a != d {
                            let (now, then) =
                                (length(a, b) + length(c, d), length(a, c) + length(b, d));
                            assert!(now <= then, "{a} {b}, {c} {d}: {now} {then}");
                        }
                    }
                }
            });
        }
    }
}
