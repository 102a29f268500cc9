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
                PagePoint { x: length(x, y), y: length(width - x, y) }
            }
        }
    }

    /// The end of piece number `part`, from 1, of `pieces` of a line on the page: the motors, not
    /// rounded on the way, and the page.
    pub fn part(self, ends: [PagePoint; 2], part: u32, pieces: u32) -> [PagePoint; 2] {
        /// Of a step.
        const PARTS: i64 = 32;
        let [from, to] = ends;
        let (Self::Polargraph(Anchors { left, width }), true) = (self, part < pieces) else {
            return [self.motors(to), to];
        };
        let along = |from: i32, to: i32| {
            let way = PARTS * (i64::from(to) - i64::from(from)) * i64::from(part);
            // Within 2^27.
            (PARTS * i64::from(from) + way / i64::from(pieces)) as i32
        };
        let rounded = |fine: i32| (fine + PARTS as i32 / 2).div_euclid(PARTS as i32);
        let fine = |steps: i32| steps * PARTS as i32;
        let (page_x, page_y) = (along(from.x, to.x), along(from.y, to.y));
        let (x, y) = (page_x - fine(left.x), fine(left.y) - page_y);
        let belts = PagePoint { x: length(x, y), y: length(fine(width) - x, y) };
        [belts, PagePoint { x: page_x, y: page_y }]
            .map(|point| PagePoint { x: rounded(point.x), y: rounded(point.y) })
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

    /// Into how many pieces a line of the page must be cut so that each is straight within an
    /// eighth of a step of the motors (their own rounding adds a step at most).
    ///
    /// Along a line a belt of length a bends by 1/a at most, so a piece of length h is off by h²/8a;
    /// no belt is shorter than the line lies below the anchors.
    pub fn pieces(self, from: PagePoint, to: PagePoint) -> u32 {
        let Self::Polargraph(Anchors { left, .. }) = self else { return 1 };
        let least = (left.y - from.y.max(to.y)).max(1).unsigned_abs();
        let length = from.x.abs_diff(to.x) + from.y.abs_diff(to.y);
        length.div_ceil(least.isqrt()).max(1)
    }
}

/// √(x² + y²), rounded.
fn length(x: i32, y: i32) -> i32 {
    let square = |steps: i32| i64::from(steps).unsigned_abs() * i64::from(steps).unsigned_abs();
    rounded_root(square(x) + square(y))
}

/// The root of a number below 2^61, rounded.
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
