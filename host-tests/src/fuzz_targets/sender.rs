//! A plotter that answers the client with anything, in each of its conversations.

use crate::cut_jobs::empty_flash;
use crate::streamed_drawing::StreamedDrawing;
use crate::whole_jobs::job_lines;
use penup::boards::host::{HostBoard, PORTS, QUEUE_LENGTH};
use penup::machine::{EventRing, PulserState};
use penup::plotter::{Board as _, EMPTY_LOOKAHEAD, Memory, Plotter};
use penup_client::error::Error;
use penup_client::link::{Answer, Link, UserRequest};
use penup_client::operate::limits;
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_job::protocol::ABORT;
use penup_job::streamed::Form;
use penup_readers::lines::{JobLine, Lines as _};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{self, Read as _};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Has the client talk with a plotter that sends the input. The client must come to an end, with an
/// error in words or without one.
///
/// If the first byte is from 1 to 8 or from 17 to 24, its lower bits choose the conversation;
/// otherwise a small job is drawn. From 17 on, a real plotter is at the other end; see `Script`.
pub fn fuzz(input: &[u8]) {
    if let Err(error) = outcome(input) {
        assert!(!error.to_string().is_empty());
    }
}

/// Does the same, and returns how the conversation ends.
///
/// # Errors
/// That of the client.
pub fn outcome(input: &[u8]) -> Result<(), Error> {
    let (conversation, is_real, rest) = match input {
        [choice @ (1..=8 | 17..=24), rest @ ..] => (choice & 15, *choice >= 16, rest),
        _ => (0, false, input),
    };
    let mut memory = Box::new(Memory::<256, 1024, 8192, PORTS>::new());
    let mut blocks = EMPTY_LOOKAHEAD;
    let mut ring = EventRing::<QUEUE_LENGTH>::new();
    let pins = PulserState::new();
    let mut board = HostBoard::new(&mut ring, &pins);
    let mut plotter = Plotter::new(memory.lend(&mut blocks), &pins);
    plotter.greet(&mut board);
    if is_real {
        board.set_flash(empty_flash());
        board.receive(&drawn_before(conversation));
        while plotter.poll(&mut board) || !board.has_read_all() {}
        if conversation == STOPPED {
            // A second of drawing, and then the user gives up.
            for turn in 0..2000 {
                if turn == 1000 {
                    board.receive(&[ABORT]);
                }
                plotter.poll(&mut board);
                board.wait();
            }
        }
        board.take_sent();
    }
    let plotter = is_real.then_some((plotter, board));
    let (start, passed) = (Instant::now(), Duration::ZERO);
    let pending = VecDeque::new();
    let mut link = Script { rest, start, passed, plotter, pending, asked: None };
    talk(conversation, &mut link)
}

/// What the real plotter has been sent when this conversation begins: where the client comes to a
/// plotter that draws or has stopped, a drawing, or all of it but its last line.
fn drawn_before(conversation: u8) -> Vec<u8> {
    let lines = match conversation {
        3 => {
            let lines = with_drawing(|drawing| drawing.from(0));
            let count = lines.count().saturating_sub(1);
            lines.in_order().take(count).map(|line| line.sent).collect()
        }
        4 | 5 | STOPPED => job_lines("cube.obj", &OPTIONS),
        _ => Vec::new(),
    };
    lines.iter().flat_map(|line| format!("{line}\n").into_bytes()).collect()
}

/// The number of the conversation with a plotter whose job has stopped.
const STOPPED: u8 = 6;

/// The settings of the small drawing.
const OPTIONS: [&str; 2] = ["$page=60x60", "$margin=2"];

/// Holds the conversation with this number.
fn talk(conversation: u8, link: &mut dyn Link) -> Result<(), Error> {
    let (interrupt, timeouts) = (AtomicBool::new(false), Timeouts::default());
    let sender = match conversation {
        // The plotter computes the drawing.
        0 | 8 => {
            let job: Vec<JobLine> =
                ["$clear", "v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1 2 3"].map(JobLine::command).into();
            let mut sender = Sender::open(link, timeouts, &interrupt)?;
            sender.stream(&job, &mut Quiet)?;
            sender.plot(&mut Quiet)?;
            sender.report()?;
            sender
        }
        // This computer computes it.
        1 => {
            let mut sender = Sender::open(link, timeouts, &interrupt)?;
            let known = limits(&mut sender)?;
            let form = sender.form(&known.settings.unwrap_or_default())?;
            with_drawing(|drawing| sender.draw_streamed(&drawing.from_as(0, form), &mut Quiet))?;
            sender.report()?;
            sender
        }
        2 => {
            let mut sender = Sender::open(link, timeouts, &interrupt)?;
            with_drawing(|drawing| {
                let mut job = drawing.from_as(0, Form::GCode);
                job.ask_for_first_pen();
                sender.draw_streamed(&job, &mut Quiet)
            })?;
            sender
        }
        // Another program has sent a part of it.
        3 => {
            let Some((mut sender, taken)) = Sender::rejoin(link, timeouts, &interrupt)? else {
                return Ok(());
            };
            with_drawing(|drawing| {
                let mut job = drawing.from_as(0, Form::Strokes);
                if job.skip(taken.targets) {
                    sender.draw_streamed(&job, &mut Quiet)?;
                }
                Ok::<(), Error>(())
            })?;
            sender
        }
        4 => {
            let (mut sender, _) = Sender::join(link, timeouts, &interrupt)?;
            sender.watch(&mut Quiet)?;
            sender.report()?;
            sender
        }
        5 => {
            let (mut sender, _) = Sender::join(link, timeouts, &interrupt)?;
            sender.pause(false)?;
            sender.resume()?;
            sender.pause(true)?;
            sender.give_up()?;
            sender
        }
        STOPPED => {
            let mut sender = Sender::open(link, timeouts, &interrupt)?;
            match sender.stopped_drawing()? {
                None => match sender.go_on(false, &mut Quiet) {
                    // The plotter does not know where the pen is.
                    Err(Error::Refused { .. }) => sender.go_on(true, &mut Quiet)?,
                    other => other?,
                },
                Some(stopped) => with_drawing(|drawing| {
                    let job = drawing.rest(stopped.drawn.min(1), stopped.points);
                    sender.draw_streamed(&job, &mut Quiet)
                })?,
            }
            sender.again(&mut Quiet)?;
            sender
        }
        _ => {
            let (mut sender, _) = Sender::open_for_orders(link, timeouts, &interrupt)?;
            limits(&mut sender)?;
            sender.ask("$X")?;
            sender.ask("$3=5")?;
            sender.ask("$110=5000.5")?;
            limits(&mut sender)?;
            sender.wait_until_ready()?;
            sender
        }
    };
    sender.end();
    Ok(())
}

