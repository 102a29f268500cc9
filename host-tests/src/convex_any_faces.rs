//! Compares the faces that are found from vertices alone with the visibility of the same faces as
//! ordinary faces.

#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use std::collections::BTreeMap;

use penup::convex::{
    EdgeVisibility, Eye, SinkFull, SolidEdge, SolidSink, from_vertices, scratch_bytes_from_vertices,
};
use penup::geometry::{Precision, Projection, Vertex};
use penup::model::{Corner, Elements};
use penup::stage::{NeverCancel, Scratch};
use penup::visibility::{Scene, Stretch, Unrounded};

use crate::convex_solids::any_solid;
use crate::random::Random;

#[derive(Default)]
struct Faces {
    corners: Vec<Corner>,
    visibilities: BTreeMap<(u16, u16), EdgeVisibility>,
}

impl SolidSink for Faces {
    fn face(&mut self, corners: &[Corner], _: bool) -> Result<(), SinkFull> {
        self.corners.extend(corners);
        Ok(())
    }

    fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull> {
        let (a, b) = edge.ends;
        self.visibilities.insert((a.min(b), a.max(b)), edge.visibility);
        Ok(())
    }
}

/// Generates a random solid and an eye for which view coordinates are whole numbers, finds the
/// faces of the solid, and calls `stretches` for the visible and hidden stretches of a scene of
/// these faces. Visible edges must be completely visible and hidden ones completely hidden. Returns
/// `false` if the random points form no solid.
pub fn is_seen_alike(random: &mut Random, stretches: impl Fn(&Scene<'_>) -> Vec<Stretch>) -> bool {
    let points = any_solid(random);
    if points.iter().flatten().any(|part| part.abs() > 100) {
        return false;
    }
    // The camera looks along y, with x to the right and z up.
    let nearest = points.iter().map(|point| point[1]).min().expect("points");
    let position = [random.between(-9, 9), nearest - random.between(1, 9), random.between(-9, 9)];
    let (eye, projection) = if random.between(0, 1) == 0 {
        (Eye::At(position.map(i64::from)), Projection::Perspective)
    } else {
        (Eye::Towards([0, -1, 0]), Projection::Parallel)
    };
    let mut words = vec![0; scratch_bytes_from_vertices::<u16>(points.len()) / 8];
    let mut faces = Faces::default();
    let scratch = Scratch::new(&mut words);
    if from_vertices(&points, eye, Precision::default(), scratch, &mut NeverCancel, &mut faces)
        .is_err()
    {
        return false;
    }
    let vertices: Vec<Vertex> = points
        .iter()
        .map(|point| Vertex {
            x: point[0] - position[0],
            y: point[2] - position[2],
            z: point[1] - position[1],
        })
        .collect();
    let scene = Scene {
        vertices: &vertices,
        elements: Elements::new(&faces.corners),
        projection,
        unrounded: Unrounded::UNKNOWN,
    };
    let mut seen: BTreeMap<(u16, u16), Vec<bool>> = BTreeMap::new();
    for stretch in stretches(&scene) {
        let Some((a, b)) = stretch.edge else { continue };
        seen.entry((a.min(b), a.max(b))).or_default().push(stretch.visible);
    }
    for (ends, visibility) in &faces.visibilities {
        let expected = match visibility {
            EdgeVisibility::Outline | EdgeVisibility::Visible => true,
            EdgeVisibility::Hidden => false,
            // It does not matter here which of several coinciding lines is drawn.
            EdgeVisibility::BehindOutline => continue,
        };
        assert_eq!(
            seen.get(ends).map(Vec::as_slice),
            Some(&[expected][..]),
            "{ends:?} {visibility:?} of {points:?} seen from {eye:?}"
        );
    }
    true
}
