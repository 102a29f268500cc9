//! Triangles and bars in front of the eye, or of a camera.

use crate::exact_visibility::{Piece, pieces};
use crate::fraction::Fraction;
use crate::scene_files::Stretches;
use penup::fixed::Decimal;
use penup::geometry::{COORDINATE_LIMIT, Projection, Vertex};
use penup::model::{Corner, Elements, Model, Position, no_undo};
use penup::stage::{NeverCancel, Scratch};
use penup::view::{Camera, Lens, Pose, View, project_scene};
use penup::visibility::{EdgeParameter, Options, Scene, Unrounded, find_stretches, scratch_bytes};

/// The most vertices and the most elements. The exact model takes a second for more.
const MOST: usize = 12;

/// Compares the hidden lines of a scene with those of the exact model.
///
/// The first byte holds options: the lowest bit is the projection, the next joins blocks that
/// touch, the next two choose the scale, and the next chooses the least memory. The second byte is
/// the number of vertices, of which each takes three bytes, signed coordinates. Each further group
/// of three bytes is a triangle between those vertices, or a bar if two of the three are the same.
///
/// If the sixth bit of the options is set, the points are those of a model that a camera sees; see
/// `camera`.
pub fn fuzz(input: &[u8]) {
    let [options, count, rest @ ..] = input else { return };
    let has_camera = options & 32 != 0;
    let Some((choices, rest)) = rest.split_at_checked(if has_camera { CHOICES } else { 0 }) else {
        return;
    };
    let (points, elements) = rest.split_at(rest.len().min(3 * (3 + usize::from(*count) % MOST)));
    let points: Vec<[i32; 3]> = points.chunks_exact(3).map(point).collect();
    let elements = elements_between(points.len(), elements);
    let projection = if options & 1 == 0 { Projection::Perspective } else { Projection::Parallel };
    if let Ok(choices) = choices.try_into() {
        see(&points, &elements, projection, choices, *options);
        return;
    }
    let Some(nearest) = points.iter().map(|point| point[2]).min() else { return };
    // In perspective all must lie in front of the eye.
    let back = if projection == Projection::Perspective { 1 - nearest } else { 0 };
    let scale =
        [1, 1000, COORDINATE_LIMIT / 256, COORDINATE_LIMIT / 257][usize::from(options >> 2 & 3)];
    let vertices: Vec<Vertex> = points
        .iter()
        .map(|[x, y, z]| Vertex::new(x * scale, y * scale, (z + back) * scale))
        .collect();
    let mut corners = Vec::new();
    for element in elements {
        let (last, of_bar) = (element.len() - 1, element.len() == 2);
        let corner = |(n, vertex): (usize, &u16)| Corner::new(*vertex, of_bar, n == last);
        corners.extend(element.iter().enumerate().map(corner));
    }
    let scene = Scene {
        vertices: &vertices,
        elements: Elements::new(&corners),
        projection,
        unrounded: Unrounded::UNKNOWN,
    };
    compare(&scene, *options);
}

/// The triangles and bars between so many points, as numbers of points from 0.
fn elements_between(points: usize, elements: &[u8]) -> Vec<Vec<u16>> {
    let mut found = Vec::new();
    for element in elements.chunks_exact(3).take(MOST) {
        let mut element: Vec<u16> =
            element.iter().map(|byte| u16::from(*byte) % points as u16).collect();
        element.dedup();
        if element.first() == element.last() {
            element.pop();
        }
        if element.len() >= 2 {
            found.push(element);
        }
    }
    found
}

/// Finds the hidden lines of a scene, and compares them with those of the exact model.
fn compare(scene: &Scene<'_>, options: u8) {
    let merged_blocks = options & 2 != 0;
    let corners = scene.elements.corners();
    let expected = pieces(scene.projection, scene.vertices, corners, merged_blocks);
    assert_eq!(found(scene, options), expected);
}

/// The number of bytes that choose a camera.
const CHOICES: usize = 8;

