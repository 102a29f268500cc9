//! The jobs and settings of these tests.

use penup::drawing::{LineType, PagePoint};
use penup::machine::{Machine, Setting, Settings, State, Target, TargetList, Value};
use penup_host_tests::event_checker::{self, Drawn};
use penup_host_tests::pin_machine::{self, Turn};

/// A point of the page in steps.
pub fn point(x: i32, y: i32) -> PagePoint {
    PagePoint { x, y }
}

/// A target to which the pen moves raised.
pub fn to(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: None }
}

/// A target to which a full line leads.
pub fn ink(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Full) }
}

/// A target to which a dotted line leads.
pub fn dotted(x: i32, y: i32) -> Target {
    Target { point: point(x, y), ink: Some(LineType::Dotted) }
}

/// A job with strokes, moves and a dotted line.
pub fn job() -> Vec<Target> {
    vec![
        to(400, 300),
        ink(1200, 300),
        ink(1200, 900),
        ink(1190, 910),
        ink(400, 300),
        to(50, 60),
        dotted(900, 333),
        ink(900, 333),
        ink(20, 1000),
        to(0, 0),
    ]
}

/// The default settings with other values for some.
pub fn with(values: &[(Setting, f64)]) -> Settings {
    let mut settings = Settings::default();
    for &(setting, value) in values {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// The settings of a machine with 23 and 15 steps of backlash, or without any.
pub fn with_backlash(loose: bool) -> Settings {
    let backlash = f64::from(u8::from(loose));
    with(&[(Setting::BacklashX, 0.3 * backlash), (Setting::BacklashY, 0.2 * backlash)])
}

/// The settings of a machine whose pen is lifted by a motor, or by a servo.
pub fn lifted(mut settings: Settings, by_a_motor: bool) -> Settings {
    for (setting, value) in [
        (Setting::TravelZ, 1.0),
        (Setting::MaxRateZ, 900.0),
        (Setting::AccelerationZ, 500.0),
        (Setting::PenUpHeight, 20.0 * f64::from(u8::from(by_a_motor))),
        (Setting::Tool, f64::from(u8::from(by_a_motor))),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}

/// Draws the job in a pin machine. `visit` is called at each iteration of the main loop, which
/// takes `turn_ticks`, and ends the run by returning `false`.
pub fn run_job(
    settings: Settings,
    turn_ticks: u64,
    visit: &mut dyn FnMut(Turn<'_, '_>) -> bool,
) -> Drawn {
    let targets = job();
    let mut path = TargetList::new(&targets);
    let trace = pin_machine::run(settings, &mut path, turn_ticks, &mut |turn| {
        if turn.now == 0 {
            turn.machine.start(&mut TargetList::new(&job())).expect("valid");
        }
        assert_eq!(turn.machine.position(), turn.pins);
        visit(turn)
    });
    event_checker::check_pins(&trace, &settings)
}

/// Whether the machine is idle and its pins rest.
pub fn is_ready(machine: &Machine<'_>) -> bool {
    machine.state() == State::Idle && machine.is_stopped()
}

/// The job, drawn without a disturbance.
pub fn never_cancel() -> Drawn {
    run_job(Settings::default(), 25_000, &mut |turn| !is_ready(turn.machine))
}

/// The pen's height and the steps of its motor when the pen is raised.
pub fn raised(by_a_motor: bool) -> (u8, i32) {
    // The height is 20 of 127, and the motor has 400 steps.
    if by_a_motor { (20, 62) } else { (0, 0) }
}

/// A polargraph with belts of 40 steps per millimetre from anchors 900 mm apart.
pub fn polargraph() -> Settings {
    let mut settings = Settings::default();
    for (setting, value) in [
        (Setting::StepsPerMmX, 40.0),
        (Setting::AnchorWidth, 900.0),
        (Setting::AnchorLeft, 200.0),
        (Setting::AnchorHeight, 750.0),
        (Setting::Kinematics, 2.0),
    ] {
        settings.set(setting, Value::from_num(value)).expect("valid");
    }
    settings
}
