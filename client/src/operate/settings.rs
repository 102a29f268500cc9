//! `penup set` and `penup settings`.
//!
//! A line of settings has no checksum, so lists of them are read until they agree about each. What
//! is set is read back.

use super::converse;
use super::settings_file::SavedSettings;
use crate::cli::{PlotterArgs, SetArgs};
use crate::error::Error;
use crate::machine_settings::AssignedSetting;
use crate::outcome::Outcome;
use crate::output;
use crate::sender::Sender;
use penup::machine::SETTINGS as KNOWN;
use penup_job::protocol::{BUILD, Reply, SETTINGS};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// How far a value that is shown with three decimals may be from what it was set to. Older firmware
/// shows so many, and every one rounds to 2^-16.
const SHOWN: f64 = 0.0006;

/// The greatest number of lists of settings that are asked for.
const MOST_LISTS: usize = 10;

/// Sets settings of the machine. All are sent: older firmware shows three decimals of a setting and
/// keeps more, so one that it shows may be another.
///
/// # Errors
/// A setting is given twice or refused, or as [`Sender::ask`].
pub fn set(args: &SetArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    fail_if_given_twice(&args.settings)?;
    let (changed, all) = converse(&args.plotter, interrupt, |sender| {
        let changed = differing(&read(sender)?, &args.settings).len();
        assign(sender, &args.settings)?;
        Ok((changed, read(sender)?))
    })?;
    Ok(told(changed, &args.settings, &all))
}

/// Checks that the command line gives each setting once: of two values one is a slip, and nobody
/// but the user knows which.
///
/// # Errors
/// A setting is given twice.
pub fn fail_if_given_twice(given: &[AssignedSetting]) -> Result<(), Error> {
    for (index, second) in given.iter().enumerate() {
        if let Some(first) = given.iter().take(index).find(|it| it.number == second.number) {
            return Err(Error::SettingTwice {
                number: second.number,
                values: [&first.value, &second.value].map(String::clone),
            });
        }
    }
    Ok(())
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

/// The setting of the same number that the plotter shows.
fn shown<'a>(all: &'a [AssignedSetting], it: &AssignedSetting) -> Option<&'a AssignedSetting> {
    all.iter().find(|now| now.number == it.number)
}

/// Those of the `wanted` settings that are not what the plotter shows.
fn differing(shown_now: &[AssignedSetting], wanted: &[AssignedSetting]) -> Vec<AssignedSetting> {
    let differs = |it: &&AssignedSetting| {
        let now = shown(shown_now, it).and_then(AssignedSetting::kept);
        now.is_none() || now != it.kept()
    };
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
    let has_taken =
        |wanted: &&AssignedSetting| shown(&after, wanted).is_some_and(|now| is_of(now, wanted));
    match wanted.iter().find(|it| !has_taken(it)) {
        Some(setting) => Err(Error::NotSet { number: setting.number }),
        None => Ok(()),
    }
}

/// Whether the plotter shows `now` where it has the value that is `wanted`.
fn is_of(now: &AssignedSetting, wanted: &AssignedSetting) -> bool {
    let has_decimals = now.value.split_once('.').is_some_and(|(_, decimals)| decimals.len() > 3);
    match (now.kept(), wanted.kept()) {
        (Some(now), Some(wanted)) if now == wanted => true,
        (Some(now), Some(wanted)) => {
            !has_decimals && (now.to_num::<f64>() - wanted.to_num::<f64>()).abs() <= SHOWN
        }
        _ => false,
    }
}

/// Reads all settings. A line of them has no checksum, so the list is asked for until each setting
/// has been told alike by two more lists than not, and none that this program knows is missing.
///
/// On a good line that takes two lists, a tenth of a second each. Where the line turns over a bit
/// of one byte in 250, it takes up to [`MOST_LISTS`], as it does with firmware that lacks a setting
/// that this program knows. By calculation, a wrong value is believed once in some 300,000 times at
/// most, which is where the line damages one byte in 1,000: on a worse one more lists are compared.
pub(crate) fn read(sender: &mut Sender<'_>) -> Result<Vec<AssignedSetting>, Error> {
    let mut lists = Vec::new();
    while lists.len() < MOST_LISTS {
        let replies = sender.ask(SETTINGS)?;
        lists.push(replies.iter().filter_map(setting_in).collect());
        if let Some(settings) = agreed(&lists).filter(|settings| !settings.is_empty()) {
            return Ok(settings);
        }
    }
    Err(Error::Damaged { line: None, times: MOST_LISTS as u32 })
}

