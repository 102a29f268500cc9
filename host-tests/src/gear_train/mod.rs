//! The scene of the picture that README begins with: a train of wheels that a crank turns, on a
//! plate with the project's name.

mod lettering;
mod mesh;
mod wheel;

use mesh::{Mesh, Point, circle, polar};
use std::f64::consts::{PI, TAU};
use wheel::{Spokes, Wheel};

/// The top of the plate.
const PLATE: f64 = 0.0;

/// The scene as an OBJ file.
pub fn obj() -> String {
    let mut mesh = Mesh::default();
    plate(&mut mesh);
    train(&mut mesh);
    mesh.obj("gears: made by host-tests/src/gear_train")
}

/// Adds the plate with its bolts and the name.
fn plate(mesh: &mut Mesh) {
    let [left, right, front, back] = [-42.0, 40.0, -34.0, 24.0];
    let rounded = |inset: f64, radius: f64| -> Vec<Point> {
        let r = radius - inset;
        let corners = [
            ([right - radius, front + radius], 1.5),
            ([right - radius, back - radius], 0.0),
            ([left + radius, back - radius], 0.5),
            ([left + radius, front + radius], 1.0),
        ];
        let corner = |(centre, from): ([f64; 2], f64)| {
            (0..=6).map(move |n| polar(centre, r, PI * (from + f64::from(n) / 12.0)))
        };
        corners.into_iter().flat_map(corner).collect()
    };
    mesh.name("plate");
    let outer = rounded(0.0, 5.0);
    let lowest = mesh.level(&outer, PLATE - 4.0);
    let edge = mesh.level(&outer, PLATE - 1.0);
    let top = mesh.level(&rounded(1.0, 5.0), PLATE);
    mesh.wall(&lowest, &edge);
    mesh.wall(&edge, &top);
    mesh.face_below(&lowest);
    mesh.face(top);
    for (n, [x, y]) in
        [[left, front], [right, front], [right, back], [left, back]].into_iter().enumerate()
    {
        let inward = |at: f64| at - 6.0 * at.signum();
        let centre = [inward(x), inward(y)];
        mesh.name("bolt");
        mesh.revolved(centre, 24, &[(2.7, PLATE), (2.7, PLATE + 0.5)]);
        let hexagon = circle(centre, 2.1, 6, 0.37 + 0.9 * n as f64);
        mesh.prism(&hexagon, PLATE + 0.5, PLATE + 2.2);
    }
    mesh.name("name");
    lettering::add(mesh, "penup", [-17.5, -24.6], 8.2, [PLATE, PLATE + 1.1]);
}

/// Adds the wheels, their bearings and the crank.
fn train(mesh: &mut Mesh) {
    let great = Wheel { centre: [-19.0, 1.0], teeth: 36, gap: 0.21, heights: [2.6, 5.6] };
    let pinion = great.meshing(15, 0.42);
    let upper = Wheel { teeth: 30, gap: 0.13, heights: [9.0, 12.0], ..pinion };
    let driver = Wheel { heights: [8.4, 13.0], ..upper.meshing(12, -0.62) };

    mesh.name("great wheel");
    let boss = |mesh: &mut Mesh, centre: Point, z: f64| {
        mesh.revolved(centre, 32, &[(4.4, PLATE), (3.6, PLATE + z)]);
    };
    boss(mesh, great.centre, 1.6);
    mesh.revolved(great.centre, 24, &[(2.0, 1.6), (2.0, 2.6)]);
    let spokes = Spokes {
        count: 6,
        half_widths: [1.5, 1.05],
        radii: [6.0, 13.6],
        rim: 14.6,
        height: 4.6,
        corner: 1.3,
    };
    let hub = [(4.2, 4.6), (4.2, 7.0), (1.8, 7.0), (1.8, 9.6), (1.3, 10.1)];
    great.add_spoked(mesh, &spokes, 36, &hub);

    mesh.name("second arbor");
    boss(mesh, pinion.centre, 1.6);
    mesh.revolved(pinion.centre, 24, &[(2.0, 1.6), (2.0, 2.0)]);
    let pinion = Wheel { heights: [2.0, 6.6], ..pinion };
    pinion.add_solid(mesh, 30, &[(3.4, 6.6), (3.4, 9.0)]);
    let spokes = Spokes {
        count: 5,
        half_widths: [1.4, 1.0],
        radii: [5.0, 10.7],
        rim: 11.7,
        height: 11.0,
        corner: 1.2,
    };
    let hub = [(3.4, 11.0), (3.4, 13.6), (1.8, 13.6), (1.8, 16.0), (1.3, 16.5)];
    upper.add_spoked(mesh, &spokes, 30, &hub);

    mesh.name("crank");
    boss(mesh, driver.centre, 6.0);
    mesh.revolved(driver.centre, 24, &[(2.0, 6.0), (2.0, 8.4)]);
    driver.add_solid(mesh, 36, &[(2.6, 13.0), (2.6, 16.0)]);
    let (angle, reach) = (-0.75, 15.0);
    let handle = polar(driver.centre, reach, angle);
    let lean = ((3.6f64 - 2.4) / reach).acos();
    let around = |centre: Point, radius: f64, from: f64, to: f64| -> Vec<Point> {
        (0..=12).map(|n| polar(centre, radius, from + (to - from) * f64::from(n) / 12.0)).collect()
    };
    let outline = [
        around(driver.centre, 3.6, angle + lean, angle + TAU - lean),
        around(handle, 2.4, angle - lean, angle + lean),
    ]
    .concat();
    mesh.prism(&outline, 16.0, 18.0);
    mesh.prism(&circle(driver.centre, 2.3, 6, 0.5), 18.0, 19.8);
    mesh.revolved(driver.centre, 24, &[(1.2, 19.8), (1.2, 20.8), (0.8, 21.2)]);
    let mut knob = vec![(1.1, 18.0), (1.1, 19.2), (1.9, 19.2)];
    for n in 1..10 {
        let turn = PI * (0.13 + 0.087 * f64::from(n));
        knob.push((2.9 * turn.sin(), 22.9 - 4.2 * turn.cos()));
    }
    mesh.revolved(handle, 24, &knob);
}
