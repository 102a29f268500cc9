//! What the pins ink, and what they should.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::boards::host::Change;
use penup_client::files::parse;
use penup_host_tests::whole_jobs::Bench;
use penup_readers::Arrangement;
use penup_readers::lines::Lines as _;
use std::collections::HashMap;

/// Steps per millimetre, and per plotter unit.
const STEPS: f64 = 80.0;
const STEPS_PER_UNIT: f64 = 2.0;

/// A straight line in steps.
pub type Segment = [[f64; 2]; 2];

/// The positions of the machine, in steps, at which ink came onto the page.
pub fn inked(bench: &Bench) -> Vec<[f64; 2]> {
    let (mut up, mut pen, mut at) = ([true; 2], 0, [0; 2]);
    let mut points: Vec<[i32; 2]> = Vec::new();
    let changes = bench.board.trace().changes();
    for (index, stamped) in changes.iter().enumerate() {
        let mut step = |axis: usize, level: bool| at[axis] += if level { 1 } else { -1 };
        match stamped.change {
            Change::StepX(true) => step(0, up[0]),
            Change::StepY(true) => step(1, up[1]),
            Change::UpX(level) => up[0] = level,
            Change::UpY(level) => up[1] = level,
            Change::Pen(height) => pen = height,
            _ => continue,
        }
        let is_last = changes.get(index + 1).is_none_or(|next| next.time != stamped.time);
        if pen > 64 && is_last {
            points.push(at);
        }
    }
    points.sort_unstable();
    points.dedup();
    points.iter().map(|[x, y]| [f64::from(*x), f64::from(*y)]).collect()
}

/// The corners of the rectangle around the ink, in whole plotter units.
pub fn units(bench: &Bench) -> [[i32; 2]; 2] {
    let ink = inked(bench);
    let around = |axis: usize, least: bool| {
        let positions = ink.iter().map(|point| point[axis]);
        let end = if least {
            positions.fold(f64::INFINITY, f64::min)
        } else {
            positions.fold(f64::NEG_INFINITY, f64::max)
        };
        (end / STEPS_PER_UNIT).round() as i32
    };
    [[around(0, true), around(1, true)], [around(0, false), around(1, false)]]
}

/// The strokes that the client's reader of HP-GL finds in a file.
pub fn plan(bytes: &[u8]) -> Vec<Segment> {
    let file = parse("file.hpgl".to_owned(), bytes.to_vec(), &Arrangement::default());
    let file = file.expect("a valid file");
    let (mut vertices, mut segments) = (Vec::new(), Vec::new());
    for index in 0.. {
        let Some(line) = file.line(index) else { break };
        let mut words = line.sent.split_whitespace();
        let keyword = words.next();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        match keyword {
            Some("v") => vertices.push([numbers[0] * STEPS, numbers[1] * STEPS]),
            Some("l") => {
                let points: Vec<[f64; 2]> = numbers
                    .iter()
                    .map(|number| {
                        let count = vertices.len();
                        let number = *number as i64;
                        vertices[if number < 0 {
                            count - number.unsigned_abs() as usize
                        } else {
                            number as usize - 1
                        }]
                    })
                    .collect();
                segments.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
            }
            _ => {}
        }
    }
    assert!(!segments.is_empty());
    segments
}

/// The strokes of a text such as `0,0 10,0; 5,5`, in plotter units. A single point is a dot.
pub fn strokes(text: &str) -> Vec<Segment> {
    let mut segments = Vec::new();
    for stroke in text.split(';').map(str::trim).filter(|stroke| !stroke.is_empty()) {
        let points: Vec<[f64; 2]> = stroke
            .split_whitespace()
            .map(|point| {
                let (x, y) = point.split_once(',').expect("x,y");
                [x, y].map(|number| number.parse::<f64>().expect("a number") * STEPS_PER_UNIT)
            })
            .collect();
        if let [point] = points[..] {
            segments.push([point; 2]);
        }
        segments.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
    }
    segments
}

/// How far a point is from a line, in steps.
fn distance([x, y]: [f64; 2], [[ax, ay], [bx, by]]: Segment) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let square = dx * dx + dy * dy;
    let along =
        if square > 0.0 { (((x - ax) * dx + (y - ay) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    (x - ax - along * dx).hypot(y - ay - along * dy)
}

/// The size of the cells in which lines and points are looked for, in steps. What is farther than
/// that counts as being that far.
const CELL: f64 = 32.0;

/// The cell of a point.
fn cell([x, y]: [f64; 2]) -> [i64; 2] {
    [x, y].map(|coordinate| (coordinate / CELL).floor() as i64)
}

/// The cells around a point, with its own.
fn around(point: [f64; 2]) -> impl Iterator<Item = [i64; 2]> {
    let [x, y] = cell(point);
    (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| [x + dx, y + dy]))
}

/// Points along a line, at most ten steps apart.
fn along([a, b]: Segment) -> impl Iterator<Item = [f64; 2]> {
    let count = (((b[0] - a[0]).hypot(b[1] - a[1]) / 10.0) as usize).max(1);
    (0..=count).map(move |part| {
        let part = part as f64 / count as f64;
        [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]
    })
}

/// The longest distance of a point of ink from the figure, in steps.
pub fn farthest(ink: &[[f64; 2]], figure: &[Segment]) -> f64 {
    let mut cells: HashMap<[i64; 2], Vec<Segment>> = HashMap::new();
    for segment in figure {
        for point in along(*segment) {
            let segments = cells.entry(cell(point)).or_default();
            if segments.last() != Some(segment) {
                segments.push(*segment);
            }
        }
    }
    let from_figure = |point: &[f64; 2]| {
        let near = around(*point).filter_map(|cell| cells.get(&cell)).flatten();
        near.map(|line| distance(*point, *line)).fold(CELL, f64::min)
    };
    ink.iter().map(from_figure).fold(0.0, f64::max)
}

/// The longest distance of a point of the figure from the ink, in steps.
fn missing(ink: &[[f64; 2]], figure: &[Segment]) -> f64 {
    let mut cells: HashMap<[i64; 2], Vec<[f64; 2]>> = HashMap::new();
    for point in ink {
        cells.entry(cell(*point)).or_default().push(*point);
    }
    let from_ink = |[x, y]: [f64; 2]| {
        let near = around([x, y]).filter_map(|cell| cells.get(&cell)).flatten();
        near.map(|[ax, ay]| (ax - x).hypot(ay - y)).fold(CELL, f64::min)
    };
    figure.iter().flat_map(|segment| along(*segment)).map(from_ink).fold(0.0, f64::max)
}

/// What differs between the ink and the figure; `None` if each lies within a step of the other, or
/// `slack` steps more.
pub fn difference(ink: &[[f64; 2]], figure: &[Segment], slack: f64) -> Option<String> {
    if ink.is_empty() || figure.is_empty() {
        let text = format!("{} points of ink, {} lines", ink.len(), figure.len());
        return (ink.len() + figure.len() > 0).then_some(text);
    }
    let (beside, missing) = (farthest(ink, figure), missing(ink, figure));
    // A point of the figure lies at most half a diagonal from the nearest step.
    (beside > 1.0 + slack || missing > 1.5 + slack)
        .then(|| format!("ink {beside:.2} steps beside, {missing:.2} missing"))
}

pub fn assert_same_ink(name: &str, ink: &[[f64; 2]], figure: &[Segment], slack: f64) {
    if let Some(difference) = difference(ink, figure, slack) {
        panic!("{name}: {difference}");
    }
}
