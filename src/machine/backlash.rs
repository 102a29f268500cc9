//! Backlash compensation: when a motor reverses, the backlash of its drive is taken up before the
//! next move begins.
//!
//! Separate steps that begin and end at rest take it up. The pen does not move during these steps,
//! so they change neither position nor ink length, and the travel limits ignore them. Within a
//! stroke the pen rests on the paper meanwhile. Before a stroke it is still raised if it may move
//! while the machine does (`$224`, `$225`). Backlash is a property of each motor, in every kind of
//! kinematics. With `$237`, which not every board has, it is taken up while the pen draws
//! (`spread_backlash.rs`).
//!
//! Until a motor has moved, it is unknown on which side of its backlash it is. The first move
//! therefore takes up nothing, and the pen may be off by the backlash until the machine is homed.

use super::{Machine, Setting};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, PushError, SpeedLimit};

/// Where each motor will be within its backlash (the steps that it loses when it reverses) once all
/// planned moves are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Backlash {
    /// For each motor, the steps that it must make upward before it moves the pen; `None` if this
    /// is not known.
    pub(super) ahead: [Option<i32>; 2],
}

impl Backlash {
    /// Returns the steps that take up backlash before a move by `delta` motor steps, for motors
    /// that have `backlash` steps of it. From now on these steps count as taken up.
    fn take_up(&mut self, backlash: [i32; 2], delta: [i32; 2]) -> [i32; 2] {
        let mut take = |axis: usize| {
            if delta[axis] == 0 {
                return 0;
            }
            let (up, ahead, backlash) = (delta[axis] > 0, &mut self.ahead[axis], backlash[axis]);
            let now = ahead.unwrap_or(if up { 0 } else { backlash });
            let steps = if up { now } else { now - backlash };
            *ahead = Some(now - steps);
            steps
        };
        [take(0), take(1)]
    }

    /// Records that `steps` of those returned by `take_up` were not made after all.
    fn give_back(&mut self, steps: PagePoint) {
        for (ahead, steps) in self.ahead.iter_mut().zip([steps.x, steps.y]) {
            *ahead = ahead.map(|ahead| ahead.wrapping_add(steps));
        }
    }

    /// Adapts the state to a change of the backlash from `before` to `after` steps. Without any
    /// before, its side does not tell which way the motor moved last, and is unknown from now on.
    fn resize(&mut self, before: [i32; 2], after: [i32; 2]) {
        for ((ahead, before), after) in self.ahead.iter_mut().zip(before).zip(after) {
            *ahead = match *ahead {
                Some(_) if before == 0 && after != 0 => None,
                Some(now) if now == before => Some(after),
                now => now.map(|now| now.min(after).max(0)),
            };
        }
    }

    /// Forgets on which side of its backlash each motor is, because the motors may have been moved
    /// by hand or are about to be homed.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// How backlash is taken up before a move of the motors.
#[derive(Debug)]
struct TakeUp {
    /// The steps that take it up.
    steps: [i32; 2],
    /// What is known of it behind them.
    behind: Backlash,
    /// The steps of the move itself.
    #[cfg(feature = "spread-backlash")]
    delta: [i32; 2],
}

impl Machine<'_> {
    /// Returns the backlash of each motor: the steps that it loses when it reverses.
    pub(super) fn backlash_steps(&self) -> [i32; 2] {
        let PagePoint { x, y } = self.settings.page_point([Setting::BacklashX, Setting::BacklashY]);
        [x, y]
    }

    /// Appends a move of the motors. If the move needs backlash to be taken up, only the move that
    /// does this is appended, and the caller has to push `segment` again. Returns whether `segment`
    /// itself was appended.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
    pub(super) fn push_motors(
        &mut self,
        segment: &Move<'_>,
        ink: Option<LineType>,
        limit: SpeedLimit,
    ) -> Result<bool, PushError> {
        #[cfg(feature = "spread-backlash")]
        let from = self.runner.motor_steps_end();
        let take_up = if self.has_no_backlash() { None } else { Some(self.take_up(segment)) };
        if let Some(TakeUp { steps: [x, y], .. }) = take_up
            && (x, y) != (0, 0)
        {
            self.runner.push_backlash(PagePoint { x, y }, ink)?;
        } else {
            #[cfg(feature = "spread-backlash")]
            let segment = &self.with_shift(*segment);
            self.runner.push(segment, ink, limit)?;
        }
        let Some(take_up) = take_up else { return Ok(true) };
        #[cfg(feature = "spread-backlash")]
        let before = self.backlash.ahead;
        self.backlash = take_up.behind;
        #[cfg(feature = "spread-backlash")]
        if self.spreads_backlash() {
            self.learn_backlash(before, from, take_up.delta);
        }
        Ok(take_up.steps == [0; 2])
    }

