//! The numbered settings: their names, units and ranges.
//!
//! Numbers up to 132 have the meaning that they have in Grbl 1.1, with one exception: 5 is a mask
//! here, and it also covers the emergency stop. Numbers from 200 on are penup's own. A value is
//! checked when it is entered, both alone and together with the other values. A refused value
//! changes nothing.

use super::{Anchors, Kinematics};
use crate::drawing::{PAGE_LIMIT, PagePoint};
use crate::fixed::Millimetres;
use crate::motion::{
    BrakeRule, LiftRule, Limits, LimitsError, MotionSettings, PenPositions, QueueSize,
    TICKS_PER_SECOND,
};

/// A value of any setting, between -32768 and 32768 with a resolution of 2^-16, in the unit of the
/// setting.
pub type Value = Millimetres;

/// The settings, in the order in which they are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Setting {
    /// `$0` The width of a step pulse.
    StepPulse,
    /// `$3` The mask of motors whose direction is inverted: bit 0 for x, bit 1 for y, bit 2 for the
    /// pen's motor.
    InvertDirections,
    /// `$5` The mask of contacts that are closed when they are not pressed: bit 0 for x, bit 1 for
    /// y, bit 2 for the emergency stop.
    InvertContacts,
    /// `$11` Junction deviation: how far a rounded corner would be from the true one. It determines
    /// the speed in corners.
    JunctionDeviation,
    /// `$20` Whether moves that leave the travel are refused.
    SoftLimits,
    /// `$21` Whether a pressed limit switch stops the machine.
    HardLimits,
    /// `$22` Whether the machine must be homed before it draws.
    Homing,
    /// `$24` The speed of the second, slow approach to a switch.
    HomingFeed,
    /// `$25` The speed of the first approach to a switch.
    HomingSeek,
    /// `$27` The distance from its switch at which an axis is homed.
    HomingPullOff,
    /// `$100` Steps per millimetre of x.
    StepsPerMmX,
    /// `$101` Steps per millimetre of y.
    StepsPerMmY,
    /// `$102` Steps per millimetre of the motor that lifts the pen.
    StepsPerMmZ,
    /// `$110` The greatest speed of x.
    MaxRateX,
    /// `$111` The greatest speed of y.
    MaxRateY,
    /// `$112` The greatest speed of the pen's motor.
    MaxRateZ,
    /// `$120` The acceleration of x.
    AccelerationX,
    /// `$121` The acceleration of y.
    AccelerationY,
    /// `$122` The acceleration of the pen's motor.
    AccelerationZ,
    /// `$130` The travel of x, from 0.
    TravelX,
    /// `$131` The travel of y, from 0.
    TravelY,
    /// `$132` The travel of the pen's motor from its upper stop to height 127.
    TravelZ,
    /// `$200` The time from a change of a direction pin to the step pulse.
    DirectionSetup,
    /// `$201` The speed along the path with the pen down.
    DrawSpeed,
    /// `$202` The speed along the path with the pen up.
    TravelSpeed,
    /// `$203` Whether the machine slows down in the bends of dense polylines so that the
    /// centripetal acceleration stays within the limit.
    Centripetal,
    /// `$204` The greatest jerk along the path, which is the rate of change of the acceleration; at
    /// least 0.1, or 0 for no limit.
    Jerk,
    /// `$209` How the pen is lifted: 0 by a servo or a solenoid, 1 by a motor.
    PenLift,
    /// `$210` The height of the raised pen, from 0 (highest) to 127.
    PenUpHeight,
    /// `$211` The height of the lowered pen, from 0 (highest) to 127.
    PenDownHeight,
    /// `$212` The dwell from the command to raise the pen to the first move.
    PenUpDwell,
    /// `$213` The dwell from the command to lower the pen to the first move.
    PenDownDwell,
    /// `$214` The time in which the pen moves in small steps from one end of its range of heights
    /// to the other; 0 if it moves at once.
    PenRamp,
    /// `$215` The length of ink after which the machine pauses at the end of a stroke; 0 for never.
    InkBeforePause,
    /// `$220` The length of the dots and gaps of a dotted line. A dash is three dots long.
    DotLength,
    /// `$230` The kinematics of the machine: 0 Cartesian, 1 CoreXY, 2 polargraph.
    Kinematics,
    /// `$231` The distance from the left anchor of the belts to the right one.
    AnchorWidth,
    /// `$232` The horizontal distance from the left anchor to the origin's origin, which is to the
    /// right of it.
    AnchorLeft,
    /// `$233` The height of the anchors above the origin.
    AnchorHeight,
    /// `$234` The length of a belt when it is homed.
    HomedBelt,
    /// `$235` The backlash of x: the travel that is lost when its motor reverses.
    BacklashX,
    /// `$236` The backlash of y, or of the second motor.
    BacklashY,
    /// `$240` The x coordinate at which the pen is parked (G28).
    ParkX,
    /// `$241` The y coordinate at which the pen is parked (G28).
    ParkY,
}

