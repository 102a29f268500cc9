//! Tests of several pens: which pen draws which line, from `usemtl` and `g` on the serial line to
//! the strokes.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use penup::geometry::Projection;
use penup::machine::Path;
use penup::model::{Elements, PenWriter, Pens};
use penup::plotter::{Board, Observer};
use penup::stage::{NeverCancel, Scratch};
use penup::view::View;
use penup::visibility::{Options, Scene, Stretch, Unrounded, find_stretches, scratch_bytes};
use penup_host_tests::random::Random;
use penup_host_tests::random_scenes::random_scene;
use penup_host_tests::scene_files::Stretches;
use penup_host_tests::whole_jobs::{Bench, job_lines};
use std::collections::{BTreeMap, BTreeSet};

fn bench(text: &str) -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    let answer = bench.say(text);
    assert!(!answer.contains("error"), "{answer}");
    bench
}

/// The stretches with their pens, counted from 1.
#[derive(Default)]
struct Found {
    stretches: Vec<(Option<(u16, u16)>, u8)>,
    bars: Vec<([f64; 2], [f64; 2], u8)>,
}

impl Observer for Found {
    fn stretch(&mut self, _: &View, stretch: &Stretch) {
        let edge = stretch.edge.map(|(a, b)| (a.min(b), a.max(b)));
        self.stretches.push((edge, stretch.pen + 1));
    }

    fn plan_bar(&mut self, from: [f64; 2], to: [f64; 2], pen: u8) {
        self.bars.push((from, to, pen + 1));
    }
}

/// A line in steps, and its pen, counted from 1.
type Ink = ([i32; 2], [i32; 2], u8);

