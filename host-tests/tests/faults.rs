//! Tests of commands, alarms and switches at random instants: on a whole plotter that draws over
//! its serial line, and on a homing polargraph with backlash.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::boards::host::{Change, Stamped};
use penup::drawing::{LineType, PagePoint};
use penup::machine::{
    Alarm, Contacts, Setting, Settings, State, Switches, Target, TargetList, Value,
};
use penup_host_tests::event_checker::{self, Backlash, Drawn};
use penup_host_tests::pin_machine;
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use std::mem::discriminant;

/// A plotter that draws one picture repeatedly and must never lose its position.
struct Session {
    bench: Bench,
    settings: Settings,
    /// The levels of the direction pins.
    directions: Vec<Stamped>,
}

impl Session {
    fn new(values: &[(Setting, f64)]) -> Self {
        let mut session =
            Self { bench: Bench::new(), settings: Settings::default(), directions: Vec::new() };
        for &(setting, value) in values {
            session.settings.set(setting, Value::from_num(value)).expect("valid");
            session.order(&format!("${}={value}", setting.info().number()));
        }
        let picture = job_lines("notched.obj", &["$page=20x20", "$margin=4"]);
        for line in picture.iter().filter(|line| *line != "$plot") {
            session.order(line);
        }
        session
    }

    fn order(&mut self, line: &str) {
        let answer = self.bench.say(&format!("{line}\n"));
        assert_eq!(answer.lines().last(), Some("ok"), "{line}: {answer}");
    }

    fn state(&self) -> State {
        self.bench.plotter.machine().state()
    }

    /// Runs for this many milliseconds. Returns how many passed before nothing moved any more.
    fn work(&mut self, milliseconds: u64) -> u64 {
        for passed in 0..milliseconds {
            let busy = self.bench.plotter.poll(&mut self.bench.board);
            if !busy && self.bench.plotter.machine().is_stopped() {
                return passed;
            }
            penup::plotter::Board::wait(&mut self.bench.board);
        }
        milliseconds
    }

    fn send(&mut self, byte: u8) {
        self.bench.board.receive(&[byte]);
    }

    fn press(&mut self, contacts: Contacts) {
        self.bench.board.set_contacts(contacts);
    }

    /// Clears an alarm, if there is one, as soon as that is allowed.
    fn unlock(&mut self) {
        for _ in 0..2000 {
            if !matches!(self.state(), State::Alarm(_)) {
                return;
            }
            self.bench.say("$X\n");
            penup::plotter::Board::wait(&mut self.bench.board);
        }
        panic!("the alarm cannot be left: {}", self.bench.say("$X\n"));
    }

    /// Returns what was drawn. Afterwards the pen is at the origin, or the plotter has lost its
    /// position.
    fn end(&mut self) -> Drawn {
        self.bench.finish();
        self.order("G28");
        self.bench.finish();
        self.order("$SLP");
        self.bench.finish();
        self.order("$X");
        let mut trace = self.directions.clone();
        trace.extend(self.bench.board.trace().take_changes());
        self.directions = [Change::UpX(true), Change::UpY(true), Change::DownZ(true)]
            .iter()
            .filter_map(|pin| {
                let is_same =
                    |stamped: &&Stamped| discriminant(&stamped.change) == discriminant(pin);
                trace.iter().rev().find(is_same).copied()
            })
            .collect();
        let drawn = event_checker::check_pins_in_alarms(&trace, &self.settings);
        assert_eq!(drawn.end, PagePoint::default(), "the position is lost");
        drawn
    }
}

