//! Describes the options for the page's controls, from the library's table.

use penup::plotter::{OPTIONS, PlotOptions};
use penup::protocol::Escape;
use penup_job::Settings;
use penup_readers::page::{NAMED_PAGES, Page};
use serde::Serialize;
use wasm_bindgen::prelude::wasm_bindgen;

/// A control of the page.
#[derive(Serialize)]
struct Control {
    name: &'static str,
    heading: &'static str,
    help: &'static str,
    /// The forms of the value: words as they are written, and forms with placeholders in capitals.
    values: Vec<&'static str>,
    /// What each of the words means; empty if the value is not a choice among words alone.
    choices: &'static [&'static str],
    is_switch: bool,
    /// Which values are valid, in words.
    range: Option<String>,
    /// The value before it is set; `None` if the plotter then chooses.
    default: Option<String>,
}

/// The controls as JSON: an array with the name, heading, help, values and default of each option
/// that a user sets, in the order of the library's table.
#[wasm_bindgen]
pub fn options() -> String {
    let controls = OPTIONS.iter().filter_map(|option| {
        let flag = option.flag.get()?;
        // The row after an option may explain more values of it.
        let same = OPTIONS.iter().filter(|other| other.name == option.name);
        Some(Control {
            name: option.name,
            heading: flag.heading,
            help: flag.help,
            values: same.flat_map(|row| row.values).copied().collect(),
            choices: flag.choices,
            is_switch: flag.is_switch,
            range: option.range(),
            default: default_of(option.name),
        })
    });
    text_of(&controls.collect::<Vec<_>>())
}

/// The pages that have names as JSON: an array of pairs of the name and the value of the option.
#[wasm_bindgen]
pub fn pages() -> String {
    let pages = NAMED_PAGES.iter();
    let value = |page: &Page| format!("{}x{}", page.width, page.height);
    text_of(&pages.map(|(name, page)| (*name, value(page))).collect::<Vec<_>>())
}

/// The default of an option; `None` if it cannot be set to what it is before it is set.
fn default_of(name: &str) -> Option<String> {
    let default = OPTIONS.iter().find(|option| option.name == name)?.default();
    PlotOptions::default().set(name, &default).is_ok().then_some(default)
}

/// A value as JSON. What is passed here always has a form in JSON.
pub(crate) fn text_of(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// The values that the user has given to options, by their names.
#[derive(Debug, Clone, Default)]
pub struct NamedValues(Vec<(String, String)>);

impl NamedValues {
    /// Parses a JSON array of pairs of name and value.
    ///
    /// # Errors
    /// The text is something else.
    pub fn parse(json: &str) -> Result<Self, String> {
        serde_json::from_str(json)
            .map(Self)
            .map_err(|error| format!("The page sent its settings in a wrong form: {error}"))
    }

    /// The settings of a job: every option with the value that it was given, or else its default,
    /// as the client sends them.
    pub fn settings(&self) -> Settings {
        let given = |name: &str| {
            let value = self.0.iter().rfind(|(own, _)| own == name);
            value.map(|(name, value)| as_sent(name, value))
        };
        let flags = OPTIONS.iter().filter(|option| option.flag.get().is_some());
        let values: Vec<_> = flags
            .filter_map(|option| {
                Some((option.name, given(option.name).or_else(|| default_of(option.name))?))
            })
            .collect();
        let mut settings = Settings { page: Page { width: 210.0, height: 297.0 }, values };
        let page = settings.value("page").and_then(|page| page.split_once('x'));
        if let Some((Ok(width), Ok(height))) =
            page.map(|(width, height)| (width.parse(), height.parse()))
        {
            settings.page = Page { width, height };
        }
        settings
    }
}

/// A value as it is sent: the title has escapes for letters beyond ASCII.
fn as_sent(name: &str, value: &str) -> String {
    if name == "title" { Escape(value).to_string() } else { value.trim().to_lowercase() }
}
