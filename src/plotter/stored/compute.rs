//! Computes a drawing of a model in flash part by part: one pass over the tiles for each pen.

use super::parts::DrawingSearch;
use crate::drawing::StepsPerMillimetre;
use crate::drawing::{Bounds, LineType, PackedLine, PagePoint, Stored, build_graph};
use crate::index::Index;
use crate::model::{Positions, StoredModel};
use crate::order::{self, Leg, TimeModel};
use crate::plotter::Unobserved;
use crate::plotter::job::{Collector, Job, PageSink, fit, move_to_front};
use crate::plotter::options::{HiddenLines, PlotOptions};
use crate::protocol::{CommandError, Crowd, StoredModelError};
use crate::stage::{Cancel, OutOfScratch, Scratch, Stage};
use crate::tiles::{ProjectedStored, Tiles, ViewParameters};
use crate::view::View;
use crate::visibility::{SinkFull, Stretch, StretchSink, VisibilityError};

/// The lines of a part take at most the working memory divided by this number.
const LINE_SHARE: usize = 8;

/// A part takes further tiles until it has at least this many lines. With fewer, the pen would
/// travel far between the parts.
const ENOUGH_LINES: usize = 64;

/// The number of positions that are looked at between two checks for cancelling.
const POSITIONS_BETWEEN_CHECKS: usize = 256;

/// Prepares `search`: the camera, the index of the tiles, which then lies at the front of `words`,
/// and the place on the page. Returns the least and the greatest coordinates of the whole drawing,
/// in steps.
///
/// # Errors
/// The [`CommandError`] to reply with.
#[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
pub(super) fn prepare(
    model: &StoredModel<'_>,
    options: &PlotOptions,
    (steps, time_model): (StepsPerMillimetre, TimeModel),
    words: &mut [u64],
    search: &mut Option<DrawingSearch>,
    cancel: &mut dyn Cancel,
) -> Result<[PagePoint; 2], CommandError> {
    cancel.enter(Stage::View);
    let camera = options.camera(model).ok_or(CommandError::NothingToPlot)?;
    cancel.check()?;
    let view = View::new(&camera, model).map_err(CommandError::View)?;
    cancel.check()?;
    if !options.clip_behind {
        view.refuse_behind(model).map_err(CommandError::View)?;
    }
    let near = view.near().unwrap_or(i32::MIN);
    let mut is_cut = false;
    for (number, position) in model.positions().enumerate() {
        if number % POSITIONS_BETWEEN_CHECKS == 0 {
            cancel.check()?;
        }
        is_cut |= view.vertex(position).z < near;
    }
    cancel.enter(Stage::Visibility);
    let source = ProjectedStored::new(model, &view);
    let parameters = ViewParameters::new(&view, options.precision_of(model));
    let mut scratch = Scratch::new(words);
    let tiles = Tiles::new(&source, parameters, options.visibility(&view), &mut scratch, cancel);
    let tiles = tiles.map_err(refused)?.ok_or(CommandError::NothingToPlot)?;
    let mut bounds = Bounds::NOTHING;
    let around = &mut |vertex| bounds.add(vertex, view.projection());
    tiles.each_point(cancel, around).map_err(refused)?;
    let tiles = tiles.pause();
    let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
    let map = fit(&view, is_cut, &bounds, options, steps)?;
    let [mut least, mut greatest] = map.extent(&bounds, &options.page, steps);
    let around = [least.x, greatest.x, least.y];
    let has_title = options.title().is_some();
    each_title_line(options, around, steps, 0, &mut |ends| {
        for end in ends {
            least = PagePoint { x: least.x.min(end.x), y: least.y.min(end.y) };
            greatest = PagePoint { x: greatest.x.max(end.x), y: greatest.y.max(end.y) };
        }
        Ok(())
    })?;
    let of_model = if options.one_pen { 1 } else { model.pens() };
    let of_hidden = match options.hidden {
        HiddenLines::Pen(pen) => 1u32.checked_shl(pen.into()).unwrap_or(0),
        HiddenLines::Drawn(_) | HiddenLines::Erased => 0,
    };
    let pens = of_model | of_hidden | u32::from(has_title);
    let pen = pens.trailing_zeros() as u8;
    let pens = pens & pens.wrapping_sub(1);
    *search = Some(DrawingSearch {
        view,
        map,
        options: *options,
        tiles,
        pens,
        pen,
        around,
        has_title,
        time_model,
    });
    Ok([least, greatest])
}

