//! Pairs the odd points with the least total length: minimum-weight perfect matching, proved by its
//! duals.
//!
//! This is Edmonds' blossom algorithm in its primal-dual form, with one alternating tree at a time.
//! Every vertex has a dual, which can be pictured as the radius of a disc around it. A blossom is
//! an odd set of vertices shrunk to one node; its dual lets the discs inside it overlap. No two
//! discs of different nodes overlap, and the discs of each matched pair touch. So the sum of the
//! duals equals the weight of the matching, and no matching can weigh less. A tree grows from an
//! unmatched vertex over touching pairs, while the duals change, until it reaches another unmatched
//! vertex. Then the matching is changed along the path between them.
//!
//! Distances are computed from the coordinates when they are needed, which is seldom. Vertices are
//! numbered in the order of their x, so that those too far away along x are not looked at, and
//! pairs too far apart by the greater of their differences in x and y are skipped. Weights are
//! twice the distances, so that all duals are whole numbers. The memory is a few dozen bytes for
//! each vertex: [`scratch_bytes`]. After Edmonds, "Paths, trees, and flowers" (1965), and Galil,
//! "Efficient algorithms for finding maximum matching in graphs" (1986).
//!
//! The file has some 500 lines, because the steps of one phase read and change the same tree.

mod blossom;
mod start;

use super::OrderError;
use super::odd::OddPoints;
use super::work_budget::WorkBudget;
use crate::index::{Index, Numbers};
use crate::stage::{OutOfScratch, Scratch};
use blossom::Node;
use core::cell::Cell;

/// A time later than any event, in the units of [`Matching::now`].
const NEVER: i32 = 1 << 30;
/// A range without vertices.
fn nothing<I: Index>() -> Numbers<I> {
    Numbers { start: I::NONE, end: I::ZERO }
}
/// Distances are shifted right until they are below this, so that a sum of four weights fits.
const DISTANCE_LIMIT: u32 = 1 << 27;

/// The role of a vertex in the tree, which is that of its outermost node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Label {
    /// The node is not in the alternating tree, so that its dual does not change.
    Outside = 0,
    /// The node is in the tree, an even number of pairs from the root: its disc grows.
    Outer = 1,
    /// The node is `Outer`, but the pairs of the vertex have not been examined yet.
    Fresh = 2,
    /// The node is in the tree, an odd number of pairs from the root: its disc shrinks.
    Inner = 3,
}

/// Returns the scratch memory needed for `count` vertices (odd points and free ends), in bytes.
pub const fn scratch_bytes<I: Index>(count: usize) -> usize {
    Scratch::bytes_for::<Node<I>>(count + count / 2)
        + Scratch::bytes_for::<i32>(count / 2)
        + 2 * Scratch::bytes_for::<i32>(count)
        + 2 * Scratch::bytes_for::<I>(count)
        + Scratch::bytes_for::<u8>(count)
}

/// Pairs all of `odd` with the least total length: `mate[i]` becomes the partner of odd point `i`.
///
/// Returns a lower bound of that length in 1/256 steps. The bound is the length itself, unless the
/// drawing is so large (above 2^19 steps) that the lengths had to be rounded further.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub(super) fn pair<'s, I: Index>(
    odd: &'s OddPoints<'s, I>,
    mut scratch: Scratch<'s>,
    work_budget: &mut WorkBudget<'_>,
    mate: &'s mut [I],
) -> Result<u64, OrderError> {
    let mut matching = Matching::new(odd, &mut scratch, mate)?;
    matching.start(work_budget)?;
    for root in I::below(odd.count()) {
        if matching.mate[root.get()] == I::NONE {
            matching.grow_tree(root, work_budget)?;
        }
    }
    matching.settle_all(work_budget)?;
    Ok(matching.length())
}

