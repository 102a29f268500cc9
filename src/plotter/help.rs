//! The list of all commands that `$` prints.

use super::OPTIONS;
use super::options::PlotOption;
use crate::protocol::HELP;
use core::fmt;

/// Passes to `row` the usage and the meaning of each command, in the order of `$`.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub fn help(row: &mut dyn FnMut(&dyn fmt::Display, &'static str)) {
    let [before, after] = HELP;
    commands(before, row);
    options(OPTIONS, row);
    commands(after, row);
}

// The lists are arguments, because the compiler would unroll a loop over a list that it knows.

#[inline(never)]
fn commands(
    list: &[(&'static str, &'static str)],
    row: &mut dyn FnMut(&dyn fmt::Display, &'static str),
) {
    list.iter().for_each(|(usage, meaning)| row(usage, meaning));
}

#[inline(never)]
fn options(list: &[PlotOption], row: &mut dyn FnMut(&dyn fmt::Display, &'static str)) {
    list.iter().for_each(|option| row(&option.usage(), option.help));
}
