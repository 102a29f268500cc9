//! Transforms a whole model to view coordinates and cuts off what is nearer than the near plane.
//!
//! A face that reaches behind the near plane is cut along it (Sutherland & Hodgman, with one
//! plane). Neighbouring faces that share a cut edge get the same new vertex. The cut itself is not
//! an edge of the model: an edge whose ends both lie on the near plane must not be drawn.

use super::curves::Flattening;
use super::weld::weld;
use super::{Sources, View};
use crate::array::MapEach;
use crate::geometry::Vertex;
use crate::index::Index;
use crate::model::{Corner, Element, Elements, Model, PenWriter};
use crate::stage::{Cancel, OutOfScratch, Scratch, StageError, heap_sort_by_key};

/// A model as the camera sees it: projected, and without what lies behind the eye.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a, I: Index> {
    /// The vertices of the model, the ends of its flattened curves, and the points where edges are
    /// cut.
    pub vertices: &'a [Vertex],
    /// The faces and bars, or their parts, that are in front of the near plane.
    pub elements: Elements<'a, I>,
    /// Of which vertices of the model the others are made.
    pub sources: Sources<'a, I>,
    /// The number of faces of the model that were left out because they have no area.
    pub degenerate_faces: u32,
    /// Whether anything of the model was cut off.
    pub is_cut: bool,
}

/// Transforms every vertex of `model` to view coordinates, welds vertices at the same position,
/// leaves out faces without an area, and cuts off what is nearer than the near plane. With
/// `curves`, the curves of the model are included too, as bars between vertices of their own.
///
/// # Errors
/// [`StageError::Scratch`] if the vertices or the cut faces do not fit in the memory, and the error
/// of `cancel` if the user cancels.
// Not inlined, so that its variables take no stack while the rest of a job is computed.
#[inline(never)]
pub fn project_scene<'a, I: Index>(
    view: &View,
    model: &'a Model<'_, I>,
    curves: Option<Flattening<'_>>,
    scratch: &mut Scratch<'a>,
    cancel: &mut dyn Cancel,
) -> Result<Seen<'a, I>, StageError> {
    let (elements, degenerate_faces) = weld(model.vertices(), model.elements(), scratch, cancel)?;
    let (vertices, elements, curve_ends) = match curves {
        Some(curves) => curves.add(view, model, elements, scratch, cancel)?,
        None => {
            let vertices = scratch.take::<Vertex>(model.vertices().len())?;
            view.fill(model, vertices, cancel)?;
            (&*vertices, elements, &[] as &[I])
        }
    };
    let mut sources = Sources {
        curves: model.curves(),
        curve_ends,
        first_chord_end: model.vertices().len(),
        first_cut: vertices.len(),
        cuts: &[],
    };
    let is_nearer = |near: &i32| vertices.iter().any(|vertex| vertex.z < *near);
    let near = view.near().filter(is_nearer);
    let (vertices, elements) = match near {
        Some(near) => {
            let (vertices, elements, cuts) = cut(vertices, elements, near, scratch)?;
            sources.cuts = cuts;
            (vertices, elements)
        }
        None => (vertices, elements),
    };
    Ok(Seen { vertices, elements, sources, degenerate_faces, is_cut: near.is_some() })
}

/// Returns the part of an edge at the depth `near` or beyond. Returns `None` if no part is.
pub(super) fn clip_edge([p, q]: [Vertex; 2], near: i32) -> Option<[Vertex; 2]> {
    match (p.z >= near, q.z >= near) {
        (true, true) => Some([p, q]),
        (true, false) => Some([p, on_plane(p, q, near)]),
        (false, true) => Some([on_plane(p, q, near), q]),
        (false, false) => None,
    }
}