/// What the lists tell of each setting, by its number; `None` as long as they do not agree.
fn agreed(lists: &[Vec<AssignedSetting>]) -> Option<Vec<AssignedSetting>> {
    let told = lists.iter().flatten().map(|setting| setting.number);
    let numbers: BTreeSet<u16> = KNOWN.iter().map(|info| info.number()).chain(told).collect();
    let mut settings = Vec::new();
    for number in numbers {
        let told: Vec<&AssignedSetting> =
            lists.iter().filter_map(|list| list.iter().find(|it| it.number == number)).collect();
        let is_agreed = |it: &&&AssignedSetting| {
            let alike = told.iter().filter(|other| other == it).count();
            2 * alike >= lists.len() + 2
        };
        match told.iter().find(is_agreed) {
            Some(setting) => settings.push((*setting).clone()),
            // Damage has made this number, or this firmware has no such setting.
            None if lists.len() == MOST_LISTS && 2 * told.len() < lists.len() => {}
            None => return None,
        }
    }
    Some(settings)
}

/// The setting that a reply tells.
fn setting_in(reply: &Reply) -> Option<AssignedSetting> {
    let Reply::Other(line) = reply else { return None };
    AssignedSetting::told(line)
}

/// The version of the firmware and the board that it runs on.
fn firmware(sender: &mut Sender<'_>) -> Result<String, Error> {
    sender.agreed(|sender| {
        let version = |reply: &Reply| match reply {
            Reply::Other(line) => Some(line.strip_prefix("[VER:")?.strip_suffix(']')?.to_owned()),
            _ => None,
        };
        Ok(sender.ask(BUILD)?.iter().find_map(version))
    })
}

#[cfg(test)]
mod tests {
    use super::super::settings_file::SavedSettings;
    use super::{assign, change, is_of, read};
    use crate::fake::{FakePlotter, Fault};
    use crate::link::{Answer, Link};
    use crate::machine_settings::{AssignedSetting, simulated};
    use crate::preview::InMemory;
    use crate::sender::{Sender, Timeouts};
    use penup::machine::{SETTINGS, Setting, Settings, Value};
    use penup_job::room::Room;
    use proptest::collection::vec;
    use proptest::prelude::*;
    use std::collections::VecDeque;
    use std::io;
    use std::sync::atomic::AtomicBool;
    use std::time::{Duration, Instant};

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

    #[test]
    fn a_value_with_more_than_three_decimals_is_shown_exactly() {
        let of = |value: &str| AssignedSetting { number: 100, value: value.to_owned() };
        for (now, wanted, is_wanted) in [
            ("80.000", "80", true),
            // Older firmware shows three decimals of any value.
            ("80.000", "80.0003", true),
            ("80.00031", "80.0003", true),
            ("80.00031", "80.0004", false),
            ("80.001", "80", false),
        ] {
            assert_eq!(is_of(&of(now), &of(wanted)), is_wanted, "{now} {wanted}");
        }
    }

    /// A machine with a value of each setting, at this part of its range, that is `near` from its
    /// least to its greatest. What conflicts with the others keeps its default.
    fn machine(parts: &[(u32, bool)]) -> Settings {
        let mut settings = Settings::default();
        for (info, (part, is_near)) in SETTINGS.iter().zip(parts) {
            let [low, high] = [info.least, info.greatest].map(|end| i64::from(end.to_bits()));
            let default = i64::from(info.default.to_bits());
            let bits = match is_near {
                // A little above or below the default, which hardly anything conflicts with.
                true => default + i64::from(*part >> 12) - (1 << 19),
                false => low + (((high - low) * i64::from(*part)) >> 32),
            };
            let bits = i32::try_from(bits.clamp(low, high)).expect("within the range");
            let value = Value::from_bits(bits);
            let value = if info.whole { value.floor() } else { value };
            let _ = settings.set(info.setting, value);
        }
        settings
    }

