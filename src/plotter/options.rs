//! What is drawn and how, as the user set it.

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

/// What is drawn and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlotOptions {
    eye: Option<Direction>,
    at: Option<Direction>,
    up: Option<Direction>,
    angles: Option<Direction>,
    projection: ProjectionChoice,
    /// Whether what is behind the eye is cut off; else it is an error.
    pub clip_behind: bool,
    /// How it is found out what is seen.
    pub see: VisibilityMode,
    /// What becomes of hidden lines.
    pub hidden: HiddenLines,
    /// Whether the lines are drawn where faces pass through each other.
    pub seams: bool,
    /// Whether blocks that touch are one shape: no line between two faces that lie in one plane.
    pub merged_blocks: bool,
    /// Edges between faces that bend less, in degrees, are not drawn; 0 draws every edge.
    pub crease: f64,
    /// How far coordinates may be off, in units of the model; `None` goes by their decimals.
    precision: Option<Decimal>,
    /// Whether one pen draws all, whatever the model says.
    pub one_pen: bool,
    /// The sheet.
    pub page: Page,
    /// What stands below the drawing, if it is not empty.
    title: TitleText,
    /// Height of its capitals.
    title_size: Millimetres,
    /// Whether a plan is scaled to the page.
    pub fit: bool,
    /// How strokes are ordered; its lift is not used.
    order: order::Options,
    /// How much longer a way with the pen up may be for one lift less.
    lift: Millimetres,
}

impl Default for PlotOptions {
    /// An automatic view in perspective, hidden lines erased, on A4 upright with a margin of 10 mm, without a title.
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
    /// Changes one.
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

    /// Changes the title; an empty one is none.
    ///
    /// # Errors
    /// [`CommandError::TitleTooLong`]; the title is as it was.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn set_title(&mut self, text: EscapedText<'_>) -> Result<(), CommandError> {
        let limit = TitleText::LIMIT;
        self.title = TitleText::new(text.letters()).ok_or(CommandError::TitleTooLong { limit })?;
        Ok(())
    }

    /// The title, if there is one to be seen.
    #[inline(never)] // Once is enough: it is asked for everywhere.
    pub fn title(&self) -> Option<Title<'_>> {
        let text = self.title.as_str();
        text.bytes().any(|byte| byte != b' ').then_some(Title { text, height: self.title_size })
    }

    /// The sheet with the room for the title.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn sheet(&self) -> Page {
        let foot = self.title().map(|title| title.rise() + title.depth());
        Page { foot: foot.unwrap_or_default(), ..self.page }
    }

    /// Whether a plan is drawn as it lies: not if the user chose a view for it.
    pub fn shows_plans_flat(&self) -> bool {
        self.eye.is_none()
            && self.angles.is_none()
            && matches!(self.projection, ProjectionChoice::Lens(_))
            && matches!(self.see, VisibilityMode::Faces | VisibilityMode::Wire)
    }

    /// How strokes are ordered on a machine of so many steps.
    pub fn order(&self, steps: StepsPerMillimetre) -> order::Options {
        let lift = self.lift.wide_mul(steps[0]).saturating_mul_int(256);
        order::Options { lift: lift.saturating_to_num(), ..self.order }
    }

    /// How far the coordinates of `model` may be off.
    pub fn precision_of(&self, model: &Model<'_>) -> Precision {
        match self.precision {
            Some(chosen) => model.chosen_precision(chosen),
            None => model.precision(),
        }
    }

    /// The camera for `model`; what the user did not choose is chosen here. `None` without vertices.
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
        if let (Pose::Towards { eye, .. }, Some(chosen)) = (&mut camera.sight, self.eye) {
            *eye = chosen;
        }
        Some(camera)
    }

    /// What visibility is to find through `view`.
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

    /// The CRC-32 of what `$options` lists: its lines, each with a line feed.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub fn checksum(&self) -> u32 {
        let mut sum = Sum(CRC_32.digest());
        self.list(|line| {
            // A sum cannot fail.
            let _ = writeln!(sum, "{line}");
        });
        sum.0.finalize()
    }

    /// What stands for each option that is set, as `$options` lists it.
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

/// Text that is only summed up.
struct Sum(Digest<'static, u32, Table<1>>);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
