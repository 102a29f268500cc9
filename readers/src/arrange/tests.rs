//! Tests of what each option of a plan promises, on drawings of any shape, which all of them share.
//! So this is longer than 500 lines.

use super::simplify::to_line;
use super::{Arrangement, PLAN_OPTIONS, Turn};
use crate::lines::Lines as _;
use crate::page::Page;
use crate::plan::Point;
use crate::{ReadError, SourceFile};
use proptest::collection::vec;
use proptest::prelude::*;
use std::fmt::Write as _;

/// A stroke with its pen.
type Sent = (u32, Vec<Point>);

/// An OBJ file that draws these strokes.
fn obj(strokes: &[Sent]) -> String {
    let (mut text, mut vertices) = (String::new(), 0);
    for (pen, points) in strokes {
        let _ = writeln!(text, "usemtl pen{pen}");
        for [x, y] in points {
            let _ = writeln!(text, "v {x} {y} 0");
        }
        let numbers: Vec<String> =
            (vertices + 1..=vertices + points.len()).map(|number| number.to_string()).collect();
        let _ = writeln!(text, "l {}", numbers.join(" "));
        vertices += points.len();
    }
    text
}

/// Reads a file and arranges it by these options.
fn arranged(name: &str, text: &str, options: &[(&str, &str)]) -> Result<SourceFile, String> {
    let mut arrangement = Arrangement::default();
    for (option, value) in options {
        arrangement.set(option, value)?;
    }
    let file = SourceFile::arranged(name.to_owned(), text.as_bytes().to_vec(), &arrangement);
    file.map_err(|error: ReadError| error.to_string())
}

/// The strokes that a file sends.
fn strokes(file: &SourceFile) -> Vec<Sent> {
    let (mut vertices, mut pen, mut strokes) = (Vec::new(), 0, Vec::<Sent>::new());
    for line in file.in_order() {
        let words: Vec<&str> = line.sent.split(' ').collect();
        match words.as_slice() {
            ["v", x, y, "0"] => {
                vertices.push([x, y].map(|word| word.parse::<f64>().expect("a number")));
            }
            ["usemtl", name] => pen = name[3..].parse().expect("a number"),
            ["l", numbers @ ..] => {
                let number = |word: &&str| word.parse::<usize>().expect("a number");
                strokes.push((pen, numbers.iter().map(|it| vertices[number(it) - 1]).collect()));
            }
            other => panic!("{other:?}"),
        }
    }
    strokes
}

/// The strokes of a plan after these options.
fn after(plan: &[Sent], options: &[(&str, &str)]) -> Vec<Sent> {
    strokes(&arranged("a.obj", &obj(plan), options).expect("a plan"))
}

fn length(points: &[Point]) -> f64 {
    points.windows(2).map(|it| (it[0][0] - it[1][0]).hypot(it[0][1] - it[1][1])).sum()
}

fn ink(strokes: &[Sent]) -> f64 {
    strokes.iter().map(|(_, points)| length(points)).sum()
}

fn distance(point: Point, strokes: &[Sent]) -> f64 {
    let pairs = strokes.iter().flat_map(|(_, points)| points.windows(2));
    pairs.map(|pair| to_line(point, pair[0], pair[1])).fold(f64::INFINITY, f64::min)
}

/// Points along strokes, no farther apart than a tenth of a millimetre.
fn along(strokes: &[Sent]) -> Vec<Point> {
    let mut points = Vec::new();
    for pair in strokes.iter().flat_map(|(_, points)| points.windows(2)) {
        let count = (length(pair) * 10.0).ceil().max(1.0);
        for part in (0..=count as u32).map(|at| f64::from(at) / count) {
            points.push(
                [0, 1].map(|axis: usize| pair[0][axis] + part * (pair[1][axis] - pair[0][axis])),
            );
        }
    }
    points
}

fn bounds(strokes: &[Sent]) -> [Point; 2] {
    let points = strokes.iter().flat_map(|(_, points)| points.iter().copied());
    points.fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], [x, y]| {
        [[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]]
    })
}

