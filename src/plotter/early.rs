//! Early ink: the pen draws the first strokes of a job while the order of the others is computed.
//!
//! [`choose_first`](crate::order::choose_first) says which strokes come first. Once they are known,
//! the machine begins with them. The order is computed as always, by code that knows nothing of
//! this; where it asks whether it is cancelled, [`OrderCancel`] keeps the machine going. So what is
//! drawn depends on the drawing and the settings, and not on how fast the board computes: if the
//! order is late, the pen waits, raised, behind the first strokes.
//!
//! Where the lines take long to find, too, the pen travels to the left end of the drawing meanwhile
//! ([`EarlyTravel`]), where the first strokes will lie.
//!
//! A board with flash keeps the drawing and the first strokes before the pen moves, with all that
//! the order is computed from. When the order is known, it is [added](super::Board::add) to that
//! while the machine is at rest with the pen raised, and only then the other strokes are drawn.
//! After a loss of power before that, the same order is computed again.

use super::job::{Begun, OrderStep, Pipeline, Unordered};
use super::listener::{Listener, MeasuredStrokes};
use super::{Board, Cursor, Inner, Job, Observer, Unobserved, records, report};
use crate::drawing::PagePoint;
use crate::index::Index;
use crate::machine::{JobSize, Machine, Measured, State, TargetList};
use crate::order::{self, Effort, Method, Shape, StrokeTime};
use crate::protocol::{CommandError, RealTime};
use crate::stage::{Aborted, Cancel, Stage};

/// The number of targets that are measured in one turn of the main loop.
const TARGETS_A_TURN: u32 = 64;

/// A job whose order is known, but not released yet, or still being improved.
#[derive(Debug)]
pub(super) struct Pending<I> {
    /// The job with its order.
    job: Job<I>,
    /// The position up to which the job has been measured.
    cursor: Cursor<I>,
    /// The state of measuring the job; `None` once it is finished.
    measured: Option<Measured>,
    /// The size of the job, once it is measured.
    size: JobSize,
}

impl<I> Pending<I> {
    /// The job with its order.
    pub(super) fn job(&self) -> &Job<I> {
        &self.job
    }
}

/// Lets the pen travel to where it will probably begin to draw, while the lines of the job are
/// found.
struct EarlyTravel<'l, 'b, 'm, B: Board> {
    /// Answers the user.
    listener: &'l mut Listener<'b, B>,
    /// The machine.
    machine: &'l mut Machine<'m>,
    /// Whether the pen has left, and has not arrived yet.
    is_travelling: bool,
    /// The number of checks by the stages since the machine was last served.
    checks: u8,
}

/// The stages ask some thousand times a second. The machine is looked after now and then: its plan
/// holds for 50 ms at least.
const CHECKS_BETWEEN: u8 = 8;

impl<B: Board> EarlyTravel<'_, '_, '_, B> {
    /// Waits until the pen has arrived, because flash must not be written while something moves.
    ///
    /// # Errors
    /// [`Aborted`] if the user does not want the job any more, or in an alarm.
    fn arrive(&mut self) -> Result<(), Aborted> {
        while self.is_travelling {
            let answered = self.listener.check();
            self.travel(answered)?;
            self.listener.board.wait_briefly();
        }
        Ok(())
    }

    /// Lets the pen travel on, and stops it where the user does not want the job any more. Returns
    /// what the user was `answered`.
    ///
    /// # Errors
    /// [`Aborted`] as `answered`, or in an alarm.
    #[inline(never)] // Keeps its frame off the stack while the lines are found.
    fn travel(&mut self, answered: Result<(), Aborted>) -> Result<(), Aborted> {
        let Self { listener, machine, .. } = self;
        machine.observe(listener.board.contacts());
        if answered.is_err() {
            machine.abort();
        } else if listener.requests.has(RealTime::HOLD) {
            machine.hold();
        }
        machine.fill(&mut TargetList::new(&[]), listener.board.queue());
        listener.board.begin_steps();
        let ([x, y], [_, _, z]) = (machine.position_mm(), listener.position);
        listener.position = [x, y, z];
        match machine.state() {
            State::Alarm(_) => Err(Aborted),
            State::Idle => {
                self.is_travelling = !machine.is_stopped();
                answered
            }
            _ => answered,
        }
    }
}

