//! The settings as the motion planner needs them, and whether it can honour all of them together.

use super::{Setting, Settings, Value};
use crate::array::MapEach;
use crate::machine::{Kinematics, Tool};
use crate::motion::{BrakeRule, Limits, LimitsError, MotionSettings, PathLength};
#[cfg(feature = "input-shaping")]
use crate::motion::{Resonance, ShaperKind, Shaping};
#[cfg(feature = "early-ink")]
use crate::order::StrokeTime;
use crate::order::TimeModel;

impl Settings {
    /// Checks the settings against each other.
    ///
    /// # Errors
    /// See [`LimitsError`].
    pub(super) fn check(&self) -> Result<(), LimitsError> {
        Kinematics::check(self)?;
        Tool::check(self)?;
        let limits = Limits::new(&self.motion_settings())?;
        #[cfg(feature = "input-shaping")]
        limits.shaped(self.shaping()?)?;
        let _ = limits;
        Ok(())
    }

    /// Returns the limits that the motion planner needs if this many steps are sure to wait in the
    /// `queue`.
    ///
    /// Speed and acceleration are measured along the path, so the slower axis determines both.
    pub fn limits(&self, queue: u32) -> Limits {
        let limits =
            self.limits_with(self.get(Setting::TravelSpeed), self.get(Setting::Jerk), queue);
        // `set` refuses whatever would be refused here.
        #[cfg(feature = "input-shaping")]
        let limits = limits.shaped(self.shaping().unwrap_or_default()).unwrap_or(limits);
        limits
    }

    /// Returns the limits for homing. They differ from [`Settings::limits`] in two ways: the speed
    /// with the pen up is that of the setting `travel`, and the jerk is not limited nor motion
    /// shaped, because the machine must brake soon at a switch. A speed for which the width of the
    /// pulses leaves no room becomes the greatest for which it does.
    pub(in crate::machine) fn limits_at(&self, travel: Setting, queue: u32) -> Limits {
        let fastest = self.motion_settings().greatest_pulsed();
        self.limits_with(self.get(travel).min(fastest), Value::ZERO, queue)
    }

    /// The limits with this speed with the pen up and this jerk.
    fn limits_with(&self, travel: Value, jerk_m_per_s3: Value, queue_steps: u32) -> Limits {
        let travel_mm_per_min = travel.min(self.axes_rate());
        let settings = self.motion_settings();
        let settings = MotionSettings { travel_mm_per_min, jerk_m_per_s3, queue_steps, ..settings };
        // `set` refuses whatever the motion planner would refuse, and homing is never faster than
        // the pulses allow, so the default is never used.
        Limits::new(&settings).unwrap_or_default()
    }

    /// The rule by which the interrupt brakes if its `queue` of this many steps runs empty. The
    /// second value is the greatest speed in mm/min if the settings ask for more than the queue can
    /// hold.
    pub(in crate::machine) fn brake(&self, queue: u32) -> (BrakeRule, Option<Value>) {
        let greatest = |speeds: [Setting; 2]| self.get(speeds[0]).max(self.get(speeds[1]));
        let homing = greatest([Setting::HomingSeek, Setting::HomingFeed])
            .min(self.motion_settings().greatest_pulsed());
        let asked = greatest([Setting::DrawSpeed, Setting::TravelSpeed]).max(homing);
        let asked = asked.min(self.axes_rate());
        let limits = self.limits_with(asked, Value::ZERO, queue);
        // Homing may be faster than what is shaped.
        #[cfg(feature = "input-shaping")]
        let limits = limits.with_shaping(self.shaping().unwrap_or_default());
        let held = limits.greatest_rate();
        // A speed is rounded by less than that.
        let is_less = asked - held > const { Value::lit("0.001") };
        let longest_step = Kinematics::properties(self).longest_step;
        (limits.brake(longest_step, queue), is_less.then_some(held))
    }

