//! Carries out the blocks of the look-ahead: plans their speed slice by slice, and hands over the
//! events of moves, pen changes and dwells.

#[cfg_attr(not(feature = "pen-overlap"), path = "runner/pen_at_rest.rs")]
mod pen;
#[cfg(feature = "spread-backlash")]
mod reversals;
#[cfg(feature = "input-shaping")]
mod shaped;

#[cfg(feature = "pen-overlap")]
pub use pen::PenOverlap;
use pen::PenTiming;
#[cfg(feature = "spread-backlash")]
pub use reversals::{BacklashTakeUp, Reversal};

use super::course::BlockCursor;
use super::curvature::Curvature;
use super::emitter::{LineLevels, MoveLevels, whole_ticks};
use super::junction::{self, Corner, Heading};
use super::lift::{Lift, LiftRule};
use super::limits::{mm_per_min, square};
use super::lookahead::BlockKind;
use super::profile::{FRACTION_BITS, PathSpeed, Profile};
#[cfg(feature = "input-shaping")]
use super::shaper::Shaper;
use super::smooth::{Interval, PathLimits, State};
use super::{
    Block, BrakeRule, Emitter, EventQueue, Limits, Lookahead, PathLength, SLICE_TICKS, SliceSpeed,
    StepEvent,
};
use crate::drawing::{LineType, PagePoint};
use crate::fixed::Millimetres;
use crate::step::Direction;
use core::cmp::Ordering;

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

/// The result of one call of [`Runner::produce`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// There is more to do.
    More,
    /// All blocks are carried out, the pen is raised, and the machine is at rest.
    Done,
    /// The machine is at rest on the path with the pen raised, as [`Runner::stop`] or
    /// [`Runner::stop_after_stroke`] asked.
    Stopped,
}

/// A straight move of the pen, or a segment of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Move {
    /// The positions of the motors at its end.
    pub motors: PagePoint,
    /// How far its ends lie beside the points that the motors can reach: see
    /// [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i16; 2],
    /// The position of the pen at its end.
    pub page: PagePoint,
    /// The displacement of the whole move on the page, in steps.
    pub displacement: (i32, i32),
    /// The length of the whole move.
    pub whole_length: PathLength,
    /// The length of this segment of it.
    pub length: PathLength,
    /// Whether this is a gap within an inked line, for which the pen is raised.
    pub is_gap: bool,
}

/// The reasons why a block was not appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PushError {
    /// The look-ahead is full: produce events first.
    Full,
    /// The move is longer than 16 m, which exceeds every page.
    TooLong,
}

/// What a runner has carried out so far. Lengths are in units of 2^-18 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RunLengths {
    /// The number of strokes begun; wraps.
    pub strokes: u32,
    /// The length of the blocks completed with the pen down.
    pub drawn: u64,
    /// The length of the blocks completed with the pen up.
    pub travelled: u64,
}

/// The plan of the speed.
#[derive(Debug)]
enum Plan {
    /// A plan without a limit on jerk, for the rest of the current piece.
    Profile(Profile),
    /// A plan with a limit on jerk, for an interval of time, regardless of how many blocks end
    /// within it.
    Interval(Interval),
}

