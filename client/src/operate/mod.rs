//! The commands that ask or move a plotter: what `penup status`, `penup watch` and the others do.

mod console;
mod lowering;
mod orders;
mod rehearsal;
mod settings;
mod settings_file;
mod setup;
mod shake;
mod squares;
mod status;

pub use console::console;
pub use orders::{abort, again, home, jog, pause, pen, resume, unlock, watch};
pub use rehearsal::limits;
pub(crate) use settings::read as read_settings;
pub use settings::{fail_if_given_twice, restore, save, set, show};
pub use settings_file::{SavedSettings, SettingsFileError};
pub use setup::setup;
pub use shake::shake;
pub use status::{ports, status};

use crate::cli::{PlotterArgs, PortArgs};
use crate::error::Error;
use crate::link::SerialLink;
use crate::ports as serial_ports;
use crate::sender::{Sender, Timeouts};
use std::sync::atomic::AtomicBool;

/// Opens the port of the plotter.
fn open(args: &PortArgs) -> Result<SerialLink, Error> {
    serial_ports::open(&args.port)
}

/// Does `work` in a conversation with the plotter at `args`, which must not be moving, and ends the
/// conversation.
fn converse<T>(
    args: &PlotterArgs,
    interrupt: &AtomicBool,
    work: impl FnOnce(&mut Sender<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    let mut link = open(&args.port)?;
    let (mut sender, _) = Sender::open_for_orders(&mut link, Timeouts::default(), interrupt)?;
    let done = work(&mut sender);
    sender.end();
    done
}
