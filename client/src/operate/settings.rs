//! `penup set` and `penup settings`.
//!
//! A line of settings has no checksum, so settings are read until two answers agree. What is set is
//! read back.

use super::converse;
use super::settings_file::SavedSettings;
use crate::cli::{PlotterArgs, SetArgs};
use crate::error::Error;
use crate::machine_settings::AssignedSetting;
use crate::outcome::Outcome;
use crate::output;
use crate::sender::Sender;
use penup_job::protocol::{BUILD, Reply, SETTINGS};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// How often the settings are read while no two answers agree.
const MOST_READINGS: u32 = 10;

/// How far the shown value of a setting may be from what it was set to: the plotter rounds to 2^-16
/// and shows three decimals.
const SHOWN: f64 = 0.0006;

/// Sets settings of the machine. All are sent: the plotter shows three decimals of a setting and
/// keeps more, so one that it shows may be another.
///
/// # Errors
/// A setting is refused, or as [`Sender::ask`].
pub fn set(args: &SetArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let (changed, all) = converse(&args.plotter, interrupt, |sender| {
        let changed = differing(&read(sender)?, &args.settings).len();
        assign(sender, &args.settings)?;
        Ok((changed, read(sender)?))
    })?;
    Ok(told(changed, &args.settings, &all))
}

/// Lists the settings.
///
/// # Errors
/// As [`Sender::ask`].
pub fn show(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let settings = converse(args, interrupt, read)?;
    let line = |it: &AssignedSetting| {
        format!("{:>3} = {:<10} {}", it.number, it.value, it.name().unwrap_or_default())
            .trim_end()
            .to_owned()
    };
    let text = settings.iter().map(line).collect::<Vec<_>>().join("\n");
    Ok(Outcome::answer(text, as_json(&settings)))
}

/// Writes the settings to `file`, or to the standard output.
///
/// # Errors
/// The file cannot be written, or as [`Sender::ask`].
pub fn save(
    file: Option<&Path>,
    args: &PlotterArgs,
    interrupt: &AtomicBool,
) -> Result<Outcome, Error> {
    if let Some(file) = file {
        output::check_outputs(&[file])?;
    }
    let (settings, firmware) =
        converse(args, interrupt, |sender| Ok((read(sender)?, firmware(sender)?)))?;
    let json = as_json(&settings);
    let count = settings.len();
    let text = SavedSettings { settings }.to_toml(&firmware);
    let Some(file) = file else { return Ok(Outcome::answer(text.trim_end(), json)) };
    output::write(file, text.as_bytes())?;
    Ok(Outcome::done(format!("{}: {count} settings", file.display()), json))
}

/// Sets what `file` says.
///
/// # Errors
/// The file cannot be read, a setting is refused, or as [`Sender::ask`].
pub fn restore(file: &Path, args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let saved = SavedSettings::read(file)?;
    let (changed, all) = converse(args, interrupt, |sender| {
        let changed = change(sender, &saved.settings)?;
        Ok((changed, read(sender)?))
    })?;
    Ok(told(changed, &saved.settings, &all))
}

/// Says how many settings were changed, with the values that the machine has now.
fn told(changed: usize, wanted: &[AssignedSetting], all: &[AssignedSetting]) -> Outcome {
    let is_wanted = |now: &&AssignedSetting| wanted.iter().any(|it| it.number == now.number);
    let now: Vec<AssignedSetting> = all.iter().filter(is_wanted).cloned().collect();
    let text = match changed {
        0 => "the machine has these settings".to_owned(),
        1 => "1 setting is changed".to_owned(),
        changed => format!("{changed} settings are changed"),
    };
    Outcome::done(text, as_json(&now))
}

pub(super) fn as_json(settings: &[AssignedSetting]) -> Value {
    let value = |it: &AssignedSetting| it.value.parse::<f64>().map_or(Value::Null, |it| json!(it));
    let pairs = settings.iter().map(|it| (it.number.to_string(), value(it)));
    json!({ "settings": pairs.collect::<Map<_, _>>() })
}

/// The value of a setting that the plotter shows.
fn shown(all: &[AssignedSetting], it: &AssignedSetting) -> Option<f64> {
    all.iter().find(|now| now.number == it.number)?.value.parse().ok()
}

/// Those of the `wanted` settings that are not what the plotter shows.
fn differing(shown_now: &[AssignedSetting], wanted: &[AssignedSetting]) -> Vec<AssignedSetting> {
    let differs = |it: &&AssignedSetting| shown(shown_now, it) != it.value.parse().ok();
    wanted.iter().filter(differs).cloned().collect()
}