// Why no index in this module can fail:
// * A vertex is below `odd.count()`, the length of `top`, `mate`, `label`, `radius`, `when` and
//   `best`. Loops count to it, and ranges of odd points and of free ends are within it. `top` has a
//   node for each vertex, and `best` a vertex: it begins with zeros, and only `note` changes it.
// * A node is below the length of `nodes`: a vertex, or a blossom in use or in the list of spare
//   ones. A blossom in use makes the outermost nodes fewer by two at least, because its ring has
//   three nodes or more. So fewer than half as many blossoms as vertices are in use, one of the
//   spare ones is always left, and `slack_inside` has an entry for each. 16 bits are enough for
//   their numbers, because 2^16 nodes would take more memory than a board has.
// * The base of a node in use is a vertex in it. It is `NONE` only in blossoms not in use, which
//   `is_outermost` keeps out. The links of a ring are pairs of vertices, and so is the link of an
//   inner outermost node: `grow_tree` and `open_inner` set it when the node becomes inner.
// * `mate` of the base of an outermost node is `NONE` or a vertex, and `NONE` is tested for. The
//   partner of the base of an outer node lies in an inner one, because each outer node but the root
//   has entered the tree as the partner of an inner one.
// * `next_touch` always finds a vertex: the number of vertices is even, so one that is unmatched is
//   left besides the root. The root is examined first, no radius of an unmatched vertex is
//   negative, and pairs are lighter than `NEVER`.

/// The matching while it is being found: the pairs so far, their duals (see the module
/// documentation), and the present tree.
struct Matching<'s, 'a, I> {
    /// The points to be paired, which are the vertices of the matching.
    odd: &'s OddPoints<'a, I>,
    /// The vertices, followed by the blossoms.
    nodes: &'s mut [Node<I>],
    /// For each vertex, the outermost node that contains it: itself, or a blossom.
    top: &'s mut [I],
    /// The partner of each vertex that is the base of an outermost node; meaningless for other
    /// vertices.
    mate: &'s mut [I],
    /// The role of each vertex in the tree: a [`Label`] as a number.
    label: &'s mut [u8],
    /// The dual of each vertex, which can be pictured as the radius of a disc. The current value is
    /// this plus `now` if its node is outer, and minus `now` if it is inner.
    radius: &'s mut [i32],
    /// The dual of each blossom, by which the discs inside it may overlap. If it is outermost and
    /// in the tree, the current value is this plus twice `now` (outer) or minus twice `now`
    /// (inner).
    slack_inside: &'s mut [i32],
    /// A range of vertices that contains all those with the label [`Label::Fresh`].
    fresh: Numbers<I>,
    /// The time at which the best known pair of each vertex with an outer vertex will touch. Times
    /// are values of `now`.
    when: &'s mut [i32],
    /// For each vertex, the outer vertex of its pair in `when`.
    best: &'s mut [I],
    /// A range that contains all odd points for which such a pair is recorded.
    reached: Numbers<I>,
    /// The time: how far the duals of the tree have moved since it was started.
    now: i32,
    /// The greatest radius (dual) of any vertex when the tree was started.
    widest: i32,
    /// The time at which the tree will reach an unmatched vertex by the best pair known.
    limit: i32,
    /// The first blossom in the list of those not in use.
    spare: I,
    /// The blossoms from this number on have never been in use.
    unused: I,
    /// The number of blossoms in the tree whose discs shrink (those that are inner).
    inner_blossoms: u32,
    /// The number of bits by which the distances are shifted right.
    shortened: u32,
    /// The weight of a pair of an odd point and a free end. It is the same for all, so it does not
    /// change which matching is the best.
    end_weight: i32,
    /// The number of square roots not yet counted in the work budget.
    roots: Cell<u32>,
}