/// Returns the edges of the faces, and the bars, each once, as pairs of vertex numbers. It takes 4
/// bytes of memory for each side of a face and each bar.
///
/// # Errors
/// [`OutOfScratch`] if that memory is not available.
pub fn distinct_edges<'a, I: Index>(
    elements: Elements<'_, I>,
    scratch: &mut Scratch<'a>,
) -> Result<&'a [[I; 2]], OutOfScratch> {
    let all = || elements.iter().flat_map(edges);
    let keys = scratch.take::<I::Pair>(all().count())?;
    for (key, edge) in keys.iter_mut().zip(all()) {
        *key = edge.key();
    }
    heap_sort_by_key(keys, |key| *key);
    // A pair has the size of its two numbers, and is aligned no less.
    Ok(bytemuck::cast_slice(without_repeats(keys)))
}

/// A scene in front of the near plane: the vertices, with those of the cuts after them, the
/// elements that are left, and for each cut the numbers of the ends of its edge.
type Cut<'a, I> = (&'a [Vertex], Elements<'a, I>, &'a [<I as Index>::Pair]);

/// Cuts off what is nearer than `near`.
pub(crate) fn cut<'a, I: Index>(
    vertices: &[Vertex],
    elements: Elements<'_, I>,
    near: i32,
    scratch: &mut Scratch<'a>,
) -> Result<Cut<'a, I>, OutOfScratch> {
    let is_seen = |number: I| vertices.get(number.get()).is_some_and(|vertex| vertex.z >= near);
    let is_cut = |edge: &Edge<I>| is_seen(edge.0) != is_seen(edge.1);

    let count = elements.iter().flat_map(edges).filter(is_cut).count();
    let keys = scratch.take::<I::Pair>(count)?;
    for (key, edge) in keys.iter_mut().zip(elements.iter().flat_map(edges).filter(is_cut)) {
        *key = edge.key();
    }
    heap_sort_by_key(keys, |key| *key);
    let keys = without_repeats(keys);

    // What cannot be numbered is refused as what does not fit, in bytes.
    let counts = [vertices.len() + keys.len(), <Corner<I>>::VERTEX_NUMBER_LIMIT];
    let [needed, available] = counts.map_each(Scratch::bytes_for::<Vertex>);
    let too_many = OutOfScratch { needed, available };
    if too_many.needed > too_many.available {
        return Err(too_many);
    }
    let all = scratch.take::<Vertex>(vertices.len() + keys.len())?;
    // `all` has as many items as `vertices` and `keys` together.
    let (same, new) = all.split_at_mut(vertices.len());
    for (vertex, original) in same.iter_mut().zip(vertices) {
        // Vertices behind the near plane no longer belong to any edge, but visibility requires
        // every vertex to be in front of the eye.
        *vertex = Vertex { z: original.z.max(near), ..*original };
    }
    for (vertex, key) in new.iter_mut().zip(keys) {
        let ends = I::halves(*key).map_each(|end| vertices.get(end.get()));
        if let [Some(p), Some(q)] = ends {
            *vertex = on_plane(*p, *q, near);
        }
    }
    let number_of = |edge: Edge<I>| {
        let at = keys.binary_search(&edge.key()).unwrap_or(0); // every cut edge is in the list
        I::new(vertices.len() + at) // below the limit, see above
    };

    // Each edge that is cut adds at most one corner.
    let corners = scratch.take::<I>(elements.corners().len() + count)?;
    let mut pens = PenWriter::new(scratch, elements.pens().changes())?;
    let mut length = 0;
    for (element, pen) in elements.iter_with_pens() {
        let start = length;
        let mut push = |number: I| {
            if let Some(corner) = corners.get_mut(length) {
                *corner = number;
                length += 1;
            }
        };
        let of_bar = matches!(element, Element::Bar(..));
        for edge in edges(element) {
            if is_seen(edge.0) {
                push(edge.0);
            }
            if is_cut(&edge) {
                push(number_of(edge));
            }
            if of_bar && is_seen(edge.1) {
                push(edge.1);
            }
        }
        let needed = if of_bar { 2 } else { 3 };
        if length - start < needed {
            length = start;
        } else {
            pens.element(start, pen);
        }
        let ends = start..length;
        let last = ends.end;
        for at in ends {
            if let Some(corner) = corners.get_mut(at) {
                *corner = bytemuck::cast(Corner::new(*corner, of_bar, at + 1 == last));
            }
        }
    }
    let corners: &'a [I] = corners;
    // A corner has the form of a number.
    let corners = bytemuck::cast_slice(corners.get(..length).unwrap_or(&[]));
    Ok((all, Elements::with_pens(corners, pens.finish()), keys))
}

