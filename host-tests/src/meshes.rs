//! Meshes of any size for measurements.

use crate::random::Random;
use crate::scene_files::Vector;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Faces between vertices.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// The positions of the vertices.
    pub vertices: Vec<Vector>,
    /// The numbers of the vertices of each face, counted from 0.
    pub faces: Vec<Vec<u32>>,
}

impl Mesh {
    /// The lines of an OBJ file, with six decimals.
    pub fn obj(&self) -> Vec<String> {
        let vertex = |[x, y, z]: &Vector| format!("v {x:.6} {y:.6} {z:.6}");
        let face = |face: &Vec<u32>| {
            let corners: Vec<_> = face.iter().map(|vertex| (vertex + 1).to_string()).collect();
            format!("f {}", corners.join(" "))
        };
        self.vertices.iter().map(vertex).chain(self.faces.iter().map(face)).collect()
    }

    /// Divides each face into triangles that have its first vertex.
    #[must_use]
    pub fn in_triangles(mut self) -> Self {
        let triangles = |face: &Vec<u32>| {
            let pairs = face.get(1..).unwrap_or_default().windows(2);
            pairs.map(|pair| vec![face[0], pair[0], pair[1]]).collect::<Vec<_>>()
        };
        self.faces = self.faces.iter().flat_map(triangles).collect();
        self
    }
}

/// So many cubes of side 1 in each direction, with gaps of 1 between them. Those of the directory
/// `scenes` are such.
pub fn lattice(cubes: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for number in 0..cubes.pow(3) {
        let first = 8 * number;
        let corner = [number % cubes, number / cubes % cubes, number / cubes.pow(2)];
        let bottom = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
        for shift in bottom.into_iter().chain(bottom.map(|[x, y, _]| [x, y, 1])) {
            mesh.vertices.push([0, 1, 2].map(|axis| f64::from(2 * corner[axis] + shift[axis])));
        }
        let sides =
            [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
        mesh.faces.extend(sides.map(|side| side.map(|vertex| first + vertex).to_vec()));
    }
    mesh
}

/// A torus of radii 2 and 1, made of `around` by `across` faces of four vertices.
pub fn torus(around: u32, across: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let turn = |part: u32, whole: u32| TAU * f64::from(part) / f64::from(whole);
    for n in 0..around * across {
        let (u, v) = (turn(n / across, around), turn(n % across, across));
        let radius = 2.0 + v.cos();
        mesh.vertices.push([radius * u.cos(), radius * u.sin(), v.sin()]);
        let at = |i: u32, j: u32| (n / across + i) % around * across + (n % across + j) % across;
        mesh.faces.push(vec![at(0, 0), at(1, 0), at(1, 1), at(0, 1)]);
    }
    mesh
}

/// So many triangles of sides of some 0.3 at random places in a cube of side 2, most of which pass
/// through others.
pub fn soup(triangles: u32) -> Mesh {
    let mut random = Random::new(1);
    let mut mesh = Mesh::default();
    for number in 0..triangles {
        let mut place = |size: i32| [(); 3].map(|()| f64::from(random.between(-size, size)) / 1e6);
        let middle = place(1_000_000);
        for _ in 0..3 {
            let by = place(150_000);
            mesh.vertices.push([0, 1, 2].map(|axis| middle[axis] + by[axis]));
        }
        mesh.faces.push([0, 1, 2].map(|corner| 3 * number + corner).to_vec());
    }
    mesh
}

/// Divides each side of an icosahedron by two until there are at least so many faces.
pub fn icosphere(faces: usize) -> Mesh {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for [one, long] in [[1.0, golden], [1.0, -golden], [-1.0, golden], [-1.0, -golden]] {
        vertices.extend([[0.0, one, long], [one, long, 0.0], [long, 0.0, one]]);
    }
    let distance = |a: Vector, b: Vector| -> f64 {
        (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>()
    };
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let near = |p: usize, q: usize| distance(vertices[p], vertices[q]) < 4.1;
                if near(a, b) && near(b, c) && near(c, a) {
                    triangles.push([a, b, c].map(|vertex| vertex as u32));
                }
            }
        }
    }
    let unit = |at: Vector| at.map(|part| part / distance(at, [0.0; 3]).sqrt());
    vertices.iter_mut().for_each(|vertex| *vertex = unit(*vertex));
    while triangles.len() < faces {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [a, b] = [a, b].map(|vertex| vertices[vertex as usize]);
                vertices.push(unit([a[0] + b[0], a[1] + b[1], a[2] + b[2]]));
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Mesh { vertices, faces: triangles.into_iter().map(Vec::from).collect() }
}

/// Hills over a square, of about so many triangles.
pub fn terrain(triangles: usize) -> Mesh {
    let side = (triangles as f64 / 2.0).sqrt().round() as u32;
    let mut vertices = Vec::new();
    for row in 0..=side {
        for column in 0..=side {
            let [x, y] = [column, row].map(|at| f64::from(at) / f64::from(side) * 2.0 - 1.0);
            let z = 0.15 * (7.0 * x).sin() * (5.0 * y).cos() + 0.05 * (23.0 * x + 17.0 * y).sin();
            vertices.push([x, y, z]);
        }
    }
    let mut faces = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let at = row * (side + 1) + column;
            faces.push(vec![at, at + 1, at + side + 2]);
            faces.push(vec![at, at + side + 2, at + side + 1]);
        }
    }
    Mesh { vertices, faces }
}
