//! What real-time bytes and commands do in the states in which they were once lost: between the
//! moves of a program, in a dwell, in homing, and in sleep.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::boards::host::{Change, LAYOUT};
use penup::machine::{Alarm, Contacts, Setting, State};
use penup::plotter::{Board as _, FlashRecords, Record};
use penup_host_tests::cut_jobs::{Powered, empty_flash, switch_on};
use penup_host_tests::whole_jobs::Bench;

/// Sends bytes, and returns what comes back within some milliseconds. Lines may wait meanwhile.
fn send(bench: &mut Bench, bytes: &[u8]) -> String {
    bench.heard();
    bench.board.receive(bytes);
    bench.work(5);
    bench.heard()
}

/// The state and the machine's coordinates that the status report tells.
fn status(bench: &mut Bench) -> String {
    let report = send(bench, b"?");
    report.split('|').take(2).collect::<Vec<_>>().join("|")
}

/// The heights to which the pen was sent.
fn heights(bench: &Bench) -> Vec<u8> {
    let changes = bench.board.trace().changes().into_iter();
    let height = |change| if let Change::Pen(height) = change { Some(height) } else { None };
    changes.filter_map(|stamped| height(stamped.change)).collect()
}

#[test]
fn a_hold_and_a_pause_act_in_a_dwell() {
    for byte in [b'!', 0x84, 0xFB] {
        let mut bench = Bench::small();
        bench.board.receive(b"G0 X1\nG4 P3\nG0 X5\n");
        bench.work(1000);
        bench.board.receive(&[byte]);
        bench.work(10_000);
        assert_eq!(status(&mut bench), "<Hold:0|MPos:1.000,0.000,0.000", "{byte:#x}");
        let resumed = bench.board.trace().now();
        send(&mut bench, b"~");
        bench.finish();
        assert_eq!(status(&mut bench), "<Idle|MPos:5.000,0.000,0.000", "{byte:#x}");
        // The rest of the dwell passes after that.
        let seconds = (bench.board.trace().now() - resumed) as f64 / 25e6;
        assert!((1.0..3.0).contains(&seconds), "{byte:#x}: {seconds} s");
    }
}

#[test]
fn a_hold_and_a_pause_act_between_two_lines_of_a_program() {
    for byte in [b'!', 0xFB] {
        let mut bench = Bench::small();
        bench.say("M3\nG1 X1\n");
        bench.finish();
        assert_eq!(bench.plotter.machine().state(), State::Idle);
        send(&mut bench, &[byte]);
        send(&mut bench, b"G1 X5\n");
        bench.work(5000);
        assert_eq!(status(&mut bench), "<Hold:0|MPos:1.000,0.000,0.000", "{byte:#x}");
        bench.say("~");
        bench.finish();
        assert_eq!(status(&mut bench), "<Idle|MPos:5.000,0.000,0.000", "{byte:#x}");
    }
    // Nothing is held where no program runs.
    for text in ["", "G0 X1\nM2\n"] {
        let mut bench = Bench::small();
        bench.say(text);
        bench.finish();
        bench.board.receive(b"!\xFB");
        bench.work(10);
        assert_eq!(bench.plotter.machine().state(), State::Idle, "{text}");
    }
}

#[test]
fn a_pause_that_comes_on_a_travel_is_not_lost_where_the_lines_come_late() {
    let mut bench = Bench::small();
    bench.say("G0 X10\n");
    bench.work(100);
    bench.board.receive(&[0xFB]);
    bench.work(1000);
    assert_eq!(status(&mut bench), "<Hold:0|MPos:10.000,0.000,0.000");
    bench.say("M3\nG1 X20\nM5\n~");
    bench.finish();
    assert_eq!(status(&mut bench), "<Idle|MPos:20.000,0.000,0.000");
}

