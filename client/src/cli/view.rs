//! The arguments that say what is drawn and how. They are made from the library's table of options,
//! which also checks their values, so a new option needs nothing here.
//!
//! The options of plans come from the readers' table in the same way. Two things are the client's
//! own: names of pages, and `--landscape`.

use super::number;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use penup::plotter::{Flag, OPTIONS, PlotOption, PlotOptions};
use penup::protocol::{Command as PlotterCommand, CommandError, Escape, LINE_LIMIT};
use penup_job::Settings;
use penup_job::user_choices::{FilePage, UserChoices, page_value};
use penup_job::view::{
    AZIMUTH, ELEVATION, MOST_DEGREES, NAMED_VIEWS, VIEW, ViewOption, Viewpoint, Y_UP,
};
use penup_readers::lines::acts_at_once;
use penup_readers::page::{NAMED_PAGES, Page};
use penup_readers::words::for_client;
use penup_readers::{Arrangement, PLAN_OPTIONS, PlanOption, SourceFile, Turn};

/// The name of the option whose value may also be the name of a page.
const PAGE: &str = "page";
/// The name of the option whose value is any text. It is sent with escapes.
const TITLE: &str = "title";
/// The name of the option for the height of the title.
const TITLE_SIZE: &str = "title-size";
/// The name of the option that says who chooses the pens, and the value with which nobody does.
const PENS: &str = "pens";
const ONE: &str = "one";
/// The name of the option that gives the layers their pens.
const LAYER_ORDER: &str = "layer-order";
/// The name of the option for the margin of the page. A file that sets its own page needs no
/// margin.
const MARGIN: &str = "margin";
/// The name of the option that scales a plan to the page.
const FIT: &str = "fit";
/// The argument that turns the page, and its values.
const LANDSCAPE: &str = "landscape";
const ALWAYS: &str = "always";
const AUTOMATIC: &str = "auto";
/// The name of the option that says what is up.
const UP: &str = "up";
/// The heading of the options of plans.
const PLAN: &str = "Plan: a drawing of straight lines at one height, in this order";

/// The arguments of camera, page and order.
#[derive(Debug, Clone)]
pub struct ViewArgs {
    choices: UserChoices,
    arrangement: Arrangement,
}

impl ViewArgs {
    /// What is done with a plan before it is drawn.
    pub fn arrangement(&self) -> &Arrangement {
        &self.arrangement
    }

    /// The settings for a file that was arranged by [`ViewArgs::arrangement`].
    ///
    /// # Errors
    /// As [`UserChoices::settings_for`].
    pub fn settings_for(&self, file: &SourceFile) -> Result<Settings, String> {
        let page =
            FilePage { own: file.page(), sheet: file.sheet(), is_plan: file.bounds().is_some() };
        self.choices.settings_for(&page, file)
    }
}

