use super::super::{SinkFull, from_vertices, scratch_bytes_from_vertices};
use super::*;
use crate::model::Corner;
use crate::stage::NeverCancel;
use std::vec;
use std::vec::Vec;

#[derive(Default)]
struct Edges(Vec<[u16; 2]>);

impl SolidSink for Edges {
    fn face(&mut self, _: &[Corner], _: bool) -> Result<(), SinkFull> {
        Ok(())
    }

    fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull> {
        self.0.push([edge.ends.0, edge.ends.1]);
        Ok(())
    }
}

const FROM_ABOVE: Eye = Eye::Towards([0, 0, 1]);

fn edges_of(points: &[Point]) -> Vec<[u16; 2]> {
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut edges = Edges::default();
    let scratch = Scratch::new(&mut words);
    let exact = Precision::default();
    let found = from_vertices(points, FROM_ABOVE, exact, scratch, &mut NeverCancel, &mut edges);
    assert_eq!(found.map(|summary| summary.edges), Ok(edges.0.len()));
    edges.0
}

/// The outline and the visible and hidden components as seen from above, in the numbers of the
/// paper (from 1).
fn parts(points: &[Point]) -> (Vec<u16>, Vec<Vec<u16>>, Vec<Vec<u16>>) {
    let edges = edges_of(points);
    let mut words = vec![0; scratch_bytes_from_edges::<u16>(points.len(), edges.len()) / 8];
    let mut scratch = Scratch::new(&mut words);
    let mut scratch = scratch.reborrow();
    let mut visible = vec![0; points.len()];
    let mut parts = (vec![], vec![], vec![]);
    let decided = (|| {
        let mut graph = Graph::new(points, &edges, &mut scratch)?;
        let Span::Space(inside) = points::span(points, graph.numbers) else {
            return Err(SolidError::AllInLine);
        };
        let viewpoint = Viewpoint {
            eye: FROM_ABOVE,
            inside: Some(inside.map(|number| points[usize::from(number)])),
        };
        let outline = graph.find_outline(&viewpoint, inside, &mut scratch, &mut NeverCancel)?;
        graph.find_components();
        graph.decide_components(&viewpoint, outline, &mut visible, &mut NeverCancel)?;
        parts.0 = outline.iter().map(|number| number + 1).collect();
        for name in graph.component_names() {
            let of_component = |number: &u16| {
                graph.membership[usize::from(*number)] == Membership::component(name)
            };
            let numbers = 0..points.len() as u16;
            let component = numbers.filter(of_component).map(|number| number + 1).collect();
            let is_visible = visible[usize::from(name)] != 0;
            if is_visible { &mut parts.1 } else { &mut parts.2 }.push(component);
        }
        Ok(())
    })();
    assert_eq!(decided, Ok(()));
    let least = (0..parts.0.len()).min_by_key(|at| parts.0[*at]).unwrap_or(0);
    parts.0.rotate_left(least);
    parts.1.sort();
    parts.2.sort();
    parts
}

/// The paper gives Figure 1 only by its numbers; this solid has the same outline and the same
/// matrix G*.
#[test]
fn the_papers_example() {
    let points = [
        [2, 5, 3],
        [-3, 4, 3],
        [9, 3, -1],
        [3, 9, 1],
        [-3, 9, 1],
        [3, -1, 3],
        [-2, -5, 3],
        [9, -3, 1],
        [3, 2, -3],
        [-9, 3, -2],
        [-9, -3, -1],
        [-3, -9, 1],
        [3, -9, 0],
        [-1, 2, -3],
    ];
    assert_eq!(
        parts(&points),
        (vec![3, 4, 5, 10, 11, 12, 13, 8], vec![vec![1, 2, 6, 7]], vec![vec![9, 14]])
    );
    let inner = [1, 2, 6, 7, 9, 14];
    let mut matrix: Vec<_> = edges_of(&points)
        .iter()
        .map(|ends| (ends[0].min(ends[1]) + 1, ends[0].max(ends[1]) + 1))
        .filter(|(a, b)| inner.contains(a) && inner.contains(b))
        .collect();
    matrix.sort_unstable();
    assert_eq!(matrix, [(1, 2), (1, 6), (2, 7), (6, 7), (9, 14)]);
}

/// A rhombic dodecahedron with two faces edge-on. Its outline has eight vertices too, and two
/// of its vertices lie exactly behind vertices of the outline. No edge joins the two visible
/// vertices.
#[test]
fn edge_on_faces_and_vertices_behind_vertices() {
    // Turned so that the face between (2, 0, 0) and (0, 2, 0) is on top: x - y, z, x + y.
    let points = [
        [2, 0, 2],
        [-2, 0, -2],
        [-2, 0, 2],
        [2, 0, -2],
        [0, 2, 0],
        [0, -2, 0],
        [0, 1, 2],
        [0, -1, 2],
        [2, 1, 0],
        [2, -1, 0],
        [-2, 1, 0],
        [-2, -1, 0],
        [0, 1, -2],
        [0, -1, -2],
    ];
    assert_eq!(
        parts(&points),
        (vec![1, 9, 5, 11, 3, 12, 6, 10], vec![vec![7], vec![8]], vec![vec![2, 4, 13, 14]])
    );
}

/// Note 4 (a) and (b): a side without a component, and no component at all.
#[test]
fn sides_without_components() {
    let pyramid = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 3]];
    assert_eq!(parts(&pyramid), (vec![1, 2, 3, 4], vec![vec![5]], vec![]));
    let tetrahedron = [[0, 0, 2], [4, 4, 2], [4, 0, 0], [0, 4, 0]];
    assert_eq!(parts(&tetrahedron), (vec![1, 3, 2, 4], vec![], vec![]));
}

/// A roof whose ridge ends on the outline separates the vertices of a side.
#[test]
fn an_isolated_edge_makes_more_than_two_components() {
    let points = [[-6, 0, 4], [6, 0, 4], [0, -6, -4], [0, 6, -4], [0, -2, 2], [0, 2, 2]];
    assert_eq!(parts(&points), (vec![1, 3, 2, 4], vec![vec![5], vec![6]], vec![]));
}
