//! The Pico's USB device beside the crates `usb-device` and `usbd-serial`, which it replaces: the
//! host sees no difference. [`Twins`] compares the two behind every step.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use penup_host_tests::fuzz_targets::usb;
use penup_host_tests::random::Random;
use penup_host_tests::usb_controller::{Answer, Handshake};
use penup_host_tests::usb_firmware::driver::PACKET;
use penup_host_tests::usb_twins::Twins;
use penup_host_tests::wish::wish;
use std::sync::atomic::{AtomicBool, Ordering};

/// The serial number of most tests, which is as long as the Pico's.
const NUMBER: &str = "E66058388352A52B";
/// Gives the device an address.
const SET_ADDRESS: [u8; 8] = [0x00, 5, 9, 0, 0, 0, 0, 0];
/// Configures the device.
const SET_CONFIGURATION: [u8; 8] = [0x00, 9, 1, 0, 0, 0, 0, 0];
/// Sets the line coding, with seven bytes of data.
const SET_LINE_CODING: [u8; 8] = [0x21, 0x20, 0, 0, 0, 0, 7, 0];
/// Asks for the line coding.
const GET_LINE_CODING: [u8; 8] = [0xA1, 0x21, 0, 0, 0, 0, 7, 0];
/// A program opens the port.
const OPEN: [u8; 8] = [0x21, 0x22, 3, 0, 0, 0, 0, 0];
/// The more usual values of `bmRequestType`.
const USUAL_TYPES: [u8; 8] = [0x00, 0x01, 0x02, 0x21, 0x80, 0x81, 0x82, 0xA1];
/// Values of `bRequest` beside 0 to 0x24.
const FURTHER_REQUESTS: [u8; 6] = [0x30, 0x40, 0x7F, 0x80, 0xFE, 0xFF];
/// Values of `wValue` that mean something, and their neighbours.
const VALUES: [u16; 16] = [
    0, 1, 2, 3, 9, 127, 128, 0x0100, 0x0200, 0x0300, 0x0301, 0x0303, 0x0304, 0x0600, 0x0F00, 0xFFFF,
];
/// Values of `wIndex` that mean something, and their neighbours.
const INDICES: [u16; 11] = [0, 1, 2, 0x80, 0x81, 0x82, 0x83, 255, 256, 0x0409, 0xFF01];
/// Values of `wLength`.
const LENGTHS: [u16; 12] = [0, 1, 2, 6, 7, 18, 64, 67, 127, 128, 129, 0xFFFF];

/// The most packets that the host takes or sends in the data stage of a transfer.
const MOST_PACKETS: usize = 4;

/// The two devices, with a host that does anything, right or wrong.
struct Bench<'b> {
    twins: Twins<'b>,
    /// Whether the host's next packet to the port is DATA1.
    is_data_1: bool,
}

impl<'b> Bench<'b> {
    fn new(twins: Twins<'b>) -> Self {
        Self { twins, is_data_1: false }
    }

    fn reset(&mut self) {
        self.twins.reset_bus();
        self.twins.serve();
        self.is_data_1 = false;
        self.twins.forget_received();
        self.twins.forget_sent();
    }

    /// Brings the devices into one of their three states: default, address, configured.
    fn enter(&mut self, state: usize) {
        self.reset();
        for request in [SET_ADDRESS, SET_CONFIGURATION].iter().take(state) {
            self.transfer(*request, &[]);
        }
        assert!(self.is_in(state), "the devices come into state {state}");
    }

    /// Whether the devices are in this state.
    fn is_in(&self, state: usize) -> bool {
        let port = self.twins.port();
        (port.bus().address() != 0) == (state > 0) && port.is_up() == (state == 2)
    }

    /// Asks endpoint 0 for packets until one is not full. Returns their bytes.
    fn take(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for _ in 0..MOST_PACKETS {
            let Answer::Packet { bytes: packet, .. } = self.twins.ask(0) else { break };
            self.twins.serve();
            bytes.extend_from_slice(&packet);
            if packet.len() < PACKET {
                break;
            }
        }
        bytes
    }

    /// Makes a whole control transfer.
    fn transfer(&mut self, request: [u8; 8], data: &[u8]) -> Vec<u8> {
        self.twins.set_up(request);
        self.twins.serve();
        if request[0] & 0x80 != 0 {
            let answer = self.take();
            self.twins.give(0, true, &[]);
            self.twins.serve();
            return answer;
        }
        for (index, packet) in data.chunks(PACKET).take(MOST_PACKETS).enumerate() {
            if self.twins.give(0, index % 2 == 0, packet) != Handshake::Ack {
                break;
            }
            self.twins.serve();
        }
        self.take()
    }

    /// The same with as many bytes as the request speaks of.
    fn whole_transfer(&mut self, request: [u8; 8]) -> Vec<u8> {
        let length = usize::from(u16::from_le_bytes([request[6], request[7]]));
        let data: Vec<u8> = (0..length.min(4 * PACKET)).map(|index| index as u8).collect();
        self.transfer(request, &data)
    }

