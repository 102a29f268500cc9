//! Polygons (`PM EP FP`), filled shapes (`RA RR WG`), and how they are filled (`FT PT`).
//!
//! A polygon is kept in a [`PolygonBuffer`], on a plotter of [`VERTICES`] points. As on
//! Hewlett-Packard's machines, filled rectangles and wedges use the same buffer, and what does not
//! fit sets error 7 (HP 7550A) and is not drawn at all. Inside is what an odd number of edges
//! surrounds. A fill is made line by line, each from edge to edge. A plotter keeps no list of
//! crossings: the next one is looked for among all edges. A buffer with more memory may list them.
//!
//! Sources: PCL 5 Printer Language Technical Reference Manual (Hewlett-Packard), part II, chapter
//! 21, "The Polygon Group": which points are joined, how subpolygons are closed, and what `EP` and
//! `FP` draw. Its `FT` and the `PT` of HP-GL give the fill types and their defaults.

use super::coordinates::{Point, UNIT, UNITS_PER_MM};
use super::interpreter::{Action, ErrorNumber, Interpreter, Step};
use super::outline::{ArcStep, sine_and_cosine};
use crate::fixed::{divide_rounding, product};

/// The most points of a polygon on a plotter, with those that close its parts. Each takes 8 bytes.
pub const VERTICES: usize = 256;
/// Coordinates of a vertex are kept without this many of their lowest bits: in 2^-6 plotter units.
const DROPPED_BITS: u32 = 10;
/// The angle of the chords of arcs in a polygon, if none is given: 5 degrees.
const CHORD: i64 = 5 * UNIT;
/// The width of the pen until `PT` sets it: 0.3 mm.
const THICKNESS: i64 = 3 * UNITS_PER_MM * UNIT / 10;
/// The least distance of the lines of a fill. Nearer ones would fall on the same steps.
const LEAST_PITCH: i64 = UNIT / 2;

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
    /// Where the pen was when polygon mode began.
    began_at: Point,
}

impl<B: PolygonBuffer> Polygon<B> {
    /// Creates an empty polygon. It consists of zero bits if the buffer does.
    pub(super) const fn new(buffer: B) -> Self {
        Self { buffer, count: 0, first: 0, is_open: false, is_full: false, began_at: Point::ZERO }
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

/// The style in which shapes are filled.
#[derive(Debug, Clone, Copy)]
pub(super) struct FillStyle {
    /// The fill type. 1 and 2: lines at the width of the pen, in both directions or in one. 3:
    /// parallel lines. 4: crossing lines.
    kind: u8,
    /// The distance of the lines of 3 and 4, on the page; 0 for 1 % of the distance of P1 and P2.
    spacing: i64,
    /// The direction of the lines of 3 and 4, in units of 2^-16 degrees.
    angle: i64,
    /// The width of the pen, on the page.
    thickness: i64,
}

impl FillStyle {
    /// Consists of zero bits.
    pub(super) const ZERO: Self = Self { kind: 0, spacing: 0, angle: 0, thickness: 0 };
    /// The default.
    pub(super) const DEFAULT: Self = Self { kind: 1, spacing: 0, angle: 0, thickness: THICKNESS };

    fn is_solid(self) -> bool {
        self.kind < 3
    }
}

/// The progress of a fill.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hatch {
    /// The sine and the cosine of the direction of the lines, in units of 2^-30.
    direction: [i64; 2],
    /// The distance of the line with index 0 to the left of the direction of the lines.
    base: i64,
    /// The distance of the lines.
    pitch: i64,
    /// The index of the present line, and of the last.
    line: i64,
    last: i64,
    /// The last crossing of the present line: where along the line, and the index of its edge.
    crossing: Option<(i64, usize)>,
    /// Whether the lines are those of the second direction, which cross the first ones.
    is_second: bool,
}

impl Hatch {
    /// Consists of zero bits.
    pub(super) const ZERO: Self = Self {
        direction: [0; 2],
        base: 0,
        pitch: 0,
        line: 0,
        last: 0,
        crossing: None,
        is_second: false,
    };

    /// Converts a point so that x runs along the lines, and y to the left of them.
    fn turned(&self, point: Point) -> Point {
        let [sine, cosine] = self.direction;
        point.rotated([-sine, cosine])
    }

