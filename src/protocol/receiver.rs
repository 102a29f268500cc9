//! Handles each byte in a port's receive interrupt. Real-time bytes act at once. Ordinary bytes
//! wait in a queue for the main loop. Where bytes were lost or damaged, the queue holds a mark.
//!
//! The mark is in band: the byte [`DAMAGED`], which UTF-8 never contains, takes the place of the
//! missing bytes in the queue. [`LineReader`](super::LineReader) then refuses the line that holds
//! it, once, at its end. The damaged byte may have been the end of a line. Two lines are then
//! refused as one, and a sender that counts replies misses one reply.
//!
//! Until a port has received its first undamaged byte, it drops damaged ones without a mark. A
//! floating input or a cable that is being plugged in produces such bytes before anybody has sent a
//! line. Later, damage between two lines is marked like any other damage and causes the next line
//! to be refused, because it may have hit the beginning of that line or a whole line. Damage alone
//! never causes a reply.

use super::{RealTime, Sorter};
use crate::byte_queue::Producer;
use core::fmt;

/// Marks the place among received bytes where bytes were lost or damaged. UTF-8 never contains it.
/// If a sender itself sends this byte, it counts as damage, too.
pub const DAMAGED: u8 = 0xFF;

/// Error bits beside the byte in the data register of Arm's PL011 UART: the stop bit is missing,
/// the parity is wrong, or the byte is part of a break.
const BYTE_IS_DAMAGED: u32 = 0b111 << 8;
/// The error bit for bytes lost before this one because the UART's own FIFO was full.
const BYTES_WERE_LOST: u32 = 1 << 11;

/// The part of a serial port that its receive interrupt uses.
pub struct Receiver<'q> {
    /// Where ordinary bytes wait for the main loop.
    queue: Producer<'q>,
    /// Tells the bytes that act at once from those of lines.
    sorter: Sorter,
    /// The number of bytes put into the queue since the start, modulo 2^32.
    count: u32,
    /// Whether an undamaged byte has come since the start.
    has_heard: bool,
    /// Whether bytes were lost or damaged after the last byte in the queue.
    damage: Damage,
}

/// Whether bytes are missing after the last byte in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Damage {
    /// No bytes are missing there.
    None,
    /// Bytes were lost, but the queue has had no room for the mark yet.
    Unmarked,
    /// Bytes were lost, and the mark that says so is in the queue.
    Marked,
}

impl fmt::Debug for Receiver<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (count, damage) = (self.count, self.damage);
        let mut shown = formatter.debug_struct("Receiver");
        shown.field("count", &count).field("damage", &damage).finish_non_exhaustive()
    }
}

impl<'q> Receiver<'q> {
    /// A receiver that puts ordinary bytes into `queue`.
    pub const fn new(queue: Producer<'q>) -> Self {
        let sorter = Sorter::new();
        Self { queue, sorter, count: 0, has_heard: false, damage: Damage::None }
    }

    /// Takes what a PL011's data register holds: a byte and its error bits. Returns the real-time
    /// request that the byte makes, if any.
    pub fn receive_from_uart(&mut self, data: u32) -> RealTime {
        if data & BYTES_WERE_LOST != 0 {
            self.lose();
        }
        if data & BYTE_IS_DAMAGED != 0 {
            self.lose();
            return RealTime::default();
        }
        self.receive((data & 0xFF) as u8)
    }

    /// Takes a byte and queues it if it is an ordinary one. Returns the real-time request that it
    /// makes, if any. If the queue is full, an ordinary byte is lost, and its place will be marked.
    pub fn receive(&mut self, byte: u8) -> RealTime {
        match self.sort_out(byte) {
            Err(requests) => requests,
            Ok(byte) => {
                if self.append(byte).is_err() {
                    self.lose();
                }
                RealTime::default()
            }
        }
    }

    /// Returns the byte if it is an ordinary one.
    ///
    /// # Errors
    /// The real-time request that the byte makes. Such a byte must not be queued.
    pub fn sort_out(&mut self, byte: u8) -> Result<u8, RealTime> {
        let requests = self.sorter.sort(byte);
        self.has_heard |= byte != DAMAGED;
        requests.map_or(Ok(byte), Err)
    }

