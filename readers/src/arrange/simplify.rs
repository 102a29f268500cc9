//! Leaves out points of strokes (Douglas & Peucker 1973).

use crate::plan::{Plan, Point};

/// Leaves out points that stay within `tolerance`, in mm, of the line that replaces them.
pub(super) fn simplify(plan: &mut Plan, tolerance: f64) {
    for stroke in &mut plan.strokes {
        stroke.points = simplified(&stroke.points, tolerance);
    }
}

fn simplified(points: &[Point], tolerance: f64) -> Vec<Point> {
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut is_kept = vec![false; points.len()];
    for end in [0, last] {
        is_kept[end] = true;
    }
    let mut ranges = vec![(0, last)];
    while let Some((from, to)) = ranges.pop() {
        let mut farthest = (tolerance, None);
        for (index, point) in points.iter().enumerate().take(to).skip(from + 1) {
            let distance = to_line(*point, points[from], points[to]);
            if distance > farthest.0 {
                farthest = (distance, Some(index));
            }
        }
        if let (_, Some(index)) = farthest {
            is_kept[index] = true;
            ranges.extend([(from, index), (index, to)]);
        }
    }
    points.iter().zip(is_kept).filter(|(_, is_kept)| *is_kept).map(|(point, _)| *point).collect()
}

/// The distance of a point from the line between two others.
pub(super) fn to_line(point: Point, from: Point, to: Point) -> f64 {
    let direction = [to[0] - from[0], to[1] - from[1]];
    let offset = [point[0] - from[0], point[1] - from[1]];
    let square = direction[0] * direction[0] + direction[1] * direction[1];
    let part = if square > 0.0 {
        (offset[0] * direction[0] + offset[1] * direction[1]) / square
    } else {
        0.0
    };
    let part = part.clamp(0.0, 1.0);
    (offset[0] - part * direction[0]).hypot(offset[1] - part * direction[1])
}
