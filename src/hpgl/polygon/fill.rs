//! How polygons are filled: `FT`, `PT`, and the lines of a fill.
//!
//! A fill is made line by line, each from edge to edge. A plotter keeps no list of crossings: the
//! next one is looked for among all edges. A buffer with more memory may list them.
//!
//! Sources: `FT` of the PCL 5 Printer Language Technical Reference Manual (Hewlett-Packard) and the
//! `PT` of HP-GL give the fill types and their defaults.

use super::{PolygonBuffer, Vertex, edge};
use crate::fixed::{divide_rounding, product};
use crate::hpgl::coordinates::{Point, UNIT, UNITS_PER_MM};
use crate::hpgl::interpreter::{Action, ErrorNumber, Interpreter};
use crate::hpgl::outline::sine_and_cosine;

/// The width of the pen until `PT` sets it: 0.3 mm.
const THICKNESS: i64 = 3 * UNITS_PER_MM * UNIT / 10;

/// The least distance of the lines of a fill. Nearer ones would fall on the same steps.
const LEAST_PITCH: i64 = UNIT / 2;

/// The style in which shapes are filled.
#[derive(Debug, Clone, Copy)]
pub(in crate::hpgl) struct FillStyle {
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
    pub(in crate::hpgl) const ZERO: Self = Self { kind: 0, spacing: 0, angle: 0, thickness: 0 };
    /// The default.
    pub(in crate::hpgl) const DEFAULT: Self =
        Self { kind: 1, spacing: 0, angle: 0, thickness: THICKNESS };

    fn is_solid(self) -> bool {
        self.kind < 3
    }
}

/// The progress of a fill.
#[derive(Debug, Clone, Copy)]
pub(in crate::hpgl) struct Hatch {
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
    pub(in crate::hpgl) const ZERO: Self = Self {
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
    /// `FT`: how shapes are filled. Numbers that are left out keep their values.
    pub(in crate::hpgl) fn choose_fill(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
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
    pub(in crate::hpgl) fn choose_thickness(&mut self, numbers: &[i64]) -> Result<(), ErrorNumber> {
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
    pub(in crate::hpgl) fn next_of_fill(&mut self, is_first: bool) -> Option<Action> {
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