#[test]
fn the_ink_before_a_pause_is_counted_across_dwells_and_late_lines() {
    // What comes between two strokes, and how long they take to come.
    for (between, late) in [("", 0), ("G4 P0.1\n", 0), ("", 1500), ("G4 P0.1\n", 1500)] {
        let mut bench = Bench::small();
        bench.say("$215=0.025\n");
        let mut stops = Vec::new();
        for stroke in 1..=8 {
            // Strokes of 10 mm.
            let x = 10 * (stroke % 2);
            bench.board.receive(format!("M3\nG1 X{x}\n").as_bytes());
            bench.work(late);
            bench.board.receive(format!("M5\n{between}G0 Y{stroke}\n").as_bytes());
            bench.work(1500);
            if let State::Hold { .. } = bench.plotter.machine().state() {
                stops.push(stroke);
                send(&mut bench, b"~");
            }
            bench.finish();
        }
        assert_eq!(stops, [3, 6], "{between:?}, {late} ms");
    }
}

#[test]
fn a_second_m3_lowers_a_pen_that_was_raised_by_itself() {
    let mut bench = Bench::small();
    for line in ["M3\n", "M3\n", "M3 S500\n"] {
        bench.say(line);
        // The program ends by idleness.
        bench.work(3000);
    }
    assert_eq!(heights(&bench), [127, 0, 127, 0, 127, 0]);
    // By Z and by S, too.
    let mut bench = Bench::small();
    bench.say("$206=2\nG0 Z-1\n");
    bench.finish();
    bench.say("G0 Z-1\n");
    bench.finish();
    bench.say("$206=3\nM3 S90\n");
    bench.finish();
    bench.say("S90\n");
    bench.finish();
    assert_eq!(heights(&bench), [127, 0].repeat(4));
    // But it does not break a line that is being drawn, and neither F nor G92 lowers the pen.
    let mut bench = Bench::small();
    bench.say("M3\nG1 X5\nM3\nG1 X10\nM3\nG1 X15\n");
    bench.finish();
    bench.say("F1000\nG92 Z0\nG90\n");
    bench.finish();
    assert_eq!(heights(&bench), [127, 0]);
}

/// The board refuses to write its flash while a step is due.
#[test]
fn coordinate_systems_are_kept_in_check_mode_once_the_machine_stands() {
    switch_on(empty_flash(), |plotter| {
        plotter.say("$J=G91 X5 F600");
        // The check begins as soon as it may, while the last steps are still due.
        while !plotter.heard().contains("[MSG:Enabled]") {
            plotter.board.receive(b"$C\n");
            while plotter.plotter.poll(plotter.board) {}
            plotter.board.wait();
        }
        assert!(!plotter.plotter.machine().is_stopped());
        plotter.board.receive(b"G10 L2 P1 X10 Y20\n$C\n");
        for _ in 0..3000 {
            while plotter.plotter.poll(plotter.board) {}
            plotter.board.wait();
        }
        let heard = plotter.heard();
        assert!(heard.starts_with("ok\n[MSG:Disabled]"), "{heard}");
        let kept = plotter.say("$#");
        assert!(kept.contains("[G54:10.000,20.000,0.000]"), "{kept}");
    });
}

#[test]
fn coordinate_systems_that_are_set_in_check_mode_are_kept() {
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.say("$C");
        for line in ["G10 L2 P1 X10 Y20", "G1 X5 Y6", "G28.1", "G30.1"] {
            assert_eq!(plotter.say(line), "ok\n", "{line}");
        }
        plotter.say("$C");
    });
    switch_on(flash, |plotter| {
        let kept = plotter.say("$#");
        for expected in
            ["[G54:10.000,20.000,0.000]", "[G28:15.000,26.000,0", "[G30:15.000,26.000,0"]
        {
            assert!(kept.contains(expected), "{kept}");
        }
    });
}

