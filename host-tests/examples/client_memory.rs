//! How much memory `penup plot` takes for a drawing that is larger than the board, and whether the
//! board takes all of it: `client_memory PENUP POINTS...`, where PENUP is the program.
//!
//! For each number of points it writes an SVG file of polylines of 1,000 points, and lets the
//! program send it to a simulated board at a pseudo-terminal. This board has the memory of the
//! Raspberry Pi Pico and draws as fast as it computes. The greatest resident memory of the program
//! is printed beside that for 10 points, and that of this process, which grows by nothing but the
//! board. Linux only, because it asks the kernel.

use penup::board_table::PICO;
use penup::machine::Settings;
use penup_client::link::Link as _;
use penup_client::preview::InMemory;
use penup_job::room::Room;
use serialport::{SerialPort as _, TTYPort};
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The points of a polyline.
const STROKE: usize = 1000;

/// An SVG file of so many points in rows, 0.2 mm apart, on a page of 400 by 400 mm.
fn svg(points: usize) -> String {
    let mut text = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"400mm\" height=\"400mm\" \
         viewBox=\"0 0 400 400\">\n",
    );
    for first in (0..points).step_by(STROKE) {
        text += "<polyline fill=\"none\" stroke=\"black\" points=\"";
        for number in first..points.min(first + STROKE) {
            let (row, column) = (number / STROKE, number % STROKE);
            let x = 20.0 + 0.2 * column as f64;
            let y = 20.0 + 0.3 * row as f64 + 0.1 * (column % 2) as f64;
            // Writing to a string cannot fail.
            let _ = write!(text, "{x:.1},{y:.1} ");
        }
        text += "\"/>\n";
    }
    text + "</svg>\n"
}

/// The greatest resident memory of a process so far, in bytes; `None` if it has ended.
fn peak(process: &str) -> Option<usize> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().strip_suffix(" kB")?.parse::<usize>().ok()?)
}

/// Lets the program draw a file. Returns its greatest resident memory, and what it said.
fn plot(penup: &str, file: &Path) -> Result<(usize, String), Box<dyn Error>> {
    let (mut wire, terminal) = TTYPort::pair()?;
    wire.set_timeout(Duration::from_millis(1))?;
    let device = terminal.name().ok_or("the terminal has no name")?;
    // Only one may hold it: the program.
    drop(terminal);
    let said = file.with_extension("txt");
    let mut program = Command::new(penup)
        .args(["plot", "--compute", "host", "--page", "400x400", "--port", &device])
        .arg(file)
        // The order of these rows is the shortest already.
        .args(["--effort", "0"])
        .stdin(Stdio::null())
        .stdout(fs::File::create(&said)?)
        .stderr(fs::File::options().append(true).open(&said)?)
        .spawn()?;
    let process = program.id().to_string();
    let mut board = InMemory::<u16>::new(Room::of_board(&PICO), Settings::default());
    let (mut buffer, mut most) = ([0; 4096], 0);
    let status = loop {
        // An error says that the program does not hold its end, or has sent nothing.
        if let Ok(count) = wire.read(&mut buffer) {
            board.send(buffer.get(..count).unwrap_or_default())?;
        }
        let count = board.receive(&mut buffer, Duration::from_millis(1))?;
        // The program may have left: then nobody listens.
        let _ = wire.write_all(buffer.get(..count).unwrap_or_default());
        most = most.max(peak(&process).unwrap_or(0));
        if let Some(status) = program.try_wait()? {
            break status;
        }
    };
    let said = fs::read_to_string(said)?;
    if status.success() { Ok((most, said)) } else { Err(format!("{status}: {said}").into()) }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let penup = arguments.next().ok_or("PENUP POINTS...")?;
    let folder = penup_client::workspace::root().join("target/client-memory");
    fs::create_dir_all(&folder)?;
    let mut least = None;
    for points in std::iter::once(Ok(10)).chain(arguments.map(|word| word.parse::<usize>())) {
        let points = points?;
        let file = folder.join(format!("{points}.svg"));
        fs::write(&file, svg(points))?;
        let began = Instant::now();
        let (most, said) = plot(&penup, &file)?;
        let seconds = began.elapsed().as_secs_f64();
        let least = *least.get_or_insert(most);
        println!(
            "{points} points: {} bytes at most, {:.0} more for each point; {seconds:.1} s; this \
             process {} bytes at most\n{said}",
            most,
            most.saturating_sub(least) as f64 / points as f64,
            peak("self").unwrap_or(0),
        );
    }
    Ok(())
}
