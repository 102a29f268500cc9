//! A reference for curves: B-splines in floats by the Cox-de Boor basis, and the minimum number of
//! chords by exhaustive search.

/// The point at parameter `u` on the spline of `order` with these control points and knots.
///
/// It is the sum over all basis functions, which shares nothing with the recursions of the library.
pub fn spline_at(control: &[[f64; 3]], knots: &[f64], order: usize, u: f64) -> [f64; 3] {
    let end = knots[control.len()];
    // The last point belongs to the last polynomial with a length.
    let span = if u >= end {
        (0..control.len()).rev().find(|&at| knots[at] < knots[at + 1]).unwrap_or(0)
    } else {
        (0..control.len()).rev().find(|&at| knots[at] <= u).unwrap_or(0)
    };
    let mut position = [0.0; 3];
    for (number, point) in control.iter().enumerate() {
        let weight = basis(knots, number, order, u, span);
        for axis in 0..3 {
            position[axis] += weight * point[axis];
        }
    }
    position
}

fn basis(knots: &[f64], number: usize, order: usize, u: f64, span: usize) -> f64 {
    if order == 1 {
        return if number == span { 1.0 } else { 0.0 };
    }
    let rising = knots[number + order - 1] - knots[number];
    let falling = knots[number + order] - knots[number + 1];
    let mut sum = 0.0;
    if rising > 0.0 {
        sum += (u - knots[number]) / rising * basis(knots, number, order - 1, u, span);
    }
    if falling > 0.0 {
        sum += (knots[number + order] - u) / falling * basis(knots, number + 1, order - 1, u, span);
    }
    sum
}

/// The distance of `position` from the line segment between `a` and `b`.
pub fn distance(position: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let away = [position[0] - a[0], position[1] - a[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let part = if square > 0.0 {
        ((away[0] * along[0] + away[1] * along[1]) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (away[0] - part * along[0]).hypot(away[1] - part * along[1])
}

/// The minimum number of chords between some of `samples`, including the first and the last, such
/// that no sample is farther than `tolerance` from its chord.
pub fn fewest_chords(samples: &[[f64; 2]], tolerance: f64) -> usize {
    let mut fewest = vec![usize::MAX; samples.len()];
    fewest[0] = 0;
    for from in 0..samples.len() {
        if fewest[from] == usize::MAX {
            continue;
        }
        for to in from + 1..samples.len() {
            let stays = samples[from..=to]
                .iter()
                .all(|sample| distance(*sample, samples[from], samples[to]) <= tolerance);
            if stays {
                fewest[to] = fewest[to].min(fewest[from] + 1);
            }
        }
    }
    fewest[samples.len() - 1]
}
