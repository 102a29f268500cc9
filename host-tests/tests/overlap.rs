//! Tests that no part of the paper is drawn twice and none is lost, by comparing every pair of
//! lines.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PackedLine, PagePoint, build_graph};
use penup::stage::{NeverCancel, items_mut};
use proptest::prelude::*;

/// A line with the code of its line type and its pen.
type Drawn = ((i64, i64), (i64, i64), u8, u8);

fn organised(lines: &[Drawn]) -> Vec<Drawn> {
    let mut words = vec![0u64; 4000];
    let point = |(x, y): (i64, i64)| PagePoint { x: x as i32, y: y as i32 };
    let packed: Vec<PackedLine> = lines
        .iter()
        .map(|(from, to, code, pen)| {
            PackedLine::new(point(*from), point(*to), LineType::from_code(*code), *pen)
        })
        .collect();
    items_mut(&mut words, lines.len()).expect("room").copy_from_slice(&packed);
    let stored = build_graph::<u16>(&mut words, lines.len(), &mut NeverCancel).expect("room");
    let (drawing, _) = stored.split(&mut words).expect("the same memory");
    let at = |number: u16| {
        let point = drawing.points[usize::from(number)];
        (i64::from(point.x), i64::from(point.y))
    };
    let segments = drawing.segments.iter();
    segments.map(|s| (at(s.from()), at(s.to()), s.line_type().code(), s.pen())).collect()
}

/// The position of a point along a line, in units of the line's squared length; `None` if the point
/// is not on it.
fn along(position: (i64, i64), (from, to, ..): &Drawn) -> Option<i64> {
    let (d, w) = ((to.0 - from.0, to.1 - from.1), (position.0 - from.0, position.1 - from.1));
    (d.0 * w.1 == d.1 * w.0).then_some(d.0 * w.0 + d.1 * w.1)
}

/// The stretch of `line` that `other` covers, from 0 to the square of its length; `None` if it has
/// no length.
fn covered(line: &Drawn, other: &Drawn) -> Option<(i64, i64)> {
    let whole = along(line.1, line)?;
    let (a, b) = (along(other.0, line)?, along(other.1, line)?);
    let (from, to) = (a.min(b).max(0), a.max(b).min(whole));
    (from < to).then_some((from, to))
}

fn drawn() -> impl Strategy<Value = Drawn> {
    // Points are ten steps apart, so that none are merged; there are few slopes, so that many lines
    // coincide.
    let position = || (0i64..7, 0i64..7).prop_map(|(x, y)| (10 * x, 10 * y));
    let slope = prop_oneof![Just((1, 0)), Just((0, 1)), Just((1, 1)), Just((2, -1)), Just((3, 2))];
    let sloped =
        (position(), slope, 1i64..6, any::<bool>()).prop_map(|(from, (dx, dy), by, back)| {
            let to = (from.0 + 10 * dx * by, from.1 + 10 * dy * by);
            if back { (to, from) } else { (from, to) }
        });
    let any = (position(), position()).prop_filter("a length", |(from, to)| from != to);
    (prop_oneof![4 => sloped, 1 => any], 0..LineType::ALL.len() as u8, 0u8..4)
        .prop_map(|((from, to), code, pen)| (from, to, code, pen))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn every_stretch_is_drawn_once(lines in prop::collection::vec(drawn(), 1..60)) {
        let found = organised(&lines);
        for (at, segment) in found.iter().enumerate() {
            for other in &found[at + 1..] {
                prop_assert_eq!(covered(segment, other), None, "{:?} {:?}", segment, other);
            }
        }
        for line in &lines {
            // Between the ends of all lines that overlap it, each stretch is drawn as the best type
            // that any of them requires.
            let on_it = || lines.iter().chain(&found);
            let stretches = on_it().filter_map(|other| covered(line, other));
            let mut cuts: Vec<i64> = stretches.flat_map(|(a, b)| [a, b]).collect();
            cuts.sort_unstable();
            for pair in cuts.windows(2).filter(|pair| pair[0] < pair[1]) {
                let best = |of: &[Drawn]| {
                    of.iter()
                        .filter(|other| {
                            covered(line, other).is_some_and(|(a, b)| a <= pair[0] && pair[1] <= b)
                        })
                        .map(|other| (other.2, other.3))
                        .min()
                };
                prop_assert_eq!(best(&found), best(&lines), "{:?} {:?}", line, pair);
            }
        }
    }
}