/// The description of a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingInfo {
    /// The setting that is described.
    pub setting: Setting,
    /// The number after the `$`.
    pub number: u16,
    /// The name in the listing.
    pub name: &'static str,
    /// The unit; empty for a plain number.
    pub unit: &'static str,
    /// The least value allowed.
    pub least: Value,
    /// The greatest value allowed.
    pub greatest: Value,
    /// The default value.
    pub default: Value,
    /// Whether only whole numbers are allowed.
    pub whole: bool,
}

/// The greatest step rate of the pen's motor, in steps per second. Every board can keep up with it.
const GREATEST_LIFT_RATE: u32 = 10_000;

/// The number of settings.
pub const SETTING_COUNT: usize = 44;

const fn info(
    setting: Setting,
    number: u16,
    name: &'static str,
    unit: &'static str,
    (least, greatest, default): (f64, f64, f64),
    whole: bool,
) -> SettingInfo {
    // A value is rounded to the nearest one, as a value that is sent is. No value is negative.
    const fn value(number: f64) -> Value {
        Value::from_bits((number * 65536.0 + 0.5) as i32)
    }
    SettingInfo {
        setting,
        number,
        name,
        unit,
        least: value(least),
        greatest: value(greatest),
        default: value(default),
        whole,
    }
}

