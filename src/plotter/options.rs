//! The options of a plot: what is drawn and how, as the user has set it with `$name=value`.

use crate::checksum::CRC_32;
use crate::drawing::{Page, StepsPerMillimetre, Title, TitleText};
use crate::fixed::{Decimal, Length, Millimetres, SixDecimals, sin_cos_degrees};
use crate::geometry::Precision;
use crate::model::Model;
use crate::order;
use crate::protocol::{
    CommandError, Escape, EscapedText, HiddenLines, PlotOption, ProjectionChoice, VisibilityMode,
};
use crate::view::{Camera, Direction, Lens, Pose, View};
use crate::visibility::{self, Crease};
use core::fmt::{self, Write};
use crc::{Digest, Table};

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
    /// decimal places.
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
    /// How strokes are ordered. Its `lift` is not used: see the next field.
    order: order::Options,
    /// Extra pen-up travel, in mm, that is accepted to save one pen lift.
    lift: Millimetres,
}

impl Default for PlotOptions {
    /// An automatic view in perspective with hidden lines erased, on A4 in portrait format with a
    /// margin of 10 mm, without a title.
    fn default() -> Self {
        let [width, height, margin, title_size, lift] =
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
            order: order::Options::default(),
            lift,
        }
    }
}

impl PlotOptions {
    /// Sets one option.
    pub fn set(&mut self, option: PlotOption) {
        match option {
            PlotOption::Eye(eye) => self.eye = Some(eye),
            PlotOption::At(at) => self.at = Some(at),
            PlotOption::Up(up) => self.up = Some(up),
            PlotOption::Angles(angles) => self.angles = Some(angles),
            PlotOption::AutomaticView => {
                (self.eye, self.at, self.up, self.angles) = (None, None, None, None)
            }
            PlotOption::Projection(projection) => self.projection = projection,
            PlotOption::ClipBehind(clip) => self.clip_behind = clip,
            PlotOption::See(see) => self.see = see,
            PlotOption::Hidden(hidden) => self.hidden = hidden,
            PlotOption::Seams(seams) => self.seams = seams,
            PlotOption::MergedBlocks(merged) => self.merged_blocks = merged,
            PlotOption::Crease(crease) => self.crease = crease,
            PlotOption::Precision(precision) => self.precision = precision,
            PlotOption::OnePen(one) => self.one_pen = one,
            PlotOption::Page { width, height } => {
                (self.page.width, self.page.height) = (width, height)
            }
            PlotOption::Margin(margin) => self.page.margin = margin,
            PlotOption::TitleSize(size) => self.title_size = size,
            PlotOption::Fit(fit) => self.fit = fit,
            PlotOption::Order(method) => self.order.method = method,
            PlotOption::Cycle(true) => self.order.shape = order::Shape::ClosedCycle,
            PlotOption::Cycle(false) => self.order.shape = order::Shape::OpenPath,
            PlotOption::Effort(effort) => self.order.effort = effort,
            PlotOption::Lift(lift) => self.lift = lift,
        }
    }

