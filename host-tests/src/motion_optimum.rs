//! A reference for the speed of a motion: the fastest motion within the limits, computed in `f64`
//! by an exact forward and backward pass over the whole path.

/// The limits of a motion.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// The maximum speed along the path, in mm/s.
    pub speed: f64,
    /// The maximum acceleration along the path, in mm/s².
    pub acceleration: f64,
    /// The junction deviation in mm.
    pub junction_deviation: f64,
    /// Whether the speed is limited in curves.
    pub centripetal: bool,
    /// Whether the limit of a tight bend counts for all of its circle and for a stride beside it,
    /// too. The planner takes care of that as far as it knows the path in time.
    pub beside_bends: bool,
    /// The length of a step in mm, the same for both axes.
    pub step: f64,
}

type Point = (f64, f64);

/// How many steps the rounding of three points may lift one over the line through the others.
const ROUNDING: f64 = 23.0 / 16.0;

fn minus(a: Point, b: Point) -> Point {
    (a.0 - b.0, a.1 - b.1)
}

fn cross(a: Point, b: Point) -> f64 {
    a.0 * b.1 - a.1 * b.0
}

fn norm(a: Point) -> f64 {
    a.0.hypot(a.1)
}

/// The squared maximum speed at each point of `points` (mm) and on each line between two points, by
/// the rules of the module `motion`. Corners are limited by junction deviation. Curves are limited
/// by the circle through points that are 2, 4, … 64 apart. In both cases, what rounding to steps
/// can explain is subtracted, or a quarter of it in a tight bend.
pub fn squared_limits(points: &[Point], limits: Limits) -> (Vec<f64>, Vec<f64>) {
    let rounding = ROUNDING * limits.step;
    let mut radius = vec![f64::INFINITY; points.len()];
    let mut curve = vec![f64::INFINITY; points.len() - 1];
    let mut sharp = vec![0];
    for i in 1..points.len() - 1 {
        let (a, b) = (minus(points[i], points[i - 1]), minus(points[i + 1], points[i]));
        let shorter = norm(a).min(norm(b));
        let turn = cross(a, b).abs().atan2(a.0 * b.0 + a.1 * b.1);
        let sine = (turn / 2.0).sin() - rounding / shorter;
        // Short moves before this line may hide a corner between two longer ones.
        let hidden = hidden_corner(points, i, rounding, limits);
        radius[i] = hidden.map_or(radius[i], |(radius, _)| radius);
        if hidden.is_some_and(|(_, sine)| sine > 0.342) {
            sharp.push(i);
        }
        // A curve ends beside a line that is much longer than its chords.
        let longer = norm(a).max(norm(b));
        if longer > 32.0 * rounding && shorter > rounding && shorter < longer / 4.0 {
            sharp.push(i);
        }
        if sine <= 0.0 {
            continue;
        }
        let cosine = (turn / 2.0).cos();
        let mut arc = limits.junction_deviation * cosine * (1.0 + cosine) / (sine * sine);
        if limits.centripetal {
            arc = arc.min(shorter * cosine / (2.0 * sine));
        }
        radius[i] = radius[i].min(arc);
        if sine > 0.342 {
            sharp.push(i);
        }
    }
    sharp.push(points.len() - 1);
    sharp.dedup();
    if limits.centripetal {
        for ends in sharp.windows(2) {
            // The least radius of the tight bends that smaller strides have found up to each point.
            let mut found = vec![f64::INFINITY; points.len()];
            for stride in [2usize, 4, 8, 16, 32, 64] {
                let smaller = std::mem::replace(&mut found, vec![f64::INFINITY; points.len()]);
                let (mut now, mut earlier) = (f64::INFINITY, f64::INFINITY);
                let mut tight_before = None;
                let mut last = ends[0] + stride;
                while last <= ends[1] {
                    now = now.min(smaller[last - stride / 2]).min(smaller[last]);
                    if last < ends[0] + 2 * stride {
                        found[last] = smaller[last];
                        last += stride;
                        continue;
                    }
                    let known = now.min(earlier);
                    (earlier, now) = (now, f64::INFINITY);
                    let middle = last - stride;
                    let is_first = middle - stride == ends[0];
                    let outer = (points[middle - stride], points[last]);
                    let circle = circle(outer.0, points[middle], outer.1, limits.step);
                    let is_last = last + stride > ends[1];
                    let is_known = circle.is_some_and(|(radius, _)| known <= radius / 2.0);
                    found[last] = circle
                        .filter(|circle| circle.1)
                        .map_or(known, |(radius, _)| known.min(radius));
                    // A tight bend has the whole circle and a stride on both sides, but not beside
                    // one that is known to be much narrower. Another circle applies to half of its
                    // arc; at the ends of a curve, to all of it.
                    let (from, to) = match circle {
                        Some((_, true)) if is_known => (last - 2 * stride, last),
                        Some((_, true)) => (last.saturating_sub(3 * stride).max(ends[0]), last),
                        _ if tight_before.is_some() => (last - stride, last),
                        _ if is_first => (ends[0], middle + stride / 2),
                        _ => (middle - stride / 2, middle + stride / 2),
                    };
                    let radius = circle.map_or(f64::INFINITY, |circle| circle.0);
                    let limit = tight_before.unwrap_or(f64::INFINITY).min(radius);
                    for slot in &mut curve[from..to] {
                        *slot = slot.min(limit);
                    }
                    if is_last {
                        for slot in &mut curve[middle + stride / 2..ends[1]] {
                            *slot = slot.min(radius);
                        }
                    }
                    tight_before = circle
                        .filter(|circle| limits.beside_bends && circle.1 && !is_known)
                        .map(|circle| circle.0);
                    last += stride;
                }
            }
        }
    }
    for (i, r) in curve.iter().enumerate() {
        radius[i] = radius[i].min(*r);
        radius[i + 1] = radius[i + 1].min(*r);
    }
    let ends = [0, points.len() - 1];
    for end in ends {
        radius[end] = 0.0;
    }
    let square = |r: f64| (limits.acceleration * r).min(limits.speed.powi(2));
    (radius.into_iter().map(square).collect(), curve.into_iter().map(square).collect())
}

