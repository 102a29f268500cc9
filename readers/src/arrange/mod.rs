//! Arranges a plan before it is drawn: scales, turns, cuts, joins and hatches its strokes.
//!
//! [`PLAN_OPTIONS`] has one row for each option, from which the help of the command line is made.
//! An [`Arrangement`] holds their values. The steps come in a fixed order: layers are chosen; the
//! plan is scaled and turned, hatched, laid in the middle of the page, and cropped; then strokes
//! are joined and simplified; and last the layers are given their pens. Where a closed stroke
//! begins is nothing to choose here: that belongs to the order of the strokes.
//!
//! The plotter scales a plan to the page. If an option is a length on the paper, the plan is scaled
//! here before that option acts, and the plotter has nothing left to scale.
//!
//! A file that is no plan is refused if any of the options is given, and so is a value that leaves
//! nothing to draw.

mod crop;
mod hatch;
mod layers;
mod linemerge;
mod simplify;
mod table;

#[cfg(feature = "svg")]
pub(crate) use crop::clip_outline;
pub use table::{PLAN_OPTIONS, PlanOption};

use crate::files::Files;
use crate::fonts::Fonts;
use crate::page::{A4, Page};
use crate::plan::{DOT, Plan, Point};
use crate::region::MappedRegions;
use penup::drawing::Title;
use penup::fixed::Millimetres;

/// Whether the page is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Turn {
    /// The page keeps its orientation.
    #[default]
    AsItIs,
    /// The page lies on its long side.
    Landscape,
    /// The page lies on its long side if the plan is wider than high, and otherwise on its short
    /// side.
    Automatic,
}

/// The part of a plan that is cut off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Crop {
    /// Everything beyond the page without its margin.
    Page,
    /// Everything beyond a rectangle, given by its least and greatest x and y in mm.
    Rectangle([Point; 2]),
}

/// The way in which areas are hatched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hatch {
    /// The distance between two lines, in mm.
    pub(crate) spacing: f64,
    /// The angle of the lines to the x axis, counterclockwise, in degrees.
    pub(crate) angle: f64,
}

/// What is done with a plan before it is drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Arrangement {
    /// The fonts in which texts are drawn.
    pub(crate) fonts: Fonts,
    /// The files to which the file refers.
    pub(crate) files: Files,
    /// The page that the user has named.
    page: Option<Page>,
    turn: Turn,
    /// What stays free on each side of the page, in mm, if the user says so.
    margin: Option<f64>,
    /// If the plan is scaled to the page, the height of the title below it, in mm.
    fit: Option<f64>,
    pub(crate) layers: Vec<String>,
    pub(crate) scale: Option<[f64; 2]>,
    pub(crate) rotate: Option<f64>,
    pub(crate) hatch: Option<Hatch>,
    pub(crate) center: bool,
    pub(crate) crop: Option<Crop>,
    pub(crate) linemerge: Option<f64>,
    pub(crate) simplify: Option<f64>,
    pub(crate) layer_order: Vec<String>,
}

impl Arrangement {
    /// Nothing is done with a plan but to lay it on `page`, turned by `turn`, with this `margin` in
    /// mm. Where there is no page, the file's own serves, or else A4; where there is no margin,
    /// nothing stays free on the page of the file, and 10 mm on any other.
    pub fn on(page: Option<Page>, turn: Turn, margin: Option<f64>) -> Self {
        Self { page, turn, margin, ..Self::default() }
    }

    /// Returns the arrangement with these fonts, in which texts are drawn.
    #[must_use]
    pub fn with_fonts(self, fonts: Fonts) -> Self {
        Self { fonts, ..self }
    }

    /// Returns the arrangement with these files, for formats that refer to other files.
    #[must_use]
    pub fn with_files(self, files: Files) -> Self {
        Self { files, ..self }
    }

    /// Returns the arrangement of a plan that is scaled to the page, above this title of this size
    /// in mm.
    #[must_use]
    pub fn fitted(self, title: &str, title_size: f64) -> Self {
        let height = Millimetres::saturating_from_num(title_size);
        let title = Title { text: title, height };
        let foot = title.rise().saturating_add(title.depth()).to_num();
        let has_title = !title.text.trim().is_empty();
        Self { fit: Some(if has_title { foot } else { 0.0 }), ..self }
    }

