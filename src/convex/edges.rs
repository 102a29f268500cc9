//! Finds the visibility of the edges of a convex solid from its vertices and edges (Zámožík &
//! Zaťková).
//!
//! The outline is a closed walk along edges. Without the vertices of the outline the graph falls
//! into components. An edge that does not cross the outline cannot lead from the near side to the
//! far side, so each component is either visible as a whole or hidden as a whole.
//!
//! The paper leaves some cases open. They are settled by comparing depths exactly:
//! * There may be more than two components, because an edge between two vertices of the outline
//!   cuts a side in two. So each component is decided by itself, from one of its vertices and the
//!   triangle of outline vertices in front of or behind that vertex. Both belong to the solid, and
//!   a corner is at one end of the part of the line of sight that lies in the solid. A side without
//!   a component, note 4 (a), and no component at all, (b), need no special treatment.
//! * *Isolated edges*, note 4 (c), join two vertices of the outline. On either side of such an edge
//!   there is another outline vertex. The line between those two vertices belongs to the solid and
//!   crosses the edge on the page. The edge is visible if it is nearer than that line at the
//!   crossing.

use crate::array::MapEach;
use crate::index::Index;
use bytemuck::{Pod, Zeroable};

use super::exact::{Plane, Point, Viewpoint};
use super::points::{self, Span};
use super::polygon::Polygon;
use super::{EdgeVisibility, Eye, SolidEdge, SolidError, SolidSink, SolidSummary};
use crate::geometry::Precision;
use crate::stage::{Cancel, OutOfScratch, Scratch, heap_sort_by_key};

/// Finds the visibility of each edge of a convex solid.
///
/// `edges` are pairs of vertex numbers, counted from 0, in any order and direction. An edge that is
/// given twice counts once; an edge between two vertices at the same position is ignored. Vertices
/// without an edge are left out. The edges are trusted: no faces are computed to check them. The
/// sink receives every edge once, sorted, with the lesser vertex first, and no face. `precision`
/// says how far the positions may be off (see the module documentation).
///
/// # Errors
/// See [`SolidError`].
///
/// ```
/// use penup::convex::*;
/// use penup::geometry::Precision;
/// use penup::model::Corner;
/// use penup::stage::{Scratch, NeverCancel};
///
/// #[derive(Default)]
/// struct Hidden(Vec<(u16, u16)>);
/// impl SolidSink for Hidden {
///     fn face(&mut self, _: &[Corner], _: bool) -> Result<(), SinkFull> {
///         Ok(())
///     }
///     fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull> {
///         if edge.visibility == EdgeVisibility::Hidden {
///             self.0.push(edge.ends);
///         }
///         Ok(())
///     }
/// }
/// // A pyramid seen from below a side: the apex, 4, is hidden.
/// let pyramid = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 3]];
/// let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]];
/// let mut words = vec![0; scratch_bytes_from_edges::<u16>(5, 8) / 8];
/// let mut hidden = Hidden::default();
/// let eye = Eye::At([2, 2, -9]);
/// let scratch = Scratch::new(&mut words);
/// let exact = Precision::default();
/// let summary = from_edges(&pyramid, &edges, eye, exact, scratch, &mut NeverCancel, &mut hidden)?;
/// assert_eq!((summary.edges, summary.components), (8, 1));
/// assert_eq!(hidden.0, [(0, 4), (1, 4), (2, 4), (3, 4)]);
/// # Ok::<(), SolidError>(())
/// ```
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub fn from_edges<I: Index>(
    positions: &[[i32; 3]],
    edges: &[[I; 2]],
    eye: Eye,
    precision: Precision,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn SolidSink<I>,
) -> Result<SolidSummary, SolidError> {
    eye.check()?;
    points::check::<I>(positions)?;
    if let Some(edge) =
        edges.iter().position(|ends| !ends.iter().all(|end| end.get() < positions.len()))
    {
        return Err(SolidError::UnknownVertex { edge });
    }
    let mut scratch = scratch.reborrow();
    let mut graph = Graph::new(positions, edges, &mut scratch)?;
    if graph.numbers.len() < 4 {
        return Err(SolidError::TooFewVertices { distinct: graph.numbers.len() });
    }
    let inside = match points::span(positions, graph.numbers) {
        Span::Line => return Err(SolidError::AllInLine),
        // A flat polygon hides nothing.
        Span::Plane(_) => return graph.hand_over(|_| EdgeVisibility::Visible, cancel, sink),
        Span::Space(inside) => inside,
    };
    let viewpoint = Viewpoint {
        eye: points::drawn_in_eye(eye, positions, graph.numbers, precision),
        inside: Some(inside.map(|number| positions.get(number.get()).copied().unwrap_or_default())),
    };
    let outline = graph.find_outline(&viewpoint, inside, &mut scratch, cancel)?;
    let visible = scratch.take::<u8>(positions.len())?;
    graph.find_components();
    graph.decide_components(&viewpoint, outline, visible, cancel)?;
    graph.hand_over(|ends| graph.visibility(ends, eye, outline, visible), cancel, sink)
}

