//! The answers to the instructions `OA` to `OW`.

use super::coordinates::{Point, Rectangle, UNIT};
use super::interpreter::{Answer, Interpreter, Step};
use super::polygon::PolygonBuffer;
use crate::fixed::{BinaryFraction, divide_rounding};
use core::fmt::Write;

impl<B: PolygonBuffer> Interpreter<B> {
    /// Answers the instruction with this second letter. Returns `false` if there is no such
    /// instruction.
    pub(super) fn query(&mut self, letter: u8) -> bool {
        let mut answer = Answer::new();
        // Writing cannot fail, because these answers are shorter than the buffer.
        let _ = match letter {
            b'I' => answer.write_str("7475A"),
            b'S' => {
                let status = self.status();
                self.is_initialized = false;
                write!(answer, "{status}")
            }
            b'E' => {
                let error = core::mem::take(&mut self.error);
                write!(answer, "{error}")
            }
            b'F' => answer.write_str("40,40"),
            b'O' => answer.write_str("0,1,0,0,1,0,0,0"),
            b'H' => self.write_rectangle(&mut answer, self.frame.limits, false),
            b'W' => self.write_rectangle(&mut answer, self.frame.visible(), self.frame.is_scaled()),
            b'P' => {
                self.has_new_corners = false;
                let [p1, p2] = self.frame.corners;
                let [x1, y1, x2, y2] = [p1.x, p1.y, p2.x, p2.y].map(whole);
                write!(answer, "{x1},{y1},{x2},{y2}")
            }
            b'A' => {
                let at = self.frame.limits.nearest(self.at);
                let Point { x, y } = self.frame.plotter_units(at);
                write!(answer, "{},{},{}", whole(x), whole(y), u8::from(self.is_down))
            }
            b'C' => {
                let Point { x, y } = self.frame.user_units(self.at);
                let user = self.frame.is_scaled();
                write!(answer, "{},{},{}", number(x, user), number(y, user), u8::from(self.is_down))
            }
            _ => return false,
        };
        self.add(Step::Answer(answer));
        true
    }

    /// The status byte: 1 the pen is down, 2 P1 or P2 changed, 8 initialized, 16 ready, 32 an
    /// error.
    fn status(&self) -> u8 {
        let bit = |is_set: bool, value: u8| if is_set { value } else { 0 };
        bit(self.is_down, 1)
            + bit(self.has_new_corners, 2)
            + bit(self.is_initialized, 8)
            + 16
            + bit(self.error != 0, 32)
    }

    /// Writes the corners of a rectangle on the page.
    fn write_rectangle(
        &self,
        answer: &mut Answer,
        rectangle: Rectangle,
        user: bool,
    ) -> core::fmt::Result {
        let Rectangle { least, most } = self.frame.seen(rectangle, user);
        let [x1, y1, x2, y2] = [least.x, least.y, most.x, most.y].map(|c| number(c, user));
        write!(answer, "{x1},{y1},{x2},{y2}")
    }
}

/// Rounds a coordinate to a whole unit.
fn whole(coordinate: i64) -> i64 {
    divide_rounding(coordinate.into(), UNIT.into()) as i64
}

/// Formats a coordinate: user units with four decimals, plotter units without.
fn number(coordinate: i64, user: bool) -> BinaryFraction {
    let decimals = if user { 4 } else { 0 };
    BinaryFraction { units: coordinate, fraction_bits: 16, decimals }
}
