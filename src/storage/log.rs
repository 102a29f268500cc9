//! The log of a record: how far the work that the record describes has come.
//!
//! A log lies in sectors of its own. [`Log::begin`] erases them and writes a page at their front;
//! from then on [`Log::note`] clears one bit after the other, each by a write of one page, so that
//! nothing has to be erased while the work goes on. The number of bits that are clear, from the
//! first one on, is how far it has come. A second count of the same kind begins at the last bit:
//! how many points are passed within the parts of the work.
//!
//! The first page begins with four words in little-endian order: a mark, the checksum of the state
//! to which the log belongs, the length of the notes in bytes, and the CRC-32 of these three and
//! the notes. The notes follow. A log whose first page is not whole has not begun.

use super::{PAGE_BYTES, StorageError, read_surely, words};
use crate::checksum::Crc32;
use embedded_storage::nor_flash::{MultiwriteNorFlash, ReadNorFlash};

/// The number at the beginning of a log, by which one that has begun is known.
const MARK: u32 = u32::from_le_bytes(*b"log1");
/// The size of the words before the notes, in bytes.
const HEADER_BYTES: usize = 16;
/// The most bytes of notes that a log holds.
pub const NOTE_BYTES: usize = PAGE_BYTES - HEADER_BYTES;
/// The number of bytes of bits that are read at a time.
const PIECE_BYTES: usize = 32;

/// The progress of the work that a log describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LogProgress {
    /// The number of parts of the work that are done.
    pub parts: u32,
    /// The number of points within its parts that are passed, counted over the whole work.
    pub points: u32,
    /// Whether the last part is done that the log has room for, by which [`Log::close`] tells that
    /// all are.
    pub is_closed: bool,
}

/// Where a log lies in flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Log {
    /// Offset of the log in bytes: a multiple of the flash's erase size.
    pub start: u32,
    /// Size of the log in bytes: also a multiple of the erase size.
    pub bytes: u32,
}

impl Log {
    /// The number of parts of the work that can be noted: three quarters of the bits.
    pub const fn limit(self) -> u32 {
        self.bits() / 4 * 3
    }

    /// The number of points that can be noted: a quarter of the bits.
    pub const fn points_limit(self) -> u32 {
        self.bits() / 4
    }

    /// The number of bits that can be cleared: those of all pages but the first.
    const fn bits(self) -> u32 {
        (self.bytes - PAGE_BYTES as u32) * 8
    }

