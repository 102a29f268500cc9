//! Draws a model in flash: `$plot` prepares it and computes the first part, and the main loop the
//! others, while the machine draws.

use super::compute::{Computed, next_part, prepare};
use super::parts::ComputedPart;
use crate::drawing::PagePoint;
use crate::fixed::Millimetres;
use crate::index::Index;
use crate::machine::{JobSize, Path, State, StrokeEnds};
use crate::model::StoredModel;
use crate::plotter::listener::Listener;
use crate::plotter::reply::Reply;
use crate::plotter::resume::{KeptParts, are_noted_at_once};
use crate::plotter::streamed::Streamed;
use crate::plotter::{BegunJob, Board, Cursor, Inner, Job, VisibilityMode, report, title};
use crate::protocol::{CommandError, RealTime, StoredModelError, StreamedTarget};
use crate::stage::{Aborted, Cancel};
#[cfg(feature = "early-ink")]
use crate::storage::PAGE_BYTES;

/// The result of working on a drawing in parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plotter) enum PartsProgress {
    /// There is nothing to do now.
    Idle,
    /// A part has been computed.
    Busy,
    /// The user has given the job up.
    Aborted,
}

/// What is left to draw of a computed part of a drawing that goes on.
#[derive(Debug, Clone, Copy)]
struct RestOfPart {
    /// The number of its strokes that are drawn.
    drawn: u32,
    /// The number of points within strokes before the part, and of those that are passed in all.
    points: [u32; 2],
}

