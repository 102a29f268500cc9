//! A stepper motor on the z axis that lifts the pen. The step interrupt pulses it
//! ([`Axes::set_z_axis`](crate::machine::Axes)) by a rule that these settings give.

use crate::array::MapEach;
use crate::machine::estimate::rest_to_rest;
use crate::machine::{Setting, Settings, Value};
use crate::motion::{LiftRule, LimitsError};

/// The greatest step rate of the motor that lifts the pen, in steps per second. Every board can
/// keep up with it.
const GREATEST_RATE: u32 = 10_000;

/// Returns how far, how fast and with what acceleration the motor lifts the pen, in its steps, as
/// the settings say.
///
/// # Errors
/// [`LimitsError::TooManySteps`] if it would have to step faster than every board can.
#[inline(never)] // Inlining it at every call would cost too much flash.
pub(super) fn rule(settings: &Settings) -> Result<LiftRule, LimitsError> {
    let in_steps = |setting| {
        let product = u64::from(settings.get(setting).to_bits().unsigned_abs())
            * u64::from(settings.get(Setting::StepsPerMmZ).to_bits().unsigned_abs());
        // The result is below 2^27 steps.
        (product >> (2 * Value::FRAC_NBITS)) as u32
    };
    let per_minute = in_steps(Setting::MaxRateZ);
    let asked = per_minute / 60;
    if asked > GREATEST_RATE {
        return Err(LimitsError::TooManySteps { asked, possible: GREATEST_RATE });
    }
    let travel = settings.millimetres_as_steps(Setting::TravelZ, Setting::StepsPerMmZ);
    Ok(LiftRule::new(travel, per_minute, in_steps(Setting::AccelerationZ)))
}

/// The time, in milliseconds, of one move between the heights of the raised and the lowered pen.
pub(super) fn move_milliseconds(settings: &Settings) -> u64 {
    let [down, up] =
        [Setting::PenDownHeight, Setting::PenUpHeight].map_each(|setting| settings.whole(setting));
    let distance = settings.positive_bits(Setting::TravelZ) * u64::from(down.abs_diff(up)) / 127;
    let per_second = settings.positive_bits(Setting::MaxRateZ) / 60;
    rest_to_rest(distance, per_second, settings.positive_bits(Setting::AccelerationZ))
}
