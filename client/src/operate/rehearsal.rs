//! Rehearses a job before its first line is sent: the library on this computer draws it as the
//! plotter would, with the plotter's settings, and what the plotter would refuse at the end of a
//! long transfer is refused at once.

use super::settings::{agreed, read};
use crate::error::Error;
use crate::machine_settings::simulated;
use crate::preview::InMemory;
use crate::sender::Sender;
use penup_job::protocol::{MODEL, Reply};
use penup_job::room::Room;
use penup_readers::lines::Lines;

/// How much a plotter holds, and how much a model takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Capacity {
    vertices: usize,
    corners: usize,
}

/// Checks that the plotter at the other end can hold the job and draw it. The machine must be idle.
///
/// # Errors
/// The model is too large for the plotter, or the drawing does not fit the machine.
pub fn rehearse(sender: &mut Sender<'_>, job: &dyn Lines) -> Result<(), Error> {
    let capacity = agreed(sender, |sender| Ok(capacity_in(&sender.ask(MODEL)?)))?;
    // Settings of a newer firmware are not known here. Then the plotter itself decides.
    let Ok(machine) = simulated(&read(sender)?) else { return Ok(()) };
    let mut plotter = InMemory::<u32>::new(Room::for_job(job), machine);
    if !plotter.take(job) {
        // The plotter names the line that it refuses.
        return Ok(());
    }
    let (vertices, corners) = plotter.model_size();
    for (what, count, limit) in
        [("vertices", vertices, capacity.vertices), ("corners", corners, capacity.corners)]
    {
        if count > limit {
            return Err(Error::TooLarge { what, count, limit });
        }
    }
    plotter.rehearse()
}

/// The limits in the answer to `$model`: `[MODEL:vertices 0 of 4000]` and
/// `[MODEL:faces 0, bars 0, curves 0, corners 0 of 16000]`.
fn capacity_in(replies: &[Reply]) -> Option<Capacity> {
    let limit = |what: &str| {
        replies.iter().find_map(|reply| {
            let Reply::Other(line) = reply else { return None };
            let (_, rest) = line.strip_prefix("[MODEL:")?.strip_suffix(']')?.split_once(what)?;
            rest.split_once(" of ")?.1.parse().ok()
        })
    };
    Some(Capacity { vertices: limit("vertices ")?, corners: limit("corners ")? })
}
