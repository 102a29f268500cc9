//! Lowers the pen of a machine for a moment.

use crate::error::Error;
use crate::machine_settings::AssignedSetting;
use crate::sender::Sender;
use penup_job::pen_lines::PenLines;
use penup_job::protocol::Status;

/// The lines that lower and raise the pen of a machine with these settings.
///
/// # Errors
/// It has a laser, which draws only while it moves.
pub(super) fn pen_lines(settings: &[AssignedSetting]) -> Result<PenLines, Error> {
    PenLines::of(settings).map_err(|reason| Error::NotLowered { reason: reason.to_owned() })
}

/// Lowers the pen for a moment by `lines`. Returns the status in which it is up again.
///
/// # Errors
/// As [`Sender::ask`].
pub(super) fn dip(lines: &PenLines, sender: &mut Sender<'_>) -> Result<Status, Error> {
    sender.ask(&lines.down)?;
    sender.wait_until_ready()?;
    // The plotter has raised the pen itself, but its program has not.
    sender.ask(&lines.up)?;
    sender.wait_until_ready()
}

#[cfg(test)]
mod tests {
    use super::{dip, pen_lines};
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
        let lines = pen_lines(&assigned)?;
        let machine = simulated(&assigned).expect("a machine");
        let mut plotter = InMemory::<u16>::new(Room::usual(), machine);
        let interrupt = AtomicBool::new(false);
        let (mut sender, _) =
            Sender::open_for_orders(&mut plotter, Timeouts::simulated(), &interrupt)?;
        dip(&lines, &mut sender)?;
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
