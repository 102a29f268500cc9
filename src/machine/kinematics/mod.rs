//! Kinematics: converts between the position of the pen on the page and the positions of the two
//! motors, and says how the machine is homed and what limits it.
//!
//! Each kind has a module, which holds its formulas and its [`Properties`]. [`Kinematics`] is the
//! only place that lists the kinds: the code outside this folder asks it, or the properties, and
//! names no kind.

mod cartesian;
mod corexy;
mod polargraph;

pub use polargraph::{Anchors, CutPositions};

use super::{Setting, Settings, Value};
use crate::drawing::PagePoint;
use crate::motion::LimitsError;

/// The kind of kinematics of the machine, with the geometry that the settings give it.
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

/// The properties that distinguish a kind of machine from the others, whatever its size.
#[derive(Debug)]
pub(super) struct Properties {
    /// The settings that hold the steps per millimetre of x and y on the page.
    pub(super) steps_per_mm: [Setting; 2],
    /// The most steps that a motor makes while the pen moves as far as one step is long: √2 on a
    /// CoreXY machine, else 1.
    pub(super) motor_ratio: Value,
    /// For the braking rule: how many times as long as a diagonal step of the page the path for one
    /// step of a motor may be.
    pub(super) longest_step: u64,
    /// Whether the travel limits the machine even if [`Setting::SoftLimits`] is off.
    pub(super) is_limited: bool,
    /// Whether switches end the travel on the page or that of a motor.
    pub(super) homing_space: HomingSpace,
    /// The settings that hold how far the switch of each axis may be away; a belt may be longer.
    pub(super) homing_travel: [Setting; 2],
    /// The setting that holds the coordinate of a homed axis; `None` for 0.
    pub(super) homed_length: Option<Setting>,
}

/// What the limit switches limit, which determines the coordinates in which a machine is homed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HomingSpace {
    /// The page: each switch ends the travel of x or of y.
    Page,
    /// The motors: each switch ends the travel of one motor, and only this motor runs.
    Motors,
}

/// Where a piece of a line ends, for the motors and on the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentEnd {
    /// The positions of the motors there, in steps.
    pub motors: PagePoint,
    /// The position on the page there, in steps.
    pub page: PagePoint,
    /// How far the exact start and the exact end of the segment lie beside the rounded motor
    /// positions: see [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i16; 2],
}

impl Kinematics {
    /// Returns the kinematics that the settings choose and describe.
    pub(super) fn of(settings: &Settings) -> Self {
        match number(settings) {
            0 => Self::Cartesian,
            1 => Self::CoreXy,
            _ => Self::Polargraph(Anchors::of(settings)),
        }
    }

    /// Returns the properties of the kind that the settings choose.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) fn properties(settings: &Settings) -> &'static Properties {
        match number(settings) {
            0 => &cartesian::PROPERTIES,
            1 => &corexy::PROPERTIES,
            _ => &polargraph::PROPERTIES,
        }
    }

    /// Checks the settings of the chosen kind against each other.
    ///
    /// # Errors
    /// [`LimitsError::Anchors`] if the page reaches up to the anchors of a polargraph.
    pub(super) fn check(settings: &Settings) -> Result<(), LimitsError> {
        match number(settings) {
            0 | 1 => Ok(()),
            _ => polargraph::check(settings),
        }
    }

    /// The motor positions, in steps, for a position on the page. On a polargraph the position must
    /// be below the anchors.
    ///
    /// ```
    /// use penup::drawing::PagePoint;
    /// use penup::machine::{Anchors, Kinematics};
    /// let page = PagePoint { x: 30, y: -4 };
    /// let motors = Kinematics::CoreXy.motors(page);
    /// assert_eq!(motors, PagePoint { x: 26, y: 34 });
    /// assert_eq!(Kinematics::CoreXy.page(motors), page);
    /// let anchors = Anchors { left: PagePoint { x: 0, y: 300 }, width: 800 };
    /// let polargraph = Kinematics::Polargraph(anchors);
    /// let belts = polargraph.motors(PagePoint { x: 400, y: 0 });
    /// assert_eq!(belts, PagePoint { x: 500, y: 500 });
    /// assert_eq!(polargraph.page(belts), PagePoint { x: 400, y: 0 });
    /// ```
    pub fn motors(self, page: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => page,
            Self::CoreXy => corexy::motors(page),
            Self::Polargraph(anchors) => anchors.belts(page),
        }
    }

    /// The position on the page for motor positions in steps. It is rounded where it lies between
    /// two steps.
    pub fn page(self, motors: PagePoint) -> PagePoint {
        match self {
            Self::Cartesian => motors,
            Self::CoreXy => corexy::page(motors),
            Self::Polargraph(anchors) => anchors.page(motors),
        }
    }

    /// The anchors of the belts, where lines on the page must be cut into segments that are
    /// straight for the motors too. `None` if the motors make straight lines of all.
    pub(super) fn belts(self) -> Option<Anchors> {
        match self {
            Self::Cartesian | Self::CoreXy => None,
            Self::Polargraph(anchors) => Some(anchors),
        }
    }
}

/// Returns the value of `$230`, which chooses the kind: 0 Cartesian, 1 CoreXY, 2 polargraph.
fn number(settings: &Settings) -> i32 {
    settings.get(Setting::Kinematics).to_bits() >> Value::FRAC_NBITS
}