    /// Whether no motor has backlash, and this is known to last. Most machines are set so.
    #[inline(always)] // It is asked for each chord.
    fn has_no_backlash(&self) -> bool {
        let has_none = matches!(self.backlash.ahead, [Some(0), Some(0)])
            && !self.settings.is_on(Setting::BacklashX)
            && !self.settings.is_on(Setting::BacklashY);
        #[cfg(feature = "spread-backlash")]
        let has_none = has_none && !self.spreads_backlash();
        has_none
    }

    /// How backlash is taken up before a move of the motors.
    #[inline(never)] // Machines without backlash do not come here: it would only fill the cache.
    fn take_up(&self, segment: &Move<'_>) -> TakeUp {
        let (motors, end) = (segment.motors, self.motors_end());
        let delta = [motors.x - end.x, motors.y - end.y];
        let mut behind = self.backlash;
        let steps = behind.take_up(self.backlash_steps(), delta);
        TakeUp {
            steps,
            behind,
            #[cfg(feature = "spread-backlash")]
            delta,
        }
    }

    /// Discards the moves that are planned but not yet made. The pen is at `page`.
    pub(super) fn forget_path(&mut self, page: PagePoint) {
        #[cfg(feature = "spread-backlash")]
        let is_settled = self.settle_planned_backlash();
        #[cfg(not(feature = "spread-backlash"))]
        let is_settled = false;
        if !is_settled {
            self.backlash.give_back(self.runner.waiting_backlash());
        }
        self.runner.forget_path(page);
    }

    /// Returns where the planned moves lead the motors, less the backlash taken up while the pen
    /// draws.
    pub(super) fn motors_end(&self) -> PagePoint {
        let end = self.runner.end();
        #[cfg(feature = "spread-backlash")]
        let end = self.end_without_spread_backlash(end);
        end
    }

    /// Forgets on which side of its backlash each motor is.
    pub(super) fn forget_backlash(&mut self) {
        #[cfg(feature = "spread-backlash")]
        self.settle_planned_backlash();
        self.backlash.forget();
        #[cfg(feature = "spread-backlash")]
        self.restart_spread_backlash();
    }

    /// Corrects the state after the pins were halted, so that steps that were planned to take up
    /// backlash were not made. Returns the steps of this kind that the pins have counted.
    pub(super) fn correct_backlash(&mut self) -> PagePoint {
        let (x, y) = self.pins.backlash();
        #[cfg(feature = "spread-backlash")]
        if self.spreads_backlash() {
            // The reversals have already settled the state.
            return PagePoint { x, y };
        }
        let planned = self.runner.backlash();
        self.backlash
            .give_back(PagePoint { x: planned.x.wrapping_sub(x), y: planned.y.wrapping_sub(y) });
        PagePoint { x, y }
    }

    /// Adapts to changed settings; the backlash was `before` steps until now.
    pub(super) fn resize_backlash(&mut self, before: [i32; 2]) {
        let after = self.backlash_steps();
        self.backlash.resize(before, after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backlash_is_taken_up_once_in_each_direction() {
        let mut backlash = Backlash::default();
        let mut take = |x, y| backlash.take_up([10, 4], [x, y]);
        assert_eq!(take(5, 0), [0, 0]);
        assert_eq!(take(1, -7), [0, 0]);
        assert_eq!(take(-1, -1), [-10, 0]);
        assert_eq!(take(-9, 0), [0, 0]);
        assert_eq!(take(3, 3), [10, 4]);
    }

    #[test]
    fn what_was_not_taken_up_is_taken_up_later() {
        let mut backlash = Backlash::default();
        backlash.take_up([10, 4], [1, 1]);
        assert_eq!(backlash.take_up([10, 4], [-1, 1]), [-10, 0]);
        // 7 of the 10 steps were never made.
        backlash.give_back(PagePoint { x: -7, y: 0 });
        assert_eq!(backlash.take_up([10, 4], [1, 1]), [3, 0]);
        backlash.take_up([10, 4], [-1, -1]);
        backlash.resize([10, 4], [20, 0]);
        assert_eq!(backlash.take_up([20, 0], [1, 1]), [20, 0]);
    }

    #[test]
    fn a_motor_that_had_no_backlash_takes_none_up_before_it_reverses() {
        for direction in [1, -1] {
            let mut backlash = Backlash::default();
            backlash.take_up([0, 4], [direction, direction]);
            backlash.resize([0, 4], [40, 4]);
            assert_eq!(backlash.take_up([40, 4], [direction, direction]), [0, 0]);
            assert_eq!(
                backlash.take_up([40, 4], [-direction, -direction]),
                [-40 * direction, -4 * direction]
            );
        }
    }
}
