//! Tests of seams, creases, merged blocks, non-planar faces, and everything that the visibility
//! module refuses.

use penup::geometry::{EdgeParameter, Precision, Projection, Vertex};
use penup::model::{Corner, Elements};
use penup::stage::{Aborted, Cancel, NeverCancel, Scratch};
use penup::visibility::{
    Crease, Options, Report, Scene, SinkFull, Stretch, StretchSink, Unrounded, VisibilityError,
    find_stretches, scratch_bytes,
};
use penup_host_tests::exact_visibility::pieces;
use penup_host_tests::random::Random;
use penup_host_tests::scene_files::{Model, Stretches, View};

const EYE: [f64; 3] = [9.0, -7.0, 6.0];
const UP: [f64; 3] = [0.0, 0.0, 1.0];

fn find(
    vertices: &[Vertex],
    corners: &[Corner],
    projection: Projection,
    options: Options,
) -> Result<(Report, Vec<Stretch>), VisibilityError> {
    find_in(vertices, corners, projection, Unrounded::UNKNOWN, options)
}

fn find_in(
    vertices: &[Vertex],
    corners: &[Corner],
    projection: Projection,
    unrounded: Unrounded<'_>,
    options: Options,
) -> Result<(Report, Vec<Stretch>), VisibilityError> {
    let scene = Scene { vertices, elements: Elements::new(corners), projection, unrounded };
    let mut words = vec![0u64; scratch_bytes(&scene) / 8 + 4096];
    let mut stretches = Stretches::default();
    let scratch = Scratch::new(&mut words);
    let report = find_stretches(&scene, options, scratch, &mut NeverCancel, &mut stretches)?;
    Ok((report, stretches.0))
}

fn visible_length(model: &Model, at: [f64; 3], options: Options) -> Result<f64, VisibilityError> {
    let view = View::new(model, EYE, at, UP, Projection::Perspective);
    let positions = model.vertices.iter().map(|at| at.map(|part| (part * 1e4).round() as i32));
    let positions: Vec<[i32; 3]> = positions.collect();
    let unrounded = Unrounded::new(&positions, Precision::default(), 1);
    let (_, stretches) =
        find_in(&view.vertices, &model.corners, view.projection, unrounded, options)?;
    Ok(stretches.iter().map(|stretch| length(&view, stretch)).sum())
}

fn length(view: &View, stretch: &Stretch) -> f64 {
    let [from, to] = [stretch.from, stretch.to].map(|along| view.image(stretch.ends, along));
    (from[0] - to[0]).hypot(from[1] - to[1])
}

fn add_box(model: &mut Model, low: [f64; 3], high: [f64; 3]) {
    let first = model.vertices.len();
    for n in 0..8 {
        let at = |axis: usize| {
            if n >> axis & 1 == 0 { low[axis] } else { high[axis] }
        };
        model.vertices.push([at(0), at(1), at(2)]);
    }
    for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        model.add(&face.map(|n| first + n));
    }
}

/// Two boxes that pass through each other, in oblique directions in which every seam has whole
/// ends.
fn crossing_boxes() -> (Vec<Vertex>, Vec<Corner>, Vec<[Vertex; 2]>) {
    let skew = |[u, v, w]: [i32; 3]| {
        let x = 90 * u + 31 * v;
        let y = 80 * w - 25 * v - 11 * u;
        let z = 70 * v + 9 * w - 40 * u;
        Vertex::new(500 * x, 500 * y, 500 * z)
    };
    let mut model = Model::default();
    add_box(&mut model, [0.0, 0.0, 0.0], [8.0, 4.0, 4.0]);
    add_box(&mut model, [2.0, -2.0, 1.0], [5.0, 6.0, 6.0]);
    let vertices = model.vertices.iter().map(|at| skew(at.map(|part| part as i32)));
    let mut seams = Vec::new();
    for y in [0, 4] {
        seams.push([[2, y, 1], [5, y, 1]]);
        seams.push([[2, y, 1], [2, y, 4]]);
        seams.push([[5, y, 1], [5, y, 4]]);
    }
    for x in [2, 5] {
        seams.push([[x, 0, 4], [x, 4, 4]]);
    }
    let seams = seams.into_iter().map(|ends| ends.map(skew)).collect();
    (vertices.collect(), model.corners, seams)
}

