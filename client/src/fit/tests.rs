use super::*;
use penup::curve::{FRACTION_BITS, Point};
use penup::model::{Corner, Model, Position, no_undo};
use penup::protocol::Command;
use penup_readers::{ReadError, SourceFile};

/// Fits the polylines of an OBJ text.
fn fit_text(text: &str, tolerance: f64) -> Result<Fitted, FitError> {
    let file = SourceFile::new("f.obj".to_owned(), text.into()).expect("lines of OBJ");
    fit_obj(&file, file.size(), tolerance, &mut |_, _| ())
}

/// The tolerance of flattening in the tests, 1/256 mm.
const FLATTENING: u16 = 1;

fn trace(count: usize, position: impl Fn(f64) -> PlanPoint) -> Vec<PlanPoint> {
    (0..=count).map(|at| position(at as f64 / count as f64)).collect()
}

fn circle(radius: f64, count: usize) -> Vec<PlanPoint> {
    trace(count, |t| {
        let (sine, cosine) = (t * std::f64::consts::TAU).sin_cos();
        [100.0 + radius * cosine, 100.0 + radius * sine]
    })
}

fn obj_of(polylines: &[Vec<PlanPoint>]) -> String {
    let mut obj = String::new();
    let mut vertices = 0;
    for polyline in polylines {
        for [x, y] in polyline {
            obj += &format!("v {x:.4} {y:.4} 0\n");
        }
        let numbers: Vec<String> =
            (1..=polyline.len()).map(|number| (vertices + number).to_string()).collect();
        obj += &format!("l {}\n", numbers.join(" "));
        vertices += polyline.len();
    }
    obj
}

/// The chords of every curve of a file, as the plotter would read and flatten it.
fn flattened(obj: &str) -> Vec<Vec<PlanPoint>> {
    let mut vertices = Box::new([Position::ORIGIN; 16_000]);
    let mut corners = vec![<Corner>::ZERO; 40_000];
    let mut model = Model::new(&mut *vertices, &mut corners);
    for line in obj.lines() {
        assert!(line.len() <= 256, "{line}");
        let done = match Command::parse(line).unwrap() {
            Command::Nothing => Ok(()),
            Command::Vertex(position) => model.add_vertex(position, &mut no_undo),
            Command::Degree(degree) => model.set_degree(degree),
            Command::Curve { ends, control } => model.begin_curve(ends, control.iter()),
            Command::Knots(knots) => model.add_knots(knots.iter()),
            Command::EndCurve => model.end_curve(&mut no_undo),
            other => panic!("{other:?}"),
        };
        done.unwrap();
    }
    let points: Vec<Point> =
        model.vertices().iter().map(|position| position.coordinates()).collect();
    let units = f64::from(1 << model.fraction_bits());
    let scale = f64::from(1 << FRACTION_BITS) * units / 256.0;
    let on_page =
        |position: [i64; 3]| Some([0, 1].map(|axis: usize| (position[axis] as f64 / scale) as i64));
    let chords = |curve: penup::model::StoredCurve<'_>| -> Vec<PlanPoint> {
        let spline = curve.spline(&points).unwrap();
        let ends = spline.chords(on_page, FLATTENING);
        ends.map(|(_, [x, y, _])| [f64::from(x) / units, f64::from(y) / units]).collect()
    };
    let mut chains: Vec<Vec<PlanPoint>> = Vec::new();
    for chain in model.curves().iter().map(chords) {
        match chains.last_mut() {
            // A long curve is written as several because the length of a line is limited.
            Some(before) if distance(before[before.len() - 1], chain[0]) < 2.0 / units => {
                before.extend(&chain[1..]);
            }
            _ => chains.push(chain),
        }
    }
    chains
}

/// The largest distance of a point of `from`, its sides included, from `to`.
fn stray(from: &[PlanPoint], to: &[PlanPoint]) -> f64 {
    let to_side = |position: PlanPoint, pair: &[PlanPoint]| {
        let (along, away) = (minus(pair[1], pair[0]), minus(position, pair[0]));
        let square = dot(along, along);
        let share = if square > 0.0 { (dot(away, along) / square).clamp(0.0, 1.0) } else { 0.0 };
        distance(position, [pair[0][0] + share * along[0], pair[0][1] + share * along[1]])
    };
    let mut worst: f64 = 0.0;
    for pair in from.windows(2) {
        for part in 0..8 {
            let share = f64::from(part) / 8.0;
            let side = minus(pair[1], pair[0]);
            let position = [pair[0][0] + share * side[0], pair[0][1] + share * side[1]];
            let nearest =
                to.windows(2).map(|other| to_side(position, other)).fold(f64::MAX, f64::min);
            worst = worst.max(nearest);
        }
    }
    worst
}

