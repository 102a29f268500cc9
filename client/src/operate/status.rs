//! `penup ports` and `penup status`.

use super::open;
use crate::cli::{PlotterArgs, PortsArgs};
use crate::error::Error;
use crate::outcome::Outcome;
use crate::ports as serial_ports;
use crate::progress::duration;
use crate::sender::{Sender, Timeouts};
use penup_job::protocol::{Status, strokes_drawn};
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;

/// Lists the serial ports and what answers there.
///
/// # Errors
/// The system cannot list its ports.
pub fn ports(_: &PortsArgs) -> Result<Outcome, Error> {
    let ports = serial_ports::list()?;
    let lines: Vec<String> = ports.iter().map(ToString::to_string).collect();
    let text = match lines.is_empty() {
        true => "there is no serial port".to_owned(),
        false => lines.join("\n"),
    };
    Ok(Outcome::answer(text, json!({ "ports": ports })))
}

/// Asks the plotter what it does.
///
/// # Errors
/// Nothing answers, or something other than penup does.
pub fn status(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let mut link = open(&args.port)?;
    let (mut sender, _) = Sender::join(&mut link, Timeouts::default(), interrupt)?;
    let status = sender.status()?;
    Ok(Outcome::answer(described(&status), as_json(&status)))
}

/// A status as an object of JSON.
pub(super) fn as_json(status: &Status) -> Value {
    let of = |pair: Option<(u64, u64)>| pair.map(|(done, all)| json!({ "done": done, "all": all }));
    let position: Vec<f64> = coordinates(status);
    json!({
        "state": status.state,
        "standing": status.is_standing,
        "position_mm": position,
        "strokes": of(status.strokes),
        "stopped": of(status.stopped),
        "ink_mm": of(status.ink),
        "seconds_left": status.seconds_left,
        "computing": status.stage,
        "speed_percent": status.percent,
        "contacts": status.contacts,
        "pen_wanted": status.pen_wanted,
        "alarm": status.alarm,
    })
}

fn coordinates(status: &Status) -> Vec<f64> {
    status.position.split(',').filter_map(|number| number.parse().ok()).collect()
}

/// A status in words, one line for each thing.
pub(super) fn described(status: &Status) -> String {
    let mut lines = vec![in_words(status)];
    if let [x, y, ..] = coordinates(status)[..] {
        lines.push(format!("the pen is at {x}, {y} mm"));
    }
    if let Some((done, all)) = status.stopped {
        lines.push(format!(
            "a job has stopped after {}: `penup resume` goes on with it, or says which \
             command does",
            strokes_drawn(done, all)
        ));
    }
    if let Some((done, all)) = status.strokes.filter(|(_, all)| *all > 0) {
        lines.push(format!("{done} of {all} strokes are drawn"));
    }
    if let Some((done, all)) = status.ink.filter(|(_, all)| *all > 0) {
        lines.push(format!("{done} of {all} mm are drawn"));
    }
    if let Some(seconds) = status.seconds_left.filter(|seconds| *seconds > 0) {
        lines.push(format!("{} are left", duration(seconds)));
    }
    if let Some(percent) = status.percent.filter(|percent| *percent != 100) {
        lines.push(format!("the speeds are at {percent} %"));
    }
    if !status.contacts.is_empty() {
        lines.push(format!("these contacts are pressed: {}", status.contacts));
    }
    lines.join("\n")
}

/// What the machine does, in words.
fn in_words(status: &Status) -> String {
    let Status { state, stage, pen_wanted, alarm, .. } = status;
    match (state.as_str(), stage, pen_wanted) {
        (_, Some(stage), _) => format!("it computes a picture: {stage}"),
        ("Hold", _, Some(pen)) => format!("it waits for pen {pen}; then `penup resume`"),
        ("Hold", ..) if status.is_standing => "it holds with the pen up: `penup resume`, or \
                                                `penup abort`"
            .to_owned(),
        ("Hold", ..) => "it slows down to hold".to_owned(),
        ("Idle", ..) => "it is idle".to_owned(),
        ("Run", ..) => "it draws".to_owned(),
        ("Jog", ..) => "it moves by hand".to_owned(),
        ("Home", ..) => "it looks for its limit switches".to_owned(),
        ("Check", ..) => "it only checks what it is sent".to_owned(),
        ("Sleep", ..) => "its motors are off; `penup unlock` wakes it".to_owned(),
        ("Alarm", ..) => {
            let number = alarm.map(|number| format!(" {number}")).unwrap_or_default();
            format!("it is locked after alarm{number}: free it, then `penup unlock`")
        }
        (state, ..) => state.to_owned(),
    }
}
