//! A job to send to a plotter, and its settings.

use crate::lines::{JobLine, Lines};
use crate::page::Page;
use crate::protocol::{
    ANGLES, AT, BEHIND, BLOCKS, CLEAR, CREASE, CYCLE, EFFORT, EYE, FIT, HIDDEN, LIFT, MARGIN,
    ORDER, PAGE, PENS, PRECISION, PROJECTION, SEAMS, SEE, TITLE, TITLE_SIZE, UP, VIEW_AUTO,
    setting,
};
use penup::protocol::Escape;

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
