//! A job to send to a plotter, and its settings.

use crate::protocol::{CLEAR, PENS, VIEW_AUTO};
use penup::plotter::PlotOptions;
use penup_readers::lines::{JobLine, Lines};
use penup_readers::page::Page;

/// The options of a job, which say what is drawn and how. What has no value here is chosen by the
/// plotter.
///
/// Values are sent unchanged, so they must be valid for the plotter.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The size of the page, for the picture. The option `page` is among the values, too.
    pub page: Page,
    /// The options of the plotter's library and their values, in the order in which they are sent.
    pub values: Vec<(&'static str, String)>,
}

impl Settings {
    /// The value of the option with this name.
    pub fn value(&self, name: &str) -> Option<&str> {
        self.values.iter().find(|(own, _)| *own == name).map(|(_, value)| value.as_str())
    }

    /// The options of the plotter with these settings. A plotter tells by itself which one it
    /// refuses.
    pub(crate) fn options(&self) -> PlotOptions {
        let mut options = PlotOptions::default();
        for (name, value) in &self.values {
            let _ = options.set(name, value);
        }
        options
    }

    /// Whether a plan is laid on the page as it is, and not drawn as a model that is seen in space.
    pub fn shows_plans_flat(&self) -> bool {
        self.options().shows_plans_flat()
    }

    /// The margin, and the height that the title takes below the drawing, in mm.
    fn margin_and_foot(&self) -> Option<[f64; 2]> {
        let foot = self.options().sheet().foot;
        Some([self.value("margin")?.parse().ok()?, foot.to_num()])
    }

    /// Says that a plan with these least and greatest coordinates, in mm, is too large for the
    /// page, but fits it if the page is turned, which the plotter does not know. `None` if the plan
    /// fits, is scaled, or is too large for the turned page, too.
    pub fn fits_turned(&self, [low, high]: [[f64; 2]; 2]) -> Option<String> {
        let [margin, foot] = self.margin_and_foot()?;
        let [width, height] = [0, 1].map(|axis| high[axis] - low[axis] + 2.0 * margin);
        let fits = |page: Page| width <= page.width && height + foot <= page.height;
        let turned = Page { width: self.page.height, height: self.page.width };
        let helps = !fits(self.page) && fits(turned) && self.value("fit") == Some("off");
        helps.then(|| "the drawing fits the page if that is turned: --landscape=auto".to_owned())
    }

    /// By how many mm the plotter moves a plan with these least and greatest coordinates, in mm,
    /// because it does not lie within the margins of the page and above the title. `None` if the
    /// plan keeps its place, is scaled, or is too large for the page, which the plotter says by
    /// itself.
    pub fn moves_plan_by(&self, [low, high]: [[f64; 2]; 2]) -> Option<[f64; 2]> {
        let [margin, foot] = self.margin_and_foot()?;
        let (first, last) =
            ([margin, margin + foot], [self.page.width - margin, self.page.height - margin]);
        let fits = |axis: usize| high[axis] - low[axis] <= last[axis] - first[axis];
        let is_flat = self.value("fit") == Some("off") && self.options().shows_plans_flat();
        if !is_flat || ![0, 1].into_iter().all(fits) {
            return None;
        }
        let by = [0, 1].map(|axis: usize| match low[axis] < first[axis] {
            true => first[axis] - low[axis],
            false => (last[axis] - high[axis]).min(0.0),
        });
        (by != [0.0; 2]).then_some(by)
    }

    /// Says that the plotter moves a plan with these least and greatest coordinates, in mm, and
    /// where to. `None` as by [`Settings::moves_plan_by`].
    pub fn moves_plan(&self, [low, high]: [[f64; 2]; 2]) -> Option<String> {
        let by = self.moves_plan_by([low, high])?;
        let [margin, foot] = self.margin_and_foot()?;
        let Page { width, height } = self.page;
        // Less than a thousandth of a millimetre is less than a step.
        let digits = |length: f64| (length * 1e3).round() / 1e3 + 0.0;
        let title = match foot > 0.0 {
            true => format!(" and the {} mm of its title", digits(foot)),
            false => String::new(),
        };
        let [to_low, to_high] =
            [low, high].map(|at| [0, 1].map(|axis: usize| digits(at[axis] + by[axis])));
        Some(format!(
            "the drawing is moved onto the page of {width} x {height} mm with its margin of \
             {margin} mm{title}: the file has it from {}, {} to {}, {} mm, and it is drawn from \
             {}, {} to {}, {} mm",
            low[0], low[1], high[0], high[1], to_low[0], to_low[1], to_high[0], to_high[1]
        ))
    }
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
        // The pen setting must precede the file, which may name more pens than there are.
        let (pens, others): (Vec<_>, Vec<_>) =
            settings.values.iter().partition(|(name, _)| *name == PENS);
        let lines = |values: Vec<&(&str, String)>| {
            let line = |(name, value): &(&str, String)| format!("${name}={value}");
            values.into_iter().map(line).collect::<Vec<String>>()
        };
        let before = std::iter::once(CLEAR.to_owned()).chain(lines(pens));
        let after = std::iter::once(VIEW_AUTO.to_owned()).chain(lines(others));
        Self {
            before: before.map(JobLine::command).collect(),
            file,
            after: after.map(JobLine::command).collect(),
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
        let values = [
            ("eye", "-3,-4,2.5"),
            ("up", "0,0,1"),
            ("hidden", "dotted"),
            ("pens", "auto"),
            ("page", "210x297"),
            ("title", "F\\xFCr Ada"),
            ("lift", "2.5"),
        ];
        let settings = Settings {
            page: Page { width: 210.0, height: 297.0 },
            values: values.map(|(name, value)| (name, value.to_owned())).into(),
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
                "$hidden=dotted",
                "$page=210x297",
                "$title=F\\xFCr Ada",
                "$lift=2.5",
            ]
        );
    }
}
