//! Describes the options for the page's controls, from the library's table.

use crate::source::Source;
use crate::words::{for_page, sentence};
use penup::machine::{self, Setting, Value};
use penup::plotter::{OPTIONS, PlotOptions};
use penup::protocol::Escape;
use penup_job::Settings;
use penup_job::export::Retracing;
use penup_job::machine_settings::{AssignedSetting, NoSuchMachine, is_grid, simulated};
use penup_job::user_choices::{UserChoices, page_value};
use penup_job::view::{
    AZIMUTH, ELEVATION, MOST_DEGREES, NAMED_VIEWS, VIEW, ViewOption, Viewpoint, Y_UP,
};
use penup_readers::page::{A4, NAMED_PAGES, Page};
use penup_readers::{PLAN_OPTIONS, words};
use serde::Serialize;
use wasm_bindgen::prelude::wasm_bindgen;

/// The option that tells how often everything is drawn, and the most times.
const MULTIPASS: &str = "multipass";
const MOST_PASSES: u32 = 100;
/// The option that begins closed lines at random points in the programs for other machines.
const RELOOP: &str = "reloop";

/// The option that sets up the emulated machine.
const SET: &str = "set";

/// The settings of a plotter whose effect is left out of the page, because its program must be
/// small: those of shaped motion, of backlash that is taken up while the pen draws, and of drawings
/// that wait while the computer is silent.
const LEFT_OUT: [u16; 7] = [218, SHAPER, 227, 228, 229, SPREAD_BACKLASH, 238];
/// Those of them that turn an effect on.
const SHAPER: u16 = 226;
const SPREAD_BACKLASH: u16 = 237;

/// Why a machine is not emulated.
const NO_GRID: &str = "The page emulates machines of which each motor moves one axis, by the same \
                       steps per mm: penup preview computes this one.";

/// The name of the option for the size of the page.
const PAGE: &str = "page";

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
    /// The value before it is set; `None` if the plotter then chooses, or the file.
    default: Option<String>,
    /// What holds before it is set, in words; `None` if there is nothing to say.
    unset: Option<&'static str>,
}

/// What holds before an option is set that depends on the file: a value is then another one than
/// the default.
const BY_FILE: [(&str, &str); 2] =
    [(PAGE, "that of the file, or A4"), ("margin", "10, or 0 on the page of the file")];

/// The names of the option that lays the page on its long side, and of its values.
const LANDSCAPE: &str = "landscape";
const WHEN: &[&str] = &["always", "auto"];
const WHEN_MEANS: &[&str] = &["On its long side", "On its long side if a plan is wider than high"];

/// The controls as JSON: an array with the name, heading, help, values and default of each option
/// that a user sets, in the order of the tables of the library, the views, and the readers.
#[wasm_bindgen]
pub fn options() -> String {
    let mut controls = Vec::new();
    for option in OPTIONS {
        let Some(flag) = option.flag.get() else { continue };
        // The row after an option may explain more values of it.
        let by_file = BY_FILE.iter().find(|(name, _)| *name == option.name);
        let unset = by_file.map(|(_, said)| *said);
        let same = OPTIONS.iter().filter(|other| other.name == option.name);
        controls.push(Control {
            name: option.name,
            heading: flag.heading,
            help: flag.help,
            values: same.flat_map(|row| row.values).copied().collect(),
            choices: flag.choices,
            is_switch: flag.is_switch,
            range: option.range(),
            default: default_of(option.name).filter(|_| unset.is_none()),
            unset,
        });
        if option.name == PAGE {
            controls.push(Control {
                values: WHEN.to_vec(),
                choices: WHEN_MEANS,
                is_switch: false,
                ..Control::new(LANDSCAPE, flag.heading, "", "Lay the page on its long side")
            });
        }
    }
    let sides = NAMED_VIEWS.map(|(name, _)| name).to_vec();
    let views = [VIEW, AZIMUTH, ELEVATION, Y_UP].map(|option| {
        let control = Control::new(option.name, "Camera", option.value, option.help);
        if option.name == VIEW.name {
            Control { values: sides.clone(), ..control }
        } else {
            control
        }
    });
    // They stand with the other options of the camera.
    let behind = controls.iter().rposition(|control| control.heading == "Camera");
    let behind = behind.map_or(controls.len(), |at| at + 1);
    controls.splice(behind..behind, views);
    controls.extend(PLAN_OPTIONS.iter().map(|option| {
        let heading = "Plan: a drawing of straight lines at one height";
        Control::new(option.name, heading, option.value, option.help)
    }));
    // They stand with the other options of the strokes' order.
    let behind = controls.iter().rposition(|control| control.heading == "Drawing");
    let behind = behind.map_or(controls.len(), |at| at + 1);
    let passes = Control {
        default: Some("1".to_owned()),
        range: Some(format!("1 to {MOST_PASSES}")),
        ..Control::new(
            MULTIPASS,
            "Drawing",
            "N",
            "Draw everything this many times; a plotter draws the whole again, and what is saved \
             as G-code and HP-GL draws each line again without lifting the pen",
        )
    };
    let reloop = Control::new(
        RELOOP,
        "Drawing",
        "",
        "Begin closed lines at random points in what is saved as G-code and HP-GL, so that the \
         marks of the pen do not stand in a row",
    );
    controls.splice(behind..behind, [passes, reloop]);
    controls.push(Control::new(
        SET,
        "Machine",
        "NUMBER=VALUE",
        "Compute and emulate a machine with these settings, with commas between them, for example \
         204=20,110=4000",
    ));
    text_of(&controls)
}

