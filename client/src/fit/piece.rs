//! The curve for one piece of a polyline, which has no sharp corner inside.

use super::least_squares::{Basis, least_squares};
use super::{Place, distance, dot, minus};

/// Fits at most, after each of which the parameters follow the curve: from nothing, and from a curve
/// almost as good.
const ROUNDS: usize = 40;
const MORE_ROUNDS: usize = 10;
/// Passes over the knots to see which may go.
const PASSES: usize = 3;

/// A fitted piece.
#[derive(Debug, Clone)]
pub struct Piece {
    /// Its control points.
    pub control: Vec<Place>,
    /// The knots inside, increasing.
    pub inner: Vec<i32>,
    /// The knot at its end.
    pub end: i32,
}

/// Places along the piece, close together, and the frame that all tries share.
struct Samples {
    places: Vec<Place>,
    /// The parameter of each by its distance along the piece.
    at: Vec<f64>,
    order: usize,
    ends: [i32; 2],
    tolerance: f64,
}

/// One try: the control points for some inner knots, and how far each sample is from the curve.
struct Try {
    control: Vec<Place>,
    at: Vec<f64>,
    errors: Vec<f64>,
}

impl Piece {
    /// Fits `places` with a curve of `order` whose first knot is `begin`; `None` if no number of knots
    /// does it, or only more than `most` before those that are not needed are taken away.
    pub fn fit(
        places: &[Place],
        order: usize,
        begin: i32,
        tolerance: f64,
        most: usize,
    ) -> Option<Self> {
        let samples = Samples::new(places, order, begin, tolerance);
        let mut inner = Vec::new();
        let mut found = samples.fit(&inner, &samples.at, ROUNDS);
        while found.worst() > tolerance {
            inner = samples.divided(&inner, &found, tolerance)?;
            if inner.len() > most {
                return None;
            }
            found = samples.fit(&inner, &samples.at, ROUNDS);
        }
        for _ in 0..PASSES {
            let before = inner.len();
            let mut at = 0;
            while at < inner.len() {
                let fewer = [without(&inner, at), merged(&inner, at)];
                let better = fewer.into_iter().flatten().find_map(|fewer| {
                    let found = samples.fit(&fewer, &found.at, MORE_ROUNDS);
                    (found.worst() <= tolerance).then_some((fewer, found))
                });
                match better {
                    Some(better) => (inner, found) = better,
                    None => at += 1,
                }
            }
            if inner.len() == before {
                break;
            }
        }
        Some(Self { control: found.control, inner, end: samples.ends[1] })
    }
}

/// `knots` without number `at`.
fn without(knots: &[i32], at: usize) -> Option<Vec<i32>> {
    let mut fewer = knots.to_vec();
    fewer.remove(at);
    Some(fewer)
}

/// `knots` with one in place of number `at` and the next; `None` if there is no next.
fn merged(knots: &[i32], at: usize) -> Option<Vec<i32>> {
    let next = *knots.get(at + 1)?;
    let mut fewer = knots.to_vec();
    let first = fewer.remove(at);
    fewer[at] = first + (next - first) / 2;
    Some(fewer)
}

impl Try {
    fn worst(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }
}

impl Samples {
    fn new(places: &[Place], order: usize, begin: i32, tolerance: f64) -> Self {
        let length: f64 = places.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let spacing = tolerance.max(length / 2000.0);
        let mut dense = vec![places[0]];
        let mut along = vec![0.0];
        for pair in places.windows(2) {
            let side = minus(pair[1], pair[0]);
            let start = along[along.len() - 1];
            let parts = (distance(pair[0], pair[1]) / spacing).ceil().max(1.0) as usize;
            for part in 1..=parts {
                let share = part as f64 / parts as f64;
                dense.push([pair[0][0] + share * side[0], pair[0][1] + share * side[1]]);
                along.push(start + share * side[0].hypot(side[1]));
            }
        }
        let width = dense.len() as i32;
        let scale = f64::from(width) / length;
        let at = along.into_iter().map(|along| f64::from(begin) + along * scale).collect();
        Self { places: dense, at, order, ends: [begin, begin + width], tolerance }
    }

