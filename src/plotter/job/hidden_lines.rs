//! The stage that finds the visible lines of a model.

use super::pipeline::Found;
use super::scale::{bounds_of, fit, map_with_curves};
use super::{Collector, HALF_A_STEP, PageSink, Pipeline, move_to_front};
use crate::drawing::PackedLine;
#[cfg(feature = "early-ink")]
use crate::drawing::PageMap;
#[cfg(feature = "early-ink")]
use crate::geometry::{Projection, Vertex};
use crate::index::Index;
#[cfg(feature = "early-ink")]
use crate::model::Elements;
use crate::model::ModelError;
use crate::plotter::VisibilityMode;
use crate::protocol::CommandError;
#[cfg(feature = "early-ink")]
use crate::stage::Cancel;
use crate::stage::{OutOfScratch, Scratch, Stage};
use crate::view::{Flattening, Seen, project_scene};
#[cfg(not(feature = "threads"))]
use crate::visibility::find_stretches;
#[cfg(feature = "threads")]
use crate::visibility::threads::find_stretches;
use crate::visibility::{self, Scene, Unrounded, VisibilityError};

/// Expected bytes of lines for each corner. A lattice of cubes shows half of its edges and has two
/// corners per edge.
const LIKELY_BYTES: usize = size_of::<PackedLine>() / 3;

/// With fewer corners, the lines are found before the pen would be at their left end.
#[cfg(feature = "early-ink")]
const CORNERS_WORTH_A_TRAVEL: usize = 1000;

impl<I: Index> Pipeline<'_, I> {
    /// Projects the model through the camera and finds its visible lines. Handles every model that
    /// is neither a flat plan nor a convex solid without faces.
    #[inline(never)] // Inlined, its frame would take stack in the rest of the computation.
    pub(super) fn find_visible_lines(&mut self) -> Result<Found, CommandError> {
        let (_, view) = self.camera_view()?;
        #[cfg(feature = "early-ink")]
        let is_early = self.early.is_some();
        let Self { model, options, steps, words, cancel, observer, .. } = self;
        let (model, options, steps, words) = (*model, *options, *steps, &mut **words);
        let cancel = &mut **cancel;
        let total = size_of_val(words);
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
        let Seen { vertices, elements, sources, degenerate_faces, is_cut } =
            project_scene(&view, model, curves, &mut scratch, cancel)?;
        let map = match curves_map {
            Some(map) => map,
            None => {
                let bounds = bounds_of(vertices, elements, projection, cancel)?;
                let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
                fit(&view, is_cut, &bounds, options, steps)?
            }
        };

        #[cfg(feature = "early-ink")]
        if is_early && !is_cut && options.see == VisibilityMode::Faces {
            expect_left_end(vertices, elements, projection, &map, cancel);
        }
        cancel.enter(Stage::Visibility);
        let precision = options.precision_of(model);
        let positions = bytemuck::cast_slice(model.vertices());
        let unrounded = Unrounded::new(positions, precision, view.error_bound(precision.written))
            .made_of(&sources);
        let scene = Scene { vertices, elements, projection, unrounded };
        // The memory is divided into three parts: what is already taken, the memory of the
        // visibility stage, and the lines that it finds. Beyond its minimum, up to three times as
        // much again makes that stage's grid usefully finer. Memory for the expected number of
        // lines takes precedence over this. If the lines still do not fit, the search is repeated
        // with ever less memory for the grid.
        let available = scratch.available_bytes();
        let needed = visibility::scratch_bytes(&scene);
        let spare = available.checked_sub(needed).ok_or(OutOfScratch { needed, available });
        let spare = spare.map_err(CommandError::DrawingTooLarge)?;
        let wanted = options.visibility(&view);
        let likely =
            elements.corners().len() * LIKELY_BYTES * if wanted.with_hidden { 2 } else { 1 };
        let finest = (3 * needed).min(spare.saturating_sub(likely).max(spare / 4));
        let grids = [finest, finest.min(spare / 4), finest.min(spare / 8), finest.min(spare / 16)];
        let mut lines = Err(CommandError::NothingToPlot);
        for (at, grid) in grids.iter().enumerate() {
            let (stage_memory, mut line_memory) = scratch.reborrow().split(needed + grid);
            let lines_at = (total - line_memory.available_bytes()) / size_of::<u64>();
            let collector = Collector { lines: line_memory.take_rest(), count: 0 };
            let mut sink =
                PageSink { collector, map: &map, view: &view, options, observer: &mut **observer };
            let found = if options.see == VisibilityMode::Wire {
                visibility::follow_wire(&scene, wanted, stage_memory, cancel, &mut sink)
            } else {
                find_stretches(&scene, wanted, stage_memory, cancel, &mut sink).map(|_| ())
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
        move_to_front(words, lines_at, lines);
        Ok(Found { lines, degenerate_faces, joined_edges: 0 })
    }
}

/// Tells where the left end of the drawing is, if its lines take long to find: the first strokes of
/// a job whose pen begins early lie there. It is the vertex whose image is furthest to the left,
/// for nothing hides that one.
#[cfg(feature = "early-ink")]
#[inline(never)] // Inlined, its frame would take stack while the lines are found.
fn expect_left_end<I: Index>(
    vertices: &[Vertex],
    elements: Elements<'_, I>,
    projection: Projection,
    map: &PageMap,
    cancel: &mut dyn Cancel,
) {
    let used = elements.corners().iter();
    if used.len() < CORNERS_WORTH_A_TRAVEL {
        return;
    }
    let image = |vertex: &Vertex| match projection {
        Projection::Perspective => (i64::from(vertex.x), i64::from(vertex.z.max(1))),
        Projection::Parallel => (i64::from(vertex.x), 1),
    };
    let is_left_of = |one: &Vertex, other: &Vertex| {
        let ((x, w), (other_x, other_w)) = (image(one), image(other));
        // Both factors have 32 bits.
        x * other_w < other_x * w
    };
    let used = used.filter_map(|corner| vertices.get(corner.vertex().get()));
    let leftmost = used.reduce(|left, next| if is_left_of(next, left) { next } else { left });
    if let Some(vertex) = leftmost {
        let (x, w) = image(vertex);
        cancel.expect_beginning(map.point(x, vertex.y.into(), w));
    }
}

/// Converts an error of the hidden-line removal to the reply. `corners` is the number of corners of
/// the model.
fn refused(error: VisibilityError, corners: usize) -> CommandError {
    match error {
        VisibilityError::Scratch(missing) => CommandError::DrawingTooLarge(missing),
        VisibilityError::Aborted => CommandError::Aborted,
        VisibilityError::TooManyCorners(limit) => {
            CommandError::Model(ModelError::TooManyCorners { limit, needed: corners })
        }
        VisibilityError::TooManyVertices { limit, .. } => {
            CommandError::Model(ModelError::TooManyVertices { limit })
        }
        // The model and the view exclude the first two errors; the caller handles the third.
        VisibilityError::UnknownVertex(_)
        | VisibilityError::OutOfRange(_)
        | VisibilityError::SinkFull => CommandError::NothingToPlot,
    }
}
