//! Which strokes of a job have been drawn at the pins, so that a board can keep it.
//!
//! While strokes are noted, the machine plans nothing after a stroke before that stroke has been
//! noted. It rests there with the pen raised, in the dwell that follows each stroke anyway, and no
//! step waits in the queue. So the board may write to its flash, which stops everything else for a
//! moment.

use super::Machine;
#[cfg(feature = "resume")]
use super::state::Activity;

/// The progress of noting the strokes of the job in flash.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StrokeLog {
    /// What is noted; `None` while nothing is to be noted.
    #[cfg(feature = "resume")]
    open: Option<Open>,
}

/// How far the strokes of a job have been noted. All counts are those of the motion planner.
#[cfg(feature = "resume")]
#[derive(Debug, Clone, Copy)]
struct Open {
    /// The number of strokes at the beginning of the job.
    begin: u32,
    /// The number of strokes that were noted.
    noted: u32,
    /// Once the job is given up, the number of strokes drawn by then: the one in which it was given
    /// up is not drawn.
    most: Option<u32>,
    /// Whether all strokes of the job have been planned to their end.
    is_whole: bool,
}

#[cfg(feature = "resume")]
impl StrokeLog {
    /// Whether strokes and points are noted.
    pub(super) const fn is_open(&self) -> bool {
        self.open.is_some()
    }
}

#[cfg(feature = "resume")]
impl Machine<'_> {
    /// Lets the machine wait after each stroke of the job that has just begun until it is noted,
    /// and at each of its points, of which this many were passed before. Call it after
    /// [`Machine::start`] or [`Machine::start_rest`].
    pub fn log_strokes(&mut self, points: u32) {
        self.begin_points(points);
        let drawn = self.progress.done(self.runner.run()).strokes;
        let noted = self.runner.strokes_over();
        let begin = noted.wrapping_sub(drawn);
        self.log.open = Some(Open { begin, noted, most: None, is_whole: false });
    }

    /// Whether a stroke may have to be noted now. The last one is so wherever the pen is: once
    /// drivers are off, nobody knows where a motor has left it.
    #[inline(always)] // It is called in every turn of the main loop.
    pub fn may_note_stroke(&self) -> bool {
        self.log.open.is_some_and(|open| open.is_whole || self.runner.is_pen_up())
    }

    /// Whether the machine waits with the pen raised until the stroke before has been noted.
    #[inline(always)] // It is called for each slice, most of them with the pen down.
    pub(super) fn waits_for_log(&self) -> bool {
        self.runner.is_pen_up() && self.waits_with_pen_up()
    }

    /// Whether the machine, whose pen is up, waits until the stroke before has been noted.
    #[cold]
    #[inline(never)]
    fn waits_with_pen_up(&self) -> bool {
        self.log.open.is_some_and(|open| self.strokes_over(open) != open.noted)
    }

    /// The number of strokes that are planned to their end, as the motion planner counts them.
    fn strokes_over(&self, open: Open) -> u32 {
        open.most.unwrap_or(self.runner.strokes_over())
    }

    /// If the pins have just drawn a stroke of the job and stand with the pen raised: how many
    /// strokes of the job are drawn. [`Machine::stroke_noted`] lets the machine go on.
    pub fn stroke_to_note(&self) -> Option<u32> {
        let open = self.log.open?;
        let over = self.strokes_over(open);
        let is_raised = self.runner.is_pen_up_at(self.pins.ticks());
        // The motion planner counts neither strokes that are shorter than a motor step nor those
        // that begin where the one before ends, so the end of the path counts.
        let is_end = open.is_whole && self.is_stopped();
        let all = self.progress.size().strokes;
        let strokes = if open.is_whole { all } else { drawn(over, open.begin) };
        (is_end || (is_raised && over != open.noted)).then_some(strokes)
    }

    /// Whether the moves of a job are planned to their end, but its last stroke is not noted yet.
    /// Nothing else may begin then.
    pub fn notes_last_stroke(&self) -> bool {
        matches!(self.activity, Activity::Idle)
            && self.log.open.is_some()
            && (!self.is_stopped() || self.stroke_to_note().is_some())
    }

    /// What [`Machine::stroke_to_note`] said has been noted.
    pub fn stroke_noted(&mut self) {
        let Some(open) = self.log.open else { return };
        let is_over = open.is_whole || open.most.is_some();
        let noted = self.strokes_over(open);
        self.log.open = (!is_over).then_some(Open { noted, ..open });
    }

    /// Stops noting strokes and points.
    pub fn end_log(&mut self) {
        self.log.open = None;
        self.point_noted();
    }

    /// The job is given up, so the stroke in which that happens is not drawn to its end.
    pub(super) fn limit_log(&mut self) {
        self.point_noted();
        let over = self.runner.strokes_over();
        if let Some(open) = &mut self.log.open {
            if open.noted == over {
                self.log.open = None;
            } else {
                open.most = Some(over);
            }
        }
    }

    /// The pen is raised within a stroke whose rest is late, so the stroke is not drawn yet.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    pub(super) const fn interrupt_stroke(&mut self) {
        if let Some(open) = &mut self.log.open {
            open.begin = open.begin.wrapping_add(1);
            open.noted = open.noted.wrapping_add(1);
        }
    }

    /// What was late is no rest of the stroke: that was whole, and is still to be noted.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    pub(super) const fn complete_stroke(&mut self) {
        if let Some(open) = &mut self.log.open {
            open.begin = open.begin.wrapping_sub(1);
            open.noted = open.noted.wrapping_sub(1);
        }
    }

    /// The path was planned to its end.
    pub(super) const fn complete_log(&mut self) {
        if let Some(open) = &mut self.log.open {
            open.is_whole = true;
        }
    }
}

