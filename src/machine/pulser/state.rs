//! What the step interrupt and the main loop share: orders for the interrupt, and counts of what
//! the pins have done.

use crate::array::MapEach;
use crate::motion::BrakeOrders;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

/// What the step interrupt and the main loop share: orders to the interrupt, and counts of what the
/// pins have done. It needs only atomic loads and stores, so a Cortex-M0+ supports it.
///
/// Only the main loop writes the orders, and it also writes the counts of the events that it finds
/// to be taken.
#[derive(Debug, Default)]
pub struct PulserState {
    /// The sum of the steps of x, as a wrapping `i32`.
    x: AtomicU32,
    /// The sum of the steps of y, as a wrapping `i32`.
    y: AtomicU32,
    /// The sum of the steps of x that took up backlash, as a wrapping `i32`.
    backlash_x: AtomicU32,
    /// The sum of the steps of y that took up backlash, as a wrapping `i32`.
    backlash_y: AtomicU32,
    /// The position of the motor of z in steps downward, as a wrapping `i32`.
    z: AtomicU32,
    /// The sum of the ticks of the events taken from the queue; it wraps.
    ticks: AtomicU32,
    /// The number of underruns: the queue ran empty while the machine moved; it wraps.
    underruns: AtomicU32,
    /// Whether the last step event has been carried out and its time is over.
    pub(super) drained: AtomicBool,
    /// Whether the main loop has halted the pulses, and whether the interrupt has done what that
    /// asks of it: [`Halt`] as a number.
    pub(super) halt: AtomicU8,
    /// The width of a step pulse, in ticks.
    pulse_ticks: AtomicU32,
    /// The mask of inverted direction pins: bit 0 for x, bit 1 for y.
    inverted: AtomicU8,
    /// Whether the direction pin of z is inverted.
    z_inverted: AtomicBool,
    /// The height of the raised pen.
    up_height: AtomicU8,
    /// How many steps can be counted on to wait on a long path.
    queue_steps: AtomicU32,
    /// How the interrupt brakes when its queue runs empty.
    pub(super) brake: BrakeOrders,
}

/// How far a halt of the pulses has come. The main loop requests it, and the interrupt does it.
#[derive(Debug, Clone, Copy)]
#[repr(u8)]
pub(super) enum Halt {
    /// The interrupt may pulse the pins.
    None,
    /// The main loop has halted the pulses. The interrupt still has to raise the pen.
    Requested,
    /// The interrupt has raised the pen and stopped.
    Done,
}

impl PulserState {
    /// Makes the state in which nothing has been counted and nothing is ordered.
    pub const fn new() -> Self {
        Self {
            x: AtomicU32::new(0),
            y: AtomicU32::new(0),
            backlash_x: AtomicU32::new(0),
            backlash_y: AtomicU32::new(0),
            z: AtomicU32::new(0),
            ticks: AtomicU32::new(0),
            underruns: AtomicU32::new(0),
            drained: AtomicBool::new(true),
            halt: AtomicU8::new(Halt::None as u8),
            pulse_ticks: AtomicU32::new(50),
            inverted: AtomicU8::new(0),
            z_inverted: AtomicBool::new(false),
            up_height: AtomicU8::new(0),
            queue_steps: AtomicU32::new(u32::MAX),
            brake: BrakeOrders::new(),
        }
    }

