//! Tests of the protocol by transcripts: the lines that are sent to the plotter, and its answers.

use penup::machine::Path;
use penup::model::ModelError;
use penup::plotter::{EMPTY_LOOKAHEAD, Memory, Unobserved};
use penup::protocol::{CommandError, error_entries};
use penup::stage::NeverCancel;
use penup_host_tests::whole_jobs::Bench;

/// A cube of side 1.
const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// A plotter that holds a cube.
fn with_cube() -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    assert_eq!(bench.say(CUBE), "ok\n".repeat(14));
    bench
}

/// The number of the error, if the line was refused with a message before it.
fn refusal(answer: &str) -> Option<u16> {
    let mut lines = answer.lines();
    let message = lines.next()?;
    let number = lines.next()?.strip_prefix("error:")?.parse().ok()?;
    (message.starts_with("[MSG:") && lines.next().is_none()).then_some(number)
}

/// Some senders take every line that contains `ok` or `error` for the answer to a line.
#[test]
fn only_answers_contain_what_answers_are_known_by() {
    let mut bench = Bench::new();
    bench.heard();
    for question in ["?", "$$\n", "$#\n", "$G\n", "$I\n", "$N\n"] {
        let answer = bench.say(question);
        let mut lines: Vec<&str> = answer.lines().collect();
        if question != "?" {
            assert_eq!(lines.pop(), Some("ok"), "{question}");
        }
        let mistaken = lines.iter().find(|line| line.contains("ok") || line.contains("error"));
        assert_eq!(mistaken, None, "{question}");
        assert!(!lines.is_empty(), "{question}");
    }
}

#[test]
fn a_new_plotter_greets_and_is_idle() {
    let mut bench = Bench::new();
    assert_eq!(bench.heard(), "\nGrbl 1.1h [penup 0.1.0 '$' for help]\n");
    assert_eq!(
        bench.say("?"),
        "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000|Drawn:0/0|Ink:0/0|Left:0>\n"
    );
    assert_eq!(bench.say("\n"), "ok\n");
    assert_eq!(bench.say("$model\n").lines().last(), Some("ok"));
}

#[test]
fn a_curve_that_has_not_ended_is_not_left_out() {
    let mut bench = with_cube();
    bench.say("deg 1\ncurv 0 1 1 2\nparm u 0 0 1 1\n");
    let answer = bench.say("$plot\n");
    let expected = CommandError::Model(ModelError::CurveUnfinished).number();
    assert_eq!(refusal(&answer), Some(expected), "{answer}");
    assert!(bench.say("end\n$plot\n").ends_with("ok\n"));
}

#[test]
fn each_refusal_has_its_own_number_and_changes_nothing() {
    let mut bench = with_cube();
    let before = bench.say("$model\n$options\n$$\n");
    let long = format!("# {}\n", "x".repeat(300));
    for (line, number) in [
        ("hello\n", 1),
        ("G0 X\n", 2),
        ("G5 X1\n", 20),
        ("M10\n", 20),
        ("G0 X10 U3\n", 20),
        ("$H\n", 5),
        ("$J=Y500 F100\n", 15),
        ("G2 X10 Y0\n", 35),
        ("G2 X10 I3\n", 33),
        ("G3 X10 I400\n", 33),
        ("v 1 2 x\n", 2),
        ("$page=axb\n", 2),
        ("$nonsense\n", 3),
        ("$nonsense=1\n", 3),
        (long.as_str(), 11),
        ("v 1 2\n", 103),
        ("f 1 2 x\n", 104),
        ("$hidden=perhaps\n", 105),
        ("$page=210\n", 106),
        ("f 1 2 9\n", 110),
        ("f 1 2 -9\n", 110),
        ("l 0 1\n", 110),
        ("f 1 2\n", 111),
        ("f 1 2 2\n", 112),
        ("v 1e12 0 0\n", 115),
        ("$margin=-1\n", 102),
        ("$120=-1\n", 4),
        ("$120=0\n", 150),
        ("$20=0.5\n", 150),
    ] {
        let answer = bench.say(line);
        assert_eq!(refusal(&answer), Some(number), "{line:?}: {answer:?}");
        assert!(error_entries().iter().any(|entry| entry.number == number), "no error {number}");
    }
    assert_eq!(bench.say("$model\n$options\n$$\n"), before);
}

#[test]
fn a_refused_setting_tells_the_range_as_the_documents_do_and_its_ends_are_taken() {
    let mut bench = Bench::new();
    bench.heard();
    assert_eq!(bench.say("$27=0\n"), "[MSG:homing pull-off goes from 0.1 to 50 mm]\nerror:150\n");
    assert_eq!(bench.say("$27=0.1\n$27=50\n"), "ok\nok\n");
}

