//! The RP2040's USB controller as a device, in plain memory (data sheet, section 4.1).
//!
//! One side of it is the program's: the registers and the memory that the driver
//! ([`driver`](crate::usb_firmware::driver)) uses. The other side is the host's end of the cable. A
//! packet of the device stays until the host takes it. A SETUP packet is always accepted, and lifts
//! the stall of endpoint 0; what that endpoint held goes only when the driver sees the SETUP
//! packet, as on the chip. A received packet whose data toggle is not the expected one is
//! acknowledged and dropped, as USB 2.0 wants it (section 8.6.3), and one that is longer than its
//! buffer is not answered; the data sheet does not say.
//!
//! It panics where a driver does what the chip may not bear: see [`Controller::put_word`] here.
//!
//! What is left out: time, and the errata E5 and E15, which the emulated Pico has.

use crate::usb_firmware::driver::{Controller, Register};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The number of words of the memory.
const WORDS: usize = 1024;
/// The number of buffers.
const BUFFERS: usize = 32;
/// The word of the memory at which the control words of the buffers begin.
const CONTROL_WORDS: usize = 0x80 / 4;
/// The word of the memory at which endpoint 0 has its buffer.
const PACKETS: usize = 0x100 / 4;
/// The number of words of a buffer.
const BUFFER_WORDS: usize = 64 / 4;
/// The cycles of the core that must pass before a buffer becomes available. The Pico SDK waits as
/// long.
const SETTLING: u32 = 12;

/// Bits of the control word of a buffer.
const LENGTH: u32 = 0x3FF;
/// See [`LENGTH`].
const AVAILABLE: u32 = 1 << 10;
/// See [`LENGTH`].
const STALL: u32 = 1 << 11;
/// See [`LENGTH`].
const IS_DATA_1: u32 = 1 << 13;
/// See [`LENGTH`].
const FULL: u32 = 1 << 15;

/// Bits of the control word of an endpoint.
const ENABLED: u32 = 1 << 31;
/// See [`ENABLED`].
const INTERRUPT_PER_BUFFER: u32 = 1 << 29;

/// In SIE_CTRL: each buffer of endpoint 0 is reported.
const EP0_INT_1BUF: u32 = 1 << 29;
/// The registers and bits without which a host finds no device.
const CONNECTED: [(Register, u32); 4] = [
    (Register::MainCtrl, 1),
    (Register::SieCtrl, 1 << 16),
    (Register::UsbMuxing, 1 | 1 << 3),
    (Register::UsbPwr, 1 << 2 | 1 << 3),
];

/// Bits of SIE_STATUS.
const SUSPENDED: u32 = 1 << 4;
/// See [`SUSPENDED`].
const RESUME: u32 = 1 << 11;
/// See [`SUSPENDED`].
const SETUP_REC: u32 = 1 << 17;
/// See [`SUSPENDED`].
const BUS_RESET: u32 = 1 << 19;
/// The interrupts that bits of SIE_STATUS raise.
const RAISED: [(u32, u32); 4] =
    [(BUS_RESET, 1 << 12), (SUSPENDED, 1 << 14), (RESUME, 1 << 15), (SETUP_REC, 1 << 16)];
/// The interrupt for a buffer that the host has taken or filled.
const BUFF_STATUS: u32 = 1 << 4;

/// The controller, with the cable at its other end.
#[derive(Clone, Default)]
pub struct UsbController(Arc<Mutex<State>>);

/// What a device answers a host that asks for a packet.
#[derive(Debug, PartialEq, Eq)]
pub enum Answer {
    /// A packet, which the host acknowledges.
    Packet {
        /// Its data.
        bytes: Vec<u8>,
        /// Whether its data toggle is DATA1.
        is_data_1: bool,
        /// Whether it was written after the driver had seen the last SETUP packet.
        is_current: bool,
    },
    /// Nothing yet.
    Nak,
    /// The endpoint is halted.
    Stall,
    /// There is no such endpoint.
    Nothing,
}

/// What a device answers a host that has sent a packet.
#[derive(Debug, PartialEq, Eq)]
pub enum Handshake {
    /// The packet is accepted.
    Ack,
    /// The packet is acknowledged, but the device takes it for a repeated one and drops it.
    Dropped,
    /// There is no room yet.
    Nak,
    /// The endpoint is halted.
    Stall,
    /// There is no such endpoint, or the packet is longer than its buffer.
    Nothing,
}

