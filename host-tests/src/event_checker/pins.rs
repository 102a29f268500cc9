//! Checks the changes of the pins, and finds what they draw.

use super::Run;
use super::backlash::{Backlash, backlash_steps};
use super::lift::LiftWatch;
use penup::boards::host::{Change, Stamped};
use penup::drawing::PagePoint;
use penup::machine::{Setting, Settings, Value};
use penup::motion::TICKS_PER_SECOND;
use std::collections::BTreeSet;

/// The result of the changes of the pins.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawn {
    /// The moves made with the pen down, with the smaller point first.
    pub inked: BTreeSet<(PagePoint, PagePoint)>,
    /// The sum of the steps.
    pub end: PagePoint,
    /// The time of the start of the last pulse, in ticks.
    pub last_step: u64,
    /// The pen's height at the end.
    pub pen: u8,
    /// The steps of the motor that lifts the pen, from its upper stop.
    pub lift: i32,
    /// The runs between changes of the pen's height.
    pub runs: Vec<Run>,
    /// The moves in which motors took up their backlash in one go, in steps of the motors.
    pub backlash: Vec<Run>,
    /// How long the machine stood before each stroke while the pen was told to be down, in ms.
    pub stood: Vec<f64>,
}

/// Checks the changes of the pins against the settings.
///
/// # Panics
/// Panics at the first change that violates a rule. The rules forbid: a pulse, or a pause between
/// pulses, shorter than the pulse width, a change of direction during a pulse or too shortly before
/// one, a step with the drivers off, a step before the pen's dwell is over but for what the
/// settings let overlap, a pen that is lowered before it was up, a step that leaves the
/// soft limits or leads further beyond them (the origin is where the pins began), a motor that
/// takes up its backlash while the other one moves the pen, and a step while the pen's motor moves
/// or is not at the pen's height.
pub fn check_pins(trace: &[Stamped], settings: &Settings) -> Drawn {
    follow_pins(trace, settings, false)
}

/// Does the same as [`check_pins`] for a job that an alarm may interrupt at any time. The pen then
/// rises at once, even during a pulse, which ends by itself.
///
/// # Panics
/// Panics as [`check_pins`] does.
pub fn check_pins_in_alarms(trace: &[Stamped], settings: &Settings) -> Drawn {
    follow_pins(trace, settings, true)
}

