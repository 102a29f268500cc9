//! Tests of the methods of determining visibility over the serial line, each against the others
//! where they overlap.

// A test fails by panicking.
#![allow(clippy::panic, clippy::expect_used, reason = "a test fails by panicking")]

use penup::machine::Path;
use penup::plotter::Observer;
use penup::protocol::CommandError;
use penup::stage::NeverCancel;
use penup::view::View;
use penup::visibility::Stretch;
use penup_host_tests::cut_jobs::{ink, strokes_of};
use penup_host_tests::whole_jobs::{Bench, job_lines};
use penup_job::pins::PinChange;
use std::collections::BTreeSet;

const CONVEX: [&str; 5] = ["cube", "octahedron", "icosahedron", "dodecahedron", "eighteen"];

/// The indices of the vertices that an edge joins, and whether the edge is visible.
type Seen = BTreeSet<((u16, u16), bool)>;

#[derive(Default)]
struct Whole(Seen);

impl Observer for Whole {
    fn stretch(&mut self, _: &View, stretch: &Stretch) {
        let (a, b) = stretch.edge.expect("one solid has no seam");
        assert!(
            stretch.from.numerator == 0 && stretch.to.numerator == stretch.to.denominator,
            "an edge of a convex solid is visible from end to end or not at all"
        );
        assert!(self.0.insert(((a.min(b), a.max(b)), stretch.visible)), "each edge comes once");
    }

    fn plan_bar(&mut self, _: [f64; 2], _: [f64; 2], _: u8) {
        panic!("a solid is no plan");
    }
}

fn with_scene(scene: &str, keep: impl Fn(&str) -> bool) -> Bench {
    let mut bench = Bench::new();
    bench.heard();
    for line in job_lines(&format!("{scene}.obj"), &[]) {
        if line != "$plot" && keep(&line) {
            assert_eq!(bench.say(&format!("{line}\n")), "ok\n", "{line}");
        }
    }
    bench
}

fn seen(bench: &mut Bench, settings: &str) -> Result<Seen, CommandError> {
    assert!(!bench.say(settings).contains("error"), "{settings}");
    let mut whole = Whole::default();
    bench.plotter.compute(&mut NeverCancel, &mut whole)?;
    Ok(whole.0)
}

/// Positions of the eye outside a solid whose largest coordinate is 1, without any symmetry to it.
const EYES: [[f64; 3]; 6] = [
    [6.0, 3.1, 2.3],
    [-5.3, 4.7, 1.9],
    [2.9, -7.1, -4.3],
    [-3.7, -4.1, 6.7],
    [1.3, 7.9, -5.9],
    [8.3, -2.1, 5.7],
];

fn eyes(bench: &Bench) -> impl Iterator<Item = String> + use<> {
    let model = bench.plotter.model();
    let unit = 1.0 / f64::from(1u32 << model.fraction_bits());
    let coordinates = model.vertices().iter().flat_map(|vertex| vertex.coordinates());
    let greatest = coordinates.map(i32::abs).max().expect("vertices");
    EYES.into_iter().map(move |eye| {
        let [x, y, z] = eye.map(|c| c * f64::from(greatest) * unit);
        format!("{x:.3},{y:.3},{z:.3}")
    })
}

#[test]
fn vertices_alone_edges_alone_and_faces_show_the_same_solid() {
    for scene in CONVEX {
        let mut bench = with_scene(scene, |_| true);
        let mut vertices_alone = with_scene(scene, |line| !line.starts_with('f'));
        for eye in eyes(&bench) {
            for projection in ["perspective", "orthographic", "oblique,30,0.7"] {
                let view = format!("$eye={eye}\n$projection={projection}\n$hidden=dotted\n");
                let faces = seen(&mut bench, &format!("{view}$see=faces\n")).unwrap();
                assert!(faces.iter().any(|(_, visible)| !visible), "{scene} from {eye}");
                let edges = seen(&mut bench, &format!("{view}$see=edges\n")).unwrap();
                assert_eq!(edges, faces, "{scene} from {eye} in {projection}");
                let vertices =
                    seen(&mut vertices_alone, &format!("{view}$see=vertices\n")).unwrap();
                assert_eq!(vertices, faces, "{scene} from {eye} in {projection}");
                // A wire frame is the visible and the hidden edges.
                let wire = seen(&mut bench, &format!("{view}$see=wire\n")).unwrap();
                let all: Seen = faces.iter().map(|(edge, _)| (*edge, true)).collect();
                assert_eq!(wire, all, "{scene} from {eye} in {projection}");
                let erased = seen(&mut bench, "$hidden=erased\n$see=faces\n").unwrap();
                assert_eq!(erased, seen(&mut bench, "$see=edges\n").unwrap());
                assert_eq!(erased, seen(&mut vertices_alone, "$hidden=erased\n").unwrap());
            }
        }
    }
}

