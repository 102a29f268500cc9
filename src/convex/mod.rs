//! Hidden-line removal for a convex solid that is given without faces. There are two methods.
//!
//! [`from_vertices`] takes vertices alone (Harrison, chapter 3). It finds the outline, then,
//! starting from the segments of the outline, the visible and the hidden faces, each once, and
//! hands over faces and edges.
//!
//! [`from_edges`] takes vertices and edges (Zámožík & Zaťková). It walks the outline along the
//! edges, removes it from the graph and decides for each remaining component whether it is visible.
//!
//! Both methods work on the *positions of the model*, not on the rounded vertices of the view. A
//! square whose corners are rounded one by one is no longer flat, and the solid that the user means
//! would break up into triangles. In the model its corners are exactly coplanar, and a face that is
//! edge-on is exactly edge-on. The eye is given in the same unit. The methods need no page, and
//! therefore none of the other numbers of the camera. The eye may be so near that part of the solid
//! lies behind it.
//!
//! Positions that were read from decimals are off by the rounding of the decimals: by at most the
//! `precision` that both methods take. The default precision is exact. Otherwise two corrections
//! apply:
//! * [`from_vertices`] joins faces that it found exactly. A face takes in a neighbour if each
//!   corner of the neighbour may lie in the plane of the face ([`crate::geometry::are_coplanar`]).
//!   Faces narrower than 64 times the precision stay as they are, so that thin slabs and needles
//!   keep their edges.
//! * The eye is moved towards the middle of the solid. With e the largest extent of the solid, the
//!   reciprocal of the eye's distance grows by 64 precisions / e². So a face that is meant to be
//!   edge-on, or a vertex that is meant to be behind another, is reliably hidden; otherwise it
//!   would show on one side or the other.
//!
//! Refused are fewer than four different vertices, vertices that are all in line, a vertex inside
//! the solid that the others span, and an eye inside the solid. Vertices that all lie in one plane
//! are drawn as the flat polygon that they form. Vertices at the same position count as one, which
//! has the least of their numbers.

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

/// The coordinates of positions lie within ± this limit, so that their differences fit in 32 bits.
pub const POSITION_LIMIT: i32 = 1 << 30;

/// The visibility of an edge of a convex solid. It is the same along the whole edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EdgeVisibility {
    /// The edge lies between a visible face and one that is hidden or edge-on.
    Outline,
    /// The edge lies between two visible faces.
    Visible,
    /// The edge is on the far side of a face that is edge-on. On the page it coincides with the
    /// outline, so drawing it would ink the same line again.
    BehindOutline,
    /// The edge is hidden.
    Hidden,
}

/// An edge of the solid, with its visibility.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolidEdge<I = u16> {
    /// The numbers of the vertices that it joins.
    pub ends: (I, I),
    /// Whether and how the edge is visible.
    pub visibility: EdgeVisibility,
}

/// Receives the faces and edges that were found. Nothing is handed over before the whole solid is
/// known to be valid.
pub trait SolidSink<I = u16> {
    /// Receives one face. Its corners run counter-clockwise as seen from outside, and the last one
    /// is marked, so that they can be appended to the elements of a model. A face that is edge-on
    /// is not visible.
    ///
    /// # Errors
    /// An implementation returns [`SinkFull`] to end the search.
    fn face(&mut self, corners: &[Corner<I>], visible: bool) -> Result<(), SinkFull>;

    /// Receives one edge. Every edge comes once, after the faces.
    ///
    /// # Errors
    /// An implementation returns [`SinkFull`] to end the search.
    fn edge(&mut self, edge: SolidEdge<I>) -> Result<(), SinkFull>;
}

pub use crate::stage::SinkFull;

/// The numbers of what was found, for the user to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SolidSummary {
    /// The number of faces handed over. It is zero for [`from_edges`].
    pub faces: usize,
    /// The number of edges handed over.
    pub edges: usize,
    /// The number of vertices left out because an earlier one is at the same position.
    pub welded: usize,
    /// The number of edges left out because their two faces may be one face ([`from_vertices`]
    /// only).
    pub joined: usize,
    /// The number of vertices that are not corners: they lie in the middle of a face or an edge.
    pub flat: usize,
    /// The number of components into which the graph falls without the outline ([`from_edges`]
    /// only).
    pub components: usize,
}

/// The reasons why a solid is not drawn. The sink has received nothing, unless the error is
/// [`SolidError::SinkFull`] or [`SolidError::Aborted`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SolidError {
    /// There are fewer than the four vertices at different positions that a solid needs.
    TooFewVertices {
        /// The number of different positions that there are.
        distinct: usize,
    },
    /// There are more vertices than elements can refer to:
    /// [`crate::model::Corner::VERTEX_NUMBER_LIMIT`].
    TooManyVertices,
    /// A coordinate is beyond ±2^30.
    PositionOutOfRange {
        /// The number of the vertex, counted from 0.
        vertex: u32,
    },
    /// All vertices lie on one line.
    AllInLine,
    /// A coordinate of the eye is beyond [`EYE_LIMIT`], or its direction is zero.
    BadEye,
    /// The eye is inside the solid or on its surface.
    EyeInside,
    /// The solid is not convex: a vertex lies inside the solid that the others span, deeper than
    /// the precision.
    VertexInside {
        /// The number of the first vertex inside, counted from 0.
        vertex: u32,
        /// The number of such vertices.
        count: usize,
    },
    /// An edge refers to a vertex that does not exist.
    UnknownVertex {
        /// The number of the edge that is wrong, counted from 0.
        edge: usize,
    },
    /// The edges do not lead around the solid: at this vertex of the outline no edge leads on.
    OutlineBroken {
        /// The number of the vertex, counted from 0.
        vertex: u32,
    },
    /// There is not enough working memory.
    Scratch(OutOfScratch),
    /// The sink had no room for another face or edge.
    SinkFull,
    /// The user cancelled the search.
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
