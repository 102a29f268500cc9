//! Owns the memory and joins the rest.

use crate::drawing::PagePoint;
use crate::motion::{EventQueue, StepEvent};

/// What came over the line and must not wait for the bytes before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Realtime {
    /// `?`: report the status.
    pub status: bool,
    /// `!`: hold.
    pub hold: bool,
    /// `~`: resume.
    pub resume: bool,
    /// ctrl-X: abort. The bytes received before it are dropped.
    pub abort: bool,
    /// Bytes were lost because the sender did not wait for replies.
    pub overrun: bool,
}

/// What the plotter needs of a board.
pub trait Board {
    /// The next ordinary byte of the line; none while an abort waits in [`Board::take_realtime`].
    fn read_byte(&mut self) -> Option<u8>;
    /// What was asked in real time since last taken.
    fn take_realtime(&mut self) -> Realtime;
    /// Sends bytes; may block.
    fn write(&mut self, bytes: &[u8]);
    /// Where step events go. They begin when the queue is half full, or at [`Board::wait`].
    fn queue(&mut self) -> &mut dyn EventQueue;
    /// Ends all steps at once; waiting events are dropped.
    fn stop_steps(&mut self);
    /// No step event waits, and the last is over.
    fn steps_idle(&mut self) -> bool;
    /// The steps executed, counted where the pins are written.
    fn pin_position(&mut self) -> PagePoint;
    /// Turns the motors' current on or off.
    fn set_drivers_enabled(&mut self, on: bool);
    /// Sleeps until an interrupt; returns at once if one came since it last returned.
    fn wait(&mut self);
}

/// Stand-in: greets, answers `?`, and steps a square for each line `square`.
pub fn run(board: &mut impl Board) -> ! {
    board.write(b"\r\nPenup 0.1 ['$' for help]\r\n");
    let mut line = heapless::Vec::<u8, 80>::new();
    loop {
        let realtime = board.take_realtime();
        if realtime.abort {
            board.stop_steps();
            line.clear();
            board.write(b"\r\nPenup 0.1 ['$' for help]\r\n");
        }
        if realtime.status {
            let idle = board.steps_idle();
            board.write(if idle { b"<Idle>\r\n" } else { b"<Run>\r\n" });
        }
        match board.read_byte() {
            Some(b'\r') => {}
            Some(b'\n') => {
                match &line[..] {
                    b"square" => square(board),
                    b"panic" => assert!(line.is_empty(), "as asked"),
                    _ => {}
                }
                board.write(b"ok\r\n");
                line.clear();
            }
            Some(byte) => drop(line.push(byte)),
            None => board.wait(),
        }
    }
}

/// A square of 100 steps, a step each millisecond, in 25 MHz ticks.
fn square(board: &mut impl Board) {
    board.set_drivers_enabled(true);
    for side in [0x21, 0x24, 0x23, 0x2C] {
        for _ in 0..100 {
            for (levels, ticks) in [(side, 250), (side & !5, 24_750)] {
                let event = StepEvent::from_bits(levels | ticks << 8);
                while board.queue().push(event).is_err() {
                    board.wait();
                }
            }
        }
    }
    let _ = board.queue().push(StepEvent::from_bits(25_000 << 8));
}
