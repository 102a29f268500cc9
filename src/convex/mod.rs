//! The two ways to see a convex solid for which no faces are needed.
//!
//! [`from_vertices`] takes vertices alone (Harrison, chapter 3): it finds the outline, then from its
//! segments the visible and the hidden faces, each once, and hands over faces and edges.
//! [`from_edges`] takes vertices and edges (Zámožík & Zaťková): it walks the outline along the edges,
//! takes it out of the graph and decides each component that is left.
//!
//! Both work on the *positions of the model*, not on the rounded vertices of the view. A square whose
//! corners are rounded one by one is no longer flat, and the solid that the user means would fall into
//! triangles; in the model its corners are exactly coplanar, and a face that is edge-on is exactly
//! edge-on. The eye is given in the same unit. No page is needed, so the camera's other numbers are not
//! either, and an eye so near that part of the solid lies behind it is all right.
//!
//! Positions that came from decimals are off by the rounding of the decimals: by at most the `precision`
//! that both take. The default is exact. Otherwise
//! - [`from_vertices`] joins the faces that it found exactly: a face takes in its neighbours if each of
//!   their corners may lie in its plane ([`crate::geometry::are_coplanar`]). Faces narrower than 64
//!   times the precision stay as they are, so that thin slabs and needles keep their edges;
//! - the eye is moved towards the middle of the solid: with e the solid's largest extent, the reciprocal of
//!   its distance grows by 64 precisions / e². So what is meant to be edge-on, or one behind the other, is
//!   hidden beyond doubt, where else it would peep out on one side or the other.
//!
//! Refused: fewer than four different vertices, vertices all in line, a vertex inside the solid that
//! the others span, an eye inside. Vertices all in one plane are drawn as the flat polygon that they
//! are. Vertices at the same place count as one, under the least of their numbers.

mod edges;
mod exact;
mod eye;
mod faces;
mod joined;
mod points;
mod polygon;

use crate::model::Corner;
use crate::stage::{Aborted, OutOfScratch};

pub use edges::{from_edges, scratch_bytes_from_edges};
pub use eye::{EYE_LIMIT, Eye};
pub use faces::{from_vertices, scratch_bytes_from_vertices};

/// Positions lie within ± this, so that differences fit 32 bits.
pub const POSITION_LIMIT: i32 = 1 << 30;

/// How an edge of a convex solid is seen, from end to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EdgeVisibility {
    /// Between a visible face and one that is hidden or edge-on.
    Outline,
    /// Between two visible faces.
    Visible,
    /// On the far side of a face that is edge-on: on the page it coincides with the outline, so to
    /// draw it is to ink the same line again.
    BehindOutline,
    /// Hidden.
    Hidden,
}

/// An edge of the solid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolidEdge {
    /// The vertices that it joins.
    pub ends: (u16, u16),
    /// How it is seen.
    pub sight: EdgeVisibility,
}

/// Who takes what was found. Nothing is handed over before the whole solid is known to be in order.
pub trait SolidSink {
    /// Takes one face: its corners counter-clockwise as seen from outside, the last one marked, so that
    /// they can be appended to the elements of a model. A face that is edge-on is not visible.
    ///
    /// # Errors
    /// [`SinkFull`] ends the job.
    fn face(&mut self, corners: &[Corner], visible: bool) -> Result<(), SinkFull>;

    /// Takes one edge. Every edge comes once, after the faces.
    ///
    /// # Errors
    /// [`SinkFull`] ends the job.
    fn edge(&mut self, edge: SolidEdge) -> Result<(), SinkFull>;
}

pub use crate::stage::SinkFull;

/// What was found, in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SolidSummary {
    /// Faces handed over (none by [`from_edges`]).
    pub faces: usize,
    /// Edges handed over.
    pub edges: usize,
    /// Vertices left out because an earlier one is at the same place.
    pub welded: usize,
    /// Edges left out because their faces may be one ([`from_vertices`] only).
    pub joined: usize,
    /// Vertices that are no corners: in the middle of a face or an edge.
    pub flat: usize,
    /// Parts into which the graph fell without the outline ([`from_edges`] only).
    pub components: usize,
}

/// Why nothing was drawn. The sink has been given nothing, except after [`SolidError::SinkFull`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SolidError {
    /// A solid needs four vertices at different places.
    TooFewVertices {
        /// How many there are.
        distinct: usize,
    },
    /// More vertices than elements can name: [`crate::model::VERTEX_NUMBER_LIMIT`].
    TooManyVertices,
    /// A coordinate is past ±2^30.
    PositionOutOfRange {
        /// The vertex, from 0.
        vertex: u16,
    },
    /// All vertices are in line.
    AllInLine,
    /// The eye's coordinates pass [`EYE_LIMIT`], or its direction is zero.
    BadEye,
    /// The eye is inside the solid or on its surface.
    EyeInside,
    /// Not convex: a vertex lies inside the solid that the others span, deeper than the precision.
    VertexInside {
        /// The first such vertex, from 0.
        vertex: u16,
        /// How many there are.
        count: usize,
    },
    /// An edge names a vertex that does not exist.
    UnknownVertex {
        /// The number of the edge, from 0.
        edge: usize,
    },
    /// The edges do not go around the solid: at this vertex of the outline none leads on.
    OutlineBroken {
        /// The vertex, from 0.
        vertex: u16,
    },
    /// Not enough working memory.
    Scratch(OutOfScratch),
    /// The sink took no more.
    SinkFull,
    /// The user gave up.
    Aborted,
}

impl From<OutOfScratch> for SolidError {
    fn from(error: OutOfScratch) -> Self {
        Self::Scratch(error)
    }
}

impl From<SinkFull> for SolidError {
    fn from(_: SinkFull) -> Self {
        Self::SinkFull
    }
}

impl From<Aborted> for SolidError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}
