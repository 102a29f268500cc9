//! Disjoint sets (union-find), which tell which points or stations are connected.

use crate::index::Index;

/// A partition of `0..len` into sets, each identified by its lowest member.
///
/// A parent never has a higher number than its child, so the representative does not depend on the
/// order of the unions.
// No index can fail: each entry of `parent` is a member, because `singletons` makes it the member
// itself and the others make it another parent; and the callers name members only, which are points
// at the ends of segments, stations at the ends of chains, or the partners of stations.
#[derive(Debug)]
pub(super) struct Partition<'a, I> {
    /// The parent of each member; a representative is its own parent.
    parent: &'a mut [I],
}

impl<'a, I: Index> Partition<'a, I> {
    /// Puts every member into a set of its own. `parent` is the memory, with one entry for each
    /// member.
    pub fn singletons(parent: &'a mut [I]) -> Self {
        for (member, parent) in I::all().zip(parent.iter_mut()) {
            *parent = member;
        }
        Self { parent }
    }

    /// Returns the lowest member of the set that holds `member`.
    pub fn find(&mut self, member: I) -> I {
        let mut member = member;
        loop {
            let parent = self.parent[member.get()];
            if parent == member {
                return member;
            }
            // Path halving keeps the walks short without a rank array.
            let grandparent = self.parent[parent.get()];
            self.parent[member.get()] = grandparent;
            member = grandparent;
        }
    }

    /// Makes the lowest member of each set the parent of all its members.
    pub fn flatten(&mut self) {
        // Parents have lower numbers, so each parent is flattened before its children.
        for member in 0..self.parent.len() {
            let parent = self.parent[member];
            self.parent[member] = self.parent[parent.get()];
        }
    }

    /// Unites the sets of `a` and `b`. Returns whether they were different sets.
    pub fn unite(&mut self, a: I, b: I) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b).get()] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_known_by_their_lowest_member() {
        let mut memory = [0u16; 5];
        let mut sets = Partition::singletons(&mut memory);
        assert!(sets.unite(4, 2));
        assert!(sets.unite(2, 1));
        assert!(!sets.unite(1, 4));
        assert_eq!([0, 1, 2, 3, 4].map(|member| sets.find(member)), [0, 1, 1, 3, 1]);
    }
}