/// Calls `each` with the lines of the title, if there is one, as it stands below a drawing with
/// these edges: left, right and bottom. `room` is the number of bytes in which they are kept.
fn each_title_line(
    options: &PlotOptions,
    around: [i32; 3],
    steps: StepsPerMillimetre,
    room: usize,
    each: &mut dyn FnMut([PagePoint; 2]) -> Result<(), SinkFull>,
) -> Result<(), CommandError> {
    let Some(title) = options.title() else { return Ok(()) };
    let placed = options.page.place_title(&title, around, steps);
    let [left, baseline] = placed.map_err(CommandError::Page)?;
    let drawn = title.draw(left, baseline, steps, each);
    let missing = OutOfScratch { needed: room + size_of::<PackedLine>(), available: room };
    drawn.map_err(|SinkFull| too_dense(missing))
}

/// A part that has been computed, and the index of the first word of the working memory that it
/// takes.
pub(super) type Computed<I> = (Job<I>, usize);

/// Computes the next part: its strokes in their order, which then lie in `words`. `at` is where
/// the part before it ends. Returns `None` if there is no part left.
///
/// # Errors
/// The [`CommandError`] to reply with.
#[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
pub(super) fn next_part<I: Index>(
    model: &StoredModel<'_>,
    search: &mut DrawingSearch,
    steps: StepsPerMillimetre,
    words: &mut [u64],
    at: Option<PagePoint>,
    cancel: &mut dyn Cancel,
) -> Result<Option<Computed<I>>, CommandError> {
    let begin = search.tiles.index_words();
    let order = search.options.order(steps, search.time_model);
    // No part is a path of its own to whose start the pen could return.
    let order = order::Options { shape: order::Shape::OpenPath, ..order };
    loop {
        let count = if !search.tiles.is_over() {
            find_lines(model, search, words, cancel)?
        } else if search.has_title && search.pen == 0 {
            search.has_title = false;
            let words = words.get_mut(begin..).unwrap_or(&mut []);
            let room = size_of_val(words);
            let mut collector = Collector::new(words);
            each_title_line(&search.options, search.around, steps, room, &mut |[from, to]| {
                collector.line(PackedLine::new(from, to, LineType::Full, 0))
            })?;
            collector.count
        } else if search.pens != 0 {
            search.pen = search.pens.trailing_zeros() as u8;
            search.pens &= search.pens - 1;
            search.tiles.restart();
            continue;
        } else {
            return Ok(None);
        };
        let words = words.get_mut(begin..).unwrap_or(&mut []);
        if count > 0
            && let Some(job) = order_lines(words, count, order, at, cancel)?
        {
            return Ok(Some((job, begin)));
        }
    }
}

/// Finds lines of the present pen, in as many tiles as it takes to find some, and moves them to the
/// front of the memory behind the index. Returns their number.
#[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
fn find_lines(
    model: &StoredModel<'_>,
    search: &mut DrawingSearch,
    words: &mut [u64],
    cancel: &mut dyn Cancel,
) -> Result<usize, CommandError> {
    cancel.enter(Stage::Visibility);
    let DrawingSearch { view, map, options, tiles: paused, pen, .. } = search;
    let room = words.len() / LINE_SHARE;
    let missing = OutOfScratch {
        needed: paused.index_words() * size_of::<u64>(),
        available: size_of_val(words),
    };
    let no_index = || too_dense(missing);
    let (index, rest) = words.split_at_mut_checked(paused.index_words()).ok_or_else(no_index)?;
    let lines_at = rest.len().saturating_sub(room);
    let (scratch, lines) = rest.split_at_mut(lines_at);
    let source = ProjectedStored::new(model, view);
    let parameters = ViewParameters::new(view, options.precision_of(model));
    let options = &*options;
    let visibility = options.visibility(view);
    let collector = Collector::new(lines);
    let sink = PageSink { collector, map, view, options, observer: &mut Unobserved };
    let mut sink = PassSink { sink, pen: *pen };
    loop {
        let tiles = Tiles::go_on(&source, parameters, visibility, *paused, index);
        let Some(mut tiles) = tiles else { return Err(no_index()) };
        let before = sink.sink.collector.count;
        let outcome = tiles.follow_next(Scratch::new(&mut *scratch), cancel, &mut sink);
        *paused = tiles.pause();
        let collector = &mut sink.sink.collector;
        match outcome {
            Ok(more) if !more || collector.count >= ENOUGH_LINES => break,
            Ok(_) => {}
            Err(VisibilityError::SinkFull) => {
                collector.count = before;
                if before > 0 {
                    break;
                }
                if !paused.divide() {
                    return Err(too_dense(collector.missing()));
                }
            }
            Err(error) => return Err(refused(error)),
        }
    }
    let count = sink.sink.collector.count;
    move_to_front(rest, lines_at, count);
    Ok(count)
}

