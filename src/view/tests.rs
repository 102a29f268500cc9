use super::*;
use crate::fixed::Decimal;
use crate::model::Corner;
use crate::model::no_undo;
use crate::stage::{NeverCancel, Scratch};

fn with_model(vertices: &[[&str; 3]], test: impl FnOnce(&Model<'_>)) {
    let mut memory = ([Position::ORIGIN; 16], [<Corner>::ZERO; 16]);
    let mut model = Model::new(&mut memory.0, &mut memory.1);
    for vertex in vertices {
        model.add_vertex(vertex.map(|text| Decimal::parse(text).unwrap()), &mut no_undo).unwrap();
    }
    test(&model);
}

const CUBE: [[&str; 3]; 8] = [
    ["0", "0", "0"],
    ["1", "0", "0"],
    ["1", "1", "0"],
    ["0", "1", "0"],
    ["0", "0", "1"],
    ["1", "0", "1"],
    ["1", "1", "1"],
    ["0", "1", "1"],
];

fn camera(eye: Direction, at: Direction) -> Camera {
    Camera { pose: Pose::Towards { eye, at, up: None }, lens: Lens::Perspective }
}

/// At 45 degrees from the line of sight, x and depth are the same.
#[test]
fn the_field_is_where_a_diagonal_is_seen() {
    with_model(&CUBE, |model| {
        for eye in [[-3.0, -4.0, 2.5], [30.0, 20.0, 10.0]] {
            let view = View::new(&camera(eye, [0.5; 3]), model).unwrap();
            let vertex = view.vertex(model.vertices()[6]);
            let field = view.field(20).unwrap() as f64 / f64::from(1 << 20);
            let axes = Axes::new(&camera(eye, [0.5; 3])).unwrap();
            let along = |direction: Direction| {
                (0..3).map(|n| (1.0 - axes.origin[n]) * direction[n]).sum::<f64>()
            };
            let [right, _, forward] = axes.directions.map(along);
            // The vertex is seen at right / forward, and the diagonal at 1.
            let seen = f64::from(vertex.x) / f64::from(vertex.z) / field;
            assert!((seen - right / forward).abs() < 1e-4, "{seen} {}", right / forward);
        }
        let parallel = Camera { lens: Lens::Orthographic, ..camera([3.0; 3], [0.5; 3]) };
        assert_eq!(View::new(&parallel, model).unwrap().field(20), None);
    });
}

#[test]
fn images_are_those_of_the_formula() {
    const OBLIQUE: Lens = Lens::Oblique { angle: 30.0, ratio: 0.5 };
    with_model(&CUBE, |model| {
        for lens in [Lens::Perspective, Lens::Orthographic, OBLIQUE] {
            for (eye, at) in [
                ([-3.0, -4.0, 2.5], [0.5, 0.5, 0.5]),
                ([1000.0, 2000.0, -500.0], [0.25, 0.5, 0.125]),
                ([0.5, -1.2, 0.5], [0.5, 0.5, 0.5]),
                ([0.5, 0.5, 5.0], [0.5, 0.5, 0.5]),
            ] {
                let camera = Camera { lens, ..camera(eye, at) };
                let view = View::new(&camera, model).unwrap();
                let Axes { directions: [right, up, forward], origin, .. } =
                    Axes::new(&camera).unwrap();
                let unit = libm::ldexp(1.0, -(model.fraction_bits() as i32));
                for position in model.vertices() {
                    let p = position.coordinates().map(|c| f64::from(c) * unit);
                    let d = [0, 1, 2].map(|axis| p[axis] - origin[axis]);
                    let vertex = view.vertex(*position);
                    let (w, depth) = match lens {
                        Lens::Perspective => (f64::from(vertex.z), dot(d, forward)),
                        _ => (1.0, 1.0),
                    };
                    for (axis, seen) in [(right, vertex.x), (up, vertex.y)] {
                        let image = f64::from(seen) / w * view.image_unit();
                        let error = image - dot(d, axis) / depth;
                        assert!(error.abs() < 2e-6, "{eye:?} {lens:?}: off by {error}");
                    }
                    let all = [vertex.x, vertex.y, vertex.z];
                    assert!(all.iter().all(|c| c.abs() <= COORDINATE_LIMIT));
                }
            }
        }
    });
}

#[test]
fn a_model_of_any_size_fills_the_range() {
    for size in ["1e-6", "0.001", "1", "12345.678", "1e9"] {
        with_model(&[["0", "0", "0"], [size, "0", "0"], ["0", size, size]], |model| {
            let camera = Camera::automatic(model, Lens::Perspective, None, None).unwrap();
            let view = View::new(&camera, model).unwrap();
            let seen = model.vertices().iter().map(|p| view.vertex(*p));
            let widest = seen.map(|v| v.x.abs().max(v.y.abs())).max();
            assert!(widest > Some(COORDINATE_LIMIT - 10), "{size}: {widest:?}");
        });
    }
}

#[test]
fn a_small_model_far_from_the_origin_stays_within_the_range() {
    const OBLIQUE: Lens = Lens::Oblique { angle: 30.0, ratio: 2.0 };
    for size in [1.0, 0.001, 20.0] {
        for far in [70.0, 4095.0, 14678.0, 100_003.0] {
            let texts = CUBE.map(|corner| {
                let text = |at: &str, far: f64| {
                    std::format!("{:.3}", far * size + at.parse::<f64>().unwrap() * size)
                };
                [text(corner[0], far), text(corner[1], 0.0), text(corner[2], -far)]
            });
            let texts = texts.each_ref().map(|texts| texts.each_ref().map(|it| it.as_str()));
            with_model(&texts, |model| {
                for lens in [Lens::Perspective, Lens::Orthographic, OBLIQUE] {
                    for azimuth in 0..40 {
                        let axonometric =
                            Camera::axonometric(model, f64::from(azimuth) * 9.0, 30.0, None, None);
                        let view =
                            View::new(&Camera { lens, ..axonometric.unwrap() }, model).unwrap();
                        let seen = model.vertices().iter().map(|p| view.vertex(*p));
                        let most = seen.flat_map(|v| [v.x, v.y, v.z]).map(i32::abs).max();
                        assert!(most <= Some(COORDINATE_LIMIT), "{size} {far}: {most:?}");
                        assert!(most > Some(COORDINATE_LIMIT / 3), "{size} {far}: {most:?}");
                    }
                }
            });
        }
    }
}

#[test]
fn impossible_cameras_are_refused() {
    with_model(&CUBE, |model| {
        let (eye, at) = ([0.5, 0.5, 5.0], [0.5, 0.5, 0.5]);
        assert_eq!(View::new(&camera(at, at), model), Err(ViewError::EyeAtTarget));
        for up in [[0.0, 0.0, -2.0], [0.0; 3]] {
            let pose = Pose::Towards { eye, at, up: Some(up) };
            let upright = Camera { pose, lens: Lens::Perspective };
            assert_eq!(View::new(&upright, model), Err(ViewError::UpAlongSight));
        }
        let away = camera([0.5, 0.5, 5.0], [0.5, 0.5, 6.0]);
        assert_eq!(View::new(&away, model), Err(ViewError::NothingInFront));
        // The eye of an orthographic camera only gives the direction.
        assert!(View::new(&Camera { lens: Lens::Orthographic, ..away }, model).is_ok());
    });
    with_model(&[], |model| {
        assert_eq!(View::new(&camera([1.0; 3], [0.0; 3]), model), Err(ViewError::NothingToSee));
    });
}

#[test]
fn one_vertex_alone_can_be_seen() {
    with_model(&[["5", "5", "5"]], |model| {
        let camera = Camera::automatic(model, Lens::Orthographic, None, None).unwrap();
        let vertex = View::new(&camera, model).unwrap().vertex(model.vertices()[0]);
        assert!([vertex.x, vertex.y, vertex.z].iter().all(|c| c.abs() <= COORDINATE_LIMIT));
    });
}

#[test]
fn an_isometric_cube_is_a_regular_hexagon() {
    with_model(&CUBE, |model| {
        let camera = Camera::axonometric(model, -45.0, 35.264_389_682_754_654, None, None).unwrap();
        let view = View::new(&camera, model).unwrap();
        let mut radii = model.vertices().iter().map(|p| view.vertex(*p)).map(|v| {
            let (x, y) = (f64::from(v.x) * view.image_unit(), f64::from(v.y) * view.image_unit());
            libm::sqrt(x * x + y * y)
        });
        let on_hexagon = radii.clone().filter(|r| libm::fabs(r - libm::sqrt(2.0 / 3.0)) < 1e-5);
        assert_eq!(on_hexagon.count(), 6);
        assert_eq!(radii.by_ref().filter(|r| *r < 1e-5).count(), 2);
    });
}

/// Positions of a random cloud in whole units, seen with and without an error of each.
#[test]
fn the_error_bound_is_twice_what_an_error_of_the_positions_moves() {
    with_model(&[["0", "0", "0"], ["900", "0", "0"], ["0", "700", "400"]], |model| {
        for lens in [Lens::Perspective, Lens::Orthographic] {
            let camera = Camera { lens, ..camera([-800.0, -900.0, 700.0], [300.0; 3]) };
            let view = View::new(&camera, model).unwrap();
            assert_eq!(view.error_bound(0), 1);
            for units in [1, 7, 1000] {
                let bound = view.error_bound(units);
                let mut most = 0;
                for corner in 0..8 {
                    let sign = |bit: u32| if corner >> bit & 1 == 0 { 1 } else { -1 };
                    let off = [0, 1, 2].map(|axis| sign(axis) * units.cast_signed());
                    let [x, y, z] = off;
                    let [from, to] =
                        [Position::ORIGIN, Position { x, y, z }].map(|p| view.vertex(p));
                    let moved = [to.x - from.x, to.y - from.y, to.z - from.z];
                    most = moved.iter().fold(most, |most, by| by.unsigned_abs().max(most));
                }
                // The vertices are rounded.
                assert!(2 * most <= bound + 2 && bound <= 2 * most + 5, "{bound} {most}");
            }
        }
    });
}

#[test]
fn the_stretch_of_depth_is_that_of_a_length_along_the_view() {
    assert_eq!(
        [1.0, 0.25, 8.0].map(as_ratio).map(|(a, b)| f64::from(a) / f64::from(b)),
        [1.0, 0.25, 8.0]
    );
    // A long thin box, seen from its front and from its side.
    let long = [["0", "0", "0"], ["8", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]];
    with_model(&long, |model| {
        for from in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            let at = [4.0, 0.5, 0.5];
            let eye = [0, 1, 2].map(|axis| at[axis] + 100.0 * from[axis]);
            let up = Some([0.0, 0.0, 1.0]);
            let pose = Pose::Towards { eye, at, up };
            let view = View::new(&Camera { pose, lens: Lens::Orthographic }, model).unwrap();
            let [a, b, c] = [0, 1, 2].map(|n| view.vertex(model.vertices()[n]));
            let (length, width) =
                if from[0] > 0.0 { (a.z - b.z, c.x - a.x) } else { (c.z - a.z, b.x - a.x) };
            let ratio = f64::from(length.abs()) / f64::from(width.abs());
            let lengths = if from[0] > 0.0 { 8.0 } else { 1.0 / 8.0 };
            let (above, below) = view.depth_stretch();
            let stretch = f64::from(above) / f64::from(below);
            assert!((ratio / lengths / stretch - 1.0).abs() < 1e-4, "{ratio} {stretch}");
        }
    });
}

