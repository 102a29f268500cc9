//! Hands the strokes of a job to the machine.

use crate::drawing::{Drawing, LineType, PagePoint, Segment};
use crate::index::Index;
#[cfg(any(feature = "stream", feature = "early-ink"))]
use crate::machine::PendingTarget;
#[cfg(feature = "resume")]
use crate::machine::{Machine, StrokePoints};
use crate::machine::{Path, StrokeEnds, Target};
use crate::motion::PathLength;
use crate::order::Leg;
#[cfg(feature = "stream")]
use crate::plotter::streamed::Streamed;

/// Position in the strokes of a job: how far they have been handed to the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Cursor<I = u16> {
    /// Index in the tour of the segment that is being handed over. For strokes that are sent while
    /// they are drawn, this is the number of targets that were handed over.
    pub(in crate::plotter) leg: usize,
    /// Number of the point at which the pen is, or `None` before the first move, and behind a
    /// stroke that went on beyond its end.
    at: Option<I>,
    /// The pen of the segment that is being handed over, from 0.
    pub(in crate::plotter) pen: u8,
    /// Index in the tour of the segment with which the path begins.
    #[cfg(feature = "resume")]
    path_start: usize,
    /// Index in the tour of the first segment of the stroke within which the path begins, if it
    /// begins within one.
    #[cfg(feature = "resume")]
    within: Option<usize>,
    /// Index in the tour of the first segment of the stroke, or, while a closed stroke goes on
    /// beyond its end, of the segment along which it does so.
    first: usize,
    /// The distance that is left to draw beyond the end.
    beyond: PathLength,
}

impl<I> Cursor<I> {
    /// Index in the tour of the first segment of a stroke that is handed over from this one on.
    // Where steps are planned.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    fn stroke_start(&self, index: usize) -> usize {
        #[cfg(feature = "resume")]
        if let Some(first) = self.within
            && index == self.path_start
        {
            return first;
        }
        index
    }
}

/// The strokes of a job, as the [`Path`] that the machine follows. A pen-up move is inserted
/// wherever a leg does not begin where the previous one ended.
#[derive(Debug)]
pub struct Strokes<'a, I = u16> {
    /// The points and segments of the job.
    pub(super) drawing: Drawing<'a, I>,
    /// The segments in the order in which they are drawn, each with its direction.
    pub(super) tour: &'a [Leg<I>],
    /// Whether more strokes follow, of which the order is not known yet.
    #[cfg(feature = "early-ink")]
    pub(in crate::plotter) has_more: bool,
    /// Whether the pen goes back, behind the last stroke, to where the first one begins.
    pub(super) returns: bool,
    /// The position up to which the strokes have been handed over.
    pub(in crate::plotter) cursor: &'a mut Cursor<I>,
    /// By how much the strokes are made longer, if they are.
    pub(super) ends: Option<StrokeEnds>,
    /// The progress of strokes that are sent while they are drawn, if they are.
    #[cfg(feature = "stream")]
    pub(in crate::plotter) streamed: Option<&'a Streamed>,
    /// The working memory, in which these strokes lie.
    #[cfg(feature = "stream")]
    pub(in crate::plotter) ring: &'a [u64],
}

impl<'a, I: Index> Strokes<'a, I> {
    /// A segment of the tour, and the numbers of the points at which it begins and ends.
    fn leg(&self, index: usize) -> Option<(&'a Segment<I>, [I; 2])> {
        let leg = self.tour.get(index)?;
        let segment = self.drawing.segments.get(leg.segment())?;
        let ends = [segment.from(), segment.to()];
        Some((segment, if leg.reversed() { [ends[1], ends[0]] } else { ends }))
    }

    /// The points with these numbers.
    fn points(&self, [from, to]: [I; 2]) -> Option<[PagePoint; 2]> {
        Some([*self.drawing.points.get(from.get())?, *self.drawing.points.get(to.get())?])
    }

    /// Whether a stroke ends with this segment of the tour.
    fn ends_stroke(&self, index: usize) -> bool {
        let Some((segment, [_, end])) = self.leg(index) else { return true };
        self.leg(index + 1)
            .is_none_or(|(next, [start, _])| start != end || next.pen() != segment.pen())
    }

    /// Whether the stroke that begins with this segment of the tour ends where it began.
    fn is_closed(&self, first: usize) -> bool {
        let last = (first..self.tour.len()).find(|&index| self.ends_stroke(index));
        let ends = last.and_then(|last| Some((self.leg(first)?.1[0], self.leg(last)?.1[1])));
        ends.is_some_and(|(start, end)| start == end)
    }

