//! `penup setup`: leads through the settings of a new machine.
//!
//! Each part asks, moves the machine, and stores what it has learnt before the next one begins. No
//! setting is changed for a while only. So whoever breaks off, or pulls the cable, finds the
//! machine with the settings of the parts that are done, and is told which these are. Answers are
//! lines of the standard input; its end breaks off.

mod answers;
mod directions;
mod polargraph;

use self::answers::{Answers, say};
use super::lowering::{dip, pen_lines};
use super::open;
use super::orders::jog_by;
use super::settings::{as_json, change, read};
use super::squares::{self, MARGIN};
use crate::cli::PlotterArgs;
use crate::error::Error;
use crate::interrupt::MovingPlotter;
use crate::link::SerialLink;
use crate::machine_settings::{AssignedSetting, value};
use crate::outcome::Outcome;
use crate::sender::{Sender, Timeouts};
use penup::machine::Setting;
use penup_job::protocol::{HOME, Status};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The length of the moves that are measured, in mm.
const LONG: f64 = 100.0;

/// The speed of all moves, in mm/min.
const SPEED: f64 = 1000.0;

/// The side of the test square, in mm.
const SQUARE: f64 = 40.0;

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

/// The kinds of machines, by what must be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Machine {
    Cartesian,
    CoreXy,
    Polargraph,
}

