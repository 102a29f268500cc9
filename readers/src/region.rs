//! Areas of any form, and what they leave of lines.
//!
//! A region is the union of parts, each of which is what its outlines surround by the rule of
//! filling. The parts of a mask lie on each other instead: a dark one hides what those below let
//! through, and the region is where at least half of the light comes through. Whether a line is
//! inside is asked of the middle of each of its pieces between two crossings, so no crossing is
//! ever taken for an entry or an exit. A line along the border is inside.

#![cfg_attr(not(feature = "svg"), expect(dead_code, reason = "only SVG files have clip paths"))]

mod mapped;

use crate::plan::Point;
pub(crate) use mapped::MappedRegions;
use std::cell::RefCell;
use std::collections::HashSet;
use std::sync::Arc;

/// How far outside of a region a line may lie without being cut, in mm: less than is written.
const TOLERANCE: f64 = 1e-4;

/// The length in mm below which what is left of a line is left out: it would be a dot.
const SHORTEST: f64 = 0.002;

/// The most rows in which the sides of a part are found.
const MOST_ROWS: usize = 4096;

/// The number of tests of a side that take as long as a point of a curve.
const TESTS: usize = 64;

/// The least part of the light that comes through a mask where it hides nothing: a half, less what
/// single precision adds.
const HALF: f64 = 0.5 - 1e-6;

/// The work is more than the budget.
#[derive(Debug)]
pub(crate) struct TooMuch;

/// What a part of a mask adds to those below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shade {
    /// The light that comes through where the part is opaque, 0 to 1.
    pub(crate) light: f64,
    /// How much of the parts below it the part covers, 0 to 1.
    pub(crate) alpha: f64,
}

impl Shade {
    /// A part that lets all light through, whatever lies below.
    pub(crate) const CLEAR: Self = Self { light: 1.0, alpha: 1.0 };
}

/// The union of some parts, or what some parts of a mask let through.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Region {
    parts: Vec<ShadedArea>,
}

/// The area that some outlines surround within other regions, and its shade in a mask.
#[derive(Debug, Clone, PartialEq)]
struct ShadedArea {
    outlines: Vec<Vec<Point>>,
    is_even_odd: bool,
    within: Vec<Arc<Region>>,
    shade: Shade,
    sides: Vec<[Point; 2]>,
    /// The sides that reach into each row, and the least y and the height of the rows.
    rows: Vec<Vec<u32>>,
    low: f64,
    row: f64,
    /// The least and the greatest x.
    width: [f64; 2],
}

impl Region {
    /// Adds what `outlines` surround: an odd number of them, or else in sum. The side from the last
    /// point of an outline to its first belongs to it.
    pub(crate) fn add(
        &mut self,
        outlines: Vec<Vec<Point>>,
        is_even_odd: bool,
        within: Vec<Arc<Region>>,
    ) {
        self.add_shade(outlines, is_even_odd, within, Shade::CLEAR);
    }

    /// Lays a part of a mask on those that were added before; see [`Region::add`].
    pub(crate) fn add_shade(
        &mut self,
        outlines: Vec<Vec<Point>>,
        is_even_odd: bool,
        within: Vec<Arc<Region>>,
        shade: Shade,
    ) {
        self.parts.push(ShadedArea { shade, ..ShadedArea::new(outlines, is_even_odd, within) });
    }

    /// Whether a point is inside. On the border the result may be either.
    pub(crate) fn contains(&self, point: Point) -> bool {
        let (mut light, mut uncovered) = (0.0, 1.0);
        for part in self.parts.iter().rev().filter(|part| part.contains(point)) {
            light += uncovered * part.shade.alpha * part.shade.light;
            uncovered *= 1.0 - part.shade.alpha;
            if uncovered == 0.0 {
                break;
            }
        }
        light >= HALF
    }

    /// Whether a line through `point` is inside, to whose left `left` leads by [`TOLERANCE`].
    fn contains_line(&self, point: Point, left: Point) -> bool {
        self.contains(point) || beside(point, left).iter().any(|point| self.contains(*point))
    }

