//! A sender and a plotter that misbehaves.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, reason = "a test fails with the words of what it expected")]

use penup_client::error::Error;
use penup_client::fake::{FakePlotter, Fault};
use penup_client::link::{Answer, Link, UserRequest};
use penup_client::progress::{Progress, Quiet};
use penup_client::sender::{Sender, Timeouts};
use penup_job::protocol::Status;
use penup_readers::lines::{JobLine, Origin};
use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const TIMEOUTS: Timeouts = Timeouts {
    silence: Duration::from_millis(600),
    lost: Duration::from_millis(1200),
    greeting: Duration::from_millis(600),
    reply: Duration::from_millis(100),
    query: Duration::from_millis(40),
    hold: Duration::from_secs(2),
};

fn lines(count: usize) -> Vec<JobLine> {
    let line = |i| JobLine {
        sent: format!("v {i} {} 0.5", i * 3),
        origin: Some(Origin {
            file: "scene.obj".to_owned(),
            line: i + 10,
            text: format!("v {i}  {}  0.5 # as written", i * 3),
        }),
    };
    (0..count).map(line).collect()
}

fn job(plotter: &mut FakePlotter, count: usize) -> Result<(), Error> {
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(plotter, TIMEOUTS, &interrupt)?;
    let mut job = vec![JobLine::command("$clear")];
    job.extend(lines(count));
    sender.stream(&job, &mut Quiet)?;
    sender.plot(&mut Quiet)
}

fn failure(fault: Fault) -> (String, FakePlotter) {
    let mut plotter = FakePlotter::new(fault);
    match job(&mut plotter, 40) {
        Ok(()) => (format!("{fault:?} went unnoticed"), plotter),
        Err(error) => (error.to_string(), plotter),
    }
}

#[test]
fn a_pen_is_changed_when_the_machine_stands_and_the_job_goes_on_when_it_is_in() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.pen_before = Some((2, 5));
    job(&mut plotter, 3).expect("a job without a fault");
    assert_eq!(plotter.requested_pens, [5, 5], "the first time it was not in");
    assert_eq!(plotter.pen_before, None, "it was told to go on");
}

#[test]
fn every_line_arrives_once_in_order_and_the_queue_is_kept_full_but_never_overflows() {
    for count in [0, 1, 2, 500] {
        let mut plotter = FakePlotter::new(Fault::None);
        job(&mut plotter, count).expect("a job without a fault");
        let mut expected: Vec<String> = lines(count).into_iter().map(|line| line.sent).collect();
        expected.push("$plot".to_owned());
        assert_eq!(plotter.lines, expected);
        assert!(!plotter.overflowed);
        assert!(count < 500 || plotter.most_waiting > 8);
    }
}

