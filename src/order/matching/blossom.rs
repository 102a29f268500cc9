//! The nodes of the matching: vertices, and blossoms, which are odd rings of nodes shrunk to one
//! node.
//!
//! While a blossom is shrunk, only its *base* is kept of the matching inside it: the vertex that is
//! matched outside. Whichever vertex that is, the other nodes pair up around the ring. So the
//! matching inside is decided when the blossom is expanded, and an augmenting path passes through a
//! blossom in one step.

use super::{Label, Matching};
use crate::index::Index;
use crate::order::OrderError;
use crate::order::work_budget::WorkBudget;
use bytemuck::{Pod, Zeroable};

/// A node: a vertex or a blossom.
///
/// It holds the blossom that contains the node, or [`Index::NONE`]; the vertex that is matched
/// outside the node, or [`Index::NONE`] for a blossom not in use; the next node in the ring of the
/// parent or, for a blossom not in use, the next such blossom; and a pair of vertices.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Node<I>([I; 5]);

impl<I: Index> Node<I> {
    /// Makes the node of a single vertex.
    pub fn vertex(vertex: I) -> Self {
        Self([I::NONE, vertex, I::NONE, I::NONE, I::NONE])
    }

    /// Returns the blossom that contains this node, or [`Index::NONE`].
    pub fn parent(&self) -> I {
        self.0[0]
    }

    fn set_parent(&mut self, parent: I) {
        self.0[0] = parent;
    }

    /// Returns the vertex that is matched outside the node; [`Index::NONE`] for a blossom not in
    /// use.
    pub fn base(&self) -> I {
        self.0[1]
    }

    pub fn set_base(&mut self, base: I) {
        self.0[1] = base;
    }

    /// Returns the next node in the ring of the parent; for a blossom not in use, the next such
    /// blossom.
    fn next(&self) -> I {
        self.0[2]
    }

    fn set_next(&mut self, next: I) {
        self.0[2] = next;
    }

    /// Returns the pair of vertices (the one in this node first) that connects this node with
    /// `next` in the ring. For an inner outermost node: the pair (the one in this node second) by
    /// which the tree reached it.
    pub fn link(&self) -> [I; 2] {
        [self.0[3], self.0[4]]
    }

    pub fn set_link(&mut self, [from, to]: [I; 2]) {
        (self.0[3], self.0[4]) = (from, to);
    }

    /// Whether the node is in use and not part of a blossom.
    pub fn is_outermost(&self) -> bool {
        self.base() != I::NONE && self.parent() == I::NONE
    }
}

// Why no index in this file can fail is said beside the struct `Matching`. Besides, `within` climbs
// from a vertex of `blossom` through the nodes that contain it, of which one lies in the ring of
// `blossom`; so it ends before a parent is `NONE`. `position` goes around a ring that has the node.
impl<I: Index> Matching<'_, '_, I> {
    /// Puts all blossoms, none of which is in use yet, in a list from which new ones are taken.
    pub(super) fn lay_out_spares(&mut self) {
        let vertices = self.top.len();
        for (number, node) in I::all().zip(self.nodes.iter_mut()).skip(vertices) {
            *node = Node::vertex(I::NONE);
            node.set_next(number + I::ONE);
        }
    }

    /// Whether the node is a blossom. Vertices have the numbers below the count of vertices,
    /// blossoms those from it on.
    fn is_blossom(&self, node: I) -> bool {
        node.get() >= self.top.len()
    }

    /// Returns the dual that is stored for a blossom, to be changed.
    fn inside(&mut self, blossom: I) -> &mut i32 {
        &mut self.slack_inside[blossom.get() - self.top.len()]
    }

    /// Adds an outermost node that has no label to the alternating tree, with this label.
    pub(super) fn enter(&mut self, node: I, label: Label) {
        self.set_label(node, label);
        if self.is_blossom(node) {
            let twice = 2 * self.now;
            if label == Label::Inner {
                *self.inside(node) += twice;
                self.inner_blossoms += 1;
            } else {
                *self.inside(node) -= twice;
            }
        }
    }

