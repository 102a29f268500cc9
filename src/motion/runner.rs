//! Runs the blocks: pen changes at rest, slices, moves, events.

#[cfg_attr(not(feature = "pen-overlap"), path = "runner/pen_at_rest.rs")]
mod pen;
#[cfg(feature = "backlash-on-the-way")]
mod turns;

#[cfg(feature = "pen-overlap")]
pub use pen::PenOverlap;
use pen::PenTiming;
#[cfg(feature = "backlash-on-the-way")]
pub use turns::{OnTheWay, Turn};

use super::course::BlockCursor;
use super::curvature::Curvature;
use super::emitter::{Kinds, MoveLevels, whole_ticks};
use super::junction::{self, Corner, Heading};
use super::lift::{Lift, LiftRule};
use super::limits::{mm_per_min, square};
use super::lookahead::BlockKind;
use super::profile::{FRACTION_BITS, Pace, Profile};
use super::smooth::{Interval, Road, State};
use super::{
    Block, BrakeRule, Emitter, EventQueue, Limits, Lookahead, PathLength, SLICE_TICKS, SliceSpeed,
    StepEvent,
};
use crate::drawing::{LineType, PagePoint};
use crate::fixed::Millimetres;
use crate::step::Direction;
use core::cmp::Ordering;

/// Where the pen stands and how long it takes to get there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PenPositions {
    /// Height when raised, 0 (fully raised) to 127.
    pub up_height: u8,
    /// Height when drawing, 0 to 127.
    pub down_height: u8,
    /// From the order to raise it to the first move.
    pub up_ticks: u32,
    /// From the order to lower it to the first move.
    pub down_ticks: u32,
    /// From one height to the next on the way between the two; 0 for no way.
    pub ramp_ticks: u32,
    /// Length of a dot or gap.
    pub dot_length: PathLength,
    /// The motor that lifts it, if that is how it is lifted.
    pub lift: Option<LiftRule>,
    /// For how long it moves while the machine does.
    #[cfg(feature = "pen-overlap")]
    pub overlap: PenOverlap,
}

/// What one call of [`Runner::produce`] came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// There is more to do.
    More,
    /// All blocks are run, the pen is raised, the machine stands.
    Done,
    /// It stands on the path with the pen raised, as [`Runner::stop`] or
    /// [`Runner::stop_after_stroke`] asked.
    Stopped,
}

/// A straight move of the pen, or a piece of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Move {
    /// Where it takes the motors.
    pub motors: PagePoint,
    /// How far start and end lie beside the motors' steps: see
    /// [`Line::beside`](crate::step::Line::beside).
    pub offsets: [i16; 2],
    /// Where it takes the pen.
    pub page: PagePoint,
    /// The whole move on the page,
    pub way: (i32, i32),
    /// its length,
    pub whole: PathLength,
    /// and that of the piece.
    pub length: PathLength,
    /// The pen is raised within an inked line.
    pub is_gap: bool,
}

/// Why a block was not appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PushError {
    /// The ring is full: produce events first.
    Full,
    /// The move is longer than 16 m: beyond every page.
    TooLong,
}

/// What a runner has run. Lengths in units of 2^-18 mm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RunLengths {
    /// Strokes begun; wraps.
    pub strokes: u32,
    /// Length of the blocks ended with the pen down.
    pub drawn: u64,
    /// The same with the pen up.
    pub travelled: u64,
}

/// The speed planned.
#[derive(Debug)]
enum Plan {
    /// For the rest of the piece in work.
    Profile(Profile),
    /// With a limit on jerk, for an interval of time, whatever ends in it.
    Interval(Interval),
}

