//! Backlash that is taken up while the pen draws ([`Setting::BacklashDistance`]).
//!
//! Where a motor reverses within a line, the steps that take up its backlash are spread evenly over
//! that distance of the line. They are planned as a part of the line: the motors follow the sum of
//! the line and these steps. So the planner limits the speed and acceleration of all steps alike,
//! and treats the corners that result like any others. While backlash is taken up, the pen lags
//! behind the line along the axis of that motor. It never lags by more than the backlash that is
//! left, nor by more than the line has moved along that axis since the reversal. What is left at
//! the end of a line is taken up there.
//!
//! Before a stroke, on travels, and in lines with gaps, backlash is taken up at rest, as without
//! this setting.
//!
//! The pins do not tell these steps from others. Where the pen really is follows from where the
//! motors reversed ([`Reversal`](crate::motion::Reversal)), because a motor moves the pen only at
//! an end of its backlash.

use super::{Machine, Segmenter, Setting};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{BacklashTakeUp, Move, PathLength, SpeedLimit};

/// The state of taking up backlash while the pen draws.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SpreadBacklash {
    /// The distance over which the backlash of a reversal is spread; 0 if it is taken up at rest.
    distance: PathLength,
    /// How much of that distance is left for the current reversal.
    left: PathLength,
    /// For each motor, the steps that are left to take up.
    due: [i32; 2],
    /// The directions in which the motors last moved: -1, 1, or 0 if none is known.
    directions: [i32; 2],
    /// For each motor, its planned position less the one that would move the pen there without
    /// backlash.
    shift: [i32; 2],
    /// The state at the last reversal that the pins have begun.
    last_begun: BacklashState,
}

/// How much backlash the motors have taken up at an instant.
#[derive(Debug, Clone, Copy, Default)]
struct BacklashState {
    /// For each motor, the steps that it must make upward before it moves the pen, as in
    /// [`Backlash`](super::Backlash); 0 if this is not known.
    ahead: [i32; 2],
    /// The sum of all steps of each motor; wraps.
    motors: [i32; 2],
    /// `motors` plus `ahead`, less the position of the pen. It never changes.
    sum: [i32; 2],
}

impl BacklashState {
    /// Updates the state for motors that move on to these sums of steps without reversing, with
    /// this much backlash each.
    fn pass(&mut self, motors: [i32; 2], backlash: [i32; 2]) {
        let moved = self.motors.zip_with(motors, |from, to| to.wrapping_sub(from));
        let ahead = self.ahead.zip_with(moved, i32::saturating_sub);
        self.ahead = ahead.zip_with(backlash, |ahead, backlash| ahead.min(backlash).max(0));
        self.motors = motors;
    }

    /// The positions of motors without backlash that would hold the pen where it is.
    fn position(&self) -> PagePoint {
        let motors = self.motors.zip_with(self.ahead, i32::wrapping_add);
        let [x, y] = motors.zip_with(self.sum, i32::wrapping_sub);
        PagePoint { x, y }
    }
}

/// A pair of values, one for each motor.
trait Pair<T> {
    /// Combines two pairs by `make`.
    fn zip_with<U, V>(self, other: [U; 2], make: impl Fn(T, U) -> V) -> [V; 2];
}

impl<T> Pair<T> for [T; 2] {
    fn zip_with<U, V>(self, other: [U; 2], make: impl Fn(T, U) -> V) -> [V; 2] {
        let ([x, y], [other_x, other_y]) = (self, other);
        [make(x, other_x), make(y, other_y)]
    }
}

