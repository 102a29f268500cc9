//! Jobs of every kind that a loss of power interrupts, as seeds of the corpus.

use super::KeptJob;
use crate::cut_jobs::{Powered, empty_flash, switch_on, switch_on_early, switch_on_small};
use crate::streamed_drawing::StreamedDrawing;
use crate::whole_jobs::job_lines;
use penup::boards::host::{CutArea, CutFlash, LAYOUT};
use penup::plotter::{FlashRecords, Record};
use penup_readers::lines::Lines as _;

/// So many ticks pass in a millisecond of computing.
pub(super) const WORK_TICKS: u64 = 25_000;
/// The size of the flash for a model, in bytes.
const MODEL_BYTES: usize = 16 << 10;
/// The settings for a small drawing, with a pen that takes little time.
const SMALL: [&str; 4] = ["$212=20", "$213=20", "$page=20x20", "$margin=4"];
/// The settings for a drawing with more strokes.
const WIDE: [&str; 4] = ["$212=20", "$213=20", "$page=60x60", "$margin=5"];

/// A job of each kind that the firmware keeps in another way, with a name: the power has failed
/// while it was drawn.
///
/// # Panics
/// Panics if one has not come far enough by then.
pub fn interrupted_jobs() -> [(&'static str, KeptJob); 5] {
    let (in_parts, _) = in_parts();
    [
        ("stopped-between-strokes", between_strokes()),
        ("stopped-within-a-stroke", within_a_stroke()),
        ("stopped-while-streamed", streamed()),
        ("stopped-in-parts", in_parts),
        ("stopped-before-its-order", before_its_order()),
    ]
    .map(|(name, flash)| (name, KeptJob::of(&flash).expect("its progress is kept")))
}

/// Runs until at least so many strokes, and points within strokes, are noted.
fn run_until_noted(plotter: &mut Powered<'_, '_>, strokes: u8, points: u8) {
    let is_noted = |plotter: &mut Powered<'_, '_>| {
        let kept = plotter.board.flash().and_then(|flash| KeptJob::of(flash));
        let [drawn, passed] = kept.map_or([0; 2], |kept| kept.noted());
        drawn >= strokes && passed >= points
    };
    while !is_noted(plotter) {
        assert!(plotter.run(20) == 20, "the job has ended before it has come so far");
    }
}

fn between_strokes() -> CutFlash {
    let lines = job_lines("lattice2.obj", &WIDE);
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        run_until_noted(plotter, 3, 0);
    });
    flash
}

fn within_a_stroke() -> CutFlash {
    let lines = job_lines("cube.obj", &[&SMALL[..], &["$219=0.01"]].concat());
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&lines);
        run_until_noted(plotter, 1, 2);
    });
    flash
}

fn streamed() -> CutFlash {
    let mut drawing = StreamedDrawing::of(&job_lines("cube.obj", &SMALL));
    let job = drawing.from(0);
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        plotter.order(&drawing.settings);
        for line in job.in_order() {
            plotter.board.receive(format!("{}\n", line.sent).as_bytes());
        }
        run_until_noted(plotter, 1, 0);
    });
    flash
}

/// A flash with a drawing that is computed part by part, and a flash with its model.
pub(super) fn in_parts() -> (CutFlash, CutArea) {
    let lines = job_lines("lattice2.obj", &WIDE);
    let model = CutArea::new(MODEL_BYTES);
    let (flash, model, _) = switch_on_small(empty_flash(), model, WORK_TICKS, |plotter| {
        plotter.order(&lines);
        run_until_noted(plotter, 3, 0);
    });
    (flash, model)
}

/// A flash with a job whose pen has begun before the order of its strokes is kept: so many strokes
/// that lie apart are the least drawing that takes long to order.
fn before_its_order() -> CutFlash {
    let strokes = (0..140).map(|index| [3 * (index % 14), 4 * (index / 14)]);
    let ends = strokes.flat_map(|[x, y]| [[x, y], [x + 1, y + 2]]);
    let vertices = ends.map(|[x, y]| format!("v {x} {y} 0"));
    let bars = (1..280).step_by(2).map(|from| format!("l {from} {}", from + 1));
    let rest = WIDE.iter().chain(&["$view=auto", "$plot"]).map(|line| (*line).to_owned());
    let lines: Vec<String> = vertices.chain(bars).chain(rest).collect();
    let (flash, _) = switch_on_early::<16384>(empty_flash(), Some(WORK_TICKS), |plotter| {
        plotter.order(&lines);
        run_until_noted(plotter, 3, 0);
    });
    let mut has_order = false;
    FlashRecords::new(flash.clone(), LAYOUT).load_added(Record::Job, &mut |_| has_order = true);
    assert!(!has_order, "the order is kept before the power fails");
    flash
}