/// Turns blocks into events.
#[derive(Debug)]
pub struct Runner<'m> {
    limits: Limits,
    brake: BrakeRule,
    pen: PenPositions,
    lookahead: Lookahead<'m>,
    curvature: Curvature,
    emitter: Emitter,
    course: Option<BlockCursor>,
    plan: Option<Plan>,
    /// Where the last plan ended.
    pace: Pace,
    /// The acceleration there, with a limit on jerk.
    ramp: i32,
    draw: Pace,
    travel: Pace,
    /// The last pace in a curve: many blocks in a row have the same.
    curve: Pace,
    /// The plan's time, 1/16 ticks; wraps.
    now: u32,
    /// Not known after an emergency stop, when it may still be on its way.
    pen_is_down: Option<bool>,
    /// Where the pen was sent last; not known at the start.
    pen_height: Option<u8>,
    lift: Lift,
    timing: PenTiming,
    stopping: bool,
    stopping_after_stroke: bool,
    /// How fast the piece in work was allowed to end, if more blocks may allow it to be faster.
    hurried: Option<PathLength>,
    /// How fast the plan that was thrown away would have ended the piece in work.
    exit_reached: Option<PathLength>,
    /// Stands after the stroke in which so much is drawn, all in all.
    ink_bound: u64,
    /// Where the events so far lead.
    position: PagePoint,
    /// Where the steps so far lead that take up slack, and where the blocks so far do.
    slack: PagePoint,
    slack_end: PagePoint,
    /// Where the blocks so far lead: the motors, and the pen on the page.
    end: PagePoint,
    page_end: PagePoint,
    /// The way in which the last block runs, its length and ink.
    last: Option<(Heading, PathLength, Option<LineType>)>,
    /// The stopping distance of its speed.
    last_limit: PathLength,
    run: RunLengths,
    /// Whether the last block begun is inked.
    in_stroke: bool,
    /// Since the pen last moved, speeds were greater: what waits may still be as fast.
    was_faster: SliceSpeed,
    /// When the pen was last told to go up, in ticks of the events; wraps.
    #[cfg(feature = "resume")]
    raised_at: u32,
    #[cfg(feature = "backlash-on-the-way")]
    turns: turns::Turns,
    /// What the next move is, besides a move.
    #[cfg(feature = "backlash-on-the-way")]
    on_the_way: OnTheWay,
}

impl<'m> Runner<'m> {
    /// Room in the queue that one call of [`Runner::produce`] needs at least.
    pub const ROOM: usize = Emitter::ROOM;

    /// A runner that stands at the page's origin with the pen raised.
    pub fn new(limits: Limits, pen: PenPositions, blocks: &'m mut [Block]) -> Self {
        let mut runner = Self {
            limits,
            brake: BrakeRule::default(),
            pen,
            lookahead: Lookahead::new(blocks),
            curvature: Curvature::default(),
            emitter: Emitter::new(&limits),
            course: None,
            plan: None,
            pace: Pace::REST,
            ramp: 0,
            draw: Pace::REST,
            travel: Pace::REST,
            curve: Pace::REST,
            now: 0,
            // A motor holds it where it happened to stand.
            pen_is_down: pen.lift.is_none().then_some(false),
            pen_height: None,
            lift: Lift::default(),
            timing: PenTiming::new(),
            #[cfg(feature = "resume")]
            raised_at: 0,
            stopping: false,
            stopping_after_stroke: false,
            hurried: None,
            exit_reached: None,
            ink_bound: u64::MAX,
            position: PagePoint::default(),
            slack: PagePoint::default(),
            slack_end: PagePoint::default(),
            end: PagePoint::default(),
            page_end: PagePoint::default(),
            last: None,
            last_limit: PathLength::ZERO,
            run: RunLengths::default(),
            in_stroke: false,
            was_faster: SliceSpeed::ZERO,
            #[cfg(feature = "backlash-on-the-way")]
            turns: turns::Turns::default(),
            #[cfg(feature = "backlash-on-the-way")]
            on_the_way: OnTheWay::default(),
        };
        runner.set_limits(limits, pen);
        runner
    }

    /// Takes new settings, while nothing moves.
    pub fn set_limits(&mut self, limits: Limits, pen: PenPositions) {
        self.limits = limits;
        self.curve = Pace::REST;
        if pen.lift != self.pen.lift {
            self.forget_lift();
        }
        self.pen = pen;
        self.emitter.set_limits(&limits);
        self.lookahead.pass_limits_on(limits.jerk.is_none());
        self.set_override(100, 100);
    }

    /// The rule by which the lengths of steps are told, while nothing moves.
    pub fn set_brake(&mut self, brake: BrakeRule) {
        self.brake = brake;
    }