#[test]
fn a_line_longer_than_the_window_goes_alone() {
    let mut plotter = FakePlotter::new(Fault::None);
    let interrupt = AtomicBool::new(false);
    let long = JobLine::command(format!("o {}", "x".repeat(245)));
    assert_eq!(long.sent.len(), 247);
    let job = [JobLine::command("v 0 0 0"), long.clone(), long];
    let mut sender = Sender::open(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    sender.stream(&job, &mut Quiet).expect("all taken");
    assert!(!plotter.overflowed);
    assert_eq!(plotter.lines.len(), 3);
}

#[test]
fn a_refused_line_is_named_with_its_text_and_nothing_is_drawn() {
    let (error, plotter) = failure(Fault::ErrorAt(7, 9999));
    assert_eq!(
        error,
        "scene.obj:16: a reason that this client does not know: what it thinks of it (error \
         9999)\n    \
         v 6  18  0.5 # as written"
    );
    assert!(!plotter.lines.iter().any(|line| line == "$plot"));
}

#[test]
fn a_refused_drawing_is_an_error() {
    let (error, _) = failure(Fault::ErrorAt(41, 9999));
    assert!(error.starts_with("the plotter refuses the drawing"), "{error}");
}

#[test]
fn silence_at_the_start_says_what_to_check() {
    let (error, _) = failure(Fault::Silent);
    assert!(error.starts_with("the plotter does not answer"), "{error}");
    assert!(error.contains("Is it powered"), "{error}");
}

#[test]
fn silence_in_the_middle_names_the_line() {
    let (error, _) = failure(Fault::SilentAfter(5));
    assert!(error.contains("line 15 of scene.obj"), "{error}");
    let (error, _) = failure(Fault::SilentAfter(40));
    assert!(error.contains("asked for the drawing"), "{error}");
}

#[test]
fn a_lost_line_is_sent_again_and_every_line_arrives_once() {
    for lost in [1, 7, 40, 41] {
        let (error, plotter) = failure(Fault::LosesLine(lost));
        assert!(error.contains("went unnoticed"), "{error}");
        let mut expected: Vec<String> = lines(40).into_iter().map(|line| line.sent).collect();
        expected.push("$plot".to_owned());
        assert_eq!(plotter.lines, expected);
    }
}

#[test]
fn a_line_that_never_arrives_is_distinguished_from_silence() {
    let (error, _) = failure(Fault::NeverTakesLine(40));
    assert!(error.contains("line 49 of scene.obj"), "{error}");
    let (error, _) = failure(Fault::NeverTakesLine(41));
    assert!(error.contains("asked for the drawing"), "{error}");
}

#[test]
fn a_plotter_that_answers_slowly_while_it_computes_is_not_asked_for_lines() {
    for answers_first in [false, true] {
        let mut plotter = FakePlotter::new(Fault::None);
        plotter.reports_while_computing = 300;
        plotter.answers_first = answers_first;
        plotter.answer_delay = 4 * TIMEOUTS.reply;
        job(&mut plotter, 3).expect("a job without a fault");
        assert!(!plotter.overflowed, "it reads nothing while it computes");
        assert_eq!(plotter.lines.len(), 4);
    }
}

#[test]
fn what_was_given_up_by_a_damaged_byte_begins_again() {
    for aborted in [1, 3, 40, 41] {
        let (error, plotter) = failure(Fault::AbortedAt(aborted));
        assert!(error.contains("went unnoticed"), "{aborted}: {error}");
        assert_eq!(plotter.lines.iter().filter(|line| *line == "$plot").count(), 1);
    }
}

#[test]
fn a_firmware_without_numbers_is_reported_as_older() {
    let (error, plotter) = failure(Fault::WithoutNumbers);
    assert!(error.contains("firmware is older"), "{error}");
    assert_eq!(plotter.lines.len(), 0);
}

#[test]
fn nothing_is_drawn_if_the_plotter_holds_another_model() {
    let (error, plotter) = failure(Fault::HoldsOther);
    assert!(error.contains("holds something else than was sent"), "{error}");
    assert!(!plotter.lines.iter().any(|line| line == "$plot"));
    let (error, _) = failure(Fault::SaysOther);
    assert!(error.contains("went unnoticed"), "{error}");
}

#[test]
fn a_machine_that_holds_goes_on_when_the_user_says_so() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.hold_before = Some(1);
    plotter.user = [Answer::NotYet, Answer::NotYet, Answer::Yes].into();
    job(&mut plotter, 3).expect("it went on");
    assert_eq!((plotter.hold_before, plotter.user.len()), (None, 0));
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.hold_before = Some(1);
    let error = job(&mut plotter, 3).expect_err("nobody is there").to_string();
    assert!(error.contains("the machine holds"), "{error}");
    assert_eq!((plotter.hold_before, plotter.aborts), (Some(1), 1), "it still holds");
}

#[test]
fn strangers_and_busy_plotters_are_left_alone() {
    let (error, _) = failure(Fault::NotPenup);
    assert!(error.contains("not penup: it said \"Grbl 1.1h"), "{error}");
    let (error, _) = failure(Fault::Noise);
    assert!(error.contains("115200 baud"), "{error}");
    let (error, plotter) = failure(Fault::Busy);
    assert!(error.contains("it reports Run"), "{error}");
    assert_eq!((plotter.aborts, plotter.lines.len()), (0, 0));
}

#[test]
fn a_restart_or_an_alarm_ends_the_job() {
    let (error, _) = failure(Fault::RestartsAt(3));
    assert!(error.contains("gave up in the middle of the job"), "{error}");
    let (error, _) = failure(Fault::AlarmWhileDrawing(3));
    assert!(error.contains("alarm 3, which this program does not know"), "{error}");
    let (error, _) = failure(Fault::AlarmWhileDrawing(10));
    assert!(error.contains("alarm 10: the emergency stop is pressed"), "{error}");
    assert!(error.contains("\nRelease the stop"), "{error}");
}

/// Presses Ctrl-C as soon as the first stroke is drawn.
struct GivesUp<'a>(&'a AtomicBool);

