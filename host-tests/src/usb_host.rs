//! A USB host that checks what the port of the Pico promises, whatever packets it sends.
//!
//! It does everything to the reference device, too, and both must answer the same: see
//! [`usb_twins`](crate::usb_twins).
//!
//! It keeps its own data toggles, as a real host does, and drops a packet that has the wrong one.
//! It acts as USB 2.0 wants, or breaks transfers off, or sends what no host sends; then it checks
//! only what the device still owes it. Three things are left out:
//!
//! - The driver takes back the answer to a broken-off request when it sees the next SETUP packet. A
//!   host that asks before gets the old answer, and may lose the data that it sends. Nothing is
//!   promised of such a transfer.
//! - A host that breaks off a request behind which packets begin anew with DATA0 does not know
//!   whether it was carried out. Behind each such request one packet may be lost each way, but no
//!   more, and none is repeated.
//! - The driver keeps a SETUP packet that it has not seen when the host resets the bus, if the
//!   device had no address, because that packet may have come behind the reset. So that request is
//!   still carried out, and may configure the device or open the port.

mod enumerate;

use crate::usb_controller::{Answer, Handshake, UsbController};
use crate::usb_firmware::device::Device;
use crate::usb_firmware::driver::PACKET;
use crate::usb_port::Port;
use crate::usb_twins::Twins;

/// The number of endpoints in each direction.
const ENDPOINTS: usize = 16;
/// The endpoint from which the host takes the port's bytes.
pub const FROM_PORT: usize = 2;
/// The endpoint to which the host sends bytes for the port.
pub const TO_PORT: usize = 1;
/// The port reads packets while this many bytes wait at most.
const ROOM_UP_TO: usize = 446;
/// How often the device is served until its interrupts end, or it answers.
const MOST_TURNS: u32 = 16;
/// The beginnings of requests that every device answers: for its descriptor, for that of its
/// configuration, and for its state.
const ALWAYS_ANSWERED: [&[u8]; 3] =
    [&[0x80, 6, 0, 1, 0, 0], &[0x80, 6, 0, 2, 0, 0], &[0x80, 0, 0, 0, 0, 0]];

/// How a control transfer has ended.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The device has confirmed it, with these data, if the host has asked for data.
    Done(Vec<u8>),
    /// The device has refused it.
    Refused,
    /// The device does not answer.
    Unanswered,
}

/// The control transfer that is under way.
struct Transfer {
    request: [u8; 8],
    /// The bytes of data that have come or gone.
    moved: usize,
    /// Whether the device owes no further packet.
    is_over: bool,
    /// Whether all packets since the request are such that the device owes what USB 2.0 says.
    is_sound: bool,
}

impl Transfer {
    /// The state in which there is none.
    const NONE: Self = Self { request: [0; 8], moved: 0, is_over: true, is_sound: false };

    /// Whether the host asks for data.
    fn is_in(&self) -> bool {
        self.request[0] & 0x80 != 0
    }

    /// The endpoints, and the sides of them, whose packets begin anew with DATA0 behind the
    /// request.
    fn begins_anew(&self) -> Vec<(usize, usize)> {
        let of_port = [(FROM_PORT, IN), (TO_PORT, OUT)];
        match self.request {
            [0x00, 9, 0 | 1, 0, ..] | [0x01, 11, 0, 0, 1, 0, ..] => of_port.to_vec(),
            [0x02, 1, 0, 0, address, ..] if address & 0x8F == 0x82 => vec![of_port[0]],
            [0x02, 1, 0, 0, address, ..] if address & 0x8F == 0x01 => vec![of_port[1]],
            _ => Vec::new(),
        }
    }

    /// The greatest number of bytes of data, or the exact one if the host sends them.
    fn length(&self) -> usize {
        usize::from(u16::from_le_bytes([self.request[6], self.request[7]]))
    }
}

/// The host, with the device at the other end of its cable.
pub struct Host<'p> {
    /// The device, and the reference, which must be the same.
    pub twins: Twins<'p>,
    /// Whether the host does one thing after the other without waiting for the device.
    pub is_hasty: bool,
    is_suspended: bool,
    transfer: Transfer,
    /// For each endpoint, whether its next packet to the host and from it is DATA1.
    is_data_1: [[bool; 2]; ENDPOINTS],
    /// For each endpoint, how many packets to the host and from it may be lost.
    may_lose: [[u32; 2]; ENDPOINTS],
    /// The bytes for the port that the device has accepted since the last reset of the bus.
    accepted: Vec<u8>,
    /// The number of packets that the port has sent, and the host taken, since then.
    taken: usize,
    /// The next byte of a pattern in which each place differs from those around it.
    next: u8,
}

