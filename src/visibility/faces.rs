//! Sorts the faces by the depth of their nearest point, so that the search can stop at the first
//! face that is too far away.

use super::VisibilityError;
use super::edges::{Outlines, is_bar};
use super::triangles::{Cut, cut_of};
use super::yield_counter::YieldCounter;
use crate::geometry::{COORDINATE_LIMIT, Vertex};
use crate::stage::{Scratch, heap_sort_by_key};

/// The elements, nearest first. The position of an element in this order is its rank.
///
/// Each is 32 bits: the nearest depth (14 bits, rounded down), the way of cutting it (2 bits) and
/// the number of its first corner (16 bits).
#[derive(Debug)]
pub struct Faces<'a> {
    /// The packed elements, sorted.
    order: &'a mut [u32],
    /// The number of faces that have no area.
    degenerate: u32,
}

/// One element, as the search needs it.
#[derive(Debug, Clone, Copy)]
pub struct Face {
    /// The number of the first corner of the element.
    pub first: usize,
    /// Whether a fan of triangles from the first corner covers it.
    pub is_fan: bool,
    /// Whether its triangles are stored in [`super::triangles::Ears`].
    pub has_ears: bool,
}

impl<'a> Faces<'a> {
    /// Sorts the elements.
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    pub fn sort(
        outlines: Outlines<'_>,
        vertices: &[Vertex],
        scratch: &mut Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let mut degenerate = 0;
        let order: &mut [u32] = scratch.take(outlines.elements().count())?;
        for (key, (first, corners)) in order.iter_mut().zip(outlines.elements()) {
            yield_counter.spend(200 * corners.len())?;
            let near = corners
                .iter()
                .map(|corner| vertices[usize::from(corner.vertex())].z)
                .min()
                .unwrap_or(0);
            let depth = ((near + COORDINATE_LIMIT) >> 7) as u32;
            let cut = match cut_of(corners, vertices) {
                Cut::None => {
                    degenerate += u32::from(!is_bar(corners));
                    0
                }
                Cut::Fan => 1,
                Cut::Ears => 2,
            };
            *key = depth.min(0x3FFF) << 18 | cut << 16 | first as u32;
        }
        // The sort itself does not check for cancelling. It takes some 500 instructions for each of
        // 2000 faces.
        yield_counter.spend(500 * order.len())?;
        heap_sort_by_key(order, |key| *key);
        Ok(Self { order, degenerate })
    }

    /// Returns the number of faces that have no area.
    pub fn degenerate(&self) -> u32 {
        self.degenerate
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Returns the element with this rank.
    #[inline]
    pub fn get(&self, rank: usize) -> Face {
        let key = self.order[rank];
        Face {
            first: (key & 0xFFFF) as usize,
            is_fan: key >> 16 & 3 == 1,
            has_ears: key >> 16 & 3 == 2,
        }
    }

    /// Whether the element with this rank, and therefore each one after it, is certainly farther
    /// than the depth `far`.
    #[inline]
    pub fn begins_behind(&self, rank: usize, far: i32) -> bool {
        self.order[rank] >> 18 > ((far + COORDINATE_LIMIT) >> 7) as u32
    }
}
