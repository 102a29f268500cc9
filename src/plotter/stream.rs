//! Lines that are not answered at once.
//!
//! This module carries out G-code, jogs, homing and lists. Some of these lines take longer. They
//! become a [`Task`], and are answered only when it is done. It also handles real-time requests and
//! reports alarms.

use super::overrides::OverrideChange;
use super::program::{
    Context, Flow, MachineAction, MachinePosition, Parameter, Program, StoredPosition,
};
use super::{Board, Inner, REPLY_BYTES, Reply, help};
use crate::drawing::{LineType, PagePoint};
use crate::fixed::{BinaryFraction, decimals_of};
use crate::index::Index;
use crate::machine::{Alarm, MachineError, Setting, State, Target};
use crate::model::ElementKind;
use crate::motion::{StepEvent, TICKS_PER_SECOND};
use crate::protocol::{AlarmEntry, CommandError, GCode, RealTime};
use crate::step::{Arc, Chords, Line};
use core::fmt;

/// The task that is left for the line that is being carried out, if the line takes longer than
/// others.
#[derive(Debug)]
pub(super) enum Task {
    /// The rest of an arc, from the point reached so far.
    Arc(PagePoint, Arc),
    /// A dwell of this many ticks, which begins once the machine has stopped.
    Dwell(u64),
    /// Waits until the machine has stopped, then for the user, to change the pen if `for_pen`.
    Pause {
        /// Whether the pen is to be changed.
        for_pen: bool,
    },
    /// A move with the pen up, behind another one.
    Go(PagePoint),
    /// Waits until the machine has stopped, then sets and keeps a parameter. What ends the line
    /// before, such as ctrl-X, leaves the parameter as it is.
    Keep(Parameter, MachinePosition),
    /// Keeps the parameters, a moment after the settings were kept.
    #[cfg(feature = "early-ink")]
    Restore {
        /// When the settings were kept, in microseconds of the board's clock.
        since: u32,
    },
    /// Waits until the machine has stopped, then locks it, because a line led beyond the travel.
    LockAtTravel(MachineError),
    /// Homing: looks for the limit switches.
    Home,
    /// Writes a list, from the row with this index on.
    List(Listing, usize),
}

/// A list of many rows, of which one is written at a time.
#[derive(Debug, Clone, Copy)]
pub(super) enum Listing {
    /// The commands, as `$` lists them.
    Help,
    /// The settings of the machine, as `$$` lists them, or with names and units as `$settings`
    /// does.
    Settings {
        /// Whether names and units are listed as well.
        named: bool,
    },
    /// The options of the plot, as `$options` lists them.
    Options,
    /// Elements of the model of one kind, up to this index, which is excluded.
    Model(ElementKind, usize),
}

/// The first line of the list of commands, which is Grbl's.
const GRBL_HELP: &str = "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]";

/// How far the task has come, as [`Inner::proceed`] returns it.
pub(super) enum Progress {
    /// The task is done, and the line can be answered with this outcome.
    Done(Result<(), CommandError>),
    /// A part of the task is done. Call again.
    More,
    /// The task waits for the machine, for time, or for room in the output.
    Waits,
    /// The task is done, the line can be answered with success, and the plotter begins anew.
    #[cfg(feature = "early-ink")]
    Reset,
}

