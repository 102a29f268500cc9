//! Random convex solids with small integer coordinates, so that degenerate cases are common, and
//! eyes to see them from.
#![allow(clippy::expect_used, clippy::panic, reason = "a test that cannot go on stops")]

use penup::convex::Eye;

use crate::convex_model::Point;
use crate::random::Random;
use crate::scene_files::{ObjText, scene};

/// Points of a sphere with whole coordinates. Each of them is a corner.
pub fn on_sphere(random: &mut Random) -> Vec<Point> {
    let square = random.one_of(&[3, 5, 6, 9, 14, 17, 21, 26, 29, 41]);
    let mut points = vec![];
    for x in -6..=6 {
        for y in -6..=6 {
            for z in -6..=6 {
                if x * x + y * y + z * z == square {
                    points.push([x, y, z]);
                }
            }
        }
    }
    random.shuffle(&mut points);
    points.truncate(random.between(4, 20) as usize);
    points
}

/// A box parallel to the axes.
pub fn cuboid(random: &mut Random) -> Vec<Point> {
    let low = [0, 1, 2].map(|_| random.between(-3, 0));
    let high = [0, 1, 2].map(|_| random.between(1, 3));
    (0..8).map(|i| [0, 1, 2].map(|k| if i >> k & 1 == 0 { low[k] } else { high[k] })).collect()
}

/// A convex polygon in the plane z = 0 with whole coordinates and at least three corners.
pub fn polygon(random: &mut Random) -> Vec<Point> {
    // Directions sorted by their angle; their partial sums are the corners of a convex polygon.
    let clock = [
        [1, 0],
        [2, 1],
        [1, 1],
        [1, 2],
        [0, 1],
        [-1, 2],
        [-1, 1],
        [-2, 1],
        [-1, 0],
        [-2, -1],
        [-1, -1],
        [-1, -2],
        [0, -1],
        [1, -2],
        [1, -1],
        [2, -1],
    ];
    loop {
        let steps: Vec<i32> = clock[..8].iter().map(|_| random.between(0, 2) / 2).collect();
        let mut at = [0, 0];
        let mut corners = vec![];
        // Each direction and its opposite are used equally often, so that the polygon closes.
        for (k, direction) in clock.iter().enumerate() {
            if steps[k % 8] > 0 {
                corners.push([at[0], at[1], 0]);
                at = [at[0] + direction[0], at[1] + direction[1]];
            }
        }
        if corners.len() >= 4 {
            if corners.len() > 4 && random.between(0, 1) == 1 {
                corners.remove(random.between(0, corners.len() as i32 - 1) as usize);
            }
            return corners;
        }
    }
}

/// A right or oblique prism over a polygon.
pub fn prism(random: &mut Random) -> Vec<Point> {
    let base = polygon(random);
    let shift = [random.between(-1, 1), random.between(-1, 1), random.between(1, 3)];
    let top = base.iter().map(|p| [0, 1, 2].map(|k| p[k] + shift[k])).collect::<Vec<_>>();
    [base, top].concat()
}

/// A pyramid over a polygon.
pub fn pyramid(random: &mut Random) -> Vec<Point> {
    let mut points = polygon(random);
    points.push([random.between(-2, 3), random.between(-2, 3), random.between(1, 3)]);
    points
}

/// An octahedron, regular or not.
pub fn octahedron(random: &mut Random) -> Vec<Point> {
    (0..6)
        .map(|i| {
            let mut point = [0; 3];
            let length = random.between(1, 3);
            point[i / 2] = if i % 2 == 0 { length } else { -length };
            point
        })
        .collect()
}

/// A cube with truncated edges or corners: all signs and orders of (a, b, c).
pub fn cut_cube(random: &mut Random) -> Vec<Point> {
    let [a, b, c] =
        random.one_of(&[[1, 1, 2], [0, 1, 2], [2, 2, 1], [0, 1, 1], [3, 3, 1], [1, 1, 3]]);
    let orders: &[[i32; 3]] = &[[a, b, c], [b, c, a], [c, a, b]];
    let mut points = vec![];
    for order in orders {
        for signs in 0..8 {
            let point = [0, 1, 2].map(|k| if signs >> k & 1 == 0 { order[k] } else { -order[k] });
            if !points.contains(&point) {
                points.push(point);
            }
        }
    }
    points
}

/// A roof over a pit, often with vertices on both slopes that, seen from above, only its ridge
/// separates.
pub fn roof(random: &mut Random) -> Vec<Point> {
    let mut points = vec![[-6, 0, 4], [6, 0, 4], [0, 0, -8]];
    for side in [-1, 1] {
        for x in [-2, 2] {
            if random.between(0, 2) > 0 {
                points.push([x, 2 * side, 2]);
            }
        }
        points.push([random.between(-2, 2), 6 * side, -4]);
    }
    points
}

/// Random points, most of which are not in convex position.
pub fn any_points(random: &mut Random) -> Vec<Point> {
    let reach = random.between(1, 3);
    (0..random.between(1, 14)).map(|_| [0, 1, 2].map(|_| random.between(-reach, reach))).collect()
}

