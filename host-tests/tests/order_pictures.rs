//! Tests of stroke orders whose expected tours are pictures.
//!
//! A picture is both the drawing and its tour. Points are crosses, six columns and two rows apart.
//! Between them a segment has a number, the position in the tour at which it is drawn (`9` is
//! followed by `a`), and a head that points where the pen goes:
//!
//! ```text
//! +--1->+<-2--+     drawn with pen 1     +==1=>+     drawn with pen 2
//! ```
//!
//! A segment that runs down is `1v` or `1^` below its upper end, and a slanting one is `1\v`,
//! `1\^`, `1/v` or `1/^`. The pen is lifted wherever a segment does not begin where the last one
//! ended.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]

use penup::drawing::{LineType, PagePoint, Segment};
use penup::order::{Effort, Leg, Options, Report, Shape};
use penup_host_tests::order_reference::Sheet;
use std::collections::BTreeMap;

/// Distance between neighbouring points, in columns and rows of the picture.
const APART: (usize, usize) = (6, 2);
/// The same distance in steps of the motors.
const STEPS: i32 = 100;

/// A position in the grid of points, as column and row, counted from the upper left.
type Position = (usize, usize);

/// The positions of the segments and their pens, as a picture shows them.
fn segments(picture: &[String]) -> Vec<(Position, Position, u8)> {
    let text = |row: usize, from: usize, to: usize| -> String {
        let line = picture.get(row).map_or("", String::as_str);
        line.chars().skip(from).take(to - from).collect()
    };
    let has = |row, from, to, letters: &str| text(row, from, to).contains(|c| letters.contains(c));
    let mut found = Vec::new();
    for row in 0..picture.len().div_ceil(APART.1) {
        for column in 0..12 {
            let (x, y) = (column * APART.0, row * APART.1);
            if has(y, x + 1, x + 6, "-=") {
                let pen = u8::from(has(y, x + 1, x + 6, "="));
                found.push(((column, row), (column + 1, row), pen));
            }
            if has(y + 1, x, x + 2, "v^") {
                found.push(((column, row), (column, row + 1), 0));
            }
            if has(y + 1, x + 2, x + 5, "\\") {
                found.push(((column, row), (column + 1, row + 1), 0));
            }
            if has(y + 1, x + 2, x + 5, "/") {
                found.push(((column + 1, row), (column, row + 1), 0));
            }
        }
    }
    found
}

/// Writes `text` into the picture.
fn write(picture: &mut Vec<Vec<char>>, (row, column): (usize, usize), text: &str) {
    if picture.len() <= row {
        picture.resize(row + 1, Vec::new());
    }
    let line = &mut picture[row];
    for (n, letter) in text.chars().enumerate() {
        if line.len() <= column + n {
            line.resize(column + n + 1, ' ');
        }
        line[column + n] = letter;
    }
}

/// The picture of a tour. Each leg is given by its first and last position and its pen.
fn picture_of(tour: &[(Position, Position, u8)]) -> Vec<String> {
    let mut picture = Vec::new();
    for (number, &(from, to, pen)) in (1..).zip(tour) {
        let number = char::from_digit(number, 36).expect("at most 35 segments");
        let (upper, lower) = if (from.1, from.0) < (to.1, to.0) { (from, to) } else { (to, from) };
        let corner = (upper.1 * APART.1, upper.0.min(lower.0) * APART.0);
        let head = if from == upper { 'v' } else { '^' };
        let below = (corner.0 + 1, corner.1);
        if from.1 == to.1 {
            let dash = if pen == 0 { '-' } else { '=' };
            let text = if from.0 < to.0 {
                format!("{dash}{dash}{number}{dash}>")
            } else {
                format!("<{dash}{number}{dash}{dash}")
            };
            write(&mut picture, (corner.0, corner.1 + 1), &text);
        } else if from.0 == to.0 {
            write(&mut picture, below, &format!("{number}{head}"));
        } else {
            let slope = if upper.0 < lower.0 { '\\' } else { '/' };
            write(&mut picture, (below.0, below.1 + 2), &format!("{number}{slope}{head}"));
        }
        for position in [from, to] {
            write(&mut picture, (position.1 * APART.1, position.0 * APART.0), "+");
        }
    }
    picture.into_iter().map(|line| line.into_iter().collect()).collect()
}

/// The lines of a picture without the indentation that they share.
fn unindented(picture: &str) -> Vec<String> {
    let lines = || picture.lines().skip_while(|line| line.trim().is_empty());
    let indentation = |line: &str| line.len() - line.trim_start().len();
    let shared = lines().filter(|line| !line.trim().is_empty()).map(indentation).min();
    let mut lines: Vec<String> = lines()
        .map(|line| line.get(shared.unwrap_or(0)..).unwrap_or_default().trim_end().to_owned())
        .collect();
    lines.truncate(lines.iter().rposition(|line| !line.is_empty()).map_or(0, |last| last + 1));
    lines
}

