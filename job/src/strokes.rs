//! The strokes of a job, as a plotter will draw them.

use crate::path::{PagePoint, Run};
use crate::straight::{TOLERANCE, straightened};
use penup::drawing::LineType;
use penup::machine::{Path, Target};
use penup::step::Pattern;

/// What the pen draws between lowering and raising.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// The pen, counted from 1.
    pub pen: u8,
    /// The points in drawing order, in mm on the page.
    pub points: Vec<PagePoint>,
}

/// Reads the strokes of `path`, whose unit is the motor step; there are `steps` of them in a mm of
/// x and of y. If the pen returns to where it began, the last one is that single point.
pub fn strokes_of(path: &mut dyn Path, steps: [f64; 2]) -> Vec<Stroke> {
    let mut strokes: Vec<Stroke> = Vec::new();
    while let Some(Target { point, ink }) = path.next_target() {
        let point = [f64::from(point.x) / steps[0], f64::from(point.y) / steps[1]];
        let pen = path.pen() + 1;
        match (ink, strokes.last_mut()) {
            (Some(_), Some(stroke)) if stroke.pen == pen => stroke.points.push(point),
            // Another pen continues where the last one ended.
            (Some(_), Some(stroke)) => {
                let from = stroke.points.last().copied().unwrap_or(point);
                strokes.push(Stroke { pen, points: vec![from, point] });
            }
            _ => strokes.push(Stroke { pen, points: vec![point] }),
        }
    }
    strokes
}

/// Whether several pens draw `path`, which is read to its end. The strokes of a pen follow each
/// other.
pub fn has_several_pens(path: &mut dyn Path) -> bool {
    let first = path.next_target().map(|_| path.pen());
    while path.next_target().is_some() {}
    first.is_some_and(|first| first != path.pen())
}

/// The units of a length in a millimetre, in which dots and gaps are cut.
const LENGTH_UNITS: f64 = (1 << 18) as f64;

/// Reads the lines that the pen draws without being lifted: as [`strokes_of`], but each dot and
/// each dash is a line of its own, and so is the single point to which the pen returns. Dots are
/// about `dot` mm long.
pub fn dashes_of(path: &mut dyn Path, steps: [f64; 2], dot: f64) -> Vec<Stroke> {
    let mut lines: Vec<Stroke> = Vec::new();
    let mut from = [0.0; 2];
    while let Some(Target { point, ink }) = path.next_target() {
        let to = [f64::from(point.x) / steps[0], f64::from(point.y) / steps[1]];
        let pen = path.pen() + 1;
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        let units = (x.hypot(y) * LENGTH_UNITS).round() as u32;
        let pattern = match ink {
            None => {
                lines.push(Stroke { pen, points: vec![to] });
                from = to;
                continue;
            }
            Some(LineType::Full) => Pattern::full(units),
            Some(line_type) => Pattern::of(line_type, units, (dot * LENGTH_UNITS) as u32),
        };
        let last = pattern.pieces() - 1;
        let position = |end: u32| match units {
            0 => to,
            _ if end == units => to,
            _ => [0, 1].map(|axis| from[axis] + [x, y][axis] * f64::from(end) / f64::from(units)),
        };
        for piece in (0..=last).filter(|piece| Pattern::inked(*piece)) {
            let end = position(pattern.end_of(piece));
            match lines.last_mut() {
                // The first dash goes on with the line before, if no other pen drew that.
                Some(line) if piece == 0 && line.pen == pen => line.points.push(end),
                _ => {
                    let begin =
                        piece.checked_sub(1).map_or(from, |gap| position(pattern.end_of(gap)));
                    lines.push(Stroke { pen, points: vec![begin, end] });
                }
            }
        }
        from = to;
    }
    lines
}

/// The path of the pen that `strokes` describe, from the origin on, with steps of `step` mm.
pub fn runs_of(strokes: Vec<Stroke>, step: f64) -> Vec<Run> {
    let (mut runs, mut at, mut last_pen) = (Vec::new(), [0.0; 2], 1);
    for Stroke { pen, points } in strokes {
        let begin: PagePoint = points.first().copied().unwrap_or(at);
        let end = points.last().copied().unwrap_or(begin);
        runs.push(Run { pen_down: false, pen: last_pen, points: vec![at, begin] });
        // A single point is where the pen returns to.
        if points.len() > 1 {
            let points = straightened(&points, TOLERANCE * step);
            runs.push(Run { pen_down: true, pen, points });
        }
        (at, last_pen) = (end, pen);
    }
    runs
}
