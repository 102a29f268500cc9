//! Compares what is visible at points along the edges of random scenes with an answer by rays.

use super::*;
use crate::geometry::Precision;
use crate::model::Corner;
use crate::stage::NeverCancel;
use std::vec::Vec;

type Point = [f64; 3];

/// Shapes of prisms, convex and concave.
const SHAPES: [&[[i32; 2]]; 5] = [
    &[[0, 0], [2, 0], [0, 2]],
    &[[0, 0], [2, 0], [2, 2], [0, 2]],
    &[[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]],
    &[[0, 0], [2, 1], [4, 0], [3, 2], [4, 4], [2, 3], [0, 4], [1, 2]],
    &[[0, 0], [4, 0], [4, 1], [1, 1], [1, 2], [4, 2], [4, 3], [0, 3]],
];

/// Prisms at random places that may pass through each other, and bars between them.
#[derive(Default)]
struct RandomScene {
    vertices: Vec<Vertex>,
    elements: Vec<Vec<u16>>,
}

impl RandomScene {
    fn new(seed: u32) -> Self {
        let mut state = seed.wrapping_mul(0x9E37_79B9) | 1;
        let mut random = |reach: i32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as i32 % (2 * reach + 1) - reach
        };
        let mut scene = Self::default();
        for _ in 0..2 + seed % 3 {
            let shape =
                SHAPES[random(2).unsigned_abs() as usize + random(1).unsigned_abs() as usize];
            let base = [random(80_000), random(80_000), 260_000 + random(80_000)];
            let steps = [(); 3].map(|()| [(); 3].map(|()| random(15_000)));
            let (first, count) = (scene.vertices.len() as u16, shape.len() as u16);
            for top in 0..2 {
                for [along, across] in shape {
                    let [x, y, z] = [0, 1, 2].map(|axis: usize| {
                        let [u, v, w] = steps.map(|step| step[axis]);
                        base[axis] + along * u + across * v + 3 * top * w
                    });
                    scene.vertices.push(Vertex { x, y, z });
                }
            }
            scene.elements.push((first..first + count).collect());
            // Some prisms are open.
            if seed % 4 != 1 {
                scene.elements.push((first + count..first + 2 * count).rev().collect());
            }
            for n in 0..count {
                let next = (n + 1) % count;
                let side = [n, next, next + count, n + count];
                scene.elements.push(side.map(|corner| first + corner).to_vec());
            }
        }
        let last = scene.vertices.len() as u16 - 1;
        scene.elements.push([0, last].to_vec());
        scene.elements.push([2, last - 1].to_vec());
        scene
    }

    fn corners(&self) -> Vec<Corner> {
        let corners = self.elements.iter().flat_map(|element| {
            let is_bar = element.len() == 2;
            let last = element.len() - 1;
            element.iter().enumerate().map(move |(n, &to)| Corner::new(to, is_bar, n == last))
        });
        corners.collect()
    }

    fn point(&self, vertex: u16) -> Point {
        let Vertex { x, y, z } = self.vertices[usize::from(vertex)];
        [x, y, z].map(f64::from)
    }

    /// Whether a point of an edge is visible; `None` where rounding would decide it.
    fn is_visible(&self, projection: Projection, edge: (u16, u16), at: Point) -> Option<bool> {
        let page = |[x, y, z]: Point| match projection {
            Projection::Perspective => [x / z, y / z].map(|part| part * 300_000.0),
            Projection::Parallel => [x, y],
        };
        let [px, py] = page(at);
        let mut is_visible = true;
        for face in self.elements.iter().filter(|element| element.len() > 2) {
            if face.contains(&edge.0) && face.contains(&edge.1) {
                continue;
            }
            let points: Vec<Point> = face.iter().map(|&vertex| self.point(vertex)).collect();
            let side = |n: usize, m: usize| [0, 1, 2].map(|axis| points[m][axis] - points[n][axis]);
            let normal = cross(side(0, 1), side(1, 2));
            let [a, b] = [at, points[0]].map(|point| dot(normal, point));
            // How far the plane is behind the point, along the line of sight.
            let behind = match projection {
                Projection::Perspective => (b / a - 1.0) * at[2],
                Projection::Parallel => (b - a) / normal[2],
            };
            let (mut is_inside, mut distance) = (false, f64::MAX);
            for n in 0..points.len() {
                let [[ax, ay], [bx, by]] = [n, (n + 1) % points.len()].map(|n| page(points[n]));
                let (dx, dy) = (bx - ax, by - ay);
                let along = ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy);
                let along = along.clamp(0.0, 1.0);
                let (fx, fy) = (ax + along * dx - px, ay + along * dy - py);
                distance = distance.min(libm::sqrt(fx * fx + fy * fy));
                if (ay > py) != (by > py) && px < ax + (py - ay) / dy * dx {
                    is_inside = !is_inside;
                }
            }
            if distance > 1e-3 && (!is_inside || behind > 1e-3) {
                continue;
            }
            if distance < 1e-3 && behind > 1.0 {
                continue;
            }
            if distance < 1e-3 || behind > -1e-3 || !behind.is_finite() {
                return None;
            }
            is_visible = false;
        }
        Some(is_visible)
    }
}

fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[derive(Default)]
struct Stretches(Vec<Stretch>);

impl StretchSink for Stretches {
    fn stretch(&mut self, stretch: Stretch) -> Result<(), SinkFull> {
        self.0.push(stretch);
        Ok(())
    }
}

fn stretches(scene: &Scene<'_>, options: Options, spare_bytes: usize) -> Vec<Stretch> {
    let mut words = std::vec![0; scratch_bytes(scene).div_ceil(8) + spare_bytes / 8];
    let mut found = Stretches::default();
    let result =
        find_stretches(scene, options, Scratch::new(&mut words), &mut NeverCancel, &mut found);
    assert_eq!(result, Ok(Report::default()));
    found.0
}

/// A scene in a parallel projection.
fn parallel<'a>(vertices: &'a [Vertex], corners: &'a [Corner]) -> Scene<'a, u16> {
    Scene {
        vertices,
        elements: Elements::new(corners),
        projection: Projection::Parallel,
        unrounded: Unrounded::UNKNOWN,
    }
}

#[test]
fn what_is_visible_is_what_rays_reach() {
    const SAMPLES: u32 = 12;
    let options = Options { with_hidden: true, ..Options::default() };
    let (mut visible, mut hidden, mut unclear) = (0, 0, 0);
    for seed in 0..60 {
        let projection = [Projection::Perspective, Projection::Parallel][seed as usize % 2];
        let random = RandomScene::new(seed);
        let positions = random.vertices.iter().map(|vertex| [vertex.x, vertex.y, vertex.z]);
        let positions: Vec<[i32; 3]> = positions.collect();
        let corners = random.corners();
        let unrounded = match seed % 3 {
            0 => Unrounded::UNKNOWN,
            _ => Unrounded::new(&positions, Precision::default(), 1),
        };
        let (vertices, elements) = (&random.vertices[..], Elements::new(&corners));
        let scene = Scene { vertices, elements, projection, unrounded };
        // The least memory has a grid of one cell.
        let found = stretches(&scene, options, 0);
        assert_eq!(found, stretches(&scene, options, 1 << 14), "seed {seed}");
        let visible_alone = stretches(&scene, Options::default(), 1000);
        let is_visible = |stretch: &&Stretch| stretch.visible;
        assert!(found.iter().filter(is_visible).eq(&visible_alone), "seed {seed}");
        let mut edges: Vec<(u16, u16)> = Vec::new();
        for element in &random.elements {
            for (n, &from) in element.iter().enumerate() {
                let to = element[(n + 1) % element.len()];
                edges.push((from.min(to), from.max(to)));
            }
        }
        edges.sort_unstable();
        edges.dedup();
        for edge in edges {
            let of_edge = |stretch: &&Stretch| {
                stretch.edge == Some(edge) || stretch.edge == Some((edge.1, edge.0))
            };
            let of_edge: Vec<&Stretch> = found.iter().filter(of_edge).collect();
            for sample in 0..SAMPLES {
                let part = (f64::from(sample) + 0.437) / f64::from(SAMPLES);
                let (a, b) = (random.point(edge.0), random.point(edge.1));
                let at = [0, 1, 2].map(|axis: usize| a[axis] + part * (b[axis] - a[axis]));
                let Some(expected) = random.is_visible(projection, edge, at) else {
                    unclear += 1;
                    continue;
                };
                let there = of_edge.iter().filter(|stretch| {
                    let part = if stretch.edge == Some(edge) { part } else { 1.0 - part };
                    let along = |at: EdgeParameter| at.numerator as f64 / at.denominator as f64;
                    (along(stretch.from)..along(stretch.to)).contains(&part)
                });
                let there: Vec<bool> = there.map(|stretch| stretch.visible).collect();
                assert_eq!(there, [expected], "seed {seed}, {edge:?} at {part}");
                if expected { visible += 1 } else { hidden += 1 }
            }
        }
    }
    assert!(visible > 5000 && hidden > 5000, "{visible} {hidden}");
    assert!(unclear < 1000, "{unclear}");
}

