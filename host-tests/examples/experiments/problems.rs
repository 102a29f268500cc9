//! The data: as random as Harrison's.

use penup::drawing::{Drawing, PagePoint, Segment};
use penup::order::enumeration::Distances;
use penup::order::{Leg, Method, Options, Report, Shape, length, order};
use penup::stage::{Scratch, Undisturbed};

/// RANDU, the generator of the IBM Scientific Subroutine Package that Harrison used.
///
/// His matrices are not printed, nor his seed. With this seed the least costs are his up to 12
/// points: 52, 56, 62, 87, 102.
#[derive(Debug, Clone)]
struct Randu(u32);

impl Randu {
    const SEED: u32 = 311_837_743;

    /// The next number from 0 to `limit` - 1.
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self.0.wrapping_mul(65539) & 0x7fff_ffff;
        ((u64::from(self.0) * u64::from(limit)) >> 31) as u32
    }
}

/// A pen-up problem with its own memory.
#[derive(Debug, Clone)]
pub struct Problem {
    pub count: usize,
    below_diagonal: Vec<u32>,
}

impl Problem {
    /// Distances from `least` to `least + range - 1`, each as likely, that need not meet the triangle
    /// inequality (7.1). The matrix of fewer points is a part of that of more.
    pub fn of_matrix(count: usize, least: u32, range: u32) -> Self {
        let mut randu = Randu(Randu::SEED);
        let next = || least + randu.below(range);
        Self {
            count,
            below_diagonal: std::iter::repeat_with(next).take(count * (count - 1) / 2).collect(),
        }
    }

    /// The distances between points of a square page.
    pub fn of_points(count: usize) -> Self {
        let points = random_points(count);
        let rows = points.iter().enumerate();
        let below_diagonal =
            rows.flat_map(|(row, &a)| points[..row].iter().map(move |&b| length(a, b))).collect();
        Self { count, below_diagonal }
    }

    pub fn distances(&self) -> Distances<'_> {
        Distances::new(self.count, &self.below_diagonal).expect("an even number of points")
    }

    /// The distance that about `wanted` are no longer than, and how many are.
    pub fn shortest(&self, wanted: usize) -> (u32, usize) {
        let mut sorted = self.below_diagonal.clone();
        sorted.sort_unstable();
        let longest = sorted[wanted - 1];
        (longest, sorted.partition_point(|&distance| distance <= longest))
    }
}

fn random_points(count: usize) -> Vec<PagePoint> {
    let mut randu = Randu(Randu::SEED);
    let mut next = || randu.below(16_000) as i32;
    std::iter::repeat_with(|| PagePoint { x: next(), y: next() }).take(count).collect()
}

/// A star: every point of [`Problem::of_points`] joined to the middle of the page. Its odd points are
/// those, so the pen-up moves of a closed cycle are a matching of them.
pub struct Star {
    points: Vec<PagePoint>,
    segments: Vec<Segment>,
    memory: Vec<u64>,
    tour: Vec<Leg>,
}

impl Star {
    pub fn new(count: u16) -> Self {
        let mut points = random_points(usize::from(count));
        points.push(PagePoint { x: 8_000, y: 8_000 });
        let segments: Vec<Segment> =
            (0..count).map(|from| Segment { from, to: count, ..Segment::default() }).collect();
        let tour = vec![Leg::new(0, false); segments.len()];
        Self { points, segments, memory: vec![0; 1 << 14], tour }
    }

    /// Orders it with the pen-up heuristic.
    pub fn order(&mut self) -> Report {
        let drawing = Drawing { points: &self.points, segments: &self.segments };
        let options =
            Options { method: Method::Greedy, shape: Shape::ClosedCycle, effort: 0, lift: 0 };
        let scratch = Scratch::new(&mut self.memory);
        order(drawing, options, scratch, &mut Undisturbed, &mut self.tour).expect("an order")
    }
}
