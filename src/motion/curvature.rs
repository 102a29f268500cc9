//! Determines how fast a curve may be passed that consists of many short blocks.
//!
//! The points lie on the grid of steps, so two short blocks tell nothing about the curve that they
//! are part of: the angle between them is mostly rounding. Circles through three points that are
//! further apart tell more. So each level of [`Curvature`] examines every 2nd, 4th, 8th … point.
//! The height of the middle point over the chord of the outer two is reduced by what rounding can
//! explain, and the narrowest of the circles that result is that of the curve.
//!
//! A tight bend ends before points are so far apart that rounding no longer matters. There the
//! angle between the two chords, more than 21°, proves that it is a bend, so the height is reduced
//! by only a quarter of what rounding can explain. Such a circle is valid for its whole arc and for
//! one more stride on both sides, because there are fewer points than that between the beginning of
//! the bend and the first circle that lies within it. But where smaller strides have found a bend
//! at most half as wide in it, they know better where that begins and ends: the circle only blurs
//! it, and is valid for its own arc alone. (Otherwise it would slow the machine far from the bend,
//! and come too late for that.) Beside a line much longer than the chords, a curve begins or ends,
//! so no circle joins the two ([`Curvature::restart`]).

use super::{Limits, Lookahead, PathLength};
use crate::drawing::PagePoint;

/// The number of levels. The last one examines every 64th point.
const LEVELS: usize = 6;

/// Coordinates are in units of 2^-12 mm: a step is at least one unit, and a page at most 2^26.
const FRACTION_BITS: u32 = 12;

/// A bend counts as tight while the height of its middle over a chord is less than this many times
/// what rounding can explain.
const TIGHT_HEIGHT: u64 = 24;

/// A point of the path, in units of 2^-12 mm.
#[derive(Debug, Clone, Copy, Default)]
struct PathPoint {
    x: i32,
    y: i32,
}

/// The points of the path at one stride.
#[derive(Debug, Clone, Copy, Default)]
struct Level {
    /// The last two points examined, the later one first.
    points: [PathPoint; 2],
    /// The last circle.
    circle: Circle,
    /// The lowest limits of tight bends that smaller strides have found: since that circle, and
    /// since the one before it.
    found: [PathLength; 2],
}

/// The limit that results from a circle through three points.
#[derive(Debug, Clone, Copy, Default)]
struct Circle {
    /// Half the radius of the circle, which is the greatest stopping distance; 0 if it limits
    /// nothing.
    limit: PathLength,
    /// Whether the circle is that of a tight bend, and is valid beside its arc, too.
    is_tight: bool,
}

/// What must be known of the path since the last sharp corner to find circles through its points.
#[derive(Debug, Default)]
pub(super) struct Curvature {
    levels: [Level; LEVELS],
    /// The number of points since the corner.
    count: u32,
}

impl Curvature {
    /// Ends the curve at `point`, the end of the last block of `blocks`, and begins the next one.
    /// There the path stops, turns sharply, or passes from chords to a much longer line.
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
        let found = [PathLength::MAX; 2];
        self.levels = [Level { points, circle: Circle::default(), found }; LEVELS];
    }

    /// Extends the path to `point`, the end of the last block of `blocks`, and limits the blocks
    /// that lie on a narrow curve.
    // Inlined where each chord is pushed, because elsewhere it would drive that code out of the
    // Pico's cache. The LM3S6965 has no cache, and no flash for two copies.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    #[cfg_attr(feature = "lm3s6965", inline(never))]
    pub(super) fn extend(&mut self, limits: &Limits, point: PagePoint, blocks: &mut Lookahead<'_>) {
        let latest = path_point(limits, point);
        self.count = self.count.wrapping_add(1);
        let mut found = PathLength::MAX;
        for (number, level) in (1u32..).zip(self.levels.iter_mut()) {
            let stride = 1 << number;
            level.found[0] = level.found[0].min(found);
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
            let [now, earlier] = level.found;
            let known = now.min(earlier);
            level.found = [PathLength::MAX, now];
            let Circle { mut limit, is_tight } = level.circle;
            found = found.min(known);
            let is_known = known <= limit / 2;
            if is_tight {
                found = found.min(limit);
                level.circle.is_tight = !is_known;
            }
            let (mut least, mut most) = (1, stride);
            if before.is_tight && (limit == 0 || limit > before.limit) {
                limit = before.limit;
            }
            if is_tight {
                most = ((if is_known { 2 } else { 3 }) * stride).min(self.count);
            } else if !before.is_tight {
                // The circle spans the last two strides. It is valid for the middle half, and for
                // the beginning of the curve.
                let half = if self.count == 2 * stride { stride } else { stride / 2 };
                (least, most) = (stride / 2 + 1, stride + half);
            }
            if limit > 0 {
                blocks.limit_curve(least, most, limit);
            }
        }
    }
}

