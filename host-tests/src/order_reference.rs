//! A slow reference check of stroke orders, and drawings to order.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use crate::scene_files::ObjText;
use penup::drawing::{Drawing, PagePoint, Segment};
use penup::order::{Leg, Options, OrderError, Report, Shape, order};
use penup::stage::{NeverCancel, Scratch};
use std::collections::{BTreeMap, BTreeSet};

/// A drawing that owns its memory.
#[derive(Debug, Clone, Default)]
pub struct Sheet {
    /// The points, which are all different.
    pub points: Vec<PagePoint>,
    /// The segments between them.
    pub segments: Vec<Segment>,
}

impl Sheet {
    /// Creates the drawing of polylines. Equal points are merged; segments that are repeated or
    /// have no length are left out.
    pub fn from_polylines(polylines: &[Vec<(i32, i32)>]) -> Self {
        let mut sheet = Self::default();
        let mut numbers = BTreeMap::new();
        let mut known = BTreeSet::new();
        for polyline in polylines {
            let ends: Vec<u16> = polyline
                .iter()
                .map(|&(x, y)| {
                    *numbers.entry((x, y)).or_insert_with(|| {
                        sheet.points.push(PagePoint { x, y });
                        sheet.points.len() as u16 - 1
                    })
                })
                .collect();
            for pair in ends.windows(2) {
                let (from, to) = (pair[0], pair[1]);
                if from != to && known.insert((from.min(to), from.max(to))) {
                    sheet.segments.push(Segment::new(from, to));
                }
            }
        }
        sheet
    }

    /// Reads a plan in millimetres from an OBJ text, with 80 steps to the millimetre.
    pub fn from_obj(text: &str) -> Self {
        let ObjText { vertices, elements } = ObjText::read(text);
        let steps = |coordinate: f64| (coordinate * 80.0).round() as i32;
        let at = |index: &usize| (steps(vertices[*index][0]), steps(vertices[*index][1]));
        let polylines: Vec<Vec<(i32, i32)>> = elements
            .iter()
            .filter(|element| !element.is_face)
            .map(|element| element.vertices.iter().map(at).collect())
            .collect();
        Self::from_polylines(&polylines)
    }

    /// The drawing as the library's type.
    pub fn drawing(&self) -> Drawing<'_> {
        Drawing { points: &self.points, segments: &self.segments }
    }

    /// The tour that the library finds with plenty of memory; it is checked.
    pub fn order(&self, options: Options) -> Result<(Vec<Leg>, Report), OrderError> {
        let mut memory = vec![0; 1 << 15];
        let mut tour = vec![Leg::new(0, false); self.segments.len()];
        let scratch = Scratch::new(&mut memory);
        let report = order(self.drawing(), options, scratch, &mut NeverCancel, &mut tour)?;
        self.check(options.shape, &tour, &report);
        Ok((tour, report))
    }

    /// As [`Sheet::order`], with the numbers and the memory of a computer.
    pub fn order_wide(&self, options: Options) -> Result<(Vec<Leg<u32>>, Report), OrderError> {
        let widened = |segment: &Segment| {
            let ends = [segment.from(), segment.to()].map(u32::from);
            Segment::new(ends[0], ends[1]).inked(segment.line_type(), segment.pen())
        };
        let segments: Vec<Segment<u32>> = self.segments.iter().map(widened).collect();
        let drawing = Drawing { points: &self.points, segments: &segments };
        let mut memory = vec![0; 1 << 16];
        let mut tour = vec![Leg::new(0, false); segments.len()];
        let scratch = Scratch::new(&mut memory);
        let report = order(drawing, options, scratch, &mut NeverCancel, &mut tour)?;
        Ok((tour, report))
    }

    /// The point at which a leg begins.
    pub fn start(&self, leg: Leg) -> PagePoint {
        let segment = self.segments[leg.segment()];
        let point = if leg.reversed() { segment.to() } else { segment.from() };
        self.points[usize::from(point)]
    }

    /// The point at which a leg ends.
    pub fn end(&self, leg: Leg) -> PagePoint {
        self.start(Leg::new(leg.segment() as u16, !leg.reversed()))
    }

    /// The number of points with an odd degree.
    pub fn odd_points(&self) -> usize {
        let mut degree = vec![0; self.points.len()];
        for segment in &self.segments {
            degree[usize::from(segment.from())] += 1;
            degree[usize::from(segment.to())] += 1;
        }
        degree.iter().filter(|&degree| degree % 2 == 1).count()
    }

    /// The number of connected components, found by flood filling.
    pub fn components(&self) -> usize {
        let mut left: BTreeSet<usize> = (0..self.segments.len()).collect();
        let mut count = 0;
        while let Some(first) = left.pop_first() {
            count += 1;
            let mut wet = BTreeSet::from([self.segments[first].from(), self.segments[first].to()]);
            loop {
                let touched: Vec<usize> = left
                    .iter()
                    .copied()
                    .filter(|&number| {
                        let (from, to) = (self.segments[number].from(), self.segments[number].to());
                        wet.contains(&from) || wet.contains(&to)
                    })
                    .collect();
                if touched.is_empty() {
                    break;
                }
                for number in touched {
                    left.remove(&number);
                    wet.insert(self.segments[number].from());
                    wet.insert(self.segments[number].to());
                }
            }
        }
        count
    }

    /// Panics unless `tour` draws each segment exactly once and `report` describes it correctly.
    pub fn check(&self, shape: Shape, tour: &[Leg], report: &Report) {
        let drawn: BTreeSet<usize> = tour.iter().map(|leg| leg.segment()).collect();
        assert_eq!(drawn.len(), tour.len(), "a segment is drawn twice");
        assert_eq!(drawn.len(), self.segments.len(), "a segment is missing");
        let mut moves: Vec<_> =
            tour.windows(2).map(|pair| (self.end(pair[0]), self.start(pair[1]))).collect();
        let pen = self.segments.first().map(|segment| segment.pen());
        let has_one_pen = self.segments.iter().all(|segment| Some(segment.pen()) == pen);
        let is_closed = shape == Shape::ClosedCycle && has_one_pen;
        if is_closed && let (Some(&first), Some(&last)) = (tour.first(), tour.last()) {
            moves.push((self.end(last), self.start(first)));
        }
        moves.retain(|(from, to)| from != to);
        let steps = |from: PagePoint, to: PagePoint| {
            f64::from(to.x - from.x).hypot(f64::from(to.y - from.y))
        };
        let pen_up: f64 = moves.iter().map(|&(from, to)| steps(from, to)).sum();
        let pen_down: f64 = tour.iter().map(|&leg| steps(self.start(leg), self.end(leg))).sum();
        let count = tour.len() as f64 + 1.0;
        assert!((report.pen_up as f64 / 256.0 - pen_up).abs() < count / 256.0);
        assert!((report.pen_down as f64 / 256.0 - pen_down).abs() < count / 256.0);
        assert_eq!(report.lifts as usize, moves.len());
        if self.segments.iter().all(|segment| segment.pen() == 0) {
            assert_eq!(report.odd_points as usize, self.odd_points());
            assert_eq!(report.components as usize, self.components());
            if report.components == 1 {
                assert!(moves.len() <= self.odd_points() / 2, "more lifts than pairs");
            }
        }
        assert!(report.bound <= report.pen_up);
        assert_eq!(report.optimal, report.bound == report.pen_up);
    }
}