    /// How long the events that wait must last so that the machine can stop within them, wherever
    /// in them it is, no matter what comes behind.
    ///
    /// Events that end at a speed u and last t hold the stopping distance of every speed v in them
    /// if t ≥ (v - (√2 - 1) u) / a: then the plan is slower in between, or goes far enough.
    pub fn stopping_ticks(&self) -> u32 {
        let end = match &self.plan {
            Some(Plan::Profile(profile)) => profile.speed().to_bits(),
            Some(Plan::Interval(interval)) => interval.state().speed,
            None => self.pace.speed.to_bits(),
        };
        let speed = self.top(self.in_stroke).speed.max(self.was_faster).to_bits();
        let change = speed.saturating_sub(end / 8 * 3);
        let slices = change.checked_div(self.limits.acceleration.to_bits()).unwrap_or(u32::MAX);
        slices.saturating_mul(SLICE_TICKS)
    }

    /// The speed that is planned, in mm/min.
    pub fn speed(&self) -> Millimetres {
        let speed = match &self.plan {
            Some(Plan::Profile(profile)) => profile.speed().to_bits(),
            Some(Plan::Interval(interval)) => interval.state().speed,
            None => self.pace.speed.to_bits(),
        };
        mm_per_min(SliceSpeed::from_bits(speed))
    }

    /// How many more targets fit now.
    pub fn room(&self) -> usize {
        self.lookahead.capacity() - self.lookahead.len()
    }

    /// Scales both speeds to `percent` (10 to 200), at once, and that with the pen up to
    /// `travel_percent` (1 to 100) of this; never above the greater of the two as set.
    pub fn set_override(&mut self, percent: u8, travel_percent: u8) {
        let percent = u64::from(percent.clamp(10, 200));
        let travel_percent = percent * u64::from(travel_percent.clamp(1, 100)) / 100;
        let greatest = self.limits.draw_speed.max(self.limits.travel_speed);
        let scaled = |speed: SliceSpeed, percent: u64| {
            let bits = u64::from(speed.to_bits()) * percent / 100;
            let bits = bits.min(greatest.to_bits().into()).max(1);
            Pace::of_speed(&self.limits, SliceSpeed::from_bits(bits as u32))
        };
        let draw = scaled(self.limits.draw_speed, percent);
        let travel = scaled(self.limits.travel_speed, travel_percent);
        self.was_faster = self.was_faster.max(self.top(self.in_stroke).speed);
        self.draw = draw;
        self.travel = travel;
        self.plan_again();
    }

    /// The limits in force.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Where the events handed over, and the one kept back, lead.
    pub fn position(&self) -> PagePoint {
        self.position
    }

    /// Where the blocks lead the motors.
    pub fn end(&self) -> PagePoint {
        self.end
    }

    /// Where the blocks lead the pen.
    pub fn page_end(&self) -> PagePoint {
        self.page_end
    }

    /// Ticks of all events handed over; wraps.
    pub fn ticks(&self) -> u32 {
        self.emitter.ticks()
    }

    /// How many targets fit in all.
    pub fn capacity(&self) -> usize {
        self.lookahead.capacity()
    }

    /// Whether no more targets fit now.
    pub fn is_full(&self) -> bool {
        self.lookahead.is_full()
    }

    /// Whether nothing waits or moves.
    pub fn is_at_rest(&self) -> bool {
        self.course.is_none() && self.lookahead.is_empty() && !self.emitter.is_open()
    }

    /// Whether all blocks are run. The pen is where it was with the last one.
    #[cfg(feature = "resume")]
    pub fn has_run_all(&self) -> bool {
        self.course.is_none() && self.lookahead.is_empty()
    }

