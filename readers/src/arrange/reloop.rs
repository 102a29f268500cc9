//! Begins closed strokes at other points.

use crate::plan::Plan;

/// Begins each closed stroke at another of its points, which depends on its number alone, so that
/// the same file is always drawn the same way.
pub(super) fn reloop(plan: &mut Plan) {
    for (number, stroke) in plan.strokes.iter_mut().enumerate() {
        if !stroke.is_closed() {
            continue;
        }
        stroke.points.pop();
        let count = stroke.points.len();
        // The fractions of multiples of the golden ratio spread evenly; 0 would change nothing.
        let part = ((number as f64 + 1.0) * 0.618_033_988_749_895).fract();
        let shift = 1 + (part * (count - 1) as f64) as usize;
        stroke.points.rotate_left(shift.min(count - 1));
        let first = stroke.points.first().copied();
        stroke.points.extend(first);
    }
}