    /// Stores the current dual of an outermost blossom, so that it no longer depends on a label and
    /// on `now`.
    pub(super) fn freeze(&mut self, blossom: I) {
        let twice = 2 * self.now;
        match self.label(self.node(blossom).base()) {
            Label::Outside => {}
            Label::Outer | Label::Fresh => *self.inside(blossom) += twice,
            Label::Inner => {
                *self.inside(blossom) -= twice;
                self.inner_blossoms -= 1;
            }
        }
    }

    /// Returns the inner blossom whose dual will be the first to reach 0, and the time of that.
    pub(super) fn next_opening(&self) -> Option<(i32, I)> {
        let vertices = self.top.len();
        self.blossoms()
            .filter(|&blossom| {
                let node = self.node(blossom);
                node.is_outermost() && self.label(node.base()) == Label::Inner
            })
            .map(|blossom| (self.slack_inside[blossom.get() - vertices] / 2, blossom))
            .min()
    }

    /// Returns the step from an outer node towards the root: the matched pair and the pair beyond
    /// it, each with the vertex farther from the root first. `None` at the root.
    fn step_up(&self, outer: I) -> Option<[[I; 2]; 2]> {
        let base = self.node(outer).base();
        let mate = self.mate[base.get()];
        if mate == I::NONE {
            return None;
        }
        let [above, below] = self.node(self.top_of(mate)).link();
        Some([[base, mate], [below, above]])
    }

    /// Returns the record of a vertex or of a blossom by its number.
    pub(super) fn node(&self, node: I) -> &Node<I> {
        &self.nodes[node.get()]
    }

    /// Returns the record of a vertex or of a blossom by its number, to be changed.
    pub(super) fn node_mut(&mut self, node: I) -> &mut Node<I> {
        &mut self.nodes[node.get()]
    }

    /// Returns the outermost node that contains a vertex.
    pub(super) fn top_of(&self, vertex: I) -> I {
        self.top[vertex.get()]
    }

    /// Returns the number of steps from an outer node to the root.
    fn depth(&self, outer: I) -> u32 {
        let mut depth = 0;
        let mut node = outer;
        while let Some([_, [_, above]]) = self.step_up(node) {
            node = self.top_of(above);
            depth += 1;
        }
        depth
    }

    /// Returns the lowest common ancestor of two outer nodes in the alternating tree.
    fn meeting(&self, a: I, b: I) -> I {
        let (mut a, mut b) = (a, b);
        let (mut depth_a, mut depth_b) = (self.depth(a), self.depth(b));
        while a != b {
            let climber = if depth_a >= depth_b {
                depth_a = depth_a.saturating_sub(1);
                &mut a
            } else {
                depth_b -= 1;
                &mut b
            };
            match self.step_up(*climber) {
                Some([_, [_, above]]) => *climber = self.top_of(above),
                None => break,
            }
        }
        a
    }

    /// Shrinks the ring that the touching pair of two outer vertices closes to one outer blossom.
    pub(super) fn shrink(&mut self, left: I, right: I) {
        let meeting = self.meeting(self.top_of(left), self.top_of(right));
        let blossom = self.spare;
        self.unused = self.unused.max(blossom + I::ONE);
        let (mut node, mut onward) = (self.top_of(left), [left, right]);
        // The left side of the ring is linked downwards: each node to the one below it.
        loop {
            let up = self.step_up(node);
            self.chain(node, onward, blossom);
            let (Some([[base, mate], [below, above]]), true) = (up, node != meeting) else {
                break;
            };
            self.chain(self.top_of(mate), [mate, base], blossom);
            (node, onward) = (self.top_of(above), [above, below]);
        }
        // The right side is linked upwards.
        let mut node = self.top_of(right);
        while node != meeting
            && let Some([matched, beyond]) = self.step_up(node)
        {
            self.chain(node, matched, blossom);
            self.chain(self.top_of(matched[1]), beyond, blossom);
            node = self.top_of(beyond[1]);
        }
        let base = self.node(meeting).base();
        self.spare = self.node(blossom).next();
        *self.node_mut(blossom) = Node::vertex(base);
        *self.inside(blossom) = -2 * self.now;
        for vertex in I::below(I::new(self.top.len())) {
            let top = self.top_of(vertex);
            if self.node(top).parent() == blossom {
                if self.label(vertex) == Label::Inner {
                    self.set_vertex_label(vertex, Label::Fresh);
                }
                self.top[vertex.get()] = blossom;
            }
        }
    }

