//! Computes a job: from the model to ordered strokes.
//!
//! [`Job::compute`] runs the stages one after the other. It projects the model, finds the visible
//! lines, maps them to the page, adds the title, builds the graph of the drawing and orders its
//! strokes. All of them share one working memory, which then holds the job.

use super::{PlotOptions, plan, solid, title};
use crate::drawing::{
    Bounds, Drawing, GraphError, LineType, PackedLine, PageMap, StepsPerMillimetre, Stored,
    build_graph,
};
use crate::geometry::{Projection, Vertex};
use crate::machine::{Path, Target};
use crate::model::{Elements, Model, ModelError, Position};
use crate::order::{self, Leg, OrderError};
use crate::protocol::{CommandError, HiddenLines, VisibilityMode};
use crate::stage::{Aborted, Cancel, OutOfScratch, Scratch, Stage, StageError, items, items_mut};
use crate::view::{Camera, Flattening, Seen, View, project_scene};
use crate::visibility::{self, Scene, SinkFull, Stretch, StretchSink, Unrounded, VisibilityError};

/// Receives each stretch as soon as it is found, in view coordinates. A preview is drawn with it.
pub trait Observer {
    /// A stretch, as seen through `view`.
    fn stretch(&mut self, view: &View, stretch: &Stretch);

    /// Everything shown so far is void, because the search begins again with another division of
    /// the memory.
    fn start_again(&mut self) {}

    /// A bar of a plan from `from` to `to`, in the plan's own coordinates, and its pen, counted
    /// from 0.
    fn plan_bar(&mut self, from: [f64; 2], to: [f64; 2], pen: u8);
}

/// An observer that ignores everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn stretch(&mut self, _: &View, _: &Stretch) {}
    fn plan_bar(&mut self, _: [f64; 2], _: [f64; 2], _: u8) {}
}

/// A drawing and the order of its strokes, both of which lie in the working memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Job {
    /// Where the drawing lies in the working memory.
    stored: Stored,
    /// Number of legs of the tour; they lie behind the drawing.
    legs: usize,
    /// Result of the ordering.
    report: order::Report,
    /// Number of faces that were left out because they have no area.
    degenerate_faces: u32,
    /// Number of edges of a convex solid that were left out because the faces beside them may be
    /// coplanar.
    joined_edges: usize,
}

impl Job {
    /// Computes the job for `model`. `words` is the working memory, which then holds the job.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with. `words` then hold no job; the model is unchanged.
    pub fn compute(
        model: &Model<'_>,
        options: &PlotOptions,
        steps: StepsPerMillimetre,
        words: &mut [u64],
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer,
    ) -> Result<Self, CommandError> {
        if model.elements().corners().is_empty()
            && model.curves().is_empty()
            && options.see != VisibilityMode::Vertices
        {
            return Err(CommandError::NothingToPlot);
        }
        title::check(options, steps)?;
        let (mut degenerate_faces, mut joined_edges) = (0, 0);
        let lines = if model.is_plan() && options.shows_plans_flat() {
            plan::lay_out(model, options, steps, words, cancel, observer)?
        } else {
            match options.see {
                VisibilityMode::Vertices | VisibilityMode::Edges => {
                    let lines;
                    (lines, joined_edges) =
                        solid::project(model, options, steps, words, cancel, observer)?;
                    lines
                }
                VisibilityMode::Faces | VisibilityMode::Wire => {
                    let found = project(model, options, steps, words, cancel, observer)?;
                    degenerate_faces = found.degenerate_faces;
                    found.lines
                }
            }
        };
        let lines = title::write(options, steps, words, lines, cancel)?;
        cancel.enter(Stage::Order);
        let stored = build_graph(words, lines, cancel)?;
        let (drawing, mut rest) = stored.split(words).map_err(CommandError::DrawingTooLarge)?;
        let legs = drawing.segments.len();
        if legs == 0 {
            return Err(CommandError::NothingToPlot);
        }
        let tour = rest.take::<Leg>(legs).map_err(CommandError::DrawingTooLarge)?;
        let report = order::order(drawing, options.order(steps), rest, cancel, tour)?;
        Ok(Self { stored, legs, report, degenerate_faces, joined_edges })
    }

    /// Number of words of the working memory that the job occupies.
    pub(super) fn words(&self) -> usize {
        (self.stored.bytes() + Scratch::bytes_for::<Leg>(self.legs)) / size_of::<u64>()
    }

