//! Parses the edits of the model and `$list`, all of the form `$name=value`.

use super::values::{choice, number, trim, whole};
use super::{Command, CommandError};
use crate::model::{self, Edit, ElementKind};
use crate::text::split_once;

/// Reads the values of an edit one after the other. They are separated by commas.
struct Values<'a> {
    /// The text not yet read; `None` after the last value.
    rest: Option<&'a str>,
    /// How many values the edit needs, which the error for too few of them tells.
    needed: usize,
}

impl<'a> Values<'a> {
    /// Returns the text of the next value.
    fn text(&mut self) -> Result<&'a str, CommandError> {
        let rest = self.rest.ok_or(CommandError::WrongNumberCount { needed: self.needed })?;
        let (value, rest) = match split_once(rest, b',') {
            Some((value, rest)) => (value, Some(rest)),
            None => (rest, None),
        };
        self.rest = rest;
        Ok(trim(value))
    }

    /// Returns the next three values, each parsed by `read`.
    fn three<T: Copy + Default>(
        &mut self,
        read: impl Fn(&str) -> Result<T, CommandError>,
    ) -> Result<[T; 3], CommandError> {
        let mut values = [T::default(); 3];
        for value in &mut values {
            *value = read(self.text()?)?;
        }
        Ok(values)
    }

    /// Returns the next value as the kind of element that its letter means.
    fn part(&mut self) -> Result<ElementKind, CommandError> {
        Ok(match choice(self.text()?, &["v", "l", "f", "c"])? {
            0 => ElementKind::Vertices,
            1 => ElementKind::Bars,
            2 => ElementKind::Faces,
            _ => ElementKind::Curves,
        })
    }

    /// Reads the first and the last number of a range, or one number for both.
    fn numbers(&mut self) -> Result<[i32; 2], CommandError> {
        let first = whole(self.text()?)?;
        let last = if self.rest.is_some() { whole(self.text()?)? } else { first };
        Ok([first, last])
    }

    /// Reads a range of numbers as [`Values::numbers`] does, or `None`, which means all, if no
    /// value follows.
    fn numbers_or_all(&mut self) -> Result<model::Numbers, CommandError> {
        if self.rest.is_some() { self.numbers().map(Some) } else { Ok(None) }
    }
}

/// Parses the edit with this name. `None` if no edit has this name.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn parse_edit<'a>(name: &str, value: &str) -> Result<Option<Command<'a>>, CommandError> {
    let mut values = Values { rest: Some(value), needed: 3 };
    let edit = match name {
        "list" => {
            let part = values.part()?;
            let numbers = values.numbers_or_all()?;
            return Ok(Some(Command::List(part, numbers)));
        }
        "delete" => Edit::Delete(values.part()?, values.numbers()?),
        "plug" => Edit::Plug(values.part()?, whole(values.text()?)?),
        "move" => {
            values.needed = 4;
            Edit::Move(whole(values.text()?)?, values.three(number)?)
        }
        "translate" => Edit::Translate(values.three(number)?, values.numbers_or_all()?),
        "scale" => Edit::Scale(values.three(number)?, values.numbers_or_all()?),
        "rotate" => {
            let axis = choice(values.text()?, &["x", "y", "z"])? as u8;
            values.needed = 2;
            let degrees = number(values.text()?)?.to_f64();
            if libm::fabs(degrees) > 36000.0 {
                return Err(CommandError::NumberOutOfRange);
            }
            Edit::Rotate(axis, degrees, values.numbers_or_all()?)
        }
        "mirror" => Edit::Mirror(values.three(whole)?, values.numbers_or_all()?),
        "reflect" => Edit::Reflect(values.three(whole)?, values.numbers_or_all()?),
        _ => return Ok(None),
    };
    match values.rest {
        None => Ok(Some(Command::Edit(edit))),
        Some(_) => Err(CommandError::WrongNumberCount { needed: values.needed }),
    }
}