    /// Whether a plan is scaled to the page here, because an option is a length on the paper.
    pub fn scales_to_page(&self) -> bool {
        let has_lengths =
            self.hatch.is_some() || self.linemerge.is_some() || self.simplify.is_some();
        self.fit.is_some() && has_lengths
    }

    /// Whether the user says what stays free on each side of the page.
    pub fn has_margin(&self) -> bool {
        self.margin.is_some()
    }

    /// Sets the option with this name.
    ///
    /// # Errors
    /// The reason why the value is refused, or there is no such option. Nothing is changed then.
    pub fn set(&mut self, name: &str, text: &str) -> Result<(), String> {
        let option = PLAN_OPTIONS.iter().find(|option| option.name == name);
        let option = option.ok_or_else(|| format!("there is no option {name} of a plan"))?;
        (option.set)(self, text)
    }

    /// Returns the name, as it is written, of the first option that is given and works on plans
    /// only.
    pub(crate) fn first_given(&self) -> Option<String> {
        let given = PLAN_OPTIONS.iter().find(|option| (option.is_set)(self));
        let name = given.map(|option| format!("--{}", option.name));
        name.or_else(|| (self.turn == Turn::Automatic).then(|| "--landscape=auto".to_owned()))
    }

    /// The page on which a drawing with these bounds is laid, if the file has this page.
    pub(crate) fn sheet(&self, own: Option<Page>, bounds: Option<[Point; 2]>) -> Page {
        let page = self.page.or(own).unwrap_or(A4);
        let (long, short) = (page.width.max(page.height), page.width.min(page.height));
        let landscape = Page { width: long, height: short };
        match (self.turn, bounds) {
            (Turn::AsItIs, _) => page,
            (Turn::Automatic, Some([low, high])) if high[0] - low[0] <= high[1] - low[1] => {
                Page { width: short, height: long }
            }
            (Turn::Landscape | Turn::Automatic, _) => landscape,
        }
    }

    /// Arranges `plan`, which has this page of its own. Returns the page on which it is laid. What
    /// the user should know is added to `notes`.
    ///
    /// # Errors
    /// The reason why it cannot be arranged so, as a sentence.
    pub(crate) fn arrange(
        &self,
        plan: &mut Plan,
        own: Option<Page>,
        notes: &mut Vec<String>,
    ) -> Result<Page, String> {
        if !self.layers.is_empty() {
            layers::choose(plan, &self.layers)?;
        }
        if let Some([x, y]) = self.scale {
            about_middle(plan, |[dx, dy]| [dx * x, dy * y]);
        }
        if let Some(degrees) = self.rotate {
            let (sine, cosine) = sine_cosine(-degrees);
            about_middle(plan, |[x, y]| [x * cosine - y * sine, x * sine + y * cosine]);
        }
        let sheet = self.sheet(own, plan.bounds());
        let is_own = self.page.is_none() && own.is_some() && self.fit.is_none();
        let margin = self.margin.unwrap_or(if is_own { 0.0 } else { 10.0 });
        let mut rectangle = self.crop.map(|crop| crop.rectangle(sheet, margin)).transpose()?;
        if self.scales_to_page() {
            // What is cut off does not count.
            let mut rest = Plan::new(String::new());
            rest.strokes.clone_from(&plan.strokes);
            rectangle.into_iter().for_each(|rectangle| crop::crop(&mut rest, rectangle));
            if let Some(map) = self.map_to(sheet, margin, rest.bounds()) {
                transform(plan, &map);
                rectangle = rectangle.map(|corners| corners.map(&map));
            }
        }
        // A line that is cut off later may leave less, which is no dot.
        if self.fit.is_none() || self.scales_to_page() {
            notes.extend(plan.keep_short(1.0, sheet.width));
        }
        if let Some(hatch) = self.hatch {
            notes.extend(hatch::hatch(plan, hatch)?);
        }
        if let (true, Some([low, high])) = (self.center, plan.bounds()) {
            let middle = [sheet.width / 2.0, sheet.height / 2.0];
            let by: [f64; 2] =
                [0, 1].map(|axis| middle[axis] - f64::midpoint(low[axis], high[axis]));
            transform(plan, |[x, y]| [x + by[0], y + by[1]]);
        }
        if let Some(rectangle) = rectangle {
            crop::crop(plan, rectangle);
        }
        if let Some(tolerance) = self.linemerge {
            linemerge::merge(plan, tolerance);
        }
        if let Some(tolerance) = self.simplify {
            simplify::simplify(plan, tolerance);
        }
        if !self.layer_order.is_empty() {
            notes.push(layers::reorder(plan, &self.layer_order)?);
        }
        if self.fit.is_some()
            && !self.scales_to_page()
            && let Some(map) = self.map_to(sheet, margin, plan.bounds())
        {
            // The plotter scales the plan, but not its dots. Coordinates are whole thousandths.
            let factor = map([1.0, 0.0])[0] - map([0.0; 2])[0];
            notes.extend(plan.keep_short(factor, f64::INFINITY));
            let length = (DOT / factor).max(0.002);
            plan.strokes.iter_mut().for_each(|stroke| stroke.keep_dot(length));
        }
        if plan.is_empty() {
            let options = PLAN_OPTIONS.iter().filter(|option| (option.is_set)(self));
            let options: Vec<String> = options.map(|it| format!("--{}", it.name)).collect();
            return Err(format!("there is nothing left to draw after {}", options.join(", ")));
        }
        Ok(sheet)
    }

