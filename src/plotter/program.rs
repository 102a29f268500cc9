//! The G-code interpreter: it turns a line of G-code into an order for the machine, given the modes
//! that earlier lines have set.

use crate::array::MapEach;
use crate::drawing::{PAGE_LIMIT, PagePoint, StepsPerMillimetre};
use crate::fixed::{Decimal, Millimetres, divide_rounding, half, product};
use crate::machine::Machine;
use crate::protocol::{CommandError, GCode, Word};
use crate::step::{Arc, ArcError, Turn};

/// The modes and the position that the lines so far have set. Lengths are in millimetres, from the
/// page's origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Program {
    /// The kind of move that coordinates ask for: G0, G1, G2 or G3.
    motion: Motion,
    /// Whether lengths are in inches (G20). Otherwise they are in millimetres (G21).
    inches: bool,
    /// Whether coordinates are relative to the last position (G91). Otherwise they are absolute
    /// (G90).
    relative: bool,
    /// Whether the next moves are drawn.
    pub(super) pen_is_down: bool,
    /// The feed in mm/min, if one is set.
    pub(super) feed: Option<Millimetres>,
    /// The end of the last move, as the lines give it.
    at: [Millimetres; 2],
}

/// The kind of move that coordinates ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motion {
    Rapid,
    Line,
    Arc(Turn),
}

/// The order of a line: what the machine is to do now.
#[derive(Debug, Clone)]
pub(super) enum Order {
    /// Nothing moves.
    Nothing,
    /// A straight move.
    Line(PagePoint),
    /// A move along an arc.
    Arc(Arc),
    /// The pen goes down where it stands.
    Lower,
    /// A dwell, in units of 2^-16 s.
    Dwell(u32),
    /// A pause until the user resumes.
    Pause,
    /// A pen-up move to the park position.
    Park,
}

/// The coordinates and parameters of one line.
#[derive(Default)]
struct Numbers {
    /// The end of the move: X and Y.
    xy: [Option<Decimal>; 2],
    /// The centre of an arc, relative to its start: I and J.
    ij: [Option<Decimal>; 2],
    /// The radius of an arc: R.
    radius: Option<Decimal>,
    /// The length of a dwell: P.
    seconds: Option<Decimal>,
}

impl Default for Program {
    fn default() -> Self {
        Self {
            motion: Motion::Rapid,
            inches: false,
            relative: false,
            pen_is_down: false,
            feed: None,
            at: [Millimetres::ZERO; 2],
        }
    }
}

impl Program {
    /// The program, continued from the position where `machine` will stop. While the machine only
    /// checks G-code (`checking`), it does not move, so the program keeps its own position.
    pub(super) fn at(self, machine: &Machine<'_>, checking: bool) -> Self {
        let steps = machine.settings().page_steps();
        if checking || steps_at(self.at, steps) == machine.end() {
            return self;
        }
        let point = machine.end();
        Self { at: machine.millimetres(point), ..self }
    }

    /// The program after `line`, and the order of that line.
    ///
    /// # Errors
    /// [`CommandError::UnsupportedWord`] for a word that is not known,
    /// [`CommandError::NumberOutOfRange`], [`CommandError::Arc`] if there is no such arc.
    pub(super) fn after(
        mut self,
        line: GCode<'_>,
        steps: StepsPerMillimetre,
    ) -> Result<(Self, Order), CommandError> {
        let mut numbers = Numbers::default();
        let mut order = Order::Nothing;
        let pen_was_down = self.pen_is_down;
        for Word { letter, number } in line.words() {
            match letter {
                b'G' => self.take_g(number, &mut order)?,
                b'M' => self.take_m(number, &mut order)?,
                b'X' => numbers.xy[0] = Some(number),
                b'Y' => numbers.xy[1] = Some(number),
                b'I' => numbers.ij[0] = Some(number),
                b'J' => numbers.ij[1] = Some(number),
                b'R' => numbers.radius = Some(number),
                b'P' => numbers.seconds = Some(number),
                // The pen is down at Z0 and below.
                b'Z' => self.pen_is_down = self.length(number)? <= 0,
                b'F' => self.feed = Some(self.length(number)?).filter(|feed| *feed > 0),
                b'N' | b'S' | b'T' => {}
                _ => return Err(CommandError::UnsupportedWord(letter)),
            }
        }
        match order {
            Order::Dwell(_) => {
                let seconds = numbers.seconds.map(Decimal::to_millimetres).transpose();
                let seconds =
                    seconds.map_err(|_| CommandError::NumberOutOfRange)?.unwrap_or_default();
                let units = u32::try_from(seconds.to_bits());
                order = Order::Dwell(units.map_err(|_| CommandError::NumberOutOfRange)?);
            }
            Order::Park => self.pen_is_down = false,
            Order::Nothing if numbers.xy != [None; 2] || numbers.ij != [None; 2] => {
                order = self.motion(&numbers, steps)?;
            }
            Order::Nothing if self.pen_is_down && !pen_was_down => order = Order::Lower,
            _ => {}
        }
        Ok((self, order))
    }