    /// The sum of the steps made at the pins so far, for x and y, as last counted; it wraps.
    pub fn steps(&self) -> (i32, i32) {
        let [x, y] = [&self.x, &self.y].map_each(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The sum of the steps that took up backlash, which [`PulserState::steps`] does not include;
    /// it wraps.
    pub fn backlash(&self) -> (i32, i32) {
        let [x, y] = [&self.backlash_x, &self.backlash_y]
            .map_each(|sum| sum.load(Ordering::Relaxed).cast_signed());
        (x, y)
    }

    /// The position of the motor of z, in steps downward; it wraps.
    pub fn z(&self) -> i32 {
        self.z.load(Ordering::Relaxed).cast_signed()
    }

    /// Counts a step of the motor that lifts the pen. The board's code that makes these steps calls
    /// it.
    pub fn count_z_step(&self, down: bool) {
        add(&self.z, if down { 1 } else { u32::MAX });
    }

    /// The sum of the ticks of the events that were taken from the queue; it wraps.
    pub fn ticks(&self) -> u32 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// How often the queue ran empty while the machine moved; the count wraps.
    pub fn underruns(&self) -> u32 {
        self.underruns.load(Ordering::Relaxed)
    }

    /// Whether the last step event has been carried out and its time is over, so that nothing
    /// moves.
    pub fn is_drained(&self) -> bool {
        self.drained.load(Ordering::Acquire)
    }

    /// Stops all pulses from now on. The interrupt raises the pen, and the main loop discards the
    /// queue. Call [`Pulser::tick`](super::Pulser::tick) at once; otherwise the pen stays down
    /// until the current event ends.
    ///
    /// [`PulserState::is_drained`] is false from then on until the pen has been raised.
    pub fn halt(&self) {
        self.drained.store(false, Ordering::Relaxed);
        if !self.is_halted() {
            self.halt.store(Halt::Requested as u8, Ordering::Release);
        }
    }

    /// Whether [`PulserState::halt`] is in force.
    pub fn is_halted(&self) -> bool {
        self.halt.load(Ordering::Acquire) != Halt::None as u8
    }

    /// Whether the interrupt has still to do what [`PulserState::halt`] asks of it.
    pub fn halt_is_due(&self) -> bool {
        self.halt.load(Ordering::Acquire) == Halt::Requested as u8
    }

    /// Allows pulses again. Call it only after [`PulserState::is_drained`] is true.
    pub fn release(&self) {
        self.halt.store(Halt::None as u8, Ordering::Release);
    }

    /// Adds the steps and ticks of the step events that were taken from the queue. Steps are packed
    /// as in the queue's table, with less than 2^15 for each motor.
    pub(super) fn count(&self, steps: u32, backlash: u32, ticks: u32) {
        for (x, y, packed) in
            [(&self.x, &self.y, steps), (&self.backlash_x, &self.backlash_y, backlash)]
        {
            let dx = i32::from(packed as u16 as i16).cast_unsigned();
            add(x, dx);
            add(y, (packed.wrapping_sub(dx).cast_signed() >> 16).cast_unsigned());
        }
        add(&self.ticks, ticks);
    }

    /// Reports what the hardware has done, for a board whose steps are not pulsed by
    /// [`Pulser`](super::Pulser): the sums of the steps and ticks, and whether the queue is
    /// drained.
    pub fn report(&self, (x, y): (i32, i32), ticks: u32, drained: bool) {
        self.x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.y.store(y.cast_unsigned(), Ordering::Relaxed);
        self.ticks.store(ticks, Ordering::Relaxed);
        self.drained.store(drained, Ordering::Release);
    }

    /// Reports the sums of the steps that took up backlash, for a board that calls
    /// [`PulserState::report`].
    pub fn report_backlash(&self, (x, y): (i32, i32)) {
        self.backlash_x.store(x.cast_unsigned(), Ordering::Relaxed);
        self.backlash_y.store(y.cast_unsigned(), Ordering::Relaxed);
    }

    /// Counts that the queue ran empty while the machine moved.
    pub fn note_underrun(&self) {
        let underruns = self.underruns.load(Ordering::Relaxed);
        self.underruns.store(underruns.wrapping_add(1), Ordering::Relaxed);
    }

    /// The width of a step pulse, in ticks.
    pub fn pulse_ticks(&self) -> u32 {
        self.pulse_ticks.load(Ordering::Relaxed)
    }

    /// The mask of inverted direction pins: bit 0 for x, bit 1 for y.
    pub fn inverted(&self) -> u8 {
        self.inverted.load(Ordering::Relaxed)
    }

    /// Whether the direction pin of z is inverted.
    pub fn z_is_inverted(&self) -> bool {
        self.z_inverted.load(Ordering::Relaxed)
    }

    /// The height of the raised pen, to which a halt or a fault sends it. A servo that is mounted
    /// the other way round has it above that of the lowered pen.
    pub fn up_height(&self) -> u8 {
        self.up_height.load(Ordering::Relaxed)
    }

    /// Sets the width of a pulse in ticks, the mask of inverted direction pins (bit 0 for x, bit 1
    /// for y, bit 2 for z), and the height of the raised pen.
    pub(in crate::machine) fn configure(&self, pulse_ticks: u32, inverted: u8, up_height: u8) {
        self.up_height.store(up_height, Ordering::Relaxed);
        self.pulse_ticks.store(pulse_ticks, Ordering::Relaxed);
        self.inverted.store(inverted & 3, Ordering::Relaxed);
        self.z_inverted.store(inverted & 4 != 0, Ordering::Relaxed);
    }

    /// Sets how many steps of the board's queue can be counted on to wait on a long path. Call it
    /// before the machine asks for the number.
    pub fn set_queue(&self, steps: u32) {
        self.queue_steps.store(steps, Ordering::Relaxed);
    }

    /// How many steps can be counted on to wait. Without a board there is no limit.
    pub(in crate::machine) fn queue(&self) -> u32 {
        self.queue_steps.load(Ordering::Relaxed)
    }

    /// How the interrupt brakes when its queue runs empty.
    pub fn brake(&self) -> &BrakeOrders {
        &self.brake
    }
}

/// Adds to a sum. Only its single writer may call this: it is a load and a store, so that a
/// Cortex-M0+ supports it.
#[inline]
fn add(sum: &AtomicU32, more: u32) {
    sum.store(sum.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
}
