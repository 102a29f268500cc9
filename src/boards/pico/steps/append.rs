//! Appends step events to the ring, as words for the state machine with the lengths of their steps.

use core::sync::atomic::{Ordering, compiler_fence};

use penup::motion::{EventKind, EventQueue, StepDistances, StepEvent, StepTrain};

use super::engine::{LEVELS, PEN_TICKS, PULSE_TICKS, PULSES, TARGETS, WAIT_TICKS, target};
use super::feed::{FEEDING, WRITTEN};
use super::heights::z_axis_levels;
use super::waits::parts;
use super::word_ring::{GROUP, LENGTHS, WORDS, lengths, pack, row, slot, sum};
use super::{BRAKED_TICKS, STATE, Steps};
use crate::boards::pico::words;

impl EventQueue for Steps {
    fn room(&self) -> usize {
        self.room as usize
    }

    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.room = self.room.checked_sub(1).ok_or(event)?;
        let (word, beyond) = match event.kind() {
            EventKind::Pen { height } => {
                self.heights.enqueue(height).map_err(|_| event)?;
                self.moving = false;
                (self.levels | target::MOVE_PEN, PEN_TICKS)
            }
            EventKind::Lift { step, down } => {
                self.moving = true;
                return self.push_z_axis(step, down, event);
            }
            EventKind::Levels(levels) => {
                self.moving = levels & StepEvent::AT_REST == 0;
                let pins = (u32::from(levels) & LEVELS) ^ self.inverted_levels;
                self.levels = pins & !PULSES;
                if event.takes_up_backlash() {
                    return self.push_backlash(pins, event.ticks());
                }
                if pins & PULSES == 0 {
                    (pins | target::WAIT, WAIT_TICKS)
                } else {
                    (pins | target::PULSE, PULSE_TICKS + self.pulse_ticks)
                }
            }
        };
        // Without a braking rule, no lengths are passed on or counted.
        let is_counted = event.is_step() && STATE.brake().is_on();
        let step = if is_counted { self.step_length.step() } else { StepDistances::default() };
        if word & TARGETS == target::PULSE {
            self.put(word, event.ticks().saturating_sub(beyond), step);
        } else {
            self.put_wait(word, beyond, event.ticks());
        }
        if !self.moving && word & TARGETS == target::WAIT {
            self.rest_end = self.written;
        }
        self.publish();
        Ok(())
    }

    fn set_step_length(&mut self, units: u32, after_next: bool) -> Result<(), StepEvent> {
        if units != self.step_length.last() {
            self.step_length.set(units, after_next);
        }
        Ok(())
    }

    /// Appends steps of a train. It takes 17 cycles per step, or more if the step may be braked.
    #[unsafe(link_section = ".data.in_ram")] // In RAM, so that it does not wait for flash.
    fn push_train(&mut self, train: &mut StepTrain, count: u32) -> Result<(), StepEvent> {
        let Some(room) = self.room.checked_sub(count) else {
            return train.push_each(count, |event| self.push(event));
        };
        let beyond = (PULSE_TICKS + self.pulse_ticks) << 8;
        let inverted_levels = self.inverted_levels | target::PULSE;
        train.convert(|event| (event ^ inverted_levels).wrapping_sub(beyond));
        let mut done = 0;
        while done < count {
            let row = row(self.written.wrapping_add(done), count - done);
            words::write_train(train, row);
            done += row.len() as u32;
        }
        let word = slot(self.written.wrapping_add(count - 1)).load(Ordering::Relaxed);
        train.convert(|word| word.wrapping_add(beyond) ^ inverted_levels);
        if STATE.brake().is_on() {
            self.record_lengths(count);
        }
        self.room = room;
        self.written = self.written.wrapping_add(count);
        self.levels = word & LEVELS & !PULSES;
        self.moving = true;
        self.publish();
        Ok(())
    }
}

impl Steps {
    /// Appends a word that takes `beyond` ticks besides its count, followed by waits, so that it
    /// takes `ticks` in all.
    fn put_wait(&mut self, word: u32, beyond: u32, ticks: u32) {
        let step = StepDistances::default();
        let mut parts = parts(ticks, BRAKED_TICKS);
        self.put(word, parts.next().unwrap_or(0).saturating_sub(beyond), step);
        for part in parts {
            self.put(self.levels | target::WAIT, part.saturating_sub(WAIT_TICKS), step);
        }
    }

