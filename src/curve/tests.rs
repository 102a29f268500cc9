use super::*;
use std::vec;
use std::vec::Vec;

const UNIT: i32 = 1 << 20;
/// The polygon of figures 4 and 5.
const PAPER: [Point; 4] =
    [[0, 0, 0], [3 * UNIT, 9 * UNIT, 0], [6 * UNIT, 3 * UNIT, 0], [9 * UNIT, 6 * UNIT, 0]];

fn uniform<'a>(points: &'a [Point], control: &'a [u16], order: u8) -> Spline<'a> {
    Spline::new(points, control, order, Knots::Uniform).unwrap()
}

/// The point at `tenths` tenths of a knot after the beginning.
fn at_tenths(spline: &Spline<'_>, tenths: i64) -> Point {
    let degree = i64::from(spline.order) - 1;
    spline.at(spline.parameter(((degree * 10 + tenths) << 16) / 10, 16))
}

fn near(a: Point, b: Point, units: u32) -> bool {
    a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= units)
}

/// A page with one fine unit to each unit of the control points.
fn flat(position: [i64; 3]) -> Option<Fine> {
    Some([position[0] >> FRACTION_BITS, position[1] >> FRACTION_BITS])
}

fn chord_ends(spline: &Spline<'_>, tolerance: u16) -> Vec<Point> {
    spline.chords(flat, tolerance).map(|(_, point)| point).collect()
}

#[test]
fn the_worked_table_of_section_2_4() {
    // The values of x and y as printed, for t from 1 to 5 in fifths. The second x is corrected: the
    // scan has .02, where the polynomial next to it, 1.5 (t - 1)^2, gives .06.
    #[rustfmt::skip]
    let table = [
        (0.0, 0.0), (0.06, 0.18), (0.24, 0.72), (0.54, 1.6), (0.96, 2.9), (1.5, 4.5),
        (2.1, 6.0), (2.7, 6.9), (3.3, 7.2), (3.9, 6.9), (4.5, 6.0),
        (5.1, 5.0), (5.7, 4.3), (6.3, 4.0), (6.9, 4.1), (7.5, 4.5),
        (8.0, 5.0), (8.5, 5.5), (8.8, 5.8), (8.9, 5.9), (9.0, 6.0),
    ];
    let spline = uniform(&PAPER, &[0, 0, 1, 2, 3, 3], 3);
    for (fifth, (x, y)) in table.into_iter().enumerate() {
        let position = at_tenths(&spline, 2 * fifth as i64);
        // The values are printed to a tenth.
        let printed = [x, y].map(|c: f64| (c * f64::from(UNIT)) as i32);
        let allowed = UNIT.unsigned_abs() / 20 + 2;
        assert!(near(position, [printed[0], printed[1], 0], allowed), "{fifth}: {position:?}");
    }
}

#[test]
fn the_polynomials_beside_the_table_come_out() {
    // The coefficients of 1, t and t², in halves. The minus signs of the leading terms are lost in
    // the scan.
    let polynomials = [
        ([3, -6, 3], [9, -18, 9]),
        ([-9, 6, 0], [-87, 78, -15]),
        ([-9, 6, 0], [129, -66, 9]),
        ([-57, 30, -3], [-63, 30, -3]),
    ];
    let spline = uniform(&PAPER, &[0, 0, 1, 2, 3, 3], 3);
    for (piece, (x, y)) in polynomials.into_iter().enumerate() {
        for sixteenth in 0..=16 {
            let t = 16 * (piece as i64 + 1) + sixteenth;
            let value = |[c, b, a]: [i64; 3]| {
                ((c * 256 + b * t * 16 + a * t * t) * i64::from(UNIT) / 512) as i32
            };
            let position = spline.at(spline.parameter((t + 16) << 12, 16));
            assert_eq!(position, [value(x), value(y), 0], "t = {t}/16");
        }
    }
}

#[test]
fn a_quadratic_passes_the_midpoints_along_the_polygon() {
    // This tests equation 25 and the slope of equation 24.
    let spline = uniform(&PAPER, &[0, 1, 2, 3], 3);
    for (knot, pair) in PAPER.windows(2).enumerate() {
        let middle: Point = core::array::from_fn(|axis| (pair[0][axis] + pair[1][axis]) / 2);
        assert_eq!(at_tenths(&spline, 10 * knot as i64), middle);
        let step = 1 << 12; // A knot is 2^16 long.
        let t = ((2 + knot as i64) << 16) + if knot == 2 { -step } else { step };
        let beside = spline.at(spline.parameter(t, 16));
        let (dx, dy) = (beside[0] - middle[0], beside[1] - middle[1]);
        let (along_x, along_y) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let turn = i64::from(dx) * i64::from(along_y) - i64::from(dy) * i64::from(along_x);
        // The curve turns away with the square of the distance: at 1/16 of a knot, by less than
        // 1/256 of a polygon side.
        let side = i64::from(along_x).pow(2) + i64::from(along_y).pow(2);
        assert!(turn.abs() * 128 < side, "knot {knot}");
    }
}

