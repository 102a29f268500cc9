//! Writes the lines of a drawing, in the order of the plotter, for other machines: as G-code or as
//! HP-GL.
//!
//! The lines are those that the pins of the previewed machine draw, so dashes are lines of their
//! own, and closed lines begin where the order of the plotter begins them.

use crate::path::{PagePoint, Run};
use std::fmt::Write as _;

/// How often, and how, each line of a drawing is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Retracing {
    /// The number of times that each line is drawn, 1 or more.
    pub passes: u32,
    /// Whether closed lines begin at random points, so that the marks which a pen leaves there do
    /// not stand in a row.
    pub reloops: bool,
}

/// A line that a pen draws without being lifted.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// The pen, counted from 1.
    pub pen: u8,
    /// The points in mm; a single one is a dot.
    pub points: Vec<PagePoint>,
}

/// The lines that `runs` draw.
///
/// ```
/// use penup_job::export::{Line, Retracing, lines};
/// use penup_job::path::Run;
/// let points = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]];
/// let run = Run { pen_down: true, pen: 1, points: points.clone() };
/// let twice = Retracing { passes: 2, reloops: false };
/// let back = [[2.0, 0.0], [0.0, 0.0]];
/// let points = [points, back.to_vec()].concat();
/// assert_eq!(lines(&[run], twice), [Line { pen: 1, points }]);
/// ```
pub fn lines(runs: &[Run], retracing: Retracing) -> Vec<Line> {
    let mut dice = Random(0x9E37_79B9_7F4A_7C15);
    let drawn = runs.iter().filter(|run| run.pen_down && !run.points.is_empty());
    drawn
        .map(|run| {
            let mut points = run.points.clone();
            if retracing.reloops {
                relooped(&mut points, &mut dice);
            }
            Line { pen: run.pen, points: retraced(points, retracing.passes) }
        })
        .collect()
}

fn is_closed(points: &[PagePoint]) -> bool {
    points.len() > 2 && points.first() == points.last()
}

/// Begins a closed line at another of its points.
fn relooped(points: &mut Vec<PagePoint>, dice: &mut Random) {
    if is_closed(points) {
        points.pop();
        let begin = dice.below(points.len());
        points.rotate_left(begin);
        points.extend(points.first().copied());
    }
}

/// The points of all passes: a closed line goes round again, an open one goes back and forth.
fn retraced(points: Vec<PagePoint>, passes: u32) -> Vec<PagePoint> {
    let closed = is_closed(&points);
    let mut all = points.clone();
    for pass in 1..passes {
        match pass % 2 {
            1 if !closed => all.extend(points.iter().rev().skip(1)),
            _ => all.extend(points.iter().skip(1)),
        }
    }
    all
}

/// Random numbers that are the same in each run, so that a file can be made again (Marsaglia 2003).
struct Random(u64);

impl Random {
    /// A number from 0 to `limit - 1`; 0 if the limit is 0.
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 33).checked_rem(limit as u64).unwrap_or(0) as usize
    }
}

/// Writes `lines` as G-code for Grbl: M3 lowers the pen, M5 raises it, and M0 waits for a pen to be
/// changed. The pen draws at `speed`, in mm/min.
pub fn gcode(lines: &[Line], speed: f64) -> String {
    let mut text = format!("(penup {})\nG21\nG90\nM5\n", env!("CARGO_PKG_VERSION"));
    let mut pen = 1;
    for line in lines {
        let Some(([x, y], rest)) = line.points.split_first() else { continue };
        if line.pen != pen {
            pen = line.pen;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "(pen {pen})\nM0");
        }
        let _ = writeln!(text, "G0 X{} Y{}\nM3", Decimal(*x), Decimal(*y));
        let rest = if rest.is_empty() { &line.points } else { rest };
        for (index, [x, y]) in rest.iter().enumerate() {
            let _ = write!(text, "G1 X{} Y{}", Decimal(*x), Decimal(*y));
            let _ = match index {
                0 => writeln!(text, " F{}", Decimal(speed)),
                _ => writeln!(text),
            };
        }
        text.push_str("M5\n");
    }
    text + "G0 X0 Y0\nM2\n"
}

/// The number of units of HP-GL in a millimetre.
const HPGL_UNITS: f64 = 40.0;

/// The most points in one instruction of HP-GL, so that a plotter with a small memory takes it.
const HPGL_POINTS: usize = 50;

