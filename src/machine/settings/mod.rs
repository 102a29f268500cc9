//! The numbered settings and their values.
//!
//! Numbers up to 132 have the meaning that they have in Grbl 1.1, with one exception: 5 is a mask
//! here, and it also covers the emergency stop. What a board does not have is fixed: any other
//! value is refused. Numbers from 200 on are penup's own. A value is checked when it is entered,
//! both alone and together with the other values. A refused value changes nothing.
//!
//! The settings themselves are rows of a table ([`SETTINGS`]). Checks of several settings together
//! belong to the part that obeys them: the kinematics, the tool, and the limits of motion.

mod motion;
mod table;

pub use table::{SETTINGS, Setting, SettingInfo};

use super::Kinematics;
use crate::array::MapEach;
use crate::drawing::PagePoint;
use crate::fixed::Millimetres;
use crate::motion::{LimitsError, TICKS_PER_SECOND};

/// A value of any setting, between -32768 and 32768 with a resolution of 2^-16, in the unit of the
/// setting.
pub type Value = Millimetres;

impl SettingInfo {
    /// Checks a value of this setting alone.
    ///
    /// # Errors
    /// [`SettingError::OutOfRange`], [`SettingError::Negative`] or [`SettingError::NotWhole`].
    pub(crate) fn check(&self, value: Value) -> Result<(), SettingError> {
        if value < 0 && self.least >= 0 {
            return Err(SettingError::Negative(self.setting));
        }
        if value < self.least || value > self.greatest {
            return Err(SettingError::OutOfRange(self.setting));
        }
        if self.whole && value.frac() != 0 {
            return Err(SettingError::NotWhole(self.setting));
        }
        Ok(())
    }
}

/// The reasons why a change of a setting is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SettingError {
    /// No setting of the machine has this number.
    Unknown,
    /// The value is below `least` or above `greatest` of [`Setting::info`].
    OutOfRange(Setting),
    /// The value is negative where none may be.
    Negative(Setting),
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
    /// The value of each setting, in the order of [`SETTINGS`].
    values: [Value; SETTINGS.len()],
}

impl Default for Settings {
    fn default() -> Self {
        Self { values: core::array::from_fn(|index| SETTINGS[index].default) }
    }
}

impl Settings {
    /// The value of a setting, in its unit.
    pub fn get(&self, setting: Setting) -> Value {
        self.values.get(setting as usize).copied().unwrap_or_default()
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
        setting.info().check(value)?;
        let mut changed = *self;
        if let Some(slot) = changed.values.get_mut(setting as usize) {
            *slot = value;
        }
        changed.check().map_err(SettingError::Conflict)?;
        *self = changed;
        Ok(())
    }

    /// Restores settings that were read from [`Settings::iter`] before. `values` are pairs of
    /// number and value; settings that are not among them get their defaults, and numbers that no
    /// longer exist are ignored. A value that is out of its range, or conflicts with others, is
    /// left out, too: that setting gets its default, and all others are restored.
    pub fn restored(values: impl IntoIterator<Item = (u16, Value)> + Clone) -> Self {
        let known = |(number, value)| Setting::numbered(number).map(|setting| (setting, value));
        let mut restored = Self::default();
        for (setting, value) in values.clone().into_iter().filter_map(known) {
            if setting.info().check(value).is_ok()
                && let Some(slot) = restored.values.get_mut(setting as usize)
            {
                *slot = value;
            }
        }
        if restored.check().is_ok() {
            return restored;
        }
        // One by one, as a user would send them. Some are valid only behind others, which may come
        // later, so they are tried again until a turn changes nothing.
        let mut restored = Self::default();
        loop {
            let before = restored;
            for (setting, value) in values.clone().into_iter().filter_map(known) {
                let _ = restored.set(setting, value);
            }
            if restored == before {
                return restored;
            }
        }
    }

    /// All settings with their values, sorted by number.
    pub fn iter(&self) -> impl Iterator<Item = (&'static SettingInfo, Value)> {
        SETTINGS.iter().zip(self.values)
    }

