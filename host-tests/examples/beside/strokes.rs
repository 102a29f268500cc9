//! The order of strokes beside vpype's `linesort`.

use crate::program::{Program, file};
use crate::{by_turns, milliseconds};
use penup::order::{Effort, Options, TimeModel};
use penup_host_tests::order_drawings::{KINDS, Strokes};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// The numbers of strokes.
const COUNTS: [u32; 3] = [1_000, 5_000, 20_000];

/// The efforts of penup, each beside a command of vpype that is meant for the same.
const EFFORTS: [(&str, Effort, &str); 2] = [
    ("`$effort=0`", Effort::Units(0), "linesort"),
    (
        "`--compute host`",
        Effort::Auto(TimeModel {
            speed: 8000,
            acceleration: 64_000,
            units_per_second: TimeModel::COMPUTER,
        }),
        "linesort --two-opt",
    ),
];

/// The strokes in millimetres, one in a line.
fn text(strokes: &Strokes) -> String {
    let mut text = String::new();
    let mut end = None;
    for segment in &strokes.segments {
        let [from, to] = [segment.from(), segment.to()].map(|number| {
            let point = strokes.points[number as usize];
            format!("{} {}", f64::from(point.x) / 80.0, f64::from(point.y) / 80.0)
        });
        if end == Some(segment.from()) {
            text += &format!(" {to}");
        } else {
            text += &format!("{}{from} {to}", if text.is_empty() { "" } else { "\n" });
        }
        end = Some(segment.to());
    }
    text
}

/// Prints a table of drawings of separate strokes.
///
/// # Errors
/// A file cannot be written.
pub fn compare(python: Option<&Path>) -> Result<(), Box<dyn Error>> {
    println!(
        "| drawing | strokes | penup | ms | pen up, mm | vpype | ms | times as long | pen up, mm, \
         of penup's |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    // The edges of triangles are one part.
    for (name, make) in KINDS.into_iter().filter(|(name, _)| *name != "triangles") {
        for count in COUNTS {
            let strokes = make(count, 1);
            let path = file(&format!("{}-{count}.txt", name.replace(' ', "-")), &text(&strokes))?;
            let path = path.display().to_string();
            for (effort_name, effort, command) in EFFORTS {
                let start = |python| Program::start(python, "vpype_sort.py", &[&path, command]);
                let options = Options { effort, ..Options::default() };
                let mut pen_up = 0.0;
                let both = by_turns(python.map(start), || {
                    let began = Instant::now();
                    let (_, report, _) = strokes.order(options).expect("an order");
                    // In 1/256 steps of 1/80 mm.
                    pen_up = report.pen_up as f64 / 256.0 / 80.0;
                    began.elapsed().as_secs_f64() * 1e3
                });
                let theirs = both.other.as_ref().map_or(String::new(), |found| {
                    format!("{:.0}, {:.1} %", found.length, 100.0 * found.length / pen_up)
                });
                println!(
                    "| {name} | {count} | {effort_name} | {} | {pen_up:.0} | `{command}` | {} | \
                     {theirs} |",
                    milliseconds(both.penup),
                    both.columns(),
                );
            }
        }
    }
    Ok(())
}