/// Makes one drawing of the lines at the front of `words` and orders its strokes. Returns `None` if
/// nothing is left to draw.
#[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
fn order_lines<I: Index>(
    words: &mut [u64],
    count: usize,
    options: order::Options,
    at: Option<PagePoint>,
    cancel: &mut dyn Cancel,
) -> Result<Option<Job<I>>, CommandError> {
    cancel.enter(Stage::Order);
    let stored: Stored<I> = build_graph(words, count, cancel)?;
    let (drawing, mut rest) = stored.split(words).map_err(CommandError::DrawingTooLarge)?;
    let tour =
        rest.take::<Leg<I>>(drawing.segments.len()).map_err(CommandError::DrawingTooLarge)?;
    if tour.is_empty() {
        return Ok(None);
    }
    let mut report = order::order(drawing, options, rest, cancel, tour)?;
    // The bound and the proof hold for a part only, and not for the order of the whole drawing.
    (report.bound, report.optimal) = (0, false);
    let point = |leg: Option<&Leg<I>>, is_end: bool| {
        let leg = leg?;
        let segment = drawing.segments.get(leg.segment())?;
        let number = if leg.reversed() == is_end { segment.from() } else { segment.to() };
        drawing.points.get(number.get()).copied()
    };
    let ends = (point(tour.first(), false), point(tour.last(), true));
    if let (Some(at), (Some(first), Some(last))) = (at, ends) {
        // The end that is nearer to where the pen is comes first.
        let distances = [first, last].map(|end| order::length(at, end));
        if distances[1] < distances[0] {
            tour.reverse();
            tour.iter_mut().for_each(|leg| *leg = leg.flipped());
        }
        let near = if distances[1] < distances[0] { last } else { first };
        report.pen_up += order::true_length(at, near, order::y_in_x(options.steps));
        report.lifts += 1;
    }
    Ok(Some(Job::of(stored, tour.len(), report)))
}

/// Receives the stretches that the pen of this pass draws.
struct PassSink<'a> {
    /// What receives them.
    sink: PageSink<'a, u32>,
    /// The pen, from 0.
    pen: u8,
}

impl StretchSink<u32> for PassSink<'_> {
    fn stretch(&mut self, stretch: Stretch<u32>) -> Result<(), SinkFull> {
        let pen = match self.sink.options.hidden {
            HiddenLines::Pen(pen) if !stretch.visible => pen,
            _ if self.sink.options.one_pen => 0,
            _ => stretch.pen,
        };
        if pen == self.pen { self.sink.stretch(stretch) } else { Ok(()) }
    }
}

/// The error that what meets in one place takes more memory than there is.
fn too_dense(missing: OutOfScratch) -> CommandError {
    let OutOfScratch { needed, available } = missing;
    crowded(Crowd { needed, room: available, unit: "bytes" })
}

fn crowded(crowd: Crowd) -> CommandError {
    StoredModelError::TooDense(crowd).into()
}

/// Converts an error of the hidden-line removal to the reply.
fn refused(error: VisibilityError) -> CommandError {
    match error {
        VisibilityError::Aborted => CommandError::Aborted,
        VisibilityError::Scratch(missing) => too_dense(missing),
        VisibilityError::TooManyCorners(room) => {
            crowded(Crowd { needed: room + 1, room, unit: "corners" })
        }
        VisibilityError::TooManyVertices { count, limit } => {
            crowded(Crowd { needed: count, room: limit, unit: "vertices" })
        }
        // The caller handles it.
        VisibilityError::SinkFull => too_dense(OutOfScratch { needed: 1, available: 0 }),
        // A model in flash that is sound causes neither error.
        VisibilityError::UnknownVertex(_) | VisibilityError::OutOfRange(_) => {
            StoredModelError::Damaged.into()
        }
    }
}
