//! From the model to ordered strokes: the way of the data, in one place.

use super::{PlotOptions, solid};
use crate::drawing::{
    Bounds, Drawing, Line, LineType, OrganiseError, PageMap, PagePoint, StepsPerMillimetre, Stored,
    organise,
};
use crate::machine::{Path, Target};
use crate::model::{Element, Model, ModelError};
use crate::order::{self, Leg, OrderError};
use crate::protocol::{HiddenLines, Refusal, WayToSee};
use crate::stage::{Aborted, Attention, OutOfScratch, Scratch, Stage, items, items_mut};
use crate::view::{SeeError, Seen, View, see};
use crate::visibility::{self, Scene, SinkFull, Stretch, StretchSink, VisibilityError};

/// Who is shown each stretch as it is found, in view coordinates: the preview.
pub trait Observer {
    /// One stretch, seen through `view`.
    fn stretch(&mut self, view: &View, stretch: &Stretch);

    /// What was shown so far counts no more: the job begins again in other memory.
    fn start_again(&mut self) {}

    /// One bar of a plan, as it lies on the page.
    fn plan_bar(&mut self, from: [f64; 2], to: [f64; 2]);
}

/// Nobody looks on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Observer for Unobserved {
    fn stretch(&mut self, _: &View, _: &Stretch) {}
    fn plan_bar(&mut self, _: [f64; 2], _: [f64; 2]) {}
}

/// A drawing in the working memory with the order of its strokes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Job {
    stored: Stored,
    legs: usize,
    report: order::Report,
    degenerate_faces: u32,
}

impl Job {
    /// Computes the job for `model` in `words`, which then hold it.
    ///
    /// # Errors
    /// The [`Refusal`] to reply with; `words` hold no job then, the model is untouched.
    pub fn compute(
        model: &Model<'_>,
        options: &PlotOptions,
        steps: StepsPerMillimetre,
        words: &mut [u64],
        attention: &mut dyn Attention,
        observer: &mut dyn Observer,
    ) -> Result<Self, Refusal> {
        if model.elements().corners().is_empty() && options.see != WayToSee::Vertices {
            return Err(Refusal::NothingToPlot);
        }
        let mut degenerate_faces = 0;
        let lines = if model.is_plan() && options.shows_plans_flat() {
            lay_out_plan(model, options, steps, words, observer)?
        } else {
            match options.see {
                WayToSee::Vertices | WayToSee::Edges => {
                    solid::project(model, options, steps, words, attention, observer)?
                }
                WayToSee::Faces | WayToSee::Wire => {
                    let found = project(model, options, steps, words, attention, observer)?;
                    degenerate_faces = found.degenerate_faces;
                    found.lines
                }
            }
        };
        let stored = organise(words, lines, attention)?;
        let (drawing, mut rest) = stored.split(words).map_err(Refusal::DrawingTooLarge)?;
        let legs = drawing.segments.len();
        if legs == 0 {
            return Err(Refusal::NothingToPlot);
        }
        let tour = rest.take::<Leg>(legs).map_err(Refusal::DrawingTooLarge)?;
        attention.enter(Stage::Order);
        let report = order::order(drawing, options.order, rest, attention, tour)?;
        Ok(Self { stored, legs, report, degenerate_faces })
    }

    /// What came of the order.
    pub fn report(&self) -> &order::Report {
        &self.report
    }

    /// Faces of the model that were left out because they have no area.
    pub fn degenerate_faces(&self) -> u32 {
        self.degenerate_faces
    }

    /// The strokes, from `cursor` on. `words` are those that hold the job.
    pub fn strokes<'a>(&self, words: &'a mut [u64], cursor: &'a mut Cursor) -> Strokes<'a> {
        // The memory is the one that `compute` filled, so both reads succeed; else there is no stroke.
        let nothing = Drawing { points: &[], segments: &[] };
        let leg_words = self.stored.bytes() / size_of::<u64>();
        let words: &'a [u64] = words;
        let tour =
            words.get(leg_words..).and_then(|rest| items::<Leg>(rest, self.legs)).unwrap_or(&[]);
        let drawing = self.stored.drawing(words).unwrap_or(nothing);
        Strokes { drawing, tour, cursor }
    }
}

/// How far the strokes of a job have been handed to the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cursor {
    leg: usize,
    at: Option<u16>,
}

/// The strokes of a job as the machine asks for them: a pen-up move wherever a leg does not begin
/// where the one before ended.
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
        self.cursor.leg += usize::from(begins_here);
        Some(Target { point, ink: begins_here.then(|| segment.line_type()) })
    }

    fn rewind(&mut self) {
        *self.cursor = Cursor::default();
    }
}

