//! Counts how the work grows with the size of a drawing, and draws it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::UNIX_EPOCH;

use anyhow::{Context, Result, ensure};

use crate::command::{cargo, describe, output, run};

/// The sizes of meshes, in faces, and of drawings, in strokes.
const FACES: [u32; 5] = [5_000, 20_000, 80_000, 320_000, 1_300_000];
const STROKES: [u32; 4] = [1_000, 5_000, 20_000, 100_000];

/// The colours of the lines: they differ in lightness, too.
const COLOURS: [&str; 4] = ["#1b5e9b", "#d9742b", "#3a9a6b", "#7a5195"];

/// A picture of how the work for each face or stroke grows.
struct Chart {
    title: &'static str,
    /// What the width shows.
    what: &'static str,
    curves: Vec<Curve>,
}

/// A kind of mesh or drawing.
struct Curve {
    name: &'static str,
    /// The sizes, and the instructions for each face or stroke.
    points: Vec<(f64, f64)>,
}

/// Counts, prints tables, and writes the pictures of `docs/performance.md`.
///
/// # Errors
/// There is no valgrind, or an example fails.
pub fn measure() -> Result<()> {
    let version = output("valgrind", &["--version"]);
    ensure!(version.is_some(), "there is no valgrind: install it, as by `apt install valgrind`");
    let mut build = cargo();
    build.current_dir(crate::root()).args(["build", "--quiet", "--release"]);
    build.args(["--package", "penup-host-tests"]);
    run(build.args(["--example", "hidden_growth", "--example", "order_growth"]))?;
    let hidden = |name, kind: &str, seams: &[&str], sizes: &[u32]| {
        let count = |faces: u32| {
            let faces = faces.to_string();
            let arguments = [&[kind, faces.as_str()], seams].concat();
            instructions("hidden_growth", "*find_stretches*", &arguments)
        };
        curve(name, sizes, count)
    };
    let meshes = Chart {
        title: "Hidden lines: instructions for each face",
        what: "faces",
        curves: vec![
            hidden("icosphere, with seams", "icosphere", &["seams"], &FACES)?,
            hidden("icosphere", "icosphere", &[], &FACES)?,
            // The largest one would take as long as all others.
            hidden("terrain, with seams", "terrain", &["seams"], &FACES[..4])?,
        ],
    };
    meshes.write("growth-hidden-lines.svg")?;
    let ordered = |kind: &'static str| {
        let count = |strokes: u32| {
            let arguments = ["0", "1", kind, &strokes.to_string()];
            instructions("order_growth", "*Strokes*order*", &arguments)
        };
        curve(kind, &STROKES, count)
    };
    let drawings = Chart {
        title: "Order of strokes, without improvement: instructions for each stroke",
        what: "strokes",
        curves: vec![ordered("random")?, ordered("hatched")?, ordered("flow field")?],
    };
    drawings.write("growth-order.svg")
}

/// Counts for all sizes.
fn curve(
    name: &'static str,
    sizes: &[u32],
    count: impl Fn(u32) -> Result<(f64, f64)>,
) -> Result<Curve> {
    say!("| {name} | instructions | for each |\n|---|---|---|")?;
    let mut points = Vec::new();
    for &size in sizes {
        let (size, instructions) = count(size)?;
        let each = instructions / size;
        say!("| {size} | {instructions} | {each:.0} |")?;
        points.push((size, each));
    }
    Ok(Curve { name, points })
}

/// The same as [`counted`], which is done once for each build of the example: all of it takes most
/// of an hour, and goes on where it was interrupted.
fn instructions(example: &str, function: &str, arguments: &[&str]) -> Result<(f64, f64)> {
    let folder = crate::root().join("target/growth");
    let program = crate::root().join("target/release/examples").join(example);
    let built = fs::metadata(&program)?.modified()?.duration_since(UNIX_EPOCH)?.as_secs();
    let name = format!("{example} {} {built}", arguments.join(" ")).replace(' ', "-");
    let kept = folder.join(name);
    let read = fs::read_to_string(&kept).unwrap_or_default();
    let mut numbers = read.split(' ').map_while(|word| word.parse().ok());
    if let Some(found) = numbers.next().zip(numbers.next()) {
        return Ok(found);
    }
    let (size, count) = counted(&program, function, arguments)?;
    fs::create_dir_all(&folder)?;
    fs::write(kept, format!("{size} {count}"))?;
    Ok((size, count))
}

