//! Orders the strokes of a small drawing so that the pen moves little while it is up:
//! `cargo run --example order_drawing`.

use penup::drawing::{Drawing, PagePoint, Segment};
use penup::order::{Leg, Options, order};
use penup::stage::{NeverCancel, Scratch};

/// Three squares in a row, each with a diagonal. Coordinates are steps of the motors.
fn squares() -> (Vec<PagePoint>, Vec<Segment>) {
    let (mut points, mut segments) = (Vec::new(), Vec::new());
    for square in 0..3_u16 {
        let left = i32::from(square) * 3000;
        let corners = [(0, 0), (1000, 0), (1000, 1000), (0, 1000)];
        points.extend(corners.map(|(x, y)| PagePoint { x: left + x, y }));
        let first = 4 * square;
        segments.extend(
            [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]]
                .map(|[from, to]| Segment::new(first + from, first + to)),
        );
    }
    (points, segments)
}

fn main() -> Result<(), String> {
    let (points, segments) = squares();
    let drawing = Drawing { points: &points, segments: &segments };
    let mut memory = vec![0; 1 << 14];
    let mut tour = vec![Leg::new(0, false); segments.len()];
    let options = Options::default();
    let report = order(drawing, options, Scratch::new(&mut memory), &mut NeverCancel, &mut tour)
        .map_err(|error| format!("{error:?}"))?;

    let mut pen_at = None;
    for leg in tour {
        let segment = segments[leg.segment()];
        let (from, to) = match leg.reversed() {
            false => (segment.from(), segment.to()),
            true => (segment.to(), segment.from()),
        };
        if pen_at != Some(from) {
            println!("pen up, to point {from}, pen down");
        }
        println!("draw from point {from} to point {to}");
        pen_at = Some(to);
    }
    let steps = |length: u64| length / 256;
    println!(
        "{} steps drawn, {} steps with the pen up, in {} lifts; least possible: {}",
        steps(report.pen_down),
        steps(report.pen_up),
        report.lifts,
        report.optimal
    );
    Ok(())
}
