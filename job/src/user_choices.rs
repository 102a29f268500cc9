//! Turns the choices of the user and the properties of a file into the settings of a job.

use crate::Settings;
use crate::view::{self, THREE_QUARTER, Viewpoint, turned_upright};
use penup::plotter::PlotOptions;
use penup_readers::lines::{Lines, extent};
use penup_readers::page::Page;

/// The names of the options that depend on the file.
const PAGE: &str = "page";
const MARGIN: &str = "margin";
const FIT: &str = "fit";
const UP: &str = "up";
const PROJECTION: &str = "projection";
/// The upward direction if nobody chooses one.
const UPRIGHT: [f64; 3] = [0.0, 0.0, 1.0];

/// The choices that the user makes before a file is read.
#[derive(Debug, Clone)]
pub struct UserChoices {
    /// The options of the plotter's library.
    pub settings: Settings,
    /// The direction from which the model is seen, if one is chosen.
    pub viewpoint: Option<Viewpoint>,
    /// Whether the user says what stays free on each side of the page.
    pub has_margin: bool,
}

/// The page that a file asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilePage {
    /// The page that the file has; `None` if it has none.
    pub own: Option<Page>,
    /// The page on which the drawing is laid.
    pub sheet: Page,
    /// Whether the drawing is flat.
    pub is_plan: bool,
}

impl UserChoices {
    /// The settings for a file of these `lines`. Where the user does not say otherwise, a file that
    /// has a page is drawn on that, and at true size no margin is kept free: so its plan keeps its
    /// place.
    ///
    /// # Errors
    /// The direction of the view contradicts the projection, or the file is a plan, which has no
    /// up.
    pub fn settings_for(&self, page: &FilePage, lines: &dyn Lines) -> Result<Settings, String> {
        let mut settings = self.settings.clone();
        settings.page = page.sheet;
        let is_true_size = settings.value(FIT) == Some("off");
        for (name, value) in &mut settings.values {
            match *name {
                PAGE => *value = page_value(page.sheet),
                MARGIN if page.own.is_some() && is_true_size && !self.has_margin => {
                    "0".clone_into(value);
                }
                _ => {}
            }
        }
        self.set_eye(page, lines, &mut settings)?;
        Ok(settings)
    }

    /// Chooses the eye if the user gives a direction, or says which way is up, because the
    /// plotter's own choice is made for models with z up.
    fn set_eye(
        &self,
        page: &FilePage,
        lines: &dyn Lines,
        settings: &mut Settings,
    ) -> Result<(), String> {
        let position = |name: &str| -> Option<[f64; 3]> {
            let parts = settings.value(name)?.split(',').map(|part| part.trim().parse());
            parts.collect::<Result<Vec<f64>, _>>().ok()?.try_into().ok()
        };
        let (up, at) = (position(UP), position("at"));
        let is_chosen = settings.value("eye").or(settings.value("angles")).is_some();
        if is_chosen || self.viewpoint.is_none() && up.is_none() {
            return Ok(());
        }
        if self.viewpoint.is_none() && page.is_plan {
            return Err(
                "--up and --y-up are for models in space, and this drawing lies flat".to_owned()
            );
        }
        let Some(extent) = extent(lines) else { return Ok(()) };
        let projection = settings.value(PROJECTION).unwrap_or_default();
        let fixed = axonometric(projection);
        let (direction, own_up) = match (self.viewpoint, fixed) {
            (Some(_), Some(_)) => {
                return Err(format!(
                    "--projection {projection} has a direction of its own: choose orthographic, or \
                     leave --view, --azimuth and --elevation out"
                ));
            }
            (Some(view), None) | (None, Some(view)) => (view.direction(), view.up()),
            (None, None) if is_oblique(projection) => ([0.0, -1.0, 0.0], UPRIGHT),
            (None, None) => (THREE_QUARTER, UPRIGHT),
        };
        let upward = up.unwrap_or(UPRIGHT);
        let turned = [direction, own_up].map(|vector| turned_upright(vector, upward));
        let [Some(direction), Some(own_up)] = turned else { return Ok(()) };
        let size = (0..3).map(|axis| extent[1][axis] - extent[0][axis]).fold(0.0, f64::max);
        let mut set = |name: &'static str, value: String| {
            settings.values.retain(|(own, _)| *own != name);
            settings.values.push((name, value));
        };
        set("eye", view::text(view::eye(extent, direction, at), size));
        set(UP, view::text(own_up, 1.0));
        if fixed.is_some() {
            set(PROJECTION, "orthographic".to_owned());
        }
        Ok(())
    }
}

/// A page as the value of its option.
pub fn page_value(page: Page) -> String {
    format!("{}x{}", page.width, page.height)
}

/// The direction of an axonometric projection; `None` for any other.
fn axonometric(projection: &str) -> Option<Viewpoint> {
    let mut options = PlotOptions::default();
    options.set(PROJECTION, projection).ok()?;
    // The plotter lists these projections by their angles.
    let lines = options.lines().map(|line| line.to_string());
    let line = lines.into_iter().find(|line| line.starts_with("$projection=axonometric,"))?;
    let mut angles = line.split(',').skip(1).map(|angle| angle.parse::<f64>());
    Some(Viewpoint { azimuth: angles.next()?.ok()?, elevation: angles.next()?.ok()? })
}

fn is_oblique(projection: &str) -> bool {
    projection.starts_with("oblique") || matches!(projection, "cavalier" | "cabinet")
}
