//! Polygons (`PM EP FP`) and filled shapes (`RA RR WG`).
//!
//! A polygon is kept in a [`PolygonBuffer`], on a plotter of [`VERTICES`] points. As on
//! Hewlett-Packard's machines, filled rectangles and wedges use the same buffer, and what does not
//! fit sets error 7 (HP 7550A) and is not drawn at all. Inside is what an odd number of edges
//! surrounds. `fill` makes the lines that fill it.
//!
//! Sources: PCL 5 Printer Language Technical Reference Manual (Hewlett-Packard), part II, chapter
//! 21, "The Polygon Group": which points are joined, how subpolygons are closed, and what `EP` and
//! `FP` draw.

mod fill;

pub(super) use fill::{FillStyle, Hatch};

use super::coordinates::{Point, UNIT};
use super::interpreter::{ErrorNumber, Interpreter, Step};
use super::outline::Chord;

/// The most points of a polygon on a plotter, with those that close its parts. Each takes 8 bytes.
pub const VERTICES: usize = 256;
/// Coordinates of a vertex are kept without this many of their lowest bits: in 2^-6 plotter units.
const DROPPED_BITS: u32 = 10;
/// The angle of the chords of arcs in a polygon, if none is given: 5 degrees.
const CHORD: Chord = Chord::Angle(5 * UNIT);

/// A point of a polygon.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// x in units of 2^-6 plotter units, times 2, plus 1 if the point begins a subpolygon.
    x: i32,
    /// y in the same way, plus 1 if the edge to the point is drawn by `EP`.
    y: i32,
}

impl Vertex {
    /// Consists of zero bits.
    pub const ZERO: Self = Self { x: 0, y: 0 };

    fn new(at: Point, begins: bool, is_drawn: bool) -> Self {
        // Coordinates are below 2^40 in units of 2^-16, so below 2^31 here.
        let packed = |coordinate: i64, flag: bool| {
            ((coordinate >> DROPPED_BITS) as i32) << 1 | i32::from(flag)
        };
        Self { x: packed(at.x, begins), y: packed(at.y, is_drawn) }
    }

    fn at(self) -> Point {
        let [x, y] = [self.x, self.y].map(|packed| i64::from(packed >> 1) << DROPPED_BITS);
        Point { x, y }
    }

    fn begins(self) -> bool {
        self.x & 1 != 0
    }

    fn is_drawn(self) -> bool {
        self.y & 1 != 0
    }
}

/// The memory for the points of a polygon.
pub trait PolygonBuffer {
    /// The points, from the first one.
    fn vertices(&self) -> &[Vertex];

    /// Sets the point with this index. Earlier points have been set, and later ones are no longer
    /// needed. Returns whether there is room for it.
    fn put(&mut self, index: usize, vertex: Vertex) -> bool;

    /// Begins the lines of a fill. `span` gives, for the edge that ends at the point with an index,
    /// how far the edge is below and above the lines, if there is such an edge.
    fn begin_fill(&mut self, span: impl Fn(&[Vertex], usize) -> Option<[i64; 2]>) {
        let _ = span;
    }

    /// All crossings of the edges with the line at `y`: where along the line, and the index of the
    /// edge's end, in ascending order. `crossing` gives that of one edge. `y` never decreases
    /// until the next fill begins. A buffer without memory for such a list returns `None`.
    fn crossings_at(
        &mut self,
        y: i64,
        crossing: impl Fn(&[Vertex], usize) -> Option<i64>,
    ) -> Option<&[(i64, usize)]> {
        let _ = (y, crossing);
        None
    }
}

impl<const POINTS: usize> PolygonBuffer for [Vertex; POINTS] {
    fn vertices(&self) -> &[Vertex] {
        self
    }

    fn put(&mut self, index: usize, vertex: Vertex) -> bool {
        self.get_mut(index).map(|slot| *slot = vertex).is_some()
    }
}

