//! The reports of the plotter: greeting, build, model, job and status.

use super::grbl::{rate, whole};
use super::reply::Reply;
use super::resume::Resumption;
use super::{Board, Inner, Job, REPLY_BYTES, records};
use crate::fixed::BinaryFraction;
use crate::index::Index;
use crate::machine::{Alarm, Setting, Settings, State, Value};
use crate::order;
use crate::protocol::{AlarmEntry, RealTime};

/// The number of bytes that a port receives before any is read.
const RECEIVE_BYTES: usize = 255;

/// For each part that status reports contain only now and then, the number of reports until the
/// next one that contains it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct ReportCounts {
    /// Until the origin of the coordinates.
    pub(super) origin: u8,
    /// Until the overrides.
    pub(super) overrides: u8,
}

/// Writes the greeting: the first line that a sender sees. It is also the reply to ctrl-X.
pub(super) fn greet<B: Board>(board: &mut B) {
    /// The version of the firmware.
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    Reply(board).line(format_args!("\r\nGrbl 1.1h [penup {VERSION} '$' for help]"));
}

/// If a program has opened a port, writes the greeting to that port alone, with the current alarm,
/// which the other ports have already heard of, the job that has stopped, and the kept settings
/// that are not in force, if the settings are given.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn greet_opened<B: Board>(
    state: State,
    resumption: Resumption,
    settings: Option<&Settings>,
    board: &mut B,
) {
    if !board.take_opened() {
        return;
    }
    board.reply_only_to_opened(true);
    greet(board);
    if let State::Alarm(alarm) = state {
        if alarm == Alarm::Restarted {
            fault(board);
        }
        Reply(board).line(format_args!("ALARM:{}", AlarmEntry::of(alarm).number));
    }
    resumption.report(state, board);
    if let Some(settings) = settings {
        records::report_refused(settings, board);
    }
    board.reply_only_to_opened(false);
}

/// Reports the fault that ended the previous run, if there was one.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
pub(super) fn fault<B: Board>(board: &mut B) {
    // The board truncates longer messages.
    let mut text = heapless::String::<192>::new();
    if let Some(fault) = board.fault() {
        let _ = text.push_str(fault);
        Reply(board).line(format_args!("[MSG:started again after a fault: {text}]"));
    }
}

