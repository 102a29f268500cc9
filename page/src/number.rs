//! The width of the numbers by which models refer to their vertices.

/// A number by which a model refers to a vertex: wide enough for any model. A board has numbers of
/// 16 bits; the drawing does not depend on the width.
pub type Number = u32;
