//! Carries out HP-GL: it hands the bytes of a serial port to a [`Session`], and the session's
//! actions to the machine, one at a time, as far as the machine has room for moves.
//!
//! While HP-GL is in force at a port, that port hears nothing but the answers that HP-GL itself
//! asks for, and the status after `?`. All other replies go to the other port.

use super::{Board, PORT_LIMIT, Plotter, REPLY_BYTES, Replies, Reply};
use crate::array::MapEach;
use crate::drawing::{LineType, PAGE_LIMIT, PagePoint};
use crate::fixed::{divide_rounding, product};
use crate::hpgl::{Action, Dialect, Point, Rectangle, Session, Token, UNITS_PER_MM};
use crate::index::Index;
use crate::machine::{Machine, MachineError, Setting, State, Target, Value};
use crate::protocol::Label;
use core::fmt;

/// HP-GL at the serial ports of a plotter.
#[derive(Debug)]
pub(super) struct HpGl<'m> {
    /// For each port, which of its bytes are HP-GL.
    dialects: [Dialect; PORT_LIMIT],
    /// The port whose HP-GL is carried out.
    port: Option<usize>,
    session: &'m mut Session,
    /// Whether HP-GL has begun and nothing of it has been carried out yet.
    is_new: bool,
    /// Whether something was to be drawn while the machine was locked. Nothing is drawn then until
    /// the next `IN`.
    was_locked: bool,
}

/// What has become of a byte of a port.
pub(super) enum Taken {
    /// It belongs to a line, and was not taken.
    Line,
    /// It was taken, and another one can be taken at once.
    More,
    /// It was taken, and something has to be done before the next one.
    Last,
}

/// The result of trying to carry out an action.
enum Outcome {
    /// The action is complete.
    Done,
    /// A part of it was carried out.
    More,
    /// The action has to wait for the machine.
    Waits,
    /// The action cannot be carried out.
    Refused,
}

impl<'m> HpGl<'m> {
    /// Without HP-GL, in the memory of `session`.
    pub(super) fn new(session: &'m mut Session) -> Self {
        let dialects = [Dialect::new(); PORT_LIMIT];
        Self { dialects, port: None, session, is_new: false, was_locked: false }
    }

    /// The port at which HP-GL is in force or still carried out.
    pub(super) fn port(&self) -> Option<usize> {
        self.port
    }

    /// Whether bytes of HP-GL are left to carry out.
    pub(super) fn is_drawing(&self) -> bool {
        self.port.is_some() && !self.session.is_idle()
    }

    /// Whether no byte can be taken now.
    pub(super) fn must_wait(&self, inner_waits: bool) -> bool {
        let Some(port) = self.port else { return inner_waits };
        if self.dialects.get(port).is_some_and(Dialect::is_in_force) {
            // The sender's questions are answered although the machine has no room for moves.
            return self.session.room() == 0;
        }
        // What follows HP-GL waits until all of it has been carried out.
        inner_waits || !self.session.is_idle()
    }
}

impl<'m, I: Index> Plotter<'m, I> {
    /// Takes a byte if it is HP-GL.
    pub(super) fn take_hpgl<B: Board>(&mut self, port: usize, byte: u8, board: &mut B) -> Taken {
        let Some(dialect) = self.hpgl.dialects.get_mut(port) else { return Taken::Line };
        let token = dialect.take(byte);
        let is_mine = self.hpgl.port.is_none_or(|mine| mine == port);
        match token {
            Token::Line => return Taken::Line,
            Token::Leaves => {
                if is_mine {
                    // Nothing more comes that would tell whether the last line has gone on.
                    self.hpgl.session.receive(b';', Token::Code);
                }
                if let Some(reader) = self.readers.get_mut(port) {
                    reader.clear();
                }
                return Taken::Line;
            }
            Token::Begins(_) if !is_mine => {
                board.reply_to(Replies::Only(port));
                let text = "HP-GL comes by the other port: end it there with ctrl-X";
                Reply(board).line(format_args!("[MSG:{text}]"));
                self.mute(board);
            }
            Token::Begins(beginning) => {
                if let Some(reader) = self.readers.get_mut(port) {
                    reader.clear();
                }
                if beginning == crate::hpgl::Beginning::Command {
                    board.reply_to(Replies::Only(port));
                    Reply(board).outcome(Ok(()), Label::default());
                }
                let (at, limits) = frame(&self.inner.machine);
                self.hpgl.session.begin(beginning, byte, at, limits);
                self.hpgl.port = Some(port);
                self.hpgl.is_new = true;
                self.inner.hpgl_pen = None;
                self.mute(board);
            }
            Token::Code | Token::Text | Token::Control if is_mine => {
                self.hpgl.session.receive(byte, token);
                if self.hpgl.session.room() > 0 && !self.hpgl.session.has_output() {
                    return Taken::More;
                }
            }
            Token::Code | Token::Text | Token::Control => return Taken::More,
        }
        Taken::Last
    }

