//! Hidden lines beside Open CASCADE's PolyAlgo, in parallel projections.

use crate::program::{Program, file};
use crate::{by_turns, milliseconds};
use penup::boards::host::HostBoard;
use penup::machine::{EventRing, PulserState, Settings};
use penup::plotter::{Observer, Plotter, Unobserved};
use penup::stage::{Aborted, Cancel, Stage};
use penup::view::View;
use penup::visibility::{EdgeParameter, Stretch};
use penup_host_tests::meshes::{Mesh, icosphere, lattice, soup, terrain, torus};
use penup_host_tests::scene_files::Vector;
use penup_job::room::Room;
use penup_readers::lines::JobLine;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// A mesh and a camera.
struct Scene {
    name: &'static str,
    mesh: Mesh,
    eye: Vector,
    at: Vector,
}

/// The lattice of the papers with its camera.
fn lattice_scene(name: &'static str, cubes: u32) -> Scene {
    let side = f64::from(cubes);
    let eye = [-3.0 * side - 0.37, -4.0 * side - 0.71, 5.0 * side + 0.13];
    Scene { name, mesh: lattice(cubes), eye, at: [side - 0.5; 3] }
}

fn scenes() -> Vec<Scene> {
    let centred = |name, mesh, eye| Scene { name, mesh, eye, at: [0.0; 3] };
    let eye = [2.3, -3.1, 1.9];
    let mut scenes = vec![
        lattice_scene("lattice3", 3),
        lattice_scene("lattice5", 5),
        lattice_scene("lattice7", 7),
        lattice_scene("lattice10", 10),
        centred("torus", torus(80, 30).in_triangles(), [6.0, -7.0, 5.0]),
    ];
    scenes.extend([1_280, 5_120, 20_480].map(|n| centred("icosphere", icosphere(n), eye)));
    scenes.extend([5_000, 20_000].map(|n| centred("terrain", terrain(n), eye)));
    scenes.extend([500, 2_000].map(|n| centred("random soup", soup(n), [4.3, -5.1, 3.9])));
    scenes
}

/// Stops a job when its lines are found.
#[derive(Default)]
struct NoOrder {
    is_found: bool,
}

impl Cancel for NoOrder {
    fn check(&mut self) -> Result<(), Aborted> {
        if self.is_found { Err(Aborted) } else { Ok(()) }
    }

    fn enter(&mut self, stage: Stage) {
        self.is_found |= stage == Stage::Order;
    }
}

/// Adds up the lengths of visible lines in a parallel projection, in units of the model.
#[derive(Default)]
struct Ink(f64);

impl Observer<u32> for Ink {
    fn stretch(&mut self, view: &View, stretch: &Stretch<u32>) {
        if stretch.visible {
            let [from, to] = [stretch.from, stretch.to].map(|along| image(view, stretch, along));
            self.0 += (to[0] - from[0]).hypot(to[1] - from[1]);
        }
    }

    fn start_again(&mut self) {
        self.0 = 0.0;
    }

    fn plan_bar(&mut self, _: [f64; 2], _: [f64; 2], _: u8) {}
}

/// The image of a place along the edge of a stretch.
fn image(view: &View, stretch: &Stretch<u32>, along: EdgeParameter) -> [f64; 2] {
    let (p, q) = stretch.ends;
    let part = along.numerator as f64 / along.denominator as f64;
    let between = |p: i32, q: i32| f64::from(p) * (1.0 - part) + f64::from(q) * part;
    [(p.x, q.x), (p.y, q.y)].map(|(p, q)| between(p, q) * view.image_unit())
}

/// A plotter in memory that has taken a model.
fn plotter_with(lines: &[String]) -> Plotter<'static, u32> {
    let job: Vec<_> = lines.iter().map(JobLine::command).collect();
    // They are leaked: there are few scenes.
    let ring = Box::leak(Box::new(EventRing::new()));
    let pins = Box::leak(Box::new(PulserState::new()));
    let mut board = HostBoard::new(ring, pins);
    let room = Room::for_job(&job).lend();
    let mut plotter = Plotter::with_settings(room, pins, Settings::default()).without_undo();
    for line in lines {
        board.receive(format!("{line}\n").as_bytes());
        while plotter.poll(&mut board) || !board.has_read_all() {}
        let answer = board.take_sent();
        assert!(answer.ends_with(b"ok\r\n"), "{line}: {}", String::from_utf8_lossy(&answer));
    }
    plotter
}

/// Prints a table of all scenes.
///
/// # Errors
/// A file cannot be written.
pub fn compare(python: Option<&Path>) -> Result<(), Box<dyn Error>> {
    println!(
        "| scene | faces | penup, ms | Open CASCADE, ms | times as long | drawn length, of \
         penup's |"
    );
    println!("|---|---|---|---|---|---|");
    for Scene { name, mesh, eye, at } in scenes() {
        let faces = mesh.faces.len();
        let mut lines = mesh.obj();
        let path = file(&format!("{}-{faces}.obj", name.replace(' ', "-")), &lines.join("\n"))?;
        let [eye, at] = [eye, at].map(|[x, y, z]| format!("{x},{y},{z}"));
        let path = path.display().to_string();
        let arguments = [&*path, &eye, &at];
        let other = python.map(|python| Program::start(python, "open_cascade.py", &arguments));
        let camera =
            ["$projection=orthographic".to_owned(), format!("$eye={eye}"), format!("$at={at}")];
        lines.extend(camera);
        let mut plotter = plotter_with(&lines);
        let mut ink = Ink::default();
        // It ends when the lines are found, which is an error.
        let _ = plotter.compute(&mut NoOrder::default(), &mut ink);
        let both = by_turns(other, || {
            let began = Instant::now();
            let _ = plotter.compute(&mut NoOrder::default(), &mut Unobserved);
            began.elapsed().as_secs_f64() * 1e3
        });
        let drawn = both
            .other
            .as_ref()
            .map_or(String::new(), |found| format!("{:.1} %", 100.0 * found.length / ink.0));
        let penup = milliseconds(both.penup);
        println!("| {name} | {faces} | {penup} | {} | {drawn} |", both.columns());
    }
    Ok(())
}
