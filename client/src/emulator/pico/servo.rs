//! Finds the state of the pen in the pulses of its servo.

use super::BOARD;
use super::record::{CYCLE_NANOS, Record, at};
use crate::emulator::{Pin, PinChange};

/// Derives from the width of the servo's pulses whether the pen is down.
#[derive(Default)]
pub(super) struct Servo {
    rose_at: u64,
    down: bool,
}

impl Servo {
    /// The length in cycles of the pulse at half of the pen's height, about 1.5 ms.
    const HALF: u64 = 1_508_000 / CYCLE_NANOS;

    /// Translates a new level of a pin. The state of the pen changes at the end of a pulse.
    pub(super) fn pin_change(&mut self, record: &Record) -> Option<PinChange> {
        let (number, high) = (record.value & 0x7F, record.value >= 0x80);
        let at = at(record.cycle);
        match Pin::numbered(number, &BOARD.pins)? {
            Pin::Pen if high => {
                self.rose_at = record.cycle;
                None
            }
            Pin::Pen => {
                let down = record.cycle - self.rose_at >= Self::HALF;
                let changed = std::mem::replace(&mut self.down, down) != down;
                changed.then_some(PinChange { pin: Pin::Pen, high: down, at })
            }
            pin => Some(PinChange { pin, high, at }),
        }
    }
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
        let mut servo = Servo::default();
        let mut events = Vec::new();
        for (start, width) in [(0, 1000), (20_000, 2000), (40_000, 1512), (60_000, 1504)] {
            for record in [record(7, true, start), record(7, false, start + width)] {
                events.extend(servo.pin_change(&record));
            }
        }
        let pen = |high, at| PinChange { pin: Pin::Pen, high, at: Duration::from_micros(at) };
        assert_eq!(events, [pen(true, 22_000), pen(false, 61_504)]);
    }

    #[test]
    fn other_pins_are_what_they_are() {
        let change = Servo::default().pin_change(&record(5, true, 8));
        let up = PinChange { pin: Pin::DirY, high: true, at: Duration::from_micros(8) };
        assert_eq!(change, Some(up));
        assert_eq!(Servo::default().pin_change(&record(0, true, 8)), None);
    }
}