    /// Begins the log of the state with the checksum `of`, with these notes and no bit cleared.
    ///
    /// # Errors
    /// [`StorageError::TooLong`] for more notes than [`NOTE_BYTES`], or the error of the flash. The
    /// log has then not begun.
    pub fn begin<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        of: u32,
        notes: &[u8],
    ) -> Result<(), StorageError<F::Error>> {
        // Notes that do not fit leave the log as it was.
        if notes.len() > NOTE_BYTES {
            return Err(StorageError::TooLong);
        }
        self.erase(flash)?;
        self.begin_erased(flash, of, notes)
    }

    /// Erases the log, which has then not begun.
    ///
    /// # Errors
    /// The error of the flash.
    pub(crate) fn erase<F: MultiwriteNorFlash>(self, flash: &mut F) -> Result<(), F::Error> {
        for at in (self.start..self.start + self.bytes).step_by(F::ERASE_SIZE) {
            flash.erase(at, at + F::ERASE_SIZE as u32)?;
        }
        Ok(())
    }

    /// Begins the log as [`Log::begin`] does, if its flash has been erased already.
    ///
    /// # Errors
    /// As [`Log::begin`].
    pub(crate) fn begin_erased<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        of: u32,
        notes: &[u8],
    ) -> Result<(), StorageError<F::Error>> {
        let mut page = [0xFF; PAGE_BYTES];
        let (head, tail) = page.split_at_mut(HEADER_BYTES);
        tail.get_mut(..notes.len()).ok_or(StorageError::TooLong)?.copy_from_slice(notes);
        let length = notes.len() as u32;
        let words = [MARK, of, length, checksum(of, notes)];
        for (slot, word) in head.chunks_exact_mut(4).zip(words) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        flash.write(self.start, &page)?;
        Ok(())
    }

    /// Copies the notes of the log of the state with the checksum `of` to the front of `notes`.
    /// Returns their length and what has been noted, or `None` if no such log has begun, or if its
    /// notes do not fit.
    pub fn read<F: ReadNorFlash>(
        self,
        flash: &mut F,
        of: u32,
        notes: &mut [u8],
    ) -> Option<(usize, LogProgress)> {
        let mut header = [0; HEADER_BYTES];
        read_surely(flash, self.start, &mut header).ok()?;
        let [mark, found, length, sum] = words(header);
        let notes = notes.get_mut(..usize::try_from(length).ok()?)?;
        if mark != MARK || found != of || notes.len() > NOTE_BYTES {
            return None;
        }
        read_surely(flash, self.start + HEADER_BYTES as u32, notes).ok()?;
        (sum == checksum(of, notes)).then(|| {
            let (parts, points) = (self.count(flash), self.count_points(flash));
            (notes.len(), LogProgress { parts, points, is_closed: self.is_closed(flash) })
        })
    }

    /// Returns the number of bits that are clear, from the first one on. A flash that fails ends
    /// the count.
    #[inline(never)] // It is called seldom.
    fn count<F: ReadNorFlash>(self, flash: &mut F) -> u32 {
        let mut count = 0;
        let mut piece = [0; PIECE_BYTES];
        while count < self.limit() {
            let at = self.start + PAGE_BYTES as u32 + count / 8;
            if read_surely(flash, at, &mut piece).is_err() {
                break;
            }
            for byte in piece {
                count += byte.trailing_zeros().min(8);
                if byte != 0 {
                    return count;
                }
            }
        }
        count
    }

    /// Returns whether the bit of the last part is clear. It is not if the flash fails.
    fn is_closed<F: ReadNorFlash>(self, flash: &mut F) -> bool {
        let (last, mut byte) = (self.limit() - 1, [0xFF]);
        let at = self.start + PAGE_BYTES as u32 + last / 8;
        read_surely(flash, at, &mut byte).is_ok() && byte[0] & (1 << (last % 8)) == 0
    }

    /// Returns the number of bits that are clear, from the last one back. A flash that fails ends
    /// the count.
    #[inline(never)] // It is called seldom.
    fn count_points<F: ReadNorFlash>(self, flash: &mut F) -> u32 {
        let mut count = 0;
        let mut piece = [0; PIECE_BYTES];
        while count < self.points_limit() {
            let at = self.start + self.bytes - count / 8 - PIECE_BYTES as u32;
            if read_surely(flash, at, &mut piece).is_err() {
                break;
            }
            for byte in piece.into_iter().rev() {
                count += byte.leading_zeros().min(8);
                if byte != 0 {
                    return count;
                }
            }
        }
        count
    }

    /// Notes the points from number `from` up to number `to`, which is excluded, by clearing bits
    /// from the last one back. Points beyond [`Log::points_limit`] are left out.
    ///
    /// # Errors
    /// The error of the flash.
    pub fn note_points<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        from: u32,
        to: u32,
    ) -> Result<(), F::Error> {
        let limit = self.points_limit();
        self.clear(flash, self.bits() - to.min(limit), self.bits() - from.min(limit))
    }

    /// Notes the parts from number `from` up to number `to`, which is excluded, by clearing bits
    /// from the first one on. Parts beyond [`Log::limit`] are left out.
    ///
    /// # Errors
    /// The error of the flash.
    pub fn note<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        from: u32,
        to: u32,
    ) -> Result<(), F::Error> {
        self.clear(flash, from, to.min(self.limit()))
    }

    /// Notes that all parts are done, however many there are, by clearing the bit of the last one
    /// that there is room for. A loss of power leaves it as it was, or clear.
    ///
    /// # Errors
    /// The error of the flash.
    pub fn close<F: MultiwriteNorFlash>(self, flash: &mut F) -> Result<(), F::Error> {
        self.clear(flash, self.limit() - 1, self.limit())
    }

    /// Clears the bits from number `from` up to number `to`, which is excluded.
    fn clear<F: MultiwriteNorFlash>(
        self,
        flash: &mut F,
        from: u32,
        to: u32,
    ) -> Result<(), F::Error> {
        const PAGE_BITS: u32 = PAGE_BYTES as u32 * 8;
        let mut from = from;
        while from < to {
            let page_begin = from / PAGE_BITS * PAGE_BITS;
            let end = to.min(page_begin + PAGE_BITS);
            let mut page = [0xFF; PAGE_BYTES];
            for bit in from..end {
                if let Some(byte) = page.get_mut(((bit - page_begin) / 8) as usize) {
                    *byte &= !(1 << (bit % 8));
                }
            }
            // The first page holds the notes.
            flash.write(self.start + PAGE_BYTES as u32 + page_begin / 8, &page)?;
            from = end;
        }
        Ok(())
    }
}

