//! Finds the distinct edges of the model: chooses for each edge one side of one element to
//! represent it.

use super::crease::Crease;
use super::yield_counter::YieldCounter;
use super::{Unrounded, VisibilityError};
use crate::geometry::{Projection, Vertex};
use crate::index::Index;
use crate::model::{Corner, Elements, Pens};
use crate::stage::Scratch;
use core::ops::Range;

/// The corners of the elements. An element is addressed by the number of its first corner.
#[derive(Debug, Clone, Copy)]
pub struct Outlines<'a, I> {
    /// The corners of all elements, one element after the other.
    pub corners: &'a [Corner<I>],
    /// The pen of each element, by corner number.
    pub pens: Pens<'a, I>,
}

impl<'a, I: Index> Outlines<'a, I> {
    /// Takes the corners and the pens from the elements of a model.
    pub fn of(elements: Elements<'a, I>) -> Self {
        Self { corners: elements.corners(), pens: elements.pens() }
    }

    /// Returns the corners of the element that begins at corner `first`.
    // Elements are found only by the numbers that `elements_in` and `start_of` give, so `first` is
    // the number of a corner. The last corner of a scene is marked (see `check`), so the end is
    // found in `rest`.
    #[inline]
    pub fn element(&self, first: usize) -> &'a [Corner<I>] {
        let rest = &self.corners[first..];
        let last = rest.iter().position(|corner| corner.is_last());
        &rest[..last.map_or(0, |last| last + 1)]
    }

    /// Iterates over the elements, each with the number of its first corner.
    pub fn elements(&self) -> impl Iterator<Item = (usize, &'a [Corner<I>])> + use<'a, I> {
        self.elements_in(0..self.corners.len())
    }

    /// Iterates over the elements of a range of corners, which begins and ends with an element,
    /// each with the number of its first corner.
    pub fn elements_in(
        &self,
        range: Range<usize>,
    ) -> impl Iterator<Item = (usize, &'a [Corner<I>])> + use<'a, I> {
        let mut next = range.start;
        let corners = self.corners.get(range).unwrap_or_default();
        corners.split_inclusive(|corner| corner.is_last()).map(move |corners| {
            let first = next;
            next += corners.len();
            (first, corners)
        })
    }
}

/// Whether the element is a bar, which has a single side and no interior.
pub fn is_bar<I: Index>(corners: &[Corner<I>]) -> bool {
    corners.len() == 2
}

/// Iterates over the sides of an element: the number of the corner within the element at which the
/// side begins, and the vertex numbers of its two ends.
pub fn sides<I: Index>(corners: &[Corner<I>]) -> impl Iterator<Item = (usize, I, I)> + '_ {
    let count = if is_bar(corners) { 1 } else { corners.len() };
    let ends = corners.iter().skip(1).chain(corners.first());
    corners
        .iter()
        .zip(ends)
        .enumerate()
        .take(count)
        .map(|(number, (from, to))| (number, from.vertex(), to.vertex()))
}

/// One bit for each corner: whether the side that begins there represents its edge.
#[derive(Debug)]
pub struct ChosenSides<'a> {
    /// The bits, 32 to a word, the lowest bit first.
    // There is a bit for each corner of the scene. A side has the number of the corner at which it
    // begins: that of the first corner of its element plus the number that `sides` gives it. So
    // indexing by a side cannot fail.
    bits: &'a mut [u32],
}

/// Returns the most corners that a scene may have. Sides are chained by numbers, one of which means
/// "none", and a profile holds ranks of 30 bits.
pub const fn most_corners<I: Index>() -> usize {
    if I::BITS < 30 { (1 << I::BITS) - 1 } else { (1 << 30) - 1 }
}

impl<'a> ChosenSides<'a> {
    /// Returns the number of bytes that stay in use once the sides are chosen.
    pub const fn bytes(corners: usize) -> usize {
        Scratch::bytes_for::<u32>(corners.div_ceil(32))
    }

    /// Returns the bytes that are in use while the sides are being chosen, in addition to
    /// [`Self::bytes`].
    pub const fn bytes_while_choosing<I: Index>(vertices: usize, corners: usize) -> usize {
        Scratch::bytes_for::<I>(vertices) + Scratch::bytes_for::<I>(corners) + Self::bytes(corners)
    }