#[test]
fn seams_are_seen_where_bars_in_their_place_would_be() -> Result<(), VisibilityError> {
    let (vertices, corners, seams) = crossing_boxes();
    let space = |p: Vertex, q: Vertex| {
        let part = |a: i32, b: i32| (f64::from(a) - f64::from(b)).powi(2);
        (part(p.x, q.x) + part(p.y, q.y) + part(p.z, q.z)).sqrt()
    };
    let mut with_bars = (vertices.clone(), corners.clone());
    for ends in &seams {
        let first = with_bars.0.len() as u16;
        with_bars.0.extend(ends);
        with_bars.1.push(Corner::new(first, true, false));
        with_bars.1.push(Corner::new(first + 1, true, true));
    }
    let (with_bars, bar_corners) = with_bars;
    let expected: f64 = pieces(Projection::Parallel, &with_bars, &bar_corners, false)
        .iter()
        .filter(|(edge, _, _, visible)| usize::from(edge.0) >= vertices.len() && *visible)
        .map(|(edge, from, to, _)| {
            let [p, q] = [edge.0, edge.1].map(|n| with_bars[usize::from(n)]);
            (to - from).to_f64() * space(p, q)
        })
        .sum();
    let options = Options { with_seams: true, ..Options::default() };
    let (_, stretches) = find(&vertices, &corners, Projection::Parallel, options)?;
    let share = |along: EdgeParameter| along.numerator as f64 / along.denominator as f64;
    let found: f64 = stretches
        .iter()
        .filter(|stretch| stretch.edge.is_none())
        .map(|stretch| {
            (share(stretch.to) - share(stretch.from)) * space(stretch.ends.0, stretch.ends.1)
        })
        .sum();
    assert!(expected > 250_000.0, "{expected}");
    // The seams are found triangle by triangle, and where they meet on a diagonal they are rounded.
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    let (_, without) = find(&vertices, &corners, Projection::Parallel, Options::default())?;
    assert!(without.iter().all(|stretch| stretch.edge.is_some()));
    assert!(stretches.starts_with(&without));
    Ok(())
}

#[test]
fn scenes_without_crossing_faces_have_no_seams() -> Result<(), Box<dyn std::error::Error>> {
    for name in ["cube", "lblock", "notched", "lattice3"] {
        let model = Model::example(name)?;
        let view = View::example(name, &model)?;
        let options = Options { with_seams: true, ..Options::default() };
        let found = find(&view.vertices, &model.corners, view.projection, options);
        assert!(found.is_ok_and(|(_, stretches)| stretches.iter().all(|s| s.edge.is_some())));
    }
    Ok(())
}

#[test]
fn a_ball_with_creases_only_is_its_outline() -> Result<(), VisibilityError> {
    let (around, up) = (48, 24);
    let mut ball = Model::default();
    for n in 0..around * (up + 1) {
        let u = std::f64::consts::TAU * (n % around) as f64 / around as f64;
        let v = std::f64::consts::PI * (n / around) as f64 / up as f64;
        ball.vertices.push([u.cos() * v.sin(), u.sin() * v.sin(), v.cos()]);
    }
    for n in 0..around * up {
        let next = n / around * around + (n + 1) % around;
        if n / around > 0 {
            ball.add(&[n, n + around, next]);
        }
        if n / around + 1 < up {
            ball.add(&[next, n + around, next + around]);
        }
    }
    // The poles are many vertices at one place: make them one.
    for corner in &mut ball.corners {
        let vertex = usize::from(corner.vertex());
        let welded = match vertex / around {
            0 => 0,
            ring if ring == up => up * around,
            _ => vertex,
        };
        *corner = Corner::new(welded as u16, false, corner.is_last());
    }
    let view = View::new(&ball, EYE, [0.0; 3], UP, Projection::Parallel);
    let crease = Some(Crease {
        cosine: 908_093, // 30 degrees
        depth_stretch: view.depth_stretch(),
        slants: [0; 2],
    });
    let options = Options { crease, ..Options::default() };
    let (_, all) = find(&view.vertices, &ball.corners, view.projection, Options::default())?;
    let (_, outline) = find(&view.vertices, &ball.corners, view.projection, options)?;
    assert!(outline.len() * 10 < all.len(), "{} of {}", outline.len(), all.len());
    let centre = view.image_of_origin();
    for stretch in &outline {
        for along in [stretch.from, stretch.to] {
            let at = view.image(stretch.ends, along);
            let radius = (at[0] - centre[0]).hypot(at[1] - centre[1]);
            assert!((0.97..1.0001).contains(&radius), "{radius}");
        }
    }
    let total: f64 = outline.iter().map(|stretch| length(&view, stretch)).sum();
    assert!((6.2..7.0).contains(&total), "{total}");
    Ok(())
}

