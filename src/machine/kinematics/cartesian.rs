//! A Cartesian machine: one motor moves x, the other moves y. The motors' positions are those of
//! the page.

use super::{HomingSpace, Properties};
use crate::machine::{Setting, Value};

/// The properties that distinguish a Cartesian machine from the other kinds.
pub(super) const PROPERTIES: Properties = Properties {
    steps_per_mm: [Setting::StepsPerMmX, Setting::StepsPerMmY],
    motor_ratio: Value::ONE,
    longest_step: 1,
    is_limited: false,
    homing_space: HomingSpace::Page,
    homing_travel: [Setting::TravelX, Setting::TravelY],
    homed_length: None,
};
