//! The records that a board with flash keeps through a loss of power, and the progress of the job.
//!
//! A board owns a [`FlashRecords`] and passes its calls of [`Board`](super::Board) on to it.

use super::{NotStored, Record, Stored};
use crate::storage::{Log, LogProgress, Slots};
use embedded_storage::nor_flash::MultiwriteNorFlash;

/// The addresses of the records in the flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// The settings of the machine.
    pub settings: Slots,
    /// The coordinate systems, startup lines and texts.
    pub parameters: Slots,
    /// The strokes of the last job.
    pub job: Slots,
    /// The logs of the progress of the job: one for each of the two slots of the job.
    pub logs: [Log; 2],
}

/// The unit in which flash is erased, in bytes.
const SECTOR_BYTES: u32 = 4096;

impl Layout {
    /// The layout of a part of flash that begins at `start`, for jobs of at most `job_bytes`: the
    /// settings, the jobs, the parameters, and the logs, each in whole sectors. It must not change,
    /// because a new version of the firmware finds what an older one has kept.
    pub const fn from(start: u32, job_bytes: u32) -> Self {
        let settings = Slots { start, bytes: SECTOR_BYTES };
        let job = Slots { start: settings.end(), bytes: job_bytes };
        let parameters = Slots { start: job.end(), bytes: SECTOR_BYTES };
        let first = Log { start: parameters.end(), bytes: SECTOR_BYTES };
        let second = Log { start: first.start + first.bytes, ..first };
        Self { settings, parameters, job, logs: [first, second] }
    }

    /// Where the part of flash ends.
    pub const fn end(&self) -> u32 {
        let [_, last] = self.logs;
        last.start + last.bytes
    }

    /// Returns where the two slots of a record lie.
    const fn slots(&self, record: Record) -> Slots {
        match record {
            Record::Settings => self.settings,
            Record::Parameters => self.parameters,
            Record::Job => self.job,
        }
    }
}

/// The log that is written while a job is drawn.
#[derive(Debug, Clone, Copy)]
struct OpenLog {
    /// The location of the log in the flash.
    log: Log,
    /// The numbers of strokes, and of points within strokes, that are noted in it.
    noted: LogProgress,
}

/// The records in the flash `F`.
#[derive(Debug)]
pub struct FlashRecords<F> {
    /// The flash.
    pub flash: F,
    /// The addresses of the records.
    layout: Layout,
    /// The log of the job that is being drawn, or that could go on.
    open: Option<OpenLog>,
    /// The parts of the flash that were erased in advance for the next job.
    #[cfg(feature = "early-ink")]
    ahead: ErasedAhead,
}

/// The parts of the flash that were erased in advance for the next job, and were not written since.
#[cfg(feature = "early-ink")]
#[derive(Debug, Clone, Copy, Default)]
struct ErasedAhead {
    /// The number of bytes of the slot that is written next, from its beginning on.
    job: u32,
    /// The number of the slot whose log is erased, if one is.
    log: Option<usize>,
}

impl<F: MultiwriteNorFlash> FlashRecords<F> {
    /// The records that lie in `flash` as `layout` says.
    pub const fn new(flash: F, layout: Layout) -> Self {
        Self {
            flash,
            layout,
            open: None,
            #[cfg(feature = "early-ink")]
            ahead: ErasedAhead { job: 0, log: None },
        }
    }