/// An edge, as the numbers of the vertices at its ends.
#[derive(Clone, Copy)]
struct Edge<I>(I, I);

impl<I: Index> Edge<I> {
    /// Returns a key that is the same for both directions of the edge.
    fn key(self) -> I::Pair {
        I::pair(self.0.min(self.1), self.0.max(self.1))
    }
}

/// Iterates over the edges around a face, or over the single edge of a bar.
fn edges<I: Index>(element: Element<'_, I>) -> impl Iterator<Item = Edge<I>> + Clone {
    let (face, bar) = match element {
        Element::Face(corners) => (corners, None),
        Element::Bar(from, to) => (&[] as &[Corner<I>], Some(Edge(from, to))),
    };
    let nexts = face.iter().cycle().skip(1);
    face.iter().zip(nexts).map(|(a, b)| Edge(a.vertex(), b.vertex())).chain(bar)
}

/// Moves each different number of a sorted list to the front, and returns these.
fn without_repeats<T: Copy + PartialEq>(sorted: &mut [T]) -> &[T] {
    // At most one item is kept for each that has been looked at, so `kept` does not exceed `at`
    // within the loop, nor the length of the list behind it.
    let mut kept = 0;
    for at in 0..sorted.len() {
        if kept == 0 || sorted[kept - 1] != sorted[at] {
            sorted[kept] = sorted[at];
            kept += 1;
        }
    }
    &sorted[..kept]
}