/// Converts a point from steps.
fn path_point(limits: &Limits, point: PagePoint) -> PathPoint {
    let [step_x, step_y] = limits.step_length;
    let along = |steps: i32, step: u32| {
        // Coordinates are within ±2^21 steps of less than 2^-1 mm. They are clamped beyond the size
        // of any page.
        let bits = (i64::from(steps) * i64::from(step)) >> (32 - FRACTION_BITS);
        bits.clamp(-(1 << 26), 1 << 26) as i32
    };
    PathPoint { x: along(point.x, step_x.to_bits()), y: along(point.y, step_y.to_bits()) }
}

/// Computes the limit that results from the circle through three points.
// For the same reason as `extend`.
#[cfg_attr(not(feature = "lm3s6965"), inline(always))]
fn circle(limits: &Limits, first: PathPoint, middle: PathPoint, last: PathPoint) -> Circle {
    // All differences are within ±2^28, so products of two stay below 2^57.
    let (ax, ay) = (middle.x - first.x, middle.y - first.y);
    let (bx, by) = (last.x - middle.x, last.y - middle.y);
    let (cx, cy) = (last.x - first.x, last.y - first.y);
    let twice_area = (i64::from(ax) * i64::from(by) - i64::from(ay) * i64::from(bx)).unsigned_abs();
    let top = u64::from(limits.top.to_bits() >> (PathLength::FRAC_NBITS - FRACTION_BITS));
    // The radius is abc / 2·(twice the area). Each length is at least its greater component, and at
    // least 11/16 of the sum of both. That suffices to recognize most circles as wide without a
    // square root.
    let least = |x: i32, y: i32| {
        let (x, y) = (x.unsigned_abs(), y.unsigned_abs());
        let sum = x + y;
        u64::from(x.max(y).max((sum >> 1) + (sum >> 3) + (sum >> 4)))
    };
    let c = least(cx, cy);
    let rounding = u64::from(limits.rounding.to_bits() >> (PathLength::FRAC_NBITS - FRACTION_BITS));
    // Rounding alone can explain the height over the chord.
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
    // The path turns so far (c below 15/16 of a or b) that the three points are not on one curve.
    if 256 * c < 225 * a.max(b) {
        return Circle::default();
    }
    // Twice the product of the two legs' lengths and the cosine of the turn between them.
    let along = c.cast_signed() - a.cast_signed() - b.cast_signed();
    let across = 2 * twice_area.cast_signed();
    let (a, b, c) = (a.isqrt(), b.isqrt(), c.isqrt());
    let height = twice_area.checked_div(c).unwrap_or(0);
    // The same question as at first, now of the length itself.
    if height <= rounding {
        return Circle::default();
    }
    let is_low = height < TIGHT_HEIGHT * rounding;
    if !is_low && across > 2 * along {
        // The path turns by more than 63°, so points nearer to each other determine the curve.
        return Circle::default();
    }
    // The path turns by more than 21°.
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