    /// All outlines, those of the regions that bound the parts included.
    fn outlines(&self) -> Vec<&[Point]> {
        let own = self.parts.iter().flat_map(|part| part.outlines.iter().map(Vec::as_slice));
        let bounds = self.parts.iter().flat_map(|part| &part.within);
        own.chain(bounds.flat_map(|region| region.outlines())).collect()
    }

    /// Appends where the line crosses sides, as parts of its length.
    fn crossings(&self, line: [Point; 2], at: &mut Vec<f64>, budget: &mut usize) -> Option<()> {
        for part in &self.parts {
            part.crossings(line, at, budget)?;
            for region in &part.within {
                region.crossings(line, at, budget)?;
            }
        }
        Some(())
    }
}

impl ShadedArea {
    fn new(mut outlines: Vec<Vec<Point>>, is_even_odd: bool, within: Vec<Arc<Region>>) -> Self {
        for outline in &mut outlines {
            if outline.first() != outline.last() {
                outline.extend(outline.first().copied());
            }
        }
        let sides: Vec<[Point; 2]> = outlines.iter().flat_map(|outline| pairs(outline)).collect();
        let heights = || sides.iter().flatten().map(|point| point[1]);
        let low = heights().fold(f64::INFINITY, f64::min);
        let high = heights().fold(f64::NEG_INFINITY, f64::max);
        let count = (sides.len() / 2).clamp(1, MOST_ROWS);
        // A part without height has one row.
        let row = ((high - low) / count as f64).max(f64::MIN_POSITIVE);
        let (shade, rows) = (Shade::CLEAR, Vec::new());
        let places = || sides.iter().flatten().map(|point| point[0]);
        let width = [
            places().fold(f64::INFINITY, f64::min) - TOLERANCE,
            places().fold(f64::NEG_INFINITY, f64::max) + TOLERANCE,
        ];
        let mut part = Self { outlines, is_even_odd, within, shade, sides, rows, low, row, width };
        let mut rows = vec![Vec::new(); count];
        for (number, [from, to]) in (0..).zip(&part.sides) {
            let range = part.rows_between(from[1].min(to[1]), from[1].max(to[1]), count);
            rows.get_mut(range)
                .into_iter()
                .flatten()
                .for_each(|row: &mut Vec<u32>| row.push(number));
        }
        part.rows = rows;
        part
    }

    /// The rows that lie between two heights, of `count`.
    fn rows_between(&self, low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
        // A height beyond the rows gives a negative number, or saturates.
        let number = |height: f64| ((height - self.low) / self.row).floor();
        if number(high) < 0.0 || number(low) > count as f64 {
            return 0..0;
        }
        let first = (number(low).max(0.0) as usize).min(count.saturating_sub(1));
        first..(number(high) as usize).saturating_add(1).min(count)
    }

    fn contains(&self, point: Point) -> bool {
        if !(self.width[0]..=self.width[1]).contains(&point[0]) {
            return false;
        }
        let rows = self.rows_between(point[1], point[1], self.rows.len());
        let sides = self.rows.get(rows.start).filter(|_| !rows.is_empty()).into_iter().flatten();
        let mut turns = 0_i32;
        for side in sides.filter_map(|number| self.sides.get(*number as usize)) {
            let [from, to] = *side;
            let upward = from[1] <= point[1] && point[1] < to[1];
            let downward = to[1] <= point[1] && point[1] < from[1];
            if upward || downward {
                let part = (point[1] - from[1]) / (to[1] - from[1]);
                if from[0] + part * (to[0] - from[0]) > point[0] {
                    turns += if upward { 1 } else { -1 };
                }
            }
        }
        let is_inside = if self.is_even_odd { turns % 2 != 0 } else { turns != 0 };
        is_inside && self.within.iter().all(|region| region.contains(point))
    }