impl Progress for GivesUp<'_> {
    fn lines_sent(&mut self, _: usize, _: usize) {}
    fn drawn(&mut self, status: &Status) {
        self.0.store(status.strokes.is_some_and(|(done, _)| done > 0), Ordering::Relaxed);
    }
    fn state(&mut self, _: &str) {}
}

#[test]
fn giving_up_stops_the_machine_and_waits_until_it_says_so() {
    for (fault, expected, aborts) in [
        (Fault::None, "the pen is up", 2),
        // Without a greeting it is sent twice more.
        (Fault::IgnoresAbort, "did not confirm", 4),
        (Fault::GoneAtAbort, "did not confirm", 2),
    ] {
        let mut plotter = FakePlotter::new(fault);
        plotter.strokes = 1000;
        let interrupt = AtomicBool::new(false);
        let mut sender = Sender::open(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
        let error = sender.plot(&mut GivesUp(&interrupt)).expect_err("it was given up");
        assert!(error.to_string().contains(expected), "{error}");
        assert_eq!(error.exit_code(), 130);
        assert_eq!(plotter.aborts, aborts);
    }
}

/// Remembers what it is told.
#[derive(Default)]
struct Recorder(Vec<String>);

impl Progress for Recorder {
    fn lines_sent(&mut self, done: usize, all: usize) {
        self.0.push(format!("line {done}/{all}"));
    }
    fn drawn(&mut self, status: &Status) {
        let (done, all) = status.strokes.expect("strokes");
        let stroke = format!("stroke {done}/{all}");
        // The last one is reported once more when the machine is idle.
        if self.0.last() != Some(&stroke) {
            self.0.push(stroke);
        }
    }
    fn state(&mut self, _: &str) {}
}

#[test]
fn progress_counts_lines_then_strokes() {
    let mut plotter = FakePlotter::new(Fault::None);
    let interrupt = AtomicBool::new(false);
    let mut recorder = Recorder::default();
    let mut sender = Sender::open(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    sender.stream(&lines(2), &mut recorder).expect("all taken");
    sender.plot(&mut recorder).expect("drawn");
    assert_eq!(
        recorder.0,
        ["line 1/2", "line 2/2", "stroke 0/3", "stroke 1/3", "stroke 2/3", "stroke 3/3"]
    );
}

#[test]
fn keys_pause_the_job_change_its_speed_and_give_it_up() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.strokes = 20;
    plotter.keys = VecDeque::from([
        (2, UserRequest::Pause),
        (2, UserRequest::Pause),
        (5, UserRequest::Faster),
        (6, UserRequest::Faster),
        (7, UserRequest::Slower),
    ]);
    job(&mut plotter, 3).expect("a job without a fault");
    assert_eq!((plotter.holds, plotter.percent), (1, 110));
    assert!(plotter.keys.is_empty());
    plotter.keys = VecDeque::from([(3, UserRequest::GiveUp)]);
    let error = job(&mut plotter, 3).expect_err("given up");
    assert!(matches!(error, Error::Interrupted), "{error}");
}

/// A pause by a key needs no question, however long it lasts.
#[test]
fn a_pause_by_a_key_lasts_until_the_next_key() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.strokes = 5;
    plotter.keys = VecDeque::from([(2, UserRequest::Pause), (3, UserRequest::GiveUp)]);
    plotter.user = VecDeque::from([Answer::Yes]);
    plotter.draw_on();
    let interrupt = AtomicBool::new(false);
    let (mut sender, status) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    assert_eq!(status.state, "Run");
    let mut reports = 0;
    let error = sender.watch(&mut Counter(&mut reports, &interrupt)).expect_err("interrupted");
    assert!(matches!(error, Error::Interrupted), "{error}");
    assert_eq!(plotter.user.len(), 1, "nobody was asked");
}

/// Presses Ctrl-C after a hundred reports.
struct Counter<'a>(&'a mut u32, &'a AtomicBool);

impl Progress for Counter<'_> {
    fn lines_sent(&mut self, _: usize, _: usize) {}
    fn drawn(&mut self, _: &Status) {
        *self.0 += 1;
        self.1.store(*self.0 > 100, Ordering::Relaxed);
    }
    fn state(&mut self, _: &str) {}
}