/// Strokes of up to 12 points in thousandths of a millimetre, some of them closed.
fn plans() -> impl Strategy<Value = Vec<Sent>> {
    let point = [0..200_000_i32, 0..280_000_i32].prop_map(|it| it.map(|it| f64::from(it) / 1000.0));
    let stroke = (1..4_u32, vec(point, 2..12), any::<bool>());
    let stroke = stroke.prop_map(|(pen, mut points, is_closed)| {
        points.dedup();
        if points.len() < 2 {
            points.push([points[0][0] + 1.0, points[0][1]]);
        }
        if is_closed && points.len() > 2 {
            points.push(points[0]);
            points.dedup();
        }
        (pen, points)
    });
    vec(stroke, 1..8)
}

/// What rounding to thousandths of a millimetre may add to the length of a line.
const ROUNDING: f64 = 0.0015;

fn corners(plan: &[Sent]) -> f64 {
    plan.iter().map(|(_, points)| points.len() as f64).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_scale_multiplies_the_ink_and_keeps_the_middle(plan in plans(), factor in 0.2..5.0_f64) {
        let scaled = after(&plan, &[("scale", &factor.to_string())]);
        let slack = ROUNDING * corners(&plan);
        prop_assert!((ink(&scaled) - factor * ink(&plan)).abs() <= slack);
        let middle = |[low, high]: [Point; 2]| [0, 1].map(|it: usize| low[it] + high[it]);
        let (before, now) = (middle(bounds(&plan)), middle(bounds(&scaled)));
        prop_assert!((0..2).all(|axis| (before[axis] - now[axis]).abs() < 0.003));
    }

    #[test]
    fn a_rotation_keeps_the_ink_and_four_quarters_change_nothing(
        plan in plans(), degrees in -720.0..720.0_f64,
    ) {
        let turned = after(&plan, &[("rotate", &degrees.to_string())]);
        prop_assert!((ink(&turned) - ink(&plan)).abs() <= ROUNDING * corners(&plan));
        prop_assert_eq!(after(&plan, &[("rotate", "360")]), after(&plan, &[]));
    }

    #[test]
    fn the_middle_of_the_drawing_is_that_of_the_page(plan in plans()) {
        let [low, high] = bounds(&after(&plan, &[("center", "")]));
        prop_assert!((low[0] + high[0] - 210.0).abs() < 0.003);
        prop_assert!((low[1] + high[1] - 297.0).abs() < 0.003);
    }

    #[test]
    fn a_crop_keeps_what_is_inside_and_nothing_else(plan in plans()) {
        let rectangle = [[40.0, 60.5], [130.25, 200.0]];
        let Ok(file) = arranged("a.obj", &obj(&plan), &[("crop", "40,60.5,90.25,139.5")]) else {
            let is_within = |[x, y]: &Point| {
                (40.0..=130.25).contains(x) && (60.5..=200.0).contains(y)
            };
            prop_assert!(!along(&plan).iter().any(is_within));
            return Ok(());
        };
        let cropped = strokes(&file);
        for [x, y] in cropped.iter().flat_map(|(_, points)| points) {
            prop_assert!((rectangle[0][0]..=rectangle[1][0]).contains(x), "{x}");
            prop_assert!((rectangle[0][1]..=rectangle[1][1]).contains(y), "{y}");
        }
        for point in along(&plan) {
            let depth = (0..2).map(|axis| {
                (point[axis] - rectangle[0][axis]).min(rectangle[1][axis] - point[axis])
            });
            if depth.fold(f64::INFINITY, f64::min) > 0.01 {
                prop_assert!(distance(point, &cropped) < 0.002, "{point:?}");
            }
        }
        for point in along(&cropped) {
            prop_assert!(distance(point, &plan) < 0.002, "{point:?}");
        }
    }

    #[test]
    fn joined_strokes_are_the_same_ink_but_for_short_joints(
        plan in plans(), tolerance in 0.5..10.0_f64,
    ) {
        let before = after(&plan, &[]);
        let joined = after(&plan, &[("linemerge", &tolerance.to_string())]);
        let joints = before.len() - joined.len();
        let added = ink(&joined) - ink(&before);
        prop_assert!((-1e-6..=tolerance * joints as f64 + 1e-6).contains(&added));
        for point in along(&before) {
            prop_assert!(distance(point, &joined) < 1e-6);
        }
        for point in along(&joined) {
            prop_assert!(distance(point, &before) <= tolerance / 2.0 + 1e-6);
        }
        // No two ends of one pen that could be joined are left.
        let open: Vec<&Sent> = joined.iter().filter(|(_, it)| it.first() != it.last()).collect();
        for (index, (pen, points)) in open.iter().enumerate() {
            for (other, others) in open.iter().skip(index + 1) {
                for end in [points[0], points[points.len() - 1]] {
                    for [x, y] in [others[0], others[others.len() - 1]] {
                        let is_apart = (end[0] - x).hypot(end[1] - y) > tolerance;
                        prop_assert!(pen != other || is_apart);
                    }
                }
            }
        }
    }

    #[test]
    fn points_that_are_left_out_stay_within_the_tolerance(
        plan in plans(),
        tolerance in 0.1..10.0_f64,
    ) {
        let before = after(&plan, &[]);
        let simple = after(&plan, &[("simplify", &tolerance.to_string())]);
        prop_assert!(corners(&simple) <= corners(&before));
        let ends = |strokes: &[Sent]| -> Vec<[Point; 2]> {
            strokes.iter().map(|(_, points)| [points[0], points[points.len() - 1]]).collect()
        };
        for (kept, whole) in simple.iter().zip(&before).filter(|_| simple.len() == before.len()) {
            prop_assert_eq!(ends(std::slice::from_ref(kept)), ends(std::slice::from_ref(whole)));
            for point in &whole.1 {
                let is_near = distance(*point, std::slice::from_ref(kept)) <= tolerance + 1e-9;
                prop_assert!(is_near, "{point:?}");
            }
            prop_assert!(kept.1.iter().all(|point| whole.1.contains(point)));
        }
    }

    #[test]
    fn hatch_lines_lie_inside_at_their_distance(
        outlines in vec(vec([0..150_000_i32, 0..150_000_i32], 3..9), 1..4),
        spacing in 1.0..9.0_f64, angle in -180.0..180.0_f64,
    ) {
        let closed = |outline: &Vec<[i32; 2]>| -> Sent {
            let mut points: Vec<Point> =
                outline.iter().map(|it| it.map(|it| f64::from(it) / 1000.0)).collect();
            points.dedup();
            points.push(points[0]);
            (1, points)
        };
        let plan: Vec<Sent> = outlines.iter().map(closed).collect();
        prop_assume!(plan.iter().all(|(_, points)| points.len() > 3));
        let hatched = after(&plan, &[("hatch", &format!("{spacing},{angle}"))]);
        let lines = &hatched[plan.len()..];
        let radians = f64::to_radians(angle);
        let across = |[x, y]: Point| (y * radians.cos() - x * radians.sin()) / spacing;
        for (_, points) in lines {
            prop_assert_eq!(points.len(), 2);
            // Each lies on a line of the grid, within what rounding to thousandths does.
            for point in points {
                let off = (across(*point) - across(*point).round()).abs() * spacing;
                prop_assert!(off < 0.001, "{off}");
            }
            let between = |part: f64| {
                [0, 1].map(|axis: usize| points[0][axis] * (1.0 - part) + points[1][axis] * part)
            };
            for part in [0.01, 0.3, 0.5, 0.77, 0.99] {
                let point = between(part);
                prop_assert!(is_inside(point, &plan) || distance(point, &plan) < 0.002);
            }
        }
        // What is inside is no farther from a line than half of their distance, along the way
        // across, unless the outline is nearer.
        for point in (0..200).map(|at| [f64::from(at * 37 % 151), f64::from(at * 53 % 149)]) {
            let nearest = across(point).round() * spacing;
            let to_grid = nearest - across(point) * spacing;
            let on_grid =
                [point[0] - to_grid * radians.sin(), point[1] + to_grid * radians.cos()];
            if is_inside(on_grid, &plan) && distance(on_grid, &plan) > 0.01 {
                prop_assert!(distance(on_grid, lines) < 0.002, "{on_grid:?}");
            }
        }
    }
}

