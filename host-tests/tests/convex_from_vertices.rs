//! Tests of convex solids from vertices alone against a reference that tries every plane through
//! three vertices.
//!
//! `PENUP_SOLIDS` sets the number of random solids; the default is 4,000.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use std::collections::{BTreeMap, BTreeSet};

use penup::convex::{
    EYE_LIMIT, EdgeVisibility, Eye, POSITION_LIMIT, SinkFull, SolidEdge, SolidError, SolidSink,
    SolidSummary, from_vertices, scratch_bytes_from_vertices,
};
use penup::geometry::Precision;
use penup::model::Corner;
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup_host_tests::convex_model::{Found, Model, Point, Solid, model};
use penup_host_tests::convex_solids::{
    any_eye, any_rotation, any_solid, as_decimals, half_of_the_last, read_scene, solid_count,
};
use penup_host_tests::random::Random;

const EXACT: Precision = Precision { written: 0, unit: 0 };

fn found(points: &[Point], eye: Eye, tolerance: u32) -> Result<(SolidSummary, Found), SolidError> {
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut sink = Found::default();
    let scratch = Scratch::new(&mut words);
    let precision = Precision { written: tolerance, unit: tolerance.min(1) };
    let summary = from_vertices(points, eye, precision, scratch, &mut NeverCancel, &mut sink)?;
    assert_eq!((summary.faces, summary.edges), (sink.faces.len(), sink.edges.len()));
    Ok((summary, sink))
}

/// Compares with the reference model. Returns the kind of case.
fn compare(points: &[Point], eye: Eye) -> &'static str {
    let found = found(points, eye, 0);
    let case = || format!("{points:?} {eye:?}");
    match (model(points, eye), found) {
        (Model::TooFew, Err(SolidError::TooFewVertices { .. })) => "too few",
        (Model::InLine, Err(SolidError::AllInLine)) => "in line",
        (Model::EyeInside, Err(SolidError::EyeInside)) => "eye inside",
        (Model::NotConvex(inside), Err(SolidError::VertexInside { vertex, count })) => {
            let first = inside.first().copied().map(u32::from);
            assert_eq!((first, inside.len()), (Some(vertex), count), "{}", case());
            "not convex"
        }
        (Model::Flat(corners), Ok((summary, found))) => {
            assert_eq!((summary.faces, summary.edges), (1, corners.len()), "{}", case());
            let ends: BTreeSet<u16> =
                found.edges.keys().flat_map(|ends| [ends.0, ends.1]).collect();
            assert_eq!(ends, corners, "{}", case());
            "flat"
        }
        (Model::Solid(solid), Ok((summary, found))) => {
            assert_eq!(found.faces, solid.faces, "{}", case());
            assert_eq!(found.edges, solid.edges, "{}", case());
            assert_eq!((summary.welded, summary.flat), (solid.welded, solid.flat), "{}", case());
            if solid.edges.values().any(|visibility| *visibility == EdgeVisibility::BehindOutline) {
                "edge-on"
            } else {
                "solid"
            }
        }
        (expected, found) => panic!("{}\n{expected:?}\n{found:?}", case()),
    }
}

#[test]
fn random_solids_are_found_exactly() {
    let mut random = Random::new(1971);
    let mut cases: BTreeMap<&str, usize> = BTreeMap::new();
    for _ in 0..solid_count() {
        let points = any_solid(&mut random);
        let eye = any_eye(&mut random, &points);
        *cases.entry(compare(&points, eye)).or_default() += 1;
    }
    for (case, least) in
        [("solid", 1000), ("edge-on", 500), ("eye inside", 50), ("not convex", 50), ("flat", 5)]
    {
        assert!(cases.get(case) >= Some(&least), "too few cases of {case}: {cases:?}");
    }
}

const SCENES: [&str; 5] = ["cube", "octahedron", "icosahedron", "dodecahedron", "eighteen"];