#[test]
fn a_running_job_is_joined_paused_resumed_and_aborted() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.strokes = 1000;
    plotter.draw_on();
    let interrupt = AtomicBool::new(false);
    let aborts = plotter.aborts;
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let status = sender.resume().expect_err("it does not hold");
    assert_eq!(status.to_string(), "there is nothing to resume: the plotter reports Run");
    assert!(sender.pause(false).expect("paused").is_standing);
    assert_eq!(sender.resume().expect("resumed").state, "Run");
    assert_eq!(sender.give_up().expect("given up").state, "Idle");
    let error = sender.pause(false).expect_err("nothing is drawn");
    assert_eq!(error.exit_code(), 4);
    assert_eq!(plotter.aborts, aborts + 1, "only the abort that was asked for");
}

/// A byte without a checksum may be lost on the line, and nobody answers it.
#[test]
fn a_pause_whose_byte_is_lost_is_asked_for_again() {
    let interrupt = AtomicBool::new(false);
    for after_stroke in [false, true] {
        let mut plotter = FakePlotter::new(Fault::None);
        (plotter.strokes, plotter.lost_bytes) = (1000, 2);
        plotter.draw_on();
        let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
        assert!(sender.pause(after_stroke).expect("paused").is_standing);
        assert_eq!((plotter.lost_bytes, plotter.holds), (0, 1));
        plotter.lost_bytes = 3;
        let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
        assert_eq!(sender.resume().expect("resumed").state, "Run");
        assert_eq!(plotter.lost_bytes, 0);
    }
}

#[test]
fn a_plotter_that_does_not_obey_is_told() {
    let interrupt = AtomicBool::new(false);
    let mut plotter = FakePlotter::new(Fault::None);
    (plotter.strokes, plotter.lost_bytes) = (1000, 1000);
    plotter.draw_on();
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let error = sender.pause(false).expect_err("it goes on");
    assert!(error.to_string().contains("did not confirm that it obeyed (pause)"), "{error}");
    assert_eq!(error.exit_code(), 5);
    plotter.lost_bytes = 0;
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    sender.pause(false).expect("paused");
    plotter.lost_bytes = 1000;
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let error = sender.resume().expect_err("it holds");
    assert!(error.to_string().contains("did not confirm that it obeyed (resume)"), "{error}");
}

#[test]
fn keys_whose_bytes_are_lost_act_all_the_same() {
    let mut plotter = FakePlotter::new(Fault::None);
    (plotter.strokes, plotter.lost_bytes) = (200, 2);
    plotter.keys = VecDeque::from([(2, UserRequest::Pause)]);
    plotter.draw_on();
    let interrupt = AtomicBool::new(false);
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let mut reports = 0;
    sender.watch(&mut Counter(&mut reports, &interrupt)).expect_err("interrupted in the pause");
    assert_eq!((plotter.lost_bytes, plotter.holds), (0, 1));
    // To go on, the key is pressed once, and nobody is asked whether the machine may go on.
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.strokes = 20;
    plotter.keys = VecDeque::from([(2, UserRequest::Pause), (2, UserRequest::Pause)]);
    plotter.lost_after_holds = 2;
    plotter.user = VecDeque::from([Answer::Yes]);
    job(&mut plotter, 3).expect("a job without a fault");
    assert_eq!((plotter.holds, plotter.user.len()), (1, 1));
}

#[test]
fn an_abort_of_a_locked_machine_is_confirmed_by_its_status() {
    let interrupt = AtomicBool::new(false);
    let mut plotter = FakePlotter::new(Fault::Locked(10));
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let status = sender.give_up().expect("it stands");
    assert_eq!((status.is_alarm(), status.alarm), (true, Some(10)));
}

#[test]
fn a_job_is_watched_to_its_end() {
    let mut plotter = FakePlotter::new(Fault::None);
    plotter.pen_before = Some((1, 2));
    plotter.draw_on();
    let interrupt = AtomicBool::new(false);
    let mut recorder = Recorder::default();
    let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    assert_eq!(sender.watch(&mut recorder).expect("drawn").state, "Idle");
    assert_eq!(recorder.0.last().map(String::as_str), Some("stroke 3/3"));
    assert_eq!(plotter.requested_pens, [2, 2]);
    assert_eq!(plotter.aborts, 0);
}