    /// The job without its memory, as numbers. [`Job::from_figures`] reads them.
    pub(super) fn figures(&self) -> [u32; Self::FIGURES] {
        let [segments, points] = self.stored.counts().map(|count| count as u32);
        let report = &self.report;
        let low = |length: u64| length as u32;
        let high = |length: u64| (length >> 32) as u32;
        [
            segments,
            points,
            self.legs as u32,
            report.odd_points,
            report.components,
            report.lifts,
            u32::from(report.optimal),
            low(report.pen_down),
            high(report.pen_down),
            low(report.pen_up),
            high(report.pen_up),
            low(report.bound),
            high(report.bound),
        ]
    }

    /// Number of the figures of a job.
    pub(super) const FIGURES: usize = 13;

    /// The job with these figures, or `None` if its memory would be larger than any board's.
    /// Whatever the figures are, [`Job::strokes`] stays within its memory.
    pub(super) fn from_figures(figures: [u32; Self::FIGURES]) -> Option<Self> {
        let [segments, points, legs, odd_points, components, lifts, optimal, lengths @ ..] =
            figures;
        let [down, down_high, up, up_high, bound, bound_high] = lengths;
        let count = |count: u32| u16::try_from(count).ok().map(usize::from);
        let length = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
        Some(Self {
            stored: Stored::of_counts([count(segments)?, count(points)?]),
            legs: count(legs)?,
            report: order::Report {
                odd_points,
                components,
                lifts,
                optimal: optimal != 0,
                pen_down: length(down, down_high),
                pen_up: length(up, up_high),
                bound: length(bound, bound_high),
            },
            degenerate_faces: 0,
            joined_edges: 0,
        })
    }

    /// Gives up the memory of the job. [`Job::report`] remains valid.
    pub fn release(&mut self) {
        (self.stored, self.legs) = (Stored::default(), 0);
    }

    /// The result of the ordering: number of pen lifts, lengths, and whether it is proved optimal.
    pub fn report(&self) -> &order::Report {
        &self.report
    }

    /// Number of faces of the model that were left out because they have no area.
    pub fn degenerate_faces(&self) -> u32 {
        self.degenerate_faces
    }

    /// Number of edges of a convex solid that were left out because the faces beside them may be
    /// coplanar.
    pub fn joined_edges(&self) -> usize {
        self.joined_edges
    }

    /// The strokes from `cursor` on. `words` is the working memory that holds the job.
    pub fn strokes<'a>(&self, words: &'a mut [u64], cursor: &'a mut Cursor) -> Strokes<'a> {
        // `compute` filled this memory, so both reads succeed. Otherwise there are no strokes.
        let nothing = Drawing { points: &[], segments: &[] };
        let leg_words = self.stored.bytes() / size_of::<u64>();
        let words: &'a [u64] = words;
        let tour =
            words.get(leg_words..).and_then(|rest| items::<Leg>(rest, self.legs)).unwrap_or(&[]);
        let drawing = self.stored.drawing(words).unwrap_or(nothing);
        Strokes { drawing, tour, cursor }
    }
}

/// Position in the strokes of a job: how far they have been handed to the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cursor {
    /// Index of the leg that is being handed over.
    leg: usize,
    /// Number of the point at which the pen is, if any.
    at: Option<u16>,
    /// The pen of that leg, from 0.
    pen: u8,
}

/// The strokes of a job, as the [`Path`] that the machine follows. A pen-up move is inserted
/// wherever a leg does not begin where the previous one ended.
#[derive(Debug)]
pub struct Strokes<'a> {
    drawing: Drawing<'a>,
    tour: &'a [Leg],
    cursor: &'a mut Cursor,
}

impl Path for Strokes<'_> {
    fn next_target(&mut self) -> Option<Target> {
        let leg = self.tour.get(self.cursor.leg)?;
        let segment = self.drawing.segments.get(leg.segment())?;
        let (from, to) =
            if leg.reversed() { (segment.to, segment.from) } else { (segment.from, segment.to) };
        let begins_here = self.cursor.at == Some(from);
        let number = if begins_here { to } else { from };
        let point = *self.drawing.points.get(usize::from(number))?;
        self.cursor.at = Some(number);
        self.cursor.pen = segment.pen;
        self.cursor.leg += usize::from(begins_here);
        Some(Target { point, ink: begins_here.then(|| segment.line_type()) })
    }

    fn pen(&self) -> u8 {
        self.cursor.pen
    }

    fn rewind(&mut self) {
        *self.cursor = Cursor::default();
    }
}

