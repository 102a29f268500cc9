//! What the plotter needs of a board.

use crate::motion::EventQueue;
use crate::protocol::RealTime;

/// A board: a serial line, and the interrupt that turns step events into pin levels.
pub trait Board {
    /// Its name, as `$I` tells it.
    const NAME: &'static str;

    /// The next ordinary byte of the line; none while an abort waits in [`Board::take_real_time`].
    fn read_byte(&mut self) -> Option<u8>;
    /// What was asked in real time since last taken.
    fn take_real_time(&mut self) -> RealTime;
    /// Sends bytes; may block.
    fn write(&mut self, bytes: &[u8]);
    /// Where step events go. They begin when the queue is half full, or at [`Board::wait`].
    fn queue(&mut self) -> &mut dyn EventQueue;
    /// Sleeps until an interrupt; returns at once if one came since it last returned.
    fn wait(&mut self);
}
