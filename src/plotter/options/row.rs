//! One row of the table of options, and what can be done with any option by its row alone: setting
//! it, showing it, and saying how it is used.

use super::PlotOptions;
use crate::array::MapEach;
use crate::fixed::{Length, Millimetres, SixDecimals};
use crate::host_only::HostOnly;
use crate::protocol::{CommandError, choice, length, numbers, whole};
use crate::view::Direction;
use core::fmt::{self, Display as _};

/// The value with which the plotter chooses.
const AUTO: &str = "auto";

/// One option of a plot. Everything about it is in its row: the parse of `$name=value`, the lines
/// of `$` and of `$options`, and the flag of the client are made from it.
#[derive(Debug, Clone, Copy)]
pub struct PlotOption {
    /// The name of the option, as in `$name=value`.
    pub name: &'static str,
    /// The alternatives for the value: words as they are written, and placeholders in capitals.
    pub values: &'static [&'static str],
    /// The explanation of the option in the reply to `$`.
    pub help: &'static str,
    /// The kind of its value, and where the value lies.
    pub(super) kind: Kind,
    /// The flag of the client, which has the same name. `None` if there is no such flag.
    pub flag: HostOnly<Option<Flag>>,
}

/// Gives access to one field of the options, to read it or to change it.
type Field<T> = fn(&mut PlotOptions) -> &mut T;

/// The kind of an option's value, and where the value lies.
#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    /// The value is one of the words in the row. The functions use its index among them.
    Choice {
        /// Returns the index of the present value among the words.
        get: fn(&PlotOptions) -> usize,
        /// Sets the value to the word with this index.
        set: fn(&mut PlotOptions, usize),
    },
    /// Three numbers with commas between them. Before they are set, the value is `auto`.
    Position(Field<Option<Direction>>),
    /// The value is a length in mm within this range.
    Length {
        /// The least length allowed, in mm.
        least: Millimetres,
        /// The greatest length allowed, in mm.
        greatest: Millimetres,
        /// The field that holds the length.
        field: Field<Millimetres>,
    },
    /// The value is a whole number, 0 or more, or `auto`.
    Whole(Field<Option<u32>>),
    /// The value has a form of its own, with functions that read and write it.
    Other {
        /// Parses and sets the value. On an error the options stay as they were.
        set: fn(&mut PlotOptions, &str) -> Result<(), CommandError>,
        /// Writes the value in the form that `set` reads.
        show: fn(&PlotOptions, &mut fmt::Formatter<'_>) -> fmt::Result,
    },
    /// The only word of the row resets other options. `$options` does not list it.
    Reset(fn(&mut PlotOptions)),
    /// The row only explains more values of the option before it, which has the same name.
    Continued,
}

/// The client's description of an option, apart from its name, values and default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flag {
    /// The heading below which the client's help lists it.
    pub heading: &'static str,
    /// What the client's help says.
    pub help: &'static str,
    /// The meaning of each word of a choice. Empty if the option is no choice.
    pub choices: &'static [&'static str],
    /// Which values are valid, for the client's message. Empty if the kind of the value says it.
    pub range: &'static str,
    /// Whether the flag takes no value: `--name` stands for `$name=on`.
    pub is_switch: bool,
}

impl Flag {
    /// The flag of an option, below `heading` and explained by `help`.
    pub(super) const fn new(heading: &'static str, help: &'static str) -> Self {
        Self { heading, help, choices: &[], range: "", is_switch: false }
    }
}

impl PlotOption {
    /// How the option is written: `$name=value|value`.
    pub fn usage(&self) -> impl fmt::Display {
        Usage(self)
    }

    /// Whether `$options` lists the option.
    pub(super) fn is_listed(&self) -> bool {
        !matches!(self.kind, Kind::Reset(_) | Kind::Continued)
    }

    /// Parses `text` and sets the option. On an error the options stay as they were.
    pub(super) fn set(&self, options: &mut PlotOptions, text: &str) -> Result<(), CommandError> {
        match self.kind {
            Kind::Choice { set, .. } => set(options, choice(text, self.values)?),
            Kind::Position(field) => *field(options) = Some(numbers(text)?),
            Kind::Length { least, greatest, field } => {
                let value = length(text)?;
                if !(least..=greatest).contains(&value) {
                    return Err(CommandError::NumberOutOfRange);
                }
                *field(options) = value;
            }
            Kind::Whole(field) if text == AUTO => *field(options) = None,
            Kind::Whole(field) => {
                let value = u32::try_from(whole(text)?);
                *field(options) = Some(value.map_err(|_| CommandError::NumberOutOfRange)?);
            }
            Kind::Other { set, .. } => set(options, text)?,
            Kind::Reset(reset) => {
                choice(text, self.values)?;
                reset(options);
            }
            Kind::Continued => {}
        }
        Ok(())
    }

    /// Shows the option with its value, as `$options` lists it.
    pub(super) fn line<'a>(&'a self, options: &'a PlotOptions) -> impl fmt::Display + use<'a> {
        OptionLine(self, options)
    }

    /// Writes the value that the option has in `options`.
    fn show(&self, options: &PlotOptions, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A field is lent to be changed. Here it is only read, so it may be that of a copy.
        let mut copy = *options;
        match self.kind {
            Kind::Choice { get, .. } => {
                formatter.write_str(self.values.get(get(options)).unwrap_or(&""))
            }
            Kind::Position(field) => match *field(&mut copy) {
                Some(position) => {
                    let [x, y, z] = position.map_each(SixDecimals);
                    write!(formatter, "{x},{y},{z}")
                }
                None => formatter.write_str(AUTO),
            },
            Kind::Length { field, .. } => Length(*field(&mut copy)).fmt(formatter),
            Kind::Whole(field) => match field(&mut copy) {
                Some(number) => number.fmt(formatter),
                None => formatter.write_str(AUTO),
            },
            Kind::Other { show, .. } => show(options, formatter),
            Kind::Reset(_) | Kind::Continued => Ok(()),
        }
    }
}

#[cfg(any(test, feature = "host"))]
impl PlotOption {
    /// The value that the option has before it is set, as `$options` shows it.
    pub fn default(&self) -> std::string::String {
        let line = std::format!("{}", self.line(&PlotOptions::default()));
        line.split_once('=').map(|(_, value)| value.into()).unwrap_or_default()
    }

    /// Says in words which numbers are valid. `None` if the value is one of some words.
    pub fn range(&self) -> Option<std::string::String> {
        let own = self.flag.get().map(|flag| flag.range).filter(|range| !range.is_empty());
        match self.kind {
            Kind::Position(_) => Some("three numbers, -1e15 to 1e15".into()),
            Kind::Length { least, greatest, .. } => {
                let [least, greatest] = [least, greatest].map_each(|length| length.to_num::<i32>());
                Some(std::format!("{least} to {greatest} mm"))
            }
            Kind::Whole(_) => Some(std::format!("auto, or a whole number, 0 to {}", i32::MAX)),
            _ => own.map(Into::into),
        }
    }
}

/// Shows how an option is used: its name and the forms of its value.
struct Usage<'a>(&'a PlotOption);

impl fmt::Display for Usage<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "${}", self.0.name)?;
        for (at, value) in self.0.values.iter().enumerate() {
            formatter.write_str(if at == 0 { "=" } else { "|" })?;
            formatter.write_str(value)?;
        }
        Ok(())
    }
}

/// Shows an option with its present value, as `$options` lists it.
struct OptionLine<'a>(&'a PlotOption, &'a PlotOptions);

impl fmt::Display for OptionLine<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "${}=", self.0.name)?;
        self.0.show(self.1, formatter)
    }
}
