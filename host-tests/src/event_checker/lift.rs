//! Follows the motor that lifts the pen.

use penup::machine::{Setting, Settings};
use penup::motion::{LiftRule, TICKS_PER_SECOND};

/// The true position of the motor that lifts the pen; the upper stop limits it.
#[derive(Debug)]
pub(super) struct LiftWatch {
    rule: Option<LiftRule>,
    acceleration: f64,
    /// Whether an alarm may stop it at once.
    may_be_cut: bool,
    /// The number of steps below the upper stop. It began at the lowest position.
    pub(super) position: i32,
    /// The time, direction and speed (steps per second) of the last step.
    last: Option<(u64, bool, f64)>,
}

impl LiftWatch {
    pub(super) fn new(settings: &Settings, may_be_cut: bool) -> Self {
        let value = |setting| settings.get(setting).to_num::<f64>();
        let steps = value(Setting::StepsPerMmZ);
        let acceleration = value(Setting::AccelerationZ) * steps;
        let rule = settings.is_on(Setting::Tool).then(|| {
            let (travel, rate) =
                (value(Setting::TravelZ) * steps, value(Setting::MaxRateZ) * steps);
            LiftRule::new(travel as i32, rate as u32, acceleration as u32)
        });
        let position = rule.map_or(0, |rule| rule.travel);
        Self { rule, acceleration, may_be_cut, position, last: None }
    }

    /// Makes one step of the motor.
    ///
    /// # Panics
    /// Panics if there is no such motor, at a step that comes too soon, and at too great an
    /// acceleration.
    pub(super) fn step(&mut self, down: bool, time: u64) {
        let rule = self.rule.expect("a motor lifts the pen");
        self.position = (self.position + if down { 1 } else { -1 }).max(0);
        assert!(self.position <= rule.travel, "{time}: the pen is driven too low");
        let second = f64::from(TICKS_PER_SECOND);
        let mut speed = 0.0;
        if let Some((before, downward, slower)) = self.last {
            let ticks = time - before;
            assert!(ticks >= u64::from(rule.least_ticks), "{time}: the pen is too fast");
            speed = if down == downward { second / ticks as f64 } else { 0.0 };
            let slowest = self.acceleration.sqrt();
            if slower == 0.0 || speed <= slowest {
                let jerks = speed.max(slower) > 1.42 * slowest;
                assert!(!jerks || self.may_be_cut, "{time}: the pen jerks to {speed} steps/s");
            } else {
                // The time between the middles of two successive intervals. Pulses are at whole
                // ticks.
                let change = (speed - slower).abs() * 2.0 / (1.0 / speed + 1.0 / slower);
                let rounding = 2.0 * speed.max(slower).powi(3) / second;
                assert!(change <= 1.02 * self.acceleration + rounding, "{time}: {change} steps/s2");
            }
        }
        self.last = Some((time, down, speed));
    }

    /// Checks where the pen is; `what` is for the message.
    ///
    /// # Panics
    /// Panics if the pen is not at `height`.
    pub(super) fn assert_at(&self, height: u8, what: &str) {
        if let Some(rule) = self.rule {
            assert_eq!(self.position, rule.steps(height), "{what} at height {height}");
        }
    }
}
