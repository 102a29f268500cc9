//! Tests of sending a drawing while it is drawn, and of joining one that is drawn.

use super::*;
use crate::link::Answer;
use crate::preview::InMemory;
use penup::board_table::{LM3S6965, PICO};
use penup::boards::host::{CutFlash, LAYOUT};
use penup_job::protocol::{ABORT, HOLD};
use penup_job::room::Room;
use penup_readers::lines::{JobLine, Lines as _};
use std::collections::VecDeque;
use std::io;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// A plotter in memory whose line breaks off for three seconds behind this line.
struct Stalling {
    plotter: InMemory<u32>,
    left: usize,
    said: VecDeque<u8>,
    /// The pens that were asked for.
    pens: Vec<u8>,
}

impl Stalling {
    fn behind(left: usize) -> Self {
        let plotter = InMemory::new(Room::usual(), Settings::default());
        Self { plotter, left, said: VecDeque::new(), pens: Vec::new() }
    }
}

impl Link for Stalling {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.plotter.send(bytes)?;
        if bytes.starts_with(b"N") {
            self.left = self.left.wrapping_sub(1);
            let begin = self.plotter.now();
            while self.left == 0 && self.plotter.now() - begin < Duration::from_secs(3) {
                let mut buffer = [0; 64];
                let count = self.plotter.receive(&mut buffer, Duration::from_millis(100))?;
                self.said.extend(&buffer[..count]);
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        match self.said.is_empty() {
            true => self.plotter.receive(buffer, timeout),
            false => io::Read::read(&mut self.said, buffer),
        }
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.pens.push(pen);
        self.plotter.change_pen(pen)
    }

    fn now(&self) -> Instant {
        self.plotter.now()
    }
}

/// A drawing as G-code.
fn gcode(lines: &[&str]) -> StreamedJob {
    let lines: Vec<_> = lines.iter().map(|line| JobLine::command(*line)).collect();
    let mut host = InMemory::<u32>::new(Room::usual(), Settings::default());
    assert!(host.take(&lines), "all lines are accepted");
    host.streamed(Form::GCode, 0).expect("a drawing").0
}

/// Draws jobs one after the other. Returns the length that was inked, and the pens that were
/// asked for.
fn draw(mut plotter: Stalling, jobs: &[&StreamedJob]) -> (f64, Vec<u8>) {
    plotter.plotter.record();
    let interrupt = AtomicBool::new(false);
    let mut sender =
        Sender::open(&mut plotter, Timeouts::simulated(), &interrupt).expect("a plotter");
    for job in jobs {
        sender.draw_streamed(job, &mut Quiet).expect("it is drawn");
    }
    sender.end();
    let runs = plotter.plotter.drawn().runs;
    let length = |points: &[[f64; 2]]| -> f64 {
        points
            .windows(2)
            .map(|ends| f64::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]))
            .sum()
    };
    let inked = runs.iter().filter(|run| run.pen_down).map(|run| length(&run.points));
    (inked.sum(), plotter.pens)
}

#[test]
fn gcode_loses_no_line_of_a_drawing_when_the_line_breaks_off() {
    let job = gcode(&[
        "v 10 10 0",
        "v 14 10 0",
        "v 14 13 0",
        "v 20 20 0",
        "v 25 20 0",
        "l 1 2 3",
        "l 4 5",
    ]);
    // A line sets modes, two end the program, and two lead to the beginnings.
    assert_eq!(job.count(), 7);
    for line in 0..=job.count() {
        let (inked, _) = draw(Stalling::behind(line), &[&job]);
        assert!((inked - 12.0).abs() < 0.05, "behind line {line}: {inked}");
    }
}

#[test]
fn the_next_pass_begins_with_the_first_pen() {
    let lines =
        ["v 10 10 0", "v 14 10 0", "v 14 13 0", "usemtl pen1", "l 1 2", "usemtl pen2", "l 2 3"];
    let (first, mut next) = (gcode(&lines), gcode(&lines));
    next.ask_for_first_pen();
    assert_eq!(draw(Stalling::behind(0), &[&first]).1, [2]);
    assert_eq!(draw(Stalling::behind(0), &[&first, &next]).1, [2, 1, 2]);
    // With one pen nobody is asked.
    let mut single = gcode(&["v 10 10 0", "v 14 10 0", "l 1 2"]);
    single.ask_for_first_pen();
    assert!(draw(Stalling::behind(0), &[&single]).1.is_empty());
}

