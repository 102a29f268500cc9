//! The interface between the plotter and a board.
//!
//! The plotter is the same for every board. A board implements [`Board`]: it receives and sends
//! bytes, pulses the pins from a queue of step events, and may keep records in flash.

use crate::machine::Contacts;
use crate::motion::EventQueue;
use crate::protocol::RealTime;
use crate::storage::LogProgress;
#[cfg(feature = "tiles")]
use crate::storage::area::{Area, AreaFlash};

/// A board: its serial ports, and the interrupt that turns step events into pin levels.
pub trait Board {
    /// The board's name, which `$I` reports.
    const NAME: &'static str;

    /// Whether the board can become a USB drive onto which a new firmware image is copied.
    const HAS_DRIVE: bool = false;

    /// The next ordinary byte, with the number of the serial port that received it, counted from 0.
    ///
    /// Returns `None` while an abort waits in [`Board::take_real_time`]. Where bytes were lost or
    /// damaged, the byte is [`DAMAGED`](crate::protocol::DAMAGED). Each port has its own lines:
    /// bytes from other ports never become part of them.
    fn read_byte(&mut self) -> Option<(usize, u8)>;
    /// Takes the real-time requests received since the last call.
    fn take_real_time(&mut self) -> RealTime;
    /// Whether `bytes` bytes can be sent without blocking. Callers ask for [`REPLY_BYTES`] at most.
    /// The board must make room after some time even if nobody reads from it.
    fn has_room(&mut self, bytes: usize) -> bool {
        let _ = bytes;
        true
    }
    /// Sends bytes. Blocks while there is no room for them.
    fn write(&mut self, bytes: &[u8]);
    /// Whether a program has opened a port since the last call. The greeting then goes to that port
    /// alone.
    fn take_opened(&mut self) -> bool {
        false
    }
    /// Chooses the ports for all later replies: only the port that was opened last
    /// (`only_to_opened`), or all ports.
    fn reply_only_to_opened(&mut self, only_to_opened: bool) {
        let _ = only_to_opened;
    }
    /// Chooses the ports for everything that is written from now on. A board with one port need not
    /// implement it.
    fn reply_to(&mut self, replies: Replies) {
        let _ = replies;
    }
    /// Whether the host has asked for the drive since the last call, in another way than by
    /// command.
    fn wants_drive(&mut self) -> bool {
        false
    }
    /// Becomes the USB drive, if the board has one. It first sends what was written; it then raises
    /// the pen and switches the motor drivers off.
    fn show_drive(&mut self) {}
    /// The queue for step events. The board begins to execute them when the queue is half full, or
    /// at the next [`Board::wait`].
    fn queue(&mut self) -> &mut dyn EventQueue;
    /// The contacts that are closed. A board without contacts reports none. A change ends
    /// [`Board::wait`].
    fn contacts(&mut self) -> Contacts {
        Contacts::default()
    }
    /// Runs the step interrupt early, as soon as no pulse is high. It is called after an alarm has
    /// halted the pins, so that they stop at once.
    fn step_now(&mut self) {}
    /// The message of the fault that ended the previous run, if the board has restarted itself
    /// after a fault.
    fn fault(&self) -> Option<&str> {
        None
    }
    /// Writes the concatenation of `parts` to flash as the new state of `record`, in place of the
    /// last one. The state survives a loss of power. The call may block, so it is only made while
    /// the machine is stopped.
    ///
    /// # Errors
    /// [`NotStored`] if the flash does not take it; the last state is still kept.
    fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        let _ = (record, parts);
        Ok(())
    }
    /// Saves a new state of `record` as [`Board::save`] does, and leaves `room` behind it for bytes
    /// that are [added](Board::add) later.
    ///
    /// # Errors
    /// [`NotStored`] if the flash does not take it; the last state is still kept.
    #[cfg(feature = "early-ink")]
    fn save_with_room(
        &mut self,
        record: Record,
        parts: &[&[u8]],
        room: u32,
    ) -> Result<(), NotStored> {
        let _ = room;
        self.save(record, parts)
    }
    /// Erases one more sector of what the next job will take if it is saved with this many `bytes`,
    /// its header and its room included, and at last its log. Returns whether more may be left. The
    /// call may block, so it is only made while the machine is stopped; between two calls the user
    /// is listened to. What was erased ahead is not erased again.
    #[cfg(feature = "early-ink")]
    fn erase_ahead(&mut self, bytes: u32) -> bool {
        let _ = bytes;
        false
    }
    /// Adds the concatenation of `parts` to the state of `record` that was saved last, for which
    /// there is [room](Board::save_with_room). The call may block for some milliseconds, so it is
    /// only made while the machine is at rest with the pen raised and no step waits.
    ///
    /// # Errors
    /// [`NotStored`] if the flash does not take it; nothing is then added.
    #[cfg(feature = "early-ink")]
    fn add(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        let _ = (record, parts);
        Ok(())
    }
    /// Begins to execute the events in the queue, if it is less than half full, and goes on. It is
    /// called in place of [`Board::wait`] where the plotter computes while steps run.
    #[cfg(feature = "early-ink")]
    fn begin_steps(&mut self) {}
    /// Passes to `take` what was added to the last saved state of `record`, if all of it is there.
    #[cfg(feature = "early-ink")]
    fn load_added(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        let _ = (record, take);
    }
    /// Passes the state of `record` that was saved last to `take`, if there is one.
    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        let _ = (record, take);
    }
    /// Whether the board keeps how far a job has come, so that the job can go on after a loss of
    /// power.
    fn keeps_progress(&self) -> bool {
        false
    }
    /// Begins to keep the progress of the job that was saved last, which has this many `strokes`,
    /// none of which is drawn yet. `notes` are kept with it. The call may block, so it is only made
    /// while the machine is stopped.
    ///
    /// # Errors
    /// [`NotStored`] if no job is kept, or the flash does not take it.
    fn begin_progress(&mut self, notes: &[u8], strokes: u32) -> Result<(), NotStored> {
        let _ = (notes, strokes);
        Err(NotStored)
    }
    /// Keeps that this many strokes of the job have been drawn; `u32::MAX` are all of them, however
    /// many there are. The call may block for a few milliseconds, so it is only made while the
    /// machine is at rest with the pen raised and no step waits.
    ///
    /// # Errors
    /// [`NotStored`] if the flash does not take it.
    fn note_progress(&mut self, strokes: u32) -> Result<(), NotStored> {
        let _ = strokes;
        Err(NotStored)
    }
    /// Keeps that this many points within strokes of the job have been passed. The call may block
    /// for a few milliseconds, so it is only made while the machine is at rest and no step waits.
    ///
    /// # Errors
    /// [`NotStored`] if the flash does not take it.
    fn note_point(&mut self, points: u32) -> Result<(), NotStored> {
        let _ = points;
        Err(NotStored)
    }
    /// Copies the notes of the job that was saved last to the front of `notes`, and goes on to keep
    /// how far that job comes. Returns the length of the notes and how many strokes are drawn and
    /// points within strokes are passed; `None` if no drawing of that job has begun.
    fn progress(&mut self, notes: &mut [u8]) -> Option<(usize, LogProgress)> {
        let _ = notes;
        None
    }
    /// Begins to execute the step events of the queue, as [`Board::wait`] does, and does not sleep.
    /// Called while the main loop computes.
    #[cfg(feature = "tiles")]
    fn start_steps(&mut self) {}
    /// The flash for a model that is too large for the memory, and what writes to it; `None` if the
    /// board has none.
    #[cfg(feature = "tiles")]
    fn model_flash(&mut self) -> Option<(Area<'static>, &mut dyn AreaFlash)> {
        None
    }
    /// The flash for a model, as the flash itself returns it now. From a cache, garbage that it
    /// returned while the voltage rose would be read again and again.
    #[cfg(feature = "tiles")]
    fn uncached_model(&mut self) -> Option<Area<'static>> {
        self.model_flash().map(|(area, _)| area)
    }
    /// Inverts the step pins of the motors in the mask, and the enable pin if `enable`, as `$2` and
    /// `$4` ask. Called at the start and when these settings change, while nothing moves.
    #[cfg(feature = "driver-pins")]
    fn invert_driver_pins(&mut self, steps: u8, enable: bool);
    /// A clock in microseconds; the count wraps. It tells how long the plotter has been idle, so it
    /// must run while [`Board::wait_briefly`] waits.
    fn microseconds(&mut self) -> u32;
    /// How many more bytes a port can receive before any is read, for status reports.
    fn receive_room(&mut self) -> usize {
        255
    }
    /// Waits like [`Board::wait`], but for some milliseconds at most.
    fn wait_briefly(&mut self) {
        self.wait();
    }
    /// Sleeps until an interrupt. Returns at once if an interrupt came since the last return.
    fn wait(&mut self);
}

