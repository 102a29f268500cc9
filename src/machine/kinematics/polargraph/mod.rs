//! A polargraph: the pen hangs on two belts, and the position of each motor is the length of its
//! belt, in steps. The steps per millimetre of x apply to both belts.
//!
//! A straight line of the page is not straight for the motors. So it is cut into segments
//! ([`CutPositions`]), and the ends of each segment are computed from the exact line.

mod cut_positions;

pub use cut_positions::CutPositions;

use super::{HomingSpace, Properties, SegmentEnd};
use crate::array::MapEach;
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::machine::{Setting, Settings, Value};
use crate::motion::LimitsError;
use crate::step::Line;

/// The properties that distinguish a polargraph from the other kinds.
pub(super) const PROPERTIES: Properties = Properties {
    steps_per_mm: [Setting::StepsPerMmX; 2],
    // A belt never moves faster than the pen, but its length may change much more slowly.
    motor_ratio: Value::ONE,
    longest_step: 8,
    // The belts cannot hold the pen above their anchors.
    is_limited: true,
    homing_space: HomingSpace::Motors,
    homing_travel: [Setting::AnchorWidth; 2],
    homed_length: Some(Setting::HomedBelt),
};

/// The least number of fraction bits of a step with which a line on a polargraph is computed. The
/// greatest polargraph that the settings allow leaves room for this many.
const LEAST_BITS: u32 = 8;
/// The greatest number of fraction bits of a step with which a line is computed. More would not
/// change the result.
const MOST_BITS: u32 = 14;

/// The most steps from an anchor to the other one, and to the page's origin along each axis.
const FARTHEST: i32 = 2 * PAGE_LIMIT;

/// Where the belts of a polargraph leave their motors. Both anchors are at the same height, above
/// the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Anchors {
    /// The left anchor, in steps from the page's origin; each coordinate is within ±2^21.
    pub left: PagePoint,
    /// The distance from the left anchor to the right one, in steps: 1 to 2^21.
    pub width: i32,
}

/// Checks whether the page lies below the anchors, and the anchors within the range of steps.
///
/// # Errors
/// [`LimitsError::Anchors`] if it reaches up to them.
pub(super) fn check(settings: &Settings) -> Result<(), LimitsError> {
    #[cfg(feature = "spread-backlash")]
    if settings.is_on(Setting::BacklashDistance) {
        return Err(LimitsError::BacklashOfBelts);
    }
    let anchors = [Setting::AnchorWidth, Setting::AnchorLeft, Setting::AnchorHeight];
    let is_near =
        |setting| settings.millimetres_as_steps(setting, Setting::StepsPerMmX).abs() <= FARTHEST;
    let is_above = settings.get(Setting::AnchorHeight) > settings.get(Setting::TravelY);
    if is_above && anchors.into_iter().all(is_near) { Ok(()) } else { Err(LimitsError::Anchors) }
}

impl Anchors {
    /// Returns the anchors that the settings describe, in steps.
    pub(super) fn of(settings: &Settings) -> Self {
        let steps =
            |setting| settings.millimetres_as_steps(setting, Setting::StepsPerMmX).min(FARTHEST);
        Self {
            left: PagePoint { x: -steps(Setting::AnchorLeft), y: steps(Setting::AnchorHeight) },
            width: steps(Setting::AnchorWidth),
        }
    }

    /// The lengths of the belts, in steps, for a position on the page below the anchors.
    pub(super) fn belts(self, page: PagePoint) -> PagePoint {
        let (x, y) = (page.x - self.left.x, self.left.y - page.y);
        PagePoint { x: length_of(x, y), y: length_of(self.width - x, y) }
    }

    /// The most steps that each belt has on a page of this `width`: at one of its lower corners.
    pub(in crate::machine) fn longest_belts(self, width: i32) -> [i32; 2] {
        let [at_left, at_right] = [0, width].map_each(|x| self.belts(PagePoint { x, y: 0 }));
        [at_left.x.max(at_right.x), at_left.y.max(at_right.y)]
    }