    fn crossings(
        &self,
        [from, to]: [Point; 2],
        at: &mut Vec<f64>,
        budget: &mut usize,
    ) -> Option<()> {
        if from[0].max(to[0]) < self.width[0] || from[0].min(to[0]) > self.width[1] {
            return Some(());
        }
        let direction = minus(to, from);
        let square = dot(direction, direction);
        let (low, high) = (from[1].min(to[1]) - TOLERANCE, from[1].max(to[1]) + TOLERANCE);
        for row in self.rows.get(self.rows_between(low, high, self.rows.len()))? {
            *budget = budget.checked_sub(1 + row.len() / TESTS)?;
            for &[begin, end] in row.iter().filter_map(|number| self.sides.get(*number as usize)) {
                let side = minus(end, begin);
                let to_begin = minus(begin, from);
                let across = cross(direction, side);
                // If both lie in one line, the ends of the side divide it.
                for corner in [begin, end] {
                    let to_corner = minus(corner, from);
                    if cross(direction, to_corner).abs() <= TOLERANCE * square.sqrt() {
                        at.push(dot(to_corner, direction) / square);
                    }
                }
                let along_side = cross(to_begin, direction) / across;
                if across != 0.0 && (0.0..=1.0).contains(&along_side) {
                    at.push(cross(to_begin, side) / across);
                }
            }
        }
        Some(())
    }
}

/// What lies inside all of these regions.
#[derive(Debug, Clone, Default)]
pub(crate) struct Regions(pub(crate) Vec<Arc<Region>>);

impl Regions {
    /// Whether a point is inside. On the border the result may be either.
    pub(crate) fn contain(&self, point: Point) -> bool {
        self.0.iter().all(|region| region.contains(point))
    }

    /// The parts of a polyline that are inside.
    ///
    /// # Errors
    /// The work is more than the budget.
    pub(crate) fn cut(
        &self,
        points: &[Point],
        budget: &mut usize,
    ) -> Result<Vec<Vec<Point>>, TooMuch> {
        if self.0.is_empty() {
            return Ok(vec![points.to_vec()]);
        }
        let keeps = |at, left| self.0.iter().all(|region| region.contains_line(at, left));
        pieces(points, &self.0, keeps, budget)
    }

    /// The parts of the borders of the regions that lie within `shape` and are borders of what is
    /// inside `shape` and all of them. What the outline of `shape` has is left out, and so is where
    /// `is_free` says so of both sides of a border.
    ///
    /// # Errors
    /// The work is more than the budget.
    pub(crate) fn borders_within(
        &self,
        shape: &Arc<Region>,
        is_free: impl Fn(Point) -> bool,
        budget: &mut usize,
    ) -> Result<Vec<Vec<Point>>, TooMuch> {
        let mut borders = Vec::new();
        let mut all = self.0.clone();
        all.push(shape.clone());
        for (number, region) in self.0.iter().enumerate() {
            // Where two borders lie on each other, the first one counts.
            let (before, others) = self.0.split_at(number);
            // So it is where two parts of the same region have one border.
            let found = RefCell::new(HashSet::new());
            let keeps = |at: Point, left: Point| {
                let both = beside(at, left);
                let is_inside = both
                    .iter()
                    .all(|it| shape.contains(*it) && before.iter().all(|area| area.contains(*it)));
                let [one, other] = both.map(|it| others.iter().all(|area| area.contains(it)));
                is_inside
                    && one != other
                    && !both.into_iter().any(&is_free)
                    && found.borrow_mut().insert(cell(at, left))
            };
            for outline in region.outlines() {
                borders.extend(pieces(outline, &all, keeps, budget)?);
            }
        }
        Ok(borders)
    }
}

