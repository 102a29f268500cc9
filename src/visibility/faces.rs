//! Sorts the faces by the depth of their nearest point, so that the search can stop at the first
//! face that is too far away. The position of a face in this order is called its rank.

use super::edges::{Outlines, is_bar};
use super::triangles::{Cut, cut_of};
use super::yield_counter::YieldCounter;
use super::{Cores, VisibilityError};
use crate::array::MapEach;
use crate::geometry::{COORDINATE_LIMIT, Vertex};
use crate::index::Index;
use crate::stage::{Scratch, heap_sort_by_key};
#[cfg(feature = "threads")]
use rayon::slice::ParallelSliceMut;

/// The elements, nearest first. The position of an element in this order is its rank.
///
/// Each is a pair of numbers: the nearest depth (14 bits, rounded down) with the way of cutting it
/// (2 bits), and the number of its first corner.
#[derive(Debug)]
pub struct Faces<'a, I: Index> {
    /// The elements, each packed into 32 bits and sorted, so that an index here is a rank.
    // Indexing by a rank cannot fail. A rank is counted up to `len`, or it is read from where such
    // a rank was put: a list or a cover of the grid, a set of faces, or the marks of a profile.
    order: &'a mut [I::Pair],
    /// The number of faces that have no area.
    degenerate: u32,
    /// Whether there is a face that no fan covers.
    has_ears: bool,
}

/// One face or bar, as the search needs it.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// The number of the element's first corner among the corners of all elements.
    pub first: usize,
    /// Whether a fan covers it: the triangles that join its first corner to each of its sides.
    pub is_fan: bool,
    /// Whether its triangles had to be cut off one by one and are stored in
    /// [`super::triangles::Ears`].
    pub has_ears: bool,
}

impl<'a, I: Index> Faces<'a, I> {
    /// Sorts the elements.
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    pub fn sort(
        outlines: Outlines<'_, I>,
        vertices: &[Vertex],
        cores: Cores,
        scratch: &mut Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let mut degenerate = 0;
        let mut has_ears = false;
        let order: &mut [I::Pair] = scratch.take(outlines.elements().count())?;
        for (key, (first, corners)) in order.iter_mut().zip(outlines.elements()) {
            yield_counter.spend(200 * corners.len())?;
            // Every corner is the number of a vertex (see `check`).
            let near =
                corners.iter().map(|corner| vertices[corner.vertex().get()].z).min().unwrap_or(0);
            let depth = ((near + COORDINATE_LIMIT) >> 7) as usize;
            let cut = match cut_of(corners, vertices) {
                Cut::None => {
                    degenerate += u32::from(!is_bar(corners));
                    0
                }
                Cut::Fan => 1,
                Cut::Ears => {
                    has_ears = true;
                    2
                }
            };
            *key = I::pair(I::new(depth.min(0x3FFF) << 2 | cut), I::new(first));
        }
        // The sort itself does not check for cancelling. It takes some 500 instructions for each of
        // 2000 faces.
        yield_counter.spend(500 * order.len())?;
        match cores {
            // This is faster; its code is too large for a board or the page.
            Cores::One if cfg!(feature = "threads") => order.sort_unstable(),
            Cores::One => heap_sort_by_key(order, |key| *key),
            #[cfg(feature = "threads")]
            Cores::All => order.par_sort_unstable(),
        }
        Ok(Self { order, degenerate, has_ears })
    }

    /// Whether there is a face that no fan covers.
    pub fn has_ears(&self) -> bool {
        self.has_ears
    }

    /// Returns the number of faces that have no area.
    pub fn degenerate(&self) -> u32 {
        self.degenerate
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Returns the element with this rank, which is its position in the order of depth.
    #[inline]
    pub fn get(&self, rank: usize) -> Face {
        let [depth_and_cut, first] = I::halves(self.order[rank]).map_each(I::get);
        Face { first, is_fan: depth_and_cut & 3 == 1, has_ears: depth_and_cut & 3 == 2 }
    }

    /// Whether the element with this rank, and therefore each one after it, is certainly farther
    /// than the depth `far`.
    #[inline]
    pub fn begins_behind(&self, rank: usize, far: i32) -> bool {
        let [depth_and_cut, _] = I::halves(self.order[rank]);
        depth_and_cut.get() >> 2 > ((far + COORDINATE_LIMIT) >> 7) as usize
    }
}
