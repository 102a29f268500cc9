//! Tests of the model editor over the serial line against plain vectors, and of whole sessions.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use penup::model::Element;
use penup::plotter::{EMPTY_LOOKAHEAD, Memory};
use penup_host_tests::whole_jobs::Bench;
use proptest::prelude::*;

/// The vertices and the pen of a bar, face or curve.
type Drawn = (Vec<usize>, u8);

/// The expected model of the plotter, made of vectors.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Plain {
    vertices: Vec<[i64; 3]>,
    bars: Vec<Drawn>,
    faces: Vec<Drawn>,
    curves: Vec<Drawn>,
    pens: Pens,
}

/// How pens are chosen; the model does not show this.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
struct Pens {
    current: u8,
    by_material: bool,
    /// The pen of each name; a pen that was chosen by number has an empty name.
    names: Vec<(u8, String)>,
}

impl Pens {
    fn choose(&mut self, name: &str) {
        let taken = |pen: u8| self.names.iter().any(|(taken, _)| *taken == pen);
        let named = self.names.iter().find(|(_, known)| known == name).map(|(pen, _)| *pen);
        if let Some(number) = name.strip_prefix("pen") {
            self.current = number.parse::<u8>().unwrap() - 1;
            if !taken(self.current) {
                self.names.push((self.current, String::new()));
            }
        } else {
            self.current = named.unwrap_or_else(|| (0..).find(|pen| !taken(*pen)).unwrap());
            if named.is_none() {
                self.names.push((self.current, name.to_owned()));
            }
        }
    }
}

fn of(bench: &Bench) -> Plain {
    let model = bench.plotter.model();
    let unit = 1i64 << model.fraction_bits();
    let whole = |c: i32| {
        assert_eq!(i64::from(c) % unit, 0, "whole numbers stay whole");
        i64::from(c) / unit
    };
    let mut plain = Plain {
        vertices: model.vertices().iter().map(|p| p.coordinates().map(whole)).collect(),
        ..Plain::default()
    };
    for (element, pen) in model.elements().iter_with_pens() {
        match element {
            Element::Bar(from, to) => plain.bars.push((vec![from.into(), to.into()], pen)),
            Element::Face(corners) => {
                let numbers = corners.iter().map(|corner| corner.vertex().into()).collect();
                plain.faces.push((numbers, pen));
            }
        }
    }
    let control = |control: &[u16]| control.iter().map(|number| usize::from(*number)).collect();
    let curves = model.curves();
    plain.curves = curves.iter().map(|curve| (control(curve.control), curve.pen)).collect();
    assert_eq!(
        (model.bar_count(), model.face_count(), model.curve_count()),
        (plain.bars.len(), plain.faces.len(), plain.curves.len())
    );
    plain
}

impl Plain {
    fn parts(&mut self) -> [&mut Vec<Drawn>; 3] {
        [&mut self.bars, &mut self.faces, &mut self.curves]
    }

    /// Everything that the model shows.
    fn shown(&self) -> Self {
        Self { pens: Pens::default(), ..self.clone() }
    }

    /// `usemtl`, or `g`.
    fn choose_pen(&mut self, by_material: bool, name: &str) {
        if by_material && !self.pens.by_material {
            self.pens = Pens { by_material, ..Pens::default() };
            for part in self.parts() {
                part.iter_mut().for_each(|(_, pen)| *pen = 0);
            }
        }
        if by_material == self.pens.by_material {
            self.pens.choose(name);
        }
    }

    fn renumber(&mut self, new: impl Fn(usize) -> Option<usize>) {
        for part in self.parts() {
            *part = part
                .iter()
                .filter_map(|(numbers, pen)| {
                    let numbers: Option<_> = numbers.iter().map(|number| new(*number)).collect();
                    Some((numbers?, *pen))
                })
                .collect();
        }
    }

