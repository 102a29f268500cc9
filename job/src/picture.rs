//! Renders the page with the path of the pen as SVG.
//!
//! One unit of the SVG is one millimetre, and the page has its true size. Pen-down lines have the
//! width of a pen; those of the first pen are dark and those of the others are coloured. Pen-up
//! moves are faint and thin. A green disc marks the start of the first stroke and a red ring the
//! end of the last one.

use crate::path::{PagePoint, Run};
use penup_readers::page::Page;
use std::collections::BTreeSet;
use std::fmt::{self, Write as _};

/// The path of the pen on a page.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The size of the page.
    pub page: Page,
    /// All runs in order.
    pub runs: Vec<Run>,
}

const PEN_WIDTH: f64 = 0.3;
const TRAVEL_WIDTH: f64 = 0.15;
const PAPER: &str = "#ffffff";
const INK: &str = "#1b1f3b";
/// The colours of the other pens, which repeat after the last one.
const INKS: [&str; 7] =
    ["#c1121f", "#0077b6", "#2d6a4f", "#e07a00", "#7b2cbf", "#8a5a2b", "#d81b84"];
const TRAVEL: &str = "#3d7edb";
const START: &str = "#2a9d5c";
const END: &str = "#d7433b";

impl Picture {
    /// Creates a picture of `strokes` in this order, with straight pen-up moves between them.
    pub fn of_strokes(page: Page, strokes: &[Vec<PagePoint>]) -> Self {
        let mut runs: Vec<Run> = Vec::with_capacity(2 * strokes.len());
        let mut pen: Option<PagePoint> = None;
        for stroke in strokes {
            let (Some(&start), Some(&end)) = (stroke.first(), stroke.last()) else {
                continue;
            };
            if let Some(from) = pen {
                runs.push(Run { pen_down: false, pen: 1, points: vec![from, start] });
            }
            runs.push(Run { pen_down: true, pen: 1, points: stroke.clone() });
            pen = Some(end);
        }
        Self { page, runs }
    }

    /// Renders the picture as an SVG document.
    pub fn svg(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_svg(&mut text);
        text
    }

    fn write_svg(&self, out: &mut String) -> fmt::Result {
        let Page { width, height } = self.page;
        let (w, h) = (Number(width), Number(height));
        writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" \
             viewBox=\"0 0 {w} {h}\">"
        )?;
        writeln!(out, "<rect width=\"{w}\" height=\"{h}\" fill=\"{PAPER}\"/>")?;
        let faint = format!("stroke=\"{TRAVEL}\" stroke-opacity=\"0.5\"");
        self.write_runs(out, "pen-up", &faint, TRAVEL_WIDTH, |run| !run.pen_down)?;
        let inked = self.runs.iter().filter(|run| run.pen_down);
        let pens: BTreeSet<u8> = inked.map(|run| run.pen).chain([1]).collect();
        for pen in pens {
            let (id, ink) = match usize::from(pen).checked_sub(2) {
                None => ("pen-down".to_owned(), INK),
                Some(other) => (format!("pen-{pen}"), INKS[other % INKS.len()]),
            };
            let paint = format!("stroke=\"{ink}\"");
            self.write_runs(out, &id, &paint, PEN_WIDTH, |run| run.pen_down && run.pen == pen)?;
        }
        self.write_marks(out)?;
        writeln!(out, "</svg>")
    }

    fn write_runs(
        &self,
        out: &mut String,
        id: &str,
        paint: &str,
        width: f64,
        of: impl Fn(&Run) -> bool,
    ) -> fmt::Result {
        writeln!(
            out,
            "<g id=\"{id}\" fill=\"none\" {paint} stroke-width=\"{}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\">",
            Number(width)
        )?;
        for run in self.runs.iter().filter(|run| of(run)) {
            let Some((first, rest)) = run.points.split_first() else {
                continue;
            };
            write!(out, "<path d=\"M{}", self.position(*first))?;
            for point in rest {
                write!(out, "L{}", self.position(*point))?;
            }
            if rest.is_empty() {
                // This is a dot: round caps make a line without a length visible.
                write!(out, "h0")?;
            }
            writeln!(out, "\"/>")?;
        }
        writeln!(out, "</g>")
    }

    fn write_marks(&self, out: &mut String) -> fmt::Result {
        let mut ink = self.runs.iter().filter(|run| run.pen_down);
        let start = ink.clone().find_map(|run| run.points.first());
        let end = ink.rfind(|run| !run.points.is_empty());
        let end = end.and_then(|run| run.points.last());
        let radius = (self.page.width.min(self.page.height) / 200.0).clamp(0.4, 2.0);
        if let Some(&point) = start {
            let Position(x, y) = self.position(point);
            writeln!(
                out,
                "<circle id=\"start\" cx=\"{x}\" cy=\"{y}\" r=\"{}\" fill=\"{START}\"/>",
                Number(radius * 0.8)
            )?;
        }
        if let Some(&point) = end {
            let Position(x, y) = self.position(point);
            writeln!(
                out,
                "<circle id=\"end\" cx=\"{x}\" cy=\"{y}\" r=\"{}\" fill=\"none\" stroke=\"{END}\" \
                 stroke-width=\"{}\"/>",
                Number(radius * 1.3),
                Number(radius * 0.4)
            )?;
        }
        Ok(())
    }

    /// Converts a point to SVG coordinates, whose y axis points down.
    fn position(&self, point: PagePoint) -> Position {
        Position(Number(point[0]), Number(self.page.height - point[1]))
    }
}