/// Orders the drawing in `expected` and compares the tour with it.
fn assert_tour(options: Options, expected: &str) -> Report {
    let expected = unindented(expected);
    let mut sheet = Sheet::default();
    let (mut positions, mut numbers) = (Vec::new(), BTreeMap::new());
    for (from, to, pen) in segments(&expected) {
        let [from, to] = [from, to].map(|position| {
            *numbers.entry(position).or_insert_with(|| {
                let [x, y] = [position.0, position.1].map(|at| STEPS * at as i32);
                sheet.points.push(PagePoint { x, y: -y });
                positions.push(position);
                positions.len() as u16 - 1
            })
        });
        sheet.segments.push(Segment::new(from, to).inked(LineType::Full, pen));
    }
    let (tour, report) = sheet.order(options).expect("a small drawing fits");
    let leg = |leg: &Leg| {
        let segment = sheet.segments[leg.segment()];
        let [from, to] = [segment.from(), segment.to()].map(|point| positions[usize::from(point)]);
        if leg.reversed() { (to, from, segment.pen()) } else { (from, to, segment.pen()) }
    };
    let found = picture_of(&tour.iter().map(leg).collect::<Vec<_>>());
    assert!(found == expected, "expected:\n{}\nfound:\n{}", expected.join("\n"), found.join("\n"));
    report
}

/// The default options, with a path that ends anywhere.
fn open() -> Options {
    Options::default()
}

/// The default options, with a path that ends where it began.
fn closed() -> Options {
    Options { shape: Shape::ClosedCycle, ..Options::default() }
}

#[test]
fn a_house_is_one_stroke_between_its_two_odd_points() {
    let report = assert_tour(
        open(),
        r"
              +
          1/^   2\v
        +<-4--+<-3--+
        5v          8^
        +--6->+--7->+
        ",
    );
    assert_eq!((report.odd_points, report.lifts), (2, 0));
}

/// The pen is lifted between `a` and `b`, from one odd point to another that is near. The path ends
/// at the other two.
#[test]
fn a_window_has_four_odd_points_and_needs_one_lift() {
    let report = assert_tour(
        open(),
        r"
        +--2->+--3->+
        1^    c^    4v
        +<-6--+<-5--+
        7v    b^    a^
        +--8->+--9->+
        ",
    );
    assert_eq!((report.odd_points, report.lifts), (4, 1));
    assert!(report.optimal);
}

/// The pen is lifted between `6` and `7`, and between `c` and `1`: once for each pair of odd
/// points.
#[test]
fn a_closed_path_returns_to_its_start() {
    let report = assert_tour(
        closed(),
        r"
        +--2->+--3->+
        1^    6^    4v
        +<-a--+<-5--+
        bv    9^    7v
        +--c->+<-8--+
        ",
    );
    assert_eq!((report.odd_points, report.lifts), (4, 2));
    assert!(report.optimal);
}

#[test]
fn a_hatching_is_drawn_back_and_forth() {
    assert_tour(
        open(),
        r"
        +--1->+--2->+

        +<-4--+<-3--+

        +--5->+--6->+
        ",
    );
}

#[test]
fn a_closed_hatching_goes_down_one_column_and_up_the_other() {
    assert_tour(
        closed(),
        r"
        +<-6--+     +<-5--+

        +--7->+     +--4->+

        +<-8--+     +<-3--+

        +--1->+     +--2->+
        ",
    );
}

/// The nearest part first leaves one behind, for which the pen travels far at the end.
#[test]
fn parts_are_drawn_nearest_first_and_then_better() {
    let nearest = assert_tour(
        Options { effort: Effort::Units(0), ..open() },
        r"
        +--1->+           +<-6--+

              +--2->+     +     +<-5--+
                          3v
        +<-7--+           +     +--4->+
        ",
    );
    let improved = assert_tour(
        open(),
        r"
        +<-1--+           +<-7--+

              +--3->+     +     +<-6--+
                          4v
        +--2->+           +     +--5->+
        ",
    );
    assert!(improved.pen_up < nearest.pen_up);
}

#[test]
fn the_second_pen_begins_at_the_nearer_end_of_its_path() {
    assert_tour(open(), "+--1->+--2->+     +==3=>+==4=>+");
    assert_tour(open(), "+<=4==+<=3==+     +--1->+--2->+");
}
