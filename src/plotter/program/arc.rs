//! The arcs of G2 and G3.

use super::block::Block;
use super::{Program, steps_at, to_steps_within};
use crate::array::MapEach;
use crate::drawing::{PagePoint, StepsPerMillimetre};
use crate::fixed::{Millimetres, divide_rounding, half, product};
use crate::protocol::{BlockError, CommandError};
use crate::step::{Arc, ArcError, Turn};

impl Program {
    /// The arc from one position of the machine to another that the words of the block give; `None`
    /// if it is shorter than a step, or so wide that it is straight.
    ///
    /// # Errors
    /// [`CommandError::Block`] if words are missing, [`CommandError::Arc`] if there is no such arc.
    pub(super) fn arc(
        &self,
        block: &Block,
        [from, to]: [[Millimetres; 2]; 2],
        turn: Turn,
        steps: StepsPerMillimetre,
    ) -> Result<Option<Arc>, CommandError> {
        let axes: [&[u8]; 3] = [b"XY", b"ZX", b"YZ"];
        let offsets: [&[u8]; 3] = [b"IJ", b"KI", b"JK"];
        let plane = usize::from(self.plane.0);
        if !block.has_any(b"XYZ") {
            return Err(BlockError::NoAxis.into());
        }
        if !axes.get(plane).is_some_and(|letters| block.has_any(letters)) {
            return Err(BlockError::ArcNoAxis.into());
        }
        let has_offset = offsets.get(plane).is_some_and(|letters| block.has_any(letters));
        if !block.has(b'R') && !has_offset {
            return Err(BlockError::ArcNoOffset.into());
        }
        if plane != 0 {
            return Err(BlockError::ArcPlane.into());
        }
        let center = match block.number(b'R') {
            Some(radius) => {
                let radius = self.length(radius)?;
                if from == to {
                    return Err(CommandError::Arc(ArcError::NoRadius));
                }
                center_of_radius(from, to, radius, turn).ok_or(BlockError::ArcRadius)?
            }
            None => {
                let mut center = from;
                for (position, letter) in center.iter_mut().zip([b'I', b'J']) {
                    let Some(number) = block.number(letter) else { continue };
                    let offset = self.length(number)?;
                    *position =
                        position.checked_add(offset).ok_or(CommandError::NumberOutOfRange)?;
                }
                center
            }
        };
        let ends = [from, to];
        let is_short = from != to && is_short(center, ends, turn);
        let [from, to] = ends.map_each(|point| steps_at(point, steps));
        // A centre may lie far beyond every page.
        // The centre and the steps are those of the axes 0 and 1.
        let [x, y] = [0, 1].map_each(|axis| to_steps_within(FAR, center[axis], steps[axis]));
        let center = PagePoint { x, y };
        // Ends that only the steps make the same are not those of a whole circle.
        if from == to && is_short {
            return Ok(None);
        }
        match Arc::scaled(steps, center, from, to, turn) {
            // Its line is off the arc by less than half a step.
            Err(ArcError::TooWide) if is_short && is_near(from, to) => Ok(None),
            arc => arc.map(Some).map_err(CommandError::Arc),
        }
    }
}

/// A number of steps that lies beyond every centre that an arc can have, though not by much: sums
/// of two fit in 32 bits.
const FAR: i32 = 1 << 24;

/// Whether the ends of an arc lie so close together that it is straight if its radius is 2^22
/// steps or more: its height over its chord c is c² / 8 r.
fn is_near(from: PagePoint, to: PagePoint) -> bool {
    from.x.abs_diff(to.x).max(from.y.abs_diff(to.y)) < 1 << 11
}

/// Whether an arc whose ends lie close together is the short one of the two between them, and not
/// the one nearly all around `center`.
fn is_short(center: [Millimetres; 2], [from, to]: [[Millimetres; 2]; 2], turn: Turn) -> bool {
    // The axes are 0 and 1, which both points have.
    let between = |from: [Millimetres; 2], to: [Millimetres; 2]| {
        [0, 1].map_each(|axis| i64::from(to[axis].to_bits()) - i64::from(from[axis].to_bits()))
    };
    let ([x, y], [dx, dy]) = (between(center, from), between(from, to));
    let across = x.saturating_mul(dy).saturating_sub(y.saturating_mul(dx));
    if turn == Turn::Counterclockwise { across > 0 } else { across < 0 }
}

/// The centre of the arc from `from` to `to` that turns less than half a turn, or more if `radius`
/// is negative. `None` if the points are further apart than the diameter.
fn center_of_radius(
    from: [Millimetres; 2],
    to: [Millimetres; 2],
    radius: Millimetres,
    turn: Turn,
) -> Option<[Millimetres; 2]> {
    // Lengths are in units of 2^-15 mm, below 2^30; so differences are below 2^31 and squares below
    // 2^62.
    let halved = |length: Millimetres| i64::from(length.to_bits()) / 2;
    // Here and in `middle`, the axes are 0 and 1, which both points have.
    let [dx, dy] = [0, 1].map_each(|axis| halved(to[axis]) - halved(from[axis]));
    let distance = (dx * dx + dy * dy).unsigned_abs();
    let wide = 2 * halved(radius).unsigned_abs();
    let length = distance.isqrt();
    // With rounded ends, the points may be further apart than the diameter, by 0.05 mm at most.
    if length == 0 || length > wide + (1 << 15) / 20 {
        return None;
    }
    // Twice the distance from the chord to the centre. The centre lies to the right of the chord
    // for a clockwise arc.
    let height = (wide * wide).saturating_sub(distance).isqrt() as i64;
    let is_right = (turn == Turn::Clockwise) == (radius > 0);
    let height = if is_right { height } else { -height };
    let middle = |axis: usize, across: i64| {
        let offset = divide_rounding(product(across, height), length.into());
        let sum = i128::from(from[axis].to_bits()) + i128::from(to[axis].to_bits()) + 2 * offset;
        i32::try_from(half(sum)).ok().map(Millimetres::from_bits)
    };
    Some([middle(0, dy)?, middle(1, -dx)?])
}
