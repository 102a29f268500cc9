//! Draws HP-GL on the board in memory and compares what the pins ink with what is expected: the
//! strokes of `lines.txt`, and for whole files the plan that the client's reader of HP-GL makes of
//! them. The sender is one that does not wait, one that asks for room (`ESC.B`), or one that obeys
//! XON and XOFF.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod ink;
mod lines;
mod senders;

use ink::{assert_same_ink, inked, plan, units};
use penup::machine::State;
use penup_client::emulator::MachineEventKind;
use penup_host_tests::whole_jobs::{Bench, machine_events};
use std::fmt::Write as _;

/// A plotter with little memory.
/// Draws HP-GL to its end, with whatever pens it asks for. Returns all that is heard.
fn draw(bench: &mut Bench, bytes: &[u8]) -> String {
    bench.board.receive(bytes);
    let mut heard = String::new();
    let mut idle = 0;
    while idle < 50 {
        bench.work(1);
        heard += &String::from_utf8_lossy(&bench.board.take_sent());
        if bench.plotter.machine().state() == (State::Hold { stopped: true }) {
            // The other port puts the pen in. It is heard there, and not here.
            bench.board.receive_by(1, b"~");
        }
        let is_idle = bench.board.has_read_all()
            && bench.plotter.machine().state() == State::Idle
            && bench.plotter.machine().is_stopped();
        idle = if is_idle { idle + 1 } else { 0 };
    }
    heard
}

/// A file as vpype writes it: a spiral of one stroke in a single `PD` without a line end.
fn vpype() -> Vec<u8> {
    let mut text = String::from("IN;DF;PS4;SP1;PU4000,3000;PD");
    for index in 0..1650 {
        let (angle, radius) = (f64::from(index) * 0.1, f64::from(index) * 1.6);
        let (x, y) = (4000.0 + radius * angle.cos(), 3000.0 + radius * angle.sin());
        let _ = write!(text, "{}{},{}", if index > 0 { "," } else { "" }, x as i32, y as i32);
    }
    text += ";PU;SP0;IN;";
    text.into_bytes()
}

/// A file as Inkscape writes it: each point an instruction of its own.
fn inkscape() -> Vec<u8> {
    let mut text = String::from("IN;SP1;FS24;VS20;");
    for square in 0..6 {
        let (at, side) = (400 + 700 * square, 300 + 60 * square);
        let _ = write!(
            text,
            "PU{at},{at};PD{},{at};PD{},{};PD{at},{};PD{at},{at};",
            at + side,
            at + side,
            at + side,
            at + side
        );
    }
    text += "PU0,0;SP0;IN; ";
    text.into_bytes()
}

/// A file as gnuplot writes it: the interface is set up first, and lines end with a line feed.
fn gnuplot() -> Vec<u8> {
    let mut text = String::from("\x1B.Y\n\x1B.I81;;17:\x1B.N;19:\x1B.M500:\nIN;\nSP1;\n");
    text += "PU1000,1000;\nPD7000,1000;\nPD7000,5000;\nPD1000,5000;\nPD1000,1000;\n";
    for tick in 1..6 {
        let x = 1000 + 1000 * tick;
        let _ = write!(text, "PU{x},1000;\nPD{x},1080;\nPU{x},5000;\nPD{x},4920;\n");
    }
    text += "PU1000,3000;\n";
    for index in 1..=120 {
        let y = 3000.0 + 1500.0 * (f64::from(index) * 0.1).sin();
        let _ = writeln!(text, "PD{},{};", 1000 + 50 * index, y as i32);
    }
    text += "PU0,0;SP0;\n\x1B.Z\n";
    text.into_bytes()
}

/// Instructions as Chiplotle sends them: objects with a scale, arcs, circles and relative moves.
fn chiplotle() -> Vec<u8> {
    let mut text = String::from("IN;SP1;VS30;PU;PA 3000,3000;CI 800;");
    text += "PA 5000.00,3000.00;AA 4000.00,3000.00,270.00;PD;AR -500.0,-500.0,-120.0;PU;";
    text += "PA 1000,1000;PR;PD 500,0,0,500;PD -500,0,0,-500;PU;PA;";
    text += "IP 1000,4000,5000,6000;SC -10,10,0,5;PA -10,0;PD 10,5;PU 10,0;PD -10,5;PU;SC;";
    text += "PA 6000,1000;EA 7000,2000;ER -300,-400;EW 300,30,200;PU 0,0;SP0;";
    text.into_bytes()
}

