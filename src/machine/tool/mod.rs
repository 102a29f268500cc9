//! The tool: what lowers and raises the pen, how long that takes, and which settings it obeys.
//!
//! Each kind has a module: [`servo`], [`solenoid`] and [`stepper`], a motor on the z axis. A servo
//! and a solenoid are told a height ([`Pen`]), and the board has the one or the other; `$209`
//! chooses between them and the stepper motor. The motion planner turns the heights, the dwells and
//! the motor's rule of [`Tool::positions`] into events.

pub mod servo;
mod solenoid;
mod stepper;

pub use solenoid::Solenoid;

use super::{Setting, Settings};
use crate::motion::{LimitsError, PenPositions};
#[cfg(feature = "pen-overlap")]
use crate::motion::{PenOverlap, TICKS_PER_SECOND};

/// The actuator of the pen that a board has: a solenoid or a servo.
pub trait Pen {
    /// Moves the pen to `height`, from 0 (fully raised) to 127. It is called from the interrupt, so
    /// it must be brief.
    fn set_height(&mut self, height: u8);
}

/// What moves the pen, as `$209` chooses it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tool {
    /// The servo or solenoid of the board, which is told a height: see [`Pen`].
    Actuator,
    /// A stepper motor on the z axis lifts the pen.
    Stepper,
}

impl Tool {
    /// Returns the kind of tool that the settings choose.
    fn of(settings: &Settings) -> Self {
        if settings.is_on(Setting::Tool) { Self::Stepper } else { Self::Actuator }
    }

    /// Checks the settings of the chosen tool against each other.
    ///
    /// # Errors
    /// [`LimitsError::TooManySteps`] if the motor of z would have to step too fast,
    /// `LimitsError::PenByMotor` if a motor is to lift the pen while the others move,
    /// [`LimitsError::PenUpsideDown`] if it is to raise the pen downward.
    pub(super) fn check(settings: &Settings) -> Result<(), LimitsError> {
        match Self::of(settings) {
            Self::Actuator => Ok(()),
            #[cfg(feature = "pen-overlap")]
            Self::Stepper
                if settings.is_on(Setting::PenDownEarly)
                    || settings.is_on(Setting::TravelEarly) =>
            {
                Err(LimitsError::PenByMotor)
            }
            Self::Stepper
                if settings.get(Setting::PenUpHeight) > settings.get(Setting::PenDownHeight) =>
            {
                Err(LimitsError::PenUpsideDown)
            }
            Self::Stepper => stepper::rule(settings).map(|_| ()),
        }
    }

    /// The heights, dwells and other settings of the pen that the motion planner needs.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) fn positions(settings: &Settings) -> PenPositions {
        let height = |setting| settings.whole(setting).min(127) as u8;
        PenPositions {
            up_height: height(Setting::PenUpHeight),
            down_height: height(Setting::PenDownHeight),
            up_ticks: settings.milliseconds_as_ticks(Setting::PenUpDwell),
            down_ticks: settings.milliseconds_as_ticks(Setting::PenDownDwell),
            ramp_ticks: settings.milliseconds_as_ticks(Setting::PenRamp) / 127,
            dot_length: settings.dot_length(),
            lift: match Self::of(settings) {
                Self::Actuator => None,
                // `Settings::set` refuses whatever would be refused here.
                Self::Stepper => stepper::rule(settings).ok(),
            },
            #[cfg(feature = "pen-overlap")]
            overlap: Self::overlap(settings),
        }
    }

    /// Whether the pen moves only while the motors stand.
    #[cfg(feature = "early-ink")]
    pub(super) fn moves_apart(settings: &Settings) -> bool {
        #[cfg(feature = "pen-overlap")]
        if Self::overlap(settings) != PenOverlap::default() {
            return false;
        }
        let _ = settings;
        true
    }

    /// For how long the pen moves while the machine does: no longer than it moves at all.
    #[cfg(feature = "pen-overlap")]
    fn overlap(settings: &Settings) -> PenOverlap {
        let ticks = |setting| settings.milliseconds_as_ticks(setting);
        let heights = [Setting::PenUpHeight, Setting::PenDownHeight].map(|at| settings.whole(at));
        let ramp = ticks(Setting::PenRamp) / 127 * heights[0].abs_diff(heights[1]).min(127);
        PenOverlap {
            down_ticks: ticks(Setting::PenDownEarly).min(ramp + ticks(Setting::PenDownDwell)),
            up_ticks: ticks(Setting::TravelEarly).min(ticks(Setting::PenUpDwell)),
        }
    }

    /// The time, in milliseconds, that lowering and raising the pen adds to each stroke: the
    /// dwells, and the moves down and up of a motor, without what passes while the machine moves.
    pub(super) fn stroke_milliseconds(settings: &Settings) -> u64 {
        let dwells = settings.whole(Setting::PenDownDwell) + settings.whole(Setting::PenUpDwell);
        #[cfg(feature = "pen-overlap")]
        let dwells = {
            let PenOverlap { down_ticks, up_ticks } = Self::overlap(settings);
            dwells.saturating_sub((down_ticks + up_ticks) / (TICKS_PER_SECOND / 1000))
        };
        let moves = match Self::of(settings) {
            Self::Actuator => 0,
            Self::Stepper => 2 * stepper::move_milliseconds(settings),
        };
        // The copies of shaped motion come to rest before the pen goes down, and before it goes up.
        #[cfg(feature = "input-shaping")]
        let moves = moves
            + settings.shaping().ok().flatten().map_or(0, |it| 2 * u64::from(it.milliseconds()));
        u64::from(dwells) + moves
    }
}
