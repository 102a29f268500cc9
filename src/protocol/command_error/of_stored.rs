//! The errors about a model that lies in flash, because it is too large for the memory.

use super::{CommandError, Row, error};
use core::fmt;

/// Why something is not done with a model in flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredModelError {
    /// The model is complete, so it cannot be extended, edited, listed or undone.
    Unchangeable,
    /// The model is too large for the memory, and the flash holds no curves.
    NoCurves,
    /// A model in flash can be drawn only with hidden lines removed by faces, and not as a flat
    /// plan.
    FacesOnly,
    /// A job draws it, so it and the options stay as they are.
    Drawing,
    /// The flash did not take it.
    NotWritten,
    /// The flash no longer holds what was written.
    Damaged,
    /// A point or an edge has more faces about it than fit in the working memory.
    TooDense(Crowd),
}

/// What the faces need that meet in one place, and what there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crowd {
    /// How much is needed; if that is not known, a little more than there is room for.
    pub needed: usize,
    /// How much there is room for.
    pub room: usize,
    /// What is counted, in the plural.
    pub unit: &'static str,
}

/// Passes to `row` the row of an error about a model in flash.
#[inline(never)] // Its caller would be larger.
pub(super) fn explain_stored(refusal: StoredModelError, row: Row<'_>) {
    match refusal {
        StoredModelError::Unchangeable => row(
            error(191, "a model in flash cannot be changed").client(
                "the plotter keeps a model in its flash, which cannot be changed: it is replaced \
                 by the next one",
            ),
            format_args!("the model lies in flash and is complete: $clear removes it"),
        ),
        StoredModelError::NoCurves => row(
            error(192, "no curves in a model in flash"),
            format_args!("a model too large for the memory has no curves: make them lines"),
        ),
        StoredModelError::FacesOnly => row(
            error(193, "a model in flash is drawn with its faces").client(
                "a model as large as this is drawn with its faces by the plotter: let this \
                 computer compute it, by `--compute host`",
            ),
            format_args!("a model in flash takes $see=faces, and is no flat plan"),
        ),
        StoredModelError::Drawing => row(
            error(194, "the model in flash is being drawn").client(
                "the plotter draws the model in its flash: wait until that is done, or give the \
                 job up by `penup abort`",
            ),
            format_args!("wait until the model in flash is drawn, or send ctrl-X"),
        ),
        StoredModelError::NotWritten => row(
            error(195, "the flash did not take the model"),
            format_args!("the flash did not take the model: it may be worn out"),
        ),
        StoredModelError::Damaged => row(
            error(196, "the model in flash is damaged"),
            format_args!("the flash no longer holds what was sent: $clear, and send it again"),
        ),
        StoredModelError::TooDense(Crowd { needed, room, unit }) => row(
            error(197, "too many faces in one place"),
            format_args!(
                "{needed} {unit} are needed in one place where there is room for {room}: leave \
                 out faces there, or let a computer compute it (penup plot --compute host)"
            ),
        ),
    }
}

impl From<StoredModelError> for CommandError {
    fn from(error: StoredModelError) -> Self {
        Self::Stored(error)
    }
}

impl fmt::Display for StoredModelError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        CommandError::Stored(*self).fmt(formatter)
    }
}

impl core::error::Error for StoredModelError {}