    fn knots(&self, inner: &[i32]) -> Vec<f64> {
        let [begin, end] = self.ends.map(|end| std::iter::repeat_n(end, self.order));
        begin.chain(inner.iter().copied()).chain(end).map(f64::from).collect()
    }

    /// Fits, lets each sample's parameter go where the curve is nearest to it, and fits again, until all
    /// is within the tolerance or that is out of reach.
    fn fit(&self, inner: &[i32], start: &[f64], rounds: usize) -> Try {
        let knots = self.knots(inner);
        let mut at = start.to_vec();
        let mut worst = f64::INFINITY;
        for round in 1.. {
            let bases: Vec<Basis> = at.iter().map(|t| Basis::at(&knots, self.order, *t)).collect();
            let control = least_squares(&self.places, &bases, self.order + inner.len());
            self.follow(&mut at, &bases, &control);
            let found = Try { errors: self.errors(&knots, &control, &at), control, at };
            let gained = worst - found.worst();
            worst = found.worst();
            // At this rate.
            let reach = worst - gained.max(0.0) * rounds.saturating_sub(round) as f64;
            if worst <= self.tolerance || reach > self.tolerance || round >= rounds {
                return found;
            }
            at = found.at;
        }
        unreachable!("the last round returns")
    }

    /// Moves each parameter to the nearest place on the curve, by one step, never past the one before.
    fn follow(&self, at: &mut [f64], bases: &[Basis], control: &[Place]) {
        let [begin, end] = self.ends.map(f64::from);
        let inside = 1..at.len() - 1;
        let mut reached = begin;
        for (number, (t, basis)) in at.iter_mut().zip(bases).enumerate() {
            let away = minus(self.places[number], basis.place(control));
            let slope = basis.slope(control);
            let square = dot(slope, slope);
            if square > 0.0 && inside.contains(&number) {
                *t += dot(away, slope) / square;
            }
            *t = t.clamp(reached, end);
            reached = *t;
        }
    }

    /// How far each sample is from its place on the curve, and the curve before it from the polyline.
    fn errors(&self, knots: &[f64], control: &[Place], at: &[f64]) -> Vec<f64> {
        let place = |t: f64| Basis::at(knots, self.order, t).place(control);
        let mut errors = vec![0.0];
        for (samples, at) in self.places.windows(2).zip(at.windows(2)) {
            let middle = [0, 1].map(|axis: usize| (samples[0][axis] + samples[1][axis]) / 2.0);
            let between = distance(place((at[0] + at[1]) / 2.0), middle);
            errors.push(distance(place(at[1]), samples[1]).max(between));
        }
        errors
    }

    /// `inner` with another knot in every polynomial that is too far off; `None` if one is too short.
    fn divided(&self, inner: &[i32], found: &Try, tolerance: f64) -> Option<Vec<i32>> {
        let mut knots = vec![self.ends[0]];
        knots.extend(inner);
        knots.push(self.ends[1]);
        let mut divided = Vec::new();
        for pair in knots.windows(2) {
            let (low, high) = (f64::from(pair[0]), f64::from(pair[1]));
            let first = found.at.partition_point(|t| *t < low);
            let last = found.at.partition_point(|t| *t <= high);
            if found.errors[first.min(last)..last].iter().any(|error| *error > tolerance) {
                let middle = pair[0] + (pair[1] - pair[0]) / 2;
                if middle == pair[0] {
                    return None;
                }
                divided.push(middle);
            }
            divided.push(pair[1]);
        }
        divided.pop();
        // An error just at a knot may be seen on neither side.
        (divided.len() > inner.len()).then_some(divided)
    }
}