#[test]
fn after_a_refused_line_the_next_one_is_carried_out() {
    let mut plotter = FakePlotter::new(Fault::ErrorAt(1, 150));
    let interrupt = AtomicBool::new(false);
    let (mut sender, _) =
        Sender::open_for_orders(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let error = sender.ask("$100=0").expect_err("refused");
    assert_eq!((error.exit_code(), matches!(error, Error::Refused { .. })), (4, true));
    sender.ask("$101=80").expect("taken");
    assert_eq!(plotter.lines, ["$100=0", "$101=80"]);
}

/// A refusal to go on at the origin is no reason not to go on from where the pen is.
#[test]
fn a_job_goes_on_after_a_refusal() {
    let mut plotter = FakePlotter::new(Fault::ErrorAt(1, 168));
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(&mut plotter, TIMEOUTS, &interrupt).expect("a plotter");
    let error = sender.go_on(true, &mut Quiet).expect_err("it knows where the pen is");
    assert!(matches!(error, Error::Refused { number: 168, .. }), "{error}");
    sender.go_on(false, &mut Quiet).expect("it goes on");
}

/// Nobody can say that the pen is in: the client says how to go on, and does not wait for ever.
#[test]
fn a_pen_that_nobody_can_put_in_ends_the_waiting() {
    let mut plotter = FakePlotter::new(Fault::LeftAlone);
    plotter.pen_before = Some((1, 2));
    let error = job(&mut plotter, 3).expect_err("nobody is there");
    assert!(matches!(error, Error::WaitsForPen { pen: 2 }), "{error}");
    assert_eq!((error.exit_code(), plotter.aborts), (5, 1));
}

/// A plotter that answers each status query with the next of these reports, and the last one again
/// and again.
struct Reporting {
    reports: VecDeque<&'static str>,
    output: VecDeque<u8>,
}

impl Link for Reporting {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for _ in bytes.iter().filter(|byte| **byte == b'?') {
            let is_last = self.reports.len() == 1;
            let next =
                if is_last { self.reports.front().copied() } else { self.reports.pop_front() };
            self.output.extend(next.unwrap_or_default().bytes().chain(*b"\r\n"));
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
        io::Read::read(&mut self.output, buffer)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Yes)
    }
}

/// The plotter reports a job that has stopped as long as it keeps it, whatever it does meanwhile.
#[test]
fn a_job_that_stopped_before_is_no_failure_of_what_is_watched() {
    for (reports, has_stopped) in [
        // A program of G-code, and one that only moves the raised pen.
        (
            &[
                "<Run|MPos:1.000,2.000,0.000|Drawn:1/1|Ink:0/37|Left:0>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:119/500|Drawn:1/1|Ink:37/37|Left:0>",
            ][..],
            false,
        ),
        (
            &[
                "<Run|MPos:1.000,2.000,0.000|Drawn:0/0|Ink:0/0|Left:0>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:119/500|Drawn:0/0|Ink:0/0|Left:0>",
            ],
            false,
        ),
        // Moves by hand.
        (
            &[
                "<Jog|MPos:1.000,2.000,0.000|Stopped:119/500|Drawn:120/500|Ink:9/50|Left:41>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:119/500|Drawn:120/500|Ink:9/50|Left:41>",
            ],
            false,
        ),
        // A job that is given up, one in its last stroke, and one that the power leaves.
        (
            &[
                "<Run|MPos:1.000,2.000,0.000|Drawn:119/500|Ink:8/50|Left:42>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:119/500|Drawn:120/500|Ink:9/50|Left:41>",
            ],
            true,
        ),
        (
            &[
                "<Run|MPos:1.000,2.000,0.000|Drawn:3/3|Ink:60/90|Left:0>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:2/3|Drawn:3/3|Ink:75/90|Left:0>",
            ],
            true,
        ),
        (
            &[
                "<Run|MPos:1.000,2.000,0.000|Drawn:119/500|Ink:8/50|Left:42>",
                "<Idle|MPos:0.000,0.000,0.000|Stopped:119/500|Drawn:0/0|Ink:0/0|Left:0>",
            ],
            true,
        ),
    ] {
        let mut plotter =
            Reporting { reports: reports.iter().copied().collect(), output: VecDeque::new() };
        let interrupt = AtomicBool::new(false);
        let (mut sender, _) = Sender::join(&mut plotter, TIMEOUTS, &interrupt).expect("it answers");
        let watched = sender.watch(&mut Quiet);
        let is_told = matches!(watched, Err(Error::JobStopped { .. }));
        assert_eq!((is_told, watched.is_ok()), (has_stopped, !has_stopped), "{reports:?}");
    }
}

