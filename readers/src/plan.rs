//! A plan while it is read and arranged: strokes in millimetres, and the areas that may be hatched.

mod plan_lines;

#[cfg(feature = "plans")]
use crate::format::{Body, Contents};
use crate::lines::Lines;
#[cfg(feature = "plans")]
use crate::page::Page;
use crate::region::Regions;
use penup::model::PenBook;
use penup::protocol::Command;
use plan_lines::{Elements, PlanLines};
use std::collections::HashMap;

/// A point of a plan in mm: x to the right, y upward.
pub(crate) type Point = [f64; 2];

/// The number of thousandths of a millimetre in a millimetre. Coordinates are written with this
/// resolution.
const PER_MM: f64 = 1000.0;

/// The length in mm of the line that is drawn for a dot. The plotter takes points less than two
/// motor steps apart for one, and leaves out a line of one point. This is three steps where a
/// millimetre has 40, which are few.
pub(crate) const DOT: f64 = 0.08;

/// The size in mm along both axes below which a plotter leaves a line out: two steps where a
/// millimetre has 40.
const SHORTEST: f64 = 0.05;

/// The coordinate in mm from which on a plan is moved: less than the largest that plotters take.
const FARTHEST: f64 = 1e9;

/// The coordinate in mm up to which a plotter, which keeps the sign and 30 bits, divides a
/// millimetre into 1024 parts: as many as the coordinates have that are written.
const FINE: f64 = (1 << 20) as f64;

/// A polyline that the pen draws.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stroke {
    /// The points of the polyline, two or more. If it is closed, the last point equals the first.
    pub(crate) points: Vec<Point>,
    /// The pen that draws it, counted from 1.
    pub(crate) pen: u32,
    /// The number of its layer.
    pub(crate) layer: u32,
    /// The number of the element of the file that it comes from.
    pub(crate) element: u32,
    /// Whether it is a dot, whose length is the same at any scale, as long as it has two points.
    pub(crate) is_dot: bool,
}

impl Stroke {
    /// Makes a dot so long, in mm. Other strokes stay as they are.
    pub(crate) fn keep_dot(&mut self, length: f64) {
        let (true, [from, to]) = (self.is_dot, &mut self.points[..]) else { return };
        let now = (to[0] - from[0]).hypot(to[1] - from[1]);
        if now > 0.0 {
            for axis in 0..2 {
                to[axis] = from[axis] + (to[axis] - from[axis]) * length / now;
            }
        }
    }

    /// Whether the polyline ends where it begins.
    pub(crate) fn is_closed(&self) -> bool {
        self.points.len() > 2 && self.points.first() == self.points.last()
    }
}

/// An area that may be hatched: what its outlines surround.
#[derive(Debug, Clone)]
pub(crate) struct Area {
    /// The outlines. The side from the last point to the first belongs to each.
    pub(crate) outlines: Vec<Vec<Point>>,
    /// Whether an odd number of outlines surround it. Else they turn around it more often in one
    /// direction than in the other.
    pub(crate) is_even_odd: bool,
    /// The regions to which the hatching is limited.
    pub(crate) within: Regions,
    /// The pen that hatches it, counted from 1.
    pub(crate) pen: u32,
    /// The number of its layer.
    pub(crate) layer: u32,
    /// The number of the element of the file that it comes from.
    pub(crate) element: u32,
}

/// A drawing at one height.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    pub(crate) file: String,
    pub(crate) strokes: Vec<Stroke>,
    /// The areas that the file says are filled; `None` if it does not say which are.
    pub(crate) areas: Option<Vec<Area>>,
    /// The names of the layers; empty if the pens are the layers.
    pub(crate) layers: Vec<String>,
    /// The elements of the file to which the strokes belong.
    elements: Elements,
    /// The number of polylines without a length, which are not drawn.
    pub(crate) dots: usize,
}

impl Plan {
    pub(crate) fn new(file: String) -> Self {
        Self { file, ..Self::default() }
    }

    /// Begins an element of the file, to which the strokes that follow belong.
    pub(crate) fn begin(&mut self, line: usize, text: &str) {
        self.elements.push(line, text);
    }

    /// The number of the element that began last.
    pub(crate) fn element(&self) -> u32 {
        u32::try_from(self.elements.count().saturating_sub(1)).unwrap_or(u32::MAX)
    }

    /// Whether nothing is drawn.
    pub(crate) fn is_empty(&self) -> bool {
        self.strokes.is_empty()
    }

    /// Draws a polyline with a pen, counted from 1, on a layer of the same number. The points are
    /// millimetres with y upward. If there is a page, they are within it; what rounding brings
    /// outside is moved to its border.
    pub(crate) fn draw(
        &mut self,
        points: impl IntoIterator<Item = Point>,
        page: Option<[f64; 2]>,
        pen: u32,
    ) {
        self.draw_on(points, page, pen, pen);
    }

