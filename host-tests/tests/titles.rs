//! Tests of titles, from the serial line to the strokes.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use penup::drawing::Title;
use penup::fixed::Millimetres;
use penup::machine::Path;
use penup::protocol::Escape;
use penup::stage::NeverCancel;
use penup_host_tests::whole_jobs::Bench;

/// A line in steps, starting at its lower or left end.
type Ink = [[i32; 2]; 2];

fn bench(text: &str) -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    let answer = bench.say(text);
    assert!(!answer.contains("error"), "{answer}");
    bench
}

/// The lines that the job draws.
fn ink(bench: &mut Bench) -> Vec<Ink> {
    bench.plotter.compute(&mut NeverCancel, &mut penup::plotter::Unobserved).unwrap();
    let mut strokes = bench.plotter.strokes();
    let (mut ink, mut at) = (Vec::new(), [0; 2]);
    while let Some(target) = strokes.next_target() {
        let to = [target.point.x, target.point.y];
        if target.ink.is_some() {
            ink.push([at.min(to), at.max(to)]);
        }
        at = to;
    }
    ink
}

fn mm(length: f64) -> Millimetres {
    Millimetres::from_num(length)
}

/// The lines of a title with its left end and baseline in mm.
fn written(text: &str, size: f64, left: Millimetres, baseline: f64) -> Vec<Ink> {
    let mut lines = Vec::new();
    let title = Title { text, height: mm(size) };
    title
        .draw::<()>(left, mm(baseline), [mm(80.0); 2], &mut |line| {
            let [from, to] = line.map(|point| [point.x, point.y]);
            lines.push([from.min(to), from.max(to)]);
            Ok(())
        })
        .unwrap();
    lines
}

/// Whether a line of a title is drawn, by one segment or more. Points closer than two steps are
/// merged.
fn is_inked(line: &Ink, ink: &[Ink]) -> bool {
    let near = |a: [i32; 2], b: [i32; 2]| (a[0] - b[0]).abs() < 3 && (a[1] - b[1]).abs() < 3;
    let short = near(line[0], line[1]);
    let end = |end: [i32; 2]| ink.iter().flatten().any(|point| near(*point, end));
    short || end(line[0]) && end(line[1])
}

/// A frame that is higher than wide, so that it uses all the available height.
const TALL: &str = "v 0 0 0\nv 1 0 0\nv 1 0 9\nv 0 0 9\nl 1 2 3 4 1\n\
                    $eye=0.5,-9,4.5\n$at=0.5,0,4.5\n$projection=orthographic\n\
                    $page=100x100\n$margin=10\n";

#[test]
fn a_title_stands_in_the_middle_below_a_solid_that_leaves_it_room() {
    let mut bench = bench(&format!("{TALL}$title=Aug 7\n$title-size=6\n"));
    let ink = ink(&mut bench);
    // A third of the size below the baseline, twice the size above it.
    let (baseline, bottom) = (10.0 + 2.0, 10.0 + 2.0 + 12.0);
    let (frame, title): (Vec<Ink>, Vec<Ink>) =
        ink.iter().partition(|line| line[0][1] >= (80.0 * bottom) as i32 - 1);
    assert_eq!(frame.len(), 4);
    let heights = || frame.iter().flatten().map(|point| point[1]);
    assert!((heights().min().unwrap() - 80 * 24).abs() <= 1);
    assert!((heights().max().unwrap() - 80 * 90).abs() <= 1);

    let width = Title { text: "Aug 7", height: mm(6.0) }.width();
    let expected = written("Aug 7", 6.0, mm(50.0) - width / 2, baseline);
    assert!(expected.len() > 20);
    assert!(expected.iter().all(|line| is_inked(line, &title)));
    for [x, y] in title.iter().flatten() {
        assert!((80 * 10..=80 * 90).contains(x) && (80 * 10..=80 * 18).contains(y), "{x} {y}");
    }
}

#[test]
fn without_a_title_nothing_changes() {
    let plain = ink(&mut bench(TALL));
    assert_eq!(plain, ink(&mut bench(&format!("{TALL}$title=Gone\n$title=\n"))));
    assert_eq!(plain, ink(&mut bench(&format!("{TALL}$title=   \n"))));
    assert_eq!(plain.len(), 4);
}

#[test]
fn drawing_and_title_are_in_the_middle_of_the_page_together() {
    let wide = "v 0 0 0\nv 8 0 0\nv 8 0 2\nv 0 0 2\nl 1 2 3 4 1\n$eye=4,-9,1\n$at=4,0,1\n\
                $projection=orthographic\n$page=100x100\n$margin=10\n$title=I\n$title-size=3\n";
    let ink = ink(&mut bench(wide));
    // 80 mm by 20, and 7 below them.
    let top = ink.iter().flatten().map(|point| point[1]).max().unwrap();
    let bottom = top - 80 * 20;
    assert!((top + bottom - 80 * 7 - 80 * 100).abs() <= 2, "{bottom} to {top}");
    let letter: Vec<&Ink> = ink.iter().filter(|line| line[1][1] < bottom - 80).collect();
    assert_eq!(letter.len(), 1, "an I is one line: {letter:?}");
    assert!((letter[0][0][0] - 80 * 50).abs() <= 1);
    assert!((letter[0][1][1] - (bottom - 80 * 3)).abs() <= 1, "a gap of the title's size");
}

