//! What lowers and raises the pen of a machine, by its settings.

use super::settings::value;
use crate::error::Error;
use crate::machine_settings::AssignedSetting;
use crate::sender::Sender;
use penup::machine::Setting;
use penup_job::protocol::{PEN_DOWN, PEN_UP, Status};

/// The speed of the moves along Z, in mm/min.
const SPEED: f64 = 1000.0;

/// How far beside the height of the lowered pen the pen is up, in mm of Z.
const CLEARANCE: f64 = 1.0;

/// The lines that lower the pen where it stands, and raise it again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PenLines {
    down: String,
    up: String,
}

impl PenLines {
    /// The lines for a machine with these settings.
    ///
    /// # Errors
    /// It has a laser, which draws only while it moves.
    pub(super) fn of(settings: &[AssignedSetting]) -> Result<Self, Error> {
        let of = |setting| value(settings, setting);
        if of(Setting::Laser) != 0.0 {
            let reason = "this machine has a laser by its settings ($32=1), which is on only while \
                          it moves: set 32=0 if it has a pen";
            return Err(Error::NotLowered { reason: reason.to_owned() });
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

    /// Lowers the pen for a moment. Returns the status in which it is up again.
    ///
    /// # Errors
    /// As [`Sender::ask`].
    pub(super) fn dip(&self, sender: &mut Sender<'_>) -> Result<Status, Error> {
        sender.ask(&self.down)?;
        sender.wait_until_ready()?;
        // The plotter has raised the pen itself, but its program has not.
        sender.ask(&self.up)?;
        sender.wait_until_ready()
    }
}

#[cfg(test)]
mod tests {
    use super::PenLines;
    use crate::error::Error;
    use crate::preview::InMemory;
    use crate::sender::{Sender, Timeouts};
    use penup_job::machine_settings::{AssignedSetting, simulated};
    use penup_job::room::Room;
    use std::sync::atomic::AtomicBool;

    /// The lines for a machine with these settings, and how often they lower its pen.
    fn dips(settings: &[&str]) -> Result<usize, Error> {
        let parse = |text: &&str| AssignedSetting::parse(text).expect("a setting");
        let assigned: Vec<_> = settings.iter().map(parse).collect();
        let lines = PenLines::of(&assigned)?;
        let machine = simulated(&assigned).expect("a machine");
        let mut plotter = InMemory::<u16>::new(Room::usual(), machine);
        let interrupt = AtomicBool::new(false);
        let (mut sender, _) =
            Sender::open_for_orders(&mut plotter, Timeouts::simulated(), &interrupt)?;
        lines.dip(&mut sender)?;
        // Nothing that follows draws because the pen was lowered before.
        sender.ask("G21G90G0X5F600")?;
        sender.wait_until_ready()?;
        sender.end();
        Ok(plotter.pen_falls())
    }

    #[test]
    fn the_pen_goes_down_whatever_moves_it() {
        for settings in [
            &["206=0"][..],
            &["206=1"],
            &["206=2"],
            &["206=2", "207=-3.5"],
            &["206=2", "207=4", "208=1"],
            &["206=3", "216=45"],
            &["206=3", "216=90.5", "217=1"],
        ] {
            assert_eq!(dips(settings).expect("lowered"), 1, "{settings:?}");
        }
        let refusal = dips(&["32=1", "206=2"]).expect_err("a laser");
        assert!(refusal.to_string().contains("set 32=0"), "{refusal}");
    }
}