    /// Appends an event at which the motor that lifts the pen makes a step (if `step`) or changes
    /// its direction. The pulse lasts half of the event, so that the handler is never two levels
    /// behind.
    fn push_z_axis(&mut self, step: bool, down: bool, event: StepEvent) -> Result<(), StepEvent> {
        use z_axis_levels::{DOWN, MARK, STEP};
        let pins = MARK | if down { DOWN } else { 0 };
        let word = self.levels | target::MOVE_PEN;
        let mut ticks = event.ticks();
        if step {
            self.room = self.room.saturating_sub(1);
            self.heights.enqueue(pins | STEP).map_err(|_| event)?;
            let high = (ticks / 2).min(BRAKED_TICKS);
            self.put_wait(word, PEN_TICKS, high);
            ticks -= high;
        }
        self.heights.enqueue(pins).map_err(|_| event)?;
        self.put_wait(word, PEN_TICKS, ticks);
        self.publish();
        Ok(())
    }

    /// Appends a pulse that takes up backlash. For the state machine it is not a pulse, so that it
    /// is counted separately: it is a wait while the pins are high and another while they are low.
    fn push_backlash(&mut self, pins: u32, ticks: u32) -> Result<(), StepEvent> {
        self.room = self.room.saturating_sub(1);
        let low = ticks.saturating_sub(self.pulse_ticks);
        for (levels, ticks) in [(pins, self.pulse_ticks), (self.levels, low)] {
            let count = ticks.saturating_sub(WAIT_TICKS);
            self.put(levels | target::WAIT, count, StepDistances::default());
        }
        self.publish();
        Ok(())
    }

    /// Records the lengths of the next `count` words, which are steps. `count` is less than the
    /// size of the ring.
    #[inline(never)] // As a function of its own it needs only the core's registers.
    #[unsafe(link_section = ".data.in_ram")] // This leaves the flash's cache to the planner.
    fn record_lengths(&mut self, count: u32) {
        if let Some(step) = self.step_length.steady() {
            return self.record_equal_lengths(step, count);
        }
        let mut queued = STATE.brake().queued();
        for number in 0..count {
            let word = self.written.wrapping_add(number);
            let step = self.step_length.step();
            lengths(word).store(pack(step), Ordering::Relaxed);
            queued = queued.wrapping_add(step.around);
            let next = word.wrapping_add(1);
            if next.is_multiple_of(GROUP) {
                sum(next).store(queued, Ordering::Relaxed);
            }
        }
        STATE.brake().set_queued(queued);
    }

    /// Records the lengths of the next `count` words where all steps have the same length, in a few
    /// cycles per step.
    fn record_equal_lengths(&self, step: StepDistances, count: u32) {
        let packed = pack(step);
        let first = (self.written % WORDS) as usize;
        let (around, behind) = LENGTHS.split_at(first);
        let count_around = (count as usize).saturating_sub(behind.len());
        for (part, count) in [(behind, count as usize), (around, count_around)] {
            for slot in part.iter().take(count) {
                slot.store(packed, Ordering::Relaxed);
            }
        }
        let queued = STATE.brake().queued();
        let mut number = GROUP - self.written % GROUP;
        while number <= count {
            let units = queued.wrapping_add(step.around * number);
            sum(self.written.wrapping_add(number)).store(units, Ordering::Relaxed);
            number += GROUP;
        }
        STATE.brake().set_queued(queued.wrapping_add(step.around * count));
    }

    /// Writes one word with its count to the ring, and what its step adds to the path.
    fn put(&mut self, word: u32, count: u32, step: StepDistances) {
        slot(self.written).store(word | count << 8, Ordering::Relaxed);
        lengths(self.written).store(pack(step), Ordering::Relaxed);
        self.written = self.written.wrapping_add(1);
        STATE.brake().add(step.around);
        if self.written.is_multiple_of(GROUP) {
            sum(self.written).store(STATE.brake().queued(), Ordering::Relaxed);
        }
    }

    /// Makes the words visible to the channel, and starts the transfer if there are many.
    fn publish(&mut self) {
        WRITTEN.store(self.written, Ordering::Release);
        // A handler that finds nothing more to transfer must either have seen these words, or its
        // result must be seen here.
        compiler_fence(Ordering::SeqCst);
        if FEEDING.load(Ordering::Relaxed) {
            return;
        }
        // If the state machine is already running, it continues at once.
        if !self.drained || self.written.wrapping_sub(self.taken) >= WORDS / 2 {
            self.start();
        }
    }
}