/// A plotter that gives these reports one after the other, and the last one for ever.
struct Reports(VecDeque<&'static str>, VecDeque<u8>);

impl Reports {
    fn of(reports: &[&'static str]) -> Self {
        Self(reports.iter().copied().collect(), VecDeque::new())
    }
}

impl Link for Reports {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        for _ in bytes.iter().filter(|byte| **byte == b'?') {
            let report =
                if self.0.len() > 1 { self.0.pop_front() } else { self.0.front().copied() };
            self.1.extend(report.unwrap_or_default().bytes().chain(*b"\r\n"));
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
        let count = buffer.len().min(self.1.len());
        buffer.iter_mut().zip(self.1.drain(..count)).for_each(|(slot, byte)| *slot = byte);
        Ok(count)
    }

    fn change_pen(&mut self, _: u8) -> io::Result<Answer> {
        Ok(Answer::Nobody)
    }
}

/// Watches a plotter that gives these reports. Returns the error, if that is what it comes to.
fn watched(reports: &[&'static str]) -> Option<Error> {
    let interrupt = AtomicBool::new(false);
    let mut link = Reports::of(reports);
    let (mut sender, first) = Sender::join(&mut link, TIMEOUTS, &interrupt).expect("a plotter");
    match first.is_idle() {
        true => sender.fail_if_unfinished(first).err(),
        false => sender.watch(&mut Quiet).err(),
    }
}

const RUNS: &str = "<Run|MPos:1.000,2.000,0.000|Drawn:12/60|Ink:10/90|Left:9>";

#[test]
fn a_job_that_is_over_before_its_end_is_not_taken_for_done() {
    let over = "<Idle|MPos:1.000,2.000,0.000|Drawn:12/60|Ink:10/90|Left:0>";
    let in_stroke = "<Idle|MPos:1.000,2.000,0.000|Drawn:1/1|Ink:10/90|Left:0>";
    let restarted = "<Idle|MPos:0.000,0.000,0.000|Drawn:0/0|Ink:0/0|Left:0>";
    let stopped = "<Idle|MPos:0.000,0.000,0.000|Stopped:3/9|Drawn:0/0|Ink:0/0|Left:0>";
    for (reports, said) in [
        (&[RUNS, RUNS, over][..], "the job is over before its end, after 12 of 60 strokes"),
        (&[RUNS, RUNS, in_stroke], "the job is over before its end, after 1 of 1 stroke"),
        (&[RUNS, RUNS, restarted], "the job is over before its end: it was given up"),
        (&[RUNS, RUNS, stopped], "the job has stopped after 3 of 9 strokes"),
        (&[stopped], "the job has stopped after 3 of 9 strokes"),
        (&[over], "the job is over before its end, after 12 of 60 strokes"),
        (&[in_stroke], "the job is over before its end, after 1 of 1 stroke"),
    ] {
        let error = watched(reports).expect("an error");
        assert!(error.to_string().starts_with(said), "{reports:?}: {error}");
        assert_eq!(error.exit_code(), 5, "{error}");
    }
}

/// Strokes of G-code that are shorter than a motor step are not counted, and lengths are rounded.
/// A digit that is damaged in one report is right in the next.
#[test]
fn what_has_ended_is_taken_for_done() {
    let ended = "<Idle|MPos:1.000,2.000,0.000|Drawn:60/60|Ink:90/90|Left:0>";
    let program = "<Idle|MPos:1.000,2.000,0.000|Drawn:59/60|Ink:89/90|Left:0>";
    let after = "<Idle|MPos:1.000,2.000,0.000|Stopped:3/9|Drawn:60/60|Ink:90/90|Left:0>";
    let damaged = "<Idle|MPos:1.000,2.000,0.000|Drawn:50/60|Ink:20/90|Left:0>";
    let moved = "<Jog|MPos:1.000,2.000,0.000|Drawn:0/0|Ink:0/0|Left:0>";
    let empty = "<Idle|MPos:1.000,2.000,0.000|Drawn:0/0|Ink:0/0|Left:0>";
    for reports in [
        &[RUNS, RUNS, ended][..],
        &[RUNS, RUNS, program],
        &[RUNS, RUNS, after],
        &[RUNS, RUNS, damaged, ended],
        &[moved, moved, empty],
        &[ended],
        &[empty],
        &[after],
        &[damaged, ended],
    ] {
        assert!(watched(reports).is_none(), "{reports:?}");
    }
}
