//! Moves the pen while the machine is at rest, and ends the sequence of events.

use super::*;

/// The heights of the pen, and how long it takes to reach them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PenPositions {
    /// The height of the raised pen, 0 (fully raised) to 127.
    pub up_height: u8,
    /// The height of the pen when it draws, 0 to 127.
    pub down_height: u8,
    /// The ticks from the order to raise the pen to the first move.
    pub up_ticks: u32,
    /// The ticks from the order to lower the pen to the first move.
    pub down_ticks: u32,
    /// The ticks from one height to the next while the pen is lowered or raised gradually; 0 if it
    /// moves at once.
    pub ramp_ticks: u32,
    /// The length of a dot or gap of a dotted line.
    pub dot_length: PathLength,
    /// The motor that lifts the pen, if a motor does.
    pub lift: Option<LiftRule>,
    /// How long the pen may move while the machine moves, too.
    #[cfg(feature = "pen-overlap")]
    pub overlap: PenOverlap,
}

impl Runner<'_> {
    /// Whether the pen was last told to go down.
    pub fn pen_is_down(&self) -> bool {
        self.pen_is_down == Some(true)
    }

    /// Whether the pen was last told to go up, and the dwell for it has been planned.
    #[cfg(feature = "resume")]
    pub fn is_pen_up(&self) -> bool {
        self.pen_is_down == Some(false)
    }

    /// Whether the pen is up, if all events that the pins have begun lasted `ticks`.
    #[cfg(feature = "resume")]
    pub fn is_pen_up_at(&self, ticks: u32) -> bool {
        self.is_pen_up() && ticks.wrapping_sub(self.raised_at).cast_signed() > 0
    }

    /// The number of strokes that are planned to their end; wraps.
    #[cfg(feature = "resume")]
    pub fn strokes_over(&self) -> u32 {
        let next_is_travel = self.lookahead.front().is_some_and(|block| block.ink.is_none());
        let is_over = !self.in_stroke || (self.course.is_none() && next_is_travel);
        self.run.strokes.wrapping_sub(u32::from(!is_over))
    }

    /// Records that something other than this runner has raised the pen, which may still be moving.
    pub fn forget_pen(&mut self) {
        self.pen_is_down = None;
        self.pen_height = None;
        self.forget_timing();
    }

    /// Records that the motor of the pen had no current, so that its position is unknown.
    pub fn forget_lift(&mut self) {
        self.lift.forget();
        self.forget_pen();
    }

    /// Records that the pins have carried out events of this many ticks. By then the motor of the
    /// pen may have found its stop.
    pub fn follow_lift(&mut self, ticks: u32) {
        self.lift.sync_consumed(ticks);
    }

    /// Sets the position of the motor of the pen, the sum of all its pulses. No pulse may wait.
    pub fn set_lift(&mut self, position: i32) {
        self.lift.set_position(position);
    }

    /// Whether a motor still has to raise the pen. If the position of the motor is unknown, this is
    /// only so if `anywhere`.
    pub fn is_pen_held(&self, anywhere: bool) -> bool {
        let is_lowered = self.pen_is_down != Some(false) && (anywhere || self.lift.is_known());
        self.pen.lift.is_some() && (is_lowered || self.emitter.is_open())
    }

    /// Hands over the next few events that raise the pen while nothing else moves.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    pub fn raise_pen(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        self.come_to_rest(Progress::Done, queue)
    }

    /// Raises the pen, and then ends the sequence of events.
    pub(super) fn come_to_rest(
        &mut self,
        standing: Progress,
        queue: &mut dyn EventQueue,
    ) -> Result<Progress, StepEvent> {
        #[cfg(feature = "input-shaping")]
        if !self.let_copies_rest(queue)? {
            return Ok(Progress::More);
        }
        if self.pen_is_down != Some(false) {
            self.move_pen(false, queue)?;
            return Ok(Progress::More);
        }
        if self.wait_for_rising(queue)? {
            return Ok(Progress::More);
        }
        if self.emitter.is_open() {
            let at = self.emitter.rest(self.now, true, queue)?;
            self.advance_to(at);
        }
        if standing == Progress::Done {
            self.last = None;
            self.in_stroke = false;
        }
        Ok(standing)
    }

    /// Moves the pen up or down, or one height further on its ramp. After the last height the dwell
    /// passes. Hands over at most four events.
    pub(super) fn move_pen(
        &mut self,
        down: bool,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        let (height, dwell) = if down {
            (self.pen.down_height, self.pen.down_ticks)
        } else {
            (self.pen.up_height, self.pen.up_ticks)
        };
        if let Some(passed) = self.lowered_while_moving(down) {
            return self.dwell_for_pen(down, dwell.saturating_sub(passed), queue);
        }
        // While it moves it is neither up nor down.
        self.pen_is_down = None;
        self.waiting_top_speed = SliceSpeed::ZERO;
        let was_known = self.lift.is_known();
        if let Some(rule) = self.pen.lift
            && let Some(next) = self.lift.next(rule, height)
        {
            if !self.emitter.is_open() {
                self.emitter.hold(self.now, queue)?;
            }
            let at = self.emitter.lift(next, self.now, queue)?;
            self.advance_to(at);
            if !was_known && self.lift.is_known() {
                self.lift.found(self.emitter.ticks());
            }
            let ticks = next.ticks.max(self.limits.setup_ticks);
            self.now = self.now.wrapping_add(ticks << FRACTION_BITS);
            return Ok(());
        }
        // At the start and after an emergency stop the height is unknown, and the pen is taken to
        // be raised.
        let from = self.pen_height.unwrap_or(self.pen.up_height);
        let next = self.next_height(from, height);
        let at = self.emitter.pen(next, self.now, queue)?;
        self.advance_to(at);
        self.pen_height = Some(next);
        if next != height {
            self.now = self.now.wrapping_add(self.pen.ramp_ticks << FRACTION_BITS);
            return Ok(());
        }
        self.dwell_for_pen(down, dwell, queue)
    }

    /// Returns the next height of a pen that moves between two heights.
    pub(super) fn next_height(&self, from: u8, to: u8) -> u8 {
        match to.cmp(&from) {
            _ if self.pen.ramp_ticks == 0 || self.pen.lift.is_some() => to,
            Ordering::Less => from - 1,
            Ordering::Equal => to,
            Ordering::Greater => from + 1,
        }
    }

    /// Lets the dwell pass after the pen was sent to its last height.
    pub(super) fn dwell_for_pen(
        &mut self,
        down: bool,
        dwell: u32,
        queue: &mut dyn EventQueue,
    ) -> Result<(), StepEvent> {
        self.pen_is_down = Some(down);
        #[cfg(feature = "resume")]
        if !down {
            self.raised_at = self.emitter.ticks();
        }
        let dwell = if down { dwell } else { self.begin_rising(dwell) };
        // Two waits of up to 0.67 s: the settings allow no longer dwell. With the pen raised, the
        // queue may run dry in the second.
        let half = dwell.div_ceil(2).min(StepEvent::MAX_TICKS);
        self.now = self.now.wrapping_add(half << FRACTION_BITS);
        let at = if down {
            self.emitter.hold(self.now, queue)?
        } else {
            self.emitter.pause(self.now, queue)?
        };
        self.advance_to(at);
        self.now = self.now.wrapping_add(half << FRACTION_BITS);
        let at = self.emitter.hold(self.now, queue)?;
        self.advance_to(at);
        Ok(())
    }
}