/// Homes the machine, whose switches lie 5 mm below where it is.
fn home(plotter: &mut Powered<'_, '_>) {
    let began = plotter.plotter.machine().position();
    plotter.board.receive(b"$H\n");
    for _ in 0..60_000 {
        while plotter.plotter.poll(plotter.board) {}
        let at = plotter.plotter.machine().position();
        let [x, y] = [at.x <= began.x - 400, at.y <= began.y - 400];
        plotter.board.set_contacts(Contacts { x, y, stop: false });
        plotter.board.wait();
        if plotter.board.has_read_all() && plotter.plotter.machine().state() == State::Idle {
            break;
        }
    }
    plotter.run(1000);
}

/// A plotter that must be homed, and carries out a line at its start.
fn that_must_be_homed(work: impl FnOnce(&mut Powered<'_, '_>)) {
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.heard();
        for line in ["$N0=G20", "$22=1", "$130=60", "$131=60"] {
            assert_eq!(plotter.say(line), "ok\n", "{line}");
        }
    });
    switch_on(flash, work);
}

/// Asserts that the plotter has just asked for homing or unlocking, and moves only behind that.
fn assert_asks_for_homing(plotter: &mut Powered<'_, '_>) {
    let said = plotter.heard();
    assert!(said.contains("'$H'|'$X' to unlock") && said.ends_with("ALARM:11\n"), "{said}");
    assert_eq!(plotter.plotter.machine().state(), State::Alarm(Alarm::NotHomed));
    assert!(plotter.say("G0 X1").ends_with("error:9\n"));
}

#[test]
fn homing_that_is_given_up_leaves_the_alarm_in_which_it_began() {
    that_must_be_homed(|plotter| {
        assert!(plotter.heard().ends_with("[MSG:'$H'|'$X' to unlock]\n"));
        for milliseconds in [1, 30, 500, 3000] {
            plotter.board.receive(b"$H\n");
            for _ in 0..milliseconds {
                while plotter.plotter.poll(plotter.board) {}
                plotter.board.wait();
            }
            assert_eq!(plotter.plotter.machine().state(), State::Home);
            plotter.heard();
            plotter.send("\x18");
            plotter.run(1000);
            assert_asks_for_homing(plotter);
        }
        // Homing and unlocking are still possible.
        home(plotter);
        assert_eq!(plotter.plotter.machine().state(), State::Idle);
        assert!(!plotter.status().contains("Late"), "{}", plotter.status());
    });
    that_must_be_homed(|plotter| {
        plotter.say("$X");
        // Who has unlocked it knows where the pen is.
        plotter.board.receive(b"$H\n");
        plotter.run(100);
        plotter.send("\x18");
        plotter.run(1000);
        assert_eq!(plotter.plotter.machine().state(), State::Idle);
        // Once x counts from its switch, and y from another place, nobody does.
        let began = plotter.plotter.machine().position();
        plotter.board.receive(b"$H\n");
        for _ in 0..60_000 {
            while plotter.plotter.poll(plotter.board) {}
            let at = plotter.plotter.machine().position();
            if at.y < began.y {
                break;
            }
            let x = at.x <= began.x - 400;
            plotter.board.set_contacts(Contacts { x, y: false, stop: false });
            plotter.board.wait();
        }
        plotter.heard();
        plotter.send("\x18");
        plotter.run(1000);
        assert_asks_for_homing(plotter);
    });
}

#[test]
fn startup_lines_are_carried_out_after_homing() {
    that_must_be_homed(|plotter| {
        assert!(!plotter.heard().contains(">G20"));
        home(plotter);
        assert!(plotter.heard().ends_with("\n>G20:ok\nok\n"), "they come before the answer");
        assert!(plotter.say("$G").contains(" G20 "));
    });
    that_must_be_homed(|plotter| {
        plotter.say("$X");
        assert!(plotter.say("$G").contains(" G21 "), "not after unlocking, as in Grbl");
    });
}