/// The lines that are found and the lines that are drawn, in order.
fn job(bench: &mut Bench) -> (Found, Vec<Ink>) {
    let mut found = Found::default();
    bench.plotter.compute(&mut NeverCancel, &mut found).unwrap();
    let mut strokes = bench.plotter.strokes();
    let (mut ink, mut at) = (Vec::new(), [0; 2]);
    while let Some(target) = strokes.next_target() {
        let to = [target.point.x, target.point.y];
        if target.ink.is_some() {
            ink.push((at.min(to), at.max(to), strokes.pen() + 1));
        }
        at = to;
    }
    (found, ink)
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n";
const FACES: [[u16; 4]; 6] =
    [[4, 3, 2, 1], [5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]];

/// A cube whose faces have these pens.
fn cube(pens: [u8; 6]) -> String {
    let mut text = CORNERS.to_owned();
    for (face, pen) in FACES.iter().zip(pens) {
        let [a, b, c, d] = face;
        text += &format!("usemtl pen{pen}\nf {a} {b} {c} {d}\n");
    }
    text
}

/// The lowest pen of the faces at each edge, with indices from 0.
fn lowest(pens: [u8; 6]) -> BTreeMap<(u16, u16), u8> {
    let mut lowest = BTreeMap::new();
    for (face, pen) in FACES.iter().zip(pens) {
        for at in 0..4 {
            let (a, b) = (face[at] - 1, face[(at + 1) % 4] - 1);
            let known = lowest.entry((a.min(b), a.max(b))).or_insert(pen);
            *known = pen.min(*known);
        }
    }
    lowest
}

/// All orders of pens are tested, because the order of the faces must not matter.
const PENS: [[u8; 6]; 4] = [[1, 2, 3, 4, 5, 6], [6, 5, 4, 3, 2, 1], [9, 2, 2, 32, 2, 9], [3; 6]];

#[test]
fn an_edge_has_the_lowest_pen_of_its_faces_and_pens_come_in_turn() {
    for pens in PENS {
        let expected = lowest(pens);
        for settings in [
            "",
            "$see=wire\n",
            "$hidden=dotted\n",
            "$hidden=shown\n",
            "$crease=20\n",
            "$see=wire\n$crease=20\n",
            "$blocks=merged\n",
            "$eye=5,-9,4\n$projection=orthographic\n",
        ] {
            let (found, ink) = job(&mut bench(&(cube(pens) + settings)));
            assert!(found.stretches.len() >= 9, "{settings}");
            for (edge, pen) in found.stretches {
                assert_eq!(expected.get(&edge.unwrap()), Some(&pen), "{pens:?} {settings}");
            }
            assert!(ink.is_sorted_by_key(|(.., pen)| *pen), "{pens:?} {settings}");
            assert!(ink.len() >= 9);
        }
        for method in ["edges", "vertices"] {
            let (_, ink) = job(&mut bench(&format!("{}$see={method}\n", cube(pens))));
            assert!(ink.iter().all(|(.., pen)| *pen == 1));
        }
    }
}

#[test]
fn loose_triangles_and_faces_without_an_area_keep_the_pens_of_the_others() {
    for pens in PENS {
        // Each face is written as two triangles with vertices of their own, and is preceded by one
        // without an area.
        let at = |number: u16| {
            let n = number - 1;
            let x = u16::from(n % 4 == 1 || n % 4 == 2);
            format!("v {x} {} {}\n", u16::from(n % 4 >= 2), n / 4)
        };
        let mut text = String::new();
        for ([a, b, c, d], pen) in FACES.iter().zip(pens) {
            text += &format!("g pen{}\n", 33 - pen);
            text += &format!("{}{}{}f -3 -2 -1\n", at(*a), at(*a), at(*b));
            text += &format!("usemtl pen{pen}\n");
            for triangle in [[a, b, c], [a, c, d]] {
                for number in triangle {
                    text += &at(*number);
                }
                text += "f -3 -2 -1\n";
            }
        }
        let whole = |text: &str| {
            let (_, ink) =
                job(&mut bench(&format!("{text}$crease=20\n$eye=5,-9,4\n$at=.5,.5,.5\n")));
            ink.into_iter().collect::<BTreeSet<_>>()
        };
        assert_eq!(whole(&text), whole(&cube(pens)), "{pens:?}");
    }
}

#[test]
fn what_is_cut_at_the_eye_keeps_its_pen() {
    for pens in PENS {
        let (found, ink) =
            job(&mut bench(&format!("{}$eye=.5,.45,.5\n$at=2,.6,.7\n$hidden=shown\n", cube(pens))));
        // The edges at the far face are whole and still have their indices.
        let expected = lowest(pens);
        let whole: Vec<_> = found
            .stretches
            .iter()
            .filter_map(|(edge, pen)| Some((expected.get(&(*edge)?)?, pen)))
            .collect();
        assert!(whole.len() >= 4 && whole.iter().all(|(a, b)| a == b), "{whole:?}");
        // The edges that are cut have the pens of the faces around the far one.
        let all: BTreeSet<u8> = ink.iter().map(|(.., pen)| *pen).collect();
        let around = [(1, 0), (2, 3), (5, 4), (6, 7)]
            .map(|(a, b): (u16, u16)| expected[&(a.min(b), a.max(b))]);
        assert!(around.iter().all(|pen| all.contains(pen)), "{all:?} {around:?}");
    }
}

#[test]
fn a_seam_has_the_lower_pen_of_its_faces() {
    let lines = job_lines("interpen.obj", &["$hidden=erased"]);
    let faces = lines.iter().filter(|line| line.starts_with("f ")).count();
    for (one, other) in [(3, 5), (5, 3)] {
        let mut text = String::new();
        let mut number = 0;
        for line in lines.iter().filter(|line| *line != "$plot") {
            if line.starts_with("f ") {
                text += &format!("usemtl pen{}\n", if number < faces / 2 { one } else { other });
                number += 1;
            }
            text += &format!("{line}\n");
        }
        let (found, ink) = job(&mut bench(&text));
        let seams = found.stretches.iter().filter(|(edge, _)| edge.is_none());
        assert!(seams.clone().count() >= 4 && seams.clone().all(|(_, pen)| *pen == 3));
        let used: BTreeSet<u8> = ink.iter().map(|(.., pen)| *pen).collect();
        assert_eq!(used, BTreeSet::from([3, 5]));
    }
}

/// Bars and curves, each of a pen, with an unused vertex off the plan if it shall be none.
fn drawing(is_plan: bool) -> String {
    let z = if is_plan { "0" } else { "7" };
    format!(
        "v 20 20 0\nv 60 20 0\nv 60 60 0\nv 20 60 {z}\n\
         usemtl red\nl 1 2\nusemtl pen5\nl 2 3 4\nusemtl red\nl 4 1\n\
         cstype bspline\ndeg 2\nusemtl green\ncurv 2 3 1 2 3\nend\nusemtl pen5\ncurv 2 4 1 4 3 \
         2\nend\n\
         $page=100x100\n$margin=5\n"
    )
}

#[test]
fn bars_and_curves_have_pens_on_a_plan_and_in_space() {
    let (found, ink) = job(&mut bench(&drawing(true)));
    let pens: Vec<u8> = found.bars.iter().map(|(.., pen)| *pen).collect();
    assert_eq!(pens[..4], [1, 5, 5, 1]);
    let green = pens[4..].iter().take_while(|pen| **pen == 2).count();
    assert!(green > 10 && pens[4 + green..].iter().all(|pen| *pen == 5), "{pens:?}");
    assert!(pens.len() > 4 + green + 10);
    let counts =
        |ink: &[Ink]| [1, 2, 5].map(|pen| ink.iter().filter(|(.., of)| *of == pen).count());
    assert!(counts(&ink)[0] == 2 && counts(&ink)[1] > 10 && counts(&ink)[2] > 10);
    let (found, ink) = job(&mut bench(&drawing(false)));
    assert!(found.bars.is_empty());
    let [red, green, five] = counts(&ink);
    assert!(red >= 2 && green > 10 && five > 10, "{red} {green} {five}");
    assert_eq!(red + green + five, ink.len());
    // The bars have the indices of their vertices.
    let pen_of = |edge| found.stretches.iter().find(|(of, _)| *of == Some(edge)).unwrap().1;
    assert_eq!([(0, 1), (1, 2), (2, 3), (0, 3)].map(pen_of), [1, 5, 5, 1]);
}

#[test]
fn one_pen_draws_all_if_it_shall() {
    for text in [drawing(true), drawing(false), cube(PENS[0])] {
        for settings in ["", "$hidden=dotted\n"] {
            let text = text.clone() + settings;
            let (_, before) = job(&mut bench(&format!("$pens=one\n{text}")));
            let (found, after) = job(&mut bench(&format!("{text}$pens=one\n")));
            assert!(before.iter().chain(&after).all(|(.., pen)| *pen == 1));
            assert!(found.stretches.iter().all(|(_, pen)| *pen == 1));
            assert!(found.bars.iter().all(|(.., pen)| *pen == 1));
            let ink =
                |ink: &[Ink]| -> BTreeSet<_> { ink.iter().map(|(a, b, _)| (*a, *b)).collect() };
            assert_eq!(ink(&before), ink(&after));
        }
    }
    let mut bench = bench(&format!("{}$pens=one\n$pens=auto\n", cube(PENS[0])));
    assert!(job(&mut bench).1.iter().any(|(.., pen)| *pen > 1));
}

#[test]
fn hidden_lines_have_the_pen_that_was_asked_for() {
    let (_, ink) = job(&mut bench(&format!("{}$hidden=pen,9\n", cube([3; 6]))));
    let count = |wanted: u8| ink.iter().filter(|(.., pen)| *pen == wanted).count();
    assert_eq!((count(3), count(9), ink.len()), (9, 3, 12));
    // Seen from straight ahead, the far edges are exactly behind the near ones. The visible edge
    // wins, although its pen is higher.
    let ahead = "$eye=.5,-9,.5\n$at=.5,.5,.5\n$projection=orthographic\n$hidden=pen,1\n";
    let (_, ink) = job(&mut bench(&(cube([3; 6]) + ahead)));
    assert_eq!(ink.iter().map(|(.., pen)| *pen).collect::<Vec<_>>(), [3; 4]);
}

#[test]
fn a_stretch_of_paper_is_inked_by_the_lower_pen_alone() {
    let plan = |first: u8, second: u8| {
        format!(
            "v 20 20 0\nv 60 20 0\nv 40 20 0\nv 80 20 0\nusemtl pen{first}\nl 1 2\nusemtl \
             pen{second}\nl 3 4\n"
        )
    };
    let mm = |from: i32, to: i32, pen| ([80 * from, 1600], [80 * to, 1600], pen);
    assert_eq!(job(&mut bench(&plan(1, 2))).1, [mm(20, 60, 1), mm(60, 80, 2)]);
    assert_eq!(job(&mut bench(&plan(2, 1))).1, [mm(40, 80, 1), mm(20, 40, 2)]);
    // Of two edges that coincide in space, the lower pen wins, whichever came first.
    for (first, second) in [(4, 7), (7, 4)] {
        let text = plan(first, second).replace("v 80 20 0", "v 80 20 0\nv 0 0 9");
        let (_, ink) = job(&mut bench(&format!("{text}$eye=50,-90,40\n$at=50,20,0\n")));
        let length = |wanted: u8| -> i32 {
            ink.iter().filter(|(.., pen)| *pen == wanted).map(|(a, b, _)| b[0] - a[0]).sum()
        };
        // Forty of the sixty millimetres.
        assert!((length(4) - 2 * length(7)).abs() < 40, "{ink:?}");
    }
}

#[test]
fn materials_rule_over_groups_and_names_are_counted() {
    let bars = "v 10 10 0\nv 20 10 0\nv 20 20 0\nv 10 20 0\nv 10 30 0\n";
    let pens = |lines: &str| -> Vec<u8> {
        job(&mut bench(&format!("{bars}{lines}"))).0.bars.iter().map(|(.., pen)| *pen).collect()
    };
    assert_eq!(pens("l 1 2\ng a\nl 2 3\ng b\nl 3 4\ng a b\nl 4 5\n"), [1, 1, 2, 3]);
    assert_eq!(pens("g a\nl 1 2\ng b\nl 2 3\nusemtl x\nl 3 4\ng c\nl 4 5\n"), [1, 1, 1, 1]);
    assert_eq!(pens("g b 3\nl 1 2\ng b\nl 2 3\nusemtl x\nl 3 4\nusemtl y\nl 4 5\n"), [1, 1, 1, 2]);
    assert_eq!(
        pens("usemtl PEN2\nl 1 2\nusemtl a\nl 2 3\nusemtl b\nl 3 4\nusemtl 2\nl 4 5\n"),
        [2, 1, 3, 2]
    );
    assert_eq!(pens("usemtl b\nl 1 2\n$clear\nv 0 0 0\nv 1 1 0\nusemtl c\nl 1 2\n"), [1]);

    let mut bench = bench(bars);
    for name in 1..=32 {
        assert_eq!(bench.say(&format!("usemtl name{name}\n")), "ok\n");
    }
    let before = bench.say("$model\n");
    for name in ["name33", "pen33", "pen0", "99"] {
        assert_eq!(
            bench.say(&format!("usemtl {name}\n")),
            "[MSG:there are pens 1 to 32, and other names take a free one each: send $pens=one to \
             draw all with one]\n\
             error:127\n"
        );
    }
    assert_eq!(bench.say("$model\n"), before);
    assert_eq!(
        bench.say("$pens=one\nusemtl name33\n$pens=auto\nusemtl name7\nl 1 2\n"),
        "ok\n".repeat(5)
    );
    assert_eq!(job(&mut bench).0.bars[0].2, 7);
}

/// The length of a stretch on the image plane.
fn length(projection: Projection, stretch: &Stretch) -> f64 {
    let (p, q) = stretch.ends;
    let [from, to] = [stretch.from, stretch.to].map(|along| {
        let part = along.numerator as f64 / along.denominator as f64;
        let between = |p: i32, q: i32| f64::from(p) * (1.0 - part) + f64::from(q) * part;
        let w = if projection == Projection::Perspective { between(p.z, q.z) } else { 1.0 };
        [between(p.x, q.x) / w, between(p.y, q.y) / w]
    });
    (from[0] - to[0]).hypot(from[1] - to[1])
}

#[test]
fn pens_change_no_line_and_each_edge_has_the_lowest_of_its_own() {
    for seed in 0..2000 {
        let random = random_scene(seed);
        let mut number = Random::new(seed);
        let mut words = vec![0u64; 1000];
        let mut writer = PenWriter::new(&mut Scratch::new(&mut words), 1000).unwrap();
        // The pens of each edge, by the numbers of its ends.
        let mut pens: BTreeMap<(u16, u16), Vec<u8>> = BTreeMap::new();
        let (mut at, mut pen) = (0, 0);
        for element in random.corners.split_inclusive(|corner| corner.is_last()) {
            if number.once_in(2) {
                pen = number.between(0, 5) as u8;
            }
            writer.element(at, pen);
            at += element.len();
            let next = element.iter().cycle().skip(1);
            for (a, b) in element.iter().zip(next) {
                let (a, b) = (a.vertex(), b.vertex());
                pens.entry((a.min(b), a.max(b))).or_default().push(pen);
            }
        }
        let elements = [Pens::default(), writer.finish()]
            .map(|pens| Elements::with_pens(&random.corners, pens));
        let [plain, with_pens] = elements.map(|elements| {
            let (vertices, projection) = (&random.vertices[..], random.projection);
            let scene = Scene { vertices, elements, projection, unrounded: Unrounded::UNKNOWN };
            let mut words = vec![0u64; scratch_bytes(&scene) / 8 + 2000];
            let mut found = Stretches::default();
            let options = Options { with_hidden: true, ..Options::default() };
            let scratch = Scratch::new(&mut words);
            find_stretches(&scene, options, scratch, &mut NeverCancel, &mut found).unwrap();
            found.0
        });
        let whole = |stretches: &[Stretch]| -> f64 {
            let visible = stretches.iter().filter(|stretch| stretch.visible);
            visible.map(|stretch| length(random.projection, stretch)).sum()
        };
        let (a, b) = (whole(&plain), whole(&with_pens));
        assert!((a - b).abs() <= 1e-9 * a.max(1e-9), "seed {seed}: {a} {b}");
        assert!(plain.iter().all(|stretch| stretch.pen == 0));
        for stretch in &with_pens {
            if let Some((a, b)) = stretch.edge {
                let lowest = pens[&(a.min(b), a.max(b))].iter().min();
                assert_eq!(Some(&stretch.pen), lowest, "seed {seed}: {stretch:?}");
            }
        }
    }
}

#[test]
fn a_hold_before_the_last_stroke_asks_for_no_pen_yet() {
    let mut bench = bench("v 10 10 0\nv 200 10 0\nv 200 20 0\nl 1 2\nusemtl pen2\nl 2 3\n");
    assert_eq!(bench.say("$plot\n"), "ok\n");
    // This is in the middle of the first stroke; the path has been read to its end.
    while bench.plotter.machine().position_mm()[0] < 100 {
        bench.plotter.poll(&mut bench.board);
        bench.board.wait();
    }
    bench.say("!");
    bench.finish();
    let held = bench.say("?");
    assert!(held.starts_with("<Hold:0|") && !held.contains("Pen:"), "{held}");
    assert_eq!(bench.say("~"), "");
    bench.finish();
    assert_eq!(bench.heard(), "[MSG:put in pen 2, then send ~]\n");
    assert!(bench.say("?").contains("|Pen:2|"));
}

#[test]
fn the_machine_asks_for_each_pen_once() {
    let mut bench = bench(
        "v 10 10 0\nv 20 10 0\nv 20 20 0\nv 10 20 0\nusemtl pen2\nl 1 2\nusemtl pen4\nl 2 \
         3\nusemtl pen1\nl 3 4\n",
    );
    assert_eq!(bench.say("$plot\n"), "ok\n");
    for pen in [2, 4] {
        bench.finish();
        assert_eq!(bench.heard(), format!("[MSG:put in pen {pen}, then send ~]\n"));
        let status = bench.say("?");
        assert!(
            status.starts_with("<Hold:0|") && status.contains(&format!("|Pen:{pen}|")),
            "{status}"
        );
        assert_eq!(bench.say("~"), "");
    }
    bench.finish();
    assert_eq!(bench.heard(), "");
    assert!(bench.say("?").starts_with("<Idle|"));
    // The last pen is still in the holder.
    assert_eq!(bench.say("$plot\n"), "ok\n");
    bench.finish();
    assert_eq!(bench.heard(), "[MSG:put in pen 1, then send ~]\n");
}