    /// Draws a polyline on a layer, see [`Plan::draw`].
    pub(crate) fn draw_on(
        &mut self,
        points: impl IntoIterator<Item = Point>,
        page: Option<[f64; 2]>,
        pen: u32,
        layer: u32,
    ) {
        let rounded = |value: f64, axis: usize| {
            let value = (value * PER_MM).round();
            let most = page.map(|page| (page[axis] * PER_MM).floor());
            most.map_or(value, |most| value.clamp(0.0, most)) / PER_MM
        };
        let position = |[x, y]: Point| [rounded(x, 0), rounded(y, 1)];
        let mut points: Vec<Point> = points.into_iter().map(position).collect();
        points.dedup();
        if points.len() < 2 {
            self.dots += 1;
            return;
        }
        let element = self.element();
        self.strokes.push(Stroke { points, pen, layer, element, is_dot: false });
    }

    /// Draws a dot on a layer, as a line of [`DOT`] to the right, or to the left at the right end
    /// of the page.
    #[cfg(any(feature = "dxf", feature = "hpgl", feature = "svg"))]
    pub(crate) fn draw_dot(&mut self, [x, y]: Point, page: Option<[f64; 2]>, pen: u32, layer: u32) {
        let is_at_end = page.is_some_and(|page| x + DOT > page[0]);
        let beside = if is_at_end { x - DOT } else { x + DOT };
        let next = self.strokes.len();
        self.draw_on([[x, y], [beside, y]], page, pen, layer);
        if let Some(dot) = self.strokes.get_mut(next) {
            dot.is_dot = true;
        }
    }

    /// Makes dots of the strokes that a plotter would leave out, because they are too short when
    /// the plan is scaled by `factor`. A stroke at whose ends others go on is a part of a longer
    /// line and stays. Up to `right` a dot goes to the right. Returns what the user should know.
    pub(crate) fn keep_short(&mut self, factor: f64, right: f64) -> Option<String> {
        let is_short = |stroke: &Stroke| {
            let size = |axis: usize| {
                let along = || stroke.points.iter().map(move |point| point[axis]);
                along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
            };
            !stroke.is_dot && size(0).max(size(1)) * factor < SHORTEST
        };
        let cell = |point: &Point| point.map(|value| (value * PER_MM).round() as i64);
        let ends = |stroke: &Stroke| {
            let first = stroke.points.first().map(cell);
            let last = stroke.points.last().map(cell).filter(|last| Some(*last) != first);
            first.into_iter().chain(last)
        };
        if !self.strokes.iter().any(is_short) {
            return None;
        }
        let mut met: HashMap<[i64; 2], u32> = HashMap::new();
        self.strokes.iter().flat_map(ends).for_each(|end| *met.entry(end).or_default() += 1);
        let mut count = 0;
        for stroke in &mut self.strokes {
            if is_short(stroke) && ends(stroke).all(|end| met.get(&end) == Some(&1)) {
                let length = (DOT / factor).max(0.002);
                let Some(&[x, y]) = stroke.points.first() else { continue };
                let beside = if x + length > right { x - length } else { x + length };
                (stroke.points, stroke.is_dot) = (vec![[x, y], [beside, y]], true);
                count += 1;
            }
        }
        let counted = super::counted(
            count,
            ["line is drawn as a dot: it is", "lines are drawn as dots: they are"],
        );
        (count > 0).then(|| format!("{counted} shorter than {SHORTEST} mm"))
    }

    /// The name of a layer.
    pub(crate) fn layer_name(&self, layer: u32) -> String {
        let name = usize::try_from(layer).ok().and_then(|layer| self.layers.get(layer));
        name.cloned().unwrap_or_else(|| format!("pen{layer}"))
    }

    /// The least and the greatest coordinates in mm; `None` if nothing is drawn.
    pub(crate) fn bounds(&self) -> Option<[Point; 2]> {
        let mut points = self.strokes.iter().flat_map(|stroke| stroke.points.iter().copied());
        let first = points.next()?;
        Some(points.fold([first, first], |[low, high], [x, y]| {
            [[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]]
        }))
    }

    /// Moves a plan without areas to the origin if its coordinates are larger than any plotter
    /// takes, or so large beside the drawing itself that a plotter would keep them too coarsely, as
    /// those of a map are. Returns what the user should know about it.
    pub(crate) fn brought_near(&mut self) -> Option<String> {
        let [low, high] = self.bounds()?;
        let farthest = low.iter().chain(&high).fold(0.0, |most: f64, it| most.max(it.abs()));
        let size = (high[0] - low[0]).max(high[1] - low[1]);
        let is_far = farthest >= FARTHEST || farthest > FINE.max(2.0 * size);
        if !is_far || self.areas.is_some() {
            return None;
        }
        let rounded = |value: f64| (value * PER_MM).round() / PER_MM;
        let by = low.map(|value| rounded(0.0 - value));
        for point in self.strokes.iter_mut().flat_map(|stroke| &mut stroke.points) {
            for axis in 0..2 {
                point[axis] = rounded(point[axis] + by[axis]);
            }
        }
        Some(format!(
            "the coordinates are too large for a plotter to keep them exactly: the drawing is \
             moved by {} and {} mm",
            by[0], by[1]
        ))
    }