    /// The position on the page for lengths of the belts in steps, rounded to the nearest step.
    pub(super) fn page(self, belts: PagePoint) -> PagePoint {
        let Self { left, width } = self;
        let square = |steps: i32| i64::from(steps) * i64::from(steps);
        let [a, b, w] = [belts.x, belts.y, width].map_each(square);
        // Belts have up to 2^23 steps, so the squares are at most 2^46.
        let twice = 2 * i64::from(width).max(1);
        let doubled = a - b + w + twice / 2;
        // `twice` is not 0. Division rounds towards 0, and this is to round down.
        let toward_zero = doubled.checked_div(twice).unwrap_or(0);
        let x = toward_zero - i64::from(toward_zero * twice > doubled);
        let down = (a - x * x).max(0).unsigned_abs();
        PagePoint { x: left.x + x as i32, y: left.y - rounded_root(down) }
    }

    /// The end of the segment of the line between two points of the page. The segment reaches from
    /// one to the other of two `positions` along the line, in units in which the whole line is
    /// `length` long. `begin` is the position of the motors at the end of the previous segment,
    /// where this segment begins.
    ///
    /// Everything is computed from the lesser end of the line, so a line drawn backward has the
    /// same points.
    pub(in crate::machine) fn segment_end(
        self,
        ends: [PagePoint; 2],
        positions: [u32; 2],
        length: u32,
        begin: PagePoint,
    ) -> SegmentEnd {
        let to = ends[1];
        let (ends, backward) = in_order(ends);
        let line = FineLine::new(self, ends);
        let [start, end] = positions.map_each(|position| {
            line.at(if backward { length.saturating_sub(position) } else { position }, length)
        });
        let motors = if positions[1] >= length {
            self.belts(to)
        } else {
            let [x, y] = end.rates;
            let major = usize::from(x.abs() <= y.abs());
            let steps = rounded(end.belts[major], line.bits);
            let others = rounded(line.other_belt(end, steps, major), line.bits);
            let [x, y] = if major == 0 { [steps, others] } else { [others, steps] };
            PagePoint { x, y }
        };
        const GREATEST: i32 = Line::GREATEST_OFFSET as i32;
        let major = usize::from((motors.x - begin.x).abs() <= (motors.y - begin.y).abs());
        let offsets = [(start, begin), (end, motors)].map_each(|(exact, PagePoint { x, y })| {
            let (steps, others) = if major == 0 { (x, y) } else { (y, x) };
            // At the ends of a line the lengths of both belts are rounded, so the offset may be
            // more than half a step.
            let step = 1 << line.bits;
            let offset = line.other_belt(exact, steps, major) - (others << line.bits);
            let units = offset.min(step).max(-step) * Line::OFFSET_UNIT;
            rounded(units, line.bits).clamp(-GREATEST, GREATEST) as i16
        });
        let [x, down] = end.position.map_each(|fine| rounded(fine, line.bits));
        let page = PagePoint { x: self.left.x + x, y: self.left.y - down };
        SegmentEnd { motors, page, offsets }
    }
}

/// Returns the ends of a line with the lesser one first, and whether this reverses the line.
fn in_order([a, b]: [PagePoint; 2]) -> ([PagePoint; 2], bool) {
    let backward = (b.x, b.y) < (a.x, a.y);
    (if backward { [b, a] } else { [a, b] }, backward)
}

/// A line on the page of a polargraph, in units of 2^-`bits` steps. Coordinates count from the left
/// anchor, to the right and downward.
struct FineLine {
    /// The number of fraction bits: the unit of the line is 2^-`bits` steps.
    bits: u32,
    /// The start of the line, to the right of the left anchor and below it.
    from: [i32; 2],
    /// The vector from the start of the line to its end.
    delta: [i32; 2],
    /// The distance between the two anchors, where the belts leave the motors.
    width: i32,
    /// The direction of the line: `delta`, scaled up as far as 32 bits allow.
    direction: [i32; 2],
}

/// A point on a [`FineLine`].
#[derive(Clone, Copy)]
struct FinePoint {
    /// The coordinates of the point, to the right of the left anchor and below it.
    position: [i32; 2],
    /// The lengths of both belts, in units of 2^-`bits` steps.
    belts: [i32; 2],
    /// The rates at which the belt lengths change along the line. Only their ratio matters.
    rates: [i32; 2],
}