    /// A plotter in memory whose line damages one byte in so many of its list of settings: it turns
    /// one bit over. The list that is sent as the first one `lacks` its line with this beginning.
    struct Damaging {
        plotter: InMemory<u16>,
        one_in: u64,
        random: u64,
        lacks: Option<&'static str>,
        said: VecDeque<u8>,
    }

    impl Damaging {
        fn new(one_in: u64, seed: u64, lacks: Option<&'static str>) -> Self {
            let plotter = InMemory::new(Room::usual(), Settings::default());
            let random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
            Self { plotter, one_in, random, lacks, said: VecDeque::new() }
        }

        fn random(&mut self) -> u64 {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            self.random >> 20
        }
    }

    impl Link for Damaging {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.plotter.send(bytes)
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
            loop {
                // Whole lines are passed on, so that it is known what a byte belongs to.
                let Some(end) = self.said.iter().position(|byte| *byte == b'\n') else {
                    let mut heard = [0; 256];
                    let count = self.plotter.receive(&mut heard, timeout)?;
                    self.said.extend(&heard[..count]);
                    if count == 0 {
                        return Ok(0);
                    }
                    continue;
                };
                let mut line: Vec<u8> = self.said.drain(..=end).collect();
                if self.lacks.is_some_and(|begin| line.starts_with(begin.as_bytes())) {
                    self.lacks = None;
                    continue;
                }
                let is_setting = line.starts_with(b"$");
                for byte in line.iter_mut().filter(|_| is_setting) {
                    if self.random().is_multiple_of(self.one_in) {
                        *byte ^= 1 << (self.random() % 8);
                    }
                }
                buffer[..line.len()].copy_from_slice(&line);
                return Ok(line.len());
            }
        }

        fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
            self.plotter.change_pen(pen)
        }

        fn now(&self) -> Instant {
            self.plotter.now()
        }
    }

    fn true_settings() -> Vec<AssignedSetting> {
        with_sender(&mut Damaging::new(u64::MAX, 1, None), read).expect("read")
    }

    #[test]
    fn settings_are_read_over_a_line_that_damages_each_list() {
        let settings = true_settings();
        assert_eq!(settings.len(), SETTINGS.len());
        for one_in in [500, 250] {
            for seed in 0..40 {
                let read = with_sender(&mut Damaging::new(one_in, seed, None), read);
                assert_eq!(read.as_ref().ok(), Some(&settings), "1 in {one_in}: {seed}");
            }
        }
    }

    #[test]
    fn a_setting_whose_line_was_lost_is_read() {
        let settings = true_settings();
        for lacks in ["$0=", "$100=", "$131="] {
            let read = with_sender(&mut Damaging::new(u64::MAX, 1, Some(lacks)), read);
            assert_eq!(read.as_ref().ok(), Some(&settings), "{lacks}");
        }
    }

    fn with_sender<R>(plotter: &mut dyn Link, act: impl FnOnce(&mut Sender<'_>) -> R) -> R {
        let interrupt = AtomicBool::new(false);
        let (mut sender, _) =
            Sender::open_for_orders(plotter, Timeouts::simulated(), &interrupt).expect("opened");
        let result = act(&mut sender);
        sender.end();
        result
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// What is saved and restored is the same to the last bit, on another machine and in a
        /// preview, but for what a machine on a computer does not need: homing, and waiting for a
        /// computer.
        #[test]
        fn settings_that_are_saved_are_restored_without_a_loss(
            parts in vec((any::<u32>(), any::<bool>()), SETTINGS.len()),
        ) {
            let mut settings = machine(&parts);
            let mut plotter = InMemory::<u16>::new(Room::usual(), settings);
            let saved = with_sender(&mut plotter, read).expect("read");
            let text = SavedSettings { settings: saved }.to_toml("penup");
            let saved = SavedSettings::parse(&text).expect("settings").settings;
            let mut other = InMemory::<u16>::new(Room::usual(), Settings::default());
            with_sender(&mut other, |sender| change(sender, &saved)).expect("restored");
            prop_assert_eq!(other.settings(), &settings);
            settings.set(Setting::Homing, Value::ZERO).expect("a switch");
            settings.set(Setting::SilenceBeforeHold, Value::ZERO).expect("a time");
            prop_assert_eq!(simulated(&saved), Ok(settings));
        }
    }
}