/// Turns the blocks of the look-ahead into step events.
#[derive(Debug)]
pub struct Runner<'m> {
    limits: Limits,
    brake: BrakeRule,
    pen: PenPositions,
    lookahead: Lookahead<'m>,
    curvature: Curvature,
    emitter: Emitter,
    #[cfg(feature = "input-shaping")]
    shaper: Shaper,
    course: Option<BlockCursor>,
    plan: Option<Plan>,
    /// The speed at the end of the last plan.
    plan_end: PathSpeed,
    /// The acceleration at the end of the last plan, as a ramp ([`State`]); only with a limit on
    /// jerk.
    ramp: i32,
    /// The greatest speed with the pen down.
    draw: PathSpeed,
    /// The greatest speed with the pen up.
    travel: PathSpeed,
    /// The last speed limit of a curve, cached because many blocks in a row have the same.
    curve: PathSpeed,
    /// The time up to which events are planned, in sixteenths of ticks; wraps.
    now: u32,
    /// Whether the pen is down. `None` while it moves, and after an emergency stop, when it may
    /// still be moving.
    pen_is_down: Option<bool>,
    /// The height to which the pen was last sent; `None` at the start.
    pen_height: Option<u8>,
    lift: Lift,
    timing: PenTiming,
    stopping: bool,
    stopping_after_stroke: bool,
    /// The stopping distance with which the current piece was allowed to end, if it is so low only
    /// because few blocks are known. When a later block allows more, the piece is planned again.
    provisional_exit: Option<PathLength>,
    /// The stopping distance with which a discarded plan would have ended the current piece.
    discarded_exit: Option<PathLength>,
    /// The runner stops after the stroke in which the total drawn length reaches this value.
    ink_bound: u64,
    /// The positions of the motors where the events so far end, without the steps that took up
    /// backlash at rest.
    position: PagePoint,
    /// For each motor, the sum of the steps in the events so far that took up backlash at rest.
    backlash: PagePoint,
    /// The same sum for the blocks so far.
    backlash_end: PagePoint,
    /// The positions of the motors where the blocks so far end.
    end: PagePoint,
    /// The position of the pen where the blocks so far end.
    page_end: PagePoint,
    /// The direction, length and ink of the last block appended.
    last: Option<(Heading, PathLength, Option<LineType>)>,
    /// The stopping distance of the speed limit of the last block appended.
    last_limit: PathLength,
    run: RunLengths,
    /// Whether the last block begun is inked.
    in_stroke: bool,
    /// The greatest speed that was in force since the pen last moved. Events that still wait in the
    /// queue may be as fast, even if the speed has been lowered since.
    waiting_top_speed: SliceSpeed,
    /// The ticks of all events before the pen was last told to go up; wraps.
    #[cfg(feature = "resume")]
    raised_at: u32,
    #[cfg(feature = "spread-backlash")]
    reversals: reversals::Reversals,
    /// The part of the next appended move that takes up backlash.
    #[cfg(feature = "spread-backlash")]
    backlash_take_up: BacklashTakeUp,
}

impl<'m> Runner<'m> {
    /// The room in the queue that one call of [`Runner::produce`] needs at least.
    pub const ROOM: usize = Emitter::ROOM;

    /// Creates a runner that is at rest at the origin of the page with the pen raised.
    pub fn new(limits: Limits, pen: PenPositions, blocks: &'m mut [Block]) -> Self {
        let mut runner = Self {
            limits,
            brake: BrakeRule::default(),
            pen,
            lookahead: Lookahead::new(blocks),
            curvature: Curvature::default(),
            emitter: Emitter::new(&limits),
            #[cfg(feature = "input-shaping")]
            shaper: Shaper::new(),
            course: None,
            plan: None,
            plan_end: PathSpeed::REST,
            ramp: 0,
            draw: PathSpeed::REST,
            travel: PathSpeed::REST,
            curve: PathSpeed::REST,
            now: 0,
            // A motor holds the pen at the height at which it happened to be switched on.
            pen_is_down: pen.lift.is_none().then_some(false),
            pen_height: None,
            lift: Lift::default(),
            timing: PenTiming::new(),
            #[cfg(feature = "resume")]
            raised_at: 0,
            stopping: false,
            stopping_after_stroke: false,
            provisional_exit: None,
            discarded_exit: None,
            ink_bound: u64::MAX,
            position: PagePoint::default(),
            backlash: PagePoint::default(),
            backlash_end: PagePoint::default(),
            end: PagePoint::default(),
            page_end: PagePoint::default(),
            last: None,
            last_limit: PathLength::ZERO,
            run: RunLengths::default(),
            in_stroke: false,
            waiting_top_speed: SliceSpeed::ZERO,
            #[cfg(feature = "spread-backlash")]
            reversals: reversals::Reversals::default(),
            #[cfg(feature = "spread-backlash")]
            backlash_take_up: BacklashTakeUp::default(),
        };
        runner.set_limits(limits, pen);
        runner
    }

    /// Adopts new settings. It may only be called while nothing moves.
    pub fn set_limits(&mut self, limits: Limits, pen: PenPositions) {
        self.limits = limits;
        self.curve = PathSpeed::REST;
        if pen.lift != self.pen.lift {
            self.forget_lift();
        }
        self.pen = pen;
        self.emitter.set_limits(&limits);
        #[cfg(feature = "input-shaping")]
        self.shaper.set_shaping(limits.shaping);
        self.lookahead.pass_limits_on(limits.jerk.is_none());
        self.set_override(100, 100);
    }

    /// Sets the rule by which the lengths of steps are told to the brake. It may only be called
    /// while nothing moves.
    pub fn set_brake(&mut self, brake: BrakeRule) {
        self.brake = brake;
    }