/// Whether closed strokes surround a point an odd number of times.
fn is_inside([x, y]: Point, plan: &[Sent]) -> bool {
    let sides = plan.iter().flat_map(|(_, points)| points.windows(2));
    let crosses = |pair: &&[Point]| {
        let ([x1, y1], [x2, y2]) = (pair[0], pair[1]);
        (y1 > y) != (y2 > y) && x < x1 + (y - y1) / (y2 - y1) * (x2 - x1)
    };
    sides.filter(crosses).count() % 2 == 1
}

#[test]
fn a_rotation_is_clockwise_and_a_scale_has_two_axes() {
    let plan = [(1, vec![[10.0, 10.0], [30.0, 10.0], [30.0, 14.0]])];
    let turned = after(&plan, &[("rotate", "90")]);
    assert_eq!(turned, [(1, vec![[18.0, 22.0], [18.0, 2.0], [22.0, 2.0]])]);
    let wide = after(&plan, &[("scale", "2,-1")]);
    assert_eq!(wide, [(1, vec![[0.0, 14.0], [40.0, 14.0], [40.0, 10.0]])]);
}

#[test]
fn a_stroke_is_cut_exactly_at_the_border() {
    let plan = [(2, vec![[0.0, 0.0], [100.0, 33.0]])];
    let [(pen, points)] = &after(&plan, &[("crop", "10,0,20,100")])[..] else { panic!() };
    assert_eq!((*pen, points.as_slice()), (2, [[10.0, 3.3], [30.0, 9.9]].as_slice()));
    // A square that begins inside stays in one piece where it can.
    let square = [[5.0, 5.0], [20.0, 5.0], [20.0, 20.0], [5.0, 20.0], [5.0, 5.0]];
    let cut = after(&[(1, square.to_vec())], &[("crop", "0,0,10,10")]);
    assert_eq!(cut, [(1, vec![[5.0, 10.0], [5.0, 5.0], [10.0, 5.0]])]);
    let page = after(&[(1, vec![[-50.0, 100.0], [500.0, 100.0]])], &[("crop", "page")]);
    assert_eq!(page, [(1, vec![[10.0, 100.0], [200.0, 100.0]])]);
}

