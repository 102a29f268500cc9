//! `penup shake`: draws squares from which it is read at what frequency a machine shakes.
//!
//! At each corner one axis stops while the other begins, and what shakes of the first is drawn as a
//! wiggle by the second. Whichever way round a square is drawn, two of its sides show how x shakes,
//! and two how y does.

use super::settings::read;
use super::{converse, squares};
use crate::cli::PlotterArgs;
use crate::error::Error;
use crate::interrupt::MovingPlotter;
use crate::machine_settings::AssignedSetting;
use crate::outcome::Outcome;
use penup::machine::Setting;
use serde_json::json;
use std::sync::atomic::AtomicBool;

/// The sides of the squares, in mm.
const SIDES: [f64; 3] = [60.0, 50.0, 40.0];

/// Draws the squares, and says how they are read.
///
/// # Errors
/// As [`Sender::ask`](crate::sender::Sender::ask) and
/// [`Sender::plot`](crate::sender::Sender::plot).
pub fn shake(args: &PlotterArgs, interrupt: &AtomicBool) -> Result<Outcome, Error> {
    let _moving = MovingPlotter::new();
    let settings = converse(args, interrupt, |sender| {
        let settings = read(sender)?;
        squares::draw(sender, &SIDES)?;
        Ok(settings)
    })?;
    let speed = least(&settings, [Setting::DrawSpeed, Setting::MaxRateX, Setting::MaxRateY]) / 60.0;
    let acceleration = least(&settings, [Setting::AccelerationX, Setting::AccelerationY]);
    let run_up = speed * speed / (2.0 * acceleration);
    let is_shaped = value(&settings, Setting::Shaper).is_some_and(|shaper| shaper > 0.0);
    let shaped = if is_shaped {
        "\nMotion is shaped ($226), so that there should be no wiggles; without it they are read \
         as follows."
    } else {
        ""
    };
    let text = format!(
        "three squares are drawn at {speed:.0} mm/s ($201){shaped}\n\
         Look along a side, behind a corner, where the pen is at full speed: {run_up:.1} mm from \
         the corner on.\n\
         Count some wiggles, and measure their length: frequency = {speed:.0} x wiggles / mm.\n\
         Upright sides show how x shakes ($227), level sides how y does ($228)."
    );
    let json = json!({ "speed": speed, "run_up": run_up, "shaped": is_shaped });
    Ok(Outcome::answer(text, json))
}

/// The value of a setting, if the plotter has it.
fn value(settings: &[AssignedSetting], setting: Setting) -> Option<f64> {
    let number = setting.info().number();
    settings.iter().find(|it| it.number == number)?.value.parse().ok()
}

/// The least value of some settings.
fn least<const N: usize>(settings: &[AssignedSetting], of: [Setting; N]) -> f64 {
    of.into_iter().filter_map(|setting| value(settings, setting)).fold(f64::INFINITY, f64::min)
}
