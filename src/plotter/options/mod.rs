//! The options of a plot: what is drawn and how, as the user has set it with `$name=value`.
//!
//! [`OPTIONS`] has one row for each option. A new option is a field of [`PlotOptions`] with its
//! default, and a row; the stage that obeys it reads the field.

#[cfg(feature = "tiles")]
mod kept;
mod row;
mod table;
#[cfg(test)]
mod tests;
mod values;

#[cfg(feature = "tiles")]
pub(super) use kept::KeptOptions;
pub use row::{Flag, PlotOption};
pub use table::OPTIONS;
pub use values::{HiddenLines, ProjectionChoice, VisibilityMode};

use crate::checksum::Crc32;
use crate::drawing::{Page, StepsPerMillimetre, Title, TitleText};
use crate::fixed::{Decimal, Millimetres, sin_cos_degrees};
use crate::geometry::Precision;
use crate::model::Positions;
use crate::order::{self, Effort, Method, Shape, TimeModel};
use crate::protocol::{CommandError, EscapedText, number};
use crate::view::{Camera, Direction, Pose, View};
use crate::visibility::{self, Crease};
use core::fmt::{self, Write};

/// How much less than `$crease` an edge may bend to be drawn, in degrees. The normals of faces are
/// rounded by less, unless the faces are very small.
const CREASE_MARGIN: f64 = 0.02;

/// The options of a plot. `None` leaves the choice to penup.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlotOptions {
    /// Position of the eye, in units of the model.
    eye: Option<Direction>,
    /// The point looked at, in units of the model.
    at: Option<Direction>,
    /// The direction that is upward on the page.
    up: Option<Direction>,
    /// Rotation of the view in degrees about x, y and z. The eye then looks along z.
    angles: Option<Direction>,
    /// The kind of projection.
    projection: ProjectionChoice,
    /// Whether parts of the model behind the eye are clipped. Otherwise they are an error.
    pub clip_behind: bool,
    /// How visibility is determined.
    pub see: VisibilityMode,
    /// How hidden lines are drawn, if at all.
    pub hidden: HiddenLines,
    /// Whether the lines are drawn along which faces intersect each other.
    pub seams: bool,
    /// Whether touching blocks are drawn as one shape, without lines between two coplanar faces.
    pub merged_blocks: bool,
    /// An edge is not drawn if its two faces bend by less than this angle, in degrees. 0 draws
    /// every edge.
    pub crease: f64,
    /// The largest error of the coordinates, in units of the model. `None` derives it from their
    /// decimals.
    precision: Option<Decimal>,
    /// Whether one pen draws everything, whatever pens the model names.
    pub one_pen: bool,
    /// The sheet of paper.
    pub page: Page,
    /// The text below the drawing. If it is empty, there is no title.
    title: TitleText,
    /// Height of the title's capital letters, in mm.
    title_size: Millimetres,
    /// Whether a plan is scaled to the page. Otherwise it is drawn at true size.
    pub fit: bool,
    /// The method that pairs the odd points.
    method: Method,
    /// Whether the path is open or closed.
    shape: Shape,
    /// The distance computations for each pen-up move by which the order is improved. `None` if it
    /// is improved as long as that pays.
    effort: Option<u32>,
    /// Extra pen-up travel, in mm, that is accepted to save one pen lift.
    lift_cost: Millimetres,
}

impl Default for PlotOptions {
    /// An automatic view in perspective with hidden lines erased, on A4 in portrait format with a
    /// margin of 10 mm, without a title.
    fn default() -> Self {
        let [width, height, margin, title_size, lift_cost] =
            [210, 297, 10, 5, 2].map(Millimetres::from_num);
        Self {
            eye: None,
            at: None,
            up: None,
            angles: None,
            projection: ProjectionChoice::default(),
            clip_behind: true,
            see: VisibilityMode::Faces,
            hidden: HiddenLines::Erased,
            seams: true,
            merged_blocks: false,
            crease: 0.0,
            precision: None,
            one_pen: false,
            page: Page { width, height, margin, foot: Millimetres::ZERO },
            title: TitleText::default(),
            title_size,
            fit: false,
            method: Method::default(),
            shape: Shape::default(),
            effort: None,
            lift_cost,
        }
    }
}

