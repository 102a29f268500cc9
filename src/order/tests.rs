//! Compares tours with the shortest ones, found by trying all, and checks what is reported.

use super::*;
use crate::drawing::{LineType, PagePoint, Segment};
use crate::stage::NeverCancel;
use std::vec::Vec;

/// Segments between random points of a coarse grid, so that some points have several segments.
fn drawing(segments: u32, reach: u32, seed: u32) -> (Vec<PagePoint>, Vec<Segment>) {
    let mut state = seed.wrapping_mul(0x9E37_79B9) | 1;
    let mut below = |limit: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((u64::from(state) * u64::from(limit)) >> 32) as i32
    };
    let mut points: Vec<PagePoint> = Vec::new();
    let mut all: Vec<Segment> = Vec::new();
    while all.len() < segments as usize {
        let mut end = || {
            let point = PagePoint { x: 37 * below(reach), y: 41 * below(reach) };
            let known = points.iter().position(|other| *other == point);
            known.unwrap_or_else(|| {
                points.push(point);
                points.len() - 1
            }) as u16
        };
        let (from, to) = (end(), end());
        if from != to {
            all.push(Segment::new(from, to).inked(LineType::Full, 0));
        }
    }
    (points, all)
}

fn ordered(
    points: &[PagePoint],
    segments: &[Segment],
    options: Options,
) -> (Vec<[PagePoint; 2]>, Report) {
    let mut memory = std::vec![0; 1 << 16];
    let mut tour = std::vec![Leg::new(0u16, false); segments.len()];
    let drawing = Drawing { points, segments };
    let report = order(drawing, options, Scratch::new(&mut memory), &mut NeverCancel, &mut tour);
    let mut numbers: Vec<usize> = tour.iter().map(|leg| leg.segment()).collect();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(0..segments.len()), "each segment is drawn once");
    let ends = |leg: &Leg| {
        let segment = segments[leg.segment()];
        let ends = [segment.from(), segment.to()].map(|point| points[usize::from(point)]);
        if leg.reversed() { [ends[1], ends[0]] } else { ends }
    };
    (tour.iter().map(ends).collect(), report.expect("enough memory"))
}

/// The lengths of the moves with the pen up, and their number.
fn moves(strokes: &[[PagePoint; 2]], shape: Shape) -> (u64, u32) {
    let nexts = strokes.iter().cycle().skip(1);
    let open = usize::from(shape == Shape::OpenPath);
    let gaps = strokes.iter().zip(nexts).take(strokes.len() - open);
    gaps.fold((0, 0), |(up, lifts), (stroke, next)| {
        let (from, to) = (stroke[1], next[0]);
        (up + u64::from(length(from, to)), lifts + u32::from(from != to))
    })
}

/// The least travel with the pen up that completes a tour of which `done` are drawn so far.
fn shortest(rest: &mut Vec<[PagePoint; 2]>, done: &mut Vec<[PagePoint; 2]>, shape: Shape) -> u64 {
    if rest.is_empty() {
        return moves(done, shape).0;
    }
    let mut least = u64::MAX;
    for at in 0..rest.len() {
        let stroke = rest.swap_remove(at);
        for ends in [stroke, [stroke[1], stroke[0]]] {
            done.push(ends);
            least = least.min(shortest(rest, done, shape));
            done.pop();
        }
        rest.push(stroke);
        let last = rest.len() - 1;
        rest.swap(at, last);
    }
    least
}

#[test]
fn small_drawings_have_the_shortest_tour() {
    for shape in [Shape::OpenPath, Shape::ClosedCycle] {
        for method in [Method::Auto, Method::Greedy] {
            for seed in 0..60 {
                let (points, segments) = drawing(3 + seed % 3, 4 + seed % 7 * 4, seed);
                let options = Options { shape, method, ..Options::default() };
                let (strokes, report) = ordered(&points, &segments, options);
                let (up, lifts) = moves(&strokes, shape);
                assert_eq!((report.pen_up, report.lifts), (up, lifts), "seed {seed}");
                let down = strokes.iter().map(|[from, to]| u64::from(length(*from, *to)));
                assert_eq!(report.pen_down, down.sum::<u64>());
                let begins = strokes.iter().map(|[from, _]| from.x).min();
                match shape {
                    Shape::OpenPath => assert!(strokes[0][0].x <= strokes[strokes.len() - 1][1].x),
                    Shape::ClosedCycle => assert_eq!(Some(strokes[0][0].x), begins),
                }
                let least = shortest(&mut strokes.clone(), &mut Vec::new(), shape);
                assert_eq!(up, least, "{shape:?}, {method:?}, seed {seed}");
                assert!(report.bound <= least, "seed {seed}: {report:?}");
                assert_eq!(report.optimal, report.bound == least, "seed {seed}: {report:?}");
            }
        }
    }
}

/// A few strokes all over the largest page are worth annealing, which must not make them longer.
/// Distances there no longer fit the weights of the matching, which then lack their last bit.
#[test]
fn drawings_as_large_as_the_page_have_nearly_the_shortest_tour() {
    const CELL: i32 = (PAGE_LIMIT - 20) / 8;
    for shape in [Shape::OpenPath, Shape::ClosedCycle] {
        for seed in 0..30 {
            let (mut points, segments) = drawing(5, 16, seed);
            for point in &mut points {
                let spread = |at: i32, step: i32| (at / step - 7) * CELL + at / step * 7 % 13;
                *point = PagePoint { x: spread(point.x, 37), y: spread(point.y, 41) };
            }
            let options = Options { shape, ..Options::default() };
            let (strokes, report) = ordered(&points, &segments, options);
            let least = shortest(&mut strokes.clone(), &mut Vec::new(), shape);
            assert!(report.pen_up <= least + least / 100, "{shape:?}, {seed}: {report:?}, {least}");
            assert!(report.bound <= least, "{shape:?}, {seed}: {report:?}, {least}");
        }
    }
}