impl<B: Board> Cancel for EarlyTravel<'_, '_, '_, B> {
    #[inline(never)] // Keeps its frame off the stack while the lines are found.
    fn check(&mut self) -> Result<(), Aborted> {
        let answered = self.listener.check();
        if !self.is_travelling {
            return answered;
        }
        self.checks = (self.checks + 1) % CHECKS_BETWEEN;
        if self.checks == 0 || answered.is_err() { self.travel(answered) } else { answered }
    }

    fn enter(&mut self, stage: Stage) {
        self.listener.enter(stage);
    }

    fn expect_beginning(&mut self, at: PagePoint) {
        let may_travel =
            self.machine.state() == State::Idle && !self.listener.requests.has(RealTime::HOLD);
        // What lies beyond the travel is refused later, with the reason.
        self.is_travelling = may_travel && self.machine.jog(at, None).is_ok();
    }
}

/// Keeps the machine going while the order of a job is computed, and ends the computation when the
/// user gives the job up.
struct OrderCancel<'h, 'm, B: Board, I> {
    /// The plotter without its working memory.
    inner: &'h mut Inner<'m, I>,
    /// The board.
    board: &'h mut B,
    /// The part of the job that the machine may read.
    begun: Begun<'h, I>,
}

impl<B: Board, I: Index> Cancel for OrderCancel<'_, '_, B, I> {
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    fn check(&mut self) -> Result<(), Aborted> {
        let Self { inner, board, begun } = self;
        let requests = board.take_real_time();
        #[cfg(feature = "hold-in-silence")]
        inner.watch_silence(requests, *board);
        let settings = Some(inner.machine.settings());
        report::greet_opened(inner.machine.state(), inner.resumption, settings, *board);
        if requests.has(RealTime::ABORT) {
            inner.machine.abort();
            inner.act(requests.only(RealTime::EMERGENCY));
            return Err(Aborted);
        }
        inner.act(requests);
        inner.watch(*board);
        inner.note_progress(*board);
        inner.plan(Some(*begun), *board);
        board.begin_steps();
        if inner.takes_status(requests, *board) {
            inner.report_status("|Stage:order", *board);
        }
        match inner.machine.state() {
            State::Run | State::Hold { .. } => Ok(()),
            _ => Err(Aborted),
        }
    }
}

