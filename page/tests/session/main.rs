//! The session of the page with an emulated plotter, over good and bad lines, on this computer.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod machine;

use penup::checksum::CRC_16;
use penup_page::{Board, Session, Sheet};
use serde_json::Value;

const NOTCHED: &[u8] = include_bytes!("../../../scenes/notched.obj");
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
        let session = Session::new(5000.0);
        let board = Board::new("", "", "[]").expect("the default machine");
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
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
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
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
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
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, "[]").expect("sent");
    pipe.until("drawn");
}

/// A line on which the first `reports` of a plotter at rest, once it draws, say that a job has
/// stopped.
fn stopped(count: &mut u64, to_plotter: bool, bytes: Vec<u8>, reports: u64) -> Vec<u8> {
    let text = String::from_utf8_lossy(&bytes);
    if to_plotter || !text.contains("<Idle|") {
        *count += u64::from(*count == 0 && text.contains("<Run|"));
        return bytes;
    }
    if *count == 0 || *count > reports {
        return bytes;
    }
    *count += 1;
    text.replace("<Idle|", "<Idle|Stopped:2/9|").into_bytes()
}

#[test]
fn a_drawing_that_has_stopped_before_its_end_is_not_called_drawn() {
    let mut pipe = Pipe::new(|count, to_plotter, bytes| stopped(count, to_plotter, bytes, 1000));
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|it| it.contains("before its end")), "{failed}");
    assert!(pipe.events.iter().all(|event| event["kind"] != "drawn"), "{:?}", pipe.events);
    // The plotter may note the last stroke a moment after it is at rest.
    drawn(|count, to_plotter, bytes| stopped(count, to_plotter, bytes, 2));
}

#[test]
fn what_is_refused_says_what_to_do() {
    let mut pipe = Pipe::new(clean);
    let refused = pipe.session.plot("x.obj", b"v 1 2 3\nf 1 2 zero\n".to_vec(), false, "[]");
    assert!(refused.expect_err("refused").contains("x.obj:2"));
    // Larger than the travel of the machine: the plotter itself refuses it.
    let options = r#"[["page","600x600"],["margin","0"]]"#;
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, options).expect("sent");
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|text| text.contains("travel")), "{failed}");
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    pipe.until("drawn");
}

#[test]
fn a_plotter_that_falls_silent_is_given_up_with_a_sentence() {
    let mut pipe = Pipe::new(|_, _, _| Vec::new());
    // A browser that lets the page wait a second and a half every time counts one of it.
    for _ in 0..4 {
        pipe.now += 1490.0;
        pipe.step();
    }
    assert!(pipe.events.iter().all(|event| event["kind"] != "failed"), "{:?}", pipe.events);
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|it| it.contains("does not answer")), "{failed}");
    assert_eq!(pipe.now.round(), 7010.0);
}

#[test]
fn a_computer_that_sleeps_gives_up_no_plotter() {
    let mut pipe = Pipe::new(clean);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    // While lines are sent, and while the machine draws, each time before an answer has come.
    for kind in ["sent", "status"] {
        pipe.until(kind);
        pipe.now += 3_600_000.0;
        pipe.session.tick(pipe.now);
        if kind == "sent" {
            pipe.until_state("Run");
        }
    }
    pipe.until("drawn");
    assert!(pipe.events.iter().all(|event| event["kind"] != "failed"), "{:?}", pipe.events);
}

