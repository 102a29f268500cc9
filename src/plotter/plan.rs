//! Plans: models of bars and curves at one height, in millimetres.
//!
//! A plan needs no projection. It is laid on the page as it is, at true size or scaled to fit.

use super::job::{Collector, FOR_BOUNDS, Found, HALF_A_STEP, Pipeline};
use crate::array::MapEach;
use crate::curve::{FRACTION_BITS, Point};
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
    let on_page =
        |map: PageMap| move |[x, y, _]: [i64; 3]| Some(map.fine(x, y, 1 << FRACTION_BITS));
    let corners = model.elements().corners().iter();
    let used = corners.filter_map(|c| vertices.get(c.vertex().get())).copied();
    let mut bounds = Bounds::NOTHING;
    for Position { x, y, .. } in used {
        bounds.add_position(x, y);
    }
    if !curves.is_empty() {
        let mut all = Bounds::NOTHING;
        for Position { x, y, .. } in vertices {
            all.add_position(*x, *y);
        }
        let all = all.known().ok_or(CommandError::NothingToPlot)?;
        let rough = PageMap::fit_plan(&all, bits, page, steps).map_err(CommandError::Page)?;
        curves.flatten(points, &on_page(rough), FOR_BOUNDS, *cancel, &mut |[x, y, _], _| {
            bounds.add_position(x, y);
            Ok(())
        })?;
    }
    let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
    let map = if options.fit {
        PageMap::fit_plan(&bounds, bits, page, steps)
    } else {
        PageMap::true_size(&bounds, bits, page, steps)
    };
    let map = map.map_err(CommandError::Page)?;
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
    curves.flatten(points, &on_page(map), HALF_A_STEP, *cancel, &mut |end, begins| {
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