#[test]
fn strokes_are_joined_in_either_direction_but_not_of_other_pens() {
    let plan = [
        (1, vec![[10.0, 0.0], [0.0, 0.0]]),
        (1, vec![[10.05, 0.0], [20.0, 0.0]]),
        (2, vec![[20.0, 0.0], [30.0, 0.0]]),
    ];
    let joined = after(&plan, &[("linemerge", "0.1")]);
    assert_eq!(joined.len(), 2);
    assert_eq!(joined[0].1.len(), 4);
    assert_eq!(after(&plan, &[("linemerge", "0.01")]).len(), 3);
}

#[test]
fn a_landscape_is_chosen_by_the_drawing() {
    let turned = |plan: &[Sent], own: Option<Page>| {
        let arrangement = Arrangement { turn: Turn::Automatic, page: own, ..Default::default() };
        let file = SourceFile::arranged("a.obj".to_owned(), obj(plan).into_bytes(), &arrangement);
        let Page { width, height } = file.expect("a plan").sheet();
        (width, height)
    };
    let wide = [(1, vec![[0.0, 0.0], [50.0, 10.0]])];
    let high = [(1, vec![[0.0, 0.0], [10.0, 50.0]])];
    assert_eq!(turned(&wide, None), (297.0, 210.0));
    assert_eq!(turned(&high, None), (210.0, 297.0));
    assert_eq!(turned(&high, Some(Page { width: 80.0, height: 20.0 })), (20.0, 80.0));
}

#[test]
fn layers_are_chosen_and_ordered_by_pen_where_there_are_no_others() {
    let plan = [(1, vec![[0.0, 0.0], [9.0, 0.0]]), (3, vec![[0.0, 5.0], [9.0, 5.0]])];
    let pens = |options: &[(&str, &str)]| -> Vec<(u32, f64)> {
        after(&plan, options).into_iter().map(|(pen, points)| (pen, points[0][1])).collect()
    };
    assert_eq!(pens(&[("layer", "3")]), [(3, 5.0)]);
    assert_eq!(pens(&[("layer", "pen1,PEN3")]), [(1, 0.0), (3, 5.0)]);
    assert_eq!(pens(&[("layer-order", "3,1")]), [(2, 0.0), (1, 5.0)]);
    let file = arranged("a.obj", &obj(&plan), &[("layer-order", "3")]).expect("a plan");
    assert_eq!(file.notes(), ["pen 1 draws the layer \"pen3\", pen 2 draws the layer \"pen1\""]);
    let error = arranged("a.obj", &obj(&plan), &[("layer", "red")]).expect_err("refused");
    let expected = "a.obj: there is no layer \"red\"; there are \"pen1\" (pen 1), \"pen3\" (pen 3)";
    assert_eq!(error, expected);
}

