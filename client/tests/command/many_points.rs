//! The memory of the program for a drawing that is larger than the board.
//!
//! It sends the drawing to a simulated board at a pseudo-terminal, which has the memory of the
//! Raspberry Pi Pico. `cargo xtask points` does so with 1,000,000 points. Linux only: its kernel
//! says how much memory a program has taken.

use super::*;
use penup::board_table::PICO;
use penup::machine::Settings;
use penup_client::link::Link as _;
use penup_client::preview::InMemory;
use penup_job::room::Room;
use serialport::{SerialPort as _, TTYPort};
use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::time::Duration;

/// The points of a row.
const ROW: usize = 1000;

/// The bytes that the program may take for each point, whether it belongs to a long polyline or to
/// a line of two, which has a stroke of its own to be ordered.
const BYTES_A_POINT: usize = 200;

/// By how many bytes the memory of the program differs from one start to the next.
const TOLERANCE: usize = 1_000_000;

/// How many points are sent, and how many points a polyline has, when the environment does not say
/// it.
const POINTS: usize = 20_000;
const STROKE: usize = ROW;

/// What holds the points in the file.
#[derive(Debug, Clone, Copy)]
enum Elements {
    /// Polylines of so many points, in SVG.
    Polylines(usize),
    /// `line` elements of SVG.
    Lines,
    /// `path` elements of SVG, each of one straight line.
    Paths,
    /// `l` elements of OBJ of two points.
    Obj,
    /// Strokes of HP-GL of two points.
    HpGl,
    /// Moves of G-code, of which every other one draws.
    GCode,
    /// `LINE` entities of DXF.
    Dxf,
}

impl Elements {
    /// The number of points of each.
    fn points(self) -> usize {
        match self {
            Self::Polylines(points) => points,
            _ => 2,
        }
    }

    /// The name of the file.
    fn file(self) -> &'static str {
        match self {
            Self::Polylines(_) | Self::Lines | Self::Paths => "points.svg",
            Self::Obj => "points.obj",
            Self::HpGl => "points.hpgl",
            Self::GCode => "points.gcode",
            Self::Dxf => "points.dxf",
        }
    }

    /// What stands before the elements and behind them.
    fn frame(self) -> [&'static str; 2] {
        match self {
            Self::Polylines(_) | Self::Lines | Self::Paths => [
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"400mm\" height=\"400mm\" \
                 viewBox=\"0 0 400 400\">\n",
                "</svg>\n",
            ],
            Self::Obj => ["", ""],
            Self::HpGl => ["IN;SP1;\n", "PU;SP0;\n"],
            Self::GCode => ["G21\nG90\nM5\n", "M5\nM2\n"],
            Self::Dxf => ["0\nSECTION\n2\nENTITIES\n", "0\nENDSEC\n0\nEOF\n"],
        }
    }

    /// Writes the element that draws these points.
    fn write(self, points: &[[f64; 2]], text: &mut String) {
        // Writing to a string cannot fail.
        let _ = match (self, points) {
            (Self::Lines, [[x1, y1], [x2, y2]]) => writeln!(
                text,
                "<line stroke=\"black\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" \
                 y2=\"{y2:.1}\"/>"
            ),
            (Self::Paths, [[x1, y1], [x2, y2]]) => writeln!(
                text,
                "<path fill=\"none\" stroke=\"black\" d=\"M{x1:.1},{y1:.1}L{x2:.1},{y2:.1}\"/>"
            ),
            (Self::Obj, [[x1, y1], [x2, y2]]) => {
                writeln!(text, "v {x1:.1} {y1:.1} 0\nv {x2:.1} {y2:.1} 0\nl -2 -1")
            }
            (Self::HpGl, [from, to]) => {
                // 40 units are a millimetre.
                let [[x1, y1], [x2, y2]] = [from, to].map(|point| point.map(|mm| 40.0 * mm));
                writeln!(text, "PU{x1:.0},{y1:.0};PD{x2:.0},{y2:.0};")
            }
            (Self::GCode, [[x1, y1], [x2, y2]]) => {
                writeln!(text, "G0 X{x1:.1} Y{y1:.1}\nM3\nG1 X{x2:.1} Y{y2:.1} F2000\nM5")
            }
            (Self::Dxf, [[x1, y1], [x2, y2]]) => {
                writeln!(text, "0\nLINE\n8\n0\n10\n{x1:.1}\n20\n{y1:.1}\n11\n{x2:.1}\n21\n{y2:.1}")
            }
            _ => {
                let points = points.iter().map(|[x, y]| format!("{x:.1},{y:.1} "));
                let points: String = points.collect();
                writeln!(text, "<polyline fill=\"none\" stroke=\"black\" points=\"{points}\"/>")
            }
        };
    }
}

