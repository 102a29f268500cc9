//! The records of settings and jobs in the board's flash, which outlive a loss of power: their
//! formats, and how they are saved and loaded.

#[cfg(feature = "early-ink")]
mod unordered;

use super::job::FIGURES;
#[cfg(feature = "tiles")]
use super::options::{KeptOptions, PlotOptions};
use super::program::{Parameters, SYSTEMS, TEXT_LIMIT, Text};
#[cfg(feature = "tiles")]
use super::resume::KeptParts;
use super::{Board, Job, NotStored, Record, Reply, Stored};
use crate::array::MapEach;
use crate::fixed::Length;
use crate::index::Index;
use crate::machine::{SETTINGS, Setting, Settings, Value};
#[cfg(feature = "tiles")]
use crate::order::TimeModel;
use crate::protocol::CommandError;
#[cfg(feature = "tiles")]
use bytemuck::Zeroable as _;
#[cfg(feature = "early-ink")]
pub(super) use unordered::{add_order, flash_bytes, is_begun, strokes_of_added_order};
#[cfg(feature = "early-ink")]
use unordered::{layout_of, load_order, save_begun};

/// Size of a kept setting: two bytes for its number, four for its value.
const SETTING_BYTES: usize = 6;

/// The values of settings that the board has kept, with their numbers.
type KeptValues = heapless::Vec<(u16, Value), { SETTINGS.len() }>;

/// Reads the values of settings that the board has kept.
fn kept_values<B: Board>(board: &mut B) -> KeptValues {
    let mut values = KeptValues::new();
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
    values
}

/// The settings kept by the board; those that are not kept, or that are refused, have their default
/// values.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn load_settings<B: Board>(board: &mut B) -> Settings {
    Settings::restored(kept_values(board).iter().copied())
}

/// Says which of the values that the board has kept are not in force, because this firmware
/// refuses them.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn report_refused<B: Board>(settings: &Settings, board: &mut B) {
    for (number, value) in kept_values(board) {
        let Some(setting) = Setting::numbered(number) else { continue };
        if settings.get(setting) != value {
            let [kept, value] = [value, settings.get(setting)].map(Length);
            Reply(board).line(format_args!(
                "[MSG:the kept ${number}={kept} is refused, so {value} holds: set it before you \
                 draw]"
            ));
        }
    }
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
    let (entries, _) = bytes.as_chunks_mut::<SETTING_BYTES>();
    for (entry, (info, value)) in entries.iter_mut().zip(settings.iter()) {
        let ([a, b], [c, d, e, f]) = (info.number().to_le_bytes(), value.to_bits().to_le_bytes());
        *entry = [a, b, c, d, e, f];
    }
    save_changed(Record::Settings, &[&bytes], board)
}

/// Saves a record, unless the board keeps just this already: each time wears the flash, and senders
/// set what is set.
///
/// # Errors
/// [`CommandError::NotStored`].
fn save_changed<B: Board>(
    record: Record,
    parts: &[&[u8]],
    board: &mut B,
) -> Result<(), CommandError> {
    // A board without the feature keeps nothing.
    #[cfg(feature = "resume")]
    {
        let mut is_kept = false;
        board.load(record, &mut |stored| is_kept = holds(stored, parts));
        if is_kept {
            return Ok(());
        }
    }
    board.save(record, parts).map_err(|_| CommandError::NotStored)
}

/// Whether a record consists of just these parts.
#[cfg(feature = "resume")]
fn holds(stored: &mut dyn Stored, parts: &[&[u8]]) -> bool {
    let mut is_next = |piece: &[u8]| {
        let mut bytes = [0; 16];
        let read = bytes.get_mut(..piece.len()).unwrap_or(&mut []);
        stored.read(read) == piece.len() && read == piece
    };
    parts.iter().flat_map(|part| part.chunks(16)).all(&mut is_next) && stored.read(&mut [0]) == 0
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
    save_changed(Record::Parameters, &parts, board)
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
    #[cfg(feature = "early-ink")]
    if let Some(unordered) = job.unordered() {
        return save_begun(job, unordered, settings, words, board);
    }
    let [x, y] = steps(settings);
    let numbers = [JOB_LAYOUT, x, y].into_iter().chain(job.figures());
    let mut header = [[0; 4]; JOB_HEADER];
    for (word, number) in header.iter_mut().zip(numbers) {
        *word = number.to_le_bytes();
    }
    let memory = words.get(..job.words()).ok_or(NotStored)?;
    board.save(Record::Job, &[header.as_flattened(), bytemuck::cast_slice(memory)])
}

/// Keeps, in place of the last job, that one was sent while it was drawn, by the number by which
/// its sender knows it. Its strokes are not kept.
///
/// # Errors
/// [`NotStored`]: the previous job is still kept.
#[cfg(all(feature = "stream", feature = "resume"))]
pub(super) fn save_streamed<B: Board>(id: u32, board: &mut B) -> Result<(), NotStored> {
    board.save(Record::Job, &[&STREAMED_LAYOUT.to_le_bytes(), &id.to_le_bytes()])
}