    fn mirror(&mut self, axis: usize, at: i64, range: std::ops::RangeInclusive<usize>) {
        let mut images = vec![None; self.vertices.len()];
        for number in range {
            let mut image = self.vertices[number];
            image[axis] = 2 * at - image[axis];
            if image == self.vertices[number] {
                images[number] = Some(number);
            } else {
                images[number] = Some(self.vertices.len());
                self.vertices.push(image);
            }
        }
        for (part, elements) in self.parts().into_iter().enumerate() {
            for (numbers, pen) in elements.clone() {
                let copy: Option<Vec<usize>> =
                    numbers.iter().map(|number| images[*number]).collect();
                let Some(mut copy) = copy.filter(|copy| *copy != numbers) else { continue };
                if part == 1 {
                    copy[1..].reverse();
                }
                elements.push((copy, pen));
            }
        }
    }
}

/// A random change as a command, applied also to the vectors; `None` if it makes no sense here.
fn change(plain: &mut Plain, kind: u8, a: usize, b: usize, c: i64) -> Option<String> {
    let count = plain.vertices.len();
    let c = c % 50;
    let one = |at: usize, of: usize| if of == 0 { None } else { Some(at % of) };
    let range = |of: usize| Some((one(a, of)?.min(one(b, of)?), one(a, of)?.max(one(b, of)?)));
    let map = |plain: &mut Plain, first: usize, last: usize, map: &dyn Fn([i64; 3]) -> [i64; 3]| {
        for vertex in &mut plain.vertices[first..=last] {
            *vertex = map(*vertex);
        }
    };
    match kind {
        0 => {
            plain.vertices.push([c, a as i64 % 7, b as i64 % 7]);
            Some(format!("v {c} {} {}", a % 7, b % 7))
        }
        1 => {
            let (from, to) = (one(a, count)?, one(b, count)?);
            (from != to).then(|| {
                plain.bars.push((vec![from, to], plain.pens.current));
                format!("l {} {}", from + 1, to as i64 - count as i64)
            })
        }
        2 => {
            let corners = [one(a, count)?, one(b, count)?, one(a + b + 1, count)?];
            let distinct =
                corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0];
            distinct.then(|| {
                plain.faces.push((corners.to_vec(), plain.pens.current));
                format!("f {} {} {}", corners[0] + 1, corners[1] + 1, corners[2] + 1)
            })
        }
        3 => {
            let control = vec![one(a, count)?, one(b, count)?, one(a + b, count)?];
            plain.curves.push((control.clone(), plain.pens.current));
            Some(format!(
                "deg 2\ncurv 0 1 {} {} {}\nparm u 0 0 0 1 1 1\nend",
                control[0] + 1,
                control[1] + 1,
                control[2] + 1
            ))
        }
        4 => {
            let (first, last) = range(count)?;
            let gone = last - first + 1;
            plain.vertices.drain(first..=last);
            plain.renumber(|number| match number {
                number if number < first => Some(number),
                number if number > last => Some(number - gone),
                _ => None,
            });
            Some(format!("$delete=v,{},{}", last as i64 - count as i64, first + 1))
        }
        5 => {
            let at = one(a, count)?;
            plain.vertices.swap_remove(at);
            plain.renumber(|number| match number {
                number if number == at => None,
                number if number == count - 1 => Some(at),
                number => Some(number),
            });
            Some(format!("$plug=v,{}", at + 1))
        }
        6 | 7 => {
            let part = b % 3;
            let elements = &mut *plain.parts()[part];
            let at = one(a, elements.len())?;
            let name = ["l", "f", "c"][part];
            if kind == 6 {
                elements.remove(at);
                Some(format!("$delete={name},{}", at + 1))
            } else {
                elements.swap_remove(at);
                Some(format!("$plug={name},{}", at + 1))
            }
        }
        8 => {
            let at = one(a, count)?;
            plain.vertices[at] = [c, -c, b as i64 % 9];
            Some(format!("$move={},{c},{},{}", at + 1, -c, b % 9))
        }
        9 => {
            let (first, last) = range(count)?;
            map(plain, first, last, &|[x, y, z]| [x + c, y - 3, z + 1]);
            Some(format!("$translate={c},-3,1,{},{}", first + 1, last + 1))
        }
        10 => {
            let (first, last) = range(count)?;
            map(plain, first, last, &|[x, y, z]| [2 * x, -y, z]);
            Some(format!("$scale=2,-1,1,{},{}", first + 1, last + 1))
        }
        11 => {
            one(a, count)?;
            let axis = b % 3;
            let (from, to) = ((axis + 1) % 3, (axis + 2) % 3);
            map(plain, 0, count - 1, &|mut p| {
                (p[from], p[to]) = (-p[to], p[from]);
                p
            });
            Some(format!("$rotate={},-270", ["x", "y", "z"][axis]))
        }
        14 | 15 => {
            // As in a file: groups first, then perhaps materials.
            let name = ["red", "pen2", "blue", "pen1", "Red", "pen32"][a % 6];
            plain.choose_pen(kind == 15, name);
            Some(format!("{} {name}", if kind == 15 { "usemtl" } else { "g" }))
        }
        _ => {
            // The plane through three vertices that have a coordinate in common and are not in
            // line.
            let axis = a % 3;
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            let at = plain.vertices.get(one(b, count)?)?[axis];
            let there: Vec<usize> = (0..count).filter(|n| plain.vertices[*n][axis] == at).collect();
            let triples = there.iter().flat_map(|p| there.iter().map(move |q| (*p, *q)));
            let (p, q, r) = triples.flat_map(|(p, q)| there.iter().map(move |r| (p, q, *r))).find(
                |(p, q, r)| {
                    let [p, q, r] = [*p, *q, *r].map(|number| plain.vertices[number]);
                    (q[i] - p[i]) * (r[j] - p[j]) != (q[j] - p[j]) * (r[i] - p[i])
                },
            )?;
            let numbers = format!("{},{},{}", p + 1, q + 1, r + 1);
            if kind == 12 {
                map(plain, 0, count - 1, &|mut p| {
                    p[axis] = 2 * at - p[axis];
                    p
                });
                for (face, _) in &mut plain.faces {
                    face[1..].reverse();
                }
                Some(format!("$reflect={numbers}"))
            } else {
                let (first, last) = range(count)?;
                plain.mirror(axis, at, first..=last);
                Some(format!("$mirror={numbers},{},{}", first + 1, last + 1))
            }
        }
    }
}