    /// Returns where the line at `y` crosses an edge. Of the two ends of an edge, the lower one
    /// belongs to it.
    fn crosses(&self, y: i64, edge: [Point; 2]) -> Option<i64> {
        let [a, b] = edge.map(|point| self.turned(point));
        if (a.y <= y) == (b.y <= y) {
            return None;
        }
        let (from, to) = if a.y < b.y { (a, b) } else { (b, a) };
        let offset = divide_rounding(product(to.x - from.x, y - from.y), (to.y - from.y).into());
        Some(from.x + offset as i64) // It lies between both ends.
    }
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
                self.polygon.began_at = self.at;
                self.polygon.push(self.at, false);
            }
            1 | 2 if self.polygon.is_open => {
                self.polygon.close();
                if mode == 2 {
                    self.polygon.is_open = false;
                    self.at = self.polygon.began_at;
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
    pub(super) fn add_arc(&mut self, center: Point, sweep: i64, chord: Option<i64>) {
        let radius = self.at.minus(center);
        let arc = ArcStep::new(center, radius, sweep, chord.or(Some(CHORD)));
        for index in 0.. {
            let Some(to) = arc.chord(index).filter(|_| !self.polygon.is_full) else { return };
            self.add_vertex(to);
        }
    }

    /// `CI` in polygon mode: a subpolygon of its own. The pen then returns.
    pub(super) fn add_circle(&mut self, radius: i64, chord: Option<i64>) {
        let center = self.at;
        let Some(begin) = center.plus(self.frame.turned(Point { x: radius, y: 0 })) else {
            return self.overflow();
        };
        self.polygon.close();
        self.push_wedge(center, begin, 360 * UNIT, chord);
        self.polygon.close();
        self.at = center;
        if self.polygon.is_full {
            self.fail(ErrorNumber::BufferOverflow);
        }
    }

    /// Adds the points of an arc that begins there.
    fn push_wedge(&mut self, center: Point, begin: Point, sweep: i64, chord: Option<i64>) {
        let arc = ArcStep::new(center, begin.minus(center), sweep, chord.or(Some(CHORD)));
        let mut has_room = self.polygon.push(begin, true);
        for index in 0.. {
            let Some(to) = arc.chord(index).filter(|_| has_room) else { return };
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
        radius: i64,
        start: i64,
        sweep: i64,
        chord: Option<i64>,
    ) -> Result<(), ErrorNumber> {
        let center = self.at;
        let angle = sine_and_cosine(start as f64 / 65536.0);
        let radius = self.frame.turned(Point { x: radius, y: 0 }.rotated(angle));
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

    /// `FT`: how shapes are filled. Numbers that are left out keep their values.
    pub(super) fn choose_fill(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
        let thickness = self.fill.thickness;
        let [kind, rest @ ..] = numbers else {
            self.fill = FillStyle { thickness, ..FillStyle::DEFAULT };
            return Ok(());
        };
        let bad = ErrorNumber::BadParameter;
        let kind = u8::try_from(kind / UNIT).ok().filter(|kind| (1..=4).contains(kind));
        let mut fill = FillStyle { kind: kind.ok_or(bad)?, ..self.fill };
        // Solid fills have no spacing and no angle.
        if let Some(spacing) = rest.first().filter(|_| !fill.is_solid()) {
            let length = self.frame.length(Point { x: *spacing, y: 0 }).filter(|_| *spacing >= 0);
            fill.spacing = length.ok_or(bad)?.length();
        }
        if let Some(angle) = rest.get(1).filter(|_| !fill.is_solid()) {
            fill.angle = angle % (360 * UNIT);
        }
        if rest.len() > 2 {
            return Err(ErrorNumber::WrongCount);
        }
        self.fill = fill;
        Ok(())
    }

    /// `PT`: the width of the pen in millimetres, from 0.1 to 5.
    pub(super) fn choose_thickness(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
        self.fill.thickness = match *numbers {
            [] => THICKNESS,
            [millimetres] if (UNIT / 10..=5 * UNIT).contains(&millimetres) => {
                millimetres * UNITS_PER_MM
            }
            [_] => return Err(ErrorNumber::BadParameter),
            _ => return Err(ErrorNumber::WrongCount),
        };
        Ok(())
    }

    /// Begins the lines of a fill, or those that cross the first ones.
    fn begin_hatch(&mut self, is_second: bool) {
        let fill = self.fill;
        let quarters = i64::from(is_second) + i64::from(self.frame.quarters);
        let angle = if fill.is_solid() { 0 } else { fill.angle } + quarters * 90 * UNIT;
        let direction = sine_and_cosine(angle as f64 / 65536.0);
        let mut hatch = Hatch { direction, is_second, ..Hatch::ZERO };
        let (mut least, mut most) = (i64::MAX, i64::MIN);
        for (_, edge) in self.polygon.edges() {
            for point in edge {
                let y = hatch.turned(point).y;
                (least, most) = (least.min(y), most.max(y));
            }
        }
        if least < most {
            if fill.is_solid() {
                // The lines at the borders lie within them.
                let pitch = fill.thickness.max(LEAST_PITCH);
                let count = ((most - least + pitch - 1) / pitch).max(1);
                hatch.pitch = ((most - least) / count).max(1);
                hatch.base = least + hatch.pitch / 2;
            } else {
                let spacing =
                    if fill.spacing > 0 { fill.spacing } else { self.frame.percent(UNIT) };
                hatch.pitch = spacing.max(LEAST_PITCH);
            }
            // What lies beyond the window is not looked at.
            let bounds = self.frame.visible();
            let mut beyond = (i64::MAX, i64::MIN);
            for x in [bounds.least.x, bounds.most.x] {
                for y in [bounds.least.y, bounds.most.y] {
                    let y = hatch.turned(Point { x, y }).y;
                    beyond = (beyond.0.min(y), beyond.1.max(y));
                }
            }
            (least, most) = (least.max(beyond.0), most.min(beyond.1));
        }
        let count = self.polygon.count;
        self.polygon.buffer.begin_fill(|vertices, index| {
            let edge = edge(vertices, index).filter(|_| index < count)?;
            let [a, b] = edge.map(|point| hatch.turned(point).y);
            Some([a.min(b), a.max(b)])
        });
        let pitch = hatch.pitch.max(1);
        hatch.pitch = pitch;
        // The first line at `least` or above, and the last at `most` or below.
        hatch.line = -(hatch.base.saturating_sub(least)).div_euclid(pitch);
        hatch.last = most.saturating_sub(hatch.base).div_euclid(pitch);
        self.hatch = hatch;
    }

    /// Returns the next line of a fill; `None` if the shape is filled. [`Action::Nothing`] means
    /// that the line does not lie on the page, or that the search was interrupted because it took
    /// long.
    pub(super) fn next_of_fill(&mut self, is_first: bool) -> Option<Action> {
        if is_first {
            self.begin_hatch(false);
        }
        let hatch = self.hatch;
        if hatch.line > hatch.last {
            if self.fill.kind != 4 || hatch.is_second {
                return None;
            }
            self.begin_hatch(true);
            return Some(Action::Nothing);
        }
        let y = hatch.base + hatch.line * hatch.pitch;
        // Every other line is drawn backwards, but with fill type 2.
        let is_backward = self.fill.kind != 2 && hatch.line & 1 != 0;
        let begin = self.crossing_after(hatch.crossing, y, is_backward);
        let end = begin.and_then(|begin| self.crossing_after(Some(begin), y, is_backward));
        let (Some((from, _)), Some((to, _))) = (begin, end) else {
            self.hatch.line += 1;
            self.hatch.crossing = None;
            return Some(Action::Nothing);
        };
        self.hatch.crossing = end;
        let [from, to] = [from, to].map(|x| Point { x, y }.rotated(hatch.direction));
        if from == to {
            return Some(Action::Nothing);
        }
        if self.fill.is_solid() {
            return Some(self.ink([from, to]).unwrap_or(Action::Nothing));
        }
        self.at = from;
        self.draw_to(to);
        Some(Action::Nothing)
    }

    /// Returns the crossing of the line at `y` that follows another one, or the first one.
    fn crossing_after(
        &mut self,
        after: Option<(i64, usize)>,
        y: i64,
        is_backward: bool,
    ) -> Option<(i64, usize)> {
        let (hatch, count) = (self.hatch, self.polygon.count);
        let crossing = |vertices: &[Vertex], index| {
            hatch.crosses(y, edge(vertices, index).filter(|_| index < count)?)
        };
        if let Some(crossings) = self.polygon.buffer.crossings_at(y, crossing) {
            let passed = |limit: (i64, usize)| crossings.partition_point(|found| *found < limit);
            let index = match after {
                None if is_backward => crossings.len().checked_sub(1),
                None => Some(0),
                Some(after) if is_backward => passed(after).checked_sub(1),
                Some((x, index)) => Some(passed((x, index + 1))),
            };
            return crossings.get(index?).copied();
        }
        let is_before =
            |a: &(i64, usize), b: &(i64, usize)| if is_backward { a > b } else { a < b };
        let edges = self.polygon.edges();
        let crossings =
            edges.filter_map(|(index, edge)| Some((self.hatch.crosses(y, edge)?, index)));
        let behind = crossings.filter(|found| after.is_none_or(|after| is_before(&after, found)));
        behind.reduce(|best, found| if is_before(&found, &best) { found } else { best })
    }
}
