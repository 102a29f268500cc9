//! Tests of convex solids from vertices and edges against a reference that tries every plane
//! through three vertices.
//!
//! `PENUP_SOLIDS` sets the number of random solids; the default is 4,000.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use std::collections::BTreeMap;

use penup::convex::{
    EdgeVisibility, Eye, SolidError, SolidSummary, from_edges, from_vertices,
    scratch_bytes_from_edges, scratch_bytes_from_vertices,
};
use penup::geometry::Precision;
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup_host_tests::convex_model::{Found, Model, Point, model};
use penup_host_tests::convex_solids::{
    any_eye, any_rotation, any_solid, as_decimals, half_of_the_last, read_scene, roof, solid_count,
};
use penup_host_tests::random::Random;

const EXACT: Precision = Precision { written: 0, unit: 0 };

const SCENES: [&str; 5] = ["cube", "octahedron", "icosahedron", "dodecahedron", "eighteen"];

type Sights = BTreeMap<(u16, u16), EdgeVisibility>;

fn found(
    points: &[Point],
    edges: &[[u16; 2]],
    eye: Eye,
    tolerance: u32,
) -> Result<(SolidSummary, Sights), SolidError> {
    let mut words = vec![0; scratch_bytes_from_edges::<u16>(points.len(), edges.len()) / 8];
    let mut sink = Found::default();
    let scratch = Scratch::new(&mut words);
    let precision = Precision { written: tolerance, unit: tolerance.min(1) };
    let summary = from_edges(points, edges, eye, precision, scratch, &mut NeverCancel, &mut sink)?;
    assert_eq!((summary.faces, summary.edges), (0, sink.edges.len()));
    Ok((summary, sink.edges))
}

/// The edges in random order and direction, some of them twice.
fn shuffled(random: &mut Random, visibilities: &Sights) -> Vec<[u16; 2]> {
    let mut edges: Vec<[u16; 2]> = visibilities.keys().map(|(a, b)| [*a, *b]).collect();
    edges.push(random.one_of(&edges));
    for edge in &mut edges {
        random.shuffle(edge);
    }
    random.shuffle(&mut edges);
    edges
}

/// Compares with the reference model where there is one. Returns the kind of case.
fn compare(random: &mut Random, points: &[Point], eye: Eye) -> Option<&'static str> {
    // From an eye inside, the edges are those seen from elsewhere.
    let outside =
        if model(points, eye) == Model::EyeInside { Eye::Towards([1, 2, 3]) } else { eye };
    let Model::Solid(solid) = model(points, outside) else { return None };
    if solid.edges.is_empty() {
        return None;
    }
    let edges = shuffled(random, &solid.edges);
    let case = || format!("{points:?} {edges:?} {eye:?}");
    if outside != eye {
        assert_eq!(found(points, &edges, eye, 0), Err(SolidError::EyeInside), "{}", case());
        return Some("eye inside");
    }
    let (summary, visibilities) =
        found(points, &edges, eye, 0).unwrap_or_else(|error| panic!("{error:?} {}", case()));
    assert_eq!(visibilities, solid.edges, "{}", case());
    assert_eq!(summary.welded, solid.welded, "{}", case());
    Some(
        ["no component", "one component", "two components", "more components"]
            [summary.components.min(3)],
    )
}

#[test]
fn random_solids_are_seen_exactly() {
    let mut random = Random::new(1980);
    let mut cases: BTreeMap<&str, usize> = BTreeMap::new();
    for _ in 0..solid_count() {
        let points = any_solid(&mut random);
        let eye = any_eye(&mut random, &points);
        if let Some(case) = compare(&mut random, &points, eye) {
            *cases.entry(case).or_default() += 1;
        }
    }
    for _ in 0..500 {
        let points = roof(&mut random);
        let from_above =
            [random.between(-1, 1), random.between(-1, 1), random.between(2, 9)].map(i64::from);
        if let Some(case) = compare(&mut random, &points, Eye::Towards(from_above)) {
            *cases.entry(case).or_default() += 1;
        }
    }
    for case in ["no component", "one component", "two components", "more components", "eye inside"]
    {
        assert!(cases.get(case) >= Some(&100), "too few cases of {case}: {cases:?}");
    }
}

/// The edges of the faces of a scene.
fn edges_of(faces: &[Vec<u16>]) -> Vec<[u16; 2]> {
    let next = |face: &Vec<u16>, at: usize| face[(at + 1) % face.len()];
    let sides =
        faces.iter().flat_map(|face| (0..face.len()).map(move |at| [face[at], next(face, at)]));
    sides.filter(|side| side[0] < side[1]).collect()
}

fn found_from_vertices(points: &[Point], eye: Eye, tolerance: u32) -> Result<Sights, SolidError> {
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut sink = Found::default();
    let scratch = Scratch::new(&mut words);
    let precision = Precision { written: tolerance, unit: tolerance.min(1) };
    from_vertices(points, eye, precision, scratch, &mut NeverCancel, &mut sink)?;
    Ok(sink.edges)
}

