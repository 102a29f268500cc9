use super::*;
use crate::model::Elements;
use crate::stage::NeverCancel;

fn scene(projection: Projection, vertices: &[Vertex]) -> Scene<'_> {
    Scene { vertices, elements: Elements::new(&[]), projection, unrounded: Unrounded::UNKNOWN }
}

#[test]
fn places_fill_the_grid_and_keep_the_order() -> Result<(), VisibilityError> {
    let vertices = [
        Vertex::new(-1 << 19, 0, 1 << 10),
        Vertex::new(1 << 19, 3, 1 << 19),
        Vertex::new(1 << 19, 4, 1 << 10),
    ];
    for projection in [Projection::Perspective, Projection::Parallel] {
        let mut words = [0u64; 4];
        let mut scratch = Scratch::new(&mut words);
        let mut never_cancel = NeverCancel;
        let yield_counter = &mut YieldCounter::new(&mut never_cancel);
        let coarse_projection =
            CoarseProjection::new(&scene(projection, &vertices), &mut scratch, yield_counter)?;
        let xs: [u16; 3] = [0u16, 1, 2].map(|n| coarse_projection.position(n).x);
        // The ends of a seam may lie a little beside the vertices.
        assert!(xs[0] <= 2 && xs[0] < xs[1] && xs[1] <= xs[2], "{xs:?}");
        assert!(xs[2] >= 1 << (COARSE_BITS - 1) && xs[2] < 1 << COARSE_BITS);
    }
    Ok(())
}

#[test]
fn a_coarse_answer_is_never_wrong() -> Result<(), VisibilityError> {
    // Every triangle of a small lattice, seen in steep perspective.
    let vertices: std::vec::Vec<Vertex> = (0..64)
        .map(|n| Vertex::new(n % 4 * 70_001, n / 4 % 4 * 69_997, 100_000 + n / 16 * 100_003))
        .collect();
    let mut words = [0u64; 64];
    let coarse_projection = CoarseProjection::new(
        &scene(Projection::Perspective, &vertices),
        &mut Scratch::new(&mut words),
        &mut YieldCounter::new(&mut NeverCancel),
    )?;
    let mut undecided = 0;
    for (a, b, c) in
        (0..64u16).flat_map(|a| (0..64u16).flat_map(move |b| (0..64u16).map(move |c| (a, b, c))))
    {
        let coarse = coarse_side(
            coarse_projection.position(a),
            coarse_projection.position(b),
            coarse_projection.position(c),
        );
        let exact = coarse_projection.side_value(a, b, coarse_projection.end(c)).signum() as i32;
        assert!(coarse == 0 || coarse == exact, "{a} {b} {c}");
        undecided += u32::from(coarse == 0 && exact != 0);
    }
    assert!(undecided < 64 * 64 * 64 / 20, "{undecided}");
    Ok(())
}
/// Where an edge is cut, its ends are rounded to points that are none of the scene's.
#[cfg(feature = "tiles")]
#[test]
fn whatever_is_rounded_from_between_vertices_lies_within_the_margin() {
    let ends = [
        [Vertex::new(-70_000, 300, 90_001), Vertex::new(50_001, 77_000, 524_288)],
        [Vertex::new(-300, -40, 501), Vertex::new(17, 33, 777)],
        [Vertex::new(-9, 4, 11), Vertex::new(12, 13, 401)],
        // On one line of sight.
        [Vertex::new(10_000, -20_000, 300_000), Vertex::new(17_000, -34_000, 510_000)],
    ];
    for vertices in ends {
        for projection in [Projection::Perspective, Projection::Parallel] {
            let places = vertices.map(|vertex| page_position(projection, vertex));
            let [low, high] = [i64::min, i64::max].map(|choose| {
                let [x, y] = [0, 1].map(|axis: usize| choose(places[0][axis], places[1][axis]));
                (x, y)
            });
            let (low, high) = with_margin(projection, &vertices, low, high);
            for part in 0..=997 {
                let between = |a: i32, b: i32| {
                    libm::round(f64::from(a) + f64::from(b - a) * f64::from(part) / 997.0)
                };
                let [a, b] = vertices;
                let [x, y, z] =
                    [between(a.x, b.x), between(a.y, b.y), between(a.z, b.z)].map(|at| at as i32);
                let [x, y] = page_position(projection, Vertex::new(x, y, z));
                let is_within = (low.0..=high.0).contains(&x) && (low.1..=high.1).contains(&y);
                assert!(is_within, "{projection:?} {vertices:?} at {part}");
            }
        }
    }
}
