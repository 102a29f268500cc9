//! Hands the planned motion over to the input shaper, and waits for its copies wherever the pen
//! moves or the machine comes to rest.

use super::{BlockCursor, Committed, Runner};
use crate::motion::shaper::POSITION_BITS;
use crate::motion::{EventQueue, StepEvent};

impl Runner<'_> {
    /// Whether motion is shaped. The shaper tells the brake how long the steps are.
    #[inline(always)]
    pub(super) fn is_shaped(&self) -> bool {
        self.shaper.is_on()
    }

    /// Plans the current slice. The shaper makes its steps.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn shape_slice(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        let Some(course) = &mut self.course else {
            return Ok(());
        };
        let Some(moves) = course.slice else {
            return Ok(());
        };
        if self.shaper.is_resting() {
            self.shaper.begin(self.position, self.now);
        }
        for _ in 0..moves.left {
            let Some(direction) = course.line.next() else { break };
            self.position = direction.from_point(self.position);
        }
        course.advance(moves.left as usize);
        course.end_slice(moves.slice);
        let [x, y] = course.ahead();
        let at = |steps: i32, ahead: i64| (i64::from(steps) << POSITION_BITS) + ahead;
        let to = [at(self.position.x, x), at(self.position.y, y)];
        self.shaper.add(moves.slice.time, to);
        self.now = self.now.wrapping_add(moves.slice.time);
        self.timing.pass(moves.slice.time);
        self.make_shaped_steps(queue).map(|_| ())
    }

    /// Makes the steps of the shaper that had no room in the queue. Returns whether all are made
    /// and the queue has room for more.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn make_waiting_steps(
        &mut self,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        Ok(self.make_shaped_steps(queue)? && queue.room() >= Self::ROOM)
    }

    /// Makes the steps of the shaper, as far as the queue has room. Returns whether all are made.
    fn make_shaped_steps(&mut self, queue: &mut dyn EventQueue) -> Result<bool, StepEvent> {
        self.shaper.make_steps(&self.limits, self.brake, &mut self.emitter, queue)
    }

    /// Lets all copies come to rest if they must before the plan goes on: the pen is to move, or
    /// the steps that come next take up backlash, which are not shaped. Returns whether it may go
    /// on; otherwise the queue has no room.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    pub(super) fn are_copies_ready(
        &mut self,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        let must_rest = |course: &BlockCursor| {
            course.takes_up_backlash() || self.pen_is_down != Some(course.is_inked())
        };
        let at_rest = self.committed == Committed::REST;
        if at_rest && self.course.as_ref().is_some_and(must_rest) {
            return self.let_copies_rest(queue);
        }
        Ok(true)
    }

    /// Lets all copies come to rest where the plan is. Returns whether they are, and the queue has
    /// room for more.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[inline(always)]
    pub(super) fn let_copies_rest(
        &mut self,
        queue: &mut dyn EventQueue,
    ) -> Result<bool, StepEvent> {
        if self.shaper.is_resting() { Ok(true) } else { self.wait_for_copies(queue) }
    }

    #[inline(never)] // Only with this setting: inlined, it would fill the cache.
    fn wait_for_copies(&mut self, queue: &mut dyn EventQueue) -> Result<bool, StepEvent> {
        if !self.make_shaped_steps(queue)? {
            return Ok(false);
        }
        let passed = self.shaper.come_to_rest(self.position);
        self.now = self.now.wrapping_add(passed);
        let at_rest =
            self.make_shaped_steps(queue)? && self.shaper.rest(&mut self.emitter, queue)?;
        Ok(at_rest && queue.room() >= Self::ROOM)
    }
}
