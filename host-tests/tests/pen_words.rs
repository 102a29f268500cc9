//! What lowers the pen in G-code, across pauses of the sender, alarms, jogs and lines that are
//! refused: judged by the ink that the pins leave.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup_host_tests::ink;
use penup_host_tests::whole_jobs::Bench;

/// The steps in a millimetre.
const STEPS: f64 = 80.0;

fn bench() -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    bench
}

/// The length in mm that is inked. Where the pen was up between two points, they lie further apart
/// than a step.
fn inked(bench: &Bench) -> f64 {
    let (points, _) = ink::inked(bench);
    let lengths = points.windows(2).map(|ends| match ends {
        [[ax, ay], [bx, by]] => f64::from(bx - ax).hypot(f64::from(by - ay)),
        _ => 0.0,
    });
    lengths.filter(|length| *length < 1.5).sum::<f64>() / STEPS
}

/// The dots and strokes that the pen has left.
fn strokes(bench: &Bench) -> u32 {
    use penup::boards::host::Change;
    let changes = bench.board.trace().changes();
    let lowered =
        changes.iter().filter(|it| matches!(it.change, Change::Pen(height) if height > 0));
    lowered.count() as u32
}

/// Sends lines; `pause` stands for three seconds in which nothing is sent, `wait` for the end of
/// all moves, and `alarm` for the byte of the emergency stop.
fn send(bench: &mut Bench, lines: &[&str]) -> String {
    let mut heard = String::new();
    for line in lines {
        match *line {
            "pause" => bench.work(3000),
            "wait" => bench.finish(),
            "alarm" => {
                bench.board.receive(b"\xFD");
                bench.work(50);
            }
            line => {
                bench.board.receive(format!("{line}\n").as_bytes());
                bench.work(20);
            }
        }
        heard += &bench.heard();
    }
    bench.finish();
    heard + &bench.heard()
}

/// A pen that an alarm or sleep has raised stays up until the program puts it down.
#[test]
fn an_alarm_and_sleep_end_what_lowered_the_pen() {
    let on = ["G0 X50 Y50", "M3", "G1 X60 F3000", "wait"];
    let by_height = ["G0 Z5", "G0 X50 Y50", "G1 Z-1", "G1 X60 F3000", "wait"];
    for begin in [&on[..], &by_height] {
        for end in [&["G1 X999", "wait", "$X"][..], &["alarm", "$X"], &["pause", "$SLP", "$X"]] {
            let mut bench = bench();
            let rest = ["G21 G90", "G0 X10 Y10", "G1 X30 F3000"];
            let heard = send(&mut bench, &[begin, end, &rest].concat());
            assert!((inked(&bench) - 10.0).abs() < 0.1, "{end:?}: {} {heard}", inked(&bench));
            // It draws on where the program puts the pen down.
            let down = if begin == on { "M3" } else { "G1 Z-1" };
            send(&mut bench, &[down, "G1 X40"]);
            assert!((inked(&bench) - 20.0).abs() < 0.1, "{end:?}: {}", inked(&bench));
        }
    }
}

/// A sender that stalls for some seconds changes nothing.
#[test]
fn a_pause_of_the_sender_does_not_lower_the_pen() {
    for (setting, lines, length) in [
        ("$206=1", &["M3 S0", "G0 X5 Y5", "pause", "G0 X50", "G1 X70 F3000"][..], 0.0),
        ("$206=0", &["M3 S0", "G1 X30 F3000", "pause", "G1 X40 S0", "X60 S0", "X70"], 0.0),
        ("$206=0", &["M3 S0", "G1 X30 F3000", "pause", "G1 X40 S0", "X60 S90", "X70 S0"], 20.0),
        ("$206=0", &["G1 Z5 F3000", "G1 X9", "pause", "G1 X30", "X40", "X60"], 0.0),
        ("$206=0", &["G1 Z5 F3000", "pause", "G1 X30", "Z-1", "pause", "X40", "Z5", "X60"], 10.0),
        ("$206=0", &["M3", "G1 X10 F3000", "M5", "pause", "G1 X30", "X40", "M3", "X60"], 30.0),
        ("$206=0", &["G21", "G1 X9 F3000", "X30", "pause", "X40", "X60"], 60.0),
        ("$206=0", &["G21", "G1 X9 F3000", "X30", "pause", "G0 X40", "G1 X60"], 50.0),
        // Behind M2 or the mark of an end the next program may move its pen in another way.
        ("$206=0", &["G1 Z5 F3000", "G1 X9", "M2", "pause", "M3", "G1 X30"], 21.0),
        ("$206=0", &["G1 Z5 F3000", "G1 X9", "%", "pause", "M3", "G1 X30"], 21.0),
        ("$206=0", &["G21", "G1 X9 F3000", "X30", "M2", "pause", "X40", "X60"], 50.0),
    ] {
        let mut bench = bench();
        let heard = send(&mut bench, &[&[setting], lines].concat());
        assert!((inked(&bench) - length).abs() < 0.1, "{lines:?}: {} {heard}", inked(&bench));
    }
}

