//! A job to send to a plotter, its settings, and its results.

use crate::protocol::{
    ANGLES, AT, BEHIND, BLOCKS, CLEAR, CREASE, CYCLE, EFFORT, EYE, FIT, HIDDEN, LIFT, MARGIN,
    ORDER, PAGE, PENS, PRECISION, PROJECTION, SEAMS, SEE, TITLE, TITLE_SIZE, UP, VIEW_AUTO,
    setting,
};
use crate::source::{JobLine, Lines};
use crate::watch::PenRuns;
use penup::protocol::Escape;
use serde::Serialize;
use std::fmt;
use std::ops::Add;

/// A point on the page in mm: x to the right and y up from the lower left corner.
pub type PagePoint = [f64; 2];

/// The output of `penup preview --json`. Fields may be added but are never changed.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct JobResult {
    /// The visible segments as x1, y1, x2, y2: on the image plane at distance 1 for a perspective
    /// projection, in model units for a parallel one. x points right and y up; the origin is on the
    /// line of sight.
    pub segments: Vec<[f64; 4]>,
    /// The pen of each segment, counted from 1.
    pub segment_pens: Vec<u8>,
    /// The strokes in drawing order, in mm on the page. A stroke is what the pen draws without
    /// being lifted.
    pub strokes: Vec<Vec<PagePoint>>,
    /// The pen of each stroke, counted from 1.
    pub stroke_pens: Vec<u8>,
    /// The length drawn, in mm.
    pub pen_down_mm: f64,
    /// The length of the moves between strokes in mm, from the start of the first stroke to the end
    /// of the last one.
    pub pen_up_mm: f64,
    /// Harrison's drawing efficiency (5.7, equation 7): the length drawn divided by the length of
    /// all moves, 0 to 1.
    pub efficiency: f64,
    /// The number of motor steps. A simultaneous step of both axes counts once.
    pub steps: u64,
    /// The computing time of each stage.
    pub timings_ms: Timings,
    /// The path of the pen according to the pins, for the picture.
    #[serde(skip)]
    pub pen: PenRuns,
}

/// The computing times of the stages, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Timings {
    /// The choice of the camera and the projection.
    pub view: f64,
    /// The removal of hidden lines.
    pub visibility: f64,
    /// The removal of repeated lines and the ordering of the strokes.
    pub order: f64,
}

impl Timings {
    /// For each stage, the shorter time of the two.
    pub fn best(self, other: Self) -> Self {
        Self {
            view: self.view.min(other.view),
            visibility: self.visibility.min(other.visibility),
            order: self.order.min(other.order),
        }
    }
}

/// The lengths of a drawing, drawn and between strokes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lengths {
    /// The length drawn, in mm.
    pub pen_down_mm: f64,
    /// The length of the moves from each stroke's end to the next one's start, in mm.
    pub pen_up_mm: f64,
}

impl Lengths {
    /// Measures `strokes`, which are in mm and in drawing order.
    ///
    /// ```
    /// use penup_client::job::Lengths;
    /// let lengths = Lengths::of(&[vec![[0.0, 0.0], [3.0, 4.0]], vec![[3.0, 5.0], [4.0, 5.0]]]);
    /// assert_eq!((lengths.pen_down_mm, lengths.pen_up_mm), (6.0, 1.0));
    /// assert_eq!(lengths.efficiency(), 6.0 / 7.0);
    /// ```
    pub fn of(strokes: &[Vec<PagePoint>]) -> Self {
        let length = |a: &PagePoint, b: &PagePoint| (a[0] - b[0]).hypot(a[1] - b[1]);
        let down = strokes.iter().flat_map(|stroke| stroke.windows(2));
        let up = strokes.windows(2);
        let up = up.filter_map(|pair| Some(length(pair[0].last()?, pair[1].first()?)));
        // The sum is folded from 0.0, because the `sum` of an empty iterator is -0.0.
        Self {
            pen_down_mm: down.map(|ends| length(&ends[0], &ends[1])).fold(0.0, Add::add),
            pen_up_mm: up.fold(0.0, Add::add),
        }
    }

    /// Harrison's drawing efficiency: the length drawn divided by the length of all moves, 0 to 1.
    /// It is 1 if nothing moves.
    pub fn efficiency(self) -> f64 {
        let whole = self.pen_down_mm + self.pen_up_mm;
        if whole > 0.0 { self.pen_down_mm / whole } else { 1.0 }
    }
}

/// The report that a plotter, real or emulated, sends about a job that it has drawn.
///
/// The lengths are those of the lines of the drawing, not those of the motor steps that approximate
/// them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobReport {
    /// How often the pen is lowered, except for the dashes of dotted lines.
    pub strokes: u64,
    /// The length drawn in mm, as the plotter reports it: with one decimal.
    pub pen_down_mm: String,
    /// The length of the moves between strokes in mm, with one decimal.
    pub pen_up_mm: String,
    /// The length drawn divided by the length of all moves, in %.
    pub efficiency: String,
}