    /// Puts an ordinary byte into the queue, after the mark of any loss before it.
    ///
    /// # Errors
    /// The byte, if there is no room for it.
    pub fn append(&mut self, byte: u8) -> Result<(), u8> {
        if byte == DAMAGED {
            self.note_loss();
            return Ok(());
        }
        if !self.mark() {
            return Err(byte);
        }
        self.queue.enqueue(byte)?;
        self.count = self.count.wrapping_add(1);
        self.damage = Damage::None;
        Ok(())
    }

    /// Notes that bytes were lost or damaged here. Adjacent losses share one mark.
    pub fn lose(&mut self) {
        // A multi-byte letter of UTF-8 that has begun is not continued after the loss.
        #[cfg(not(feature = "hpgl"))]
        self.sorter.sort(DAMAGED);
        // Noise before the first byte belongs to no line.
        #[cfg(feature = "hpgl")]
        if self.has_heard {
            self.sorter.sort(DAMAGED);
        } else {
            self.sorter.break_letter();
        }
        self.note_loss();
    }

    /// Has the loss of bytes marked in the queue.
    #[cfg_attr(feature = "hpgl", inline(never))]
    fn note_loss(&mut self) {
        if self.has_heard && self.damage == Damage::None {
            self.damage = Damage::Unmarked;
            self.mark();
        }
    }

    /// Puts a pending mark into the queue if there is room. Returns whether no mark is pending.
    pub fn mark(&mut self) -> bool {
        if self.damage == Damage::Unmarked && self.queue.enqueue(DAMAGED).is_ok() {
            self.count = self.count.wrapping_add(1);
            self.damage = Damage::Marked;
        }
        self.damage != Damage::Unmarked
    }

    /// Discards everything received so far, because ctrl-X came by some port. Returns the number of
    /// bytes put into the queue since the start, modulo 2^32. The main loop drops those of them
    /// that it has not taken.
    pub fn abort(&mut self) -> u32 {
        self.damage = Damage::None;
        #[cfg(feature = "hpgl")]
        self.sorter.clear();
        self.count
    }

    /// Notes that a line that has begun was ended in place of its sender, who has gone.
    pub fn end_line(&mut self) {
        self.sorter.sort(DAMAGED);
        self.sorter.sort(b'\n');
    }

    /// Whether an undamaged byte has come since the start.
    pub fn has_heard(&self) -> bool {
        self.has_heard
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CommandError, LineReader};
    use super::*;
    use crate::byte_queue::{ByteQueue, Consumer};
    use std::string::{String, ToString};
    use std::vec::Vec;

    const FRAMING: u32 = 1 << 8;
    const PARITY: u32 = 1 << 9;
    const BREAK: u32 = 1 << 10;
    const OVERRUN: u32 = 1 << 11;

    /// The lines that a reader makes from the bytes in the queue.
    fn lines(
        reader: &mut LineReader,
        queue: &mut Consumer<'_>,
    ) -> Vec<Result<String, CommandError>> {
        let mut lines = Vec::new();
        while let Some(byte) = queue.dequeue() {
            lines.extend(reader.push(byte).map(|line| line.map(ToString::to_string)));
        }
        lines
    }

    /// The lines that result from the values of a PL011's data register.
    fn lines_of(data: impl IntoIterator<Item = u32>) -> Vec<Result<String, CommandError>> {
        let (mut queue, mut reader) = (ByteQueue::<256>::new(), LineReader::default());
        let (producer, mut consumer) = queue.split();
        let mut receiver = Receiver::new(producer);
        for data in data {
            assert_eq!(receiver.receive_from_uart(data), RealTime::default());
        }
        lines(&mut reader, &mut consumer)
    }

    /// The text, with the bits added to its byte at `index`.
    fn damaged(text: &str, index: usize, bits: u32) -> Vec<u32> {
        let mut data: Vec<u32> = text.bytes().map(u32::from).collect();
        data[index] |= bits;
        data
    }

    fn ok(line: &str) -> Result<String, CommandError> {
        Ok(line.to_string())
    }

    const LOST: Result<String, CommandError> = Err(CommandError::BytesLost);

    #[test]
    fn every_error_of_the_uart_voids_its_line_and_no_other() {
        let text = "v 1 2 3\nv 4 5 6\nv 7 8 9\n";
        for bits in [FRAMING, PARITY, BREAK | FRAMING, OVERRUN] {
            for index in 8..15 {
                let found = lines_of(damaged(text, index, bits));
                assert_eq!(found, [ok("v 1 2 3"), LOST, ok("v 7 8 9")], "{bits:#x} at {index}");
            }
        }
    }

