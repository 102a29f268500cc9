//! The nodes of the matching: vertices, and blossoms, which are odd rings of nodes shrunk to one
//! node.
//!
//! While a blossom is shrunk, only its *base* is kept of the matching inside it: the vertex that is
//! matched outside. Whichever vertex that is, the other nodes pair up around the ring. So the
//! matching inside is decided when the blossom is expanded, and an augmenting path passes through a
//! blossom in one step.

use super::{Label, Matching};
use crate::order::work_budget::WorkBudget;
use crate::order::{NONE, OrderError};
use bytemuck::{Pod, Zeroable};

/// A node: a vertex or a blossom.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Node {
    /// The blossom that contains this node, or [`NONE`].
    pub parent: u16,
    /// The next node in the ring of the parent; for a blossom not in use, the next such blossom.
    next: u16,
    /// The pair of vertices (the one in this node first) that connects this node with `next` in the
    /// ring. For an inner outermost node: the pair (the one in this node second) by which the tree
    /// reached it.
    pub link: [u16; 2],
    /// The vertex that is matched outside the node; [`NONE`] for a blossom not in use.
    pub base: u16,
}

impl Node {
    /// Makes the node of a single vertex.
    pub fn vertex(vertex: u16) -> Self {
        Self { parent: NONE, next: NONE, link: [NONE; 2], base: vertex }
    }

    /// Whether the node is in use and not part of a blossom.
    pub fn is_outermost(&self) -> bool {
        self.base != NONE && self.parent == NONE
    }
}

impl Matching<'_, '_> {
    /// Links the blossoms, none of which is in use yet, in a list.
    pub(super) fn lay_out_spares(&mut self) {
        let vertices = self.top.len();
        for (number, node) in (0..).zip(self.nodes.iter_mut()).skip(vertices) {
            *node = Node::vertex(NONE);
            node.next = number + 1;
        }
    }

    fn is_blossom(&self, node: u16) -> bool {
        usize::from(node) >= self.top.len()
    }

    /// Returns the stored dual of a blossom.
    fn inside(&mut self, blossom: u16) -> &mut i32 {
        &mut self.slack_inside[usize::from(blossom) - self.top.len()]
    }

