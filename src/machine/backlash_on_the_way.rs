//! Slack that is taken up while the pen draws on ([`Setting::BacklashDistance`]).
//!
//! Where a motor turns round within a line, the steps that take up its slack are spread evenly over
//! that distance of the line, and are planned as a part of it: the motors' path is the line and
//! those steps together. So one law of motion limits speed and acceleration of all steps, and the
//! corners that the spread makes are corners as others. While slack is taken up, the pen lags
//! behind the line along the axis of that motor: by no more than the slack that is left, nor than
//! the line has moved on along that axis since it turned. What is left where a line ends is taken
//! up there.
//!
//! Before a stroke, on travels, and in lines with gaps, slack is taken up at rest, as without it.
//!
//! The pins count those steps as others. Where the pen truly is follows from where the motors
//! turned round ([`Turn`](crate::motion::Turn)): a motor moves the pen only at an end of its slack.

use super::{Machine, Segmenter, Setting};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{Move, OnTheWay, PathLength};

/// The slack taken up on the way.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SlackOnTheWay {
    /// Over which distance; 0 for at rest.
    distance: PathLength,
    /// How much of that distance is left of the slack in work.
    left: PathLength,
    /// The steps that are left of it.
    due: [i32; 2],
    /// The directions in which the motors last moved: -1, 0 for none, 1.
    directions: [i32; 2],
    /// How far the motors' planned positions lead beyond those that move the pen.
    shift: [i32; 2],
    /// The slack at the last turn that the pins have begun.
    seen: SlackSeen,
}

/// How the slack of the motors is at an instant.
#[derive(Debug, Clone, Copy, Default)]
struct SlackSeen {
    /// As in [`Backlash`](super::Backlash); 0 if not known.
    ahead: [i32; 2],
    /// All steps of each motor; they wrap.
    motors: [i32; 2],
    /// The same and `ahead`, less the position of the pen: constant.
    sum: [i32; 2],
}

impl SlackSeen {
    /// The motors, with so much slack each, move on to these sums of steps without turning round.
    fn pass(&mut self, motors: [i32; 2], slack: [i32; 2]) {
        let moved = self.motors.zip_with(motors, |from, to| to.wrapping_sub(from));
        let ahead = self.ahead.zip_with(moved, i32::saturating_sub);
        self.ahead = ahead.zip_with(slack, |ahead, slack| ahead.min(slack).max(0));
        self.motors = motors;
    }

    /// The positions of the motors that move the pen to where it is.
    fn position(&self) -> PagePoint {
        let motors = self.motors.zip_with(self.ahead, i32::wrapping_add);
        let [x, y] = motors.zip_with(self.sum, i32::wrapping_sub);
        PagePoint { x, y }
    }
}

/// Two values, one of each motor.
trait Pair<T> {
    /// Those that `make` makes of both.
    fn zip_with<U, V>(self, other: [U; 2], make: impl Fn(T, U) -> V) -> [V; 2];
}

impl<T> Pair<T> for [T; 2] {
    fn zip_with<U, V>(self, other: [U; 2], make: impl Fn(T, U) -> V) -> [V; 2] {
        let ([x, y], [other_x, other_y]) = (self, other);
        [make(x, other_x), make(y, other_y)]
    }
}