    #[test]
    fn a_damaged_line_end_makes_one_void_line_of_two() {
        let found = lines_of(damaged("v 1 2 3\nv 4 5 6\nv 7 8 9\n", 7, FRAMING));
        assert_eq!(found, [LOST, ok("v 7 8 9")]);
        // The line end itself is undamaged; bytes before it were lost.
        let found = lines_of(damaged("v 1 2 3\nv 4 5 6\n", 7, OVERRUN));
        assert_eq!(found, [LOST, ok("v 4 5 6")]);
    }

    #[test]
    fn noise_before_the_first_byte_is_dropped() {
        let noise = [BREAK | FRAMING, FRAMING | 0x80, u32::from(DAMAGED)];
        let found = lines_of(noise.into_iter().chain(damaged("$I\n", 0, 0)));
        assert_eq!(found, [ok("$I")]);
    }

    #[test]
    fn noise_between_lines_is_not_answered_but_voids_the_next_line() {
        let mut data = damaged("v 1 2 3\nv 4 5 6\nv 7 8 9\n", 0, 0);
        data.insert(8, BREAK | FRAMING);
        assert_eq!(lines_of(data[..9].iter().copied()), [ok("v 1 2 3")]);
        assert_eq!(lines_of(data), [ok("v 1 2 3"), LOST, ok("v 7 8 9")]);
    }

    #[test]
    fn a_line_with_much_damage_is_refused_once_and_takes_one_place_of_the_queue() {
        let noise = core::iter::repeat_n(FRAMING, 1000);
        let found = lines_of(damaged("v 1", 0, 0).into_iter().chain(noise).chain(damaged(
            "3\nv 4 5 6\n",
            0,
            0,
        )));
        assert_eq!(found, [LOST, ok("v 4 5 6")]);
    }

    #[test]
    fn a_full_queue_is_marked_before_any_later_byte() {
        let (mut queue, mut reader) = (ByteQueue::<8>::new(), LineReader::default());
        let (producer, mut consumer) = queue.split();
        let mut receiver = Receiver::new(producer);
        for byte in *b"$I\n$100=80\n" {
            receiver.receive(byte);
        }
        // The queue held "$I\n$100", so "=80\n" is lost.
        assert_eq!(lines(&mut reader, &mut consumer), [ok("$I")]);
        assert!(receiver.mark());
        for byte in *b"$$\n$#\n" {
            receiver.receive(byte);
        }
        assert_eq!(lines(&mut reader, &mut consumer), [LOST, ok("$#")]);
    }

    #[test]
    fn real_time_bytes_act_however_full_the_queue_is() {
        let mut queue = ByteQueue::<2>::new();
        let (producer, _consumer) = queue.split();
        let mut receiver = Receiver::new(producer);
        for byte in *b"v 1" {
            receiver.receive(byte);
        }
        assert_eq!(receiver.receive(b'!'), RealTime::HOLD);
        assert_eq!(receiver.receive_from_uart(OVERRUN | u32::from(b'?')), RealTime::STATUS);
    }

    #[test]
    fn an_abort_voids_what_was_lost_before_it() {
        let (mut queue, mut reader) = (ByteQueue::<16>::new(), LineReader::default());
        let (producer, mut consumer) = queue.split();
        let mut receiver = Receiver::new(producer);
        for byte in *b"$100=80" {
            receiver.receive(byte);
        }
        receiver.lose();
        assert_eq!(receiver.receive(0x18), RealTime::ABORT);
        for _ in 0..receiver.abort() {
            consumer.dequeue();
        }
        for byte in *b"$I\n" {
            receiver.receive(byte);
        }
        assert_eq!(lines(&mut reader, &mut consumer), [ok("$I")]);
    }

    #[test]
    fn a_stray_first_byte_of_a_letter_on_one_port_leaves_the_others_real_time_bytes() {
        let (mut first, mut second) = (ByteQueue::<8>::new(), ByteQueue::<8>::new());
        let (mut first, mut second) =
            (Receiver::new(first.split().0), Receiver::new(second.split().0));
        first.receive(0xF0);
        assert_eq!(second.receive(0x85), RealTime::CANCEL_JOG);
        // Damage ends a letter, too.
        first.lose();
        assert_eq!(first.receive(0x85), RealTime::CANCEL_JOG);
    }
}