/// For each edge, whether it is drawn when hidden lines are omitted.
fn drawn(visibilities: Sights) -> BTreeMap<(u16, u16), bool> {
    let is_drawn =
        |visibility| !matches!(visibility, EdgeVisibility::Hidden | EdgeVisibility::BehindOutline);
    visibilities.into_iter().map(|(ends, visibility)| (ends, is_drawn(visibility))).collect()
}

/// The dodecahedron and the other scenes are rotated and rounded, and also seen along their axes
/// and level with their faces. There, faces are edge-on and vertices behind vertices except for the
/// rounding. Both methods must draw them like the exact solid.
#[test]
fn rounded_solids_are_seen_like_exact_ones() {
    let mut random = Random::new(12);
    for name in SCENES {
        let (points, faces) = read_scene(name);
        let edges = edges_of(&faces);
        let square = |point: &Point| point.iter().map(|part| f64::from(part * part)).sum::<f64>();
        let radius = points.iter().map(square).fold(0.0, f64::max).sqrt();
        for _ in 0..300 {
            let rotation = any_rotation(&mut random);
            let rounded = as_decimals(&points, &rotation, 6);
            let turned = |position: [i64; 3]| {
                let row =
                    |row: usize| (0..3).map(|k| rotation[row][k] * position[k] as f64).sum::<f64>();
                [0, 1, 2].map(row)
            };
            let (eye, turned_eye) = match any_eye(&mut random, &points) {
                Eye::Towards(direction) => {
                    // So fine that its own rounding is nothing.
                    let fixed = turned(direction).map(|part| (part * 2f64.powi(50)) as i64);
                    (Eye::Towards(direction), Eye::Towards(fixed))
                }
                Eye::At(position) => {
                    let fixed = turned(position).map(|part| (part / radius * 2f64.powi(29)) as i64);
                    (Eye::At(position), Eye::At(fixed))
                }
            };
            let case = || format!("{name} {eye:?} {rounded:?}");
            let exact = match found(&points, &edges, eye, 0) {
                Ok((_, exact)) => drawn(exact),
                // On the surface a rounded eye may be on either side.
                Err(error) => {
                    assert_eq!(error, SolidError::EyeInside, "{}", case());
                    continue;
                }
            };
            let tolerance = half_of_the_last(6);
            let seen = found(&rounded, &edges, turned_eye, tolerance);
            assert_eq!(
                seen.map(|(_, visibilities)| drawn(visibilities)).as_ref(),
                Ok(&exact),
                "{}",
                case()
            );
            let seen = found_from_vertices(&rounded, turned_eye, tolerance);
            assert_eq!(seen.map(drawn).as_ref(), Ok(&exact), "{}", case());
        }
    }
}

#[test]
fn both_ways_to_see_agree_on_the_scenes() {
    let mut random = Random::new(4);
    for name in SCENES {
        let (points, faces) = read_scene(name);
        for _ in 0..200 {
            let eye = any_eye(&mut random, &points);
            let from_edges =
                found(&points, &edges_of(&faces), eye, 0).map(|(_, visibilities)| visibilities);
            assert_eq!(from_edges, found_from_vertices(&points, eye, 0), "{name} {eye:?}");
        }
    }
}

const SQUARE_PYRAMID: [Point; 5] = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 3]];
const ITS_EDGES: [[u16; 2]; 8] = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]];

#[test]
fn a_diagonal_of_a_face_is_seen_like_the_face() {
    let edges = [&ITS_EDGES[..], &[[0, 2]]].concat();
    for (eye, visibility) in [
        (Eye::Towards([0, 0, 1]), EdgeVisibility::Hidden),
        (Eye::Towards([0, 0, -1]), EdgeVisibility::Visible),
        (Eye::Towards([9, 1, 1]), EdgeVisibility::Hidden),
        (Eye::Towards([9, 1, -1]), EdgeVisibility::Visible),
        (Eye::Towards([9, 1, 0]), EdgeVisibility::BehindOutline),
    ] {
        let (_, visibilities) = found(&SQUARE_PYRAMID, &edges, eye, 0).expect("a solid");
        assert_eq!(visibilities[&(0, 2)], visibility, "{eye:?}");
    }
}

#[test]
fn a_vertex_in_the_middle_of_an_edge_or_face_is_seen_like_it() {
    let mut points = SQUARE_PYRAMID.to_vec();
    points.extend([[2, 0, 0], [2, 2, 0]]);
    let split = [[0, 5], [5, 1], [5, 6], [2, 6], [3, 6]];
    let edges = [&ITS_EDGES[1..], &split].concat();
    for (eye, of_edge, of_face) in [
        (Eye::Towards([0, 0, 1]), EdgeVisibility::Outline, EdgeVisibility::Hidden),
        (Eye::Towards([0, 0, -1]), EdgeVisibility::Outline, EdgeVisibility::Visible),
        (Eye::Towards([1, -9, -9]), EdgeVisibility::Visible, EdgeVisibility::Visible),
        (Eye::Towards([1, 9, 1]), EdgeVisibility::Hidden, EdgeVisibility::Hidden),
    ] {
        let (_, visibilities) = found(&points, &edges, eye, 0).expect("a solid");
        assert_eq!([visibilities[&(0, 5)], visibilities[&(1, 5)]], [of_edge; 2], "{eye:?}");
        assert_eq!(
            [visibilities[&(2, 6)], visibilities[&(3, 6)], visibilities[&(5, 6)]],
            [of_face; 3],
            "{eye:?}"
        );
    }
}