    /// How long the waiting events must last so that the machine can stop within them, whatever
    /// follows and wherever in them it is.
    ///
    /// Events that end at a speed u and last t contain the stopping distance of every speed v
    /// within them if t ≥ (v - (√2 - 1) u) / a: either the plan is slower in between, or it goes
    /// far enough.
    pub fn stopping_ticks(&self) -> u32 {
        let end = match &self.plan {
            Some(Plan::Profile(profile)) => profile.speed().to_bits(),
            Some(Plan::Interval(interval)) => interval.state().speed,
            None => self.plan_end.speed.to_bits(),
        };
        // The copies of faster motion may come later.
        #[cfg(feature = "input-shaping")]
        let end = if self.is_shaped() { 0 } else { end };
        let speed = self.top(self.in_stroke).speed.max(self.waiting_top_speed).to_bits();
        let change = speed.saturating_sub(end / 8 * 3);
        let slices = change.checked_div(self.limits.acceleration.to_bits()).unwrap_or(u32::MAX);
        slices.saturating_mul(SLICE_TICKS)
    }

    /// The planned speed, in mm/min.
    pub fn speed(&self) -> Millimetres {
        let speed = match &self.plan {
            Some(Plan::Profile(profile)) => profile.speed().to_bits(),
            Some(Plan::Interval(interval)) => interval.state().speed,
            None => self.plan_end.speed.to_bits(),
        };
        mm_per_min(SliceSpeed::from_bits(speed))
    }

    /// How many more targets fit now.
    pub fn room(&self) -> usize {
        self.lookahead.capacity() - self.lookahead.len()
    }

    /// Scales both speeds to `percent` (10 to 200) at once, and the speed with the pen up to
    /// `travel_percent` (1 to 100) of the result. Neither exceeds the greater of the two speeds
    /// that are set.
    pub fn set_override(&mut self, percent: u8, travel_percent: u8) {
        let percent = u64::from(percent.clamp(10, 200));
        let travel_percent = percent * u64::from(travel_percent.clamp(1, 100)) / 100;
        let greatest = self.limits.draw_speed.max(self.limits.travel_speed);
        let scaled = |speed: SliceSpeed, percent: u64| {
            let bits = u64::from(speed.to_bits()) * percent / 100;
            let bits = bits.min(greatest.to_bits().into()).max(1);
            PathSpeed::of_speed(&self.limits, SliceSpeed::from_bits(bits as u32))
        };
        let draw = scaled(self.limits.draw_speed, percent);
        let travel = scaled(self.limits.travel_speed, travel_percent);
        self.waiting_top_speed = self.waiting_top_speed.max(self.top(self.in_stroke).speed);
        self.draw = draw;
        self.travel = travel;
        self.plan_again();
    }

    /// The limits in force.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The positions of the motors where the events end that were handed over, including the one
    /// that is kept back.
    pub fn position(&self) -> PagePoint {
        self.position
    }

    /// The positions of the motors where the blocks end.
    pub fn end(&self) -> PagePoint {
        self.end
    }

    /// The position of the pen where the blocks end.
    pub fn page_end(&self) -> PagePoint {
        self.page_end
    }

    /// The ticks of all events handed over; wraps.
    pub fn ticks(&self) -> u32 {
        self.emitter.ticks()
    }

    /// The number of targets that fit into an empty look-ahead.
    pub fn capacity(&self) -> usize {
        self.lookahead.capacity()
    }

    /// Whether no more targets fit now.
    pub fn is_full(&self) -> bool {
        self.lookahead.is_full()
    }

    /// Whether nothing waits and nothing moves.
    pub fn is_at_rest(&self) -> bool {
        self.course.is_none() && self.lookahead.is_empty() && !self.emitter.is_open()
    }

    /// Whether all blocks are carried out. The pen is still where the last one left it.
    #[cfg(feature = "resume")]
    pub fn has_run_all(&self) -> bool {
        self.course.is_none() && self.lookahead.is_empty()
    }

    /// Ends the events of all blocks that are carried out, and leaves the pen where it is. Returns
    /// whether that is done; otherwise the queue has no room.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[cfg(feature = "resume")]
    #[inline(never)] // Rarely called: inlined, it would fill the cache.
    pub fn rest_on_paper(&mut self, queue: &mut dyn EventQueue) -> Result<bool, StepEvent> {
        #[cfg(feature = "input-shaping")]
        if !self.let_copies_rest(queue)? {
            return Ok(false);
        }
        if self.emitter.is_open() {
            let at = self.emitter.rest(self.now, true, queue)?;
            self.advance_to(at);
        }
        Ok(true)
    }

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

    /// What has been carried out since the runner was created.
    pub fn run(&self) -> RunLengths {
        self.run
    }