#[test]
fn the_sheet_shows_what_the_plotter_draws() {
    let mut sheet = Sheet::new();
    sheet.open("notched.obj", NOTCHED.to_vec(), false, "[]").expect("a model");
    let solid = sheet.draw().expect("lines");
    sheet.turn(r#"[["hidden","dashed"]]"#).expect("set");
    let dashed = sheet.draw().expect("lines");
    assert!(dashed.len() > solid.len(), "hidden lines are dashes of their own");
    let mut pipe = Pipe::new(clean);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, "[]").expect("sent");
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

#[test]
fn a_model_stands_on_the_side_that_is_chosen_and_contradictions_are_refused() {
    let mut sheet = Sheet::new();
    sheet.open("notched.obj", NOTCHED.to_vec(), false, "[]").expect("a model");
    let eye = |sheet: &mut Sheet, options: &str| -> Result<Vec<f64>, String> {
        sheet.turn(options)?;
        let camera: Value = serde_json::from_str(&sheet.camera()).expect("a camera");
        let from = |name: &str, axis: usize| camera[name][axis].as_f64().expect("a number");
        Ok((0..3).map(|axis| (from("eye", axis) - from("at", axis)).round()).collect())
    };
    let front = eye(&mut sheet, r#"[["view","front"]]"#).expect("seen");
    assert!(front[1] < 0.0 && front[0] == 0.0 && front[2] == 0.0, "{front:?}");
    let angles = r#"[["azimuth","-90"],["elevation","0"]]"#;
    assert_eq!(eye(&mut sheet, angles), Ok(front.clone()));
    let upright = eye(&mut sheet, r#"[["view","front"],["y-up","on"]]"#).expect("seen");
    assert!(upright[2] > 0.0 && upright[1] == 0.0, "the front is at positive z: {upright:?}");
    for (options, said) in [
        (r#"[["view","front"],["eye","1,2,3"]]"#, "clear it"),
        (r#"[["view","front"],["azimuth","3"]]"#, "leave out"),
        (r#"[["azimuth","370"]]"#, "-360 to 360"),
        (r#"[["elevation","steep"]]"#, "-90 to 90"),
        (r#"[["y-up","on"],["up","0,0,1"]]"#, "what is up"),
        (r#"[["page","wide"]]"#, "WIDTHxHEIGHT"),
        (r#"[["view","front"],["projection","isometric"]]"#, "direction of its own"),
    ] {
        let refused = eye(&mut sheet, options).expect_err(options);
        assert!(refused.contains(said), "{options}: {refused}");
    }
}

#[test]
fn speeds_follow_the_buttons() {
    let mut pipe = Pipe::new(clean);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    pipe.until_state("Run");
    let until_percent = |pipe: &mut Pipe, percent: u64| {
        for _ in 0..1000 {
            if pipe.until("status")["percent"] == percent {
                return;
            }
        }
        panic!("the speeds are never at {percent} %");
    };
    until_percent(&mut pipe, 100);
    pipe.session.override_speed(1);
    until_percent(&mut pipe, 110);
    pipe.session.override_speed(1);
    until_percent(&mut pipe, 120);
    pipe.session.override_speed(-1);
    until_percent(&mut pipe, 110);
    pipe.session.override_speed(0);
    until_percent(&mut pipe, 100);
    pipe.until("drawn");
}

/// The modes of the plotter, as it tells them.
fn modes(pipe: &mut Pipe) -> String {
    pipe.session.command("$G").expect("sent");
    let told = pipe.until("reply")["text"].as_str().expect("a line").to_owned();
    (0..100).for_each(|_| pipe.step());
    told
}

/// A line on which the first line is damaged that makes coordinates absolute.
fn losing_the_end(count: &mut u64, to_plotter: bool, bytes: Vec<u8>) -> Vec<u8> {
    let end = bytes.windows(3).position(|part| part == b"G90");
    let (Some(at), true, 0) = (end, to_plotter, *count) else { return bytes };
    *count = 1;
    [&bytes[..at], b"\xFF", &bytes[at + 1..]].concat()
}

#[test]
fn a_test_square_is_a_square_where_the_pen_stands() {
    let mut pipe = Pipe::new(clean);
    assert!(pipe.session.test_square(20.0).is_err(), "the plotter is not found yet");
    let until_ready = |pipe: &mut Pipe| while pipe.until("phase")["name"] != "ready" {};
    until_ready(&mut pipe);
    // The place of the pen is told in inches, and in the coordinates of the user alone.
    for setting in ["$13=1", "$10=0"] {
        pipe.session.command(setting).expect("sent");
        (0..100).for_each(|_| pipe.step());
    }
    pipe.session.command("$J=G91 G21 X30 Y40 F3000").expect("sent");
    pipe.until_state("Idle");
    (0..200).for_each(|_| pipe.step());
    pipe.board.begin_again();
    pipe.board.take_path();
    pipe.session.test_square(20.0).expect("sent");
    (0..1000).for_each(|_| pipe.step());
    let path = pipe.board.take_path();
    let inked = path.chunks_exact(4).filter(|sample| sample[3] > 0.0);
    let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
    for sample in inked {
        for axis in [0, 1] {
            low[axis] = low[axis].min(sample[axis + 1]);
            high[axis] = high[axis].max(sample[axis + 1]);
        }
    }
    assert_eq!((low, high), ([30.0, 40.0], [50.0, 60.0]));
    assert!(modes(&mut pipe).contains("G90"), "coordinates are absolute again");
    // In check mode only the second side of a square that is too high is refused, and the machine
    // is not locked. The line that ends the square may be lost behind that.
    pipe.session.command("$131=100").expect("sent");
    (0..100).for_each(|_| pipe.step());
    pipe.session.command("$C").expect("sent");
    pipe.until_state("Check");
    (pipe.line, pipe.count) = (losing_the_end, 0);
    pipe.session.test_square(90.0).expect("sent");
    pipe.until("failed");
    (0..100).for_each(|_| pipe.step());
    assert!(modes(&mut pipe).contains("G90"), "coordinates are absolute behind it, too");
    pipe.session.command("$C").expect("sent");
    pipe.until_state("Idle");
    (0..200).for_each(|_| pipe.step());
    pipe.events.clear();
    // A square beyond the travel locks the machine, and the session goes on once it is unlocked.
    pipe.session.test_square(4000.0).expect("sent");
    let refused = pipe.until("failed");
    assert!(refused["text"].as_str().is_some_and(|text| text.contains("3610")), "{refused}");
    let locked = pipe.until("failed");
    let said = locked["text"].as_str().expect("a sentence");
    assert!(said.contains("beyond the travel") && said.contains("Unlock"), "{said}");
    while pipe.until("phase")["name"] != "alarm" {}
    assert!(pipe.session.command("M5").is_err(), "it is locked");
    // Homing would end the alarm, but it is off.
    pipe.session.command("$H").expect("sent");
    let refused = pipe.until("failed");
    assert!(refused["text"].as_str().is_some_and(|text| text.contains("homing is off")));
    (0..100).for_each(|_| pipe.step());
    assert!(pipe.events.iter().all(|event| event["kind"] == "status"), "{:?}", pipe.events);
    pipe.session.command("$X").expect("sent");
    until_ready(&mut pipe);
    assert!(modes(&mut pipe).contains("G90"));
    // This board keeps no job, and knows of none that a computer sends.
    pipe.session.go_on(false).expect("sent");
    let refused = pipe.until("failed");
    assert!(refused["text"].as_str().is_some_and(|it| it.starts_with("Resume: ")), "{refused}");
    (0..100).for_each(|_| pipe.step());
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    pipe.until("drawn");
}

/// A reply with its checksum.
fn checked(reply: &str) -> String {
    format!("{reply}*{:04X}\r\n", CRC_16.checksum(reply.as_bytes()))
}

/// A plotter whose job has stopped that a computer sent while it was drawn.
fn of_a_computer(_: &mut u64, to_plotter: bool, bytes: Vec<u8>) -> Vec<u8> {
    let text = String::from_utf8_lossy(&bytes);
    assert!(!to_plotter || !text.contains("$resume"), "it would be refused, or do nothing");
    // The board of the page has no such jobs, with or without the feature `stream`.
    let is_refused = ["error:3 N1", "error:181 N1"].map(checked).iter().any(|it| text.contains(it));
    if to_plotter || !is_refused {
        return bytes;
    }
    let said = ["ok N1", "Line: 1"].map(checked).concat();
    format!("[STOPPED:7,12,100,1]\r\n{said}").into_bytes()
}

#[test]
fn a_job_that_a_computer_sent_is_left_to_it() {
    for is_at_origin in [false, true] {
        let mut pipe = Pipe::new(of_a_computer);
        while pipe.until("phase")["name"] != "ready" {}
        pipe.session.go_on(is_at_origin).expect("sent");
        let failed = pipe.until("failed");
        let text = failed["text"].as_str().expect("a sentence");
        let says = text.contains("A computer sent this drawing");
        assert!(says && text.contains("`penup plot FILE --port DEVICE --resume`"), "{text}");
        (0..100).for_each(|_| pipe.step());
        assert!(pipe.events.iter().all(|event| event["kind"] != "failed"), "{:?}", pipe.events);
    }
}

/// A plotter that is locked when the session finds it is homed without being unlocked first.
#[test]
fn homing_ends_an_alarm() {
    let mut session = Session::new(5000.0);
    session.connect(0.0);
    let mut now = 0.0;
    // What the session sends, and the names of its phases, once it has received this.
    let mut hear = |session: &mut Session, said: &str| {
        now += 10.0;
        session.receive(said.as_bytes(), now);
        session.tick(now);
        let events: Vec<Value> = serde_json::from_str(&session.take_events()).expect("events");
        let phases = events.into_iter().filter(|event| event["kind"] == "phase");
        let names: Vec<String> = phases.map(|event| event["name"].to_string()).collect();
        (String::from_utf8(session.take_out()).expect("text"), names)
    };
    let alarm = "<Alarm|MPos:0.000,0.000|Alarm:11>\r\n";
    assert_eq!(hear(&mut session, alarm).1, ["\"finding\"", "\"alarm\""]);
    session.command("$H").expect("sent");
    // The first answer is lost.
    assert!(hear(&mut session, alarm).0.starts_with("\nN0 M110*"));
    let again = (0..150).map(|_| hear(&mut session, alarm).0).collect::<String>();
    assert_eq!(again.matches("N0 M110*").count(), 1, "{again}");
    let sent = hear(&mut session, &checked("ok N0")).0;
    assert!(sent.contains("N1 $H*") && sent.contains("N2 G90*"), "{sent}");
    assert_eq!(hear(&mut session, alarm).1, [""; 0]);
    let homing = hear(&mut session, "<Home|MPos:0.000,0.000>\r\n");
    assert_eq!(homing.1, ["\"ready\""]);
    assert!(session.command("M5").is_err(), "it homes");
    let ends = ["ok N1", "ok N2", "Line: 2"].map(checked).concat();
    assert_eq!(hear(&mut session, &ends).1, [""; 0]);
    session.command("M5").expect("sent");
    let sent = hear(&mut session, "<Idle|MPos:0.000,0.000>\r\n").0;
    assert!(sent.contains("N3 M5*"), "{sent}");
}

/// The seek to a switch that is not there takes 25 s at the speed set, and no line is read then.
#[test]
fn a_plotter_that_finds_its_switches_is_waited_for() {
    let mut pipe = Pipe::new(clean);
    while pipe.until("phase")["name"] != "ready" {}
    pipe.session.command("$22=1").expect("sent");
    (0..200).for_each(|_| pipe.step());
    let began = pipe.now;
    pipe.session.command("$H").expect("sent");
    let failed = pipe.until("failed");
    assert!(pipe.now - began > 20_000.0, "{failed} after {} ms", pipe.now - began);
    assert!(failed["text"].as_str().is_some_and(|text| text.contains("switch")), "{failed}");
    // The alarm leaves homing possible.
    while pipe.until("phase")["name"] != "alarm" {}
    pipe.events.clear();
    let began = pipe.now;
    pipe.session.command("$H").expect("sent");
    pipe.until_state("Home");
    let failed = pipe.until("failed");
    assert!(pipe.now - began > 20_000.0, "{failed} after {} ms", pipe.now - began);
    assert!(failed["text"].as_str().is_some_and(|text| text.contains("press Home")), "{failed}");
}
