//! The driver of the Pico's USB controller, where a host acts at the worst moment, and what the
//! controller of the tests refuses.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use penup_host_tests::usb_controller::{Answer, Handshake, UsbController};
use penup_host_tests::usb_firmware::driver::{
    Buffers, Bus, Controller, Event, FROM_0, FROM_PORT, PacketError, Register, TO_PORT,
};
use std::sync::atomic::{AtomicU32, Ordering};

/// Asks for the state of the device.
const GET_STATUS: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 2, 0];
/// Configures the device.
const SET_CONFIGURATION: [u8; 8] = [0x00, 9, 1, 0, 0, 0, 0, 0];
/// The bit of a control word with which a buffer belongs to the controller.
const AVAILABLE: u32 = 1 << 10;

/// A controller whose host acts while the driver works: behind one of the driver's readings.
struct Disturbed<F> {
    controller: UsbController,
    /// The readings until the host acts.
    left: AtomicU32,
    act: F,
}

impl<F: Fn(&UsbController)> Disturbed<F> {
    fn count_reading(&self) {
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            (self.act)(&self.controller);
        }
    }
}

impl<F: Fn(&UsbController)> Controller for Disturbed<F> {
    fn get(&self, register: Register) -> u32 {
        let bits = self.controller.get(register);
        self.count_reading();
        bits
    }

    fn put(&self, register: Register, bits: u32) {
        self.controller.put(register, bits);
    }

    fn word(&self, index: usize) -> u32 {
        let word = self.controller.word(index);
        self.count_reading();
        word
    }

    fn put_word(&self, index: usize, word: u32) {
        self.controller.put_word(index, word);
    }

    fn delay(&self, cycles: u32) {
        self.controller.delay(cycles);
    }
}

/// A driver that has just seen the first reset of the bus, and whose host acts behind `readings`
/// further readings.
fn disturbed<F: Fn(&UsbController)>(
    readings: u32,
    before: impl Fn(&Bus<UsbController>),
    act: F,
) -> Bus<Disturbed<F>> {
    let controller = UsbController::default();
    let bus = connected(&controller);
    before(&bus);
    Bus::new(Disturbed { controller, left: AtomicU32::new(readings), act })
}

/// A driver that has just seen the first reset of the bus.
fn connected(controller: &UsbController) -> Bus<UsbController> {
    let bus = Bus::new(controller.clone());
    bus.connect();
    controller.reset_bus();
    assert_eq!(bus.look(), Event::Reset);
    bus.reset();
    bus
}

/// What the driver reports when it looks: the buffers that were taken or filled, and whether there
/// is a request.
fn look<C: Controller>(bus: &Bus<C>) -> (u32, bool) {
    match bus.look() {
        Event::Packets { has_setup, finished } => (finished, has_setup),
        Event::Reset => (0, false),
    }
}

#[test]
fn a_packet_that_is_taken_while_the_driver_looks_is_reported() {
    for readings in 1..=4 {
        let bus = disturbed(
            readings,
            |bus| assert_eq!(bus.write(FROM_PORT, b"ok\r\n"), Ok(())),
            |controller| assert!(matches!(controller.ask(2), Answer::Packet { .. })),
        );
        let taken: u32 = (0..4).map(|_| u32::from(look(&bus).0 == 1 << FROM_PORT)).sum();
        assert_eq!(taken, 1, "behind reading {readings}");
        assert!(!bus.controller().controller.has_interrupt());
    }
}

#[test]
fn a_packet_that_comes_while_the_driver_reads_another_one_is_not_lost() {
    let controller = UsbController::default();
    let bus = connected(&controller);
    let mut into = [0; 64];
    for turn in 0..4_u8 {
        assert_eq!(controller.give(1, turn % 2 == 1, &[turn; 64]), Handshake::Ack);
        assert_eq!(controller.give(1, turn % 2 == 0, &[turn; 64]), Handshake::Nak);
        assert_eq!(look(&bus), (1 << TO_PORT, false));
        assert_eq!(bus.read(TO_PORT, &mut into), Ok(64));
        assert_eq!(into, [turn; 64]);
        assert_eq!(bus.read(TO_PORT, &mut into), Err(PacketError::WouldBlock));
    }
}

#[test]
fn a_request_that_comes_while_another_one_is_read_is_read_whole() {
    for readings in 1..=12 {
        let bus = disturbed(
            readings,
            |bus| bus.controller().set_up(GET_STATUS),
            |controller| controller.set_up(SET_CONFIGURATION),
        );
        let mut requests = Vec::new();
        for _ in 0..6 {
            if look(&bus).1 {
                requests.extend(bus.read_setup());
            }
        }
        assert_eq!(requests.pop(), Some(SET_CONFIGURATION), "behind reading {readings}");
        assert!(requests.iter().all(|request| *request == GET_STATUS), "{requests:?}");
    }
}

#[test]
fn a_request_from_before_a_reset_is_forgotten_if_the_device_had_an_address() {
    for address in [0, 5] {
        let controller = UsbController::default();
        let bus = connected(&controller);
        bus.set_address(address);
        controller.set_up(SET_CONFIGURATION);
        controller.reset_bus();
        assert_eq!(bus.look(), Event::Reset);
        bus.reset();
        // Without an address, the request may have come behind the reset.
        assert_eq!(look(&bus), (0, address == 0));
        assert_eq!(controller.address(), 0);
    }
}

#[test]
fn an_answer_leaves_no_room_for_data_in_its_memory() {
    let controller = UsbController::default();
    let bus = connected(&controller);
    controller.set_up(GET_STATUS);
    assert_eq!(look(&bus), (0, true));
    assert_eq!(bus.read_setup(), Some(GET_STATUS));
    assert_eq!(bus.write(FROM_0, &[1, 0]), Ok(()));
    assert_eq!(controller.give(0, true, &[0xEE; 2]), Handshake::Nothing);
    let answer = Answer::Packet { bytes: vec![1, 0], is_data_1: true, is_current: true };
    assert_eq!(controller.ask(0), answer);
    assert_eq!(controller.give(0, true, &[]), Handshake::Ack);
}

#[test]
#[should_panic(expected = "AVAILABLE must come alone")]
fn the_controller_refuses_a_buffer_that_comes_with_its_control_word() {
    let controller = UsbController::default();
    connected(&controller);
    let control = 0x90 / 4;
    controller.put_word(control, 0);
    controller.delay(12);
    controller.put_word(control, AVAILABLE | 1 << 15 | 4);
}

#[test]
#[should_panic(expected = "is available too early")]
fn the_controller_refuses_a_buffer_that_comes_too_early() {
    let controller = UsbController::default();
    connected(&controller);
    let control = 0x90 / 4;
    controller.put_word(control, 1 << 15 | 4);
    controller.put_word(control, AVAILABLE | 1 << 15 | 4);
}

#[test]
#[should_panic(expected = "the controller has the buffer of word")]
fn the_controller_refuses_writes_to_its_buffers() {
    let controller = UsbController::default();
    let bus = connected(&controller);
    assert_eq!(bus.write(FROM_PORT, b"ok\r\n"), Ok(()));
    controller.put_word((0x100 + 4 * 64) / 4, 0);
}

#[test]
#[should_panic(expected = "the controller has buffer 4")]
fn the_controller_refuses_another_length_of_a_packet_that_it_has() {
    let controller = UsbController::default();
    let bus = connected(&controller);
    assert_eq!(bus.write(FROM_PORT, b"ok\r\n"), Ok(()));
    let word = Buffers(controller.clone()).control(4);
    controller.put_word(0x90 / 4, word + 1);
}
