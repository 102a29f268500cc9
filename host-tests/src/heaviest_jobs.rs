//! Runs the jobs that use the most stack of a board, and measures how much they leave, and how long
//! the main loop of the Pico does not look at what is asked in real time.

use crate::emulated_jobs::Line;
use crate::meshes::soup;
use crate::whole_jobs::job_lines;
use penup_client::emulator::{
    CallGaps, EmulatedBoard, Emulator, EmulatorError, Options, Pico, Stack, image_path,
};
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

/// The name of a job, and its lines.
type Job = (&'static str, Vec<String>);

/// The number of status reports that a job drawn part by part is asked for while a part is computed
/// and the machine moves.
const REPORTS_IN_PARTS: usize = 40;

/// A solid that is larger than the Pico's memory, with many seams. It lies in flash, and each part
/// is computed while the one before is drawn.
fn in_flash() -> Job {
    let settings = ["$see=faces", "$page=60x60", "$margin=2", "$110=600", "$111=600"];
    let mut lines = settings.map(str::to_owned).to_vec();
    lines.extend(soup(1400).obj());
    lines.push("$plot".to_owned());
    ("a solid in flash", lines)
}

/// The jobs. `lattice` is the largest lattice scene for the board. The effort is small, because
/// more of it takes longer but no more stack.
fn jobs(lattice: &str) -> Vec<Job> {
    let page = "$page=40x40";
    let of = |scene: &str, settings: &[&str]| {
        job_lines(scene, &[&[page, "$margin=2"], settings].concat())
    };
    let typed = |lines: &[&str]| lines.iter().map(|line| (*line).to_owned()).collect();
    vec![
        (
            "lists and settings",
            typed(&["$", "$$", "$I", "$options", "$130=300", "$204=50", "$effort=200"]),
        ),
        ("hidden lines", of(lattice, &["$see=faces"])),
        (
            "hidden lines dotted, with an eye among them",
            of("interpen.obj", &["$hidden=dotted", "$seams=on", "$behind=clip", "$eye=1,2,3"]),
        ),
        ("merged blocks, creases", of("notched.obj", &["$blocks=merged", "$crease=30"])),
        ("a convex solid from its vertices", of("eighteen.obj", &["$see=vertices"])),
        ("a convex solid from its edges", of("dodecahedron.obj", &["$see=edges"])),
        ("curves on a plan", of("isobars.obj", &["$see=faces", "$fit=on"])),
        ("curves in space", of("isobars.obj", &["$projection=isometric"])),
        ("an editing session", of("structure.txt", &["$list=v", "$model", "$undo"])),
        (
            "a title",
            of("octahedron.obj", &["$see=faces", "$title=\\xC9tude \\u{2013} 3", "$title-size=3"]),
        ),
        ("greedy pairs", of("text300.obj", &["$title=", "$fit=on", "$order=greedy"])),
        ("the last job again", typed(&["$again"])),
        ("arcs", typed(&["$204=0", "G0X20Y20", "M3", "G3I5J0", "G2X30Y30R9", "M5"])),
        ("homing", typed(&["$22=1", "$130=60", "$131=60", "$H", "$X", "$22=0"])),
        ("what is refused", typed(&["v 1 1e99 x", "f 1 2 99", "G7", "$130=0", "$eye=1", "$pen=x"])),
    ]
}

/// Runs all jobs on the LM3S6965, and reports the deepest use of the stack after each.
///
/// # Errors
/// The emulator fails.
pub fn on_the_lm3s6965(report: impl FnMut(&str, Stack)) -> Result<(), Box<dyn Error>> {
    let options = Options { paints_stack: true, ..Options::default() };
    let emulator = Emulator::start(&image_path("lm3s6965"), options)?;
    let line = Line::to(Box::new(emulator))?;
    let stack = |emulator: &mut Emulator| {
        let painted = emulator.stack()?;
        painted.ok_or(EmulatorError::Ended { said: "the stack was not painted".into() })
    };
    run_all(line, jobs("lattice5.obj"), |_| Ok(()), stack, report)
}

/// A part of the mangled name of the function of the Pico's image by which the main loop takes what
/// was asked in real time, at whichever port.
pub const LOOK: &str = "5Ports14take_real_time17h";

/// Runs all jobs on the Pico, whose USB host queries the status all the time. After each, reports
/// the deepest use of the stack so far, and the longest times between two looks in this job.
///
/// # Errors
/// The emulator fails.
pub fn on_the_pico(mut report: impl FnMut(&str, Stack, CallGaps)) -> Result<(), Box<dyn Error>> {
    let image = image_path("pico");
    let mut line = Line::to(Box::new(Pico::start(&image)?))?;
    line.emulator.time_between_calls(&image, LOOK)?;
    line.emulator.plug_usb_in()?;
    let ask_by_usb = |pico: &mut Pico| {
        pico.send_by_usb(b"?")?;
        while pico.receive_by_usb(&mut [0; 256], Duration::ZERO)? > 0 {}
        Ok(())
    };
    let jobs = jobs("lattice2.obj").into_iter().chain([in_flash()]);
    let measure = |pico: &mut Pico| Ok((pico.stack()?, pico.take_call_gaps()));
    run_all(line, jobs, ask_by_usb, measure, |job, (stack, gaps)| report(job, stack, gaps))
}

fn run_all<E: EmulatedBoard, M>(
    mut line: Line<E>,
    jobs: impl IntoIterator<Item = Job>,
    mut meanwhile: impl FnMut(&mut E) -> std::io::Result<()>,
    mut measure: impl FnMut(&mut E) -> Result<M, EmulatorError>,
    mut report: impl FnMut(&str, M),
) -> Result<(), Box<dyn Error>> {
    for (name, lines) in jobs {
        let mut is_in_parts = false;
        for text in [String::from("$clear")].into_iter().chain(lines) {
            line.emulator.send(format!("{text}\n").as_bytes())?;
            let asks = text == "$plot";
            loop {
                if asks {
                    line.emulator.send(b"?")?;
                    meanwhile(&mut line.emulator)?;
                    sleep(Duration::from_millis(20));
                }
                let heard = line.hear()?;
                is_in_parts |= heard.contains("drawn part by part");
                if heard == "ok" || heard.starts_with("error:") {
                    break;
                }
            }
        }
        // A hundred times as many end the wait for parts that do not come.
        let (mut reports, mut asked) = (0, 0);
        while is_in_parts && reports < REPORTS_IN_PARTS {
            asked += 1;
            meanwhile(&mut line.emulator)?;
            let status = line.status()?;
            reports += usize::from(status.contains("|Stage:visibility"));
            let has_ended = status.starts_with("<Idle") || status.contains("started again");
            if has_ended || asked > 100 * REPORTS_IN_PARTS {
                return Err(format!("{name}: {status} after {reports} reports").into());
            }
        }
        // Draws a part of it with one feed hold, and aborts the rest.
        for byte in [b'?', b'?', b'!', b'?', b'~', b'?', b'?', 0x18] {
            line.emulator.send(&[byte])?;
            meanwhile(&mut line.emulator)?;
            sleep(Duration::from_millis(20));
        }
        line.hear_greeting()?;
        while !line.status()?.contains("<Idle") {}
        line.emulator.pin_changes()?;
        report(name, measure(&mut line.emulator)?);
    }
    Ok(())
}
