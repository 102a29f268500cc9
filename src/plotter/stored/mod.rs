//! A model that is too large for the memory. It lies in flash, and is drawn part by part.
//!
//! A model begins in memory. The line that does not fit there moves it to flash, where the lines
//! after it are written ([`Upload`]). `$plot` writes the record, with which the model is complete:
//! it then stays through a loss of power, and cannot be changed any more. `$clear` removes it.
//!
//! The sectors are erased while the model arrives, so that is refused unless the machine is at
//! rest. While the model is drawn ([`parts`]) nothing of its flash is written.

mod compute;
mod parts;
mod serve;

pub(super) use parts::Parts;
pub(super) use serve::PartsProgress;

use super::listener::Listener;
use super::reply::Reply;
use super::{Board, Inner};
use crate::index::Index;
use crate::machine::State;
use crate::model::{StoredModel, Upload, UploadError};
use crate::protocol::{Command, CommandError, RealTime, StoredModelError};
use crate::stage::Cancel as _;
use crate::storage::PAGE_BYTES;
use crate::storage::area::{Area, AreaFlash, NotWritten};

/// The state of the model in flash.
#[derive(Debug, Default)]
#[expect(clippy::large_enum_variant, reason = "without an allocator it lies here anyway")]
pub(super) enum FlashModel {
    /// There is no model in flash, and the one in memory counts.
    #[default]
    Nothing,
    /// A model that is still coming.
    Upload(Upload),
    /// A model that is complete.
    Whole,
}

impl From<UploadError> for CommandError {
    fn from(error: UploadError) -> Self {
        match error {
            UploadError::Model(error) => Self::Model(error),
            UploadError::Flash => StoredModelError::NotWritten.into(),
        }
    }
}

/// The area for models and what writes it.
///
/// # Errors
/// [`StoredModelError::NotWritten`] if the board has none.
fn flash_of<B: Board>(board: &mut B) -> Result<(Area<'static>, &mut dyn AreaFlash), CommandError> {
    board.model_flash().ok_or(StoredModelError::NotWritten.into())
}

