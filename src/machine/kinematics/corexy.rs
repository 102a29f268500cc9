//! A CoreXY machine: two motors drive one belt, the first by x + y, the second by x - y. The steps
//! per millimetre of x apply to both.

use super::{HomingSpace, Properties};
use crate::drawing::PagePoint;
use crate::machine::{Setting, Value};

/// The properties that distinguish a CoreXY machine from the other kinds.
pub(super) const PROPERTIES: Properties = Properties {
    steps_per_mm: [Setting::StepsPerMmX; 2],
    // A diagonal move on the page is √2 times as long for one of the motors.
    motor_ratio: Value::SQRT_2,
    longest_step: 1,
    is_limited: false,
    homing_space: HomingSpace::Page,
    homing_travel: [Setting::TravelX, Setting::TravelY],
    homed_length: None,
};

/// Returns the positions of both motors for a position of the pen, in steps.
pub(super) fn motors(page: PagePoint) -> PagePoint {
    PagePoint { x: page.x + page.y, y: page.x - page.y }
}

/// Returns the position of the pen for positions of both motors, in steps and rounded down.
pub(super) fn page(motors: PagePoint) -> PagePoint {
    PagePoint {
        x: (motors.x.wrapping_add(motors.y)) >> 1,
        y: (motors.x.wrapping_sub(motors.y)) >> 1,
    }
}
