//! Where the strokes of a drawing begin and end: a closed stroke may go on along its beginning, and
//! an open one begin early and end late. Ink that starts late or thin is covered that way.

use super::{Machine, Setting};
use crate::drawing::PagePoint;
use crate::motion::{Limits, PathLength};

/// By how much strokes are longer than they are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StrokeEnds {
    /// The limits of motion, which know how long a step is.
    limits: Limits,
    /// By how much a closed stroke goes on beyond its end.
    pub overlap: PathLength,
    /// How far before its first point an open stroke begins.
    pub lead: PathLength,
    /// How far behind its last point it ends.
    pub trail: PathLength,
}

impl StrokeEnds {
    /// The length of a line; `None` beyond 16 m.
    pub fn length(&self, from: PagePoint, to: PagePoint) -> Option<PathLength> {
        self.limits.length(to.x.wrapping_sub(from.x), to.y.wrapping_sub(from.y))
    }

    /// The point on the line from `from` to `to`, or beyond it, that is `length` away from `start`,
    /// an end of the line: in its direction. `start` itself if the line has no length.
    pub fn along(
        &self,
        [from, to]: [PagePoint; 2],
        start: PagePoint,
        length: PathLength,
    ) -> PagePoint {
        let whole = self.length(from, to).map_or(0, |length| i64::from(length.to_bits()));
        let part = |from: i32, to: i32| {
            // The product of less than 2^22 steps and a length below 2^22 (10 mm) fits. The
            // quotient is rounded half away from zero.
            let product = 2 * i64::from(to.wrapping_sub(from)) * i64::from(length.to_bits());
            let rounded = (product + product.signum() * whole).checked_div(2 * whole);
            rounded.unwrap_or(0) as i32
        };
        PagePoint {
            x: start.x.saturating_add(part(from.x, to.x)),
            y: start.y.saturating_add(part(from.y, to.y)),
        }
    }
}

impl Machine<'_> {
    /// By how much the strokes of a drawing are made longer; `None` if by nothing.
    pub fn stroke_ends(&self) -> Option<StrokeEnds> {
        // A unit of the settings, which are not negative, is four units of a length.
        let length = |setting| {
            let bits = self.settings.get(setting).to_bits().unsigned_abs();
            PathLength::from_bits(bits << 2)
        };
        let overlap = length(Setting::StrokeOverlap);
        let [lead, trail] = [length(Setting::StrokeLead), length(Setting::StrokeTrail)];
        if overlap == 0 && lead == 0 && trail == 0 {
            return None;
        }
        Some(StrokeEnds { limits: *self.runner.limits(), overlap, lead, trail })
    }
}
