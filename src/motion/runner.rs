//! Carries out the blocks of the look-ahead: plans their speed slice by slice, and hands over the
//! events of moves, pen changes and dwells.
//!
//! The file is longer than 500 lines, because most of it are the short questions and orders of the
//! machine. What takes thought is in `append`, `plan` and `pen_moves`.

mod append;
#[cfg_attr(not(feature = "pen-overlap"), path = "runner/pen_at_rest.rs")]
mod pen;
mod pen_moves;
mod plan;
#[cfg(feature = "spread-backlash")]
mod reversals;
#[cfg(feature = "input-shaping")]
mod shaped;

use append::LastMove;
pub use append::{Chord, Move, PushError};
#[cfg(feature = "pen-overlap")]
pub use pen::PenOverlap;
use pen::PenTiming;
pub use pen_moves::PenPositions;
use plan::{Committed, Plan};
#[cfg(feature = "spread-backlash")]
pub use reversals::{BacklashTakeUp, Reversal};

use super::course::BlockCursor;
use super::curvature::Curvature;
use super::emitter::{LineLevels, MoveLevels, whole_ticks};
use super::junction::{self, Corner, Heading};
use super::lift::{Lift, LiftRule};
use super::limits::{mm_per_min, square};
use super::long_move::LongMove;
use super::lookahead::{BlockKind, is_in_line};
use super::profile::{FRACTION_BITS, PathSpeed, Profile, Slice};
#[cfg(feature = "input-shaping")]
use super::shaper::Shaper;
use super::smooth::{Interval, PathLimits, State};
use super::speed_limit::FeedOverride;
use super::{
    Block, BrakeRule, Emitter, EventQueue, Limits, Lookahead, PathLength, SLICE_TICKS, SliceSpeed,
    SpeedLimit, StepEvent,
};
use crate::drawing::{LineType, PagePoint};
use crate::fixed::Millimetres;
use crate::step::Direction;
use core::cmp::Ordering;

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
    /// The state of motion at the commit point, if nothing is planned from there on.
    committed: Committed,
    /// The greatest speed with the pen down.
    draw: PathSpeed,
    /// The greatest speed with the pen up.
    travel: PathSpeed,
    /// The last speed limit of a curve, cached because many blocks in a row have the same.
    curve: PathSpeed,
    /// The last limit of a block, and the speed that it allows, cached for the same reason.
    speed_limit: (SpeedLimit, PathSpeed),
    feed_override: FeedOverride,
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
    /// The last move appended.
    last: Option<LastMove>,
    /// The last chord that was another one than that move.
    other_chord: Option<Chord>,
    /// The last long move of the path that goes on.
    long: Option<LongMove>,
    /// The speed limit of the last move appended.
    last_limit: SpeedLimit,
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
            committed: Committed::REST,
            draw: PathSpeed::REST,
            travel: PathSpeed::REST,
            curve: PathSpeed::REST,
            speed_limit: (SpeedLimit::NONE, PathSpeed::REST),
            feed_override: FeedOverride::NONE,
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
            ink_bound: u64::MAX,
            position: PagePoint::default(),
            backlash: PagePoint::default(),
            backlash_end: PagePoint::default(),
            end: PagePoint::default(),
            page_end: PagePoint::default(),
            last: None,
            other_chord: None,
            long: None,
            last_limit: SpeedLimit::NONE,
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
        (self.last, self.other_chord) = (None, None);
        if pen.lift != self.pen.lift {
            self.forget_lift();
        }
        if pen.up_height != self.pen.up_height {
            // The pen is raised to the new height before anything else moves.
            self.pen_is_down = None;
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
        let end = self.planned_speed().to_bits();
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
        mm_per_min(self.planned_speed())
    }

    /// How many more targets fit now.
    pub fn room(&self) -> usize {
        self.lookahead.capacity() - self.lookahead.len()
    }

    /// Scales both speeds and all feeds to `percent` (10 to 200) at once, and the speed with the
    /// pen up to `travel_percent` (1 to 100) of the result. None exceeds the greater of the two
    /// speeds that are set.
    pub fn set_override(&mut self, percent: u8, travel_percent: u8) {
        let percent = percent.clamp(10, 200);
        self.feed_override = FeedOverride::new(&self.limits, percent);
        self.lookahead.set_override(self.feed_override);
        self.speed_limit = (SpeedLimit::NONE, PathSpeed::REST);
        let percent = u64::from(percent);
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
        self.replan();
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

    /// Whether the last move appended is inked and leaves the pen at this position of the page.
    #[cfg(feature = "hpgl")]
    pub fn inks_to(&self, point: PagePoint) -> bool {
        self.page_end == point && self.last.is_some_and(|last| last.ink.is_some())
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
    #[cfg(any(feature = "resume", feature = "spread-backlash"))]
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

    /// Begins to slow down on the path with the next slice or interval, until the machine is at
    /// rest on a whole step with the pen raised. If the pen was already told to go down on a
    /// travel, the travel is completed first.
    pub fn stop(&mut self) {
        self.replan();
        self.stopping = true;
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

    /// Whether the runner is to stop before the next travel.
    pub fn pauses(&self) -> bool {
        self.stopping_after_stroke || self.run.drawn >= self.ink_bound
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
            let most = if self.in_stroke { Slice::MOST } else { Slice::MOST_OF_TRAVEL };
            let slice = match &mut self.plan {
                None => {
                    let progress = self.plan(queue)?;
                    if self.plan.is_none() {
                        return Ok(progress);
                    }
                    continue;
                }
                Some(Plan::Profile { profile, .. }) => profile.next_slice(&self.limits, most),
                Some(Plan::Interval(interval)) => interval.next_slice(course.room(), most),
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

    fn begin_block(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        let stroke_ends =
            self.in_stroke && self.lookahead.front().is_some_and(|block| block.ink.is_none());
        let stops = self.stopping || (stroke_ends && self.pauses());
        if stops && self.plan.is_none() && self.committed == Committed::REST {
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

    /// Delays the plan to the time `at`, until which the pins needed.
    fn advance_to(&mut self, at: u32) {
        let late = at.wrapping_sub(whole_ticks(self.now));
        self.now = self.now.wrapping_add(late);
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

#[cfg(test)]
mod tests;