#[test]
fn edges_that_rounding_made_are_left_out_and_counted() {
    let mut bench = with_scene("dodecahedron", |line| !line.starts_with('f'));
    let said = bench.say("$rotate=z,33\n$rotate=x,20\n$see=vertices\n$hidden=dotted\n$plot\n");
    assert!(said.contains(" edges are left out: within the precision"), "{said}");
    bench.finish();
    assert_eq!(seen(&mut bench, "").unwrap().len(), 30);
}

#[test]
fn a_thin_slab_has_twelve_edges_at_any_precision_that_a_file_tells() {
    // 0.002 thick and 300 long: within 2^-17 of a plane.
    let corners = (0..8).map(|n| [n & 1, n >> 1 & 1, n >> 2 & 1]);
    let vertices: String = corners
        .map(|[x, y, z]| format!("v {} {} {y}.{}\n", 300 * x, 200 * y + 7 * x, 123 + 2 * z))
        .collect();
    for precision in ["auto", "0"] {
        let mut bench = Bench::new();
        bench.heard();
        let said = bench.say(&format!("{vertices}$precision={precision}\n$see=vertices\n"));
        assert!(!said.contains("error"), "{said}");
        let edges = seen(&mut bench, "$hidden=dotted\n").unwrap();
        assert_eq!(edges.len(), 12, "{precision}");
    }
    let said = Bench::new().say("$precision=0.010\n$options\n$precision=-1\n");
    assert!(said.contains("$precision=10e-3\n") && said.contains("error"), "{said}");
}

#[test]
fn the_same_strokes_are_drawn_whichever_way_is_chosen() {
    // Seen straight on and along an axis of symmetry, too: what is edge-on is inked once.
    for (scene, eye) in [("cube", "0,-9,0"), ("octahedron", "9,9,9"), ("dodecahedron", "3,7,4")] {
        let mut bench = with_scene(scene, |_| true);
        let totals = ["faces", "edges", "vertices"].map(|method| {
            bench.say(&format!(
                "$eye={eye}\n$at=0,0,0\n$projection=orthographic\n$see={method}\n$plot\n"
            ));
            bench.finish();
            let drawn = bench.plotter.machine().status().done.drawn;
            bench.say("$clear\n");
            bench = with_scene(scene, |_| true);
            drawn
        });
        assert!(totals[0] > 0, "{scene}");
        let near = |total: u64| total.abs_diff(totals[0]) < totals[0] / 2000;
        assert!(near(totals[1]) && near(totals[2]), "{scene}: {totals:?}");
    }
}

#[test]
fn what_is_no_convex_solid_is_refused_and_nothing_is_lost() {
    let mut bench = with_scene("lattice2", |_| true);
    let before = bench.say("$model\n$options\n");
    let answer = bench.say("$see=vertices\n$plot\n");
    assert!(answer.contains("[MSG:") && answer.ends_with("error:125\n"), "{answer}");
    // Three loose bars.
    let mut open = Bench::new();
    let answer = open.say(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv .5 .5 1\nl 1 2\nl 3 4\nl 1 5\n$see=edges\n$plot\n",
    );
    assert!(answer.contains("[MSG:no edge leads") && answer.ends_with("error:125\n"), "{answer}");
    let mut cube = with_scene("cube", |_| true);
    let answer = cube.say("$see=vertices\n$eye=0.1,0,0\n$at=5,0,0\n$plot\n");
    assert!(answer.ends_with("error:126\n"), "{answer}");
    let answer = with_scene("grid20", |_| true).say("$see=edges\n$plot\n");
    assert!(!answer.contains("error"), "a flat polygon is drawn: {answer}");
    assert_eq!(Bench::new().say("$see=vertices\n$plot\n").lines().last(), Some("error:120"));
    bench.say("$see=faces\n");
    assert_eq!(bench.say("$model\n$options\n"), before);
    assert!(!bench.say("$plot\n").contains("error"));
}

