//! What the pins ink, and what they should.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use penup_client::files::parse;
pub use penup_host_tests::ink::{Segment, assert_same_ink, places as inked};
use penup_host_tests::whole_jobs::Bench;
use penup_readers::Arrangement;
use penup_readers::lines::Lines as _;

/// Steps per millimetre, and per plotter unit.
const STEPS: f64 = 80.0;
const STEPS_PER_UNIT: f64 = 2.0;

/// The corners of the rectangle around the ink, in whole plotter units.
pub fn units(bench: &Bench) -> [[i32; 2]; 2] {
    let ink = inked(bench);
    let around = |axis: usize, least: bool| {
        let positions = ink.iter().map(|point| point[axis]);
        let end = if least {
            positions.fold(f64::INFINITY, f64::min)
        } else {
            positions.fold(f64::NEG_INFINITY, f64::max)
        };
        (end / STEPS_PER_UNIT).round() as i32
    };
    [[around(0, true), around(1, true)], [around(0, false), around(1, false)]]
}

/// The strokes that the client's reader of HP-GL finds in a file.
///
/// # Errors
/// The reader refuses the file, for this reason.
pub fn plan(bytes: &[u8]) -> Result<Vec<Segment>, String> {
    let file = parse("file.hpgl".to_owned(), bytes.to_vec(), &Arrangement::default());
    let file = file.map_err(|error| error.to_string())?;
    let (mut vertices, mut segments) = (Vec::new(), Vec::new());
    for index in 0.. {
        let Some(line) = file.line(index) else { break };
        let mut words = line.sent.split_whitespace();
        let keyword = words.next();
        let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
        match keyword {
            Some("v") => vertices.push([numbers[0] * STEPS, numbers[1] * STEPS]),
            Some("l") => {
                let points: Vec<[f64; 2]> = numbers
                    .iter()
                    .map(|number| {
                        let count = vertices.len();
                        let number = *number as i64;
                        vertices[if number < 0 {
                            count - number.unsigned_abs() as usize
                        } else {
                            number as usize - 1
                        }]
                    })
                    .collect();
                segments.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
            }
            _ => {}
        }
    }
    assert!(!segments.is_empty());
    Ok(segments)
}

/// The places of ink along segments, half a step from one to the next.
pub fn places(segments: &[Segment]) -> Vec<[f64; 2]> {
    let mut places = Vec::new();
    for [from, to] in segments {
        let count = ((to[0] - from[0]).hypot(to[1] - from[1]) * 2.0).ceil().max(1.0);
        let place = |number: u32| {
            [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * f64::from(number) / count)
        };
        places.extend((0..=count as u32).map(place));
    }
    places
}

/// The strokes of a text such as `0,0 10,0; 5,5`, in plotter units. A single point is a dot.
pub fn strokes(text: &str) -> Vec<Segment> {
    let mut segments = Vec::new();
    for stroke in text.split(';').map(str::trim).filter(|stroke| !stroke.is_empty()) {
        let points: Vec<[f64; 2]> = stroke
            .split_whitespace()
            .map(|point| {
                let (x, y) = point.split_once(',').expect("x,y");
                [x, y].map(|number| number.parse::<f64>().expect("a number") * STEPS_PER_UNIT)
            })
            .collect();
        if let [point] = points[..] {
            segments.push([point; 2]);
        }
        segments.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
    }
    segments
}
