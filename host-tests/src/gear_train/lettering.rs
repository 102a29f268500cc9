//! Letters that stand in relief: bands that follow a line, with round ends.

use super::mesh::{Mesh, Point, polar};
use std::f64::consts::PI;

/// Half the width of the band, for letters whose small ones are 1 high.
const HALF_WIDTH: f64 = 0.115;
/// The radius of the round parts along the middle of the band.
const RADIUS: f64 = 0.385;
/// Points of a round end between its two corners.
const CAP: usize = 4;
/// Pieces of half a circle.
const HALF_CIRCLE: usize = 10;

/// The line along the middle of a letter that is as wide as twice the radius, from (0, 0).
fn line(letter: char) -> Vec<Point> {
    let (r, width, top) = (RADIUS, 2.0 * RADIUS, 1.0 - HALF_WIDTH);
    let foot = HALF_WIDTH;
    // Part of a circle, in degrees counterclockwise.
    let arc = |centre: Point, from: f64, to: f64| -> Vec<Point> {
        let steps = ((to - from).abs() / 180.0 * HALF_CIRCLE as f64).round().max(1.0) as usize;
        let at = |n: usize| (from + (to - from) * n as f64 / steps as f64).to_radians();
        (0..=steps).map(|n| polar(centre, r, at(n))).collect()
    };
    match letter {
        // The foot of the stem, up, round the bowl and back until shortly before the stem.
        'p' => [vec![[0.0, -0.62]], arc([r, top - r], 180.0, -90.0)].concat(),
        // The bar from shortly behind the round, its end, and round.
        'e' => {
            let middle = f64::midpoint(top, foot);
            [vec![[2.6 * HALF_WIDTH, middle]], arc([r, top - r], 0.0, 300.0)].concat()
        }
        'n' => [vec![[0.0, foot]], arc([r, top - r], 180.0, 0.0), vec![[width, foot]]].concat(),
        'u' => [vec![[0.0, top]], arc([r, foot + r], 180.0, 360.0), vec![[width, top]]].concat(),
        _ => Vec::new(),
    }
}

/// Adds `text` to the mesh, on a plane at `heights[0]`, as high as `heights[1]`. The first letter
/// stands at `origin`; small letters are `size` high.
pub fn add(mesh: &mut Mesh, text: &str, origin: Point, size: f64, heights: [f64; 2]) {
    for (n, letter) in text.chars().enumerate() {
        let left = origin[0] + n as f64 * size * (2.0 * RADIUS + 0.46);
        let position = |[x, y]: Point| [left + size * x, origin[1] + size * y];
        add_band(mesh, &line(letter).into_iter().map(position).collect::<Vec<_>>(), size, heights);
    }
}

/// Adds a band along a line.
fn add_band(mesh: &mut Mesh, line: &[Point], size: f64, heights: [f64; 2]) {
    let half = HALF_WIDTH * size;
    let angle = |from: Point, to: Point| (to[1] - from[1]).atan2(to[0] - from[0]);
    let (mut right, mut left) = (Vec::new(), Vec::new());
    let last = line.len().saturating_sub(1);
    let (mut ends, mut before) = ([0.0; 2], None);
    for (n, &at) in line.iter().enumerate() {
        let after = (n < last).then(|| angle(at, line[n + 1]));
        let (one, other) = (before.or(after).unwrap_or(0.0), after.or(before).unwrap_or(0.0));
        let turn = (other - one + 3.0 * PI).rem_euclid(2.0 * PI) - PI;
        let across = half / (turn / 2.0).cos();
        right.push(polar(at, across, one + turn / 2.0 - PI / 2.0));
        left.push(polar(at, across, one + turn / 2.0 + PI / 2.0));
        if n == 0 {
            ends[0] = other;
        }
        ends[1] = one;
        before = after;
    }
    let (Some(&first), Some(&end)) = (line.first(), line.last()) else { return };
    let cap = |at: Point, middle: f64| -> Vec<Point> {
        [-54.0f64, -18.0, 18.0, 54.0].map(|off| polar(at, half, middle + off.to_radians())).to_vec()
    };
    left.reverse();
    let outline = [cap(first, ends[0] + PI), right.clone(), cap(end, ends[1]), left].concat();
    let [lower, upper] = heights.map(|z| mesh.level(&outline, z));
    mesh.wall(&lower, &upper);
    // The top: the two ends, and a face for each piece of the line.
    let count = right.len();
    let (near, far) = (CAP, CAP + count + CAP);
    let total = outline.len();
    let opposite = |n: usize| far + count - 1 - n;
    mesh.face((total - 1..=total + near).map(|n| upper[n % total]));
    for n in 0..count - 1 {
        let corners = [near + n, near + n + 1, opposite(n + 1), opposite(n)];
        mesh.face(corners.map(|n| upper[n]));
    }
    mesh.face((near + count - 1..=far).map(|n| upper[n]));
}
