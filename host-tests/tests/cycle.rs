//! Whether the pen returns to where it began (`$cycle=on`), and the lengths that are reported of a
//! job, both judged by the pins.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup::machine::{Path as _, Target};
use penup_host_tests::whole_jobs::Bench;
use penup_job::path::Run;
use penup_job::pins::PinChange;
use penup_job::relooped::Relooped;
use penup_job::streamed::{Form, StreamedJob};
use penup_job::watch::PenWatch;
use penup_readers::lines::Lines as _;

/// A plan of three bars that nothing joins, without a pen between its vertices and its bars.
const BARS: [&str; 2] = [
    "v 20 20 0\nv 60 20 0\nv 20 100 0\nv 80 140 0\nv 150 60 0\nv 100 80 0\n",
    "l 1 2\nl 3 4\nl 5 6\n",
];

/// A plotter that has drawn the bars with these settings. Its path begins at the origin.
fn drawn(settings: &str) -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    let [vertices, bars] = BARS;
    for text in [settings, vertices, bars, "$plot\n"] {
        let answer = bench.say(text);
        assert!(!answer.contains("error"), "{answer}");
    }
    bench.finish();
    bench
}

/// What the pins have drawn, in steps.
fn runs(bench: &Bench) -> Vec<Run> {
    let mut pen = PenWatch::new(1.0);
    bench.board.trace().changes().iter().for_each(|change| pen.change(PinChange::from(change)));
    pen.runs()
}

/// The lengths in mm that the pins have drawn and travelled since the pen came down for the first
/// time, and where in mm the pen came down first and where it is, for a machine with these steps
/// in a mm of x and of y.
fn by_pins(runs: &[Run], steps: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
    let mm = |point: &[f64; 2]| [point[0] / steps[0], point[1] / steps[1]];
    let mut lengths = [0.0; 2];
    let drawn = runs.iter().skip_while(|run| !run.pen_down);
    let points: Vec<_> = drawn.clone().flat_map(|run| &run.points).map(mm).collect();
    for run in drawn {
        let ends = [run.points.first(), run.points.last()].map(|end| mm(end.expect("a step")));
        let length = (ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]);
        lengths[usize::from(!run.pen_down)] += length;
    }
    (lengths, [points[0], points[points.len() - 1]])
}

/// The lengths in mm that the plotter reports, drawn and travelled.
fn reported(bench: &mut Bench) -> [f64; 2] {
    let answer = bench.say("$model\n");
    let job = answer.lines().find(|line| line.starts_with("[JOB:pen down ")).expect("a report");
    let [down, up] = ["pen down ", "up "].map(|name| {
        let number = job.split_once(name).and_then(|(_, rest)| rest.split_once(" mm"));
        number.and_then(|(number, _)| number.parse().ok()).expect("a length")
    });
    [down, up]
}

/// Fails unless the report is what the pins have done. Returns the ends of the path, and the
/// lengths that are reported.
fn assert_true_report(bench: &mut Bench, steps: [f64; 2]) -> ([[f64; 2]; 2], [f64; 2]) {
    let (lengths, ends) = by_pins(&runs(bench), steps);
    let reported = reported(bench);
    for (length, reported) in lengths.iter().zip(reported) {
        assert!((length - reported).abs() < 0.15, "{lengths:?} {reported}");
    }
    (ends, reported)
}

#[test]
fn the_pen_returns_to_where_it_began_and_the_report_counts_it() {
    let mut open = drawn("");
    let (ends, lengths) = assert_true_report(&mut open, [80.0; 2]);
    assert_eq!(lengths, [166.0, 143.2]);
    assert_ne!(ends[0], ends[1]);
    let mut closed = drawn("$cycle=on\n");
    let (ends, lengths) = assert_true_report(&mut closed, [80.0; 2]);
    assert_eq!(lengths, [166.0, 241.7]);
    assert_eq!(ends[0], ends[1]);
    let answer = closed.say("$model\n?");
    assert!(answer.contains("parts 3, lifts 3]"), "{answer}");
    assert!(answer.contains("|Drawn:3/3|"), "{answer}");
}

