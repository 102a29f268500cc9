//! The main loop's end of the queue of step events: it puts events in, and counts those that the
//! interrupt has taken.

use super::{EventRing, PinOrder, PulserState};
use crate::motion::{EventKind, EventQueue, Runner, StepEvent, StepLength};
use core::sync::atomic::Ordering;

/// The main loop's end of the queue: it puts step events in and counts those that the interrupt
/// took.
#[derive(Debug)]
pub struct StepQueue<'q, const N: usize> {
    /// The queue itself, in which words wait for the interrupt.
    ring: &'q EventRing<N>,
    /// The numbers and requests that the main loop shares with the step interrupt.
    state: &'q PulserState,
    /// The order of the axes' pins in the words of the ring.
    order: &'static PinOrder,
    /// The length of the steps that were put in last, in units of the brake's rule.
    step_length: StepLength,
    /// The slot after the word up to which the taken events have been counted.
    counted: u32,
    /// Whether the machine is in motion after the event that was counted last.
    moving: bool,
}

impl<'q, const N: usize> StepQueue<'q, N> {
    /// Slots that are reserved for words that only carry information about some of the step events.
    const RESERVED: usize = Runner::ROOM;
    /// The number of events that fit into the queue at once.
    pub(super) const EVENTS: usize = N - 1 - Self::RESERVED;

    /// The queue of events in `ring`, for a board whose pins have this `order`.
    pub(super) fn new(
        ring: &'q EventRing<N>,
        state: &'q PulserState,
        order: &'static PinOrder,
    ) -> Self {
        let counted = ring.taken_slot();
        Self { ring, state, order, step_length: StepLength::new(), counted, moving: false }
    }

    /// Whether no event waits for the interrupt.
    pub fn is_empty(&self) -> bool {
        self.ring.is_empty()
    }

    /// Whether at least half of the slots are taken, so that the steps may begin.
    pub fn is_half_full(&self) -> bool {
        self.ring.waiting() as usize >= N / 2
    }

    /// Whether the last event is over, so that [`Pulser::begin`](super::Pulser::begin) must be
    /// called for the next one.
    pub fn is_stopped(&self) -> bool {
        !self.ring.is_running()
    }

    /// The number of words that were taken since [`StepQueue::sync_consumed`] was last called.
    pub fn taken(&self) -> usize {
        self.ring.taken_behind(self.counted) as usize
    }

    /// Counts the events that the interrupt has taken since the last call, which frees their slots,
    /// and updates the shared state. After [`PulserState::halt`] it discards the queue.
    pub fn sync_consumed(&mut self) {
        let stopped = !self.ring.is_running();
        let down = self.state.inverted() << 2;
        let (mut steps, mut backlash, mut ticks) = (0u32, 0u32, 0u32);
        let moving = &mut self.moving;
        self.ring.count(&mut self.counted, |word| {
            let (event, flags) = (StepEvent::from_bits(word), word as u8);
            if event.is_told() {
                return;
            }
            ticks = ticks.wrapping_add(word >> 8);
            *moving = flags & (StepEvent::AT_REST | StepEvent::PEN) == 0;
            match event.kind() {
                EventKind::Levels(_) => {}
                EventKind::Lift { step: true, down } => return self.state.count_z_step(down),
                EventKind::Lift { .. } | EventKind::Pen { .. } => return,
            }
            let levels = self.order.levels[usize::from(flags & LEVELS)] ^ down;
            let step = PACKED_STEPS[usize::from(levels & STEPS)];
            let sum = if flags & StepEvent::AT_REST == 0 { &mut steps } else { &mut backlash };
            *sum = sum.wrapping_add(step);
        });
        self.state.count(steps, backlash, ticks);
        if stopped && core::mem::take(&mut self.moving) && !self.state.is_halted() {
            self.state.note_underrun();
        }
        if stopped && self.state.is_halted() {
            self.ring.clear();
            self.state.brake.forget();
            self.step_length = StepLength::new();
        }
        let is_drained = stopped && !self.state.halt_is_due();
        self.state.drained.store(is_drained, Ordering::Release);
    }
}

impl<const N: usize> EventQueue for StepQueue<'_, N> {
    fn room(&self) -> usize {
        self.ring.room(self.counted).saturating_sub(Self::RESERVED)
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        let is_no_step =
            event.takes_up_backlash() || matches!(event.kind(), EventKind::Lift { step: true, .. });
        if self.ring.room(self.counted) <= usize::from(is_no_step) {
            return Err(event);
        }
        self.state.drained.store(false, Ordering::Relaxed);
        if is_no_step {
            self.ring.put(StepEvent::skip_next().to_bits());
        }
        let mut word = event.to_bits();
        let flags = word as u8;
        if matches!(event.kind(), EventKind::Levels(_)) {
            let levels = (flags ^ self.state.inverted() << 2) & LEVELS;
            let pins = self.order.pins[usize::from(levels)];
            word = word & !u32::from(LEVELS) | u32::from(pins);
        }
        self.ring.put(word);
        if event.is_step() {
            self.state.brake.add(self.step_length.step().around);
        }
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        if units != self.step_length.last() {
            let start = self.step_length.start(after_next);
            let word = StepEvent::step_length(units, start);
            if self.ring.room(self.counted) == 0 {
                return Err(word);
            }
            self.ring.put(word.to_bits());
            self.step_length.set_from(units, start);
        }
        Ok(())
    }
}

/// The bits of an event that are levels of the axes' pins.
const LEVELS: u8 = (1 << 5) - 1;

/// The bits of the levels that are pulses and directions.
const STEPS: u8 = StepEvent::STEP_X | StepEvent::STEP_Y | StepEvent::DOWN_X | StepEvent::DOWN_Y;

/// The steps for each combination of these bits: those of x are added in the lower half of a word,
/// those of y in the upper half.
const PACKED_STEPS: [u32; 16] = {
    let mut table = [0; 16];
    let mut levels = 0;
    while levels < 16u8 {
        let (dx, dy) = StepEvent::levels(levels, 0).step();
        table[levels as usize] = (dx as u32).wrapping_add((dy as u32) << 16);
        levels += 1;
    }
    table
};