/// Returns the checksum of a log's first page.
fn checksum(of: u32, notes: &[u8]) -> u32 {
    let mut digest = Crc32::new();
    for word in [MARK, of, notes.len() as u32] {
        digest.update(&word.to_le_bytes());
    }
    digest.update(notes);
    digest.finalize()
}

#[cfg(all(test, feature = "host"))]
mod tests {
    use super::*;
    use crate::boards::host::CutFlash;

    const LOG: Log = Log { start: 4096, bytes: 4096 };

    #[test]
    fn a_log_has_a_bit_for_each_part_and_point_behind_its_first_page() {
        // Fifteen pages of 2048 bits.
        assert_eq!((LOG.limit(), LOG.points_limit()), (23_040, 7_680));
    }

    #[test]
    fn a_log_is_closed_by_one_byte_and_keeps_its_count() {
        let mut flash = CutFlash::new(3 * 4096);
        LOG.begin(&mut flash, 7, b"notes").unwrap();
        LOG.note(&mut flash, 0, 9).unwrap();
        LOG.note_points(&mut flash, 0, 7_680).unwrap();
        let before = flash.bytes.clone();
        let read = |flash: &mut CutFlash| LOG.read(flash, 7, &mut [0; NOTE_BYTES]).unwrap().1;
        let open = LogProgress { parts: 9, points: 7_680, is_closed: false };
        assert_eq!(read(&mut flash), open);
        LOG.close(&mut flash).unwrap();
        assert_eq!(read(&mut flash), LogProgress { is_closed: true, ..open });
        let changed = before.iter().zip(&flash.bytes).filter(|(before, now)| before != now);
        assert_eq!(changed.count(), 1);
    }

    #[test]
    fn what_is_noted_is_read_up_to_the_limits() {
        let mut flash = CutFlash::new(3 * 4096);
        LOG.begin(&mut flash, 7, b"notes").unwrap();
        let read = |flash: &mut CutFlash| {
            let mut notes = [0; NOTE_BYTES];
            let (length, noted) = LOG.read(flash, 7, &mut notes).unwrap();
            assert_eq!(&notes[..length], b"notes");
            noted
        };
        let (mut parts, mut points) = (0, 0);
        for (next, next_points) in
            [(1, 0), (2, 1), (9, 3), (2047, 2048), (2049, 2060), (23_040, 7_680)]
        {
            LOG.note(&mut flash, parts, next).unwrap();
            LOG.note_points(&mut flash, points, next_points).unwrap();
            (parts, points) = (next, next_points);
            let is_closed = parts == LOG.limit();
            assert_eq!(read(&mut flash), LogProgress { parts, points, is_closed });
        }
        // Notes of a page less its head are too long by a byte, and leave the log as it was.
        assert!(LOG.begin(&mut flash, 7, &[0; 241]).is_err());
        assert_eq!(read(&mut flash), LogProgress { parts, points, is_closed: true });
        // Another state has another log, and a page with another mark is none.
        assert!(LOG.read(&mut flash, 8, &mut [0; NOTE_BYTES]).is_none());
        flash.bytes[4096] ^= 1;
        assert!(LOG.read(&mut flash, 7, &mut [0; NOTE_BYTES]).is_none());
        assert!(flash.bytes[..4096].iter().chain(&flash.bytes[8192..]).all(|byte| *byte == 0xFF));
    }
}