#[test]
fn equation_18_for_the_quadratic() {
    let spline = uniform(&PAPER, &[0, 1, 2, 3], 3);
    for (i, p) in PAPER.windows(3).enumerate() {
        for s in 0..16i64 {
            // With s in sixteenths: 512 R = p2 s² + p1 ((s+16)² - 3 s²) + p0 ((s+32)² - 3 (s+16)² +
            // 3 s²).
            let (a, b, c) = (s * s, (s + 16) * (s + 16), (s + 32) * (s + 32));
            let expected = core::array::from_fn(|axis| {
                let [p0, p1, p2] = [0, 1, 2].map(|at: usize| i64::from(p[at][axis]));
                ((p2 * a + p1 * (b - 3 * a) + p0 * (c - 3 * b + 3 * a)) / 512) as i32
            });
            let t = ((2 + i as i64) << 16) + (s << 12);
            assert!(near(spline.at(spline.parameter(t, 16)), expected, 1), "{i} {s}");
        }
    }
}

#[test]
fn order_2_is_the_polygon() {
    let spline = uniform(&PAPER, &[0, 1, 2, 3], 2);
    for (knot, point) in PAPER.into_iter().enumerate() {
        assert_eq!(at_tenths(&spline, 10 * knot as i64), point);
    }
    let ends = chord_ends(&spline, 64);
    assert_eq!(ends.len(), 4, "{ends:?}");
    for (end, corner) in ends.into_iter().zip(PAPER) {
        assert!(near(end, corner, 1 << 17), "{end:?} {corner:?}");
    }
}

#[test]
fn a_repeated_point_draws_the_curve_nearer() {
    // Figure 5, order 4, has the second vertex once and twice.
    let nearest = |control: &[u16]| {
        let spline = uniform(&PAPER, control, 4);
        let [x, y, _] = PAPER[1];
        let tenths = 0..=10 * spline.spans() as i64;
        tenths
            .map(|tenth| at_tenths(&spline, tenth))
            .map(|position| i64::from(position[0] - x).pow(2) + i64::from(position[1] - y).pow(2))
            .min()
    };
    let once = nearest(&[0, 0, 0, 1, 2, 3, 3, 3]);
    let twice = nearest(&[0, 0, 0, 1, 1, 2, 3, 3, 3]);
    let thrice = nearest(&[0, 0, 0, 1, 1, 1, 2, 3, 3, 3]);
    assert!(twice < once);
    // With multiplicity order - 1 the curve passes through the point.
    assert_eq!(thrice, Some(0));
}

#[test]
fn a_moved_point_moves_only_what_is_near() {
    // As in figure 6 of Allard & Bown, where the fifth control point of a B-spline of order 4 is
    // moved.
    let points: Vec<Point> = (0..9).map(|i| [i * UNIT, (i % 3) * UNIT, i * i * 999]).collect();
    let mut moved = points.clone();
    moved[4][1] += 5 * UNIT;
    let control: Vec<u16> = (0..9).collect();
    let (before, after) = (uniform(&points, &control, 4), uniform(&moved, &control, 4));
    for tenth in 0..=60 {
        // Point 4 has an effect from knot 4 to 8, and the curve begins at knot 3.
        let acts = 10 < tenth && tenth < 50;
        let same = at_tenths(&before, tenth) == at_tenths(&after, tenth);
        assert_eq!(same, !acts, "{tenth}");
    }
}

#[test]
fn a_closed_curve_ends_where_it_began() {
    for order in 3..=GREATEST_ORDER {
        let control: Vec<u16> = (0..4).chain(0..4).cycle().take(3 + usize::from(order)).collect();
        let spline = uniform(&PAPER, &control, order);
        let ends = chord_ends(&spline, 128);
        assert_eq!(ends.first(), ends.last(), "order {order}");
        assert!(ends.len() > 4);
    }
}

#[test]
fn points_in_line_give_one_chord() {
    let points: Vec<Point> = (0..40).map(|i| [i * 3000, i * 1000, i * 7]).collect();
    let control: Vec<u16> = (0..40).collect();
    for order in LEAST_ORDER..=GREATEST_ORDER {
        assert_eq!(chord_ends(&uniform(&points, &control, order), 1).len(), 2, "order {order}");
    }
    // One chord is enough across double knots too.
    let knots: Vec<i32> = (0..43).map(|knot| knot / 2).collect();
    let doubled = Spline::new(&points, &control, 3, Knots::Listed(&knots)).unwrap();
    assert_eq!(chord_ends(&doubled, 1).len(), 2);
    // One curve has all points at one place, and the other runs there and back along a line.
    let still = [0u16; 9];
    assert_eq!(chord_ends(&uniform(&points, &still, 4), 1), [[0; 3]]);
    let back = chord_ends(&uniform(&points, &[0, 20, 39, 20, 0], 2), 128);
    assert_eq!(back.len(), 3, "{back:?}");
}

