//! Drawings of many strokes for tests and measurements of the order: random, hatched, a flow field,
//! and the edges of triangles.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use crate::order_reference::Sheet;
use penup::drawing::{Drawing, PagePoint, Segment};
use penup::order::{Leg, Options, OrderError, Report, order};
use penup::stage::{Aborted, Cancel, Scratch};
use std::collections::BTreeMap;

/// The size of the page in steps: 280 mm by 200 mm.
const PAGE: PagePoint = PagePoint { x: 22_400, y: 16_000 };

/// The number of segments in each stroke of a flow field.
const FLOW_SEGMENTS: u32 = 8;

/// Makes a drawing of so many strokes, each seed another.
pub type Kind = fn(u32, u32) -> Strokes;

/// A generator of numbers that look random and are the same in every run.
struct Random(u32);

impl Random {
    /// Returns a number from 0 to `limit` - 1.
    fn below(&mut self, limit: i32) -> i32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((u64::from(self.0) * limit as u64) >> 32) as i32
    }
}

/// A drawing that owns its points and segments.
#[derive(Default)]
pub struct Strokes {
    /// The points.
    pub points: Vec<PagePoint>,
    /// The segments between them.
    pub segments: Vec<Segment<u32>>,
}

impl Strokes {
    /// Adds a stroke through `points`, which meets no other.
    pub fn add(&mut self, points: impl IntoIterator<Item = PagePoint>) {
        for (number, point) in points.into_iter().enumerate() {
            let at = self.points.len() as u32;
            if number > 0 {
                self.segments.push(Segment::new(at - 1, at));
            }
            self.points.push(point);
        }
    }
}

/// Counts how often a computation asks whether it is cancelled.
struct Checks(u64);

impl Cancel for Checks {
    fn check(&mut self) -> Result<(), Aborted> {
        self.0 += 1;
        Ok(())
    }
}

impl From<&Sheet> for Strokes {
    fn from(sheet: &Sheet) -> Self {
        let segment = |segment: &Segment| Segment::new(segment.from().into(), segment.to().into());
        Self {
            points: sheet.points.clone(),
            segments: sheet.segments.iter().map(segment).collect(),
        }
    }
}

impl Strokes {
    /// The two ends of each stroke, for a drawing whose parts are strokes that do not meet.
    ///
    /// # Panics
    /// If a part has not exactly two odd points.
    pub fn ends(&self) -> Vec<[PagePoint; 2]> {
        let mut part: Vec<usize> = (0..self.points.len()).collect();
        let mut degree = vec![0; self.points.len()];
        // Each point of a part gets the lowest number in it. The segments of a stroke follow each
        // other, so a few passes are enough.
        let mut changed = true;
        while std::mem::take(&mut changed) {
            for segment in &self.segments {
                let [from, to] = [segment.from() as usize, segment.to() as usize];
                let lowest = part[from].min(part[to]);
                changed |= part[from] != lowest || part[to] != lowest;
                (part[from], part[to]) = (lowest, lowest);
            }
        }
        for segment in &self.segments {
            degree[segment.from() as usize] += 1;
            degree[segment.to() as usize] += 1;
        }
        let mut ends: BTreeMap<usize, Vec<PagePoint>> = BTreeMap::new();
        for (number, &point) in self.points.iter().enumerate() {
            if degree[number] % 2 == 1 {
                ends.entry(part[number]).or_default().push(point);
            }
        }
        let pair = |ends: Vec<PagePoint>| <[PagePoint; 2]>::try_from(ends).expect("a stroke");
        ends.into_values().map(pair).collect()
    }

    /// The tour that the library finds with the numbers of a computer and plenty of memory, its
    /// report, and the units of work (distance computations), rounded up to a few hundred.
    ///
    /// # Errors
    /// See [`OrderError`].
    pub fn order(&self, options: Options) -> Result<(Vec<Leg<u32>>, Report, u64), OrderError> {
        let Self { points, segments } = self;
        let drawing = Drawing { points, segments };
        let mut memory = vec![0; 64 * segments.len() + 8192];
        let mut tour = vec![Leg::new(0u32, false); segments.len()];
        let mut checks = Checks(0);
        let scratch = Scratch::new(&mut memory);
        let report = order(drawing, options, scratch, &mut checks, &mut tour)?;
        // It asks after each 256 units.
        Ok((tour, report, 256 * checks.0))
    }

    /// The seconds that the moves with the pen up of `tour` take at `speed` mm/s and with an
    /// acceleration in mm/s², from rest to rest, with 80 steps to the millimetre.
    pub fn travel_seconds(&self, tour: &[Leg<u32>], speed: f64, acceleration: f64) -> f64 {
        let start = |leg: Leg<u32>| {
            let segment = self.segments[leg.segment()];
            let point = if leg.reversed() { segment.to() } else { segment.from() };
            self.points[point as usize]
        };
        let moves = tour.windows(2).map(|pair| {
            let (from, to) = (start(pair[0].flipped()), start(pair[1]));
            let length = f64::from(to.x - from.x).hypot(f64::from(to.y - from.y)) / 80.0;
            if length * acceleration < speed * speed {
                2.0 * (length / acceleration).sqrt()
            } else {
                length / speed + speed / acceleration
            }
        });
        moves.sum()
    }
}