/// The radius of the arc of the corner between the line behind point `at` and the last one before
/// it that is no short move, and half the sine of its turn; `None` if no short moves are between
/// the two, or if rounding explains the corner.
fn hidden_corner(points: &[Point], at: usize, rounding: f64, limits: Limits) -> Option<(f64, f64)> {
    let after = minus(points[at + 1], points[at]);
    let mut start = at;
    let (before, gap) = loop {
        let before = minus(points[start], *points.get(start.checked_sub(1)?)?);
        let gap: f64 =
            points[start..=at].windows(2).map(|pair| norm(minus(pair[1], pair[0]))).sum();
        if gap > 8.0 * rounding {
            return None;
        }
        if norm(before) >= 4.0 * rounding {
            break (before, gap);
        }
        start -= 1;
    };
    if gap == 0.0 || norm(after) < 4.0 * rounding {
        return None;
    }
    let turn = cross(before, after).abs().atan2(before.0 * after.0 + before.1 * after.1);
    let shorter = norm(before).min(norm(after));
    let (sine, cosine) = ((turn / 2.0).sin() - rounding / shorter, (turn / 2.0).cos());
    if sine <= 0.0 {
        return None;
    }
    let deviation = limits.junction_deviation * cosine + gap * sine / 4.0;
    let mut radius = deviation * (1.0 + cosine) / (sine * sine);
    if limits.centripetal {
        radius = radius.min((shorter + gap) * cosine / (2.0 * sine));
    }
    Some((radius, sine))
}

/// The radius of the circle through three points, and whether it is that of a tight bend.
fn circle(first: Point, middle: Point, last: Point, step: f64) -> Option<(f64, bool)> {
    // Whether a circle applies depends on a threshold, so points are rounded exactly as `motion`
    // does: a step has a whole number of units of 2^-32 mm, and a point one of 2^-12 mm.
    let unit = (2f64.powi(32) * step).floor();
    let along = |mm: f64| (((mm / step).round() * unit) / 2f64.powi(20)).floor() / 4096.0;
    let [first, middle, last] = [first, middle, last].map(|p| (along(p.0), along(p.1)));
    let rounding = ROUNDING * step;
    let (a, b, c) = (minus(middle, first), minus(last, middle), minus(last, first));
    if 16.0 * norm(c) < 15.0 * norm(a).max(norm(b)) {
        return None;
    }
    let height = cross(a, b).abs() / norm(c);
    if height <= rounding {
        return None;
    }
    let (across, along) = (cross(a, b).abs(), a.0 * b.0 + a.1 * b.1);
    let is_low = height < 24.0 * rounding;
    if !is_low && across > 2.0 * along {
        return None;
    }
    let is_tight = is_low && 8.0 * across >= 3.0 * along;
    let height = height - if is_tight { rounding / 4.0 } else { rounding };
    Some((norm(a) * norm(b) / (2.0 * height), is_tight))
}

/// The time in seconds from rest at the first point to rest at the last one. Successive points must
/// differ.
pub fn seconds(points: &[Point], limits: Limits) -> f64 {
    let (mut squares, tops) = squared_limits(points, limits);
    let lengths: Vec<f64> = points.windows(2).map(|pair| norm(minus(pair[1], pair[0]))).collect();
    for i in 0..lengths.len() {
        squares[i + 1] = squares[i + 1].min(squares[i] + 2.0 * limits.acceleration * lengths[i]);
    }
    for i in (0..lengths.len()).rev() {
        squares[i] = squares[i].min(squares[i + 1] + 2.0 * limits.acceleration * lengths[i]);
    }
    lengths
        .iter()
        .zip(squares.windows(2))
        .zip(tops)
        .map(|((&length, ends), top)| {
            let a = limits.acceleration;
            let peak = ((ends[0] + ends[1]) / 2.0 + a * length).min(top);
            let ramps = (2.0 * peak - ends[0] - ends[1]) / (2.0 * a);
            let speed_up = 2.0 * peak.sqrt() - ends[0].sqrt() - ends[1].sqrt();
            speed_up / a + (length - ramps) / peak.sqrt()
        })
        .sum()
}

/// The time in seconds for a straight line of `length` mm from rest to rest with a jerk limit, in
/// mm/s³.
pub fn straight_seconds(length: f64, limits: Limits, jerk: f64) -> f64 {
    let ramp = |speed: f64| {
        let full = limits.acceleration.powi(2) / jerk;
        if speed < full {
            2.0 * (speed / jerk).sqrt()
        } else {
            speed / limits.acceleration + limits.acceleration / jerk
        }
    };
    // The length of a ramp from rest is its duration times half of its final speed; two ramps must
    // fit into the line.
    let (mut slow, mut fast) = (0.0, limits.speed);
    if fast * ramp(fast) > length {
        for _ in 0..100 {
            let middle = (slow + fast) / 2.0;
            if middle * ramp(middle) > length {
                fast = middle;
            } else {
                slow = middle;
            }
        }
    }
    2.0 * ramp(fast) + (length - fast * ramp(fast)).max(0.0) / fast
}
