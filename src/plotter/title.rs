//! Places the title below the drawing and adds its lines.

use super::PlotOptions;
use super::job::{Collector, Pipeline};
use crate::drawing::{LineType, PackedLine, StepsPerMillimetre};
use crate::index::Index;
use crate::protocol::CommandError;
use crate::stage::{StageError, items};
use crate::visibility::SinkFull;

/// Lines handled between two checks for cancelling: some 50,000 instructions.
const LINES_BETWEEN_CHECKS: usize = 64;

/// Refuses a title that is too wide for the page. Its width does not depend on the drawing, so this
/// is checked before the computation begins.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn check(options: &PlotOptions, steps: StepsPerMillimetre) -> Result<(), CommandError> {
    let Some(title) = options.title() else { return Ok(()) };
    options.page.place_title(&title, [0; 3], steps).map(|_| ()).map_err(CommandError::Page)
}

/// Adds the lines of the title, for the first pen, to the `count` lines at the front of the working
/// memory, and places them below those lines. Returns the total number of lines. A page without a
/// drawing has no title.
///
/// # Errors
/// [`CommandError::Page`], [`CommandError::DrawingTooLarge`], [`CommandError::Aborted`].
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn write<I: Index>(
    pipeline: &mut Pipeline<'_, I>,
    count: usize,
) -> Result<usize, CommandError> {
    let Pipeline { options, steps, words, cancel, .. } = pipeline;
    let steps = *steps;
    let Some(title) = options.title() else { return Ok(count) };
    // These are the left, right and bottom edges of the drawing.
    let mut around: Option<[i32; 3]> = None;
    for lines in items::<PackedLine>(words, count).unwrap_or(&[]).chunks(LINES_BETWEEN_CHECKS) {
        cancel.check()?;
        for point in lines.iter().flat_map(|line| line.ends()) {
            let [left, right, bottom] = around.unwrap_or([point.x, point.x, point.y]);
            around = Some([left.min(point.x), right.max(point.x), bottom.min(point.y)]);
        }
    }
    let Some(around) = around else { return Ok(count) };
    let placed = options.page.place_title(&title, around, steps);
    let [left, baseline] = placed.map_err(CommandError::Page)?;
    let mut collector = Collector::new(words);
    collector.count = count;
    let mut drawn = 0usize;
    title
        .draw(left, baseline, steps, &mut |[from, to]| {
            if drawn.is_multiple_of(LINES_BETWEEN_CHECKS) {
                cancel.check()?;
            }
            drawn += 1;
            let added = collector.line(PackedLine::new(from, to, LineType::Full, 0));
            added.map_err(|SinkFull| collector.missing().into())
        })
        .map_err(|error: StageError| CommandError::from(error))?;
    Ok(collector.count)
}