    /// Returns how long strokes take.
    #[cfg(feature = "early-ink")]
    pub fn stroke_time(&self) -> StrokeTime {
        let MotionSettings { steps_per_mm, draw_mm_per_min, .. } = self.motion_settings();
        let [speed, per_mm] = [draw_mm_per_min, steps_per_mm[0]]
            .map_each(|value| u64::from(value.to_bits().unsigned_abs()));
        let per_minute = (speed * per_mm) >> (2 * Value::FRAC_NBITS);
        let [steps_per_second, stroke_milliseconds] =
            [(per_minute / 60).max(1), Tool::stroke_milliseconds(self)]
                .map_each(|number| u32::try_from(number).unwrap_or(u32::MAX));
        StrokeTime { steps_per_second, stroke_milliseconds }
    }

    /// Returns how fast the pen travels on the page, and how many units of work on the order count
    /// as one second. It does not depend on the board.
    pub fn time_model(&self, units_per_second: u32) -> TimeModel {
        let MotionSettings { steps_per_mm, travel_mm_per_min, acceleration_mm_per_s2, .. } =
            self.motion_settings();
        let in_steps = |value: Value| {
            let [value, per_mm] =
                [value, steps_per_mm[0]].map_each(|it| it.to_bits().unsigned_abs());
            (u64::from(value) * u64::from(per_mm)) >> (2 * Value::FRAC_NBITS)
        };
        // The products are at most 32767 times 4000.
        let [per_minute, acceleration] =
            [travel_mm_per_min, acceleration_mm_per_s2].map_each(|value| in_steps(value) as u32);
        TimeModel { speed: per_minute / 60, acceleration, units_per_second }
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

    /// The speed along the path that one of the settings of speed asks for, in mm/min, as far as
    /// both axes allow it.
    pub(in crate::machine) fn path_speed(&self, speed: Setting) -> Value {
        self.get(speed).min(self.axes_rate())
    }

    /// The greatest acceleration along the path in mm/s², and the junction deviation in mm. Shaped
    /// motion has lesser ones where it would leave the path too far.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(in crate::machine) fn acceleration_and_corners(&self) -> (Value, Value) {
        let acceleration = self.get(Setting::AccelerationX).min(self.get(Setting::AccelerationY));
        let corners = self.get(Setting::JunctionDeviation);
        #[cfg(feature = "input-shaping")]
        if let Ok(Some(shaping)) = self.shaping() {
            let deviation = self.get(Setting::ShapingDeviation);
            if deviation > 0 {
                return shaping.bounds(deviation, acceleration, corners);
            }
        }
        (acceleration, corners)
    }

    /// The shapers of both axes; `None` if motion is not shaped.
    ///
    /// # Errors
    /// [`LimitsError::ShapingConflict`] or [`LimitsError::ShapingFrequency`].
    #[cfg(feature = "input-shaping")]
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(in crate::machine) fn shaping(&self) -> Result<Option<Shaping>, LimitsError> {
        let kind = match self.whole(Setting::Shaper) {
            0 => return Ok(None),
            1 => ShaperKind::Zv,
            2 => ShaperKind::Zvd,
            _ => ShaperKind::Ei,
        };
        // With these the pen would not draw the sum of the copies, or not when it is expected.
        let couples_axes = match self.kinematics() {
            Kinematics::Cartesian => false,
            Kinematics::CoreXy => true,
            Kinematics::Polargraph(_) => return Err(LimitsError::ShapingConflict),
        };
        let moves_beside = self.is_on(Setting::PenDownEarly)
            || self.is_on(Setting::TravelEarly)
            || self.is_on(Setting::BacklashDistance);
        if moves_beside || !self.is_on(Setting::Centripetal) {
            return Err(LimitsError::ShapingConflict);
        }
        let resonance = Resonance {
            kind,
            hertz: [Setting::ShakeX, Setting::ShakeY].map(|axis| self.get(axis)),
            damping: self.get(Setting::Damping),
        };
        let shaping = Shaping::new(&resonance, couples_axes);
        shaping.map(Some).map_err(|least| LimitsError::ShapingFrequency { least })
    }

