//! The session of the page with an emulated plotter, over good and bad lines, on this computer.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup_page::{Board, Session, Sheet};
use serde_json::Value;

const NOTCHED: &[u8] = include_bytes!("../../scenes/notched.obj");
const OPTIONS: &str = r#"[["hidden","dashed"],["page","100x80"]]"#;

/// A pipe between a session and a board.
struct Pipe {
    session: Session,
    board: Board,
    now: f64,
    events: Vec<Value>,
    /// What happens to the bytes on their way: their direction, and those bytes.
    line: fn(&mut u64, bool, Vec<u8>) -> Vec<u8>,
    count: u64,
}

impl Pipe {
    fn new(line: fn(&mut u64, bool, Vec<u8>) -> Vec<u8>) -> Self {
        let (session, board) = (Session::new(5000.0), Board::new(""));
        let mut pipe = Self { session, board, now: 0.0, events: Vec::new(), line, count: 0 };
        pipe.session.connect(0.0);
        pipe
    }

    /// Lets 10 ms pass.
    fn step(&mut self) {
        self.now += 10.0;
        let out = (self.line)(&mut self.count, true, self.session.take_out());
        self.board.receive(&out);
        self.board.advance(10);
        let sent = (self.line)(&mut self.count, false, self.board.take_sent());
        self.session.receive(&sent, self.now);
        self.session.tick(self.now);
        let events: Vec<Value> = serde_json::from_str(&self.session.take_events()).expect("events");
        self.events.extend(events);
    }

    /// Lets time pass until there is an event of this kind, for 10 minutes at most.
    fn until(&mut self, kind: &str) -> Value {
        for _ in 0..60_000 {
            self.step();
            if let Some(at) = self.events.iter().position(|event| event["kind"] == kind) {
                return self.events.drain(..=at).next_back().expect("found");
            }
        }
        panic!("no event {kind}: {:?}", self.events.last());
    }

    /// Lets time pass until a status says this state.
    fn until_state(&mut self, state: &str) {
        while self.until("status")["state"] != state {}
    }
}

fn clean(_: &mut u64, _: bool, bytes: Vec<u8>) -> Vec<u8> {
    bytes
}

/// Every 151st byte is damaged, except for those that act at once, and every 1009th is lost.
fn noisy(count: &mut u64, to_plotter: bool, bytes: Vec<u8>) -> Vec<u8> {
    let mut arrived = Vec::new();
    for byte in bytes {
        *count += 1;
        if byte != b'?' && (*count).is_multiple_of(1009) {
            continue;
        }
        let damaged = (*count).is_multiple_of(151) && byte.is_ascii_graphic() && byte != b'?';
        arrived.push(match damaged {
            true if to_plotter => 0xFF,
            true => byte ^ 1,
            false => byte,
        });
    }
    arrived
}

/// Draws, and returns the picture that the pins made.
fn drawn(line: fn(&mut u64, bool, Vec<u8>) -> Vec<u8>) -> String {
    let mut pipe = Pipe::new(line);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), OPTIONS).expect("sent");
    let report = pipe.until("drawn");
    assert!(report["report"].as_str().is_some_and(|it| it.contains("mm drawn")), "{report}");
    pipe.board.svg(100.0, 80.0)
}

#[test]
fn a_bad_line_changes_nothing() {
    let clean = drawn(clean);
    assert!(clean.matches("<path").count() > 10, "dashes are strokes of the pen");
    assert_eq!(drawn(noisy), clean);
}

#[test]
fn hold_resume_and_give_up() {
    let mut pipe = Pipe::new(clean);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), OPTIONS).expect("sent");
    pipe.until_state("Run");
    pipe.session.hold();
    pipe.until_state("Hold");
    // Until the machine has slowed down.
    (0..100).for_each(|_| pipe.step());
    pipe.board.take_path();
    (0..100).for_each(|_| pipe.step());
    assert_eq!(pipe.board.take_path(), [0.0; 0], "the pen stands while it is held");
    pipe.session.resume();
    pipe.until_state("Run");
    pipe.session.give_up();
    pipe.until("stopped");
    // The session goes on with the next drawing.
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), "[]").expect("sent");
    pipe.until("drawn");
}

#[test]
fn what_is_refused_says_what_to_do() {
    let mut pipe = Pipe::new(clean);
    let refused = pipe.session.plot("x.obj", b"v 1 2 3\nf 1 2 zero\n".to_vec(), "[]");
    assert!(refused.expect_err("refused").contains("x.obj:2"));
    // Larger than the travel of the machine: the plotter itself refuses it.
    let options = r#"[["page","600x600"],["margin","0"]]"#;
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), options).expect("sent");
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|text| text.contains("travel")), "{failed}");
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), OPTIONS).expect("sent");
    pipe.until("drawn");
}

#[test]
fn a_plotter_that_falls_silent_is_given_up_with_a_sentence() {
    let mut pipe = Pipe::new(|_, _, _| Vec::new());
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|it| it.contains("does not answer")), "{failed}");
}

#[test]
fn the_sheet_shows_what_the_plotter_draws() {
    let mut sheet = Sheet::new();
    sheet.open("notched.obj", NOTCHED.to_vec(), "[]").expect("a model");
    let solid = sheet.draw().expect("lines");
    sheet.turn(r#"[["hidden","dashed"]]"#).expect("set");
    let dashed = sheet.draw().expect("lines");
    assert!(dashed.len() > solid.len(), "hidden lines are dashes of their own");
    let mut pipe = Pipe::new(clean);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), "[]").expect("sent");
    pipe.until("drawn");
    let strokes = pipe.board.strokes();
    let (mut ink, mut at) = (0.0, 0);
    while let Some(&count) = strokes.get(at + 1) {
        let points = &strokes[at + 2..at + 2 + 2 * count as usize];
        for pair in points.windows(4).step_by(2) {
            ink += (pair[2] - pair[0]).hypot(pair[3] - pair[1]);
        }
        at += 2 + 2 * count as usize;
    }
    let seen: f64 = solid
        .chunks_exact(5)
        .map(|line| f64::from(line[2] - line[0]).hypot(f64::from(line[3] - line[1])))
        .sum();
    assert!((ink - seen).abs() < 0.01, "{ink} mm of strokes, {seen} mm of lines");
}