impl Args for ViewArgs {
    fn augment_args(command: Command) -> Command {
        let command = flags().fold(command, |command, (option, flag)| {
            let command = command.arg(argument(option, flag));
            if option.name != PAGE {
                return command;
            }
            command.arg(
                Arg::new(LANDSCAPE)
                    .long(LANDSCAPE)
                    .help(
                        "Lay the page on its long side; --landscape=auto does so if a plan \
                         is wider than high",
                    )
                    .help_heading(flag.heading)
                    .value_name("WHEN")
                    .num_args(0..=1)
                    .require_equals(true)
                    .default_missing_value(ALWAYS)
                    .value_parser([ALWAYS, AUTOMATIC]),
            )
        });
        let command = command.args(view_arguments());
        PLAN_OPTIONS.iter().fold(command, |command, option| command.arg(plan_argument(option)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for ViewArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let is_given = |name: &str| matches.value_source(name) == Some(ValueSource::CommandLine);
        let page = matches.get_one::<Page>(PAGE).copied().unwrap_or(NAMED_PAGES[0].1);
        let turn = match matches.get_one::<String>(LANDSCAPE).map(String::as_str) {
            None => Turn::AsItIs,
            Some(AUTOMATIC) => Turn::Automatic,
            Some(_) => Turn::Landscape,
        };
        let value = |(option, flag): (&'static PlotOption, Flag)| {
            let value = match option.name {
                PAGE => Some(page_value(page)),
                name if flag.is_switch => {
                    Some(if matches.get_flag(name) { "on" } else { "off" }.to_owned())
                }
                name => matches.get_one::<String>(name).cloned(),
            };
            Some((option.name, value?))
        };
        let settings = Settings { page, values: flags().filter_map(value).collect() };
        if settings.value(PENS) == Some(ONE) && is_given(LAYER_ORDER) {
            let reason = "--pens one draws all layers with one pen: leave out --layer-order, or \
                          --pens one\n";
            return Err(Error::raw(ErrorKind::ArgumentConflict, reason));
        }
        let margin = settings.value(MARGIN).and_then(|margin| margin.parse().ok());
        let mut arrangement = Arrangement::on(
            is_given(PAGE).then_some(page),
            turn,
            margin.filter(|_| is_given(MARGIN)),
        );
        if settings.value(FIT) == Some("on") {
            let size = settings.value(TITLE_SIZE).and_then(|size| size.parse().ok());
            let title = settings.value(TITLE).unwrap_or_default();
            arrangement = arrangement.fitted(title, size.unwrap_or_default());
        }
        for option in PLAN_OPTIONS {
            let text = match matches.try_get_one::<String>(option.name) {
                _ if option.value.is_empty() => matches.get_flag(option.name).then(String::new),
                Ok(text) => text.cloned(),
                Err(_) => None,
            };
            if let Some(text) = text {
                arrangement
                    .set(option.name, &text)
                    .map_err(|reason| Error::raw(ErrorKind::ValueValidation, reason))?;
            }
        }
        let side = matches.get_one::<String>(VIEW.name).map(String::as_str);
        let angle = |option: ViewOption| matches.get_one::<f64>(option.name).copied();
        let viewpoint = Viewpoint::chosen(side, angle(AZIMUTH), angle(ELEVATION));
        let mut settings = settings;
        if matches.get_flag(Y_UP.name) {
            settings.values.push((UP, "0,1,0".to_owned()));
        }
        let has_margin = arrangement.has_margin();
        Ok(Self { choices: UserChoices { settings, viewpoint, has_margin }, arrangement })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The options that have a flag, in the order of the table.
fn flags() -> impl Iterator<Item = (&'static PlotOption, Flag)> {
    OPTIONS.iter().filter_map(|option| Some((option, option.flag.get()?)))
}

/// The arguments that choose the eye by its direction.
fn view_arguments() -> [Arg; 4] {
    let argument = |option: ViewOption| {
        Arg::new(option.name).long(option.name).help(option.help).help_heading("Camera")
    };
    let names = NAMED_VIEWS.map(|(name, _)| name);
    let angle = |option: ViewOption, most: f64| {
        let argument = argument(option).value_name(option.value).allow_hyphen_values(true);
        argument.conflicts_with_all(["eye", "angles", VIEW.name]).value_parser(move |text: &str| {
            match number(text)? {
                angle if angle.abs() <= most => Ok(angle),
                _ => Err(format!("the angle is -{most} to {most} degrees")),
            }
        })
    };
    [
        argument(VIEW)
            .value_name(VIEW.value)
            .conflicts_with_all(["eye", "angles"])
            .value_parser(PossibleValuesParser::new(names)),
        angle(AZIMUTH, MOST_DEGREES[0]),
        angle(ELEVATION, MOST_DEGREES[1]),
        argument(Y_UP).conflicts_with_all([UP, "angles"]).action(ArgAction::SetTrue),
    ]
}

/// The argument for an option of plans.
fn plan_argument(option: &'static PlanOption) -> Arg {
    let argument = Arg::new(option.name).long(option.name).help(option.help).help_heading(PLAN);
    if option.value.is_empty() {
        let argument = argument.action(ArgAction::SetTrue);
        return if option.changes_size { argument.conflicts_with(FIT) } else { argument };
    }
    let argument = argument.value_name(option.value).allow_hyphen_values(true);
    let argument = if option.changes_size { argument.conflicts_with(FIT) } else { argument };
    argument.value_parser(move |text: &str| {
        Arrangement::default().set(option.name, text).map(|()| text.to_owned())
    })
}

/// The argument for an option. Its value is what is sent to the plotter, except for the page.
fn argument(option: &'static PlotOption, flag: Flag) -> Arg {
    let argument =
        Arg::new(option.name).long(option.name).help(flag.help).help_heading(flag.heading);
    if flag.is_switch {
        return argument.action(ArgAction::SetTrue);
    }
    let argument = argument.value_name(value_name(option));
    if option.name == PAGE {
        let argument = argument.allow_hyphen_values(true).default_value("A4");
        return argument.value_parser(page);
    }
    let default = option.default();
    let argument = argument.hide_default_value(default.is_empty());
    // A position is chosen by the plotter until it is set, and cannot be set to that choice.
    let argument = match PlotOptions::default().set(option.name, &default) {
        Ok(_) => argument.default_value(lasting(default)),
        Err(_) => argument,
    };
    if flag.choices.is_empty() {
        let argument = argument.allow_hyphen_values(true);
        return argument.value_parser(move |text: &str| understood(option, text));
    }
    let choices = option.values.iter().zip(flag.choices);
    argument.value_parser(PossibleValuesParser::new(
        choices.map(|(word, meaning)| PossibleValue::new(word).help(*meaning)),
    ))
}

/// What stands for the value in the help: the placeholder that the plotter's help has, if the value
/// has no form but that and `auto`, or else the option's name.
fn value_name(option: &PlotOption) -> &'static str {
    let is_placeholder = |form: &&str| !form.contains(|letter: char| letter.is_lowercase());
    match option.values.last().copied().filter(is_placeholder) {
        Some(placeholder) => placeholder,
        None => lasting(option.name.to_uppercase()),
    }
}

/// Keeps a text as long as the program runs, as the definition of an argument requires.
fn lasting(text: String) -> &'static str {
    text.leak()
}

/// Checks the value of an option with the plotter's own parser. Returns it as it is sent.
fn understood(option: &PlotOption, text: &str) -> Result<String, String> {
    let is_title = option.name == TITLE;
    let value = if is_title { Escape(text).to_string() } else { text.to_owned() };
    // These letters are refused even in a comment.
    if value.contains(|letter| letter == '#' && !is_title || acts_at_once(letter)) {
        return Err(within(option, "no value has such a letter"));
    }
    let line = format!("${}={value}", option.name);
    if line.len() > LINE_LIMIT {
        let limit = CommandError::LineTooLong { limit: LINE_LIMIT }.to_string();
        let escaped = "it is too long: letters beyond ASCII take four to eight bytes of a line";
        return Err(within(option, if is_title { escaped } else { &limit }));
    }
    let outcome = PlotterCommand::parse(&line).and_then(|command| match command {
        PlotterCommand::Assign { name, value } => PlotOptions::default().set(name, value),
        _ => Ok(false),
    });
    match outcome {
        Ok(_) => Ok(value),
        Err(refusal) => Err(within(option, &for_client(&refusal.to_string()))),
    }
}

/// A reason for a refusal, with the values that are valid.
fn within(option: &PlotOption, reason: &str) -> String {
    let range = option.range().map(|range| format!(" (expected: {range})"));
    format!("{reason}{}", range.unwrap_or_default())
}

/// Parses the size of a page: its name, or its width and height with a unit.
pub(super) fn page(text: &str) -> Result<Page, String> {
    let page = Page::parse(text)?;
    if let Some(option) = OPTIONS.iter().find(|option| option.name == PAGE) {
        understood(option, &page_value(page))?;
    }
    Ok(page)
}

#[cfg(test)]
mod tests;