    /// Sends replies to the ports at which no HP-GL is in force.
    pub(super) fn mute<B: Board>(&self, board: &mut B) {
        board.reply_to(self.hpgl.port.map_or(Replies::All, Replies::Others));
    }

    /// Ends HP-GL and forgets what is left of it.
    pub(super) fn end_hpgl<B: Board>(&mut self, board: &mut B) {
        self.hpgl.dialects = [Dialect::new(); PORT_LIMIT];
        self.hpgl.session.forget();
        self.hpgl.session.release();
        self.send_hpgl(board);
        self.hpgl.port = None;
        self.inner.hpgl_pen = None;
        self.mute(board);
    }

    /// Sends what the session has to say.
    fn send_hpgl<B: Board>(&mut self, board: &mut B) {
        let Some(port) = self.hpgl.port else { return };
        let output = self.hpgl.session.output();
        if !output.is_empty() {
            board.reply_to(Replies::Only(port));
            board.write(output);
            self.hpgl.session.clear_output();
            self.mute(board);
        }
    }

    /// Carries out the next action, if there is one and the machine has room. Returns whether there
    /// was anything to do.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    pub(super) fn carry_out_hpgl<B: Board>(&mut self, board: &mut B) -> bool {
        let Some(port) = self.hpgl.port else { return false };
        if !board.has_room(REPLY_BYTES) {
            return false;
        }
        let is_done = self.carry_out_action(board);
        self.send_hpgl(board);
        if self.hpgl.session.take_loss() {
            Reply(board).line(format_args!("[MSG:bytes of HP-GL were lost: lines are missing]"));
        }
        let is_over = self.hpgl.session.is_idle()
            && !self.hpgl.dialects.get(port).is_some_and(Dialect::is_in_force);
        if is_over {
            self.hpgl.port = None;
            self.mute(board);
        }
        is_done || is_over
    }

    /// Carries out the next action. Returns whether there was anything to do.
    fn carry_out_action<B: Board>(&mut self, board: &mut B) -> bool {
        if self.hpgl.is_new {
            if !self.inner.machine.knows_end() {
                return false;
            }
            self.initialize_hpgl();
        }
        let action = self.hpgl.session.action().clone();
        if !self.hpgl.session.has_asked() {
            // The sender may have taken the request for a pen back.
            self.inner.hpgl_pen = None;
        }
        let outcome = match action {
            Action::Nothing => return !self.hpgl.session.is_idle(),
            Action::Answer(answer) => {
                self.hpgl.session.answer(&answer);
                Outcome::Done
            }
            Action::Initialize if !self.inner.machine.knows_end() => Outcome::Waits,
            Action::Initialize => {
                self.initialize_hpgl();
                Outcome::Done
            }
            Action::Pen(number) => self.change_pen(number, board),
            Action::Sheet => self.change_sheet(board),
            Action::Line(_) | Action::Dot(_) | Action::Go(_) => self.draw_action(action),
        };
        match outcome {
            Outcome::Done => self.hpgl.session.end_action(),
            Outcome::Refused => self.hpgl.session.refuse_action(),
            Outcome::More => {}
            Outcome::Waits => return false,
        }
        true
    }

    /// Makes the state after `IN`, with the pen where the moves known so far end.
    fn initialize_hpgl(&mut self) {
        let (at, limits) = frame(&self.inner.machine);
        self.hpgl.session.initialize(at, limits);
        (self.hpgl.is_new, self.hpgl.was_locked) = (false, false);
    }

    /// Draws a line or a dot, or moves without drawing.
    fn draw_action(&mut self, action: Action) -> Outcome {
        let machine = &mut self.inner.machine;
        match machine.state() {
            State::Alarm(_) | State::Sleep => self.hpgl.was_locked = true,
            State::Check => return Outcome::Done,
            _ => {}
        }
        if self.hpgl.was_locked {
            return Outcome::Refused;
        }
        if !machine.has_room() || machine.notes_last_stroke() {
            return Outcome::Waits;
        }
        let (from, to, ink) = match action {
            Action::Line([from, to]) => (Some(from), to, true),
            Action::Dot(at) => (Some(at), at, true),
            Action::Go(to) => (None, to, false),
            _ => return Outcome::Done,
        };
        let steps = |point| steps_at(machine, point);
        let (from, to) = (from.map(steps), steps(to));
        let travel = from.filter(|from| *from != machine.end());
        let is_dot = from == Some(to);
        let moved = match travel {
            Some(point) => machine.draw_to(Target { point, ink: None }, None),
            // The pen is down there already. To lower it again, the machine would stop.
            None if is_dot && machine.draws_to(to) => Ok(()),
            None if is_dot => machine.lower_pen(),
            None => {
                let ink = ink.then_some(LineType::Full);
                // Centimetres a second are 600 mm/min.
                let feed = self.hpgl.session.speed().filter(|_| ink.is_some()).map(|speed| {
                    Value::from_bits(i32::try_from(speed.saturating_mul(600)).unwrap_or(i32::MAX))
                });
                machine.draw_to(Target { point: to, ink }, feed)
            }
        };
        match moved {
            Ok(()) if travel.is_some() => Outcome::More,
            Ok(()) => Outcome::Done,
            Err(MachineError::State(_)) => Outcome::Waits,
            // Lines are clipped to the travel, so no other error is expected.
            Err(_) => Outcome::Refused,
        }
    }

    /// Waits for the pen with this number, from 1, unless it is in the holder. Pen 0 needs nothing.
    fn change_pen<B: Board>(&mut self, number: u8, board: &mut B) -> Outcome {
        let machine = &self.inner.machine;
        let Some(pen) = number.checked_sub(1) else { return Outcome::Done };
        let is_there = pen == machine.pen() || self.inner.options.one_pen;
        if !self.hpgl.session.has_asked() && (is_there || self.draws_nothing()) {
            return Outcome::Done;
        }
        let outcome = self.ask(format_args!("[MSG:put in pen {number}, then send ~]"), board);
        match outcome {
            Outcome::More => self.inner.hpgl_pen = Some(pen),
            Outcome::Done => {
                self.inner.hpgl_pen = None;
                if !matches!(self.inner.machine.state(), State::Alarm(_) | State::Sleep) {
                    self.inner.machine.set_pen(pen);
                }
            }
            Outcome::Waits | Outcome::Refused => {}
        }
        outcome
    }

    /// Waits for the next sheet of paper.
    fn change_sheet<B: Board>(&mut self, board: &mut B) -> Outcome {
        if !self.hpgl.session.has_asked() && self.draws_nothing() {
            return Outcome::Done;
        }
        self.ask(format_args!("[MSG:put in the next sheet, then send ~]"), board)
    }

    /// Whether the machine draws nothing in its present state, so that it needs neither pen nor
    /// sheet.
    fn draws_nothing(&self) -> bool {
        matches!(self.inner.machine.state(), State::Alarm(_) | State::Sleep | State::Check)
    }

    /// Lets the machine stand at the end of all moves until `~`, and says why. Done once it goes
    /// on.
    fn ask<B: Board>(&mut self, message: fmt::Arguments<'_>, board: &mut B) -> Outcome {
        let machine = &mut self.inner.machine;
        if self.hpgl.session.has_asked() {
            return match machine.state() {
                State::Hold { .. } => Outcome::Waits,
                _ => Outcome::Done,
            };
        }
        if machine.state() != State::Idle || !machine.is_stopped() || machine.pause().is_err() {
            return Outcome::Waits;
        }
        machine.reset_ink_budget();
        self.hpgl.session.note_asked();
        Reply(board).line(message);
        Outcome::More
    }
}