    /// Does something at random.
    fn act(&mut self, random: &mut Random) {
        match random.below(26) {
            0..=3 => self.twins.set_up(any_request(random)),
            4..=8 => drop(self.whole_transfer(any_request(random))),
            9 | 10 => {
                let data = pattern(random, 200);
                self.transfer(any_request(random), &data);
            }
            11..=13 => drop(self.twins.ask(0)),
            14..=16 => {
                let data = any_packet(random);
                self.twins.give(0, random.once_in(2), &data);
            }
            17 | 18 => drop(self.twins.ask(2)),
            19..=21 => {
                let data = any_packet(random);
                let is_data_1 = self.is_data_1 ^ random.once_in(16);
                match self.twins.give(1, is_data_1, &data) {
                    Handshake::Ack | Handshake::Dropped => self.is_data_1 = !self.is_data_1,
                    _ => {}
                }
            }
            22 => {
                let data = pattern(random, 256);
                self.twins.write(&data);
            }
            23 => match random.below(6) {
                0 => drop(self.twins.ask(random.below(16) as usize)),
                1 => drop(self.twins.give(random.below(16) as usize, true, &[])),
                2 => self.twins.set_line_full(!self.twins.is_line_full()),
                3 => self.twins.suspend_bus(),
                4 => self.twins.resume_bus(),
                _ => self.twins.set_line_full(false),
            },
            24 => {
                if random.once_in(3) {
                    self.twins.reset_bus();
                    self.is_data_1 = false;
                }
            }
            _ => self.enter(random.below(3) as usize),
        }
        if !random.once_in(3) {
            self.twins.serve();
        }
    }
}

/// Up to `most` bytes.
fn pattern(random: &mut Random, most: u64) -> Vec<u8> {
    let count = random.below(most + 1);
    (0..count).map(|_| random.below(256) as u8).collect()
}

/// A packet, often an empty or a full one.
fn any_packet(random: &mut Random) -> Vec<u8> {
    match random.below(4) {
        0 => Vec::new(),
        1 => vec![random.below(256) as u8; PACKET],
        _ => pattern(random, PACKET as u64),
    }
}

/// A request of a real host, one with a wrong length, one that is made of usual parts, or any.
fn any_request(random: &mut Random) -> [u8; 8] {
    let mut request: [u8; 8] = match random.below(8) {
        0..=4 => usb::REQUESTS[random.below(usb::REQUESTS.len() as u64) as usize],
        5 | 6 => {
            let [value, value_high] = random.one_of(&VALUES).to_le_bytes();
            let [index, index_high] = random.one_of(&INDICES).to_le_bytes();
            let number = random.below(0x25) as u8;
            let kind = random.one_of(&USUAL_TYPES);
            [kind, number, value, value_high, index, index_high, random.below(130) as u8, 0]
        }
        _ => std::array::from_fn(|_| random.below(256) as u8),
    };
    if random.once_in(5) {
        request[6] = random.below(130) as u8;
        request[7] = 0;
    }
    request
}

/// An input of the fuzzer's target: it begins as a host begins in half of the cases, and goes on
/// with what a host does, broken off here and there.
fn any_input(random: &mut Random) -> Vec<u8> {
    let mut input = vec![random.one_of(&[16, 16, 16, 0, 31, 32, 63, 0x50, 0x7F])];
    if random.once_in(2) {
        input.extend(b"ae\x00ae\x02e\x01e\x04e\x06e\x07e\x08e\x0A");
    }
    for _ in 0..random.below(24) {
        let letter = random.one_of(b"aabbbbcccdddeeeeeefffggghiijklmmmnnooooo");
        let case = if random.once_in(4) { 0x20 } else { 0 };
        input.push(letter & !case);
        match letter {
            b'b' | b'd' | b'm' => input.push(random.below(256) as u8),
            b'h' => input.push(random.below(4) as u8),
            b'c' | b'e' => input.push(random.below(16) as u8),
            b'f' | b'n' => input.extend(any_request(random)),
            b'o' => input.extend([random.below(16) as u8, random.below(130) as u8]),
            _ => {}
        }
    }
    input
}

/// Runs `act` with each number below `count`, on all cores.
fn on_all_cores(count: u64, act: impl Fn(u64) + Sync) {
    let cores = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let has_failed = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for core in 0..cores {
            let (act, has_failed) = (&act, &has_failed);
            scope.spawn(move || {
                for number in (core..count).step_by(cores as usize) {
                    if has_failed.load(Ordering::Relaxed) {
                        return;
                    }
                    let fails = Fails { has_failed, number };
                    act(number);
                    std::mem::forget(fails);
                }
            });
        }
    });
}

/// Says which number has failed, when it is dropped.
struct Fails<'a> {
    has_failed: &'a AtomicBool,
    number: u64,
}

impl Drop for Fails<'_> {
    fn drop(&mut self) {
        self.has_failed.store(true, Ordering::Relaxed);
        eprintln!("case {} has failed", self.number);
    }
}