    /// Whether a setting is on. It is for those whose value is 0 (off) or 1 (on).
    pub fn is_on(&self, setting: Setting) -> bool {
        self.get(setting) != 0
    }

    /// The value of a setting in units of 2^-16 of its unit; at least 1.
    pub(super) fn positive_bits(&self, setting: Setting) -> u64 {
        u64::from(self.get(setting).to_bits().unsigned_abs()).max(1)
    }

    /// The value of a setting, rounded down to a whole number of its unit.
    pub(crate) fn whole(&self, setting: Setting) -> u32 {
        (self.get(setting).to_bits().max(0) >> Value::FRAC_NBITS).unsigned_abs()
    }

    /// Converts a setting in microseconds to ticks, the unit of time of step events.
    pub fn microseconds_as_ticks(&self, setting: Setting) -> u32 {
        self.as_ticks(setting, TICKS_PER_SECOND / 1_000_000)
    }

    /// Converts a setting in milliseconds to ticks, the unit of time of step events.
    pub fn milliseconds_as_ticks(&self, setting: Setting) -> u32 {
        self.as_ticks(setting, TICKS_PER_SECOND / 1000)
    }

    /// Converts a setting that is a time to ticks. `ticks_per_unit` is the number of ticks in its
    /// unit.
    fn as_ticks(&self, setting: Setting, ticks_per_unit: u32) -> u32 {
        let bits = u64::from(self.get(setting).to_bits().max(0).unsigned_abs());
        // The ranges of the settings keep the result below 2^27 ticks.
        ((bits * u64::from(ticks_per_unit)) >> Value::FRAC_NBITS) as u32
    }

    /// Returns the kinematics that the settings choose and describe.
    pub fn kinematics(&self) -> Kinematics {
        Kinematics::of(self)
    }

    /// The settings that hold the steps per millimetre of x and y on the page.
    pub(super) fn steps_per_mm(&self) -> [Setting; 2] {
        Kinematics::properties(self).steps_per_mm
    }

    /// The steps per millimetre on the page, for x and y.
    pub fn page_steps(&self) -> [Value; 2] {
        self.steps_per_mm().map_each(|setting| self.get(setting))
    }

    /// Converts two settings in millimetres, one for x and one for y, to steps on the page, rounded
    /// to the nearest step as every target is: a target that lies just at the end of the travel is
    /// within it.
    pub(super) fn page_point(&self, settings: [Setting; 2]) -> PagePoint {
        let [x, y] = self.steps_per_mm();
        PagePoint {
            x: self.rounded_steps(settings[0], x, 1 << (2 * Value::FRAC_NBITS - 1)),
            y: self.rounded_steps(settings[1], y, 1 << (2 * Value::FRAC_NBITS - 1)),
        }
    }

    /// Converts a setting in millimetres to steps, rounded down.
    pub(super) fn millimetres_as_steps(&self, setting: Setting, steps_per_mm: Setting) -> i32 {
        self.rounded_steps(setting, steps_per_mm, 0)
    }

    /// Converts a setting in millimetres to steps, rounded down once `addend` is added, in units of
    /// 2^-32 steps, which is at most one step.
    fn rounded_steps(&self, setting: Setting, steps_per_mm: Setting, addend: i64) -> i32 {
        let steps =
            i64::from(self.get(setting).to_bits()) * i64::from(self.get(steps_per_mm).to_bits());
        // The result is at most 8000 mm times 4000 steps per millimetre.
        ((steps + addend) >> (2 * Value::FRAC_NBITS)) as i32
    }

