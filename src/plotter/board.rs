//! What the plotter needs of a board.

use crate::machine::Contacts;
use crate::motion::EventQueue;
use crate::protocol::RealTime;

/// A board: a serial line, and the interrupt that turns step events into pin levels.
pub trait Board {
    /// Its name, as `$I` tells it.
    const NAME: &'static str;

    /// Whether it can become a drive that takes a new image.
    const HAS_DRIVE: bool = false;

    /// The next ordinary byte, and the number of the serial port that received it, from 0; none
    /// while an abort waits in [`Board::take_real_time`]. Where bytes were lost or damaged, it is
    /// [`DAMAGED`](crate::protocol::DAMAGED). A port's bytes are those of its lines, whatever
    /// comes by others meanwhile.
    fn read_byte(&mut self) -> Option<(usize, u8)>;
    /// What was asked in real time since last taken.
    fn take_real_time(&mut self) -> RealTime;
    /// Whether so many bytes, [`REPLY_BYTES`] at most, can be sent without blocking. There will be
    /// room in a while, whatever becomes of who listens.
    fn has_room(&mut self, bytes: usize) -> bool {
        let _ = bytes;
        true
    }
    /// Sends bytes; blocks while there is no room.
    fn write(&mut self, bytes: &[u8]);
    /// Whether a program has opened a port since last asked: it is greeted there alone.
    fn take_opened(&mut self) -> bool {
        false
    }
    /// What is written from now on goes to the port opened last alone, or again to all.
    fn speak_aside(&mut self, is_aside: bool) {
        let _ = is_aside;
    }
    /// Whether the host has asked for that drive since last asked, by other means than the command.
    fn wants_drive(&mut self) -> bool {
        false
    }
    /// Becomes that drive, if there is one: pen up, drivers off. What was written is sent before.
    fn show_drive(&mut self) {}
    /// Where step events go. They begin when the queue is half full, or at [`Board::wait`].
    fn queue(&mut self) -> &mut dyn EventQueue;
    /// Which contacts are closed; none where there are none. A change ends [`Board::wait`].
    fn contacts(&mut self) -> Contacts {
        Contacts::default()
    }
    /// Runs the step interrupt as soon as no pulse is high, although its time has not come: the pins
    /// were halted.
    fn step_now(&mut self) {}
    /// What ended the program before, if that was a fault after which the board has started again
    /// by itself.
    fn fault(&self) -> Option<&str> {
        None
    }
    /// Keeps what `parts` hold, one after the other, through a loss of power: as the new state of
    /// `record`, in place of the last one. May block, so only while the machine stands.
    ///
    /// # Errors
    /// The last state is still kept.
    fn save(&mut self, record: Record, parts: &[&[u8]]) -> Result<(), NotStored> {
        let _ = (record, parts);
        Ok(())
    }
    /// Hands the kept state of `record` to `take`, if there is one.
    fn load(&mut self, record: Record, take: &mut dyn FnMut(&mut dyn Stored)) {
        let _ = (record, take);
    }
    /// Sleeps until an interrupt; returns at once if one came since it last returned.
    fn wait(&mut self);
}

/// No row of a list is longer, nor all that is told of one line which is no list.
pub const REPLY_BYTES: usize = 512;

/// What a board with flash keeps through a loss of power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record {
    /// The settings of the machine.
    Settings,
    /// The strokes of the last job in the order in which they are drawn, and the steps per millimetre
    /// that they are counted in. Neither the model nor the options are kept.
    Job,
}

/// The board cannot keep something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotStored;

/// A kept state, from its beginning on.
pub trait Stored {
    /// The next bytes, as many as there are and `into` holds; says how many.
    fn read(&mut self, into: &mut [u8]) -> usize;
}

impl<F: embedded_storage::nor_flash::ReadNorFlash> Stored for crate::storage::Reader<'_, F> {
    fn read(&mut self, into: &mut [u8]) -> usize {
        Self::read(self, into)
    }
}