impl<I: Index> Inner<'_, I> {
    /// Whether the model lies in flash, or goes there.
    pub(super) fn is_in_flash(&self) -> bool {
        !matches!(self.large, FlashModel::Nothing)
    }

    /// Looks for a model in flash, and tells the user of it.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn find_stored<B: Board>(&mut self, board: &mut B) {
        /// While the voltage rises, flash may return garbage, which is no model.
        const READINGS: usize = 4;
        let mut readings = (0..READINGS).map_while(|_| board.uncached_model());
        let Some(model) = readings.find_map(StoredModel::new) else { return };
        self.large = FlashModel::Whole;
        Reply(board).line(format_args!(
            "[MSG:the flash keeps a model of {} vertices: $plot draws it, $clear removes it]",
            model.vertex_count()
        ));
    }

    /// Carries out a command if it is about a model in flash, or if it makes the model too large
    /// for the memory. Returns the command if it is to be carried out as usual.
    ///
    /// # Errors
    /// [`StoredModelError`], or the refusal of the model.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn carry_out_in_flash<'l, B: Board>(
        &mut self,
        command: Command<'l>,
        board: &mut B,
    ) -> Result<Option<Command<'l>>, CommandError> {
        let grows = matches!(command, Command::Vertex(_) | Command::Face(_) | Command::Polyline(_));
        let is_curve = matches!(
            command,
            Command::Degree(_) | Command::Curve { .. } | Command::Knots(_) | Command::EndCurve
        );
        let is_edit = matches!(command, Command::Edit(_) | Command::List(..) | Command::Undo);
        if !self.is_in_flash() {
            if !grows || self.fits_in_memory(&command) || board.model_flash().is_none() {
                return Ok(Some(command));
            }
            if !self.model.curves().is_empty() {
                return Err(StoredModelError::NoCurves.into());
            }
            self.move_to_flash(board)?;
        }
        match command {
            Command::Clear => {
                self.remove_stored(board)?;
                return Ok(Some(command));
            }
            Command::Assign { .. } if self.parts.is_active() => {
                return Err(StoredModelError::Drawing.into());
            }
            Command::Pen { .. } if self.options.one_pen => return Ok(Some(command)),
            Command::Pen { .. } => {}
            _ if is_edit || is_curve && matches!(self.large, FlashModel::Whole) => {
                return Err(StoredModelError::Unchangeable.into());
            }
            _ if is_curve => return Err(StoredModelError::NoCurves.into()),
            _ if grows => {}
            _ => return Ok(Some(command)),
        }
        let FlashModel::Upload(upload) = &mut self.large else {
            return Err(StoredModelError::Unchangeable.into());
        };
        if !is_at_rest(self.machine.state(), self.machine.is_stopped()) {
            return Err(CommandError::Busy);
        }
        let (area, flash) = flash_of(board)?;
        let outcome = match command {
            Command::Vertex(coordinates) => upload.add_vertex(coordinates, area, flash),
            Command::Face(numbers) => upload.add_face(numbers.iter(), area, flash),
            Command::Polyline(numbers) => upload.add_polyline(numbers.iter(), area, flash),
            Command::Pen { by_material, name } => upload.choose_pen(by_material, name),
            _ => Ok(()),
        };
        if outcome == Err(UploadError::Flash) {
            self.large = FlashModel::Nothing;
        }
        Ok(outcome.map(|()| None)?)
    }

    /// Whether what a command adds fits in memory. A change of the pen that needs no room may count
    /// as if it did.
    fn fits_in_memory(&self, command: &Command<'_>) -> bool {
        /// The room of a change of the pen.
        const RUN: usize = 2;
        let model = &self.model;
        let more = match command {
            Command::Vertex(_) => return model.vertices().len() < model.vertex_limit(),
            Command::Face(numbers) => numbers.iter().count(),
            Command::Polyline(numbers) => 2 * numbers.iter().count().saturating_sub(1),
            _ => 0,
        };
        model.corner_count() + more + RUN <= model.corner_limit()
    }

    /// Moves the model to flash, because its next part does not fit in memory. The user is answered
    /// meanwhile. A model that is given up before all of it is there stays in memory.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn move_to_flash<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        if !is_at_rest(self.machine.state(), self.machine.is_stopped()) {
            return Err(CommandError::Busy);
        }
        let (area, _) = flash_of(board)?;
        let mut listener = self.listener(board);
        listener.stage = None;
        listener.state = match self.machine.state() {
            State::Alarm(_) => "Alarm",
            State::Check => "Check",
            State::Sleep => "Sleep",
            _ => "Idle",
        };
        let mut flash = ListeningFlash { listener: &mut listener, is_aborted: false };
        let begun = Upload::begin(&self.model, area, &mut flash);
        let is_aborted = flash.is_aborted;
        let Listener { requests, overrides, .. } = listener;
        self.change_overrides(overrides);
        if is_aborted {
            self.act(requests.only(RealTime::EMERGENCY));
            return Err(CommandError::Aborted);
        }
        self.large = FlashModel::Upload(begun?);
        self.copy_words = 0;
        self.model.clear();
        Reply(board).line(format_args!(
            "[MSG:too large for the memory: the model goes to flash, and cannot be edited]"
        ));
        Ok(())
    }

    /// Removes the model from flash.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn remove_stored<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        if self.parts.is_active() {
            return Err(StoredModelError::Drawing.into());
        }
        if !is_at_rest(self.machine.state(), self.machine.is_stopped()) {
            return Err(CommandError::Busy);
        }
        let (area, flash) = flash_of(board)?;
        area.clear(flash).map_err(|_| StoredModelError::NotWritten)?;
        self.large = FlashModel::Nothing;
        Reply(board).line(format_args!("[MSG:the model in flash is removed]"));
        Ok(())
    }

    /// Completes the model that is coming, and returns it.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(super) fn whole_model<B: Board>(
        &mut self,
        board: &mut B,
    ) -> Result<StoredModel<'static>, CommandError> {
        let (area, flash) = flash_of(board)?;
        match core::mem::take(&mut self.large) {
            FlashModel::Upload(upload) => drop(upload.finish(area, flash)?),
            FlashModel::Whole | FlashModel::Nothing => {}
        }
        let model = StoredModel::new(area).ok_or(StoredModelError::Damaged)?;
        self.large = FlashModel::Whole;
        Ok(model)
    }

    /// Whether a model is coming that is not complete in flash.
    pub(super) fn is_uploading(&self) -> bool {
        matches!(self.large, FlashModel::Upload(_))
    }

    /// Writes the part of the reply to `$model` that tells of a model in flash, or of the room
    /// there. A model that is still coming is completed. Returns the checksum of the model.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn report_stored<B: Board>(&mut self, board: &mut B) -> Option<u32> {
        let bytes = board.model_flash()?.0.bytes();
        if !self.is_in_flash() {
            Reply(board).line(format_args!("[FLASH:{bytes} bytes for a larger model]"));
            return None;
        }
        let model = match self.whole_model(board) {
            Ok(model) => model,
            Err(error) => {
                Reply(board).line(format_args!("[MSG:{error}]"));
                return None;
            }
        };
        Reply(board).line(format_args!(
            "[FLASH:vertices {}, faces {}, bars {}, corners {} in {bytes} bytes]",
            model.vertex_count(),
            model.face_count(),
            model.bar_count(),
            model.corner_count()
        ));
        Some(model.checksum())
    }
}

/// The flash for models, which listens to the user before each change: a sector may take 400 ms,
/// and a model that goes to flash takes many.
struct ListeningFlash<'l, 'b, B: Board> {
    /// What answers the user meanwhile.
    listener: &'l mut Listener<'b, B>,
    /// Whether the user has given up what is written.
    is_aborted: bool,
}

impl<B: Board> ListeningFlash<'_, '_, B> {
    /// Listens to the user, and returns the flash.
    fn listen(&mut self) -> Result<&mut dyn AreaFlash, NotWritten> {
        self.is_aborted = self.is_aborted || self.listener.check().is_err();
        if self.is_aborted {
            return Err(NotWritten);
        }
        self.listener.board.model_flash().map(|(_, flash)| flash).ok_or(NotWritten)
    }
}

impl<B: Board> AreaFlash for ListeningFlash<'_, '_, B> {
    fn erase_sector(&mut self, at: usize) -> Result<(), NotWritten> {
        self.listen()?.erase_sector(at)
    }

    fn write_page(&mut self, at: usize, page: &[u8; PAGE_BYTES]) -> Result<(), NotWritten> {
        self.listen()?.write_page(at, page)
    }
}

/// Whether flash may be erased.
fn is_at_rest(state: State, is_stopped: bool) -> bool {
    matches!(state, State::Idle | State::Check | State::Alarm(_) | State::Sleep) && is_stopped
}
