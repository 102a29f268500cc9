use super::*;

const FAR: i32 = COORDINATE_LIMIT;

#[test]
fn the_largest_coordinates_do_not_overflow() {
    let corners = |n: u32| {
        let sign = |bit: u32| if n >> bit & 1 == 0 { FAR } else { -FAR };
        Vertex::new(sign(0), sign(1), sign(2))
    };
    let mut largest = 0;
    for n in 0..1 << 12 {
        let [a, b, c, d] = [n, n >> 3, n >> 6, n >> 9].map(corners);
        let side = plane_side(a, b, c, d);
        assert_eq!(side, -plane_side(b, a, c, d));
        largest = largest.max(side);
        assert_eq!(
            page_side(Projection::Perspective, a, b, c),
            page_side(Projection::Perspective, b, c, a)
        );
    }
    // The largest tetrahedron in a cube takes a third of it: 6 x (1/3) x (2^20)^3.
    assert_eq!(largest, 2 << 60);
}

#[test]
fn sides_and_offsets_have_their_values_and_not_only_their_signs() {
    use Projection::{Parallel, Perspective};
    let (a, b, c) = (Vertex::new(3, 5, 7), Vertex::new(13, 4, 9), Vertex::new(2, 15, 11));
    // 10 x 10 - (-1) x (-1), and 3 (44 - 135) - 5 (143 - 18) + 7 (195 - 8).
    assert_eq!(page_side(Parallel, a, b, c), 99);
    assert_eq!(page_side(Perspective, a, b, c), 411);
    assert_eq!(page_side(Parallel, b, a, c), -99);
    assert_eq!(page_side(Parallel, a, b, Vertex::new(23, 3, 0)), 0);
    assert_eq!(page_offset(Parallel, Axis::X, a, b), 10);
    assert_eq!(page_offset(Parallel, Axis::Y, a, b), -1);
    // 13 x 7 - 3 x 9, and 4 x 7 - 5 x 9.
    assert_eq!(page_offset(Perspective, Axis::X, a, b), 64);
    assert_eq!(page_offset(Perspective, Axis::Y, a, b), -17);
    // A point on the line beyond b, but deeper by 3 or nearer by 4.
    let beyond = |dz: i32| Vertex::new(23, 3, 11 + dz);
    for (projection, axis, dz, side) in [
        (Parallel, Axis::X, 3, 30),
        (Parallel, Axis::X, -4, -40),
        (Parallel, Axis::Y, 3, 3),
        (Parallel, Axis::Y, -4, -4),
        (Perspective, Axis::X, 3, 30),
        (Perspective, Axis::Y, -4, -4),
    ] {
        assert_eq!(line_side(projection, axis, a, b, beyond(dz)), side, "{axis:?} {dz}");
    }
}

#[test]
fn the_margin_of_a_plane_grows_with_the_differences_of_each_coordinate() {
    let a = Vertex::new(5, -3, 9);
    for (n, margin) in [(1, 18 * (1 + 1) + 6), (4, 18 * 4 * (4 + 1) + 6)] {
        for to in [[n, 0, 0], [0, n, 0], [0, 0, n], [-n, 0, 0], [0, 0, -n]] {
            let far = Vertex::new(5 + to[0], to[1] - 3, 9 + to[2]);
            for [b, c, d] in [[far, a, a], [a, far, a], [a, a, far]] {
                assert_eq!(plane_side_margin(a, b, c, d, 1), margin, "{to:?}");
            }
        }
    }
    // 18 x 4 x (4 + 3) x 3, and 6 x 3^3.
    let b = Vertex::new(5, -3, 13);
    assert_eq!(plane_side_margin(a, b, a, a, 3), 1512 + 162);
}

#[test]
fn the_margin_of_a_plane_saturates_at_every_error_bound() {
    // Up to 2^21 the parts of a difference are joined bit by bit.
    for most in [0, 1, 1000, 2 * COORDINATE_LIMIT - 1, 2 * COORDINATE_LIMIT] {
        let b = Vertex::new(most - COORDINATE_LIMIT, 5, 5);
        let a = Vertex::new(-COORDINATE_LIMIT, 5, 5);
        // The squares of the error bounds after the fifth exceed 2^63.
        for error_bound in [1, 2, 65_535, 1_048_576, 3_037_000_499, 3_037_000_500, u32::MAX] {
            let (m, d) = (i128::from(most), i128::from(error_bound));
            let exact = 18 * d * m * (m + d) + 6 * d * d * d;
            let margin = plane_side_margin(a, b, a, a, error_bound);
            assert_eq!(i128::from(margin), exact.min(i64::MAX.into()), "{most} {error_bound}");
        }
    }
    let [low, high] = [-COORDINATE_LIMIT, COORDINATE_LIMIT].map(|c| Vertex::new(c, c, c));
    let skew = Vertex::new(COORDINATE_LIMIT - 1, 0, -1);
    assert_eq!(plane_side_margin(low, high, skew, low, u32::MAX), i64::MAX);
}

