//! The messages between this program and the emulator of the Pico. The script `pico.mjs` describes
//! them.

use super::BOARD;
use std::time::Duration;

/// The length of a core cycle in nanoseconds.
pub(super) const CYCLE_NANOS: u64 = 1_000_000_000 / BOARD.clock_hertz as u64;
/// A message from or to the emulator. The meaning of `value` and `cycle` depends on `what`.
pub(super) struct Record {
    pub(super) what: u8,
    pub(super) value: u8,
    pub(super) cycle: u64,
}

pub(super) const RECORD_BYTES: usize = 8;
pub(super) const SERIAL: u8 = 0;
pub(super) const PIN: u8 = 1;
pub(super) const LOG: u8 = 3;
pub(super) const CUT_POWER: u8 = 2;
pub(super) const CUT_FLASH: u8 = 3;
pub(super) const HANG: u8 = 4;
pub(super) const USB: u8 = 5;
pub(super) const USB_HOST: u8 = 6;
pub(super) const SWITCH: u8 = 7;
pub(super) const TIMED: u8 = 8;
pub(super) const RETURNED: u8 = 6;
pub(super) const STACK: u8 = 9;
pub(super) const UNUSED_STACK: u8 = 7;
pub(super) const STALL: u8 = 10;
pub(super) const PAGE_TIME: u8 = 11;
pub(super) const ERASE_TIME: u8 = 12;
pub(super) const GARBLE: u8 = 13;
pub(super) const GARBLED: u8 = 34;
pub(super) const ANSWERED: u8 = 35;
pub(super) const READS: u8 = 14;
pub(super) const WERE_READ: u8 = 36;
pub(super) const RECORD_FLASH: u8 = 15;
pub(super) const BOOT_WITHIN: u8 = 16;
pub(super) const BOOT_SCATTERED: u8 = 17;
pub(super) const OPERATION_BEGAN: u8 = 37;
pub(super) const OPERATION_CHANGES: u8 = 38;
pub(super) const OPERATIONS: u8 = 39;
pub(super) const ASK_IN_CHANGES: u8 = 18;
pub(super) const DELAY_ALARM: u8 = 48;
pub(super) const TIME_INTERRUPTS: u8 = 49;
pub(super) const HANDLER_TOOK: u8 = 40;
pub(super) const MASK_TOOK: u8 = 41;
pub(super) const INTERRUPTS_END: u8 = 42;
pub(super) const TIME_GAPS: u8 = 50;
pub(super) const GAP: u8 = 43;
pub(super) const RESET: u8 = 4;
pub(super) const RUN_PIN: u8 = 32;
pub(super) const UF2: u8 = 33;
pub(super) const STAYS_LOW: u8 = 34;
pub(super) const STAYS_HIGH: u8 = 35;
pub(super) const JUMP: u8 = 36;
pub(super) const USB_LINE: u8 = 37;
pub(super) const USB_RESETS: u8 = 38;
pub(super) const BOOTSEL: u8 = 32;
pub(super) const USB_SERIAL: u8 = 33;
/// The emulator's number for the starting position of an axis.
pub(super) const SWITCH_ZERO: i64 = 1 << 40;

impl Record {
    pub(super) fn from_bytes([what, value, cycle @ ..]: [u8; RECORD_BYTES]) -> Self {
        let [a, b, c, d, e, f] = cycle;
        Self { what, value, cycle: u64::from_le_bytes([a, b, c, d, e, f, 0, 0]) }
    }

    pub(super) fn to_bytes(&self) -> [u8; RECORD_BYTES] {
        let [a, b, c, d, e, f, ..] = self.cycle.to_le_bytes();
        [self.what, self.value, a, b, c, d, e, f]
    }
}

/// The time of a core cycle.
pub(super) fn at(cycle: u64) -> Duration {
    Duration::from_nanos(cycle * CYCLE_NANOS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_eight_bytes() {
        let bytes = [1, 0x83, 6, 5, 4, 3, 2, 1];
        let record = Record::from_bytes(bytes);
        assert_eq!((record.what, record.value, record.cycle), (1, 0x83, 0x0102_0304_0506));
        assert_eq!(record.to_bytes(), bytes);
    }
}
