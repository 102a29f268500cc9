//! Records in flash that survive a loss of power at any time.
//!
//! A record has two [`Slots`] in flash. A new state is written to the slot that does not hold the
//! latest state: first the payload, then the header, whose checksum over both makes it valid. A
//! reader therefore finds either the old state or the new one, never a mixture, even if the power
//! fails between any two bytes. A state is read whole, by [`Reader`], and written whole, by
//! [`Writer`], in pieces of any size.
//!
//! The flash is any [`NorFlash`]: erasing sets all bits to ones, and writing turns ones into zeros.
//! A state that is longer than a slot is refused.
//!
//! A slot begins with a page for the header. The header consists of four words in little-endian
//! order: a mark, a sequence number, the length of the payload in bytes, and the CRC-32 of these
//! three and the payload.
//!
//! While the voltage falls or rises, flash may return garbage. So whatever is read is read again
//! until it is the same twice.
//!
//! What becomes known of a state only later can be [added](Slots::add) behind it, without erasing
//! anything, if [room was left](Writer::leave_room). It begins with a page of its own, with a
//! header as that of a slot, whose second word is the checksum of the state.
//!
//! How far the work that a state describes has come can be kept beside it, in a [`Log`].

#[cfg(feature = "tiles")]
pub mod area;
mod log;
mod writer;

pub use log::{Log, LogProgress, NOTE_BYTES};
pub use writer::Writer;

use crate::checksum::Crc32;
#[cfg(feature = "early-ink")]
use embedded_storage::nor_flash::MultiwriteNorFlash;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};

/// The unit in which flash is written, in bytes.
pub const PAGE_BYTES: usize = 256;

/// The number at the beginning of a header, by which a slot that was written is known.
const MARK: u32 = u32::from_le_bytes(*b"pen1");
/// The number at the beginning of what was added to a state.
#[cfg(feature = "early-ink")]
const ADDED_MARK: u32 = u32::from_le_bytes(*b"add1");
/// The size of a header in bytes. The rest of its page is empty.
const HEADER_BYTES: usize = 16;

/// The reasons why a new state was not kept. The previous state still is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StorageError<E> {
    /// The state is longer than a slot.
    TooLong,
    /// Something else has been added to the state before.
    #[cfg(feature = "early-ink")]
    Changed,
    /// The flash reported an error.
    Flash(E),
}

impl<E> From<E> for StorageError<E> {
    fn from(error: E) -> Self {
        Self::Flash(error)
    }
}

/// The two slots of a record, one directly after the other in flash.
///
/// ```
/// # use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
/// # struct Flash([u8; 8192]);
/// # impl ErrorType for Flash { type Error = core::convert::Infallible; }
/// # impl ReadNorFlash for Flash {
/// #     const READ_SIZE: usize = 1;
/// #     fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
/// #         let at = at as usize;
/// #         bytes.copy_from_slice(&self.0[at..at + bytes.len()]);
/// #         Ok(())
/// #     }
/// #     fn capacity(&self) -> usize { 8192 }
/// # }
/// # impl NorFlash for Flash {
/// #     const WRITE_SIZE: usize = 256;
/// #     const ERASE_SIZE: usize = 4096;
/// #     fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
/// #         self.0[from as usize..to as usize].fill(0xFF);
/// #         Ok(())
/// #     }
/// #     fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Self::Error> {
/// #         self.0[at as usize..][..bytes.len()].copy_from_slice(bytes);
/// #         Ok(())
/// #     }
/// # }
/// # let mut flash = Flash([0xFF; 8192]);
/// use penup::storage::Slots;
/// let slots = Slots { start: 0, bytes: 4096 };
/// assert!(slots.latest(&mut flash).is_none());
/// let mut writer = slots.write(&mut flash).unwrap();
/// writer.write(b"old or new").unwrap();
/// writer.finish().unwrap();
/// let mut kept = [0; 20];
/// let length = slots.latest(&mut flash).unwrap().read(&mut kept);
/// assert_eq!(&kept[..length], b"old or new");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slots {
    /// Offset of the first slot in bytes: a multiple of the flash's erase size.
    pub start: u32,
    /// Size of each slot in bytes: also a multiple of the erase size.
    pub bytes: u32,
}