/// The names of the two directions in the tables of [`Host`].
const IN: usize = 0;
/// See [`IN`].
const OUT: usize = 1;

impl<'p> Host<'p> {
    /// Plugs the device in. The bus has not been reset yet.
    pub fn new(twins: Twins<'p>) -> Self {
        Self {
            twins,
            is_hasty: false,
            is_suspended: false,
            transfer: Transfer::NONE,
            is_data_1: [[false; 2]; ENDPOINTS],
            may_lose: [[0; 2]; ENDPOINTS],
            accepted: Vec::new(),
            taken: 0,
            next: 0,
        }
    }

    /// The port of the device.
    pub fn port(&self) -> &Port<Device<'p, UsbController>> {
        self.twins.port()
    }

    /// The next bytes of the pattern.
    pub fn pattern(&mut self, count: usize) -> Vec<u8> {
        let mut pattern = Vec::with_capacity(count);
        for _ in 0..count {
            pattern.push(self.next);
            self.next = self.next.wrapping_add(1) % 251;
        }
        pattern
    }

    /// Lets the device work until its interrupts end.
    pub fn settle(&mut self) {
        for _ in 0..MOST_TURNS {
            self.twins.serve();
            if !self.port().bus().has_interrupt() {
                return;
            }
        }
        panic!("the controller interrupts for ever");
    }

    /// Lets the device work, unless the host is hasty.
    pub fn pause(&mut self) {
        if !self.is_hasty {
            self.settle();
        }
    }

    /// Resets the bus, and waits as long as a host does. What the controller holds is lost, but
    /// nothing else.
    pub fn reset(&mut self) {
        self.is_suspended = false;
        let keeps_setup = self.port().bus().has_setup() && self.port().bus().address() == 0;
        self.twins.reset_bus();
        self.transfer = Transfer::NONE;
        self.settle();
        let is_anew = !self.port().is_up() && !self.port().is_open();
        assert!(is_anew || keeps_setup, "a reset has left the port open");
        let lost = self.accepted.len() - self.arrived();
        assert!(lost <= PACKET, "{lost} bytes were lost by a reset");
        self.accepted = self.port().waiting().iter().copied().collect();
        self.twins.forget_received();
        self.twins.forget_sent();
        self.taken = 0;
        self.is_data_1 = [[false; 2]; ENDPOINTS];
        self.may_lose = [[0; 2]; ENDPOINTS];
    }

    /// Suspends the bus. It resumes it before the next packet, if not before.
    pub fn suspend(&mut self) {
        self.is_suspended = true;
        self.twins.suspend_bus();
    }

    /// Resumes the bus.
    pub fn resume(&mut self) {
        if self.is_suspended {
            self.is_suspended = false;
            self.twins.resume_bus();
        }
    }

    /// Checks that what the port has received is what it was sent, and returns the number of those
    /// bytes.
    fn arrived(&self) -> usize {
        let waiting = self.port().waiting();
        let (read, count) = (&self.port().received, self.port().received.len());
        let is_same = self.accepted.starts_with(read)
            && self.accepted.len() >= count + waiting.len()
            && self.accepted[count..].iter().zip(waiting).all(|(sent, read)| sent == read);
        assert!(is_same, "the port has received other bytes than it was sent");
        count + waiting.len()
    }

    /// Sends a SETUP packet.
    pub fn set_up(&mut self, request: [u8; 8]) {
        self.resume();
        self.break_off_anew();
        self.twins.set_up(request);
        self.transfer = Transfer { request, moved: 0, is_over: false, is_sound: true };
        self.is_data_1[0] = [true; 2];
    }

    /// Asks endpoint 0 for a packet: for data, or for the confirmation of a request. Returns its
    /// bytes, if the host takes them for new ones.
    pub fn ask_control(&mut self) -> Result<Vec<u8>, Answer> {
        self.resume();
        let had_setup = self.port().bus().has_setup();
        let (bytes, is_data_1, is_current) = match self.twins.ask(0) {
            Answer::Packet { bytes, is_data_1, is_current } => (bytes, is_data_1, is_current),
            Answer::Stall => {
                let is_owed = self.transfer.is_sound && !self.transfer.is_over;
                let is_known = ALWAYS_ANSWERED.contains(&&self.transfer.request[..6]);
                assert!(!(is_owed && is_known), "{:x?} is refused", self.transfer.request);
                self.transfer.is_over = true;
                return Err(Answer::Stall);
            }
            answer => {
                let has_all = self.transfer.moved == self.transfer.length();
                self.check_progress(self.transfer.is_in() || has_all);
                return Err(answer);
            }
        };
        let length = self.transfer.length();
        let transfer = &mut self.transfer;
        assert!(is_current || had_setup, "an old answer is kept behind a SETUP packet");
        transfer.is_sound &= is_current;
        let is_new = is_data_1 == self.is_data_1[0][IN];
        if transfer.is_sound {
            assert!(is_new, "a packet of a control transfer has the wrong data toggle");
            assert!(
                transfer.is_in() || transfer.moved == length,
                "a request is confirmed before its data have come"
            );
            let room = if transfer.is_in() { length - transfer.moved } else { 0 };
            assert!(bytes.len() <= room, "{} bytes, but only {room} are due", bytes.len());
        }
        if !is_new {
            return Ok(Vec::new());
        }
        self.is_data_1[0][IN] = !is_data_1;
        if !transfer.is_in() {
            let was_over = std::mem::replace(&mut transfer.is_over, true);
            if !was_over && transfer.moved >= length {
                self.follow_confirmed();
            }
        } else {
            transfer.moved += bytes.len();
            transfer.is_over |= bytes.len() < PACKET || transfer.moved >= length;
        }
        Ok(bytes)
    }

    /// Sends endpoint 0 a packet: data of a request, or the confirmation of an answer.
    pub fn give_control(&mut self, packet: &[u8]) -> Handshake {
        self.resume();
        let had_setup = self.port().bus().has_setup();
        let is_data_1 = self.transfer.is_in() || self.is_data_1[0][OUT];
        let handshake = self.twins.give(0, is_data_1, packet);
        let left = self.transfer.length().saturating_sub(self.transfer.moved);
        let is_due = if self.transfer.is_in() {
            packet.is_empty()
        } else {
            left > 0 && packet.len() == left.min(PACKET)
        };
        match handshake {
            Handshake::Ack | Handshake::Dropped => {
                self.is_data_1[0][OUT] = !is_data_1;
                self.transfer.is_sound &= is_due && !had_setup;
                let is_wrong = self.transfer.is_sound && handshake == Handshake::Dropped;
                assert!(!is_wrong, "the device expects another data toggle");
                if self.transfer.is_in() {
                    self.transfer.is_over = true;
                } else {
                    self.transfer.moved += packet.len();
                }
            }
            Handshake::Stall => self.transfer.is_over = true,
            Handshake::Nak | Handshake::Nothing => {
                self.check_progress(is_due && !self.transfer.is_in());
            }
        }
        handshake
    }

    /// Checks that a device that does not answer at endpoint 0 has still something to do, or owes
    /// nothing.
    fn check_progress(&self, is_owed: bool) {
        let transfer = &self.transfer;
        let is_late = transfer.is_sound && !transfer.is_over && !self.port().bus().has_interrupt();
        assert!(!(is_owed && is_late), "the device does not go on with {:x?}", transfer.request);
    }

    /// Begins anew with DATA0 where a confirmed request wants it.
    fn follow_confirmed(&mut self) {
        for (index, side) in self.transfer.begins_anew() {
            self.is_data_1[index][side] = false;
            // An old answer may have confirmed it before the device has carried it out. Then one
            // packet may be lost before that, and another one behind it.
            let losses = &mut self.may_lose[index][side];
            *losses = if self.transfer.is_sound { 0 } else { *losses + 2 };
        }
    }

    /// Breaks off a request behind which packets begin anew, if one is under way, before it
    /// exchanges packets with those endpoints. It is unknown whether the device has carried it out,
    /// or still will.
    fn break_off_anew(&mut self) {
        if !self.transfer.is_over {
            for (index, side) in self.transfer.begins_anew() {
                self.may_lose[index][side] += 1;
                self.transfer.is_over = true;
            }
        }
    }

    /// Notes that a packet was lost, and fails with `fault` if none may be.
    fn lose(&mut self, endpoint: usize, side: usize, fault: &str) {
        let losses = &mut self.may_lose[endpoint][side];
        assert!(*losses > 0, "{fault}");
        *losses -= 1;
    }

    /// Asks another endpoint than the first for a packet. Only the port has any.
    pub fn ask(&mut self, endpoint: usize) -> Result<Vec<u8>, Answer> {
        self.resume();
        self.break_off_anew();
        let (bytes, is_data_1) = match self.twins.ask(endpoint) {
            Answer::Packet { bytes, is_data_1, .. } => (bytes, is_data_1),
            answer => return Err(answer),
        };
        assert_eq!(endpoint, FROM_PORT, "a packet of an endpoint that sends nothing");
        assert_eq!(self.port().sent.get(self.taken), Some(&bytes), "another packet than was sent");
        if is_data_1 == self.is_data_1[endpoint][IN] {
            self.is_data_1[endpoint][IN] = !is_data_1;
            self.taken += 1;
            assert_eq!(self.taken, self.port().sent.len(), "a packet is missing");
            return Ok(bytes);
        }
        self.lose(endpoint, IN, "a packet from the port has the wrong data toggle");
        self.twins.forget_last_sent();
        Ok(Vec::new())
    }

    /// Sends the port a packet.
    pub fn give(&mut self, packet: &[u8]) -> Handshake {
        self.resume();
        self.break_off_anew();
        let is_data_1 = self.is_data_1[TO_PORT][OUT];
        let handshake = self.twins.give(TO_PORT, is_data_1, packet);
        match handshake {
            Handshake::Ack => {
                self.accepted.extend_from_slice(packet);
                self.is_data_1[TO_PORT][OUT] = !is_data_1;
            }
            Handshake::Dropped => {
                self.lose(TO_PORT, OUT, "the port drops a packet that it acknowledges");
                self.is_data_1[TO_PORT][OUT] = !is_data_1;
            }
            Handshake::Nak => {
                let has_room = self.port().waiting().len() <= ROOM_UP_TO;
                let is_idle = !self.port().bus().has_interrupt();
                assert!(!(has_room && is_idle), "the port has room, but takes nothing");
            }
            Handshake::Stall | Handshake::Nothing => {}
        }
        handshake
    }

    /// Makes a whole control transfer, as a host should. `data` follow the request, or are what the
    /// host asks for.
    pub fn transfer(&mut self, request: [u8; 8], data: &[u8]) -> Outcome {
        self.set_up(request);
        self.pause();
        let mut answer = Vec::new();
        if self.transfer.is_in() {
            loop {
                match self.ask_until_answered() {
                    Ok(packet) => {
                        answer.extend_from_slice(&packet);
                        if packet.len() < PACKET || answer.len() >= self.transfer.length() {
                            break;
                        }
                    }
                    Err(Answer::Stall) => return Outcome::Refused,
                    Err(_) => return Outcome::Unanswered,
                }
            }
        }
        let packets =
            if self.transfer.is_in() { vec![&data[..0]] } else { data.chunks(PACKET).collect() };
        for packet in packets {
            match self.give_until_answered(packet) {
                Handshake::Ack | Handshake::Dropped => {}
                Handshake::Stall => return Outcome::Refused,
                Handshake::Nak | Handshake::Nothing => return Outcome::Unanswered,
            }
        }
        if !self.transfer.is_in() {
            match self.ask_until_answered() {
                Ok(_) => {}
                Err(Answer::Stall) => return Outcome::Refused,
                Err(_) => return Outcome::Unanswered,
            }
        }
        Outcome::Done(answer)
    }

    /// Asks endpoint 0 until it answers.
    fn ask_until_answered(&mut self) -> Result<Vec<u8>, Answer> {
        for _ in 0..MOST_TURNS {
            let answer = self.ask_control();
            if answer != Err(Answer::Nak) {
                self.pause();
                return answer;
            }
            self.twins.serve();
        }
        Err(Answer::Nak)
    }

    /// Sends endpoint 0 a packet until it answers.
    fn give_until_answered(&mut self, packet: &[u8]) -> Handshake {
        for _ in 0..MOST_TURNS {
            let handshake = self.give_control(packet);
            if handshake != Handshake::Nak {
                self.pause();
                return handshake;
            }
            self.twins.serve();
        }
        Handshake::Nak
    }

    /// Takes all that the port has to send, and checks that all bytes have arrived on both sides.
    pub fn drain(&mut self) {
        self.twins.set_line_full(false);
        self.settle();
        assert_eq!(self.arrived(), self.accepted.len(), "bytes for the port are missing");
        loop {
            match self.ask(FROM_PORT) {
                Ok(_) => self.settle(),
                Err(Answer::Nak) => break,
                Err(_) => return,
            }
        }
        assert!(!self.port().has_to_send(), "the port keeps bytes back");
        assert_eq!(self.taken, self.port().sent.len(), "bytes from the port are missing");
    }
}