/// Makes short strokes at random places and in random directions.
pub fn random(count: u32, seed: u32) -> Strokes {
    let mut random = Random(seed);
    let mut strokes = Strokes::default();
    for _ in 0..count {
        let from = PagePoint { x: random.below(PAGE.x), y: random.below(PAGE.y) };
        let to =
            PagePoint { x: from.x + random.below(400) - 200, y: from.y + random.below(400) - 200 };
        strokes.add([from, to]);
    }
    strokes
}

/// Makes parallel strokes in squares of a hundred each, which are not quite in line.
pub fn hatched(count: u32, seed: u32) -> Strokes {
    let mut random = Random(seed);
    let mut shift = PagePoint::default();
    let squares = (f64::from(count / 100).sqrt().ceil() as i32).max(1);
    let mut strokes = Strokes::default();
    for number in 0..count {
        let (square, line) = ((number / 100) as i32, (number % 100) as i32);
        if line == 0 {
            shift = PagePoint { x: random.below(60), y: random.below(60) };
        }
        let x = square % squares * 900 + shift.x;
        let y = square / squares * 900 + shift.y + 8 * line;
        strokes.add([x, x + 800].map(|x| PagePoint { x, y }));
    }
    strokes
}

/// Makes 500 lines in two columns, whose lengths change along the page. The shortest way goes back
/// and forth, down one column and up the other.
pub fn two_columns() -> Sheet {
    let lines = (0..250).flat_map(|row| {
        let turn = f64::from(row);
        let (y, middle) = (15.0 + turn, 95.0 + 30.0 * (turn / 20.0).sin());
        let left = (20.0 + 5.0 * (turn / 9.0).sin(), middle - 4.0);
        let right = (middle + 4.0, 175.0 + 8.0 * (turn / 7.0).cos());
        let steps = |mm: f64| (80.0 * mm).round() as i32;
        [left, right].map(|(from, to)| vec![(steps(from), steps(y)), (steps(to), steps(y))])
    });
    Sheet::from_polylines(&lines.collect::<Vec<_>>())
}

/// Makes strokes of several segments that follow a field of smoothly changing directions.
pub fn flow_field(count: u32, seed: u32) -> Strokes {
    let mut random = Random(seed);
    let mut strokes = Strokes::default();
    for _ in 0..count {
        let mut x = f64::from(random.below(PAGE.x));
        let mut y = f64::from(random.below(PAGE.y));
        strokes.add((0..=FLOW_SEGMENTS).map(|_| {
            let point = PagePoint { x: x as i32, y: y as i32 };
            let angle = (x / 1900.0).sin() + (y / 1300.0).cos() + (x + y) / 9000.0;
            x += 40.0 * angle.cos();
            y += 40.0 * angle.sin();
            point
        }));
    }
    strokes
}

/// Makes the edges of triangles between points that are nearly a square grid. Of the two diagonals
/// of each square, the shorter is drawn, as in a Delaunay triangulation.
pub fn triangles(count: u32, seed: u32) -> Strokes {
    // Each point has about three edges: one to the right, one up, and a diagonal.
    let side = (f64::from(count) / 3.0).sqrt().ceil() as u32;
    let step = PAGE.y / side as i32;
    let mut random = Random(seed);
    let mut strokes = Strokes::default();
    for number in 0..side * side {
        let (column, row) = ((number % side) as i32, (number / side) as i32);
        strokes.points.push(PagePoint {
            x: column * step + random.below(step * 4 / 5),
            y: row * step + random.below(step * 4 / 5),
        });
    }
    let square = |a: PagePoint, b: PagePoint| (a.x - b.x).pow(2) + (a.y - b.y).pow(2);
    for at in 0..side * side {
        let (is_last_column, is_last_row) = (at % side == side - 1, at / side == side - 1);
        if !is_last_column {
            strokes.segments.push(Segment::new(at, at + 1));
        }
        if !is_last_row {
            strokes.segments.push(Segment::new(at, at + side));
        }
        if !is_last_column && !is_last_row {
            let [a, b, c, d] =
                [at, at + side + 1, at + 1, at + side].map(|at| strokes.points[at as usize]);
            let (from, to) = if square(a, b) <= square(c, d) {
                (at, at + side + 1)
            } else {
                (at + 1, at + side)
            };
            strokes.segments.push(Segment::new(from, to));
        }
    }
    strokes
}

/// The kinds of drawings by name.
pub const KINDS: [(&str, Kind); 4] = [
    ("random", random),
    ("hatched", hatched),
    ("flow field", flow_field),
    ("triangles", triangles),
];