#[test]
fn after_sleep_a_job_that_has_stopped_does_not_know_where_the_pen_is() {
    let (_, _) = switch_on(empty_flash(), |plotter| {
        for line in ["v 0 0 0", "v 9 9 0", "v 9 0 0", "l 1 2 3", "$212=20", "$plot"] {
            assert!(plotter.say(line).ends_with("ok\n"), "{line}");
        }
        plotter.run(200);
        plotter.send("\x18");
        plotter.finish();
        assert!(plotter.status().contains("|Stopped:"));
        plotter.say("$SLP");
        plotter.run(100);
        plotter.say("$X");
        assert!(plotter.say("$resume").ends_with("error:164\n"));
        assert!(plotter.say("$resume=origin").ends_with("ok\n"));
    });
}

#[test]
fn a_reset_in_sleep_asks_for_homing_where_homing_is_on() {
    that_must_be_homed(|plotter| {
        home(plotter);
        plotter.say("$SLP");
        plotter.run(100);
        plotter.heard();
        plotter.send("\x18");
        plotter.run(100);
        assert_asks_for_homing(plotter);
        home(plotter);
        assert_eq!(plotter.plotter.machine().state(), State::Idle);
        // `$X` is the word of somebody who knows where the pen is.
        plotter.say("$SLP");
        plotter.run(100);
        plotter.say("$X");
        assert_eq!(plotter.plotter.machine().state(), State::Idle);
    });
    let mut bench = Bench::small();
    bench.say("$SLP\n");
    bench.work(100);
    send(&mut bench, b"\x18");
    assert_eq!(bench.plotter.machine().state(), State::Idle);
}

#[test]
fn a_stop_in_sleep_forgets_what_sleep_forgets() {
    for settings in ["$235=0.3", "$235=0.3\n$237=0.5", "$132=1\n$112=900\n$122=500\n$209=1"] {
        // The changes of the pins that a move back makes after sleep.
        let changes = |bytes: &[u8]| {
            let mut bench = Bench::small();
            bench.say(&format!("{settings}\nG0 X10\n"));
            bench.finish();
            bench.say("$SLP\n");
            bench.work(100);
            bench.board.receive(bytes);
            bench.work(100);
            bench.say("$X\n");
            bench.work(5);
            bench.board.trace().take_changes();
            bench.say("M3\nG1 X5\n");
            bench.finish();
            let changes = bench.board.trace().take_changes().into_iter();
            changes.map(|stamped| stamped.change).collect::<Vec<_>>()
        };
        assert_eq!(changes(b"\xFD"), changes(b""), "{settings}");
    }
}

#[test]
fn a_pen_that_is_raised_by_the_greater_height_is_raised_whatever_happens() {
    let mut bench = Bench::small();
    bench.say("$211=0\n$210=127\n");
    // The pen is still where it was: the first move raises it before it steps.
    bench.say("G0 X2\n");
    bench.finish();
    let changes = bench.board.trace().changes();
    let first = |is: fn(&Change) -> bool| changes.iter().position(|stamped| is(&stamped.change));
    let raised = first(|change| *change == Change::Pen(127)).expect("it is raised");
    let stepped = first(|change| *change == Change::StepX(true)).expect("it moves");
    assert!(raised < stepped && changes[raised].time + 3_700_000 < changes[stepped].time);
    bench.say("M3\nG1 X90\n");
    bench.work(600);
    bench.board.receive(b"\xFD");
    bench.work(20);
    assert_eq!(heights(&bench), [127, 0, 127]);
    bench.say("$X\nM3\nG1 X50\n");
    bench.work(600);
    bench.board.set_contacts(Contacts { stop: true, ..Contacts::default() });
    bench.work(20);
    assert_eq!(heights(&bench), [127, 0, 127, 0, 127]);
    // A motor has its stop above.
    bench.board.set_contacts(Contacts::default());
    let refused = bench.say("$X\n$209=1\n");
    assert!(refused.contains("set $210 below $211") && refused.ends_with("error:151\n"));
    assert!(bench.say("$210=0\n$209=1\n").ends_with("ok\nok\n"));
    assert!(bench.say("$210=1\n").ends_with("error:151\n"));
}

