//! A job whose strokes a computer has computed and sends while they are drawn.
//!
//! The working memory is a ring of targets. The machine reads a stroke once all of it has come, so
//! that a line that is slower than the pen lets the pen wait between strokes, where it is raised. A
//! stroke longer than the ring is read once the ring is full. If its rest is late, the pen is
//! raised where it is, and is lowered there again when the ring is full again.

use super::reply::Reply;
use super::{Board, Cursor, Inner, Job, Strokes};
use crate::drawing::{LineType, PagePoint};
use crate::index::Index;
use crate::machine::{PendingTarget, State, Target};
#[cfg(feature = "resume")]
use crate::protocol::RealTime;
use crate::protocol::{CommandError, MOST_TARGETS, StreamHeader, StreamedTarget, StreamedTargets};

/// The number of bits of a coordinate, which is at most [`PAGE_LIMIT`](crate::drawing::PAGE_LIMIT).
const COORDINATE_BITS: u32 = 21;

/// The number of bits of a pen's number.
const PEN_BITS: u32 = 5;

/// The progress of strokes that are sent while they are drawn.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Streamed {
    /// The header that was sent before the strokes; without targets if there is no such job.
    header: StreamHeader,
    /// The number of targets that have come.
    taken: u32,
    /// The number of targets that the machine may read.
    released: u32,
}

impl Streamed {
    /// Creates the state of a job whose number of targets is not known yet.
    #[cfg(feature = "tiles")]
    pub(super) fn open_ended() -> Self {
        let header = StreamHeader { targets: u32::MAX, ..StreamHeader::default() };
        Self { header, taken: 0, released: 0 }
    }

    /// The job has no other targets than those that have come.
    #[cfg(feature = "tiles")]
    pub(super) fn end_here(&mut self) {
        self.header.targets = self.taken;
    }

    /// Takes the next target, for which there is room. The machine may read it.
    #[cfg(feature = "tiles")]
    pub(super) fn put(&mut self, ring: &mut [u64], target: StreamedTarget) {
        let place = (self.taken as usize).checked_rem(ring.len());
        if let Some(word) = place.and_then(|place| ring.get_mut(place)) {
            *word = packed(target);
        }
        self.taken += 1;
        self.released = self.taken;
    }

    /// Whether there are targets that have not come yet.
    #[inline(always)] // It is called in every turn of the main loop.
    fn is_open(&self) -> bool {
        self.taken < self.header.targets
    }

    /// The number of targets for which a ring of `length` has room once this many have been `read`.
    pub(super) fn room(&self, length: usize, read: usize) -> usize {
        length.saturating_sub((self.taken as usize).saturating_sub(read))
    }

    /// The target with this index, if the machine may read it.
    fn target(&self, ring: &[u64], index: usize) -> Option<StreamedTarget> {
        if index >= self.released as usize { None } else { unpacked(ring, index) }
    }
}

/// A target in a word of the ring.
fn packed(StreamedTarget { target: Target { point, ink }, pen }: StreamedTarget) -> u64 {
    let ink = ink.map_or(0, |line_type| u64::from(line_type.code()) + 1);
    let above = ink << PEN_BITS | u64::from(pen);
    (above << COORDINATE_BITS | u64::from(point.y.cast_unsigned())) << COORDINATE_BITS
        | u64::from(point.x.cast_unsigned())
}

/// The target with this index, as it lies in the ring.
fn unpacked(ring: &[u64], index: usize) -> Option<StreamedTarget> {
    let word = *ring.get(index.checked_rem(ring.len())?)?;
    let part = |shift: u32, bits: u32| (word >> shift) as u32 & ((1 << bits) - 1);
    let x = part(0, COORDINATE_BITS).cast_signed();
    let y = part(COORDINATE_BITS, COORDINATE_BITS).cast_signed();
    let pen = part(2 * COORDINATE_BITS, PEN_BITS) as u8;
    let ink = part(2 * COORDINATE_BITS + PEN_BITS, 8) as u8;
    let ink = ink.checked_sub(1).map(LineType::from_code);
    Some(StreamedTarget { target: Target { point: PagePoint { x, y }, ink }, pen })
}

impl<I: Index> Strokes<'_, I> {
    /// Returns the next target that was sent. A job of this kind has no strokes besides those that
    /// are sent.
    pub(super) fn next_streamed(&mut self) -> Option<Target> {
        let StreamedTarget { target, pen } = self.streamed?.target(self.ring, self.cursor.leg)?;
        self.cursor.leg += 1;
        self.cursor.pen = pen;
        Some(target)
    }

    /// Returns the pending target if the next target, or a part of its stroke, has not come yet.
    #[inline(never)] // Other jobs come here once, at their end.
    pub(super) fn lateness(&self) -> Option<PendingTarget> {
        let (streamed, read) = (self.streamed?, self.cursor.leg);
        if read < streamed.released as usize || read >= streamed.header.targets as usize {
            return None;
        }
        let last = read.checked_sub(1).and_then(|last| unpacked(self.ring, last));
        Some(PendingTarget { within_stroke: last.is_some_and(|last| last.target.ink.is_some()) })
    }
}

