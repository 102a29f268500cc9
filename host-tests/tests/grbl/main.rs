//! What the plotter answers to the lines of Grbl 1.1: `lines.txt` lists them with what Grbl answers
//! in each state.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::boards::host::Change;
use penup::machine::{Contacts, State};
use penup::plotter::Board;
use penup_host_tests::grbl_lines::{Row, agrees, rows};
use penup_host_tests::ink;
use penup_host_tests::whole_jobs::Bench;

/// A plotter in one of the states of the list.
fn bench_in(state: &str) -> Bench {
    let mut bench = Bench::small();
    let (bytes, milliseconds): (&[u8], _) = match state {
        "idle" => (b"", 0),
        "run" => (b"M3 S0\nM5\nG1 X300 F600\n", 700),
        "hold" => (b"G1 X300 F600\n", 500),
        "jog" => (b"$J=X100 F600\n", 500),
        "check" => (b"$C\n", 1),
        "alarm" => (b"\xFD", 1),
        "sleep" => (b"$SLP\n", 50),
        _ => panic!("no state {state}"),
    };
    bench.board.receive(bytes);
    bench.work(milliseconds);
    if state == "hold" {
        bench.board.receive(b"!");
        bench.work(1500);
    }
    bench.heard();
    bench
}

/// What the plotter answers to the bytes, in which `⏎` ends a line, `\xHH` is a byte, `\p` is a
/// pause of some milliseconds and `\w` one of a second and a half.
fn answer(state: &str, sent: &str) -> String {
    let mut bench = bench_in(state);
    let (mut rest, mut heard, mut lines) = (sent, String::new(), 0);
    while let Some(letter) = rest.chars().next() {
        rest = &rest[letter.len_utf8()..];
        match letter {
            '⏎' => {
                lines += 1;
                bench.board.receive(b"\n");
            }
            '\\' if rest.starts_with('x') => {
                let byte = u8::from_str_radix(&rest[1..3], 16).expect("a byte");
                bench.board.receive(&[byte]);
                rest = &rest[3..];
            }
            '\\' => {
                bench.work(if rest.starts_with('p') { 3 } else { 1500 });
                rest = &rest[1..];
            }
            letter => bench.board.receive(letter.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    // An arc or a dwell is answered when it is done.
    for _ in 0..200 {
        bench.work(25);
        heard += &bench.heard();
        let answers =
            heard.lines().filter(|line| *line == "ok" || line.starts_with("error:")).count();
        if answers >= lines {
            break;
        }
    }
    heard
}

/// The time that homing takes, in milliseconds, with the settings. While the machine homes, its
/// switches lie 5 mm from where it begins.
fn homing_time(settings: &str) -> u32 {
    let mut bench = Bench::small();
    bench.say("$22=1\n$130=60\n$131=60\n$J=X30 Y20 F6000\n");
    bench.finish();
    bench.say(settings);
    bench.heard();
    bench.board.receive(b"$H\n");
    for milliseconds in 0..60_000 {
        while bench.plotter.poll(&mut bench.board) {}
        let pins = bench.plotter.machine().position();
        let home = bench.plotter.machine().state() == State::Home;
        let contacts = Contacts { x: home && pins.x <= 400, y: home && pins.y <= 400, stop: false };
        bench.board.set_contacts(contacts);
        bench.board.wait();
        if bench.heard().contains("ok") {
            return milliseconds;
        }
    }
    panic!("homing does not end");
}

/// Where the machine is after homing with `$23=MASK`, and how far its pins have moved from where it
/// began. Its switches lie 5 mm away.
fn homed(mask: u8) -> (String, [i32; 2]) {
    let mut bench = Bench::small();
    bench.say("$22=1\n$130=60\n$131=50\n$J=X30 Y20 F6000\n");
    bench.finish();
    bench.say(&format!("$23={mask}\n"));
    let (_, began) = ink::inked(&bench);
    bench.heard();
    bench.board.receive(b"$H\n");
    for _ in 0..60_000 {
        while bench.plotter.poll(&mut bench.board) {}
        let (_, at) = ink::inked(&bench);
        let is_pressed = |axis: usize| {
            let way = at[axis] - began[axis];
            if mask & 1 << axis != 0 { way <= -400 } else { way >= 400 }
        };
        bench.board.set_contacts(Contacts { x: is_pressed(0), y: is_pressed(1), stop: false });
        for _ in 0..5 {
            bench.board.wait();
            while bench.plotter.poll(&mut bench.board) {}
        }
        if bench.heard().contains("ok") {
            let status = bench.say("?");
            let place = status.split("MPos:").nth(1).and_then(|rest| rest.split(",0.000|").next());
            let (_, at) = ink::inked(&bench);
            return (place.expect("a place").to_owned(), [at[0] - began[0], at[1] - began[1]]);
        }
    }
    panic!("homing does not end");
}

#[test]
fn homing_seeks_the_corner_that_the_mask_says() {
    for (mask, place, [x, y]) in [
        (3, "0.000,0.000", [-1, -1]),
        (2, "60.000,0.000", [1, -1]),
        (1, "0.000,50.000", [-1, 1]),
        (0, "60.000,50.000", [1, 1]),
    ] {
        let (found, moved) = homed(mask);
        assert_eq!(found, place, "{mask}");
        // 5 mm to the switch, and 2 mm back.
        for (moved, sign) in moved.into_iter().zip([x, y]) {
            assert!((moved * sign - 240).abs() < 20, "{mask}: {moved}");
        }
    }
}

#[test]
fn the_drivers_are_switched_off_when_the_machine_has_stood_for_a_while() {
    let drivers = |bench: &Bench| {
        let enables =
            bench.board.trace().changes().into_iter().filter_map(|stamped| match stamped.change {
                Change::Enable(on) => Some((stamped.time / 25_000, on)),
                _ => None,
            });
        enables.collect::<Vec<_>>()
    };
    let mut bench = Bench::small();
    bench.say("$1=100\n");
    bench.work(500);
    assert_eq!(drivers(&bench), [], "they are off at first");
    bench.say("G0 X10\n");
    bench.finish();
    let end = bench.board.trace().now() / 25_000;
    bench.work(500);
    let changes = drivers(&bench);
    let [(_, true), (off, false)] = changes[..] else { panic!("{changes:?}") };
    assert!((95..=115).contains(&(off - end)), "{off} {end}");
    // They are on again with the next move, and the position is the same.
    bench.say("G0 X20\n");
    bench.finish();
    assert_eq!(drivers(&bench).len(), 3);
    assert!(bench.say("?").starts_with("<Idle|MPos:20.000,0.000,"));
    // 255 keeps them on.
    bench.say("$1=255\nG0 X30\n");
    bench.work(5000);
    let changes = drivers(&bench);
    assert!(changes.last().is_some_and(|(_, on)| *on), "{changes:?}");
}

#[test]
fn the_pins_of_the_drivers_are_inverted_as_the_settings_say() {
    let mut bench = Bench::small();
    for (line, expected) in
        [("", (0, false)), ("$2=5\n", (5, false)), ("$4=1\n", (5, true)), ("$2=0\n", (0, true))]
    {
        bench.say(line);
        assert_eq!(bench.board.inverted_pins(), expected, "{line}");
    }
    assert!(bench.say("$2=8\n").contains("invert step pulses goes from 0 to 7"));
    bench.say("$RST=$\n");
    assert_eq!(bench.board.inverted_pins(), (0, false));
}

#[test]
fn homing_pauses_after_each_of_its_moves() {
    let plain = homing_time("$26=0\n");
    for milliseconds in [100, 1000] {
        let paused = homing_time(&format!("$26={milliseconds}\n"));
        // Each axis seeks its switch, leaves it, approaches it again and pulls off.
        let all = 8 * milliseconds;
        assert!((all..all + 40).contains(&(paused - plain)), "{plain} and {paused} ms");
    }
}

#[test]
fn the_origin_of_the_coordinates_moves_what_is_drawn() {
    let mut bench = Bench::small();
    // 20 mm by G54, 5 mm more by G92; then from there, by the machine's own coordinates, and back.
    for (lines, position) in [
        ("G10 L2 P1 X20 Y10\nG0 X1 Y1\n", "21.000,11.000"),
        ("G92 X6\nG0 X7\n", "22.000,11.000"),
        ("G53 G0 X3 Y3\n", "3.000,3.000"),
        ("G92.1\nG0 X0 Y0\n", "20.000,10.000"),
        ("G55\nG0 X1 Y1\n", "1.000,1.000"),
        ("G10 L20 P0 X0 Y0\nG91\nG0 X2\nG90\nG0 Y3\n", "3.000,4.000"),
        ("G28.1\nG0 X9 Y9\nG28 X5\n", "3.000,10.000"),
        ("G28\n", "3.000,4.000"),
        ("G30.1\nG0 X5 Y5\nG30\n", "3.000,4.000"),
        ("$J=G53 X8 Y8 F1000\n", "8.000,8.000"),
        ("G54\n$J=X1 Y1 F1000\n", "21.000,11.000"),
        ("G20\nG0 X1 Y1\n", "45.400,35.400"),
    ] {
        bench.board.receive(lines.as_bytes());
        for _ in 0..20 {
            bench.finish();
        }
        assert!(!bench.heard().contains("error"), "{lines}");
        let status = bench.say("?");
        assert!(status.contains(&format!("MPos:{position},")), "{lines}: {status}");
    }
}

#[test]
fn the_override_of_rapid_moves_slows_those_with_the_pen_up_only() {
    let time = |bytes: &[u8], line: &str| {
        let mut bench = Bench::small();
        bench.board.receive(bytes);
        bench.say(line);
        bench.finish();
        bench.board.trace().now()
    };
    assert!(time(&[0x97], "G0 X200\n") > 3 * time(&[], "G0 X200\n"));
    assert_eq!(time(&[0x97], "M3\nG1 X100\n"), time(&[], "M3\nG1 X100\n"));
}

#[test]
fn a_feed_above_the_greatest_speed_is_that_speed() {
    let time = |feed: u32| {
        let mut bench = Bench::small();
        assert_eq!(bench.say(&format!("G1 X100 F{feed}\n")), "ok\n");
        bench.finish();
        bench.board.trace().now()
    };
    assert_eq!(time(100_000), time(6000));
    assert!(time(6000) < time(3000));
}

#[test]
fn a_comment_may_be_long_and_a_command_may_not() {
    let mut bench = Bench::small();
    let long = |letter: &str| letter.repeat(300);
    assert_eq!(bench.say(&format!("G0 X1 ({})\n", long("a"))), "ok\n");
    assert_eq!(bench.say(&format!("G0 X2 ;{}\n", long("ä"))), "ok\n");
    bench.finish();
    assert!(bench.say("?").starts_with("<Idle|MPos:2.000,"));
    for line in [format!("G0 X{}", long("1")), long("#_"), long("G0")] {
        assert!(bench.say(&format!("{line}\n")).contains("error:11\n"), "{line}");
    }
    assert!(bench.say("?").starts_with("<Idle|MPos:2.000,"));
    assert_eq!(bench.say("G0 X1\n"), "ok\n");
}

#[test]
fn letters_of_utf_8_are_no_orders() {
    let mut bench = Bench::small();
    assert_eq!(bench.say("# Å Д °±\n(Ä)\n"), "ok\nok\n");
    assert!(bench.say("?").starts_with("<Idle|"));
}

#[test]
fn lines_are_answered_as_grbl_does() {
    let (mut all, mut like_grbl, mut faults) = (0, 0, String::new());
    for Row { state, sent, grbl, penup } in rows() {
        let heard = answer(state, sent);
        all += 1;
        like_grbl += usize::from(agrees(&heard, grbl));
        if !agrees(&heard, penup.unwrap_or(grbl)) {
            faults += &format!("{state} | {sent} | {}\n", penup.unwrap_or(grbl));
            faults += &format!("    answered {}\n", heard.replace('\n', "⏎"));
        }
    }
    println!("{like_grbl} of {all} lines are answered as Grbl does");
    assert!(faults.is_empty(), "{like_grbl} of {all} are answered as Grbl does:\n{faults}");
}
