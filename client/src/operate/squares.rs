//! Draws nested squares, which tests look at: in the corner of the sheet, at true size.

use crate::error::Error;
use crate::progress::Quiet;
use crate::sender::Sender;
use penup_job::protocol::CLEAR;

/// The distance of the squares from the edges of the sheet, in mm.
pub(super) const MARGIN: f64 = 10.0;

/// Draws squares with these `sides` in mm, the first of which is the largest, about one middle.
/// Then it takes them from the plotter again.
pub(super) fn draw(sender: &mut Sender<'_>, sides: &[f64]) -> Result<(), Error> {
    let largest = sides.first().copied().unwrap_or_default();
    sender.ask(CLEAR)?;
    for (number, side) in sides.iter().enumerate() {
        let from = MARGIN + (largest - side) / 2.0;
        let to = from + side;
        for (x, y) in [(from, from), (to, from), (to, to), (from, to)] {
            sender.ask(&format!("v {x} {y} 0"))?;
        }
        let corner = |corner: usize| 4 * number + corner;
        let [a, b, c, d] = [1, 2, 3, 4].map(corner);
        sender.ask(&format!("l {a} {b} {c} {d} {a}"))?;
    }
    sender.ask("$fit=off")?;
    sender.ask(&format!("$page={0}x{0}", largest + 2.0 * MARGIN))?;
    sender.ask(&format!("$margin={MARGIN}"))?;
    sender.plot(&mut Quiet)?;
    sender.ask(CLEAR).map(drop)
}
