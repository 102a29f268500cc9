//! Machines of other settings than the default ones: what the page shows of them, and how it moves
//! them by hand.

use super::{NOTCHED, OPTIONS, Pipe, clean};
use penup_page::{Board, Sheet};
use serde_json::Value;

/// The options of a machine with these settings, such as `3=1,235=0.5`.
fn machine(settings: &str) -> String {
    format!(r#"[["set","{settings}"]]"#)
}

/// A pipe to a board of these settings.
fn pipe(settings: &str) -> Pipe {
    let mut pipe = Pipe::new(clean);
    pipe.board = Board::new("", "", &machine(settings)).expect("a machine");
    pipe
}

/// The picture that a machine with these settings draws.
fn drawn(settings: &str) -> String {
    let mut pipe = pipe(settings);
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    pipe.until("drawn");
    pipe.board.svg(100.0, 80.0)
}

#[test]
fn motors_that_turn_round_and_have_backlash_draw_the_same_picture() {
    let usual = drawn("");
    for settings in ["3=1", "3=2", "3=7", "235=0.5,236=0.3"] {
        assert!(drawn(settings) == usual, "{settings}");
    }
}

#[test]
fn settings_whose_effect_the_page_does_not_have_are_passed_over() {
    let notes = |settings: &str| {
        let mut sheet = Sheet::new();
        let options = machine(settings);
        sheet.open("notched.obj", NOTCHED.to_vec(), false, &options).map(|_| sheet.notes())
    };
    let of_pico = "218=60,226=0,227=30.0,228=30.0,229=0.1,237=0,238=1";
    let usual = notes("").expect("shown");
    assert_eq!(notes(of_pico).expect("shown"), usual);
    assert!(drawn(of_pico) == drawn(""));
    for (settings, said) in [
        ("226=1", "226"),
        ("237=0.5,226=0", "237"),
        // Whoever has such a machine may plot on it.
        ("230=1", "penup preview"),
    ] {
        let notes = notes(settings).expect(settings);
        assert!(notes.contains(said), "{settings}: {notes}");
    }
    for unknown in ["999=1", "204=1e300", "210=50,211=50,3=8"] {
        let refused = notes(unknown).expect_err(unknown);
        assert!(refused.starts_with(|it: char| it.is_uppercase()), "{refused}");
        assert!(!refused.contains('$'), "{refused}");
    }
}

#[test]
fn a_machine_of_which_the_page_shows_nothing_is_plotted_on() {
    let mut pipe = Pipe::new(clean);
    let options = machine("230=1");
    assert!(Board::new("", "", &options).is_err(), "the page emulates no CoreXY machine");
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, &options).expect("sent");
    pipe.until("drawn");
}

/// Lets time pass until the drawing is done, and hands on each event.
fn draw(pipe: &mut Pipe, mut take: impl FnMut(&mut Pipe, &Value)) {
    for _ in 0..60_000 {
        pipe.step();
        for event in std::mem::take(&mut pipe.events) {
            if event["kind"] == "drawn" {
                return;
            }
            take(pipe, &event);
        }
    }
    assert!(pipe.now < 0.0, "it is never drawn");
}

#[test]
fn a_pause_for_ink_is_told_from_one_for_a_pen() {
    let mut pipe = pipe("215=0.2");
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    let mut pauses = 0;
    draw(&mut pipe, |pipe, event| {
        if event["kind"] == "status" && event["is_held"] == true {
            pipe.session.resume();
            pauses += 1;
        }
    });
    assert!(pauses > 0);
}

#[test]
fn a_wanted_pen_is_told_once_and_needs_no_ink() {
    let two_pens = b"v 0 0 0\nv 9 0 0\nv 9 9 0\nusemtl a\nl 1 2\nusemtl b\nl 2 3\n".to_vec();
    let mut pipe = pipe("");
    pipe.session.plot("two.obj", two_pens, false, "[]").expect("sent");
    let mut pens = Vec::new();
    draw(&mut pipe, |pipe, event| {
        assert!(event["kind"] != "note" && event["is_held"] != true, "{event}");
        if event["kind"] == "pen" {
            pens.push(event["pen"].clone());
            pipe.session.resume();
        }
    });
    assert_eq!(pens, [2]);
}

