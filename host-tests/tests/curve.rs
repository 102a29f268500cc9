//! Tests of B-splines against the Cox-de Boor basis in floats, and of their chords against dense
//! sampling and the minimum number of chords.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use penup::curve::{FRACTION_BITS, Fine, Knots, Parameter, Point, Spline};
use penup_host_tests::curve_reference::{distance, fewest_chords, spline_at};
use proptest::prelude::*;

/// A curve as a test generates it.
#[derive(Debug, Clone)]
struct Sketch {
    points: Vec<Point>,
    order: u8,
    /// The knots; empty for uniform ones.
    knots: Vec<i32>,
}

impl Sketch {
    fn control(&self) -> Vec<u16> {
        (0..self.points.len() as u16).collect()
    }

    fn spline<'a>(&'a self, control: &'a [u16]) -> Spline<'a> {
        let knots = if self.knots.is_empty() { Knots::Uniform } else { Knots::Listed(&self.knots) };
        Spline::new(&self.points, control, self.order, knots).unwrap()
    }

    fn float_knots(&self) -> Vec<f64> {
        let count = self.points.len() + usize::from(self.order);
        match &self.knots[..] {
            [] => (0..count).map(|knot| knot as f64).collect(),
            knots => knots.iter().map(|knot| f64::from(*knot)).collect(),
        }
    }

    fn float_points(&self) -> Vec<[f64; 3]> {
        self.points.iter().map(|point| point.map(f64::from)).collect()
    }
}

fn sketch(limit: i32, points: std::ops::Range<usize>) -> impl Strategy<Value = Sketch> {
    let point = prop::array::uniform3(-limit..=limit);
    (2u8..=6, prop::collection::vec(point, points)).prop_flat_map(|(order, mut points)| {
        while points.len() < usize::from(order) {
            points.push([points.len() as i32 * 100, 7, -7]);
        }
        let inner = points.len() - usize::from(order);
        let gaps = prop::collection::vec(prop_oneof![Just(0i32), 1..2000i32], inner + 1);
        (Just(points), Just(order), any::<bool>(), gaps).prop_map(
            |(points, order, listed, gaps)| {
                let knots = if listed { clamped_knots(usize::from(order), &gaps) } else { vec![] };
                Sketch { points, order, knots }
            },
        )
    })
}

/// Creates clamped knots: each end occurs `order` times, and inner knots are at `gaps`, where 0
/// repeats a knot, at most order - 1 times.
fn clamped_knots(order: usize, gaps: &[i32]) -> Vec<i32> {
    let mut knots = vec![-1000; order];
    let mut repeats = order - 1;
    for gap in gaps {
        let gap = if repeats + 1 >= order { (*gap).max(1) } else { *gap };
        repeats = if gap == 0 { repeats + 1 } else { 1 };
        knots.push(knots[knots.len() - 1] + gap);
    }
    // The last gap leads to the end.
    let end = knots[knots.len() - 1].max(knots[knots.len() - 2] + 1);
    knots.pop();
    knots.extend(std::iter::repeat_n(end, order));
    knots
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_curve_is_where_the_basis_functions_say(
        sketch in sketch(1 << 30, 2..12),
        sixteenths in 0u32..(16 * 11),
    ) {
        let control = sketch.control();
        let spline = sketch.spline(&control);
        let (knots, points) = (sketch.float_knots(), sketch.float_points());
        let order = usize::from(sketch.order);
        let (first, last) = (knots[order - 1], knots[points.len()]);
        // Binary fractions of the whole are whole numbers of 2^-16 knots, but for listed ones.
        let u = (first + (last - first) * f64::from(sixteenths) / 176.0).floor()
            + f64::from(sixteenths % 16) / 16.0;
        let u = u.min(last);
        let t = spline.parameter((u * 65536.0) as i64, 16);
        let found = spline.at(t);
        let expected = spline_at(&points, &knots, order, u);
        // Half a unit of rounding, 1/16 of arithmetic, and the parameter's own rounding (2^-21 of a
        // polynomial) where `u` is no binary fraction of it: at most degree × the polygon's width.
        let parameter = if sketch.knots.is_empty() { 0.0 } else { 5.0 * 2f64.powi(31 - 21) };
        for axis in 0..3 {
            let error = (f64::from(found[axis]) - expected[axis]).abs();
            prop_assert!(error <= 0.5 + 1.0 / 16.0 + parameter, "{error}");
        }
    }

    #[test]
    fn small_curves_are_exact_to_a_rounding(sketch in sketch(1 << 9, 2..12), bits in any::<u32>()) {
        // |parameter error| × slope is below 2^-21 × 5 × 2^10 here: nothing.
        let control = sketch.control();
        let spline = sketch.spline(&control);
        let (knots, points) = (sketch.float_knots(), sketch.float_points());
        let order = usize::from(sketch.order);
        let spans = points.len() + 1 - order;
        let t = bits % ((spans as u32) << 20);
        let span = order - 1 + (t >> 20) as usize;
        let local = f64::from(t & 0xFFFFF) / f64::from(1 << 20);
        let u = knots[span] + (knots[span + 1] - knots[span]) * local;
        let found = spline.at(Parameter::from_bits(t));
        let expected = spline_at(&points, &knots, order, u);
        for axis in 0..3 {
            let error = (f64::from(found[axis]) - expected[axis]).abs();
            prop_assert!(error <= 0.5 + 1.0 / 16.0, "{error}");
        }
    }
}

