//! How fast a curve that comes as many short blocks may be passed.
//!
//! The points lie on the grid of steps, so two short blocks say nothing about the curve that they
//! are part of: the angle between them is mostly rounding. Circles through three points further
//! apart say more. So each level of [`Curvature`] looks at every 2nd, 4th, 8th … point. The height
//! of the middle point over the chord of the outer two counts less what rounding can explain;
//! the narrowest of the circles that remain is the curve's.
//!
//! A tight bend is over before points are so far apart that rounding no longer matters. There the
//! turn between the two chords, more than 21°, says that it is one, so no more than a quarter of
//! what rounding can explain is counted less. Such a circle stands for all of its arc and for one
//! more stride on both sides: wherever the bend begins, between its beginning and the first circle
//! that lies in it are less points than that. Beside a line much longer than the chords, a curve
//! begins or ends, so no circle joins the two ([`Curvature::restart`]).

use super::{Limits, Lookahead, PathLength};
use crate::drawing::PagePoint;

/// The last level looks at every 64th point.
const LEVELS: usize = 6;

/// Units of 2^-12 mm: a step is at least one, a page at most 2^26.
const FRACTION_BITS: u32 = 12;

/// A bend is tight while the height of its middle over a chord is less than so many times what
/// rounding can explain.
const TIGHT_HEIGHT: u64 = 24;

#[derive(Debug, Clone, Copy, Default)]
struct PathPoint {
    x: i32,
    y: i32,
}

/// Every so many points of the path.
#[derive(Debug, Clone, Copy, Default)]
struct Level {
    /// The last two points looked at, the later first.
    points: [PathPoint; 2],
    /// The last circle.
    circle: Circle,
}

/// What a circle through three points says of the curve.
#[derive(Debug, Clone, Copy, Default)]
struct Circle {
    /// Half its radius; 0 if it slows nothing.
    limit: PathLength,
    /// Whether it is that of a tight bend.
    is_tight: bool,
}

/// The path since the last sharp corner, as far as it matters.
#[derive(Debug, Default)]
pub(super) struct Curvature {
    levels: [Level; LEVELS],
    /// Points since the corner.
    count: u32,
}

impl Curvature {
    /// The path stops, turns sharply, or passes from chords to a much longer line at `point`, the
    /// end of the last block of `blocks`: the curve so far is complete, the next begins.
    pub(super) fn restart(
        &mut self,
        limits: &Limits,
        point: PagePoint,
        blocks: &mut Lookahead<'_>,
    ) {
        for (number, level) in (1u32..).zip(&self.levels) {
            let stride = 1 << number;
            if level.circle.limit > 0 {
                blocks.limit_curve(1, stride / 2 + self.count % stride, level.circle.limit);
            }
        }
        blocks.end_curve();
        self.count = 0;
        let points = [path_point(limits, point); 2];
        self.levels = [Level { points, circle: Circle::default() }; LEVELS];
    }

    /// The path goes on to `point`, the end of the last block of `blocks`. Limits the blocks that
    /// lie on too narrow a curve.
    // Where each chord is pushed: elsewhere it would drive that out of the Pico's cache. The
    // LM3S6965 has none, and no flash for two of it.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    #[cfg_attr(feature = "lm3s6965", inline(never))]
    pub(super) fn extend(&mut self, limits: &Limits, point: PagePoint, blocks: &mut Lookahead<'_>) {
        let latest = path_point(limits, point);
        self.count = self.count.wrapping_add(1);
        for (number, level) in (1u32..).zip(self.levels.iter_mut()) {
            let stride = 1 << number;
            if !self.count.is_multiple_of(stride) {
                return;
            }
            let [middle, first] = level.points;
            level.points = [latest, middle];
            if self.count < 2 * stride {
                continue;
            }
            let before =
                core::mem::replace(&mut level.circle, circle(limits, first, middle, latest));
            let Circle { mut limit, is_tight } = level.circle;
            let (mut least, mut most) = (1, stride);
            if before.is_tight && (limit == 0 || limit > before.limit) {
                limit = before.limit;
            }
            if is_tight {
                most = (3 * stride).min(self.count);
            } else if !before.is_tight {
                // The circle spans the last two strides. It stands for the middle half, and for the
                // beginning of the curve.
                let half = if self.count == 2 * stride { stride } else { stride / 2 };
                (least, most) = (stride / 2 + 1, stride + half);
            }
            if limit > 0 {
                blocks.limit_curve(least, most, limit);
            }
        }
    }
}

