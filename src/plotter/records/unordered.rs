//! Jobs that are kept before their order is known, and their order, which is added later.

use super::{JOB_HEADER, JOB_LAYOUT, steps};
use crate::index::Index;
use crate::machine::Settings;
use crate::plotter::job::{FIGURES, UNORDERED_WORDS, Unordered};
use crate::plotter::{Board, Job, NotStored, Record, Stored};
use crate::storage::PAGE_BYTES;

/// A mark at the beginning of a kept job of which only the drawing and the first strokes are known.
/// After its figures come the data from which the order of the other strokes is computed, and then
/// the drawing alone. When the order is known, it is added: the number of strokes, the figures, and
/// the legs.
const BEGUN_LAYOUT: u32 = u32::from_le_bytes(*b"job3");
/// Number of words before the drawing of a job whose order is not known yet.
const BEGUN_HEADER: usize = JOB_HEADER + UNORDERED_WORDS;
/// Number of words before the legs of an order.
const ORDER_HEADER: usize = 1 + FIGURES;

/// Keeps a job of which only the drawing and the first strokes are known, and leaves room for its
/// order.
///
/// # Errors
/// [`NotStored`]: the previous job is still kept.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn save_begun<B: Board, I: Index>(
    job: &Job<I>,
    unordered: Unordered,
    settings: &Settings,
    words: &[u64],
    board: &mut B,
) -> Result<(), NotStored> {
    let [x, y] = steps(settings);
    let numbers = [BEGUN_LAYOUT, x, y].into_iter().chain(job.figures()).chain(unordered.words());
    let mut header = [[0; 4]; BEGUN_HEADER];
    for (word, number) in header.iter_mut().zip(numbers) {
        *word = number.to_le_bytes();
    }
    let memory = words.get(..job.drawing_words()).ok_or(NotStored)?;
    let room = size_of::<[[u8; 4]; ORDER_HEADER]>() + 8 * (job.words() - job.drawing_words());
    let room = u32::try_from(room).map_err(|_| NotStored)?;
    let parts = [header.as_flattened(), bytemuck::cast_slice(memory)];
    board.save_with_room(Record::Job, &parts, room)
}

/// The number of bytes of flash that a job takes when it is saved, its headers and the room for its
/// order included.
pub(in crate::plotter) fn flash_bytes<I: Index>(job: &Job<I>) -> u32 {
    let pages = |words: usize, header: usize| 1 + (4 * header + 8 * words).div_ceil(PAGE_BYTES);
    let pages = if job.unordered().is_some() {
        let legs = job.words() - job.drawing_words();
        pages(job.drawing_words(), BEGUN_HEADER) + pages(legs, ORDER_HEADER)
    } else {
        pages(job.words(), JOB_HEADER)
    };
    u32::try_from(pages * PAGE_BYTES).unwrap_or(u32::MAX)
}

/// Adds the order of a job, and its number of strokes, to the job that was kept last.
///
/// # Errors
/// [`NotStored`]: the order has to be computed again.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(in crate::plotter) fn add_order<B: Board, I: Index>(
    job: &Job<I>,
    strokes: u32,
    words: &[u64],
    board: &mut B,
) -> Result<(), NotStored> {
    let mut header = [[0; 4]; ORDER_HEADER];
    for (word, number) in header.iter_mut().zip([strokes].into_iter().chain(job.figures())) {
        *word = number.to_le_bytes();
    }
    let legs = words.get(job.drawing_words()..job.words()).ok_or(NotStored)?;
    board.add(Record::Job, &[header.as_flattened(), bytemuck::cast_slice(legs)])
}

/// Whether the job that was kept last was kept before its order was known.
#[inline(never)] // Inlined, it would take room in its callers.
pub(in crate::plotter) fn is_begun<B: Board>(board: &mut B) -> bool {
    let mut layout = [0; 4];
    board.load(Record::Job, &mut |record| {
        record.read(&mut layout);
    });
    u32::from_le_bytes(layout) == BEGUN_LAYOUT
}

/// The number of strokes of the order that was added to the job that was kept last; `None` if none
/// was.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(in crate::plotter) fn strokes_of_added_order<B: Board>(board: &mut B) -> Option<u32> {
    let mut strokes = None;
    board.load_added(Record::Job, &mut |added| {
        let mut word = [0; 4];
        if added.read(&mut word) == word.len() {
            strokes = Some(u32::from_le_bytes(word));
        }
    });
    strokes
}

/// Loads the order that was added to a kept job, whose drawing is in `words`. If none was added,
/// returns the job as it was.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn load_order<B: Board, I: Index>(
    begun: Job<I>,
    words: &mut [u64],
    board: &mut B,
) -> Job<I> {
    let mut loaded = begun;
    board.load_added(Record::Job, &mut |added| {
        let mut header = [[0; 4]; ORDER_HEADER];
        if added.read(header.as_flattened_mut()) != size_of_val(&header) {
            return;
        }
        let [_, figures @ ..] = header.map(u32::from_le_bytes);
        let job = Job::<I>::from_figures(figures);
        let Some(job) = job.filter(|job| job.drawing_words() == begun.drawing_words()) else {
            return;
        };
        let Some(legs) = words.get_mut(job.drawing_words()..job.words()) else { return };
        if added.read(bytemuck::cast_slice_mut(legs)) == size_of_val(legs) {
            loaded = job;
        }
    });
    loaded
}

/// Returns the job that a record of this layout begins, and the number of words of its memory.
/// `record` is read up to that memory.
pub(super) fn layout_of<I: Index>(
    layout: u32,
    job: Job<I>,
    record: &mut dyn Stored,
) -> Option<(Job<I>, usize)> {
    if layout != BEGUN_LAYOUT {
        return (layout == JOB_LAYOUT).then_some((job, job.words()));
    }
    let mut rest = [[0; 4]; UNORDERED_WORDS];
    if record.read(rest.as_flattened_mut()) != size_of_val(&rest) {
        return None;
    }
    let unordered = Unordered::from_words(rest.map(u32::from_le_bytes))?;
    Some((job.without_order(unordered), job.drawing_words()))
}
