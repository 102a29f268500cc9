//! Cuts strokes off at the border of a rectangle.

use super::Crop;
use crate::page::Page;
use crate::plan::{Plan, Point, Stroke};

impl Crop {
    /// The rectangle beyond which all is cut off: its least and greatest x and y in mm.
    ///
    /// # Errors
    /// The margins leave nothing of the page.
    pub(super) fn rectangle(self, page: Page, margin: f64) -> Result<[Point; 2], String> {
        match self {
            Self::Rectangle(corners) => Ok(corners),
            Self::Page => {
                let high = [page.width - margin, page.height - margin];
                if high.iter().any(|&high| high <= margin) {
                    return Err("the margins leave nothing of the page to crop to".to_owned());
                }
                Ok([[margin, margin], high])
            }
        }
    }
}

/// Cuts off what is beyond the rectangle.
pub(super) fn crop(plan: &mut Plan, rectangle: [Point; 2]) {
    let strokes = std::mem::take(&mut plan.strokes);
    for stroke in strokes {
        let is_within = |point: &Point| {
            (0..2).all(|axis| (rectangle[0][axis]..=rectangle[1][axis]).contains(&point[axis]))
        };
        if stroke.points.iter().all(is_within) {
            plan.strokes.push(stroke);
            continue;
        }
        let mut parts: Vec<Vec<Point>> = Vec::new();
        for pair in stroke.points.windows(2) {
            let &[from, to] = pair else { continue };
            let Some([enter, leave]) = inside(from, to, rectangle) else { continue };
            match parts.last_mut() {
                // The stroke goes on where its last part within the rectangle ended.
                Some(part) if part.last() == Some(&enter) && enter == from => part.push(leave),
                _ => parts.push(vec![enter, leave]),
            }
        }
        // A closed stroke that begins inside goes on at its end where it began.
        if stroke.is_closed()
            && parts.len() > 1
            && parts.first().and_then(|part| part.first()) == stroke.points.first()
            && parts.last().and_then(|part| part.last()) == stroke.points.first()
            && let Some(mut last) = parts.pop()
        {
            let first = parts.remove(0);
            last.extend(first.into_iter().skip(1));
            parts.push(last);
        }
        let part = |points| Stroke { points, ..stroke.clone() };
        plan.strokes.extend(parts.into_iter().map(part));
    }
}

/// The part of the line between two points that is within the rectangle (Liang & Barsky 1984). Its
/// ends on the border are exactly there.
fn inside(from: Point, to: Point, rectangle: [Point; 2]) -> Option<[Point; 2]> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let (mut enters_at, mut leaves_at) = (None, None);
    for axis in 0..2 {
        let direction = to[axis] - from[axis];
        let [low, high] = [rectangle[0][axis], rectangle[1][axis]];
        if direction == 0.0 {
            if !(low..=high).contains(&from[axis]) {
                return None;
            }
            continue;
        }
        let (near, far) = if direction > 0.0 { (low, high) } else { (high, low) };
        let (begin, end) = ((near - from[axis]) / direction, (far - from[axis]) / direction);
        if begin > enter {
            (enter, enters_at) = (begin, Some((axis, near)));
        }
        if end < leave {
            (leave, leaves_at) = (end, Some((axis, far)));
        }
    }
    if enter >= leave {
        return None;
    }
    let at = |part: f64, border: Option<(usize, f64)>, whole: Point| {
        let Some((axis, value)) = border else { return whole };
        let mut point = [0, 1].map(|axis: usize| {
            let value = from[axis] + part * (to[axis] - from[axis]);
            value.clamp(rectangle[0][axis], rectangle[1][axis])
        });
        point[axis] = value;
        point
    };
    Some([at(enter, enters_at, from), at(leave, leaves_at, to)])
}

/// The outline of what is inside both `outline` and a convex area, which lies on the side of each
/// `(point, inward)` to which `inward` points (Sutherland & Hodgman 1974). Where the area cuts the
/// outline into parts, they hang together by sides along the border, which surround nothing.
#[cfg(feature = "svg")]
pub(crate) fn clip_outline(outline: &[Point], sides: &[(Point, Point)]) -> Vec<Point> {
    let mut points = outline.to_vec();
    for &(origin, inward) in sides {
        let height =
            |point: Point| (point[0] - origin[0]) * inward[0] + (point[1] - origin[1]) * inward[1];
        let Some(mut from) = points.last().copied() else { break };
        let mut kept = Vec::with_capacity(points.len());
        for to in points {
            let (before, after) = (height(from), height(to));
            if (before < 0.0) != (after < 0.0) {
                let part = before / (before - after);
                kept.push([0, 1].map(|axis: usize| from[axis] + part * (to[axis] - from[axis])));
            }
            if after >= 0.0 {
                kept.push(to);
            }
            from = to;
        }
        points = kept;
    }
    points
}
