//! What stands in its place on a board that keeps nothing of jobs: none goes on.

use super::Resumption;
use crate::index::Index;
use crate::machine::{Settings, State};
use crate::plotter::{Board, Inner};
#[cfg(feature = "stream")]
use crate::protocol::{CommandError, StreamHeader};

impl Resumption {
    /// How many strokes of a job that has stopped are drawn, and how many there are: none.
    pub(in crate::plotter) const fn stopped(&self, _: State) -> Option<[u32; 2]> {
        None
    }

    /// The position of the pen is not known.
    pub(in crate::plotter) const fn lose_position(&mut self) {}

    /// The machine has been homed.
    pub(in crate::plotter) const fn find_position(&mut self, _: &Settings) {}

    /// Reports a job that has stopped: there is none.
    pub(in crate::plotter) const fn report<B: Board>(&self, _: State, _: &mut B) {}
}

impl<I: Index> Inner<'_, I> {
    /// Keeps nothing of a job that is sent while it is drawn.
    #[cfg(feature = "stream")]
    pub(in crate::plotter) const fn keep_streamed<B: Board>(&mut self, _: StreamHeader, _: &mut B) {
    }

    /// Whether a job has stopped that was sent while it was drawn: none.
    ///
    /// # Errors
    /// None.
    #[cfg(feature = "stream")]
    pub(in crate::plotter) const fn report_stopped_stream<B: Board>(
        &self,
        _: &mut B,
    ) -> Result<bool, CommandError> {
        Ok(false)
    }

    /// Looks for a job that has stopped: there is none.
    pub(in crate::plotter) const fn find_stopped<B: Board>(&mut self, _: &mut B) {}

    /// Does nothing, because the progress of jobs is not kept.
    pub(in crate::plotter) const fn keep_progress<B: Board>(
        &mut self,
        _: Option<[u32; 2]>,
        _: &mut B,
    ) {
    }

    /// Keeps that a stroke has been drawn: it is not kept.
    pub(in crate::plotter) const fn note_progress<B: Board>(&mut self, _: &mut B) {}
}