impl<'s, 'a, I: Index> Matching<'s, 'a, I> {
    /// Makes the state before the first tree: every vertex is a node of its own and unmatched, and
    /// all duals are 0.
    fn new(
        odd: &'s OddPoints<'a, I>,
        scratch: &mut Scratch<'s>,
        mate: &'s mut [I],
    ) -> Result<Self, OutOfScratch> {
        let count = odd.count().get();
        let nodes: &mut [Node<I>] = scratch.take(count + count / 2)?;
        let slack_inside = scratch.take(count / 2)?;
        let radius = scratch.take(count)?;
        let when = scratch.take(count)?;
        let top: &mut [I] = scratch.take(count)?;
        let best = scratch.take(count)?;
        let label = scratch.take(count)?;
        for (vertex, (node, top)) in I::all().zip(nodes.iter_mut().zip(top.iter_mut())) {
            *node = Node::vertex(vertex);
            *top = vertex;
        }
        mate.fill(I::NONE);
        let mut matching = Self {
            odd,
            nodes,
            top,
            mate,
            label,
            radius,
            slack_inside,
            fresh: nothing(),
            when,
            best,
            reached: nothing(),
            now: 0,
            widest: 0,
            limit: NEVER,
            spare: odd.count(),
            unused: odd.count(),
            inner_blossoms: 0,
            shortened: 0,
            end_weight: 0,
            roots: Cell::new(0),
        };
        matching.lay_out_spares();
        while odd.extent() >> matching.shortened >= DISTANCE_LIMIT {
            matching.shortened += 1;
        }
        Ok(matching)
    }

    /// Returns the weight of a pair: twice the distance of two odd points.
    fn weight(&self, a: I, b: I) -> i32 {
        let real = self.odd.real_count();
        if a < real && b < real {
            2 * (self.odd.distance(a, b) >> self.shortened) as i32
        } else if a >= real && b >= real {
            NEVER / 2
        } else {
            self.end_weight
        }
    }

    /// Returns a lower bound of the weight of a pair of odd points, from their x alone.
    fn weight_along_x(&self, a: I, b: I) -> i32 {
        2 * (self.odd.distance_along_x(a, b) >> self.shortened) as i32
    }

    /// Returns the weight if it is less than `bound`. Most pairs that weigh more are rejected
    /// without a square root.
    fn weight_below(&self, a: I, b: I, bound: i32) -> Option<i32> {
        if bound <= 0 || (self.odd.least_distance(a, b) >> self.shortened) as i32 * 2 >= bound {
            return None;
        }
        self.roots.set(self.roots.get() + 1);
        let weight = self.weight(a, b);
        (weight < bound).then_some(weight)
    }

    /// Counts in the work budget the square roots since the last call, and that `vertices` vertices
    /// were looked at.
    fn charge(&self, vertices: usize, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        work_budget.work(1 + self.roots.take() + vertices as u32 / 12)?;
        Ok(())
    }

    /// Returns the label of the node in which the vertex lies.
    fn label(&self, vertex: I) -> Label {
        match self.label[vertex.get()] {
            0 => Label::Outside,
            1 => Label::Outer,
            2 => Label::Fresh,
            _ => Label::Inner,
        }
    }

    /// Returns the current radius (dual) of a vertex.
    fn radius_now(&self, vertex: I) -> i32 {
        let radius = self.radius[vertex.get()];
        match self.label(vertex) {
            Label::Outside => radius,
            Label::Outer | Label::Fresh => radius + self.now,
            Label::Inner => radius - self.now,
        }
    }

    /// Gives all vertices of an outermost node a label. Their current duals do not change.
    fn set_label(&mut self, node: I, label: Label) {
        for vertex in self.candidates(node) {
            if self.top_of(vertex) == node {
                self.set_vertex_label(vertex, label);
            }
        }
    }

    /// Returns a range that contains all vertices of an outermost node.
    fn candidates(&self, node: I) -> Numbers<I> {
        let all = I::new(self.top.len());
        if node < all { node.to(node + I::ONE) } else { I::below(all) }
    }

    /// Gives a vertex a label, and stores its dual so that its current value does not change.
    fn set_vertex_label(&mut self, vertex: I, label: Label) {
        let radius = self.radius_now(vertex);
        let index = vertex.get();
        self.label[index] = label as u8;
        self.when[index] = NEVER;
        if label == Label::Fresh {
            cover(&mut self.fresh, vertex);
        }
        self.radius[index] = match label {
            Label::Outside => radius,
            Label::Outer | Label::Fresh => radius - self.now,
            Label::Inner => radius + self.now,
        };
    }

