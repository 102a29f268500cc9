//! How the pen's place on the page follows from the two motors.

use crate::drawing::PagePoint;

/// The build of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kinematics {
    /// One motor for x, one for y.
    #[default]
    Cartesian,
    /// Two motors at one belt: the first turns by x + y, the second by x - y.
    CoreXy,
    /// The pen hangs on two belts; each motor counts the steps of its belt's length.
    Polargraph(Anchors),
}

/// Of a step: the unit of [`Line::beside`](crate::step::Line::beside).
const FINE: i32 = 256;

/// The end of a piece of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// The motors' steps there.
    pub motors: PagePoint,
    /// The page's.
    pub page: PagePoint,
    /// How far start and end lie beside the motors' steps: see [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i8; 2],
}

/// Where the belts of a polargraph leave their motors: both at the same height, above the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Anchors {
    /// The left one, in steps from the page's origin; at most 2^21 each way.
    pub left: PagePoint,
    /// From it to the right one, in steps: 1 to 2^21.
    pub width: i32,
}

impl Kinematics {
    /// The motors' steps for a place on the page, which is below the anchors.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::machine::{Anchors, Kinematics};
    /// let place = PagePoint { x: 30, y: -4 };
    /// let motors = Kinematics::CoreXy.motors(place);
    /// assert_eq!(motors, PagePoint { x: 26, y: 34 });
    /// assert_eq!(Kinematics::CoreXy.page(motors), place);
    /// let wall = Kinematics::Polargraph(Anchors { left: PagePoint { x: 0, y: 300 }, width: 800 });
    /// let belts = wall.motors(PagePoint { x: 400, y: 0 });
    /// assert_eq!(belts, PagePoint { x: 500, y: 500 });
    /// assert_eq!(wall.page(belts), PagePoint { x: 400, y: 0 });
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

    /// The piece of a straight line on the page between two `places` along it, counted such that the line is
    /// `length` long. It begins where the motors stand in the end of the piece before, at `begin`.
    pub fn piece(
        self,
        ends: [PagePoint; 2],
        places: [u32; 2],
        length: u32,
        begin: PagePoint,
    ) -> Piece {
        let [from, to] = ends;
        let Self::Polargraph(Anchors { left, width }) = self else {
            return Piece { motors: self.motors(to), page: to, offsets: [0; 2] };
        };
        let fine = |steps: i32| steps * FINE;
        let [start, end] = places.map(|place| {
            let along = |from: i32, to: i32| {
                let way = i64::from(FINE) * (i64::from(to) - i64::from(from)) * i64::from(place);
                // Within 2^30.
                fine(from) + (way / i64::from(length.max(1))) as i32
            };
            let page = PagePoint { x: along(from.x, to.x), y: along(from.y, to.y) };
            let (x, y) = (page.x - fine(left.x), fine(left.y) - page.y);
            ([length_of(x, y), length_of(fine(width) - x, y)], page)
        });
        let change = [end.0[0] - start.0[0], end.0[1] - start.0[1]];
        // How far the belts are, along the axis of fewer steps, from where the piece passes `steps` of
        // the other one.
        let beside = |belts: [i32; 2], steps: i32, more: usize| {
            let ahead = i64::from(fine(steps) - belts[more]) * i64::from(change[1 - more]);
            let ahead = ahead.checked_div(change[more].into()).unwrap_or(0);
            i64::from(belts[1 - more]) + ahead
        };
        let more_of = |x: i32, y: i32| usize::from(x.abs() <= y.abs());
        let motors = if places[1] >= length {
            self.motors(to)
        } else {
            let more = more_of(change[0], change[1]);
            let steps = rounded(end.0[more].into());
            let others = rounded(beside(end.0, steps, more));
            let [x, y] = if more == 0 { [steps, others] } else { [others, steps] };
            PagePoint { x, y }
        };
        let more = more_of(motors.x - begin.x, motors.y - begin.y);
        let offsets = [(start.0, begin), (end.0, motors)].map(|(belts, PagePoint { x, y })| {
            let (steps, others) = if more == 0 { (x, y) } else { (y, x) };
            // At the ends of a line both belts are rounded, so it may be more.
            (beside(belts, steps, more) - i64::from(fine(others))).clamp(-127, 127) as i8
        });
        let page = PagePoint { x: rounded(end.1.x.into()), y: rounded(end.1.y.into()) };
        Piece { motors, page, offsets }
    }

    /// The place on the page for the motors' steps; rounded where it lies between two steps.
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
                // Belts of up to 2^23 steps: squares below 2^46.
                let twice = 2 * i64::from(width).max(1);
                let x = (a - b + w + twice / 2).div_euclid(twice);
                let down = (a - x * x).max(0).unsigned_abs();
                PagePoint { x: left.x + x as i32, y: left.y - rounded_root(down) }
            }
        }
    }

    /// Into how many pieces a line of the page must be cut so that each is straight within 1/64 of a
    /// step of the motors; their own rounding adds half a step.
    ///
    /// Along a line a belt of length a bends by 1/a at most, so a piece of length h is off by h²/8a;
    /// no belt is shorter than the line lies below the anchors.
    pub fn pieces(self, from: PagePoint, to: PagePoint) -> u32 {
        let Self::Polargraph(Anchors { left, .. }) = self else { return 1 };
        let least = (left.y - from.y.max(to.y)).max(1).unsigned_abs();
        let length = from.x.abs_diff(to.x) + from.y.abs_diff(to.y);
        length.div_ceil((least / 8).isqrt().max(1)).max(1)
    }
}

/// √(x² + y²), rounded.
fn length_of(x: i32, y: i32) -> i32 {
    let square = |steps: i32| i64::from(steps).unsigned_abs() * i64::from(steps).unsigned_abs();
    rounded_root(square(x) + square(y))
}

/// Fine units as steps.
fn rounded(fine: i64) -> i32 {
    (fine + i64::from(FINE / 2)).div_euclid(FINE.into()) as i32
}

/// The root of a number below 2^62, rounded.
fn rounded_root(squared: u64) -> i32 {
    (4 * squared).isqrt().div_ceil(2) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_knows_its_page() {
        let anchors = Anchors { left: PagePoint { x: -15_000, y: 60_000 }, width: 64_000 };
        let wall = Kinematics::Polargraph(anchors);
        for x in (0..34_000).step_by(1711) {
            for y in (0..42_000).step_by(2213) {
                let page = PagePoint { x, y };
                let again = wall.page(wall.motors(page));
                assert!(again.x.abs_diff(x) <= 2 && again.y.abs_diff(y) <= 2, "{page:?} {again:?}");
            }
        }
    }
}
