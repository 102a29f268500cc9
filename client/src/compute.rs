//! Decides whether the plotter computes a drawing or this computer does.
//!
//! What fits in the plotter's memory is sent as a model, and the plotter computes the drawing. What
//! does not fit is computed here by the same library, and its strokes are sent while they are
//! drawn. If the user wishes, the plotter computes that, too: a solid goes to its flash.

use crate::error::Error;
use crate::preview::{InMemory, ModelSize};
use crate::table::BoardRow;
use clap::ValueEnum;
use penup::machine::Settings;
use penup::protocol::CommandError;
use penup_job::room::Room;
use penup_readers::lines::Lines;

/// Where a drawing is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Compute {
    /// By the plotter if it fits in its memory, else by this computer
    #[default]
    Auto,
    /// By the plotter
    Board,
    /// By this computer, which sends the strokes while they are drawn
    Host,
}

/// The capacity of a plotter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Capacity {
    /// The number of vertices.
    pub vertices: usize,
    /// The number of corners of faces and ends of bars.
    pub corners: usize,
    /// The number of bytes of flash for a solid that is larger; 0 if there is none.
    pub flash: usize,
}

impl Capacity {
    /// The capacity of a board of the table.
    pub fn of(board: &BoardRow) -> Self {
        let BoardRow { memory, model_flash, .. } = board;
        let flash = usize::try_from(*model_flash).unwrap_or(0);
        Self { vertices: memory.vertices, corners: memory.corners, flash }
    }

    /// Whether a model of this size fits in flash: 12 bytes for a vertex and 3 for a corner, in
    /// whole pages of 256.
    fn holds_in_flash(self, size: &ModelSize) -> bool {
        let pages = (12 * size.vertices).div_ceil(256) + (3 * size.corners).div_ceil(256);
        size.curves == 0 && pages < self.flash / 256
    }
}

/// What is known of a plotter before a drawing is sent to it.
#[derive(Debug, Clone)]
pub struct Known {
    /// The capacity of the plotter.
    pub capacity: Capacity,
    /// The board of the plotter, if this program knows it.
    pub board: Option<&'static BoardRow>,
    /// The settings of the plotter. `None` if its firmware has settings that this program does not
    /// know.
    pub settings: Option<Settings>,
    /// The number of vertices of the model that its flash keeps; 0 if there is none.
    pub kept: usize,
}

/// Where a drawing is computed, and why.
pub struct Choice {
    /// The plotter in memory that is to compute it, with the file; `None` if the real one does.
    pub host: Option<InMemory<u32>>,
    /// A summary of the file and the drawing, for the user.
    pub totals: String,
    /// A sentence for the user, if this program has chosen.
    pub reason: Option<String>,
}

/// Chooses where a drawing is computed, and checks all that can be checked before it is sent.
///
/// # Errors
/// The drawing does not fit the machine, or it does not fit the plotter that is to compute it.
pub fn choose(known: &Known, job: &dyn Lines, compute: Compute) -> Result<Choice, Error> {
    let Capacity { vertices, corners, .. } = known.capacity;
    // Settings of a newer firmware are not known here. Then the plotter itself decides.
    let Some(settings) = known.settings else {
        if compute == Compute::Host {
            let reason = "this program does not know all settings of the plotter's firmware";
            return Err(Error::NotStreamed { reason: reason.to_owned() });
        }
        return Ok(Choice { host: None, totals: String::new(), reason: None });
    };
    let mut plotter = InMemory::<u32>::new(Room::for_job(job), settings);
    if !plotter.take(job) {
        // The plotter names the line that it refuses.
        return Ok(Choice { host: None, totals: String::new(), reason: None });
    }
    let size = plotter.model_size();
    let totals = format!(
        "the file has {} vertices, {} faces, {} edges and {} curves; the board holds {vertices} \
         vertices and {corners} corners",
        size.vertices, size.faces, size.bars, size.curves,
    );
    let here = |plotter, reason| Ok(Choice { host: Some(plotter), totals: totals.clone(), reason });
    if compute == Compute::Host {
        return here(plotter, None);
    }
    let is_too_large = [("vertices", size.vertices, vertices), ("corners", size.corners, corners)]
        .into_iter()
        .find(|(_, count, limit)| count > limit);
    if let Some((what, count, limit)) = is_too_large {
        if compute == Compute::Board && known.capacity.holds_in_flash(&size) && !plotter.is_plan() {
            let reason = format!(
                "the drawing has {count} {what}, and the board's memory takes {limit}: it goes to \
                 the board's flash, and is computed and drawn part by part"
            );
            return Ok(Choice { host: None, totals, reason: Some(reason) });
        }
        if compute == Compute::Board {
            return Err(Error::TooLarge { what, count, limit });
        }
        let reason = because(&format!("{count} {what}, and it takes {limit}"));
        return here(plotter, Some(reason));
    }
    let rehearsed = match known.board {
        // The rehearsal has the memory and the number widths of that board.
        Some(board) => {
            let mut plotter = InMemory::<u16>::new(Room::of_board(board), settings);
            if plotter.take(job) { plotter.rehearse() } else { Ok(()) }
        }
        None => plotter.rehearse(),
    };
    match rehearsed {
        Err(Error::NotDrawn { refusal }) if compute == Compute::Auto && is_for_memory(&refusal) => {
            here(plotter, Some(because(&refusal.to_string())))
        }
        rehearsed => {
            rehearsed?;
            Ok(Choice { host: None, totals, reason: None })
        }
    }
}

/// Says that this computer computes, and why.
fn because(reason: &str) -> String {
    format!(
        "the drawing is too large for the board's memory ({reason}), so this computer computes it \
         and sends the strokes while they are drawn"
    )
}

/// Whether a plotter with more memory would not refuse the drawing so.
fn is_for_memory(refusal: &CommandError) -> bool {
    matches!(refusal, CommandError::DrawingTooLarge(_) | CommandError::TooManyLines)
}
