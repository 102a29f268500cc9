//! Runs a machine on simulated pins by a transcript, and writes what it answers and what the pins
//! do.
//!
//! A transcript has three kinds of lines:
//!
//! ```text
//! > job ink 200,0 to 0,0      what the machine is told
//! < ok                        what it answers
//! = down 200 steps to 200,0   what the pins did, and where the machine came to rest
//! ```
//!
//! [`transcript`] takes the commands from the lines that begin with `>` and returns the whole
//! transcript, so that a test compares one text with another.
//!
//! The commands are:
//!
//! - `job TARGETS` starts a job. A target is `to X,Y` with the pen up or `ink X,Y` with it down, in
//!   steps; `pen N` chooses the pen, counted from 1, of the targets behind it.
//! - `jog X,Y`, `hold`, `resume`, `abort`, `pause`, `sleep`, `check` and `unlock` call the function
//!   of the machine of that name.
//! - `restarted` and `stop` are the alarm after a restart and that of the emergency stop.
//! - `$N=VALUE` sets a machine setting.
//! - `wait` runs until the machine is at rest, and `wait SECONDS` for this time.

use crate::event_checker;
use crate::pin_machine::{self, Turn};
use penup::boards::host::{Change, Stamped};
use penup::drawing::{LineType, PagePoint};
use penup::machine::{Alarm, Machine, Path, Setting, Settings, State, Target, Value};
use penup::motion::TICKS_PER_SECOND;
use std::fmt::{Debug, Write as _};

/// The time between two iterations of the main loop, in ticks: a millisecond.
const TURN_TICKS: u64 = 25_000;

/// A path that owns its targets, with the index of the pen of each.
#[derive(Debug, Clone, Default)]
struct Job {
    targets: Vec<(Target, u8)>,
    next: usize,
}

impl Job {
    fn parse(words: &str) -> Self {
        let (mut job, mut pen) = (Self::default(), 0);
        let mut words = words.split(' ');
        while let (Some(kind), Some(value)) = (words.next(), words.next()) {
            match kind {
                "pen" => pen = value.parse::<u8>().expect("the number of a pen") - 1,
                _ => {
                    let ink = (kind == "ink").then_some(LineType::Full);
                    job.targets.push((Target { point: point(value), ink }, pen));
                }
            }
        }
        job
    }
}

impl Path for Job {
    fn next_target(&mut self) -> Option<Target> {
        let (target, _) = *self.targets.get(self.next)?;
        self.next += 1;
        Some(target)
    }

    fn rewind(&mut self) {
        self.next = 0;
    }

    fn pen(&self) -> u8 {
        let before = self.targets.get(self.next.saturating_sub(1));
        before.map_or(0, |(_, pen)| *pen)
    }
}

fn point(text: &str) -> PagePoint {
    let (x, y) = text.split_once(',').expect("x,y");
    let number = |text: &str| text.parse().expect("a whole number");
    PagePoint { x: number(x), y: number(y) }
}

/// Runs the commands of `script` on a machine with `settings` and returns the transcript. Lines
/// that do not begin with `>` are ignored.
///
/// # Panics
/// Panics at a command that does not exist, if the machine does not come to rest within a minute,
/// if it loses its position, and at pins that [`event_checker::check_pins`] refuses.
pub fn transcript(settings: Settings, script: &str) -> String {
    let mut commands = script.lines().filter_map(|line| line.trim().strip_prefix("> "));
    let mut entries: Vec<(u64, String)> = Vec::new();
    let mut job = Job::default();
    // The time at which the wait began, and the time that it lasts; `None` until rest.
    let mut wait: Option<(u64, Option<u64>)> = None;
    let trace = pin_machine::run_with(settings, TURN_TICKS, &mut |turn, queue| {
        let Turn { machine, now, pins, .. } = turn;
        assert_eq!(machine.position(), settings.kinematics().page(pins));
        loop {
            if let Some((began, time)) = wait {
                assert!(now < began + 60 * TICKS_PER_SECOND_64, "the machine does not rest");
                let is_over = match time {
                    Some(time) => now >= began + time,
                    // What the command before began takes an iteration.
                    None => now > began && is_at_rest(machine),
                };
                if !is_over {
                    machine.fill(&mut job, queue);
                    return true;
                }
                entries.push((now, rest(machine)));
                wait = None;
            }
            let Some(command) = commands.next() else { return false };
            entries.push((now, format!("> {command}")));
            if let Some(seconds) = command.strip_prefix("wait") {
                let ticks = |seconds: f64| (seconds * f64::from(TICKS_PER_SECOND)) as u64;
                wait = Some((now, seconds.trim().parse().ok().map(ticks)));
            } else {
                entries.push((now, format!("< {}", answer(machine, &mut job, command))));
            }
        }
    });
    event_checker::check_pins(&trace, &settings);
    woven(&entries, &trace)
}

const TICKS_PER_SECOND_64: u64 = TICKS_PER_SECOND as u64;

fn is_at_rest(machine: &Machine<'_>) -> bool {
    let moves = matches!(
        machine.state(),
        State::Run | State::Jog | State::Home | State::Abort | State::Hold { stopped: false }
    );
    !moves && machine.is_stopped()
}