    /// What the user should know about any plan.
    #[cfg(feature = "plans")]
    pub(crate) fn notes(&self) -> Vec<String> {
        left_out(self.dots, "dots have no length").into_iter().collect()
    }

    /// Ends the reading of the plan.
    #[cfg(feature = "plans")]
    pub(crate) fn contents(mut self, page: Option<Page>, mut notes: Vec<String>) -> Contents {
        notes.extend(self.brought_near());
        notes.extend(self.notes());
        Contents { body: Body::Plan(self), page, bounds: None, notes }
    }

    /// Writes the lines that are sent, and says what the user should know about their number.
    pub(crate) fn into_lines(self) -> (PlanLines, Vec<String>) {
        let mut writer = PlanLines::writer(self.file, self.elements);
        // The strokes are freed one by one.
        let short = self.strokes.into_iter().filter(|stroke| !writer.draw(stroke)).count();
        let (lines, vertices) = writer.end();
        let short = left_out(short, "too short at this scale");
        let notes = short.into_iter().chain(super::capacity(vertices)).collect();
        (lines, notes)
    }
}

/// Says why so many lines are left out, if there are any.
fn left_out(count: usize, why: &str) -> Option<String> {
    let counted = || super::counted(count, ["line is", "lines are"]);
    (count > 0).then(|| format!("{} not drawn: {why}", counted()))
}

/// The most pens that a plotter has.
#[cfg(any(feature = "dxf", feature = "gcode", feature = "svg"))]
pub(crate) const MOST_PENS: u32 = 32;

/// The pen number in the name of a layer: `1`, `2 red`, `pen3`, `Layer 4`, `layer_5`. The number
/// stands at the beginning, or after one word.
#[cfg(any(feature = "dxf", feature = "svg"))]
pub(crate) fn number_in(name: &str) -> Option<u32> {
    let name = name.trim_start().trim_start_matches(['%', '!']).trim_start();
    let word_end = name.find(|letter: char| !letter.is_alphabetic()).unwrap_or(name.len());
    let rest = name.get(word_end..)?.trim_start_matches([' ', '_', '-', '#']);
    let end = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
    let number = rest.get(..end)?.parse().ok()?;
    (1..=MOST_PENS).contains(&number).then_some(number)
}

/// Reads the lines of OBJ as a plan.
///
/// # Errors
/// The reason why they are not a plan, as the end of a sentence about the file.
pub(crate) fn of_lines(file: &str, lines: &dyn Lines) -> Result<Plan, String> {
    let mut plan = Plan::new(file.to_owned());
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut pens = PenBook::default();
    let mut height = None;
    for line in lines.in_order() {
        let mut words = line.sent.split(' ');
        let keyword = words.next().unwrap_or_default();
        match keyword {
            "v" => {
                let mut number = || words.next().and_then(|word| word.parse().ok());
                let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else {
                    return Err("has a vertex without three coordinates".to_owned());
                };
                vertices.push([x, y, z]);
            }
            "usemtl" | "g" => {
                let Ok(Command::Pen { by_material, name }) = Command::parse(&line.sent) else {
                    return Err("has a pen without a name that is read".to_owned());
                };
                let before = pens;
                pens = pens.after(by_material, name).map_err(|_| "has too many pens".to_owned())?;
                if pens.is_by_material() != before.is_by_material() {
                    // Groups choose no pens in a file with materials.
                    for stroke in &mut plan.strokes {
                        (stroke.pen, stroke.layer) = (1, 1);
                    }
                }
            }
            "l" => {
                let mut points = Vec::new();
                for word in words {
                    let number = word.split('/').next().unwrap_or_default();
                    let number: i64 =
                        number.parse().map_err(|_| "has a corner that is no number")?;
                    let at = if number < 0 { number + vertices.len() as i64 } else { number - 1 };
                    let vertex = usize::try_from(at).ok().and_then(|at| vertices.get(at));
                    let &[x, y, z] = vertex.ok_or("has a corner that is no vertex")?;
                    if *height.get_or_insert(z) != z {
                        return Err("has lines at more than one height".to_owned());
                    }
                    points.push([x, y]);
                }
                if let Some(origin) = line.origin {
                    plan.begin(origin.line, &origin.text);
                }
                plan.draw(points, None, u32::from(pens.pen()) + 1);
            }
            "f" => return Err("has faces".to_owned()),
            "curv" => return Err("has curves".to_owned()),
            _ => {}
        }
    }
    if plan.is_empty() { Err("has no lines".to_owned()) } else { Ok(plan) }
}

#[cfg(all(test, feature = "svg"))]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_a_pen_is_found_in_the_name_of_a_layer() {
        for (name, number) in [
            ("1", Some(1)),
            ("2 red", Some(2)),
            ("pen3", Some(3)),
            ("Layer 4", Some(4)),
            ("layer_05", Some(5)),
            ("12-outline", Some(12)),
            ("red", None),
            ("the house of 1893", None),
            ("0", None),
            ("33", None),
            ("", None),
            ("99999999999999999999", None),
        ] {
            assert_eq!(number_in(name), number, "{name}");
        }
    }
}