    /// Sets the position after homing or an emergency stop: of the `motors`, of the steps that took
    /// up `backlash` at rest, and of the pen on the `page`. The events carried out so far lasted
    /// `ticks` (it wraps), and none may wait.
    pub fn set_position(
        &mut self,
        motors: PagePoint,
        backlash: PagePoint,
        page: PagePoint,
        ticks: u32,
    ) {
        self.position = motors;
        self.backlash = backlash;
        #[cfg(feature = "spread-backlash")]
        self.reversals.clear();
        self.forget_path(page);
        self.emitter.restart(ticks);
    }

    /// Appends a move whose speed is limited by a stopping distance ([`Limits::feed`]). Lengths,
    /// corners and bends are measured on the page. A move without length is skipped.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push(
        &mut self,
        piece: &Move,
        ink: Option<LineType>,
        limit: PathLength,
    ) -> Result<(), PushError> {
        let Move { motors, offsets, page, mut displacement, mut whole_length, mut length, is_gap } =
            *piece;
        let (dx, dy) = (motors.x - self.end.x, motors.y - self.end.y);
        if dx == 0 && dy == 0 {
            // The pen may be only near this point, because the motors move in whole steps.
            self.page_end = page;
            return Ok(());
        }
        if displacement == (0, 0) || length == 0 {
            // The move is shorter than a step on the page, so its direction is that of the motors.
            displacement = (dx.signum(), dy.signum());
            whole_length =
                self.limits.length(displacement.0, displacement.1).ok_or(PushError::TooLong)?;
            length = whole_length;
        }
        let inked = ink.filter(|_| !is_gap);
        let heading = Heading::new(&self.limits, displacement.0, displacement.1, whole_length);
        let corner = match self.last {
            Some((before, length_before, ink_before)) if passes(ink_before, inked) => {
                junction::corner(&self.limits, before, heading, length.min(length_before))
            }
            _ => Corner::STOP,
        };
        let bends_apart = self
            .last
            .is_some_and(|(_, before, _)| junction::bends_apart(&self.limits, before, length));
        if corner.is_sharp || bends_apart {
            self.curvature.restart(&self.limits, self.page_end, &mut self.lookahead);
        }
        let (entry_limit, curve_limit) = (corner.limit, limit);
        let kind = if is_gap { BlockKind::Gap } else { BlockKind::Line };
        #[cfg(feature = "spread-backlash")]
        let (kind, extra) = core::mem::take(&mut self.backlash_take_up).of_block(kind);
        let block = Block {
            dx,
            dy,
            length,
            entry_limit,
            curve_limit,
            ink,
            offsets,
            kind,
            #[cfg(feature = "spread-backlash")]
            extra,
            ..Block::EMPTY
        };
        // The speed is checked only between blocks, so moves are joined only if nothing limits it
        // there.
        let is_free = corner.limit >= self.limits.top && limit == self.last_limit;
        if self.lookahead.is_full() {
            return Err(PushError::Full);
        }
        let is_joined = is_free && self.lookahead.join(&block, &self.limits);
        if !is_joined && self.lookahead.push(block).is_err() {
            return Err(PushError::Full);
        }
        self.last_limit = limit;
        if self.limits.centripetal {
            self.curvature.extend(&self.limits, page, &mut self.lookahead);
        }
        self.end = motors;
        self.page_end = page;
        self.last = Some((heading, length, inked));
        self.slow_for_bends();
        if self
            .provisional_exit
            .is_some_and(|exit| exit < self.lookahead.entry_allowed(PathLength::MAX, &self.limits))
        {
            self.provisional_exit = None;
            self.plan_again();
        }
        Ok(())
    }

    /// Appends steps by which the motors take up their backlash, from rest to rest. The pen stays
    /// where it is, and is lowered if there is `ink`. If the pen may move while the machine does,
    /// and these steps come before a stroke, it is still raised.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push_backlash(&mut self, by: PagePoint, ink: Option<LineType>) -> Result<(), PushError> {
        let PagePoint { x: dx, y: dy } = by;
        let length = self.limits.length(dx, dy).ok_or(PushError::TooLong)?;
        let ink = ink.map(|_| LineType::Full);
        let block = Block { dx, dy, length, ink, kind: BlockKind::Backlash, ..Block::EMPTY };
        self.end_path();
        self.lookahead.push(block).map_err(|_| PushError::Full)?;
        self.backlash_end.x = self.backlash_end.x.wrapping_add(dx);
        self.backlash_end.y = self.backlash_end.y.wrapping_add(dy);
        Ok(())
    }

    /// The steps in the waiting blocks that take up backlash. [`Runner::forget_path`] discards
    /// them.
    pub fn waiting_backlash(&self) -> PagePoint {
        PagePoint {
            x: self.backlash_end.x.wrapping_sub(self.backlash.x),
            y: self.backlash_end.y.wrapping_sub(self.backlash.y),
        }
    }

    /// For each motor, the sum of the steps that took up backlash at rest; wraps.
    pub fn backlash(&self) -> PagePoint {
        self.backlash
    }

    /// Lowers the pen where the path ends so far.
    ///
    /// # Errors
    /// [`PushError::Full`]; nothing is appended then.
    pub fn push_dot(&mut self) -> Result<(), PushError> {
        let dot = Block { ink: Some(LineType::Full), ..Block::EMPTY };
        self.lookahead.push(dot).map_err(|_| PushError::Full)?;
        self.last = None;
        Ok(())
    }

    /// Ends the path with the last block, and with it a curve.
    pub fn end_path(&mut self) {
        self.curvature.restart(&self.limits, self.page_end, &mut self.lookahead);
        self.last = None;
        self.slow_for_bends();
    }

    /// Slows down for bends that became known late: those on the current piece, or behind a cruise
    /// that would pass them too fast.
    #[inline(never)] // Inlined, it would only fill the cache.
    fn slow_for_bends(&mut self) {
        let late = self.lookahead.late_limit();
        if let Some(course) = &mut self.course
            && late < course.curve_limit
        {
            course.curve_limit = late;
            if let Some(Plan::Profile(_)) = &self.plan {
                self.plan_again();
            }
        }
        let limit = self.lookahead.take_lowered();
        if limit < PathLength::MAX
            && let Some(Plan::Interval(interval)) = &self.plan
            && interval.is_cruise()
            && square(interval.state().speed.into()) > self.limits.squared_speed(limit)
        {
            self.give_plan_up();
        }
    }

    /// Begins to slow down on the path with the next slice or interval, until the machine is at
    /// rest on a whole step with the pen raised. If the pen was already told to go down on a
    /// travel, the travel is completed first.
    pub fn stop(&mut self) {
        self.plan_again();
        self.stopping = true;
    }

    /// Discards the plan, unless that would cause a jerk: an interval in which the acceleration
    /// changes is completed, which takes at most 42 ms, and 1.3 ms from a jerk of 20 m/s³ at 800
    /// mm/s² on. A travel on which the pen was told to go down is completed, too. Returns the
    /// stopping distance with which the plan would have ended the current piece.
    fn break_plan_off(&mut self) -> Option<PathLength> {
        if self.timing.is_lowering() {
            return None;
        }
        match &self.plan {
            Some(Plan::Interval(interval)) if interval.changes() => None,
            _ => self.give_plan_up(),
        }
    }

    /// Discards the plan after its last slice. Returns the stopping distance with which it would
    /// have ended the current piece, if it was to end it.
    fn give_plan_up(&mut self) -> Option<PathLength> {
        match self.plan.take()? {
            Plan::Profile(profile) => {
                self.plan_end = PathSpeed::of_speed(&self.limits, profile.speed());
                Some(profile.exit().stopping_distance)
            }
            Plan::Interval(interval) => {
                let State { speed, ramp } = interval.state();
                self.plan_end =
                    PathSpeed { speed: SliceSpeed::from_bits(speed), ..PathSpeed::REST };
                self.ramp = ramp;
                None
            }
        }
    }

    /// Plans the rest of the current piece anew, from the next slice on.
    fn plan_again(&mut self) {
        if !self.stopping
            && let Some(exit) = self.break_plan_off()
        {
            self.discarded_exit = Some(exit);
        }
    }

    /// Stops before the next travel, with the pen up.
    pub fn stop_after_stroke(&mut self) {
        self.stopping_after_stroke = true;
    }

    /// Stops before the next travel, with the pen up, once this much more `length` is drawn, in
    /// units of 2^-18 mm. `None` sets no bound.
    pub fn stop_after_ink(&mut self, length: Option<u64>) {
        self.ink_bound = length.map_or(u64::MAX, |length| self.run.drawn.saturating_add(length));
    }

    /// Continues where [`Runner::stop`] or [`Runner::stop_after_stroke`] stopped.
    pub fn resume(&mut self) {
        self.stopping = false;
        self.stopping_after_stroke = false;
        if let Some(course) = &mut self.course {
            course.resume();
        }
    }

    /// Discards the waiting blocks. The machine must be at rest, with the pen at `page`.
    #[inline(never)] // Rarely called: inlined, it would fill the cache.
    pub fn forget_path(&mut self, page: PagePoint) {
        self.lookahead.clear();
        self.course = None;
        self.rest();
        self.stopping = false;
        self.stopping_after_stroke = false;
        self.discarded_exit = None;
        self.last = None;
        self.in_stroke = false;
        #[cfg(feature = "input-shaping")]
        self.shaper.forget();
        self.end = self.position;
        self.backlash_end = self.backlash;
        self.page_end = page;
        #[cfg(feature = "spread-backlash")]
        {
            self.backlash_take_up = BacklashTakeUp::default();
        }
    }

    /// Lets `ticks` pass. Nothing may wait or move.
    ///
    /// # Errors
    /// The event that the queue refused.
    pub fn dwell(&mut self, ticks: u32, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        self.emitter.hold(self.now, queue)?;
        self.now = self.now.wrapping_add(ticks.min(StepEvent::MAX_TICKS) << FRACTION_BITS);
        let at = self.emitter.rest(self.now, true, queue)?;
        self.advance_to(at);
        Ok(())
    }

    /// Switches the drivers off. Nothing may wait or move.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Rarely called: inlined, it would fill the cache.
    pub fn release_drivers(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        let at = self.emitter.rest(self.now, false, queue)?;
        self.advance_to(at);
        Ok(())
    }

    /// Hands over the next few events: those of one slice, as far as the queue has room.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    pub fn produce(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        #[cfg(feature = "input-shaping")]
        if !self.shaper.is_resting() && !self.make_waiting_steps(queue)? {
            return Ok(Progress::More);
        }
        if self.course.is_none() {
            let progress = self.begin_block(queue)?;
            if self.course.is_none() {
                return Ok(progress);
            }
        }
        while let Some(course) = &mut self.course
            && course.slice.is_none()
        {
            if course.begin_rest() {
                break;
            }
            let slice = match &mut self.plan {
                None => {
                    let progress = self.plan(queue)?;
                    if self.plan.is_none() {
                        return Ok(progress);
                    }
                    continue;
                }
                Some(Plan::Profile(profile)) => profile.next_slice(&self.limits),
                Some(Plan::Interval(interval)) => interval.next_slice(course.room()),
            };
            let Some(slice) = slice else {
                self.end_plan();
                return Ok(Progress::More);
            };
            course.begin_slice(slice);
        }
        if self.timing.is_due() {
            self.lower_while_moving(queue)?;
        }
        self.run_slice(queue)?;
        Ok(Progress::More)
    }

    /// Handles the end of a plan, which is carried out or has reached the end of the current piece.
    fn end_plan(&mut self) {
        let Some(course) = &self.course else {
            return;
        };
        let ends = match &self.plan {
            Some(Plan::Profile(profile)) => {
                self.plan_end = profile.exit();
                self.plan = None;
                course.moves_done == course.piece_moves
            }
            Some(Plan::Interval(_)) if course.room() > 0 => {
                self.give_plan_up();
                false
            }
            // The interval goes on, unless the next piece begins at rest.
            _ => {
                let next = self.lookahead.front().filter(|_| course.is_last_piece());
                if next.is_none_or(|block| block.entry_limit == 0) {
                    self.rest();
                }
                true
            }
        };
        if ends {
            self.end_piece();
        }
    }

    /// Records that nothing moves.
    fn rest(&mut self) {
        self.plan = None;
        self.plan_end = PathSpeed::REST;
        self.ramp = 0;
    }

    /// Hands over the moves of the current slice, as far as the queue has room.
    fn run_slice(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        #[cfg(feature = "input-shaping")]
        if self.is_shaped()
            && self.course.as_ref().is_some_and(|course| !course.takes_up_backlash())
        {
            return self.shape_slice(queue);
        }
        let Some(course) = &mut self.course else {
            return Ok(());
        };
        let Some(slice) = course.slice.map(|moves| moves.slice) else {
            return Ok(());
        };
        // A move and the change of direction before it are two events; room for one more is kept
        // for a long wait.
        let mut room = (queue.room().saturating_sub(1)) / 2;
        // Handled one by one, because arrays would go through memory.
        let [straight, diagonal] = course.line.moves();
        let levels = |direction: Direction| {
            let levels = MoveLevels::of(direction);
            if course.takes_up_backlash() { levels.for_backlash() } else { levels }
        };
        let levels = LineLevels { straight: levels(straight), diagonal: levels(diagonal) };
        let ((x, y), (diagonal_x, diagonal_y)) = (straight.delta(), diagonal.delta());
        while let Some(moves) = &course.slice
            && moves.left > 0
        {
            let train = moves.train(room);
            let count = train.count;
            if count == 0 {
                return Ok(());
            }
            room -= count;
            let reversing =
                (self.emitter.reverses(levels.straight), self.emitter.reverses(levels.diagonal));
            let reverses = reversing != (false, false) && {
                let diagonals = course.line.diagonals_within(count);
                (reversing.0 && diagonals < count) || (reversing.1 && diagonals > 0)
            };
            let is_even = !reverses && !course.takes_up_backlash() && self.emitter.has_stepped();
            let stepped = if is_even && self.emitter.keeps_up(&train) {
                self.emitter.steps(self.now, train, &mut course.line, levels, queue)?
            } else {
                self.emitter.single_steps(self.now, train, &mut course.line, levels, queue)?
            };
            self.now = self.now.wrapping_add(stepped.late);
            let place =
                if course.takes_up_backlash() { &mut self.backlash } else { &mut self.position };
            let diagonals = stepped.diagonals as i32;
            let straights = count as i32 - diagonals;
            place.x = place.x.wrapping_add(x * straights + diagonal_x * diagonals);
            place.y = place.y.wrapping_add(y * straights + diagonal_y * diagonals);
            course.advance(count);
        }
        if course.end_slice(slice) {
            let units = self.brake.step_length(course.move_length);
            queue.set_step_length(units, self.emitter.has_stepped())?;
        }
        self.now = self.now.wrapping_add(slice.time);
        self.timing.pass(slice.time);
        self.emitter.split_long_wait(self.now, queue)
    }

    /// Whether motion is shaped. The shaper tells the brake how long the steps are.
    #[cfg(not(feature = "input-shaping"))]
    const fn is_shaped(&self) -> bool {
        false
    }

    fn top(&self, inked: bool) -> PathSpeed {
        if inked { self.draw } else { self.travel }
    }

    fn begin_block(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        let stroke_ends =
            self.in_stroke && self.lookahead.front().is_some_and(|block| block.ink.is_none());
        let pauses = self.stopping_after_stroke || self.run.drawn >= self.ink_bound;
        let stops = self.stopping || (pauses && stroke_ends);
        if stops && self.plan.is_none() && self.plan_end == PathSpeed::REST {
            return self.come_to_rest(Progress::Stopped, queue);
        }
        let dot_length = self.pen.dot_length;
        let Self { course, lookahead, .. } = self;
        let begun = lookahead.pop(|block| {
            *course = Some(BlockCursor::new(block, dot_length));
        });
        if begun.is_none() {
            return self.come_to_rest(Progress::Done, queue);
        }
        let Some(course) = &self.course else {
            return Ok(Progress::More);
        };
        if course.ink.is_some() && !self.in_stroke {
            self.run.strokes = self.run.strokes.wrapping_add(1);
        }
        self.in_stroke = course.ink.is_some();
        #[cfg(feature = "spread-backlash")]
        if course.reverses() {
            self.reversals.add(Reversal::new(self.emitter.ticks(), self.position, self.backlash));
        }
        if self.plan.is_some() && !self.is_shaped() {
            // The current interval continues with these moves.
            let units = self.brake.step_length(course.move_length);
            queue.set_step_length(units, self.emitter.has_stepped())?;
        }
        Ok(Progress::More)
    }

    /// Raises the pen, and then ends the sequence of events.
    fn come_to_rest(
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
    fn move_pen(&mut self, down: bool, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
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
    fn next_height(&self, from: u8, to: u8) -> u8 {
        match to.cmp(&from) {
            _ if self.pen.ramp_ticks == 0 || self.pen.lift.is_some() => to,
            Ordering::Less => from - 1,
            Ordering::Equal => to,
            Ordering::Greater => from + 1,
        }
    }

    /// Lets the dwell pass after the pen was sent to its last height.
    fn dwell_for_pen(
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

    /// Delays the plan to the time `at`, until which the pins needed.
    fn advance_to(&mut self, at: u32) {
        let late = at.wrapping_sub(whole_ticks(self.now));
        self.now = self.now.wrapping_add(late);
    }

    /// Plans the rest of the current piece.
    fn plan(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        #[cfg(feature = "input-shaping")]
        if !self.shaper.is_resting() && !self.are_copies_ready(queue)? {
            return Ok(Progress::More);
        }
        let is_shaped = self.is_shaped();
        let Some(course) = &mut self.course else {
            return Ok(Progress::More);
        };
        let at_rest = self.plan_end == PathSpeed::REST;
        if self.stopping && at_rest {
            return self.come_to_rest(Progress::Stopped, queue);
        }
        #[cfg(not(feature = "pen-overlap"))]
        let inked = course.is_inked();
        #[cfg(feature = "pen-overlap")]
        let inked = {
            let stays_raised = PenTiming::stays_raised(&self.pen, self.pen_is_down);
            course.is_inked() && !(stays_raised && course.takes_up_backlash())
        };
        if at_rest {
            // Before a stroke, the machine may come to rest once more so that motors take up their
            // backlash.
            #[cfg(feature = "pen-overlap")]
            let must_move =
                self.pen_is_down != Some(inked) && (inked || !self.timing.is_lowering());
            #[cfg(not(feature = "pen-overlap"))]
            let must_move = self.pen_is_down != Some(inked);
            if must_move {
                if inked && self.wait_for_rising(queue)? {
                    return Ok(Progress::More);
                }
                self.move_pen(inked, queue)?;
                return Ok(Progress::More);
            }
            if !self.emitter.is_open() {
                self.emitter.hold(self.now, queue)?;
            }
        }
        if course.moves_done == 0 && !course.takes_up_backlash() && !is_shaped {
            let units = self.brake.step_length(course.move_length);
            queue.set_step_length(units, self.emitter.has_stepped())?;
        }
        let top = if inked { self.draw } else { self.timing.travel_top(self.travel) };
        let stopping = self.stopping && !self.timing.is_lowering();
        if let Some(jerk) = self.limits.jerk {
            let state = State { speed: self.plan_end.speed.to_bits(), ramp: self.ramp };
            let mut path_limits = PathLimits {
                limits: &self.limits,
                jerk,
                top: top.speed,
                room: course.room(),
                curve_limit: course.curve_limit,
                beyond: course.is_last_piece().then_some(&self.lookahead),
            };
            if stopping {
                let least = jerk.braking_distance(state, 0);
                if least <= path_limits.room {
                    path_limits.room = course.stop_behind(least);
                    (path_limits.top, path_limits.beyond) = (self.plan_end.speed, None);
                } else {
                    path_limits.top = SliceSpeed::ZERO;
                }
            }
            self.plan = Some(Plan::Interval(path_limits.next(state)));
            return self.planned(inked, at_rest, queue);
        }
        let left = course.left();
        if let Some(exit) = self.discarded_exit.take() {
            // The discarded plan would have reached this exit. The speed was rounded when it was
            // recovered by a square root, which must not make the exit unreachable.
            let bound = left.saturating_add(exit);
            self.plan_end.stopping_distance = self.plan_end.stopping_distance.min(bound);
        }
        let mut top = top;
        if course.curve_limit < top.stopping_distance {
            if self.curve.stopping_distance != course.curve_limit {
                self.curve = PathSpeed::of_stopping_distance(&self.limits, course.curve_limit);
            }
            top = self.curve;
        }
        let (length, exit_allowed) = if stopping {
            let least = u64::from(self.plan_end.stopping_distance.to_bits()) << 14;
            let length = course.to_whole_step(least).div_ceil(1 << 14) as u32;
            (PathLength::from_bits(length).min(left), PathLength::ZERO)
        } else {
            let is_last = course.is_last_piece();
            let exit_allowed = if is_last {
                self.lookahead.entry_allowed(top.stopping_distance, &self.limits)
            } else {
                PathLength::ZERO
            };
            let may_change =
                is_last && self.lookahead.is_short() && exit_allowed < top.stopping_distance;
            self.provisional_exit = may_change.then_some(exit_allowed);
            (left, exit_allowed)
        };
        // Constructed in place, because a copy costs as much as the plan.
        self.plan = Some(Plan::Profile(Profile::new(
            &self.limits,
            self.plan_end,
            length,
            top,
            exit_allowed,
        )));
        self.planned(inked, at_rest, queue)
    }

    /// Begins the next piece of a dotted line, or ends the block.
    fn end_piece(&mut self) {
        let Some(course) = &mut self.course else {
            return;
        };
        if !course.is_last_piece() {
            course.next_piece();
            return;
        }
        let length =
            if course.takes_up_backlash() { 0 } else { u64::from(course.drawn().to_bits()) };
        if course.ink.is_some() {
            self.run.drawn += length;
        } else {
            self.run.travelled += length;
        }
        self.course = None;
    }
}

/// Whether the machine may pass from one block to the next without coming to rest.
fn passes(before: Option<LineType>, after: Option<LineType>) -> bool {
    before == after && matches!(after, None | Some(LineType::Full))
}

#[cfg(test)]
mod tests;