fn path_point(limits: &Limits, point: PagePoint) -> PathPoint {
    let [step_x, step_y] = limits.step_length;
    let along = |steps: i32, step: u32| {
        // Steps within ±2^21 of less than 2^-1 mm; clamped where no page reaches.
        let bits = (i64::from(steps) * i64::from(step)) >> (32 - FRACTION_BITS);
        bits.clamp(-(1 << 26), 1 << 26) as i32
    };
    PathPoint { x: along(point.x, step_x.to_bits()), y: along(point.y, step_y.to_bits()) }
}

/// The circle through three points.
#[inline(always)] // As above.
fn circle(limits: &Limits, first: PathPoint, middle: PathPoint, last: PathPoint) -> Circle {
    // Within ±2^28, so products of two stay below 2^57.
    let (ax, ay) = (middle.x - first.x, middle.y - first.y);
    let (bx, by) = (last.x - middle.x, last.y - middle.y);
    let (cx, cy) = (last.x - first.x, last.y - first.y);
    let twice_area = (i64::from(ax) * i64::from(by) - i64::from(ay) * i64::from(bx)).unsigned_abs();
    let top = u64::from(limits.top.to_bits() >> (PathLength::FRAC_NBITS - FRACTION_BITS));
    // r = abc / 2·(twice the area), and each length is at least its greater part, and 11/16 of
    // both: most circles are wide, and known to be without a root.
    let least = |x: i32, y: i32| {
        let (x, y) = (x.unsigned_abs(), y.unsigned_abs());
        let sum = x + y;
        u64::from(x.max(y).max((sum >> 1) + (sum >> 3) + (sum >> 4)))
    };
    let c = least(cx, cy);
    let rounding = u64::from(limits.rounding.to_bits() >> (PathLength::FRAC_NBITS - FRACTION_BITS));
    // The height over the chord is that of rounding.
    if twice_area < (rounding + 1) * c {
        return Circle::default();
    }
    let ab = least(ax, ay) * least(bx, by);
    // To 32 bits; `c` is below 2^29, `top` below 2^26.
    let shift = 32u32.saturating_sub((ab | twice_area).leading_zeros());
    if (ab >> shift) * c >= 4 * (twice_area >> shift) * top {
        return Circle::default();
    }
    let squared = |x: i32, y: i32| {
        let square = |part: i32| u64::from(part.unsigned_abs()) * u64::from(part.unsigned_abs());
        square(x) + square(y)
    };
    let (a, b, c) = (squared(ax, ay), squared(bx, by), squared(cx, cy));
    // Turned so far that the chord says nothing about one curve: c below 15/16 of a or b.
    if 256 * c < 225 * a.max(b) {
        return Circle::default();
    }
    // Twice the product of the two legs' lengths and the cosine of the turn between them.
    let along = c.cast_signed() - a.cast_signed() - b.cast_signed();
    let across = 2 * twice_area.cast_signed();
    let (a, b, c) = (a.isqrt(), b.isqrt(), c.isqrt());
    let height = twice_area.checked_div(c).unwrap_or(0);
    let is_low = height < TIGHT_HEIGHT * rounding;
    if !is_low && across > 2 * along {
        // By more than 63°: points nearer to each other say what it is.
        return Circle::default();
    }
    // By more than 21°.
    let is_tight = is_low && 8 * across >= 3 * along;
    let height = height.saturating_sub(if is_tight { rounding / 4 } else { rounding });
    let limit = match (a * b).checked_div(4 * height) {
        Some(half_radius) if half_radius < top => {
            let bits = half_radius << (PathLength::FRAC_NBITS - FRACTION_BITS);
            PathLength::from_bits(u32::try_from(bits).unwrap_or(u32::MAX).max(1))
        }
        _ => return Circle::default(),
    };
    Circle { limit, is_tight }
}