/// A number that is written with at most three decimals, a resolution of a thousandth of a mm.
#[derive(Clone, Copy)]
struct Number(f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rounded = (self.0 * 1000.0).round() / 1000.0;
        // Adding zero turns a negative zero into a positive one.
        write!(f, "{}", rounded + 0.0)
    }
}

#[derive(Clone, Copy)]
struct Position(Number, Number);

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.0, self.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: Page = Page { width: 40.0, height: 30.0 };

    #[test]
    fn a_picture_shows_ink_moves_start_and_end() {
        let strokes = [
            vec![[5.0, 5.0], [35.0, 5.0], [35.0, 25.0]],
            vec![],
            vec![[10.0, 25.0], [10.0001, 12.34567]],
        ];
        let svg = Picture::of_strokes(PAGE, &strokes).svg();
        let expected = r##"<svg XMLNS width="40mm" height="30mm" viewBox="0 0 40 30">
<rect width="40" height="30" fill="#ffffff"/>
<g id="pen-up" fill="none" stroke="#3d7edb" stroke-opacity="0.5" stroke-width="0.15" ROUND>
<path d="M35 5L10 5"/>
</g>
<g id="pen-down" fill="none" stroke="#1b1f3b" stroke-width="0.3" ROUND>
<path d="M5 25L35 25L35 5"/>
<path d="M10 5L10 17.654"/>
</g>
<circle id="start" cx="5" cy="25" r="0.32" fill="#2a9d5c"/>
<circle id="end" cx="10" cy="17.654" r="0.52" fill="none" stroke="#d7433b" stroke-width="0.16"/>
</svg>
"##;
        let expected = expected.replace("XMLNS", r#"xmlns="http://www.w3.org/2000/svg""#);
        let round = r#"stroke-linecap="round" stroke-linejoin="round""#;
        assert_eq!(svg, expected.replace("ROUND", round));
    }

    #[test]
    fn each_pen_has_its_ink() {
        let run = |pen, x| Run { pen_down: true, pen, points: vec![[x, 5.0], [x, 9.0]] };
        let runs = vec![run(1, 1.0), run(3, 2.0), run(2, 3.0), run(3, 4.0), run(9, 5.0)];
        let svg = Picture { page: PAGE, runs }.svg();
        let groups: Vec<&str> = svg.split("<g id=\"").skip(2).collect();
        for (group, (id, ink, paths)) in groups.iter().zip([
            ("pen-down", INK, 1),
            ("pen-2", INKS[0], 1),
            ("pen-3", INKS[1], 2),
            ("pen-9", INKS[0], 1),
        ]) {
            assert!(group.starts_with(&format!("{id}\"")) && group.contains(ink), "{group}");
            assert_eq!(group.matches("<path").count(), paths, "{group}");
        }
        assert_eq!(groups.len(), 4);
    }

    #[test]
    fn an_empty_page_is_a_picture() {
        let svg = Picture::of_strokes(PAGE, &[]).svg();
        assert!(!svg.contains("path") && !svg.contains("circle"));
    }
}