/// Fits a plan, writes it, reads it back, flattens it and compares both. Returns what was saved.
fn checked(polylines: &[Vec<PlanPoint>], tolerance: f64) -> Saving {
    let Fitted { obj, saving } = fit_text(&obj_of(polylines), tolerance).unwrap();
    let chains = flattened(&obj);
    assert_eq!(chains.len(), polylines.len());
    for (chain, polyline) in chains.iter().zip(polylines) {
        // The text has four decimals; the plotter's own chords take 1/256 mm.
        let allowed = tolerance + 1.0 / 256.0 + 0.001;
        let strays = [stray(chain, polyline), stray(polyline, chain)];
        assert!(strays.iter().all(|stray| *stray <= allowed), "{strays:?} for {tolerance}");
        for (end, expected) in
            [(chain[0], polyline[0]), (chain[chain.len() - 1], polyline[polyline.len() - 1])]
        {
            assert!(distance(end, expected) <= 0.03 * tolerance + 0.001);
        }
    }
    saving
}

#[test]
fn smooth_traces_need_few_control_points() {
    let wave = trace(600, |t| [200.0 * t, 20.0 * (t * 25.0).sin()]);
    let spiral = trace(800, |t| {
        let (sine, cosine) = (15.0 * t).sin_cos();
        [100.0 + 80.0 * t * cosine, 100.0 + 80.0 * t * sine]
    });
    for (polyline, most) in
        [(circle(50.0, 360), 12), (circle(3.0, 40), 8), (wave, 32), (spiral, 32)]
    {
        let saving = checked(&[polyline], 0.1);
        assert!(saving.vertices_after <= most, "{saving}");
        assert!(saving.bytes_after * 2 < saving.bytes_before, "{saving}");
    }
}

#[test]
fn corners_and_straight_sides_stay() {
    let corners = [[10.0, 10.0], [110.0, 10.0], [110.0, 60.0], [10.0, 60.0], [10.0, 10.0]];
    let square: Vec<PlanPoint> = corners
        .windows(2)
        .flat_map(|side| {
            let along = minus(side[1], side[0]);
            (0..50).map(move |part| {
                let share = f64::from(part) / 50.0;
                [side[0][0] + share * along[0], side[0][1] + share * along[1]]
            })
        })
        .chain([corners[4]])
        .collect();
    let curves = fit(std::slice::from_ref(&square), 0.1, &mut |_, _| ());
    assert_eq!((curves[0].order, &curves[0].control[..]), (2, &corners[..]));
    checked(&[square], 0.1);
    // A half disc: an arc between two corners.
    let mut half = trace(90, |t| {
        let (sine, cosine) = (t * std::f64::consts::PI).sin_cos();
        [100.0 + 40.0 * cosine, 50.0 + 40.0 * sine]
    });
    half.push(half[0]);
    let saving = checked(&[half], 0.05);
    assert!(saving.vertices_after <= 14, "{saving}");
}

#[test]
fn a_scanners_steps_are_smoothed_within_the_tolerance() {
    // A tenth of a millimetre grid.
    let stepped: Vec<PlanPoint> = circle(30.0, 900)
        .into_iter()
        .map(|position| position.map(|c| (c * 10.0).round() / 10.0))
        .collect();
    let saving = checked(&[stepped], 0.2);
    assert!(saving.vertices_after <= 20, "{saving}");
}

#[test]
fn random_walks_are_followed_too() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    for step in [0.05, 1.0, 20.0] {
        let mut position = [100.0, 100.0];
        let walk: Vec<PlanPoint> = (0..150)
            .map(|_| {
                position = position.map(|c| c + step * random());
                position
            })
            .collect();
        let saving = checked(&[walk], 0.2);
        assert!(saving.vertices_after <= saving.vertices_before, "{saving}");
    }
}

#[test]
fn several_polylines_and_degenerate_ones() {
    let dot_only = vec![[5.0, 5.0]; 4];
    let side = vec![[0.0, 0.0], [10.0, 0.0], [10.0, 0.0]];
    let curves = fit(&[dot_only, side, vec![], vec![[1.0, 1.0]]], 0.1, &mut |_, _| ());
    assert_eq!(curves.len(), 1);
    assert_eq!((curves[0].order, curves[0].knots.len()), (2, 4));
    assert_eq!(curves[0].control, [[0.0, 0.0], [10.0, 0.0]]);
    checked(&[circle(20.0, 100), vec![[0.0, 0.0], [3.0, 4.0]], circle(10.0, 50)], 0.05);
}

