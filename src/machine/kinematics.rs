//! How the pen's place on the page follows from the two motors.

use crate::drawing::PagePoint;

/// The build of the machine. Straight lines of the page are straight lines of the motors in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kinematics {
    /// One motor for x, one for y.
    #[default]
    Cartesian,
    /// Two motors at one belt: the first turns by x + y, the second by x - y.
    CoreXy,
}

impl Kinematics {
    /// The motors' steps for a place on the page.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::machine::Kinematics;
    /// let place = PagePoint { x: 30, y: -4 };
    /// let motors = Kinematics::CoreXy.motors(place);
    /// assert_eq!(motors, PagePoint { x: 26, y: 34 });
    /// assert_eq!(Kinematics::CoreXy.page(motors), place);
    /// ```
    pub const fn motors(self, page: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => page,
            Self::CoreXy => PagePoint { x: page.x + page.y, y: page.x - page.y },
        }
    }

    /// The place on the page for the motors' steps; rounded down where it lies between two steps.
    pub const fn page(self, motors: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => motors,
            Self::CoreXy => PagePoint {
                x: (motors.x.wrapping_add(motors.y)) >> 1,
                y: (motors.x.wrapping_sub(motors.y)) >> 1,
            },
        }
    }
}