fn follow_pins(trace: &[Stamped], settings: &Settings, alarms: bool) -> Drawn {
    let pulse = u64::from(settings.microseconds_as_ticks(Setting::StepPulse));
    let setup = u64::from(settings.microseconds_as_ticks(Setting::DirectionSetup));
    let mut drawn = Drawn { runs: vec![Run::default()], ..Drawn::default() };
    let build = settings.kinematics();
    let second = f64::from(TICKS_PER_SECOND);
    // For x, y and z: whether the pulse is high, since when, whether the direction is up, and since
    // when.
    let mut axes = [(false, None::<u64>, true, None::<u64>); 3];
    let mut lift = LiftWatch::new(settings, true);
    let (mut enabled, mut pen_ready) = (false, 0);
    // When the machine may move on a raised pen, and until when it may while the pen goes down.
    let (mut may_leave, mut must_stand) = (0, 0);
    let mut is_arriving = false;
    let overlaps = settings.is_on(Setting::PenDownEarly);
    let (mut at, mut motors) = (PagePoint::default(), PagePoint::default());
    let mut backlashes = backlash_steps(settings).map(Backlash::new);
    let mut takes_up = false;
    let mut index = 0;
    while let Some(&Stamped { time, .. }) = trace.get(index) {
        let mut delta = (0, 0);
        // All changes of one interrupt.
        while let Some(stamped) = trace.get(index).filter(|stamped| stamped.time == time) {
            index += 1;
            match stamped.change {
                Change::Enable(on) => enabled = on,
                Change::Pen(height) => {
                    let is_pulse = axes[0].0 || axes[1].0;
                    let may_be = alarms && height < drawn.pen;
                    assert!(!is_pulse || may_be, "{time}: the pen moves during a pulse");
                    let dwell = if height > drawn.pen {
                        Setting::PenDownDwell
                    } else {
                        Setting::PenUpDwell
                    };
                    let ticks = |setting| u64::from(settings.milliseconds_as_ticks(setting));
                    let is_ramp = settings.is_on(Setting::PenRamp) && is_arriving;
                    is_arriving = height > drawn.pen;
                    if !is_arriving || !overlaps {
                        drawn.runs.push(Run { height, ..Run::default() });
                    }
                    if is_arriving {
                        let is_up = !overlaps || is_ramp || time >= pen_ready;
                        assert!(is_up, "{time}: the pen is lowered before it was up");
                        if !is_ramp {
                            must_stand = time + ticks(Setting::PenDownEarly);
                        }
                        may_leave = u64::MAX;
                    } else {
                        must_stand = 0;
                        let early = ticks(Setting::TravelEarly).min(ticks(dwell));
                        may_leave = time + ticks(dwell) - early;
                    }
                    pen_ready = time + ticks(dwell);
                    drawn.pen = height;
                }
                Change::UpX(up) => turn(&mut axes[0], up, time),
                Change::UpY(up) => turn(&mut axes[1], up, time),
                Change::DownZ(down) => turn(&mut axes[2], down, time),
                Change::StepZ(high) => {
                    assert!(!axes[0].0 && !axes[1].0, "{time}: the pen moves during a pulse");
                    match rise(&mut axes[2], high, time, pulse, setup) {
                        0 => {}
                        steps => lift.step(steps > 0, time),
                    }
                    assert!(enabled, "{time}: the pen moves with the drivers off");
                    pen_ready = pen_ready.max(time);
                }
                Change::StepX(high) => delta.0 += rise(&mut axes[0], high, time, pulse, setup),
                Change::StepY(high) => delta.1 += rise(&mut axes[1], high, time, pulse, setup),
            }
        }
        if delta != (0, 0) {
            assert!(enabled, "{time}: step with the drivers off");
            if is_arriving && time >= pen_ready {
                // The stroke begins.
                let last = drawn.last_step.max(pen_ready - ticks_of(settings));
                drawn.stood.push((time - last) as f64 / second * 1000.0);
                if overlaps {
                    drawn.runs.push(Run { height: drawn.pen, ..Run::default() });
                }
                (is_arriving, may_leave) = (false, 0);
            }
            let may_move = if is_arriving { time <= must_stand } else { time >= may_leave };
            assert!(may_move, "{time}: step while the pen moves");
            lift.assert_at(drawn.pen, "a step with the pen");
            motors = PagePoint { x: motors.x + delta.0, y: motors.y + delta.1 };
            let moved = (backlashes[0].turn(delta.0), backlashes[1].turn(delta.1));
            if moved == (0, 0) {
                if !std::mem::replace(&mut takes_up, true) {
                    let height = if is_arriving { 0 } else { drawn.pen };
                    drawn.backlash.push(Run { height, ..Run::default() });
                }
                let run = drawn.backlash.last_mut().expect("never empty");
                run.times.push(time as f64 / second);
                run.points.push(motors);
                continue;
            }
            takes_up = false;
            assert_eq!(moved, delta, "{time}: backlash is taken up while the pen moves");
            let next = PagePoint { x: at.x + delta.0, y: at.y + delta.1 };
            if drawn.pen >= 64 && !is_arriving {
                drawn.inked.insert((at.min(next), at.max(next)));
            }
            if settings.is_on(Setting::SoftLimits) && !settings.is_on(Setting::Homing) {
                let beyond = [at, next].map(|motors| beyond(build.page(motors), settings));
                assert!(beyond[1] <= beyond[0], "{time}: out of the soft limits at {next:?}");
            }
            let run = drawn.runs.last_mut().expect("never empty");
            run.times.push(time as f64 / second);
            run.points.push(next);
            at = next;
            drawn.last_step = time;
        }
    }
    drawn.end = at;
    drawn.lift = lift.position;
    drawn
}

/// The dwell of the pen when it is lowered, in ticks.
fn ticks_of(settings: &Settings) -> u64 {
    settings.milliseconds_as_ticks(Setting::PenDownDwell).into()
}

/// The number of steps beyond the travel.
fn beyond(page: PagePoint, settings: &Settings) -> i64 {
    let [x, y] = settings.page_steps();
    let over = |at: i32, travel: Setting, steps: Value| {
        let most = settings.get(travel).to_num::<f64>() * steps.to_num::<f64>();
        i64::from(at - at.clamp(0, most as i32)).abs()
    };
    over(page.x, Setting::TravelX, x) + over(page.y, Setting::TravelY, y)
}

type AxisPins = (bool, Option<u64>, bool, Option<u64>);

fn turn(axis: &mut AxisPins, up: bool, time: u64) {
    assert!(!axis.0, "{time}: direction changes during a pulse");
    (axis.2, axis.3) = (up, Some(time));
}

fn rise(axis: &mut AxisPins, high: bool, time: u64, pulse: u64, setup: u64) -> i32 {
    if let Some(since) = axis.1 {
        assert!(time >= since + pulse, "{time}: pulse or pause too short");
    }
    (axis.0, axis.1) = (high, Some(time));
    if !high {
        return 0;
    }
    if let Some(turned) = axis.3 {
        assert!(time >= turned + setup, "{time}: pulse too soon after the direction");
    }
    if axis.2 { 1 } else { -1 }
}
