//! The pen on a motor of its own: from rest to rest, so that it lands softly.
//!
//! Its steps count down from an upper stop. Where that is, is not known after the motor had no
//! current: then the pen is first driven up by more than its travel, slowly, against the stop.
//!
//! Each pulse leaves in the middle of its step: step n from a rest, from 0, leaves √((2n + 1)/a)
//! after it.

use super::TICKS_PER_SECOND;

/// The motor of the pen, as far as motion needs to know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiftRule {
    /// Steps from the upper stop to height 127: 1 to 2^18.
    pub travel: i32,
    /// The least ticks from one step to the next.
    pub least_ticks: u32,
    /// The square of the ticks in which acceleration brings a steps-per-tick up: (ticks per
    /// second)²/(steps/s²).
    pub square: u64,
}

impl LiftRule {
    /// For `travel` steps, below 2^18, at most `rate` steps a second (1 at least), `acceleration`
    /// steps/s² (20 at least).
    pub fn new(travel: i32, rate: u32, acceleration: u32) -> Self {
        let second = u64::from(TICKS_PER_SECOND);
        Self {
            travel: travel.max(1),
            least_ticks: TICKS_PER_SECOND.div_ceil(rate.max(1)),
            // Below 2^45.
            square: second * second / u64::from(acceleration.max(20)),
        }
    }

    /// Steps below the stop at a height of the pen, 0 to 127.
    pub fn steps(self, height: u8) -> i32 {
        // Below 2^25.
        self.travel * i32::from(height) / 127
    }

    /// Ticks from a rest over so many half steps: below 2^24 for one, below 2^32 for 2^19.
    fn ticks_over(self, half_steps: i32) -> u32 {
        (u64::from(half_steps.unsigned_abs()) * self.square).isqrt() as u32
    }
}

/// Where the pen's motor is and where it goes.
#[derive(Debug, Default)]
pub(super) struct Lift {
    /// The sum of all steps planned; wraps.
    place: i32,
    /// Where the move in work began and where it ends.
    from: i32,
    to: i32,
    /// That sum at the upper stop.
    top: Option<i32>,
    /// Until the pins have worked off so many ticks, they have not been there.
    found_at: Option<u32>,
}

/// What the motor does next: a direction alone, or a step. Then so many ticks pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LiftStep {
    pub(super) step: bool,
    pub(super) down: bool,
    pub(super) ticks: u32,
}

impl Lift {
    /// A search for the stop is as much slower as this, and as much longer than the travel as 1/8.
    const SLOWER: u32 = 4;

    /// Whether it is known where the stop is.
    pub(super) fn is_known(&self) -> bool {
        self.top.is_some()
    }

    /// The motor had no current, or another travel is in force.
    pub(super) fn forget(&mut self) {
        (self.top, self.found_at) = (None, None);
    }

    /// The stop was found, by the plan, by the event that begins after `ticks`.
    pub(super) fn found(&mut self, ticks: u32) {
        self.found_at = Some(ticks);
    }

    /// The pins have worked off so many ticks.
    pub(super) fn sync_consumed(&mut self, ticks: u32) {
        self.found_at = self.found_at.filter(|at| ticks.wrapping_sub(*at).cast_signed() <= 0);
    }

    /// The pulses so far sum up to `place`, and nothing waits.
    pub(super) fn stand_at(&mut self, place: i32) {
        (self.place, self.from, self.to) = (place, place, place);
        if self.found_at.is_some() {
            self.forget();
        }
    }

    /// The next step on the way to `height`; `None` if the pen is there.
    pub(super) fn next(&mut self, rule: LiftRule, height: u8) -> Option<LiftStep> {
        if self.place == self.to {
            self.to = match self.top {
                Some(top) => top.wrapping_add(rule.steps(height)),
                None => self.place.wrapping_sub(rule.travel + rule.travel / 8 + 1),
            };
            self.from = self.place;
            let down = self.to.wrapping_sub(self.from) > 0;
            let ticks = rule.ticks_over(1);
            return (self.to != self.from).then_some(LiftStep { step: false, down, ticks });
        }
        let way = self.to.wrapping_sub(self.from);
        let down = way > 0;
        let done = self.place.wrapping_sub(self.from).abs();
        self.place = self.place.wrapping_add(way.signum());
        // The steps from the rests to the two pulses.
        let left = way.abs() - 2 - done;
        let within = 2 * done.min(left) + 1;
        let slower = if self.top.is_none() { Self::SLOWER } else { 1 };
        let ticks = if left < 0 {
            self.top = self.top.or(Some(self.place));
            rule.ticks_over(1)
        } else {
            let planned = match rule.ticks_over(within) {
                // The top speed is reached between the two.
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
        let rule = LiftRule::new(800, 2000, 20_000);
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
            let rule = LiftRule::new(steps, rate, acceleration);
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
            // When and where, and how fast in the middle of the way there.
            let (mut before, mut slower) = ((0.0, 0.0), (0.0, 0.0));
            for &(at, place) in places.iter().chain(&[(time, f64::from(steps))]) {
                let (middle, speed) = ((before.0 + at) / 2.0, (place - before.1) / (at - before.0));
                assert!(speed <= 1.001 * f64::from(rate));
                let change = (speed - slower.1) / (middle - slower.0);
                // Pulses are at whole ticks.
                let rounding = 2.0 * speed.powi(3) / f64::from(TICKS_PER_SECOND);
                let most = 1.02 * f64::from(acceleration) + rounding;
                assert!(change.abs() <= most, "{steps}: {change}");
                (before, slower) = ((at, place), (middle, speed));
            }
        }
    }

    #[test]
    fn a_move_that_was_cut_short_goes_on_from_where_the_pins_are() {
        let rule = LiftRule::new(800, 2000, 20_000);
        let mut lift = Lift::default();
        run(&mut lift, rule, 0);
        for _ in 0..301 {
            lift.next(rule, 127);
        }
        // The last 3 of the 300 steps never left.
        lift.stand_at(-901 + 297);
        assert_eq!(run(&mut lift, rule, 0).iter().filter(|next| next.step).count(), 297);
        lift.forget();
        assert_eq!(run(&mut lift, rule, 0).iter().filter(|next| next.step).count(), 901);
    }
}
