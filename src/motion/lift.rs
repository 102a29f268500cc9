//! The motor that lifts the pen. Each of its moves is planned from rest to rest, so that the pen
//! lands softly.
//!
//! Its steps count downward from an upper stop. The position of this stop is unknown after the
//! motor had no current. Then the pen is first driven up slowly, against the stop, by more than its
//! travel.
//!
//! Each pulse leaves in the middle of its step: step n after a rest, counted from 0, leaves √((2n +
//! 1)/a) after it.

use super::{StepEvent, TICKS_PER_SECOND};

/// The properties of the pen's motor that motion needs to know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiftRule {
    /// The steps from the upper stop to height 127: 1 to 2^18.
    pub travel: i32,
    /// The least ticks from one step to the next.
    pub least_ticks: u32,
    /// The square of the ticks in which the acceleration reaches a speed of one step per tick:
    /// (ticks per second)² / (steps/s²).
    pub square: u64,
}

impl LiftRule {
    /// The rule for `travel` steps (below 2^18), at most `rate` steps a minute (at least 1), and an
    /// `acceleration` in steps/s² (at least 20).
    pub fn new(travel: i32, rate: u32, acceleration: u32) -> Self {
        const TICKS_PER_MINUTE: u32 = 60 * TICKS_PER_SECOND;
        let second = u64::from(TICKS_PER_SECOND);
        Self {
            travel: travel.max(1),
            least_ticks: TICKS_PER_MINUTE.div_ceil(rate.max(1)),
            // The square is below 2^45.
            square: second * second / u64::from(acceleration.max(20)),
        }
    }

    /// The number of steps below the stop at which the pen has a `height` of 0 to 127.
    pub fn steps(self, height: u8) -> i32 {
        // The product is below 2^25.
        self.travel * i32::from(height) / 127
    }

    /// The ticks that this many half steps take from rest: below 2^24 for one, below 2^32 for 2^19.
    fn ticks_over(self, half_steps: i32) -> u32 {
        (u64::from(half_steps.unsigned_abs()) * self.square).isqrt() as u32
    }
}

/// The position of the pen's motor and its current move.
#[derive(Debug, Default)]
pub(super) struct Lift {
    /// The sum of all planned steps; wraps.
    position: i32,
    /// The position at which the current move began.
    from: i32,
    /// The position at which the current move ends.
    to: i32,
    /// The position of the upper stop, if it is known.
    top: Option<i32>,
    /// While the pins have not yet carried out events of this many ticks, the motor has not yet
    /// been driven against the stop.
    found_at: Option<u32>,
    /// The ticks that must still pass before the next action. A slow step takes more of them than
    /// one event can last.
    wait: u32,
}

/// The next action of the motor: a step, or a level of the direction pin, after which `ticks` pass,
/// no more than an event can last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LiftStep {
    pub(super) step: bool,
    pub(super) down: bool,
    pub(super) ticks: u32,
}

impl Lift {
    /// How many times slower the motor moves while it searches for the stop. The search is longer
    /// than the travel by 1/8.
    const SLOWER: u32 = 4;

    /// Whether the position of the stop is known.
    pub(super) fn is_known(&self) -> bool {
        self.top.is_some()
    }

    /// Forgets the position of the stop, because the motor had no current or its travel was
    /// changed.
    pub(super) fn forget(&mut self) {
        (self.top, self.found_at) = (None, None);
    }

    /// Records that the plan has reached the stop, with the event that begins after `ticks`.
    pub(super) fn found(&mut self, ticks: u32) {
        self.found_at = Some(ticks);
    }

    /// Records that the pins have carried out events of this many ticks.
    pub(super) fn sync_consumed(&mut self, ticks: u32) {
        self.found_at = self.found_at.filter(|at| ticks.wrapping_sub(*at).cast_signed() <= 0);
    }

    /// Sets the position to the sum of the pulses so far. No pulse may wait.
    pub(super) fn set_position(&mut self, position: i32) {
        (self.position, self.from, self.to) = (position, position, position);
        self.wait = 0;
        if self.found_at.is_some() {
            self.forget();
        }
    }

    /// Returns the next action on the way to `height`; `None` if the pen is there.
    pub(super) fn next(&mut self, rule: LiftRule, height: u8) -> Option<LiftStep> {
        let mut next = if self.wait > 0 {
            let down = self.to.wrapping_sub(self.from) > 0;
            LiftStep { step: false, down, ticks: core::mem::take(&mut self.wait) }
        } else {
            self.begin_next(rule, height)?
        };
        // The rest of the wait goes on without a step.
        self.wait = next.ticks.saturating_sub(StepEvent::MAX_TICKS);
        next.ticks -= self.wait;
        Some(next)
    }