    /// Returns where the stroke that begins with this segment of the tour begins. An open stroke
    /// begins earlier than its segment, by the length that is added.
    #[inline(never)] // Without such settings, this is never called.
    fn early(&self, ends: &StrokeEnds, index: usize) -> Option<PagePoint> {
        let (segment, numbers) = self.leg(index)?;
        let [from, to] = self.points(numbers)?;
        let is_early = ends.lead > 0 && self.cursor.stroke_start(index) == index;
        if !is_early || segment.line_type() != LineType::Full || self.is_closed(index) {
            return Some(from);
        }
        Some(ends.along([to, from], from, ends.lead))
    }

    /// Returns where this segment of the tour ends. If it is the last one of an open stroke, it
    /// ends later, by the length that is added; a closed stroke continues along its beginning.
    #[inline(never)] // Without such settings, this is never called.
    fn late(&mut self, ends: &StrokeEnds, index: usize) -> Option<PagePoint> {
        let (segment, numbers) = self.leg(index)?;
        let [from, to] = self.points(numbers)?;
        if !self.ends_stroke(index) || segment.line_type() != LineType::Full {
            return Some(to);
        }
        if self.leg(self.cursor.first).is_some_and(|(_, [start, _])| start == numbers[1]) {
            self.cursor.beyond = ends.overlap;
            return Some(to);
        }
        if ends.trail > 0 {
            self.cursor.at = None;
        }
        Some(ends.along([from, to], to, ends.trail))
    }

    /// The next target along the beginning of a closed stroke, behind its end.
    #[inline(never)] // Without such settings, this is never called.
    fn next_beyond(&mut self, ends: &StrokeEnds) -> Option<Target> {
        let left = core::mem::take(&mut self.cursor.beyond);
        // What comes next begins with a move with the pen up.
        self.cursor.at = None;
        let (segment, numbers) =
            self.leg(self.cursor.first).filter(|_| self.cursor.first < self.cursor.leg)?;
        let [from, to] = self.points(numbers)?;
        let length = ends.length(from, to)?;
        let ink = Some(segment.line_type()).filter(|&line_type| line_type == LineType::Full)?;
        let mut point = to;
        if length < left {
            self.cursor.beyond = left - length;
            self.cursor.first += 1;
        } else {
            point = ends.along([from, to], from, left);
        }
        Some(Target { point, ink: Some(ink) })
    }
}

impl<I: Index> Strokes<'_, I> {
    /// The next target behind the legs of the tour: the return of the pen, or a target that was
    /// sent.
    #[inline(never)] // It is called where a job ends, and for strokes that are sent.
    fn next_behind(&mut self) -> Option<Target> {
        if self.returns && self.cursor.leg == self.tour.len() {
            let (_, [begin, _]) = self.leg(0)?;
            let point = match &self.ends {
                Some(ends) => self.early(ends, 0)?,
                None => *self.drawing.points.get(begin.get())?,
            };
            self.cursor.leg += 1;
            return Some(Target { point, ink: None });
        }
        #[cfg(feature = "stream")]
        return self.next_streamed();
        #[cfg(not(feature = "stream"))]
        None
    }
}

impl<I: Index> Path for Strokes<'_, I> {
    // Where steps are planned, which is done for each chord.
    #[cfg_attr(not(feature = "lm3s6965"), inline(always))]
    fn next_target(&mut self) -> Option<Target> {
        let ends = self.ends;
        if let Some(ends) = &ends
            && self.cursor.beyond > 0
            && let Some(target) = self.next_beyond(ends)
        {
            return Some(target);
        }
        let index = self.cursor.leg;
        let Some((segment, [from, to])) = self.leg(index) else { return self.next_behind() };
        let begins_here = self.cursor.at == Some(from);
        let number = if begins_here { to } else { from };
        let mut point = *self.drawing.points.get(number.get())?;
        if !begins_here || self.cursor.pen != segment.pen() {
            self.cursor.first = self.cursor.stroke_start(index);
        }
        self.cursor.at = Some(number);
        self.cursor.pen = segment.pen();
        self.cursor.leg += usize::from(begins_here);
        if let Some(ends) = &ends {
            point = if begins_here { self.late(ends, index)? } else { self.early(ends, index)? };
        }
        Some(Target { point, ink: begins_here.then(|| segment.line_type()) })
    }

    fn pen(&self) -> u8 {
        self.cursor.pen
    }

    fn rewind(&mut self) {
        *self.cursor = Cursor {
            #[cfg(feature = "resume")]
            leg: self.cursor.path_start,
            #[cfg(feature = "resume")]
            path_start: self.cursor.path_start,
            #[cfg(feature = "resume")]
            within: self.cursor.within,
            ..Cursor::default()
        };
    }

    #[cfg(any(feature = "stream", feature = "early-ink"))]
    fn late(&self) -> Option<PendingTarget> {
        #[cfg(feature = "early-ink")]
        if self.has_more {
            return (self.cursor.leg >= self.tour.len())
                .then_some(PendingTarget { within_stroke: false });
        }
        #[cfg(feature = "stream")]
        return self.lateness();
        #[cfg(not(feature = "stream"))]
        None
    }

    fn look_ahead(&mut self, visit: &mut dyn FnMut(Target) -> bool) {
        let before = *self.cursor;
        while let Some(target) = self.next_target()
            && self.cursor.pen == before.pen
            && visit(target)
        {}
        *self.cursor = before;
    }
}

