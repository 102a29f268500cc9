//! Draws a cube without its hidden lines: `cargo run --example hidden_lines > cube.svg`.

use penup::fixed::Decimal;
use penup::geometry::Projection;
use penup::model::{Corner, Model, Position, no_undo};
use penup::stage::{NeverCancel, Scratch, SinkFull};
use penup::view::{Camera, Lens, Pose, View, project_scene};
use penup::visibility::{
    EdgeParameter, Options, Scene, Stretch, StretchSink, Unrounded, find_stretches,
};

const FACES: [[i32; 4]; 6] =
    [[1, 4, 3, 2], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];

/// Prints each visible stretch as a line of an SVG.
struct Svg<'a>(&'a View);

impl StretchSink for Svg<'_> {
    fn stretch(&mut self, Stretch { ends: (p, q), from, to, .. }: Stretch) -> Result<(), SinkFull> {
        let point = |at: EdgeParameter| {
            let part = at.numerator as f64 / at.denominator as f64;
            let between = |p: i32, q: i32| f64::from(p) * (1.0 - part) + f64::from(q) * part;
            let depth = match self.0.projection() {
                Projection::Perspective => between(p.z, q.z),
                Projection::Parallel => 1.0,
            };
            [between(p.x, q.x), -between(p.y, q.y)].map(|v| v / depth * self.0.image_unit())
        };
        let ([x1, y1], [x2, y2]) = (point(from), point(to));
        println!("<line x1='{x1:.4}' y1='{y1:.4}' x2='{x2:.4}' y2='{y2:.4}'/>");
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut vertices = [Position::ORIGIN; 8];
    let mut corners = [<Corner>::ZERO; 24];
    let mut model = Model::new(&mut vertices, &mut corners);
    let refused = |error: &dyn std::fmt::Debug| format!("{error:?}");
    for z in ["0", "1"] {
        for [x, y] in [["0", "0"], ["1", "0"], ["1", "1"], ["0", "1"]] {
            let position = [Decimal::parse(x), Decimal::parse(y), Decimal::parse(z)];
            let [Ok(x), Ok(y), Ok(z)] = position else { return Err("not a number".into()) };
            model.add_vertex([x, y, z], &mut no_undo).map_err(|error| refused(&error))?;
        }
    }
    for face in FACES {
        model.add_face(face.into_iter(), &mut no_undo).map_err(|error| refused(&error))?;
    }

    let pose = Pose::Towards { eye: [4.0, -5.0, 3.0], at: [0.5; 3], up: None };
    let camera = Camera { pose, lens: Lens::Perspective };
    let view = View::new(&camera, &model).map_err(|error| refused(&error))?;
    let mut memory = vec![0; 1 << 16];
    let mut scratch = Scratch::new(&mut memory);
    let seen = project_scene(&view, &model, None, &mut scratch, &mut NeverCancel)
        .map_err(|error| refused(&error))?;
    let scene = Scene {
        vertices: seen.vertices,
        elements: seen.elements,
        projection: view.projection(),
        unrounded: Unrounded::UNKNOWN,
    };

    println!("<svg xmlns='http://www.w3.org/2000/svg' viewBox='-0.2 -0.2 0.4 0.4'");
    println!(" stroke='black' stroke-width='0.002' stroke-linecap='round'>");
    find_stretches(&scene, Options::default(), scratch, &mut NeverCancel, &mut Svg(&view))
        .map_err(|error| refused(&error))?;
    println!("</svg>");
    Ok(())
}
