//! The records of settings and jobs in the board's flash, which outlive a loss of power: their
//! formats, and how they are saved and loaded.

use super::job::FIGURES;
use super::program::{Parameters, SYSTEMS, TEXT_LIMIT, Text};
use super::{Board, Job, NotStored, Record, Stored};
use crate::array::MapEach;
use crate::index::Index;
use crate::machine::{SETTINGS, Settings, Value};
use crate::protocol::CommandError;

/// Size of a kept setting: two bytes for its number, four for its value.
const SETTING_BYTES: usize = 6;

/// The settings kept by the board; those that are not kept have their default values.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn load_settings<B: Board>(board: &mut B) -> Settings {
    let mut values = heapless::Vec::<(u16, Value), { SETTINGS.len() }>::new();
    board.load(Record::Settings, &mut |record| {
        let mut bytes = [0; SETTING_BYTES];
        // A record with more entries than there are settings was written by another version. Its
        // last entries are unknown to this one.
        while record.read(&mut bytes) == SETTING_BYTES && !values.is_full() {
            let [a, b, c, d, e, f] = bytes;
            let value = Value::from_bits(i32::from_le_bytes([c, d, e, f]));
            let _ = values.push((u16::from_le_bytes([a, b]), value));
        }
    });
    Settings::restored(values)
}

/// Keeps the settings in the board's flash.
///
/// # Errors
/// [`CommandError::NotStored`]: the settings are in force, but after a loss of power the previous
/// ones return.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn save_settings<B: Board>(
    settings: &Settings,
    board: &mut B,
) -> Result<(), CommandError> {
    let mut bytes = [0; SETTINGS.len() * SETTING_BYTES];
    for (entry, (info, value)) in bytes.chunks_exact_mut(SETTING_BYTES).zip(settings.iter()) {
        entry[..2].copy_from_slice(&info.number.to_le_bytes());
        entry[2..].copy_from_slice(&value.to_bits().to_le_bytes());
    }
    board.save(Record::Settings, &[&bytes]).map_err(|_| CommandError::NotStored)
}

/// A mark at the beginning of kept parameters; those with another layout have another mark. Behind
/// it stand the coordinates of the systems and of G30, each four bytes, and then the texts, each
/// with its length before it.
const PARAMETERS_LAYOUT: [u8; 4] = *b"par1";

/// The parameters kept by the board, or the default ones.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn load_parameters<B: Board>(board: &mut B) -> Parameters {
    let mut parameters = Parameters::default();
    board.load(Record::Parameters, &mut |record| {
        if let Some(found) = read_parameters(record) {
            parameters = found;
        }
    });
    parameters
}

/// Reads parameters. `None` if the record has another layout.
fn read_parameters(record: &mut dyn Stored) -> Option<Parameters> {
    let mut next = || {
        let mut word = [0; 4];
        (record.read(&mut word) == word.len()).then_some(word)
    };
    if next()? != PARAMETERS_LAYOUT {
        return None;
    }
    let mut parameters = Parameters::default();
    let Parameters { systems, second, texts } = &mut parameters;
    for coordinate in systems.as_flattened_mut().iter_mut().chain(second) {
        *coordinate = Value::from_bits(i32::from_le_bytes(next()?));
    }
    for text in texts {
        let (mut length, mut bytes) = ([0; 1], [0; TEXT_LIMIT]);
        let [count] = (record.read(&mut length) == 1).then_some(length)?;
        let bytes = bytes.get_mut(..count.into())?;
        if record.read(bytes) != bytes.len() {
            return None;
        }
        *text = Text::try_from(core::str::from_utf8(bytes).ok()?).ok()?;
    }
    Some(parameters)
}

