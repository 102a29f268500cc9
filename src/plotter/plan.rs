//! Plans: models of bars and curves at one height, in millimetres.
//!
//! A plan needs no projection. It is laid on the page as it is, at true size or scaled to fit.

use super::job::{Collector, FOR_BOUNDS, Found, HALF_A_STEP, Pipeline};
use crate::array::MapEach;
use crate::curve::{FRACTION_BITS, Fine, Point};
use crate::drawing::{Bounds, LineType, PackedLine, PageMap};
use crate::index::Index;
use crate::model::{Element, Position};
use crate::protocol::CommandError;
use crate::visibility::SinkFull;

/// Maps the lines of the plan to the page and packs them at the front of the working memory.
///
/// # Errors
/// [`CommandError::Page`] if the plan does not go on the page, [`CommandError::DrawingTooLarge`] if
/// its lines do not fit in the memory, [`CommandError::Aborted`].
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn lay_out<I: Index>(pipeline: &mut Pipeline<'_, I>) -> Result<Found, CommandError> {
    let Pipeline { model, options, steps, words, cancel, observer, .. } = pipeline;
    let steps = *steps;
    let (vertices, curves) = (model.vertices(), model.curves());
    let points: &[Point] = bytemuck::cast_slice(vertices);
    let unit = libm::ldexp(1.0, -(model.fraction_bits() as i32));
    let (page, bits) = (&options.sheet(), model.fraction_bits());
    let corners = model.elements().corners().iter();
    let used = corners.filter_map(|c| vertices.get(c.vertex().get())).copied();
    let mut straight = Bounds::NOTHING;
    for Position { x, y, .. } in used {
        straight.add_position(x, y);
    }
    let mut all = Bounds::NOTHING;
    for Position { x, y, .. } in vertices {
        all.add_position(*x, *y);
    }
    let fit = |bounds: Bounds, is_true_size: bool| {
        let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
        if is_true_size {
            PageMap::true_size(&bounds, bits, page, steps)
        } else {
            PageMap::fit_plan(&bounds, bits, page, steps)
        }
        .map_err(CommandError::Page)
    };
    // Chords that were found at a quarter of the scale or less may lie farther within their curve
    // than those that are drawn, so they are found again. The scale grows each time.
    let mut map = fit(all, false)?;
    loop {
        let (mut bounds, rough) = (straight, map.magnitude());
        curves.flatten(points, &on_page(&map), FOR_BOUNDS, *cancel, &mut |[x, y, _], _| {
            bounds.add_position(x, y);
            Ok(())
        })?;
        map = fit(bounds, !options.fit)?;
        if map.magnitude() <= rough + 2 {
            break;
        }
    }
    let mut collector = Collector::new(words);
    let mut draw = |from: Point, to: Point, pen: u8| {
        let pen = if options.one_pen { 0 } else { pen };
        let on_plan = |[x, y, _]: Point| [x, y].map_each(|c| f64::from(c) * unit);
        observer.plan_bar(on_plan(from), on_plan(to), pen);
        let [from, to] = [from, to].map_each(|[x, y, _]| map.point(x.into(), y.into(), 1));
        collector
            .line(PackedLine::new(from, to, LineType::Full, pen))
            .map_err(|SinkFull| collector.missing())
    };
    for (element, pen) in model.elements().iter_with_pens() {
        let Element::Bar(from, to) = element else { continue };
        if let [Some(from), Some(to)] = [from, to].map_each(|number| points.get(number.get())) {
            draw(*from, *to, pen).map_err(CommandError::DrawingTooLarge)?;
        }
    }
    let mut before = None;
    let (mut pens, mut pen) = (curves.iter().map(|curve| curve.pen), 0);
    curves.flatten(points, &on_page(&map), HALF_A_STEP, *cancel, &mut |end, begins| {
        if begins {
            pen = pens.next().unwrap_or(pen);
        }
        match before.replace(end) {
            Some(before) if !begins => draw(before, end, pen),
            _ => Ok(()),
        }
    })?;
    Ok(Found { lines: collector.count, ..Found::default() })
}

/// Maps points of curves to the page, in 1/256 step.
fn on_page(map: &PageMap) -> impl Fn([i64; 3]) -> Option<Fine> {
    |[x, y, _]| Some(map.fine(x, y, 1 << FRACTION_BITS))
}

#[cfg(test)]
mod tests {
    use super::super::{PlotOptions, job::Unobserved};
    use super::*;
    use crate::fixed::{Decimal, Millimetres};
    use crate::model::{Corner, Model, no_undo};
    use crate::order::TimeModel;
    use crate::stage::{NeverCancel, items};
    use std::format;

    /// A curve around a small circle, which a scale that shows its other control points, far off,
    /// would show as a point.
    #[test]
    fn a_curve_that_is_small_beside_its_control_points_fills_the_page() {
        for (radius, fit) in [(0.02, "on"), (0.3, "on"), (90.0, "off"), (90.0, "on")] {
            let mut memory = ([Position::ORIGIN; 64], [<Corner>::ZERO; 128]);
            let mut model = Model::new(&mut memory.0, &mut memory.1);
            let number = |value: f64| Decimal::parse(&format!("{value:.6}")).unwrap();
            let ring = (0..16).map(|n| {
                let (sin, cos) = (core::f64::consts::TAU * f64::from(n) / 16.0).sin_cos();
                [radius * cos, radius * sin]
            });
            for [x, y] in ring.chain([[1000.0, 0.0], [1000.0, 1000.0], [0.0, 1000.0]]) {
                model.add_vertex([x, y, 0.0].map(number), &mut no_undo).unwrap();
            }
            model.set_degree(2).unwrap();
            model.begin_curve([2.0, 15.0].map(number), 1..=19).unwrap();
            model.add_knots((0..22).map(|n| number(n.into()))).unwrap();
            model.end_curve(&mut no_undo).unwrap();
            let mut options = PlotOptions::default();
            options.set("fit", fit).unwrap();
            let mut words = [0; 4096];
            let mut pipeline = Pipeline {
                model: &model,
                options: &options,
                steps: [Millimetres::from_num(80); 2],
                time_model: TimeModel::default(),
                #[cfg(feature = "early-ink")]
                early: None,
                words: &mut words,
                cancel: &mut NeverCancel,
                observer: &mut Unobserved,
            };
            let found = lay_out(&mut pipeline).unwrap();
            let lines: &[PackedLine] = items(&words, found.lines).unwrap();
            // The free part of a sheet of A4 is 190 mm wide. A chord may lie half a step beyond.
            let across = || lines.iter().flat_map(|line| line.ends()).map(|end| end.x);
            let (low, high) = (across().min().unwrap(), across().max().unwrap());
            assert!(low >= 799 && high <= 16_001, "{radius} {fit}: {low} {high}");
            if fit == "on" {
                assert!(low <= 801 && high >= 15_999, "{radius}: {low} {high}");
            }
        }
    }
}