/// The registers and the memory.
struct State {
    /// The registers that keep what was written to them, in the order of [`Register`].
    registers: [u32; 10],
    memory: [u32; WORDS],
    status: u32,
    /// One bit for each buffer that the host has taken or filled.
    finished: u32,
    /// For each buffer, the cycles for which its control word has not changed.
    settled: [u32; BUFFERS],
    /// The number of SETUP packets that have come.
    setups: u32,
    /// For each buffer, that number when it became available.
    setups_before: [u32; BUFFERS],
}

impl Default for State {
    /// After a reset. The memory holds anything.
    fn default() -> Self {
        Self {
            registers: [0; 10],
            memory: std::array::from_fn(|index| 0x9E37_79B9_u32.wrapping_mul(index as u32)),
            status: 0,
            finished: 0,
            settled: [0; BUFFERS],
            setups: 0,
            setups_before: [0; BUFFERS],
        }
    }
}

impl State {
    fn register(&self, register: Register) -> u32 {
        self.registers[register as usize]
    }

    /// The interrupts that are due.
    fn due(&self) -> u32 {
        let is_raised = |(bit, _): &&(u32, u32)| self.status & bit != 0;
        let due = RAISED.iter().filter(is_raised).fold(0, |due, (_, bit)| due | bit);
        if self.finished == 0 { due } else { due | BUFF_STATUS }
    }

    /// The control word of a buffer.
    fn control(&self, buffer: usize) -> u32 {
        self.memory[CONTROL_WORDS + buffer]
    }

    /// The words of the memory in which a buffer lies.
    fn place(&self, buffer: usize) -> std::ops::Range<usize> {
        let first = if buffer < 2 { PACKETS } else { (self.memory[buffer] & 0xFFC0) as usize / 4 };
        first..first + BUFFER_WORDS
    }

    /// Whether the endpoint of this buffer answers the host.
    fn answers(&self, buffer: usize) -> bool {
        let is_on =
            CONNECTED.iter().all(|(register, bits)| self.register(*register) & bits == *bits);
        is_on && (buffer < 2 || self.memory[buffer] & ENABLED != 0)
    }

    /// Whether this buffer answers STALL.
    fn stalls(&self, buffer: usize) -> bool {
        let is_armed = buffer >= 2 || self.register(Register::EpStallArm) & 1 << buffer != 0;
        is_armed && self.control(buffer) & STALL != 0
    }

    /// The host has taken or filled a buffer, whose control word is this afterwards.
    fn finish(&mut self, buffer: usize, word: u32) {
        self.memory[CONTROL_WORDS + buffer] = word;
        let (word, bit) = match buffer {
            0 | 1 => (self.register(Register::SieCtrl), EP0_INT_1BUF),
            _ => (self.memory[buffer], INTERRUPT_PER_BUFFER),
        };
        if word & bit != 0 {
            self.finished |= 1 << buffer;
        }
    }
}

/// The host's end of the cable.
impl UsbController {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a SETUP packet, which every device acknowledges.
    pub fn set_up(&self, request: [u8; 8]) {
        let mut state = self.state();
        let [a, b, c, d, e, f, g, h] = request;
        state.memory[0] = u32::from_le_bytes([a, b, c, d]);
        state.memory[1] = u32::from_le_bytes([e, f, g, h]);
        state.status |= SETUP_REC;
        state.registers[Register::EpStallArm as usize] = 0;
        state.setups += 1;
    }

    /// Whether the driver has not seen the last SETUP packet.
    pub fn has_setup(&self) -> bool {
        self.state().status & SETUP_REC != 0
    }

    /// Asks an endpoint for a packet.
    pub fn ask(&self, endpoint: usize) -> Answer {
        let (mut state, buffer) = (self.state(), 2 * endpoint);
        if !state.answers(buffer) {
            return Answer::Nothing;
        }
        if state.stalls(buffer) {
            return Answer::Stall;
        }
        let word = state.control(buffer);
        if word & (AVAILABLE | FULL) != AVAILABLE | FULL {
            return Answer::Nak;
        }
        let words = &state.memory[state.place(buffer)];
        let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.truncate((word & LENGTH) as usize);
        let is_current = state.setups_before[buffer] == state.setups;
        state.finish(buffer, word & !(AVAILABLE | FULL));
        Answer::Packet { bytes, is_data_1: word & IS_DATA_1 != 0, is_current }
    }

