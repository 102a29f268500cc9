//! Draws nested squares, which tests look at: in the corner of the sheet, at true size.

use super::settings::read;
use crate::error::Error;
use crate::machine_settings::simulated;
use crate::preview::InMemory;
use crate::progress::Quiet;
use crate::sender::Sender;
use penup::machine::Settings;
use penup_job::room::Room;
use penup_readers::lines::JobLine;

/// The distance of the squares from the edges of the sheet, in mm.
pub(super) const MARGIN: f64 = 10.0;

/// Draws squares with these `sides` in mm, the first of which is the largest, about one middle.
///
/// This computer computes them and sends their strokes, so they depend on no option of an earlier
/// job, change none, and leave the model in the plotter's memory alone.
pub(super) fn draw(sender: &mut Sender<'_>, sides: &[f64]) -> Result<(), Error> {
    let settings: Settings = simulated(&read(sender)?)?;
    let lines: Vec<JobLine> = lines(sides).into_iter().map(JobLine::command).collect();
    let mut host = InMemory::<u32>::new(Room::for_job(&lines), settings);
    if !host.take(&lines) {
        let reason = "this machine cannot draw the test squares".to_owned();
        return Err(Error::NotStreamed { reason });
    }
    let form = sender.form(&settings)?;
    let (streamed, _) = host.streamed(form, 0)?;
    sender.draw_streamed(&streamed, &mut Quiet)
}

/// Returns the lines of the job that draws the squares.
fn lines(sides: &[f64]) -> Vec<String> {
    let largest = sides.first().copied().unwrap_or_default();
    let mut lines = Vec::new();
    for (number, side) in sides.iter().enumerate() {
        let from = MARGIN + (largest - side) / 2.0;
        let to = from + side;
        for (x, y) in [(from, from), (to, from), (to, to), (from, to)] {
            lines.push(format!("v {x} {y} 0"));
        }
        let [a, b, c, d] = [1, 2, 3, 4].map(|corner| 4 * number + corner);
        lines.push(format!("l {a} {b} {c} {d} {a}"));
    }
    lines.push(format!("$page={0}x{0}", largest + 2.0 * MARGIN));
    lines.push(format!("$margin={MARGIN}"));
    lines
}