/// The descriptions of all settings, sorted by number.
#[rustfmt::skip] // a table
pub const SETTINGS: [SettingInfo; SETTING_COUNT] = {
    use Setting::*;
    [
        info(StepPulse, 0, "step pulse length", "us", (0.2, 500.0, 2.0), false),
        info(InvertDirections, 3, "invert directions", "mask", (0.0, 7.0, 0.0), true),
        info(InvertContacts, 5, "invert contacts", "mask", (0.0, 7.0, 0.0), true),
        info(JunctionDeviation, 11, "junction deviation", "mm", (0.0, 1.0, 0.05), false),
        info(SoftLimits, 20, "soft limits", "0|1", (0.0, 1.0, 1.0), true),
        info(HardLimits, 21, "hard limits", "0|1", (0.0, 1.0, 0.0), true),
        info(Homing, 22, "homing", "0|1", (0.0, 1.0, 0.0), true),
        info(HomingFeed, 24, "homing speed, slow approach", "mm/min", (1.0, 32767.0, 60.0), false),
        info(HomingSeek, 25, "homing speed, first approach", "mm/min", (1.0, 32767.0, 1500.0), false),
        info(HomingPullOff, 27, "homing pull-off", "mm", (0.1, 50.0, 2.0), false),
        info(StepsPerMmX, 100, "steps per mm of x", "step/mm", (2.0, 4000.0, 80.0), false),
        info(StepsPerMmY, 101, "steps per mm of y", "step/mm", (2.0, 4000.0, 80.0), false),
        info(StepsPerMmZ, 102, "steps per mm of z", "step/mm", (2.0, 4000.0, 400.0), false),
        info(MaxRateX, 110, "maximum speed of x", "mm/min", (1.0, 32767.0, 6000.0), false),
        info(MaxRateY, 111, "maximum speed of y", "mm/min", (1.0, 32767.0, 6000.0), false),
        info(MaxRateZ, 112, "maximum speed of z", "mm/min", (1.0, 32767.0, 300.0), false),
        info(AccelerationX, 120, "acceleration of x", "mm/s2", (10.0, 32767.0, 800.0), false),
        info(AccelerationY, 121, "acceleration of y", "mm/s2", (10.0, 32767.0, 800.0), false),
        info(AccelerationZ, 122, "acceleration of z", "mm/s2", (10.0, 32767.0, 50.0), false),
        info(TravelX, 130, "travel of x", "mm", (1.0, 8000.0, 420.0), false),
        info(TravelY, 131, "travel of y", "mm", (1.0, 8000.0, 420.0), false),
        info(TravelZ, 132, "travel of z", "mm", (0.1, 50.0, 4.0), false),
        info(DirectionSetup, 200, "direction setup time", "us", (0.1, 500.0, 1.0), false),
        info(DrawSpeed, 201, "drawing speed", "mm/min", (1.0, 32767.0, 3000.0), false),
        info(TravelSpeed, 202, "travel speed", "mm/min", (1.0, 32767.0, 6000.0), false),
        info(Centripetal, 203, "limit speed by curvature", "0|1", (0.0, 1.0, 1.0), true),
        info(Jerk, 204, "jerk", "m/s3", (0.0, 1000.0, 0.0), false),
        info(PenLift, 209, "pen lifted by a stepper", "0|1", (0.0, 1.0, 0.0), true),
        info(PenUpHeight, 210, "height of the raised pen", "of 127", (0.0, 127.0, 0.0), true),
        info(PenDownHeight, 211, "height of the lowered pen", "of 127", (0.0, 127.0, 127.0), true),
        info(PenUpDwell, 212, "dwell after raising the pen", "ms", (1.0, 1300.0, 150.0), false),
        info(PenDownDwell, 213, "dwell after lowering the pen", "ms", (1.0, 1300.0, 150.0), false),
        info(PenRamp, 214, "pen ramp time", "ms", (0.0, 5000.0, 0.0), false),
        info(InkBeforePause, 215, "drawn length before a pause", "m", (0.0, 10000.0, 0.0), false),
        info(DotLength, 220, "length of a dot", "mm", (0.1, 100.0, 1.0), false),
        info(Kinematics, 230, "kinematics", "0|1|2", (0.0, 2.0, 0.0), true),
        info(AnchorWidth, 231, "distance between anchors", "mm", (100.0, 8000.0, 800.0), false),
        info(AnchorLeft, 232, "left anchor to the origin", "mm", (0.0, 8000.0, 190.0), false),
        info(AnchorHeight, 233, "anchors above the origin", "mm", (10.0, 8000.0, 700.0), false),
        info(HomedBelt, 234, "belt length when homed", "mm", (10.0, 8000.0, 500.0), false),
        info(BacklashX, 235, "backlash of x", "mm", (0.0, 10.0, 0.0), false),
        info(BacklashY, 236, "backlash of y", "mm", (0.0, 10.0, 0.0), false),
        info(ParkX, 240, "park at x", "mm", (0.0, 8000.0, 0.0), false),
        info(ParkY, 241, "park at y", "mm", (0.0, 8000.0, 0.0), false),
    ]
};

impl Setting {
    /// The description of this setting.
    pub const fn info(self) -> &'static SettingInfo {
        &SETTINGS[self as usize]
    }

    /// The setting with this number, or `None` if there is none.
    ///
    /// ```
    /// use penup::machine::Setting;
    /// assert_eq!(Setting::numbered(100), Some(Setting::StepsPerMmX));
    /// assert_eq!(Setting::numbered(99), None);
    /// ```
    pub fn numbered(number: u16) -> Option<Self> {
        let index = SETTINGS.binary_search_by_key(&number, |info| info.number);
        index.ok().map(|index| SETTINGS[index].setting)
    }
}

/// Why a change of a setting was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SettingError {
    /// No setting has this number.
    Unknown,
    /// The value is below `least` or above `greatest` of [`Setting::info`].
    OutOfRange(Setting),
    /// The setting needs a whole number.
    NotWhole(Setting),
    /// The value conflicts with the values of other settings.
    Conflict(LimitsError),
    /// Settings cannot be changed while the machine moves.
    Busy,
}

