//! Tests of the records in flash when the power fails between any two bytes.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use penup::boards::host::{CutFlash, PowerCut};
use penup::storage::{Log, LogProgress, NOTE_BYTES, Slots, StorageError};
use penup_host_tests::cut_jobs::{empty_flash, switch_on};

/// The slots are not at the beginning of the flash, and each has more than one sector.
const SLOTS: Slots = Slots { start: 4096, bytes: 8192 };
const FLASH_BYTES: usize = 5 * 4096;

/// A state of this length that differs from the others.
fn state(number: u8, length: usize) -> Vec<u8> {
    (0..length).map(|at| (at as u8).wrapping_mul(7) ^ number).collect()
}

fn save(flash: &mut CutFlash, state: &[u8]) -> Result<(), StorageError<PowerCut>> {
    let mut writer = SLOTS.write(flash)?;
    // In pieces that are no pages.
    for piece in state.chunks(100) {
        writer.write(piece)?;
    }
    writer.finish()
}

fn latest(flash: &mut CutFlash) -> Option<Vec<u8>> {
    let mut reader = SLOTS.latest(flash)?;
    let mut state = vec![0; reader.left()];
    let count = reader.read(&mut state);
    assert_eq!((count, reader.left()), (state.len(), 0));
    Some(state)
}

#[test]
fn a_state_is_read_as_it_was_written() {
    let mut flash = CutFlash::new(FLASH_BYTES);
    assert_eq!(latest(&mut flash), None);
    for (number, length) in (0u8..).zip([0, 1, 255, 256, 257, 3840, 3841, 8192 - 256]) {
        let state = state(number, length);
        assert_eq!(save(&mut flash, &state), Ok(()));
        assert_eq!(latest(&mut flash), Some(state));
    }
    // Nothing beyond the slots was touched.
    assert!(flash.bytes[..4096].iter().all(|byte| *byte == 0xFF));
}

#[test]
fn too_long_a_state_leaves_the_one_before() {
    let mut flash = CutFlash::new(FLASH_BYTES);
    let before = state(1, 500);
    save(&mut flash, &before).expect("it fits");
    let refused = save(&mut flash, &state(2, 8192 - 255));
    assert_eq!(refused, Err(StorageError::TooLong));
    assert_eq!(latest(&mut flash), Some(before));
}

#[test]
fn after_a_cut_between_any_two_bytes_it_is_the_old_state_or_the_new_one() {
    // The first save ever; one over an older; and one whose slot held a longer state.
    let histories: [&[usize]; 3] = [&[], &[40], &[700, 5000, 300]];
    for history in histories {
        let mut before = CutFlash::new(FLASH_BYTES);
        for (number, length) in (10u8..).zip(history) {
            save(&mut before, &state(number, *length)).expect("it fits");
        }
        let old = latest(&mut before);
        let new = state(99, 600);
        for budget in 0.. {
            let mut flash = CutFlash { budget, ..before.clone() };
            let outcome = save(&mut flash, &new);
            let mut flash = flash.powered();
            let found = latest(&mut flash);
            if outcome.is_ok() {
                assert_eq!(found.as_ref(), Some(&new));
                break;
            }
            assert!(found == old || found.as_ref() == Some(&new), "cut after {budget} bytes");
            // It goes on as if nothing had been.
            let next = state(7, 300);
            save(&mut flash, &next).expect("it fits");
            assert_eq!(latest(&mut flash), Some(next), "after a cut after {budget} bytes");
        }
    }
}

/// Behind the slots, with more than one sector.
const LOG: Log = Log { start: 5 * 4096, bytes: 2 * 4096 };

/// Reads the notes and the bits of the log of the state with this checksum.
fn log_of(flash: &mut CutFlash, of: u32) -> Option<(Vec<u8>, u32)> {
    let mut notes = [0; NOTE_BYTES];
    let (length, LogProgress { parts, .. }) = LOG.read(flash, of, &mut notes)?;
    Some((notes[..length].to_vec(), parts))
}