    /// Grows a tree from the unmatched vertex `root` until it reaches another one, and matches
    /// both.
    fn grow_tree(&mut self, root: I, work_budget: &mut WorkBudget<'_>) -> Result<(), OrderError> {
        self.now = 0;
        self.widest = self.radius.iter().copied().max().unwrap_or(0);
        self.limit = NEVER;
        self.inner_blossoms = 0;
        self.when.fill(NEVER);
        self.reached = nothing();
        self.enter(root, Label::Fresh);
        loop {
            self.examine_fresh_vertices(work_budget)?;
            self.charge(self.reached.len(), work_budget)?;
            let (time, vertex) = self.next_touch();
            if self.inner_blossoms > 0
                && let Some((empty, blossom)) = self.next_opening()
                && empty <= time
            {
                self.now = empty;
                self.open_inner(blossom, work_budget)?;
                continue;
            }
            self.now = time;
            let outer = self.best[vertex.get()];
            let node = self.top_of(vertex);
            if self.label(vertex) == Label::Outer {
                if self.top_of(outer) == node {
                    self.find_first_pair(vertex, work_budget)?;
                } else {
                    self.shrink(outer, vertex);
                }
                continue;
            }
            let base = self.node(node).base();
            let mate = self.mate[base.get()];
            if mate == I::NONE {
                self.augment(outer, vertex);
                self.fell_tree();
                return Ok(());
            }
            self.node_mut(node).set_link([outer, vertex]);
            self.enter(node, Label::Inner);
            self.enter(self.top_of(mate), Label::Fresh);
        }
    }

    /// Returns the first pair with an outer vertex that will touch: the time, and the vertex that
    /// is not the outer one in `best`.
    fn next_touch(&self) -> (i32, I) {
        let mut first = (NEVER, I::ZERO);
        for Numbers { start, end } in [self.reached, self.odd.free_numbers()] {
            let all = self.when.get(start.get()..end.get()).unwrap_or(&[]);
            for (vertex, &when) in start.to(end).zip(all) {
                if when < first.0 {
                    first = (when, vertex);
                }
            }
        }
        first
    }

    /// Records, for each fresh vertex, when its pairs will touch. The vertices are then no longer
    /// fresh.
    fn examine_fresh_vertices(
        &mut self,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        for vertex in core::mem::replace(&mut self.fresh, nothing()) {
            if self.label(vertex) == Label::Fresh {
                self.label[vertex.get()] = Label::Outer as u8;
                self.record_pairs_of(vertex, work_budget)?;
            }
        }
        Ok(())
    }

    /// Records at all other vertices when their pair with the outer vertex `from` will touch, if
    /// that is sooner than the time recorded there.
    fn record_pairs_of(
        &mut self,
        from: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let own = self.radius_now(from);
        let node = self.top_of(from);
        for others in self.within_limit(from, own, work_budget)? {
            for other in others {
                let label = self.label(other);
                if label != Label::Inner && self.top_of(other) != node {
                    self.record_pair(other, label, from, own);
                }
            }
        }
        Ok(())
    }

    /// Records when the pair of `other` with the outer vertex `from`, whose current radius is
    /// `own`, will touch, if that is sooner than the time recorded.
    fn record_pair(&mut self, other: I, label: Label, from: I, own: i32) {
        let (now, index) = (self.now, other.get());
        // If `other` is outside the tree, only the disc of `from` grows; between two outer vertices
        // both discs grow.
        let left = self.when[index].min(self.limit) - now;
        let (sides, reach) = match label {
            Label::Outside => (1, self.radius[index]),
            _ => (2, self.radius[index] + now),
        };
        let Some(weight) = self.weight_below(from, other, sides * left + reach + own) else {
            return;
        };
        let when = now + (weight - reach - own) / sides;
        self.note(other, when, from);
        if label == Label::Outside && self.is_free(other) {
            self.limit = when;
        }
    }

    /// Records when the pair of `vertex` with the outer vertex `best` will touch.
    fn note(&mut self, vertex: I, when: i32, best: I) {
        self.when[vertex.get()] = when;
        self.best[vertex.get()] = best;
        if vertex < self.odd.real_count() {
            cover(&mut self.reached, vertex);
        }
    }