    /// Handles a word G: a mode or an order.
    fn take_g(&mut self, number: Decimal, order: &mut Order) -> Result<(), CommandError> {
        match number.to_whole() {
            Ok(0) => self.motion = Motion::Rapid,
            Ok(1) => self.motion = Motion::Line,
            Ok(2) => self.motion = Motion::Arc(Turn::Clockwise),
            Ok(3) => self.motion = Motion::Arc(Turn::Counterclockwise),
            Ok(4) => *order = Order::Dwell(0),
            Ok(20) => self.inches = true,
            Ok(21) => self.inches = false,
            Ok(28) => *order = Order::Park,
            Ok(90) => self.relative = false,
            Ok(91) => self.relative = true,
            // These choose the xy plane, no compensation, no offsets, and units per minute, which
            // are all that there is here.
            Ok(17 | 40 | 49 | 54 | 80 | 94) => {}
            _ if Decimal::parse("91.1") == Ok(number) => {}
            _ => return Err(CommandError::UnsupportedWord(b'G')),
        }
        Ok(())
    }

    /// Handles a word M: the pen, a pause or the end of the program.
    fn take_m(&mut self, number: Decimal, order: &mut Order) -> Result<(), CommandError> {
        match number.to_whole() {
            Ok(0 | 1 | 6) => *order = Order::Pause,
            Ok(2 | 30) => *self = Self { at: self.at, ..Self::default() },
            Ok(3 | 4) => self.pen_is_down = true,
            Ok(5) => self.pen_is_down = false,
            _ => return Err(CommandError::UnsupportedWord(b'M')),
        }
        Ok(())
    }

    /// The order for the coordinates of a line. Moves the position to their end.
    fn motion(
        &mut self,
        numbers: &Numbers,
        steps: StepsPerMillimetre,
    ) -> Result<Order, CommandError> {
        let from = self.at;
        for (axis, number) in numbers.xy.into_iter().enumerate() {
            let Some(number) = number else { continue };
            let base = if self.relative { from[axis] } else { Millimetres::ZERO };
            self.at[axis] =
                base.checked_add(self.length(number)?).ok_or(CommandError::NumberOutOfRange)?;
        }
        let to = steps_at(self.at, steps);
        let Motion::Arc(turn) = self.motion else { return Ok(Order::Line(to)) };
        let start = steps_at(from, steps);
        let center = match numbers.radius {
            Some(radius) => {
                let radius = self.length(radius)?;
                let center = center_of_radius(from, self.at, radius, turn);
                steps_at(center.ok_or(CommandError::Arc(ArcError::NoRadius))?, steps)
            }
            None => {
                let mut center = from;
                for (axis, number) in numbers.ij.into_iter().enumerate() {
                    let Some(number) = number else { continue };
                    let offset = self.length(number)?;
                    center[axis] =
                        center[axis].checked_add(offset).ok_or(CommandError::NumberOutOfRange)?;
                }
                steps_at(center, steps)
            }
        };
        Arc::scaled(steps, center, start, to, turn).map(Order::Arc).map_err(CommandError::Arc)
    }

    /// A length as given in the current unit, in millimetres.
    fn length(&self, number: Decimal) -> Result<Millimetres, CommandError> {
        let bits = number.to_binary(16).map_err(|_| CommandError::NumberOutOfRange)?;
        let bits = product(bits, if self.inches { 127 } else { 5 });
        i32::try_from(divide_rounding(bits, 5))
            .map(Millimetres::from_bits)
            .map_err(|_| CommandError::NumberOutOfRange)
    }
}

/// The length in steps from the page's origin, clamped to a value that still lies beyond every
/// page.
fn to_steps(length: Millimetres, per_mm: Millimetres) -> i32 {
    let exact = i64::from(length.to_bits()) * i64::from(per_mm.to_bits());
    let steps = divide_rounding(exact.into(), 1 << 32);
    steps.clamp((-2 * PAGE_LIMIT).into(), (2 * PAGE_LIMIT).into()) as i32
}

/// A position in steps.
fn steps_at([x, y]: [Millimetres; 2], steps: StepsPerMillimetre) -> PagePoint {
    PagePoint { x: to_steps(x, steps[0]), y: to_steps(y, steps[1]) }
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
    let [dx, dy] = [0, 1].map_each(|axis| halved(to[axis]) - halved(from[axis]));
    let distance = (dx * dx + dy * dy).unsigned_abs();
    let wide = 2 * halved(radius).unsigned_abs();
    let length = distance.isqrt();
    // With rounded ends, the points may be up to a step further apart than the diameter.
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