impl<I: Index> Inner<'_, I> {
    /// Tells the user if the machine is slower than its settings ask for, unless it was as slow
    /// `before`.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn report_held<B: Board>(&self, before: Option<Value>, board: &mut B) {
        let held = self.machine.held_to();
        if let Some(rate) = held.filter(|_| held != before) {
            Reply(board).line(format_args!(
                "[MSG:held to {} mm/min, to stop in time: a greater $120 and $121 allow more]",
                rate.to_bits() >> Value::FRAC_NBITS
            ));
        }
    }

    /// Reports the faces and edges that the job has left out, if any.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn report_degenerate<B: Board>(&self, board: &mut B) {
        let count = self.job.degenerate_faces();
        if count > 0 {
            Reply(board).line(format_args!("[MSG:{count} faces have no area and are left out]"));
        }
        let count = self.job.joined_edges();
        if count > 0 {
            Reply(board).line(format_args!(
                "[MSG:{count} edges are left out: within the precision, the faces beside them are \
                 one]"
            ));
        }
    }

    /// Writes the reply to `$I`: version, board, moves planned ahead and longest line.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn report_build<B: Board>(&self, board: &mut B) {
        const VERSION: &str = env!("CARGO_PKG_VERSION");
        Reply(board).line(format_args!("[VER:1.1h.penup {VERSION} {}:{}]", B::NAME, self.info()));
        let blocks = self.machine.moves_ahead();
        Reply(board).line(format_args!("[OPT:VZ,{blocks},{RECEIVE_BYTES}]"));
    }

    /// The job that is drawn and whose strokes are not all released yet, or else the last job.
    fn known_job(&self) -> &Job<I> {
        #[cfg(feature = "early-ink")]
        if let Some(pending) = &self.pending {
            return pending.job();
        }
        &self.job
    }

    /// Writes the reply to `$model`: the size of the model, its checksums, the result of the last
    /// job's ordering, and the size of the working memory.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn report_model<B: Board>(&mut self, board: &mut B) {
        let model = &self.model;
        let (vertices, limit) = (model.vertices().len(), model.vertex_limit());
        Reply(board).line(format_args!("[MODEL:vertices {vertices} of {limit}]"));
        let (corners, limit) = (model.corner_count(), model.corner_limit());
        let (faces, bars, curves) = (model.face_count(), model.bar_count(), model.curve_count());
        Reply(board).line(format_args!(
            "[MODEL:faces {faces}, bars {bars}, curves {curves}, corners {corners} of {limit}]"
        ));
        #[cfg(feature = "tiles")]
        let contents = self.report_stored(board).unwrap_or_else(|| self.model.checksum());
        #[cfg(not(feature = "tiles"))]
        let contents = model.checksum();
        let options = self.options.checksum();
        Reply(board).line(format_args!("[MODEL:checksum {contents:08X}, options {options:08X}]"));
        let order::Report {
            odd_points, components, pen_down, pen_up, lifts, bound, optimal, ..
        } = *self.known_job().report();
        Reply(board)
            .line(format_args!("[JOB:odd points {odd_points}, parts {components}, lifts {lifts}]"));
        // This converts from 1/256 step to 1/256 mm. Lengths are below 2^56.
        let steps = self.machine.settings().get(Setting::StepsPerMmX).to_bits();
        let mm = |length: u64| BinaryFraction {
            units: (length << 16).checked_div(steps.unsigned_abs().into()).unwrap_or(0) as i64,
            fraction_bits: 8,
            decimals: 1,
        };
        let percent = BinaryFraction {
            units: (pen_down * 25600).checked_div(pen_down + pen_up).unwrap_or(0) as i64,
            fraction_bits: 8,
            decimals: 1,
        };
        let (down, up, bound) = (mm(pen_down), mm(pen_up), mm(bound));
        let proof = if optimal { "the least" } else { "not proved the least" };
        Reply(board).line(format_args!(
            "[JOB:pen down {down} mm, up {up} mm, efficiency {percent} %, bound {bound} mm, \
             {proof}]"
        ));
        Reply(board).line(format_args!("[MEM:{} bytes to work in]", size_of_val(self.words)));
    }

    /// Whether a status report is to be written now: one was asked for, by `requests` or before,
    /// and the output has room for it. The request is done with then; otherwise it waits, also
    /// where what is computed ends meanwhile.
    pub fn takes_status<B: Board>(&mut self, requests: RealTime, board: &mut B) -> bool {
        self.status_due |= requests.has(RealTime::STATUS);
        self.status_due && board.has_room(REPLY_BYTES) && core::mem::take(&mut self.status_due)
    }

    /// Writes Grbl's status report, with penup's own fields at its end, and `stage` behind them. It
    /// is empty, or the field of the stage that is computed while the machine draws: meanwhile no
    /// line is read.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn report_status<B: Board>(&mut self, stage: &str, board: &mut B) {
        let status = self.machine.status();
        let state = match status.state {
            State::Idle if self.machine.is_stopped() => "Idle",
            State::Idle | State::Run | State::Abort => "Run",
            State::Hold { stopped: true } if self.machine.is_stopped() => "Hold:0",
            State::Hold { .. } => "Hold:1",
            State::Jog => "Jog",
            State::Home => "Home",
            State::Check => "Check",
            State::Alarm(_) => "Alarm",
            State::Sleep => "Sleep",
        };
        let is_moving = !matches!(status.state, State::Idle | State::Check | State::Alarm(_));
        let settings = self.machine.settings();
        let mask = settings.get(Setting::StatusReport).to_num::<u8>();
        let inches = self.in_inches();
        let origin = self.program.origin(&self.parameters);
        let [x, y] = self.machine.position_mm();
        let mut position = [x, y, self.program.z()];
        let name = if mask & 1 != 0 { "MPos" } else { "WPos" };
        if mask & 1 == 0 {
            for (coordinate, origin) in position.iter_mut().zip(origin) {
                *coordinate = coordinate.saturating_sub(origin);
            }
        }
        let (blocks, bytes) = (self.machine.free_moves(), board.receive_room());
        let stopped = self.resumption.stopped(status.state);
        #[cfg(feature = "stream")]
        let streamed = self.streamed_targets();
        let mut reply = Reply(board);
        reply.part(format_args!("<{state}|{name}:"));
        reply.coordinates(position, inches);
        if mask & 2 != 0 {
            reply.part(format_args!("|Bf:{blocks},{bytes}"));
        }
        let speed = self.program.speed_in_force();
        let least = settings.get(Setting::MinSpindle);
        let speed = if speed > 0 { speed.max(least) } else { speed };
        let speed = whole(speed.min(settings.get(Setting::MaxSpindle)));
        reply.part(format_args!("|FS:{},{speed}", rate(self.machine.speed(), inches)));
        let (switches, stop) = (self.machine.switches(), self.machine.stop_is_pressed());
        if switches.any() || stop {
            let letter = |pressed, letter| if pressed { letter } else { "" };
            let (x, y, stop) =
                (letter(switches.x, "X"), letter(switches.y, "Y"), letter(stop, "E"));
            reply.part(format_args!("|Pn:{x}{y}{stop}"));
        }
        let counts = &mut self.report_counts;
        match counts.origin.checked_sub(1) {
            Some(count) => counts.origin = count,
            None => {
                counts.origin = if is_moving { 29 } else { 9 };
                counts.overrides = counts.overrides.max(1);
                reply.part(format_args!("|WCO:"));
                reply.coordinates(origin, inches);
            }
        }
        match counts.overrides.checked_sub(1) {
            Some(count) => counts.overrides = count,
            None => {
                counts.overrides = if is_moving { 19 } else { 9 };
                let (draw, rapid) = (status.percent, self.machine.rapid_percent());
                reply.part(format_args!("|Ov:{draw},{rapid},100"));
                let (_, spindle, [mist, flood]) = self.program.modes();
                let spindle = ["", "S", "C", ""].get(usize::from(spindle - 2)).unwrap_or(&"");
                let (mist, flood) = (if mist { "M" } else { "" }, if flood { "F" } else { "" });
                if !(spindle.is_empty() && mist.is_empty() && flood.is_empty()) {
                    reply.part(format_args!("|A:{spindle}{flood}{mist}"));
                }
            }
        }
        if let State::Alarm(alarm) = status.state {
            reply.part(format_args!("|Alarm:{}", AlarmEntry::of(alarm).number));
        }
        let pen = status.pen_wanted.filter(|_| self.machine.is_stopped());
        #[cfg(feature = "hpgl")]
        let pen = pen.or(self.hpgl_pen);
        if let Some(pen) = pen {
            reply.part(format_args!("|Pen:{}", pen + 1));
        }
        if self.machine.underruns() != 0 {
            reply.part(format_args!("|Late:{}", self.machine.underruns()));
        }
        match stopped {
            // The number of strokes of a drawing in parts is not known before its end.
            #[cfg(feature = "tiles")]
            Some([done, u32::MAX]) => reply.part(format_args!("|Stopped:{done}/0")),
            Some([done, all]) => reply.part(format_args!("|Stopped:{done}/{all}")),
            None => {}
        }
        #[cfg(feature = "stream")]
        if let Some([taken, all, room]) = streamed {
            reply.part(format_args!("|Stream:{taken}/{all},{room}"));
        }
        let (done, all) = (status.done, status.job);
        reply.part(format_args!("|Drawn:{}/{}", done.strokes, all.strokes));
        let mm =
            |units: u64| BinaryFraction { units: units as i64, fraction_bits: 18, decimals: 0 };
        let (drawn, left) = (mm(done.drawn), status.seconds_left);
        reply.line(format_args!("|Ink:{drawn}/{}|Left:{left}{stage}>", mm(all.drawn)));
    }
}