#[test]
fn merged_blocks_look_like_one_block() -> Result<(), VisibilityError> {
    let merged = Options { merged_blocks: true, ..Options::default() };
    let mut whole = Model::default();
    add_box(&mut whole, [0.0, 0.0, 0.0], [2.0, 1.0, 2.0]);
    let expected = visible_length(&whole, [1.0, 0.5, 1.0], Options::default())?;
    // A stack of two, and two bricks on one: corners that meet corners, and corners that meet
    // sides.
    let bricks: [&[[[f64; 3]; 2]]; 2] = [
        &[[[0.0; 3], [2.0, 1.0, 1.3]], [[0.0, 0.0, 1.3], [2.0, 1.0, 2.0]]],
        &[
            [[0.0; 3], [2.0, 1.0, 0.7]],
            [[0.0, 0.0, 0.7], [0.9, 1.0, 2.0]],
            [[0.9, 0.0, 0.7], [2.0, 1.0, 2.0]],
        ],
    ];
    for bricks in bricks {
        let mut wall = Model::default();
        for [low, high] in bricks {
            add_box(&mut wall, *low, *high);
        }
        let separate = visible_length(&wall, [1.0, 0.5, 1.0], Options::default())?;
        let together = visible_length(&wall, [1.0, 0.5, 1.0], merged)?;
        assert!(separate > expected * 1.1, "{separate} {expected}");
        assert!((together / expected - 1.0).abs() < 2e-4, "{together} {expected}");
    }
    Ok(())
}

#[test]
fn a_wall_on_a_floor_keeps_its_foot() -> Result<(), VisibilityError> {
    // Seen straight from the front, so that rounding leaves the wall exactly on the floor.
    let mut model = Model::default();
    add_box(&mut model, [0.0, 0.0, 0.0], [800.0, 100.0, 800.0]);
    add_box(&mut model, [200.0, 100.0, 300.0], [600.0, 500.0, 400.0]);
    let vertices: Vec<Vertex> = model
        .vertices
        .iter()
        .map(|at| at.map(|part| part as i32))
        .map(|[x, y, z]| Vertex::new(100 * (x - 300), 100 * (y - 900), 100 * (z + 1000)))
        .collect();
    let foot = (8, 9);
    for merged_blocks in [false, true] {
        let options = Options { merged_blocks, ..Options::default() };
        let (_, stretches) = find(&vertices, &model.corners, Projection::Perspective, options)?;
        let found = stretches
            .iter()
            .find(|stretch| stretch.edge.is_some_and(|(p, q)| (p.min(q), p.max(q)) == foot));
        let Some(found) = found else {
            return Err(VisibilityError::SinkFull);
        };
        assert!(
            found.visible && found.from == EdgeParameter::START && found.to == EdgeParameter::END
        );
    }
    Ok(())
}

#[test]
fn rounding_does_not_take_a_block_off_its_floor() -> Result<(), VisibilityError> {
    for turn in 0..12 {
        let seen = |lift: i32, with_positions: bool| -> Result<f64, VisibilityError> {
            let mut model = Model::default();
            let height = 1.0 + 1e-4 * f64::from(lift);
            add_box(&mut model, [0.0; 3], [10.0, 10.0, 1.0]);
            add_box(&mut model, [3.0, 3.0, height], [5.0, 6.0, height + 3.0]);
            let eye = [19.0 + f64::from(turn), 0.3 * f64::from(turn) - 17.0, 12.0];
            let view = View::new(&model, eye, [5.0, 5.0, 1.0], UP, Projection::Perspective);
            let positions = model.vertices.iter().map(|at| at.map(|part| (part * 1e4) as i32));
            let positions: Vec<[i32; 3]> = positions.collect();
            let scene = Scene {
                vertices: &view.vertices,
                elements: Elements::new(&model.corners),
                projection: view.projection,
                unrounded: match with_positions {
                    true => Unrounded::new(&positions, Precision::default(), 1),
                    false => Unrounded::UNKNOWN,
                },
            };
            let mut words = vec![0u64; scratch_bytes(&scene) / 8 + 100];
            let mut stretches = Stretches::default();
            let scratch = Scratch::new(&mut words);
            let options = Options::default();
            find_stretches(&scene, options, scratch, &mut NeverCancel, &mut stretches)?;
            Ok(stretches.0.iter().map(|stretch| length(&view, stretch)).sum())
        };
        // Lifted by a hair, the block shows its whole foot.
        let expected = seen(1, false)?;
        let found = seen(0, true)?;
        assert!((found / expected - 1.0).abs() < 1e-5, "{turn}: {found} {expected}");
    }
    Ok(())
}

