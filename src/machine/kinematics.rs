//! Kinematics: converts between the position of the pen on the page and the positions of the two
//! motors.

use super::CutPositions;
use crate::drawing::PagePoint;
use crate::step::Line;

/// The kind of kinematics of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kinematics {
    /// One motor moves x, the other moves y.
    #[default]
    Cartesian,
    /// Two motors drive one belt: the first turns by x + y, the second by x - y.
    CoreXy,
    /// The pen hangs on two belts. The position of each motor is the length of its belt, in steps.
    Polargraph(Anchors),
}

/// The least and the most fraction bits of a step in which a line on a polargraph is computed. The
/// greatest polargraph that the settings allow leaves room for the least; more than the most would
/// not change the result.
const LEAST_BITS: u32 = 8;
const MOST_BITS: u32 = 14;

/// The end of a segment of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentEnd {
    /// The positions of the motors there, in steps.
    pub motors: PagePoint,
    /// The position on the page there, in steps.
    pub page: PagePoint,
    /// How far the exact start and the exact end of the segment lie beside the rounded motor
    /// positions: see [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i8; 2],
}

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

impl Kinematics {
    /// The motor positions, in steps, for a position on the page. On a polargraph the position must
    /// be below the anchors.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::machine::{Anchors, Kinematics};
    /// let place = PagePoint { x: 30, y: -4 };
    /// let motors = Kinematics::CoreXy.motors(place);
    /// assert_eq!(motors, PagePoint { x: 26, y: 34 });
    /// assert_eq!(Kinematics::CoreXy.page(motors), place);
    /// let anchors = Anchors { left: PagePoint { x: 0, y: 300 }, width: 800 };
    /// let polargraph = Kinematics::Polargraph(anchors);
    /// let belts = polargraph.motors(PagePoint { x: 400, y: 0 });
    /// assert_eq!(belts, PagePoint { x: 500, y: 500 });
    /// assert_eq!(polargraph.page(belts), PagePoint { x: 400, y: 0 });
    /// ```
    pub fn motors(self, page: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => page,
            Self::CoreXy => PagePoint { x: page.x + page.y, y: page.x - page.y },
            Self::Polargraph(Anchors { left, width }) => {
                let (x, y) = (page.x - left.x, left.y - page.y);
                PagePoint { x: length_of(x, y), y: length_of(width - x, y) }
            }
        }
    }

    /// The segment of a straight line on the page between two positions `places` along it, in units
    /// in which the whole line is `length` long. `begin` is the position of the motors at the end
    /// of the previous segment, where this segment begins.
    ///
    /// Everything is computed from the lesser end of the line, so a line drawn backward has the
    /// same points.
    pub fn piece(
        self,
        ends: [PagePoint; 2],
        places: [u32; 2],
        length: u32,
        begin: PagePoint,
    ) -> SegmentEnd {
        let to = ends[1];
        let Self::Polargraph(anchors) = self else {
            return SegmentEnd { motors: self.motors(to), page: to, offsets: [0; 2] };
        };
        let (ends, backward) = in_order(ends);
        let line = FineLine::new(anchors, ends);
        let [start, end] = places.map(|place| {
            line.at(if backward { length.saturating_sub(place) } else { place }, length)
        });
        let motors = if places[1] >= length {
            self.motors(to)
        } else {
            let [x, y] = end.ways;
            let more = usize::from(x.abs() <= y.abs());
            let steps = rounded(end.belts[more], line.bits);
            let others = rounded(line.beside(end, steps, more), line.bits);
            let [x, y] = if more == 0 { [steps, others] } else { [others, steps] };
            PagePoint { x, y }
        };
        let more = usize::from((motors.x - begin.x).abs() <= (motors.y - begin.y).abs());
        let offsets = [(start, begin), (end, motors)].map(|(place, PagePoint { x, y })| {
            let (steps, others) = if more == 0 { (x, y) } else { (y, x) };
            // At the ends of a line the lengths of both belts are rounded, so the offset may be
            // more than half a step.
            let step = 1 << line.bits;
            let beside = line.beside(place, steps, more) - (others << line.bits);
            let units = beside.clamp(-step, step) * Line::OFFSET_UNIT;
            rounded(units, line.bits).clamp(-127, 127) as i8
        });
        let [x, down] = end.place.map(|fine| rounded(fine, line.bits));
        let page = PagePoint { x: anchors.left.x + x, y: anchors.left.y - down };
        SegmentEnd { motors, page, offsets }
    }

    /// The position on the page for motor positions in steps. It is rounded where it lies between
    /// two steps.
    pub fn page(self, motors: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => motors,
            Self::CoreXy => PagePoint {
                x: (motors.x.wrapping_add(motors.y)) >> 1,
                y: (motors.x.wrapping_sub(motors.y)) >> 1,
            },
            Self::Polargraph(Anchors { left, width }) => {
                let square = |steps: i32| i64::from(steps) * i64::from(steps);
                let [a, b, w] = [motors.x, motors.y, width].map(square);
                // Belts have up to 2^23 steps, so the squares are at most 2^46.
                let twice = 2 * i64::from(width).max(1);
                let x = (a - b + w + twice / 2).div_euclid(twice);
                let down = (a - x * x).max(0).unsigned_abs();
                PagePoint { x: left.x + x as i32, y: left.y - rounded_root(down) }
            }
        }
    }

    /// Where a line on the page is cut into segments; `None` if the line is also straight for the
    /// motors.
    pub fn cuts(self, from: PagePoint, to: PagePoint) -> Option<CutPositions> {
        match self {
            Self::Polargraph(anchors) => Some(CutPositions::new(anchors, from, to)),
            Self::Cartesian | Self::CoreXy => None,
        }
    }
}