#[test]
fn what_is_no_plan_is_refused_with_the_name_of_the_option() {
    let solid = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let tilted = "v 0 0 0\nv 1 0 0\nv 0 1 2\nl 1 2 3\n";
    let curve = "v 0 0 0\nv 1 1 0\ndeg 1\ncurv 0 1 1 2\nparm u 0 0 1 1\nend\n";
    for option in PLAN_OPTIONS {
        let value = match option.name {
            "crop" => "page",
            "layer" | "layer-order" => "1",
            _ => "1",
        };
        for (text, reason) in [
            (solid, "this file has faces"),
            (tilted, "has lines at more than one height"),
            (curve, "this file has curves"),
        ] {
            let error = arranged("a.obj", text, &[(option.name, value)]).expect_err("refused");
            let begin = format!("a.obj: --{} is for drawings of straight lines", option.name);
            assert!(error.starts_with(&begin) && error.contains(reason), "{error}");
        }
    }
    let arrangement = Arrangement { turn: Turn::Automatic, ..Default::default() };
    let error = SourceFile::arranged("a.obj".to_owned(), solid.into(), &arrangement);
    let error = error.expect_err("refused").to_string();
    assert!(error.contains("--landscape=auto is for drawings"), "{error}");
}

#[test]
fn values_that_make_no_sense_are_refused_and_change_nothing() {
    for (name, value) in [
        ("scale", "0"),
        ("scale", "1,2,3"),
        ("scale", "nan"),
        ("scale", "1e9"),
        ("rotate", "left"),
        ("rotate", "1,2"),
        ("crop", "1,2,3"),
        ("crop", "0,0,0,5"),
        ("hatch", "0"),
        ("hatch", "-1"),
        ("hatch", "0.001"),
        ("linemerge", "0"),
        ("simplify", "-1"),
        ("simplify", "11"),
        ("layer", ""),
        ("layer-order", "1,,2"),
        ("banana", "1"),
    ] {
        let mut arrangement = Arrangement::default();
        arrangement.set(name, value).expect_err(value);
        assert_eq!(arrangement, Arrangement::default(), "{name} {value}");
    }
    let line = obj(&[(1, vec![[0.0, 0.0], [9.0, 0.0]])]);
    let error = arranged("a.obj", &line, &[("crop", "50,50,9,9")]).expect_err("nothing left");
    assert_eq!(error, "a.obj: there is nothing left to draw after --crop");
    let error = arranged("a.obj", &line, &[("hatch", "1")]).expect_err("nothing closed");
    assert_eq!(error, "a.obj: there is no closed, filled shape to hatch");
}

/// Reads a plan that is scaled to a page of 110 x 210 mm with margins of 5 mm, under these options.
fn fitted(text: &str, options: &[(&str, &str)]) -> SourceFile {
    let page = Page { width: 110.0, height: 210.0 };
    let mut arrangement = Arrangement::on(Some(page), Turn::AsItIs, Some(5.0)).fitted(" ", 5.0);
    for (option, value) in options {
        arrangement.set(option, value).expect("an option");
    }
    SourceFile::arranged("a.obj".to_owned(), text.as_bytes().to_vec(), &arrangement).expect("read")
}

/// The y of the level lines of a plan, in order.
fn levels(file: &SourceFile) -> Vec<f64> {
    let strokes = strokes(file);
    let level = strokes.iter().filter(|(_, points)| points.len() == 2);
    let mut levels: Vec<f64> = level.map(|(_, points)| points[0][1]).collect();
    levels.sort_by(f64::total_cmp);
    levels
}

#[test]
fn a_length_on_the_paper_is_not_scaled_to_the_page() {
    let square = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nl 1 2 3 4 1\n";
    let file = fitted(square, &[("hatch", "2,0")]);
    assert_eq!(file.bounds(), Some([[5.0, 55.0], [105.0, 155.0]]));
    let hatch = levels(&file);
    assert!((48..=50).contains(&hatch.len()), "{hatch:?}");
    assert!(hatch.windows(2).all(|pair| (pair[1] - pair[0] - 2.0).abs() < 0.002), "{hatch:?}");
    // What is left of the crop, a tenth of the square, fills the page, and its rectangle is in mm
    // of the drawing.
    let file = fitted(square, &[("hatch", "2,0"), ("crop", "0,0,1,10")]);
    let hatch = levels(&file);
    assert!((99..=101).contains(&hatch.len()), "{hatch:?}");
    assert!(hatch.windows(2).all(|pair| (pair[1] - pair[0] - 2.0).abs() < 0.002), "{hatch:?}");
    let [low, high] = file.bounds().expect("a plan");
    assert!((high[0] - low[0] - 20.0).abs() < 0.01 && (high[1] - low[1] - 200.0).abs() < 0.01);
    // A gap of 0.1 mm in the file is one of 1 mm on the paper.
    let lines = "v 0 0 0\nv 5 0 0\nv 5.1 0 0\nv 10 0 0\nl 1 2\nl 3 4\n";
    let count = |gap| strokes(&fitted(lines, &[("linemerge", gap)])).len();
    assert_eq!((count("0.9"), count("1.1")), (2, 1));
    // So is a bend.
    let bend = "v 0 0 0\nv 5 0.1 0\nv 10 0 0\nl 1 2 3\n";
    let points = |within| strokes(&fitted(bend, &[("simplify", within)]))[0].1.len();
    assert_eq!((points("0.9"), points("1.1")), (3, 2));
}

