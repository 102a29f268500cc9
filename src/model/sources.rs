//! Vertices that a view makes of those of the model.

/// Tells of which vertices of a model the vertices are made that a view adds to them: the ends of a
/// curve's chords, of its control points, and the points where edges are cut, of the ends of these.
///
/// A vertex that is made of others lies in every plane, and on every line, that holds all of them.
pub trait VertexSources: Sync {
    /// Returns the number of the vertex of the model with this index, counted from 0, among those
    /// that the vertex `number` is made of; `None` beyond the last one.
    fn source(&self, number: usize, index: usize) -> Option<usize>;
}