/// Tolerance for the chords of a curve on the page, in 1/256 step: half a step.
pub(super) const HALF_A_STEP: u16 = 128;
/// A finer tolerance, used to find the bounds of curves before the scale of the page is known.
pub(super) const FOR_BOUNDS: u16 = 32;

/// Corners handled between two checks for cancelling: some 100,000 instructions.
const CORNERS_BETWEEN_CHECKS: usize = 128;

/// Expected bytes of lines for each corner. A lattice of cubes shows half of its edges and has two
/// corners per edge.
const LIKELY_BYTES: usize = size_of::<PackedLine>() / 3;

/// The result of the search for hidden lines.
struct Found {
    /// Number of lines at the front of the working memory.
    lines: usize,
    /// Number of faces left out because they have no area.
    degenerate_faces: u32,
}

/// The camera that the options choose, and the view of the model through it.
///
/// # Errors
/// [`CommandError::NothingToPlot`] if there is no vertex, [`CommandError::View`] if the camera
/// cannot show the model, [`CommandError::Aborted`].
#[inline(never)] // Keeps its frame off the stack while the stages run.
pub(super) fn camera_view(
    model: &Model<'_>,
    options: &PlotOptions,
    cancel: &mut dyn Cancel,
) -> Result<(Camera, View), CommandError> {
    cancel.enter(Stage::View);
    let camera = options.camera(model).ok_or(CommandError::NothingToPlot)?;
    cancel.check()?;
    let view = View::new(&camera, model).map_err(CommandError::View)?;
    cancel.check()?;
    if !options.clip_behind {
        view.refuse_behind(model).map_err(CommandError::View)?;
    }
    Ok((camera, view))
}

/// Projects the model through the camera and finds its visible lines. Handles every model that is
/// neither a flat plan nor a convex solid without faces.
fn project(
    model: &Model<'_>,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
    words: &mut [u64],
    cancel: &mut dyn Cancel,
    observer: &mut dyn Observer,
) -> Result<Found, CommandError> {
    let total = size_of_val(words);
    let (_, view) = camera_view(model, options, cancel)?;
    let projection = view.projection();
    let mut scratch = Scratch::new(words);
    let curves_map = if model.curves().is_empty() {
        None
    } else {
        let scratch = scratch.reborrow();
        Some(map_with_curves(&view, model, options, steps, scratch, cancel)?)
    };
    let on_page = curves_map.as_ref().map(|map| |x, y, w| map.fine(x, y, w));
    let curves = on_page.as_ref().map(|on_page| Flattening { on_page, tolerance: HALF_A_STEP });
    let Seen { vertices, elements, degenerate_faces, is_cut } =
        project_scene(&view, model, curves, &mut scratch, cancel)?;
    let map = match curves_map {
        Some(map) => map,
        None => {
            let bounds = bounds_of(vertices, elements, projection, cancel)?;
            let bounds = bounds.ok_or(CommandError::NothingToPlot)?;
            fit(&view, is_cut, &bounds, options, steps)?
        }
    };

    cancel.enter(Stage::Visibility);
    let precision = options.precision_of(model);
    let positions = bytemuck::cast_slice(model.vertices());
    let unrounded = Unrounded::new(positions, precision, view.doubt(precision.written));
    let scene = Scene { vertices, elements, projection, unrounded };
    // The memory is divided into three parts: what is already taken, the memory of the visibility
    // stage, and the lines that it finds. Beyond its minimum, up to three times as much again makes
    // that stage's grid usefully finer. Memory for the expected number of lines takes precedence
    // over this. If the lines still do not fit, the search is repeated with ever less memory for
    // the grid.
    let available = scratch.available_bytes();
    let needed = visibility::scratch_bytes(&scene);
    let spare = available.checked_sub(needed).ok_or(OutOfScratch { needed, available });
    let spare = spare.map_err(CommandError::DrawingTooLarge)?;
    let wanted = options.visibility(&view);
    let likely = elements.corners().len() * LIKELY_BYTES * if wanted.with_hidden { 2 } else { 1 };
    let finest = (3 * needed).min(spare.saturating_sub(likely).max(spare / 4));
    let grids = [finest, finest.min(spare / 4), finest.min(spare / 8), finest.min(spare / 16)];
    let mut lines = Err(CommandError::NothingToPlot);
    for (at, grid) in grids.iter().enumerate() {
        let (stage_memory, mut line_memory) = scratch.reborrow().split(needed + grid);
        let lines_at = (total - line_memory.available_bytes()) / size_of::<u64>();
        let room = line_memory.available_bytes() / size_of::<PackedLine>();
        let collected = line_memory.take(room).map_err(CommandError::DrawingTooLarge)?;
        let collector = Collector { lines: collected, count: 0 };
        let mut sink = PageSink { collector, map: &map, view: &view, options, observer };
        let found = if options.see == VisibilityMode::Wire {
            visibility::follow_wire(&scene, wanted, stage_memory, cancel, &mut sink)
        } else {
            visibility::find_stretches(&scene, wanted, stage_memory, cancel, &mut sink).map(|_| ())
        };
        lines = match found {
            Ok(()) => Ok((lines_at, sink.collector.count)),
            Err(VisibilityError::SinkFull) => Err(sink.collector.out_of_memory()),
            Err(error) => Err(refused(error, elements.corners().len())),
        };
        if found != Err(VisibilityError::SinkFull) || at + 1 == grids.len() {
            break;
        }
        sink.observer.start_again();
    }
    let (lines_at, lines) = lines?;
    to_front(words, lines_at, lines);
    Ok(Found { lines, degenerate_faces })
}

