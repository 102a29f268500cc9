//! What is done with the buffers of the endpoints beside reading and writing them.
//!
//! * A packet that the host has not taken is taken back: see [`Buffers::take_back`].
//! * A packet for which the port has no room waits in the controller: see [`Buffers::leave`].
//! * Data at endpoint 0 that nobody reads are refused: see [`Buffers::refuse`].
//! * Packets begin anew with DATA0 where USB 2.0 wants it: see [`Buffers::begin_anew`].

use super::Controller;
use super::buffers::{Buffers, FROM_0, FROM_PORT, TO_0, TO_PORT, control_word};

/// The most bytes of data from the host for which the device has room in one request.
pub const MOST_DATA: usize = 128;
/// Cycles of the core after which a packet of 64 bytes that has already begun is over: 60
/// microseconds.
const PACKET_CYCLES: u32 = 7500;

impl<C: Controller> Buffers<C> {
    /// Whether the host has taken the port's packet, and the device was not polled since.
    pub fn is_taken(&self) -> bool {
        self.finished() & 1 << FROM_PORT != 0
    }

    /// Leaves a packet for the port in the controller, until there is room for it. Its interrupt is
    /// cleared so that it does not come again and again.
    pub fn leave(&self) {
        self.clear_finished(1 << TO_PORT);
    }

    /// Takes back the port's packet that the controller holds for the host, unless the host is
    /// taking it just now. Returns whether there was one to take back.
    pub fn take_back(&self) -> bool {
        use control_word::{AVAILABLE, FULL, IS_DATA_1};
        let word = self.control(FROM_PORT);
        if word & AVAILABLE == 0 {
            return false;
        }
        self.keep(FROM_PORT, word);
        self.0.delay(PACKET_CYCLES);
        if self.is_taken() {
            return false;
        }
        // The next packet must have the data toggle of this one, which was never sent; the driver
        // will flip it.
        self.keep(FROM_PORT, word & !FULL ^ IS_DATA_1);
        true
    }

    /// Returns the control word of a packet at endpoint 0 that was not read, if there is one and no
    /// request has come after it. Packets that follow each other differ in their data toggle.
    pub fn unread(&self) -> Option<u32> {
        let is_left = self.finished() & 1 << TO_0 != 0 && !self.has_setup();
        is_left.then(|| self.control(TO_0))
    }

    /// Whether a request was read with more data from the host than the device has room for.
    fn is_too_long(&self) -> bool {
        let [low, high] = self.setup();
        let is_from_device = low & 0x80 != 0;
        let length = high >> 16;
        !is_from_device && length > MOST_DATA as u32 && !self.has_setup()
    }

    /// Refuses data at endpoint 0 that the device has neither read nor refused, until the next
    /// request. Otherwise their interrupt would come without an end, or they would be taken for
    /// those of an earlier request. Call it after the device has done all else; `before` is what
    /// [`Buffers::unread`] returned before.
    ///
    /// Such data are those of a request that is too long, and data that no request has announced.
    pub fn refuse(&self, before: Option<u32>) {
        let is_unread = before.is_some() && before == self.unread();
        if !is_unread && !self.is_too_long() {
            return;
        }
        for buffer in [FROM_0, TO_0] {
            self.set_bit(buffer, control_word::STALL, true);
        }
        self.arm_stall();
        self.clear_finished(1 << TO_0);
    }

    /// Makes the next packet of an endpoint DATA0, even if it is waiting for the host already. The
    /// host exchanges no packet with the endpoint until its request is confirmed.
    pub fn begin_anew(&self, buffer: usize) {
        use control_word::{AVAILABLE, IS_DATA_1};
        // The driver flips the toggle when it writes a packet, and when it has read one.
        let is_flipped = self.control(buffer) & AVAILABLE == 0;
        self.set_bit(buffer, IS_DATA_1, is_flipped);
    }
}