/// The files, with their names.
fn files() -> [(&'static str, Vec<u8>); 4] {
    [
        ("vpype", vpype()),
        ("inkscape", inkscape()),
        ("gnuplot", gnuplot()),
        ("chiplotle", chiplotle()),
    ]
}

/// How far the client's plan may be from the true figure, in steps: the chords of its arcs are up
/// to 0.2 plotter units off, which are 0.4 steps.
fn tolerance(name: &str) -> f64 {
    if name == "chiplotle" { 0.4 } else { 0.0 }
}

#[test]
fn the_ink_of_files_is_the_plan_of_the_clients_reader() {
    assert!(vpype().len() > 14_701 && !vpype().contains(&b'\n'));
    for (name, bytes) in files() {
        let mut bench = Bench::small();
        let heard = draw(&mut bench, &bytes);
        assert!(!heard.contains("ok") && !heard.contains("error"), "{name}: {heard}");
        assert_same_ink(
            name,
            &inked(&bench),
            &plan(&bytes).expect("a valid file"),
            tolerance(name),
        );
    }
}

#[test]
fn nothing_is_answered_that_hp_gl_does_not_ask_for() {
    let mut bench = Bench::small();
    assert_eq!(draw(&mut bench, b"IN;SP1;PD100,100;XX;PA1;OE;SP2;PD200,200;\n\n"), "1\r");
    // The pen was asked for at the other port only.
    let mut bench = Bench::small();
    bench.board.receive_by(1, b"$I\n");
    let heard = draw(&mut bench, b"IN;SP2;PD100,100;");
    assert!(heard.contains("[MSG:put in pen 2, then send ~]"), "{heard}");
    // An alarm is heard there, too, and what is to be drawn then sets error 8.
    let mut bench = Bench::small();
    bench.board.receive(b"\xFDIN;PD100,100;OE;PA0,0;OE;");
    bench.work(50);
    assert_eq!(bench.heard(), "ALARM:10\n8\r8\r");
}

#[test]
fn the_machine_stands_until_the_next_sheet_is_there() {
    let mut bench = Bench::small();
    bench.board.receive(b"IN;PG;PD100,0;PU;PG;PU0,100;");
    bench.work(3000);
    assert!(bench.say("?").starts_with("<Idle|"), "nothing is to be drawn on the next sheet");
    bench.board.receive(b"PD100,100;PD100,200;PU;PG;");
    bench.work(3000);
    let status = bench.say("?");
    assert!(status.starts_with("<Hold:0|") && !status.contains("|Pen:"), "{status}");
    assert!(inked(&bench).iter().all(|[_, y]| *y == 0.0), "nothing is drawn on the first sheet");
    bench.board.receive(b"~");
    bench.work(3000);
    assert!(bench.say("?").starts_with("<Idle|"));
    for point in [[0.0, 200.0], [200.0, 200.0], [200.0, 400.0]] {
        assert!(inked(&bench).contains(&point), "{point:?}");
    }
    // The sheet is asked for at the other port.
    let mut bench = Bench::small();
    bench.board.receive_by(1, b"$I\n");
    let heard = draw(&mut bench, b"IN;PD100,0;PG;PD100,100;");
    assert!(heard.contains("[MSG:put in the next sheet, then send ~]"), "{heard}");
}

#[test]
fn what_the_sender_takes_back_has_not_been_asked_for() {
    for (first, next) in [("SP3;", "SP2;PD300,0;"), ("SP3;", "SP1;PD100,0;PU;PG;PD300,0;")] {
        let mut bench = Bench::small();
        bench.board.receive(format!("IN;SP1;PD50,0;PU;{first}PD200,0;").as_bytes());
        bench.work(3000);
        assert!(bench.say("?").contains("|Pen:3|"));
        // `ESC.K` forgets the change of pens and the line behind it.
        bench.board.receive(b"\x1B.K");
        bench.work(3000);
        assert!(!bench.say("?").contains("|Pen:"));
        bench.board.receive(b"~");
        bench.work(3000);
        assert!(bench.say("?").starts_with("<Idle|"));
        bench.board.receive(next.as_bytes());
        bench.work(3000);
        let status = bench.say("?");
        assert!(status.starts_with("<Hold:0|"), "{next} {status}");
        let ink = inked(&bench);
        assert!(ink.iter().all(|[x, _]| *x <= 200.0), "{next} {ink:?}");
    }
}

#[test]
fn pens_are_asked_for_when_they_differ_and_status_tells_which() {
    let mut bench = Bench::small();
    bench.board.receive(b"IN;SP1;PD100,0;SP1;PD200,0;SP3;PD300,0;");
    bench.work(3000);
    assert_eq!(units(&bench), [[0, 0], [200, 0]]);
    let status = bench.say("?");
    assert!(status.starts_with("<Hold:0|") && status.contains("|Pen:3|"), "{status}");
    bench.board.receive(b"~");
    bench.work(3000);
    assert_eq!(units(&bench), [[0, 0], [300, 0]]);
    bench.board.receive(b"SP0;PD400,0;SP3;PD500,0;");
    bench.work(3000);
    assert!(!bench.say("?").contains("|Pen:"));
    let ink = inked(&bench);
    assert!(ink.iter().all(|[x, _]| *x <= 600.0 || *x >= 800.0), "put away");
    assert!(ink.iter().any(|[x, _]| *x == 1000.0));
    // With one pen for all there are no questions.
    let mut bench = Bench::small();
    bench.say("$pens=one\n");
    bench.board.receive(b"IN;SP5;PD100,0;");
    bench.work(2000);
    assert_eq!(units(&bench), [[0, 0], [100, 0]]);
}

/// Whoever holds between two instructions has seen something go wrong.
#[test]
fn a_hold_between_two_instructions_stops_what_comes() {
    for hold in [b"!", b"\xFB"] {
        let mut bench = Bench::small();
        bench.board.receive(b"IN;SP1;PU400,400;PD800,400;");
        bench.work(3000);
        assert_eq!(bench.plotter.machine().state(), State::Idle);
        bench.board.receive(hold);
        bench.work(10);
        assert_eq!(bench.plotter.machine().state(), State::Hold { stopped: true });
        let before = bench.plotter.machine().position();
        bench.board.receive(b"PD800,800;PU;");
        bench.work(3000);
        assert_eq!(bench.plotter.machine().position(), before);
        bench.board.receive(b"~");
        bench.work(3000);
        assert_ne!(bench.plotter.machine().position(), before);
        assert_eq!(bench.plotter.machine().state(), State::Idle);
    }
}

/// How long the plotter takes for the instructions behind `IN;PU0,0;PD`, in ms, and how often it
/// lowers the pen.
fn time_and_lowerings(text: &str) -> (u64, usize) {
    let mut bench = Bench::small();
    draw(&mut bench, format!("IN;PU0,0;PD{text}").as_bytes());
    let time = bench.board.trace().now() * 1000 / u64::from(penup::motion::TICKS_PER_SECOND);
    let events = machine_events(&bench.board.trace().take_changes());
    let is_down = |event: &&MachineEventKind| matches!(event, MachineEventKind::Pen { down: true });
    (time, events.iter().filter(is_down).count())
}

#[test]
fn the_pen_passes_repeated_points_and_lines_below_a_step_without_a_stop() {
    let line = |points: fn(i32) -> String| {
        let points: Vec<String> = (1..=35).map(|point| points(point * 80)).collect();
        time_and_lowerings(&format!("{};PU;", points.join(",")))
    };
    let (once, lowerings) = line(|x| format!("{x},0"));
    assert_eq!(lowerings, 1);
    for (name, (time, lowerings)) in [
        ("twice", line(|x| format!("{x},0,{x},0"))),
        ("below a step", line(|x| format!("{x},0,{x}.1,0.1,{x},0"))),
        ("lowered", line(|x| format!("{x},0;PU;PD;PD{x},0"))),
    ] {
        assert!(time.abs_diff(once) <= 50 && lowerings == 1, "{name}: {time} and {once} ms");
    }
    // Dots are drawn where the pen comes raised, and with another pen.
    for (text, lowerings) in [("", 1), (";PU;PD", 1), ("9,0;PU0,0;PD", 2), ("9,0;PU;SP2;PD", 2)] {
        assert_eq!(time_and_lowerings(&format!("{text};PU;")).1, lowerings, "{text}");
    }
}

#[test]
fn hp_gl_begins_where_a_jog_or_a_job_has_ended() {
    for begin in ["IN;", "\x1B.(", "$hpgl\n", "\x1B.(IN;"] {
        let mut bench = Bench::small();
        bench.say("$J=G90 X100 Y0 F1200\n");
        bench.work(200);
        bench.board.receive(format!("{begin}OA;").as_bytes());
        bench.work(20);
        assert!(!bench.heard().contains('\r'), "the jog still runs");
        bench.board.receive(b"\x85");
        bench.work(2000);
        let steps = bench.plotter.machine().position().x;
        assert!((1..1000).contains(&steps), "{steps}");
        let units = f64::from(steps) / 2.0;
        let heard = bench.heard();
        let [x, ..] = heard.split(',').collect::<Vec<_>>()[..] else { panic!("{heard}") };
        assert!((x.parse::<f64>().expect("a number") - units).abs() <= 0.5, "{heard} {units}");
        bench.board.receive(b"PR;PD400,0;PU;");
        bench.work(4000);
        assert_eq!(bench.plotter.machine().position().x, steps + 800, "{begin}");
    }
}

#[test]
fn control_x_and_a_dollar_line_end_it() {
    let mut bench = Bench::small();
    assert_eq!(bench.say("G0 X1\n"), "ok\n");
    draw(&mut bench, b"IN;PU0,0;LBWhat?! ~");
    // In a label these are letters.
    assert_eq!(bench.plotter.machine().state(), State::Idle);
    assert_eq!(bench.heard(), "");
    let heard = bench.say("\x18");
    assert!(heard.contains("Grbl 1.1h"), "{heard}");
    assert_eq!(bench.say("G90\n"), "ok\n");
    assert!(bench.say("?").starts_with("<Idle|"));
    bench.finish();
    assert_eq!(bench.say("IN;PU400,0;\n"), "");
    assert_eq!(bench.say("G90;\n"), "", "HP-GL");
    let heard = bench.say("$G\nG21\n");
    assert!(heard.starts_with("[GC:") && heard.ends_with("ok\nok\n"), "{heard}");
    assert_eq!(bench.say("$hpgl\n"), "ok\n");
    assert_eq!(bench.say("PU0,0;OE;"), "0\r");
    // What was sent before is drawn before the line is carried out.
    bench.board.trace().take_changes();
    bench.board.receive(b"PU0,0;PD4000,0;\n$G\nG0 X200\n");
    bench.work(15_000);
    let heard = bench.heard();
    assert!(heard.starts_with("[GC:") && heard.ends_with("ok\nok\n"), "{heard}");
    let [[left, bottom], [right, top]] = units(&bench);
    assert_eq!([right - left, top - bottom], [4000, 0]);
    assert_eq!(bench.plotter.machine().position().x, 200 * 80);
}

#[test]
fn hp_gl_may_begin_behind_the_end_of_an_instruction_and_end_behind_the_name_of_one() {
    let mut bench = Bench::small();
    assert_eq!(bench.say(";INTRO\n;in;\n"), "ok\nok\n");
    let heard = draw(&mut bench, b";IN;SP1;PU100,100;PD200,100;PU200,300;PD\n");
    assert_eq!(heard, "");
    assert_eq!(units(&bench), [[100, 100], [200, 100]]);
    // The dot is made as soon as nothing more can come.
    assert!(draw(&mut bench, b"$G\n").starts_with("[GC:"));
    assert_eq!(units(&bench), [[100, 100], [200, 300]]);
}

#[test]
fn bytes_of_a_label_that_would_act_elsewhere_are_letters() {
    let label = |bytes: &[u8]| {
        let mut bench = Bench::small();
        let text = [b"IN;PU400,400;LB", bytes, b"\x03OC;OE;"].concat();
        let heard = draw(&mut bench, &text);
        (heard, inked(&bench))
    };
    let (heard, ink) = label(b"\xA1a\xA0b");
    assert_eq!((heard, ink), label("¡a\u{A0}b".as_bytes()));
    // 0x84 would hold and 0x91 would change the speed. Each is a box, as letters that are unknown.
    assert_eq!(label(b"\x84\x91"), label("\u{4E2D}\u{4E2D}".as_bytes()));
}

#[test]
fn the_other_port_watches_and_cannot_interrupt() {
    let mut bench = Bench::small();
    bench.board.receive_by(1, b"$I\n");
    bench.work(1);
    bench.heard();
    let zigzag: String = (0..80).map(|index| format!("PD{},{};", index % 2 * 400, index)).collect();
    bench.board.receive(format!("IN;PU0,0;{zigzag}").as_bytes());
    bench.work(100);
    bench.board.receive_by(1, b"?G0 X1\n");
    bench.work(2);
    let heard = bench.heard();
    assert!(heard.starts_with("<Run|"), "{heard}");
    assert!(heard.ends_with("error:8\n"), "{heard}");
    bench.board.receive(b"OI;");
    bench.work(60_000);
    assert_eq!(bench.heard(), "7475A\r");
    assert_eq!(units(&bench), [[0, 0], [400, 79]]);
    bench.board.receive_by(1, b"G90\nIN;PD0,0;");
    bench.work(5);
    assert!(bench.heard().starts_with("ok\n[MSG:HP-GL comes by the other port"));
}

#[test]
fn damaged_bytes_leave_a_part_out_and_ink_nothing_else() {
    let bytes = inkscape();
    let whole = plan(&bytes).expect("a valid file");
    for damaged in (18..bytes.len() - 10).step_by(7) {
        let mut bench = Bench::small();
        let mut spoilt = bytes.clone();
        spoilt[damaged] = 0xFF;
        spoilt.extend_from_slice(b"\x1B.E");
        let heard = draw(&mut bench, &spoilt);
        assert_eq!(heard, "15\r", "byte {damaged}");
        let beside = penup_host_tests::ink::farthest(&inked(&bench), &whole);
        assert!(beside <= 1.0, "byte {damaged}: ink {beside} steps beside");
    }
}

#[test]
fn a_label_is_drawn_with_the_letters_that_the_line_would_otherwise_obey() {
    let mut bench = Bench::small();
    let heard = draw(&mut bench, b"IN;SI1,1.4;PU400,400;LB?!~$\x03PU0,0;OE;");
    assert_eq!(heard, "0\r");
    let ink = inked(&bench);
    // Four letters of 1 cm, half a centimetre apart.
    for letter in 0..4 {
        let left = 800.0 + f64::from(letter) * 1200.0;
        let count = ink.iter().filter(|[x, _]| (left..left + 800.0).contains(x)).count();
        assert!(count > 100, "letter {letter}: {count}");
    }
    assert!(ink.iter().all(|[x, y]| (700.0..5700.0).contains(x) && (500.0..2200.0).contains(y)));
}

#[test]
fn nothing_leaves_the_travel() {
    let mut bench = Bench::small();
    bench.say("$130=100\n$131=50\n");
    let text = b"IN;PU-500,-500;PD9000,900;CI3000;PA-9000,3000;PU8000000,0;PD0,0;RO90;PD5000,100;\
        LBoutside\x03EA-4000,9000;IW-10,-10,20000,200;EW9000,0,359;PU100,100;OH;OE;";
    let heard = draw(&mut bench, text);
    assert_eq!(heard, "0,0,2000,4000\r0\r");
    let ink = inked(&bench);
    assert!(ink.len() > 1000);
    let position = bench.plotter.machine().position();
    assert_eq!((position.x, position.y), (8000 - 200, 200));
    assert!(ink.iter().all(|[x, y]| (0.0..=8000.0).contains(x) && (0.0..=4000.0).contains(y)));
}

#[test]
fn a_polygon_that_does_not_fit_is_an_error_and_is_not_drawn() {
    let polygon = |points: usize| {
        let mut text = String::from("IN;SP1;PU100,100;PM0;PD");
        for point in 1..points {
            text +=
                &format!("{}{},{}", if point > 1 { "," } else { "" }, 100 + point, point % 2 * 100);
        }
        text + ";PM2;FP;EP;OE;"
    };
    // The last place is that of the point that closes it.
    for (points, error, inks) in [(255, "0", true), (256, "7", false), (5000, "7", false)] {
        let mut bench = Bench::small();
        let heard = draw(&mut bench, polygon(points).as_bytes());
        assert_eq!(heard.trim(), error, "{points}");
        assert_eq!(inked(&bench).is_empty(), !inks, "{points}");
    }
}

#[test]
fn a_fill_of_a_circle_covers_it_and_nothing_else() {
    for (style, spacing) in [("PT1", 40.0), ("FT2;PT0.5", 20.0), ("FT3,30,30", 30.0)] {
        let mut bench = Bench::small();
        let text = format!("IN;SP1;{style};PU2000,2000;PM0;CI400,6;PM1;CI200,6;PM2;FP;");
        draw(&mut bench, text.as_bytes());
        // A chord of 6 degrees lies less than a unit within the circle.
        let centre = [4000.0, 4000.0];
        let off = |[x, y]: [f64; 2]| (x - centre[0]).hypot(y - centre[1]) / 2.0;
        let ink = inked(&bench);
        for point in &ink {
            assert!((198.5..=401.0).contains(&off(*point)), "{style}: {point:?}");
        }
        // No point of the ring is farther from the ink than half the distance of the lines.
        let mut random = 1u32;
        for _ in 0..500 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let angle = f64::from(random >> 16) / 65536.0 * std::f64::consts::TAU;
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let radius = 2.0 * (230.0 + f64::from(random >> 16) / 65536.0 * 140.0);
            let [x, y] = [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()];
            let near =
                ink.iter().map(|[ix, iy]| (ix - x).hypot(iy - y)).fold(f64::INFINITY, f64::min);
            assert!(near / 2.0 <= spacing / 2.0 + 1.0, "{style}: {near} at {x} {y}");
        }
    }
}