#[test]
fn odd_points_and_parts_are_counted() {
    for seed in 0..40 {
        let (points, segments) = drawing(12, 9, seed);
        let (_, report) = ordered(&points, &segments, Options::default());
        let mut part: Vec<usize> = (0..points.len()).collect();
        let mut degree = std::vec![0u32; points.len()];
        for segment in &segments {
            let [from, to] = [segment.from(), segment.to()].map(usize::from);
            degree[from] += 1;
            degree[to] += 1;
            let (old, new) = (part[from], part[to]);
            part.iter_mut().filter(|part| **part == old).for_each(|part| *part = new);
        }
        let mut part: Vec<usize> = part
            .into_iter()
            .zip(&degree)
            .filter(|(_, degree)| **degree > 0)
            .map(|(part, _)| part)
            .collect();
        part.sort_unstable();
        part.dedup();
        let odd = degree.iter().filter(|degree| *degree % 2 == 1).count();
        assert_eq!((report.odd_points, report.components), (odd as u32, part.len() as u32));
    }
}

/// Numbers that a change of the order may lower, and should raise only for a reason.
#[test]
fn large_drawings_have_tours_no_longer_than_they_had() {
    let known = [
        (Method::Auto, Shape::OpenPath, [2_089_207, 216_866, 8_514_117]),
        (Method::Auto, Shape::ClosedCycle, [2_142_634, 238_882, 9_130_285]),
        (Method::Greedy, Shape::OpenPath, [2_107_430, 216_866, 8_514_117]),
        (Method::Greedy, Shape::ClosedCycle, [2_174_145, 244_213, 9_148_884]),
    ];
    for (method, shape, lengths) in known {
        for ((segments, reach), known) in [(150, 40), (120, 9), (90, 200)].into_iter().zip(lengths)
        {
            let (points, segments) = drawing(segments, reach, 7);
            let options = Options { shape, method, ..Options::default() };
            let (strokes, report) = ordered(&points, &segments, options);
            assert_eq!(moves(&strokes, shape), (report.pen_up, report.lifts));
            assert!(report.bound <= report.pen_up, "{report:?}");
            // A thousandth is left for changes that are no worse on other drawings.
            assert!(report.pen_up <= known + known / 1000, "{method:?} {shape:?}: {report:?}");
        }
    }
}

#[test]
fn a_drawing_of_more_segments_than_a_tour_can_number_is_refused() {
    let points = [PagePoint { x: 0, y: 0 }, PagePoint { x: 1, y: 1 }];
    for (count, is_refused) in [(32_766, false), (32_767, true)] {
        let segments = std::vec![Segment::new(0u16, 1).inked(LineType::Full, 0); count];
        let mut tour = std::vec![Leg::new(0, false); count];
        let drawing = Drawing { points: &points, segments: &segments };
        // One that is not refused for its number lacks memory.
        let options = Options::default();
        let report = order(drawing, options, Scratch::new(&mut []), &mut NeverCancel, &mut tour);
        assert_eq!(report == Err(OrderError::TooManySegments), is_refused, "{report:?}");
        assert!(report.is_err());
    }
}

#[test]
fn with_more_memory_no_order_fails_that_was_found_with_less() {
    for (segments, reach, shape) in
        [(30, 60, Shape::OpenPath), (30, 60, Shape::ClosedCycle), (40, 6, Shape::ClosedCycle)]
    {
        let (points, segments) = drawing(segments, reach, 5);
        let drawing = Drawing { points: &points, segments: &segments };
        let options = Options { shape, effort: Effort::Units(1), ..Options::default() };
        let mut tour = std::vec![Leg::new(0u16, false); segments.len()];
        let mut is_enough = false;
        for words in 0..800 {
            let mut memory = std::vec![0; words];
            let scratch = Scratch::new(&mut memory);
            match order(drawing, options, scratch, &mut NeverCancel, &mut tour) {
                Ok(_) => is_enough = true,
                Err(error) => assert!(!is_enough, "{words} words: {error:?}"),
            }
        }
        assert!(is_enough);
    }
}

#[test]
fn lines_in_pieces_need_little_more_memory_than_whole_ones() {
    let least_words = |pieces: i32| {
        let (mut points, mut segments) = (Vec::new(), Vec::new());
        for line in 0..20 {
            for at in 0..=pieces {
                let x = 97 * (line % 5) + 30 * at / pieces;
                points.push(PagePoint { x, y: 61 * (line / 5) + line % 3 * at });
                if at > 0 {
                    let last = points.len() as u16 - 1;
                    segments.push(Segment::new(last - 1, last).inked(LineType::Full, 0));
                }
            }
        }
        let drawing = Drawing { points: &points, segments: &segments };
        let mut tour = std::vec![Leg::new(0u16, false); segments.len()];
        let mut is_enough = |words: &usize| {
            let mut memory = std::vec![0; *words];
            let scratch = Scratch::new(&mut memory);
            order(drawing, Options::default(), scratch, &mut NeverCancel, &mut tour).is_ok()
        };
        (0..2000).find(&mut is_enough).expect("some memory is enough")
    };
    let [whole, in_pieces] = [1, 3].map(least_words);
    // Of the 40 points within lines, each needs some numbers of 16 bits.
    assert!(in_pieces <= whole + 40, "{whole} and {in_pieces} words");
}
