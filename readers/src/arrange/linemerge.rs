//! Joins strokes whose ends are near each other.

use crate::plan::{Plan, Point, Stroke};
use std::collections::HashMap;

/// A square of the plane, for the strokes of one pen and layer.
type Square = (u32, u32, i64, i64);

/// An end of a stroke: its number, and whether it is its last point.
type End = (usize, bool);

/// The ends of strokes by the square of the plane in which they lie.
struct Ends {
    side: f64,
    squares: HashMap<Square, Vec<End>>,
}

impl Ends {
    fn square(&self, [x, y]: Point) -> (i64, i64) {
        ((x / self.side).floor() as i64, (y / self.side).floor() as i64)
    }

    fn insert(&mut self, (pen, layer): (u32, u32), point: Point, end: End) {
        let (x, y) = self.square(point);
        self.squares.entry((pen, layer, x, y)).or_default().push(end);
    }

    /// Returns the end nearest to `point` among those of the `strokes` that are left, if it is
    /// within the side of a square.
    fn nearest(
        &self,
        (pen, layer): (u32, u32),
        point: Point,
        strokes: &[Option<Stroke>],
    ) -> Option<End> {
        let (x, y) = self.square(point);
        let mut nearest: Option<(f64, End)> = None;
        for square in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (pen, layer, x + dx, y + dy))) {
            for &end in self.squares.get(&square).into_iter().flatten() {
                let (index, is_last) = end;
                let Some(Some(stroke)) = strokes.get(index) else { continue };
                let own = if is_last { stroke.points.last() } else { stroke.points.first() };
                let Some(own) = own else { continue };
                let distance = (own[0] - point[0]).hypot(own[1] - point[1]);
                let is_nearer = nearest.is_none_or(|best| (distance, end) < best);
                if distance <= self.side && is_nearer {
                    nearest = Some((distance, end));
                }
            }
        }
        nearest.map(|(_, end)| end)
    }
}

/// Joins strokes of one pen and layer whose ends are no farther apart than `tolerance`, in mm. A
/// short line joins them where they do not meet.
pub(super) fn merge(plan: &mut Plan, tolerance: f64) {
    let mut strokes: Vec<Option<Stroke>> =
        std::mem::take(&mut plan.strokes).into_iter().map(Some).collect();
    let mut ends = Ends { side: tolerance, squares: HashMap::new() };
    for (index, stroke) in strokes.iter().flatten().enumerate() {
        if stroke.is_closed() {
            continue;
        }
        for (point, is_last) in [(stroke.points.first(), false), (stroke.points.last(), true)] {
            if let Some(&point) = point {
                ends.insert((stroke.pen, stroke.layer), point, (index, is_last));
            }
        }
    }
    for index in 0..strokes.len() {
        let Some(mut merged) = strokes.get_mut(index).and_then(Option::take) else { continue };
        let owner = (merged.pen, merged.layer);
        if !merged.is_closed() {
            // First what goes on at the end, and then, the other way round, at the beginning.
            for _ in 0..2 {
                while !merged.is_closed()
                    && let Some(&end) = merged.points.last()
                    && let Some((next, is_last)) = ends.nearest(owner, end, &strokes)
                    && let Some(mut next) = strokes.get_mut(next).and_then(Option::take)
                {
                    if is_last {
                        next.points.reverse();
                    }
                    let meets = next.points.first() == Some(&end);
                    merged.points.extend(next.points.into_iter().skip(usize::from(meets)));
                }
                merged.points.reverse();
            }
        }
        plan.strokes.push(merged);
    }
}