    /// Returns the next action with its whole wait, however long that is.
    fn begin_next(&mut self, rule: LiftRule, height: u8) -> Option<LiftStep> {
        if self.position == self.to {
            self.to = match self.top {
                Some(top) => top.wrapping_add(rule.steps(height)),
                None => self.position.wrapping_sub(rule.travel + rule.travel / 8 + 1),
            };
            self.from = self.position;
            let down = self.to.wrapping_sub(self.from) > 0;
            let ticks = rule.ticks_over(1);
            return (self.to != self.from).then_some(LiftStep { step: false, down, ticks });
        }
        let distance = self.to.wrapping_sub(self.from);
        let down = distance > 0;
        let done = self.position.wrapping_sub(self.from).abs();
        self.position = self.position.wrapping_add(distance.signum());
        // The steps between this pulse and the end of the move.
        let left = distance.abs() - 2 - done;
        let within = 2 * done.min(left) + 1;
        let slower = if self.top.is_none() { Self::SLOWER } else { 1 };
        let ticks = if left < 0 {
            self.top = self.top.or(Some(self.position));
            rule.ticks_over(1)
        } else {
            let planned = match rule.ticks_over(within) {
                // The motor is fastest in the middle of this interval.
                before if done == left => 2 * (rule.ticks_over(within + 1) - before),
                before => rule.ticks_over(within + 2) - before,
            };
            planned.max(rule.least_ticks.saturating_mul(slower))
        };
        Some(LiftStep { step: true, down, ticks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(lift: &mut Lift, rule: LiftRule, height: u8) -> std::vec::Vec<LiftStep> {
        core::iter::from_fn(|| lift.next(rule, height)).collect()
    }

    #[test]
    fn the_first_move_finds_the_stop_and_later_ones_the_height() {
        let rule = LiftRule::new(800, 120_000, 20_000);
        let mut lift = Lift::default();
        let moves = run(&mut lift, rule, 0);
        assert_eq!(moves.iter().filter(|next| next.step).count(), 901);
        assert!(moves.iter().all(|next| !next.down && next.ticks >= 4 * rule.least_ticks));
        let moves = run(&mut lift, rule, 127);
        assert_eq!(moves.iter().filter(|next| next.step).count(), 800);
        assert!(moves.iter().all(|next| next.down));
        assert_eq!(run(&mut lift, rule, 127), []);
        // 64 of 127 heights.
        assert_eq!(run(&mut lift, rule, 63).iter().filter(|next| next.step).count(), 800 - 396);
    }

    #[test]
    fn from_rest_to_rest_within_rate_and_acceleration() {
        for (steps, rate, acceleration) in
            [(1, 500, 1000), (2, 500, 1000), (3, 500, 1000), (40, 9000, 1000), (5000, 3000, 20_000)]
        {
            let rule = LiftRule::new(steps, 60 * rate, acceleration);
            let mut lift = Lift { top: Some(0), ..Lift::default() };
            let moves = run(&mut lift, rule, 127);
            let mut time = 0.0;
            let mut places = std::vec![];
            for (number, next) in moves.iter().enumerate() {
                if next.step {
                    places.push((time, number as f64 - 0.5));
                }
                time += f64::from(next.ticks) / f64::from(TICKS_PER_SECOND);
            }
            // The times and positions, and the speed in the middle between two of them.
            let (mut before, mut slower) = ((0.0, 0.0), (0.0, 0.0));
            for &(at, position) in places.iter().chain(&[(time, f64::from(steps))]) {
                let (middle, speed) =
                    ((before.0 + at) / 2.0, (position - before.1) / (at - before.0));
                assert!(speed <= 1.001 * f64::from(rate));
                let change = (speed - slower.1) / (middle - slower.0);
                // Pulses are at whole ticks.
                let rounding = 2.0 * speed.powi(3) / f64::from(TICKS_PER_SECOND);
                let most = 1.02 * f64::from(acceleration) + rounding;
                assert!(change.abs() <= most, "{steps}: {change}");
                (before, slower) = ((at, position), (middle, speed));
            }
        }
    }

    #[test]
    fn a_step_that_lasts_longer_than_an_event_takes_several() {
        // Two steps a minute, and eight times as long in the search for the stop.
        let rule = LiftRule::new(8, 2, 20);
        let mut lift = Lift::default();
        for (height, steps, minutes_per_step) in [(0, 10, 2), (127, 8, 0)] {
            let moves = run(&mut lift, rule, height);
            assert!(moves.iter().all(|next| next.ticks <= StepEvent::MAX_TICKS));
            assert_eq!(moves.iter().filter(|next| next.step).count(), steps);
            let between = u64::from(minutes_per_step * 60 * TICKS_PER_SECOND).max(750_000_000);
            let mut waits = std::vec![0];
            for next in moves {
                if next.step {
                    waits.push(0);
                }
                *waits.last_mut().expect("a wait") += u64::from(next.ticks);
            }
            assert!(waits[1..steps].iter().all(|&wait| wait == between), "{waits:?}");
        }
        // An abort in the middle of a wait forgets it.
        lift.next(rule, 0);
        lift.next(rule, 0);
        lift.set_position(-3);
        assert_eq!(lift.next(rule, 0).map(|next| next.step), Some(false));
        assert_eq!(lift.next(rule, 0).map(|next| next.step), Some(true));
    }

    #[test]
    fn a_move_that_was_cut_short_goes_on_from_where_the_pins_are() {
        let rule = LiftRule::new(800, 120_000, 20_000);
        let mut lift = Lift::default();
        run(&mut lift, rule, 0);
        for _ in 0..301 {
            lift.next(rule, 127);
        }
        // The last 3 of the 300 steps never left.
        lift.set_position(-901 + 297);
        assert_eq!(run(&mut lift, rule, 0).iter().filter(|next| next.step).count(), 297);
        lift.forget();
        assert_eq!(run(&mut lift, rule, 0).iter().filter(|next| next.step).count(), 901);
    }
}
