//! Finds out whether lines of OBJ are a plan, and where it lies.
//!
//! A plan has only lines and curves, and all of its vertices are at one height: see
//! [`penup::model::Model::is_plan`]. Its bounds are those of what is drawn: vertices without a line
//! do not count, and a curve is followed, because it does not reach its control points. In a
//! browser those count, because the page has no room for more.

use crate::lines::Lines;
#[cfg(not(target_arch = "wasm32"))]
use penup::{
    curve::Point,
    model::{Corner, Model, Position, no_undo},
    protocol::Command,
    stage::NeverCancel,
};

/// The least and the greatest x and y, in mm.
type Bounds = [[f64; 2]; 2];

/// What the lines that were followed so far have in common with a plan.
#[derive(Debug, Default)]
pub(super) struct Flat {
    /// The height of all vertices.
    height: Option<f64>,
    /// The x and y of each vertex.
    points: Vec<[f64; 2]>,
    /// The bounds of what the lines of the plan reach.
    bounds: Option<Bounds>,
    /// At least as many numbers as a model needs for the lines and curves.
    numbers: usize,
    has_curves: bool,
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
                let mut number = || words.next().and_then(|word| word.parse().ok());
                let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else { return };
                self.is_in_space = *self.height.get_or_insert(z) != z;
                self.points.push([x, y]);
            }
            Some("f") => self.is_in_space = true,
            Some("l") => {
                for word in words {
                    self.numbers += 2;
                    self.reach(word);
                }
            }
            Some("curv") => {
                self.has_curves = true;
                self.numbers += 16;
                for word in words.skip(2) {
                    self.numbers += 1;
                    // A browser has no room for what follows a curve.
                    if cfg!(target_arch = "wasm32") {
                        self.reach(word);
                    }
                }
            }
            Some("parm") => self.numbers += 2 * words.count(),
            Some("usemtl" | "g") => self.numbers += 16,
            _ => {}
        }
        if self.is_in_space {
            self.points = Vec::new();
        }
    }

    /// Extends the bounds to the vertex with this number.
    fn reach(&mut self, number: &str) {
        let number = number.split('/').next().and_then(|number| number.parse::<i64>().ok());
        let count = self.points.len() as i64;
        let index = number.map(|number| if number < 0 { count + number } else { number - 1 });
        let point = index.and_then(|index| self.points.get(usize::try_from(index).ok()?));
        if let Some(point) = point {
            extend(&mut self.bounds, *point);
        }
    }

    /// The bounds of the plan that the followed `lines` make; `None` if they make none. Curves cost
    /// as much time as a plotter needs to read them, and some 40 bytes for each vertex.
    pub(super) fn bounds(&self, lines: &dyn Lines) -> Option<Bounds> {
        if self.is_in_space {
            return None;
        }
        let mut bounds = self.bounds;
        if self.has_curves {
            self.extend_by_curves(lines, &mut bounds)?;
        }
        bounds
    }

    #[cfg(target_arch = "wasm32")]
    #[allow(clippy::unnecessary_wraps, reason = "elsewhere the lines may be refused")]
    fn extend_by_curves(&self, _: &dyn Lines, _: &mut Option<Bounds>) -> Option<()> {
        Some(())
    }

    /// Extends `bounds` to what the curves reach; `None` if a plotter would refuse a line.
    #[cfg(not(target_arch = "wasm32"))]
    fn extend_by_curves(&self, lines: &dyn Lines, bounds: &mut Option<Bounds>) -> Option<()> {
        let mut vertices = vec![Position::ORIGIN; self.points.len()];
        let mut corners = vec![Corner::<u32>::ZERO; self.numbers];
        let mut model = Model::new(&mut vertices, &mut corners);
        for line in lines.in_order() {
            let undo = &mut no_undo;
            let added = match Command::parse(&line.sent).ok()? {
                Command::Vertex(position) => model.add_vertex(position, undo),
                Command::Polyline(numbers) => model.add_polyline(numbers.iter(), undo),
                Command::Degree(degree) => model.set_degree(degree),
                Command::Curve { ends, control } => model.begin_curve(ends, control.iter()),
                Command::Knots(knots) => model.add_knots(knots.iter()),
                Command::EndCurve => model.end_curve(undo),
                _ => Ok(()),
            };
            // The plotter says why.
            added.ok()?;
        }
        let unit = (-f64::from(model.fraction_bits())).exp2();
        let control: Vec<Point> = model.vertices().iter().map(|p| [p.x, p.y, p.z]).collect();
        // In hundredths of a millimetre, of which the library knows 256 parts, like a plotter that
        // makes a hundred steps in each.
        let scale = unit * 100.0;
        let on_page = |[x, y, _]: [i64; 3]| Some([x, y].map(|c| (c as f64 * scale) as i64));
        let mut reach = |[x, y, _]: Point, _| {
            // What lies between the file's own numbers is told in thousandths of a millimetre.
            extend(bounds, [x, y].map(|c| (f64::from(c) * unit * 1000.0).round() / 1000.0));
            Ok(())
        };
        model.curves().flatten(&control, &on_page, 32, &mut NeverCancel, &mut reach).ok()
    }
}

/// Extends bounds to a point.
fn extend(bounds: &mut Option<Bounds>, [x, y]: [f64; 2]) {
    let [low, high] = bounds.get_or_insert([[x, y]; 2]);
    *low = [low[0].min(x), low[1].min(y)];
    *high = [high[0].max(x), high[1].max(y)];
}