/// The camera that these bytes choose: the coordinates of the eye, those of the point looked at,
/// and two that choose the rest. The eye is up to eight times as far away as the model is large.
fn camera(choices: [u8; CHOICES], projection: Projection) -> Camera {
    let [eye, at] = [&choices[..3], &choices[3..6]].map(|bytes| point(bytes).map(f64::from));
    let [which, angle] = [choices[6], choices[7]];
    let eye = eye.map(|part| part * f64::from(1 + (which >> 5)));
    let degrees = f64::from(angle) * 360.0 / 256.0;
    let pose = match which & 3 {
        0 => Pose::Towards { eye, at: at.map(|part| part / 16.0), up: None },
        1 => Pose::Towards { eye, at, up: Some([degrees.sin(), degrees.cos(), 0.5]) },
        2 => Pose::Towards { eye, at, up: None },
        _ => Pose::Turned { eye, angles: at.map(|part| part + degrees) },
    };
    let lens = match (projection, which & 4) {
        (Projection::Perspective, _) => Lens::Perspective,
        (Projection::Parallel, 0) => Lens::Orthographic,
        _ => Lens::Oblique { angle: degrees, ratio: f64::from(which >> 3 & 3) / 2.0 },
    };
    Camera { pose, lens }
}

/// Lets a camera see a model of these points and elements. What it sees is compared with the exact
/// model, which takes the vertices as the view has rounded them. Where something lies behind the
/// eye, faces are cut, whose corners are no longer in a plane then, so nothing is compared.
fn see(
    points: &[[i32; 3]],
    elements: &[Vec<u16>],
    projection: Projection,
    choices: [u8; CHOICES],
    options: u8,
) {
    let (mut vertices, mut corners) = ([Position::ORIGIN; 2 * MOST], [<Corner>::ZERO; 4 * MOST]);
    let mut model = Model::new(&mut vertices, &mut corners);
    // The points are written with no decimals to three.
    let decimals = usize::from(options >> 2 & 3);
    let unit = 10f64.powi(-(decimals as i32));
    for point in points {
        let numbers = point.map(|part| {
            let text = format!("{:.decimals$}", f64::from(part) * unit);
            Decimal::parse(&text).expect("it was written as a number")
        });
        model.add_vertex(numbers, &mut no_undo).expect("there is room");
    }
    for element in elements {
        let numbers = element.iter().map(|number| i32::from(*number) + 1);
        let added = match element.len() {
            2 => model.add_polyline(numbers, &mut no_undo),
            _ => model.add_face(numbers, &mut no_undo),
        };
        added.expect("there is room");
    }
    let camera = camera(choices, projection);
    let scaled = |place: [f64; 3]| place.map(|part| part * unit);
    let pose = match camera.pose {
        Pose::Towards { eye, at, up } => Pose::Towards { eye: scaled(eye), at: scaled(at), up },
        Pose::Turned { eye, angles } => Pose::Turned { eye: scaled(eye), angles },
    };
    let Ok(view) = View::new(&Camera { pose, ..camera }, &model) else { return };
    let mut words = vec![0; 1 << 12];
    let mut scratch = Scratch::new(&mut words);
    let seen = project_scene(&view, &model, None, &mut scratch, &mut NeverCancel);
    let seen = seen.expect("there is room");
    let scene = Scene {
        vertices: seen.vertices,
        elements: seen.elements,
        projection: view.projection(),
        unrounded: Unrounded::UNKNOWN,
    };
    if seen.is_cut {
        found(&scene, options);
    } else {
        compare(&scene, options);
    }
}

/// Three signed coordinates.
fn point(bytes: &[u8]) -> [i32; 3] {
    [0, 1, 2].map(|axis: usize| i32::from(bytes[axis].cast_signed()))
}

/// The pieces that the library finds.
fn found(scene: &Scene<'_>, options: u8) -> Vec<Piece> {
    let merged_blocks = options & 2 != 0;
    let spare_bytes = if options & 16 == 0 { 1 << 14 } else { 0 };
    let mut words = vec![0u64; (scratch_bytes(scene) + spare_bytes) / 8];
    let mut stretches = Stretches::default();
    let options = Options { with_hidden: true, merged_blocks, ..Options::default() };
    let result =
        find_stretches(scene, options, Scratch::new(&mut words), &mut NeverCancel, &mut stretches);
    assert!(result.is_ok(), "{result:?}");
    let fraction = |along: EdgeParameter| Fraction::new(along.numerator, along.denominator);
    let piece = |stretch: &penup::visibility::Stretch| {
        let edge = stretch.edge.unwrap_or_default();
        (edge, fraction(stretch.from), fraction(stretch.to), stretch.visible)
    };
    stretches.0.iter().map(piece).collect()
}