/// Changes that are refused for every model.
const REFUSED: [&str; 12] = [
    "v 1e12 0 0",
    "f 1 2 9999",
    "f 1 1 1",
    "l 1",
    "deg 1\ncurv 2 1 1 2\nend",
    "$delete=v,9999",
    "$plug=f,9999",
    "$move=9999,1,2,3",
    "$translate=1e12,0,0",
    "$scale=1e9,1e9,1e9",
    "$mirror=1,1,1",
    "$reflect=2,9999,1",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn any_changes_do_what_they_do_to_plain_vectors_and_are_taken_back(
        // More elements are added than removed, and pens change often.
        changes in prop::collection::vec(
            (
                prop_oneof![4 => 0u8..4, 2 => 6u8..16, 1 => 4u8..6, 2 => 14u8..16],
                any::<u16>(),
                any::<u16>(),
                -50i64..50,
            ),
            1..80,
        ),
    ) {
        let memory = Box::leak(Box::new(Memory::<60, 400, 400>::new()));
        let mut bench = Bench::with_memory(memory.lend(Box::leak(Box::new(EMPTY_LOOKAHEAD))));
        let mut plain = Plain::default();
        for position in [[0, 0, 0], [4, 0, 0], [0, 5, 0], [0, 0, 6], [4, 5, 6]] {
            bench.say(&format!("v {} {} {}\n", position[0], position[1], position[2]));
            plain.vertices.push(position);
        }
        for (kind, a, b, c) in changes {
            let before = plain.clone();
            let Some(line) = change(&mut plain, kind, a.into(), b.into(), c) else { continue };
            // Numbers grow with repeated scaling; the vectors would have no limit.
            let is_large = plain.vertices.iter().flatten().any(|c| c.abs() > 1 << 20);
            let answer = bench.say(&format!("{line}\n"));
            if answer.contains("error:") || is_large {
                // Full.
                prop_assert!(
                    is_large || answer.contains("error:113") || answer.contains("error:114"),
                    "{line}: {answer}"
                );
                prop_assert!(is_large || of(&bench) == before.shown(), "{line}");
                break;
            }
            prop_assert_eq!(of(&bench), plain.shown(), "{}", line);
            // To choose the same pen again is no change.
            if b % 3 == 0 && (kind < 14 || plain != before) {
                // Commands that are refused in between change nothing, and neither do commands that
                // are undone. Nothing is too far for a model without vertices.
                if !plain.vertices.is_empty() {
                    let refused = REFUSED[usize::from(a) % REFUSED.len()];
                    let answer = bench.say(&format!("{refused}\n"));
                    prop_assert!(answer.contains("error:"), "{}: {}", refused, answer);
                    prop_assert_eq!(of(&bench), plain.shown(), "{}", refused);
                }
                prop_assert_eq!(bench.say("$undo\n"), "ok\n");
                prop_assert_eq!(of(&bench), before.shown(), "{} taken back", line);
                plain = before;
            }
        }
    }
}