/// A mark in place of [`JOB_LAYOUT`] for a drawing that is computed and drawn part by part. What it
/// is computed from is kept besides the model: the speed, the acceleration and the work of a second
/// by which the order is chosen, the checksums of the model and of the firmware's sources, and the
/// options.
#[cfg(feature = "tiles")]
const PARTS_LAYOUT: u32 = u32::from_le_bytes(*b"jobq");
/// A number that differs between builds from other sources, which may compute other strokes.
#[cfg(feature = "resume")]
pub(super) const SOURCES: u32 = match u32::from_str_radix(env!("PENUP_SOURCES"), 16) {
    Ok(sources) => sources,
    Err(_) => 0,
};

/// Tells the user that the job that begins is not kept.
#[inline(never)] // It is called in several places.
pub(super) fn say_not_kept<B: Board>(board: &mut B) {
    Reply(board).line(format_args!("[MSG:$again will not draw this: the flash is worn out]"));
}

/// Keeps what a drawing in parts of the model with this checksum is computed from, as the last job.
/// Returns whether it is kept. If it is not, `$again` does not draw it, which is said.
#[cfg(feature = "tiles")]
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn save_parts<B: Board>(
    options: &PlotOptions,
    time_model: TimeModel,
    model: u32,
    board: &mut B,
) -> bool {
    let TimeModel { speed, acceleration, units_per_second } = time_model;
    let head = [PARTS_LAYOUT, speed, acceleration, units_per_second, model, SOURCES];
    let head = head.map(u32::to_le_bytes);
    let options = KeptOptions::from(options);
    let kept = board.save(Record::Job, &[head.as_flattened(), bytemuck::bytes_of(&options)]);
    if kept.is_err() {
        say_not_kept(board);
    }
    kept.is_ok()
}

/// Returns what the last job is computed from, if it is a drawing in parts; `None` if it is
/// another one. Sets the `options`, if they are given, to its own.
#[cfg(feature = "tiles")]
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn load_parts<B: Board>(
    mut options: Option<&mut PlotOptions>,
    board: &mut B,
) -> Option<KeptParts> {
    let mut found = None;
    board.load(Record::Job, &mut |record| {
        let (mut head, mut kept) = ([[0; 4]; 6], KeptOptions::zeroed());
        if record.read(head.as_flattened_mut()) != size_of_val(&head)
            || record.read(bytemuck::bytes_of_mut(&mut kept)) != size_of_val(&kept)
        {
            return;
        }
        let [layout, speed, acceleration, units_per_second, model, sources] =
            head.map(u32::from_le_bytes);
        // No machine is faster, and no board counts more work as a second.
        let is_known = layout == PARTS_LAYOUT
            && speed < 1 << 22
            && acceleration < 1 << 27
            && units_per_second <= TimeModel::BOARD;
        if let Some(kept) = kept.options().filter(|_| is_known) {
            if let Some(options) = options.as_deref_mut() {
                *options = kept;
            }
            let time_model = TimeModel { speed, acceleration, units_per_second };
            found = Some(KeptParts { time_model, model, sources, drawn: None, points: 0 });
        }
    });
    found
}

/// Returns the job that a record of this layout begins, and the number of words of its memory.
#[cfg(not(feature = "early-ink"))]
fn layout_of<I: Index>(layout: u32, job: Job<I>, _: &mut dyn Stored) -> Option<(Job<I>, usize)> {
    (layout == JOB_LAYOUT).then_some((job, job.words()))
}

/// Loads the job that was kept last. Its memory is then in `words`. If its order is not known, only
/// its drawing is.
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
        let bytes = record.read(header.as_flattened_mut());
        let [layout, x, y, figures @ ..] = header.map(u32::from_le_bytes);
        #[cfg(all(feature = "stream", feature = "resume"))]
        if layout == STREAMED_LAYOUT {
            found = Err(CommandError::StrokesAreSent);
        }
        if bytes != size_of_val(&header) {
            return;
        }
        let job = Job::<I>::from_figures(figures).and_then(|job| layout_of(layout, job, record));
        let Some((job, memory)) = job.and_then(|(job, count)| Some((job, words.get_mut(..count)?)))
        else {
            return;
        };
        if [x, y] != steps(settings) {
            found = Err(CommandError::OtherSteps);
        } else if record.read(bytemuck::cast_slice_mut(memory)) == size_of_val(memory) {
            found = Ok(job);
        }
    });
    #[cfg(feature = "early-ink")]
    if let Ok(job) = &mut found
        && job.unordered().is_some()
    {
        *job = load_order(job.for_steps(settings.page_steps()), words, board);
    }
    found
}