#[test]
fn a_refused_arc_asks_for_what_arcs_need() {
    let mut bench = Bench::new();
    bench.heard();
    // Steps of different length are no obstacle.
    assert_eq!(bench.say("$101=40\nG0 X20 Y10\n"), "ok\nok\n");
    assert_eq!(bench.say("G3 X10 Y20 I-10\n"), "");
    bench.finish();
    assert_eq!(bench.heard(), "ok\n");
    assert_eq!(
        bench.say("G2 X30 Y10 I3\n"),
        "[MSG:both ends of an arc lie equally far from its centre, at most 4194304 steps: \
         check I and J, or R]\nerror:33\n"
    );
}

#[test]
fn a_model_too_large_is_refused_with_the_limit() {
    let memory = Box::leak(Box::new(Memory::<4, 6, 16>::new()));
    let mut bench = Bench::with_memory(memory.lend(Box::leak(Box::new(EMPTY_LOOKAHEAD))));
    bench.heard();
    assert_eq!(bench.say("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"), "ok\n".repeat(4));
    assert_eq!(bench.say("v 2 2 2\n"), "[MSG:the limit is 4 vertices]\nerror:113\n");
    assert_eq!(bench.say("f 1 2 3 4\n"), "ok\n");
    assert_eq!(
        bench.say("f 4 3 2 1\n"),
        "[MSG:the limit is 6 corners of faces and ends of lines, this makes 8]\nerror:114\n"
    );
    // The working memory is too small for any picture; the model stays.
    assert_eq!(refusal(&bench.say("$plot\n")), Some(140));
    assert!(bench.say("$model\n").starts_with("[MODEL:vertices 4 of 4]\n"));
}

#[test]
fn views_that_show_nothing_are_refused() {
    let mut bench = Bench::new();
    bench.heard();
    assert_eq!(refusal(&bench.say("$plot\n")), Some(120));
    bench.say("v 0 0 0\nv 1 1 1\n");
    assert_eq!(refusal(&bench.say("$plot\n")), Some(120));
    let mut bench = with_cube();
    for (settings, number) in [
        ("$eye=1,1,1\n$at=1,1,1\n", 121),
        ("$eye=0.5,0.5,9\n$at=0.5,0.5,0.5\n$up=0,0,1\n", 122),
        // The eye inside, or beside the cube.
        ("$view=auto\n$behind=refuse\n$eye=0.5,0.5,0.5\n$at=0.5,0.5,2\n", 123),
        ("$eye=0.5,0.5,-3\n$at=0.5,0.5,-9\n$behind=clip\n", 124),
        ("$view=auto\n$margin=105\n", 130),
    ] {
        bench.say(settings);
        assert_eq!(refusal(&bench.say("$plot\n")), Some(number), "{settings:?}");
    }
    // Nothing was lost: a good view draws.
    assert_eq!(bench.say("$view=auto\n$margin=10\n$plot\n"), "ok\n".repeat(3));
}

#[test]
fn an_eye_inside_sees_what_is_in_front_of_it() {
    let mut bench = with_cube();
    assert_eq!(bench.say("$eye=0.5,0.5,0.5\n$at=0.6,2,0.7\n$plot\n"), "ok\n".repeat(3));
    bench.finish();
    assert!(bench.say("?").starts_with("<Idle|"));
}

#[test]
fn a_plan_is_drawn_at_true_size_or_refused_with_its_size() {
    let mut bench = Bench::new();
    bench.heard();
    assert_eq!(
        bench.say("v 50 50 0\nv 350 50 0\nl 1 2\n$plot\n").lines().last(),
        Some("error:132")
    );
    let answer = bench.say("$plot\n");
    assert_eq!(
        answer,
        "[MSG:the plan is 300.0x0.0 mm: choose a larger $page, or $fit=on]\nerror:132\n"
    );
    assert_eq!(bench.say("$page=420x297\n$plot\n"), "ok\nok\n");
    bench.finish();
    assert_eq!(
        bench.say("?"),
        "<Idle|MPos:350.000,50.000,0.000|FS:0,0|WCO:0.000,0.000,0.000|Drawn:1/1|\
         Ink:300/300|Left:0>\n"
    );
    assert_eq!(bench.say("$page=210x297\n$fit=on\n$plot\n"), "ok\nok\nok\n");
    bench.finish();
    assert!(bench.say("?").contains("Ink:190/190"));
}

#[test]
fn both_axes_of_a_corexy_machine_have_the_steps_of_its_motors() {
    let mut bench = Bench::new();
    // Both motors of a CoreXY drive one belt, so the setting of the other axis is not used.
    let answer = bench.say(
        "$230=1\n$100=80\n$101=40\nv 20 20 0\nv 70 20 0\nv 70 50 0\nv 20 50 0\n\
         l 1 2 3 4 1\n",
    );
    assert!(!answer.contains("error"), "{answer}");
    bench.plotter.compute(&mut NeverCancel, &mut Unobserved).expect("a job");
    let mut strokes = bench.plotter.strokes();
    let mut most = [0; 2];
    while let Some(target) = strokes.next_target() {
        most = [most[0].max(target.point.x), most[1].max(target.point.y)];
    }
    assert_eq!(most, [70 * 80, 50 * 80]);
}