/// A plan: its bars are lines on the page already. Returns how many lines stand in `words`.
fn lay_out_plan(
    model: &Model<'_>,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
    words: &mut [u64],
    observer: &mut dyn Observer,
) -> Result<usize, Refusal> {
    let vertices = model.vertices();
    let unit = libm::ldexp(1.0, -(model.fraction_bits() as i32));
    let used = model
        .elements()
        .corners()
        .iter()
        .filter_map(|c| vertices.get(usize::from(c.vertex())))
        .copied();
    let (page, bits) = (&options.page, model.fraction_bits());
    let map = if options.fit {
        PageMap::fit_plan(used, bits, page, steps)
    } else {
        PageMap::true_size(used, bits, page, steps)
    };
    let map = map.map_err(Refusal::Page)?;
    let mut collector = Collector::new(words);
    for element in model.elements().iter() {
        let Element::Bar(from, to) = element else { continue };
        let (Some(from), Some(to)) =
            (vertices.get(usize::from(from)), vertices.get(usize::from(to)))
        else {
            continue;
        };
        observer.plan_bar(
            [from.x, from.y].map(|c| f64::from(c) * unit),
            [to.x, to.y].map(|c| f64::from(c) * unit),
        );
        let [from, to] = [from, to].map(|p| map.point(p.x.into(), p.y.into(), 1));
        collector.line(from, to, LineType::Full).map_err(|SinkFull| collector.out_of_memory())?;
    }
    Ok(collector.count)
}

/// These take some 100,000 instructions.
const CORNERS_BETWEEN_CHECKS: usize = 128;

/// Of lines for each corner: a lattice of cubes shows half of its edges, and has two corners to an edge.
const LIKELY_BYTES: usize = size_of::<Line>() / 3;

/// What stands in the memory after the hidden lines are found.
struct Found {
    lines: usize,
    degenerate_faces: u32,
}

/// Anything else: through the camera, hidden lines found.
fn project(
    model: &Model<'_>,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
    words: &mut [u64],
    attention: &mut dyn Attention,
    observer: &mut dyn Observer,
) -> Result<Found, Refusal> {
    attention.enter(Stage::View);
    let total = size_of_val(words);
    let mut scratch = Scratch::new(words);
    let camera = options.camera(model).ok_or(Refusal::NothingToPlot)?;
    attention.check()?;
    let view = View::new(&camera, model).map_err(Refusal::View)?;
    attention.check()?;
    let Seen { vertices, elements, degenerate_faces } = see(&view, model, &mut scratch, attention)?;
    if !options.clip_behind {
        view.refuse_behind(model).map_err(Refusal::View)?;
    }
    let projection = view.projection();
    // Two divisions a corner: some at a time, so that the line is answered.
    let mut bounds: Option<Bounds> = None;
    for corners in elements.corners().chunks(CORNERS_BETWEEN_CHECKS) {
        attention.check()?;
        let used = corners.iter().filter_map(|c| vertices.get(usize::from(c.vertex()))).copied();
        bounds = grow(bounds, Bounds::around(used, projection));
    }
    let bounds = bounds.ok_or(Refusal::NothingToPlot)?;
    let map = PageMap::fit(&bounds, &options.page, steps).map_err(Refusal::Page)?;

    attention.enter(Stage::Visibility);
    let positions = bytemuck::cast_slice(model.vertices());
    let scene = Scene { vertices, elements, projection, positions };
    // Memory: what is taken, then visibility's, then the lines as they are found. Thrice what visibility
    // needs makes a grid as fine as is of any use; lines that are likely come before that. If
    // there turn out to be more, a quarter of what is to spare must do for the grid.
    let available = scratch.available_bytes();
    let needed = visibility::scratch_bytes(&scene);
    let spare = available.checked_sub(needed).ok_or(OutOfScratch { needed, available });
    let spare = spare.map_err(Refusal::DrawingTooLarge)?;
    let wanted = options.visibility(&view);
    let likely = elements.corners().len() * LIKELY_BYTES * if wanted.with_hidden { 2 } else { 1 };
    let grids = [(3 * needed).min(spare.saturating_sub(likely).max(spare / 4)), spare / 4];
    let mut lines = Err(Refusal::NothingToPlot);
    for (at, grid) in grids.iter().enumerate() {
        let (stage_memory, mut line_memory) = scratch.reborrow().split(needed + grid);
        let lines_at = (total - line_memory.available_bytes()) / size_of::<u64>();
        let room = line_memory.available_bytes() / size_of::<Line>();
        let collected = line_memory.take(room).map_err(Refusal::DrawingTooLarge)?;
        let collector = Collector { lines: collected, count: 0 };
        let mut sink = PageSink { collector, map, view, hidden: options.hidden, observer };
        let found = if options.see == WayToSee::Wire {
            visibility::follow_wire(&scene, wanted, stage_memory, attention, &mut sink)
        } else {
            visibility::find_stretches(&scene, wanted, stage_memory, attention, &mut sink)
                .map(|_| ())
        };
        lines = match found {
            Ok(()) => Ok((lines_at, sink.collector.count)),
            Err(VisibilityError::SinkFull) => Err(sink.collector.out_of_memory()),
            Err(error) => Err(refused(error, elements.corners().len())),
        };
        if found != Err(VisibilityError::SinkFull) || grids[0] <= grids[1] || at > 0 {
            break;
        }
        sink.observer.start_again();
    }
    let (lines_at, lines) = lines?;
    to_front(words, lines_at, lines);
    Ok(Found { lines, degenerate_faces })
}

