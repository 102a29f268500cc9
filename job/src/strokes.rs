//! The strokes of a job, as a plotter will draw them.

use crate::path::PagePoint;
use penup::machine::{Path, Target};

/// What the pen draws between lowering and raising.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// The pen, counted from 1.
    pub pen: u8,
    /// The points in drawing order, in mm on the page.
    pub points: Vec<PagePoint>,
}

/// Reads the strokes of `path`, whose unit is the motor step; there are `steps` of them in a mm of
/// x and of y.
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