#[test]
fn a_kept_setting_that_is_refused_is_told_and_the_others_stay() {
    // As another version of the firmware may have kept them: -1 m of ink before a pause.
    let kept = [(130, 300), (215, -1), (100, 100), (999, 1)].map(|(number, value): (u16, i32)| {
        let [a, b] = number.to_le_bytes();
        let [c, d, e, f] = (value << 16).to_le_bytes();
        [a, b, c, d, e, f]
    });
    let mut records = FlashRecords::new(empty_flash(), LAYOUT);
    records.save(Record::Settings, &[kept.as_flattened()]).expect("it fits");
    let told = "[MSG:the kept $215=-1 is refused, so 0 holds: set it before you draw]\n";
    let (flash, _) = switch_on(records.flash, |plotter| {
        assert!(plotter.heard().ends_with(told));
        let settings = plotter.plotter.machine().settings();
        assert_eq!(
            [settings.get(Setting::TravelX), settings.get(Setting::StepsPerMmX)],
            [300, 100]
        );
        assert_eq!(settings.get(Setting::InkBeforePause), 0);
    });
    let (flash, _) = switch_on(flash, |plotter| {
        assert!(plotter.heard().ends_with(told), "at each start");
        assert_eq!(plotter.say("$215=0"), "ok\n");
    });
    switch_on(flash, |plotter| assert!(!plotter.heard().contains("$215")));
}

/// What G10, G28.1 and G30.1 set counts once the machine has stopped. A line that is broken off
/// before has set nothing.
#[test]
fn a_parameter_whose_line_is_broken_off_stays_as_it_was() {
    for line in ["G10 L20 P1 X0 Y0", "G10 L2 P2 X3", "G28.1", "G30.1"] {
        for stop in [0xFD, 0x18] {
            let mut bench = Bench::small();
            let before = bench.say("$#\n");
            bench.board.receive(format!("G1 X15 Y2 F600\n{line}\n").as_bytes());
            bench.work(300);
            send(&mut bench, &[stop]);
            bench.finish();
            bench.say("$X\n");
            assert_eq!(bench.say("$#\n"), before, "{line} {stop:#x}");
        }
        // Left alone, it sets what it says.
        let mut bench = Bench::small();
        let before = bench.say("$#\n");
        assert_eq!(bench.say(&format!("G1 X15 Y2 F600\n{line}\n")), "ok\n");
        bench.finish();
        assert_eq!(bench.heard(), "ok\n", "{line}");
        assert_ne!(bench.say("$#\n"), before, "{line}");
    }
}

/// X and Y beside a word for motors or fans are no place to go to.
#[test]
fn words_for_other_machines_move_nothing() {
    let mut bench = Bench::small();
    bench.say("G1 X10 Y10 F3000\n");
    bench.finish();
    bench.heard();
    for line in ["M84 X0 Y0", "M18 X3", "M106 S255 X4", "M400 X6", "M17 Z5"] {
        assert_eq!(bench.say(&format!("{line}\n")), "ok\n", "{line}");
        bench.finish();
        assert_eq!(status(&mut bench), "<Idle|MPos:10.000,10.000,0.000", "{line}");
    }
}