#[test]
fn a_session_reads_as_it_is_documented() {
    let mut bench = Bench::new();
    bench.heard();
    bench
        .say("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1.25\nl 1 2 3 4 1\nf 1 2 5\nf 2 3 5\n");
    bench.say("deg 2\ncurv 2 3 1 5 3\nend\n");
    for (line, answer) in [
        ("$list=v,-1", "[v 5: 0.500000 0.500000 1.250000]\nok\n"),
        ("$list=l,2,3", "[l 2: 2 3]\n[l 3: 3 4]\nok\n"),
        ("$list=f", "[f 1: 1 2 5]\n[f 2: 2 3 5]\nok\n"),
        ("$list=c", "[c 1 of degree 2: 1 5 3]\nok\n"),
        ("$delete=v,2", "[EDIT:vertices -1, bars -2, faces -2, curves +0]\nok\n"),
        ("$list=c", "[c 1 of degree 2: 1 4 2]\nok\n"),
        ("$undo", "ok\n"),
        (
            "$undo",
            "[MSG:only the last change can be taken back, and not after a plot]\nerror:143\n",
        ),
        ("$plug=v,2", "[EDIT:vertices -1, bars -2, faces -2, curves +0]\nok\n"),
        ("$list=l", "[l 1: 3 4]\n[l 2: 4 1]\nok\n"),
        ("$list=c", "[c 1 of degree 2: 1 2 3]\nok\n"),
        ("$undo", "ok\n"),
        ("$mirror=1,2,3", "[EDIT:vertices +1, bars +0, faces +2, curves +1]\nok\n"),
        ("$list=v,6", "[v 6: 0.500000 0.500000 -1.250000]\nok\n"),
        ("$list=f,3,4", "[f 3: 1 6 2]\n[f 4: 2 6 3]\nok\n"),
        ("$rotate=z,90", "[EDIT:vertices +0, bars +0, faces +0, curves +0]\nok\n"),
        ("$list=v,2", "[v 2: 0.000000 1.000000 0.000000]\nok\n"),
        ("$scale=100,100,100,2,3", "[EDIT:vertices +0, bars +0, faces +0, curves +0]\nok\n"),
        (
            "$list=v,2,3",
            "[v 2: 0.000000 100.000000 0.000000]\n[v 3: -100.000000 100.000000 0.000000]\nok\n",
        ),
        ("$delete=l,5", "[MSG:there is no bar 5: the model has 4]\nerror:118\n"),
        ("$delete=v,9", "[MSG:there is no vertex 9: the model has 6]\nerror:110\n"),
        ("$mirror=1,2,2", "[MSG:three vertices that are not in line make a plane]\nerror:119\n"),
        ("$translate=1e12,0,0", "[MSG:coordinates go up to 1073741824]\nerror:115\n"),
        ("$move=1,2", "[MSG:it takes 4 numbers]\nerror:103\n"),
        ("$scale=2,2,2", "[EDIT:vertices +0, bars +0, faces +0, curves +0]\nok\n"),
        ("$mirror=1,2,9", "[MSG:there is no vertex 9: the model has 6]\nerror:110\n"),
        ("$undo", "ok\n"),
        ("$list=v,2", "[v 2: 0.000000 100.000000 0.000000]\nok\n"),
        ("$rotate=w,2", "[MSG:choose x, y or z]\nerror:105\n"),
        ("$list=q", "[MSG:choose v, l, f or c]\nerror:105\n"),
    ] {
        assert_eq!(bench.say(&format!("{line}\n")), answer, "{line}");
    }
    // A plot uses the memory of the copy.
    assert_eq!(bench.say("$plot\n"), "ok\n");
    bench.finish();
    assert!(bench.say("$undo\n").ends_with("error:143\n"));
}

