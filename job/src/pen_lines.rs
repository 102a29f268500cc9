//! The lines that lower and raise the pen of a machine where it stands, by its settings.

use crate::machine_settings::{AssignedSetting, value};
use crate::protocol::{PEN_DOWN, PEN_UP};
use penup::machine::Setting;

/// The speed of the moves along Z, in mm/min.
const SPEED: f64 = 1000.0;

/// How far beside the height of the lowered pen the pen is up, in mm of Z.
const CLEARANCE: f64 = 1.0;

/// The lines that lower the pen where it stands, and raise it again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PenLines {
    /// Lowers the pen.
    pub down: String,
    /// Raises it again.
    pub up: String,
}

impl PenLines {
    /// The lines for a machine with these settings.
    ///
    /// # Errors
    /// The reason, for the user: it has a laser, which draws only while it moves.
    pub fn of(settings: &[AssignedSetting]) -> Result<Self, &'static str> {
        let of = |setting| value(settings, setting);
        if of(Setting::Laser) != 0.0 {
            return Err(
                "this machine has a laser by its settings ($32=1), which is on only while \
                        it moves: set 32=0 if it has a pen",
            );
        }
        let (down, up) = match of(Setting::PenMode) {
            2.0 => {
                let height = of(Setting::PenZ);
                let away = if of(Setting::PenZAbove) == 0.0 { CLEARANCE } else { -CLEARANCE };
                let to = |z: f64| format!("G21G90G94G1Z{z}F{SPEED}");
                (to(height), to(height + away))
            }
            3.0 => (format!("{PEN_DOWN}S{}", of(Setting::PenS)), PEN_UP.to_owned()),
            _ => (PEN_DOWN.to_owned(), PEN_UP.to_owned()),
        };
        Ok(Self { down, up })
    }
}