/// How often everything is drawn, with these options: a JSON array of pairs of name and value.
///
/// # Errors
/// A sentence for the user.
#[wasm_bindgen]
pub fn passes(options: &str) -> Result<u32, String> {
    NamedValues::parse(options)?.retracing().map(|retracing| retracing.passes)
}

impl Control {
    /// A control for a value with this placeholder, or a switch if that is empty.
    fn new(
        name: &'static str,
        heading: &'static str,
        placeholder: &'static str,
        help: &'static str,
    ) -> Self {
        Self {
            name,
            heading,
            help,
            values: Some(placeholder).filter(|it| !it.is_empty()).into_iter().collect(),
            choices: &[],
            is_switch: placeholder.is_empty(),
            range: None,
            default: None,
            unset: None,
        }
    }
}

/// Whether the option with this name arranges plans, which `penup-page-files` does.
pub(crate) fn is_of_plans(name: &str) -> bool {
    name == LANDSCAPE || PLAN_OPTIONS.iter().any(|option| option.name == name)
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

    /// The names of the options.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(name, _)| name.as_str())
    }

    /// The value that an option was given; `None` if it was given none.
    fn given(&self, name: &str) -> Option<&str> {
        self.0.iter().rfind(|(own, _)| own == name).map(|(_, value)| value.trim())
    }

    /// The settings of a job that draws `source`: every option with the value that it was given, or
    /// else its default, as the client sends them.
    ///
    /// # Errors
    /// A sentence for the user: values contradict each other, or the file.
    pub fn settings_for(&self, source: &Source) -> Result<Settings, String> {
        self.retracing()?;
        let mut page = source.page;
        if let (Some(named), false) = (self.page()?, source.is_arranged) {
            page.sheet = named;
        }
        let settings = self.choices()?.settings_for(&page, &*source.lines);
        settings.map_err(|reason| for_page(&sentence(&reason)))
    }

    /// What is done with each line of a drawing that is saved for another machine.
    ///
    /// # Errors
    /// A sentence for the user: the number of passes is none.
    pub(crate) fn retracing(&self) -> Result<Retracing, String> {
        let passes = self.given(MULTIPASS).unwrap_or("1").parse().ok();
        let passes =
            passes.filter(|passes| (1..=MOST_PASSES).contains(passes)).ok_or_else(|| {
                format!("\u{201c}{MULTIPASS}\u{201d} is a whole number from 1 to {MOST_PASSES}.")
            })?;
        Ok(Retracing { passes, reloops: self.given(RELOOP).is_some() })
    }

    /// The settings that the user gives a machine.
    ///
    /// # Errors
    /// A sentence for the user: one of them has a wrong form.
    fn assigned(&self) -> Result<Vec<AssignedSetting>, String> {
        let words = self.given(SET).unwrap_or_default().split([',', ' ', ';']);
        let words = words.map(str::trim).filter(|word| !word.is_empty());
        let assigned = words.map(AssignedSetting::parse).collect::<Result<_, _>>();
        assigned.map_err(|reason| sentence(&reason))
    }

    /// The settings of the user's machine, as far as the page knows them.
    ///
    /// # Errors
    /// A sentence for the user: there is no such machine.
    fn real_machine(&self) -> Result<machine::Settings, String> {
        let mut assigned = self.assigned()?;
        assigned.retain(|setting| !LEFT_OUT.contains(&setting.number));
        let known = |setting: &AssignedSetting| Setting::numbered(setting.number);
        if let Some(AssignedSetting { number, .. }) = assigned.iter().find(|it| known(it).is_none())
        {
            return Err(format!("A machine has no setting {number}: clear it."));
        }
        let refused =
            |reason: NoSuchMachine| sentence(&for_page(&words::for_client(&reason.to_string())));
        simulated(&assigned).map_err(refused)
    }

    /// The settings of the machine that the page emulates: that of the user, but its motors turn
    /// the usual way round and have no backlash, so that the levels of its pins tell where the pen
    /// is. Its ink is the same; the moments in which backlash is taken up are left out.
    ///
    /// # Errors
    /// A sentence for the user: there is no such machine, or the page cannot show it.
    pub(crate) fn machine(&self) -> Result<machine::Settings, String> {
        let mut machine = self.real_machine()?;
        if !is_grid(&machine) {
            return Err(NO_GRID.to_owned());
        }
        // The motor of the pen keeps its direction, on which its heights depend.
        let of_pen = machine.get(Setting::InvertDirections).to_num::<u8>() & 4;
        for (setting, value) in [
            (Setting::InvertDirections, Value::from_num(of_pen)),
            (Setting::BacklashX, Value::ZERO),
            (Setting::BacklashY, Value::ZERO),
        ] {
            machine.set(setting, value).map_err(|_| NO_GRID.to_owned())?;
        }
        Ok(machine)
    }

    /// What the page cannot show of the user's machine, in sentences. It can be plotted on.
    ///
    /// # Errors
    /// A sentence for the user: there is no such machine.
    pub(crate) fn not_shown(&self) -> Result<Vec<String>, String> {
        let mut notes = Vec::new();
        if !is_grid(&self.real_machine()?) {
            notes.push(NO_GRID.to_owned());
        }
        let assigned = self.assigned()?;
        for (setting, what) in
            [(SHAPER, "shaped motion"), (SPREAD_BACKLASH, "backlash taken up in strokes")]
        {
            if assigned.iter().any(|it| it.number == setting && it.value.parse() != Ok(0.0)) {
                notes.push(format!("The page does not show {what} (setting {setting})."));
            }
        }
        Ok(notes)
    }

    /// The choices of the user.
    fn choices(&self) -> Result<UserChoices, String> {
        let mut values = Vec::new();
        for option in OPTIONS.iter().filter(|option| option.flag.get().is_some()) {
            let given = self.given(option.name).map(|value| as_sent(option.name, value));
            if let Some(value) = given.transpose()?.or_else(|| default_of(option.name)) {
                values.push((option.name, value));
            }
        }
        let angle = |option: ViewOption, most: f64| match self.given(option.name) {
            None => Ok(None),
            Some(text) => match text.parse::<f64>() {
                Ok(angle) if angle.abs() <= most => Ok(Some(angle)),
                _ => Err(format!(
                    "\u{201c}{}\u{201d} is a number of degrees from -{most} to {most}.",
                    option.name
                )),
            },
        };
        let (azimuth, elevation) =
            (angle(AZIMUTH, MOST_DEGREES[0])?, angle(ELEVATION, MOST_DEGREES[1])?);
        let side = self.given(VIEW.name);
        if side.is_some() && azimuth.or(elevation).is_some() {
            return Err("\u{201c}view\u{201d} is a direction by itself: leave out \
                        \u{201c}azimuth\u{201d} and \u{201c}elevation\u{201d}."
                .to_owned());
        }
        let viewpoint = Viewpoint::chosen(side, azimuth, elevation);
        let chosen = ["eye", "angles"].into_iter().find(|name| self.given(name).is_some());
        if let (Some(chosen), true) = (chosen, viewpoint.is_some()) {
            return Err(format!(
                "\u{201c}{chosen}\u{201d} chooses the eye: clear it, or \u{201c}view\u{201d}, \
                 \u{201c}azimuth\u{201d} and \u{201c}elevation\u{201d}."
            ));
        }
        if self.given(Y_UP.name).is_some() {
            if let Some(other) = ["up", "angles"].into_iter().find(|it| self.given(it).is_some()) {
                return Err(format!(
                    "\u{201c}{other}\u{201d} says what is up: clear it, or \u{201c}y-up\u{201d}."
                ));
            }
            values.push(("up", "0,1,0".to_owned()));
        }
        let settings = Settings { page: A4, values };
        Ok(UserChoices { settings, viewpoint, has_margin: self.given("margin").is_some() })
    }

    /// The page that the user has named; `None` if there is none.
    ///
    /// # Errors
    /// It is no page.
    fn page(&self) -> Result<Option<Page>, String> {
        let Some(text) = self.given(PAGE) else { return Ok(None) };
        let range = OPTIONS.iter().find(|option| option.name == PAGE).and_then(|it| it.range());
        let range = range.map(|range| format!(" ({range})")).unwrap_or_default();
        let refused = || format!("A page is WIDTHxHEIGHT in mm, such as 200x150{range}.");
        let page = Page::parse(text).map_err(|_| refused())?;
        PlotOptions::default().set(PAGE, &page_value(page)).map_err(|_| refused())?;
        Ok(Some(page))
    }
}

/// A value as it is sent: the title has escapes for letters beyond ASCII, and for those on which a
/// plotter acts at once.
///
/// # Errors
/// A sentence for the user: another value has such letters, which no value of an option needs.
fn as_sent(name: &str, value: &str) -> Result<String, String> {
    if name == "title" {
        return Ok(Escape(value).to_string());
    }
    let is_plain = |byte| matches!(byte, b' '..=b'}') && !matches!(byte, b'!' | b'?');
    if !value.bytes().all(is_plain) {
        return Err(format!("\u{201c}{name}\u{201d} has a letter that no value has: clear it."));
    }
    Ok(value.to_lowercase())
}
