//! One strict checker for every event stream: what a real driver, motor and pen would not forgive.

use penup::drawing::PagePoint;
use penup::machine::{Setting, Settings};
use penup::motion::{EventKind, StepEvent, TICKS_PER_SECOND};

/// What the events of a job came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Time (s), place along the path (mm) of each move, by run of the pen's height.
    pub runs: Vec<Run>,
    /// Where the steps lead.
    pub end: PagePoint,
}

/// What happens between two moves of the pen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Run {
    /// The pen's height.
    pub height: u8,
    /// Seconds from the first event of the run to the end of the last.
    pub seconds: f64,
    /// Seconds of each move from the start of the run.
    pub times: Vec<f64>,
    /// Where each move leads.
    pub points: Vec<PagePoint>,
}

/// Checks the events against the settings.
///
/// # Panics
/// At the first event that breaks a rule, with its number: pulses closer than twice their width, a
/// pulse too soon after the change of its direction, a direction that changes during a pulse, a
/// step beyond the soft limits, a step while the pen's dwell runs or with the drivers off, an event
/// of no time, a stream that does not end at rest with the pen up.
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
    // Of x and y: the level, when it changed, when the axis was last pulsed.
    let mut axes = [(false, None::<u64>, None::<u64>); 2];
    let mut runs = vec![Run::default()];
    let second = f64::from(TICKS_PER_SECOND);
    for (number, event) in events.iter().enumerate() {
        assert!(event.ticks() > 0, "event {number} takes no time");
        match event.kind() {
            EventKind::Pen { height } => {
                assert!(time >= pen_ready, "event {number}: the pen moves while it moves");
                pen_ready = time + dwell(height);
                let run = runs.last_mut().expect("never empty");
                run.seconds = (time - run_start) as f64 / second;
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
                let (dx, dy) = event.step();
                if (dx, dy) != (0, 0) {
                    at = PagePoint { x: at.x + dx, y: at.y + dy };
                    assert!(time >= pen_ready, "event {number}: moves while the pen moves");
                    assert!(levels & StepEvent::DRIVERS_ON != 0, "event {number}: drivers off");
                    assert!(
                        (0..=most.0).contains(&at.x) && (0..=most.1).contains(&at.y),
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

/// The greatest change of speed along the path, mm/s², over windows of at least `window` seconds.
///
/// `places` are the path lengths (mm) that the plan has when each move leaves, `times` when it does.
/// The speed between two moves belongs to the time in the middle between them, which is exact for
/// constant acceleration.
pub fn greatest_acceleration(times: &[f64], places: &[f64], window: f64) -> f64 {
    let speeds: Vec<(f64, f64)> = times
        .windows(2)
        .zip(places.windows(2))
        .map(|(t, s)| ((t[0] + t[1]) / 2.0, (s[1] - s[0]) / (t[1] - t[0])))
        .collect();
    let mut greatest = 0.0f64;
    let mut first = 0;
    for (index, &(time, speed)) in speeds.iter().enumerate() {
        while first < index && speeds[first + 1].0 <= time - window {
            first += 1;
        }
        let (before, slower) = speeds[first];
        if time - before >= window {
            greatest = greatest.max((speed - slower).abs() / (time - before));
        }
    }
    greatest
}