/// Without the feature, no stroke is noted.
#[cfg(not(feature = "resume"))]
impl Machine<'_> {
    /// Whether the last stroke of a job is not noted yet: never.
    pub const fn notes_last_stroke(&self) -> bool {
        false
    }

    /// Whether the machine waits until the stroke before has been noted: never.
    pub(super) const fn waits_for_log(&self) -> bool {
        let StrokeLog {} = self.log;
        false
    }

    /// The pen is raised within a stroke.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    pub(super) const fn interrupt_stroke(&mut self) {}

    /// The stroke was whole.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    pub(super) const fn complete_stroke(&mut self) {}

    /// Stops noting strokes.
    pub(super) const fn end_log(&mut self) {}

    /// The job is given up.
    pub(super) const fn limit_log(&mut self) {}

    /// The path was planned to its end.
    pub(super) const fn complete_log(&mut self) {}

    /// No point is passed.
    pub(super) const fn pass_point(&mut self, _: super::Target, _: crate::motion::PathLength) {}

    /// Whether targets may be read: always.
    pub(super) const fn reads_on(&self) -> bool {
        true
    }
}

/// Returns how many strokes of the job are drawn if the motion planner has counted `over` strokes,
/// and `begin` before the job. Of a stroke that has been interrupted, the planner may not have
/// counted the piece before that, because it is shorter than a motor step; then `over` is less.
#[cfg(feature = "resume")]
const fn drawn(over: u32, begin: u32) -> u32 {
    let strokes = over.wrapping_sub(begin);
    if strokes > i32::MAX.cast_unsigned() { 0 } else { strokes }
}

#[cfg(all(test, feature = "resume"))]
mod tests {
    use super::*;

    #[test]
    fn no_more_strokes_are_noted_than_are_drawn() {
        for (over, begin, strokes) in
            [(5, 5, 0), (7, 5, 2), (5, 6, 0), (2, u32::MAX, 3), (u32::MAX, 0, 0), (0, 3, 0)]
        {
            assert_eq!(drawn(over, begin), strokes, "{over} after {begin}");
        }
    }
}