/// Counts the instructions of a function of an example. Returns the size that the example prints
/// first, and the count.
fn counted(program: &Path, function: &str, arguments: &[&str]) -> Result<(f64, f64)> {
    let mut valgrind = Command::new("valgrind");
    valgrind
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(format!("--toggle-collect={function}"))
        .arg(program)
        .args(arguments)
        .stdin(Stdio::null());
    let name = describe(&valgrind);
    let answer = valgrind.output().with_context(|| format!("cannot run {name}"))?;
    ensure!(answer.status.success(), "{name}: {}", answer.status);
    let [said, counted] =
        [answer.stdout, answer.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    let size = said.split([' ', ',']).find_map(|word| word.parse().ok());
    let count = counted.lines().find_map(|line| line.split_once("Collected : ")?.1.parse().ok());
    let (size, count): (f64, f64) = size.zip(count).context("it counted nothing")?;
    ensure!(count > 0.0, "{name}: it has no function {function}");
    Ok((size, count))
}

impl Chart {
    const LEFT: f64 = 80.0;
    const TOP: f64 = 44.0;
    const WIDTH: f64 = 520.0;
    const HEIGHT: f64 = 220.0;

    /// Writes the picture into `docs`.
    fn write(&self, file: &str) -> Result<()> {
        let path = crate::root().join("docs").join(file);
        fs::write(&path, self.svg()).with_context(|| format!("cannot write {}", path.display()))?;
        say!("{}", path.display())
    }

    /// Draws it on white, so that it can be read on any page. The sizes are on a logarithmic scale.
    fn svg(&self) -> String {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let least = points().map(|point| point.0).fold(f64::INFINITY, f64::min).log10();
        let most = points().map(|point| point.0).fold(0.0, f64::max).log10();
        let greatest = points().map(|point| point.1).fold(0.0, f64::max);
        let step = tick(greatest);
        let ticks = (greatest / step).ceil();
        let [right, bottom] = [Self::LEFT + Self::WIDTH, Self::TOP + Self::HEIGHT];
        let x = |size: f64| Self::LEFT + (size.log10() - least) / (most - least) * Self::WIDTH;
        let y = |each: f64| bottom - each / (ticks * step) * Self::HEIGHT;
        let (width, height) = (right + 190.0, bottom + 50.0);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
             <text x=\"{}\" y=\"24\" font-size=\"15\">{}</text>\n",
            Self::LEFT,
            self.title
        );
        // Writing to a string cannot fail.
        for number in 0..=ticks as u32 {
            let each = step * f64::from(number);
            let _ = writeln!(
                svg,
                "<path d=\"M{} {y:.1}H{right}\" stroke=\"#d0d0d0\"/>\n\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                Self::LEFT,
                Self::LEFT - 8.0,
                y(each) + 4.0,
                grouped(each),
                y = y(each),
            );
        }
        let mut sizes: Vec<f64> =
            self.curves.first().map_or(Vec::new(), |c| c.points.iter().map(|p| p.0).collect());
        sizes.dedup();
        for size in sizes {
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {bottom}v5\" stroke=\"#707070\"/>\n\
                 <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 20.0,
                grouped(size),
                x = x(size),
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            Self::LEFT + Self::WIDTH / 2.0,
            bottom + 40.0,
            self.what
        );
        let mut label = f64::NEG_INFINITY;
        let mut curves: Vec<_> = self.curves.iter().zip(COLOURS).collect();
        // The names stand at the ends of the lines, from top to bottom.
        let end = |curve: &Curve| curve.points.last().map_or(0.0, |point| point.1);
        curves.sort_by(|a, b| end(b.0).total_cmp(&end(a.0)));
        for (curve, colour) in curves {
            let places: Vec<_> =
                curve.points.iter().map(|&(size, each)| (x(size), y(each))).collect();
            let path: Vec<_> = places.iter().map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
            let _ = writeln!(
                svg,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                path.join("L")
            );
            for (x, y) in &places {
                let _ = writeln!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{colour}\"/>"
                );
            }
            let Some((x, y)) = places.last() else { continue };
            label = y.max(label + 16.0);
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>",
                x + 10.0,
                label + 4.0,
                curve.name
            );
        }
        svg + "</svg>\n"
    }
}

/// The distance of some five lines below `greatest`: 1, 2 or 5 times a power of ten.
fn tick(greatest: f64) -> f64 {
    let power = 10_f64.powf((greatest / 5.0).log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .map(|times| times * power)
        .into_iter()
        .find(|t| *t >= greatest / 5.0)
        .unwrap_or(power)
}

/// A whole number in groups of three digits with spaces between them.
fn grouped(number: f64) -> String {
    crate::bench::thousands(number.round() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_has_lines_below_its_greatest_value_and_names_at_the_ends() {
        assert_eq!([tick(36_000.0), tick(5.0), tick(51.0)], [10_000.0, 1.0, 20.0]);
        let curve = |name, each| Curve { name, points: vec![(1e3, each), (1e5, 2.0 * each)] };
        let curves = vec![curve("one", 10.0), curve("two", 10.1)];
        let svg = Chart { title: "Work", what: "strokes", curves }.svg();
        // The second name does not stand on the first.
        let heights: Vec<f64> = ["two", "one"]
            .into_iter()
            .filter_map(|name| {
                let line = svg.lines().find(|line| line.ends_with(&format!(">{name}</text>")))?;
                line.split('"').nth(3)?.parse().ok()
            })
            .collect();
        assert!(heights[1] - heights[0] >= 15.9, "{heights:?}");
        assert!(svg.contains(">100 000</text>"), "{svg}");
    }
}
