//! Asks a plotter for all that decides whether a drawing fits, before its first line is sent.

use super::settings::read;
use crate::compute::{Capacity, Known};
use crate::error::Error;
use crate::machine_settings::simulated;
use crate::sender::Sender;
use crate::table::BoardRow;
use penup_job::protocol::{BUILD, MODEL, Reply};

/// What decides whether a drawing fits the plotter at the other end. The machine must be idle.
///
/// # Errors
/// As [`Sender::stream`].
pub fn limits(sender: &mut Sender<'_>) -> Result<Known, Error> {
    let (capacity, kept) = sender.agreed(|sender| {
        let replies = sender.ask(MODEL)?;
        Ok(capacity_in(&replies).map(|capacity| (capacity, kept_in(&replies))))
    })?;
    let settings = simulated(&read(sender)?).ok();
    // A board whose name is not known, or was damaged, is rehearsed with this computer's numbers.
    let board = sender.ask(BUILD)?.iter().find_map(board_in);
    // A board of the name that was built with other limits is another board.
    let is_same = |board: &&BoardRow| capacity == Capacity::of(board);
    Ok(Known { capacity, board: board.filter(is_same), settings, kept })
}

/// The board in the answer to `$I`: `[VER:1.1h.penup 0.1.0 pico:a text of the user's]`.
fn board_in(reply: &Reply) -> Option<&'static BoardRow> {
    let Reply::Other(line) = reply else { return None };
    let (version, _) = line.strip_prefix("[VER:")?.split_once(':')?;
    BoardRow::named(version.rsplit(' ').next()?)
}

/// The limits in the answer to `$model`: `[MODEL:vertices 0 of 4000]` and
/// `[MODEL:faces 0, bars 0, curves 0, corners 0 of 16000]`.
fn capacity_in(replies: &[Reply]) -> Option<Capacity> {
    let limit = |what: &str| {
        replies.iter().find_map(|reply| {
            let Reply::Other(line) = reply else { return None };
            let (_, rest) = line.strip_prefix("[MODEL:")?.strip_suffix(']')?.split_once(what)?;
            rest.split_once(" of ")?.1.parse().ok()
        })
    };
    let flash = replies.iter().find_map(|reply| {
        let (before, _) = flash_of(reply)?.split_once(" bytes")?;
        before.rsplit(' ').next()?.parse().ok()
    });
    let flash = flash.unwrap_or(0);
    Some(Capacity { vertices: limit("vertices ")?, corners: limit("corners ")?, flash })
}

/// What the answer to `$model` says of the flash for models: `[FLASH:1146880 bytes for a larger
/// model]`, or `[FLASH:vertices 9, faces 8, bars 0, corners 24 in 1146880 bytes]`.
fn flash_of(reply: &Reply) -> Option<&str> {
    let Reply::Other(line) = reply else { return None };
    line.strip_prefix("[FLASH:")?.strip_suffix(']')
}

/// The number of vertices of the model that the plotter's flash keeps.
fn kept_in(replies: &[Reply]) -> usize {
    let vertices = replies.iter().find_map(|reply| {
        let (vertices, _) = flash_of(reply)?.strip_prefix("vertices ")?.split_once(',')?;
        vertices.parse().ok()
    });
    vertices.unwrap_or(0)
}