/// The values of all settings. Each value is within its range, and the motion planner can honour
/// all of them together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// The values, in the order of [`SETTINGS`].
    values: [Value; SETTING_COUNT],
}

impl Default for Settings {
    fn default() -> Self {
        Self { values: SETTINGS.map(|info| info.default) }
    }
}

impl Settings {
    /// The value of a setting, in its unit.
    pub fn get(&self, setting: Setting) -> Value {
        self.values[setting as usize]
    }

    /// Changes a setting.
    ///
    /// # Errors
    /// See [`SettingError`]. On an error the setting keeps its old value.
    ///
    /// ```
    /// use penup::machine::{Setting, SettingError, Settings, Value};
    /// let mut settings = Settings::default();
    /// settings.set(Setting::AccelerationX, Value::from_num(1500))?;
    /// assert_eq!(settings.get(Setting::AccelerationX), 1500);
    /// let refused = settings.set(Setting::AccelerationX, Value::ZERO);
    /// assert_eq!(refused, Err(SettingError::OutOfRange(Setting::AccelerationX)));
    /// # Ok::<(), SettingError>(())
    /// ```
    pub fn set(&mut self, setting: Setting, value: Value) -> Result<(), SettingError> {
        let info = setting.info();
        if value < info.least || value > info.greatest {
            return Err(SettingError::OutOfRange(setting));
        }
        if info.whole && value.frac() != 0 {
            return Err(SettingError::NotWhole(setting));
        }
        let mut changed = *self;
        changed.values[setting as usize] = value;
        changed.checked_limits().map_err(SettingError::Conflict)?;
        *self = changed;
        Ok(())
    }

    /// Restores settings that were read from [`Settings::iter`] before. `values` are pairs of
    /// number and value; settings that are not among them get their defaults. Numbers that no
    /// longer exist are ignored. If a value is out of its range, or if values conflict, all
    /// settings get their defaults.
    pub fn restored(values: impl IntoIterator<Item = (u16, Value)>) -> Self {
        let mut restored = Self::default();
        for (setting, value) in values.into_iter().filter_map(|(number, value)| {
            let setting = Setting::numbered(number)?;
            Some((setting, value))
        }) {
            let info = setting.info();
            let out_of_range = value < info.least || value > info.greatest;
            if out_of_range || (info.whole && value.frac() != 0) {
                return Self::default();
            }
            restored.values[setting as usize] = value;
        }
        if restored.checked_limits().is_ok() { restored } else { Self::default() }
    }

    /// All settings with their values, sorted by number.
    pub fn iter(&self) -> impl Iterator<Item = (&'static SettingInfo, Value)> {
        SETTINGS.iter().zip(self.values)
    }

    /// Whether a setting whose value is 0 or 1 is 1.
    pub fn is_on(&self, setting: Setting) -> bool {
        self.get(setting) != 0
    }

    /// Converts a setting in microseconds to ticks.
    pub fn microseconds_as_ticks(&self, setting: Setting) -> u32 {
        self.as_ticks(setting, TICKS_PER_SECOND / 1_000_000)
    }

    /// Converts a setting in milliseconds to ticks.
    pub fn milliseconds_as_ticks(&self, setting: Setting) -> u32 {
        self.as_ticks(setting, TICKS_PER_SECOND / 1000)
    }

    fn as_ticks(&self, setting: Setting, ticks_per_unit: u32) -> u32 {
        let bits = u64::from(self.get(setting).to_bits().max(0).unsigned_abs());
        // The ranges of the settings keep the result below 2^27 ticks.
        ((bits * u64::from(ticks_per_unit)) >> Value::FRAC_NBITS) as u32
    }

    fn height(&self, setting: Setting) -> u8 {
        self.get(setting).saturating_to_num::<u8>().min(127)
    }

    /// The limits that the motion planner needs.
    ///
    /// Speed and acceleration are measured along the path, so the slower axis determines both.
    pub fn limits(&self) -> Limits {
        // `set` refuses whatever the motion planner would refuse, so the default is never used.
        self.checked_limits().unwrap_or_default()
    }

