//! The file in which `penup settings save` keeps the settings of a machine: TOML with a table of
//! numbers and values.

use crate::error::Error;
use crate::files;
use crate::machine_settings::AssignedSetting;
use std::fmt::Write as _;
use std::io;
use std::path::Path;
use toml::{Table, Value};

/// The name of the table with the settings.
const TABLE: &str = "settings";

/// The reason why a file holds no settings.
#[derive(Debug, thiserror::Error)]
pub enum SettingsFileError {
    /// The file is no TOML.
    #[error("this is not TOML: {0}")]
    Syntax(#[from] toml::de::Error),
    /// There is no table of settings.
    #[error("there is no table [{TABLE}] in it: is it a file of `penup settings save`?")]
    NoTable,
    /// A setting has no number.
    #[error("[{TABLE}] holds {0}, and settings have numbers, as in 100 = 80")]
    NoNumber(String),
    /// A value is no number.
    #[error("the value of setting {0} is no number")]
    NoValue(String),
}

/// Settings of a machine with their values.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SavedSettings {
    /// The settings in the order of their numbers.
    pub settings: Vec<AssignedSetting>,
}

impl SavedSettings {
    /// The contents of a file.
    ///
    /// ```
    /// use penup_client::operate::SavedSettings;
    /// let saved = SavedSettings::parse("[settings]\n100 = 88.9\n3 = 1\n").unwrap();
    /// let text = saved.to_toml("penup 0.1.0");
    /// let (_, rows) = text.split_once("firmware: penup 0.1.0\n").unwrap();
    /// assert_eq!(
    ///     rows,
    ///     "[settings]\n3 = 1 # invert directions\n100 = 88.9 # steps per mm of x\n"
    /// );
    /// ```
    pub fn to_toml(&self, firmware: &str) -> String {
        let mut text = format!(
            "# Settings of a plotter, saved by `penup settings save`; firmware: {firmware}\n\
             [{TABLE}]\n"
        );
        for setting in &self.settings {
            let name = setting.name().map(|name| format!(" # {name}")).unwrap_or_default();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{} = {}{name}", setting.number, setting.value);
        }
        text
    }

    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or holds no settings.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let name = file.display().to_string();
        let unreadable = |source| Error::File { file: name.clone(), source };
        let text = String::from_utf8(files::bytes(file)?)
            .map_err(|error| unreadable(io::Error::new(io::ErrorKind::InvalidData, error)))?;
        Self::parse(&text).map_err(|source| Error::SettingsFile { file: name.clone(), source })
    }

    /// Reads the contents of a file.
    ///
    /// # Errors
    /// See [`SettingsFileError`].
    pub fn parse(text: &str) -> Result<Self, SettingsFileError> {
        let file: Table = text.parse()?;
        let Some(Value::Table(table)) = file.get(TABLE) else {
            return Err(SettingsFileError::NoTable);
        };
        let setting = |(key, value): (&String, &Value)| {
            let number = key.parse().map_err(|_| SettingsFileError::NoNumber(key.clone()))?;
            let value = match value {
                Value::Integer(value) => value.to_string(),
                Value::Float(value) if value.is_finite() => value.to_string(),
                _ => return Err(SettingsFileError::NoValue(key.clone())),
            };
            Ok(AssignedSetting { number, value })
        };
        let mut settings =
            table.iter().map(setting).collect::<Result<Vec<_>, SettingsFileError>>()?;
        settings.sort_by_key(|setting| setting.number);
        Ok(Self { settings })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_of_settings_is_refused_with_the_reason() {
        for (text, reason) in [
            ("x = [", "not TOML"),
            ("port = 1", "no table [settings]"),
            ("[settings]\nspeed = 1", "holds speed"),
            ("[settings]\n100 = \"fast\"", "setting 100 is no number"),
            ("[settings]\n100 = nan", "setting 100 is no number"),
        ] {
            let error = SavedSettings::parse(text).expect_err("refused").to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
