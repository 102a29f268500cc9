//! Sessions as users and the client have them, as seeds of the corpus.

use super::{CTRL_X, ORDER};
use crate::streamed_drawing::StreamedDrawing;
use crate::whole_jobs::job_lines;
use penup::machine::{SETTINGS, SettingInfo, Value};
use penup_job::protocol::{END, LAST_NUMBER, numbered};
use penup_readers::lines::Lines as _;

/// Settings for a small drawing, with a pen that takes little time.
const SMALL: [&str; 4] = ["$212=5", "$213=5", "$page=20x20", "$margin=4"];
/// The order to the bench to use a board with flash.
const WITH_FLASH: [u8; 2] = [ORDER, 0xF1];
/// The order to use one with flash whose pen begins early.
const EARLY_INK: [u8; 2] = [ORDER, 0xF2];
/// The order to use one with little memory, and with flash for models.
const LITTLE_MEMORY: [u8; 2] = [ORDER, 0xF3];
/// The order to let the power fail.
const OUTAGE: [u8; 2] = [ORDER, 0xE8];
/// The order to let the power fail within a sector that is written.
const OUTAGE_IN_SECTOR: [u8; 2] = [ORDER, 0xEB];

/// What is sent after a loss of power to go on with the job.
const GO_ON: &str = "$resume=origin\n";

/// The sessions, each with its name and something that the plotter says in it. It accepts all lines
/// but some settings that conflict with the others.
pub fn sessions() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let cube = job_lines("cube.obj", &SMALL);
    let point = job_lines("cube.obj", &[&SMALL[..], &["$219=0.01"]].concat());
    let lattice = job_lines("lattice2.obj", &SMALL);
    vec![
        ("flash-resume", cut(WITH_FLASH, &cube, 1000), "|Stopped:"),
        ("flash-resume-in-stroke", cut(EARLY_INK, &point, 1500), "|Stopped:"),
        ("flash-resume-in-parts", cut(LITTLE_MEMORY, &lattice, 2500), "|Stopped:"),
        ("flash-again", again(&cube), "ok\n<Run|"),
        ("flash-settings-cut", settings_cut(), "$3=5\n"),
        ("streamed", streamed(&cube), "|Stream:"),
        ("streamed-cut", streamed_cut(&cube), "[STOPPED:"),
        ("settings-least", settings(|info| info.least), "$3=0\n"),
        ("settings-greatest", settings(|info| info.greatest), "$3=7\n"),
    ]
}

/// So many milliseconds pass.
fn wait(mut milliseconds: u32) -> Vec<u8> {
    let mut orders = Vec::new();
    while let part @ 1.. = milliseconds.min(0xDF) {
        orders.extend([ORDER, part as u8]);
        milliseconds -= part;
    }
    orders
}

/// The lines as bytes.
fn text(lines: &[String]) -> Vec<u8> {
    lines.iter().flat_map(|line| format!("{line}\n").into_bytes()).collect()
}

/// A job whose power fails, and which goes on.
fn cut(board: [u8; 2], lines: &[String], milliseconds: u32) -> Vec<u8> {
    let go_on = format!("?{GO_ON}");
    let parts: [&[u8]; 6] =
        [&board, &text(lines), &wait(milliseconds), &OUTAGE, go_on.as_bytes(), &wait(500)];
    parts.concat()
}

/// A job that is drawn again after a loss of power.
fn again(lines: &[String]) -> Vec<u8> {
    [&WITH_FLASH[..], &text(lines), &wait(8000), &OUTAGE, b"$again\n?", &wait(500)].concat()
}

/// Settings whose power fails while they are written.
fn settings_cut() -> Vec<u8> {
    let change = b"$100=100\n$101=100\n$3=5\n$100=81\n";
    [&WITH_FLASH[..], change, &OUTAGE_IN_SECTOR, &change.repeat(30), b"$$\n", &wait(100)].concat()
}

/// A drawing that is sent while it is drawn, with the numbers and checksums of the client.
fn streamed(lines: &[String]) -> Vec<u8> {
    let mut drawing = StreamedDrawing::of(lines);
    let job = drawing.from(0);
    let job = job.in_order().map(|line| line.sent);
    let all = drawing.settings.iter().cloned().chain(job).chain(["$stream".to_owned()]);
    let mut bytes = format!("\n{}\n", numbered(Some(0), LAST_NUMBER)).into_bytes();
    let mut last = 0;
    for (number, line) in (1..).zip(all) {
        bytes.extend(format!("{}\n", numbered(Some(number), &line)).into_bytes());
        bytes.extend(wait(5));
        last = number;
    }
    bytes.push(b'?');
    bytes.extend(wait(4000));
    bytes.extend(format!("{}\n", numbered(Some(last + 1), END)).into_bytes());
    bytes
}

/// A drawing whose power fails while it is sent, and whose rest is sent then.
fn streamed_cut(lines: &[String]) -> Vec<u8> {
    let mut drawing = StreamedDrawing::of(lines);
    let sent = |job: penup_job::streamed::StreamedJob| {
        text(&job.in_order().map(|line| line.sent).collect::<Vec<_>>())
    };
    let (all, rest) = (sent(drawing.from(0)), sent(drawing.from(1)));
    let settings = text(&drawing.settings);
    [
        &WITH_FLASH[..],
        &settings,
        &all,
        &wait(1500),
        &OUTAGE,
        b"$stream\nG92X0Y0\n",
        &rest,
        &wait(500),
    ]
    .concat()
}

/// Sets each setting to an end of its range, lists all, moves a little, gives that up, and sets the
/// setting to its default again. It is shorter than the longest input of the fuzzer.
fn settings(end: impl Fn(&SettingInfo) -> Value) -> Vec<u8> {
    let change = |info: &SettingInfo| {
        let (end, default) = (end(info), info.default);
        let number = info.number();
        let changed = format!("\n${number}={end}\n$$\n").into_bytes();
        let back = format!("$X\n${number}={default}\n").into_bytes();
        [changed, wait(60), b"G91G1X.1F600\n".to_vec(), wait(30), vec![CTRL_X], wait(220), back]
            .concat()
    };
    SETTINGS.iter().flat_map(change).collect()
}
