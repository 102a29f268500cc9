//! Settings of a machine by number and value, and the machine that the library on this computer
//! simulates with them.

use penup::fixed::Decimal;
use penup::machine::{SETTINGS, Setting, SettingError, Settings, Value};
use penup::protocol::CommandError;

/// A setting and the value that it has or shall have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssignedSetting {
    /// The number of the setting.
    pub number: u16,
    /// The value, a decimal number.
    pub value: String,
}

/// The reason why no machine has these settings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("setting {number} cannot be {value}: {reason}")]
pub struct NoSuchMachine {
    /// The number of the setting that is refused.
    pub number: u16,
    /// The value that it should have.
    pub value: String,
    /// The reason, as the library gives it.
    pub reason: CommandError,
}

impl AssignedSetting {
    /// Parses `NUMBER=VALUE`; a `$` before the number does no harm.
    ///
    /// # Errors
    /// The reason why the text is no assignment, for the user.
    ///
    /// ```
    /// use penup_job::machine_settings::AssignedSetting;
    /// assert_eq!(AssignedSetting::parse("$100=88.9")?.number, 100);
    /// assert!(AssignedSetting::parse("100=fast").is_err());
    /// # Ok::<(), String>(())
    /// ```
    pub fn parse(text: &str) -> Result<Self, String> {
        let (setting, value) =
            text.split_once('=').ok_or("a setting has the form NUMBER=VALUE, such as 100=80")?;
        let setting = setting.trim().trim_start_matches('$');
        let number = setting.parse().map_err(|_| format!("\"{setting}\" is no number"))?;
        let value = value.trim();
        match value.parse::<f64>() {
            Ok(parsed) if parsed.is_finite() => Ok(Self { number, value: value.to_owned() }),
            _ => Err(format!("the value \"{value}\" is not a number")),
        }
    }

    /// The setting that a line of a plotter such as `$100=80.000` tells. Firmware of before has its
    /// name behind it.
    pub fn told(line: &str) -> Option<Self> {
        let assignment = line.strip_prefix('$')?.split(' ').next()?;
        Self::parse(assignment).ok()
    }

    /// The value as a plotter keeps it, rounded to 2^-16; `None` if it is beyond what a setting can
    /// be.
    pub fn kept(&self) -> Option<Value> {
        Decimal::parse(&self.value).ok()?.to_millimetres().ok()
    }

    /// The name of the setting, if this program knows it.
    pub fn name(&self) -> Option<&'static str> {
        SETTINGS.iter().find(|info| info.number() == self.number).map(|info| info.name)
    }
}

/// The value of a setting among those that a plotter has told; 0 if it has not told it.
pub fn value(settings: &[AssignedSetting], setting: Setting) -> f64 {
    let number = setting.info().number();
    let own = settings.iter().find(|it| it.number == number);
    own.and_then(|it| it.value.parse::<f64>().ok()).unwrap_or_default()
}

/// The number of the setting after which silence of the computer a drawing waits.
const SILENCE_BEFORE_HOLD: u16 = 218;

/// The settings that a machine has with `assigned`, and otherwise with the defaults. It needs no
/// homing, because a machine on a computer stands at its origin, and it never waits for a silent
/// computer.
///
/// # Errors
/// A setting is unknown or out of its range, or settings do not fit each other.
pub fn simulated(assigned: &[AssignedSetting]) -> Result<Settings, NoSuchMachine> {
    let mut settings = Settings::default();
    let mut left: Vec<&AssignedSetting> = assigned.iter().collect();
    // Two settings may only fit each other once both are set, whichever comes first.
    while !left.is_empty() {
        let mut refused = Vec::new();
        let mut first_reason = None;
        for setting in &left {
            if let Err(reason) = set(&mut settings, setting) {
                refused.push(*setting);
                let AssignedSetting { number, value } = (*setting).clone();
                let reason = CommandError::Setting(reason);
                first_reason.get_or_insert(NoSuchMachine { number, value, reason });
            }
        }
        match first_reason {
            Some(reason) if refused.len() == left.len() => return Err(reason),
            _ => left = refused,
        }
    }
    // These conflict with nothing. Some builds of the library do not have the second one.
    let _ = settings.set(Setting::Homing, Value::ZERO);
    if let Some(silence) = Setting::numbered(SILENCE_BEFORE_HOLD) {
        let _ = settings.set(silence, Value::ZERO);
    }
    Ok(settings)
}

/// Whether each motor moves one axis, and both make steps of the same length, so that the pins tell
/// where the pen is.
pub fn is_grid(settings: &Settings) -> bool {
    let [x, y] = settings.page_steps();
    settings.get(Setting::Kinematics) == 0 && x == y
}

fn set(settings: &mut Settings, assigned: &AssignedSetting) -> Result<(), SettingError> {
    let setting = Setting::numbered(assigned.number).ok_or(SettingError::Unknown)?;
    settings.set(setting, assigned.kept().ok_or(SettingError::OutOfRange(setting))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assigned(settings: &[&str]) -> Vec<AssignedSetting> {
        let parse = |text: &&str| AssignedSetting::parse(text).expect("a setting");
        settings.iter().map(parse).collect()
    }

    #[test]
    fn a_setting_is_a_number_and_a_value() {
        let parsed = |text| AssignedSetting::parse(text).map(|it| (it.number, it.value));
        assert_eq!(parsed("100=88.9"), Ok((100, "88.9".to_owned())));
        assert_eq!(parsed("$3 = 1"), Ok((3, "1".to_owned())));
        for bad in ["100", "x=1", "100=", "100=fast", "100=inf", "70000=1"] {
            assert!(parsed(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_machine_has_what_is_assigned_in_any_order_and_needs_no_homing() {
        let anchors = ["230=2", "231=300", "232=100", "233=1200", "22=1"];
        let backwards: Vec<&str> = anchors.iter().rev().copied().collect();
        for order in [&anchors[..], &backwards] {
            let settings = simulated(&assigned(order)).expect("a polargraph");
            assert_eq!(settings.get(Setting::Kinematics), 2);
            assert_eq!(settings.get(Setting::AnchorWidth), 300);
            assert_eq!(settings.get(Setting::Homing), 0);
        }
        for (bad, number) in [("100=1", 100), ("999=1", 999), ("100=1e300", 100), ("204=5000", 204)]
        {
            let refused = simulated(&assigned(&["110=1500", bad])).expect_err("refused");
            assert_eq!(refused.number, number, "{refused}");
        }
    }
}