impl Machine {
    /// The kind that the settings say.
    fn of(settings: &[AssignedSetting]) -> Self {
        match value(settings, Setting::Kinematics) {
            0.0 => Self::Cartesian,
            1.0 => Self::CoreXy,
            _ => Self::Polargraph,
        }
    }
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
/// The setup is broken off, the machine stops with an alarm, or as [`Sender::ask`]. What was
/// changed until then is told.
pub fn setup(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    let mut setup =
        Setup { answers: Answers::new(interrupt), before: Vec::new(), changed: Vec::new() };
    let ended = setup.parts(args, interrupt);
    let changed = setup.changes();
    let json = as_json(&setup.changed);
    match ended {
        Ok(()) => Ok(Outcome::done(format!("the machine is set up; {changed}"), json)),
        Err(End::BrokenOff | End::Failed(Error::Interrupted)) => Err(Error::SetupBrokenOff {
            changes: changed,
            is_interrupted: interrupt.load(Ordering::Relaxed),
        }),
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
        let settings = self.on(&mut link, interrupt, |setup, sender| {
            let settings = read(sender)?;
            setup.before.clone_from(&settings);
            // Without a pen that goes down there is nothing to set up.
            pen_lines(&settings)?;
            say("Keep a hand at the switch of the motor supply.");
            Ok(settings)
        })?;
        let machine = Machine::of(&settings);
        if machine == Machine::Polargraph {
            return self.polargraph_parts(args, link, &settings, interrupt);
        }
        self.on(&mut link, interrupt, |setup, sender| {
            say(
                "1 of 5: directions. Bring the pen by hand to the middle of the machine, with the \
                 motors off.",
            );
            setup.answers.ask("Press Enter when it is there.")?;
            let room = room_for_moves(&sender.status()?, &settings)?;
            setup.moving_parts(sender, machine, &settings, room)
        })?;
        let has_switches = value(&settings, Setting::Homing) != 0.0;
        self.find_origin(args, link, has_switches, interrupt)
    }

    /// Does a part in a conversation of its own.
    fn on<T>(
        &mut self,
        link: &mut SerialLink,
        interrupt: &AtomicBool,
        part: impl FnOnce(&mut Self, &mut Sender<'_>) -> Result<T, End>,
    ) -> Result<T, End> {
        let (mut sender, status) = Sender::open_for_orders(link, Timeouts::default(), interrupt)?;
        if status.is_alarm() {
            return Err(Error::NotReady { state: status.state }.into());
        }
        let done = part(self, &mut sender);
        sender.end();
        done
    }

    /// The parts in which the pen moves about the middle of the machine, by up to `room` mm to the
    /// right and up, and back.
    fn moving_parts(
        &mut self,
        sender: &mut Sender<'_>,
        machine: Machine,
        settings: &[AssignedSetting],
        room: [f64; 2],
    ) -> Result<(), End> {
        let inverting = value(settings, Setting::InvertDirections) as u8;
        self.find_directions(sender, machine, inverting)?;
        say("2 of 5: steps in a mm.");
        for (axis, setting, name) in
            [(0, Setting::StepsPerMmX, "right"), (1, Setting::StepsPerMmY, "up")]
        {
            // Both motors of a CoreXY have the steps of x.
            if axis == 1 && machine == Machine::CoreXy {
                break;
            }
            let now = value(settings, setting);
            self.measure(sender, axis, setting, name, now, room[axis])?;
        }
        self.pen_heights(sender, settings, 3)
    }

    /// Moves the pen by `way` mm, which the user measures, and sets the steps in a mm by it.
    fn measure(
        &mut self,
        sender: &mut Sender<'_>,
        axis: usize,
        setting: Setting,
        name: &str,
        now: f64,
        way: f64,
    ) -> Result<(), End> {
        let info = setting.info();
        let [least, most] = [info.least, info.greatest].map(|bound| bound.to_num::<f64>());
        self.answers
            .ask(&format!("Mark where the pen is, then press Enter: it goes {way} mm {name}."))?;
        let mut by = [0.0; 2];
        by[axis] = way;
        jog(sender, by)?;
        // The bounds are those of the setting.
        let bounds = [(now * way / most).max(0.1), now * way / least];
        let measured = self.answers.number(
            "How many mm did it go? (Enter if it is right)",
            bounds.map(|bound| (bound * 10.0).round() / 10.0),
        );
        jog(sender, by.map(|part| -part))?;
        if let Some(measured) = measured?.filter(|measured| *measured > 0.0) {
            let steps = (now * way / measured).clamp(least, most);
            self.set(sender, setting, (steps * 1000.0).round() / 1000.0)?;
        }
        Ok(())
    }

    fn pen_heights(
        &mut self,
        sender: &mut Sender<'_>,
        settings: &[AssignedSetting],
        part: u8,
    ) -> Result<(), End> {
        let pen = pen_lines(settings)?;
        say(&format!(
            "{part} of 5: heights of the pen, from 0 (raised) to 127 (lowered). Lay paper below \
             the pen. After each answer it goes down for a moment and up again."
        ));
        for (setting, what) in [
            (Setting::PenUpHeight, "The raised pen should clear the paper by 2 to 3 mm"),
            (Setting::PenDownHeight, "The lowered pen should press lightly"),
        ] {
            let mut height = value(settings, setting);
            loop {
                dip(&pen, sender)?;
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
            if !has_switches {
                expect_origin(sender)?;
            }
            setup.draw_test(sender)
        })
    }

    /// Draws the test square.
    fn draw_test(&mut self, sender: &mut Sender<'_>) -> Result<(), End> {
        self.set(sender, Setting::SoftLimits, 1.0)?;
        say("5 of 5: a test square.");
        let question = format!(
            "Draw a square of {SQUARE} mm, {MARGIN} mm from the corner of the sheet? Put a pen in \
             first."
        );
        if self.answers.is_yes(&question)? {
            squares::draw(sender, &[SQUARE])?;
            say(&format!(
                "Measure it: each side is {SQUARE} mm, and both diagonals are the same. If not, \
                 run `penup setup` again."
            ));
        }
        Ok(())
    }

    /// Changes a setting, and remembers that.
    fn set(&mut self, sender: &mut Sender<'_>, setting: Setting, value: f64) -> Result<(), End> {
        let number = setting.info().number();
        let setting = AssignedSetting { number, value: value.to_string() };
        if change(sender, std::slice::from_ref(&setting))? > 0 {
            self.changed.retain(|it| it.number != number);
            let was = self.before.iter().find(|it| it.number == number);
            if was.and_then(|was| was.value.parse().ok()) != Some(value) {
                self.changed.push(setting);
            }
        }
        Ok(())
    }
}

/// Moves the raised pen, and waits until it is there.
fn jog(sender: &mut Sender<'_>, by: [f64; 2]) -> Result<Status, Error> {
    jog_by(sender, by, SPEED)
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

/// Breaks off unless the plotter takes its place for the origin, as it does when it starts.
fn expect_origin(sender: &mut Sender<'_>) -> Result<(), End> {
    let place = sender.status()?.position;
    let mut numbers = place.split(',').take(2).map(str::parse::<f64>);
    if numbers.all(|number| number.is_ok_and(|number| number == 0.0)) {
        return Ok(());
    }
    say(&format!("The plotter was not switched off: it takes its place for {place} mm."));
    Err(End::BrokenOff)
}

/// How far the pen may move to the right and up from where the plotter takes it to be, up to
/// [`LONG`] on each axis.
///
/// All moves of the setup go there and back. So the soft limits stay on, although the pen was
/// brought elsewhere by hand. Breaks off if there is no room for them.
fn room_for_moves(status: &Status, settings: &[AssignedSetting]) -> Result<[f64; 2], End> {
    let place: Vec<f64> =
        status.position.split(',').filter_map(|number| number.parse().ok()).collect();
    let travel = [Setting::TravelX, Setting::TravelY].map(|axis| value(settings, axis));
    let room = [0, 1].map(|axis| LONG.min(travel[axis]).floor());
    let is_free = |axis: usize| {
        place.get(axis).is_some_and(|at| *at >= 0.0 && at + room[axis] <= travel[axis])
    };
    if value(settings, Setting::SoftLimits) == 0.0 || is_free(0) && is_free(1) {
        return Ok(room);
    }
    say(&format!(
        "The plotter takes its place for {} mm, and its travel is {} x {} mm ($130, $131): from \
         there it cannot go {} mm to the right and {} mm up. Switch it off and on, so that it \
         begins at 0,0, and run `penup setup` again.",
        status.position, travel[0], travel[1], room[0], room[1]
    ));
    Err(End::BrokenOff)
}