#[test]
fn the_first_vertex_behind_the_eye_is_named() {
    with_model(&CUBE, |model| {
        let before = View::new(&camera([-3.0, 0.5, 0.5], [0.5; 3]), model).unwrap();
        assert_eq!(before.refuse_behind(model), Ok(()));
        // The eye is inside: the vertices with x = 0 are behind it.
        let within = View::new(&camera([0.5, 0.5, 0.5], [2.0, 0.5, 0.5]), model).unwrap();
        assert_eq!(within.refuse_behind(model), Err(ViewError::BehindEye { vertex: 1 }));
        let back = View::new(&camera([0.5, 0.5, 0.5], [-1.0, 0.5, 0.5]), model).unwrap();
        assert_eq!(back.refuse_behind(model), Err(ViewError::BehindEye { vertex: 2 }));
        let parallel =
            Camera { lens: Lens::Orthographic, ..camera([0.5, 0.5, 0.5], [2.0, 0.5, 0.5]) };
        assert_eq!(View::new(&parallel, model).unwrap().refuse_behind(model), Ok(()));
    });
}

/// Of two curves of degree 1 the chords are the sides of their control polygons. Each becomes a bar
/// behind the elements that were there, and no bar joins one curve to the other.
#[test]
fn the_chords_of_curves_become_bars() {
    let decimals = |text: &'static str| text.split(' ').map(|part| Decimal::parse(part).unwrap());
    let mut memory = ([Position::ORIGIN; 16], [<Corner>::ZERO; 64]);
    let mut model = Model::new(&mut memory.0, &mut memory.1);
    for at in ["0 0 0", "4 0 0", "4 3 0", "9 1 0", "9 5 0", "2 7 0", "1 6 0"] {
        let mut at = decimals(at);
        let vertex = [(); 3].map(|()| at.next().unwrap());
        model.add_vertex(vertex, &mut no_undo).unwrap();
    }
    model.add_polyline([1, 7].into_iter(), &mut no_undo).unwrap();
    model.set_degree(1).unwrap();
    for (last, controls, knots) in
        [("2", &[1, 2, 3][..], "0 0 1 2 2"), ("3", &[4, 5, 6, 7], "0 0 1 2 3 3")]
    {
        let ends = ["0", last].map(|text| Decimal::parse(text).unwrap());
        model.begin_curve(ends, controls.iter().copied()).unwrap();
        model.add_knots(decimals(knots)).unwrap();
        model.end_curve(&mut no_undo).unwrap();
    }
    let above = Camera {
        pose: Pose::Towards { eye: [4.5, 3.5, 9.0], at: [4.5, 3.5, 0.0], up: None },
        lens: Lens::Orthographic,
    };
    let view = View::new(&above, &model).unwrap();
    let flattening = Flattening { on_page: &|x, y, _| [x, y], tolerance: 128 };
    let mut words = [0; 512];
    let mut scratch = Scratch::new(&mut words);
    let (vertices, elements, _) =
        flattening.add(&view, &model, model.elements(), &mut scratch, &mut NeverCancel).unwrap();
    let bars: std::vec::Vec<[u16; 2]> = elements
        .corners()
        .chunks(2)
        .map(|bar| [0, 1].map(|end: usize| bar[end].vertex()))
        .collect();
    // The ends of chords are numbered behind the seven vertices: three, then four.
    assert_eq!(bars, [[0, 6], [7, 8], [8, 9], [10, 11], [11, 12], [12, 13]]);
    for (end, control) in (7..).zip([0, 1, 2, 3, 4, 5, 6]) {
        assert_eq!(vertices[end], vertices[control], "{end}");
    }
    assert!(elements.corners().chunks(2).all(|bar| !bar[0].is_last() && bar[1].is_last()));
}