fn rest(machine: &Machine<'_>) -> String {
    let PagePoint { x, y } = machine.position();
    let state = match (machine.state(), machine.pen_wanted()) {
        (State::Hold { .. }, Some(pen)) => format!("Hold for pen {}", pen + 1),
        (State::Hold { .. }, None) => "Hold".to_owned(),
        (state, _) => format!("{state:?}"),
    };
    let planned = machine.planned_position();
    assert!(!is_at_rest(machine) || planned == machine.position(), "planned {planned:?}");
    format!("= {state} at {x},{y}")
}

/// Gives the machine a command and returns its answer.
fn answer(machine: &mut Machine<'_>, job: &mut Job, command: &str) -> String {
    let (name, value) = command.split_once(' ').unwrap_or((command, ""));
    if let Some((number, value)) = name.strip_prefix('$').and_then(|rest| rest.split_once('=')) {
        let setting = number.parse().ok().and_then(Setting::numbered).expect("a setting");
        return said(
            machine.set(setting, Value::from_num(value.parse::<f64>().expect("a number"))),
        );
    }
    match name {
        "job" => {
            *job = Job::parse(value);
            match machine.start(&mut job.clone()) {
                Ok(size) => format!("ok, strokes: {}", size.strokes),
                Err(error) => said(Err::<(), _>(error)),
            }
        }
        "jog" => said(machine.jog(point(value), None)),
        "sleep" => said(machine.sleep()),
        "check" => said(machine.check(true)),
        "unlock" => said(machine.unlock()),
        "hold" => {
            machine.hold();
            ok()
        }
        "resume" => {
            machine.resume();
            ok()
        }
        "abort" => {
            machine.abort();
            ok()
        }
        "pause" => {
            machine.pause_after_stroke();
            ok()
        }
        "restarted" => {
            machine.alarm(Alarm::Restarted);
            ok()
        }
        "stop" => {
            machine.alarm(Alarm::EmergencyStop);
            ok()
        }
        _ => panic!("there is no command {command}"),
    }
}

fn ok() -> String {
    "ok".to_owned()
}

fn said<E: Debug>(result: Result<(), E>) -> String {
    match result {
        Ok(()) => ok(),
        Err(error) => format!("{error:?}"),
    }
}

/// Puts what the pins did between the entries, by time.
fn woven(entries: &[(u64, String)], trace: &[Stamped]) -> String {
    let mut text = String::new();
    let mut pins = Pins::default();
    let mut changes = trace.iter().peekable();
    for (time, entry) in entries {
        while let Some(stamped) = changes.next_if(|stamped| stamped.time < *time) {
            pins.change(stamped, &mut text);
        }
        pins.finish_move(&mut text);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{entry}");
    }
    text
}

/// Follows the pins.
#[derive(Default)]
struct Pins {
    at: [i32; 2],
    /// Whether the direction pins of x, y and the pen's motor are high.
    directions: [bool; 3],
    is_down: bool,
    /// The number of steps since the last line, and the time of the last of them: simultaneous
    /// steps of both axes count once.
    steps: u32,
    last_step: Option<u64>,
    /// The number of steps of the pen's motor since the last line, and whether they lower the pen.
    lifted: (u32, bool),
}

impl Pins {
    fn change(&mut self, stamped: &Stamped, text: &mut String) {
        match stamped.change {
            Change::UpX(up) => self.directions[0] = up,
            Change::UpY(up) => self.directions[1] = up,
            Change::DownZ(down) => self.directions[2] = down,
            Change::StepX(true) => self.step(0, stamped.time, text),
            Change::StepY(true) => self.step(1, stamped.time, text),
            Change::StepZ(true) => {
                let down = self.directions[2];
                if self.lifted.1 != down || self.steps > 0 {
                    self.finish_move(text);
                }
                self.lifted = (self.lifted.0 + 1, down);
            }
            Change::StepX(false) | Change::StepY(false) | Change::StepZ(false) => {}
            Change::Enable(on) => {
                self.finish_move(text);
                let _ = writeln!(text, "= drivers {}", if on { "on" } else { "off" });
            }
            Change::Pen(height) => {
                // Half of the height of 127.
                let is_down = height >= 64;
                if is_down != self.is_down {
                    self.finish_move(text);
                    self.is_down = is_down;
                }
                if !matches!(height, 0 | 127) {
                    self.finish_move(text);
                    let _ = writeln!(text, "= the pen at height {height}");
                }
            }
        }
    }

    fn step(&mut self, axis: usize, time: u64, text: &mut String) {
        if self.lifted.0 > 0 {
            self.finish_move(text);
        }
        self.at[axis] += if self.directions[axis] { 1 } else { -1 };
        if self.last_step.replace(time) != Some(time) {
            self.steps += 1;
        }
    }

    fn finish_move(&mut self, text: &mut String) {
        let ([x, y], pen) = (self.at, if self.is_down { "down" } else { "up" });
        if self.steps > 0 {
            let _ = writeln!(text, "= {pen} {} steps to {x},{y}", self.steps);
        }
        if let (steps @ 1.., down) = self.lifted {
            let direction = if down { "down" } else { "up" };
            let _ = writeln!(text, "= the pen's motor {direction} {steps} steps");
        }
        (self.steps, self.last_step, self.lifted.0) = (0, None, 0);
    }
}