/// Returns the point where the edge from `p` to `q`, one end of which is nearer than `near`, meets
/// the near plane. It is the same in both directions.
pub(crate) fn on_plane(p: Vertex, q: Vertex, near: i32) -> Vertex {
    let (p, q) = if p.z < q.z { (p, q) } else { (q, p) };
    let depth = i64::from(q.z) - i64::from(p.z); // above zero
    let part = i64::from(near) - i64::from(p.z);
    // Differences of coordinates are within 2^20, so products are below 2^41.
    let between = |p: i32, q: i32| {
        let rise = (i64::from(q) - i64::from(p)) * part;
        p + crate::fixed::divide_rounding(i128::from(rise), i128::from(depth)) as i32
    };
    Vertex { x: between(p.x, q.x), y: between(p.y, q.y), z: near }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn vertex(x: i32, y: i32, z: i32) -> Vertex {
        Vertex { x, y, z }
    }

    /// The elements after cutting at z = 10, as lists of positions.
    fn after(vertices: &[Vertex], elements: &[(&[u16], bool)]) -> Vec<Vec<(i32, i32, i32)>> {
        let corners: Vec<Corner> = elements
            .iter()
            .flat_map(|(numbers, bar)| {
                numbers
                    .iter()
                    .enumerate()
                    .map(|(at, number)| Corner::new(*number, *bar, at + 1 == numbers.len()))
            })
            .collect();
        let mut words = [0u64; 100];
        let (vertices, elements, _) =
            cut(vertices, Elements::new(&corners), 10, &mut Scratch::new(&mut words)).unwrap();
        let position = |number: u16| vertices[usize::from(number)];
        let found = elements.iter().map(|element| match element {
            Element::Bar(a, b) => std::vec![position(a), position(b)],
            Element::Face(corners) => {
                corners.iter().map(|corner| position(corner.vertex())).collect()
            }
        });
        found.map(|positions| positions.iter().map(|v| (v.x, v.y, v.z)).collect()).collect()
    }

    #[test]
    fn more_vertices_than_numbers_are_refused_in_bytes() {
        // Every bar is cut and adds a vertex, so the limit is passed by one.
        let limit = <Corner>::VERTEX_NUMBER_LIMIT;
        let bars = limit / 2 + 1;
        let vertices: Vec<Vertex> =
            (0..bars).map(|at| vertex(at as i32, 0, if at == 0 { 0 } else { 20 })).collect();
        let corners: Vec<Corner> = (1..bars as u16)
            .flat_map(|at| [Corner::new(0, true, false), Corner::new(at, true, true)])
            .collect();
        let mut words = std::vec![0u64; limit * 4];
        let outcome =
            cut(&vertices, Elements::new(&corners), 10, &mut Scratch::new(&mut words)).map(|_| ());
        let size = size_of::<Vertex>();
        let refused = OutOfScratch {
            needed: ((2 * bars - 1) * size).next_multiple_of(8),
            available: limit * size,
        };
        assert_eq!(outcome, Err(refused));
    }

    #[test]
    fn what_is_in_front_stays_and_what_is_behind_goes() {
        let vertices = [
            vertex(0, 0, 10),
            vertex(9, 0, 20),
            vertex(9, 9, 30),
            vertex(0, 0, -5),
            vertex(1, 1, 9),
        ];
        assert_eq!(
            after(&vertices, &[(&[0, 1, 2], false)]),
            [[(0, 0, 10), (9, 0, 20), (9, 9, 30)]]
        );
        assert!(after(&vertices, &[(&[3, 4], true)]).is_empty());
    }

    #[test]
    fn neighbours_share_the_vertex_of_their_cut_edge() {
        // Two faces with the edge 0-1 in common, which goes from z 20 to z 0.
        let vertices =
            [vertex(0, 0, 20), vertex(100, 40, 0), vertex(-50, 0, 20), vertex(50, 0, 20)];
        let found = after(&vertices, &[(&[0, 1, 2], false), (&[1, 0, 3], false), (&[1, 0], true)]);
        assert_eq!(found[0], [(0, 0, 20), (50, 20, 10), (25, 20, 10), (-50, 0, 20)]);
        assert_eq!(found[1], [(50, 20, 10), (0, 0, 20), (50, 0, 20), (75, 20, 10)]);
        assert_eq!(found[2], [(50, 20, 10), (0, 0, 20)]);
    }

    #[test]
    fn an_edge_alone_is_cut_like_that_of_a_face() {
        let [p, q] = [vertex(0, 0, 20), vertex(100, 40, 0)];
        let middle = vertex(50, 20, 10);
        assert_eq!(clip_edge([p, q], 10), Some([p, middle]));
        assert_eq!(clip_edge([q, p], 10), Some([middle, p]));
        assert_eq!(clip_edge([q, vertex(1, 1, 9)], 10), None);
        assert_eq!(clip_edge([p, q], i32::MIN), Some([p, q]));
    }

    #[test]
    fn an_edge_of_two_faces_and_a_bar_is_one() {
        let corners = [(0, false), (1, false), (2, true), (1, false), (0, false), (3, true)];
        let mut corners: Vec<Corner> =
            corners.map(|(number, last)| Corner::new(number, false, last)).into();
        corners.extend([Corner::new(3, true, false), Corner::new(1, true, true)]);
        let mut words = [0u64; 4];
        let edges = distinct_edges(Elements::new(&corners), &mut Scratch::new(&mut words)).unwrap();
        let sorted = |edge: &[u16; 2]| (edge[0].min(edge[1]), edge[0].max(edge[1]));
        let found: Vec<_> = edges.iter().map(sorted).collect();
        assert_eq!(found, [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3)]);
        assert!(distinct_edges(Elements::new(&corners), &mut Scratch::new(&mut [0; 3])).is_err());
        assert!(
            distinct_edges::<u16>(Elements::new(&[]), &mut Scratch::new(&mut []))
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn too_little_memory_is_an_error() {
        let vertices = [vertex(0, 0, 20), vertex(100, 40, 0), vertex(-50, 0, 20)];
        let corners = [0u16, 1, 2].map(|number| Corner::new(number, false, number == 2));
        for words in 0..9 {
            let mut words = std::vec![0u64; words];
            assert!(
                cut(&vertices, Elements::new(&corners), 10, &mut Scratch::new(&mut words)).is_err()
            );
        }
    }
}