#[test]
fn a_bent_face_hides_like_its_triangles() -> Result<(), VisibilityError> {
    let mut random = Random::new(5);
    for _ in 0..200 {
        let mut vertices = Vec::new();
        let (mut bent, mut cut) = (Vec::new(), Vec::new());
        for first in [0u16, 4, 8] {
            let mut at = |x: i32, y: i32| {
                let mut jitter = || random.between(-400, 400);
                Vertex::new(x + jitter(), y + jitter(), 3000 + 3 * jitter())
            };
            vertices.extend([at(-900, -900), at(900, -900), at(900, 900), at(-900, 900)]);
            for n in 0..4 {
                bent.push(Corner::new(first + n, false, n == 3));
            }
            for triangle in [[0, 1, 2], [0, 2, 3]] {
                for (n, corner) in triangle.into_iter().enumerate() {
                    cut.push(Corner::new(first + corner, false, n == 2));
                }
            }
        }
        let options = Options { with_hidden: true, ..Options::default() };
        let outline = |corners: &[Corner]| -> Result<Vec<_>, VisibilityError> {
            let (_, stretches) = find(&vertices, corners, Projection::Perspective, options)?;
            let mut sides: Vec<_> = stretches
                .iter()
                .filter_map(|stretch| Some((stretch.edge?, stretch)))
                .map(|((p, q), stretch)| match p < q {
                    true => ((p, q), stretch.from, stretch.to, stretch.visible),
                    false => {
                        ((q, p), mirrored(stretch.to), mirrored(stretch.from), stretch.visible)
                    }
                })
                .filter(|((p, q), ..)| q - p != 2)
                .collect();
            sides.sort();
            Ok(sides)
        };
        assert_eq!(outline(&bent)?, outline(&cut)?);
    }
    Ok(())
}

fn mirrored(along: EdgeParameter) -> EdgeParameter {
    EdgeParameter { numerator: along.denominator - along.numerator, denominator: along.denominator }
}

fn triangle() -> (Vec<Vertex>, Vec<Corner>) {
    let vertices = [(0, 0), (100, 0), (0, 100), (50, 0)];
    let vertices = vertices.map(|(x, y)| Vertex::new(x, y, 10)).to_vec();
    let corners = [0, 1, 2].map(|n| Corner::new(n, false, n == 2)).to_vec();
    (vertices, corners)
}

#[test]
fn degenerate_faces_are_counted_and_hide_nothing() {
    let (vertices, mut corners) = triangle();
    corners.extend([0, 3, 1].map(|n| Corner::new(n, false, n == 1)));
    corners.extend([0, 3, 0].map(|n| Corner::new(n, false, false)));
    let last = corners.len() - 1;
    corners[last] = Corner::new(0, false, true);
    let found = find(&vertices, &corners, Projection::Parallel, Options::default());
    assert!(
        found.is_ok_and(|(report, stretches)| report.degenerate_faces == 2 && stretches.len() == 3)
    );
}

#[test]
fn nothing_has_no_stretches() {
    let found = find(&[], &[], Projection::Perspective, Options::default());
    assert_eq!(found, Ok((Report::default(), Vec::new())));
}

#[test]
fn what_the_arithmetic_cannot_take_is_refused() {
    let (vertices, corners) = triangle();
    let refused = |vertices: &[Vertex], corners: &[Corner], projection| {
        find(vertices, corners, projection, Options::default()).err()
    };
    for (bad, number) in [
        (Vertex::new(1 << 19, 0, 1), None),
        (Vertex::new((1 << 19) + 1, 0, 1), Some(1)),
        (Vertex::new(0, i32::MIN, 1), Some(1)),
        (Vertex::new(0, 0, 0), Some(1)),
    ] {
        let mut vertices = vertices.clone();
        vertices[1] = bad;
        let error = refused(&vertices, &corners, Projection::Perspective);
        assert_eq!(error, number.map(VisibilityError::OutOfRange), "{bad:?}");
    }
    let unknown =
        [corners.clone(), [0, 1, 7].map(|n| Corner::new(n, false, n == 7)).to_vec()].concat();
    assert_eq!(
        refused(&vertices, &unknown, Projection::Parallel),
        Some(VisibilityError::UnknownVertex(7))
    );
    let many = corners.repeat(30_000);
    assert_eq!(
        refused(&vertices, &many, Projection::Parallel),
        Some(VisibilityError::TooManyCorners(65_535))
    );
}

