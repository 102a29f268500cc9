//! Finds the polylines of a plan and writes the fitted curves as OBJ.

use super::{FittedCurve, PlanPoint, fit_each};
use penup::protocol::Command;
use penup_readers::lines::Lines;
use std::fmt::{self, Write};
use std::rc::Rc;

/// The reason why a file could not be fitted.
#[derive(Debug, Clone, PartialEq)]
pub enum FitError {
    /// The tolerance is not within [`TOLERANCES`].
    Tolerance,
    /// A line of the file cannot be fitted.
    Line {
        /// The line number, counted from 1.
        number: usize,
        /// What is wrong with the line.
        reason: &'static str,
    },
    /// There is no `l` element.
    NoPolyline,
}

/// The tolerances that make sense on paper, in mm.
pub const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-4..=1000.0;

/// The largest coordinate that a plotter takes, in mm.
const COORDINATE_LIMIT: f64 = (1u32 << 30) as f64;

impl fmt::Display for FitError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tolerance => write!(
                formatter,
                "the tolerance is {} to {} mm",
                TOLERANCES.start(),
                TOLERANCES.end()
            ),
            Self::Line { number, reason } => write!(formatter, "line {number}: {reason}"),
            Self::NoPolyline => write!(formatter, "there is no polyline (`l` element) to fit"),
        }
    }
}

impl std::error::Error for FitError {}

/// The sizes before and after fitting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saving {
    /// The number of polylines in the file.
    pub polylines: usize,
    /// The number of their vertices.
    pub vertices_before: usize,
    /// The number of control points of the curves.
    pub vertices_after: usize,
    /// The size of the input in bytes.
    pub bytes_before: usize,
    /// The size of the output in bytes.
    pub bytes_after: usize,
    /// The number of polylines that are not written because they have no length.
    pub left_out: usize,
}

impl fmt::Display for Saving {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let saved =
            |before: usize, after: usize| 100.0 * (1.0 - after as f64 / (before as f64).max(1.0));
        write!(
            formatter,
            "{} polylines: {} vertices became {} control points ({:.1} % saved), \
             {} bytes became {} ({:.1} % saved)",
            self.polylines,
            self.vertices_before,
            self.vertices_after,
            saved(self.vertices_before, self.vertices_after),
            self.bytes_before,
            self.bytes_after,
            saved(self.bytes_before, self.bytes_after),
        )?;
        match self.left_out {
            0 => Ok(()),
            1 => write!(formatter, "; 1 without a length is left out"),
            count => write!(formatter, "; {count} without a length are left out"),
        }
    }
}

/// The result of fitting a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The text of the new OBJ file.
    pub obj: String,
    /// How much it saves.
    pub saving: Saving,
}