/// The number of random solids that a test compares: `PENUP_SOLIDS`, or else 4,000.
pub fn solid_count() -> u32 {
    crate::wish::wish("PENUP_SOLIDS", 4000) as u32
}

/// A random solid of any kind with its vertices in any order. Sometimes vertices are repeated, and
/// sometimes the coordinates are as large as possible.
pub fn any_solid(random: &mut Random) -> Vec<Point> {
    let kinds = [on_sphere, cuboid, prism, pyramid, octahedron, cut_cube, roof, any_points];
    let mut points = random.one_of(&kinds[..])(random);
    if random.between(0, 4) == 0 {
        let point = random.one_of(&points);
        points.push(point);
    }
    random.shuffle(&mut points);
    if random.between(0, 5) == 0 {
        // No coordinate is larger than 11, so the product stays within 2^30.
        let scale = random.between(50_000_000, 90_000_000);
        points.iter_mut().flatten().for_each(|part| *part *= scale);
    }
    points
}

/// A random eye: a direction along an axis, a diagonal or any other, or a point that is often level
/// with vertices and sometimes inside.
pub fn any_eye(random: &mut Random, points: &[Point]) -> Eye {
    let largest = points.iter().flatten().map(|part| part.abs()).max().unwrap_or(1).max(1);
    let unit = i64::from(if largest > 100 { largest / 11 } else { 1 });
    match random.between(0, 4) {
        0 => {
            let mut direction = [0; 3];
            direction[random.between(0, 2) as usize] = i64::from(random.one_of(&[-1, 1]));
            Eye::Towards(direction)
        }
        1 => loop {
            let direction = [0, 1, 2].map(|_| i64::from(random.between(-3, 3)));
            if direction != [0; 3] {
                return Eye::Towards(direction);
            }
        },
        2 => Eye::At([0, 1, 2].map(|_| i64::from(random.between(-12, 12)) * unit)),
        3 => {
            // The eye is level with vertices in one or two coordinates.
            let mut position = [0, 1, 2].map(|_| i64::from(random.between(-9, 9)) * unit);
            for _ in 0..2 {
                let axis = random.between(0, 2) as usize;
                position[axis] = i64::from(random.one_of(points)[axis]);
            }
            Eye::At(position)
        }
        _ => {
            // The eye is on the line through two vertices.
            let (a, b) = (random.one_of(points), random.one_of(points));
            let times = i64::from(random.between(2, 4));
            Eye::At(
                [0, 1, 2].map(|k| i64::from(a[k]) + times * (i64::from(b[k]) - i64::from(a[k]))),
            )
        }
    }
}

/// Reads the vertices and faces of a scene with whole coordinates. Indices of corners count from 0.
pub fn read_scene(name: &str) -> (Vec<Point>, Vec<Vec<u16>>) {
    let path = scene(&format!("{name}.obj"));
    let text = std::fs::read_to_string(&path).expect("a scene that can be read");
    let ObjText { vertices, elements } = ObjText::read(&text);
    let faces = elements.into_iter().filter(|element| element.is_face);
    (
        vertices.into_iter().map(|vertex| vertex.map(whole)).collect(),
        faces.map(|face| face.vertices.iter().map(|vertex| *vertex as u16).collect()).collect(),
    )
}

/// # Panics
/// Panics if a coordinate is not a whole number.
fn whole(coordinate: f64) -> i32 {
    assert_eq!(coordinate.fract(), 0.0, "a whole coordinate is expected");
    coordinate as i32
}

/// A random rotation: three perpendicular directions of length 1.
pub fn any_rotation(random: &mut Random) -> [[f64; 3]; 3] {
    let [w, x, y, z] = loop {
        let q = [0; 4].map(|_| f64::from(random.between(-1000, 1000)) / 1000.0);
        let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
        if length > 0.1 {
            break q.map(|part| part / length);
        }
    };
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// The error bound of the coordinates that [`as_decimals`] returns, in its unit.
pub fn half_of_the_last(decimals: i32) -> u32 {
    (f64::from(1 << 28) / 10f64.powi(decimals)).ceil() as u32 + 1
}

/// The solid scaled to radius 1, rotated, written with this number of decimals, and read in units
/// of 2^-29.
pub fn as_decimals(points: &[Point], rotation: &[[f64; 3]; 3], decimals: i32) -> Vec<Point> {
    let square = |point: &Point| point.iter().map(|part| f64::from(part * part)).sum::<f64>();
    let radius = points.iter().map(square).fold(0.0, f64::max).sqrt();
    let written = |number: f64| (number * 10f64.powi(decimals)).round() / 10f64.powi(decimals);
    points
        .iter()
        .map(|point| {
            [0, 1, 2].map(|row| {
                let turned: f64 = (0..3).map(|k| rotation[row][k] * f64::from(point[k])).sum();
                (written(turned / radius) * f64::from(1 << 29)).round() as i32
            })
        })
        .collect()
}