#[test]
fn sides_that_come_one_by_one_are_one_polyline() {
    let text = "v 0 0 7\nv 1 0 7\nv 2 0 7\nv 5 5 7\nv 6 6 7\nl 1 2\nl 2 3\nl -2 -1 # a second\n";
    let Fitted { obj, saving } = fit_text(text, 0.1).unwrap();
    assert_eq!((saving.polylines, saving.vertices_before, saving.vertices_after), (2, 5, 4));
    assert!(obj.contains("v 2 0 7\n"), "{obj}");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let line = |text: &str| match SourceFile::new("f.obj".to_owned(), text.into()) {
        // The reader itself refuses what is no vertex.
        Err(ReadError::Line { origin, .. }) => Some(origin.line),
        _ => match fit_text(text, 0.1) {
            Err(FitError::Line { number, .. }) => Some(number),
            _ => None,
        },
    };
    assert_eq!(line("v 0 0 0\nv 1 1 1\n"), Some(2));
    assert_eq!(line("v 0 0 0\nv 1 1 0\nl 1 2\nl 1 3\n"), Some(4));
    assert_eq!(line("v 0 0 0\nl 0 1\n"), Some(2));
    assert_eq!(fit_text("v 0 0 0\nl 1\n", 0.1), Err(FitError::NoPolyline));
    assert_eq!(line("v 0 0 0\nv 1 1 0\nv 2 1 0\nf 1 2 3\n"), Some(4));
    // The fitted file would lose the curve.
    assert_eq!(
        line("v 0 0 0\nv 1 1 0\nl 1 2\ndeg 1\ncurv 0 1 1 2\nparm u 0 0 1 1\nend\n"),
        Some(5)
    );
    assert_eq!(fit_text("v 0 0 0\n", 0.1), Err(FitError::NoPolyline));
    for tolerance in [0.0, -1.0, 1e-300, 1e308, f64::NAN, f64::INFINITY] {
        assert_eq!(fit_text("v 0 0 0\nv 1 1 0\nl 1 2\n", tolerance), Err(FitError::Tolerance));
    }
}

#[test]
fn numbers_that_no_plotter_takes_are_refused_with_their_line() {
    for number in ["1e308", "-1e308", "1.7976931348623157e308", "1073741825", "1e30", "-2e9"] {
        let text = format!("v 0 0 0\nv {number} 1 0\nv 1 {number} 0\nl 1 2 3\n");
        let expected = FitError::Line { number: 2, reason: "coordinates go up to 1073741824" };
        match SourceFile::new("f.obj".to_owned(), text.into()) {
            Ok(file) => assert_eq!(fit_obj(&file, file.size(), 0.1, &mut |_, _| ()), Err(expected)),
            Err(error) => assert!(error.to_string().starts_with("f.obj:2: "), "{error}"),
        }
    }
    for number in ["nan", "inf", "-inf", "x", "1,5", "0x10", "1e999999"] {
        let text = format!("v 0 0 0\nv {number} 1 0\n");
        let error = SourceFile::new("f.obj".to_owned(), text.into()).expect_err("no number");
        assert!(error.to_string().starts_with("f.obj:2: "), "{error}");
    }
    // The largest and the smallest differences.
    for far in [[1073741824.0, 1073741824.0], [1e-300, 0.0], [f64::MIN_POSITIVE, 5e-324]] {
        let curves = fit(&[vec![[0.0, 0.0], far, [-far[0], far[1]]]], 1e-4, &mut |_, _| ());
        let finite = |curve: &FittedCurve| curve.control.iter().flatten().all(|c| c.is_finite());
        assert!(curves.iter().all(finite));
    }
}

#[test]
fn what_has_no_length_is_reported() {
    let text = "v 0 0 0\nv 0 0.000001 0\nv 5 5 0\nl 1 2\nl 1 3\n";
    let text = text.replace("l 1 2\nl 1 3", "l 2 1\nl 3 1");
    let Fitted { saving, .. } = fit_text(&text, 0.1).unwrap();
    assert_eq!((saving.polylines, saving.left_out), (2, 1));
    assert!(saving.to_string().ends_with("; 1 without a length is left out"), "{saving}");
}

#[test]
fn curves_keep_the_pens_of_their_polylines() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 5 0\nl 1 2\nusemtl red\nl 2 3\nl 3 1\nusemtl blue\nl 1 3\n";
    let Fitted { obj, saving } = fit_text(text, 0.1).unwrap();
    assert_eq!(saving.polylines, 3);
    let lines: Vec<&str> = obj.lines().collect();
    let at = |wanted: &str| lines.iter().position(|line| *line == wanted).expect("written");
    let curves: Vec<usize> =
        (0..lines.len()).filter(|number| lines[*number].starts_with("curv")).collect();
    assert_eq!(curves.len(), 3);
    assert!(curves[0] < at("usemtl red") && at("usemtl red") < curves[1]);
    assert!(curves[1] < at("usemtl blue") && at("usemtl blue") < curves[2]);
}

/// The work is measured in evaluations of the basis functions, which take nearly all of the time.
#[test]
fn a_long_trace_takes_work_in_proportion_to_its_length() {
    // The path has no corners and does not repeat.
    let wanders = |count: usize| {
        let (mut state, mut bend, mut angle, mut position) = (1u64, 0.0, 0.0_f64, [0.0; 2]);
        let mut step = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            bend = 0.98 * bend + 0.04 * ((state >> 40) as f64 / f64::from(1 << 24) - 0.5);
            angle += bend;
            position = [position[0] + 0.1 * angle.cos(), position[1] + 0.1 * angle.sin()];
            position
        };
        (0..count).map(|_| step()).collect::<Vec<PlanPoint>>()
    };
    let evaluations = |count| {
        let before = least_squares::evaluations();
        let curves = fit(&[wanders(count)], 0.1, &mut |_, _| ());
        assert!(curves[0].control.len() * 8 < count, "{}", curves[0].control.len());
        least_squares::evaluations() - before
    };
    let (short, long) = (evaluations(700), evaluations(4200));
    assert!(long < 9 * short, "{short} evaluations for 700 positions, {long} for 4200");
}