/// Sets those settings that differ from what the plotter shows, because each one that is sent is
/// written to its flash. Checks that the machine then has them. Returns how many differed.
pub(super) fn change(sender: &mut Sender<'_>, wanted: &[AssignedSetting]) -> Result<usize, Error> {
    let wanted = differing(&read(sender)?, wanted);
    assign(sender, &wanted)?;
    Ok(wanted.len())
}

/// Sets all these settings, and checks that the machine then has them.
fn assign(sender: &mut Sender<'_>, wanted: &[AssignedSetting]) -> Result<(), Error> {
    let mut left: Vec<&AssignedSetting> = wanted.iter().collect();
    // Two settings may only fit each other once both are changed, whichever comes first; so what is
    // refused is tried again after the others.
    while !left.is_empty() {
        let (mut refused, mut first_refusal) = (Vec::new(), None);
        for setting in &left {
            match sender.ask(&format!("${}={}", setting.number, setting.value)) {
                Ok(_) => {}
                Err(error @ Error::Refused { .. }) => {
                    refused.push(*setting);
                    first_refusal.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        match first_refusal {
            Some(error) if refused.len() == left.len() => return Err(error),
            _ => left = refused,
        }
    }
    let after = read(sender)?;
    let has_taken = |it: &&AssignedSetting| match (shown(&after, it), it.value.parse::<f64>()) {
        (Some(now), Ok(wanted)) => (now - wanted).abs() <= SHOWN,
        _ => false,
    };
    match wanted.iter().find(|it| !has_taken(it)) {
        Some(setting) => Err(Error::NotSet { number: setting.number }),
        None => Ok(()),
    }
}

/// Reads all settings.
pub(crate) fn read(sender: &mut Sender<'_>) -> Result<Vec<AssignedSetting>, Error> {
    agreed(sender, |sender| {
        let replies = sender.ask(SETTINGS)?;
        let settings: Vec<_> = replies.iter().filter_map(setting_in).collect();
        Ok(Some(settings).filter(|settings| !settings.is_empty()))
    })
}

/// The setting that a line such as `$100=80.000 (steps per mm of x, step/mm)` tells.
fn setting_in(reply: &Reply) -> Option<AssignedSetting> {
    let Reply::Other(line) = reply else { return None };
    let assignment = line.strip_prefix('$')?.split(' ').next()?;
    AssignedSetting::parse(assignment).ok()
}

/// The version of the firmware and the board that it runs on.
fn firmware(sender: &mut Sender<'_>) -> Result<String, Error> {
    agreed(sender, |sender| {
        let version = |reply: &Reply| match reply {
            Reply::Other(line) => Some(line.strip_prefix("[VER:")?.strip_suffix(']')?.to_owned()),
            _ => None,
        };
        Ok(sender.ask(BUILD)?.iter().find_map(version))
    })
}

/// Asks until two answers in a row are the same.
pub(super) fn agreed<T: PartialEq>(
    sender: &mut Sender<'_>,
    mut ask: impl FnMut(&mut Sender<'_>) -> Result<Option<T>, Error>,
) -> Result<T, Error> {
    let mut last = None;
    for _ in 0..MOST_READINGS {
        match ask(sender)? {
            Some(answer) if last.as_ref() == Some(&answer) => return Ok(answer),
            answer => last = answer,
        }
    }
    Err(Error::Damaged { line: None, times: MOST_READINGS })
}

#[cfg(test)]
mod tests {
    use super::{assign, change};
    use crate::fake::{FakePlotter, Fault};
    use crate::machine_settings::AssignedSetting;
    use crate::sender::{Sender, Timeouts};
    use std::sync::atomic::AtomicBool;

    /// What the plotter is sent that shows `$100=80.000`.
    fn sent(value: &str, is_restored: bool) -> Vec<String> {
        let wanted = [AssignedSetting { number: 100, value: value.to_owned() }];
        let mut plotter = FakePlotter::new(Fault::None);
        let interrupt = AtomicBool::new(false);
        let (mut sender, _) =
            Sender::open_for_orders(&mut plotter, Timeouts::default(), &interrupt).expect("opened");
        match is_restored {
            true => drop(change(&mut sender, &wanted).expect("set")),
            false => assign(&mut sender, &wanted).expect("set"),
        }
        plotter.lines
    }

    #[test]
    fn a_change_that_the_plotter_does_not_show_is_sent() {
        assert_eq!(sent("80.0003", false), ["$100=80.0003"]);
        assert_eq!(sent("80.0003", true), ["$100=80.0003"]);
        // It may have been 80.0003 before.
        assert_eq!(sent("80", false), ["$100=80"]);
        assert!(sent("80", true).is_empty());
    }
}