    /// Carries out [`Board::save`](super::Board::save).
    ///
    /// # Errors
    /// [`NotStored`]; the last state is still kept.
    pub fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        #[cfg(feature = "early-ink")]
        return self.save_with_room(record, parts, 0);
        #[cfg(not(feature = "early-ink"))]
        {
            if record == Record::Job {
                self.open = None;
            }
            let slots = self.layout.slots(record);
            let mut writer = slots.write(&mut self.flash).map_err(|_| NotStored)?;
            for part in parts {
                writer.write(part).map_err(|_| NotStored)?;
            }
            writer.finish().map_err(|_| NotStored)
        }
    }

    /// Carries out [`Board::save_with_room`](super::Board::save_with_room).
    ///
    /// # Errors
    /// [`NotStored`]; the last state is still kept.
    #[cfg(feature = "early-ink")]
    #[inline(never)] // Its callers share one copy of the code.
    pub fn save_with_room(
        &mut self,
        record: Record,
        parts: &[&[u8]],
        room: u32,
    ) -> Result<(), NotStored> {
        let mut erased = 0;
        if record == Record::Job {
            self.open = None;
            erased = core::mem::take(&mut self.ahead.job);
        }
        let slots = self.layout.slots(record);
        let writer = slots.write_into_erased(&mut self.flash, erased);
        let mut writer = writer.map_err(|_| NotStored)?;
        for part in parts {
            writer.write(part).map_err(|_| NotStored)?;
        }
        if room > 0 {
            writer.leave_room(room).map_err(|_| NotStored)?;
        }
        writer.finish().map_err(|_| NotStored)
    }

    /// Carries out [`Board::erase_ahead`](super::Board::erase_ahead).
    #[cfg(feature = "early-ink")]
    #[inline(never)] // It is called seldom.
    pub fn erase_ahead(&mut self, bytes: u32) -> bool {
        let Layout { job, logs, .. } = self.layout;
        if self.ahead.job < bytes {
            // A sector that fails is erased again when the job is saved, which then fails, too.
            let erased = job.erase_ahead(&mut self.flash, self.ahead.job).is_ok();
            self.ahead.job += if erased { SECTOR_BYTES } else { 0 };
            return erased;
        }
        if self.ahead.log.is_none()
            && let Ok(slot) = job.erase_ahead(&mut self.flash, job.bytes)
            && let Some(log) = logs.get(slot)
            && log.erase(&mut self.flash).is_ok()
        {
            self.ahead.log = Some(slot);
        }
        false
    }

    /// Carries out [`Board::add`](super::Board::add).
    ///
    /// # Errors
    /// [`NotStored`]; nothing is then added.
    #[cfg(feature = "early-ink")]
    pub fn add(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        self.layout.slots(record).add(&mut self.flash, parts).map_err(|_| NotStored)
    }

    /// Carries out [`Board::load_added`](super::Board::load_added).
    #[cfg(feature = "early-ink")]
    pub fn load_added(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        if let Some(mut added) = self.layout.slots(record).added(&mut self.flash) {
            take(&mut added);
        }
    }

    /// Carries out [`Board::load`](super::Board::load).
    pub fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        if let Some(mut state) = self.layout.slots(record).latest(&mut self.flash) {
            take(&mut state);
        }
    }

    /// Carries out [`Board::begin_progress`](super::Board::begin_progress).
    ///
    /// # Errors
    /// [`NotStored`] if no job is kept, if the log cannot hold this many strokes, or if the flash
    /// does not take it.
    pub fn begin_progress(&mut self, notes: &[u8], strokes: u32) -> Result<(), NotStored> {
        self.open = None;
        let (slot, sum) = self.layout.job.identify(&mut self.flash).ok_or(NotStored)?;
        let log = *self.layout.logs.get(slot).ok_or(NotStored)?;
        if strokes > log.limit() {
            return Err(NotStored);
        }
        #[cfg(feature = "early-ink")]
        let begun = if self.ahead.log.take() == Some(slot) {
            log.begin_erased(&mut self.flash, sum, notes)
        } else {
            log.begin(&mut self.flash, sum, notes)
        };
        #[cfg(not(feature = "early-ink"))]
        let begun = log.begin(&mut self.flash, sum, notes);
        begun.map_err(|_| NotStored)?;
        self.open = Some(OpenLog { log, noted: LogProgress::default() });
        Ok(())
    }

    /// Carries out [`Board::note_progress`](super::Board::note_progress).
    ///
    /// # Errors
    /// [`NotStored`] if no log is open or the flash does not take it.
    pub fn note_progress(&mut self, strokes: u32) -> Result<(), NotStored> {
        let open = self.open.as_mut().ok_or(NotStored)?;
        if strokes == u32::MAX {
            // The flash may refuse to clear a bit that is cleared.
            if !open.noted.is_closed {
                open.log.close(&mut self.flash).map_err(|_| NotStored)?;
                open.noted.is_closed = true;
            }
            return Ok(());
        }
        open.log.note(&mut self.flash, open.noted.parts, strokes).map_err(|_| NotStored)?;
        open.noted.parts = open.noted.parts.max(strokes);
        Ok(())
    }

    /// Carries out [`Board::note_point`](super::Board::note_point).
    ///
    /// # Errors
    /// [`NotStored`] if no log is open or the flash does not take it.
    pub fn note_point(&mut self, points: u32) -> Result<(), NotStored> {
        let open = self.open.as_mut().ok_or(NotStored)?;
        open.log.note_points(&mut self.flash, open.noted.points, points).map_err(|_| NotStored)?;
        open.noted.points = open.noted.points.max(points);
        Ok(())
    }

    /// Carries out [`Board::progress`](super::Board::progress).
    pub fn progress(&mut self, notes: &mut [u8]) -> Option<(usize, LogProgress)> {
        let (slot, sum) = self.layout.job.identify(&mut self.flash)?;
        let log = *self.layout.logs.get(slot)?;
        let (length, noted) = log.read(&mut self.flash, sum, notes)?;
        self.open = Some(OpenLog { log, noted });
        Some((length, noted))
    }
}