    /// The same limits with two differences: the speed with the pen up is that of the setting
    /// `travel`, and the jerk is not limited, because the machine must brake soon at a switch.
    pub(super) fn limits_at(&self, travel: Setting) -> Limits {
        let settings = MotionSettings {
            travel_mm_per_min: self.get(travel).min(self.axes_rate()),
            jerk_m_per_s3: Value::ZERO,
            ..self.motion_settings()
        };
        Limits::new(&settings).unwrap_or_else(|_| self.limits())
    }

    /// The rule by which the interrupt brakes if its `queue` runs empty.
    pub(super) fn brake(&self, queue: QueueSize) -> BrakeRule {
        let limits = self.limits();
        let fastest = limits.fastest().max(self.limits_at(Setting::HomingSeek).fastest());
        // The belts of a polargraph may change their lengths much more slowly than the pen moves.
        let longer = if matches!(self.kinematics(), Kinematics::Polargraph(_)) { 8 } else { 1 };
        limits.brake(fastest, longer, queue)
    }

    fn checked_limits(&self) -> Result<Limits, LimitsError> {
        let below_anchors = self.get(Setting::AnchorHeight) > self.get(Setting::TravelY);
        if matches!(self.kinematics(), Kinematics::Polargraph(_)) && !below_anchors {
            return Err(LimitsError::Anchors);
        }
        self.checked_lift()?;
        Limits::new(&self.motion_settings())
    }