#[test]
fn a_quarter_mirrored_twice_is_the_structure_of_figure_4() {
    let mut bench = Bench::new();
    bench.heard();
    let session = include_str!("../../scenes/structure.txt");
    let answers: String = session.lines().map(|line| bench.say(&format!("{line}\n"))).collect();
    let edits: Vec<&str> = answers.lines().filter(|line| line.starts_with("[EDIT")).collect();
    // On the vertical plane four joints and four bars, on the horizontal one six and seven.
    assert_eq!(
        edits[1..],
        [
            "[EDIT:vertices +12, bars +26, faces +0, curves +0]",
            "[EDIT:vertices +22, bars +49, faces +0, curves +0]"
        ]
    );
    let model = bench.plotter.model();
    let (low, high) = model.bounds().unwrap();
    let unit = 1 << model.fraction_bits();
    assert_eq!([low, high].map(|p| p.coordinates().map(|c| c / unit)), [[0, 0, 0], [5, 2, 6]]);
    assert!(bench.say("$plot\n").ends_with("ok\n"));
}

#[test]
fn images_in_any_plane_are_exact_to_a_millionth() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("v 3 1 2\nv -7 4 5\nv 6 -2 9\nv 10 20 30\nv -50 3 8\nl 1 2 3 4 5\n$mirror=1,2,3\n");
    let unit = f64::from(1 << bench.plotter.model().fraction_bits());
    let positions: Vec<[f64; 3]> = bench
        .plotter
        .model()
        .vertices()
        .iter()
        .map(|p| p.coordinates().map(|c| f64::from(c) / unit))
        .collect();
    assert_eq!((positions.len(), bench.plotter.model().bar_count()), (7, 6));
    let distance =
        |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    for (old, image) in [(3, 5), (4, 6)] {
        for on_plane in 0..3 {
            let before = distance(positions[old], positions[on_plane]);
            assert!((distance(positions[image], positions[on_plane]) - before).abs() < 1e-6);
        }
    }
}

#[test]
fn a_face_about_whose_plane_is_mirrored_is_its_own_image() {
    let mut number = 1u32;
    let mut below = |limit: f64| {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(number >> 8) / f64::from(1 << 24) * limit * 100.0).round() / 100.0
    };
    let mut models = vec!["v 76.2 94.5 83.4\nv -7.4 -92.7 0.1\nv -43.6 -45.3 32.5\n".to_owned()];
    for _ in 0..200 {
        let vertex = |_| {
            let at = [0; 3].map(|_| below(200.0) - 100.0);
            format!("v {:.2} {:.2} {:.2}\n", at[0], at[1], at[2])
        };
        models.push((0..3).map(vertex).collect());
    }
    for model in models {
        let mut bench = Bench::new();
        bench.heard();
        bench.say(&format!("{model}f 1 2 3\n"));
        let answer = bench.say("$mirror=1,2,3\n");
        assert_eq!(answer, "[EDIT:vertices +0, bars +0, faces +0, curves +0]\nok\n", "{model}");
    }
}

#[test]
fn nothing_is_taken_back_while_a_curve_is_unfinished() {
    let mut bench = Bench::new();
    bench.heard();
    bench.say("v 0 0 0\nv 1 0 0\nv 2 2 0\nv 3 0 0\ndeg 3\ncurv 3 4 1 2 3 4\n");
    let answer = bench.say("$undo\n");
    assert!(answer.contains("end") && answer.contains("error:"), "{answer}");
    assert_eq!(bench.say("parm u 0 1 2 3 4 5 6 7\nend\n"), "ok\nok\n");
    assert_eq!(
        (bench.plotter.model().vertices().len(), bench.plotter.model().curve_count()),
        (4, 1)
    );
}
