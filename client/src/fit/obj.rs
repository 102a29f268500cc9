//! The file: polylines in, curves out, and what was saved.

use super::{FittedCurve, Place, fit};
use std::fmt::{self, Write};

/// Why a file was not fitted.
#[derive(Debug, Clone, PartialEq)]
pub enum FitError {
    /// The tolerance is not a positive number of millimetres.
    Tolerance,
    /// A line of the file cannot be read.
    Line {
        /// From 1.
        number: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// There is no `l` element.
    NoPolyline,
}

impl fmt::Display for FitError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tolerance => write!(formatter, "the tolerance must be a positive number of mm"),
            Self::Line { number, reason } => write!(formatter, "line {number}: {reason}"),
            Self::NoPolyline => write!(formatter, "there is no polyline (`l` element) to fit"),
        }
    }
}

impl std::error::Error for FitError {}

/// What fitting saved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saving {
    /// How many polylines were read.
    pub polylines: usize,
    /// Their vertices.
    pub vertices_before: usize,
    /// The control points of the curves.
    pub vertices_after: usize,
    /// Bytes of the file read.
    pub bytes_before: usize,
    /// Bytes of the file written.
    pub bytes_after: usize,
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
        )
    }
}

/// A fitted file.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The new file.
    pub obj: String,
    /// What it saves.
    pub saving: Saving,
}

/// Fits every polyline of an OBJ plan within `tolerance` mm.
///
/// # Errors
/// See [`FitError`].
pub fn fit_obj(text: &str, tolerance: f64) -> Result<Fitted, FitError> {
    if !(tolerance > 0.0 && tolerance.is_finite()) {
        return Err(FitError::Tolerance);
    }
    let plan = Plan::read(text)?;
    let curves = fit(&plan.polylines, tolerance);
    let obj = write_obj(&curves, plan.height, tolerance);
    let saving = Saving {
        polylines: plan.polylines.len(),
        vertices_before: plan.polylines.iter().map(Vec::len).sum(),
        vertices_after: curves.iter().map(|curve| curve.control.len()).sum(),
        bytes_before: text.len(),
        bytes_after: obj.len(),
    };
    Ok(Fitted { obj, saving })
}

/// Control points on one `curv` line: with numbers of six digits it stays below 256 bytes.
const CONTROL_LIMIT: usize = 30;

/// Writes curves as OBJ, `height` the z of all, rounded to a hundredth of `tolerance` or finer.
///
/// A long curve is written as several, which share control points: each polynomial depends on `order`
/// of them only.
pub fn write_obj(curves: &[FittedCurve], height: f64, tolerance: f64) -> String {
    let places = (2.0 - tolerance.log10()).ceil().clamp(0.0, 9.0) as usize;
    let mut obj = String::from("cstype bspline\n");
    let mut vertices = 0;
    let mut order = 0;
    for curve in curves {
        for place in &curve.control {
            let [x, y] = place.map(|c| shortest(c, places));
            let _ = writeln!(obj, "v {x} {y} {}", shortest(height, places));
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

/// With at most `places` decimals, without zeros that say nothing.
fn shortest(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    if text == "-0" { "0".into() } else { text.into() }
}

/// The polylines of a file, all at one height.
struct Plan {
    polylines: Vec<Vec<Place>>,
    height: f64,
}

impl Plan {
    fn read(text: &str) -> Result<Self, FitError> {
        let mut vertices: Vec<Place> = Vec::new();
        let mut height = None;
        let mut chains: Vec<Vec<usize>> = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let refused = |reason| FitError::Line { number: number + 1, reason };
            let mut words = line.split('#').next().unwrap_or("").split_ascii_whitespace();
            match words.next() {
                Some("v") => {
                    let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
                    let [x, y, z, ..] = numbers[..] else {
                        return Err(refused("a vertex needs three numbers"));
                    };
                    if !numbers.iter().all(|number| number.is_finite()) {
                        return Err(refused("a vertex needs three numbers"));
                    }
                    if *height.get_or_insert(z) != z {
                        return Err(refused("the plan is not flat: z must be the same everywhere"));
                    }
                    vertices.push([x, y]);
                }
                Some("l") => {
                    let chain: Option<Vec<usize>> =
                        words.map(|word| vertex(word, vertices.len())).collect();
                    let chain = chain.ok_or_else(|| refused("there is no such vertex"))?;
                    if chain.len() < 2 {
                        return Err(refused("a polyline needs two vertices"));
                    }
                    match chains.last_mut() {
                        // A trace that comes as one element for each side.
                        Some(before) if before.last() == chain.first() => {
                            before.extend(&chain[1..]);
                        }
                        _ => chains.push(chain),
                    }
                }
                Some("f") => return Err(refused("faces cannot be fitted, only polylines")),
                _ => {}
            }
        }
        if chains.is_empty() {
            return Err(FitError::NoPolyline);
        }
        let polylines =
            chains.iter().map(|chain| chain.iter().map(|at| vertices[*at]).collect()).collect();
        Ok(Self { polylines, height: height.unwrap_or(0.0) })
    }
}

/// The vertex that an OBJ number means, from 0.
fn vertex(word: &str, count: usize) -> Option<usize> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let at = if number < 0 { count as i64 + number } else { number - 1 };
    usize::try_from(at).ok().filter(|at| *at < count)
}