#[test]
fn both_recursions_agree() {
    let big = 1 << 30;
    let points =
        [[big, -big, 3], [-big, big, -5], [big, 7, big], [-big, -big, -big], [5, 9, 1], [big; 3]];
    let control = [0, 1, 2, 3, 4, 5, 1, 3];
    for order in LEAST_ORDER..=GREATEST_ORDER {
        let knots: Vec<i32> = (0..8 + i32::from(order)).map(|i| 70 * i - 300).collect();
        let listed = Spline::new(&points, &control, order, Knots::Listed(&knots)).unwrap();
        let counted = uniform(&points, &control, order);
        for bits in 0..counted.spans() as u32 * 8 {
            let t = Parameter::from_bits(bits << (Parameter::LOCAL_BITS - 3));
            assert_eq!(t.to_bits(), bits << (Parameter::LOCAL_BITS - 3));
            assert!(near(listed.at(t), counted.at(t), 1), "order {order}, {t:?}");
        }
    }
}

#[test]
fn every_parameter_is_on_the_curve() {
    let knots = [0, 0, 0, 5, 5, 9, 9, 9];
    let points = [[0, 0, 0], [10, 100, 0], [200, 0, 0], [300, 300, 0], [9, 9, 9]];
    let spline = Spline::new(&points, &[0, 1, 2, 3, 4], 3, Knots::Listed(&knots)).unwrap();
    assert_eq!(spline.at(Parameter::from_bits(0)), [0, 0, 0]);
    assert_eq!(spline.at(Parameter::from_bits(u32::MAX)), [9, 9, 9]);
    // At a double knot, a quadratic passes through the point, from both sides and by each parameter
    // of the knot.
    for t in [spline.parameter(5, 0), Parameter::start_of(1), Parameter::start_of(2)] {
        assert_eq!(spline.at(t), [200, 0, 0]);
    }
    for (u, end) in [(i64::MIN, 0), (-1, 0), (0, 0), (9, 3), (10, 3), (i64::MAX, 3)] {
        assert_eq!(spline.parameter(u, 0), Parameter::start_of(end), "{u}");
    }
    let nothing = spline.between(spline.parameter(7, 0), spline.parameter(2, 0));
    assert_eq!(chord_ends(&nothing, 128).len(), 1);
}

#[test]
fn what_is_cut_off_costs_no_chords() {
    // The curve goes behind the near plane z = 1 in the middle, in perspective.
    let points = [[-9000, 0, 9000], [-3000, 9000, -90_000], [3000, 9, -90_000], [9000, 0, 9000]];
    let spline =
        Spline::new(&points, &[0u16, 1, 2, 3], 4, Knots::Listed(&[0, 0, 0, 0, 1, 1, 1, 1]))
            .unwrap();
    let perspective = |position: [i64; 3]| {
        (position[2] >= 1 << FRACTION_BITS)
            .then(|| [0, 1].map(|axis: usize| position[axis] * 5000 / position[2]))
    };
    let ends: Vec<_> = spline.chords(perspective, 128).map(|(_, point)| point).collect();
    let behind = ends.windows(2).filter(|pair| pair.iter().all(|point| point[2] < 1)).count();
    assert!(behind <= 1, "{ends:?}");
    assert!(ends.len() < 100, "{}", ends.len());
    let hidden: Vec<_> = spline.chords(|_| None, 128).collect();
    assert_eq!(hidden.len(), 2);
}

#[test]
fn what_is_no_curve_is_refused() {
    fn command_error(control: &[u16], order: u8, knots: Knots<'_>) -> CurveError {
        Spline::new(&[[0; 3]; 5], control, order, knots).map(|_| ()).unwrap_err()
    }
    let listed = |knots: &'static [i32]| command_error(&[0, 1, 2], 3, Knots::Listed(knots));
    for order in [0, 1, 7, 255] {
        assert_eq!(command_error(&[0, 1, 2, 3, 4], order, Knots::Uniform), CurveError::Order);
    }
    let too_few = CurveError::TooFewControlPoints { needed: 4 };
    assert_eq!(command_error(&[0, 1, 2], 4, Knots::Uniform), too_few);
    assert_eq!(command_error(&[], 4, Knots::Uniform), too_few);
    assert_eq!(
        command_error(&[0, 1, 5], 3, Knots::Uniform),
        CurveError::UnknownPoint { number: 5 }
    );
    assert_eq!(
        command_error(&vec![0; 4096], 3, Knots::Uniform),
        CurveError::TooManyControlPoints { limit: 4095 }
    );
    assert_eq!(listed(&[0; 5]), CurveError::WrongKnotCount { needed: 6, given: 5 });
    assert_eq!(listed(&[0, 1, 2, 3, 5, 4]), CurveError::KnotDecreases { knot: 5 });
    assert_eq!(listed(&[i32::MIN, 1, 2, 3, 5, 7]), CurveError::KnotTooLarge { knot: 0 });
    assert_eq!(listed(&[0, 1, 2, 2, 5, 7]), CurveError::OutsideKnots);
    let broken = Knots::Listed(&[0, 0, 0, 4, 4, 4, 9, 9, 9]);
    assert_eq!(command_error(&[0, 1, 2, 3, 4, 0], 3, broken), CurveError::KnotRepeated { knot: 3 });
}
