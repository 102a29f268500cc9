//! The vertices of a model, in memory lent by the owner.

use super::Position;
use core::ops::{Deref, DerefMut};

/// A list of positions that grows within its memory.
#[derive(Debug)]
pub(super) struct Vertices<'m> {
    memory: &'m mut [Position],
    /// How many positions at the front of the memory are in use; at most as many as there are.
    count: usize,
}

impl<'m> Vertices<'m> {
    /// Makes an empty list. What the memory contains is discarded.
    pub(super) fn new(memory: &'m mut [Position]) -> Self {
        Self { memory, count: 0 }
    }

    /// Returns how many positions there is room for.
    pub(super) fn capacity(&self) -> usize {
        self.memory.len()
    }

    /// Returns all memory if no position is in it, else none.
    #[cfg(feature = "tiles")]
    pub(super) fn spare(&mut self) -> &mut [Position] {
        if self.count == 0 { self.memory } else { &mut [] }
    }

    /// Adds a position at the end. Returns `None`, and changes nothing, if there is no room.
    pub(super) fn push(&mut self, position: Position) -> Option<()> {
        *self.memory.get_mut(self.count)? = position;
        self.count += 1;
        Some(())
    }

    /// Removes all positions but the first `count`.
    pub(super) fn truncate(&mut self, count: usize) {
        self.count = self.count.min(count);
    }

    /// Replaces all positions. Returns `None`, and changes nothing, if they do not fit.
    pub(super) fn replace(&mut self, positions: &[Position]) -> Option<()> {
        self.memory.get_mut(..positions.len())?.copy_from_slice(positions);
        self.count = positions.len();
        Some(())
    }
}

impl Deref for Vertices<'_> {
    type Target = [Position];

    fn deref(&self) -> &[Position] {
        self.memory.get(..self.count).unwrap_or(&[])
    }
}

impl DerefMut for Vertices<'_> {
    fn deref_mut(&mut self) -> &mut [Position] {
        self.memory.get_mut(..self.count).unwrap_or(&mut [])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_changes_nothing() {
        let at = |x| Position { x, ..Position::default() };
        let mut memory = [at(7); 2];
        let mut vertices = Vertices::new(&mut memory);
        assert_eq!((vertices.capacity(), vertices.len()), (2, 0));
        assert_eq!([1, 2, 3].map(|x| vertices.push(at(x))), [Some(()), Some(()), None]);
        assert_eq!(vertices.replace(&[at(4); 3]), None);
        assert_eq!(*vertices, [at(1), at(2)]);
        vertices.truncate(1);
        assert_eq!(vertices.replace(&[at(5)]), Some(()));
        vertices.truncate(9);
        assert_eq!(*vertices, [at(5)]);
    }
}