#[test]
fn a_ball_of_loose_triangles_is_a_circle() {
    // Each triangle of an icosahedron divided twice, with vertices of its own.
    let mut text = String::new();
    let phi = (1.0 + 5f64.sqrt()) / 2.0;
    let corners: Vec<[f64; 3]> = [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)]
        .iter()
        .flat_map(|&(a, b)| [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]])
        .collect();
    let distance = |p: [f64; 3], q: [f64; 3]| {
        (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum::<f64>().sqrt()
    };
    let near = |p, q| (distance(p, q) - 2.0).abs() < 1e-9;
    let on_ball = |p: [f64; 3]| {
        let length = distance(p, [0.0; 3]);
        p.map(|c| c / length)
    };
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [p, q, r] = [corners[i], corners[j], corners[k]];
                if near(p, q) && near(q, r) && near(p, r) {
                    triangles.push([p, q, r]);
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..2 {
        triangles = triangles
            .into_iter()
            .flat_map(|[p, q, r]| {
                let middle =
                    |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|i: usize| (a[i] + b[i]) / 2.0);
                let [a, b, c] = [middle(p, q), middle(q, r), middle(r, p)];
                [[p, a, c], [a, q, b], [c, b, r], [a, b, c]]
            })
            .collect();
    }
    for triangle in &triangles {
        for p in triangle {
            let [x, y, z] = on_ball(*p);
            text += &format!("v {x:.7} {y:.7} {z:.7}\n");
        }
        text += "f -3 -2 -1\n";
    }
    let mut bench = Bench::new();
    assert!(!bench.say(&text).contains("error"));
    let net = bench.say("$eye=7,5,3\n$crease=60\n$plot\n");
    assert!(!net.contains("error"), "{net}");
    bench.finish();
    let report = *bench.plotter.job().report();
    let status = bench.plotter.machine().status();
    // One closed outline: no odd point, one part, one stroke.
    assert_eq!((report.odd_points, report.components, status.done.strokes), (0, 1, 1));
}

#[test]
fn faces_without_an_area_are_counted() {
    let mut bench = Bench::new();
    bench.heard();
    let said = bench
        .say("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 2 1\nv 1 0 0\nf 1 2 3\nf 1 3 4\nf 2 5 4\n$plot\n");
    assert!(said.contains("[MSG:2 faces have no area and are left out]\n"), "{said}");
    assert!(said.ends_with("ok\n"), "{said}");
}

#[test]
fn an_eye_inside_sees_what_is_before_it_and_stays_on_the_page() {
    for see in ["faces", "wire"] {
        let mut bench = with_scene("lattice3", |_| true);
        let view = "$eye=1.5,1.5,1.5\n$at=5,4,3\n$page=100x100\n$margin=10\n";
        assert!(bench.say(&format!("{view}$see={see}\n$plot\n")).ends_with("ok\n"));
        let steps = 80 * 10..=80 * 90;
        let mut path = bench.plotter.strokes();
        let mut targets = 0;
        // Something is drawn within a tenth of the page about its middle, and nothing off the page.
        let mut in_the_middle = 0;
        while let Some(target) = path.next_target() {
            let position = [target.point.x, target.point.y];
            assert!(position.iter().all(|steps_of| steps.contains(steps_of)), "{position:?}");
            targets += 1;
            in_the_middle += i32::from(position.iter().all(|steps| (steps - 4000).abs() < 1500));
        }
        assert!(
            targets > 40 && in_the_middle > 10,
            "{targets} targets, {in_the_middle} in the middle"
        );
    }
}

/// The normals of the faces are rounded differently from each eye.
#[test]
fn an_edge_that_bends_by_the_crease_is_drawn_from_every_eye() {
    let prism = |sides: u32| {
        let mut lines = String::new();
        for n in 0..sides {
            let (y, x) = (std::f64::consts::TAU * f64::from(n) / f64::from(sides)).sin_cos();
            lines +=
                &format!("v {:.6} {:.6} 0\nv {:.6} {:.6} 9\n", 5.0 * x, 5.0 * y, 5.0 * x, 5.0 * y);
        }
        for n in 0..sides {
            let (a, b) = (2 * n + 1, 2 * ((n + 1) % sides) + 1);
            lines += &format!("f {a} {b} {} {}\n", b + 1, a + 1);
        }
        for end in 0..2 {
            let corners: Vec<_> = (0..sides).map(|n| (2 * n + 1 + end).to_string()).collect();
            lines += &format!("f {}\n", corners.join(" "));
        }
        lines
    };
    for (sides, bend) in [(4, 90), (6, 60), (8, 45), (12, 30)] {
        let mut bench = Bench::new();
        bench.heard();
        assert!(!bench.say(&prism(sides)).contains("error"));
        for eye in ["30,-40,35", "17,-50,33", "-21,44,-37", "60,31,23", "13,79,-59"] {
            for projection in ["perspective", "orthographic"] {
                let view = format!("$eye={eye}\n$at=0,0,4.5\n$projection={projection}\n");
                let all = seen(&mut bench, &format!("{view}$crease=0\n")).expect("drawn");
                let found = seen(&mut bench, &format!("$crease={bend}\n")).expect("drawn");
                assert_eq!(found, all, "{sides} sides from {eye}, {projection}");
                let fewer = seen(&mut bench, &format!("$crease={}\n", bend + 1)).expect("drawn");
                assert!(fewer.len() < all.len(), "{sides} sides from {eye}, {projection}");
            }
        }
    }
}