impl FineLine {
    /// Makes the line between two points of the page, with as many fraction bits as 32-bit numbers
    /// leave room for.
    fn new(Anchors { left, width }: Anchors, ends: [PagePoint; 2]) -> Self {
        let [from, to] = ends.map_each(|end| [end.x - left.x, left.y - end.y]);
        let greatest = [from, to].map_each(|[x, y]| x.abs().max((width - x).abs()).max(y.abs()));
        // The greatest coordinate is below 2^22, so everything stays below 2^30.
        let bits = (greatest[0].max(greatest[1]) | 1).leading_zeros() - 2;
        let bits = bits.clamp(LEAST_BITS, MOST_BITS);
        let delta = [to[0] - from[0], to[1] - from[1]];
        // The components are below 2^21.
        let longer = (delta[0].abs().max(delta[1].abs()) | 1).leading_zeros().saturating_sub(10);
        let direction = delta.map_each(|delta| delta << longer);
        let [from, delta] = [from, delta].map_each(|vector| vector.map_each(|steps| steps << bits));
        Self { bits, from, delta, width: width << bits, direction }
    }

    /// Returns the point on the line that divides it as `done` divides `length`.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn at(&self, done: u32, length: u32) -> FinePoint {
        let along = |axis: usize| {
            // The product is below 2^62.
            let delta = i64::from(self.delta[axis]) * i64::from(done);
            self.from[axis] + delta.checked_div(length.into()).unwrap_or(0) as i32
        };
        let position @ [x, y] = [along(0), along(1)];
        let from_anchors = [x, x - self.width];
        let belts = from_anchors.map_each(|x| length_of(x, y));
        let rate = |belt: usize| {
            // The sum is below 2^54.
            let [right, down] = self.direction.map_each(i64::from);
            let product = i64::from(from_anchors[belt]) * right + i64::from(y) * down;
            // The quotient is below 2^23, as the direction is.
            product.checked_div(belts[belt].into()).unwrap_or(0) as i32
        };
        FinePoint { position, belts, rates: [rate(0), rate(1)] }
    }

    /// The length of the other belt at the point near `point` where belt `major` is `steps` steps
    /// long. The result is in units of 2^-`bits` steps.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn other_belt(&self, point: FinePoint, steps: i32, major: usize) -> i32 {
        let major_first = |[first, second]: [i32; 2]| {
            if major == 0 { [first, second] } else { [second, first] }
        };
        let [belt, other] = major_first(point.belts);
        let [rate, other_rate] = major_first(point.rates);
        let change = i64::from((steps << self.bits) - belt) * i64::from(other_rate);
        // The extrapolation covers a step or two, unless the belt lengths hardly change.
        let change = change.checked_div(rate.into()).unwrap_or(0);
        other.saturating_add(change as i32)
    }
}

/// Returns √(x² + y²), rounded to the nearest integer: the length of a belt.
#[inline(never)] // Inlining it at every call would cost too much flash.
fn length_of(x: i32, y: i32) -> i32 {
    let square = |steps: i32| i64::from(steps).unsigned_abs() * i64::from(steps).unsigned_abs();
    rounded_root(square(x) + square(y))
}

/// Rounds a number in units of 2^-`bits` to the nearest integer; `bits` is at least 1.
fn rounded(fine: i32, bits: u32) -> i32 {
    (fine + (1 << (bits - 1))) >> bits
}

/// The square root of a number below 2^62, rounded to the nearest integer.
fn rounded_root(squared: u64) -> i32 {
    (4 * squared).isqrt().div_ceil(2) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Kinematics;

    #[test]
    fn a_polargraph_knows_its_page() {
        let anchors = Anchors { left: PagePoint { x: -15_000, y: 60_000 }, width: 64_000 };
        let polargraph = Kinematics::Polargraph(anchors);
        for x in (0..34_000).step_by(1711) {
            for y in (0..42_000).step_by(2213) {
                let page = PagePoint { x, y };
                let again = polargraph.page(polargraph.motors(page));
                assert!(again.x.abs_diff(x) <= 2 && again.y.abs_diff(y) <= 2, "{page:?} {again:?}");
            }
        }
    }
}
