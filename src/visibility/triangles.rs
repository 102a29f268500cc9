//! Cuts every face into triangles: a fan from its first corner if that covers the face, otherwise
//! ears.
//!
//! Rounding bends a face of more than three corners, so its triangles are what hides. They are
//! computed exactly, in the projection of the face onto the coordinate plane to which it is most
//! nearly parallel.

use super::VisibilityError;
use super::edges::{Outlines, is_bar};
use super::yield_counter::YieldCounter;
use crate::array::MapEach;
use crate::geometry::Vertex;
use crate::index::Index;
use crate::model::Corner;
use crate::stage::Scratch;
use bytemuck::{Pod, Zeroable};

/// The way in which a face is cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    /// The element has no triangles because it has no area or is a bar.
    None,
    /// Each triangle joins the first corner to one of the sides that do not touch it.
    Fan,
    /// The triangles are stored in [`Ears`].
    Ears,
}

/// The start of the triangles of one face that no fan covers: the number of its first corner, and
/// the index of its first triangle.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(transparent)]
struct Entry<I>([I; 2]);

/// The triangles of all faces that no fan covers. (A fan is all triangles with one common corner;
/// an ear is a triangle that was cut off at a corner.)
#[derive(Debug, Default)]
pub struct Ears<'a, I> {
    /// Where the triangles of each face begin, in the order of the model.
    // A face begins at the number of triangles of those before it, so these indexes ascend, and
    // none is beyond `ears`. A face of n corners has n - 2 triangles at most, so each index is
    // below the number of corners and fits `I`.
    entries: &'a mut [Entry<I>],
    /// The triangles, face after face. Each is three vertex numbers.
    ears: &'a mut [[I; 3]],
}

/// How many faces a fan does not cover, and how large they are, which gives the memory that their
/// triangles need.
#[derive(Debug, Clone, Copy, Default)]
struct EarNeeds {
    /// The number of faces that no fan covers.
    faces: usize,
    /// The number of their triangles.
    ears: usize,
    /// The number of corners of the face among them that has the most.
    most_corners: usize,
}

impl EarNeeds {
    /// Counts the faces of a scene that no fan covers.
    fn of<I: Index>(outlines: Outlines<'_, I>, vertices: &[Vertex]) -> Self {
        concave(outlines, vertices).fold(Self::default(), |needs, (_, corners)| Self {
            faces: needs.faces + 1,
            ears: needs.ears + corners.len() - 2,
            most_corners: needs.most_corners.max(corners.len()),
        })
    }
}

impl<'a, I: Index> Ears<'a, I> {
    /// Returns the bytes that [`Self::cut`] takes, including those for the corners of a face while
    /// it is being cut.
    pub fn bytes(outlines: Outlines<'_, I>, vertices: &[Vertex]) -> usize {
        let needs = EarNeeds::of(outlines, vertices);
        Scratch::bytes_for::<Entry<I>>(needs.faces)
            + Scratch::bytes_for::<[I; 3]>(needs.ears)
            + Scratch::bytes_for::<I>(needs.most_corners)
    }

    /// Cuts every face that no fan covers into triangles.
    ///
    /// # Errors
    /// Returns an error if the memory is too small or the user cancels.
    #[inline(never)] // Inlined in its only caller, the code would be larger.
    pub fn cut(
        outlines: Outlines<'_, I>,
        vertices: &[Vertex],
        scratch: &mut Scratch<'a>,
        yield_counter: &mut YieldCounter<'_>,
    ) -> Result<Self, VisibilityError> {
        let needs = EarNeeds::of(outlines, vertices);
        yield_counter.spend(200 * outlines.corners.len())?;
        let entries: &mut [Entry<I>] = scratch.take(needs.faces)?;
        let ears: &mut [[I; 3]] = scratch.take(needs.ears)?;
        let mut meantime = scratch.reborrow();
        let remaining: &mut [I] = meantime.take(needs.most_corners)?;
        // `EarNeeds::of` has gone through the same faces, so none has more corners than `remaining`
        // has room for, and each has an entry. `cut_ears` says how many of the ears that are left
        // it has used, which are no more than there are.
        let mut used = 0;
        for (entry, (first, corners)) in entries.iter_mut().zip(concave(outlines, vertices)) {
            *entry = Entry([first, used].map_each(I::new));
            for (slot, corner) in remaining.iter_mut().zip(corners) {
                *slot = corner.vertex();
            }
            used += cut_ears(
                &mut remaining[..corners.len()],
                vertices,
                &mut ears[used..],
                yield_counter,
            )?;
        }
        Ok(Self { entries, ears: &mut ears[..used] })
    }

    /// Returns the triangles of the face that begins at corner `first`. The slice is empty if a fan
    /// covers the face.
    pub fn of(&self, first: usize) -> &[[I; 3]] {
        let begins = |entry: &Entry<I>| entry.0[1].get();
        match self.entries.binary_search_by_key(&first, |entry| entry.0[0].get()) {
            Ok(found) => {
                let end = self.entries.get(found + 1).map_or(self.ears.len(), begins);
                &self.ears[begins(&self.entries[found])..end]
            }
            Err(_) => &[],
        }
    }
}

