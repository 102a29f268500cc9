//! Finds the state of the pen in the pulses of its servo.

use super::BOARD;
use super::record::{CYCLE_NANOS, Record, at};
use crate::emulator::{Pin, PinChange};
use penup::machine::servo;
use penup_job::pins::PenHeights;

/// Derives from the width of the servo's pulses whether the pen is down.
#[derive(Default)]
pub(super) struct Servo {
    rose_at: u64,
    down: bool,
}

impl Servo {
    /// Translates a new level of a pin, with a pen that is raised and lowered to these `heights`.
    /// The state of the pen changes at the end of a pulse.
    pub(super) fn pin_change(&mut self, record: &Record, heights: PenHeights) -> Option<PinChange> {
        let (number, high) = (record.value & 0x7F, record.value >= 0x80);
        let at = at(record.cycle);
        match Pin::numbered(number, &BOARD.pins)? {
            Pin::Pen if high => {
                self.rose_at = record.cycle;
                None
            }
            Pin::Pen => {
                let down = heights.is_down(height(record.cycle - self.rose_at));
                let changed = std::mem::replace(&mut self.down, down) != down;
                changed.then_some(PinChange { pin: Pin::Pen, high: down, at })
            }
            pin => Some(PinChange { pin, high, at }),
        }
    }
}

/// The height of the pen for a pulse of so many cycles.
fn height(cycles: u64) -> u8 {
    let microseconds = (cycles * CYCLE_NANOS + 500) / 1000;
    let is_shorter = |height: &u8| u64::from(servo::pulse_microseconds(*height)) < microseconds;
    (0..127).find(|height| !is_shorter(height)).unwrap_or(127)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::emulator::pico::record::PIN;
    use std::time::Duration;

    fn record(number: u8, high: bool, microsecond: u64) -> Record {
        Record { what: PIN, value: number | u8::from(high) << 7, cycle: microsecond * 125 }
    }

    #[test]
    fn the_pen_is_where_the_servo_was_set() {
        let pen = |high, at| PinChange { pin: Pin::Pen, high, at: Duration::from_micros(at) };
        let events = |heights, pulses: [u64; 4]| {
            let mut servo = Servo::default();
            let mut events = Vec::new();
            for (start, width) in (0..).step_by(20_000).zip(pulses) {
                for record in [record(7, true, start), record(7, false, start + width)] {
                    events.extend(servo.pin_change(&record, heights));
                }
            }
            events
        };
        let usual = PenHeights::default();
        let changes = events(usual, [1000, 2000, 1512, 1504]);
        assert_eq!(changes, [pen(true, 22_000), pen(false, 61_504)]);
        // A servo that is mounted the other way round is not raised when it starts.
        let reversed = PenHeights { up: 100, down: 20 };
        let changes = events(reversed, [1000, 1800, 1160, 1800]);
        let starts = [pen(true, 1000), pen(false, 21_800)];
        assert_eq!(changes, [starts, [pen(true, 41_160), pen(false, 61_800)]].concat());
        let changes = events(PenHeights { up: 10, down: 40 }, [1000, 1080, 1320, 1080]);
        assert_eq!(changes, [pen(true, 41_320), pen(false, 61_080)]);
    }

    #[test]
    fn other_pins_are_what_they_are() {
        let change = |record| Servo::default().pin_change(&record, PenHeights::default());
        let up = PinChange { pin: Pin::DirY, high: true, at: Duration::from_micros(8) };
        assert_eq!(change(record(5, true, 8)), Some(up));
        assert_eq!(change(record(0, true, 8)), None);
    }
}