/// The faces that the scene's file contains.
fn listed_faces(faces: &[Vec<u16>]) -> BTreeSet<Vec<u16>> {
    let from_least = |face: &Vec<u16>| {
        let mut face = face.clone();
        let least = (0..face.len()).min_by_key(|at| face[*at]).expect("corners");
        face.rotate_left(least);
        face
    };
    faces.iter().map(from_least).collect()
}

#[test]
fn the_scenes_list_the_faces_that_are_found() {
    for name in SCENES {
        let (points, faces) = read_scene(name);
        let (_, found) = found(&points, Eye::At([900, -2000, 1300]), 0).expect(name);
        let found: BTreeSet<_> = found.faces.into_iter().map(|(corners, _)| corners).collect();
        assert_eq!(found, listed_faces(&faces), "{name}");
    }
}

#[test]
fn rounded_decimals_still_give_whole_faces() {
    let mut random = Random::new(20);
    for name in SCENES {
        let (points, faces) = read_scene(name);
        for decimals in [6, 7, 9] {
            for _ in 0..20 {
                let rounded = as_decimals(&points, &any_rotation(&mut random), decimals);
                let eye = Eye::At([0, 1, 2].map(|_| i64::from(random.between(-9, 9)) << 32));
                let tolerance = half_of_the_last(decimals);
                match found(&rounded, eye, tolerance) {
                    Ok((_, found)) => {
                        let found: BTreeSet<_> =
                            found.faces.into_iter().map(|(corners, _)| corners).collect();
                        assert_eq!(found, listed_faces(&faces), "{name} {decimals} {rounded:?}");
                    }
                    Err(error) => {
                        assert_eq!((error, eye), (SolidError::EyeInside, Eye::At([0; 3])))
                    }
                }
            }
        }
    }
}

#[test]
fn without_a_tolerance_rounded_pentagons_fall_into_triangles() {
    let (points, _) = read_scene("dodecahedron");
    let rounded = as_decimals(&points, &any_rotation(&mut Random::new(1)), 6);
    let (summary, _) = found(&rounded, Eye::Towards([1, 2, 3]), 0).expect("a solid");
    assert_eq!((summary.faces, summary.edges), (36, 54));
}

/// A square plate with a ridge of height 10 across each side: two almost flat roofs.
const ROOFS: [Point; 12] = [
    [0, 0, 0],
    [5000, 0, 10],
    [9000, 0, 0],
    [0, 9000, 0],
    [5000, 9000, 10],
    [9000, 9000, 0],
    [0, 0, -500],
    [5000, 0, -510],
    [9000, 0, -500],
    [0, 9000, -500],
    [5000, 9000, -510],
    [9000, 9000, -500],
];

#[test]
fn faces_are_joined_that_may_be_one_plane() {
    let eye = Eye::Towards([1, 2, 3]);
    let faces = |written| found(&ROOFS, eye, written).map(|(summary, _)| summary.faces);
    let joined = |written| found(&ROOFS, eye, written).map(|(summary, _)| summary.joined);
    assert_eq!((faces(0), joined(0)), (Ok(8), Ok(0)));
    // The far edge of half a roof is 18 off the plane of the other half. All four corners of that
    // plane may be off, and reaching out from 5000 to 9000 makes nearly twice as much of it.
    assert_eq!((faces(4), joined(4)), (Ok(8), Ok(0)));
    assert_eq!((faces(6), joined(6)), (Ok(6), Ok(2)));
    // What is less than 64 times the precision wide is as it stands, however large that is.
    assert_eq!(faces(9000), Ok(8));
}

#[test]
fn thin_slabs_and_needles_keep_their_edges() {
    // 0.002 thick, as a file of three decimals has it, in units of 0.00001: off by up to 50.
    let (thick, precision) = (200, 51);
    let slab: Vec<Point> = (0..8)
        .map(|n| [n & 1, n >> 1 & 1, n >> 2 & 1])
        .map(|[x, y, z]| [3_000_000 * x + 7000 * y, 2_000_000 * y - 3000 * x, thick * z + 40 * x])
        .collect();
    let wedge: Vec<Point> =
        slab.iter().filter(|point| point[1] > 0 || point[2] < thick).copied().collect();
    let needle = vec![[0, 0, 0], [thick, 0, 0], [0, thick, 0], [90, 80, 5_000_000]];
    let eye = Eye::At([9_000_000, 8_000_000, 7_000_000]);
    for solid in [slab, wedge, needle] {
        let exact = found(&solid, eye, 0).map(|(summary, _)| summary.edges);
        let rounded = found(&solid, eye, precision).map(|(summary, _)| summary);
        assert_eq!(rounded.map(|summary| (summary.edges, summary.joined)), exact.map(|e| (e, 0)));
    }
}