/// Returns twice the signed areas of a polygon projected along x, y and z (Newell). As a vector
/// they point along the normal of the polygon.
///
/// Each area is a sum of at most 2^16 products of a factor within 2^20 and one within 2^21.
#[cfg_attr(feature = "threads", inline(always))] // So nothing is called through a pointer.
pub fn areas(polygon: &mut dyn Iterator<Item = Vertex>) -> [i64; 3] {
    let mut areas = [0i64; 3];
    let Some(first) = polygon.next() else {
        return areas;
    };
    let mut add = |a: Vertex, b: Vertex| {
        let product = |from: i32, to: i32, at: i32, with: i32| {
            (i64::from(from) - i64::from(to)) * (i64::from(at) + i64::from(with))
        };
        areas[0] += product(a.y, b.y, a.z, b.z);
        areas[1] += product(a.z, b.z, a.x, b.x);
        areas[2] += product(a.x, b.x, a.y, b.y);
    };
    let mut before = first;
    for vertex in polygon {
        add(before, vertex);
        before = vertex;
    }
    add(before, first);
    areas
}

/// A coordinate plane, seen from the side from which a given face runs anticlockwise.
#[derive(Debug, Clone, Copy)]
struct Plane {
    /// The axis at right angles to the plane: 0 for x, 1 for y, 2 for z.
    leans_to: usize,
    /// Whether the plane is seen from the positive end of that axis (`false`) or from the negative
    /// end.
    flipped: bool,
}

impl Plane {
    /// Returns the coordinate plane to which a polygon is most nearly parallel. Returns `None` if
    /// the polygon has no area.
    fn of(mut polygon: impl Iterator<Item = Vertex>) -> Option<Self> {
        let areas = areas(&mut polygon);
        // An axis is 0, 1 or 2, which is an index of `areas`.
        let leans_to = (0..3).rev().max_by_key(|&axis| areas[axis].abs())?;
        (areas[leans_to] != 0).then_some(Self { leans_to, flipped: areas[leans_to] < 0 })
    }

    /// Returns twice the signed area of a triangle projected onto the plane: positive if it runs
    /// anticlockwise. The result is within ±2^42.
    fn turn(self, a: Vertex, b: Vertex, c: Vertex) -> i64 {
        let flat = |vertex: Vertex| {
            let (x, y) = match self.leans_to {
                0 => (vertex.y, vertex.z),
                1 => (vertex.z, vertex.x),
                _ => (vertex.x, vertex.y),
            };
            (i64::from(x), i64::from(y))
        };
        let (a, b, c) = (flat(a), flat(b), flat(c));
        let turn = (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
        if self.flipped { -turn } else { turn }
    }
}

/// Decides how a face must be cut into triangles: not at all, as a fan, or ear by ear.
pub fn cut_of<I: Index>(corners: &[Corner<I>], vertices: &[Vertex]) -> Cut {
    if is_bar(corners) {
        return Cut::None;
    }
    // Every corner is the number of a vertex (see `check`), and an element has at least one corner.
    let at = |corner: &Corner<I>| vertices[corner.vertex().get()];
    let Some(plane) = Plane::of(corners.iter().map(at)) else {
        return Cut::None;
    };
    if corners.len() == 3 {
        return Cut::Fan;
    }
    let is_fan = corners[1..]
        .windows(2)
        .all(|side| plane.turn(at(&corners[0]), at(&side[0]), at(&side[1])) >= 0);
    if is_fan { Cut::Fan } else { Cut::Ears }
}

/// Returns the faces that no fan covers, each with the number of its first corner.
fn concave<'a, I: Index>(
    outlines: Outlines<'a, I>,
    vertices: &[Vertex],
) -> impl Iterator<Item = (usize, &'a [Corner<I>])> {
    outlines
        .elements()
        .filter(|(_, corners)| corners.len() > 3 && cut_of(corners, vertices) == Cut::Ears)
}

/// Cuts one ear after the other off a polygon and returns the number of triangles.
///
/// A corner is an ear if it is convex and no other corner lies in its triangle. Corners where the
/// polygon goes straight on are dropped. A polygon that crosses itself may have no ear; then a
/// convex corner is cut off nevertheless, so that the loop always ends.
fn cut_ears<I: Index>(
    polygon: &mut [I],
    vertices: &[Vertex],
    ears: &mut [[I; 3]],
    yield_counter: &mut YieldCounter<'_>,
) -> Result<usize, VisibilityError> {
    // `polygon` holds vertices of corners, which exist (see `check`).
    let at = |number: I| vertices[number.get()];
    let Some(plane) = Plane::of(polygon.iter().map(|&number| at(number))) else {
        return Ok(0);
    };
    let mut count = 0;
    let mut left = polygon.len();
    while left >= 3 {
        yield_counter.spend(100 * left * left)?;
        // `left` begins as the length of `polygon` and only becomes less, and it is at least 3
        // here. All numbers that `around` is asked for are below `left`, and `cut` is one of them.
        let rest = &polygon[..left];
        let around = |middle: usize| {
            [rest[(middle + left - 1) % left], rest[middle], rest[(middle + 1) % left]]
        };
        let turn_at = |middle: usize| {
            let [a, b, c] = around(middle);
            plane.turn(at(a), at(b), at(c))
        };
        let is_ear = |middle: usize| {
            let corners = around(middle).map_each(at);
            let [a, b, c] = corners;
            !rest.iter().map(|&number| at(number)).any(|point| {
                !corners.contains(&point)
                    && plane.turn(a, b, point) >= 0
                    && plane.turn(b, c, point) >= 0
                    && plane.turn(c, a, point) >= 0
            })
        };
        let straight = (0..left).find(|&middle| turn_at(middle) == 0);
        let cut = straight
            .or_else(|| (0..left).find(|&middle| turn_at(middle) > 0 && is_ear(middle)))
            .or_else(|| (0..left).find(|&middle| turn_at(middle) > 0))
            .unwrap_or(0);
        if turn_at(cut) > 0
            && let Some(ear) = ears.get_mut(count)
        {
            *ear = around(cut);
            count += 1;
        }
        polygon.copy_within(cut + 1..left, cut);
        left -= 1;
    }
    Ok(count)
}
