//! `penup setup`: leads through the settings of a new machine.
//!
//! Each part asks, moves the machine, and stores what it has learnt before the next one begins. So
//! whoever breaks off finds the machine with the settings of the parts that are done, and is told
//! which these are. Answers are lines of the standard input; its end breaks off.

use super::open;
use super::settings::{as_json, change, is_same, read};
use crate::cli::PlotterArgs;
use crate::error::Error;
use crate::interrupt::MovingPlotter;
use crate::link::SerialLink;
use crate::machine_settings::AssignedSetting;
use crate::outcome::Outcome;
use crate::progress::Quiet;
use crate::sender::{Patience, Sender};
use penup::machine::Setting;
use penup_job::protocol::{CLEAR, HOME, PEN_DOWN, Status};
use std::io::{self, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// The length of the moves that show a direction, in mm.
const SHORT: f64 = 10.0;

/// The length of the moves that are measured, in mm.
const LONG: f64 = 100.0;

/// The speed of all moves, in mm/min.
const SPEED: f64 = 1000.0;

/// The side of the test square, and its distance from the edges of the sheet, in mm.
const SQUARE: [f64; 2] = [40.0, 10.0];

/// How long a plotter is waited for after its power came back.
const START: Duration = Duration::from_secs(60);

/// The end of a part of the setup.
enum End {
    /// The user has broken off.
    BrokenOff,
    Failed(Error),
}

impl From<Error> for End {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// Where the pen went, as the user saw it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Right,
    Left,
    Up,
    Down,
}

impl Way {
    /// The words for it, of which one letter is enough.
    const WORDS: [(&'static str, Self); 4] =
        [("right", Self::Right), ("left", Self::Left), ("up", Self::Up), ("down", Self::Down)];

    fn vector(self) -> [i8; 2] {
        match self {
            Self::Right => [1, 0],
            Self::Left => [-1, 0],
            Self::Up => [0, 1],
            Self::Down => [0, -1],
        }
    }
}

/// The bits of the setting that inverts directions which must change, if the pen went these ways
/// when it should have gone right, and up. `None` if the motors are exchanged.
///
/// On a CoreXY (`core`) the motors a and b turn by x + y and x - y.
fn inverted([x, y]: [Way; 2], core: bool) -> Option<u8> {
    let seen = [x.vector(), y.vector()];
    (0..4).find(|bits| {
        let sign = |bit: u8| if bits & bit == 0 { 1 } else { -1 };
        let moved = |[dx, dy]: [i8; 2]| match core {
            false => [sign(1) * dx, sign(2) * dy],
            true => {
                let (a, b) = (sign(1) * (dx + dy), sign(2) * (dx - dy));
                [(a + b) / 2, (a - b) / 2]
            }
        };
        [moved([1, 0]), moved([0, 1])] == seen
    })
}

/// The lines that the user types.
struct Answers<'a> {
    typed: Receiver<String>,
    interrupt: &'a AtomicBool,
}

impl<'a> Answers<'a> {
    fn new(interrupt: &'a AtomicBool) -> Self {
        let (sender, typed) = mpsc::channel();
        // The thread reads until the input or the process ends.
        std::thread::spawn(move || {
            io::stdin().lines().map_while(Result::ok).all(|line| sender.send(line).is_ok())
        });
        Self { typed, interrupt }
    }

    /// Asks a question and returns what the user types, in lower case.
    fn ask(&self, question: &str) -> Result<String, End> {
        say(question);
        loop {
            match self.typed.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => return Ok(line.trim().to_lowercase()),
                Err(RecvTimeoutError::Disconnected) => return Err(End::BrokenOff),
                Err(RecvTimeoutError::Timeout) if self.interrupt.load(Ordering::Relaxed) => {
                    return Err(End::BrokenOff);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Asks until the answer is one of these words, or begins one of them.
    fn choose<T: Copy>(&self, question: &str, words: &[(&str, T)]) -> Result<T, End> {
        loop {
            let answer = self.ask(question)?;
            let is_it = |(word, _): &&(&str, T)| !answer.is_empty() && word.starts_with(&answer);
            if let Some((_, choice)) = words.iter().find(is_it) {
                return Ok(*choice);
            }
            let words: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            say(&format!("Please type {}.", words.join(", ")));
        }
    }

    /// Asks until the answer is a number within these bounds; `None` if it is empty.
    fn number(&self, question: &str, [least, most]: [f64; 2]) -> Result<Option<f64>, End> {
        loop {
            let answer = self.ask(question)?;
            match answer.replace(',', ".").parse::<f64>() {
                _ if answer.is_empty() => return Ok(None),
                Ok(number) if (least..=most).contains(&number) => return Ok(Some(number)),
                _ => say(&format!("Please type a number from {least} to {most}.")),
            }
        }
    }

    fn is_yes(&self, question: &str) -> Result<bool, End> {
        self.choose(&format!("{question} (yes, no)"), &[("yes", true), ("no", false)])
    }
}

/// Says something to the user, who is to answer; so `--quiet` does not silence it.
fn say(text: &str) {
    // A closed standard error is no reason to fail.
    let _ = writeln!(io::stderr(), "{text}");
}

/// The setup of one machine.
struct Setup<'a> {
    answers: Answers<'a>,
    /// The settings before the first change.
    before: Vec<AssignedSetting>,
    /// What differs from that now, in the order of the changes.
    changed: Vec<AssignedSetting>,
}

/// Leads through the settings.
///
/// # Errors
/// The machine is a polargraph, stops with an alarm, or as [`Sender::ask`]. What was changed until
/// then was told on the standard error.
pub fn setup(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    let mut setup =
        Setup { answers: Answers::new(interrupt), before: Vec::new(), changed: Vec::new() };
    let ended = setup.parts(args, interrupt);
    let changed = setup.changes();
    let json = as_json(&setup.changed);
    match ended {
        Ok(()) => Ok(Outcome::done(format!("the machine is set up; {changed}"), json)),
        Err(End::BrokenOff) => {
            Ok(Outcome::done(format!("the setup is broken off; {changed}"), json))
        }
        Err(End::Failed(error)) => {
            say(&format!("penup: the setup ends here; {changed}"));
            Err(error)
        }
    }
}

impl Setup<'_> {
    /// Says which settings were changed.
    fn changes(&self) -> String {
        if self.changed.is_empty() {
            return "all settings are as before".to_owned();
        }
        let changes: Vec<String> = self
            .changed
            .iter()
            .map(|it| {
                let name = it.name().map(|name| format!(" ({name})")).unwrap_or_default();
                format!("{}={}{name}", it.number, it.value)
            })
            .collect();
        format!("these settings are stored, and all others are as before: {}", changes.join(", "))
    }

    fn parts(&mut self, args: &PlotterArgs, interrupt: &AtomicBool) -> Result<(), End> {
        let mut link = open(&args.port)?;
        let has_switches = self.on(&mut link, interrupt, |setup, sender| {
            let value = |settings: &[AssignedSetting], setting: Setting| {
                let number = setting.info().number;
                let own = settings.iter().find(|it| it.number == number);
                own.and_then(|it| it.value.parse::<f64>().ok()).unwrap_or_default()
            };
            let settings = read(sender)?;
            setup.before.clone_from(&settings);
            let core = match value(&settings, Setting::Kinematics) {
                0.0 => false,
                1.0 => true,
                _ => return Err(Error::SetupOfPolargraph.into()),
            };
            say("Keep a hand at the switch of the motor supply.\n\
                 1 of 5: directions. Bring the pen by hand to the middle of the machine, with the \
                 motors off.");
            setup.answers.ask("Press Enter when it is there.")?;
            // From where it stands now, the pen may go both ways.
            let limits = value(&settings, Setting::SoftLimits);
            setup.set(sender, Setting::SoftLimits, 0.0)?;
            let done = setup.moving_parts(sender, core, &settings, &value);
            if !matches!(done, Err(End::Failed(Error::Link(_)))) {
                setup.set(sender, Setting::SoftLimits, limits)?;
            }
            done?;
            Ok(value(&settings, Setting::Homing) != 0.0)
        })?;
        self.find_origin(args, link, has_switches, interrupt)
    }

    /// Does a part in a conversation of its own.
    fn on<T>(
        &mut self,
        link: &mut SerialLink,
        interrupt: &AtomicBool,
        part: impl FnOnce(&mut Self, &mut Sender<'_>) -> Result<T, End>,
    ) -> Result<T, End> {
        let (mut sender, status) = Sender::open_for_orders(link, Patience::default(), interrupt)?;
        if status.is_alarm() {
            return Err(Error::NotReady { state: status.state }.into());
        }
        let done = part(self, &mut sender);
        sender.end();
        done
    }

    /// The parts in which the pen moves about the middle of the machine.
    fn moving_parts(
        &mut self,
        sender: &mut Sender<'_>,
        core: bool,
        settings: &[AssignedSetting],
        value: &dyn Fn(&[AssignedSetting], Setting) -> f64,
    ) -> Result<(), End> {
        let mut inverting = value(settings, Setting::InvertDirections) as u8;
        loop {
            let right = self.observe(sender, [SHORT, 0.0])?;
            let up = self.observe(sender, [0.0, SHORT])?;
            match inverted([right, up], core) {
                Some(0) => break,
                Some(bits) => {
                    inverting ^= bits;
                    self.set(sender, Setting::InvertDirections, f64::from(inverting))?;
                    say("The directions are changed. Once more:");
                }
                None => {
                    say("The motors are exchanged. Switch off, swap the plugs of the two motors, \
                         and run `penup setup` again.");
                    return Err(End::BrokenOff);
                }
            }
        }
        say("2 of 5: steps in a mm.");
        for (axis, setting, name) in
            [(0, Setting::StepsPerMmX, "right"), (1, Setting::StepsPerMmY, "up")]
        {
            // Both motors of a CoreXY have the steps of x.
            if axis == 1 && core {
                break;
            }
            self.measure(sender, axis, setting, name, value(settings, setting))?;
        }
        self.pen_heights(sender, settings, value)
    }

    /// Moves the pen, asks which way it went, and moves it back.
    fn observe(&mut self, sender: &mut Sender<'_>, by: [f64; 2]) -> Result<Way, End> {
        loop {
            jog(sender, by)?;
            let mut words: Vec<(&str, Option<Way>)> =
                Way::WORDS.iter().map(|(word, way)| (*word, Some(*way))).collect();
            words.push(("not at all", None));
            let question =
                "Which way did the pen go? (right, left, up: away from you, down, not at all)";
            let way = self.answers.choose(question, &words);
            jog(sender, by.map(|part| -part))?;
            match way? {
                Some(way) => return Ok(way),
                None => {
                    say(
                        "Is the motor supply on? If a motor hums or trembles, its coils are mixed \
                         up or its current is too low.",
                    );
                    if !self.answers.is_yes("Try again?")? {
                        return Err(End::BrokenOff);
                    }
                }
            }
        }
    }

    /// Moves the pen by a length that the user measures, and sets the steps in a mm by it.
    fn measure(
        &mut self,
        sender: &mut Sender<'_>,
        axis: usize,
        setting: Setting,
        name: &str,
        now: f64,
    ) -> Result<(), End> {
        let info = setting.info();
        let [least, most] = [info.least, info.greatest].map(|bound| bound.to_num::<f64>());
        self.answers
            .ask(&format!("Mark where the pen is, then press Enter: it goes {LONG} mm {name}."))?;
        let mut by = [0.0; 2];
        by[axis] = LONG;
        jog(sender, by)?;
        // The bounds are those of the setting.
        let bounds = [(now * LONG / most).max(0.1), now * LONG / least];
        let measured = self.answers.number(
            "How many mm did it go? (Enter if it is right)",
            bounds.map(|bound| (bound * 10.0).round() / 10.0),
        );
        jog(sender, by.map(|part| -part))?;
        if let Some(measured) = measured?.filter(|measured| *measured > 0.0) {
            let steps = (now * LONG / measured).clamp(least, most);
            self.set(sender, setting, (steps * 1000.0).round() / 1000.0)?;
        }
        Ok(())
    }

    fn pen_heights(
        &mut self,
        sender: &mut Sender<'_>,
        settings: &[AssignedSetting],
        value: &dyn Fn(&[AssignedSetting], Setting) -> f64,
    ) -> Result<(), End> {
        say("3 of 5: heights of the pen, from 0 (raised) to 127 (lowered). Lay paper below the \
             pen. After each answer it goes down for a moment and up again.");
        for (setting, what) in [
            (Setting::PenUpHeight, "The raised pen should clear the paper by 2 to 3 mm"),
            (Setting::PenDownHeight, "The lowered pen should press lightly"),
        ] {
            let mut height = value(settings, setting);
            loop {
                sender.ask(PEN_DOWN)?;
                sender.wait_until_ready()?;
                let question =
                    format!("{what}: it is {height} now. Which height? (Enter keeps it)");
                let Some(new) = self.answers.number(&question, [0.0, 127.0])? else { break };
                height = new.round();
                self.set(sender, setting, height)?;
            }
        }
        Ok(())
    }

    /// Leads to the origin and draws the test square.
    fn find_origin(
        &mut self,
        args: &PlotterArgs,
        link: SerialLink,
        has_switches: bool,
        interrupt: &AtomicBool,
    ) -> Result<(), End> {
        say("4 of 5: the origin, the sheet's lower left corner.");
        let mut link = if has_switches {
            self.answers.ask(
                "Lay the sheet so that its lower left corner is where the switches are. Press \
                 Enter to find them.",
            )?;
            link
        } else {
            drop(link);
            self.answers.ask(
                "Switch the plotter off, bring the pen by hand to the sheet's lower left corner, \
                 switch it on, and press Enter.",
            )?;
            reopened(args)?
        };
        self.on(&mut link, interrupt, |setup, sender| {
            if has_switches {
                sender.ask(HOME)?;
                sender.wait_until_ready()?;
            }
            let status = sender.status()?;
            if !is_at_origin(&status) && !has_switches {
                say(&format!(
                    "The plotter was not switched off: it takes its place for {} mm.",
                    status.position
                ));
                return Err(End::BrokenOff);
            }
            setup.set(sender, Setting::SoftLimits, 1.0)?;
            say("5 of 5: a test square.");
            let [side, from] = SQUARE;
            let question = format!(
                "Draw a square of {side} mm, {from} mm from the corner of the sheet? Put a pen in \
                 first."
            );
            if setup.answers.is_yes(&question)? {
                draw_square(sender)?;
                say(&format!(
                    "Measure it: each side is {side} mm, and both diagonals are the same. If not, \
                     run `penup setup` again."
                ));
            }
            Ok(())
        })
    }

    /// Changes a setting, and remembers that.
    fn set(&mut self, sender: &mut Sender<'_>, setting: Setting, value: f64) -> Result<(), End> {
        let number = setting.info().number;
        let setting = AssignedSetting { number, value: value.to_string() };
        if change(sender, std::slice::from_ref(&setting))? > 0 {
            self.changed.retain(|it| it.number != number);
            let was = self.before.iter().find(|it| it.number == number);
            if !was.is_some_and(|was| is_same(&was.value, &setting.value)) {
                self.changed.push(setting);
            }
        }
        Ok(())
    }
}

/// Moves the raised pen, and waits until it is there.
fn jog(sender: &mut Sender<'_>, [x, y]: [f64; 2]) -> Result<Status, Error> {
    sender.ask(&format!("$J=G91 X{x} Y{y} F{SPEED}"))?;
    sender.wait_until_ready()
}

/// Opens the port of a plotter that was switched off and on.
fn reopened(args: &PlotterArgs) -> Result<SerialLink, Error> {
    let start = Instant::now();
    loop {
        match open(&args.port) {
            Err(Error::Port { .. } | Error::NoPlotter { .. }) if start.elapsed() < START => {
                std::thread::sleep(Duration::from_millis(500));
            }
            opened => return opened,
        }
    }
}

fn is_at_origin(status: &Status) -> bool {
    let mut numbers = status.position.split(',').take(2).map(str::parse::<f64>);
    numbers.all(|number| number.is_ok_and(|number| number == 0.0))
}

/// Draws the test square, and takes it from the plotter again.
fn draw_square(sender: &mut Sender<'_>) -> Result<(), Error> {
    let [side, from] = SQUARE;
    let to = side + from;
    let lines = [
        CLEAR.to_owned(),
        format!("v {from} {from} 0"),
        format!("v {to} {from} 0"),
        format!("v {to} {to} 0"),
        format!("v {from} {to} 0"),
        "l 1 2 3 4 1".to_owned(),
        "$fit=off".to_owned(),
        format!("$page={0}x{0}", to + from),
        format!("$margin={from}"),
    ];
    for line in &lines {
        sender.ask(line)?;
    }
    sender.plot(&mut Quiet)?;
    sender.ask(CLEAR).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Way::{Down, Left, Right, Up};

    #[test]
    fn directions_are_inverted_as_the_pen_was_seen_to_go() {
        for (seen, straight, core) in [
            ([Right, Up], Some(0), Some(0)),
            ([Left, Up], Some(1), None),
            ([Right, Down], Some(2), None),
            ([Left, Down], Some(3), Some(3)),
            // An inverted motor of a CoreXY exchanges the axes.
            ([Down, Left], None, Some(1)),
            ([Up, Right], None, Some(2)),
            ([Up, Up], None, None),
        ] {
            assert_eq!((inverted(seen, false), inverted(seen, true)), (straight, core), "{seen:?}");
        }
    }
}
