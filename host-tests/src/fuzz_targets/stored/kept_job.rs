//! A job and its progress, as flash keeps them and as an input holds them.

use super::{SETTING_BYTES, divide, interrupted};
use crate::cut_jobs::{Powered, empty_flash, switch_on, switch_on_small};
use penup::boards::host::{CutArea, CutFlash, LAYOUT};
use penup::plotter::{FlashRecords, Record};
use penup::storage::NOTE_BYTES;
use std::cell::Cell;
use std::ops::Range;

/// The mark of a layout.
const MARK: Range<usize> = 0..4;
/// What differs between builds, so that a job of another one is refused: in notes, the version of
/// the firmware and the checksum of its sources.
const BUILD_IN_NOTES: [Range<usize>; 2] = [4..8, 24..28];
/// In the record of a drawing in parts, the checksum of the sources.
const BUILD_IN_PARTS: Range<usize> = 20..24;
/// Behind so many bytes of notes come settings, each with its number: two words.
const SETTINGS_IN_NOTES: usize = 32;
/// The room behind a record for the order of its strokes, in bytes.
const ORDER_ROOM: u32 = 16 << 10;

/// A job and its progress.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptJob {
    /// The record of the job, which begins with the mark of its layout.
    record: Vec<u8>,
    /// The notes of the job's log, which begin with the mark of theirs.
    notes: Vec<u8>,
    /// The number of strokes that are noted as drawn, at most 255.
    strokes: u8,
    /// The number of points within strokes that are noted as passed, at most 255.
    points: u8,
}

impl KeptJob {
    /// The job that this flash keeps, if it keeps the progress, too.
    pub fn of(flash: &CutFlash) -> Option<Self> {
        let mut records = FlashRecords::new(flash.clone(), LAYOUT);
        let mut notes = [0; NOTE_BYTES];
        let (length, noted) = records.progress(&mut notes)?;
        let mut record = Vec::new();
        records.load(Record::Job, &mut |stored| {
            let mut bytes = [0; 256];
            while let count @ 1.. = stored.read(&mut bytes) {
                record.extend(&bytes[..count]);
            }
        });
        let [strokes, points] = [noted.parts, noted.points].map(|count| count.min(255) as u8);
        Some(Self { record, notes: notes[..length].to_vec(), strokes, points })
    }

    /// The job that an input of the target holds: in place of settings, the number of strokes, the
    /// number of points, the length of the notes, and the notes.
    pub fn from_input(input: &[u8]) -> Option<Self> {
        let (settings, record) = divide(input)?;
        let (&[strokes, points, length], rest) = settings.split_first_chunk()?;
        let notes = rest.get(..length.into()).filter(|notes| !notes.is_empty())?;
        Some(Self { record: record.to_vec(), notes: notes.to_vec(), strokes, points })
    }

    /// The input of the target that holds this job.
    pub fn input(&self) -> Vec<u8> {
        const { assert!((3 + NOTE_BYTES).div_ceil(SETTING_BYTES) < 256) };
        let mut settings = vec![self.strokes, self.points, self.notes.len() as u8];
        settings.extend(&self.notes);
        settings.resize(settings.len().next_multiple_of(SETTING_BYTES), 0);
        let count = (settings.len() / SETTING_BYTES) as u8;
        [&[count][..], &settings, &self.record].concat()
    }

    /// The marks of the layouts of the record and of the notes.
    pub fn marks(&self) -> [String; 2] {
        [&self.record, &self.notes]
            .map(|bytes| String::from_utf8_lossy(bytes.get(MARK).unwrap_or_default()).into_owned())
    }

    /// The number of strokes that are noted as drawn, and of points within strokes as passed.
    pub fn noted(&self) -> [u8; 2] {
        [self.strokes, self.points]
    }

    /// Whether another job is kept in the same layouts and has stopped at a place of the same kind:
    /// between two strokes, or within one.
    pub fn is_like(&self, other: &Self) -> bool {
        self.marks() == other.marks() && (self.points > 0) == (other.points > 0)
    }

    /// Whether a board goes on with this job.
    pub fn goes_on(self) -> bool {
        let mut answer = String::new();
        self.switch_on(|plotter| answer = plotter.say("$resume=origin"));
        answer.ends_with("ok\n")
    }

    /// Switches a board on whose flash holds this job, as one that this build has begun, and the
    /// settings in the notes, and lets `work` use it. Does nothing if the flash does not take them.
    pub fn switch_on(mut self, work: impl FnOnce(&mut Powered<'_, '_>)) {
        let board = BoardWithModel::take();
        let is_in_parts = self.marks()[0] == board.stopped.marks()[0];
        for place in BUILD_IN_NOTES {
            copy(place, &board.stopped.notes, &mut self.notes);
        }
        if is_in_parts {
            copy(BUILD_IN_PARTS, &board.stopped.record, &mut self.record);
        }
        match self.flash() {
            Some(flash) if is_in_parts => board.switch_on(flash, work),
            Some(flash) => {
                board.put_back();
                switch_on(flash, work);
            }
            None => board.put_back(),
        }
    }

    /// A flash that holds this job and the settings in its notes, if it takes them.
    fn flash(&self) -> Option<CutFlash> {
        let settings = self.notes.get(SETTINGS_IN_NOTES..).unwrap_or_default();
        let settings: Vec<u8> = settings
            .chunks_exact(8)
            .flat_map(|setting| [&setting[..2], &setting[4..]].concat())
            .collect();
        let mut records = FlashRecords::new(empty_flash(), LAYOUT);
        records.save(Record::Settings, &[&settings]).ok()?;
        records.save_with_room(Record::Job, &[&self.record], ORDER_ROOM).ok()?;
        records.begin_progress(&self.notes, self.strokes.into()).ok()?;
        records.note_progress(self.strokes.into()).ok()?;
        records.note_point(self.points.into()).ok()?;
        Some(records.flash)
    }
}

/// Copies what lies at this place, if both have it.
fn copy(place: Range<usize>, from: &[u8], to: &mut [u8]) {
    if let (Some(to), Some(from)) = (to.get_mut(place.clone()), from.get(place)) {
        to.copy_from_slice(from);
    }
}

/// A board whose flash holds a model, which it draws in parts.
struct BoardWithModel {
    model: CutArea,
    /// A drawing of the model that has stopped.
    stopped: KeptJob,
}

thread_local! {
    /// One board serves for all inputs, because its model takes long to come and stays as it is.
    static BOARD: Cell<Option<BoardWithModel>> = const { Cell::new(None) };
}

impl BoardWithModel {
    /// Takes the board of this thread.
    fn take() -> Self {
        BOARD.take().unwrap_or_else(|| {
            let (flash, model) = interrupted::in_parts();
            Self { model, stopped: KeptJob::of(&flash).expect("its progress is kept") }
        })
    }

    /// Puts it back.
    fn put_back(self) {
        BOARD.set(Some(self));
    }

    /// Switches it on with this flash for jobs, lets `work` use it, and puts it back.
    fn switch_on(self, flash: CutFlash, work: impl FnOnce(&mut Powered<'_, '_>)) {
        let (_, model, _) = switch_on_small(flash, self.model, interrupted::WORK_TICKS, work);
        Self { model, ..self }.put_back();
    }
}