#[test]
fn a_plane_asks_the_same_as_four_points() {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    for _ in 0..2000 {
        // Far corners of the range, where the products are greatest, and small coordinates, where
        // points coincide.
        let limit = if random() % 2 == 0 { COORDINATE_LIMIT } else { 2 };
        let mut coordinate = || match random() % 3 {
            0 => -limit,
            1 => limit,
            _ => random() as i32 % (limit + 1),
        };
        let [a, b, c, d] = [(); 4].map(|()| Vertex::new(coordinate(), coordinate(), coordinate()));
        assert_eq!(Plane::through(a, b, c).side(d), plane_side(a, b, c, d));
    }
}

#[test]
fn four_points_of_the_model_lie_in_a_plane_or_not() {
    let points = |x: i32, y: i32, z: i32| [[3, 5, 7], [13, 4, 9], [2, 15, 11], [x, y, z]];
    // (3, 5, 7) + m (10, -1, 2) + n (-1, 10, 4)
    for (m, n) in [(1, 1), (-2, 3), (4, -1), (0, 5)] {
        let at = [3 + 10 * m - n, 5 - m + 10 * n, 7 + 2 * m + 4 * n];
        let exact = Precision::default();
        assert!(are_coplanar(points(at[0], at[1], at[2]), exact));
        for (dx, dy, dz) in [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)] {
            assert!(!are_coplanar(points(at[0] + dx, at[1] + dy, at[2] + dz), exact));
        }
    }
}

/// Returns a source of pseudo-random numbers.
fn scattered(n: i64) -> impl Fn(i64) -> i64 {
    move |k| (n * 7919 + k * 104_729) * (n * 31 + k * 17 + 5) % 1_000_003
}

#[test]
fn points_of_one_plane_are_known_however_they_were_rounded() {
    for n in 1..4000i64 {
        let number = scattered(n);
        let written = 1 + (n % 40) as i32;
        // A point and two steps, all whole, and errors of up to `written`.
        let [a, u, v] = [0, 3, 6].map(|k| [0, 1, 2].map(|axis| (number(k + axis) * 40) as i32));
        let position = |i: i32, j: i32, k: i64| {
            [0, 1, 2].map(|axis: usize| {
                let off = number(k + axis as i64) as i32 % (written + 1);
                a[axis] + i * u[axis] / 4 * 4 + j * v[axis] / 4 * 4 + off
            })
        };
        let points = [
            position(0, 0, 20),
            position(4, 0, 30),
            position(0, 4, 40),
            position((n % 9) as i32 - 4, (n % 7) as i32 - 3, 50),
        ];
        let precision = Precision { written: written as u32, unit: 1 };
        let area = cross([0, 1, 2].map(|n| i64::from(u[n])), [0, 1, 2].map(|n| i64::from(v[n])));
        if area.iter().any(|part| part.unsigned_abs() > 1 << 44) {
            assert!(are_coplanar(points, precision), "{n}: {points:?}");
        }
    }
}

#[test]
fn the_largest_model_and_the_largest_error_do_not_overflow() {
    let far = 1 << 30;
    let points = [[-far, -far, -far], [far, -far, far], [-far, far, far], [far, far, -far]];
    for written in [1, 1 << 20, 1 << 30] {
        assert!(!are_coplanar(points, Precision { written, unit: 1 }));
    }
    let line = [points[0], points[1], points[2]];
    assert!(!are_in_line(line, Precision { written: 1 << 24, unit: 1 }));
}

#[test]
fn a_point_off_the_plane_is_off_it() {
    let precision = Precision { written: 500, unit: 1 };
    let side = 1_000_000;
    let of_plane = |z| [[0, 0, 0], [side, 0, 0], [0, side, 0], [side / 3, side / 3, z]];
    assert!(are_coplanar(of_plane(999), precision));
    assert!(!are_coplanar(of_plane(1300), precision));
    // If a triangle is hardly larger than the precision, its plane is taken from its corners as
    // they are.
    let side = 20_000;
    let of_small = |z| [[0, 0, 0], [side, 0, 0], [0, side, 0], [side, side, z]];
    assert!(are_coplanar(of_small(1), precision) && !are_coplanar(of_small(20), precision));
}

#[test]
fn the_margin_covers_every_rounding() {
    for n in 1..4000i64 {
        let number = scattered(n);
        let error_bound = 1 + (n % 9) as i32;
        let reach = 1 << (n % 17 + 2);
        let part = |k: i64| number(k) as i32 % reach;
        // Four points of the plane z = x, each moved by up to half of `error_bound`.
        let point = |k: i64| {
            let off = |m: i64| number(k + m) as i32 % (error_bound / 2 + 1);
            let (x, y) = (part(k), part(k + 1));
            Vertex::new(x + off(2), y + off(3), x + off(4))
        };
        let [a, b, c, d] = [0, 10, 20, 30].map(point);
        let margin = plane_side_margin(a, b, c, d, error_bound as u32);
        assert!(plane_side(a, b, c, d).abs() <= margin, "{n}");
    }
}