fn refused(error: VisibilityError, corners: usize) -> Refusal {
    match error {
        VisibilityError::Scratch(missing) => Refusal::DrawingTooLarge(missing),
        VisibilityError::Aborted => Refusal::Aborted,
        VisibilityError::TooManyCorners(limit) => {
            Refusal::Model(ModelError::TooManyCorners { limit, needed: corners })
        }
        // The model and the view see to it that neither of the first two can be; the sink speaks for itself.
        VisibilityError::UnknownVertex(_)
        | VisibilityError::OutOfRange(_)
        | VisibilityError::SinkFull => Refusal::NothingToPlot,
    }
}

/// The bounds of both.
pub(super) fn grow(bounds: Option<Bounds>, more: Option<Bounds>) -> Option<Bounds> {
    bounds.zip(more).map(|(a, b)| a.union(b)).or(bounds).or(more)
}

/// Moves `count` lines from word `at` to the front, where [`organise`] looks for them.
pub(super) fn to_front(words: &mut [u64], at: usize, count: usize) {
    let line_words = Scratch::bytes_for::<Line>(count) / size_of::<u64>();
    words.copy_within(at..at + line_words, 0);
}

impl From<Aborted> for Refusal {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

impl From<SeeError> for Refusal {
    fn from(error: SeeError) -> Self {
        match error {
            SeeError::Scratch(missing) => Self::DrawingTooLarge(missing),
            SeeError::Aborted => Self::Aborted,
        }
    }
}

impl From<OrganiseError> for Refusal {
    fn from(error: OrganiseError) -> Self {
        match error {
            OrganiseError::Scratch(missing) => Self::DrawingTooLarge(missing),
            OrganiseError::Aborted => Self::Aborted,
        }
    }
}

impl From<OrderError> for Refusal {
    fn from(error: OrderError) -> Self {
        match error {
            OrderError::Scratch(missing) => Self::DrawingTooLarge(missing),
            OrderError::Aborted => Self::Aborted,
            OrderError::TooManySegments => Self::TooManyLines,
            // Of a drawing that `organise` made neither can be.
            OrderError::TourLength | OrderError::BadSegment(_) => Self::TooManyLines,
        }
    }
}

/// Packs lines at the front of the memory.
pub(super) struct Collector<'a> {
    lines: &'a mut [Line],
    pub(super) count: usize,
}

impl<'a> Collector<'a> {
    pub(super) fn new(words: &'a mut [u64]) -> Self {
        let room = size_of_val(words) / size_of::<Line>();
        Self { lines: items_mut(words, room).unwrap_or(&mut []), count: 0 }
    }

    fn line(
        &mut self,
        from: PagePoint,
        to: PagePoint,
        line_type: LineType,
    ) -> Result<(), SinkFull> {
        if from != to {
            *self.lines.get_mut(self.count).ok_or(SinkFull)? = Line::new(from, to, line_type, 0);
            self.count += 1;
        }
        Ok(())
    }

    pub(super) fn out_of_memory(&self) -> Refusal {
        let available = size_of_val(self.lines);
        Refusal::DrawingTooLarge(OutOfScratch { needed: available + size_of::<Line>(), available })
    }
}

/// Puts each stretch on the page.
pub(super) struct PageSink<'a> {
    pub(super) collector: Collector<'a>,
    pub(super) map: PageMap,
    pub(super) view: View,
    pub(super) hidden: HiddenLines,
    pub(super) observer: &'a mut dyn Observer,
}

impl StretchSink for PageSink<'_> {
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull> {
        let (p, q) = stretch.ends;
        // The cut along the near plane is no edge of the model.
        let is_cut = |near| p.z == near && q.z == near && stretch.edge.is_some();
        if self.view.near().is_some_and(is_cut) {
            return Ok(());
        }
        let line_type = match (stretch.visible, self.hidden) {
            (true, _) | (false, HiddenLines::Shown) => LineType::Full,
            (false, HiddenLines::Dotted) => LineType::Dotted,
            (false, HiddenLines::Dashed) => LineType::Dashed,
            (false, HiddenLines::Erased) => return Ok(()),
        };
        self.observer.stretch(&self.view, &stretch);
        let [from, to] =
            [stretch.from, stretch.to].map(|end| self.map.along(p, q, end, self.view.projection()));
        self.collector.line(from, to, line_type)
    }
}
