//! The errors that leave a model unchanged.

use super::ElementKind;
use crate::curve::CurveError;
use crate::stage::OutOfScratch;

/// The reasons why the model was not changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ModelError {
    /// A coordinate is beyond ±2^30.
    CoordinateTooLarge,
    /// There is no room for another vertex.
    TooManyVertices {
        /// The greatest number of vertices that the model can hold.
        limit: usize,
    },
    /// There is no room for the corners of this element.
    TooManyCorners {
        /// The greatest number of corners (and of other data of this size) that the model can hold.
        limit: usize,
        /// The number of corners that the model would have had with the element.
        needed: usize,
    },
    /// An element names a vertex that does not exist.
    UnknownVertex {
        /// The number as the user wrote it: from 1, or negative and counted from the last.
        number: i32,
        /// The number of vertices that the model has.
        vertices: usize,
    },
    /// An element has too few corners: a face needs three, a bar two.
    TooFewCorners {
        /// The number of corners that an element of this kind needs.
        needed: usize,
    },
    /// A vertex occurs twice in a row, or at both ends of a face.
    RepeatedVertex {
        /// The number of the vertex as the user wrote it.
        number: i32,
    },
    /// A curve begins before the user has set its degree.
    NoDegree,
    /// A curve begins before the one before it was completed.
    CurveUnfinished,
    /// Knots or the end of a curve came although none has begun.
    NoCurve,
    /// A parameter or knot is beyond ±2^22.
    KnotTooLarge,
    /// The degree, the knots or the ends do not form a curve.
    Curve(CurveError),
    /// An edit names a bar, face or curve that does not exist.
    UnknownElement {
        /// Whether it would be a bar, a face or a curve.
        part: ElementKind,
        /// The number by which the user named the element that does not exist.
        number: i32,
        /// The number of elements of this kind that the model has.
        count: usize,
    },
    /// The three vertices that should define a plane are collinear.
    NoPlane,
    /// There are more names than pens, or a pen number is not below
    /// [`PEN_LIMIT`](super::PEN_LIMIT).
    TooManyPens,
    /// The flash has no room for another part of the model.
    #[cfg(feature = "tiles")]
    StoreFull {
        /// The number of vertices that it holds.
        vertices: usize,
        /// The number of corners of faces and ends of bars that it holds.
        corners: usize,
    },
    /// There is not enough working memory for the edit.
    Scratch(OutOfScratch),
}