#[test]
fn a_log_is_read_as_it_was_written() {
    let mut flash = CutFlash::new(7 * 4096);
    assert_eq!(log_of(&mut flash, 7), None);
    for notes in [&b""[..], b"notes", &[9; NOTE_BYTES]] {
        LOG.begin(&mut flash, 7, notes).expect("it fits");
        let mut count = 0;
        // One by one, across a page, and to the end.
        for next in [1, 2, 3, 2047, 2048, 2049, 6000, LOG.limit() - 1, LOG.limit()] {
            LOG.note(&mut flash, count, next).expect("it is taken");
            count = next;
            assert_eq!(log_of(&mut flash, 7), Some((notes.to_vec(), count)));
        }
        LOG.note(&mut flash, count, count + 5).expect("what is beyond is left out");
        assert_eq!(log_of(&mut flash, 7), Some((notes.to_vec(), count)));
        assert_eq!(log_of(&mut flash, 8), None, "it belongs to another state");
    }
    let too_long = LOG.begin(&mut flash, 7, &[0; NOTE_BYTES + 1]);
    assert_eq!(too_long, Err(StorageError::TooLong));
    assert_eq!(log_of(&mut flash, 7).map(|(_, count)| count), Some(LOG.limit()));
}

/// Parts and points are counted from the two ends, and neither count reaches the bits of the other.
#[test]
fn points_are_counted_beside_the_parts() {
    let mut flash = CutFlash::new(7 * 4096);
    LOG.begin(&mut flash, 7, b"notes").expect("it fits");
    let read = |flash: &mut CutFlash| LOG.read(flash, 7, &mut [0; NOTE_BYTES]).expect("the log").1;
    let (most, limit) = (LOG.limit(), LOG.points_limit());
    assert_eq!(most + limit, (2 * 4096 - 256) * 8);
    let mut noted = LogProgress::default();
    for (parts, points) in [(0, 1), (5, 9), (5, 2048), (2050, 2049), (most, 3000), (most, limit)] {
        LOG.note(&mut flash, noted.parts, parts).expect("it is taken");
        LOG.note_points(&mut flash, noted.points, points).expect("it is taken");
        noted = LogProgress { parts, points, is_closed: parts == most };
        assert_eq!(read(&mut flash), noted);
    }
    LOG.note(&mut flash, most, most + 9).expect("what is beyond is left out");
    LOG.note_points(&mut flash, limit, limit + 9).expect("what is beyond is left out");
}

#[test]
fn after_a_cut_between_any_two_bytes_a_log_is_the_old_one_or_the_new_one_or_none() {
    let mut before = CutFlash::new(7 * 4096);
    LOG.begin(&mut before, 1, b"old").expect("it fits");
    LOG.note(&mut before, 0, 3000).expect("it is taken");
    let mut is_new = false;
    for budget in 0.. {
        let mut flash = CutFlash { budget, ..before.clone() };
        let outcome = LOG.begin(&mut flash, 2, b"newer");
        let mut flash = flash.powered();
        let (old, new) = (log_of(&mut flash, 1), log_of(&mut flash, 2));
        assert!(old.is_none_or(|old| budget == 0 && old == (b"old".to_vec(), 3000)), "{budget}");
        assert!(new.as_ref().is_none_or(|new| *new == (b"newer".to_vec(), 0)), "{budget}");
        assert!(outcome.is_err() || new.is_some(), "{budget}");
        is_new |= new.is_some();
        if outcome.is_ok() {
            break;
        }
    }
    assert!(is_new);
    // Bits that are cleared, within a page and across its border.
    LOG.begin(&mut before, 1, b"old").expect("it fits");
    LOG.note(&mut before, 0, 2040).expect("it is taken");
    for to in [2041, 2048, 2060] {
        for budget in 0.. {
            let mut flash = CutFlash { budget, ..before.clone() };
            let outcome = LOG.note(&mut flash, 2040, to);
            let (notes, count) = log_of(&mut flash.powered(), 1).expect("the log");
            assert_eq!(notes, b"old");
            assert!((2040..=to).contains(&count), "{budget}: {count}");
            if outcome.is_ok() {
                assert_eq!(count, to);
                break;
            }
        }
    }
}