    /// Adds `node` to the ring of `blossom`. The pair `onward` leads to the next node of the ring.
    fn chain(&mut self, node: I, onward: [I; 2], blossom: I) {
        if self.is_blossom(node) {
            self.freeze(node);
        }
        let next = self.top_of(onward[1]);
        let node = self.node_mut(node);
        node.set_link(onward);
        node.set_next(next);
        node.set_parent(blossom);
    }

    /// Returns the node on the ring of `blossom` that is or contains `vertex`.
    fn within(&self, blossom: I, vertex: I) -> I {
        let mut node = vertex;
        while self.node(node).parent() != blossom {
            node = self.node(node).parent();
        }
        node
    }

    /// Expands an outermost blossom: the nodes of its ring become outermost. Returns the one that
    /// contains the base.
    fn open(&mut self, blossom: I) -> I {
        for vertex in I::below(I::new(self.top.len())) {
            if self.top_of(vertex) == blossom {
                self.top[vertex.get()] = self.within(blossom, vertex);
            }
        }
        self.settle(blossom)
    }

    /// Matches the nodes of an outermost blossom around its ring, starting after the one that
    /// contains the base. Returns that node, and frees the blossom.
    fn settle(&mut self, blossom: I) -> I {
        let base = self.node(blossom).base();
        let first = self.within(blossom, base);
        self.node_mut(first).set_base(base);
        self.node_mut(first).set_parent(I::NONE);
        let mut node = self.node(first).next();
        while node != first {
            let (next, [a, b]) = (self.node(node).next(), self.node(node).link());
            self.mate[a.get()] = b;
            self.mate[b.get()] = a;
            for (node, base) in [(node, a), (next, b)] {
                self.node_mut(node).set_base(base);
                self.node_mut(node).set_parent(I::NONE);
            }
            node = self.node(next).next();
        }
        let spare = self.spare;
        *self.node_mut(blossom) = Node::vertex(I::NONE);
        self.node_mut(blossom).set_next(spare);
        self.spare = blossom;
        first
    }

    /// Expands an inner blossom whose dual has reached 0. The part of its ring that connects the
    /// tree above with the tree below replaces it; the rest leaves the tree.
    pub(super) fn open_inner(
        &mut self,
        blossom: I,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let entry = self.node(blossom).link();
        self.freeze(blossom);
        let first = self.open(blossom);
        let entrance = self.top_of(entry[1]);
        let position = self.position(first, entrance);
        let mut node = first;
        let mut last = first;
        for index in 0.. {
            let (next, link) = (self.node(node).next(), self.node(node).link());
            let vertices = self.candidates(node).len();
            self.charge(vertices, work_budget)?;
            self.set_label(node, Label::Outside);
            // The nodes 1 and 2, 3 and 4, and so on are matched. So the path from the entrance
            // through its partner to the base goes backwards from an even position and forwards
            // from an odd one.
            let back = position.is_multiple_of(2);
            if index == 0
                || (index % 2 == position % 2 && (index < position) == back)
                || node == entrance
            {
                let link = match (node == entrance, back) {
                    (true, _) => entry,
                    (false, true) => [link[1], link[0]],
                    (false, false) => self.node(last).link(),
                };
                self.node_mut(node).set_link(link);
                self.enter(node, Label::Inner);
            } else if (index < position) == back {
                self.enter(node, Label::Fresh);
            } else {
                self.find_first_pairs(node, work_budget)?;
            }
            if next == first {
                if !back {
                    let link = self.node(node).link();
                    self.node_mut(first).set_link(link);
                }
                break;
            }
            (last, node) = (node, next);
        }
        Ok(())
    }

    /// Returns how many nodes after `first` in the ring `node` is.
    fn position(&self, first: I, node: I) -> u32 {
        let mut position = 0;
        let mut at = first;
        while at != node {
            at = self.node(at).next();
            position += 1;
        }
        position
    }

    /// Expands every blossom, so that every vertex has its partner.
    pub(super) fn settle_all(
        &mut self,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let mut settled = true;
        while core::mem::take(&mut settled) {
            for blossom in self.blossoms() {
                if self.node(blossom).is_outermost() {
                    settled = true;
                    self.charge(0, work_budget)?;
                    self.settle(blossom);
                }
            }
        }
        Ok(())
    }
}