/// A polygon.
#[derive(Debug)]
pub(super) struct Polygon<B> {
    buffer: B,
    count: usize,
    /// The index of the first point of the subpolygon that is being defined.
    first: usize,
    /// Whether polygon mode is on.
    pub(super) is_open: bool,
    /// Whether points did not fit.
    is_full: bool,
    /// Where the pen was when polygon mode began, and whether it was down.
    began_at: Point,
    began_down: bool,
}

impl<B: PolygonBuffer> Polygon<B> {
    /// Creates an empty polygon. It consists of zero bits if the buffer does.
    pub(super) const fn new(buffer: B) -> Self {
        let (is_open, is_full, began_down) = (false, false, false);
        Self { buffer, count: 0, first: 0, is_open, is_full, began_at: Point::ZERO, began_down }
    }

    /// Forgets the polygon, and ends polygon mode.
    pub(super) fn clear(&mut self) {
        (self.count, self.first, self.is_open, self.is_full) = (0, 0, false, false);
    }

    /// Adds a point. Returns whether there was room for it.
    fn push(&mut self, at: Point, is_drawn: bool) -> bool {
        let begins = self.count == self.first;
        if !self.is_full && self.buffer.put(self.count, Vertex::new(at, begins, is_drawn)) {
            self.count += 1;
        } else {
            self.is_full = true;
        }
        !self.is_full
    }

    /// Closes the subpolygon that is being defined. A single point is no subpolygon.
    fn close(&mut self) {
        let vertices = self.buffer.vertices();
        let [first, last] =
            [self.first, self.count.wrapping_sub(1)].map(|index| vertices.get(index).copied());
        match (first, last) {
            (Some(first), Some(last)) if self.count >= self.first + 2 => {
                if first.at() != last.at() {
                    self.push(first.at(), last.is_drawn());
                }
            }
            _ => self.count = self.first,
        }
        self.first = self.count;
    }

    /// All edges, with the index of each.
    fn edges(&self) -> impl Iterator<Item = (usize, [Point; 2])> {
        let vertices = self.buffer.vertices();
        (1..self.count).filter_map(|index| Some((index, edge(vertices, index)?)))
    }
}

/// The edge that ends at the point with this index, if one does.
fn edge(vertices: &[Vertex], index: usize) -> Option<[Point; 2]> {
    let end = vertices.get(index).filter(|end| !end.begins())?;
    let begin = vertices.get(index.checked_sub(1)?)?;
    Some([begin.at(), end.at()])
}

impl<B: PolygonBuffer> Interpreter<B> {
    /// `PM`: begins polygon mode, closes a subpolygon, or ends polygon mode.
    pub(super) fn polygon_mode(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
        let mode = match *numbers {
            [] => 0,
            [mode] => mode / UNIT,
            _ => return Err(ErrorNumber::WrongCount),
        };
        match mode {
            0 => {
                self.polygon.clear();
                self.polygon.is_open = true;
                (self.polygon.began_at, self.polygon.began_down) = (self.at, self.is_down);
                self.polygon.push(self.at, false);
            }
            1 | 2 if self.polygon.is_open => {
                self.polygon.close();
                if mode == 2 {
                    self.polygon.is_open = false;
                    (self.at, self.is_down) = (self.polygon.began_at, self.polygon.began_down);
                }
                self.check_polygon()?;
            }
            1 | 2 => return Err(ErrorNumber::Unknown),
            _ => return Err(ErrorNumber::BadParameter),
        }
        Ok(())
    }

    /// Adds a point to the polygon, whose mode is on.
    pub(super) fn add_vertex(&mut self, to: Point) {
        self.at = to;
        if !self.polygon.push(to, self.is_down) {
            self.fail(ErrorNumber::BufferOverflow);
        }
    }