impl PlotOptions {
    /// The title, unless it is empty or consists of spaces only.
    #[inline(never)] // Its many callers share one copy of the code.
    pub fn title(&self) -> Option<Title<'_>> {
        let text = self.title.as_str();
        text.bytes().any(|byte| byte != b' ').then_some(Title { text, height: self.title_size })
    }

    /// The sheet, with the space at its foot that the title needs.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn sheet(&self) -> Page {
        let foot = self.title().map(|title| title.rise() + title.depth());
        Page { foot: foot.unwrap_or_default(), ..self.page }
    }

    /// Whether a plan is laid on the page as it is. This is not the case if the user has chosen a
    /// view for it.
    pub fn shows_plans_flat(&self) -> bool {
        self.eye.is_none()
            && self.angles.is_none()
            && matches!(self.projection, ProjectionChoice::Lens(_))
            && matches!(self.see, VisibilityMode::Faces | VisibilityMode::Wire)
    }

    /// The options of the ordering, with lengths in 1/256 step for a machine with `steps` per
    /// millimetre, which travels and computes at this `time_model`.
    pub fn order(&self, steps: StepsPerMillimetre, time_model: TimeModel) -> order::Options {
        let lift_cost = self.lift_cost.wide_mul(steps[0]).saturating_mul_int(256);
        order::Options {
            method: self.method,
            shape: self.shape,
            effort: self.effort.map_or(Effort::Auto(time_model), Effort::Units),
            lift_cost: lift_cost.saturating_to_num(),
            steps,
        }
    }

    /// The precision of the coordinates of `model`: as the user has set it, or as derived from the
    /// model.
    pub fn precision_of(&self, model: &impl Positions) -> Precision {
        match self.precision {
            Some(chosen) => model.chosen_precision(chosen),
            None => model.precision(),
        }
    }

    /// The camera for `model`, with automatic choices for all that the user has not set. `None` if
    /// the model has no vertices.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn camera(&self, model: &impl Positions) -> Option<Camera> {
        let lens = match self.projection {
            ProjectionChoice::Axonometric { azimuth, elevation } => {
                return Camera::axonometric(model, azimuth, elevation, self.at, self.up);
            }
            ProjectionChoice::Lens(lens) => lens,
        };
        if let Some(angles) = self.angles {
            return Camera::turned(model, lens, angles, self.eye);
        }
        let mut camera = Camera::automatic(model, lens, self.at, self.up)?;
        if let (Pose::Towards { eye, .. }, Some(chosen)) = (&mut camera.pose, self.eye) {
            *eye = chosen;
        }
        Some(camera)
    }

    /// The options of the visibility stage for `view`.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn visibility(&self, view: &View) -> visibility::Options {
        // A little less than the angle, so that edges that bend by just as much are drawn from
        // every eye, however the normals of their faces are rounded.
        let bend = (self.crease - CREASE_MARGIN).max(0.0);
        let crease = (self.crease > 0.0).then(|| Crease {
            cosine: libm::round(sin_cos_degrees(bend).1 * 1_048_576.0) as i32,
            depth_stretch: view.depth_stretch(),
            slants: view.slants(),
        });
        let with_hidden = self.hidden != HiddenLines::Erased;
        visibility::Options {
            with_hidden,
            with_seams: self.seams,
            merged_blocks: self.merged_blocks,
            crease,
        }
    }

    /// The CRC-32 of the lines that `$options` lists, each followed by a line feed. Equal options
    /// have equal checksums.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn checksum(&self) -> u32 {
        let mut sum = Sum(Crc32::new());
        for line in self.lines() {
            // Writing to a checksum cannot fail.
            let _ = writeln!(sum, "{line}");
        }
        sum.0.finalize()
    }

    /// The lines of `$options`: each option with its value.
    pub fn lines(&self) -> impl Iterator<Item = impl fmt::Display> {
        OPTIONS.iter().filter(|option| option.is_listed()).map(|option| option.line(self))
    }
}

/// Sets the title. An empty text removes it.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
fn set_title(options: &mut PlotOptions, text: &str) -> Result<(), CommandError> {
    let (letters, limit) = (EscapedText::new(text)?.letters(), TitleText::LIMIT);
    options.title = TitleText::new(letters).ok_or(CommandError::TitleTooLong { limit })?;
    Ok(())
}

/// Sets the precision of the coordinates: `auto`, or a length in units of the model.
fn set_precision(options: &mut PlotOptions, text: &str) -> Result<(), CommandError> {
    options.precision = match text {
        "auto" => None,
        _ => {
            let precision = number(text)?;
            if !(0.0..=1e6).contains(&precision.to_f64()) {
                return Err(CommandError::NumberOutOfRange);
            }
            Some(precision)
        }
    };
    Ok(())
}

/// A writer that only computes the checksum of its text.
struct Sum(Crc32);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