/// Draws the picture `count` times, each time with a different disturbance at a random instant.
fn disturb(values: &[(Setting, f64)], count: u64, seed: u64) {
    let mut session = Session::new(values);
    session.order("$plot");
    let duration = session.work(3_600_000);
    let never_cancel = session.end();
    assert!(never_cancel.inked.len() > 1000 && duration > 1000, "{duration} ms is no job");
    let mut random = Random::new(seed);
    let mut alarms = 0;
    for case in 0..count {
        session.order("$plot");
        session.work(random.below(duration));
        let fault = random.below(8);
        match fault {
            // Hold, and hold again while the machine decelerates or stands still.
            0 | 1 => {
                session.send(b'!');
                session.work(random.below(600));
                session.send(b'~');
                session.work(random.below(600));
                session.send(b'!');
                session.bench.finish();
                session.send(b'~');
            }
            2 => {
                session.send(0xFB);
                session.bench.finish();
                session.send(b'~');
            }
            // Faster, and slower.
            3 => {
                session.send(0x91);
                session.work(random.below(300));
                session.send(0x92);
            }
            4 => session.send(0x18),
            5 => {
                session.send(b'!');
                session.work(random.below(400));
                session.send(0x18);
            }
            6 => session.send(0xFD),
            _ => {
                let stop = random.below(2) == 0;
                session.press(Contacts { x: !stop, y: false, stop });
                session.work(1 + random.below(50));
                if stop {
                    assert_eq!(session.state(), State::Alarm(Alarm::EmergencyStop));
                    session.bench.say("$X\n");
                    assert_eq!(session.state(), State::Alarm(Alarm::EmergencyStop));
                }
                session.press(Contacts::default());
            }
        }
        session.bench.plotter.poll(&mut session.bench.board);
        alarms += u64::from(matches!(session.state(), State::Alarm(_)));
        session.unlock();
        session.bench.finish();
        if fault > 3 {
            session.order("$plot");
        }
        let drawn = session.end();
        let missing = never_cancel.inked.difference(&drawn.inked).count();
        let other: Vec<_> = drawn.inked.difference(&never_cancel.inked).take(3).collect();
        assert_eq!((missing, other), (0, vec![]), "case {case}: other ink after fault {fault}");
        assert_eq!((drawn.pen, drawn.lift), (never_cancel.pen, never_cancel.lift), "case {case}");
    }
    assert!(alarms > count / 10, "{alarms} alarms of {count}");
}

#[test]
fn a_plotter_that_is_disturbed_at_400_instants_draws_the_same() {
    disturb(&[(Setting::HardLimits, 1.0)], 400, 1971);
}

#[test]
fn so_does_one_with_backlash_whose_pen_a_motor_lifts() {
    let values = [
        (Setting::HardLimits, 1.0),
        (Setting::BacklashX, 0.3),
        (Setting::BacklashY, 0.2),
        (Setting::TravelZ, 1.0),
        (Setting::MaxRateZ, 900.0),
        (Setting::AccelerationZ, 500.0),
        (Setting::Tool, 1.0),
    ];
    disturb(&values, 300, 1975);
}

#[test]
fn so_does_a_polargraph_with_backlash() {
    let values = [
        (Setting::HardLimits, 1.0),
        // Always in force there, and the checker reckons from belts of no length.
        (Setting::SoftLimits, 0.0),
        (Setting::Kinematics, 2.0),
        (Setting::BacklashX, 0.3),
        (Setting::BacklashY, 0.2),
    ];
    disturb(&values, 300, 1978);
}

/// The lengths of a polargraph's belts in steps, seen from the gondola, with backlash.
struct PolargraphMachine {
    backlashes: [Backlash; 2],
    motors: PagePoint,
    belts: PagePoint,
}

impl PolargraphMachine {
    fn follow(&mut self, motors: PagePoint) {
        self.belts.x += self.backlashes[0].turn(motors.x - self.motors.x);
        self.belts.y += self.backlashes[1].turn(motors.y - self.motors.y);
        self.motors = motors;
    }
}

/// The actions of the main loop in the next test.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Homing,
    Drawing,
    Held,
    Stopped,
    Last,
}