#[test]
fn no_stroke_is_told_that_the_plotter_may_not_have_drawn() {
    let mut lines: Vec<String> =
        (0..200).map(|n| format!("v {} {} 0", 10 + n / 2, 10 + n % 2)).collect();
    lines.extend((0..100).map(|n| format!("v {} 50 0", 10 + n)));
    lines.extend((1..200).map(|n| format!("l {n} {}", n + 1)));
    lines.extend((0..50).map(|n| format!("l {} {}", 201 + 2 * n, 202 + 2 * n)));
    let job = gcode(&lines.iter().map(String::as_str).collect::<Vec<_>>());
    let mut streaming = Streaming::of(&job);
    let mut begun = 0;
    let mut counts = Vec::new();
    let mut is_down = false;
    for (done, line) in job.in_order().enumerate() {
        counts.push(begun);
        let told = streaming.told(Status::default(), done).strokes.expect("strokes");
        assert_eq!(told, (counts[done.saturating_sub(20)], 51), "line {done}");
        is_down = if line.sent.contains("G0") { false } else { is_down };
        if line.sent.contains("G1M3") && !is_down {
            (begun, is_down) = (begun + 1, true);
        }
    }
    assert_eq!(begun, 51);
}

/// A plotter in memory that holds, and whose client goes after 200 s of its time.
struct Holding {
    plotter: InMemory<u16>,
    began: Instant,
    is_client_here: bool,
    has_held: bool,
    /// Whether somebody gives the drawing up while the next client waits.
    is_given_up: bool,
}

impl Link for Holding {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.plotter.send(bytes)?;
        if bytes.windows(3).any(|part| part == b"$s=") && !self.has_held {
            self.has_held = true;
            self.plotter.send(&[HOLD])?;
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let is_late = self.plotter.now() - self.began > Duration::from_secs(200);
        if self.is_client_here && is_late {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.plotter.receive(buffer, timeout)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn ask_to_resume(&mut self, first: bool) -> io::Result<Answer> {
        if !self.is_client_here && self.is_given_up {
            self.plotter.send(&[ABORT])?;
        }
        Ok(if self.is_client_here || first { Answer::NotYet } else { Answer::Yes })
    }

    fn now(&self) -> Instant {
        self.plotter.now()
    }
}

/// A drawing that holds with a full memory, and whose client has gone.
fn held_with_a_full_memory() -> (Holding, StreamedJob) {
    let mut lines: Vec<String> =
        (0..6000).map(|n| format!("v {} {} 0", 10 + n % 100, 10 + n / 50)).collect();
    lines.extend((1..6000).map(|n| format!("l {n} {}", n + 1)));
    let lines: Vec<_> = lines.iter().map(JobLine::command).collect();
    let room = Room::for_job(&lines);
    let mut host = InMemory::<u32>::new(room, Settings::default());
    assert!(host.take(&lines), "all lines are accepted");
    let (job, _) = host.streamed(Form::Strokes, 0).expect("a drawing");
    let room = Room::of_board(&LM3S6965);
    let plotter = InMemory::<u16>::new(room, Settings::default());
    let began = plotter.now();
    let mut link =
        Holding { plotter, began, is_client_here: true, has_held: false, is_given_up: false };
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(&mut link, Timeouts::default(), &interrupt).expect("a plotter");
    let error = sender.draw_streamed(&job, &mut Quiet).expect_err("the client goes");
    assert!(matches!(error, Error::Link(_)), "{error}");
    drop(sender);
    link.is_client_here = false;
    (link, job)
}

/// A plotter whose memory is full reads no line before it has drawn more.
#[test]
fn a_drawing_is_joined_that_holds_with_a_full_memory() {
    let (mut link, mut job) = held_with_a_full_memory();
    let interrupt = AtomicBool::new(false);
    let joined = Sender::rejoin(&mut link, Timeouts::default(), &interrupt);
    let (mut sender, taken) = joined.expect("it answers").expect("it waits for strokes");
    assert!(taken.id == job.id() && job.skip(taken.targets), "{taken:?}");
    sender.draw_streamed(&job, &mut Quiet).expect("it is drawn");
}

/// The caller would take that for a plotter that draws nothing, and draw all over it.
#[test]
fn a_drawing_that_is_given_up_while_a_client_waits_is_no_idle_plotter() {
    let (mut link, _) = held_with_a_full_memory();
    link.is_given_up = true;
    let interrupt = AtomicBool::new(false);
    let joined = Sender::rejoin(&mut link, Timeouts::default(), &interrupt);
    let error = joined.err().expect("the drawing is no more");
    assert!(error.to_string().contains("has ended, or was given up"), "{error}");
    assert_eq!(error.exit_code(), 5);
}

/// A plotter with flash, whose client goes when it is told to, and whose line may damage the
/// first answer to `$stream`.
struct Wire<'w> {
    plotter: InMemory<u16>,
    goes: &'w AtomicBool,
    damages: bool,
    began: Instant,
    /// How long the plotter has been listened to, a tenth of a second each time.
    clock: Duration,
}

impl Link for Wire<'_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.plotter.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.goes.load(Ordering::Relaxed) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let count = self.plotter.receive(buffer, timeout)?;
        self.clock += Duration::from_millis(100);
        let heard = &mut buffer[..count];
        let begin = heard.windows(3).position(|part| part == b"[ST").filter(|_| self.damages);
        if let Some(begin) = begin
            && let Some(comma) = heard[begin..].iter().position(|byte| *byte == b',')
            && let Some(digit) = heard.get_mut(begin + comma + 1)
        {
            *digit = if *digit == b'9' { b'1' } else { *digit + 1 };
            self.damages = false;
        }
        Ok(count)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn now(&self) -> Instant {
        self.began + self.clock
    }
}