impl<I: Index> Inner<'_, I> {
    /// For a job whose strokes are being sent, returns how many targets have come, how many there
    /// are in all, and for how many more there is room.
    pub(super) fn streamed_targets(&self) -> Option<[u32; 3]> {
        let Streamed { header, taken, .. } = self.streamed;
        let room = self.streamed.room(self.words.len(), self.cursor.leg);
        self.is_streamed().then_some([taken, header.targets, room as u32])
    }

    /// Whether the machine draws a job whose strokes are being sent.
    pub(super) fn is_streamed(&self) -> bool {
        #[cfg(feature = "tiles")]
        if self.parts.is_active() {
            return false;
        }
        self.streamed.header.targets > 0
            && matches!(self.machine.state(), State::Run | State::Hold { .. })
            && !self.machine.is_streaming()
    }

    /// Whether the next line must wait until the machine has read targets.
    #[inline(always)] // It is called in every turn of the main loop.
    pub(super) fn waits_for_targets(&self) -> bool {
        self.streamed.is_open() && self.is_full()
    }

    /// Whether the ring has no room for another line of a job that is being sent.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn is_full(&self) -> bool {
        self.is_streamed() && self.streamed.room(self.words.len(), self.cursor.leg) < MOST_TARGETS
    }

    /// Begins a job whose strokes will be sent.
    ///
    /// # Errors
    /// [`CommandError::Busy`] or [`CommandError::Locked`] if the state does not allow it,
    /// [`CommandError::OtherSteps`] if it was computed for other steps, or the machine's refusal of
    /// its bounds. Nothing moves then.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn begin_streamed<B: Board>(
        &mut self,
        text: &str,
        board: &mut B,
    ) -> Result<(), CommandError> {
        let header = StreamHeader::parse(text)?;
        let steps = self.machine.settings().page_steps().map(|steps| steps.to_bits());
        if self.machine.state() == State::Idle && steps != header.steps {
            return Err(CommandError::OtherSteps);
        }
        #[cfg(feature = "resume")]
        let requests = match self.machine.state() {
            State::Idle => self.wait_until_idle(board).map_err(|_| CommandError::Aborted)?,
            _ => RealTime::default(),
        };
        self.machine.start_streamed(header.size, [header.least, header.greatest])?;
        // A drawing in parts may have ended just before.
        #[cfg(feature = "tiles")]
        self.parts.end();
        self.copy_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        self.streamed = Streamed { header, taken: 0, released: 0 };
        self.keep_streamed(header, board);
        #[cfg(feature = "resume")]
        self.act(requests);
        Ok(())
    }

    /// Takes a line of strokes: all of it or nothing.
    ///
    /// # Errors
    /// [`CommandError::NoStream`] if no such line is expected, [`CommandError::NotStrokes`], or
    /// [`CommandError::BeyondBounds`] if a target lies elsewhere than was said.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn take_strokes(&mut self, text: &str) -> Result<(), CommandError> {
        if !self.is_streamed() {
            return Err(match self.machine.state() {
                State::Alarm(_) | State::Sleep => CommandError::Locked,
                _ => CommandError::NoStream,
            });
        }
        let Streamed { header, taken, mut released } = self.streamed;
        let mut count = 0;
        for target in StreamedTargets::new(text) {
            if !header.holds(target?.target.point) {
                return Err(CommandError::BeyondBounds);
            }
            count += 1;
        }
        let room = self.streamed.room(self.words.len(), self.cursor.leg);
        if count as usize > room || header.targets - taken < count {
            return Err(CommandError::NoStream);
        }
        let mut end = taken;
        let before = (taken as usize).checked_sub(1).and_then(|last| unpacked(self.words, last));
        let mut pen = before.map(|before| before.pen);
        let length = self.words.len();
        for target in StreamedTargets::new(text).map_while(Result::ok) {
            let place = (end as usize).checked_rem(length);
            let Some(word) = place.and_then(|place| self.words.get_mut(place)) else { break };
            *word = packed(target);
            // A move with the pen up, or a change of the pen, completes the strokes before it.
            if target.target.ink.is_none() {
                released = end + 1;
            } else if pen.is_some_and(|pen| pen != target.pen) {
                released = end;
            }
            pen = Some(target.pen);
            end += 1;
        }
        self.streamed = Streamed { header, taken: end, released };
        let is_full = self.streamed.room(length, self.cursor.leg) < MOST_TARGETS;
        if is_full || !self.streamed.is_open() {
            self.streamed.released = end;
        }
        Ok(())
    }

    /// Says how much of the job has come, or how far a job has come that has stopped, so that its
    /// sender can go on.
    ///
    /// # Errors
    /// [`CommandError::NoStream`], or what the job that has stopped depends on has changed.
    pub(super) fn report_streamed<B: Board>(&self, board: &mut B) -> Result<(), CommandError> {
        if !self.is_streamed() {
            let is_stopped = self.report_stopped_stream(board)?;
            return if is_stopped { Ok(()) } else { Err(CommandError::NoStream) };
        }
        let Streamed { header, taken, .. } = self.streamed;
        let StreamHeader { id, targets, points, .. } = header;
        Reply(board).line(format_args!("[STREAM:{id},{taken},{targets},{points}]"));
        Ok(())
    }
}