/// The seam of two triangles that pass through each other, and that of a triangle and a square.
#[test]
fn faces_that_pass_through_each_other_have_a_seam() {
    let at = |x, y, z| Vertex { x, y, z };
    let triangle = [at(-3000, -2000, 2000), at(3000, -2000, 8000), at(0, 4000, 5000)];
    let level = [at(-3500, -3000, 5100), at(3500, -3000, 5100), at(3500, 5000, 5100)];
    for corners in [3, 4] {
        let fourth = [at(-3500, 5000, 5100)];
        let vertices: Vec<Vertex> =
            triangle.into_iter().chain(level).chain(fourth.into_iter().take(corners - 3)).collect();
        let count = vertices.len() as u16;
        let corners: Vec<Corner> = (0..count)
            .map(|vertex| Corner::new(vertex, false, vertex == 2 || vertex == count - 1))
            .collect();
        let scene = parallel(&vertices, &corners);
        let with_seams = Options { with_seams: true, ..Options::default() };
        let found = stretches(&scene, with_seams, 1000);
        let seams: Vec<&Stretch> = found.iter().filter(|stretch| stretch.edge.is_none()).collect();
        // Where the slanted triangle is at 5100: at x = 100. A square counts as two triangles.
        assert_eq!(seams.len(), usize::from(count) - 5, "{found:?}");
        for seam in &seams {
            let (from, to) = seam.ends;
            assert!(seam.visible && [from, to].iter().all(|end| (end.x - 100).abs() <= 1));
            assert!((from.y - to.y).abs() > 2000, "{from:?} {to:?}");
        }
    }
}

#[test]
fn a_scene_of_more_corners_than_can_be_numbered_is_refused() {
    let vertices = [Vertex::new(0, 0, 1), Vertex::new(1, 0, 1)];
    for (count, is_refused) in [(65_535, false), (65_536, true)] {
        let corners: Vec<Corner> =
            (0..count).map(|at| Corner::new((at % 2) as u16, true, at % 2 == 1)).collect();
        let scene = parallel(&vertices, &corners);
        // One that is not refused for its number lacks memory.
        let scratch = Scratch::new(&mut []);
        let mut found = Stretches::default();
        let result =
            find_stretches(&scene, Options::default(), scratch, &mut NeverCancel, &mut found);
        let is_too_many = result == Err(VisibilityError::TooManyCorners(65_535));
        assert_eq!(is_too_many, is_refused, "{result:?}");
        assert!(result.is_err());
    }
}

/// A large square that leans a little away from the eye covers most cells. Before its farther part
/// lies a small one, and between both a bar, all within one unit of the coarse depth.
#[test]
fn a_face_hides_although_its_coarse_depth_is_that_of_a_cover() {
    for lowest in 0..32 {
        let at = |x, y, z| Vertex { x, y, z: 1000 + lowest + z };
        let cover = [(-400, 0), (400, 0), (400, 30), (-400, 30)]
            .map(|(x, far)| at(1000 * x, 1000 * (far / 15 * 400 - 400), far));
        // There the large one is at 22 or beyond.
        let small =
            [(4, 21), (9, 21), (9, 29), (4, 29)].map(|(x, y)| at(10_000 * x, 10_000 * y, 20));
        let bar = [at(45_000, 220_000, 21), at(85_000, 280_000, 21)];
        // Behind all of them, so that there are many cells.
        let others = (0..60).map(|n| at(1000 * n, 1000 * (n % 3 % 2), 90));
        let vertices: Vec<Vertex> =
            cover.into_iter().chain(small).chain(bar).chain(others).collect();
        let corners: Vec<Corner> = (0..70u16)
            .map(|vertex| {
                let is_last = matches!(vertex, 3 | 7 | 9) || vertex > 9 && vertex % 3 == 0;
                Corner::new(vertex, matches!(vertex, 8 | 9), is_last)
            })
            .collect();
        let scene = parallel(&vertices, &corners);
        let options = Options { with_hidden: true, ..Options::default() };
        let found = stretches(&scene, options, 1 << 14);
        let of_bar: Vec<&Stretch> =
            found.iter().filter(|stretch| stretch.edge == Some((8, 9))).collect();
        let [whole] = of_bar[..] else { panic!("{of_bar:?}") };
        assert!(!whole.visible, "{lowest}: {of_bar:?}");
    }
}

/// Returns the vertices, positions and corners of boxes, from the least and the greatest corner of
/// each, seen as [`seen`] describes.
fn boxes(
    boxes: &[[[i32; 3]; 2]],
    page: [[i32; 3]; 3],
) -> (Vec<Vertex>, Vec<[i32; 3]>, Vec<Corner>) {
    /// The faces of a box, anticlockwise from outside; the bits of a number choose the ends.
    const FACES: [[u16; 4]; 6] =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let corner_of = |ends: &[[i32; 3]; 2], number: usize| {
        [0, 1, 2].map(|axis: usize| ends[number >> axis & 1][axis])
    };
    let positions: Vec<[i32; 3]> =
        boxes.iter().flat_map(|ends| (0..8).map(move |n| corner_of(ends, n))).collect();
    let corners = (0..boxes.len() as u16).flat_map(|n| {
        let faces = FACES.into_iter().flat_map(|face| (0..4).zip(face));
        faces.map(move |(at, corner)| Corner::new(8 * n + corner, false, at == 3))
    });
    let corners = corners.collect();
    (seen(&positions, page), positions, corners)
}