    /// Returns the vertices that may touch `vertex`, whose current radius is `own`, before the tree
    /// reaches an unmatched vertex.
    fn within_limit(
        &self,
        vertex: I,
        own: i32,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<[Numbers<I>; 2], OrderError> {
        // At most, both discs grow; no radius has grown by more than `now`.
        let closing = 2 * i64::from(self.limit - self.now);
        let weight = closing + i64::from(own) + i64::from(self.widest) + i64::from(self.now);
        self.up_to(vertex, weight, work_budget)
    }

    /// Returns a range that contains all odd points whose pair with `vertex` weighs at most
    /// `weight`, and the range of the free ends. Counts the work of looking at them.
    fn up_to(
        &self,
        vertex: I,
        weight: i64,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<[Numbers<I>; 2], OrderError> {
        let reach = (weight.max(0).unsigned_abs() / 2) << self.shortened;
        let others = self.odd.around(vertex, u32::try_from(reach).unwrap_or(u32::MAX));
        self.charge(others.len(), work_budget)?;
        Ok([others, self.odd.free_numbers()])
    }

    /// Whether the outermost node of `vertex` has no partner yet.
    fn is_free(&self, vertex: I) -> bool {
        let base = self.node(self.top_of(vertex)).base();
        self.mate[base.get()] == I::NONE
    }

    /// Computes again when the first pair of `vertex` (outside or outer) with an outer vertex of
    /// another node will touch.
    fn find_first_pair(
        &mut self,
        vertex: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let index = vertex.get();
        let (now, own) = (self.now, self.radius_now(vertex));
        let sides = if self.label(vertex) == Label::Outside { 1 } else { 2 };
        self.when[index] = NEVER;
        for others in self.within_limit(vertex, own, work_budget)? {
            for other in others {
                if self.label(other) != Label::Outer || self.top_of(other) == self.top_of(vertex) {
                    continue;
                }
                let left = self.when[index].min(self.limit) - now;
                let reach = self.radius_now(other) + own;
                if let Some(weight) = self.weight_below(vertex, other, sides * left + reach) {
                    self.note(vertex, now + (weight - reach) / sides, other);
                }
            }
        }
        Ok(())
    }

    /// Computes again, for each vertex of a node, when its first pair will touch: see
    /// [`Self::find_first_pair`].
    fn find_first_pairs(
        &mut self,
        node: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        for vertex in self.candidates(node) {
            if self.top_of(vertex) == node {
                self.find_first_pair(vertex, work_budget)?;
            }
        }
        Ok(())
    }

    /// Changes the matching along the path from the root to `outer`, and matches `outer` with the
    /// unmatched vertex `free`.
    fn augment(&mut self, outer: I, free: I) {
        let mut pair = [outer, free];
        loop {
            let [outer, inner] = pair;
            let node = self.top_of(outer);
            let base = self.node(node).base();
            self.node_mut(node).set_base(outer);
            let next = self.mate[base.get()];
            self.mate[outer.get()] = inner;
            self.mate[inner.get()] = outer;
            if next == I::NONE {
                return;
            }
            let above = self.node_mut(self.top_of(next));
            pair = above.link();
            above.set_base(pair[1]);
        }
    }

    /// Returns the numbers of all blossoms that are or were in use.
    fn blossoms(&self) -> Numbers<I> {
        self.odd.count().to(self.unused)
    }

    /// Removes the alternating tree after two vertices were matched: stores all current duals and
    /// removes all labels.
    fn fell_tree(&mut self) {
        for blossom in self.blossoms() {
            if self.node(blossom).is_outermost() {
                self.freeze(blossom);
            }
        }
        for vertex in I::below(I::new(self.top.len())) {
            self.set_vertex_label(vertex, Label::Outside);
        }
    }

    /// Returns the length of the matching without the free ends, in 1/256 steps, rounded as the
    /// weights are.
    fn length(&self) -> u64 {
        let twice: u64 = I::below(self.odd.real_count())
            .filter_map(|vertex| {
                let mate = self.mate[vertex.get()];
                self.odd.station(mate)?;
                Some(u64::from(self.odd.distance(vertex, mate) >> self.shortened))
            })
            .sum();
        (twice / 2) << self.shortened
    }
}

/// Extends `range` so that it contains `vertex`.
fn cover<I: Index>(range: &mut Numbers<I>, vertex: I) {
    *range = range.start.min(vertex).to(range.end.max(vertex + I::ONE));
}