    /// Sets the title. An empty text removes it.
    ///
    /// # Errors
    /// [`CommandError::TitleTooLong`]; the title is then unchanged.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn set_title(&mut self, text: EscapedText<'_>) -> Result<(), CommandError> {
        let limit = TitleText::LIMIT;
        self.title = TitleText::new(text.letters()).ok_or(CommandError::TitleTooLong { limit })?;
        Ok(())
    }

    /// The title, unless it is empty or consists of spaces only.
    #[inline(never)] // Its many callers share one copy of the code.
    pub fn title(&self) -> Option<Title<'_>> {
        let text = self.title.as_str();
        text.bytes().any(|byte| byte != b' ').then_some(Title { text, height: self.title_size })
    }

    /// The sheet, with the space at its foot that the title needs.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
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
    /// millimetre.
    pub fn order(&self, steps: StepsPerMillimetre) -> order::Options {
        let lift = self.lift.wide_mul(steps[0]).saturating_mul_int(256);
        order::Options { lift: lift.saturating_to_num(), ..self.order }
    }

    /// The precision of the coordinates of `model`: as the user has set it, or as derived from the
    /// model.
    pub fn precision_of(&self, model: &Model<'_>) -> Precision {
        match self.precision {
            Some(chosen) => model.chosen_precision(chosen),
            None => model.precision(),
        }
    }

    /// The camera for `model`, with automatic choices for all that the user has not set. `None` if
    /// the model has no vertices.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn camera(&self, model: &Model<'_>) -> Option<Camera> {
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
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn visibility(&self, view: &View) -> visibility::Options {
        let crease = (self.crease > 0.0).then(|| Crease {
            cosine: libm::round(sin_cos_degrees(self.crease).1 * 32768.0) as i32,
            depth_stretch: view.depth_stretch(),
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
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn checksum(&self) -> u32 {
        let mut sum = Sum(CRC_32.digest());
        self.list(|line| {
            // Writing to a checksum cannot fail.
            let _ = writeln!(sum, "{line}");
        });
        sum.0.finalize()
    }

    /// Passes to `line` the text of each option and its value, in the order of `$options`.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn list(&self, mut line: impl FnMut(core::fmt::Arguments<'_>)) {
        let places = [("eye", self.eye), ("at", self.at), ("up", self.up), ("angles", self.angles)];
        for (name, place) in places {
            match place {
                Some(place) => {
                    let [x, y, z] = place.map(SixDecimals);
                    line(format_args!("${name}={x},{y},{z}"))
                }
                None => line(format_args!("${name}=auto")),
            }
        }
        match self.projection {
            ProjectionChoice::Lens(Lens::Perspective) => {
                line(format_args!("$projection=perspective"))
            }
            ProjectionChoice::Lens(Lens::Orthographic) => {
                line(format_args!("$projection=orthographic"))
            }
            ProjectionChoice::Lens(Lens::Oblique { angle, ratio }) => {
                let [angle, ratio] = [angle, ratio].map(SixDecimals);
                line(format_args!("$projection=oblique,{angle},{ratio}"));
            }
            ProjectionChoice::Axonometric { azimuth, elevation } => {
                let [azimuth, elevation] = [azimuth, elevation].map(SixDecimals);
                line(format_args!("$projection=axonometric,{azimuth},{elevation}"));
            }
        }
        let see = match self.see {
            VisibilityMode::Faces => "faces",
            VisibilityMode::Wire => "wire",
            VisibilityMode::Vertices => "vertices",
            VisibilityMode::Edges => "edges",
        };
        let hidden = match self.hidden {
            HiddenLines::Erased => "erased",
            HiddenLines::Dotted => "dotted",
            HiddenLines::Dashed => "dashed",
            HiddenLines::Shown => "shown",
            HiddenLines::Pen(_) => "pen",
        };
        let method = match self.order.method {
            order::Method::Auto => "auto",
            order::Method::Greedy => "greedy",
            order::Method::Exact => "exact",
        };
        let on = |on: bool| if on { "on" } else { "off" };
        line(format_args!("$behind={}", if self.clip_behind { "clip" } else { "refuse" }));
        line(format_args!("$see={see}"));
        match self.hidden {
            HiddenLines::Pen(pen) => line(format_args!("$hidden=pen,{}", pen + 1)),
            _ => line(format_args!("$hidden={hidden}")),
        }
        line(format_args!("$seams={}", on(self.seams)));
        line(format_args!("$blocks={}", if self.merged_blocks { "merged" } else { "separate" }));
        line(format_args!("$crease={}", SixDecimals(self.crease)));
        match self.precision {
            Some(precision) => line(format_args!("$precision={precision}")),
            None => line(format_args!("$precision=auto")),
        }
        line(format_args!("$pens={}", if self.one_pen { "one" } else { "auto" }));
        let [width, height, margin] =
            [self.page.width, self.page.height, self.page.margin].map(Length);
        line(format_args!("$page={width}x{height}"));
        line(format_args!("$margin={margin}"));
        line(format_args!("$title={}", Escape(self.title.as_str())));
        line(format_args!("$title-size={}", Length(self.title_size)));
        line(format_args!("$fit={}", on(self.fit)));
        line(format_args!("$order={method}"));
        line(format_args!("$cycle={}", on(self.order.shape == order::Shape::ClosedCycle)));
        line(format_args!("$effort={}", self.order.effort));
        line(format_args!("$lift={}", Length(self.lift)));
    }
}

/// A writer that only computes the checksum of its text.
struct Sum(Digest<'static, u32, Table<1>>);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