impl JobReport {
    /// Parses one of the lines that answer `$model`; `None` if it is not the line with the lengths.
    /// `strokes` comes from the status reports.
    ///
    /// ```
    /// use penup_client::job::JobReport;
    /// let line = "[JOB:pen down 80.0 mm, up 30.5 mm, efficiency 72.3 %, bound 30.5 mm, the least]";
    /// let report = JobReport::parse(2, line).expect("the line of lengths");
    /// assert_eq!(report.pen_up_mm, "30.5");
    /// ```
    pub fn parse(strokes: u64, line: &str) -> Option<Self> {
        let (down, rest) = line.strip_prefix("[JOB:pen down ")?.split_once(" mm, up ")?;
        let (up, rest) = rest.split_once(" mm, efficiency ")?;
        let (efficiency, _) = rest.split_once(" %")?;
        let [pen_down_mm, pen_up_mm, efficiency] = [down, up, efficiency].map(str::to_owned);
        Some(Self { strokes, pen_down_mm, pen_up_mm, efficiency })
    }
}

impl fmt::Display for JobReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { strokes, pen_down_mm, pen_up_mm, efficiency } = self;
        write!(
            formatter,
            "{strokes} strokes, {pen_down_mm} mm drawn, {pen_up_mm} mm between them, \
             efficiency {efficiency} %"
        )
    }
}

/// The size of a page, in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Page {
    /// The width of the page.
    pub width: f64,
    /// The height of the page.
    pub height: f64,
}

/// The camera, the page and the drawing options of a job. `None` leaves a choice to the plotter.
///
/// Fields that are text are sent unchanged, so they must be valid for the plotter.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The position of the eye.
    pub eye: Option<String>,
    /// The point that the eye looks at.
    pub at: Option<String>,
    /// The direction that is up in the picture.
    pub up: Option<String>,
    /// The rotation angles of Harrison's program, in degrees.
    pub angles: Option<String>,
    /// The kind of projection, in the plotter's syntax.
    pub projection: String,
    /// What to do with parts behind the eye: `clip` or `refuse`.
    pub behind: &'static str,
    /// Whether the intersection lines of faces that pass through each other are drawn: `on` or
    /// `off`.
    pub seams: &'static str,
    /// How blocks that touch are drawn: `separate` or `merged`.
    pub blocks: &'static str,
    /// Edges between faces that bend less than this angle, in degrees, are not drawn.
    pub crease: String,
    /// The error bound of the coordinates: `auto`, or a length in model units in the plotter's
    /// syntax.
    pub precision: String,
    /// The method of determining visibility: `faces`, `wire`, `vertices` or `edges`.
    pub see: &'static str,
    /// How hidden lines are drawn, in the plotter's syntax.
    pub hidden: String,
    /// Whether the file chooses the pens: `auto` or `one`.
    pub pens: &'static str,
    /// The size of the page.
    pub page: Page,
    /// The margin on each side of the page, in mm.
    pub margin: String,
    /// The title below the drawing; empty for none.
    pub title: String,
    /// The height of the title's capital letters, in mm.
    pub title_size: String,
    /// Whether plans, too, are scaled to the page; solids always are.
    pub fit: bool,
    /// The method of ordering the strokes: `auto`, `greedy` or `exact`.
    pub order: &'static str,
    /// Whether the pen returns to its starting point at the end.
    pub cycle: bool,
    /// The amount of work to improve the order, for each pen-up move.
    pub effort: String,
    /// The extra pen-up travel, in mm, that is accepted to save one pen lift.
    pub lift: String,
}

/// Every line of a job before the plot command: clear the old model, choose how pens are assigned,
/// the lines of the file, the other settings.
#[derive(Debug)]
pub struct Job<L> {
    before: Vec<JobLine>,
    file: L,
    after: Vec<JobLine>,
}