impl Machine<'_> {
    /// Whether backlash is taken up while the pen draws.
    pub(super) fn spreads_backlash(&self) -> bool {
        self.spread_backlash.distance > 0
    }

    /// The backlash of each motor in steps; 0 while it is unknown on which side of its backlash the
    /// motor is.
    fn known_backlash(&self) -> [i32; 2] {
        self.backlash
            .ahead
            .zip_with(self.backlash_steps(), |ahead, backlash| ahead.map_or(0, |_| backlash))
    }

    /// The state at the pins.
    fn backlash_at_pins(&self) -> BacklashState {
        let ((x, y), backlash) = (self.pins.steps(), self.pins.backlash());
        let motors = [
            self.origin.x.wrapping_add(x).wrapping_add(backlash.0),
            self.origin.y.wrapping_add(y).wrapping_add(backlash.1),
        ];
        let (mut state, ticks, backlash) =
            (self.spread_backlash.last_begun, self.pins.ticks(), self.known_backlash());
        for reversal in self.runner.reversals().take_while(|reversal| reversal.has_begun(ticks)) {
            state.pass(reversal.motors, backlash);
        }
        state.pass(motors, backlash);
        state
    }

    /// The state where the planned events end.
    fn backlash_planned(&self) -> BacklashState {
        let (mut state, backlash) = (self.spread_backlash.last_begun, self.known_backlash());
        for reversal in self.runner.reversals() {
            state.pass(reversal.motors, backlash);
        }
        state.pass(self.runner.motor_steps(), backlash);
        state
    }

    /// Converts the positions of the motors at the pins to those that motors without backlash would
    /// have.
    pub(super) fn without_spread_backlash(&self, motors: PagePoint) -> PagePoint {
        if self.spreads_backlash() { self.backlash_at_pins().position() } else { motors }
    }

    /// Converts the positions of the motors where the planned events end to those that motors
    /// without backlash would have.
    pub(super) fn planned_without_spread_backlash(&self, motors: PagePoint) -> PagePoint {
        if self.spreads_backlash() { self.backlash_planned().position() } else { motors }
    }

    /// Converts the positions of the motors where the planned moves end to those that motors
    /// without backlash would have.
    pub(super) fn end_without_spread_backlash(&self, end: PagePoint) -> PagePoint {
        let [x, y] = self.spread_backlash.shift;
        PagePoint { x: end.x.wrapping_sub(x), y: end.y.wrapping_sub(y) }
    }

    /// Advances the state past the reversals that the pins have begun.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn pass_begun_reversals(&mut self) {
        let (ticks, backlash) = (self.pins.ticks(), self.known_backlash());
        while let Some(reversal) = self.runner.next_begun_reversal(ticks) {
            self.spread_backlash.last_begun.pass(reversal.motors, backlash);
        }
    }

    /// Discards what is planned after the events so far, so that the state is the one in which
    /// these leave it. Returns whether backlash is taken up while the pen draws; only then the
    /// state is known here.
    pub(super) fn settle_planned_backlash(&mut self) -> bool {
        if self.spreads_backlash() {
            let state = self.backlash_planned();
            let (at, position) = (self.runner.position(), state.position());
            self.settle_backlash(state.ahead);
            self.spread_backlash.shift =
                [at.x.wrapping_sub(position.x), at.y.wrapping_sub(position.y)];
        }
        self.spreads_backlash()
    }

    /// Discards what is planned beyond the pins, so that the state is the one in which they left
    /// it.
    pub(super) fn settle_backlash_at_pins(&mut self) {
        if self.spreads_backlash() {
            self.settle_backlash(self.backlash_at_pins().ahead);
        }
    }

    /// Sets the backlash that each motor has ahead, with nothing left to take up.
    fn settle_backlash(&mut self, at: [i32; 2]) {
        self.backlash.ahead = self.backlash.ahead.zip_with(at, |ahead, at| ahead.map(|_| at));
        let spread = &mut self.spread_backlash;
        (spread.left, spread.due, spread.directions) = (PathLength::ZERO, [0; 2], [0; 2]);
    }

    /// Starts to track the state anew from where the motors are now. Nothing may move.
    pub(super) fn restart_spread_backlash(&mut self) {
        let distance = self.settings.backlash_distance();
        let motors = self.runner.motor_steps();
        let at = self.runner.position();
        let ahead = self.backlash.ahead.map(|ahead| ahead.unwrap_or(0));
        let position = [at.x, at.y].zip_with(self.spread_backlash.shift, i32::wrapping_sub);
        let sum = motors.zip_with(ahead, i32::wrapping_add).zip_with(position, i32::wrapping_sub);
        let spread = &mut self.spread_backlash;
        (spread.distance, spread.left, spread.due) = (distance, PathLength::ZERO, [0; 2]);
        spread.last_begun = BacklashState { ahead, motors, sum };
        self.runner.record_reversals(distance > 0);
    }

    /// From now on the motors are where motors without backlash would be.
    pub(super) fn forget_shift(&mut self) {
        self.spread_backlash.shift = [0; 2];
    }

    /// Records that the motors move by `delta`, where `from` is the sum of all steps of each
    /// before, and `before` what was known of its backlash. The move may be the first that tells on
    /// which side of its backlash a motor is.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn learn_backlash(
        &mut self,
        before: [Option<i32>; 2],
        from: [i32; 2],
        delta: [i32; 2],
    ) {
        let SpreadBacklash { directions, last_begun, .. } = &mut self.spread_backlash;
        *directions = directions.zip_with(delta, direction);
        let BacklashState { ahead, motors, sum } = last_begun;
        // The backlash that becomes known by this move.
        let news =
            before.zip_with(self.backlash.ahead, |before, now| now.filter(|_| before.is_none()));
        *sum = sum.zip_with(news, |sum, news| sum.wrapping_add(news.unwrap_or(0)));
        *ahead = ahead.zip_with(news, |ahead, news| news.unwrap_or(ahead));
        let from = from.zip_with(news, |from, news| news.map(|_| from));
        *motors = motors.zip_with(from, |motors, from| from.unwrap_or(motors));
    }

    /// Returns a move whose motors end as much further as the backlash that was taken up requires.
    pub(super) fn with_shift<'c>(&self, segment: Move<'c>) -> Move<'c> {
        let [x, y] = self.spread_backlash.shift;
        let PagePoint { x: to_x, y: to_y } = segment.motors;
        Move { motors: PagePoint { x: to_x.wrapping_add(x), y: to_y.wrapping_add(y) }, ..segment }
    }

    /// Appends the next part of a line on which backlash is taken up, or what is left of it where a
    /// line has ended. There must be room. Returns whether the move is complete; `None` if nothing
    /// was appended.
    #[inline]
    pub(super) fn push_spread_backlash(&mut self, segmenter: &mut Segmenter) -> Option<bool> {
        if self.spreads_backlash() { self.push_spread(segmenter) } else { None }
    }

    /// Does the work of [`Self::push_spread_backlash`] if backlash is taken up while the pen draws.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    fn push_spread(&mut self, segmenter: &mut Segmenter) -> Option<bool> {
        if !self.runner.is_in_line() || segmenter.ink != Some(LineType::Full) {
            return self.push_backlash_due().then_some(false);
        }
        let Segmenter { to, chord, position, limit, .. } = *segmenter;
        let (from, length) = (segmenter.from(), chord.length());
        let (kinematics, backlash, end) =
            (self.settings.kinematics(), self.backlash_steps(), self.motors_end());
        let target = kinematics.motors(to);
        let delta = [target.x - end.x, target.y - end.y];
        let ahead = self.backlash.ahead.zip_with(
            delta.zip_with(backlash, |delta, backlash| [delta, backlash]),
            {
                |ahead, [delta, backlash]| match delta.signum() {
                    1 => ahead.or(Some(0)),
                    -1 => ahead.or(Some(backlash)),
                    _ => ahead,
                }
            },
        );
        if ahead != self.backlash.ahead {
            let before = core::mem::replace(&mut self.backlash.ahead, ahead);
            self.learn_backlash(before, self.runner.motor_steps_end(), [0; 2]);
        }
        let mut spread = self.spread_backlash;
        // Motors without backlash do not count.
        let delta =
            delta.zip_with(self.known_backlash(), |delta, backlash| delta * backlash.signum());
        let before = spread.directions;
        spread.directions = before.zip_with(delta, direction);
        let reverses = before != spread.directions;
        let ahead = self.backlash.ahead.map(|ahead| ahead.unwrap_or(0));
        let due = spread.directions.zip_with(
            ahead.zip_with(backlash, |ahead, backlash| [ahead, backlash]),
            {
                |direction, [ahead, backlash]| match direction {
                    1 => ahead,
                    -1 => ahead - backlash,
                    _ => 0,
                }
            },
        );
        if due == [0; 2] && !reverses {
            return None;
        }
        if reverses || spread.left == 0 {
            spread.left = spread.distance;
        }
        let rest = length.saturating_sub(position);
        let piece = rest.min(spread.left);
        let share = due.map(|steps| {
            let part = i64::from(steps) * i64::from(piece.to_bits());
            // No more than all steps that are due, and so below 2^31.
            part.checked_div(spread.left.to_bits().into()).unwrap_or(0) as i32
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
        if !self.push_with_backlash(by, page, piece, reverses, limit) {
            return None;
        }
        spread.left = spread.left.saturating_sub(piece);
        spread.due = due.zip_with(share, i32::wrapping_sub);
        self.count_backlash(spread, share);
        segmenter.position = position + piece;
        Some(segmenter.position >= length)
    }

    /// Whether steps are left to take up at the end of the line so far.
    pub(super) fn owes_backlash(&self) -> bool {
        self.spread_backlash.due != [0; 2] && self.runner.is_in_line()
    }

    /// Appends the steps that are left to take up where a line has ended. They draw the part by
    /// which the pen lags behind. There must be room. Returns whether anything was appended.
    pub(super) fn push_backlash_due(&mut self) -> bool {
        let mut spread = self.spread_backlash;
        let due = core::mem::take(&mut spread.due);
        spread.left = PathLength::ZERO;
        if !self.owes_backlash() {
            return false;
        }
        let page = self.runner.page_end();
        let limit = SpeedLimit::NONE;
        let pushed = self.push_with_backlash(due, page, PathLength::ZERO, false, limit);
        if pushed {
            self.count_backlash(spread, due);
        }
        pushed
    }

    /// Appends a move of the motors by `by` that leads the pen to `page` along a line of length
    /// `drawn`.
    fn push_with_backlash(
        &mut self,
        by: [i32; 2],
        page: PagePoint,
        drawn: PathLength,
        reverses: bool,
        limit: SpeedLimit,
    ) -> bool {
        // The kinematics that can take up backlash this way are linear, so a displacement is
        // converted like a position.
        let [x, y] = by;
        let offset = self.settings.kinematics().page(PagePoint { x, y });
        let Some(chord) = self.runner.chord(offset.x, offset.y) else { return false };
        let end = self.runner.end();
        let motors = PagePoint { x: end.x.wrapping_add(x), y: end.y.wrapping_add(y) };
        let piece = Move::whole(motors, page, &chord);
        let extra = chord.length().saturating_sub(drawn);
        self.runner.set_backlash_take_up(BacklashTakeUp { reverses, extra });
        let pushed = self.runner.push(&piece, Some(LineType::Full), limit).is_ok();
        self.runner.set_backlash_take_up(BacklashTakeUp::default());
        pushed
    }

    /// Replaces the state by `spread`, and counts `steps` that were appended to take up backlash.
    fn count_backlash(&mut self, spread: SpreadBacklash, steps: [i32; 2]) {
        self.spread_backlash = spread;
        self.spread_backlash.shift = spread.shift.zip_with(steps, i32::wrapping_add);
        let made = |ahead: Option<i32>, steps| ahead.map(|ahead| ahead - steps);
        self.backlash.ahead = self.backlash.ahead.zip_with(steps, made);
    }
}

/// Returns the direction of a motor that moves by `delta`; `before` if it does not move.
fn direction(before: i32, delta: i32) -> i32 {
    if delta == 0 { before } else { delta.signum() }
}

impl super::Settings {
    /// The distance over which the backlash of a reversal is spread; 0 if it is taken up at rest.
    fn backlash_distance(&self) -> PathLength {
        // A unit of the setting is four units of the length.
        PathLength::from_bits(self.get(Setting::BacklashDistance).to_bits().unsigned_abs() << 2)
    }
}