/// Sets a switch once so many strokes are drawn.
struct AtStroke<'s>(u64, &'s AtomicBool);

impl Progress for AtStroke<'_> {
    fn lines_sent(&mut self, _: usize, _: usize) {}
    fn drawn(&mut self, status: &Status) {
        let is_there = status.strokes.is_some_and(|(done, _)| done >= self.0);
        self.1.fetch_or(is_there && status.stream.is_some(), Ordering::Relaxed);
    }
    fn state(&mut self, _: &str) {}
}

#[test]
fn a_damaged_answer_about_a_drawing_is_not_believed() {
    let mut lines: Vec<String> =
        (0..80).map(|n| format!("v {} {} 0", 10 + n % 2 * 90, 10 + n / 2)).collect();
    lines.extend((0..40).map(|n| format!("l {} {}", 2 * n + 1, 2 * n + 2)));
    let lines: Vec<_> = lines.iter().map(JobLine::command).collect();
    let mut host = InMemory::<u32>::new(Room::for_job(&lines), Settings::default());
    assert!(host.take(&lines), "all lines are accepted");
    let (job, _) = host.streamed(Form::Strokes, 0).expect("a drawing");
    let flash = CutFlash::new(LAYOUT.end() as usize);
    let plotter = InMemory::with_flash(Room::of_board(&PICO), flash);
    let (goes, interrupt) = (AtomicBool::new(false), AtomicBool::new(false));
    let (began, clock) = (Instant::now(), Duration::ZERO);
    let mut wire = Wire { plotter, goes: &goes, damages: false, began, clock };
    let timeouts = Timeouts::default();
    let mut sender = Sender::open(&mut wire, timeouts, &interrupt).expect("a plotter");
    sender.draw_streamed(&job, &mut AtStroke(2, &goes)).expect_err("the client goes");
    drop(sender);
    goes.store(false, Ordering::Relaxed);
    wire.damages = true;
    let joined = Sender::rejoin(&mut wire, timeouts, &interrupt);
    let (mut sender, taken) = joined.expect("it answers").expect("it draws");
    assert_eq!((taken.id, taken.targets), (job.id(), job.targets()));
    let mut rest = job;
    assert!(rest.skip(taken.targets));
    sender.draw_streamed(&rest, &mut AtStroke(5, &interrupt)).expect_err("interrupted");
    drop(sender);
    interrupt.store(false, Ordering::Relaxed);
    // The pen rises.
    for _ in 0..50 {
        wire.receive(&mut [0; 256], Duration::ZERO).expect("memory");
    }
    let mut sender = Sender::open(&mut wire, timeouts, &interrupt).expect("a plotter");
    let stopped = sender.stopped_drawing().expect("an answer").expect("it has stopped");
    drop(sender);
    wire.damages = true;
    let mut sender = Sender::open(&mut wire, timeouts, &interrupt).expect("a plotter");
    let told = sender.stopped_drawing().expect("an answer").expect("it has stopped");
    assert_eq!(told, stopped);
    assert!((4..40).contains(&told.drawn) && told.all == 40, "{told:?}");
}