impl<L: Lines> Job<L> {
    /// Creates the job that draws `file` with `settings`.
    ///
    /// Every setting is sent, so that no setting of an earlier job remains in effect.
    pub fn new(file: L, settings: &Settings) -> Self {
        let page = settings.page;
        let points = [
            (EYE, &settings.eye),
            (AT, &settings.at),
            (UP, &settings.up),
            (ANGLES, &settings.angles),
        ];
        let points = points
            .into_iter()
            .filter_map(|(name, point)| Some(format!("{name}={}", point.as_ref()?)));
        let commands = std::iter::once(VIEW_AUTO.to_owned()).chain(points).chain([
            format!("{PROJECTION}={}", settings.projection),
            format!("{BEHIND}={}", settings.behind),
            format!("{SEAMS}={}", settings.seams),
            format!("{BLOCKS}={}", settings.blocks),
            format!("{CREASE}={}", settings.crease),
            format!("{PRECISION}={}", settings.precision),
            format!("{SEE}={}", settings.see),
            format!("{HIDDEN}={}", settings.hidden),
            setting(PAGE, &[page.width, page.height], 'x'),
            format!("{MARGIN}={}", settings.margin),
            format!("{TITLE}={}", Escape(&settings.title)),
            format!("{TITLE_SIZE}={}", settings.title_size),
            format!("{FIT}={}", if settings.fit { "on" } else { "off" }),
            format!("{ORDER}={}", settings.order),
            format!("{CYCLE}={}", if settings.cycle { "on" } else { "off" }),
            format!("{EFFORT}={}", settings.effort),
            format!("{LIFT}={}", settings.lift),
        ]);
        // The pen setting must precede the file, which may name more pens than there are.
        let before = [CLEAR.to_owned(), format!("{PENS}={}", settings.pens)];
        Self {
            before: before.into_iter().map(JobLine::command).collect(),
            file,
            after: commands.map(JobLine::command).collect(),
        }
    }
}

impl<L: Lines> Lines for Job<L> {
    fn count(&self) -> usize {
        self.before.count() + self.file.count() + self.after.count()
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let Some(index) = index.checked_sub(self.before.count()) else {
            return self.before.line(index);
        };
        match index.checked_sub(self.file.count()) {
            None => self.file.line(index),
            Some(index) => self.after.line(index),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_json_has_the_promised_fields() {
        let result = JobResult {
            segments: vec![[0.0, 0.5, 1.0, -1.0]],
            segment_pens: vec![1],
            strokes: vec![vec![[10.0, 20.0], [30.0, 20.25]]],
            stroke_pens: vec![2],
            pen_down_mm: 20.0,
            pen_up_mm: 0.0,
            efficiency: 1.0,
            steps: 1600,
            timings_ms: Timings { view: 0.5, visibility: 1.5, order: 2.0 },
            pen: PenRuns::default(),
        };
        assert_eq!(
            serde_json::to_string(&result).expect("numbers are finite"),
            "{\"segments\":[[0.0,0.5,1.0,-1.0]],\"segment_pens\":[1],\
             \"strokes\":[[[10.0,20.0],[30.0,20.25]]],\"stroke_pens\":[2],\
             \"pen_down_mm\":20.0,\"pen_up_mm\":0.0,\"efficiency\":1.0,\"steps\":1600,\
             \"timings_ms\":{\"view\":0.5,\"visibility\":1.5,\"order\":2.0}}"
        );
    }

    #[test]
    fn nothing_drawn_is_perfectly_efficient_and_empty_strokes_do_no_harm() {
        assert_eq!(Lengths::of(&[]).efficiency(), 1.0);
        let one = Lengths::of(&[vec![[0.0, 0.0], [1.0, 0.0]]]);
        assert!([one.pen_up_mm, Lengths::of(&[]).pen_down_mm].iter().all(|c| c.is_sign_positive()));
        let strokes = [vec![], vec![[1.0, 1.0]], vec![]];
        assert_eq!(Lengths::of(&strokes), Lengths::default());
    }

    #[test]
    fn every_setting_is_sent_after_the_file() {
        let settings = Settings {
            eye: Some("-3,-4,2.5".to_owned()),
            at: None,
            up: Some("0,0,1".to_owned()),
            angles: None,
            projection: "perspective".to_owned(),
            behind: "clip",
            seams: "on",
            blocks: "separate",
            crease: "0".to_owned(),
            precision: "auto".to_owned(),
            see: "faces",
            hidden: "dotted".to_owned(),
            pens: "auto",
            page: Page { width: 210.0, height: 297.0 },
            margin: "7.5".to_owned(),
            title: "Für Ada".to_owned(),
            title_size: "4.5".to_owned(),
            fit: false,
            order: "auto",
            cycle: false,
            effort: "4000".to_owned(),
            lift: "2.5".to_owned(),
        };
        let job = Job::new([JobLine::command("v 0 0 0")], &settings);
        let lines = (0..job.count()).filter_map(|index| job.line(index));
        let sent: Vec<String> = lines.map(|line| line.sent).collect();
        assert_eq!(job.line(job.count()), None);
        assert_eq!(
            sent,
            [
                "$clear",
                "$pens=auto",
                "v 0 0 0",
                "$view=auto",
                "$eye=-3,-4,2.5",
                "$up=0,0,1",
                "$projection=perspective",
                "$behind=clip",
                "$seams=on",
                "$blocks=separate",
                "$crease=0",
                "$precision=auto",
                "$see=faces",
                "$hidden=dotted",
                "$page=210x297",
                "$margin=7.5",
                "$title=F\\xFCr Ada",
                "$title-size=4.5",
                "$fit=off",
                "$order=auto",
                "$cycle=off",
                "$effort=4000",
                "$lift=2.5",
            ]
        );
    }
}
