//! The strokes of a drawing that is computed and drawn part by part.
//!
//! The memory of the model, which lies in flash, serves as a ring of targets, as the working memory
//! does for strokes that a computer sends. A part is handed to the ring as a whole if it fits, and
//! the machine draws it from there while the next part is computed. If the next part is late, the
//! machine waits with the pen raised.

use crate::drawing::{PageMap, PagePoint};
use crate::machine::{JobSize, Target};
use crate::order::TimeModel;
use crate::plotter::job::{Cursor, Job};
use crate::plotter::options::PlotOptions;
use crate::plotter::streamed::Streamed;
use crate::protocol::StreamedTarget;
use crate::tiles::PausedTiles;
use crate::view::View;

/// The state that all parts of a drawing share, and the progress of the search for its lines.
#[derive(Debug, Clone, Copy)]
pub(super) struct DrawingSearch {
    /// The camera.
    pub view: View,
    /// The map to the page.
    pub map: PageMap,
    /// The options of the drawing. Changes by the user do not affect it.
    pub options: PlotOptions,
    /// The tiles that are left of this pass.
    pub tiles: PausedTiles,
    /// One bit for each pen that has a pass of its own after this one.
    pub pens: u32,
    /// The pen of this pass, from 0.
    pub pen: u8,
    /// The edges of the whole drawing on the page: left, right and bottom.
    pub around: [i32; 3],
    /// Whether the title has still to be drawn.
    pub has_title: bool,
    /// By what the order of each part is chosen. Other speeds that the user sets do not affect it.
    pub time_model: TimeModel,
}

/// A part whose strokes lie in the working memory, in their order.
#[derive(Debug, Clone, Copy)]
pub(super) struct ComputedPart<I> {
    /// The strokes.
    pub job: Job<I>,
    /// The position up to which the strokes have been handed to the ring.
    pub cursor: Cursor<I>,
    /// The number of targets that have not been handed to the ring.
    pub left: usize,
    /// The first word of the working memory that the part takes.
    pub begin: usize,
}

/// A drawing that is computed and drawn part by part.
#[derive(Debug)]
pub(in crate::plotter) struct Parts<I = u16> {
    /// What is left to compute; `None` if no drawing in parts is in progress, or all of it is
    /// computed.
    pub(super) search: Option<DrawingSearch>,
    /// The part that has been computed.
    pub(super) part: Option<ComputedPart<I>>,
    /// The last target that has come to the ring.
    pub(super) last: StreamedTarget,
    /// Whether a drawing in parts is in progress.
    pub(super) is_active: bool,
}

impl<I> Default for Parts<I> {
    fn default() -> Self {
        let nowhere = Target { point: PagePoint { x: 0, y: 0 }, ink: None };
        let last = StreamedTarget { target: nowhere, pen: 0 };
        Self { search: None, part: None, last, is_active: false }
    }
}

impl<I> Parts<I> {
    /// Whether a drawing in parts is in progress.
    #[inline(always)] // It is called in every turn of the main loop.
    pub(in crate::plotter) fn is_active(&self) -> bool {
        self.is_active
    }

    /// Ends the drawing.
    pub(in crate::plotter) fn end(&mut self) {
        *self = Self::default();
    }

    /// Hands as much of the computed part to the ring as there is room for once the machine has
    /// `read` this many targets: all of it, or, if it is longer than the ring, as much as the ring
    /// holds. Returns its size.
    pub(super) fn feed(
        &mut self,
        (streamed, read): (&mut Streamed, usize),
        ring: &mut [u64],
        mut next: impl FnMut(&mut ComputedPart<I>) -> Option<StreamedTarget>,
        length: impl Fn([PagePoint; 2]) -> u64,
    ) -> JobSize {
        let mut size = JobSize::default();
        let Some(part) = &mut self.part else { return size };
        let room = streamed.room(ring.len(), read);
        if room < part.left.min(ring.len()) {
            return size;
        }
        for _ in 0..room.min(part.left) {
            let Some(next) = next(part) else {
                part.left = 0;
                break;
            };
            streamed.put(ring, next);
            let StreamedTarget { target: last, pen } = core::mem::replace(&mut self.last, next);
            let distance = length([last.point, next.target.point]);
            if next.target.ink.is_some() {
                size.drawn += distance;
                size.strokes += u32::from(last.ink.is_none() || pen != next.pen);
            } else {
                size.travelled += distance;
            }
            part.left -= 1;
        }
        if part.left == 0 {
            self.part = None;
        }
        size
    }
}
