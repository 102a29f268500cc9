//! The list of all commands that `$` prints.

use super::OPTIONS;
use crate::protocol::HELP;
use core::fmt;

/// Passes to `row` the usage and the meaning of each command, in the order of `$`.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub fn help(row: &mut dyn FnMut(&dyn fmt::Display, &'static str)) {
    let [before, after] = HELP;
    before.iter().for_each(|(usage, meaning)| row(usage, meaning));
    OPTIONS.iter().for_each(|option| row(&option.usage(), option.help));
    after.iter().for_each(|(usage, meaning)| row(usage, meaning));
}