/// Where the pen will be when all moves known so far have ended, and the hard clip limits.
fn frame(machine: &Machine<'_>) -> (Point, Rectangle) {
    let settings = machine.settings();
    let steps = settings.page_steps();
    let units = |steps: i32, per_mm: Value| {
        let per_mm = i64::from(per_mm.to_bits()).max(1);
        divide_rounding(product(i64::from(steps), UNITS_PER_MM << 32), per_mm.into()) as i64
    };
    let [x_per_mm, y_per_mm] = steps;
    let [width, height] = [Setting::TravelX, Setting::TravelY]
        .map_each(|travel| i64::from(settings.get(travel).to_bits()) * UNITS_PER_MM);
    let most = Point {
        x: width.min(units(PAGE_LIMIT, x_per_mm)),
        y: height.min(units(PAGE_LIMIT, y_per_mm)),
    };
    let PagePoint { x, y } = machine.end();
    let at = Point { x: units(x, x_per_mm), y: units(y, y_per_mm) };
    (at, Rectangle { least: Point::default(), most })
}

/// The nearest step to a position within the travel.
fn steps_at(machine: &Machine<'_>, Point { x, y }: Point) -> PagePoint {
    let most = machine.travel();
    let [x_per_mm, y_per_mm] = machine.settings().page_steps();
    let steps = |position: i64, per_mm: Value, most: i32| {
        let exact = product(position, per_mm.to_bits().into());
        let steps = divide_rounding(exact, i128::from(UNITS_PER_MM) << 32);
        steps.min(most.into()).max(0) as i32
    };
    PagePoint { x: steps(x, x_per_mm, most.x), y: steps(y, y_per_mm, most.y) }
}