/// The square that the pen of a machine with these settings draws by hand: its least and its
/// greatest x and y. `None` if there is no ink.
fn square(settings: &str) -> Option<[[f32; 2]; 2]> {
    let mut pipe = pipe(settings);
    while pipe.until("phase")["name"] != "ready" {}
    pipe.session.test_square(20.0).expect("sent");
    (0..2000).for_each(|_| pipe.step());
    assert!(pipe.events.iter().all(|event| event["kind"] != "failed"), "{:?}", pipe.events);
    let path = pipe.board.take_path();
    let inked: Vec<_> = path.chunks_exact(4).filter(|sample| sample[3] > 0.0).collect();
    let over = |pick: fn(f32, f32) -> f32| {
        [1, 2].map(|axis| inked.iter().map(|it| it[axis]).reduce(pick).unwrap_or_default())
    };
    (!inked.is_empty()).then(|| [over(f32::min), over(f32::max)])
}

#[test]
fn the_pen_goes_down_by_hand_whatever_moves_it() {
    for settings in ["", "206=2,207=-3.5", "206=2,207=4,208=1", "206=3,216=90.5"] {
        assert_eq!(square(settings), Some([[0.0; 2], [20.0; 2]]), "{settings}");
    }
    let mut pipe = pipe("32=1");
    while pipe.until("phase")["name"] != "ready" {}
    pipe.session.test_square(20.0).expect("sent");
    let failed = pipe.until("failed");
    assert!(failed["text"].as_str().is_some_and(|it| it.contains("This machine has a laser")));
    // It can be plotted on all the same.
    (0..100).for_each(|_| pipe.step());
    pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, OPTIONS).expect("sent");
    pipe.until("drawn");
}

#[test]
fn an_unlock_is_announced_once_and_names_its_button() {
    let mut pipe = pipe("");
    while pipe.until("phase")["name"] != "ready" {}
    // What a machine with switches says when it starts and has not been homed.
    let locked = "[MSG:'$H'|'$X' to unlock]\r\nALARM:11\r\n";
    pipe.session.receive(locked.as_bytes(), pipe.now);
    let failed = pipe.until("failed");
    let says = |want| failed["text"].as_str().is_some_and(|text| text.contains(want));
    assert!(says("It said: press Home or Unlock.") && !says("X'"), "{failed}");
    pipe.session.command("$X").expect("sent");
    // What was on its way says Alarm still.
    pipe.session.receive(b"<Alarm|MPos:0.000,0.000|Alarm:11>\r\n", pipe.now);
    (0..500).for_each(|_| pipe.step());
    let failed = |event: &Value| event["kind"] == "failed";
    assert!(!pipe.events.iter().any(failed), "{:?}", pipe.events);
    pipe.session.command("G91").expect("unlocked");
}

#[test]
fn values_with_bytes_that_cannot_be_sent_are_refused_by_name() {
    for value in ["0!1", "1?", "~", "1\u{18}", "1\\n2", "1\u{e9}"] {
        let mut sheet = Sheet::new();
        let options = format!(r#"[["crease","{}"]]"#, value.replace('\u{18}', "\\u0018"));
        let opened = sheet.open("notched.obj", NOTCHED.to_vec(), false, &options);
        let refused = opened.expect_err(value);
        assert!(refused.contains("\u{201c}crease\u{201d}"), "{value:?}: {refused}");
        let mut pipe = Pipe::new(clean);
        let sent = pipe.session.plot("notched.obj", NOTCHED.to_vec(), false, &options);
        assert_eq!(sent, Err(refused));
    }
    let mut sheet = Sheet::new();
    let title = r#"[["title","Why not? Caf\u00e9!"]]"#;
    sheet.open("notched.obj", NOTCHED.to_vec(), false, title).expect("a title");
}
