use super::*;
use crate::stage::NeverCancel;
use std::vec;
use std::vec::Vec;

/// Runs `steps` on a search of the solid as seen from above, with its outline as the first
/// perimeter.
fn search_from_above(points: &[Point], steps: impl FnOnce(&mut FaceFinder<'_, u16>)) {
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut scratch = Scratch::new(&mut words);
    let mut candidates: Vec<u16> = (0..points.len() as u16).collect();
    let Span::Space(inside) = points::span(points, &candidates) else {
        unreachable!("the examples are solids");
    };
    let eye = Eye::Towards([0, 0, 1]);
    let mut scratch = scratch.reborrow();
    let mut search =
        FaceFinder::new(points, eye, inside, &mut candidates, &mut scratch, &mut NeverCancel);
    assert_eq!(search.as_mut().map(steps).err(), None);
}

/// Returns the perimeter, sorted, in the numbers of the paper (from 1).
fn perimeter(search: &FaceFinder<'_, u16>) -> Vec<(u16, u16)> {
    let mut segments: Vec<_> = (0..search.perimeter_count)
        .map(|at| search.segment(at))
        .map(|(from, to)| (from + 1, to + 1))
        .collect();
    segments.sort_unstable();
    segments
}

fn sorted<T: Ord + Copy>(items: &[T]) -> Vec<T> {
    let mut items = items.to_vec();
    items.sort_unstable();
    items
}

/// Finds the face at a segment. Returns the new edges and the vertices that drop out.
fn step(search: &mut FaceFinder<'_, u16>, segment: (u16, u16)) -> (Vec<(u16, u16)>, Vec<u16>) {
    let (edges, candidates) =
        (search.edge_count, search.candidates[..search.candidate_count].to_vec());
    let at = (0..search.perimeter_count)
        .find(|at| search.segment(*at) == (segment.0 - 1, segment.1 - 1));
    assert_ne!(at, None, "{segment:?} is in the perimeter");
    let found = search.find_face(at.unwrap_or(0), &mut NeverCancel);
    assert_eq!(found, Ok(()));
    let new_edges: Vec<_> = search.edges[edges..search.edge_count]
        .iter()
        .map(|edge| (edge.from().min(edge.to()) + 1, edge.from().max(edge.to()) + 1))
        .collect();
    let left = &search.candidates[..search.candidate_count];
    let dropped: Vec<_> = candidates
        .iter()
        .filter(|number| !left.contains(number))
        .map(|number| number + 1)
        .collect();
    (sorted(&new_edges), sorted(&dropped))
}

/// The example of Harrison 3.5. He gives the solid only by its numbering; a triangular cupola
/// has that numbering. His list of rejected vertices omits vertex 4, although both of its
/// segments cancel in the second step.
#[test]
fn the_general_example() {
    let cupola = [
        [-3, -3, 0],
        [-3, 0, 0],
        [0, 3, 0],
        [3, 3, 0],
        [3, 0, 0],
        [0, -3, 0],
        [-1, -2, 2],
        [-1, 1, 2],
        [2, 1, 2],
    ];
    type Segments = &'static [(u16, u16)];
    type Step = ((u16, u16), Segments, &'static [u16], Segments);
    let steps: [Step; 7] = [
        ((5, 4), &[(4, 9), (5, 9)], &[], &[(1, 6), (2, 1), (3, 2), (4, 3), (5, 9), (6, 5), (9, 4)]),
        (
            (4, 3),
            &[(3, 8), (8, 9)],
            &[4],
            &[(1, 6), (2, 1), (3, 2), (5, 9), (6, 5), (8, 3), (9, 8)],
        ),
        ((3, 2), &[(2, 8)], &[3], &[(1, 6), (2, 1), (5, 9), (6, 5), (8, 2), (9, 8)]),
        ((2, 1), &[(1, 7), (7, 8)], &[2], &[(1, 6), (5, 9), (6, 5), (7, 1), (8, 7), (9, 8)]),
        ((1, 6), &[(6, 7)], &[1], &[(5, 9), (6, 5), (7, 6), (8, 7), (9, 8)]),
        ((6, 5), &[(7, 9)], &[5, 6], &[(7, 9), (8, 7), (9, 8)]),
        ((9, 8), &[], &[7, 8, 9], &[]),
    ];
    search_from_above(&cupola, |search| {
        assert_eq!(perimeter(search), [(1, 6), (2, 1), (3, 2), (4, 3), (5, 4), (6, 5)]);
        for (segment, new_edges, dropped, new_perimeter) in steps {
            assert_eq!(
                step(search, segment),
                (new_edges.to_vec(), dropped.to_vec()),
                "{segment:?}"
            );
            assert_eq!(perimeter(search), new_perimeter, "{segment:?}");
        }
        // His final draw list has the same number of edges.
        assert_eq!(search.edge_count, 15);
        search.turn_to_hidden_faces();
        assert_eq!(perimeter(search), [(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1)]);
        assert_eq!(step(search, (1, 2)).0, []);
        assert_eq!((search.face_count, perimeter(search)), (8, vec![]));
    });
}

/// The example of Harrison 3.6: the perimeter falls into loops that touch in vertex 1. This
/// vertex must not drop out when the loop of face 1, 3, 4 closes.
#[test]
fn the_perimeter_splits() {
    let fan = [[3, 0, 0], [3, 3, 0], [0, 3, 2], [-3, 0, 3], [-3, -3, 2], [0, -3, 0]];
    search_from_above(&fan, |search| {
        assert_eq!(perimeter(search), [(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1)]);
        assert_eq!(step(search, (4, 5)), (vec![(1, 4), (1, 5)], vec![]));
        assert_eq!(perimeter(search), [(1, 2), (1, 5), (2, 3), (3, 4), (4, 1), (5, 6), (6, 1)]);
        assert_eq!(step(search, (2, 3)), (vec![(1, 3)], vec![2]));
        assert_eq!(perimeter(search), [(1, 3), (1, 5), (3, 4), (4, 1), (5, 6), (6, 1)]);
        assert_eq!(step(search, (4, 1)), (vec![], vec![3, 4]));
        assert_eq!(perimeter(search), [(1, 5), (5, 6), (6, 1)]);
        assert_eq!(step(search, (5, 6)), (vec![], vec![1, 5, 6]));
        assert_eq!(perimeter(search), []);
        assert_eq!(search.edge_count, 9);
    });
}