/// A plotter in memory whose power goes and comes back while it draws, and nobody hears how it
/// greets.
struct Restarting {
    plotter: InMemory<u32>,
    /// The number of reports until then, once strokes have come.
    reports: u32,
    has_strokes: bool,
}

impl Link for Restarting {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.has_strokes |= bytes.windows(3).any(|part| part == b"$s=");
        if self.has_strokes && bytes.contains(&b'?') && self.reports > 0 {
            self.reports -= 1;
            if self.reports == 0 {
                self.plotter = InMemory::new(Room::usual(), Settings::default());
                while self.plotter.receive(&mut [0; 64], Duration::ZERO)? > 0 {}
            }
        }
        self.plotter.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.plotter.receive(buffer, timeout)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }

    fn now(&self) -> Instant {
        self.plotter.now()
    }
}

#[test]
fn a_drawing_that_a_plotter_has_forgotten_is_not_taken_for_drawn() {
    let mut lines: Vec<String> =
        (0..20).map(|n| format!("v {} {} 0", 10 + 180 * (n % 2), 20 + n / 2)).collect();
    lines.extend((0..10).map(|n| format!("l {} {}", 2 * n + 1, 2 * n + 2)));
    let lines: Vec<_> = lines.iter().map(JobLine::command).collect();
    let mut host = InMemory::<u32>::new(Room::usual(), Settings::default());
    assert!(host.take(&lines), "all lines are accepted");
    let (job, _) = host.streamed(Form::Strokes, 0).expect("a drawing");
    for (reports, is_drawn) in [(0, true), (10, false)] {
        let plotter = InMemory::new(Room::usual(), Settings::default());
        let mut link = Restarting { plotter, reports, has_strokes: false };
        let interrupt = AtomicBool::new(false);
        let mut sender =
            Sender::open(&mut link, Timeouts::default(), &interrupt).expect("a plotter");
        let drawn = sender.draw_streamed(&job, &mut Quiet);
        let is_noticed = matches!(&drawn, Err(Error::JobUnfinished { .. }));
        assert_eq!((drawn.is_ok(), is_noticed), (is_drawn, !is_drawn), "{reports}: {drawn:?}");
    }
}

/// A plotter whose power fails, unheard, once it has confirmed the last line.
struct FailsAtEnd {
    plotter: InMemory<u32>,
    /// How it confirms that line.
    confirms: String,
    heard: String,
    has_failed: bool,
}

impl Link for FailsAtEnd {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.plotter.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.heard.contains(&self.confirms) && !self.has_failed {
            self.has_failed = true;
            self.plotter = InMemory::new(Room::usual(), Settings::default());
            // The greeting is lost.
            self.plotter.receive(&mut [0; 256], timeout)?;
        }
        let count = self.plotter.receive(buffer, timeout)?;
        self.heard += &String::from_utf8_lossy(&buffer[..count]);
        Ok(count)
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.plotter.change_pen(pen)
    }

    fn now(&self) -> Instant {
        self.plotter.now()
    }
}

#[test]
fn gcode_is_not_taken_for_drawn_by_a_plotter_that_has_started_again() {
    let job = gcode(&["v 10 10 0", "v 14 10 0", "v 14 13 0", "f 1 2 3"]);
    let plotter = InMemory::new(Room::usual(), Settings::default());
    let confirms = format!("Line: {}*", job.count());
    let mut link = FailsAtEnd { plotter, confirms, heard: String::new(), has_failed: false };
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(&mut link, Timeouts::simulated(), &interrupt).expect("a plotter");
    let drawn = sender.draw_streamed(&job, &mut Quiet);
    assert!(matches!(drawn, Err(Error::Restarted)), "{drawn:?}");
    assert!(link.has_failed);
}