#[test]
fn a_plate_that_is_flat_but_for_rounding_has_two_faces() {
    let plate = [
        [0, 0, 1],
        [900_000, 0, 0],
        [1_000_000, 700_000, 1],
        [400_000, 1_000_000, 0],
        [0, 600_000, 0],
    ];
    let summary = found(&plate, Eye::Towards([1, 2, 3]), 2).map(|(summary, _)| summary);
    assert_eq!(summary.map(|summary| (summary.faces, summary.edges)), Ok((2, 5)));
}

#[test]
fn a_vertex_just_inside_a_face_is_flat_and_one_deeper_is_refused() {
    let mut points = ROOFS.to_vec();
    points.push([2500, 4000, 2]); // 3 below the roof, which is at 5 there
    let eye = Eye::Towards([1, 2, 3]);
    let error = SolidError::VertexInside { vertex: 12, count: 1 };
    assert_eq!(found(&points, eye, 0).map(|_| ()), Err(error));
    assert_eq!(found(&points, eye, 1).map(|_| ()), Err(error));
    assert_eq!(
        found(&points, eye, 2).map(|(summary, _)| (summary.faces, summary.flat)),
        Ok((8, 1))
    );
}

#[test]
fn vertices_in_the_middle_of_edges_and_faces_are_no_corners() {
    let points: Vec<Point> =
        (0..27).map(|i| [i % 3, i / 3 % 3, i / 9]).filter(|p| *p != [1; 3]).collect();
    let (summary, found) = found(&points, Eye::At([9, 2, 0]), 0).expect("a cube");
    assert_eq!((summary.faces, summary.edges, summary.flat), (6, 12, 18));
    let visible: Vec<_> = found.faces.iter().filter(|face| face.1).collect();
    assert_eq!(visible, [&(vec![2, 8, 25, 19], true)]);
}

#[test]
fn the_same_solid_whatever_the_order_of_its_vertices() {
    let (points, _) = read_scene("eighteen");
    let eye = Eye::At([7, 3, 3]);
    let Model::Solid(Solid { edges, .. }) = model(&points, eye) else { panic!("a solid") };
    let mut random = Random::new(3);
    let mut order: Vec<u16> = (0..points.len() as u16).collect();
    for _ in 0..50 {
        random.shuffle(&mut order);
        let shuffled: Vec<Point> =
            order.iter().map(|number| points[usize::from(*number)]).collect();
        let (_, found) = found(&shuffled, eye, 0).expect("a solid");
        let renamed: BTreeMap<_, _> = found
            .edges
            .iter()
            .map(|((a, b), visibility)| {
                let (a, b) = (order[usize::from(*a)], order[usize::from(*b)]);
                ((a.min(b), a.max(b)), *visibility)
            })
            .collect();
        assert_eq!(renamed, edges);
    }
}

const TETRAHEDRON: [Point; 4] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
const FROM_THERE: Eye = Eye::Towards([1, 1, 1]);

