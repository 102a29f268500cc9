//! What outlives a loss of power.

use super::{Board, Job, NotStored, Record};
use crate::machine::{SETTING_COUNT, Setting, Settings, Value};
use crate::protocol::CommandError;

/// A setting: its number, its value.
const SETTING_BYTES: usize = 6;

/// The settings as they were kept, else the defaults.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn settings<B: Board>(board: &mut B) -> Settings {
    let mut values = heapless::Vec::<(u16, Value), SETTING_COUNT>::new();
    board.load(Record::Settings, &mut |kept| {
        let mut bytes = [0; SETTING_BYTES];
        // More than there are settings would be of another version: its last ones are not known here.
        while kept.read(&mut bytes) == SETTING_BYTES && !values.is_full() {
            let [a, b, c, d, e, f] = bytes;
            let value = Value::from_bits(i32::from_le_bytes([c, d, e, f]));
            let _ = values.push((u16::from_le_bytes([a, b]), value));
        }
    });
    Settings::restored(values)
}

/// Keeps them.
///
/// # Errors
/// [`CommandError::NotStored`]: they are in force, but those before will be after a loss of power.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn keep_settings<B: Board>(
    settings: &Settings,
    board: &mut B,
) -> Result<(), CommandError> {
    let mut bytes = [0; SETTING_COUNT * SETTING_BYTES];
    for (place, (info, value)) in bytes.chunks_exact_mut(SETTING_BYTES).zip(settings.iter()) {
        place[..2].copy_from_slice(&info.number.to_le_bytes());
        place[2..].copy_from_slice(&value.to_bits().to_le_bytes());
    }
    board.save(Record::Settings, &[&bytes]).map_err(|_| CommandError::NotStored)
}

/// Tells a kept job from one of another layout.
const JOB_LAYOUT: u32 = u32::from_le_bytes(*b"job1");
/// The layout, the steps of a millimetre, the job's figures; then its memory.
const JOB_HEADER: usize = 3 + Job::FIGURES;

/// The steps of a millimetre, which a job is counted in.
fn steps(settings: &Settings) -> [u32; 2] {
    [Setting::StepsPerMmX, Setting::StepsPerMmY]
        .map(|setting| settings.get(setting).to_bits().cast_unsigned())
}

/// Keeps a job, which lies in `words`.
///
/// # Errors
/// [`NotStored`]: the job before still is.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn keep_job<B: Board>(
    job: &Job,
    settings: &Settings,
    words: &[u64],
    board: &mut B,
) -> Result<(), NotStored> {
    let [x, y] = steps(settings);
    let numbers = [JOB_LAYOUT, x, y].into_iter().chain(job.figures());
    let mut header = [[0; 4]; JOB_HEADER];
    for (place, number) in header.iter_mut().zip(numbers) {
        *place = number.to_le_bytes();
    }
    let memory = words.get(..job.words()).ok_or(NotStored)?;
    board.save(Record::Job, &[header.as_flattened(), bytemuck::cast_slice(memory)])
}

/// The job that was kept last; its memory is then in `words`.
///
/// # Errors
/// [`CommandError::NoJobKept`], [`CommandError::OtherSteps`]; `words` hold no job then.
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn job<B: Board>(
    settings: &Settings,
    words: &mut [u64],
    board: &mut B,
) -> Result<Job, CommandError> {
    let mut found = Err(CommandError::NoJobKept);
    board.load(Record::Job, &mut |kept| {
        let mut header = [[0; 4]; JOB_HEADER];
        if kept.read(header.as_flattened_mut()) != size_of_val(&header) {
            return;
        }
        let [layout, x, y, figures @ ..] = header.map(u32::from_le_bytes);
        let job = Job::from_figures(figures).filter(|_| layout == JOB_LAYOUT);
        let Some((job, memory)) = job.and_then(|job| Some((job, words.get_mut(..job.words())?)))
        else {
            return;
        };
        if [x, y] != steps(settings) {
            found = Err(CommandError::OtherSteps);
        } else if kept.read(bytemuck::cast_slice_mut(memory)) == size_of_val(memory) {
            found = Ok(job);
        }
    });
    found
}