    /// Ends the events of all blocks that are run, and leaves the pen where it is.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    #[cfg(feature = "resume")]
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub fn rest_on_paper(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        if self.emitter.is_open() {
            let at = self.emitter.rest(self.now, true, queue)?;
            self.advance_to(at);
        }
        Ok(())
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

    /// Whether the pen is up once the pins have begun events of so many `ticks` in all.
    #[cfg(feature = "resume")]
    pub fn is_pen_up_at(&self, ticks: u32) -> bool {
        self.is_pen_up() && ticks.wrapping_sub(self.raised_at).cast_signed() > 0
    }

    /// How many strokes are planned to their end; wraps.
    #[cfg(feature = "resume")]
    pub fn strokes_over(&self) -> u32 {
        let next_is_travel = self.lookahead.front().is_some_and(|block| block.ink.is_none());
        let is_over = !self.in_stroke || (self.course.is_none() && next_is_travel);
        self.run.strokes.wrapping_sub(u32::from(!is_over))
    }

    /// The pen was raised by somebody else and may still be on its way.
    pub fn forget_pen(&mut self) {
        self.pen_is_down = None;
        self.pen_height = None;
        self.forget_timing();
    }

    /// The pen's motor had no current: where it stands is not known.
    pub fn forget_lift(&mut self) {
        self.lift.forget();
        self.forget_pen();
    }

    /// The pins have worked off so many ticks: they may have found the stop of the pen's motor.
    pub fn follow_lift(&mut self, ticks: u32) {
        self.lift.sync_consumed(ticks);
    }

    /// The pulses of the pen's motor sum up to `place`, and none waits.
    pub fn set_lift(&mut self, place: i32) {
        self.lift.stand_at(place);
    }

    /// Whether a motor has still to raise the pen. Where it is not known how far, only if
    /// `anywhere`.
    pub fn is_pen_held(&self, anywhere: bool) -> bool {
        let is_lowered = self.pen_is_down != Some(false) && (anywhere || self.lift.is_known());
        self.pen.lift.is_some() && (is_lowered || self.emitter.is_open())
    }

    /// Hands over the next few events of a pen that is raised while nothing else moves.
    ///
    /// # Errors
    /// The event that the queue refused although it had room.
    pub fn raise_pen(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        self.stand(Progress::Done, queue)
    }

    /// What has been run since the runner was made.
    pub fn run(&self) -> RunLengths {
        self.run
    }

    /// The motors stand at `motors` and have taken up `slack`, the pen at `page`, nothing waits,
    /// and the events worked off took `ticks` (it wraps): after homing, or after an emergency stop.
    pub fn set_position(
        &mut self,
        motors: PagePoint,
        slack: PagePoint,
        page: PagePoint,
        ticks: u32,
    ) {
        self.position = motors;
        self.slack = slack;
        #[cfg(feature = "backlash-on-the-way")]
        self.turns.clear();
        self.forget_path(page);
        self.emitter.restart(ticks);
    }

    /// Appends a move; a speed, by its stopping distance ([`Limits::feed`]), is not passed.
    /// Lengths, corners and bends are those of the page. A move of no length is skipped.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push(
        &mut self,
        piece: &Move,
        ink: Option<LineType>,
        limit: PathLength,
    ) -> Result<(), PushError> {
        let Move { motors, offsets, page, mut way, mut whole, mut length, is_gap } = *piece;
        let (dx, dy) = (motors.x - self.end.x, motors.y - self.end.y);
        if dx == 0 && dy == 0 {
            // The pen may stand only about there.
            self.page_end = page;
            return Ok(());
        }
        if way == (0, 0) || length == 0 {
            // Less than a step of the page.
            way = (dx.signum(), dy.signum());
            whole = self.limits.length(way.0, way.1).ok_or(PushError::TooLong)?;
            length = whole;
        }
        let inked = ink.filter(|_| !is_gap);
        let heading = Heading::new(&self.limits, way.0, way.1, whole);
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
        #[cfg(feature = "backlash-on-the-way")]
        let (kind, extra) = core::mem::take(&mut self.on_the_way).of_block(kind);
        let block = Block {
            dx,
            dy,
            length,
            entry_limit,
            curve_limit,
            ink,
            offsets,
            kind,
            #[cfg(feature = "backlash-on-the-way")]
            extra,
            ..Block::EMPTY
        };
        // Between two blocks the speed is looked at.
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
            self.curvature.sync_consumed(&self.limits, page, &mut self.lookahead);
        }
        self.end = motors;
        self.page_end = page;
        self.last = Some((heading, length, inked));
        self.heed_bends();
        if self
            .hurried
            .is_some_and(|exit| exit < self.lookahead.entry_allowed(PathLength::MAX, &self.limits))
        {
            self.hurried = None;
            self.plan_again();
        }
        Ok(())
    }

    /// Appends steps by which the motors take up their slack, from rest to rest; the pen stays
    /// where it is, lowered if `ink` says so. Where the pen may move while the machine does, it is
    /// still raised if these steps come before a stroke.
    ///
    /// # Errors
    /// See [`PushError`]; nothing is appended then.
    pub fn push_slack(&mut self, by: PagePoint, ink: Option<LineType>) -> Result<(), PushError> {
        let PagePoint { x: dx, y: dy } = by;
        let length = self.limits.length(dx, dy).ok_or(PushError::TooLong)?;
        let ink = ink.map(|_| LineType::Full);
        let block = Block { dx, dy, length, ink, kind: BlockKind::Slack, ..Block::EMPTY };
        self.end_path();
        self.lookahead.push(block).map_err(|_| PushError::Full)?;
        self.slack_end.x = self.slack_end.x.wrapping_add(dx);
        self.slack_end.y = self.slack_end.y.wrapping_add(dy);
        Ok(())
    }

    /// The slack that the blocks that wait take up: what [`Runner::forget_path`] forgets of it.
    pub fn slack_ahead(&self) -> PagePoint {
        PagePoint {
            x: self.slack_end.x.wrapping_sub(self.slack.x),
            y: self.slack_end.y.wrapping_sub(self.slack.y),
        }
    }

    /// All slack taken up so far; wraps.
    pub fn slack(&self) -> PagePoint {
        self.slack
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

    /// The path ends with the last block: a curve ends there, too.
    pub fn end_path(&mut self) {
        self.curvature.restart(&self.limits, self.page_end, &mut self.lookahead);
        self.last = None;
        self.heed_bends();
    }

    /// Slows down for bends that are known only now: on the piece in work, or behind a cruise that
    /// would pass one too fast.
    #[inline(never)] // Inlined, it would only fill the cache.
    fn heed_bends(&mut self) {
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

    /// Sheds speed on the path, from the next slice or interval on, and stands on a whole step with
    /// the pen raised. A travel on which the pen was told to go down is carried out first.
    pub fn stop(&mut self) {
        self.plan_again();
        self.stopping = true;
    }

    /// Gives the plan up where that leaves no kink. An interval in which the acceleration changes
    /// is carried out: at most 42 ms, and 1.3 ms from a jerk of 20 m/s³ at 800 mm/s² on. So is the
    /// rest of a travel on which the pen was told to go down.
    fn break_plan_off(&mut self) -> Option<PathLength> {
        if self.timing.is_lowering() {
            return None;
        }
        match &self.plan {
            Some(Plan::Interval(interval)) if interval.changes() => None,
            _ => self.give_plan_up(),
        }
    }

    /// The plan ends with the last slice that it gave. Says how fast it would have ended the piece
    /// in work, if it was to.
    fn give_plan_up(&mut self) -> Option<PathLength> {
        match self.plan.take()? {
            Plan::Profile(profile) => {
                self.pace = Pace::of_speed(&self.limits, profile.speed());
                Some(profile.exit().stopping_distance)
            }
            Plan::Interval(interval) => {
                let State { speed, ramp } = interval.state();
                self.pace = Pace { speed: SliceSpeed::from_bits(speed), ..Pace::REST };
                self.ramp = ramp;
                None
            }
        }
    }

    /// Plans the rest of the piece in work anew, from the next slice on.
    fn plan_again(&mut self) {
        if !self.stopping
            && let Some(exit) = self.break_plan_off()
        {
            self.exit_reached = Some(exit);
        }
    }

    /// Stands before the next move with the pen up.
    pub fn stop_after_stroke(&mut self) {
        self.stopping_after_stroke = true;
    }

    /// Stands before the next move with the pen up once `length` more, in units of 2^-18 mm, is
    /// drawn; `None` for no bound.
    pub fn stop_after_ink(&mut self, length: Option<u64>) {
        self.ink_bound = length.map_or(u64::MAX, |length| self.run.drawn.saturating_add(length));
    }

    /// Goes on where [`Runner::stop`] or [`Runner::stop_after_stroke`] stood.
    pub fn resume(&mut self) {
        self.stopping = false;
        self.stopping_after_stroke = false;
        if let Some(course) = &mut self.course {
            course.resume();
        }
    }

    /// Gives up what waits; the machine must stand, the pen at `page`.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub fn forget_path(&mut self, page: PagePoint) {
        self.lookahead.clear();
        self.course = None;
        self.rest();
        self.stopping = false;
        self.stopping_after_stroke = false;
        self.exit_reached = None;
        self.last = None;
        self.in_stroke = false;
        self.end = self.position;
        self.slack_end = self.slack;
        self.page_end = page;
        #[cfg(feature = "backlash-on-the-way")]
        {
            self.on_the_way = OnTheWay::default();
        }
    }

    /// Lets `ticks` pass; nothing must wait or move.
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

    /// Switches the drivers off; nothing must wait or move.
    ///
    /// # Errors
    /// The event that the queue refused.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
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
            self.lower_on_the_way(queue)?;
        }
        self.run_slice(queue)?;
        Ok(Progress::More)
    }

    /// The plan is carried out, or has led to the end of the piece in work.
    fn end_plan(&mut self) {
        let Some(course) = &self.course else {
            return;
        };
        let ends = match &self.plan {
            Some(Plan::Profile(profile)) => {
                self.pace = profile.exit();
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

    /// Nothing moves.
    fn rest(&mut self) {
        self.plan = None;
        self.pace = Pace::REST;
        self.ramp = 0;
    }

    /// The moves of the slice in work, as far as the queue has room.
    fn run_slice(&mut self, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        let Some(course) = &mut self.course else {
            return Ok(());
        };
        let Some(slice) = course.slice.map(|moves| moves.slice) else {
            return Ok(());
        };
        // A move and its direction set-up are two events; one is left for a long wait.
        let mut room = (queue.room().saturating_sub(1)) / 2;
        // One by one: arrays would go through memory.
        let [straight, diagonal] = course.line.moves();
        let levels = |direction: Direction| {
            let levels = MoveLevels::of(direction);
            if course.is_slack() { levels.as_slack() } else { levels }
        };
        let levels = Kinds { straight: levels(straight), diagonal: levels(diagonal) };
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
            let turning =
                (self.emitter.turns(levels.straight), self.emitter.turns(levels.diagonal));
            let turns = turning != (false, false) && {
                let diagonals = course.line.diagonals_within(count);
                (turning.0 && diagonals < count) || (turning.1 && diagonals > 0)
            };
            let is_even = !turns && !course.is_slack() && self.emitter.has_stepped();
            let stepped = if is_even && self.emitter.keeps_up(&train) {
                self.emitter.steps(self.now, train, &mut course.line, levels, queue)?
            } else {
                self.emitter.single_steps(self.now, train, &mut course.line, levels, queue)?
            };
            self.now = self.now.wrapping_add(stepped.late);
            let place = if course.is_slack() { &mut self.slack } else { &mut self.position };
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

    fn top(&self, inked: bool) -> Pace {
        if inked { self.draw } else { self.travel }
    }

    fn begin_block(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        let stroke_ends =
            self.in_stroke && self.lookahead.front().is_some_and(|block| block.ink.is_none());
        let pauses = self.stopping_after_stroke || self.run.drawn >= self.ink_bound;
        let stops = self.stopping || (pauses && stroke_ends);
        if stops && self.plan.is_none() && self.pace == Pace::REST {
            return self.stand(Progress::Stopped, queue);
        }
        let dot_length = self.pen.dot_length;
        let Self { course, lookahead, .. } = self;
        let begun = lookahead.pop(|block| {
            *course = Some(BlockCursor::new(block, dot_length));
        });
        if begun.is_none() {
            return self.stand(Progress::Done, queue);
        }
        let Some(course) = &self.course else {
            return Ok(Progress::More);
        };
        if course.ink.is_some() && !self.in_stroke {
            self.run.strokes = self.run.strokes.wrapping_add(1);
        }
        self.in_stroke = course.ink.is_some();
        #[cfg(feature = "backlash-on-the-way")]
        if course.turns() {
            self.turns.add(Turn::new(self.emitter.ticks(), self.position, self.slack));
        }
        if self.plan.is_some() {
            // The interval in work goes on with these moves.
            let units = self.brake.step_length(course.move_length);
            queue.set_step_length(units, self.emitter.has_stepped())?;
        }
        Ok(Progress::More)
    }

    /// Stands: raises the pen, then closes the time line.
    fn stand(
        &mut self,
        standing: Progress,
        queue: &mut dyn EventQueue,
    ) -> Result<Progress, StepEvent> {
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

    /// The pen goes up or down, or one height further on its ramp; at the end the dwell passes. At
    /// most four events.
    fn move_pen(&mut self, down: bool, queue: &mut dyn EventQueue) -> Result<(), StepEvent> {
        let (height, dwell) = if down {
            (self.pen.down_height, self.pen.down_ticks)
        } else {
            (self.pen.up_height, self.pen.up_ticks)
        };
        if let Some(passed) = self.lowered_on_the_way(down) {
            return self.dwell_for_pen(down, dwell.saturating_sub(passed), queue);
        }
        // On its way it is neither up nor down.
        self.pen_is_down = None;
        self.was_faster = SliceSpeed::ZERO;
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
        // Where it stands if that is not known: at the start, and after an emergency stop.
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

    /// The height at which the pen is next on its way from one to another.
    fn next_height(&self, from: u8, to: u8) -> u8 {
        match to.cmp(&from) {
            _ if self.pen.ramp_ticks == 0 || self.pen.lift.is_some() => to,
            Ordering::Less => from - 1,
            Ordering::Equal => to,
            Ordering::Greater => from + 1,
        }
    }

    /// The dwell passes of a pen that was told its last height.
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

    /// The pins needed until then: the plan waits for them.
    fn advance_to(&mut self, at: u32) {
        let late = at.wrapping_sub(whole_ticks(self.now));
        self.now = self.now.wrapping_add(late);
    }

    /// Plans the rest of the piece in work.
    fn plan(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        let Some(course) = &mut self.course else {
            return Ok(Progress::More);
        };
        let at_rest = self.pace == Pace::REST;
        if self.stopping && at_rest {
            return self.stand(Progress::Stopped, queue);
        }
        #[cfg(not(feature = "pen-overlap"))]
        let inked = course.is_inked();
        #[cfg(feature = "pen-overlap")]
        let inked = {
            let stays_raised = PenTiming::stays_raised(&self.pen, self.pen_is_down);
            course.is_inked() && !(stays_raised && course.is_slack())
        };
        if at_rest {
            // On the way to a stroke, motors may stand before they take up their slack.
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
        if course.moves_done == 0 && !course.is_slack() {
            let units = self.brake.step_length(course.move_length);
            queue.set_step_length(units, self.emitter.has_stepped())?;
        }
        let top = if inked { self.draw } else { self.timing.travel_top(self.travel) };
        let stopping = self.stopping && !self.timing.is_lowering();
        if let Some(jerk) = self.limits.jerk {
            let state = State { speed: self.pace.speed.to_bits(), ramp: self.ramp };
            let mut road = Road {
                limits: &self.limits,
                jerk,
                top: top.speed,
                room: course.room(),
                curve_limit: course.curve_limit,
                beyond: course.is_last_piece().then_some(&self.lookahead),
            };
            if stopping {
                let least = jerk.braking_distance(state, 0);
                if least <= road.room {
                    road.room = course.stop_behind(least);
                    (road.top, road.beyond) = (self.pace.speed, None);
                } else {
                    road.top = SliceSpeed::ZERO;
                }
            }
            self.plan = Some(Plan::Interval(road.next(state)));
            return self.planned(inked, at_rest, queue);
        }
        let left = course.left();
        if let Some(exit) = self.exit_reached.take() {
            // It was within reach; the root that gave the speed back must not deny it.
            let bound = left.saturating_add(exit);
            self.pace.stopping_distance = self.pace.stopping_distance.min(bound);
        }
        let mut top = top;
        if course.curve_limit < top.stopping_distance {
            if self.curve.stopping_distance != course.curve_limit {
                self.curve = Pace::of_stopping_distance(&self.limits, course.curve_limit);
            }
            top = self.curve;
        }
        let (length, exit_allowed) = if stopping {
            let least = u64::from(self.pace.stopping_distance.to_bits()) << 14;
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
            self.hurried = may_change.then_some(exit_allowed);
            (left, exit_allowed)
        };
        // No copies: they cost as much as the plan.
        self.plan =
            Some(Plan::Profile(Profile::new(&self.limits, self.pace, length, top, exit_allowed)));
        self.planned(inked, at_rest, queue)
    }

    /// The next piece of a dotted line, or the end of the block.
    fn end_piece(&mut self) {
        let Some(course) = &mut self.course else {
            return;
        };
        if !course.is_last_piece() {
            course.next_piece();
            return;
        }
        let length = if course.is_slack() { 0 } else { u64::from(course.drawn().to_bits()) };
        if course.ink.is_some() {
            self.run.drawn += length;
        } else {
            self.run.travelled += length;
        }
        self.course = None;
    }
}

/// Whether the machine may pass from one block to the next without standing.
fn passes(before: Option<LineType>, after: Option<LineType>) -> bool {
    before == after && matches!(after, None | Some(LineType::Full))
}

#[cfg(test)]
mod tests;