#[test]
fn a_plan_at_true_size_stays_if_there_is_room_below_and_is_moved_if_not() {
    let plan = |low: i32| {
        format!(
            "v 20 {low} 0\nv 60 {low} 0\nl 1 2\n$page=100x60\n$margin=5\n$title=I\n$title-size=6\n"
        )
    };
    for (low, expected) in [(40, 40), (19, 19), (6, 19), (-70, 19)] {
        let ink = ink(&mut bench(&plan(low)));
        let bar = ink.iter().find(|line| line[0][1] == line[1][1]).unwrap();
        assert_eq!(*bar, [[80 * 20, 80 * expected], [80 * 60, 80 * expected]], "{low}");
        let letter = ink.iter().find(|line| line[0][0] == line[1][0]).unwrap();
        // Below the middle of the bar, not of the page.
        let baseline = 80 * expected - 80 * 12;
        assert_eq!(*letter, [[80 * 40, baseline], [80 * 40, baseline + 80 * 6]], "{low}");
    }
    // Near the margin it is moved to be within.
    let edge = "v 5 40 0\nv 6 40 0\nl 1 2\n$page=100x60\n$margin=5\n$title=WWWW\n";
    let ink = ink(&mut bench(edge));
    assert_eq!(ink.iter().flatten().map(|point| point[0]).min(), Some(80 * 5));
}

#[test]
fn what_does_not_fit_is_refused_with_its_measure() {
    let mut bench = bench("v 5 5 0\nv 5 55 0\nl 1 2\n$page=100x60\n$margin=5\n");
    assert_eq!(ink(&mut bench).len(), 1);
    bench.say("$title=Bar\n$title-size=6\n");
    let answer = bench.say("$plot\n");
    assert_eq!(
        answer,
        "[MSG:the plan is 0.0x50.0 mm and its title takes 14.0 mm below it: choose a larger \
         $page, or $fit=on]\nerror:132\n"
    );
    bench.say("$title-size=50\n");
    let answer = bench.say("$plot\n");
    assert!(
        answer.starts_with("[MSG:the title is 1")
            && answer.contains(" mm wide where 90.0 are free"),
        "{answer}"
    );
    assert!(answer.ends_with("error:133\n"), "{answer}");
    bench.say("$title=I\n$fit=on\n");
    assert_eq!(bench.say("$plot\n").lines().last(), Some("error:130"));
    assert_eq!(bench.say("$title=\n$plot\n"), "ok\nok\n");
}

#[test]
fn a_title_is_kept_as_it_was_sent() {
    let mut bench = bench("");
    let listed = |bench: &mut Bench| {
        let options = bench.say("$options\n");
        options.lines().find(|line| line.starts_with("$title=")).unwrap().to_owned()
    };
    for (line, expected) in [
        ("$title=Plan #3:  A & b", "$title=Plan #3:  A & b"),
        (r"$title=Caf\xE9 \u{2013} 3\x3F \\", r"$title=Caf\xE9 \u{2013} 3\x3F \\"),
        ("$title=Straße – Åå", r"$title=Stra\xDFe \u{2013} \xC5\xE5"),
        ("$title= both ends ", "$title= both ends "),
    ] {
        assert_eq!(bench.say(&format!("{line}\n")), "ok\n", "{line}");
        assert_eq!(listed(&mut bench), expected);
        // It is no part of the model, and what is listed can be sent.
        assert_eq!(bench.say(&format!("$clear\n{expected}\n")), "ok\nok\n");
        assert_eq!(listed(&mut bench), expected);
    }
    for (line, answer) in [
        ("$title=a→b", "[MSG:the font lacks → (U+2192): leave it out]\nerror:108\n".to_owned()),
        (r"$title=\x", "error:107\n".to_owned()),
        ("$title-size=0.9", "error:102\n".to_owned()),
        ("$title-size=101", "error:102\n".to_owned()),
    ] {
        let said = bench.say(&format!("{line}\n"));
        assert!(said.starts_with("[MSG:") && said.ends_with(&answer), "{line}: {said}");
    }
    let long = "x".repeat(81);
    assert!(bench.say(&format!("$title={long}\n")).ends_with("error:109\n"));
    assert_eq!(listed(&mut bench), "$title= both ends ", "a refused title changes nothing");
}

#[test]
fn all_of_latin_1_is_drawn() {
    let letters: Vec<char> = ('!'..='~').chain('¡'..='¬').chain('®'..='ÿ').collect();
    for part in letters.chunks(30) {
        let text: String = part.iter().collect();
        let title = format!("$title={}\n$page=400x60\n$title-size=5\n$margin=5\n", Escape(&text));
        let mut bench = bench(&format!("v 5 40 0\nv 395 40 0\nl 1 2\n{title}"));
        let width = Title { text: &text, height: mm(5.0) }.width();
        let expected = written(&text, 5.0, mm(200.0) - width / 2, 30.0);
        let ink = ink(&mut bench);
        assert!(expected.iter().all(|line| is_inked(line, &ink)), "{text}");
    }
}

#[test]
fn what_an_eye_among_the_solids_sees_is_cut_above_the_title() {
    let mut bench = bench(
        "v -1 -.3 0\nv 1 -.3 0\nv 1 .3 0\nv -1 .3 0\nv -1 -.3 1\nv 1 -.3 1\nv 1 .3 1\nv -1 .3 1\n\
         f 1 2 3 4\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n\
         $eye=0,0,0.5\n$at=1,0.1,0.5\n$page=100x100\n$margin=10\n$title=I\n$title-size=6\n",
    );
    let ink = ink(&mut bench);
    let first = 80 * 24;
    let (above, below): (Vec<Ink>, Vec<Ink>) =
        ink.iter().partition(|line| line.iter().all(|point| point[1] >= first - 1));
    assert_eq!(below.len(), 1, "the letter alone: {below:?}");
    assert!(above.iter().flatten().any(|point| (point[1] - first).abs() <= 1), "cut at the border");
}
