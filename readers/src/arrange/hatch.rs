//! Fills areas with parallel lines.

use super::{Hatch, sine_cosine};
use crate::counted;
use crate::plan::{Area, Plan, Point, Stroke};
use crate::region::Regions;
use std::collections::BTreeMap;

/// The most lines that hatch a drawing. They take some 100 MB.
const MOST_LINES: usize = 1_000_000;

/// The most tests of the sides of clip paths, in units of some points.
const MOST_WORK: usize = 10_000_000;

/// The length in mm below which a line is left out: it would be a dot.
const SHORTEST: f64 = 0.002;

/// The area in mm² up to which nobody misses lines in a shape.
const LEAST_AREA: f64 = 0.01;

/// Hatches the areas that the file fills. In a file that does not say which these are, it hatches
/// what the closed strokes of a pen surround together. Returns how many got no line, for the user.
///
/// # Errors
/// There is no area, or there are too many lines.
pub(super) fn hatch(plan: &mut Plan, hatch: Hatch) -> Result<Option<String>, String> {
    let are_filled = plan.areas.is_some();
    let areas = match plan.areas.take() {
        Some(areas) => areas,
        None => closed(plan),
    };
    if areas.is_empty() {
        return Err("there is no closed, filled shape to hatch".to_owned());
    }
    let (mut lines, mut budget, mut without_line) = (0, MOST_WORK, 0);
    for area in areas {
        let Area { outlines, is_even_odd, within, pen, layer, element } = area;
        let too_many = || format!("--hatch {} makes more than a million lines", hatch.spacing);
        let hatched =
            lines_within(&outlines, is_even_odd, hatch, MOST_LINES - lines).ok_or_else(too_many)?;
        lines += hatched.len();
        without_line += match are_filled {
            true => usize::from(hatched.is_empty() && outlines.iter().any(|it| is_seen(it))),
            false => outlines.iter().filter(|it| is_seen(it) && !is_crossed(it, hatch)).count(),
        };
        for line in hatched {
            let parts = within.cut(&line, &mut budget).map_err(|_| {
                "the clip paths of the drawing have too many sides for --hatch".to_owned()
            })?;
            let stroke = |points| Stroke { points, pen, layer, element, is_dot: false };
            plan.strokes.extend(parts.into_iter().map(stroke));
        }
    }
    let nouns = match are_filled {
        true => ["filled shape is", "filled shapes are"],
        false => ["closed line is", "closed lines are"],
    };
    Ok((without_line > 0).then(|| {
        let them = if without_line == 1 { "it" } else { "them" };
        format!(
            "{} not hatched: no line of --hatch {} crosses {them}",
            counted(without_line, nouns),
            hatch.spacing
        )
    }))
}

/// Whether an outline surrounds an area that would be seen if it were filled.
fn is_seen(outline: &[Point]) -> bool {
    let Some(last) = outline.last() else { return false };
    let before = std::iter::once(last).chain(outline);
    let twice: f64 = before.zip(outline).map(|(from, to)| from[0] * to[1] - to[0] * from[1]).sum();
    twice.abs() > 2.0 * LEAST_AREA
}

/// Whether a line of the hatching crosses an outline.
fn is_crossed(outline: &[Point], hatch: Hatch) -> bool {
    let (sine, cosine) = sine_cosine(hatch.angle);
    let numbers = outline.iter().map(|[x, y]| ((y * cosine - x * sine) / hatch.spacing).ceil());
    let [low, high] = numbers
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], it| [low.min(it), high.max(it)]);
    low < high
}

/// Returns the areas that the closed strokes of each pen surround together.
fn closed(plan: &Plan) -> Vec<Area> {
    let mut areas: BTreeMap<u32, Area> = BTreeMap::new();
    for stroke in plan.strokes.iter().filter(|stroke| stroke.is_closed()) {
        let Stroke { pen, layer, element, .. } = *stroke;
        let within = Regions::default();
        let area = || Area { outlines: Vec::new(), is_even_odd: true, within, pen, layer, element };
        areas.entry(pen).or_insert_with(area).outlines.push(stroke.points.clone());
    }
    areas.into_values().collect()
}

/// The lines that hatch what `outlines` surround by a rule of filling; `None` if they are more than
/// `most`. The lines of all areas of a drawing lie on the same grid.
fn lines_within(
    outlines: &[Vec<Point>],
    is_even_odd: bool,
    hatch: Hatch,
    most: usize,
) -> Option<Vec<[Point; 2]>> {
    let Hatch { spacing, angle } = hatch;
    let (sine, cosine) = sine_cosine(angle);
    // Converts a point to coordinates along the lines and across them, in units of the distance
    // between lines.
    let turned = |[x, y]: Point| [x * cosine + y * sine, (y * cosine - x * sine) / spacing];
    let mut crossings: BTreeMap<i64, Vec<(f64, i32)>> = BTreeMap::new();
    let mut count = 0usize;
    for outline in outlines {
        let mut from = turned(*outline.last()?);
        for point in outline {
            let to = turned(*point);
            let (low, high, turn) = if from[1] <= to[1] { (from, to, 1) } else { (to, from, -1) };
            // A line through a corner belongs to the side above it, so that it counts once.
            let (first, end) = (low[1].ceil(), high[1].ceil());
            count = count.saturating_add((end - first) as usize);
            if count > 2 * most {
                return None;
            }
            for line in first as i64..end as i64 {
                let part = (line as f64 - low[1]) / (high[1] - low[1]);
                let along = low[0] + part * (high[0] - low[0]);
                crossings.entry(line).or_default().push((along, turn));
            }
            from = to;
        }
    }
    let back = |along: f64, line: i64| {
        let across = line as f64 * spacing;
        [along * cosine - across * sine, along * sine + across * cosine]
    };
    let mut lines = Vec::new();
    for (line, mut along) in crossings {
        along.sort_by(|one, other| one.0.total_cmp(&other.0));
        let (mut turns, mut begin) = (0, 0.0);
        let is_inside = |turns: i32| if is_even_odd { turns % 2 != 0 } else { turns != 0 };
        for (along, turn) in along {
            let before = is_inside(turns);
            turns += turn;
            if !before {
                begin = along;
            } else if !is_inside(turns) && along - begin >= SHORTEST {
                lines.push([back(begin, line), back(along, line)]);
            }
        }
    }
    (lines.len() <= most).then_some(lines)
}