#[test]
fn random_sequences_look_the_same_to_a_host_that_checks_promises() {
    let seed = wish("PENUP_USB_SEED", 1209);
    on_all_cores(wish("PENUP_USB_SEQUENCES", 12_000), |number| {
        usb::fuzz(&any_input(&mut Random::new(seed << 32 | number)));
    });
}

#[test]
fn random_sequences_look_the_same_to_a_host_that_does_anything() {
    let seed = wish("PENUP_USB_SEED", 1210);
    on_all_cores(wish("PENUP_USB_SEQUENCES", 24_000), |number| {
        let mut random = Random::new(seed << 32 | 1 << 31 | number);
        let bus = Twins::allocator();
        let mut bench = Bench::new(Twins::new(&bus, NUMBER));
        if !random.once_in(8) {
            bench.enter(random.below(3) as usize);
        }
        for _ in 0..10 + random.below(60) {
            bench.act(&mut random);
        }
        bench.enter(2);
        assert!(!bench.transfer(GET_LINE_CODING, &[]).is_empty());
    });
}

/// Every `bmRequestType`, in each of the three states of the device.
#[test]
fn every_kind_of_request_gets_the_same_answer_in_each_state() {
    on_all_cores(3 * 256, |number| {
        let (state, kind) = ((number % 3) as usize, (number / 3) as u8);
        let bus = Twins::allocator();
        let mut bench = Bench::new(Twins::new(&bus, NUMBER));
        bench.enter(state);
        let is_usual = USUAL_TYPES.contains(&kind);
        let (values, indices, lengths): (&[u16], &[u16], &[u16]) =
            if is_usual { (&VALUES, &INDICES, &LENGTHS) } else { (&[0, 1], &[0, 1], &[0, 7]) };
        for number in (0..=0x24).chain(FURTHER_REQUESTS) {
            for (value, index) in
                values.iter().flat_map(|value| indices.iter().map(move |index| (value, index)))
            {
                for length in lengths {
                    let [value, index, length] =
                        [value, index, length].map(|word| word.to_le_bytes());
                    bench.whole_transfer([
                        kind, number, value[0], value[1], index[0], index[1], length[0], length[1],
                    ]);
                    if !bench.is_in(state) {
                        bench.enter(state);
                    }
                }
            }
        }
    });
}

/// The data have each length, and the host sends fewer, as many or more of them.
#[test]
fn data_of_each_length_are_taken_the_same_way() {
    let bus = Twins::allocator();
    let mut bench = Bench::new(Twins::new(&bus, NUMBER));
    bench.enter(2);
    let data: Vec<u8> = (0..260).map(|index| (index % 7) as u8).collect();
    for request in [SET_LINE_CODING, [0x21, 0, 0, 0, 0, 0, 0, 0], SET_CONFIGURATION] {
        for length in 0..=129_u8 {
            for sent in 0..=260 {
                let mut request = request;
                request[6] = length;
                bench.transfer(request, &data[..sent]);
            }
        }
    }
}

/// Each answer, asked for with each length, and confirmed after each number of packets.
#[test]
fn answers_of_each_length_are_sent_the_same_way() {
    // A number of more than 63 letters has no room, and gets no answer.
    for letters in 0..70 {
        let number: String = "0123456789".chars().cycle().take(letters).collect();
        let bus = Twins::allocator();
        let mut bench = Bench::new(Twins::new(&bus, &number));
        bench.enter(1);
        for descriptor in [[0, 1], [0, 2], [0, 3], [1, 3], [2, 3], [3, 3], [0, 15]] {
            for length in 0..=255 {
                for packets in 0..4 {
                    let [index, kind] = descriptor;
                    bench.twins.set_up([0x80, 6, index, kind, 0x09, 0x04, length, 0]);
                    bench.twins.serve();
                    for _ in 0..packets {
                        bench.twins.ask(0);
                        bench.twins.serve();
                    }
                    bench.twins.give(0, true, &[]);
                    bench.twins.serve();
                }
            }
        }
    }
}

/// Letters that are not of one byte.
#[test]
fn a_number_of_any_letters_is_the_same() {
    for number in ["", "ß", "Ω№", "\u{1F58A}", "penup \u{1F58A} äöü"] {
        let bus = Twins::allocator();
        let mut bench = Bench::new(Twins::new(&bus, number));
        bench.enter(1);
        let answer = bench.transfer([0x80, 6, 3, 3, 0x09, 0x04, 255, 0], &[]);
        assert_eq!(answer.len(), 2 + 2 * number.encode_utf16().count());
    }
}

#[test]
fn each_line_coding_is_kept_the_same_way() {
    let bus = Twins::allocator();
    let mut bench = Bench::new(Twins::new(&bus, NUMBER));
    bench.enter(2);
    bench.transfer(OPEN, &[]);
    for code in 0..=255 {
        for place in 0..7 {
            let mut data = [0x80, 0x25, 0, 0, 0, 0, 8];
            data[place] = code;
            bench.transfer(SET_LINE_CODING, &data);
            assert_eq!(bench.transfer(GET_LINE_CODING, &[]).len(), 7);
        }
    }
}
