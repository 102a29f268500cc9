//! Backlash: when a motor turns round, its slack is taken up before the move goes on.
//!
//! That is done by steps of their own, from rest to rest. The pen stays where it is, so they count as
//! no way: position, limits and ink know nothing of them. The slack is that of each motor, whatever
//! the build.
//!
//! On which side a motor lies is not known until it has moved: the first move takes up nothing, so the
//! pen may be off by the slack until the machine is homed.

use super::{Machine, Setting};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, PathLength, PushError};

/// How the motors lie in their slack, once all blocks are run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Backlash {
    /// Steps until the motor takes the pen along if it turns up; `None` if that is not known.
    ahead: [Option<i32>; 2],
}

impl Backlash {
    /// The steps to take up before a move by (`dx`, `dy`) steps of motors that have `slack`; they are
    /// taken up from here on.
    fn take_up(&mut self, slack: [i32; 2], way: [i32; 2]) -> [i32; 2] {
        let mut take = |axis: usize| {
            if way[axis] == 0 {
                return 0;
            }
            let (up, ahead, slack) = (way[axis] > 0, &mut self.ahead[axis], slack[axis]);
            let now = ahead.unwrap_or(if up { 0 } else { slack });
            let steps = if up { now } else { now - slack };
            *ahead = Some(now - steps);
            steps
        };
        [take(0), take(1)]
    }

    /// So much of it was not taken up after all.
    fn give_back(&mut self, steps: PagePoint) {
        for (ahead, steps) in self.ahead.iter_mut().zip([steps.x, steps.y]) {
            *ahead = ahead.map(|ahead| ahead.wrapping_add(steps));
        }
    }

    /// The slack itself changes.
    fn resize(&mut self, before: [i32; 2], after: [i32; 2]) {
        for ((ahead, before), after) in self.ahead.iter_mut().zip(before).zip(after) {
            *ahead = ahead.map(|now| if now == before { after } else { now.clamp(0, after) });
        }
    }

    /// Motors that were moved by hand, or are homed now.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
}

impl Machine<'_> {
    /// Steps of slack of each motor.
    pub(super) fn slack_steps(&self) -> [i32; 2] {
        let steps = |slack: Setting, steps_per_mm: Setting| {
            self.settings.millimetres_as_steps(slack, steps_per_mm)
        };
        [
            steps(Setting::BacklashX, Setting::StepsPerMmX),
            steps(Setting::BacklashY, self.settings.steps_per_mm_y()),
        ]
    }

    /// Appends a move of the motors, or first one that takes up their slack: then the other is still to
    /// come. Whether it was the move.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub(super) fn push_motors(
        &mut self,
        piece: &Move,
        ink: Option<LineType>,
        limit: PathLength,
    ) -> Result<bool, PushError> {
        let (motors, end) = (piece.motors, self.runner.end());
        let mut slack = self.slack;
        let [x, y] = slack.take_up(self.slack_steps(), [motors.x - end.x, motors.y - end.y]);
        if (x, y) == (0, 0) {
            self.runner.push(piece, ink, limit)?;
        } else {
            self.runner.push_slack(PagePoint { x, y }, ink)?;
        }
        self.slack = slack;
        Ok((x, y) == (0, 0))
    }

    /// Gives up what waits; the pen stands at `page`.
    pub(super) fn forget_path(&mut self, page: PagePoint) {
        self.slack.give_back(self.runner.slack_ahead());
        self.runner.forget_path(page);
    }

    /// What the pins did not take up of the slack, as they were halted.
    pub(super) fn find_slack(&mut self) -> PagePoint {
        let (x, y) = self.pins.slack();
        let planned = self.runner.slack();
        self.slack
            .give_back(PagePoint { x: planned.x.wrapping_sub(x), y: planned.y.wrapping_sub(y) });
        PagePoint { x, y }
    }

    /// The slack was so many steps.
    pub(super) fn resize_slack(&mut self, before: [i32; 2]) {
        let after = self.slack_steps();
        self.slack.resize(before, after);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slack_is_taken_up_once_each_way() {
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