#[test]
fn what_is_no_solid_is_refused() {
    let eye = Eye::Towards([0, 0, 1]);
    let error = |points: &[Point], edges: &[[u16; 2]]| found(points, edges, eye, 0).err();
    let pyramid = &SQUARE_PYRAMID;
    assert_eq!(error(pyramid, &[]), Some(SolidError::TooFewVertices { distinct: 0 }));
    assert_eq!(error(pyramid, &ITS_EDGES[..2]), Some(SolidError::TooFewVertices { distinct: 3 }));
    assert_eq!(error(pyramid, &[[0, 1], [1, 5]]), Some(SolidError::UnknownVertex { edge: 1 }));
    assert_eq!(error(pyramid, &[[0, u16::MAX]]), Some(SolidError::UnknownVertex { edge: 0 }));
    // A side of the base is missing.
    let broken = error(pyramid, &[&ITS_EDGES[..1], &ITS_EDGES[2..]].concat());
    assert!(broken.is_none() || matches!(broken, Some(SolidError::OutlineBroken { .. })));
    // Three loose bars and a bow.
    assert!(matches!(
        error(pyramid, &[[0, 1], [2, 3], [0, 4]]),
        Some(SolidError::OutlineBroken { .. })
    ));
    let line: Vec<Point> = (0..5).map(|i| [i, 2 * i, -i]).collect();
    assert_eq!(error(&line, &ITS_EDGES), Some(SolidError::AllInLine));
    assert_eq!(
        found(pyramid, &ITS_EDGES, Eye::At([2, 2, 1]), 0).err(),
        Some(SolidError::EyeInside)
    );
    // In a plane: nothing hides anything.
    let flat = SQUARE_PYRAMID.map(|[x, y, _]| [x, y, x]);
    let (_, visibilities) = found(&flat, &ITS_EDGES, eye, 0).expect("a flat thing");
    assert!(
        visibilities.len() == 8
            && visibilities.values().all(|visibility| *visibility == EdgeVisibility::Visible)
    );
    // An edge of no length, and the same corner under two numbers.
    let twice = [&SQUARE_PYRAMID[..], &[[0, 0, 0]]].concat();
    let edges = [&ITS_EDGES[..], &[[0, 5], [5, 5], [5, 1]]].concat();
    let (summary, visibilities) = found(&twice, &edges, eye, 0).expect("a solid");
    assert_eq!((summary.welded, visibilities.len()), (1, 8));
}

/// For any edges, the library returns a result or an error and does not panic.
#[test]
fn nonsense_does_no_harm() {
    let mut random = Random::new(99);
    for _ in 0..5_000 {
        let points = any_solid(&mut random);
        let last = points.len() as i32 - 1;
        let edges: Vec<[u16; 2]> = (0..random.between(0, 30))
            .map(|_| [0, 1].map(|_| random.between(0, last) as u16))
            .collect();
        let eye = any_eye(&mut random, &points);
        let tolerance = random.one_of(&[0, 1, 1000, u32::MAX]);
        if let Ok((summary, visibilities)) = found(&points, &edges, eye, tolerance) {
            assert!(visibilities.len() == summary.edges && summary.edges <= edges.len());
        }
    }
}

/// Cancels the computation at the n-th check.
struct Impatient(usize);

impl Cancel for Impatient {
    fn check(&mut self) -> Result<(), Aborted> {
        self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
        Ok(())
    }
}

#[test]
fn a_word_too_few_or_no_patience_is_an_error() {
    let (points, faces) = read_scene("dodecahedron");
    let edges = edges_of(&faces);
    let eye = Eye::Towards([1, 2, 3]);
    let mut words = vec![0; scratch_bytes_from_edges::<u16>(points.len(), edges.len()) / 8];
    let all = words.len();
    for count in 0..all {
        let scratch = Scratch::new(&mut words[..count]);
        let result = from_edges(
            &points,
            &edges,
            eye,
            EXACT,
            scratch,
            &mut NeverCancel,
            &mut Found::default(),
        );
        assert!(matches!(result, Err(SolidError::Scratch(_))), "{count} of {all}: {result:?}");
    }
    let mut patience = 0;
    loop {
        let (scratch, mut cancel) = (Scratch::new(&mut words), Impatient(patience));
        match from_edges(&points, &edges, eye, EXACT, scratch, &mut cancel, &mut Found::default()) {
            Ok(summary) => break assert_eq!(summary.edges, 30),
            Err(error) => assert_eq!(error, SolidError::Aborted),
        }
        patience += 1;
    }
    assert!(patience > 30, "asked only {patience} times");
}
