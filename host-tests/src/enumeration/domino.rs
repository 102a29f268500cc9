//! The upper bound: segments are added to the image graph until it holds a matching (Harrison
//! 6.12).
//!
//! A *domino graph* is a perfect matching. Harrison looks for one by trying pairings one after the
//! other, which took 423 s at 30 points; here alternating paths that shrink odd loops (Edmonds
//! 1965) answer the same question in n³.

use super::EnumerationError;
use super::image::{ImplicitCosts, members};
use super::work_counter::WorkCounter;
use penup::stage::{Aborted, Cancel, OutOfScratch, Scratch};

/// No partner, no predecessor.
const NONE: u8 = u8::MAX;

/// Points, the set of neighbours of each, and a matching of them that grows.
pub(super) struct GrowingGraph<'a> {
    near: &'a mut [u64],
    mate: &'a mut [u8],
    parent: &'a mut [u8],
    base: &'a mut [u8],
    queue: &'a mut [u8],
}

impl<'a> GrowingGraph<'a> {
    fn new(count: usize, scratch: &mut Scratch<'a>) -> Result<Self, OutOfScratch> {
        let (near, mate) = (scratch.take(count)?, scratch.take(count)?);
        let (parent, base) = (scratch.take(count)?, scratch.take(count)?);
        Ok(Self { near, mate, parent, base, queue: scratch.take(count)? })
    }

    fn begin_with(&mut self, costs: &ImplicitCosts<'_>) {
        self.mate.fill(NONE);
        for (point, near) in self.near.iter_mut().enumerate() {
            *near = costs.image_graph_at(point);
        }
    }

    fn add(&mut self, [a, b]: [u8; 2]) {
        self.near[usize::from(a)] |= 1 << b;
        self.near[usize::from(b)] |= 1 << a;
    }

    /// Matches as many points as can be; says whether all are.
    fn is_domino(&mut self, work_counter: &mut WorkCounter<'_>) -> Result<bool, Aborted> {
        for root in 0..self.mate.len() {
            if self.mate[root] != NONE {
                continue;
            }
            // A point that no path leads from now stays unmatched in some greatest matching.
            let Some(end) = self.free_point_reached_from(root, work_counter)? else {
                return Ok(false);
            };
            self.swap_along_the_path_to(end);
        }
        Ok(true)
    }

    /// Searches, breadth first, an alternating path from `root` to another unmatched point.
    fn free_point_reached_from(
        &mut self,
        root: usize,
        work_counter: &mut WorkCounter<'_>,
    ) -> Result<Option<usize>, Aborted> {
        self.parent.fill(NONE);
        for (point, base) in self.base.iter_mut().enumerate() {
            *base = point as u8;
        }
        let mut even: u64 = 1 << root;
        self.queue[0] = root as u8;
        let (mut taken, mut queued) = (0, 1);
        while taken < queued {
            let point = usize::from(self.queue[taken]);
            taken += 1;
            work_counter.work(self.mate.len() as u32 / 4)?;
            for other in members(self.near[point]) {
                let partner = self.mate[other];
                if self.base[point] == self.base[other] || usize::from(partner) == point {
                    continue;
                }
                let is_even =
                    other == root || partner != NONE && self.parent[usize::from(partner)] != NONE;
                if is_even {
                    for freed in members(self.shrink(point, other) & !even) {
                        even |= 1 << freed;
                        self.queue[queued] = freed as u8;
                        queued += 1;
                    }
                } else if self.parent[other] == NONE {
                    self.parent[other] = point as u8;
                    if partner == NONE {
                        return Ok(Some(other));
                    }
                    even |= 1 << partner;
                    self.queue[queued] = partner;
                    queued += 1;
                }
            }
        }
        Ok(None)
    }

    /// Makes one of the odd loop that the segment `a`-`b` closes; the set of its points.
    fn shrink(&mut self, a: usize, b: usize) -> u64 {
        let stem = self.meeting_base(a, b);
        let bases = self.bases_to(stem, a, b) | self.bases_to(stem, b, a);
        let mut absorbed = 0;
        for (point, base) in self.base.iter_mut().enumerate() {
            if bases >> *base & 1 != 0 {
                *base = stem as u8;
                absorbed |= 1 << point;
            }
        }
        absorbed
    }

    /// Where the paths from `a` and `b` to the root meet.
    fn meeting_base(&self, a: usize, b: usize) -> usize {
        let base = |point: usize| usize::from(self.base[point]);
        let up = |point: usize| match self.mate[point] {
            NONE => None,
            mate => Some(usize::from(self.parent[usize::from(mate)])),
        };
        let mut seen: u64 = 0;
        let mut above = Some(a);
        while let Some(point) = above {
            seen |= 1 << base(point);
            above = up(base(point));
        }
        let mut point = base(b);
        while seen >> point & 1 == 0 {
            match up(point) {
                Some(next) => point = base(next),
                None => break,
            }
        }
        point
    }

    /// The bases on the way from `point` to `stem`; their parents now lead across the loop.
    fn bases_to(&mut self, stem: usize, mut point: usize, mut child: usize) -> u64 {
        let mut bases = 0;
        while usize::from(self.base[point]) != stem {
            let mate = usize::from(self.mate[point]);
            bases |= 1 << self.base[point] | 1 << self.base[mate];
            self.parent[point] = child as u8;
            child = mate;
            point = usize::from(self.parent[mate]);
        }
        bases
    }

    fn swap_along_the_path_to(&mut self, end: usize) {
        let mut point = end as u8;
        while point != NONE {
            let previous = self.parent[usize::from(point)];
            let next = self.mate[usize::from(previous)];
            self.mate[usize::from(point)] = previous;
            self.mate[usize::from(previous)] = point;
            point = next;
        }
    }