    /// `AA` and `AR` in polygon mode: an arc about a centre.
    pub(super) fn add_arc(&mut self, center: Point, sweep: i64, chord: Option<Chord>) {
        let radius = self.at.minus(center);
        let Some(arc) = self.arc_about(center, radius, sweep, chord.or(Some(CHORD))) else {
            return self.overflow();
        };
        for index in 0.. {
            let Some(to) = arc.chord(index, &self.frame).filter(|_| !self.polygon.is_full) else {
                return;
            };
            self.add_vertex(to);
        }
    }

    /// `CI` in polygon mode: a subpolygon of its own. The pen then returns.
    pub(super) fn add_circle(&mut self, radius: Point, chord: Option<Chord>) {
        let center = self.at;
        let Some(begin) = center.plus(radius) else { return self.overflow() };
        self.polygon.close();
        self.push_wedge(center, begin, 360 * UNIT, chord);
        self.polygon.close();
        self.at = center;
        if self.polygon.is_full {
            self.fail(ErrorNumber::BufferOverflow);
        }
    }

    /// Adds the points of an arc that begins there.
    fn push_wedge(&mut self, center: Point, begin: Point, sweep: i64, chord: Option<Chord>) {
        let radius = begin.minus(center);
        let Some(arc) = self.arc_about(center, radius, sweep, chord.or(Some(CHORD))) else {
            return self.overflow();
        };
        let mut has_room = self.polygon.push(begin, true);
        for index in 0.. {
            let Some(to) = arc.chord(index, &self.frame).filter(|_| has_room) else { return };
            has_room = self.polygon.push(to, true);
        }
    }

    /// `RA` and `RR`: a filled rectangle from the pen to the opposite corner.
    pub(super) fn fill_rectangle(&mut self, corner: Point) -> Result<(), ErrorNumber> {
        let at = self.at;
        self.polygon.clear();
        for point in [at, Point { x: corner.x, y: at.y }, corner, Point { x: at.x, y: corner.y }] {
            self.polygon.push(point, true);
        }
        self.polygon.close();
        self.fill_polygon()
    }

    /// `WG`: a filled wedge about the pen.
    pub(super) fn fill_wedge(
        &mut self,
        radius: Point,
        sweep: i64,
        chord: Option<Chord>,
    ) -> Result<(), ErrorNumber> {
        let center = self.at;
        let begin = center.plus(radius).ok_or(ErrorNumber::Overflow)?;
        self.polygon.clear();
        self.polygon.push(center, true);
        self.push_wedge(center, begin, sweep, chord);
        self.polygon.close();
        self.fill_polygon()
    }

    /// Checks that the polygon has fitted. Otherwise it is discarded, because a part of it would be
    /// another shape.
    fn check_polygon(&mut self) -> Result<(), ErrorNumber> {
        if !self.polygon.is_full {
            return Ok(());
        }
        let is_open = self.polygon.is_open;
        if !is_open {
            self.polygon.clear();
        }
        Err(ErrorNumber::BufferOverflow)
    }

    /// `FP`: fills the polygon.
    pub(super) fn fill_polygon(&mut self) -> Result<(), ErrorNumber> {
        self.check_polygon()?;
        self.hatch = Hatch::ZERO;
        self.add(Step::Fill);
        self.add(Step::Place(self.at));
        Ok(())
    }

    /// `EP`: draws the edges of the polygon that were defined with the pen down.
    pub(super) fn edge_polygon(&mut self) {
        self.add(Step::Edges);
        self.add(Step::Place(self.at));
    }

    /// Returns the edge of the polygon with this index: whether it is drawn, and its end. `None`
    /// after the last edge.
    pub(super) fn polygon_edge(&self, index: u32) -> Option<(bool, Point)> {
        let vertices = self.polygon.buffer.vertices().get(..self.polygon.count)?;
        let vertex = vertices.get(index as usize)?;
        Some((vertex.is_drawn() && !vertex.begins(), vertex.at()))
    }
}