    /// Returns the settings in the units of the motion planner.
    fn motion_settings(&self) -> MotionSettings {
        let steps = self.page_steps();
        let motor_ratio = Kinematics::properties(self).motor_ratio;
        let (acceleration_mm_per_s2, junction_deviation_mm) = self.acceleration_and_corners();
        MotionSettings {
            steps_per_mm: steps,
            motor_steps_per_mm: steps[0].max(steps[1]).saturating_mul(motor_ratio),
            draw_mm_per_min: self.path_speed(Setting::DrawSpeed),
            travel_mm_per_min: self.path_speed(Setting::TravelSpeed),
            acceleration_mm_per_s2,
            jerk_m_per_s3: self.get(Setting::Jerk),
            junction_deviation_mm,
            centripetal: self.is_on(Setting::Centripetal),
            pulse_ticks: self.microseconds_as_ticks(Setting::StepPulse),
            direction_setup_ticks: self.microseconds_as_ticks(Setting::DirectionSetup),
            queue_steps: u32::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(values: &[(Setting, f64)]) -> Settings {
        let mut settings = Settings::default();
        for &(setting, value) in values {
            settings.set(setting, Value::from_num(value)).expect("a valid setting");
        }
        settings
    }

    #[test]
    fn homing_faster_than_the_pulses_allow_is_as_fast_as_they_do() {
        for pulse in [0.2, 1.0, 2.0, 7.3, 10.0, 33.3, 500.0] {
            for steps in [2.0, 80.0, 333.3, 3200.0, 4000.0] {
                for kinematics in [0.0, 1.0] {
                    let settings = with(&[
                        (Setting::DrawSpeed, 1.0),
                        (Setting::TravelSpeed, 1.0),
                        (Setting::MaxRateX, 32_767.0),
                        (Setting::MaxRateY, 32_767.0),
                        (Setting::Kinematics, kinematics),
                        (Setting::StepsPerMmX, steps),
                        (Setting::StepsPerMmY, steps),
                        (Setting::StepPulse, pulse),
                        (Setting::HomingSeek, 32_000.0),
                    ]);
                    let ratio = if kinematics > 0.0 { std::f64::consts::SQRT_2 } else { 1.0 };
                    let ticks = f64::from(2 * settings.microseconds_as_ticks(Setting::StepPulse));
                    let possible = 60.0 * 25e6 / ticks / (steps * ratio).min(4000.0);
                    let expected = possible.min(32_000.0);
                    let limits = settings.limits_at(Setting::HomingSeek, u32::MAX);
                    let speed = limits.greatest_rate().to_num::<f64>();
                    assert!((speed / expected - 1.0).abs() < 1e-4, "{speed}, not {expected}");
                    let length = settings.limits(u32::MAX).length(1 << 12, 0);
                    assert_eq!(limits.length(1 << 12, 0), length, "the steps of the settings");
                    assert_eq!(settings.brake(u32::MAX).1, None);
                }
            }
        }
    }

    #[test]
    fn the_speed_of_homing_does_not_replace_the_rule_by_which_all_motion_brakes() {
        for (pulse, steps, speed) in [(20.0, 320.0, 3000.0), (10.0, 3200.0, 900.0)] {
            let mut settings = with(&[
                (Setting::DrawSpeed, speed),
                (Setting::TravelSpeed, speed),
                (Setting::StepPulse, pulse),
                (Setting::StepsPerMmX, steps),
                (Setting::StepsPerMmY, steps),
                (Setting::HomingSeek, 6000.0),
            ]);
            let (rule, _) = settings.brake(1000);
            assert_ne!(rule, Limits::default().brake(1, 1000));
            let fits = settings.motion_settings().greatest_pulsed();
            settings.set(Setting::HomingSeek, fits).expect("a valid setting");
            let motion = settings.motion_settings();
            let limits = Limits::new(&MotionSettings { travel_mm_per_min: fits, ..motion });
            assert!(limits.is_ok(), "{fits} mm/min");
            assert_eq!(rule, settings.brake(1000).0);
        }
    }
}