/// M0, M2, M6 and M30 come behind the move or the dot of their line.
#[test]
fn the_end_of_a_program_comes_behind_the_move_of_its_line() {
    let strokes = |bench: &mut Bench| {
        let report = send(bench, b"?");
        report.split('|').find(|field| field.starts_with("Drawn:")).unwrap_or("").to_owned()
    };
    for end in ["M2", "M30", "M0", "M6"] {
        let mut bench = Bench::small();
        bench.board.receive(format!("M3\nM5 {end}\n").as_bytes());
        bench.finish();
        send(&mut bench, b"~");
        bench.finish();
        assert_eq!(strokes(&mut bench), "Drawn:1/1", "{end}");
        bench.board.receive(format!("G0 X10 Y5 {end}\n").as_bytes());
        bench.finish();
        let is_pause = end == "M0" || end == "M6";
        let expected = if is_pause { "<Hold:0" } else { "<Idle" };
        assert_eq!(status(&mut bench), format!("{expected}|MPos:10.000,5.000,0.000"), "{end}");
    }
}

/// Nothing moves in check mode, and no coordinate stays of it.
#[test]
fn z_is_after_a_check_what_it_was_before() {
    let mut bench = Bench::small();
    bench.say("G0 X1 Z3\n");
    bench.finish();
    assert_eq!(status(&mut bench), "<Idle|MPos:1.000,0.000,3.000");
    bench.say("$C\nG1 X5 Z-5 F600\n$C\n");
    assert_eq!(status(&mut bench), "<Idle|MPos:1.000,0.000,3.000");
    bench.say("$C\nG0 Z-7\n");
    send(&mut bench, &[0x18]);
    assert_eq!(status(&mut bench), "<Idle|MPos:1.000,0.000,3.000");
    // An alarm ends the check, too.
    bench.say("$C\nG1 Z5 X5 F600\n");
    send(&mut bench, &[0xFD]);
    bench.say("$X\n");
    assert_eq!(status(&mut bench), "<Idle|MPos:1.000,0.000,3.000");
    bench.say("G91\nG0 Z1\n");
    bench.finish();
    assert_eq!(status(&mut bench), "<Idle|MPos:1.000,0.000,4.000");
}

/// What such a line counts from is where the machine stops, and not where it would have gone.
#[test]
fn a_startup_line_waits_until_the_machine_stands() {
    for moves in ["G53 G1 X100 Y50 F600\n", "v 10 10 0\nv 60 10 0\nl 1 2\n$plot\n"] {
        let mut bench = Bench::new();
        bench.heard();
        bench.say("$N0=G92X0Y0\n");
        bench.board.receive(moves.as_bytes());
        bench.work(2500);
        let mut heard = send(&mut bench, b"\x18$#\n");
        bench.finish();
        heard += &bench.heard();
        let at = |text: &str, from: &str| {
            let (_, rest) = text.split_once(from).expect(from);
            rest.split([']', '|']).next().expect("a position").to_owned()
        };
        let order = ["Grbl", ">G92X0Y0:ok", "[G92:"].map(|part| heard.find(part));
        assert!(order.is_sorted() && order[0].is_some(), "{heard}");
        let stood = at(&status(&mut bench), "MPos:");
        assert_eq!(at(&heard, "[G92:"), stood, "{heard}");
        assert!(!stood.starts_with("0.000"), "the machine has not moved");
    }
}

/// The end of the travel is within the travel, however many steps to a millimetre there are.
#[test]
fn the_end_of_the_travel_is_within_it() {
    for steps in ["80", "157.4803", "78.74", "100.0013", "2.005"] {
        let mut bench = Bench::new();
        bench.heard();
        bench.say(&format!("$100={steps}\n$101={steps}\n$130=420\n$131=297\n"));
        let answer = bench.say("G53 G0 X420 Y297\n");
        bench.finish();
        assert!(answer.ends_with("ok\n"), "{steps}: {answer}");
        bench.say("G53 G0 X0 Y0\n$240=420\n$241=297\n");
        let answer = bench.say("G28\n");
        bench.finish();
        assert!(answer.ends_with("ok\n"), "{steps}: {answer}");
        assert_eq!(bench.plotter.machine().state(), State::Idle, "{steps}");
        // A step further is beyond it.
        let beyond = 420.0 + 1.5 / steps.parse::<f64>().expect("a number");
        let answer = bench.say(&format!("G53 G0 X{beyond:.4}\n"));
        assert!(answer.contains("error:15"), "{steps}: {answer}");
    }
}

