//! The settings as the motion planner needs them, and whether it can honour all of them together.

use super::{Setting, Settings, Value};
use crate::machine::{Kinematics, Tool};
use crate::motion::{BrakeRule, Limits, LimitsError, MotionSettings, PathLength, QueueSize};

impl Settings {
    /// Checks the settings against each other.
    ///
    /// # Errors
    /// See [`LimitsError`].
    pub(super) fn check(&self) -> Result<(), LimitsError> {
        Kinematics::check(self)?;
        Tool::check(self)?;
        Limits::new(&self.motion_settings()).map(|_| ())
    }

    /// The limits that the motion planner needs.
    ///
    /// Speed and acceleration are measured along the path, so the slower axis determines both.
    pub fn limits(&self) -> Limits {
        // `set` refuses whatever the motion planner would refuse, so the default is never used.
        Limits::new(&self.motion_settings()).unwrap_or_default()
    }

    /// Returns the limits for homing. They differ from [`Settings::limits`] in two ways: the speed
    /// with the pen up is that of the setting `travel`, and the jerk is not limited, because the
    /// machine must brake soon at a switch.
    pub(in crate::machine) fn limits_at(&self, travel: Setting) -> Limits {
        let settings = MotionSettings {
            travel_mm_per_min: self.get(travel).min(self.axes_rate()),
            jerk_m_per_s3: Value::ZERO,
            ..self.motion_settings()
        };
        Limits::new(&settings).unwrap_or_else(|_| self.limits())
    }

    /// The rule by which the interrupt brakes if its `queue` runs empty.
    pub(in crate::machine) fn brake(&self, queue: QueueSize) -> BrakeRule {
        let limits = self.limits();
        let fastest = limits.fastest().max(self.limits_at(Setting::HomingSeek).fastest());
        limits.brake(fastest, Kinematics::properties(self).longest_step, queue)
    }

    /// Returns the length of the dots of a dotted line.
    pub(in crate::machine) fn dot_length(&self) -> PathLength {
        // The setting is positive, and a unit of it is four units of the length.
        PathLength::from_bits(self.get(Setting::DotLength).to_bits().unsigned_abs() << 2)
    }

    /// Returns the greatest speed that both axes allow, in mm/min.
    fn axes_rate(&self) -> Value {
        self.get(Setting::MaxRateX).min(self.get(Setting::MaxRateY))
    }

    /// Returns the settings in the units of the motion planner.
    fn motion_settings(&self) -> MotionSettings {
        let steps = self.page_steps();
        let motor_ratio = Kinematics::properties(self).motor_ratio;
        MotionSettings {
            steps_per_mm: steps,
            motor_steps_per_mm: steps[0].max(steps[1]).saturating_mul(motor_ratio),
            draw_mm_per_min: self.get(Setting::DrawSpeed).min(self.axes_rate()),
            travel_mm_per_min: self.get(Setting::TravelSpeed).min(self.axes_rate()),
            acceleration_mm_per_s2: self
                .get(Setting::AccelerationX)
                .min(self.get(Setting::AccelerationY)),
            jerk_m_per_s3: self.get(Setting::Jerk),
            junction_deviation_mm: self.get(Setting::JunctionDeviation),
            centripetal: self.is_on(Setting::Centripetal),
            pulse_ticks: self.microseconds_as_ticks(Setting::StepPulse),
            direction_setup_ticks: self.microseconds_as_ticks(Setting::DirectionSetup),
        }
    }
}
