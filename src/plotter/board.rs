//! What the plotter needs of a board.

use crate::machine::Contacts;
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
    /// Which contacts are closed; none where there are none. A change ends [`Board::wait`].
    fn contacts(&mut self) -> Contacts {
        Contacts::default()
    }
    /// Runs the step interrupt as soon as no pulse is high, although its time has not come: the pins
    /// were halted.
    fn step_now(&mut self) {}
    /// Sleeps until an interrupt; returns at once if one came since it last returned.
    fn wait(&mut self);
}