    /// Converts steps on the page to millimetres, clamped to the range of a value.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) fn millimetres(&self, point: PagePoint) -> [Value; 2] {
        let millimetres = |steps: i32, steps_per_mm: Value| {
            let per_mm = i64::from(steps_per_mm.to_bits()).max(1);
            let bits = (i64::from(steps) << (2 * Value::FRAC_NBITS)) / per_mm;
            Value::from_bits(bits.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
        };
        let [x, y] = self.page_steps();
        [millimetres(point.x, x), millimetres(point.y, y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_found_and_the_defaults_are_valid() {
        for info in SETTINGS {
            assert_eq!(Setting::numbered(info.number()), Some(info.setting));
            assert_eq!(Settings::default().get(info.setting), info.default);
        }
        assert!(Settings::default().check().is_ok());
    }

    #[test]
    fn a_refused_value_changes_nothing() {
        let mut settings = Settings::default();
        let before = settings;
        for info in SETTINGS {
            let [below, above] = [info.least - Value::DELTA, info.greatest + Value::DELTA];
            let out_of_range = Err(SettingError::OutOfRange(info.setting));
            let negative = Err(SettingError::Negative(info.setting));
            let is_negative = info.least == 0;
            assert_eq!(
                settings.set(info.setting, below),
                if is_negative { negative } else { out_of_range }
            );
            assert_eq!(settings.set(info.setting, above), out_of_range);
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
    fn restored_settings_are_those_that_were_kept_but_for_those_that_are_refused() {
        let mut settings = Settings::default();
        settings.set(Setting::TravelX, Value::from_num(300)).expect("valid");
        settings.set(Setting::StepPulse, Value::from_num(1.5)).expect("valid");
        let kept = |settings: &Settings| {
            settings
                .iter()
                .map(|(info, value)| (info.number(), value))
                .collect::<std::vec::Vec<_>>()
        };
        let mut values = kept(&settings);
        assert_eq!(Settings::restored(values.clone()), settings);
        values.push((9999, Value::ONE)); // of another version
        assert_eq!(Settings::restored(values.clone()), settings);
        // A value that is refused alone, one that is no whole number, and one that conflicts.
        for (number, value) in [(131, 0.0), (20, 0.5), (0, 400.0), (209, 2.0)] {
            let mut spoilt = values.clone();
            spoilt.retain(|(kept, _)| *kept != number);
            spoilt.push((number, Value::from_num(value)));
            let setting = Setting::numbered(number).expect("a setting");
            let mut expected = settings;
            expected.set(setting, setting.info().default).expect("valid");
            assert_eq!(Settings::restored(spoilt), expected, "{number}");
        }
        // Whichever comes first: the anchors of belts must lie above the page.
        for (setting, value) in
            [(Setting::AnchorHeight, 1500), (Setting::TravelY, 1000), (Setting::Kinematics, 2)]
        {
            settings.set(setting, Value::from_num(value)).expect("valid");
        }
        let mut values = kept(&settings);
        values.push((0, Value::from_num(400)));
        settings.set(Setting::StepPulse, Setting::StepPulse.info().default).expect("valid");
        for _ in 0..2 {
            values.reverse();
            values.retain(|kept| *kept != (0, Value::from_num(1.5)));
            assert_eq!(Settings::restored(values.clone()), settings);
        }
    }

    #[test]
    fn belts_whose_steps_cannot_be_counted_are_refused() {
        let mut settings = Settings::default();
        for (setting, value) in [(Setting::Kinematics, 2), (Setting::StepsPerMmX, 1600)] {
            settings.set(setting, Value::from_num(value)).expect("valid");
        }
        // 2^21 steps are 1310.72 mm.
        for (value, is_taken) in [(1310, true), (1311, false)] {
            let answer = settings.set(Setting::AnchorWidth, Value::from_num(value));
            assert_eq!(answer.is_ok(), is_taken, "{value}: {answer:?}");
        }
        let answer = settings.set(Setting::AnchorHeight, Value::from_num(1311));
        assert_eq!(answer, Err(SettingError::Conflict(LimitsError::Anchors)));
    }

    #[test]
    fn ticks() {
        let settings = Settings::default();
        assert_eq!(settings.microseconds_as_ticks(Setting::StepPulse), 50);
        assert_eq!(settings.milliseconds_as_ticks(Setting::PenUpDwell), 3_750_000);
    }
}