/// The bounds of all elements on the view plane; `None` if there are none.
fn bounds_of(
    vertices: &[Vertex],
    elements: Elements<'_>,
    projection: Projection,
    cancel: &mut dyn Cancel,
) -> Result<Option<Bounds>, Aborted> {
    // Each corner costs two divisions, so the check for cancelling comes after some of them.
    let mut bounds: Option<Bounds> = None;
    for corners in elements.corners().chunks(CORNERS_BETWEEN_CHECKS) {
        cancel.check()?;
        let used = corners.iter().filter_map(|c| vertices.get(usize::from(c.vertex()))).copied();
        bounds = grow(bounds, Bounds::around(used, projection));
    }
    Ok(bounds)
}

/// Fits elements and curves to the page. The curves' control points do not count, only the chords.
#[inline(never)] // Keeps its frame off the stack while the stages run.
fn map_with_curves(
    view: &View,
    model: &Model<'_>,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<PageMap, CommandError> {
    let projection = view.projection();
    let near = view.near().unwrap_or(i32::MIN);
    let in_front = |position: &Position| {
        let vertex = view.vertex(*position);
        Vertex { z: vertex.z.max(near), ..vertex }
    };
    let mut all = None;
    for positions in model.vertices().chunks(CORNERS_BETWEEN_CHECKS) {
        cancel.check()?;
        all = grow(all, Bounds::around(positions.iter().map(in_front), projection));
    }
    let all = all.ok_or(CommandError::NothingToPlot)?;
    let rough = PageMap::fit(&all, &options.sheet(), steps).map_err(CommandError::Page)?;
    let (mut bounds, is_cut) = {
        let mut scratch = scratch.reborrow();
        let seen = project_scene(view, model, None, &mut scratch, cancel)?;
        (bounds_of(seen.vertices, seen.elements, projection, cancel)?, seen.is_cut)
    };
    let flattening = Flattening { on_page: &|x, y, w| rough.fine(x, y, w), tolerance: FOR_BOUNDS };
    flattening.each_chord(view, model, scratch, cancel, &mut |chord| {
        bounds = grow(bounds, Bounds::around(chord.into_iter(), projection));
    })?;
    let bounds = bounds.ok_or(CommandError::NothingToPlot)?;
    fit(view, is_cut, &bounds, options, steps)
}

/// Fits the view to the page. If the near plane cuts the model, only what lies within 45 degrees of
/// the line of sight is fitted.
fn fit(
    view: &View,
    is_cut: bool,
    bounds: &Bounds,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
) -> Result<PageMap, CommandError> {
    match view.field(Bounds::FRACTION_BITS).filter(|_| is_cut) {
        Some(field) => PageMap::fit_field(bounds, field, &options.sheet(), steps),
        None => PageMap::fit(bounds, &options.sheet(), steps),
    }
    .map_err(CommandError::Page)
}

/// Converts an error of the visibility stage. `corners` is the number of corners of the model.
fn refused(error: VisibilityError, corners: usize) -> CommandError {
    match error {
        VisibilityError::Scratch(missing) => CommandError::DrawingTooLarge(missing),
        VisibilityError::Aborted => CommandError::Aborted,
        VisibilityError::TooManyCorners(limit) => {
            CommandError::Model(ModelError::TooManyCorners { limit, needed: corners })
        }
        // The model and the view exclude the first two errors; the caller handles the third.
        VisibilityError::UnknownVertex(_)
        | VisibilityError::OutOfRange(_)
        | VisibilityError::SinkFull => CommandError::NothingToPlot,
    }
}