impl<I: Index> Inner<'_, I> {
    /// Begins to draw the model in flash, or the drawing of it that was `kept`, whose options are
    /// in force: all of it, or what is not drawn of it.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with. Nothing moves then.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn plot_stored<B: Board>(
        &mut self,
        kept: Option<KeptParts>,
        listener: &mut Listener<'_, B>,
    ) -> Result<(), CommandError> {
        if self.options.see != VisibilityMode::Faces {
            return Err(StoredModelError::FacesOnly.into());
        }
        let steps = self.machine.settings().page_steps();
        title::check(&self.options, steps)?;
        let model = self.whole_model(listener.board);
        let model = model.as_ref().map_err(|&error| error)?;
        if model.is_plan() && self.options.shows_plans_flat() {
            return Err(StoredModelError::FacesOnly.into());
        }
        if !model.is_sound(&mut || listener.check())? {
            return Err(StoredModelError::Damaged.into());
        }
        self.copy_words = 0;
        self.job = Job::default();
        self.cursor = Cursor::default();
        self.parts.end();
        let time_model = self.machine.settings().time_model(self.units_per_second());
        let time_model = kept.map_or(time_model, |kept| kept.time_model);
        let search = &mut self.parts.search;
        let scales = (steps, time_model);
        let [least, greatest] =
            prepare(model, &self.options, scales, self.words, search, listener)?;
        let bounds = beyond([least, greatest], self.machine.stroke_ends(), steps);
        for point in bounds {
            self.machine.check_travel(0, point)?;
        }
        // No copy of it, which would take a twentieth of the stack.
        let Some(search) = &mut self.parts.search else {
            return Err(CommandError::NothingToPlot);
        };
        self.job = Job::left_out(search.tiles.degenerate_faces());
        if self.machine.state() == State::Check {
            return Ok(());
        }
        let at = self.machine.end();
        let mut rest =
            kept.and_then(|kept| Some(RestOfPart { drawn: kept.drawn?, points: [0, kept.points] }));
        let drawn = rest.map_or(0, |rest| rest.drawn);
        let has_pens = search.pens != 0;
        let begins_before_pen = are_noted_at_once(drawn);
        if drawn > 0 {
            Reply(listener.board).line(format_args!(
                "[MSG:what is drawn is computed again, which may take minutes]"
            ));
        }
        let ends = self.machine.stroke_ends();
        let mut part = next_part(model, search, steps, self.words, None, listener)?;
        // The parts that are drawn are left out.
        while let (Some((job, begin)), Some(RestOfPart { drawn, points: [passed, _] })) =
            (&part, &mut rest)
        {
            let words = self.words.get_mut(*begin..).unwrap_or(&mut []);
            let mut cursor = Cursor::default();
            let mut counted = job.strokes(words, &mut cursor, ends);
            let (strokes, points, at) = counted.count_strokes(&self.machine);
            if *drawn < strokes {
                break;
            }
            *drawn -= strokes;
            *passed += points;
            part = next_part(model, search, steps, self.words, at, listener)?;
        }
        let Some(part) = part else {
            return self.nothing_left(kept, listener.board);
        };
        // What is kept already takes no new room.
        #[cfg(feature = "early-ink")]
        if kept.is_none() {
            Self::make_room(listener, 2 * PAGE_BYTES as u32)?;
        }
        self.machine.start_streamed(JobSize::default(), bounds)?;
        if has_pens && kept.is_some_and(|kept| kept.drawn.is_some()) {
            // If several strokes are noted at once, the rest may begin with strokes before the last
            // change of the pen.
            self.machine.forget_pen(begins_before_pen);
        }
        let points = self.take_part(Some(part), rest);
        self.keep_parts(model.checksum(), time_model, kept, points, listener.board);
        self.parts.is_active = true;
        self.parts.last.target.point = at;
        self.streamed = Streamed::open_ended();
        self.feed_part();
        Reply(listener.board).line(format_args!("[MSG:computed and drawn part by part]"));
        Ok(())
    }

    /// Notes what has been computed, of which only the `rest` is drawn, if there is one. Returns
    /// the number of points within strokes before that.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn take_part(&mut self, part: Option<Computed<I>>, rest: Option<RestOfPart>) -> u32 {
        if part.is_none() {
            self.parts.search = None;
            self.streamed.end_here();
            self.resumption.end_parts(self.machine.status().job.strokes);
        }
        if let Some((job, _)) = &part {
            self.job.add_report(job.report());
        }
        let mut before = 0;
        self.parts.part = part.map(|(job, begin)| {
            let ends = self.machine.stroke_ends();
            let words = self.words.get_mut(begin..).unwrap_or(&mut []);
            let mut cursor = Cursor::default();
            let mut strokes = job.strokes(words, &mut cursor, ends);
            if let Some(RestOfPart { drawn, points }) = rest {
                before = strokes.begin_rest(drawn, points, &self.machine).unwrap_or(0);
            }
            let from = *strokes.cursor;
            let left = core::iter::from_fn(|| strokes.next_target()).count();
            ComputedPart { job, cursor: from, left, begin }
        });
        before
    }

    /// Hands the strokes of the computed part to the machine, as far as there is room.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn feed_part(&mut self) {
        let ends = self.machine.stroke_ends();
        let (words, machine) = (&mut *self.words, &self.machine);
        let size = self.parts.feed(
            (&mut self.streamed, self.cursor.leg),
            self.model.spare_words(),
            |part| {
                let words = words.get_mut(part.begin..).unwrap_or(&mut []);
                let mut strokes = part.job.strokes(words, &mut part.cursor, ends);
                Some(StreamedTarget { target: strokes.next_target()?, pen: strokes.pen() })
            },
            |ends| machine.length(ends),
        );
        self.machine.grow_job(size);
    }

    /// Computes the next part of a drawing, or hands what is computed to the machine.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    pub(in crate::plotter) fn tend_parts<B: Board>(&mut self, board: &mut B) -> PartsProgress {
        if !matches!(self.machine.state(), State::Run | State::Hold { .. }) {
            self.end_parts();
            return PartsProgress::Idle;
        }
        if self.parts.part.is_some() {
            self.feed_part();
            return PartsProgress::Idle;
        }
        // One copy: each takes a twentieth of the stack.
        let mut search = self.parts.search;
        let Some(search) = &mut search else { return PartsProgress::Idle };
        let model = board.model_flash().and_then(|(area, _)| StoredModel::new(area));
        let Some(model) = &model else {
            self.give_up(StoredModelError::Damaged.into(), board);
            return PartsProgress::Busy;
        };
        let steps = self.machine.settings().page_steps();
        let at = Some(self.parts.last.target.point);
        // The machine goes on meanwhile, and does not use this memory.
        let words = core::mem::take(&mut self.words);
        let mut server = PartCancel { inner: self, board, ends: None };
        let part = next_part(model, search, steps, words, at, &mut server);
        let ends = server.ends;
        self.words = words;
        match (ends, part) {
            (Some(EarlyEnd::ByUser), _) => return PartsProgress::Aborted,
            // The machine has reported why.
            (Some(EarlyEnd::ByMachine), _) => self.end_parts(),
            (None, Ok(part)) => {
                self.parts.search = Some(*search);
                self.take_part(part, None);
                self.feed_part();
            }
            (None, Err(error)) => self.give_up(error, board),
        }
        PartsProgress::Busy
    }

    /// Gives the job up because its next part cannot be computed.
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn give_up<B: Board>(&mut self, error: CommandError, board: &mut B) {
        Reply(board).line(format_args!("[MSG:the job is given up: {error}]"));
        self.end_parts();
        self.machine.abort();
    }

    /// Forgets the drawing: the machine reads no more of it.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(in crate::plotter) fn end_parts(&mut self) {
        self.parts.end();
        self.streamed = Streamed::default();
    }
}