/// The report tells millimetres, however many steps they are.
#[test]
fn the_report_is_true_where_the_steps_of_x_and_y_differ() {
    for (settings, steps) in [
        ("$101=160\n", [80.0, 160.0]),
        ("$100=160\n", [160.0, 80.0]),
        ("$100=40\n$101=120\n$cycle=on\n", [40.0, 120.0]),
    ] {
        let mut bench = drawn(settings);
        let (ends, [down, _]) = assert_true_report(&mut bench, steps);
        assert_eq!(down, 166.0);
        assert_eq!(ends[0] == ends[1], settings.contains("cycle"));
        // The order is the best in steps, which is not proved to be the best in millimetres.
        let answer = bench.say("$model\n");
        assert!(answer.contains("bound 0.0 mm, not proved the least]"), "{answer}");
    }
}

/// A single part that ends where it began needs no return.
#[test]
fn a_pen_that_is_back_already_makes_no_move() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("$cycle=on\nv 20 20 0\nv 60 20 0\nv 60 70 0\nl 1 2 3 1\n$plot\n");
    bench.finish();
    assert_eq!(reported(&mut bench)[1], 0.0);
    assert_eq!(runs(&bench).len(), 2);
}

/// The pen begins earlier than the first bar, so it returns to there.
#[test]
fn the_pen_returns_to_the_beginning_of_a_longer_stroke() {
    let bench = drawn("$222=2\n$cycle=on\n");
    let (_, [begin, end]) = by_pins(&runs(&bench), [80.0; 2]);
    assert_eq!(begin, [18.0, 20.0]);
    assert_eq!(end, begin);
}

#[test]
fn no_pen_of_several_returns() {
    let mut bench = Bench::new();
    bench.heard();
    let [vertices, _] = BARS;
    for text in ["$cycle=on\n", vertices, "l 1 2\nl 3 4\nusemtl pen2\nl 5 6\n", "$plot\n"] {
        assert!(!bench.say(text).contains("error"));
    }
    bench.finish();
    assert!(bench.say("?").contains("|Pen:2"));
    bench.say("~");
    bench.finish();
    let (ends, lengths) = assert_true_report(&mut bench, [80.0; 2]);
    assert_eq!(lengths, [166.0, 143.2]);
    assert_ne!(ends[0], ends[1]);
}

/// The targets of a path.
fn targets(path: &mut dyn penup::machine::Path) -> Vec<Target> {
    std::iter::from_fn(|| path.next_target()).collect()
}

#[test]
fn the_rest_of_a_job_and_what_is_made_of_it_return_too() {
    let mut bench = drawn("$cycle=on\n");
    let whole = targets(&mut bench.plotter.strokes());
    let (begin, end) = (whole[0], whole[whole.len() - 1]);
    assert_eq!(begin, end);
    let mut rest = bench.plotter.strokes();
    assert!(rest.begin_at(2));
    assert_eq!(targets(&mut rest)[2], end);
    rest.rewind();
    assert_eq!(targets(&mut rest).len(), 3);
    assert!(!bench.plotter.strokes().begin_at(3));
    assert_eq!(targets(&mut Relooped::of(&mut bench.plotter.strokes())), whole);
    // What a computer sends, as strokes and as G-code.
    for form in [Form::Strokes, Form::GCode] {
        let settings = *bench.plotter.machine().settings();
        let job = StreamedJob::new(&settings, &mut bench.plotter.strokes(), form).expect("fits");
        assert_eq!(job.size().strokes, 3);
        let mut other = Bench::new();
        other.heard();
        for line in job.in_order() {
            let answer = other.say(&format!("{}\n", line.sent));
            assert!(answer.ends_with("ok\n"), "{} {answer}", line.sent);
        }
        other.finish();
        assert_eq!(by_pins(&runs(&other), [80.0; 2]), by_pins(&runs(&bench), [80.0; 2]));
    }
}