/// `$RST` would end the sleep, and a machine that must be homed would be in an alarm.
#[test]
fn nothing_is_restored_in_sleep() {
    for line in ["$RST=#", "$RST=$", "$RST=*"] {
        let mut bench = Bench::new();
        bench.say("$SLP\n");
        bench.work(10);
        let answer = send(&mut bench, format!("{line}\n").as_bytes());
        assert!(answer.ends_with("error:8\n"), "{line}: {answer}");
        assert_eq!(bench.plotter.machine().state(), State::Sleep, "{line}");
    }
}

/// Such a line would wait for the end of the job, and all lines behind it with it.
#[test]
fn what_needs_rest_is_refused_while_a_job_is_drawn() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("v 10 10 0\nv 60 10 0\nl 1 2\n$plot\n");
    bench.work(200);
    for hold in ["", "!"] {
        send(&mut bench, hold.as_bytes());
        for line in
            ["M0", "M6", "M2", "G4 P1", "G10 L20 P1 X0", "G28.1", "G91 G2 X1 Y1 R5", "G92 X7"]
        {
            let answer = send(&mut bench, format!("{line}\n").as_bytes());
            assert!(answer.ends_with("error:8\n"), "{hold}{line}: {answer}");
        }
    }
    // A line that is refused sets no mode, and shifts nothing.
    assert!(send(&mut bench, b"$G\n").contains(" G90 "));
    send(&mut bench, b"~");
    bench.finish();
    assert_eq!(status(&mut bench).split('|').next(), Some("<Idle"));
    assert!(send(&mut bench, b"$#\n").contains("[G92:0.000,0.000,0.000]"));
    let answer = bench.say("G4 P0.1\n");
    bench.finish();
    let answer = answer + &bench.heard();
    assert!(answer.ends_with("ok\n"), "{answer}");
}

#[test]
fn nothing_is_kept_while_steps_are_due() {
    for line in ["$RST=#", "$RST=$", "$RST=*", "$I=a", "$N0=G21"] {
        let mut bench = Bench::new();
        bench.heard();
        bench.board.receive(b"G0 X1\n");
        while !bench.board.has_read_all() || bench.plotter.machine().state() != State::Idle {
            bench.work(1);
        }
        assert!(!bench.plotter.machine().is_stopped(), "the steps are made already");
        bench.heard();
        bench.board.receive(format!("{line}\n").as_bytes());
        while !bench.board.has_read_all() {
            bench.plotter.poll(&mut bench.board);
        }
        let answer = bench.heard();
        assert!(answer.ends_with("error:8\n"), "{line}: {answer}");
    }
}

#[test]
fn a_program_that_is_checked_begins_where_the_pen_is() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("G0 X50 Y20\n");
    bench.finish();
    send(&mut bench, b"\x18");
    bench.say("$C\nG10 L20 P1 X0 Y0\n$C\n");
    let kept = bench.say("$#\n");
    assert!(kept.contains("[G54:50.000,20.000,0.000]"), "{kept}");
}

/// The bit may have been one of a digit.
#[test]
fn a_command_with_a_damaged_byte_is_refused() {
    let mut bench = Bench::new();
    bench.heard();
    let before = bench.say("$$\n");
    for line in [&b"$100=8\xB0\n"[..], b"$13\xB0=42\n", b"$eye=1,\xB2,3\n"] {
        let answer = send(&mut bench, line);
        assert!(answer.ends_with("error:100\n"), "{line:?}: {answer}");
    }
    // Noise before it is no part of it.
    let answer = send(&mut bench, b"\xB0\xB0$100=80\n");
    assert!(answer.ends_with("ok\n"), "{answer}");
    assert_eq!(bench.say("$$\n"), before);
}