/// The union of both bounds, where either may be missing.
pub(super) fn grow(bounds: Option<Bounds>, more: Option<Bounds>) -> Option<Bounds> {
    bounds.zip(more).map(|(a, b)| a.union(b)).or(bounds).or(more)
}

/// Moves `count` lines from word `at` to the front, where [`build_graph`] looks for them.
pub(super) fn to_front(words: &mut [u64], at: usize, count: usize) {
    let line_words = Scratch::bytes_for::<PackedLine>(count) / size_of::<u64>();
    words.copy_within(at..at + line_words, 0);
}

impl From<Aborted> for CommandError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

impl From<StageError> for CommandError {
    fn from(error: StageError) -> Self {
        match error {
            StageError::Scratch(missing) => Self::DrawingTooLarge(missing),
            StageError::Aborted => Self::Aborted,
        }
    }
}

impl From<GraphError> for CommandError {
    fn from(error: GraphError) -> Self {
        match error {
            GraphError::Scratch(missing) => Self::DrawingTooLarge(missing),
            GraphError::Aborted => Self::Aborted,
        }
    }
}

impl From<OrderError> for CommandError {
    fn from(error: OrderError) -> Self {
        match error {
            OrderError::Scratch(missing) => Self::DrawingTooLarge(missing),
            OrderError::Aborted => Self::Aborted,
            OrderError::TooManySegments => Self::TooManyLines,
            // A drawing made by `build_graph` causes neither error.
            OrderError::TourLength | OrderError::BadSegment(_) => Self::TooManyLines,
        }
    }
}

/// Collects lines, packed, at the front of the memory. Lines without length are dropped.
pub(super) struct Collector<'a> {
    lines: &'a mut [PackedLine],
    /// Number of lines collected so far.
    pub(super) count: usize,
}

impl<'a> Collector<'a> {
    /// Collects lines at the front of `words`.
    pub(super) fn new(words: &'a mut [u64]) -> Self {
        let room = size_of_val(words) / size_of::<PackedLine>();
        Self { lines: items_mut(words, room).unwrap_or(&mut []), count: 0 }
    }

    /// Adds a line.
    ///
    /// # Errors
    /// [`SinkFull`] if there is no room for it.
    pub(super) fn line(&mut self, line: PackedLine) -> Result<(), SinkFull> {
        if line.has_length() {
            *self.lines.get_mut(self.count).ok_or(SinkFull)? = line;
            self.count += 1;
        }
        Ok(())
    }

    /// The error for one line too many, with the sizes.
    pub(super) fn missing(&self) -> OutOfScratch {
        let available = size_of_val(self.lines);
        OutOfScratch { needed: available + size_of::<PackedLine>(), available }
    }

    /// The same as an error to reply with.
    pub(super) fn out_of_memory(&self) -> CommandError {
        CommandError::DrawingTooLarge(self.missing())
    }
}

/// Maps each stretch that is to be drawn to the page and collects it as a line.
pub(super) struct PageSink<'a> {
    /// Where the lines go.
    pub(super) collector: Collector<'a>,
    /// From the view to the page.
    pub(super) map: &'a PageMap,
    pub(super) view: &'a View,
    pub(super) options: &'a PlotOptions,
    /// Is shown each stretch that is drawn.
    pub(super) observer: &'a mut dyn Observer,
}

impl StretchSink for PageSink<'_> {
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull> {
        let (p, q) = stretch.ends;
        // The intersection of a face with the near plane is not an edge of the model.
        let is_cut = |near| p.z == near && q.z == near && stretch.edge.is_some();
        if self.view.near().is_some_and(is_cut) {
            return Ok(());
        }
        let mut stretch = stretch;
        if self.options.one_pen {
            stretch.pen = 0;
        }
        let line_type = match (stretch.visible, self.options.hidden) {
            (true, _) | (false, HiddenLines::Shown) => LineType::Full,
            (false, HiddenLines::Dotted) => LineType::Dotted,
            (false, HiddenLines::Dashed) => LineType::Dashed,
            (false, HiddenLines::Pen(pen)) => {
                stretch.pen = pen;
                LineType::Full
            }
            (false, HiddenLines::Erased) => return Ok(()),
        };
        self.observer.stretch(self.view, &stretch);
        let along = [stretch.from, stretch.to];
        match self.map.stretch((p, q), along, self.view.projection()) {
            Some([from, to]) => {
                let line = PackedLine::new(from, to, line_type, stretch.pen);
                self.collector.line(if stretch.visible { line } else { line.under() })
            }
            None => Ok(()),
        }
    }
}
