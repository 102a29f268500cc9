//! Speed profile with look-ahead; step events for the interrupt.
//!
//! (skeleton: the motion work fills this in)

/// The unit of time of every step event: 40 ns. A divisor of both boards' clocks.
pub const TICKS_PER_SECOND: u32 = 25_000_000;

/// What the step interrupt is told: pin levels, and how long until the next event. One word.
///
/// Bits 0 to 7 what happens, bits 8 to 31 ticks from the start of this event to the start of the
/// next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct StepEvent(u32);

/// Where planned events go: the interrupt's queue on a board, a recorder in tests.
pub trait EventQueue {
    /// How many more events fit.
    fn room(&self) -> usize;
    /// Appends one.
    ///
    /// # Errors
    /// Hands the event back if the queue is full.
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent>;
}

impl StepEvent {
    /// From its word.
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Its word.
    pub const fn bits(self) -> u32 {
        self.0
    }
}