#[cfg(feature = "resume")]
impl<I: Index> Strokes<'_, I> {
    /// Reads the path to its end. Returns the number of its strokes, as the machine counts them,
    /// the number of its points within strokes, and where it ends.
    #[cfg(feature = "tiles")]
    pub fn count_strokes(&mut self, machine: &Machine<'_>) -> (u32, u32, Option<PagePoint>) {
        let mut points = StrokePoints::new(0, machine.point_distance());
        let (mut inked, mut pen, mut strokes, mut end) = (false, 0, 0u32, None);
        while let Some(target) = self.next_target() {
            let Target { point, ink } = target;
            strokes += u32::from(ink.is_some() && (!inked || self.pen() != pen));
            points.pass(target, end.map_or(0, |end| machine.length([end, point])));
            (inked, pen, end) = (ink.is_some(), self.pen(), Some(point));
        }
        (strokes, points.passed, end)
    }

    /// Lets the path begin with this stroke, counted from 0 as the machine counts them. Returns
    /// whether there is such a stroke; if not, the path is at its end.
    pub fn begin_at(&mut self, stroke: u32) -> bool {
        *self.cursor = Cursor::default();
        let (mut inked, mut pen, mut strokes) = (false, 0, 0u32);
        loop {
            let path_start = self.cursor.leg;
            let Some(Target { ink, .. }) = self.next_target() else { return false };
            // A change of the pen begins a new stroke.
            if ink.is_some() && (!inked || self.pen() != pen) {
                if strokes == stroke {
                    *self.cursor = Cursor { leg: path_start, path_start, ..Cursor::default() };
                    return true;
                }
                strokes += 1;
            }
            (inked, pen) = (ink.is_some(), self.pen());
        }
    }

    /// Lets the path begin where a job goes on of which so many strokes are `drawn` and so many
    /// points are passed ([`Setting::PointDistance`](crate::machine::Setting::PointDistance)).
    /// `points` has the number of those before the strokes, and of all. Returns the number of
    /// points before the path, or `None` if nothing is left to draw.
    pub fn begin_rest(
        &mut self,
        drawn: u32,
        points: [u32; 2],
        machine: &Machine<'_>,
    ) -> Option<u32> {
        if !self.begin_at(drawn) {
            return None;
        }
        let distance = machine.point_distance();
        if distance == 0 {
            return Some(0);
        }
        Some(self.begin_at_point(drawn, points, distance, &|ends| machine.length(ends)))
    }

    /// Lets the path begin within this stroke, at the last one of the points that are passed, if it
    /// lies in this stroke. Otherwise the path begins with the stroke, as with
    /// [`Strokes::begin_at`]. `points` has the number of points before the whole path, and of those
    /// that are passed. `distance` and `length` are the machine's
    /// [`point_distance`](crate::machine::Machine::point_distance) and
    /// [`length`](crate::machine::Machine::length). Returns the number of points before the path.
    pub fn begin_at_point(
        &mut self,
        stroke: u32,
        [before, points]: [u32; 2],
        distance: u64,
        length: &dyn Fn([PagePoint; 2]) -> u64,
    ) -> u32 {
        *self.cursor = Cursor::default();
        let mut walk = StrokePoints::new(before, distance);
        let (mut inked, mut pen, mut begun, mut before) = (false, 0, 0u32, before);
        let mut at = None;
        while let Some(target) = self.next_target() {
            if target.ink.is_some() && (!inked || self.pen() != pen) {
                if begun == stroke {
                    before = walk.passed;
                } else if begun > stroke {
                    break;
                }
                begun += 1;
            }
            let moved = at.map_or(0, |at| length([at, target.point]));
            let is_last_point = walk.pass(target, moved) && walk.passed == points;
            let leg = self.cursor.leg;
            // A point at the end of the stroke, or beyond it, is not a point within the stroke.
            if is_last_point && begun > stroke && !self.ends_stroke(leg.saturating_sub(1)) {
                let within = Some(self.cursor.first);
                *self.cursor = Cursor { leg, path_start: leg, within, ..Cursor::default() };
                return points;
            }
            (inked, pen, at) = (target.ink.is_some(), self.pen(), Some(target.point));
        }
        self.begin_at(stroke);
        before
    }
}