/// Bounds that are wider by how much strokes are made longer.
fn beyond(
    [least, greatest]: [PagePoint; 2],
    ends: Option<StrokeEnds>,
    steps: [Millimetres; 2],
) -> [PagePoint; 2] {
    let Some(StrokeEnds { lead, trail, .. }) = ends else { return [least, greatest] };
    let longest = u64::from(lead.max(trail).to_bits());
    // A length is in units of 2^-18 mm, at most 10 mm.
    let [x, y] = steps.map(|steps| {
        let more = longest * u64::from(steps.to_bits().unsigned_abs());
        if longest == 0 { 0 } else { (more >> 34) as i32 + 1 }
    });
    [
        PagePoint { x: least.x - x, y: least.y - y },
        PagePoint { x: greatest.x + x, y: greatest.y + y },
    ]
}

/// The reasons why a computation has ended early.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EarlyEnd {
    /// The user has given the job up.
    ByUser,
    /// The machine no longer draws, because it is in alarm.
    ByMachine,
}

/// Keeps the machine and the serial line going while the next part is computed.
struct PartCancel<'s, 'm, I, B> {
    /// The plotter without its working memory.
    inner: &'s mut Inner<'m, I>,
    /// The board.
    board: &'s mut B,
    /// The reason why the computation is to end, if it is.
    ends: Option<EarlyEnd>,
}

impl<I: Index, B: Board> Cancel for PartCancel<'_, '_, I, B> {
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn check(&mut self) -> Result<(), Aborted> {
        let Self { inner, board, ends } = self;
        let requests = board.take_real_time();
        let settings = Some(inner.machine.settings());
        report::greet_opened(inner.machine.state(), inner.resumption, settings, *board);
        if requests.has(RealTime::ABORT) {
            inner.act(requests.only(RealTime::EMERGENCY));
            *ends = Some(EarlyEnd::ByUser);
            return Err(Aborted);
        }
        inner.act(requests);
        inner.watch(*board);
        inner.note_progress(*board);
        inner.plan(BegunJob::default(), *board);
        board.start_steps();
        if inner.takes_status(requests, *board) {
            inner.report_status("|Stage:visibility", *board);
        }
        if matches!(inner.machine.state(), State::Run | State::Hold { .. }) {
            return Ok(());
        }
        *ends = Some(EarlyEnd::ByMachine);
        Err(Aborted)
    }
}
