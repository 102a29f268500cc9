//! Of which vertices of the model those are made that a view adds to them.

use crate::index::Index;
use crate::model::{Curves, VertexSources};

/// The vertices behind those of the model: first the ends of the chords of curves, then the points
/// where edges are cut.
#[derive(Debug, Clone, Copy)]
pub struct Sources<'a, I: Index> {
    /// The curves of the model.
    pub(super) curves: Curves<'a, I>,
    /// For each curve, the number after that of its last chord end.
    pub(super) curve_ends: &'a [I],
    /// The number of the first chord end.
    pub(super) first_chord_end: usize,
    /// The number of the first point where an edge is cut.
    pub(super) first_cut: usize,
    /// For each of these points, the numbers of the ends of its edge.
    pub(super) cuts: &'a [I::Pair],
}

impl<'a, I: Index> Sources<'a, I> {
    /// The vertices from number `first_cut` on are the points where these edges are cut, each a
    /// pair of numbers below. There are no curves.
    #[cfg(feature = "tiles")]
    pub(crate) fn of_cuts(first_cut: usize, cuts: &'a [I::Pair]) -> Self {
        let curves = Curves::default();
        Self { curves, curve_ends: &[], first_chord_end: first_cut, first_cut, cuts }
    }
}

impl<I: Index> VertexSources for Sources<'_, I> {
    #[inline(never)] // Called seldom.
    fn source(&self, number: usize, mut index: usize) -> Option<usize> {
        let (ends, count) = match number.checked_sub(self.first_cut) {
            None => ([I::new(number); 2], 1),
            Some(at) => (I::halves(*self.cuts.get(at)?), 2),
        };
        for end in ends.into_iter().take(count) {
            let mut points = &[end][..];
            if end.get() >= self.first_chord_end {
                let curve = self.curve_ends.partition_point(|curve_end| *curve_end <= end);
                points = self.curves.iter().nth(curve)?.control;
            }
            if let Some(point) = points.get(index) {
                return Some(point.get());
            }
            index -= points.len();
        }
        None
    }
}
