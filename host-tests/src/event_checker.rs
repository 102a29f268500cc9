//! A strict checker for event streams and for pins: it rejects everything that a real driver, motor
//! or pen would not tolerate.

mod backlash;
mod lift;
mod pins;
mod speed;
mod standstill;

pub use backlash::{Backlash, backlash_steps};
pub use pins::{Drawn, check_pins, check_pins_in_alarms};
pub use speed::{
    Ratios, acceleration_ratio, acceleration_window, check_speed, greatest_acceleration,
    greatest_jerk, speed_ratios,
};

pub use standstill::{Standstill, standstill};

use lift::LiftWatch;
use penup::drawing::PagePoint;
use penup::machine::{Setting, Settings};
use penup::motion::{EventKind, StepEvent, TICKS_PER_SECOND};

/// The motion that the events of a job amount to.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The runs between changes of the pen's height.
    pub runs: Vec<Run>,
    /// The final position.
    pub end: PagePoint,
}

/// The motion between two moves of the pen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// The pen's height.
    pub height: u8,
    /// The time in seconds from the first event of the run to the end of the last one.
    pub seconds: f64,
    /// The time of each move in seconds from the start of the run.
    pub times: Vec<f64>,
    /// The position after each move.
    pub points: Vec<PagePoint>,
}

/// Checks the events against the settings.
///
/// # Panics
/// Panics at the first event that violates a rule, with its number. The rules forbid: pulses closer
/// than twice their width, a pulse too soon after a change of its direction, a change of direction
/// during a pulse, a step beyond the soft limits, a step during the pen's dwell, while the pen's
/// motor moves, or with the drivers off, an event without duration, a pen height that differs from
/// the steps of the pen's motor, a pen that moves faster or accelerates more than set, and a stream
/// that does not end at rest with the pen up.
pub fn check(events: &[StepEvent], settings: &Settings) -> Verdict {
    let pulse = u64::from(settings.microseconds_as_ticks(Setting::StepPulse));
    let setup = u64::from(settings.microseconds_as_ticks(Setting::DirectionSetup));
    let dwell = |height: u8| {
        let lowered = i64::from(height) == settings.get(Setting::PenDownHeight).to_num::<i64>();
        let dwell = if lowered { Setting::PenDownDwell } else { Setting::PenUpDwell };
        u64::from(settings.milliseconds_as_ticks(dwell))
    };
    let travel = |travel, steps| {
        (settings.get(travel).to_num::<f64>() * settings.get(steps).to_num::<f64>()) as i32
    };
    let most = (
        travel(Setting::TravelX, Setting::StepsPerMmX),
        travel(Setting::TravelY, Setting::StepsPerMmY),
    );
    let mut at = PagePoint::default();
    let mut time = 0u64;
    let mut run_start = 0u64;
    let mut pen_ready = 0u64;
    // For x and y: the direction level, the time of its last change, and the time of the axis's
    // last pulse.
    let mut axes = [(false, None::<u64>, None::<u64>); 2];
    let mut lift = LiftWatch::new(settings, false);
    let mut runs = vec![Run::default()];
    let second = f64::from(TICKS_PER_SECOND);
    for (number, event) in events.iter().enumerate() {
        assert!(event.ticks() > 0, "event {number} takes no time");
        match event.kind() {
            EventKind::Lift { step, down } => {
                assert!(event.ticks() >= setup as u32, "event {number}: no time for the direction");
                if step {
                    lift.step(down, time);
                }
                // The pen is not ready until it has reached its height.
                pen_ready = u64::MAX;
            }
            EventKind::Pen { height } => {
                lift.assert_at(height, "an event of the pen");
                pen_ready = time + dwell(height);
                // On a ramp, the pen moves again before its dwell.
                let run = runs.last_mut().expect("never empty");
                run.seconds = time.saturating_sub(run_start) as f64 / second;
                runs.push(Run { height, ..Run::default() });
                run_start = pen_ready;
            }
            EventKind::Levels(levels) => {
                for (axis, down_bit, pulse_bit) in [
                    (0, StepEvent::DOWN_X, StepEvent::STEP_X),
                    (1, StepEvent::DOWN_Y, StepEvent::STEP_Y),
                ] {
                    let (level, changed, pulsed) = &mut axes[axis];
                    let down = levels & down_bit != 0;
                    if down != *level {
                        *level = down;
                        *changed = Some(time);
                        assert!(
                            pulsed.is_none_or(|pulsed| time >= pulsed + pulse),
                            "event {number}: direction changes during a pulse"
                        );
                    }
                    if levels & pulse_bit != 0 {
                        assert!(
                            changed.is_none_or(|changed| time >= changed + setup),
                            "event {number}: pulse too soon after the change of direction"
                        );
                        assert!(
                            pulsed.is_none_or(|pulsed| time >= pulsed + 2 * pulse),
                            "event {number}: pulses run together"
                        );
                        *pulsed = Some(time);
                    }
                }
                if event.pulses() != (0, 0) {
                    assert!(time >= pen_ready, "event {number}: moves while the pen moves");
                    assert!(levels & StepEvent::DRIVERS_ON != 0, "event {number}: drivers off");
                }
                let (dx, dy) = event.step();
                if (dx, dy) != (0, 0) {
                    at = PagePoint { x: at.x + dx, y: at.y + dy };
                    let page = settings.kinematics().page(at);
                    assert!(
                        (0..=most.0).contains(&page.x) && (0..=most.1).contains(&page.y),
                        "event {number}: beyond the travel at {at:?}"
                    );
                    let run = runs.last_mut().expect("never empty");
                    run.times.push((time - run_start) as f64 / second);
                    run.points.push(at);
                }
            }
        }
        time += u64::from(event.ticks());
    }
    assert!(time >= pen_ready, "the events end while the pen moves");
    if let Some(run) = runs.last_mut() {
        run.seconds = (time - run_start) as f64 / second;
        assert!(run.height < 64, "the events end with the pen down");
    }
    Verdict { runs, end: at }
}