/// Homes a polargraph with backlash and draws, with a disturbance at some instant. The true lengths
/// of the belts must then still be those that the machine assumes.
fn home_and_disturb(random: &mut Random) -> Stage {
    let mut settings = Settings::default();
    for (setting, value) in [
        (Setting::Homing, 1.0),
        (Setting::HardLimits, 1.0),
        (Setting::Kinematics, 2.0),
        (Setting::HomingSeek, 3000.0),
        (Setting::HomingFeed, 240.0),
        (Setting::BacklashX, 0.3),
        (Setting::BacklashY, 0.2),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    // 500 mm when homed, 2 mm from the switches.
    let (homed, switch) = (40_000, 40_000 - 160);
    let build = settings.kinematics();
    let middle = build.page(PagePoint { x: homed, y: homed });
    let target =
        |x: i32, y: i32, ink| Target { point: PagePoint { x: middle.x + x, y: middle.y + y }, ink };
    let full = Some(LineType::Full);
    let job = [
        target(-300, -700, None),
        target(500, -900, full),
        target(100, -600, full),
        target(-300, -700, full),
    ];
    let last = [target(200, -300, full), target(0, 0, None)];
    let mut paths = [TargetList::new(&job), TargetList::new(&last)];
    let mut polargraph = PolargraphMachine {
        backlashes: event_checker::backlash_steps(&settings).map(Backlash::in_the_middle),
        motors: PagePoint::default(),
        belts: PagePoint {
            x: homed - 100 + random.below(900) as i32,
            y: homed - 100 + random.below(900) as i32,
        },
    };
    let instant = random.below(160_000_000);
    let fault = random.below(4);
    let (mut stage, mut struck_in) = (Stage::Homing, None);
    let mut off = None;
    pin_machine::run_with(settings, 25_000, &mut |turn, queue| {
        polargraph.follow(turn.motors);
        let machine = turn.machine;
        let mut pressed =
            Switches { x: polargraph.belts.x <= switch, y: polargraph.belts.y <= switch };
        let ready = machine.state() == State::Idle && machine.is_stopped();
        if turn.now == 0 {
            machine.home(pressed).expect("ready");
        } else if struck_in.is_none() && turn.now >= instant {
            struck_in = Some(stage);
            match fault {
                0 => machine.hold(),
                1 => machine.abort(),
                // During homing, it would be the switch that is searched for.
                _ if fault == 2 || stage == Stage::Homing => machine.alarm(Alarm::EmergencyStop),
                // The alarm is caused by another switch.
                _ => pressed = Switches { x: true, y: true },
            }
            if fault > 0 {
                stage = Stage::Stopped;
            } else if matches!(machine.state(), State::Hold { .. }) {
                // Homing cannot be held.
                stage = Stage::Held;
            }
        } else {
            match stage {
                Stage::Homing if ready => {
                    machine.start(&mut paths[0]).expect("idle");
                    off = None;
                    stage = Stage::Drawing;
                }
                // The machine is far from its assumed position if the switches were pressed at a
                // wrong position.
                Stage::Homing | Stage::Stopped
                    if matches!(machine.state(), State::Alarm(_)) && machine.unlock().is_ok() =>
                {
                    stage = Stage::Stopped;
                }
                Stage::Held
                    if machine.state() == (State::Hold { stopped: true })
                        && machine.is_stopped() =>
                {
                    machine.resume();
                    stage = Stage::Drawing;
                }
                Stage::Stopped if ready && (struck_in != Some(Stage::Homing) || off.is_some()) => {
                    machine.start(&mut paths[1]).expect("idle");
                    stage = Stage::Last;
                }
                Stage::Stopped if ready => {
                    machine.home(pressed).expect("idle");
                    stage = Stage::Homing;
                }
                Stage::Drawing if ready => {
                    machine.start(&mut paths[1]).expect("idle");
                    stage = Stage::Last;
                }
                Stage::Last if ready => return false,
                _ => {}
            }
        }
        machine.watch(pressed);
        let path = &mut paths[usize::from(stage == Stage::Last)];
        machine.fill(path, queue);
        if stage == Stage::Homing && machine.state() == State::Idle && machine.is_stopped() {
            off = Some((polargraph.belts.x - homed, polargraph.belts.y - homed));
        }
        assert!(
            turn.now < 25_000_000 * 60,
            "{stage:?} takes more than a minute: {:?} {struck_in:?} {fault} {:?}",
            machine.state(),
            polargraph.belts
        );
        true
    });
    let end = build.motors(middle);
    let (x, y) = (polargraph.belts.x - end.x, polargraph.belts.y - end.y);
    assert!(x.abs() <= 2 && y.abs() <= 2, "off by {x}, {y} after fault {fault} in {struck_in:?}");
    struck_in.unwrap_or(Stage::Last)
}

#[test]
fn a_polargraph_with_backlash_that_is_disturbed_while_it_homes_or_draws_knows_its_belts() {
    let mut random = Random::new(1980);
    let mut struck = Vec::new();
    for _ in 0..600 {
        struck.push(home_and_disturb(&mut random));
    }
    for stage in [Stage::Homing, Stage::Drawing] {
        let count = struck.iter().filter(|&&other| other == stage).count();
        assert!(count > 100, "{count} in {stage:?}");
    }
}
