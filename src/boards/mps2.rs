//! Arm MPS2+ (AN385) in QEMU: a Cortex-M3 that counts the instructions that it executes.

mod divide;
mod memory;

/// A timer that counts down once every 40 ns. With `-icount shift=0`, QEMU takes 1 ns for an
/// instruction.
const TIMER: *mut u32 = 0x4000_0000 as *mut u32;
/// The instructions that QEMU executes while the timer counts once.
const INSTRUCTIONS_PER_TICK: u64 = 40;

/// Counts the instructions that were executed since it was created.
pub struct Counter {
    /// The value of the timer when it was last read.
    last: u32,
    /// The number of times that the timer has counted down since the start.
    ticks: u64,
}

impl Counter {
    /// Starts the timer and counts from now on.
    pub fn start() -> Self {
        // SAFETY: CMSDK APB timer 0 (Arm DDI 0479): VALUE, RELOAD and CTRL are words at 4, 8 and 0,
        // and nothing else uses it.
        unsafe {
            TIMER.add(1).write_volatile(u32::MAX);
            TIMER.add(2).write_volatile(u32::MAX);
            TIMER.write_volatile(1);
        }
        Self { last: u32::MAX, ticks: 0 }
    }

    /// Returns the number of instructions so far. Call it at least once in 171 s of the timer.
    pub fn read(&mut self) -> u64 {
        // SAFETY: the timer exists on this machine, and VALUE may be read at any time.
        let value = unsafe { TIMER.add(1).read_volatile() };
        self.ticks += u64::from(self.last.wrapping_sub(value));
        self.last = value;
        self.ticks * INSTRUCTIONS_PER_TICK
    }
}
