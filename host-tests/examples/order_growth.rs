//! Times and pen-up lengths of `order` as drawings grow, with the numbers of a computer:
//! `order_growth EFFORT SEEDS COUNT...` for COUNT strokes of four kinds of drawings, each the mean
//! of SEEDS drawings.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]
use penup::drawing::{Drawing, PagePoint, Segment};
use penup::order::{Leg, Method, Options, order};
use penup::stage::{NeverCancel, Scratch};
use std::time::Instant;

/// The size of the page in steps: 280 mm by 200 mm.
const PAGE: PagePoint = PagePoint { x: 22_400, y: 16_000 };

/// The number of segments in each stroke of a flow field.
const FLOW_SEGMENTS: u32 = 8;

/// Makes a drawing of so many strokes, each seed another.
type Kind = fn(u32, u32) -> Strokes;

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
struct Strokes {
    points: Vec<PagePoint>,
    segments: Vec<Segment<u32>>,
}

impl Strokes {
    /// Adds a stroke through `points`, which meets no other.
    fn add(&mut self, points: impl IntoIterator<Item = PagePoint>) {
        for (number, point) in points.into_iter().enumerate() {
            let at = self.points.len() as u32;
            if number > 0 {
                self.segments.push(Segment::new(at - 1, at));
            }
            self.points.push(point);
        }
    }
}

/// Makes short strokes at random places and in random directions.
fn random(count: u32, seed: u32) -> Strokes {
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
fn hatched(count: u32, seed: u32) -> Strokes {
    let mut random = Random(seed);
    let mut shift = PagePoint::default();
    let squares = f64::from(count / 100).sqrt().ceil() as i32;
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

/// Makes strokes of several segments that follow a field of smoothly changing directions.
fn flow_field(count: u32, seed: u32) -> Strokes {
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
fn triangles(count: u32, seed: u32) -> Strokes {
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

fn main() {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse::<u32>().expect("a number"));
    let usage = "EFFORT SEEDS COUNT...";
    let (effort, seeds) = (numbers.next().expect(usage), numbers.next().expect(usage));
    let kinds: [(&str, Kind); 4] = [
        ("random", random),
        ("hatched", hatched),
        ("flow field", flow_field),
        ("triangles", triangles),
    ];
    for count in numbers {
        for (name, make) in kinds {
            let (mut seconds, mut pen_up) = (0.0, 0);
            for seed in 1..=seeds {
                let Strokes { points, segments } = make(count, seed);
                let drawing = Drawing { points: &points, segments: &segments };
                let mut memory = vec![0; 64 * segments.len() + 1024];
                let mut tour = vec![Leg::new(0u32, false); segments.len()];
                let options = Options { method: Method::Greedy, effort, ..Options::default() };
                let begin = Instant::now();
                let scratch = Scratch::new(&mut memory);
                let report = order(drawing, options, scratch, &mut NeverCancel, &mut tour)
                    .expect("an order");
                seconds += begin.elapsed().as_secs_f64();
                pen_up += report.pen_up >> 8;
            }
            let (seconds, pen_up) = (seconds / f64::from(seeds), pen_up / u64::from(seeds));
            println!("{count} {name}: {seconds:.3} s, up {pen_up} steps");
        }
    }
}