/// Maps positions to the page by these rows, without rounding.
fn seen(positions: &[[i32; 3]], page: [[i32; 3]; 3]) -> Vec<Vertex> {
    let along = |row: [i32; 3], at: &[i32; 3]| (0..3).map(|axis| row[axis] * at[axis]).sum();
    let vertex = |at: &[i32; 3]| Vertex {
        x: along(page[0], at),
        y: along(page[1], at),
        z: along(page[2], at) + 100_000,
    };
    positions.iter().map(vertex).collect()
}

/// Returns the sum of the lengths of all visible stretches on the page, in units of the view.
fn visible_length(found: &[Stretch]) -> f64 {
    let part = |at: EdgeParameter| at.numerator as f64 / at.denominator as f64;
    let length = |stretch: &Stretch| {
        let (from, to) = stretch.ends;
        let [x, y] = [to.x - from.x, to.y - from.y].map(f64::from);
        libm::sqrt(x * x + y * y) * (part(stretch.to) - part(stretch.from))
    };
    found.iter().filter(|stretch| stretch.visible).map(length).sum()
}

/// Views from above and the front, from below, from behind, and from the side.
const PAGES: [[[i32; 3]; 3]; 4] = [
    [[5, -3, 0], [2, 3, 6], [3, 5, -4]],
    [[5, 3, 1], [1, -3, 6], [3, -5, 4]],
    [[-7, 2, 0], [1, 4, 7], [-2, -6, -5]],
    [[2, 7, 1], [-3, 1, 8], [-6, 2, 3]],
];

/// Two blocks that touch and are flush on three sides look as the one solid that they make: an L.
#[test]
fn merged_blocks_look_as_the_solid_that_they_make() {
    let merged = Options { merged_blocks: true, ..Options::default() };
    // The long block lies, and the short one stands on its end.
    let (long, short) = ([[0, 0, 0], [900, 300, 200]], [[0, 0, 200], [400, 300, 700]]);
    let profile = [[0, 0], [900, 0], [900, 200], [400, 200], [400, 700], [0, 700]];
    let solid: Vec<[i32; 3]> =
        [0, 300].into_iter().flat_map(|y| profile.map(|[x, z]| [x, y, z])).collect();
    let mut faces: Vec<Vec<u16>> = std::vec![(0..6).collect(), (6..12).rev().collect()];
    faces.extend((0..6).map(|n| [n, n + 6, (n + 1) % 6 + 6, (n + 1) % 6].to_vec()));
    let solid_corners = faces.iter().flat_map(|face| {
        (1..=face.len()).zip(face).map(|(n, &to)| Corner::new(to, false, n == face.len()))
    });
    let solid_corners: Vec<Corner> = solid_corners.collect();
    for page in PAGES {
        // In either order, because the faces are asked in the order of depth.
        for blocks in [[long, short], [short, long]] {
            let (vertices, positions, corners) = boxes(&blocks, page);
            let unrounded = Unrounded::new(&positions, Precision::default(), 1);
            let scene = Scene { unrounded, ..parallel(&vertices, &corners) };
            let apart = stretches(&scene, Options::default(), 1 << 12);
            let found = stretches(&scene, merged, 1 << 12);
            let vertices = seen(&solid, page);
            let whole =
                stretches(&parallel(&vertices, &solid_corners), Options::default(), 1 << 12);
            let [apart, found, whole] = [apart, found, whole].map(|lines| visible_length(&lines));
            assert!((found - whole).abs() < 1e-6 * whole, "{page:?}: {found}, not {whole}");
            assert!(apart > whole + 300.0, "{page:?}: {apart} {whole}");
        }
    }
}

/// The line where a block stands on another is kept, although the underside of the one and the top
/// of the other lie in one plane.
#[test]
fn a_block_that_stands_on_another_keeps_its_line() {
    let merged = Options { merged_blocks: true, ..Options::default() };
    for page in PAGES {
        let blocks = [[[0, 0, 0], [900, 700, 200]], [[300, 200, 200], [500, 400, 600]]];
        let (vertices, positions, corners) = boxes(&blocks, page);
        let unrounded = Unrounded::new(&positions, Precision::default(), 1);
        let scene = Scene { unrounded, ..parallel(&vertices, &corners) };
        let (apart, found) =
            (stretches(&scene, Options::default(), 1 << 12), stretches(&scene, merged, 1 << 12));
        assert_eq!(apart, found, "{page:?}");
    }
}