/// Keeps the parameters in the board's flash.
///
/// # Errors
/// [`CommandError::NotStored`]: they are in force, but after a loss of power the previous ones
/// return.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn save_parameters<B: Board>(
    parameters: &Parameters,
    board: &mut B,
) -> Result<(), CommandError> {
    let Parameters { systems, second, texts } = parameters;
    let mut coordinates = [[0; 4]; 3 * SYSTEMS + 3];
    for (word, coordinate) in
        coordinates.iter_mut().zip(systems.as_flattened().iter().chain(second))
    {
        *word = coordinate.to_bits().to_le_bytes();
    }
    let [first, other, info] = texts;
    let lengths = texts.each_ref().map_each(|text| [text.len() as u8]);
    let parts: [&[u8]; 8] = [
        &PARAMETERS_LAYOUT,
        coordinates.as_flattened(),
        &lengths[0],
        first.as_bytes(),
        &lengths[1],
        other.as_bytes(),
        &lengths[2],
        info.as_bytes(),
    ];
    board.save(Record::Parameters, &parts).map_err(|_| CommandError::NotStored)
}

/// A mark at the beginning of a kept job; a job with another layout has another mark.
const JOB_LAYOUT: u32 = u32::from_le_bytes(*b"job1");
/// A mark in place of [`JOB_LAYOUT`] for a job of which nothing is kept, because it was sent while
/// it was drawn.
#[cfg(all(feature = "stream", feature = "resume"))]
const STREAMED_LAYOUT: u32 = u32::from_le_bytes(*b"jobs");
/// Number of words before a job's memory: the layout, the steps per millimetre of x and y, and the
/// job's figures.
const JOB_HEADER: usize = 3 + FIGURES;

/// Returns the steps per millimetre on the page, for x and y, as they are kept in the flash with a
/// job, whose coordinates are measured in these steps.
fn steps(settings: &Settings) -> [u32; 2] {
    settings.page_steps().map(|steps| steps.to_bits().cast_unsigned())
}

/// Keeps a job, which lies in `words`, in the board's flash.
///
/// # Errors
/// [`NotStored`]: the previous job is still kept.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn save_job<B: Board, I: Index>(
    job: &Job<I>,
    settings: &Settings,
    words: &[u64],
    board: &mut B,
) -> Result<(), NotStored> {
    let [x, y] = steps(settings);
    let numbers = [JOB_LAYOUT, x, y].into_iter().chain(job.figures());
    let mut header = [[0; 4]; JOB_HEADER];
    for (word, number) in header.iter_mut().zip(numbers) {
        *word = number.to_le_bytes();
    }
    let memory = words.get(..job.words()).ok_or(NotStored)?;
    board.save(Record::Job, &[header.as_flattened(), bytemuck::cast_slice(memory)])
}

/// Keeps, in place of the last job, that one was sent while it was drawn, by the number by which its
/// sender knows it. Its strokes are not kept.
///
/// # Errors
/// [`NotStored`]: the previous job is still kept.
#[cfg(all(feature = "stream", feature = "resume"))]
pub(super) fn save_streamed<B: Board>(id: u32, board: &mut B) -> Result<(), NotStored> {
    board.save(Record::Job, &[&STREAMED_LAYOUT.to_le_bytes(), &id.to_le_bytes()])
}

/// Loads the job that was kept last. Its memory is then in `words`.
///
/// # Errors
/// [`CommandError::NoJobKept`] if there is none, [`CommandError::OtherSteps`] if the steps per
/// millimetre have changed since. `words` then hold no job.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn load_job<B: Board, I: Index>(
    settings: &Settings,
    words: &mut [u64],
    board: &mut B,
) -> Result<Job<I>, CommandError> {
    let mut found = Err(CommandError::NoJobKept);
    board.load(Record::Job, &mut |record| {
        let mut header = [[0; 4]; JOB_HEADER];
        if record.read(header.as_flattened_mut()) != size_of_val(&header) {
            return;
        }
        let [layout, x, y, figures @ ..] = header.map(u32::from_le_bytes);
        let job = Job::<I>::from_figures(figures).filter(|_| layout == JOB_LAYOUT);
        let Some((job, memory)) = job.and_then(|job| Some((job, words.get_mut(..job.words())?)))
        else {
            return;
        };
        if [x, y] != steps(settings) {
            found = Err(CommandError::OtherSteps);
        } else if record.read(bytemuck::cast_slice_mut(memory)) == size_of_val(memory) {
            found = Ok(job);
        }
    });
    found
}
