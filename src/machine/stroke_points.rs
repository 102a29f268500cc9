//! Points within long strokes at which the machine rests, so that a board can keep how far it has
//! come: a job that is interrupted goes on there, and not at the beginning of a stroke that took
//! hours.
//!
//! [`Setting::PointDistance`] says how much of a stroke is drawn from one such point to the next.
//! The pen stays on the paper; it stands for the time that the flash takes, a few milliseconds. The
//! points depend on the path alone, so they are found again when the job goes on. They lie where
//! straight pieces of full lines end. Broken lines have none, since their pattern would begin anew.

use super::{Machine, Setting, Target};
use crate::drawing::{LineType, PagePoint};
use crate::motion::{EventQueue, PathLength};

/// Counts the points along a path at which the machine rests within strokes.
#[derive(Debug, Clone, Copy, Default)]
pub struct StrokePoints {
    /// The number of points passed, from the beginning of the path.
    pub passed: u32,
    /// How much of the stroke is drawn since the last point or its beginning, in 2^-18 mm.
    drawn: u64,
    /// How much of it is drawn from one point to the next; 0 if there are none.
    distance: u64,
}

impl StrokePoints {
    /// Begins where this many points have been passed. There is one after each `distance` of a
    /// stroke, in 2^-18 mm; 0 for none.
    pub const fn new(passed: u32, distance: u64) -> Self {
        Self { passed, drawn: 0, distance }
    }

    /// Goes on to a target that is `length` away, in 2^-18 mm. Returns whether a point lies there.
    pub fn pass(&mut self, target: Target, length: u64) -> bool {
        self.drawn = match target.ink {
            Some(LineType::Full) => self.drawn.saturating_add(length),
            _ => 0,
        };
        let is_point = self.distance > 0 && self.drawn >= self.distance;
        if is_point {
            self.drawn = 0;
            self.passed = self.passed.saturating_add(1);
        }
        is_point
    }
}

/// How far the machine has come with a rest within a stroke.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum StrokeRest {
    /// No rest is due.
    #[default]
    None,
    /// No target is read any more before the rest.
    Due,
    /// The path was ended there, so that the machine comes to rest.
    Ended,
    /// The machine is planned to rest there, with the pen on the paper.
    Planned,
}

impl Machine<'_> {
    /// How much of a stroke is drawn from one point at which the machine rests to the next, in
    /// 2^-18 mm; 0 if it does not rest.
    pub fn point_distance(&self) -> u64 {
        // Converts units of 2^-16 m.
        u64::from(self.settings.get(Setting::PointDistance).to_bits().unsigned_abs()) * 4000
    }

    /// The length of a straight move between two points of the page, in 2^-18 mm.
    pub fn length(&self, [from, to]: [PagePoint; 2]) -> u64 {
        let (dx, dy) = (to.x.wrapping_sub(from.x), to.y.wrapping_sub(from.y));
        self.runner.limits().length(dx, dy).map_or(0, |length| length.to_bits().into())
    }

    /// The number of points at which a job that begins now was before.
    pub(super) fn begin_points(&mut self, passed: u32) {
        self.points = StrokePoints::new(passed, self.point_distance());
        self.rest = StrokeRest::None;
    }

    /// Goes on to a target of the job that has just been appended. If a point lies there, no other
    /// target is read until the machine has rested.
    // It is called for each target, most of them in jobs without points.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub(super) fn pass_point(&mut self, target: Target, length: PathLength) {
        if self.points.distance > 0 {
            self.pass_next_point(target, length);
        }
    }

    /// Carries out [`Machine::pass_point`] in a job with points.
    #[inline(never)] // Inlined, it would take room where steps are planned.
    fn pass_next_point(&mut self, target: Target, length: PathLength) {
        if self.points.pass(target, length.to_bits().into()) {
            self.rest = StrokeRest::Due;
        }
    }

    /// Whether targets may be read: no rest is due.
    pub(super) fn reads_on(&self) -> bool {
        self.rest == StrokeRest::None
    }

    /// Plans the machine to its rest, if one is due, and goes on once that is noted. Returns
    /// whether the machine has to wait for that.
    // It is called for each slice, most of them without a rest.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub(super) fn rests_in_stroke(&mut self, queue: &mut dyn EventQueue) -> bool {
        self.rest != StrokeRest::None && self.plan_rest(queue)
    }

    /// Plans the machine to the rest that is due. Returns whether nothing can be planned now.
    #[cold]
    #[inline(never)]
    fn plan_rest(&mut self, queue: &mut dyn EventQueue) -> bool {
        if self.rest == StrokeRest::Due && self.segmenter.is_none() {
            // The pen rests where the stroke goes on after a loss of power.
            #[cfg(feature = "spread-backlash")]
            if self.owes_backlash() && !self.push_backlash_due() {
                // There is no room yet.
                return false;
            }
            self.runner.end_path();
            self.rest = StrokeRest::Ended;
        }
        if self.rest == StrokeRest::Ended && self.runner.has_run_all() {
            if queue.room() < crate::motion::Runner::ROOM {
                return true;
            }
            match self.runner.rest_on_paper(queue) {
                Ok(true) => self.rest = StrokeRest::Planned,
                Ok(false) => return true,
                Err(_) => {
                    self.alarm(super::Alarm::Queue);
                    return true;
                }
            }
        }
        if self.rest == StrokeRest::Planned && !self.log.is_open() {
            self.rest = StrokeRest::None;
        }
        self.rest == StrokeRest::Planned
    }

    /// Returns how many points have been passed if the machine rests at a point within a stroke
    /// that is not noted yet. [`Machine::point_noted`] lets it continue.
    // It is called in every turn of the main loop.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    pub fn point_to_note(&self) -> Option<u32> {
        (self.rest == StrokeRest::Planned && self.is_stopped()).then_some(self.points.passed)
    }

    /// What [`Machine::point_to_note`] said has been noted.
    pub fn point_noted(&mut self) {
        self.rest = StrokeRest::None;
    }
}