/// Lets `work` use a small drawing that this computer has computed. One serves for all inputs.
fn with_drawing<T>(work: impl FnOnce(&mut StreamedDrawing) -> T) -> T {
    thread_local! {
        static DRAWING: RefCell<StreamedDrawing> = {
            let lines = job_lines("cube.obj", &OPTIONS);
            RefCell::new(StreamedDrawing::of(&lines))
        };
    }
    DRAWING.with_borrow_mut(work)
}

/// In the input, a part that begins so lets the real plotter answer, and sends the rest of the part
/// behind its answer.
const HONEST: u8 = 0x06;

/// A part that begins so loses what the real plotter answers.
const LOST: u8 = 0x07;

/// A part that begins so turns over a bit of what the real plotter answers: the lower bits of the
/// next byte say which bit, the others which byte.
const TURNED: u8 = 0x0E;

/// A part that begins so is what the user asks for, in place of an answer.
const REQUEST: u8 = 0x0F;

/// What a user may ask for.
const REQUESTS: [UserRequest; 6] = [
    UserRequest::Pause,
    UserRequest::Faster,
    UserRequest::Slower,
    UserRequest::PenHigher,
    UserRequest::PenLower,
    UserRequest::GiveUp,
];

/// How long a user waits behind the last request before giving up, as one who has paused must.
const PATIENCE: Duration = Duration::from_secs(600);

/// A plotter whose answers are parts of the input, each of which ends with a zero byte. It sends
/// one whenever the client listens. When none is left, it is silent, or answers as the real plotter
/// does that receives all that the client sends, if there is one. Time passes only while the client
/// waits, a day at most.
struct Script<'i, 'm> {
    rest: &'i [u8],
    start: Instant,
    passed: Duration,
    plotter: Option<(Plotter<'m>, HostBoard<'m>)>,
    /// What was answered and is still to be received.
    pending: VecDeque<u8>,
    /// When the user asked for something last.
    asked: Option<Duration>,
}

impl Script<'_, '_> {
    /// Lets the real plotter work until it answers, at most for so long. Returns its answer.
    fn answer(&mut self, timeout: Duration) -> Vec<u8> {
        let Some((plotter, board)) = &mut self.plotter else {
            self.passed += timeout;
            return Vec::new();
        };
        for passed in 0..timeout.as_millis() as u64 {
            let is_busy = plotter.poll(board);
            let sent = board.take_sent();
            let is_at_rest = !is_busy && plotter.machine().is_stopped() && board.has_read_all();
            if !sent.is_empty() {
                self.passed += Duration::from_millis(passed);
                return sent;
            }
            if is_at_rest {
                break;
            }
            board.wait();
        }
        self.passed += timeout;
        Vec::new()
    }

    /// The bytes that come when the client listens for so long.
    fn next(&mut self, timeout: Duration) -> Vec<u8> {
        if self.rest.is_empty() {
            return self.answer(timeout);
        }
        let end = self.rest.iter().position(|byte| *byte == 0).unwrap_or(self.rest.len());
        let (part, rest) = self.rest.split_at(end);
        self.rest = rest.get(1..).unwrap_or_default();
        match part {
            [HONEST, more @ ..] => [&self.answer(timeout), more].concat(),
            [LOST, ..] => {
                self.answer(timeout);
                Vec::new()
            }
            [TURNED, which, more @ ..] => {
                let mut answer = self.answer(timeout);
                let length = answer.len().max(1);
                if let Some(byte) = answer.get_mut(usize::from(which >> 3) % length) {
                    *byte ^= 1 << (which & 7);
                }
                answer.extend(more);
                answer
            }
            part => {
                self.passed += timeout;
                part.to_vec()
            }
        }
    }
}

impl Link for Script<'_, '_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Some((_, board)) = &mut self.plotter {
            board.receive(bytes);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.passed += Duration::from_millis(1);
        assert!(self.passed < Duration::from_secs(86_400), "the client never gives up");
        if self.pending.is_empty() {
            self.pending = self.next(timeout).into();
        }
        self.pending.read(buffer)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn ask_to_resume(&mut self, _: bool) -> io::Result<Answer> {
        Ok(if self.plotter.is_some() { Answer::Yes } else { Answer::Nobody })
    }

    fn request(&mut self) -> Option<UserRequest> {
        if let [REQUEST, which, 0, rest @ ..] = self.rest {
            self.rest = rest;
            self.asked = Some(self.passed);
            return REQUESTS.get(usize::from(*which)).copied();
        }
        self.asked.filter(|asked| self.passed - *asked > PATIENCE)?;
        Some(UserRequest::GiveUp)
    }

    fn now(&self) -> Instant {
        self.start + self.passed
    }
}