/// The pieces of a polyline for which `keeps` is true. It is asked for the middle of each piece
/// between two crossings with the regions, and is given what leads to the left of the line by
/// [`TOLERANCE`].
fn pieces(
    points: &[Point],
    regions: &[Arc<Region>],
    keeps: impl Fn(Point, Point) -> bool,
    budget: &mut usize,
) -> Result<Vec<Vec<Point>>, TooMuch> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let mut is_going_on = false;
    let mut at = Vec::new();
    for [from, to] in pairs(points) {
        let direction = minus(to, from);
        let length = direction[0].hypot(direction[1]);
        if length == 0.0 {
            continue;
        }
        let left = [-direction[1] / length * TOLERANCE, direction[0] / length * TOLERANCE];
        at.clear();
        for region in regions {
            region.crossings([from, to], &mut at, budget).ok_or(TooMuch)?;
        }
        at.retain(|part| (0.0..=1.0).contains(part));
        at.extend([0.0, 1.0]);
        at.sort_by(f64::total_cmp);
        at.dedup();
        let point = |part: f64| match part {
            0.0 => from,
            1.0 => to,
            _ => [from[0] + part * direction[0], from[1] + part * direction[1]],
        };
        for part in at.windows(2) {
            let &[begin, end] = part else { continue };
            *budget = budget.checked_sub(1).ok_or(TooMuch)?;
            let is_kept = keeps(point(f64::midpoint(begin, end)), left);
            match pieces.last_mut() {
                Some(piece) if is_kept && is_going_on => {
                    if begin > 0.0 {
                        piece.pop();
                    }
                    piece.push(point(end));
                }
                _ if is_kept => pieces.push(vec![point(begin), point(end)]),
                _ => {}
            }
            is_going_on = is_kept;
        }
    }
    // A closed line that begins inside goes on at its end where it began.
    if points.first() == points.last()
        && pieces.len() > 1
        && pieces.first().and_then(|piece| piece.first()) == points.first()
        && pieces.last().and_then(|piece| piece.last()) == points.first()
        && let Some(mut last) = pieces.pop()
        && let Some(first) = pieces.first_mut()
    {
        last.extend(first.drain(..).skip(1));
        *first = last;
    }
    let is_whole = matches!(pieces.as_slice(), [piece] if piece.len() >= points.len());
    pieces.retain(|piece| is_whole || length(piece) >= SHORTEST);
    Ok(pieces)
}

/// The length of a polyline.
pub(crate) fn length(points: &[Point]) -> f64 {
    pairs(points).map(|[from, to]| (to[0] - from[0]).hypot(to[1] - from[1])).sum()
}

/// The lines of a polyline.
fn pairs(points: &[Point]) -> impl Iterator<Item = [Point; 2]> {
    points.iter().zip(points.iter().skip(1)).map(|(from, to)| [*from, *to])
}

/// The points to the left and to the right of a line through `point`.
fn beside(point: Point, left: Point) -> [Point; 2] {
    [[point[0] + left[0], point[1] + left[1]], minus(point, left)]
}