impl Machine<'_> {
    /// Whether slack is taken up on the way at all.
    pub(super) fn spreads_slack(&self) -> bool {
        self.on_the_way.distance > 0
    }

    /// The slack of each motor; 0 as long as it is not known on which side a motor lies.
    fn known_slack(&self) -> [i32; 2] {
        self.slack.ahead.zip_with(self.slack_steps(), |ahead, slack| ahead.map_or(0, |_| slack))
    }

    /// The slack where the pins are.
    fn slack_at_pins(&self) -> SlackSeen {
        let ((x, y), slack) = (self.pins.steps(), self.pins.slack());
        let motors = [
            self.origin.x.wrapping_add(x).wrapping_add(slack.0),
            self.origin.y.wrapping_add(y).wrapping_add(slack.1),
        ];
        let (mut seen, ticks, slack) =
            (self.on_the_way.seen, self.pins.ticks(), self.known_slack());
        for turn in self.runner.turns().take_while(|turn| turn.has_begun(ticks)) {
            seen.pass(turn.motors, slack);
        }
        seen.pass(motors, slack);
        seen
    }

    /// The slack where the events planned so far end.
    fn slack_planned(&self) -> SlackSeen {
        let (mut seen, slack) = (self.on_the_way.seen, self.known_slack());
        for turn in self.runner.turns() {
            seen.pass(turn.motors, slack);
        }
        seen.pass(self.runner.motor_steps(), slack);
        seen
    }

    /// The positions of the motors at the pins, less the slack that they took up on the way.
    pub(super) fn without_slack(&self, motors: PagePoint) -> PagePoint {
        if self.spreads_slack() { self.slack_at_pins().position() } else { motors }
    }

    /// The same where the events planned so far end.
    pub(super) fn planned_without_slack(&self, motors: PagePoint) -> PagePoint {
        if self.spreads_slack() { self.slack_planned().position() } else { motors }
    }

    /// The positions to which the planned moves lead the motors, less that slack.
    pub(super) fn end_without_slack(&self, end: PagePoint) -> PagePoint {
        let [x, y] = self.on_the_way.shift;
        PagePoint { x: end.x.wrapping_sub(x), y: end.y.wrapping_sub(y) }
    }

    /// Follows the turns that the pins have begun.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn follow_slack(&mut self) {
        let (ticks, slack) = (self.pins.ticks(), self.known_slack());
        while let Some(turn) = self.runner.next_turn_begun(ticks) {
            self.on_the_way.seen.pass(turn.motors, slack);
        }
    }

    /// What is planned behind the events so far is not made: the slack is as they leave it.
    /// Returns whether that is known by the turns.
    pub(super) fn settle_slack_planned(&mut self) -> bool {
        if self.spreads_slack() {
            let seen = self.slack_planned();
            let (at, position) = (self.runner.position(), seen.position());
            self.settle_slack(seen.ahead);
            self.on_the_way.shift = [at.x.wrapping_sub(position.x), at.y.wrapping_sub(position.y)];
        }
        self.spreads_slack()
    }

    /// What is planned behind the pins is not made: the slack is as they left it.
    pub(super) fn settle_slack_at_pins(&mut self) {
        if self.spreads_slack() {
            self.settle_slack(self.slack_at_pins().ahead);
        }
    }

    fn settle_slack(&mut self, at: [i32; 2]) {
        self.slack.ahead = self.slack.ahead.zip_with(at, |ahead, at| ahead.map(|_| at));
        let way = &mut self.on_the_way;
        (way.left, way.due, way.directions) = (PathLength::ZERO, [0; 2], [0; 2]);
    }

    /// Begins anew to follow the slack, of which the present state is known, while nothing moves.
    pub(super) fn follow_slack_anew(&mut self) {
        let distance = self.settings.backlash_distance();
        let motors = self.runner.motor_steps();
        let at = self.runner.position();
        let ahead = self.slack.ahead.map(|ahead| ahead.unwrap_or(0));
        let position = [at.x, at.y].zip_with(self.on_the_way.shift, i32::wrapping_sub);
        let sum = motors.zip_with(ahead, i32::wrapping_add).zip_with(position, i32::wrapping_sub);
        let way = &mut self.on_the_way;
        (way.distance, way.left, way.due) = (distance, PathLength::ZERO, [0; 2]);
        way.seen = SlackSeen { ahead, motors, sum };
        self.runner.keep_turns(distance > 0);
    }

    /// The motors' positions are those that move the pen, from now on.
    pub(super) fn forget_shift(&mut self) {
        self.on_the_way.shift = [0; 2];
    }

    /// The motors move by `delta`, all steps of each having been `from` and its slack `before`.
    /// That may be the first that is known of their slack.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn learn_slack(
        &mut self,
        before: [Option<i32>; 2],
        from: [i32; 2],
        delta: [i32; 2],
    ) {
        let SlackOnTheWay { directions, seen, .. } = &mut self.on_the_way;
        *directions = directions.zip_with(delta, direction);
        let SlackSeen { ahead, motors, sum } = seen;
        // What becomes known now.
        let news =
            before.zip_with(self.slack.ahead, |before, now| now.filter(|_| before.is_none()));
        *sum = sum.zip_with(news, |sum, news| sum.wrapping_add(news.unwrap_or(0)));
        *ahead = ahead.zip_with(news, |ahead, news| news.unwrap_or(ahead));
        let from = from.zip_with(news, |from, news| news.map(|_| from));
        *motors = motors.zip_with(from, |motors, from| from.unwrap_or(motors));
    }

    /// A move whose motors lead as far beyond as the slack taken up on the way.
    pub(super) fn with_slack(&self, segment: Move) -> Move {
        let [x, y] = self.on_the_way.shift;
        let PagePoint { x: to_x, y: to_y } = segment.motors;
        Move { motors: PagePoint { x: to_x.wrapping_add(x), y: to_y.wrapping_add(y) }, ..segment }
    }

    /// Appends the next part of a line on which slack is taken up on the way, or what is left of
    /// the slack where a line has ended. There is room. Returns whether there was any.
    #[inline]
    pub(super) fn push_on_the_way(&mut self, segmenter: &Segmenter) -> bool {
        self.spreads_slack() && self.push_spread(segmenter)
    }

    /// The same where slack is taken up on the way at all.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    fn push_spread(&mut self, segmenter: &Segmenter) -> bool {
        if !self.runner.is_in_line() || segmenter.ink != Some(LineType::Full) {
            return self.push_slack_due();
        }
        let Segmenter { from, to, length, position, limit, .. } = *segmenter;
        let (kinematics, slack, end) =
            (self.settings.kinematics(), self.slack_steps(), self.motors_end());
        let target = kinematics.motors(to);
        let delta = [target.x - end.x, target.y - end.y];
        let ahead =
            self.slack.ahead.zip_with(delta.zip_with(slack, |delta, slack| [delta, slack]), {
                |ahead, [delta, slack]| match delta.signum() {
                    1 => ahead.or(Some(0)),
                    -1 => ahead.or(Some(slack)),
                    _ => ahead,
                }
            });
        if ahead != self.slack.ahead {
            let before = core::mem::replace(&mut self.slack.ahead, ahead);
            self.learn_slack(before, self.runner.motor_steps_end(), [0; 2]);
        }
        let mut way = self.on_the_way;
        // Only of motors with slack.
        let delta = delta.zip_with(self.known_slack(), |delta, slack| delta * slack.signum());
        let before = way.directions;
        way.directions = before.zip_with(delta, direction);
        let turns = before != way.directions;
        let ahead = self.slack.ahead.map(|ahead| ahead.unwrap_or(0));
        let due = way.directions.zip_with(ahead.zip_with(slack, |ahead, slack| [ahead, slack]), {
            |direction, [ahead, slack]| match direction {
                1 => ahead,
                -1 => ahead - slack,
                _ => 0,
            }
        });
        if due == [0; 2] && !turns {
            return false;
        }
        if turns || way.left == 0 {
            way.left = way.distance;
        }
        let rest = length.saturating_sub(position);
        let piece = rest.min(way.left);
        let share = due.map(|steps| {
            let part = i64::from(steps) * i64::from(piece.to_bits());
            // Steps, and so less than 2^31.
            part.checked_div(way.left.to_bits().into()).unwrap_or(0) as i32
        });
        let page = if piece == rest {
            to
        } else {
            let at = i64::from((position + piece).to_bits());
            let along = |from: i32, to: i32| {
                let whole = i64::from(length.to_bits());
                let part = (2 * i64::from(to - from) * at + whole).checked_div_euclid(2 * whole);
                from + part.unwrap_or(0) as i32
            };
            PagePoint { x: along(from.x, to.x), y: along(from.y, to.y) }
        };
        let motors = kinematics.motors(page);
        let by = [motors.x - end.x, motors.y - end.y].zip_with(share, i32::wrapping_add);
        if !self.push_with_slack(by, page, piece, turns, limit) {
            return false;
        }
        way.left = way.left.saturating_sub(piece);
        way.due = due.zip_with(share, i32::wrapping_sub);
        self.count_slack(way, share);
        let position = position + piece;
        self.segmenter = (position < length).then_some(Segmenter { position, ..*segmenter });
        true
    }

    /// Appends what is left of the slack where a line has ended, which draws what the pen lags
    /// behind. There is room. Returns whether there was any.
    pub(super) fn push_slack_due(&mut self) -> bool {
        let mut way = self.on_the_way;
        let due = core::mem::take(&mut way.due);
        way.left = PathLength::ZERO;
        if due == [0; 2] || !self.runner.is_in_line() {
            return false;
        }
        let page = self.runner.page_end();
        let pushed = self.push_with_slack(due, page, PathLength::ZERO, false, PathLength::MAX);
        if pushed {
            self.count_slack(way, due);
        }
        pushed
    }

    /// These steps of the motors lead the pen to `page`, which draws a line of `drawn`.
    fn push_with_slack(
        &mut self,
        by: [i32; 2],
        page: PagePoint,
        drawn: PathLength,
        turns: bool,
        limit: PathLength,
    ) -> bool {
        // These kinds of kinematics are linear.
        let [x, y] = by;
        let way = self.settings.kinematics().page(PagePoint { x, y });
        let Some(length) = self.runner.limits().length(way.x, way.y) else { return false };
        let end = self.runner.end();
        let motors = PagePoint { x: end.x.wrapping_add(x), y: end.y.wrapping_add(y) };
        let (offsets, way, is_gap) = ([0; 2], (way.x, way.y), false);
        let piece = Move { motors, offsets, page, way, whole: length, length, is_gap };
        self.runner.set_on_the_way(OnTheWay { turns, extra: length.saturating_sub(drawn) });
        let pushed = self.runner.push(&piece, Some(LineType::Full), limit).is_ok();
        self.runner.set_on_the_way(OnTheWay::default());
        pushed
    }

    /// So many steps were appended that take up slack.
    fn count_slack(&mut self, way: SlackOnTheWay, steps: [i32; 2]) {
        self.on_the_way = way;
        self.on_the_way.shift = way.shift.zip_with(steps, i32::wrapping_add);
        let made = |ahead: Option<i32>, steps| ahead.map(|ahead| ahead - steps);
        self.slack.ahead = self.slack.ahead.zip_with(steps, made);
    }
}

/// The direction of a motor that moves by `delta`, and `before` moved in a direction.
fn direction(before: i32, delta: i32) -> i32 {
    if delta == 0 { before } else { delta.signum() }
}

impl super::Settings {
    /// The distance over which slack is taken up; 0 for at rest.
    fn backlash_distance(&self) -> PathLength {
        // A unit of the setting is four units of the length.
        PathLength::from_bits(self.get(Setting::BacklashDistance).to_bits().unsigned_abs() << 2)
    }
}
