//! Fits what a camera sees to the page.

use super::super::PlotOptions;
use crate::drawing::{Bounds, PageMap, StepsPerMillimetre};
use crate::geometry::{Projection, Vertex};
use crate::index::Index;
use crate::model::{Elements, Model};
use crate::protocol::CommandError;
use crate::stage::{Aborted, Cancel, Scratch};
use crate::view::{Flattening, View, project_scene};

/// Tolerance for the chords of a curve on the page, in 1/256 step: half a step.
pub(in crate::plotter) const HALF_A_STEP: u16 = 128;
/// A finer tolerance, used to find the bounds of curves before the scale of the page is known.
pub(in crate::plotter) const FOR_BOUNDS: u16 = 32;

/// Corners handled between two checks for cancelling: some 100,000 instructions.
const CORNERS_BETWEEN_CHECKS: usize = 128;

/// The bounds of all elements on the view plane.
pub(super) fn bounds_of<I: Index>(
    vertices: &[Vertex],
    elements: Elements<'_, I>,
    projection: Projection,
    cancel: &mut dyn Cancel,
) -> Result<Bounds, Aborted> {
    // Each corner costs two divisions, so the check for cancelling comes after some of them.
    let mut bounds = Bounds::NOTHING;
    for corners in elements.corners().chunks(CORNERS_BETWEEN_CHECKS) {
        cancel.check()?;
        for vertex in corners.iter().filter_map(|corner| vertices.get(corner.vertex().get())) {
            bounds.add(*vertex, projection);
        }
    }
    Ok(bounds)
}

/// Fits elements and curves to the page. The curves' control points do not count, only the chords.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn map_with_curves<I: Index>(
    view: &View,
    model: &Model<'_, I>,
    options: &PlotOptions,
    steps: StepsPerMillimetre,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
) -> Result<PageMap, CommandError> {
    let projection = view.projection();
    let near = view.near().unwrap_or(i32::MIN);
    let mut all = Bounds::NOTHING;
    for positions in model.vertices().chunks(CORNERS_BETWEEN_CHECKS) {
        cancel.check()?;
        for position in positions {
            let vertex = view.vertex(*position);
            all.add(Vertex { z: vertex.z.max(near), ..vertex }, projection);
        }
    }
    let all = all.known().ok_or(CommandError::NothingToPlot)?;
    let rough = PageMap::fit(&all, &options.sheet(), steps).map_err(CommandError::Page)?;
    let (mut bounds, is_cut) = {
        let mut scratch = scratch.reborrow();
        let seen = project_scene(view, model, None, &mut scratch, cancel)?;
        (bounds_of(seen.vertices, seen.elements, projection, cancel)?, seen.is_cut)
    };
    let flattening = Flattening { on_page: &|x, y, w| rough.fine(x, y, w), tolerance: FOR_BOUNDS };
    flattening.each_chord(view, model, scratch, cancel, &mut |chord| {
        for end in chord {
            bounds.add(end, projection);
        }
    })?;
    let bounds = bounds.known().ok_or(CommandError::NothingToPlot)?;
    fit(view, is_cut, &bounds, options, steps)
}

/// Fits the view to the page. If the near plane cuts the model, only what lies within 45 degrees of
/// the line of sight is fitted.
pub(in crate::plotter) fn fit(
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