/// M3 and M5 without a move between them draw a dot only where the pen would be down.
#[test]
fn a_dot_is_drawn_only_where_the_pen_would_be_down() {
    for (settings, lines, dots) in [
        (&[][..], &["M3", "G4 P0.1", "M5"][..], 1),
        (&[], &["M3 S90", "G4 P0.1", "M5"], 1),
        (&[], &["M3 S90", "M5 S0"], 1),
        (&[], &["M3 S0", "M5"], 0),
        (&["$206=1"], &["M3 S0", "M5"], 0),
        (&["$206=1"], &["M3", "G4 P0.1", "M5"], 1),
        (&["$206=2"], &["M3 S1000", "M5"], 0),
        (&["$206=3", "$216=60"], &["M3 S30", "G4 P0.1", "M5"], 0),
        (&["$206=3", "$216=60"], &["M3 S90", "G4 P0.1", "M5"], 1),
        (&["$32=1"], &["M3 S0", "M5"], 0),
    ] {
        let mut bench = bench();
        let heard = send(&mut bench, &[settings, &["G0 X60 Y10"], lines, &["G0 X5"]].concat());
        assert_eq!(strokes(&bench), dots, "{settings:?} {lines:?}: {heard}");
    }
}

/// Whoever jogs along Z lifts the pen.
#[test]
fn a_jog_along_z_lifts_a_pen_that_z_moves() {
    let mut bench = bench();
    let lines = ["G1 Z0 F3000", "pause", "$J=G91 Z5 F500", "wait", "G0 X10 Y10", "G1 Z0", "G1 X20"];
    send(&mut bench, &lines);
    send(&mut bench, &["G0 Z5", "G0 X30"]);
    assert!((inked(&bench) - 10.0).abs() < 0.1, "{}", inked(&bench));
}

/// A line that is refused leaves nothing behind, and F of G93 is no speed behind M2.
#[test]
fn a_refused_line_and_an_ended_program_leave_no_mode_behind() {
    let mut bench = bench();
    send(&mut bench, &["$20=0", "G0 X-5 Y-5", "wait"]);
    let before = send(&mut bench, &["$G"]);
    let refused = send(&mut bench, &["G91 G20 F10 S7 T3 G28.1"]);
    assert!(refused.contains("error:"), "{refused}");
    assert_eq!(send(&mut bench, &["$G"]), before);
    let heard = send(&mut bench, &["G93", "G1 X10 F60", "M2", "G1 X20", "wait"]);
    assert!(!heard.contains("error"), "{heard}");
    let heard = send(&mut bench, &["G93", "G1 X10 F60 M2", "$G"]);
    assert!(heard.contains(" F0 "), "{heard}");
}

/// How far, in steps, the ink is from the circle of this radius through two points, at most. The
/// centre lies below the line between them. Lengths are in steps.
fn farthest_from_arc(bench: &Bench, [from, to]: [[f64; 2]; 2], radius: f64) -> f64 {
    let (points, end) = ink::inked(bench);
    assert_eq!(end.map(f64::from), to);
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let chord = dx.hypot(dy);
    let height = (radius * radius - chord * chord / 4.0).sqrt();
    let center = [
        f64::midpoint(from[0], to[0]) + height * dy / chord,
        f64::midpoint(from[1], to[1]) - height * dx / chord,
    ];
    let off = |[x, y]: &[i32; 2]| {
        ((f64::from(*x) - center[0]).hypot(f64::from(*y) - center[1]) - radius).abs()
    };
    points.iter().map(off).fold(0.0, f64::max)
}

/// The centres of nearly straight arcs lie far beyond every page.
#[test]
fn wide_arcs_are_drawn_as_they_are() {
    for (arc, to, radius) in [
        ("G2 X40 Y10 R5000", [40.0, 10.0], 5000.0),
        ("G2 X30 Y20 R5000", [30.0, 20.0], 5000.0),
        ("G2 X40 Y10 I20 J-4000", [40.0, 10.0], 4000.05),
        ("G2 X2 Y10 R30000", [2.0, 10.0], 30_000.0),
        ("G2 X2 Y10.5 R30000", [2.0, 10.5], 30_000.0),
    ] {
        let mut bench = bench();
        let lines = ["$100=800", "$101=800", "$202=30", "$201=30", "G0 X0 Y10", "M3", arc];
        let heard = send(&mut bench, &lines);
        assert!(!heard.contains("error"), "{arc}: {heard}");
        let off =
            farthest_from_arc(&bench, [[0.0, 8000.0], to.map(|it| it * 800.0)], radius * 800.0);
        assert!(off < 0.75, "{arc}: {off}");
    }
    // What is too wide and not straight is refused.
    let mut bench = bench();
    let lines = ["$100=800", "$101=800", "$202=30", "$201=30", "G0 X0 Y10", "G2 X100 Y10 R30000"];
    assert!(send(&mut bench, &lines).contains("error:33"));
}

/// Programs of few decimals end an arc a little off its circle. Grbl takes a thousandth.
#[test]
fn an_arc_that_ends_a_little_off_its_circle_is_drawn() {
    for (arc, is_taken) in [("G2 X40 Y40.01 I20 J0", true), ("G2 X40 Y40.1 I20 J0", false)] {
        let mut bench = bench();
        let lines = ["$100=400", "$101=400", "$202=30", "$201=30", "G0 X20 Y20", "M3", arc];
        let heard = send(&mut bench, &lines);
        assert_eq!(heard.contains("error:33"), !is_taken, "{arc}: {heard}");
        let (points, end) = ink::inked(&bench);
        if is_taken {
            assert_eq!(end, [16_000, 16_004]);
            let off = |[x, y]: &[i32; 2]| {
                (f64::from(x - 16_000).hypot(f64::from(y - 8000)) - 8000.0).abs()
            };
            assert!(points.iter().all(|point| off(point) < 5.0), "{arc}");
        }
    }
}