/// The header of a slot whose checksum is right, so that the slot holds a whole state.
#[derive(Clone, Copy)]
struct Valid {
    /// Which slot it is: 0 for the first, 1 for the second.
    slot: u32,
    /// The number of the state. Each state that is written has a number one higher than the one
    /// before it, and 0 follows the highest.
    sequence: u32,
    /// The length of the payload in bytes.
    length: u32,
    /// The checksum in the header.
    sum: u32,
}

impl Slots {
    /// Opens the record that was saved last for reading. Records that are damaged or were not
    /// written to their end do not count. `None` if there is no record.
    pub fn latest<F: ReadNorFlash>(self, flash: &mut F) -> Option<Reader<'_, F>> {
        let valid = self.find(flash)?;
        let at = self.begin(valid.slot) + PAGE_BYTES as u32;
        Some(Reader { flash, at, left: valid.length })
    }

    /// Returns which slot holds the latest state, 0 or 1, and the checksum in its header, by which
    /// it is told from other states. `None` if there is no state.
    #[inline(never)] // It is called in several places, and seldom.
    pub fn identify<F: ReadNorFlash>(self, flash: &mut F) -> Option<(usize, u32)> {
        let valid = self.find(flash)?;
        Some((valid.slot as usize, valid.sum))
    }

    /// Begins to write a new state.
    ///
    /// # Errors
    /// The error of the flash; the latest state is unchanged.
    pub fn write<F: NorFlash>(
        self,
        flash: &mut F,
    ) -> Result<Writer<'_, F>, StorageError<F::Error>> {
        self.write_into_erased(flash, 0)
    }

    /// Does the same where this many bytes of the slot that is to be written, whole sectors from
    /// its beginning on, have been erased by [`Slots::erase_ahead`] and not been written since.
    ///
    /// # Errors
    /// As [`Slots::write`].
    pub(crate) fn write_into_erased<F: NorFlash>(
        self,
        flash: &mut F,
        erased: u32,
    ) -> Result<Writer<'_, F>, StorageError<F::Error>> {
        let latest = self.find(flash);
        let slot = latest.map_or(0, |valid| 1 - valid.slot);
        let sequence = latest.map_or(0, |valid| valid.sequence.wrapping_add(1));
        Writer::begin(flash, self, self.begin(slot), sequence, erased)
    }

    /// Erases a sector of the slot that is written next, which begins this many bytes behind the
    /// slot's beginning. Returns which slot that is, 0 or 1.
    ///
    /// # Errors
    /// The error of the flash; the latest state is unchanged.
    #[cfg(feature = "early-ink")]
    pub(crate) fn erase_ahead<F: NorFlash>(
        self,
        flash: &mut F,
        from: u32,
    ) -> Result<usize, F::Error> {
        let slot = self.find(flash).map_or(0, |valid| 1 - valid.slot);
        if from < self.bytes {
            let start = self.begin(slot) + from;
            flash.erase(start, start + F::ERASE_SIZE as u32)?;
        }
        Ok(slot as usize)
    }

    /// Adds the concatenation of `parts` to the latest state, behind which there is
    /// [room](Writer::leave_room). Nothing is erased, and the state itself stays as it is. What was
    /// added before may be added once more, so that a loss of power meanwhile does no harm.
    ///
    /// # Errors
    /// [`StorageError::TooLong`] if there is no state or no room in the slot,
    /// [`StorageError::Changed`], or the error of the flash. Nothing is then added.
    #[cfg(feature = "early-ink")]
    pub fn add<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        parts: &[&[u8]],
    ) -> Result<(), StorageError<F::Error>> {
        let valid = self.find(flash).ok_or(StorageError::TooLong)?;
        let length: usize = parts.iter().map(|part| part.len()).sum();
        let length = u32::try_from(length).map_err(|_| StorageError::TooLong)?;
        let start = self.begin_of_added(valid);
        let end = u64::from(start) + PAGE_BYTES as u64 + u64::from(length);
        if end > u64::from(self.begin(valid.slot) + self.bytes) {
            return Err(StorageError::TooLong);
        }
        let mut digest = Crc32::new();
        let mut page = [0xFF; PAGE_BYTES];
        let (mut at, mut filled) = (start, 0);
        for &byte in parts.iter().copied().flatten() {
            if let Some(slot) = page.get_mut(filled) {
                *slot = byte;
            }
            filled += 1;
            digest.update(&[byte]);
            if filled == PAGE_BYTES {
                at += PAGE_BYTES as u32;
                complete(flash, at, page)?;
                page.fill(0xFF);
                filled = 0;
            }
        }
        if filled > 0 {
            complete(flash, at + PAGE_BYTES as u32, page)?;
        }
        let sum = total_of(ADDED_MARK, digest, valid.sum, length);
        page.fill(0xFF);
        put_words(&mut page, [ADDED_MARK, valid.sum, length, sum]);
        complete(flash, start, page)?;
        // Where something else was written before, this is not what was to be added.
        self.added(flash).map(drop).ok_or(StorageError::Changed)
    }

    /// Opens for reading what was added to the latest state; `None` if nothing was, or not all.
    #[cfg(feature = "early-ink")]
    pub fn added<F: ReadNorFlash>(self, flash: &mut F) -> Option<Reader<'_, F>> {
        let valid = self.find(flash)?;
        let start = self.begin_of_added(valid);
        let mut header = [0; HEADER_BYTES];
        read_surely(flash, start, &mut header).ok()?;
        let [mark, of, length, sum] = words(header);
        let room = (self.begin(valid.slot) + self.bytes).checked_sub(start + PAGE_BYTES as u32)?;
        if mark != ADDED_MARK || of != valid.sum || length > room {
            return None;
        }
        let at = start + PAGE_BYTES as u32;
        let digest = Reader { flash: &mut *flash, at, left: length }.digest()?;
        (sum == total_of(ADDED_MARK, digest, of, length)).then_some(Reader {
            flash,
            at,
            left: length,
        })
    }

    /// Returns the offset in flash of what is added to a state: the first page behind it.
    #[cfg(feature = "early-ink")]
    fn begin_of_added(self, valid: Valid) -> u32 {
        let pages = 1 + valid.length.div_ceil(PAGE_BYTES as u32);
        self.begin(valid.slot) + pages * PAGE_BYTES as u32
    }

    /// The offset in flash at which the second slot ends, in bytes.
    pub const fn end(self) -> u32 {
        self.start + 2 * self.bytes
    }

    /// Returns the offset in flash at which a slot begins, in bytes.
    fn begin(self, slot: u32) -> u32 {
        self.start + slot * self.bytes
    }

    /// Returns the header of the latest state, or `None` if neither slot holds a whole state.
    fn find<F: ReadNorFlash>(self, flash: &mut F) -> Option<Valid> {
        let [first, second] = [0, 1].map(|slot| self.check(flash, slot));
        match (first, second) {
            (Some(first), Some(second)) => {
                let newer = second.sequence.wrapping_sub(first.sequence).cast_signed() > 0;
                Some(if newer { second } else { first })
            }
            (first, second) => first.or(second),
        }
    }

    /// Returns the header of a slot, or `None` if its checksum does not match that of its payload.
    fn check<F: ReadNorFlash>(self, flash: &mut F, slot: u32) -> Option<Valid> {
        let mut header = [0; HEADER_BYTES];
        read_surely(flash, self.begin(slot), &mut header).ok()?;
        let [mark, sequence, length, sum] = words(header);
        if mark != MARK || length > self.bytes - PAGE_BYTES as u32 {
            return None;
        }
        let at = self.begin(slot) + PAGE_BYTES as u32;
        let digest = Reader { flash, at, left: length }.digest()?;
        (sum == total(digest, sequence, length)).then_some(Valid { slot, sequence, length, sum })
    }
}