#[test]
fn while_it_draws_it_is_busy_and_ctrl_x_ends_it_with_the_position_known() {
    let mut bench = with_cube();
    assert_eq!(bench.say("$plot\n"), "ok\n");
    for _ in 0..3000 {
        bench.plotter.poll(&mut bench.board);
        penup::plotter::Board::wait(&mut bench.board);
    }
    assert!(bench.say("?").starts_with("<Run|"));
    assert_eq!(refusal(&bench.say("$plot\n")), Some(8));
    assert_eq!(refusal(&bench.say("$110=100\n")), Some(8));
    assert_eq!(bench.say("\x18"), "\nGrbl 1.1h [penup 0.1.0 '$' for help]\n");
    bench.finish();
    let status = bench.say("?");
    assert!(status.starts_with("<Idle|"), "{status}");
    let changes = bench.board.trace().changes();
    let (mut x, mut y) = (0i32, 0i32);
    let (mut up_x, mut up_y, mut pen) = (false, false, 0);
    for stamped in &changes {
        use penup::boards::host::Change;
        match stamped.change {
            Change::StepX(true) => x += if up_x { 1 } else { -1 },
            Change::StepY(true) => y += if up_y { 1 } else { -1 },
            Change::UpX(up) => up_x = up,
            Change::UpY(up) => up_y = up,
            Change::Pen(height) => pen = height,
            _ => {}
        }
    }
    assert_eq!(pen, 0, "the pen is up");
    let position = bench.plotter.machine().position();
    assert_eq!((position.x, position.y), (x, y));
    assert!((x, y) != (0, 0));
    // Ready for the next job, with the model still there.
    assert_eq!(bench.say("$plot\n"), "ok\n");
}

#[test]
fn hold_stops_with_the_pen_up_and_resume_finishes() {
    let mut bench = with_cube();
    bench.say("$plot\n");
    for _ in 0..3000 {
        bench.plotter.poll(&mut bench.board);
        penup::plotter::Board::wait(&mut bench.board);
    }
    bench.say("!");
    bench.finish();
    assert!(bench.say("?").starts_with("<Hold:0|"));
    bench.say("~");
    bench.finish();
    assert!(bench.say("?").starts_with("<Idle|"));
}

#[test]
fn the_help_lists_every_command() {
    let mut bench = Bench::new();
    bench.heard();
    let help = bench.say("$\n");
    penup::plotter::help(&mut |usage, meaning| {
        assert!(help.contains(&format!("[HLP:{usage} {meaning}]\n")), "{usage}");
    });
    assert_eq!(help.lines().last(), Some("ok"));
}

#[test]
fn hidden_lines_have_their_own_pen_after_a_pause() {
    let mut bench = with_cube();
    bench.say("$hidden=pen\n");
    bench
        .plotter
        .compute(&mut penup::stage::NeverCancel, &mut penup::plotter::Unobserved)
        .expect("a job");
    let mut strokes = bench.plotter.strokes();
    let mut pens = Vec::new();
    while let Some(penup::machine::Target { ink, .. }) =
        penup::machine::Path::next_target(&mut strokes)
    {
        if ink.is_some() {
            pens.push(penup::machine::Path::pen(&strokes));
        }
    }
    // Nine edges are seen, three are not.
    assert_eq!(pens, [[0; 9].as_slice(), &[1; 3]].concat());
    assert_eq!(bench.say("$plot\n"), "ok\n");
    bench.finish();
    let paused = bench.say("?");
    assert!(!paused.starts_with("<Idle"), "{paused}");
    bench.say("~");
    bench.finish();
    assert!(bench.say("?").starts_with("<Idle"));
}

#[test]
fn the_order_is_as_it_was_asked_for_and_reported() {
    let mut bench = Bench::new();
    bench.heard();
    // Two squares: two parts without odd points.
    for (x, first) in [(20, 1), (60, 5)] {
        for (dx, dy) in [(0, 0), (10, 0), (10, 10), (0, 10)] {
            bench.say(&format!("v {} {} 0\n", x + dx, 50 + dy));
        }
        bench.say(&format!("l {} {} {} {} {}\n", first, first + 1, first + 2, first + 3, first));
    }
    for (settings, (lifts, up)) in
        [("$order=exact\n$effort=10\n", (1, "30.0")), ("$cycle=on\n", (2, "60.0"))]
    {
        bench.say(settings);
        assert_eq!(bench.say("$plot\n"), "ok\n");
        bench.finish();
        let answer = bench.say("$model\n");
        let counts = format!("[JOB:odd points 0, parts 2, lifts {lifts}]");
        assert!(answer.contains(&counts), "{answer}");
        let job = format!("[JOB:pen down 80.0 mm, up {up} mm, efficiency ");
        assert!(answer.contains(&job), "{answer}");
    }
    for (line, number) in [
        ("$order=best\n", 105),
        ("$effort=-1\n", 102),
        ("$lift=1000.5\n", 102),
        ("$lift=-1\n", 102),
        ("$hidden=pen,33\n", 102),
    ] {
        assert_eq!(refusal(&bench.say(line)), Some(number), "{line}");
    }
}
