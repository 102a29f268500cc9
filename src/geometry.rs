//! Exact predicates on integers: orientation, which of two crossing lines is nearer, where along a line.
//!
//! (skeleton: the visibility work fills this in)

use bytemuck::{Pod, Zeroable};

/// View coordinates lie within ± this: products of three stay below 2^60.
pub const COORDINATE_LIMIT: i32 = 1 << 19;

/// A vertex in view coordinates: x right, y up, z the depth away from the eye.
///
/// Each within ±[`COORDINATE_LIMIT`]; in perspective z > 0 and the eye is the origin. The scales of
/// x, y and of z may differ (a linear map keeps every incidence).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// To the right.
    pub x: i32,
    /// Up.
    pub y: i32,
    /// Away from the eye.
    pub z: i32,
}

/// How a vertex gets onto the page: (x, y, w) with w = z, or w constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Projection {
    /// Lines of sight meet in the eye (the origin): w = z.
    Perspective,
    /// Lines of sight are parallel to z: w = 1.
    Parallel,
}