/// Cancels the computation at the given check.
struct Impatient(usize);

impl Cancel for Impatient {
    fn check(&mut self) -> Result<(), Aborted> {
        self.0 = self.0.checked_sub(1).ok_or(Aborted)?;
        Ok(())
    }
}

/// A sink that accepts only this many stretches.
struct Small(usize);

impl StretchSink for Small {
    fn stretch(&mut self, _: Stretch) -> Result<(), SinkFull> {
        self.0 = self.0.checked_sub(1).ok_or(SinkFull)?;
        Ok(())
    }
}

#[test]
fn an_abort_a_full_sink_and_too_little_memory_end_the_search() -> std::io::Result<()> {
    let model = Model::example("lattice3")?;
    let view = View::example("lattice3", &model)?;
    let scene = Scene {
        vertices: &view.vertices,
        elements: Elements::new(&model.corners),
        projection: view.projection,
        unrounded: Unrounded::UNKNOWN,
    };
    let least = scratch_bytes(&scene) / 8;
    let run = |words: usize, looks: usize, room: usize| {
        let mut words = vec![0u64; words];
        let scratch = Scratch::new(&mut words);
        let options = Options { with_seams: true, ..Options::default() };
        let (mut cancel, mut sink) = (Impatient(looks), Small(room));
        let result = find_stretches(&scene, options, scratch, &mut cancel, &mut sink);
        (result, looks - cancel.0)
    };
    let (result, looks) = run(least, 1_000_000, 1_000_000);
    assert!(result.is_ok() && looks > 40, "{result:?} after {looks} looks");
    for looks in 0..looks {
        assert_eq!(run(least, looks, 1_000_000).0, Err(VisibilityError::Aborted));
    }
    for room in 0..216 {
        assert_eq!(run(least, 1_000_000, room).0, Err(VisibilityError::SinkFull));
    }
    assert!(run(least, 1_000_000, 216).0.is_ok());
    for words in 0..least {
        let result = run(words, 1_000_000, 1_000_000).0;
        assert!(matches!(result, Ok(_) | Err(VisibilityError::Scratch(_))), "{result:?}");
        assert!(result.is_err() || words + 60 > least, "{words} of {least}");
    }
    Ok(())
}

/// The three squares of an octahedron: each two have two corners in common, but no edge.
#[test]
fn faces_that_cross_along_a_common_diagonal_have_a_seam() -> Result<(), VisibilityError> {
    let mut model = Model::default();
    for axis in 0..3 {
        for at in [1.0, -1.0] {
            model.vertices.push(std::array::from_fn(|n| if n == axis { at } else { 0.0 }));
        }
    }
    for face in [[0, 2, 1, 3], [0, 4, 1, 5], [2, 4, 3, 5]] {
        model.corners.extend((0..4).map(|n| Corner::new(face[n], false, n == 3)));
    }
    let view = View::new(&model, EYE, [0.0; 3], UP, Projection::Perspective);
    let options = Options { with_seams: true, ..Options::default() };
    let (_, stretches) = find(&view.vertices, &model.corners, view.projection, options)?;
    let seams = stretches.iter().filter(|stretch| stretch.edge.is_none());
    let found: f64 = seams.map(|stretch| length(&view, stretch)).sum();
    // They are seen where bars along the three axes would be.
    for axis in 0..3 {
        model.corners.push(Corner::new(2 * axis, true, false));
        model.corners.push(Corner::new(2 * axis + 1, true, true));
    }
    let (_, stretches) = find(&view.vertices, &model.corners, view.projection, Options::default())?;
    let is_bar = |stretch: &&Stretch| stretch.edge.is_some_and(|(a, b)| a ^ b == 1);
    let expected: f64 = stretches.iter().filter(is_bar).map(|stretch| length(&view, stretch)).sum();
    assert!(expected > 0.2, "{expected}");
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    Ok(())
}