/// Returns the bytes of working memory that [`from_edges`] takes.
pub const fn scratch_bytes_from_edges<I: Index>(vertices: usize, edges: usize) -> usize {
    3 * Scratch::bytes_for::<I>(vertices)
        + Scratch::bytes_for::<u8>(vertices)
        + Scratch::bytes_for::<[I; 2]>(edges)
}

/// The part of the graph to which a vertex belongs: a component, the outline, or neither.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
struct Membership<I>(I);

impl<I: Index> Membership<I> {
    /// The membership of a vertex at which no edge ends.
    const NO_EDGE: Self = Self(I::NONE);
    /// The flag of a corner of the outline.
    fn outline_flag() -> I {
        I::ONE << (I::BITS - 1)
    }

    /// Makes the membership in a component. A component is named after the least of its vertices,
    /// here `name`.
    fn component(name: I) -> Self {
        Self(name)
    }

    /// Makes the membership in the outline, whose corner number `at` the vertex is.
    fn outline(at: usize) -> Self {
        Self(Self::outline_flag() | I::new(at)) // fewer than there are vertices
    }

    /// Returns the name of the component to which a vertex belongs, or `None` if it lies on the
    /// outline.
    fn component_name(self) -> Option<I> {
        (self.0 & Self::outline_flag() == I::ZERO).then_some(self.0)
    }

    /// Returns the vertex's index among the corners of the outline, or `None` if it is not one of
    /// them.
    fn outline_place(self) -> Option<usize> {
        (self.component_name().is_none() && self != Self::NO_EDGE)
            .then_some((self.0 & (Self::outline_flag() - I::ONE)).get())
    }
}

// Why no index in this file can fail:
// * A vertex is below `points.len()`: `from_edges` has checked the ends of all edges, `numbers`
//   begins with the numbers of all points, and `first_at_place` returns one of these. `membership`
//   and `visible` are as long as `points`.
// * The name of a component is a vertex: only ends of edges and other names become names.
// * `outline` holds vertices, and the place of a vertex in it is below its length.

/// The vertices that have edges, each position once, and the edges between them.
struct Graph<'s, I> {
    /// The positions of all vertices, those without edges included.
    points: &'s [Point],
    /// The numbers of the vertices that have edges, in the order of their positions.
    numbers: &'s [I],
    /// The edges, sorted and each once, with the lesser vertex number first.
    edges: &'s [[I; 2]],
    /// The membership of each vertex. A vertex that is in no component and not on the outline has
    /// no edge.
    membership: &'s mut [Membership<I>],
    /// The number of vertices left out because an earlier one is at the same position.
    welded: usize,
}

impl<'s, I: Index> Graph<'s, I> {
    /// Makes the graph of `edges`. A vertex at the same position as an earlier one is replaced by
    /// it, and an edge between two such vertices is left out.
    fn new(
        points: &'s [Point],
        edges: &[[I; 2]],
        scratch: &mut Scratch<'s>,
    ) -> Result<Self, OutOfScratch> {
        let numbers = scratch.take::<I>(points.len())?;
        for (slot, number) in numbers.iter_mut().zip(I::all()) {
            *slot = number;
        }
        let distinct = points::weld(points, numbers);
        let membership = scratch.take::<Membership<I>>(points.len())?;
        membership.fill(Membership::NO_EDGE);
        let own_edges = scratch.take::<[I; 2]>(edges.len())?;
        let mut count = 0; // at most the number of edges that were looked at
        for ends in edges {
            let [a, b] =
                ends.map_each(|end| points::first_at_place(points, &numbers[..distinct], end));
            if a != b {
                own_edges[count] = [a.min(b), a.max(b)];
                count += 1;
                membership[a.get()] = Membership::component(a);
                membership[b.get()] = Membership::component(b);
            }
        }
        let own_edges = &mut own_edges[..count];
        heap_sort_by_key(own_edges, |edge| *edge);
        let edge_count = remove_repeated(own_edges);
        let mut used = 0; // at most `at`
        for at in 0..distinct {
            if membership[numbers[at].get()] != Membership::NO_EDGE {
                numbers[used] = numbers[at];
                used += 1;
            }
        }
        Ok(Self {
            points,
            numbers: &numbers[..used],
            edges: &own_edges[..edge_count],
            membership,
            welded: points.len() - distinct,
        })
    }

    /// Returns the position of a vertex.
    fn point(&self, number: I) -> Point {
        self.points[number.get()]
    }