/// The upper limit, in bytes, of one row of a list, and of the whole reply to a line that is not a
/// list.
pub const REPLY_BYTES: usize = 512;

/// The serial ports to which replies go, by their numbers, as [`Board::read_byte`] numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Replies {
    /// All ports that have sent something since the start.
    #[default]
    All,
    /// This port alone.
    Only(usize),
    /// All but this port.
    Others(usize),
    /// All but this port, but to this port if no other one has sent anything.
    OthersIfAny(usize),
}

/// The records that a board with flash keeps through a loss of power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record {
    /// The settings of the machine, which `$N=VALUE` changes.
    Settings,
    /// The coordinate systems, startup lines and texts.
    Parameters,
    /// The strokes of the last job in drawing order, and the steps per millimetre in which they are
    /// measured. The model and the options are not kept.
    Job,
}

/// The error that the board could not keep a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotStored;

/// A kept state of a [`Record`], which is read from its beginning to its end.
pub trait Stored {
    /// Copies the next bytes to the front of `into`, as many as are left and fit. Returns their
    /// number.
    fn read(&mut self, into: &mut [u8]) -> usize;
}

impl<F: embedded_storage::nor_flash::ReadNorFlash> Stored for crate::storage::Reader<'_, F> {
    fn read(&mut self, into: &mut [u8]) -> usize {
        Self::read(self, into)
    }
}
