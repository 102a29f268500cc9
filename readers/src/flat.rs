//! Finds out whether lines of OBJ are a plan, and where it lies.
//!
//! A plan has only lines and curves, and all of its vertices are at one height: see
//! [`Model::is_plan`]. Its bounds are those of what is drawn: vertices without a line do not count,
//! and a curve is followed, because it does not reach its control points.

use crate::lines::Lines;
use penup::curve::Point;
use penup::model::{Corner, Model, Position, no_undo};
use penup::protocol::Command;
use penup::stage::NeverCancel;

/// The least and the greatest x and y, in mm.
type Bounds = [[f64; 2]; 2];

/// What the lines that were followed so far have in common with a plan.
#[derive(Debug, Default)]
pub(super) struct Flat {
    /// The height of all vertices.
    height: Option<f64>,
    vertices: usize,
    /// At least as many numbers as the model needs for its lines and curves.
    numbers: usize,
    /// Whether a vertex at another height or a face was found.
    is_in_space: bool,
}

impl Flat {
    /// What all of these lines have in common with a plan.
    pub(super) fn of(lines: &dyn Lines) -> Self {
        let mut flat = Self::default();
        let mut in_order = lines.in_order();
        while let Some(line) = in_order.next().filter(|_| !flat.is_in_space) {
            flat.follow(&line.sent);
        }
        flat
    }

    /// Follows a line that is sent.
    pub(super) fn follow(&mut self, line: &str) {
        if self.is_in_space {
            return;
        }
        let mut words = line.split(' ');
        match words.next() {
            Some("v") => {
                let Some(z) = words.nth(2).and_then(|word| word.parse().ok()) else { return };
                self.is_in_space = *self.height.get_or_insert(z) != z;
                self.vertices += 1;
            }
            Some("f") => self.is_in_space = true,
            // A line takes two numbers for each vertex at most, and so does a knot.
            Some("l" | "parm") => self.numbers += 2 * words.count(),
            Some("curv" | "usemtl" | "g") => self.numbers += words.count() + 16,
            _ => {}
        }
    }

    /// The bounds of the plan that the followed lines make; `None` if they make none. It costs as
    /// much time as a plotter needs to read them, and some 40 bytes for each vertex.
    pub(super) fn bounds(&self, lines: &dyn Lines) -> Option<Bounds> {
        if self.is_in_space || self.numbers == 0 {
            return None;
        }
        let mut vertices = vec![Position::ORIGIN; self.vertices];
        let mut corners = vec![Corner::<u32>::ZERO; self.numbers];
        let mut model = Model::new(&mut vertices, &mut corners);
        let mut points = Vec::with_capacity(self.vertices);
        for line in lines.in_order() {
            let undo = &mut no_undo;
            let added = match Command::parse(&line.sent).ok()? {
                Command::Vertex(position) => {
                    points.push(place(&line.sent)?);
                    model.add_vertex(position, undo)
                }
                Command::Polyline(numbers) => model.add_polyline(numbers.iter(), undo),
                Command::Degree(degree) => model.set_degree(degree),
                Command::Curve { ends, control } => model.begin_curve(ends, control.iter()),
                Command::Knots(knots) => model.add_knots(knots.iter()),
                Command::EndCurve => model.end_curve(undo),
                _ => Ok(()),
            };
            // A plotter refuses the same line, and says why.
            added.ok()?;
        }
        let mut bounds: Option<Bounds> = None;
        let mut add = |[x, y]: [f64; 2]| {
            let [low, high] = bounds.get_or_insert([[x, y]; 2]);
            *low = [low[0].min(x), low[1].min(y)];
            *high = [high[0].max(x), high[1].max(y)];
        };
        let ends = model.elements().corners().iter().map(|corner| corner.vertex());
        ends.filter_map(|number| points.get(number as usize)).for_each(|point| add(*point));
        let unit = (-f64::from(model.fraction_bits())).exp2();
        let control: Vec<Point> = model.vertices().iter().map(|p| [p.x, p.y, p.z]).collect();
        // In hundredths of a millimetre, of which the library knows 256 parts, like a plotter that
        // makes a hundred steps in each.
        let scale = unit * 100.0;
        let on_page = |[x, y, _]: [i64; 3]| Some([x, y].map(|c| (c as f64 * scale) as i64));
        let mut point = |[x, y, _]: Point, _| {
            add([x, y].map(|c| f64::from(c) * unit));
            Ok(())
        };
        model.curves().flatten(&control, &on_page, 32, &mut NeverCancel, &mut point).ok()?;
        bounds
    }
}

/// The x and y of the line of a vertex.
fn place(line: &str) -> Option<[f64; 2]> {
    let mut numbers = line.split(' ').skip(1).map(|word| word.parse().ok());
    Some([numbers.next()??, numbers.next()??])
}
