//! Hidden-line removal on all cores of a computer.
//!
//! What takes the longest while the scene is made ready is divided among the cores, and the rest of
//! that is done on one (`Cores`). Then the edges and the seams are divided into parts, which the
//! cores work through with marks of their own (`Marks`). The stretches of the parts are handed
//! over in the order of the model, by the thread that called, so the result does not depend on the
//! number of cores.
//!
//! It costs memory for the stretches that wait for those before them, and a set of marks for each
//! core, beside the working memory of the stage.

use super::grid::Grid;
use super::scene_index::SceneIndex;
use super::search::{Marks, StretchFinder};
use super::yield_counter::YieldCounter;
use super::{Cores, Options, Report, Scene, Stretch, StretchSink, VisibilityError, index};
use crate::index::Index;
use crate::stage::{Cancel, CancelFlag, Scratch, SinkFull};
use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::collections::BTreeMap;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::vec;
use std::vec::Vec;

/// The usual number of corners, or of faces whose seams are found, in a part. It is worth some
/// milliseconds of work.
const PART: usize = 4096;

/// How long the calling thread waits for a part before it asks whether the user has cancelled.
const TIMEOUT: Duration = Duration::from_millis(20);

/// A part of the search.
#[derive(Debug, Clone)]
enum SearchPart {
    /// The edges of the elements between these corners.
    Edges(Range<usize>),
    /// The seams of the faces with these ranks, each with the faces of higher rank.
    Seams(Range<usize>),
}

/// Does the same as [`find_stretches`](super::find_stretches) on all cores.
///
/// # Errors
/// See [`VisibilityError`]. By then the sink may already have received some of the stretches.
pub fn find_stretches<I: Index>(
    scene: &Scene<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<I>,
) -> Result<Report, VisibilityError> {
    let is_small = scene.elements.corners().len() < 2 * PART;
    if is_small || rayon::current_num_threads() < 2 {
        return super::find_stretches(scene, options, scratch, cancel, sink);
    }
    find_stretches_in_parts(PART, scene, options, scratch, cancel, sink)
}

/// Does the same as [`find_stretches`], in parts of at least `part` corners, and of `part` faces
/// whose seams are found; 0 counts as 1.
///
/// # Errors
/// See [`VisibilityError`]. By then the sink may already have received some of the stretches.
pub fn find_stretches_in_parts<I: Index>(
    part: usize,
    scene: &Scene<'_, I>,
    options: Options,
    scratch: Scratch<'_>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<I>,
) -> Result<Report, VisibilityError> {
    let mut scratch = scratch;
    let yield_counter = &mut YieldCounter::new(cancel);
    let around = &index(scene, options, Cores::All, &mut scratch, yield_counter)?;
    let grid = &Grid::new(around, false, Cores::All, scratch, yield_counter)?;
    let stop = &AtomicBool::new(false);
    rayon::in_place_scope_fifo(|scope| {
        let (sender, receiver) = mpsc::channel();
        let parts = parts(part.max(1), around, options);
        let count = parts.len();
        for (number, part) in parts.into_iter().enumerate() {
            let sender = sender.clone();
            scope.spawn_fifo(move |_| {
                // The other end is gone if the search has ended early.
                let _ = sender.send((number, search(around, grid, options, part, stop)));
            });
        }
        drop(sender);
        let outcome = hand_over(count, &receiver, cancel, sink);
        stop.store(true, Ordering::Relaxed);
        outcome
    })?;
    Ok(around.report())
}

/// Divides the search of a scene into parts, in the order in which their stretches are handed over.
fn parts<I: Index>(part: usize, around: &SceneIndex<'_, I>, options: Options) -> Vec<SearchPart> {
    let corners = around.outlines.corners.len();
    let mut parts = Vec::new();
    let mut begin = 0;
    for (first, _) in around.outlines.elements() {
        if first >= begin + part {
            parts.push(SearchPart::Edges(begin..first));
            begin = first;
        }
    }
    parts.push(SearchPart::Edges(begin..corners));
    if options.with_seams {
        let faces = around.faces.len();
        let part_of = |begin: usize| SearchPart::Seams(begin..faces.min(begin + part));
        parts.extend((0..faces).step_by(part).map(part_of));
    }
    parts
}

/// The outcome of a part.
type Found<I> = Result<Vec<Stretch<I>>, VisibilityError>;

/// Searches one part of a scene, until `stop` is set.
fn search<I: Index>(
    around: &SceneIndex<'_, I>,
    grid: &Grid<'_, I>,
    options: Options,
    part: SearchPart,
    stop: &AtomicBool,
) -> Found<I> {
    let faces = around.faces.len();
    let mut memory = vec![0; Marks::<I>::most_bytes(faces).div_ceil(size_of::<u64>())];
    let marks = Marks::new(faces, 0, &mut Scratch::new(&mut memory))?;
    let mut finder = StretchFinder::new(around, grid, marks, options, super::Owner::default());
    let mut found = Collected(Vec::new());
    let mut stopping = CancelFlag::new(stop);
    let yield_counter = &mut YieldCounter::new(&mut stopping);
    match part {
        SearchPart::Edges(corners) => finder.follow_edges(corners, yield_counter, &mut found)?,
        SearchPart::Seams(ranks) => finder.follow_seams(ranks, yield_counter, &mut found)?,
    }
    Ok(found.0)
}

/// Hands the stretches of `count` parts over in the order of their numbers, as they arrive.
fn hand_over<I: Index>(
    count: usize,
    receiver: &mpsc::Receiver<(usize, Found<I>)>,
    cancel: &mut dyn Cancel,
    sink: &mut dyn StretchSink<I>,
) -> Result<(), VisibilityError> {
    let mut waiting = BTreeMap::new();
    let mut next = 0;
    while next < count {
        cancel.check()?;
        match receiver.recv_timeout(TIMEOUT) {
            Ok((number, found)) => {
                waiting.insert(number, found);
            }
            Err(RecvTimeoutError::Timeout) => continue,
            // Every part sends its outcome, so this is not reached while parts are missing.
            Err(RecvTimeoutError::Disconnected) => return Err(VisibilityError::Aborted),
        }
        while let Some(found) = waiting.remove(&next) {
            for stretch in found? {
                sink.stretch(stretch)?;
            }
            next += 1;
        }
    }
    Ok(())
}

/// Collects the stretches of a part.
struct Collected<I>(Vec<Stretch<I>>);

impl<I> StretchSink<I> for Collected<I> {
    fn stretch(&mut self, stretch: Stretch<I>) -> Result<(), SinkFull> {
        self.0.push(stretch);
        Ok(())
    }
}