    /// Adds an outermost node that has no label to the tree.
    pub(super) fn enter(&mut self, node: u16, label: Label) {
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
    pub(super) fn freeze(&mut self, blossom: u16) {
        let twice = 2 * self.now;
        match self.label(self.node(blossom).base) {
            Label::Outside => {}
            Label::Outer | Label::Fresh => *self.inside(blossom) += twice,
            Label::Inner => {
                *self.inside(blossom) -= twice;
                self.inner_blossoms -= 1;
            }
        }
    }

    /// Returns the inner blossom whose dual will be the first to reach 0, and the time of that.
    pub(super) fn next_opening(&self) -> Option<(i32, u16)> {
        let vertices = self.top.len();
        self.blossoms()
            .filter(|&blossom| {
                let node = self.node(blossom);
                node.is_outermost() && self.label(node.base) == Label::Inner
            })
            .map(|blossom| (self.slack_inside[usize::from(blossom) - vertices] / 2, blossom))
            .min()
    }

    /// Returns the step from an outer node towards the root: the matched pair and the pair beyond
    /// it, each with the vertex farther from the root first. `None` at the root.
    fn step_up(&self, outer: u16) -> Option<[[u16; 2]; 2]> {
        let base = self.node(outer).base;
        let mate = self.mate[usize::from(base)];
        if mate == NONE {
            return None;
        }
        let [above, below] = self.node(self.top_of(mate)).link;
        Some([[base, mate], [below, above]])
    }

    pub(super) fn node(&self, node: u16) -> &Node {
        &self.nodes[usize::from(node)]
    }

    pub(super) fn node_mut(&mut self, node: u16) -> &mut Node {
        &mut self.nodes[usize::from(node)]
    }

    /// Returns the outermost node that contains a vertex.
    pub(super) fn top_of(&self, vertex: u16) -> u16 {
        self.top[usize::from(vertex)]
    }

    /// Returns the number of steps from an outer node to the root.
    fn depth(&self, outer: u16) -> u16 {
        let mut depth = 0;
        let mut node = outer;
        while let Some([_, [_, above]]) = self.step_up(node) {
            node = self.top_of(above);
            depth += 1;
        }
        depth
    }

    /// Returns the lowest common ancestor of two outer nodes.
    fn meeting(&self, a: u16, b: u16) -> u16 {
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
    pub(super) fn shrink(&mut self, left: u16, right: u16) {
        let meeting = self.meeting(self.top_of(left), self.top_of(right));
        let blossom = self.spare;
        self.unused = self.unused.max(blossom + 1);
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
        let base = self.node(meeting).base;
        self.spare = self.node(blossom).next;
        *self.node_mut(blossom) = Node::vertex(base);
        *self.inside(blossom) = -2 * self.now;
        for vertex in 0..self.top.len() as u16 {
            let top = self.top_of(vertex);
            if self.node(top).parent == blossom {
                if self.label(vertex) == Label::Inner {
                    self.set_vertex_label(vertex, Label::Fresh);
                }
                self.top[usize::from(vertex)] = blossom;
            }
        }
    }

    /// Adds `node` to the ring of `blossom`. The pair `onward` leads to the next node of the ring.
    fn chain(&mut self, node: u16, onward: [u16; 2], blossom: u16) {
        if self.is_blossom(node) {
            self.freeze(node);
        }
        let next = self.top_of(onward[1]);
        let node = self.node_mut(node);
        node.link = onward;
        node.next = next;
        node.parent = blossom;
    }

    /// Returns the node of the ring of `blossom` that contains `vertex`.
    fn within(&self, blossom: u16, vertex: u16) -> u16 {
        let mut node = vertex;
        while self.node(node).parent != blossom {
            node = self.node(node).parent;
        }
        node
    }

    /// Expands an outermost blossom: the nodes of its ring become outermost. Returns the one that
    /// contains the base.
    fn open(&mut self, blossom: u16) -> u16 {
        for vertex in 0..self.top.len() as u16 {
            if self.top_of(vertex) == blossom {
                self.top[usize::from(vertex)] = self.within(blossom, vertex);
            }
        }
        self.settle(blossom)
    }

    /// Matches the nodes of an outermost blossom around its ring, starting after the one that
    /// contains the base. Returns that node, and frees the blossom.
    fn settle(&mut self, blossom: u16) -> u16 {
        let base = self.node(blossom).base;
        let first = self.within(blossom, base);
        self.node_mut(first).base = base;
        self.node_mut(first).parent = NONE;
        let mut node = self.node(first).next;
        while node != first {
            let Node { next, link: [a, b], .. } = *self.node(node);
            self.mate[usize::from(a)] = b;
            self.mate[usize::from(b)] = a;
            for (node, base) in [(node, a), (next, b)] {
                self.node_mut(node).base = base;
                self.node_mut(node).parent = NONE;
            }
            node = self.node(next).next;
        }
        let spare = self.spare;
        *self.node_mut(blossom) = Node { next: spare, ..Node::vertex(NONE) };
        self.spare = blossom;
        first
    }

    /// Expands an inner blossom whose dual has reached 0. The part of its ring that connects the
    /// tree above with the tree below replaces it; the rest leaves the tree.
    pub(super) fn open_inner(
        &mut self,
        blossom: u16,
        work_budget: &mut WorkBudget<'_>,
    ) -> Result<(), OrderError> {
        let entry = self.node(blossom).link;
        self.freeze(blossom);
        let first = self.open(blossom);
        let entrance = self.top_of(entry[1]);
        let position = self.position(first, entrance);
        let mut node = first;
        let mut last = first;
        for index in 0.. {
            let Node { next, link, .. } = *self.node(node);
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
                self.node_mut(node).link = match (node == entrance, back) {
                    (true, _) => entry,
                    (false, true) => [link[1], link[0]],
                    (false, false) => self.node(last).link,
                };
                self.enter(node, Label::Inner);
            } else if (index < position) == back {
                self.enter(node, Label::Fresh);
            } else {
                self.find_first_pairs(node, work_budget)?;
            }
            if next == first {
                if !back {
                    self.node_mut(first).link = self.node(node).link;
                }
                break;
            }
            (last, node) = (node, next);
        }
        Ok(())
    }

    /// Returns how many nodes after `first` in the ring `node` is.
    fn position(&self, first: u16, node: u16) -> u16 {
        let mut position = 0;
        let mut at = first;
        while at != node {
            at = self.node(at).next;
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