    /// Adds `segments` one after the other until there is a matching; how many that took.
    fn add_until_domino(
        &mut self,
        segments: &[[u8; 2]],
        work_counter: &mut WorkCounter<'_>,
    ) -> Result<usize, Aborted> {
        for (added, &segment) in segments.iter().enumerate() {
            if self.is_domino(work_counter)? {
                return Ok(added);
            }
            self.add(segment);
        }
        self.is_domino(work_counter)?;
        Ok(segments.len())
    }
}

/// An upper bound: a matching of the image graph to which as little as possible was added.
///
/// The segments are added in the order of their reduced distances until there is a matching: the
/// last is needed, be it with few of the others. So it is put in first, and the others again from
/// the least. (Harrison tries, for each segment, all that are before it; a graph that has no
/// matching has none with a segment less, so this finds the same.) The cost of the matching exceeds
/// the sum of the implicit costs by no more than the reduced distances of what was added.
///
/// # Errors
/// [`EnumerationError::Scratch`] if n² + 13 n bytes do not fit,
/// [`EnumerationError::Aborted`] if `cancel` says so.
///
/// ```
/// use penup_host_tests::enumeration::{Distances, domino_matching, solve_image_problem};
/// use penup::stage::{Scratch, NeverCancel};
/// let distances = Distances::new(4, &[1, 5, 6, 7, 8, 1]).unwrap();
/// let mut memory = [0; 64];
/// let mut scratch = Scratch::new(&mut memory);
/// let (costs, _) = solve_image_problem(distances, &mut scratch).unwrap();
/// let pairs = domino_matching(&costs, &mut scratch, &mut NeverCancel).unwrap();
/// assert_eq!(distances.cost(pairs), 2);
/// ```
pub fn domino_matching<'a>(
    costs: &ImplicitCosts<'_>,
    scratch: &mut Scratch<'a>,
    cancel: &mut dyn Cancel,
) -> Result<&'a [[u8; 2]], EnumerationError> {
    let pairs = scratch.take(costs.distances().count() / 2)?;
    match_by_domino_graph(costs, scratch.reborrow(), &mut WorkCounter::new(cancel), pairs)?;
    Ok(pairs)
}

/// Writes [`domino_matching`] into `pairs`.
pub(super) fn match_by_domino_graph(
    costs: &ImplicitCosts<'_>,
    mut scratch: Scratch<'_>,
    work_counter: &mut WorkCounter<'_>,
    pairs: &mut [[u8; 2]],
) -> Result<(), EnumerationError> {
    let count = costs.distances().count();
    let segments: &mut [[u8; 2]] = scratch.take(costs.distances().pair_count())?;
    let every = (0..count as u8).flat_map(|a| (a + 1..count as u8).map(move |b| [a, b]));
    let mut length = 0;
    for segment in every {
        if costs.reduced(usize::from(segment[0]), usize::from(segment[1])) > 0 {
            segments[length] = segment;
            length += 1;
        }
    }
    let segments = &mut segments[..length];
    segments.sort_unstable_by_key(|&[a, b]| (costs.reduced(usize::from(a), usize::from(b)), a, b));
    let mut graph = GrowingGraph::new(count, &mut scratch)?;
    graph.begin_with(costs);
    let needed = graph.add_until_domino(segments, work_counter)?;
    if let Some((&last, before)) = segments.get(..needed).and_then(<[_]>::split_last) {
        graph.begin_with(costs);
        graph.add(last);
        graph.add_until_domino(before, work_counter)?;
    }
    let ends = (0..).zip(graph.mate.iter()).filter(|&(point, &mate)| point < mate);
    for (pair, (point, &mate)) in pairs.iter_mut().zip(ends) {
        *pair = [point, mate];
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup::stage::NeverCancel;

    fn is_domino(count: usize, segments: &[[u8; 2]]) -> bool {
        let mut memory = [0; 200];
        let mut cancel = NeverCancel;
        let mut graph = GrowingGraph::new(count, &mut Scratch::new(&mut memory)).unwrap();
        graph.mate.fill(NONE);
        for &segment in segments {
            graph.add(segment);
        }
        let all = graph.is_domino(&mut WorkCounter::new(&mut cancel)).unwrap();
        for (point, &mate) in graph.mate.iter().enumerate().filter(|&(_, &mate)| mate != NONE) {
            assert_eq!(usize::from(graph.mate[usize::from(mate)]), point);
            assert_ne!(graph.near[point] >> mate & 1, 0, "only segments of the graph");
        }
        all
    }

    #[test]
    fn two_odd_loops_joined_by_a_segment_are_matched_across_it() {
        let loops = [[0, 1], [1, 2], [0, 2], [3, 4], [4, 5], [3, 5]];
        assert!(!is_domino(6, &loops));
        let mut joined = loops.to_vec();
        joined.push([2, 3]);
        assert!(is_domino(6, &joined));
    }

    #[test]
    fn a_star_has_no_matching() {
        assert!(!is_domino(4, &[[0, 1], [0, 2], [0, 3]]));
        assert!(is_domino(4, &[[0, 1], [0, 2], [0, 3], [2, 3]]));
    }

    #[test]
    fn sixty_four_points_in_a_ring() {
        let ring: Vec<[u8; 2]> = (0..64).map(|point| [point, (point + 1) % 64]).collect();
        assert!(is_domino(64, &ring));
        assert!(!is_domino(64, &ring[2..]), "point 1 is alone");
    }
}