#[test]
fn a_plan_is_scaled_into_what_the_title_leaves() {
    let square = "v 0 0 0\nv 10 0 0\nv 10 20 0\nv 0 20 0\nl 1 2 3 4 1\n";
    let page = Page { width: 110.0, height: 210.0 };
    let mut arrangement = Arrangement::on(Some(page), Turn::AsItIs, Some(5.0)).fitted("Ada", 6.0);
    arrangement.set("hatch", "50").expect("an option");
    let file = SourceFile::arranged("a.obj".into(), square.as_bytes().to_vec(), &arrangement);
    let [low, high] = file.expect("read").bounds().expect("a plan");
    // Capitals of 6 mm, as much above them, and a third of that below.
    assert!((low[1] - 19.0).abs() < 0.01 && (high[1] - 205.0).abs() < 0.01, "{low:?} {high:?}");
}

/// The pens of an OBJ are those that the plotter chooses, whether or not it is arranged here.
#[test]
fn an_option_changes_no_pen_of_an_obj() {
    for (statements, expected) in [
        (["usemtl pen1", "usemtl red", "usemtl 3", "usemtl red"], [1, 2, 3, 2]),
        (["usemtl red", "usemtl Pen1", "usemtl blue", "usemtl PEN07"], [1, 1, 2, 7]),
        (["g wall 3", "g", "g a", "g b"], [3, 1, 2, 4]),
        (["g a", "g b", "usemtl x", "g a"], [1, 1, 1, 1]),
        (["g b 3", "g c", "usemtl x", "usemtl y"], [1, 1, 1, 2]),
    ] {
        let mut text = String::new();
        for (statement, y) in statements.iter().zip(1..) {
            let end = 2 * y;
            let _ = write!(text, "{statement}\nv 0 {y} 0\nv 9 {y} 0\nl {} {end}\n", end - 1);
        }
        let file = arranged("a.obj", &text, &[("scale", "2")]).expect("a plan");
        let pens: Vec<u32> = strokes(&file).iter().map(|(pen, _)| *pen).collect();
        assert_eq!(pens, expected, "{text}");
    }
    let many: String = (1..=40).map(|at| format!("usemtl m{at}\n")).collect();
    let line = "v 0 0 0\nv 9 0 0\nl 1 2\n";
    let plain = SourceFile::new("a.obj".to_owned(), format!("{many}{line}").into_bytes());
    let scaled = arranged("a.obj", &format!("{many}{line}"), &[("scale", "2")]);
    assert!(plain.is_ok() && scaled.is_ok(), "{plain:?} {scaled:?}");
}

/// Shapes that lie between two lines of the hatching stay white.
#[test]
fn a_filled_shape_without_a_hatch_line_is_told() {
    let svg = |width: u32, small: u32| {
        format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='100mm' height='100mm' \
             viewBox='0 0 100 100'><rect x='5' y='5' width='{width}' height='{width}'/>\
             <rect x='71' y='71' width='{small}' height='{small}'/></svg>"
        )
    };
    let said = |text: &str| {
        let file = arranged("a.svg", text, &[("hatch", "20")]).expect("an SVG");
        let notes: Vec<String> = file.notes().to_vec();
        notes.join("; ")
    };
    assert_eq!(
        said(&svg(60, 2)),
        "1 filled shape is not hatched: no line of --hatch 20 crosses it"
    );
    assert_eq!(
        said(&svg(2, 2)),
        "2 filled shapes are not hatched: no line of --hatch 20 crosses them"
    );
    assert_eq!(said(&svg(60, 29)), "");
}