/// Steps of the page to a unit of view, 1/64, in fine units of 1/256 step.
fn parallel(position: [i64; 3]) -> Option<Fine> {
    Some([0, 1].map(|axis: usize| position[axis] >> (FRACTION_BITS - 2)))
}

/// From the eye, depth 0.6 to 1: as if the far plane were a page of 8192 steps across.
fn perspective(position: [i64; 3]) -> Option<Fine> {
    let depth = position[2] + (800_000 << FRACTION_BITS);
    Some([0, 1].map(|axis: usize| position[axis] * (4096 * 256) / depth))
}

fn in_steps(fine: Fine) -> [f64; 2] {
    fine.map(|c| c as f64 / 256.0)
}

struct Flattened {
    /// Points on the page in steps, at even parameters along each polynomial.
    samples: Vec<[f64; 2]>,
    chords: usize,
    /// The largest distance between the curve and its chords, in steps.
    worst: f64,
}

fn flattened(
    sketch: &Sketch,
    project: fn([i64; 3]) -> Option<Fine>,
    tolerance: u16,
    samples: u32,
) -> Flattened {
    let control = sketch.control();
    let spline = sketch.spline(&control);
    let on_page = |t: u32| {
        let position = spline.at(Parameter::from_bits(t));
        in_steps(project(position.map(|c| i64::from(c) << FRACTION_BITS)).unwrap())
    };
    let ends: Vec<(Parameter, Point)> = spline.chords(project, tolerance).collect();
    let (first, last) = spline.ends();
    assert_eq!(ends[0], (first, spline.at(first)));
    assert_eq!(ends[ends.len() - 1].1, spline.at(last));
    let mut worst: f64 = 0.0;
    for pair in ends.windows(2) {
        assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1);
        let (from, to) = (pair[0].0.to_bits(), pair[1].0.to_bits());
        let (a, b) = (on_page(from), on_page(to));
        for sample in 0..=64 {
            let t = from + (u64::from(to - from) * sample / 64) as u32;
            worst = worst.max(distance(on_page(t), a, b));
        }
    }
    let length = last.to_bits() - first.to_bits();
    let samples = (0..=samples)
        .map(|sample| on_page((u64::from(length) * u64::from(sample) / u64::from(samples)) as u32))
        .collect();
    Flattened { samples, chords: ends.len() - 1, worst }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn no_chord_strays_and_hardly_any_is_too_many(
        sketch in sketch(1 << 13, 3..7),
        from_the_eye in any::<bool>(),
    ) {
        // 128 steps across at most, so that 300 samples stand for the curve; half a step of
        // tolerance.
        let project = if from_the_eye { perspective } else { parallel };
        let found = flattened(&sketch, project, 128, 300);
        // Rounding to units (1/64 step) of the samples themselves comes on top.
        prop_assert!(found.worst <= 0.5 + 0.04, "{} steps", found.worst);
        let fewest = fewest_chords(&found.samples, 0.5);
        prop_assert!(found.chords <= fewest + fewest / 20 + 1, "{} for {fewest}", found.chords);
    }

    #[test]
    fn large_curves_stay_within_the_tolerance(
        sketch in sketch(1 << 19, 3..12),
        from_the_eye in any::<bool>(),
        tolerance in 16u16..1024,
    ) {
        let project = if from_the_eye { perspective } else { parallel };
        let found = flattened(&sketch, project, tolerance, 1);
        prop_assert!(found.worst <= f64::from(tolerance) / 256.0 + 0.06, "{} steps", found.worst);
    }
}

#[test]
fn a_chord_may_stay_by_a_bend_where_shorter_ones_do_not() {
    let loops = [
        [-404, 6431, 7857],
        [1237, 2404, -5390],
        [6229, -3515, -1797],
        [569, -4868, 4927],
        [6381, 5255, -1524],
        [7897, -3626, -7851],
    ];
    let turning = [[-8052, -3452, 2895], [5538, -2140, -288], [-2767, -4095, -5461], [300, 7, -7]];
    for (points, most) in [(&loops[..], 11), (&turning[..], 7)] {
        let order = points.len() as u8;
        let sketch = Sketch { points: points.to_vec(), order, knots: vec![] };
        // One polynomial, given by its Bézier points.
        let knots = [-1000, -999].into_iter().flat_map(|knot| vec![knot; points.len()]).collect();
        let found = flattened(&Sketch { knots, ..sketch }, parallel, 128, 300);
        assert!(found.chords <= most, "{} for {most}", found.chords);
    }
}
