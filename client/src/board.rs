//! How command lines name a board. `penup` and `xtask` share this file.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::table::{BOARDS, BoardRow};

/// The name of the default board.
pub const DEFAULT: &str = BOARDS[0].name;

/// The parser of `--board`: it accepts the names of the table's rows.
pub fn parser() -> impl TypedValueParser<Value = &'static BoardRow> {
    let values = BOARDS.map(|board| PossibleValue::new(board.name).help(board.about));
    PossibleValuesParser::new(values)
        .try_map(|name| BoardRow::named(&name).ok_or_else(|| format!("there is no board {name}")))
}
