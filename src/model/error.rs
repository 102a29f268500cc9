//! Why a model is not changed.

use super::ElementKind;
use crate::curve::CurveError;
use crate::stage::OutOfScratch;

/// Why the model was not changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ModelError {
    /// A coordinate is past ±2^30.
    CoordinateTooLarge,
    /// There is no room for another vertex.
    TooManyVertices {
        /// How many there can be.
        limit: usize,
    },
    /// There is no room for the corners of this element.
    TooManyCorners {
        /// How many there can be.
        limit: usize,
        /// How many there would have been.
        needed: usize,
    },
    /// An element names a vertex that does not exist.
    UnknownVertex {
        /// The number as the user wrote it: from 1, or negative and counted from the last.
        number: i32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A face needs three corners, a bar two.
    TooFewCorners {
        /// How many it needs.
        needed: usize,
    },
    /// The same vertex twice in a row, or at both ends.
    RepeatedVertex {
        /// The vertex, from 1.
        number: i32,
    },
    /// A curve needs its degree first.
    NoDegree,
    /// The curve before has no end.
    CurveUnfinished,
    /// Knots or an end without a curve.
    NoCurve,
    /// A parameter or knot is past ±2^22.
    KnotTooLarge,
    /// It is no curve.
    Curve(CurveError),
    /// An edit names a bar, face or curve that does not exist.
    UnknownElement {
        /// Which of them.
        part: ElementKind,
        /// The number as the user wrote it.
        number: i32,
        /// How many there are.
        count: usize,
    },
    /// The three vertices of a plane are in line.
    NoPlane,
    /// More names than pens, or a pen past [`PEN_LIMIT`](super::PEN_LIMIT).
    TooManyPens,
    /// Not enough working memory for the edit.
    Scratch(OutOfScratch),
}