#[test]
fn a_flipped_bit_makes_a_state_invalid() {
    let mut flash = CutFlash::new(FLASH_BYTES);
    let (old, new) = (state(1, 50), state(2, 50));
    save(&mut flash, &old).expect("it fits");
    save(&mut flash, &new).expect("it fits");
    let second = 4096 + 8192;
    for bit in (0..16 * 8).chain(256 * 8..306 * 8) {
        let mut worn = flash.clone();
        worn.bytes[second + bit / 8] ^= 1 << (bit % 8);
        assert_eq!(latest(&mut worn).as_ref(), Some(&old), "bit {bit}");
    }
}

/// A flash with a cell that can no longer be erased, and that verifies what it has written.
struct VerifyError {
    bytes: Vec<u8>,
    /// The offset of the byte, and the bits that stay low.
    worn: (usize, u8),
}

#[derive(Debug, PartialEq)]
struct NotHeld;

impl NorFlashError for NotHeld {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for VerifyError {
    type Error = NotHeld;
}

impl ReadNorFlash for VerifyError {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NotHeld> {
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for VerifyError {
    const WRITE_SIZE: usize = 256;
    const ERASE_SIZE: usize = 4096;

    /// The cell fails between the erasure and the write, which is the worst instant.
    fn erase(&mut self, from: u32, to: u32) -> Result<(), NotHeld> {
        self.bytes[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NotHeld> {
        let slot = &mut self.bytes[offset as usize..][..bytes.len()];
        slot.copy_from_slice(bytes);
        let (worn, low) = self.worn;
        self.bytes[worn] &= !low;
        if self.bytes[offset as usize..][..bytes.len()] == *bytes { Ok(()) } else { Err(NotHeld) }
    }
}

/// The cell is in the header's page, behind the header. The checksum is right, and yet the state
/// does not count as saved, because an error was reported.
#[test]
fn a_state_that_is_said_not_to_be_kept_is_not() {
    let mut flash =
        VerifyError { bytes: vec![0xFF; FLASH_BYTES], worn: (SLOTS.start as usize + 200, 1) };
    let mut writer = SLOTS.write(&mut flash).expect("it is erased");
    writer.write(b"lost").expect("the page of the payload is sound");
    assert_eq!(writer.finish(), Err(StorageError::Flash(NotHeld)));
    assert!(SLOTS.latest(&mut flash).is_none());
}

#[test]
fn settings_that_are_too_fast_are_kept_and_the_user_hears_how_fast_the_machine_is() {
    let held = |rate: u32| {
        format!(
            "[MSG:held to {rate} mm/min, to stop in time: a greater $120 and $121 allow more]\n"
        )
    };
    let (flash, _) = switch_on(empty_flash(), |plotter| {
        assert!(!plotter.heard().contains("MSG"));
        // 13/16 of 1776 steps of 1/80 mm, at 800 and at 400 mm/s².
        assert_eq!(plotter.say("$110=32000"), "ok\n");
        assert_eq!(plotter.say("$111=32000"), "ok\n");
        assert_eq!(plotter.say("$202=20000"), held(10_192) + "ok\n");
        assert_eq!(plotter.say("$120=400"), held(7207) + "ok\n");
        assert_eq!(plotter.say("$121=400"), "ok\n");
        assert_eq!(plotter.say("$220=2"), "ok\n");
    });
    switch_on(flash, |plotter| {
        assert!(plotter.heard().contains(&held(7207)));
        let settings = plotter.say("$$");
        for line in ["$110=32000.000\n", "$120=400.000\n", "$202=20000.000\n"] {
            assert!(settings.contains(line), "{settings}");
        }
        assert_eq!(plotter.say("$202=4000"), "ok\n");
    });
}
