//! Begins the closed strokes of a drawing at random points.
//!
//! A pen leaves a mark where it comes down. The order lets each closed stroke begin where the moves
//! between strokes become short, so the marks of similar strokes stand in a row.

use penup::checksum::Crc32;
use penup::machine::{Path, Target};
use penup::protocol::StreamedTarget;

/// A path whose closed strokes begin at random points. It is read at once and held in memory.
#[derive(Debug)]
pub struct Relooped {
    targets: Vec<StreamedTarget>,
    /// The index of the target to which the pen goes next.
    next: usize,
}

impl Relooped {
    /// Reads all of `path`, and rewinds it. The point at which a stroke begins depends on the
    /// stroke alone, so the rest of a drawing has the same strokes as the whole.
    ///
    /// ```
    /// use penup::drawing::{LineType, PagePoint};
    /// use penup::machine::{Path as _, Target, TargetList};
    /// use penup_job::relooped::Relooped;
    /// let to = |x, y, ink| Target { point: PagePoint { x, y }, ink };
    /// let line = Some(LineType::Full);
    /// // It is not closed, so it stays as it is.
    /// let targets = [to(5, 0, None), to(9, 0, line), to(9, 9, line)];
    /// let mut path = Relooped::of(&mut TargetList::new(&targets));
    /// assert_eq!([(); 3].map(|()| path.next_target()), targets.map(Some));
    /// ```
    pub fn of(path: &mut dyn Path) -> Self {
        let mut targets = Vec::new();
        path.rewind();
        while let Some(target) = path.next_target() {
            targets.push(StreamedTarget { target, pen: path.pen() });
        }
        path.rewind();
        let is_line = |before: &StreamedTarget, target: &StreamedTarget| {
            target.target.ink.is_some() && target.pen == before.pen
        };
        let [begin, last] = [targets.first(), targets.last()].map(|it| it.map(|it| it.target));
        targets.chunk_by_mut(is_line).for_each(reloop);
        // A pen that returns to where it began has now begun elsewhere.
        if begin == last
            && let [first, .., last] = &mut *targets
        {
            last.target = first.target;
        }
        Self { targets, next: 0 }
    }
}

impl Path for Relooped {
    fn next_target(&mut self) -> Option<Target> {
        let next = self.targets.get(self.next)?;
        self.next += 1;
        Some(next.target)
    }

    fn rewind(&mut self) {
        self.next = 0;
    }

    fn look_ahead(&mut self, visit: &mut dyn FnMut(Target) -> bool) {
        let pen = self.pen();
        let rest = self.targets.get(self.next..).unwrap_or_default();
        let _ = rest.iter().take_while(|it| it.pen == pen).all(|it| visit(it.target));
    }

    fn pen(&self) -> u8 {
        let last = self.next.checked_sub(1).and_then(|last| self.targets.get(last));
        last.map_or(0, |last| last.pen)
    }
}

/// Lets a stroke begin at another of its points if it is closed. Its first target is the move to
/// its begin.
fn reloop(stroke: &mut [StreamedTarget]) {
    let [begin, lines @ ..] = stroke else { return };
    let is_closed = lines.last().is_some_and(|last| last.target.point == begin.target.point);
    if begin.target.ink.is_some() || !is_closed {
        return;
    }
    // The checksum of the points is as good as a random number.
    let mut sum = Crc32::new();
    for line in &*lines {
        let point = line.target.point;
        [point.x, point.y].into_iter().for_each(|number| sum.update(&number.to_le_bytes()));
    }
    let first = sum.finalize() as usize % lines.len();
    lines.rotate_left(first);
    if let Some(last) = lines.last() {
        begin.target.point = last.target.point;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup::drawing::{LineType, PagePoint};
    use penup::machine::TargetList;

    /// A closed stroke of this many sides around a place, of which every other one is dashed.
    fn loop_at(x: i32, sides: i32) -> Vec<Target> {
        let point = |side: i32| PagePoint { x: x + side % sides, y: (side % sides).pow(2) };
        let ink = |side: i32| Some(if side % 2 == 1 { LineType::Full } else { LineType::Dashed });
        let lines = (1..=sides).map(|side| Target { point: point(side), ink: ink(side) });
        [Target { point: point(0), ink: None }].into_iter().chain(lines).collect()
    }

    fn all(path: &mut dyn Path) -> Vec<Target> {
        std::iter::from_fn(|| path.next_target()).collect()
    }

    /// The lines from a point to the next, without their order.
    fn sides(stroke: &[Target]) -> Vec<(PagePoint, PagePoint, Option<LineType>)> {
        let side = |ends: &[Target]| (ends[0].point, ends[1].point, ends[1].ink);
        let mut sides: Vec<_> = stroke.windows(2).map(side).collect();
        sides.sort_by_key(|(from, to, _)| (from.x, from.y, to.x, to.y));
        sides
    }

    #[test]
    fn closed_strokes_have_the_same_lines_and_other_begins() {
        let strokes: Vec<Vec<Target>> = (0..60).map(|at| loop_at(100 * at, 3 + at % 9)).collect();
        let whole = strokes.concat();
        let relooped = all(&mut Relooped::of(&mut TargetList::new(&whole)));
        let mut begun = [0; 3];
        for (before, after) in strokes.iter().zip(relooped.chunk_by(|_, it| it.ink.is_some())) {
            assert_eq!(after[0].ink, None);
            assert_eq!(after[0].point, after[after.len() - 1].point);
            assert_eq!(sides(before), sides(after));
            if let Some(begun) = begun.get_mut((after[0].point.x % 100) as usize) {
                *begun += 1;
            }
        }
        assert!(begun.iter().all(|&begun| (3..30).contains(&begun)), "{begun:?}");
        // The rest of a drawing is as in the whole.
        let rest = strokes[40..].concat();
        let rest = all(&mut Relooped::of(&mut TargetList::new(&rest)));
        assert_eq!(rest, relooped[relooped.len() - rest.len()..]);
    }

    #[test]
    fn a_pen_that_returns_does_so_to_where_it_begins_now() {
        let begin = loop_at(0, 7)[0];
        let path = [loop_at(0, 7), loop_at(100, 5), vec![begin]].concat();
        let relooped = all(&mut Relooped::of(&mut TargetList::new(&path)));
        assert_ne!(relooped[0], begin);
        assert_eq!(relooped[relooped.len() - 1], relooped[0]);
        assert_eq!(relooped.len(), path.len());
        // Another move at the end stays.
        let path = [loop_at(0, 7), vec![loop_at(100, 5)[0]]].concat();
        let relooped = all(&mut Relooped::of(&mut TargetList::new(&path)));
        assert_eq!(relooped.last(), path.last());
    }

    #[test]
    fn open_strokes_dots_and_nothing_stay() {
        let mut open = loop_at(0, 5);
        open.pop();
        for targets in [vec![], open, vec![loop_at(0, 3)[0]], loop_at(0, 3)[1..].to_vec()] {
            assert_eq!(all(&mut Relooped::of(&mut TargetList::new(&targets))), targets);
        }
    }
}
