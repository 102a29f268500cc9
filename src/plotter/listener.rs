//! What listens while a job is computed or measured, which takes seconds: the serial line is still
//! answered, and the work can be cancelled.

use super::overrides::OverrideChange;
use super::reply::Reply;
use super::resume::Resumption;
use super::{Board, Strokes, report};
use crate::index::Index;
use crate::machine::{Path, State, Target, Value};
use crate::protocol::RealTime;
use crate::stage::{Aborted, Cancel, Stage};

/// The strokes of a job while the machine measures them. They check for cancelling as they go.
pub(super) struct MeasuredStrokes<'s, 'a, I> {
    /// The strokes of the job.
    pub(super) strokes: Strokes<'s, I>,
    /// Called after every 64 targets, so that the serial line is answered and the user can abort.
    pub(super) cancel: &'a mut dyn Cancel,
    /// Number of targets that the machine has read so far.
    pub(super) targets: usize,
    /// Whether the user has aborted the job. The strokes then end.
    pub(super) aborted: bool,
    /// The pen of the last target that the machine has read.
    #[cfg(feature = "resume")]
    pub(super) last_pen: Option<u8>,
    /// Whether the targets that the machine has read have several pens.
    #[cfg(feature = "resume")]
    pub(super) has_pens: bool,
}

impl<'s, 'a, I> MeasuredStrokes<'s, 'a, I> {
    /// None of these strokes is read yet.
    pub(super) fn new(strokes: Strokes<'s, I>, cancel: &'a mut dyn Cancel) -> Self {
        Self {
            strokes,
            cancel,
            targets: 0,
            aborted: false,
            #[cfg(feature = "resume")]
            last_pen: None,
            #[cfg(feature = "resume")]
            has_pens: false,
        }
    }
}

impl<I: Index> Path for MeasuredStrokes<'_, '_, I> {
    fn next_target(&mut self) -> Option<Target> {
        self.targets += 1;
        // 64 targets take some 100,000 instructions.
        if self.targets.is_multiple_of(64) && self.cancel.check().is_err() {
            self.aborted = true;
        }
        let target = self.strokes.next_target().filter(|_| !self.aborted)?;
        #[cfg(feature = "resume")]
        {
            let pen = self.strokes.pen();
            self.has_pens |= self.last_pen.replace(pen).is_some_and(|last| last != pen);
        }
        Some(target)
    }

    fn rewind(&mut self) {
        self.strokes.rewind();
    }

    fn pen(&self) -> u8 {
        self.strokes.pen()
    }
}

/// Answers the serial line while a job is computed, and ends the computation when the user asks.
pub(super) struct Listener<'b, B: Board> {
    /// The board, from which requests come and to which replies go.
    pub(super) board: &'b mut B,
    /// The position that status reports tell meanwhile, in mm.
    pub(super) position: [Value; 3],
    /// Whether reports are in inches.
    pub(super) inches: bool,
    /// Which contacts are closed when they are not pressed.
    inverted: u8,
    /// The state of the machine that status reports tell.
    pub(super) state: &'static str,
    /// The stage of the computation that they tell; `None` if flash is written instead.
    pub(super) stage: Option<Stage>,
    /// The hold, the pause or the emergency stop that was requested meanwhile. It is carried out
    /// when the computation ends.
    pub(super) requests: RealTime,
    /// The changes of the overrides that were requested meanwhile.
    pub(super) overrides: OverrideChange,
    /// Whether the status was reported since this was last set to false.
    #[cfg(feature = "early-ink")]
    pub(super) has_answered: bool,
}

impl<'b, B: Board> Listener<'b, B> {
    /// Begins to listen with the first stage.
    #[inline(always)] // Adds no frame to the stack while the stages run.
    pub(super) fn new(board: &'b mut B, position: [Value; 3], inches: bool, inverted: u8) -> Self {
        Self {
            board,
            position,
            inches,
            inverted,
            state: "Run",
            stage: Some(Stage::View),
            requests: RealTime::default(),
            overrides: OverrideChange::default(),
            #[cfg(feature = "early-ink")]
            has_answered: false,
        }
    }
}

impl<B: Board> Cancel for Listener<'_, B> {
    fn check(&mut self) -> Result<(), Aborted> {
        report::greet_opened(State::Run, Resumption::default(), None, self.board);
        let requests = self.board.take_real_time();
        if requests.has(RealTime::RESUME) {
            self.requests = self.requests.only(RealTime::EMERGENCY);
        }
        let stops = RealTime::HOLD.and(RealTime::PAUSE).and(RealTime::EMERGENCY);
        self.requests = self.requests.and(requests.only(stops));
        self.overrides.add(requests);
        if requests.has(RealTime::STATUS) {
            #[cfg(feature = "early-ink")]
            {
                self.has_answered = true;
            }
            let stage = match self.stage {
                Some(Stage::View) => "|Stage:view",
                Some(Stage::Visibility) => "|Stage:visibility",
                Some(Stage::Order) => "|Stage:order",
                None => "",
            };
            let mut reply = Reply(self.board);
            reply.part(format_args!("<{}|MPos:", self.state));
            reply.coordinates(self.position, self.inches);
            reply.line(format_args!("|FS:0,0{stage}>"));
        }
        // The button stops what is computed, too, also if it is released again before the end.
        if self.board.contacts().pressed(self.inverted).stop {
            self.requests = self.requests.and(RealTime::EMERGENCY);
        }
        let ends = requests.has(RealTime::ABORT) || self.requests.has(RealTime::EMERGENCY);
        if ends { Err(Aborted) } else { Ok(()) }
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = Some(stage);
    }
}
