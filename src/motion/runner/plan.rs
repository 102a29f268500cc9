//! Plans the speed of the current piece, and plans it again when something changes.
//!
//! The *commit point* is the end of the last slice: what lies before it has gone to the queue. A
//! hold, an abort, another speed, a bend that is found late and a path that goes on are one
//! operation, [`Runner::replan`]: what was planned behind the commit point is discarded, and
//! planned anew from the state of motion there.

use super::*;

/// The plan of the speed behind the commit point.
#[derive(Debug)]
pub(super) enum Plan {
    /// A plan without a limit on jerk, for the rest of the current piece.
    Profile {
        profile: Profile,
        /// The stopping distance with which the piece may end, if it is so low only because few
        /// blocks are known. When a later block allows more, the piece is planned again.
        provisional: Option<PathLength>,
    },
    /// A plan with a limit on jerk, for an interval of time, regardless of how many blocks end
    /// within it.
    Interval(Interval),
}

/// The state of motion at the commit point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Committed {
    /// The speed. Its stopping distance is known only without a limit on jerk.
    speed: PathSpeed,
    /// The acceleration as a ramp ([`State`]); 0 without a limit on jerk, whose plans may change it
    /// at any time.
    ramp: i32,
}

impl Committed {
    /// Nothing moves.
    pub(super) const REST: Self = Self { speed: PathSpeed::REST, ramp: 0 };
}

impl Plan {
    /// The state of motion at the commit point.
    fn committed(&self) -> Committed {
        match self {
            Self::Profile { profile, .. } => Committed { speed: profile.state(), ramp: 0 },
            Self::Interval(interval) => {
                let State { speed, ramp } = interval.state();
                let speed = SliceSpeed::from_bits(speed);
                Committed { speed: PathSpeed { speed, ..PathSpeed::REST }, ramp }
            }
        }
    }

    /// Whether the plan must be carried out to its end because a change would cause a jerk. This
    /// takes at most 42 ms, and 2.6 ms with a jerk of 20 m/s³ at 800 mm/s².
    fn must_end(&self) -> bool {
        matches!(self, Self::Interval(interval) if interval.changes())
    }
}