#[test]
fn positions_far_along_a_long_edge_are_distinguished() {
    let near_end = EdgeParameter { numerator: (1 << 62) - 1, denominator: 1 << 62 };
    let nearer_end = EdgeParameter { numerator: u64::MAX - 1, denominator: u64::MAX };
    assert!(near_end < nearer_end && nearer_end < EdgeParameter::END);
    assert!(
        near_end != nearer_end
            && near_end != EdgeParameter::END
            && EdgeParameter::START != EdgeParameter::END
    );
    let along = |numerator, denominator| EdgeParameter { numerator, denominator };
    assert_eq!(along(7, 21), along(1, 3));
    assert_ne!(along(7, 21), along(8, 21));
    assert!(along(1, 3) < along(2, 5) && along(3, 5) > along(4, 7));
    assert_eq!(EdgeParameter::zero_between(0, 7), EdgeParameter::START);
    assert_eq!(EdgeParameter::zero_between(7, 0), EdgeParameter::END);
}

/// Whatever lies in a plane lies in one for [`are_coplanar`], too, once each coordinate is off by
/// as much as it may be, in the directions that matter most.
#[test]
fn points_of_a_plane_stay_in_it_within_their_errors() {
    let mut state = 1u32;
    let mut random = |reach: i32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as i32 % (2 * reach + 1) - reach
    };
    let mut tried = 0;
    for round in 0..4000 {
        let off = [1, 2, 5, 40, 300][round % 5];
        let reach = 90 * off;
        let a = [(); 3].map(|()| random(reach));
        let [u, v] = [(); 2].map(|()| [(); 3].map(|()| random(reach)));
        let (along, across) = (random(3), random(3));
        let add = |to: [i32; 3]| [0, 1, 2].map(|n| a[n] + to[n]);
        let w = [0, 1, 2].map(|n| along * u[n] + across * v[n]);
        let exact = [a, add(u), add(v), add(w)];
        let precision = Precision { written: off.unsigned_abs(), unit: off.unsigned_abs() };
        assert!(are_coplanar(exact, precision));
        // How the determinant changes with each coordinate, by trying it.
        let height = |points: [[i32; 3]; 4]| {
            let [a, points @ ..] = points;
            let [u, v, w] = points.map(|to| difference(to, a));
            dot(cross(u, v), w)
        };
        for sign in [1, -1] {
            let mut moved = exact;
            for point in 0..4 {
                for axis in 0..3 {
                    let mut nearby = exact;
                    nearby[point][axis] += 1;
                    let slope = height(nearby).signum() as i32;
                    moved[point][axis] += sign * off * if slope == 0 { 1 } else { slope };
                }
            }
            let [u, v] = [1, 2].map(|to| difference(moved[to], moved[0]));
            let side = largest(u).max(largest(v)).max(largest([0, 1, 2].map(|n| v[n] - u[n])));
            if largest(cross(u, v)) >= WIDTHS * i64::from(off) * side {
                assert!(are_coplanar(moved, precision), "{exact:?} {moved:?}");
                tried += 1;
            }
        }
    }
    assert!(tried > 1000, "{tried}");
}

#[test]
fn the_corners_of_the_largest_cube_overflow_nothing() {
    let corner = |number: usize| {
        [0, 1, 2].map(|axis: usize| if number >> axis & 1 == 0 { -(1 << 30) } else { 1 << 30 })
    };
    let roughest = Precision { written: 1 << 30, unit: 1 << 30 };
    for number in 0..8 * 8 * 8 * 8 {
        let points = [0, 3, 6, 9].map(|shift: usize| corner(number >> shift & 7));
        let [a, b, c, d] = points;
        let [u, v, w] = [b, c, d].map(|to| [0, 1, 2].map(|n| i128::from(to[n]) - i128::from(a[n])));
        let minor = |m: usize, n: usize| u[m] * v[n] - u[n] * v[m];
        let normal = [minor(1, 2), minor(2, 0), minor(0, 1)];
        let height: i128 = (0..3).map(|n| normal[n] * w[n]).sum();
        assert_eq!(are_coplanar(points, Precision::default()), height == 0, "{points:?}");
        // The cube is narrower than 64 times this precision, which then counts as exact.
        assert_eq!(are_coplanar(points, roughest), height == 0, "{points:?}");
        let in_line = normal == [0; 3];
        assert_eq!(are_in_line([a, b, c], Precision::default()), in_line, "{points:?}");
        // An error of one unit lets no corner of the cube come into a plane of others.
        let precise = Precision { written: 1, unit: 1 };
        assert_eq!(are_coplanar(points, precise), height == 0, "{points:?}");
    }
}
