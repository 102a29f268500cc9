//! A drawing that waits while no byte comes from the computer, if `$218` says so.
//!
//! Without that setting a drawing that the plotter has computed goes on until its end, whatever
//! becomes of the computer. With it, the machine holds with the pen raised once the computer has
//! been silent for so long, and goes on with the first byte that comes. Drawings that a computer
//! sends while they are drawn need no setting: they wait for what has not come.
//!
//! A hold that the user asks for meanwhile is the user's: then only `~` goes on.

use super::reply::Reply;
use super::{Board, Inner};
use crate::index::Index;
use crate::machine::{Setting, State};
use crate::protocol::RealTime;

/// The requests behind which a drawing does not go on by itself.
const STOPS: [RealTime; 4] =
    [RealTime::HOLD, RealTime::PAUSE, RealTime::ABORT, RealTime::EMERGENCY];

/// For how long the computer has been silent, and what came of it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Silence {
    /// When the last byte came while the machine draws, or when it began to draw, in microseconds
    /// of the board's clock.
    heard_at: u32,
    /// Whether the machine drew in the turn before.
    was_drawing: bool,
    /// Whether a byte of a line has come since the turn before.
    has_heard: bool,
    /// Whether the machine holds because of the silence.
    holds: bool,
}

impl Silence {
    /// Notes that a byte of a line has come.
    #[inline(always)] // It is called for each byte.
    pub(super) fn note_byte(&mut self) {
        self.has_heard = true;
    }
}

impl<I: Index> Inner<'_, I> {
    /// Holds the drawing when the computer has been silent for longer than `$218` allows, and goes
    /// on when it is heard again. `requests` are those of this turn, which are carried out behind
    /// it, so that a status that was asked for tells that the drawing goes on.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn watch_silence<B: Board>(&mut self, requests: RealTime, board: &mut B) {
        let has_heard = requests != RealTime::default() || self.silence.has_heard;
        self.silence.has_heard = false;
        if !matches!(self.machine.state(), State::Hold { .. }) {
            self.silence.holds = false;
        } else if self.silence.holds && has_heard {
            self.silence.holds = false;
            // Such a request makes the hold the user's, or ends the drawing. A pen that the machine
            // waits for is not in because the computer is back.
            let ends_here = STOPS.into_iter().any(|stop| requests.has(stop));
            if !ends_here && self.machine.pen_wanted().is_none() {
                Reply(board).line(format_args!("[MSG:the computer is back: the drawing goes on]"));
                self.machine.resume();
            }
        }
        let draws = self.machine.state() == State::Run && self.draws_job();
        #[cfg(feature = "stream")]
        let draws = draws && !self.is_streamed();
        let now = board.microseconds();
        if !draws || !self.silence.was_drawing || has_heard {
            self.silence.heard_at = now;
        }
        self.silence.was_drawing = draws;
        let seconds = self.machine.settings().get(Setting::SilenceBeforeHold).to_num::<u32>();
        let is_silent = now.wrapping_sub(self.silence.heard_at) >= seconds * 1_000_000;
        if draws && seconds > 0 && is_silent {
            Reply(board).line(format_args!(
                "[MSG:the computer has been silent for {seconds} s ($218): the drawing waits]"
            ));
            self.machine.hold();
            self.silence.holds = true;
        }
    }
}
