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
        /// The greatest number of vertices.
        limit: usize,
    },
    /// There is no room for the corners of this element.
    TooManyCorners {
        /// The greatest number of corners.
        limit: usize,
        /// The number of corners there would have been.
        needed: usize,
    },
    /// An element names a vertex that does not exist.
    UnknownVertex {
        /// The number as the user wrote it: from 1, or negative and counted from the last.
        number: i32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An element has too few corners: a face needs three, a bar two.
    TooFewCorners {
        /// The number of corners that it needs.
        needed: usize,
    },
    /// A vertex occurs twice in a row, or at both ends of a face.
    RepeatedVertex {
        /// The number of the vertex as the user wrote it.
        number: i32,
    },
    /// A curve begins before its degree was set.
    NoDegree,
    /// The curve before has not been completed.
    CurveUnfinished,
    /// Knots or an end came without a curve.
    NoCurve,
    /// A parameter or knot is beyond ±2^22.
    KnotTooLarge,
    /// The degree, the knots or the ends do not form a curve.
    Curve(CurveError),
    /// An edit names a bar, face or curve that does not exist.
    UnknownElement {
        /// The kind of the element.
        part: ElementKind,
        /// The number as the user wrote it.
        number: i32,
        /// The number of elements of this kind.
        count: usize,
    },
    /// The three vertices that should define a plane are collinear.
    NoPlane,
    /// There are more names than pens, or a pen number is not below
    /// [`PEN_LIMIT`](super::PEN_LIMIT).
    TooManyPens,
    /// There is not enough working memory for the edit.
    Scratch(OutOfScratch),
}