    /// Sends an endpoint a packet.
    pub fn give(&self, endpoint: usize, is_data_1: bool, packet: &[u8]) -> Handshake {
        let (mut state, buffer) = (self.state(), 2 * endpoint + 1);
        if !state.answers(buffer) {
            return Handshake::Nothing;
        }
        if state.stalls(buffer) {
            return Handshake::Stall;
        }
        let word = state.control(buffer);
        if word & AVAILABLE == 0 {
            return Handshake::Nak;
        }
        let length = packet.len() as u32;
        if length > word & LENGTH {
            return Handshake::Nothing;
        }
        if (word & IS_DATA_1 != 0) != is_data_1 {
            return Handshake::Dropped;
        }
        let place = state.place(buffer);
        for (word, bytes) in state.memory[place].iter_mut().zip(packet.chunks(4)) {
            let mut whole = word.to_le_bytes();
            whole[..bytes.len()].copy_from_slice(bytes);
            *word = u32::from_le_bytes(whole);
        }
        state.finish(buffer, word & !(AVAILABLE | LENGTH) | FULL | length);
        Handshake::Ack
    }

    /// Begins and ends a reset of the bus.
    pub fn reset_bus(&self) {
        self.state().status |= BUS_RESET;
    }

    /// Suspends the bus.
    pub fn suspend_bus(&self) {
        self.state().status |= SUSPENDED;
    }

    /// Resumes the bus.
    pub fn resume_bus(&self) {
        self.state().status |= RESUME;
    }

    /// The address to which the device answers.
    pub fn address(&self) -> u8 {
        self.state().register(Register::AddrEndp) as u8
    }

    /// What the host can see that is not the same in another controller: all registers and the
    /// whole memory are compared.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let (state, other) = (self.state(), other.state());
        if state.memory != other.memory {
            let words = state.memory.iter().zip(&other.memory).enumerate();
            let differing: Vec<String> = words
                .filter(|(_, (word, other))| word != other)
                .map(|(index, (word, other))| format!("{index}: {word:08x} {other:08x}"))
                .collect();
            return Some(format!("the words {}", differing.join(", ")));
        }
        let registers = (state.registers, state.status, state.finished);
        let others = (other.registers, other.status, other.finished);
        (registers != others).then(|| format!("the registers {registers:x?} and {others:x?}"))
    }

    /// Whether the controller interrupts the processor.
    pub fn has_interrupt(&self) -> bool {
        let state = self.state();
        state.due() & state.register(Register::Inte) != 0
    }
}

/// The program's side. Each method panics where the chip might not do what the driver wants.
impl Controller for UsbController {
    fn get(&self, register: Register) -> u32 {
        let state = self.state();
        match register {
            Register::SieStatus => state.status,
            Register::BuffStatus => state.finished,
            Register::Intr => state.due(),
            _ => state.register(register),
        }
    }

    fn put(&self, register: Register, bits: u32) {
        let mut state = self.state();
        match register {
            Register::SieStatus => state.status &= !bits,
            Register::BuffStatus => state.finished &= !bits,
            Register::Intr => panic!("this register can only be read"),
            _ => state.registers[register as usize] = bits,
        }
    }

    fn word(&self, index: usize) -> u32 {
        self.state().memory[index]
    }

    /// Writes a word of the memory.
    ///
    /// # Panics
    /// If the controller has the buffer that is written to, if a buffer becomes available before
    /// the controller has seen the rest of its control word, or if that buffer lies nowhere.
    fn put_word(&self, index: usize, word: u32) {
        let mut state = self.state();
        let before = std::mem::replace(&mut state.memory[index], word);
        if index >= PACKETS {
            let has = |buffer: &usize| {
                let word = state.control(*buffer);
                let place = state.place(*buffer).take((word & LENGTH).div_ceil(4) as usize);
                word & AVAILABLE != 0 && place.into_iter().any(|place| place == index)
            };
            let owner = (0..BUFFERS).find(has);
            assert_eq!(owner, None, "the controller has the buffer of word {index}");
        } else if index >= CONTROL_WORDS {
            let buffer = index - CONTROL_WORDS;
            if word & AVAILABLE == 0 {
                state.settled[buffer] = 0;
                return;
            }
            if before & AVAILABLE != 0 {
                let is_same = (word ^ before) & !(STALL | IS_DATA_1) == 0;
                assert!(is_same, "the controller has buffer {buffer}");
                return;
            }
            assert_eq!(word & !AVAILABLE, before, "buffer {buffer}: AVAILABLE must come alone");
            assert!(state.settled[buffer] >= SETTLING, "buffer {buffer} is available too early");
            let place = state.place(buffer);
            let least = if buffer < 2 { PACKETS } else { PACKETS + 2 * BUFFER_WORDS };
            assert!(place.start >= least && place.end <= WORDS, "buffer {buffer} lies nowhere");
            state.setups_before[buffer] = state.setups;
        }
    }

    fn delay(&self, cycles: u32) {
        let mut state = self.state();
        state.settled.iter_mut().for_each(|settled| *settled = settled.saturating_add(cycles));
    }
}
