//! The results of a job: what was drawn, its lengths, and the times of computing it.

use crate::path::{PagePoint, Run};
use serde::{Serialize, Serializer};
use std::fmt;
use std::ops::Add;

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
    /// of the last one, and of the return to that start, if there is one.
    pub pen_up_mm: f64,
    /// Harrison's drawing efficiency (5.7, equation 7): the length drawn divided by the length of
    /// all moves, 0 to 1.
    pub efficiency: f64,
    /// The number of motor steps. A simultaneous step of both axes counts once.
    pub steps: u64,
    /// The time from the first to the last change of a pin, in seconds, without changes of pens by
    /// hand.
    pub duration_s: f64,
    /// The computing time of each stage.
    pub timings_ms: Timings,
    /// The path of the pen according to the pins, for the picture.
    #[serde(skip)]
    pub runs: Vec<Run>,
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
    /// use penup_job::results::Lengths;
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
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct JobReport {
    /// How often the pen is lowered, except for the dashes of dotted lines.
    pub strokes: u64,
    /// The length drawn in mm, as the plotter reports it: with one decimal.
    #[serde(serialize_with = "as_number")]
    pub pen_down_mm: String,
    /// The length of the moves between strokes in mm, with one decimal.
    #[serde(serialize_with = "as_number")]
    pub pen_up_mm: String,
    /// The length drawn divided by the length of all moves, in %.
    #[serde(serialize_with = "as_number", rename = "efficiency_percent")]
    pub efficiency: String,
}

/// Writes a decimal of the plotter as a number.
fn as_number<S: Serializer>(decimal: &str, serializer: S) -> Result<S::Ok, S::Error> {
    decimal.parse::<f64>().ok().serialize(serializer)
}

impl JobReport {
    /// Parses one of the lines that answer `$model`; `None` if it is not the line with the lengths.
    /// `strokes` comes from the status reports.
    ///
    /// ```
    /// use penup_job::results::JobReport;
    /// let line = "[JOB:pen down 80.0 mm, up 30.5 mm, efficiency 72.3 %, bound 30.5 mm, the
    /// least]"; let report = JobReport::parse(2, line).expect("the line of lengths");
    /// assert_eq!(report.pen_up_mm, "30.5");
    /// ```
    pub fn parse(strokes: u64, line: &str) -> Option<Self> {
        let (down, rest) = line.strip_prefix("[JOB:pen down ")?.split_once(" mm, up ")?;
        let (up, rest) = rest.split_once(" mm, efficiency ")?;
        let (efficiency, _) = rest.split_once(" %")?;
        let [pen_down_mm, pen_up_mm, efficiency] = [down, up, efficiency].map(str::to_owned);
        Some(Self { strokes, pen_down_mm, pen_up_mm, efficiency })
    }

    /// Returns the same results with the lengths of other moves between the strokes.
    #[must_use]
    pub fn with_moves_of(self, lengths: Lengths) -> Self {
        let pen_up_mm = format!("{:.1}", lengths.pen_up_mm);
        Self { pen_up_mm, efficiency: format!("{:.1}", 100.0 * lengths.efficiency()), ..self }
    }
}

/// A number of strokes with its noun.
pub fn counted_strokes(number: u64) -> String {
    format!("{number} {}", if number == 1 { "stroke" } else { "strokes" })
}

impl fmt::Display for JobReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { strokes, pen_down_mm, pen_up_mm, efficiency } = self;
        write!(
            formatter,
            "{}, {pen_down_mm} mm drawn, {pen_up_mm} mm between them, efficiency {efficiency} %",
            counted_strokes(*strokes)
        )
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
            duration_s: 12.5,
            timings_ms: Timings { view: 0.5, visibility: 1.5, order: 2.0 },
            runs: Vec::new(),
        };
        assert_eq!(
            serde_json::to_string(&result).expect("numbers are finite"),
            "{\"segments\":[[0.0,0.5,1.0,-1.0]],\"segment_pens\":[1],\
             \"strokes\":[[[10.0,20.0],[30.0,20.25]]],\"stroke_pens\":[2],\
             \"pen_down_mm\":20.0,\"pen_up_mm\":0.0,\"efficiency\":1.0,\"steps\":1600,\
             \"duration_s\":12.5,\"timings_ms\":{\"view\":0.5,\"visibility\":1.5,\"order\":2.0}}"
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
}
