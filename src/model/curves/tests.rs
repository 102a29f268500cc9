//! Tests of sending curves: what is sent comes back, and what is refused leaves nothing behind.

use super::*;
use crate::fixed::Decimal;
use crate::model::{Corner, Model, ModelError, Position, no_undo};
use std::vec::Vec;

fn decimal(text: &str) -> Decimal {
    Decimal::parse(text).unwrap()
}

fn decimals(text: &str) -> impl Iterator<Item = Decimal> + Clone {
    text.split(' ').map(decimal)
}

/// A model with eight vertices and room for 48 half-words.
fn with_model(test: impl FnOnce(&mut Model<'_>)) {
    let mut memory = ([Position::ORIGIN; 8], [<Corner>::ZERO; 48]);
    let mut model = Model::new(&mut memory.0, &mut memory.1);
    for _ in 0..8 {
        model.add_vertex(["0", "0", "0"].map(decimal), &mut no_undo).unwrap();
    }
    test(&mut model);
}

fn sent(
    model: &mut Model<'_>,
    ends: [&str; 2],
    control: &[i32],
    knots: &[&str],
) -> Result<(), ModelError> {
    model.begin_curve(ends.map(decimal), control.iter().copied())?;
    for line in knots {
        model.add_knots(decimals(line))?;
    }
    model.end_curve(&mut no_undo)
}

fn controls(model: &Model<'_>) -> Vec<Vec<u16>> {
    model.curves().iter().map(|curve| curve.control.to_vec()).collect()
}

fn knots(curve: &StoredCurve<'_>) -> Vec<i64> {
    (0..curve.control.len() + usize::from(curve.order)).map(|at| curve.knots.get(at)).collect()
}

#[test]
fn curves_come_back_as_they_were_sent_wherever_the_elements_come() {
    with_model(|model| {
        model.set_degree(2).unwrap();
        model.add_polyline([1, 2].into_iter(), &mut no_undo).unwrap();
        sent(model, ["2.5", "4"], &[1, 2, -5, 4, 1], &[]).unwrap();
        model.begin_curve(["0", "3"].map(decimal), [5, 4, 3, 2].into_iter()).unwrap();
        model.add_knots(decimals("0 0 0")).unwrap();
        model.add_face([1, 2, 3].into_iter(), &mut no_undo).unwrap();
        // A knot past 1 coarsens those before it.
        model.add_knots(decimals("0.5")).unwrap();
        model.add_knots(decimals("3 3 3")).unwrap();
        model.end_curve(&mut no_undo).unwrap();
        let curves: Vec<_> = model.curves().iter().collect();
        assert_eq!((curves.len(), model.curve_count()), (2, 2));
        assert_eq!(
            (curves[0].order, curves[0].control, curves[0].knots),
            (3, &[0, 1, 3, 3, 0][..], Knots::Uniform)
        );
        assert_eq!((curves[0].from.to_bits(), curves[0].to.to_bits()), (1 << 19, 2 << 20));
        let unit = 1 << 20;
        assert_eq!(curves[1].control, [4, 3, 2, 1]);
        assert_eq!(knots(&curves[1]), [0, 0, 0, unit / 2, 3 * unit, 3 * unit, 3 * unit]);
        assert!(curves[1].spline(&[[0; 3]; 5]).is_ok());
        assert!(matches!(
            curves[1].spline(&[[0; 3]; 4]),
            Err(CurveError::UnknownPoint { number: 4 })
        ));
        assert_eq!(model.corner_count(), 5 + (8 + 5) + (8 + 4 + 14));
        assert_eq!(model.elements().iter().count(), 2);
        model.clear();
        assert_eq!((model.curve_count(), model.curves().iter().count()), (0, 0));
    });
}

#[test]
fn what_is_refused_leaves_nothing_behind() {
    with_model(|model| {
        let three = [1, 2, 3];
        assert_eq!(sent(model, ["2", "3"], &three, &[]), Err(ModelError::NoDegree));
        assert_eq!(model.add_knots(decimals("1")), Err(ModelError::NoCurve));
        assert_eq!(model.end_curve(&mut no_undo), Err(ModelError::NoCurve));
        for degree in [0, 6] {
            assert_eq!(model.set_degree(degree), Err(ModelError::Curve(CurveError::Order)));
        }
        model.set_degree(2).unwrap();
        sent(model, ["2", "3"], &three, &[]).unwrap();
        let full = ModelError::TooManyCorners { limit: 48, needed: 11 + 8 + 30 };
        let unknown = ModelError::UnknownVertex { number: 9, vertices: 8 };
        let outside = ModelError::Curve(CurveError::OutsideKnots);
        let few = ModelError::Curve(CurveError::TooFewControlPoints { needed: 3 });
        let count = ModelError::Curve(CurveError::WrongKnotCount { needed: 6, given: 5 });
        let falls = ModelError::Curve(CurveError::KnotDecreases { knot: 5 });
        for (ends, control, knots, error) in [
            (["2", "3"], &three[..2], &[][..], few),
            (["2", "3"], &[1, 2, 9], &[], unknown),
            (["2", "3"], &[7; 30], &[], full),
            (["0", "1"], &three, &[], outside),
            (["3", "2"], &three, &[], outside),
            (["2", "1e30"], &three, &[], ModelError::KnotTooLarge),
            (["2", "4"], &three, &[], outside),
            (["0", "1"], &three, &["0 0 0 1 1"], count),
            (["0", "1"], &three, &["0 0 0 1 2 1"], falls),
        ] {
            assert_eq!(sent(model, ends, control, knots), Err(error), "{ends:?} {knots:?}");
            assert_eq!((model.curve_count(), model.corner_count()), (1, 11));
        }
        assert_eq!(controls(model), [[0, 1, 2]]);
    });
}

#[test]
fn a_refused_line_leaves_the_unfinished_curve() {
    with_model(|model| {
        model.set_degree(1).unwrap();
        model.begin_curve(["0", "1"].map(decimal), [4, 5].into_iter()).unwrap();
        assert_eq!(
            model.begin_curve(["0", "1"].map(decimal), [4, 5].into_iter()),
            Err(ModelError::CurveUnfinished)
        );
        model.add_knots(decimals("0 0")).unwrap();
        assert_eq!(model.add_knots(decimals("1e9")), Err(ModelError::KnotTooLarge));
        let many = core::iter::repeat_n(decimal("7"), 99);
        assert_eq!(
            model.add_knots(many),
            Err(ModelError::TooManyCorners { limit: 48, needed: 8 + 2 + 4 + 2 * 99 })
        );
        model.add_knots(decimals("1 1")).unwrap();
        model.end_curve(&mut no_undo).unwrap();
        let curve = model.curves().iter().next().unwrap();
        assert_eq!(knots(&curve), [0, 0, 1 << 22, 1 << 22]);
    });
}