/// How often a piece of flash is read before its last reading counts, although it was never the
/// same twice.
const READINGS: usize = 8;

/// Reads flash until it has returned the same twice in a row, which garbage does not.
///
/// # Errors
/// The error of the flash.
fn read_surely<F: ReadNorFlash>(flash: &mut F, at: u32, into: &mut [u8]) -> Result<(), F::Error> {
    let mut again = [0; 64];
    for (from, piece) in (at..).step_by(again.len()).zip(into.chunks_mut(again.len())) {
        let (again, _) = again.split_at_mut(piece.len());
        flash.read(from, piece)?;
        for _ in 1..READINGS {
            flash.read(from, again)?;
            if piece == again {
                break;
            }
            piece.copy_from_slice(again);
        }
    }
    Ok(())
}

/// Returns the four words of a header (see the module documentation).
fn words(header: [u8; HEADER_BYTES]) -> [u32; 4] {
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = header;
    [[a, b, c, d], [e, f, g, h], [i, j, k, l], [m, n, o, p]].map(u32::from_le_bytes)
}

/// Returns the checksum of a payload and its header. `digest` has processed the payload.
fn total(digest: Crc32, sequence: u32, length: u32) -> u32 {
    total_of(MARK, digest, sequence, length)
}

/// Returns the checksum of a header with this mark and of the payload whose `digest` is given.
fn total_of(mark: u32, mut digest: Crc32, sequence: u32, length: u32) -> u32 {
    for word in [mark, sequence, length] {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

/// Writes a page, of which a part may have been written before. No bit is cleared twice.
#[cfg(feature = "early-ink")]
fn complete<F: MultiwriteNorFlash>(
    flash: &mut F,
    at: u32,
    mut page: [u8; PAGE_BYTES],
) -> Result<(), F::Error> {
    let mut present = [0; PAGE_BYTES];
    read_surely(flash, at, &mut present)?;
    for (byte, present) in page.iter_mut().zip(present) {
        *byte |= !present;
    }
    if page.iter().all(|&byte| byte == 0xFF) { Ok(()) } else { flash.write(at, &page) }
}

/// Writes the words of a header to the front of a page.
fn put_words(page: &mut [u8; PAGE_BYTES], words: [u32; HEADER_BYTES / 4]) {
    for (slot, word) in page.chunks_exact_mut(4).zip(words) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
}

/// Reads a kept state from its beginning to its end, in pieces of any size.
#[derive(Debug)]
pub struct Reader<'f, F> {
    /// The flash that holds the state.
    flash: &'f mut F,
    /// The offset in flash of the next byte to read.
    at: u32,
    /// The number of bytes that have not been read yet.
    left: u32,
}

impl<F: ReadNorFlash> Reader<'_, F> {
    /// Copies the next bytes to the front of `into`, as many as are left and fit. Returns their
    /// number, which is 0 if the flash fails.
    pub fn read(&mut self, into: &mut [u8]) -> usize {
        let count = into.len().min(self.left as usize);
        match read_surely(self.flash, self.at, &mut into[..count]) {
            Ok(()) => {
                self.at += count as u32;
                self.left -= count as u32;
                count
            }
            Err(_) => 0,
        }
    }

    /// Reads all that is left. Returns its checksum so far, or `None` if the flash fails.
    fn digest(&mut self) -> Option<Crc32> {
        let mut digest = Crc32::new();
        let mut piece = [0; 64];
        loop {
            match self.read(&mut piece) {
                0 => break,
                count => digest.update(&piece[..count]),
            }
        }
        (self.left == 0).then_some(digest)
    }

    /// Returns the number of bytes of the state that have not been read yet.
    pub fn left(&self) -> usize {
        self.left as usize
    }
}