/// Returns a key that is the same for two lines through a point in the same direction or its
/// opposite.
fn cell(point: Point, left: Point) -> [i64; 4] {
    let sign = if (left[0], left[1]) < (0.0, 0.0) { -1.0 } else { 1.0 };
    let direction = left.map(|part| (sign * part / TOLERANCE * 1e3).round() as i64);
    let place = point.map(|part| (part / TOLERANCE).round() as i64);
    [place[0], place[1], direction[0], direction[1]]
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polygon as a region.
    fn region(outlines: &[&[Point]], is_even_odd: bool) -> Arc<Region> {
        let mut region = Region::default();
        let outlines = outlines.iter().map(|outline| outline.to_vec()).collect();
        region.add(outlines, is_even_odd, Vec::new());
        Arc::new(region)
    }

    fn square(low: f64, high: f64) -> [Point; 4] {
        [[low, low], [high, low], [high, high], [low, high]]
    }

    fn cut(points: &[Point], regions: &[&Arc<Region>]) -> Vec<Vec<Point>> {
        let regions = Regions(regions.iter().map(|region| (*region).clone()).collect());
        regions.cut(points, &mut 100_000).expect("little work")
    }

    #[test]
    fn a_line_is_cut_at_holes_by_the_rule_of_filling() {
        let line = [[-1.0, 5.0], [11.0, 5.0]];
        let both = [&square(0.0, 10.0)[..], &square(4.0, 6.0)];
        let (left, right) = (vec![[0.0, 5.0], [4.0, 5.0]], vec![[6.0, 5.0], [10.0, 5.0]]);
        assert_eq!(cut(&line, &[&region(&both, true)]), [left, right]);
        assert_eq!(cut(&line, &[&region(&both, false)]), [[[0.0, 5.0], [10.0, 5.0]]]);
        let other = region(&[&square(5.0, 20.0)], false);
        assert_eq!(cut(&line, &[&region(&both, false), &other]), [[[5.0, 5.0], [10.0, 5.0]]]);
        assert!(cut(&line, &[&Arc::default()]).is_empty(), "nothing is inside nothing");
    }

    #[test]
    fn a_line_on_the_border_is_inside_whatever_its_direction() {
        let square = region(&[&square(0.0, 10.0)], false);
        for line in [[[-3.0, 0.0], [13.0, 0.0]], [[-3.0, 10.0], [13.0, 10.0]]] {
            let [mut from, mut to] = line;
            (from[0], to[0]) = (0.0, 10.0);
            assert_eq!(cut(&line, &[&square]), [[from, to]]);
            assert_eq!(cut(&[line[1], line[0]], &[&square]), [[to, from]]);
        }
        // It may go on inside and leave.
        let bent = [[0.0, 0.0], [0.0, 5.0], [5.0, 5.0], [15.0, 5.0]];
        assert_eq!(cut(&bent, &[&square]), [[[0.0, 0.0], [0.0, 5.0], [5.0, 5.0], [10.0, 5.0]]]);
    }

    /// Lines in any direction through a star: as much of them is inside as of many points.
    #[test]
    fn as_much_of_a_line_is_left_as_of_its_points() {
        let corner = |number: u32| {
            let (sine, cosine) = (f64::from(number) * 2.0 * std::f64::consts::TAU / 5.0).sin_cos();
            [8.0 * sine, 8.0 * cosine]
        };
        let star: Vec<Point> = (0..5).map(corner).collect();
        for is_even_odd in [false, true] {
            let star = region(&[&star], is_even_odd);
            for number in 0..50 {
                let (sine, cosine) = (f64::from(number) * 0.7).sin_cos();
                let middle = [f64::from(number % 7) - 3.0, f64::from(number % 5) - 2.0];
                let end =
                    |direction: f64| [middle[0] + direction * cosine, middle[1] + direction * sine];
                let ink: f64 =
                    cut(&[end(-20.0), end(20.0)], &[&star]).iter().map(|it| length(it)).sum();
                let inside =
                    (0..40_000).filter(|it| star.contains(end(f64::from(*it) / 1000.0 - 20.0)));
                assert!((ink - inside.count() as f64 / 1000.0).abs() < 0.02, "{number}");
            }
        }
    }

    #[test]
    fn the_border_within_a_shape_is_that_of_both() {
        let shape = region(&[&square(0.0, 10.0)], false);
        let borders = |regions: &[&Arc<Region>]| {
            let regions = Regions(regions.iter().map(|region| (*region).clone()).collect());
            regions.borders_within(&shape, |_| false, &mut 100_000).expect("little work")
        };
        let beyond = region(&[&[[5.0, 5.0], [20.0, 5.0], [20.0, 20.0], [5.0, 20.0]]], false);
        assert_eq!(borders(&[&beyond]), [[[5.0, 10.0], [5.0, 5.0], [10.0, 5.0]]]);
        assert!(borders(&[&shape]).is_empty(), "its outline has it");
        let twice = borders(&[&beyond, &beyond]);
        assert_eq!(twice, borders(&[&beyond]), "a border that two regions share counts once");
    }

    #[test]
    fn more_work_than_the_budget_is_an_error() {
        let square = region(&[&square(0.0, 10.0)], false);
        let line = [[-1.0, 5.0], [11.0, 5.0]];
        assert!(Regions(vec![square]).cut(&line, &mut 2).is_err());
    }
}