/// A file of so many points in rows, in these elements.
fn file(points: usize, elements: Elements) -> String {
    let [before, after] = elements.frame();
    let mut text = before.to_owned();
    let place = |number: usize| {
        let (row, column) = (number / ROW, number % ROW);
        let x = 20.0 + 0.2 * column as f64;
        [x, 20.0 + 0.3 * row as f64 + 0.1 * (column % 2) as f64]
    };
    for first in (0..points).step_by(elements.points()) {
        let of_element = first..points.min(first + elements.points());
        let places: Vec<[f64; 2]> = of_element.map(place).collect();
        elements.write(&places, &mut text);
    }
    text + after
}

/// The greatest resident memory of a process so far, in bytes; `None` if it has ended.
fn peak(process: &str) -> Option<usize> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix(" kB")?.parse::<usize>().ok()?)
}

/// Lets the program draw so many points. Returns its greatest resident memory in bytes.
fn memory_for(points: usize, elements: Elements) -> usize {
    let folder = tempfile::tempdir().expect("a folder");
    let name = elements.file();
    let [path, said] = [name, "said.txt"].map(|name| folder.path().join(name));
    fs::write(&path, file(points, elements)).expect("written");
    let (mut wire, terminal) = TTYPort::pair().expect("a pseudo-terminal");
    wire.set_timeout(Duration::from_millis(1)).expect("set");
    let device = terminal.name().expect("a name");
    // Only one may hold it: the program.
    drop(terminal);
    let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["plot", name, "--compute", "host", "--page", "400x400", "--effort", "0"])
        .args(["--port", &device])
        .current_dir(folder.path())
        .stderr(fs::File::create(&said).expect("a file"))
        .spawn()
        .expect("the program runs");
    let process = program.id().to_string();
    let mut board = InMemory::<u16>::new(Room::of_board(&PICO), Settings::default());
    let (mut buffer, mut most) = ([0; 4096], 0);
    let status = loop {
        // An error says that the program does not hold its end, or has sent nothing.
        if let Ok(count) = wire.read(&mut buffer) {
            board.send(&buffer[..count]).expect("memory");
        }
        // The board draws as fast as it computes.
        let count = board.receive(&mut buffer, Duration::from_millis(200)).expect("memory");
        // The program may have left: then nobody listens.
        let _ = wire.write_all(&buffer[..count]);
        most = most.max(peak(&process).unwrap_or(0));
        if let Some(status) = program.try_wait().expect("a state") {
            break status;
        }
    };
    let said = fs::read_to_string(said).expect("what it said");
    assert!(status.success(), "{status}: {said}");
    let strokes = match points.div_ceil(elements.points()) {
        1 => "1 stroke".to_owned(),
        several => format!("{several} strokes"),
    };
    assert!(said.contains(&format!("it sends {strokes} with {points} points, ")), "{said}");
    assert!(most > 0);
    most
}

/// A number that the environment says, or else the usual one.
fn number(name: &str, usual: usize) -> usize {
    std::env::var(name).map_or(usual, |text| text.parse().expect("a number of points"))
}

/// Checks that the program takes no more than so many bytes for each point.
fn check(elements: Elements) {
    let points = number("PENUP_POINTS", POINTS);
    // So much is taken by the program itself.
    let least = memory_for(10, elements);
    let most = memory_for(points, elements);
    let each = most.saturating_sub(least) as f64 / points as f64;
    println!(
        "{points} points as {elements:?}: {most} bytes at most, {each:.0} for each beside {least} \
         for 10"
    );
    assert!(most <= least + BYTES_A_POINT * points + TOLERANCE, "{each:.0} bytes a point");
}

#[test]
fn a_drawing_larger_than_the_board_takes_little_memory_for_each_point() {
    check(Elements::Polylines(number("PENUP_STROKE", STROKE)));
}

#[test]
fn short_lines_take_little_memory_for_each_point_too() {
    check(Elements::Lines);
    check(Elements::Paths);
}

#[test]
fn other_formats_take_little_memory_for_each_point_too() {
    for elements in [Elements::Obj, Elements::HpGl, Elements::GCode, Elements::Dxf] {
        check(elements);
    }
}