    /// The map that scales a plan with these bounds to the sheet, as the plotter does: as large as
    /// the margins and the title leave room, and in the middle of that. `None` if the plotter will
    /// say that there is nothing to scale, or no room.
    fn map_to(
        &self,
        sheet: Page,
        margin: f64,
        bounds: Option<[Point; 2]>,
    ) -> Option<impl Fn(Point) -> Point + use<>> {
        let (foot, [low, high]) = (self.fit.unwrap_or(0.0), bounds?);
        let side = [sheet.width, sheet.height - foot];
        let factors = [0, 1].map(|axis: usize| {
            let free = side[axis] - 2.0 * margin;
            free / (high[axis] - low[axis])
        });
        let factor = factors[0].min(factors[1]);
        let is_scale = factor.is_finite() && factor > 0.0;
        let middle = [side[0] / 2.0, foot + side[1] / 2.0];
        is_scale.then_some(move |point: Point| {
            [0, 1].map(|axis: usize| {
                middle[axis] + factor * (point[axis] - f64::midpoint(low[axis], high[axis]))
            })
        })
    }
}

/// Applies `map` to the ways from the middle of the plan to each point.
fn about_middle(plan: &mut Plan, map: impl Fn(Point) -> Point) {
    let Some([low, high]) = plan.bounds() else { return };
    let [x, y] = [0, 1].map(|axis| f64::midpoint(low[axis], high[axis]));
    transform(plan, |point| {
        let [dx, dy] = map([point[0] - x, point[1] - y]);
        [x + dx, y + dy]
    });
}

/// The sine and the cosine of an angle in degrees; exact for quarter turns.
///
/// ```
/// assert_eq!(penup_readers::sine_cosine(-90.0), (-1.0, 0.0));
/// ```
pub fn sine_cosine(degrees: f64) -> (f64, f64) {
    match degrees.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        degrees => degrees.to_radians().sin_cos(),
    }
}

/// Applies `map` to every point of the plan. Dots keep their length.
fn transform(plan: &mut Plan, map: impl Fn(Point) -> Point) {
    let strokes = plan.strokes.iter_mut().flat_map(|stroke| &mut stroke.points);
    strokes.for_each(|point| *point = map(*point));
    let mut known = MappedRegions::default();
    for area in plan.areas.iter_mut().flatten() {
        area.outlines.iter_mut().flatten().for_each(|point| *point = map(*point));
        area.within.transform(&map, &mut known);
    }
    plan.strokes.iter_mut().for_each(|stroke| stroke.keep_dot(DOT));
}

#[cfg(test)]
mod tests;