/// Fits every polyline of a plan within `tolerance` mm; each keeps its pen. `lines` are those of a
/// file of `size` bytes. From time to time it calls `progress` with the number of vertices done and
/// the number of all vertices.
///
/// # Errors
/// See [`FitError`].
pub fn fit_obj(
    lines: &dyn Lines,
    size: usize,
    tolerance: f64,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Fitted, FitError> {
    if !TOLERANCES.contains(&tolerance) {
        return Err(FitError::Tolerance);
    }
    let Plan { polylines, pens, height } = Plan::read(lines)?;
    let fitted = fit_each(&polylines, tolerance, progress);
    let left_out = fitted.iter().filter(|curve| curve.is_none()).count();
    let penned = |(curve, pen): (Option<FittedCurve>, _)| Some((pen, curve?));
    let (pens, curves): (Vec<_>, Vec<_>) = fitted.into_iter().zip(pens).filter_map(penned).unzip();
    let obj = write_obj(&curves, &pens, height, tolerance);
    let saving = Saving {
        polylines: polylines.len(),
        vertices_before: polylines.iter().map(Vec::len).sum(),
        vertices_after: curves.iter().map(|curve| curve.control.len()).sum(),
        bytes_before: size,
        bytes_after: obj.len(),
        left_out,
    };
    Ok(Fitted { obj, saving })
}

/// The maximum number of control points on one `curv` line. With numbers of six digits such a line
/// stays below 256 bytes.
const CONTROL_LIMIT: usize = 30;

/// Writes curves as OBJ. All vertices get the z coordinate `height`, and coordinates are rounded to
/// a hundredth of `tolerance` or finer.
///
/// A long curve is written as several curves that share control points, because each polynomial
/// depends on only `order` of them. `pens` contains the line that chooses the pen of each curve.
pub fn write_obj(
    curves: &[FittedCurve],
    pens: &[Option<Rc<str>>],
    height: f64,
    tolerance: f64,
) -> String {
    let decimals = (2.0 - tolerance.log10()).ceil().clamp(0.0, 9.0) as usize;
    let mut obj = String::from("cstype bspline\n");
    let mut vertices = 0;
    let mut order = 0;
    let mut pen = &None;
    for (curve, its_pen) in curves.iter().zip(pens) {
        if let Some(line) = its_pen
            && its_pen != pen
        {
            let _ = writeln!(obj, "{line}");
            pen = its_pen;
        }
        for position in &curve.control {
            let [x, y] = position.map(|c| shortest(c, decimals));
            let _ = writeln!(obj, "v {x} {y} {}", shortest(height, decimals));
        }
        if curve.order != order {
            order = curve.order;
            let _ = writeln!(obj, "deg {}", order - 1);
        }
        let degree = order - 1;
        let mut first = 0;
        while first + degree < curve.control.len() {
            let end = (first + CONTROL_LIMIT).min(curve.control.len());
            let knots = &curve.knots[first..end + order];
            let ends = [knots[degree], knots[end - first]].map(|knot| knot - knots[0]);
            let _ = write!(obj, "curv {} {}", ends[0], ends[1]);
            for control in first..end {
                let _ = write!(obj, " {}", vertices + control + 1);
            }
            obj.push_str("\nparm u");
            for knot in knots {
                let _ = write!(obj, " {}", knot - knots[0]);
            }
            obj.push_str("\nend\n");
            first = end - degree;
        }
        vertices += curve.control.len();
    }
    obj
}

/// Formats `value` with at most `decimals` decimals and without trailing zeros.
fn shortest(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    if text == "-0" { "0".into() } else { text.into() }
}

/// The polylines of a file, all of which have the same z.
struct Plan {
    polylines: Vec<Vec<PlanPoint>>,
    /// The line that chooses the pen of each polyline; `None` before the first such line.
    pens: Vec<Option<Rc<str>>>,
    height: f64,
}

impl Plan {
    fn read(lines: &dyn Lines) -> Result<Self, FitError> {
        let mut vertices: Vec<PlanPoint> = Vec::new();
        let mut height = None;
        let mut chains: Vec<Vec<usize>> = Vec::new();
        let mut pens = Vec::new();
        let mut pen: Option<Rc<str>> = None;
        let mut first_curve = None;
        for line in lines.in_order() {
            let number = line.origin.map_or(0, |origin| origin.line);
            let refused = |reason| FitError::Line { number, reason };
            match Command::parse(&line.sent) {
                Ok(Command::Vertex(numbers)) => {
                    let [x, y, z] = numbers.map(|number| number.to_f64());
                    let is_usable = |number: &f64| number.abs() <= COORDINATE_LIMIT;
                    if ![x, y, z].iter().all(is_usable) {
                        return Err(refused("coordinates go up to 1073741824"));
                    }
                    if *height.get_or_insert(z) != z {
                        return Err(refused("the plan is not flat: z must be the same everywhere"));
                    }
                    vertices.push([x, y]);
                }
                Ok(Command::Polyline(numbers)) => {
                    let chain: Option<Vec<usize>> =
                        numbers.iter().map(|number| vertex(number, vertices.len())).collect();
                    let chain = chain.ok_or_else(|| refused("there is no such vertex"))?;
                    if chain.len() < 2 {
                        return Err(refused("a polyline needs two vertices"));
                    }
                    match chains.last_mut() {
                        // A trace may be written with one element for each side, which are joined
                        // here.
                        Some(before)
                            if before.last() == chain.first() && pens.last() == Some(&pen) =>
                        {
                            before.extend(&chain[1..]);
                        }
                        _ => {
                            chains.push(chain);
                            pens.push(pen.clone());
                        }
                    }
                }
                Ok(Command::Face(_)) => {
                    return Err(refused("faces cannot be fitted, only polylines"));
                }
                Ok(Command::Pen { .. }) => pen = Some(line.sent.into()),
                Ok(Command::Curve { .. }) => {
                    first_curve.get_or_insert(number);
                }
                // Keywords that belong to a curve are ignored. The reader of the file accepts
                // nothing else.
                _ => {}
            }
        }
        match first_curve {
            _ if chains.is_empty() => return Err(FitError::NoPolyline),
            Some(number) => {
                let reason = "this is a curve already: fit a file of polylines alone";
                return Err(FitError::Line { number, reason });
            }
            None => {}
        }
        let polylines =
            chains.iter().map(|chain| chain.iter().map(|at| vertices[*at]).collect()).collect();
        Ok(Self { polylines, pens, height: height.unwrap_or(0.0) })
    }
}

/// The index, counted from 0, of the vertex that an OBJ index refers to.
fn vertex(number: i32, count: usize) -> Option<usize> {
    let number = i64::from(number);
    let at = if number < 0 { count as i64 + number } else { number - 1 };
    usize::try_from(at).ok().filter(|at| *at < count)
}