/// Writes `lines` as HP-GL, in units of 0.025 mm. `SP` chooses the pens.
pub fn hpgl(lines: &[Line]) -> String {
    let units = |point: &PagePoint| point.map(|part| (part * HPGL_UNITS).round() as i64);
    let mut text = String::from("IN;\n");
    let mut pen = 0;
    for line in lines {
        let mut points: Vec<[i64; 2]> = line.points.iter().map(units).collect();
        points.dedup();
        let Some(([x, y], rest)) = points.split_first() else { continue };
        if line.pen != pen {
            pen = line.pen;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "SP{pen};");
        }
        let _ = write!(text, "PU{x},{y};");
        if rest.is_empty() {
            text.push_str("PD;");
        }
        for part in rest.chunks(HPGL_POINTS) {
            let numbers: Vec<String> = part.iter().map(|[x, y]| format!("{x},{y}")).collect();
            let _ = write!(text, "PD{};", numbers.join(","));
        }
        text.push_str("PU;\n");
    }
    text + "PU0,0;SP0;\n"
}

/// A number with up to three decimals.
struct Decimal(f64);

impl std::fmt::Display for Decimal {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Adding zero turns a negative zero into a positive one.
        write!(formatter, "{}", (self.0 * 1000.0).round() / 1000.0 + 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(pen: u8, points: &[PagePoint]) -> Run {
        Run { pen_down: true, pen, points: points.to_vec() }
    }

    const ONCE: Retracing = Retracing { passes: 1, reloops: false };

    #[test]
    fn each_pass_draws_the_whole_line_without_lifting_the_pen() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]];
        let open = [[0.0, 0.0], [3.0, 0.0], [3.0, 5.0]];
        let length = |points: &[PagePoint]| -> f64 {
            points.windows(2).map(|it| (it[1][0] - it[0][0]).hypot(it[1][1] - it[0][1])).sum()
        };
        for passes in 1..5 {
            for points in [&square[..], &open] {
                let retracing = Retracing { passes, reloops: false };
                let drawn = lines(&[run(1, points)], retracing);
                assert_eq!(drawn.len(), 1);
                assert_eq!(length(&drawn[0].points), f64::from(passes) * length(points));
            }
        }
    }

    #[test]
    fn closed_lines_begin_elsewhere_and_stay_the_same_lines() {
        let ring: Vec<PagePoint> =
            (0..=40).map(|at| f64::from(at % 40) * 0.157).map(|a| [a.cos(), a.sin()]).collect();
        let open = [[9.0, 9.0], [1.0, 2.0], [5.0, 5.0]];
        let runs: Vec<Run> = (0..20).map(|_| run(1, &ring)).chain([run(1, &open)]).collect();
        let drawn = lines(&runs, Retracing { passes: 1, reloops: true });
        let sides = |points: &[PagePoint]| {
            let mut sides: Vec<String> =
                points.windows(2).map(|side| format!("{side:?}")).collect();
            sides.sort();
            sides
        };
        let (last, rings) = drawn.split_last().expect("lines");
        assert_eq!(last.points, open);
        for line in rings {
            assert_eq!(sides(&line.points), sides(&ring));
        }
        let mut begins: Vec<String> =
            rings.iter().map(|it| format!("{:?}", it.points[0])).collect();
        begins.sort();
        begins.dedup();
        assert!(begins.len() > 10, "{begins:?}");
        assert_eq!(drawn, lines(&runs, Retracing { passes: 1, reloops: true }));
    }

    #[test]
    fn pens_dots_and_numbers_are_written_as_other_machines_read_them() {
        let drawn = lines(&[run(1, &[[1.0, 2.0], [3.5, -0.0001]]), run(3, &[[0.1, 0.2]])], ONCE);
        let version = env!("CARGO_PKG_VERSION");
        assert_eq!(
            gcode(&drawn, 1500.0),
            format!(
                "(penup {version})\nG21\nG90\nM5\nG0 X1 Y2\nM3\nG1 X3.5 Y0 F1500\nM5\n(pen 3)\nM0\n\
                 G0 X0.1 Y0.2\nM3\nG1 X0.1 Y0.2 F1500\nM5\nG0 X0 Y0\nM2\n"
            )
        );
        assert_eq!(
            hpgl(&drawn),
            "IN;\nSP1;PU40,80;PD140,0;PU;\nSP3;PU4,8;PD;PU;\nPU0,0;SP0;\n"
                .replace(";PU40", ";\nPU40")
                .replace("SP3;PU4", "SP3;\nPU4")
        );
    }
}
