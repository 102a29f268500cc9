//! The wire frame: draws every edge from end to end, without removing hidden lines.

use super::edges::{ChosenSides, Outlines, sides};
use super::yield_counter::YieldCounter;
use super::{Options, Scene, Stretch, StretchSink, VisibilityError, check};
use crate::geometry::EdgeParameter;
use crate::index::Index;
use crate::stage::{Cancel, Scratch};

/// Hands over every distinct edge and bar as one visible stretch, in the order of the model, as if
/// no face hid anything. Of `options` only the crease is used.
///
/// # Errors
/// See [`VisibilityError`]. Working memory of [`super::scratch_bytes`] is enough.
#[inline(never)] // Inlined in its only caller, the code would be larger.
pub fn follow_wire<I: Index>(
    scene: &Scene<'_, I>,
    options: Options,
    mut scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<I>,
) -> Result<(), VisibilityError> {
    check(scene)?;
    let outlines = Outlines::of(scene.elements);
    let (vertices, projection) = (scene.vertices, scene.projection);
    let yield_counter = &mut YieldCounter::new(cancel);
    let creases = (options.crease, scene.unrounded);
    let chosen =
        ChosenSides::choose(outlines, projection, vertices, creases, &mut scratch, yield_counter)?;
    for (first, element) in outlines.elements() {
        yield_counter.spend(500 * element.len())?;
        for (number, p, q) in sides(element) {
            if chosen.contains(first + number) {
                // Every corner is the number of a vertex (see `check`).
                let ends = (vertices[p.get()], vertices[q.get()]);
                let (from, to) = (EdgeParameter::START, EdgeParameter::END);
                let pen = outlines.pens.at(first);
                sink.stretch(Stretch { edge: Some((p, q)), ends, from, to, visible: true, pen })?;
            }
        }
    }
    Ok(())
}