    /// How the pen's motor lifts the pen; `None` if no motor does.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    fn checked_lift(&self) -> Result<Option<LiftRule>, LimitsError> {
        if !self.is_on(Setting::PenLift) {
            return Ok(None);
        }
        let per_second = |setting, seconds| {
            let product = u64::from(self.get(setting).to_bits().unsigned_abs())
                * u64::from(self.get(Setting::StepsPerMmZ).to_bits().unsigned_abs());
            // The result is below 2^27 steps.
            ((product >> (2 * Value::FRAC_NBITS)) / seconds) as u32
        };
        let asked = per_second(Setting::MaxRateZ, 60);
        if asked > GREATEST_LIFT_RATE {
            return Err(LimitsError::TooManySteps { asked, possible: GREATEST_LIFT_RATE });
        }
        let travel = self.millimetres_as_steps(Setting::TravelZ, Setting::StepsPerMmZ);
        Ok(Some(LiftRule::new(travel, asked, per_second(Setting::AccelerationZ, 1))))
    }

    fn axes_rate(&self) -> Value {
        self.get(Setting::MaxRateX).min(self.get(Setting::MaxRateY))
    }

    fn motion_settings(&self) -> MotionSettings {
        let steps = self.page_steps();
        MotionSettings {
            steps_per_mm: steps,
            motor_steps_per_mm: match self.kinematics() {
                Kinematics::Cartesian => steps[0].max(steps[1]),
                // A diagonal move on the page is √2 times as long for one of the motors.
                Kinematics::CoreXy => steps[0].saturating_mul(Value::SQRT_2),
                // A belt never moves faster than the pen.
                Kinematics::Polargraph(_) => steps[0],
            },
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

    /// The kinematics of the machine. With CoreXY and polargraph kinematics, the steps per
    /// millimetre of x apply to both motors.
    pub fn kinematics(&self) -> Kinematics {
        let steps =
            |setting| self.millimetres_as_steps(setting, Setting::StepsPerMmX).min(2 * PAGE_LIMIT);
        match self.get(Setting::Kinematics).to_bits() >> Value::FRAC_NBITS {
            0 => Kinematics::Cartesian,
            1 => Kinematics::CoreXy,
            _ => Kinematics::Polargraph(Anchors {
                left: PagePoint { x: -steps(Setting::AnchorLeft), y: steps(Setting::AnchorHeight) },
                width: steps(Setting::AnchorWidth),
            }),
        }
    }

    /// The steps per millimetre on the page, for x and y.
    pub fn page_steps(&self) -> [Value; 2] {
        [self.get(Setting::StepsPerMmX), self.get(self.steps_per_mm_y())]
    }

    /// The setting that holds the steps per millimetre of y on the page. It is that of x where
    /// belts move both axes.
    pub(super) fn steps_per_mm_y(&self) -> Setting {
        if self.get(Setting::Kinematics) == 0 { Setting::StepsPerMmY } else { Setting::StepsPerMmX }
    }

    /// Converts a setting in millimetres to steps of the page, rounded down.
    pub(super) fn millimetres_as_steps(&self, setting: Setting, steps_per_mm: Setting) -> i32 {
        let steps =
            i64::from(self.get(setting).to_bits()) * i64::from(self.get(steps_per_mm).to_bits());
        // The result is at most 8000 mm times 4000 steps per millimetre.
        (steps >> (2 * Value::FRAC_NBITS)) as i32
    }

    /// Converts steps of the page to millimetres, clamped to the range of a value.
    pub(super) fn steps_as_millimetres(&self, steps: i32, steps_per_mm: Setting) -> Value {
        let per_mm = i64::from(self.get(steps_per_mm).to_bits()).max(1);
        let bits = (i64::from(steps) << (2 * Value::FRAC_NBITS)) / per_mm;
        Value::from_bits(bits.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
    }

    /// The heights, dwells and other settings of the pen that the motion planner needs.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) fn pen_positions(&self) -> PenPositions {
        PenPositions {
            up_height: self.height(Setting::PenUpHeight),
            down_height: self.height(Setting::PenDownHeight),
            up_ticks: self.milliseconds_as_ticks(Setting::PenUpDwell),
            down_ticks: self.milliseconds_as_ticks(Setting::PenDownDwell),
            ramp_ticks: self.milliseconds_as_ticks(Setting::PenRamp) / 127,
            dot_length: self.get(Setting::DotLength).saturating_to_num(),
            // `set` refuses whatever would be refused here.
            lift: self.checked_lift().unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_order_and_its_defaults_are_valid() {
        for (index, info) in SETTINGS.iter().enumerate() {
            assert_eq!(info.setting as usize, index);
            assert_eq!(Setting::numbered(info.number), Some(info.setting));
            assert!(info.least <= info.default && info.default <= info.greatest);
        }
        assert!(SETTINGS.is_sorted_by(|a, b| a.number < b.number));
        assert!(Settings::default().checked_limits().is_ok());
    }

    #[test]
    fn a_refused_value_changes_nothing() {
        let mut settings = Settings::default();
        let before = settings;
        for info in &SETTINGS {
            for value in [info.least - Value::DELTA, info.greatest + Value::DELTA] {
                assert_eq!(
                    settings.set(info.setting, value),
                    Err(SettingError::OutOfRange(info.setting))
                );
            }
        }
        assert_eq!(
            settings.set(Setting::SoftLimits, Value::from_num(0.5)),
            Err(SettingError::NotWhole(Setting::SoftLimits))
        );
        assert!(matches!(
            settings.set(Setting::StepPulse, Value::from_num(400)),
            Err(SettingError::Conflict(LimitsError::TooManySteps { .. }))
        ));
        assert_eq!(settings, before);
    }

    #[test]
    fn restored_settings_are_those_that_were_kept_or_the_defaults() {
        let mut settings = Settings::default();
        settings.set(Setting::TravelX, Value::from_num(300)).expect("valid");
        settings.set(Setting::StepPulse, Value::from_num(1.5)).expect("valid");
        let kept = |settings: &Settings| {
            settings.iter().map(|(info, value)| (info.number, value)).collect::<std::vec::Vec<_>>()
        };
        let mut values = kept(&settings);
        assert_eq!(Settings::restored(values.clone()), settings);
        values.push((9999, Value::ONE)); // of another version
        assert_eq!(Settings::restored(values.clone()), settings);
        for (number, value) in [(130, 0.0), (20, 0.5), (0, 400.0)] {
            let mut spoilt = values.clone();
            spoilt.push((number, Value::from_num(value)));
            assert_eq!(Settings::restored(spoilt), Settings::default());
        }
    }

    #[test]
    fn ticks() {
        let settings = Settings::default();
        assert_eq!(settings.microseconds_as_ticks(Setting::StepPulse), 50);
        assert_eq!(settings.milliseconds_as_ticks(Setting::PenUpDwell), 3_750_000);
    }
}