/// Returns the ends of a line with the lesser one first, and whether this reverses the line.
pub(super) fn in_order([a, b]: [PagePoint; 2]) -> ([PagePoint; 2], bool) {
    let backward = (b.x, b.y) < (a.x, a.y);
    (if backward { [b, a] } else { [a, b] }, backward)
}

/// A line on the page of a polargraph, in units of 2^-`bits` steps. Coordinates count from the left
/// anchor, to the right and downward.
struct FineLine {
    /// The number of fraction bits of a step.
    bits: u32,
    /// The start of the line.
    from: [i32; 2],
    /// The vector from the start of the line to its end.
    way: [i32; 2],
    /// The distance between the anchors.
    width: i32,
    /// The same vector as `way`, scaled up as far as 32 bits allow. Only its direction matters.
    direction: [i32; 2],
}

/// A point on a [`FineLine`].
#[derive(Clone, Copy)]
struct FinePlace {
    /// Its coordinates.
    place: [i32; 2],
    /// The lengths of both belts, in units of 2^-`bits` steps.
    belts: [i32; 2],
    /// The rates at which the belt lengths change along the line. Only their ratio matters.
    ways: [i32; 2],
}

impl FineLine {
    fn new(Anchors { left, width }: Anchors, ends: [PagePoint; 2]) -> Self {
        let [from, to] = ends.map(|end| [end.x - left.x, left.y - end.y]);
        let greatest = [from, to].map(|[x, y]| x.abs().max((width - x).abs()).max(y.abs()));
        // The greatest coordinate is below 2^22, so everything stays below 2^30.
        let bits = (greatest[0].max(greatest[1]) | 1).leading_zeros() - 2;
        let bits = bits.clamp(LEAST_BITS, MOST_BITS);
        let way = [to[0] - from[0], to[1] - from[1]];
        // The components are below 2^21.
        let longer = (way[0].abs().max(way[1].abs()) | 1).leading_zeros().saturating_sub(10);
        let direction = way.map(|way| way << longer);
        let [from, way] = [from, way].map(|point| point.map(|steps| steps << bits));
        Self { bits, from, way, width: width << bits, direction }
    }

    /// The point on the line after `done` of `length` units.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn at(&self, done: u32, length: u32) -> FinePlace {
        let along = |axis: usize| {
            // The product is below 2^62.
            let way = i64::from(self.way[axis]) * i64::from(done);
            self.from[axis] + way.checked_div(length.into()).unwrap_or(0) as i32
        };
        let place @ [x, y] = [along(0), along(1)];
        let beside = [x, x - self.width];
        let belts = beside.map(|x| length_of(x, y));
        let way = |axis: usize| {
            // The sum is below 2^54.
            let [right, down] = self.direction.map(i64::from);
            let way = i64::from(beside[axis]) * right + i64::from(y) * down;
            // The quotient is below 2^23, as the direction is.
            way.checked_div(belts[axis].into()).unwrap_or(0) as i32
        };
        FinePlace { place, belts, ways: [way(0), way(1)] }
    }

    /// The length of the other belt at the point near `place` where belt `more` is `steps` steps
    /// long. The result is in units of 2^-`bits` steps.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn beside(&self, place: FinePlace, steps: i32, more: usize) -> i32 {
        let ahead = i64::from((steps << self.bits) - place.belts[more]);
        let ahead = ahead * i64::from(place.ways[1 - more]);
        // The extrapolation covers a step or two, unless the belt lengths hardly change.
        let ahead = ahead.checked_div(place.ways[more].into()).unwrap_or(0);
        place.belts[1 - more].saturating_add(ahead as i32)
    }
}

/// √(x² + y²), rounded to the nearest integer.
#[inline(never)] // Inlining it at every call would cost too much flash.
pub(super) fn length_of(x: i32, y: i32) -> i32 {
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