    /// Chooses one side to represent each edge. Of the sides of all elements that share the edge,
    /// it is the first one with the lowest pen. If a crease is given, only edges that it keeps are
    /// chosen.
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    pub fn choose<I: Index>(
        outlines: Outlines<'_, I>,
        projection: Projection,
        vertices: &[Vertex],
        (crease, unrounded): (Option<Crease>, Unrounded<'_>),
        scratch: &mut Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let corners = outlines.corners;
        let word_count = corners.len().div_ceil(32);
        let mut chosen = Self { bits: scratch.take(word_count)? };
        let mut meantime = scratch.reborrow();
        let heads: &mut [I] = meantime.take(vertices.len())?;
        let next: &mut [I] = meantime.take(corners.len())?;
        // This marks the sides whose edges have been found to have a second side.
        let mut shared = ChosenSides { bits: meantime.take(word_count)? };
        // None of the indexes below can fail. `heads` has an item for each vertex, and `from` and
        // `to` are vertices (see `check`). `next` has an item for each corner; `side` is the number
        // of a corner, and so is `known` wherever it is not `NONE`, because nothing but such sides,
        // `NONE` and the zeros of new memory is ever put into `heads` and `next`.
        heads.fill(I::NONE);
        for (first, element) in outlines.elements() {
            for (number, from, to) in sides(element) {
                if from == to {
                    continue;
                }
                let side = first + number;
                let head = &mut heads[from.min(to).get()];
                let mut known = *head;
                let mut before = I::NONE;
                let mut turned = false;
                while known != I::NONE {
                    let (a, b) = side_at(corners, known.get());
                    turned = (a, b) == (from, to);
                    if turned || (a, b) == (to, from) {
                        break;
                    }
                    before = known;
                    known = next[known.get()];
                    yield_counter.spend(30)?;
                }
                if known == I::NONE {
                    next[side] = *head;
                    *head = I::new(side);
                    chosen.insert(side);
                    continue;
                }
                let known = known.get();
                let is_open = is_bar(element) || shared.contains(known);
                let mut best = known;
                if outlines.pens.at(side) < outlines.pens.at(known) {
                    // The new side represents the edge from now on.
                    best = side;
                    next[side] = next[known];
                    // The side before it is one of the sides.
                    let link =
                        if before == I::NONE { Some(head) } else { next.get_mut(before.get()) };
                    if let Some(link) = link {
                        *link = I::new(side);
                    }
                    if chosen.contains(known) {
                        chosen.remove(known);
                        chosen.insert(best);
                    }
                }
                shared.insert(best);
                let Some(crease) = crease else { continue };
                let known_element = outlines.element(start_of(corners, known));
                // All vertices of elements exist.
                let at = |corner: &Corner<I>| vertices.get(corner.vertex().get()).copied();
                let mut one = known_element.iter().filter_map(at);
                let mut other = element.iter().filter_map(at);
                let end = vertices[from.get()];
                if is_open
                    || is_bar(known_element)
                    || crease.draws(projection, end, [&mut one, &mut other], turned, &|| {
                        unrounded.are_one_plane([from, to], known_element, element)
                    })
                {
                    chosen.insert(best);
                } else {
                    chosen.remove(best);
                }
            }
            yield_counter.spend(100 * element.len())?;
        }
        Ok(chosen)
    }

    /// Makes the side that begins at corner `side` represent its edge.
    fn insert(&mut self, side: usize) {
        self.bits[side / 32] |= 1 << (side % 32);
    }

    /// Makes the side that begins at corner `side` no longer represent its edge.
    fn remove(&mut self, side: usize) {
        self.bits[side / 32] &= !(1 << (side % 32));
    }

    /// Whether the side that begins at corner `side` represents its edge.
    #[inline]
    pub fn contains(&self, side: usize) -> bool {
        self.bits[side / 32] >> (side % 32) & 1 != 0
    }
}

/// Returns the number of the first corner of the element to which a corner belongs.
// In these two functions, `corner` and `side` are numbers of corners, because `choose` passes only
// what it has found in `heads` and `next`. If the corner at `side` is not the last of its element,
// there is another one behind it: the last corner of a scene is marked (see `check`).
fn start_of<I: Index>(corners: &[Corner<I>], corner: usize) -> usize {
    let before = corners[..corner].iter().rposition(|corner| corner.is_last());
    before.map_or(0, |last| last + 1)
}

/// Returns the vertex numbers of the two ends of the side that begins at a corner.
fn side_at<I: Index>(corners: &[Corner<I>], side: usize) -> (I, I) {
    let from = corners[side];
    let to = if from.is_last() { corners[start_of(corners, side)] } else { corners[side + 1] };
    (from.vertex(), to.vertex())
}