impl<I: Index> Inner<'_, I> {
    /// How long strokes take, if the pen may begin before the order is known. This decides about
    /// the order, so it depends on nothing but the options and the settings.
    pub(super) fn early(&self) -> Option<StrokeTime> {
        let settings = self.machine.settings();
        let time_model = settings.time_model(order::TimeModel::BOARD);
        let order::Options { method, shape, effort, .. } =
            self.options.order(settings.page_steps(), time_model);
        // If the pen moves while the machine does, or if strokes are made longer, the end of a
        // stroke depends on what follows. The exact method may need more memory than there is.
        let may_begin = shape == Shape::OpenPath
            && effort != Effort::Units(0)
            && method != Method::Exact
            && self.machine.stroke_ends().is_none()
            && self.machine.moves_apart();
        (may_begin && self.has_early_ink()).then(|| settings.stroke_time())
    }

    /// Whether this plotter's pen begins early.
    #[cfg(any(test, feature = "host"))]
    fn has_early_ink(&self) -> bool {
        self.has_early_ink && !self.is_thorough
    }

    /// Whether this plotter's pen begins early.
    #[cfg(not(any(test, feature = "host")))]
    fn has_early_ink(&self) -> bool {
        true
    }

    /// Computes the job of `$plot` and begins to draw it.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(always)] // Adds no frame to the stack.
    pub(super) fn plot_model<B: Board>(
        &mut self,
        listener: &mut Listener<'_, B>,
    ) -> Result<(), CommandError> {
        let job = self.begin_job_while_travelling(listener)?;
        if !self.begins_early(job) {
            self.job = job.ordered(self.words, listener)?;
            if self.machine.state() == State::Idle {
                Self::make_room(listener, records::flash_bytes(&self.job))?;
            }
            self.begin(listener)?;
            self.keep_begun(listener.board);
            return Ok(());
        }
        let measured = self.begin_first(job, listener)?;
        self.change_overrides(core::mem::take(&mut listener.overrides));
        self.act(core::mem::take(&mut listener.requests));
        // The pen leaves before the order is begun, which asks for the first time only when it has
        // taken its memory.
        self.plan(None, listener.board);
        listener.board.begin_steps();
        let job = self.order_meanwhile(job, listener.board)?;
        let (cursor, measured) = (Cursor::default(), Some(measured));
        self.pending = Some(Pending { job, cursor, measured, size: JobSize::default() });
        Ok(())
    }

    /// Computes the drawing of `$plot`, in place of the last job, while the pen travels to where it
    /// will probably begin.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    fn begin_job_while_travelling<B: Board>(
        &mut self,
        listener: &mut Listener<'_, B>,
    ) -> Result<Job<I>, CommandError> {
        self.forget_job();
        let (steps, early) = (self.machine.settings().page_steps(), self.early());
        let time_model = self.machine.settings().time_model(self.units_per_second());
        let Self { model, options, words, machine, .. } = self;
        let mut travel = EarlyTravel { listener, machine, is_travelling: false, checks: 0 };
        let (cancel, observer) = (&mut travel, &mut Unobserved);
        let begun =
            Pipeline { model, options, steps, time_model, early, words, cancel, observer }.begin();
        if begun.is_ok() {
            travel.arrive()?;
        } else if travel.is_travelling {
            travel.machine.abort();
        }
        begun
    }

    /// Computes the drawing of `$plot`, in place of the last job.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    pub(super) fn begin_job(
        &mut self,
        cancel: &mut dyn Cancel,
        observer: &mut dyn Observer<I>,
    ) -> Result<Job<I>, CommandError> {
        self.forget_job();
        self.pipeline(cancel, observer).begin()
    }

    /// Whether the machine begins with the first strokes of a job, of which only the drawing is
    /// known: there are such strokes, and nothing can fail later.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    fn begins_early(&mut self, job: Job<I>) -> bool {
        let Some(Unordered { first, .. }) = job.unordered() else { return false };
        if self.machine.state() != State::Idle || first.segments == 0 || !job.lay_first(self.words)
        {
            return false;
        }
        let Some(drawing) = job.drawing(self.words) else { return false };
        let Some(&begin) = drawing.points.first() else { return false };
        let mut bounds = [begin, begin];
        for point in drawing.points {
            let [least, greatest] = &mut bounds;
            *least = PagePoint { x: least.x.min(point.x), y: least.y.min(point.y) };
            *greatest = PagePoint { x: greatest.x.max(point.x), y: greatest.y.max(point.y) };
        }
        first.segments < drawing.segments.len() && self.machine.takes_any_path(bounds)
    }

    /// Keeps the drawing of a job and lets the machine begin with its first strokes. Returns the
    /// beginning of its measurement.
    #[inline(never)] // Keeps its frame off the stack while the order is computed.
    fn begin_first<B: Board>(
        &mut self,
        job: Job<I>,
        listener: &mut Listener<'_, B>,
    ) -> Result<Measured, CommandError> {
        self.job = job;
        Self::make_room(listener, records::flash_bytes(&self.job))?;
        let is_kept = self.save(listener.board);
        // It has taken the place of a job that has stopped. If it is not kept, its order must not
        // be kept either, behind that other job.
        self.resumption.forget();
        let measured = self.machine.begin_measuring();
        {
            let strokes = self.job.strokes(self.words, &mut self.cursor, None);
            let cancel: &mut dyn Cancel = listener;
            let mut strokes = MeasuredStrokes::new(strokes, cancel);
            self.machine.start(&mut strokes)?;
            if strokes.aborted {
                self.machine.abort();
                return Err(CommandError::Aborted);
            }
        }
        self.cursor = Cursor::default();
        if let (Some(drawing), Some(Unordered { first, .. })) =
            (job.drawing(self.words), job.unordered())
        {
            let rest = drawing.segments.iter().skip(first.segments);
            let length = rest.map(|segment| {
                let ends = [segment.from(), segment.to()]
                    .map(|point| drawing.points.get(point.get()).copied().unwrap_or_default());
                self.machine.length(ends)
            });
            self.machine.expect_more(first.strokes_left, length.sum());
        }
        if is_kept {
            self.keep_model(listener.board);
        }
        Ok(measured)
    }

    /// Carries out the next step of the computation of the order, while the machine draws the
    /// strokes that are released, and releases some more of them. Gives the job up if that fails.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with.
    #[inline(never)] // Its two callers share one copy of the code.
    fn order_meanwhile<B: Board>(
        &mut self,
        job: Job<I>,
        board: &mut B,
    ) -> Result<Job<I>, CommandError> {
        let words = core::mem::take(&mut self.words);
        let ordered = job.order_further(words, |step: OrderStep<'_, I>, scratch, rest| {
            let begun = step.begun;
            let mut meanwhile = OrderCancel { inner: self, board, begun };
            step.run(scratch, &mut meanwhile, rest)
        });
        self.words = words;
        match ordered {
            Ok(job) if job.unordered().is_some() => self.job = job,
            Ok(_) => {}
            Err(_) => self.machine.abort(),
        }
        ordered
    }

    /// Whether the order of the job that is drawn is still being improved.
    pub(super) fn is_improving(&self) -> bool {
        self.pending.as_ref().is_some_and(|pending| pending.job.unordered().is_some())
    }

    /// Improves the order of a job once, and lets the machine draw some more of its strokes. Gives
    /// the job up if that fails.
    ///
    /// # Errors
    /// [`CommandError::Aborted`].
    #[inline(never)] // Keeps its frame off the stack while other stages run.
    pub(super) fn improve_order<B: Board>(&mut self, board: &mut B) -> Result<(), CommandError> {
        let Some(Pending { job, .. }) = self.pending else { return Ok(()) };
        let ordered = self.order_meanwhile(job, board);
        match (&mut self.pending, ordered) {
            (Some(pending), Ok(job)) => pending.job = job,
            (pending, _) => *pending = None,
        }
        ordered.map(|_| ())
    }

    /// Measures a job whose order is not improved any more, and releases all of its strokes once
    /// the board has kept the order. Returns whether there was anything to do.
    #[inline(always)] // It is called in every turn of the main loop.
    pub(super) fn follow_order<B: Board>(&mut self, board: &mut B) -> bool {
        self.pending.is_some() && self.release(board)
    }

    /// Carries out [`Inner::follow_order`].
    #[inline(never)] // Called seldom: inlined, it would only fill the cache.
    fn release<B: Board>(&mut self, board: &mut B) -> bool {
        if !matches!(self.machine.state(), State::Run | State::Hold { .. }) {
            // The job was given up. It is kept without the order, which can be computed again.
            self.pending = None;
            return false;
        }
        let Some(pending) = &mut self.pending else { return false };
        if pending.job.unordered().is_some() {
            return false;
        }
        if let Some(measured) = &mut pending.measured {
            let mut strokes = pending.job.strokes(self.words, &mut pending.cursor, None);
            for _ in 0..TARGETS_A_TURN {
                // Every target was checked with the bounds of the drawing.
                if !matches!(self.machine.measure_next(&mut strokes, measured), Ok(true)) {
                    let measured = pending.measured.take();
                    pending.size = measured
                        .map(|measured| self.machine.end_measuring(measured))
                        .unwrap_or_default();
                    break;
                }
            }
            return true;
        }
        let (job, size) = (pending.job, pending.size);
        if self.resumption.keeps() {
            // The flash is written while nothing moves.
            if !self.machine.is_stopped() {
                return false;
            }
            let kept = records::add_order(&job, size.strokes, self.words, board);
            self.order_kept(size.strokes, kept, board);
        }
        self.pending = None;
        self.machine.set_job_size(size);
        self.job = job;
        true
    }

    /// Computes the order of a job that was loaded, if it is not known. Returns the number of
    /// strokes then, which was an estimate before. The caller keeps the order by
    /// [`Inner::keep_order`] once the job has begun.
    ///
    /// # Errors
    /// The [`CommandError`] to reply with. The job stays kept as it was.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn complete_order<B: Board>(
        &mut self,
        listener: &mut Listener<'_, B>,
    ) -> Result<Option<u32>, CommandError> {
        if self.job.unordered().is_none() {
            return Ok(None);
        }
        self.job = self.job.ordered(self.words, listener)?;
        let strokes = {
            let strokes = self.job.strokes(self.words, &mut self.cursor, None);
            let cancel: &mut dyn Cancel = listener;
            let mut strokes = MeasuredStrokes::new(strokes, cancel);
            let mut measured = self.machine.begin_measuring();
            while self.machine.measure_next(&mut strokes, &mut measured)? {}
            if strokes.aborted {
                return Err(CommandError::Aborted);
            }
            self.machine.end_measuring(measured).strokes
        };
        self.cursor = Cursor::default();
        Ok(Some(strokes))
    }

    /// Keeps the order of a job that was loaded without it, and that has so many strokes, before
    /// anything moves.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn keep_order<B: Board>(&mut self, strokes: u32, board: &mut B) {
        if records::add_order(&self.job, strokes, self.words, board).is_err() {
            records::say_not_kept(board);
        }
    }
}