impl<I: Index> Inner<'_, I> {
    /// Carries out real-time requests, except status and abort.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn act(&mut self, requests: RealTime) {
        if requests == RealTime::default() {
            return;
        }
        if requests.has(RealTime::EMERGENCY) {
            self.machine.alarm(Alarm::EmergencyStop);
        }
        // Which of them came first is not known; a hold is the safe one, so it comes last.
        // A pen that nobody has been asked for yet is not in.
        let is_pen_due = self.machine.pen_wanted().is_some() && !self.machine.is_stopped();
        if requests.has(RealTime::RESUME) && !is_pen_due {
            self.machine.resume();
        }
        if requests.has(RealTime::HOLD) {
            self.machine.hold();
        }
        if requests.has(RealTime::CANCEL_JOG) {
            self.machine.cancel_jog();
        }
        if requests.has(RealTime::PAUSE) {
            self.machine.pause_after_stroke();
        }
        // Between two lines of a program, and in a dwell, the machine is idle and can hold at once.
        // In other states this is refused.
        if (requests.has(RealTime::HOLD) || requests.has(RealTime::PAUSE)) && self.program.is_open()
        {
            let _ = self.machine.pause();
        }
        let mut change = OverrideChange::default();
        change.add(requests);
        self.change_overrides(change);
    }

    /// Changes the overrides of the speeds, and lets the status tell so.
    pub(super) fn change_overrides(&mut self, change: OverrideChange) {
        let before = (self.machine.percent(), self.machine.rapid_percent());
        let (feed, rapid) = (change.feed_after(before.0), change.rapid_after(before.1));
        if (feed, rapid) != before {
            self.machine.set_override(feed);
            self.machine.set_rapid_override(rapid);
            self.report_counts.overrides = 0;
        }
    }

    /// Reads the contacts. Reports an alarm once, and lets the board carry it out at once. Asks for
    /// the next pen, once, when the machine has stopped and waits for it.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn watch<B: Board>(&mut self, board: &mut B) {
        self.machine.observe(board.contacts());
        let alarm = match self.machine.state() {
            State::Alarm(alarm) => Some(alarm),
            _ => None,
        };
        if alarm != self.alarm_reported {
            self.alarm_reported = alarm;
            if let Some(alarm) = alarm {
                self.restore_z();
                if alarm != Alarm::SoftLimit {
                    self.resumption.lose_position();
                }
                board.step_now();
                Reply(board).line(format_args!("ALARM:{}", AlarmEntry::of(alarm).number));
            }
        }
        if let State::Alarm(_) | State::Sleep = self.machine.state() {
            // What comes behind it draws only where it lowers the pen, which is raised.
            if self.program.raise_pen() {
                self.report_counts.overrides = 0;
            }
        }
        // A hand goes to the pen then.
        let pen = self.machine.pen_wanted().filter(|_| self.machine.is_stopped());
        if pen != self.pen_reported {
            self.pen_reported = pen;
            if let Some(pen) = pen {
                Reply(board).line(format_args!("[MSG:put in pen {}, then send ~]", pen + 1));
            }
        }
    }

    /// Continues the task of the line that is being carried out.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn proceed<B: Board>(&mut self, board: &mut B) -> Progress {
        if let Some(Task::List(listing, number)) = &mut self.task {
            // Writing a row takes up to 10 ms. It waits for room in the output rather than block,
            // because steps may be running.
            if !board.has_room(REPLY_BYTES) {
                return Progress::Waits;
            }
            let (listing, this) = (*listing, *number);
            *number += 1;
            if self.list(listing, this, board) {
                return Progress::More;
            }
            self.task = None;
            return Progress::Done(Ok(()));
        }
        #[cfg(feature = "early-ink")]
        if let Some(Task::Restore { .. }) = self.task {
            return match self.keep_rest(false, board) {
                None => Progress::Waits,
                Some(Ok(())) => Progress::Reset,
                Some(error) => Progress::Done(error),
            };
        }
        let progress = match self.machine.state() {
            State::Alarm(_) | State::Sleep => Progress::Done(Err(CommandError::Locked)),
            State::Abort => Progress::Done(Err(CommandError::Aborted)),
            _ => self.advance(board).unwrap_or_else(|error| Progress::Done(Err(error.into()))),
        };
        if matches!(progress, Progress::Done(_)) {
            self.task = None;
        }
        progress
    }

    /// Does the next part of the task, as far as the machine is ready for it.
    fn advance<B: Board>(&mut self, board: &mut B) -> Result<Progress, MachineError> {
        let machine = &mut self.machine;
        let is_stopped = machine.state() == State::Idle && machine.is_stopped();
        let may_keep =
            machine.is_stopped() && matches!(machine.state(), State::Idle | State::Check);
        match &mut self.task {
            Some(Task::Arc(from, arc)) if machine.has_room() => {
                // The chord iterator is made anew for each chord. Keeping it, with the points that
                // it reads ahead, would take stack that the computation of a job needs.
                let Some(to) = Chords::new(*from, arc.clone()).next() else {
                    return Ok(Progress::Done(Ok(())));
                };
                machine.draw_to(self.program.target(to), self.program.feed())?;
                // The chord replaces as many points of the arc as it has moves.
                for _ in Line::new(core::mem::replace(from, to), to) {
                    arc.next();
                }
                Ok(Progress::More)
            }
            Some(Task::Dwell(left)) if is_stopped && *left > 0 => {
                let ticks = (*left).min(StepEvent::MAX_TICKS.into());
                *left -= ticks;
                machine.dwell(ticks as u32, board.queue());
                Ok(Progress::More)
            }
            Some(Task::Pause { for_pen }) if is_stopped => {
                let text = if *for_pen { "put in the next pen, then" } else { "to go on," };
                machine.pause()?;
                machine.reset_ink_budget();
                if *for_pen {
                    // Nobody knows whether it is changed, so the next drawing asks for its own.
                    machine.set_pen(u8::MAX);
                }
                Reply(board).line(format_args!("[MSG:{text} send ~]"));
                Ok(Progress::Done(Ok(())))
            }
            Some(Task::Go(point)) if machine.has_room() => {
                machine.draw_to(Target { point: *point, ink: None }, None)?;
                Ok(Progress::Done(Ok(())))
            }
            Some(Task::Keep(parameter, position)) if may_keep => {
                let (parameter, position) = (*parameter, *position);
                Ok(Progress::Done(self.set_parameter(parameter, position, board)))
            }
            Some(Task::LockAtTravel(error)) if is_stopped => {
                let error = *error;
                machine.alarm(Alarm::SoftLimit);
                Ok(Progress::Done(Err(error.into())))
            }
            Some(Task::Home) if is_stopped => {
                self.resumption.find_position(self.machine.settings());
                self.run_startup_lines(board);
                Ok(Progress::Done(Ok(())))
            }
            Some(Task::Dwell(_)) if is_stopped => Ok(Progress::Done(Ok(()))),
            Some(_) => Ok(Progress::Waits),
            None => Ok(Progress::Done(Ok(()))),
        }
    }

    /// Writes row `number` of a list. Returns `false` past its end.
    fn list<B: Board>(&self, listing: Listing, number: usize, board: &mut B) -> bool {
        if let Listing::Model(part, end) = listing {
            if number < end {
                self.list_one(part, number, board);
            }
            return number < end;
        }
        let mut lines = 0;
        let mut line = |text: fmt::Arguments<'_>| {
            if lines == number {
                Reply(board).line(text);
            }
            lines += 1;
        };
        match listing {
            Listing::Help => {
                line(format_args!("{GRBL_HELP}"));
                help(&mut |usage, meaning| match cfg!(feature = "command-help") {
                    true => line(format_args!("[HLP:{usage} {meaning}]")),
                    false => line(format_args!("[HLP:{usage}]")),
                });
            }
            Listing::Settings { named } => {
                for (info, value) in self.machine.settings().iter() {
                    let (name, unit) = (info.name, info.unit());
                    let number = u32::from(info.number());
                    let units = value.to_bits().into();
                    let decimals = if info.whole { 0 } else { decimals_of(value) };
                    let value = BinaryFraction { units, fraction_bits: 16, decimals };
                    if named {
                        line(format_args!("${number}={value} ({name}, {unit})"));
                    } else {
                        line(format_args!("${number}={value}"));
                    }
                }
            }
            Listing::Model(..) => {}
            Listing::Options => {
                self.options.lines().for_each(|option| line(format_args!("{option}")));
            }
        }
        number < lines
    }

    /// Begins to look for the limit switches.
    ///
    /// # Errors
    /// [`CommandError::HomingOff`] if homing is switched off, or the machine's refusal.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn home(&mut self) -> Result<(), CommandError> {
        self.check_idle()?;
        if !self.machine.settings().is_on(Setting::Homing) {
            return Err(CommandError::HomingOff);
        }
        self.machine.home(self.machine.switches())?;
        self.task = Some(Task::Home);
        Ok(())
    }

    /// Returns the state that the interpreter needs besides the line.
    pub(super) fn context(&self) -> Context<'_> {
        let settings = self.machine.settings();
        let park = [settings.get(Setting::ParkX), settings.get(Setting::ParkY)];
        let is_idle = self.machine.state() == State::Idle;
        Context { settings, parameters: &self.parameters, park, is_idle }
    }

    /// Carries out a line of G-code, or begins a task for it.
    ///
    /// # Errors
    /// [`CommandError::Locked`] in alarm or sleep, [`CommandError::Jogging`] while a jog is in
    /// progress, or the interpreter's or the machine's refusal. The program's modes are then
    /// unchanged.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn run_gcode<B: Board>(
        &mut self,
        line: GCode<'_>,
        board: &mut B,
    ) -> Result<(), CommandError> {
        if line.words().next().is_none() {
            if line.is_mark() {
                self.end_program(board);
                self.program.forget_raised_pen(self.machine.settings());
            }
            if !line.text().is_empty() {
                self.program.begin_line();
            }
            return Ok(());
        }
        let checking = match self.machine.state() {
            State::Alarm(_) | State::Sleep => return Err(CommandError::Locked),
            State::Jog => return Err(CommandError::Jogging),
            state => state == State::Check,
        };
        let (program, action, flow) =
            self.program.at(&self.machine, checking).after(line, &self.context())?;
        // A task would wait for the end of a job, which needs the next lines.
        let waits_for_rest = flow.is_some()
            || matches!(
                action,
                MachineAction::Arc(_) | MachineAction::Dwell(_) | MachineAction::Set(..)
            )
            // A shift counts from the position, which only the rest of the job decides.
            || program.shifts() != self.program.shifts();
        if waits_for_rest && self.draws_job() {
            return Err(CommandError::Busy);
        }
        let machine = &mut self.machine;
        let waits = !checking;
        match action {
            MachineAction::Nothing => {}
            MachineAction::Line(point) => machine.draw_to(program.target(point), program.feed())?,
            MachineAction::Arc(arc) => {
                let (least, most) = arc.bounds();
                machine.check_travel(0, least)?;
                machine.check_travel(0, most)?;
                machine.check_feed(program.feed())?;
                if waits {
                    self.task = Some(Task::Arc(machine.end(), arc));
                }
            }
            MachineAction::Lower => machine.lower_pen()?,
            MachineAction::Go([via, to]) => {
                machine.check_travel(0, to)?;
                machine.draw_to(Target { point: via, ink: None }, None)?;
                if waits && to != via {
                    self.task = Some(Task::Go(to));
                }
            }
            MachineAction::Dwell(units) if waits => {
                let ticks = (u64::from(units) * u64::from(TICKS_PER_SECOND)) >> 16;
                self.task = Some(Task::Dwell(ticks));
            }
            MachineAction::Dwell(_) => {}
            MachineAction::Set(parameter, position) => {
                if parameter == Parameter::Stored(StoredPosition::Park) {
                    // What it would be refused for later must not leave the line's modes behind.
                    Setting::ParkX.info().check(position[0])?;
                    Setting::ParkY.info().check(position[1])?;
                }
                self.task = Some(Task::Keep(parameter, position));
            }
            MachineAction::Position => self.report_position(board),
        }
        self.note_shift(&program);
        self.program = program;
        match flow {
            None => {}
            Some(Flow::Pause) if waits => self.task = Some(Task::Pause { for_pen: false }),
            Some(Flow::ChangePen) if waits => self.task = Some(Task::Pause { for_pen: true }),
            Some(Flow::Pause | Flow::ChangePen) => {}
            Some(Flow::End) => {
                self.end_program(board);
                self.program.forget_pen();
                Reply(board).line(format_args!("[MSG:Pgm End]"));
            }
        }
        Ok(())
    }

    /// Lets no further line of a program act if the `error` of a line is that it leads beyond the
    /// travel: the moves before it are done, then the machine is locked. In check mode, and while
    /// a job is drawn, the line is refused alone.
    ///
    /// # Errors
    /// The `error`, unless the machine will be locked.
    pub(super) fn end_at_travel(&mut self, error: CommandError) -> Result<(), CommandError> {
        match error {
            CommandError::Machine(error @ MachineError::BeyondTravel { .. })
                if self.machine.state() != State::Check && !self.draws_job() =>
            {
                self.task = Some(Task::LockAtTravel(error));
                Ok(())
            }
            error => Err(error),
        }
    }

    /// Carries out a jog. The modes that the line sets do not affect later lines.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub(super) fn jog(&mut self, line: GCode<'_>) -> Result<(), CommandError> {
        if !matches!(self.machine.state(), State::Idle | State::Jog) {
            return Err(CommandError::Busy);
        }
        let program = self.program.at(&self.machine, false);
        let (jogged, point) = program.after_jog(line, &self.context())?;
        self.machine.jog(point, jogged.feed())?;
        self.program = jogged;
        Ok(())
    }

    /// Whether the machine draws a job, or holds within one: not G-code that is sent line by line.
    pub(super) fn draws_job(&self) -> bool {
        matches!(self.machine.state(), State::Run | State::Hold { .. })
            && !self.machine.is_streaming()
    }

    /// Whether the next line must wait, because a line is being carried out or there is no room for
    /// a move.
    pub(super) fn must_wait(&self) -> bool {
        #[cfg(feature = "stream")]
        if self.waits_for_targets() {
            return true;
        }
        // After ctrl-X and after a jog that was cancelled, lines wait until the machine stands, and
        // behind a job until its last stroke is noted.
        self.task.is_some()
            || self.machine.notes_last_stroke()
            || self.machine.state() == State::Abort
            || (self.machine.is_streaming() && !self.machine.has_room())
    }
}

impl Program {
    /// The target at a point, with the pen up or down as the program has set it.
    fn target(&self, point: PagePoint) -> Target {
        Target { point, ink: self.draws.then_some(LineType::Full) }
    }
}