#[test]
fn what_is_no_solid_is_refused() {
    let error = |points: &[Point], eye| found(points, eye, 0).map(|_| ()).err();
    let distinct = 0;
    assert_eq!(error(&[], FROM_THERE), Some(SolidError::TooFewVertices { distinct }));
    let twice = [TETRAHEDRON, TETRAHEDRON].concat();
    assert_eq!(error(&twice[..3], FROM_THERE), Some(SolidError::TooFewVertices { distinct: 3 }));
    assert_eq!(found(&twice, FROM_THERE, 0).map(|(summary, _)| summary.welded), Ok(4));
    let line: Vec<Point> = (0..5).map(|i| [i, 2 * i, -i]).collect();
    assert_eq!(error(&line, FROM_THERE), Some(SolidError::AllInLine));
    let mut far = TETRAHEDRON;
    far[2][1] = POSITION_LIMIT;
    assert_eq!(error(&far, FROM_THERE), None);
    far[2][1] = -POSITION_LIMIT - 1;
    assert_eq!(error(&far, FROM_THERE), Some(SolidError::PositionOutOfRange { vertex: 2 }));
    assert_eq!(error(&TETRAHEDRON, Eye::Towards([0; 3])), Some(SolidError::BadEye));
    assert_eq!(error(&TETRAHEDRON, Eye::At([EYE_LIMIT; 3])), None);
    assert_eq!(error(&TETRAHEDRON, Eye::At([0, i64::MIN, 0])), Some(SolidError::BadEye));
    // On a face, on an edge, on a corner.
    for eye in [[0, 0, 0], [1, 0, 0]] {
        assert_eq!(error(&TETRAHEDRON, Eye::At(eye)), Some(SolidError::EyeInside));
    }
    let large = TETRAHEDRON.map(|point| point.map(|part| 3 * part));
    for eye in [[1, 0, 0], [1, 1, 0], [1, 1, 1]] {
        assert_eq!(error(&large, Eye::At(eye)), Some(SolidError::EyeInside));
    }
    assert_eq!(error(&vec![[0; 3]; 20_000], FROM_THERE), Some(SolidError::TooManyVertices));
}

/// A sink for a limited number of items. It must receive none if the result is an error.
struct Limited(usize);

impl SolidSink for Limited {
    fn face(&mut self, _: &[Corner], _: bool) -> Result<(), SinkFull> {
        self.0 = self.0.checked_sub(1).ok_or(SinkFull)?;
        Ok(())
    }

    fn edge(&mut self, _: SolidEdge) -> Result<(), SinkFull> {
        self.0 = self.0.checked_sub(1).ok_or(SinkFull)?;
        Ok(())
    }
}

#[test]
fn a_word_too_few_is_an_error_and_the_sink_is_given_nothing() {
    let (points, _) = read_scene("icosahedron");
    // Triangles only: as many edges and faces as there can be.
    let words_needed = scratch_bytes_from_vertices::<u16>(points.len()) / 8;
    let mut words = vec![0; words_needed];
    for count in 0..words_needed {
        let scratch = Scratch::new(&mut words[..count]);
        let mut sink = Limited(0);
        let result =
            from_vertices(&points, FROM_THERE, EXACT, scratch, &mut NeverCancel, &mut sink);
        assert!(matches!(result, Err(SolidError::Scratch(_))), "{count} {result:?}");
    }
    // 20 faces and 30 edges.
    for room in [0, 19, 20, 49] {
        let scratch = Scratch::new(&mut words);
        let result = from_vertices(
            &points,
            FROM_THERE,
            EXACT,
            scratch,
            &mut NeverCancel,
            &mut Limited(room),
        );
        assert_eq!(result, Err(SolidError::SinkFull));
    }
    let scratch = Scratch::new(&mut words);
    assert!(
        from_vertices(&points, FROM_THERE, EXACT, scratch, &mut NeverCancel, &mut Limited(50))
            .is_ok()
    );
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
fn the_user_can_give_up_at_any_moment() {
    let (points, _) = read_scene("dodecahedron");
    let rounded = as_decimals(&points, &any_rotation(&mut Random::new(2)), 6);
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut patience = 0;
    loop {
        let scratch = Scratch::new(&mut words);
        let mut cancel = Impatient(patience);
        let precision = Precision { written: half_of_the_last(6), unit: 1 };
        let mut sink = Limited(42);
        match from_vertices(&rounded, FROM_THERE, precision, scratch, &mut cancel, &mut sink) {
            Ok(_) => break,
            Err(error) => assert_eq!(error, SolidError::Aborted),
        }
        patience += 1;
    }
    assert!(patience > 36, "asked only {patience} times");
}