/// Two rectangles with a common edge. Cosines of small angles hardly differ from 1.
#[test]
fn a_slight_bend_is_told_from_one_that_is_a_little_less() {
    for bend in [0.5, 1.0, 2.0, 5.0] {
        let (y, x) = f64::to_radians(bend).sin_cos();
        let mut bench = Bench::new();
        bench.heard();
        let model = format!(
            "v -5 0 0\nv -5 0 9\nv 0 0 9\nv 0 0 0\nv {:.6} {:.6} 0\nv {:.6} {:.6} 9\nf 1 2 3 4\n\
             f 4 3 6 5\n",
            5.0 * x,
            5.0 * y,
            5.0 * x,
            5.0 * y
        );
        assert!(!bench.say(&model).contains("error"));
        for eye in ["30,-40,35", "17,-50,33", "-21,-44,-37", "5,-60,23", "13,-79,-59"] {
            for projection in ["perspective", "orthographic"] {
                let view = format!("$eye={eye}\n$at=0,0,4.5\n$projection={projection}\n");
                for (crease, edges) in [(bend, 7), (bend + 0.1, 6), (bend - 0.1, 7)] {
                    let found = seen(&mut bench, &format!("{view}$crease={crease}\n"));
                    assert_eq!(found.expect("drawn").len(), edges, "{bend} {crease} {eye}");
                }
            }
        }
    }
}

/// What lies near the plane of the eye has its image almost at infinity.
#[test]
fn a_solid_that_is_partly_behind_the_eye_is_as_large_as_its_faces() {
    let corners = [(-10, -10), (10, -10), (10, 10), (-10, 10)];
    let mut model = String::new();
    for z in [-1, 0] {
        for (x, y) in corners {
            model += &format!("v {x} {y} {z}\n");
        }
    }
    for face in ["4 3 2 1", "5 6 7 8", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8"] {
        model += &format!("f {face}\n");
    }
    let mut bench = Bench::new();
    bench.heard();
    assert!(!bench.say(&format!("{model}$eye=-6,2,3\n$at=8,1,0\n")).contains("error"));
    let mut drawn = 0;
    let [faces, vertices] = ["faces", "vertices"].map(|see| {
        let answer = bench.say(&format!("$see={see}\n$plot\n"));
        assert!(answer.ends_with("ok\n"), "{see}: {answer}");
        bench.finish();
        let strokes = strokes_of(bench.board.trace().changes().iter().map(PinChange::from));
        let new = ink(strokes.iter().skip(drawn));
        drawn = strokes.len();
        new
    });
    let differing = faces.symmetric_difference(&vertices).count();
    assert!(faces.len() > 1000 && differing < 10, "{} {differing}", faces.len());
}

/// From far away the depths of a model would be the same number, so that nothing hides.
#[test]
fn the_same_is_hidden_however_far_the_eye_is() {
    let mut bench = with_scene("cube", |_| true);
    for direction in [[6.0, -10.0, 8.0], [-7.0, -3.0, -9.0]] {
        let eye = |times: f64| {
            let [x, y, z] = direction.map(|part: f64| part * times);
            format!("$eye={x},{y},{z}\n$at=0.5,0.5,0.5\n")
        };
        let straight = format!("$projection=orthographic\n{}", eye(1.0));
        let expected = seen(&mut bench, &straight).expect("drawn");
        assert_eq!(expected.len(), 9);
        for times in [1.0, 20.0, 100.0, 140.0, 150.0, 170.0, 200.0, 300.0, 1e3, 1e4, 1e6, 1e9, 1e14]
        {
            let view = format!("$projection=perspective\n{}", eye(times));
            assert_eq!(seen(&mut bench, &view).expect("drawn"), expected, "{view}");
        }
    }
}
