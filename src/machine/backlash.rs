//! Backlash compensation: when a motor reverses, the slack of its drive is taken up before the next
//! move begins.
//!
//! The slack is taken up by separate steps that begin and end at rest. The pen does not move during
//! these steps. So they change neither position nor ink length, and the travel limits ignore them.
//! Within a stroke the pen stands on the paper during them. Before one it is still raised if it may
//! move while the machine does (`$224`, `$225`). The slack is a property of each motor, in every
//! kind of kinematics. With `$237`, which not every board has, it is taken up on the way instead
//! (`backlash_on_the_way.rs`).
//!
//! Until a motor has moved, it is unknown on which side of its slack it is. The first move
//! therefore takes up nothing, and the pen may be off by the slack until the machine is homed.

use super::{Machine, Setting};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, PathLength, PushError};

/// Where each motor is within its slack (the steps that it loses when it reverses) once all planned
/// moves are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Backlash {
    /// For each motor, the steps that it must make upward before it moves the pen; `None` if this
    /// is not known.
    pub(super) ahead: [Option<i32>; 2],
}

impl Backlash {
    /// Returns the steps that take up the slack of the drives before a move by `delta` motor steps,
    /// for motors that have `slack` steps of it. From now on these steps count as taken up.
    fn take_up(&mut self, slack: [i32; 2], delta: [i32; 2]) -> [i32; 2] {
        let mut take = |axis: usize| {
            if delta[axis] == 0 {
                return 0;
            }
            let (up, ahead, slack) = (delta[axis] > 0, &mut self.ahead[axis], slack[axis]);
            let now = ahead.unwrap_or(if up { 0 } else { slack });
            let steps = if up { now } else { now - slack };
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

    /// Adapts the state to a change of the slack from `before` to `after` steps.
    fn resize(&mut self, before: [i32; 2], after: [i32; 2]) {
        for ((ahead, before), after) in self.ahead.iter_mut().zip(before).zip(after) {
            *ahead = ahead.map(|now| if now == before { after } else { now.min(after).max(0) });
        }
    }

    /// Forgets on which side of its slack each motor is, because the motors may have been moved by
    /// hand or are about to be homed.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Machine<'_> {
    /// Returns the slack of each motor: the steps that it loses when it reverses.
    pub(super) fn slack_steps(&self) -> [i32; 2] {
        let PagePoint { x, y } = self.settings.page_point([Setting::BacklashX, Setting::BacklashY]);
        [x, y]
    }

    /// Appends a move of the motors. If the move needs slack to be taken up, only the move that
    /// does this is appended, and the caller has to push `segment` again. Returns whether `segment`
    /// itself was appended.
    ///
    /// # Errors
    /// See [`PushError`]. On an error nothing is appended.
    pub(super) fn push_motors(
        &mut self,
        segment: &Move,
        ink: Option<LineType>,
        limit: PathLength,
    ) -> Result<bool, PushError> {
        let (motors, end) = (segment.motors, self.motors_end());
        let delta = [motors.x - end.x, motors.y - end.y];
        let mut slack = self.slack;
        // Most drives are set to have none, which is then known of both.
        let has_none = slack.ahead == [Some(0); 2]
            && !self.settings.is_on(Setting::BacklashX)
            && !self.settings.is_on(Setting::BacklashY);
        let [x, y] = if has_none { [0; 2] } else { slack.take_up(self.slack_steps(), delta) };
        #[cfg(feature = "backlash-on-the-way")]
        let (before, from) = (self.slack.ahead, self.runner.motor_steps_end());
        if (x, y) == (0, 0) {
            #[cfg(feature = "backlash-on-the-way")]
            let segment = &self.with_slack(*segment);
            self.runner.push(segment, ink, limit)?;
        } else {
            self.runner.push_slack(PagePoint { x, y }, ink)?;
        }
        self.slack = slack;
        #[cfg(feature = "backlash-on-the-way")]
        if self.spreads_slack() {
            self.learn_slack(before, from, delta);
        }
        Ok((x, y) == (0, 0))
    }

    /// Discards the moves that are planned but not yet made. The pen is at `page`.
    pub(super) fn forget_path(&mut self, page: PagePoint) {
        #[cfg(feature = "backlash-on-the-way")]
        let is_settled = self.settle_slack_planned();
        #[cfg(not(feature = "backlash-on-the-way"))]
        let is_settled = false;
        if !is_settled {
            self.slack.give_back(self.runner.slack_ahead());
        }
        self.runner.forget_path(page);
    }

    /// Returns where the planned moves lead the motors, less the slack taken up on the way.
    pub(super) fn motors_end(&self) -> PagePoint {
        let end = self.runner.end();
        #[cfg(feature = "backlash-on-the-way")]
        let end = self.end_without_slack(end);
        end
    }

    /// Forgets on which side of its slack each motor is.
    pub(super) fn forget_slack(&mut self) {
        #[cfg(feature = "backlash-on-the-way")]
        self.settle_slack_planned();
        self.slack.forget();
        #[cfg(feature = "backlash-on-the-way")]
        self.follow_slack_anew();
    }

    /// Corrects the state by the slack steps that were planned but never made because the pins were
    /// halted. Returns the slack steps that the pins have counted.
    pub(super) fn find_slack(&mut self) -> PagePoint {
        let (x, y) = self.pins.slack();
        #[cfg(feature = "backlash-on-the-way")]
        if self.spreads_slack() {
            // It is settled by the turns.
            return PagePoint { x, y };
        }
        let planned = self.runner.slack();
        self.slack
            .give_back(PagePoint { x: planned.x.wrapping_sub(x), y: planned.y.wrapping_sub(y) });
        PagePoint { x, y }
    }

    /// Adapts to changed settings; the slack was `before` steps until now.
    pub(super) fn resize_slack(&mut self, before: [i32; 2]) {
        let after = self.slack_steps();
        self.slack.resize(before, after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backlash_is_taken_up_once_in_each_direction() {
        let mut slack = Backlash::default();
        let mut take = |x, y| slack.take_up([10, 4], [x, y]);
        assert_eq!(take(5, 0), [0, 0]);
        assert_eq!(take(1, -7), [0, 0]);
        assert_eq!(take(-1, -1), [-10, 0]);
        assert_eq!(take(-9, 0), [0, 0]);
        assert_eq!(take(3, 3), [10, 4]);
    }

    #[test]
    fn what_was_not_taken_up_is_taken_up_later() {
        let mut slack = Backlash::default();
        slack.take_up([10, 4], [1, 1]);
        assert_eq!(slack.take_up([10, 4], [-1, 1]), [-10, 0]);
        // 7 of the 10 steps were never made.
        slack.give_back(PagePoint { x: -7, y: 0 });
        assert_eq!(slack.take_up([10, 4], [1, 1]), [3, 0]);
        slack.take_up([10, 4], [-1, -1]);
        slack.resize([10, 4], [20, 0]);
        assert_eq!(slack.take_up([20, 0], [1, 1]), [20, 0]);
    }
}