impl Runner<'_> {
    /// The speed at the commit point.
    pub(super) fn planned_speed(&self) -> SliceSpeed {
        match &self.plan {
            Some(Plan::Profile { profile, .. }) => profile.speed(),
            Some(Plan::Interval(interval)) => SliceSpeed::from_bits(interval.state().speed),
            None => self.committed.speed.speed,
        }
    }

    pub(super) fn top(&self, inked: bool) -> PathSpeed {
        if inked { self.draw } else { self.travel }
    }

    /// The greatest speed that the limit of the current block allows, if it is below `top`, which
    /// is that of the machine.
    fn within_speed_limit(&mut self, top: PathSpeed) -> PathSpeed {
        let limit = self.course.as_ref().map_or(SpeedLimit::NONE, |course| course.speed_limit);
        if limit == SpeedLimit::NONE {
            return top;
        }
        if self.speed_limit.0 != limit {
            self.speed_limit = (limit, self.feed_override.speed(&self.limits, limit));
        }
        let (_, speed) = self.speed_limit;
        if speed.speed < top.speed { speed } else { top }
    }

    /// The greatest speed of the current piece, which is `inked` or a travel.
    pub(super) fn current_top(&mut self, inked: bool) -> PathSpeed {
        if !inked && self.timing.is_lowering() {
            return self.timing.travel_top(self.travel);
        }
        self.within_speed_limit(self.top(inked))
    }

    /// Plans again from the commit point on. A stop goes on, and so does a plan that
    /// [must end](Plan::must_end), and a travel on which the pen was told to go down.
    pub(super) fn replan(&mut self) {
        let must_end = self.plan.as_ref().is_some_and(Plan::must_end);
        if !self.stopping && !must_end && !self.timing.is_lowering() {
            self.discard_plan();
        }
    }

    /// Discards what is planned behind the commit point.
    fn discard_plan(&mut self) {
        if let Some(plan) = self.plan.take() {
            self.committed = plan.committed();
        }
    }

    /// Plans again if more of the path has become known that matters to the plan: a bend on the
    /// current piece, or one behind it that the plan would pass too fast, or a path that goes on.
    #[inline(never)] // Inlined, it would only fill the cache.
    pub(super) fn follow_path(&mut self) {
        let late = self.lookahead.late_limit();
        let lowered = self.lookahead.take_lowered();
        let mut changes = false;
        if let Some(course) = &mut self.course
            && late < course.curve_limit
        {
            course.curve_limit = late;
            changes = true;
        }
        changes |= match &self.plan {
            Some(Plan::Profile { profile, provisional }) => {
                let exit = profile.exit().stopping_distance;
                let allowed = || self.lookahead.entry_allowed(PathLength::MAX, &self.limits);
                provisional.is_some_and(|exit| exit < allowed())
                    || (lowered < exit && allowed() < exit)
            }
            Some(Plan::Interval(interval)) if interval.is_cruise() => {
                lowered < PathLength::MAX
                    && square(interval.state().speed.into()) > self.limits.squared_speed(lowered)
            }
            _ => false,
        };
        if changes {
            self.replan();
        }
    }

    /// Handles the end of a plan, which is carried out or has reached the end of the current piece.
    pub(super) fn end_plan(&mut self) {
        let Some(course) = &self.course else {
            return;
        };
        let ends = match &self.plan {
            Some(Plan::Profile { .. }) => {
                let ends = course.moves_done == course.piece_moves;
                self.discard_plan();
                ends
            }
            Some(Plan::Interval(_)) if course.room() > 0 => {
                self.discard_plan();
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
    pub(super) fn rest(&mut self) {
        self.plan = None;
        self.committed = Committed::REST;
    }

    /// Plans the rest of the current piece.
    pub(super) fn plan(&mut self, queue: &mut dyn EventQueue) -> Result<Progress, StepEvent> {
        #[cfg(feature = "input-shaping")]
        if !self.shaper.is_resting() && !self.are_copies_ready(queue)? {
            return Ok(Progress::More);
        }
        let is_shaped = self.is_shaped();
        let Some(course) = &self.course else {
            return Ok(Progress::More);
        };
        let at_rest = self.committed == Committed::REST;
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
        let top = self.current_top(inked);
        let top_ends = top.speed < self.top(inked).speed;
        let Some(course) = &mut self.course else {
            return Ok(Progress::More);
        };
        let stopping = self.stopping && !self.timing.is_lowering();
        let Committed { speed: entry, ramp } = self.committed;
        if let Some(jerk) = self.limits.jerk {
            let state = State { speed: entry.speed.to_bits(), ramp };
            let mut path_limits = PathLimits {
                limits: &self.limits,
                jerk,
                top: top.speed,
                room: course.room(),
                curve_limit: course.curve_limit,
                top_ends,
                beyond: course.is_last_piece().then_some(&self.lookahead),
            };
            if stopping {
                let least = jerk.braking_distance(state, 0);
                if least <= path_limits.room {
                    path_limits.room = course.stop_behind(least);
                    (path_limits.top, path_limits.beyond) = (entry.speed, None);
                } else {
                    path_limits.top = SliceSpeed::ZERO;
                }
            }
            self.plan = Some(Plan::Interval(path_limits.next(state)));
            return self.planned(inked, at_rest, queue);
        }
        let left = course.left();
        let mut top = top;
        if course.curve_limit < top.stopping_distance {
            if self.curve.stopping_distance != course.curve_limit {
                self.curve = PathSpeed::of_stopping_distance(&self.limits, course.curve_limit);
            }
            top = self.curve;
        }
        let mut provisional = None;
        let (length, exit_allowed) = if stopping {
            let least = u64::from(entry.stopping_distance.to_bits()) << 14;
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
            provisional = may_change.then_some(exit_allowed);
            (left, exit_allowed)
        };
        // Constructed in place, because a copy costs as much as the plan.
        self.plan = Some(Plan::Profile {
            profile: Profile::new(&self.limits, entry, length, top, exit_allowed),
            provisional,
        });
        self.planned(inked, at_rest, queue)
    }
}