    /// Walks around the outline, counter-clockwise on the page, and marks its vertices. Returns the
    /// vertices in this order.
    fn find_outline(
        &mut self,
        viewpoint: &Viewpoint,
        [a, b, c, _]: [I; 4],
        scratch: &mut Scratch<'s>,
        cancel: &mut dyn Cancel,
    ) -> Result<&'s [I], SolidError> {
        let room = scratch.take::<I>(self.numbers.len())?;
        let mut enclosing = Polygon::triangle(room, self.points, viewpoint, [a, b, c]);
        for number in self.numbers {
            cancel.check()?;
            enclosing
                .enclose(self.points, viewpoint, *number)
                .map_err(|_| SolidError::EyeInside)?;
        }
        // Only this corner is taken from the polygon. Its other corners need not be joined by the
        // given edges, as positions may be rounded.
        let start = enclosing.corners()[0];
        let outline = enclosing.into_room();
        let mut count = 0;
        let (mut from, mut at) = (start, start);
        loop {
            cancel.check()?;
            let seen_before = self.membership[at.get()].outline_place().is_some();
            let room = outline.get_mut(count).filter(|_| !seen_before);
            *room.ok_or(SolidError::OutlineBroken { vertex: at.into() })? = at;
            self.membership[at.get()] = Membership::outline(count);
            count += 1;
            let next = self
                .rightmost_neighbour(from, at, viewpoint)
                .ok_or(SolidError::OutlineBroken { vertex: at.into() })?;
            if next == start {
                break;
            }
            (from, at) = (at, next);
        }
        if count < 3 {
            return Err(SolidError::OutlineBroken { vertex: start.into() });
        }
        Ok(&outline[..count])
    }

    /// Returns the neighbour of `at` that has all other neighbours to its left, not counting the
    /// one from which `at` was reached.
    fn rightmost_neighbour(&self, from: I, at: I, viewpoint: &Viewpoint) -> Option<I> {
        let origin = self.point(at);
        self.edges
            .iter()
            .filter_map(|[a, b]| if *a == at { Some(*b) } else { (*b == at).then_some(*a) })
            .filter(|number| *number != from)
            .reduce(|best, number| {
                if viewpoint.turn(origin, self.point(best), self.point(number)) < 0 {
                    number
                } else {
                    best
                }
            })
    }

    /// Finds the components into which the graph falls without the outline, and names each after
    /// the least of its vertices.
    fn find_components(&mut self) {
        for [a, b] in self.edges {
            let (Some(a), Some(b)) = (self.component(*a), self.component(*b)) else {
                continue;
            };
            self.membership[a.max(b).get()] = Membership::component(a.min(b));
        }
        // A name is never greater than the number of the vertex, so one pass in ascending order
        // reaches the final name.
        for number in 0..self.membership.len() {
            if let Some(name) = self.membership[number].component_name() {
                self.membership[number] = self.membership[name.get()];
            }
        }
    }

    /// Returns the name of the component of a vertex, as far as it is known. Returns `None` for a
    /// vertex on the outline.
    fn component(&self, number: I) -> Option<I> {
        let mut at = number;
        loop {
            let name = self.membership[at.get()].component_name()?;
            if name == at {
                return Some(name);
            }
            at = name;
        }
    }

    /// Sets `visible` to 1 at the name of each component that is on the near side.
    fn decide_components(
        &self,
        viewpoint: &Viewpoint,
        outline: &[I],
        visible: &mut [u8],
        cancel: &mut dyn Cancel,
    ) -> Result<(), SolidError> {
        for name in self.component_names() {
            // If the positions are rounded, the vertex farthest from its triangle decides most
            // reliably.
            let mut height_of_witness = 0i128;
            let mut plane_of_witness = None;
            for number in self.numbers {
                if self.membership[number.get()] != Membership::component(name) {
                    continue;
                }
                cancel.check()?;
                let Some(plane) = self.triangle_at(*number, viewpoint, outline) else {
                    continue;
                };
                let height = plane.height(self.point(*number));
                if plane_of_witness.is_none()
                    || height.unsigned_abs() > height_of_witness.unsigned_abs()
                {
                    height_of_witness = height;
                    plane_of_witness = Some(plane);
                }
            }
            let is_near = match plane_of_witness {
                Some(plane) if height_of_witness == 0 => self.is_nothing_above(&plane),
                _ => height_of_witness > 0,
            };
            visible[name.get()] = u8::from(is_near);
        }
        Ok(())
    }

    /// Iterates over the names of the components, each of which is its least vertex.
    fn component_names(&self) -> impl Iterator<Item = I> {
        self.numbers
            .iter()
            .copied()
            .filter(|number| self.membership[number.get()] == Membership::component(*number))
    }

    /// Returns the plane of the triangle of outline vertices in front of or behind which the vertex
    /// lies on the page. The upper side of the plane faces the eye.
    fn triangle_at(&self, number: I, viewpoint: &Viewpoint, outline: &[I]) -> Option<Plane> {
        let (first, rest) = outline.split_first()?;
        let apex = self.point(*first);
        let side = |corner: I| viewpoint.turn(apex, self.point(corner), self.point(number));
        rest.windows(2)
            .filter(|base| side(base[0]) >= 0 && side(base[1]) <= 0)
            .map(|base| Plane::through(apex, self.point(base[0]), self.point(base[1])))
            .find(|plane| !plane.is_degenerate())
    }

    /// Whether a plane is that of a face turned to the eye, provided that it is the plane of a
    /// face.
    fn is_nothing_above(&self, plane: &Plane) -> bool {
        self.numbers.iter().all(|number| plane.height(self.point(*number)) <= 0)
    }

    /// Returns the visibility of an edge.
    fn visibility(&self, ends: [I; 2], eye: Eye, outline: &[I], visible: &[u8]) -> EdgeVisibility {
        let memberships = ends.map(|end| self.membership[end.get()]);
        let is_visible = match memberships.map_each(Membership::component_name) {
            [Some(name), _] | [None, Some(name)] => visible[name.get()] != 0,
            [None, None] => {
                let [one, other] =
                    memberships.map(|membership| membership.outline_place().unwrap_or(0));
                let (first, last) = (one.min(other), one.max(other));
                if last - first == 1 || last - first == outline.len() - 1 {
                    return EdgeVisibility::Outline;
                }
                self.is_isolated_edge_visible(first, last, outline)
            }
        };
        if is_visible {
            EdgeVisibility::Visible
        } else if self.is_behind_outline(ends, eye, outline) {
            EdgeVisibility::BehindOutline
        } else {
            EdgeVisibility::Hidden
        }
    }

    /// Whether an edge between two corners of the outline that are not neighbours is visible. The
    /// corners are given by their indices.
    // `right` is not empty: `first` is less than `last`, because the outline has no vertex twice,
    // and `visibility` has excluded neighbours.
    fn is_isolated_edge_visible(&self, first: usize, last: usize, outline: &[I]) -> bool {
        let [start, end] = [first, last].map(|slot| self.point(outline[slot]));
        let right = &outline[first + 1..last];
        let left = || outline[last + 1..].iter().chain(&outline[..first]);
        // The upper side of this plane faces the eye, since the outline runs counter-clockwise. The
        // line that crosses the edge from right to left rises above this plane if its left end
        // does.
        let height = |right: I, left: I| {
            Plane::through(start, self.point(right), end).height(self.point(left))
        };
        // One pair would be enough if the positions were not rounded. Here the most reliable pair
        // is used among those that have one end fixed.
        let (mut surest, mut best_left) = (0i128, None);
        for number in left() {
            let height = height(right[0], *number);
            if best_left.is_none() || height.unsigned_abs() > surest.unsigned_abs() {
                (surest, best_left) = (height, Some(*number));
            }
        }
        for number in right {
            let height = best_left.map_or(0, |left| height(*number, left));
            if height.unsigned_abs() > surest.unsigned_abs() {
                surest = height;
            }
        }
        match surest {
            // The edge is a diagonal of a face whose plane contains the whole outline.
            0 => self.is_nothing_above(&Plane::through(start, self.point(right[0]), end)),
            _ => surest < 0,
        }
    }

    /// Whether an edge is exactly behind a side of the outline, so that drawing it would ink the
    /// same line again.
    fn is_behind_outline(&self, ends: [I; 2], eye: Eye, outline: &[I]) -> bool {
        let eye_itself = Viewpoint { eye, inside: None };
        let next = outline.iter().skip(1).chain(outline.first());
        outline.iter().zip(next).any(|(from, to)| {
            ends.iter().all(|end| {
                eye_itself.turn(self.point(*from), self.point(*to), self.point(*end)) == 0
            })
        })
    }

    /// Hands the edges, each with its visibility, to the sink.
    fn hand_over(
        &self,
        visibility: impl Fn([I; 2]) -> EdgeVisibility,
        cancel: &mut dyn Cancel,
        sink: &mut dyn SolidSink<I>,
    ) -> Result<SolidSummary, SolidError> {
        for ends in self.edges {
            cancel.check()?;
            sink.edge(SolidEdge { ends: (ends[0], ends[1]), visibility: visibility(*ends) })?;
        }
        Ok(SolidSummary {
            edges: self.edges.len(),
            welded: self.welded,
            components: self.component_names().count(),
            ..SolidSummary::default()
        })
    }
}

/// Keeps the first of each run of equal edges and returns how many are left.
fn remove_repeated<I: Index>(edges: &mut [[I; 2]]) -> usize {
    let mut kept = 0; // at most `at`
    for at in 0..edges.len() {
        if kept == 0 || edges[kept - 1] != edges[at] {
            edges[kept] = edges[at];
            kept += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests;
