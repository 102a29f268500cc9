//! For each edge, the visible stretches.
//!
//! (skeleton: the visibility work fills this in)

use crate::geometry::{Projection, Vertex};
use crate::model::Elements;
use crate::stage::{Aborted, Attention, OutOfScratch, Scratch};

/// A scene as the camera sees it: rounded vertices, and the faces and bars between them.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// View coordinates of every vertex of the model.
    pub vertices: &'a [Vertex],
    /// Faces and bars, by vertex number.
    pub elements: Elements<'a>,
    /// Perspective or parallel.
    pub projection: Projection,
}

/// A place along an edge from p to q: p + (numerator / denominator)(q - p) in view *space*.
///
/// 0 <= numerator <= denominator, denominator > 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Along {
    /// Zero at p.
    pub numerator: u64,
    /// Equal to the numerator at q.
    pub denominator: u64,
}

/// A longest piece of one edge that is all visible or all hidden.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// The vertices that the edge joins.
    pub edge: (u16, u16),
    /// Where it begins.
    pub from: Along,
    /// Where it ends, after `from`.
    pub to: Along,
    /// Whether it is seen.
    pub visible: bool,
}

/// Who takes the stretches as they are found.
pub trait StretchSink {
    /// Takes one stretch.
    ///
    /// # Errors
    /// [`SinkFull`] ends the search.
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull>;
}

/// The sink has no room for another stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SinkFull;

/// Why visibility ended without a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityError {
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The sink took no more.
    SinkFull,
    /// The user gave up.
    Aborted,
}

impl From<OutOfScratch> for VisibilityError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}
impl From<SinkFull> for VisibilityError {
    fn from(_: SinkFull) -> Self {
        Self::SinkFull
    }
}
impl From<Aborted> for VisibilityError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

/// The working memory that [`find_stretches`] takes for a scene of this size.
pub fn scratch_bytes(_scene: &Scene<'_>) -> usize {
    0
}

/// Finds the stretches of every edge and bar of the scene.
///
/// `with_hidden`: also hand over the hidden stretches (dotted or shown).
///
/// # Errors
/// See [`VisibilityError`].
pub fn find_stretches(
    _scene: &Scene<'_>,
    _with_hidden: bool,
    _scratch: Scratch<'_>,
    _attention: &mut dyn Attention,
    _sink: &mut dyn StretchSink,
) -> Result<(), VisibilityError> {
    Ok(())
}
