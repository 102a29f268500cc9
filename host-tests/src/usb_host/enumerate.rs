//! How a host finds the device: its descriptors, its configuration, and the port that it opens.

use super::{FROM_PORT, Host, Outcome};
use crate::usb_controller::Handshake;
use crate::usb_firmware::driver::PACKET;
use crate::usb_reference::{MANUFACTURER, PRODUCT, VENDOR_AND_PRODUCT};

/// Sets the line coding. The data follow: 115200 bits a second, one stop bit, no parity, 8 bits.
const SET_LINE_CODING: [u8; 8] = [0x21, 0x20, 0, 0, 0, 0, 7, 0];

/// The data of [`SET_LINE_CODING`].
const LINE_CODING: [u8; 7] = [0x00, 0xC2, 0x01, 0x00, 0, 0, 8];

/// Kinds of descriptors.
const DEVICE: u8 = 1;
/// See [`DEVICE`].
const CONFIGURATION: u8 = 2;
/// See [`DEVICE`].
const STRING: u8 = 3;
/// See [`DEVICE`].
const CAPABILITIES: u8 = 15;

impl Host<'_> {
    /// Finds the device as real hosts do, and checks that it is complete.
    pub fn enumerate(&mut self, address: u8, number: &str) {
        self.reset();
        assert_eq!(self.port().bus().address(), 0);
        let first = self.answer(DEVICE, 0, 64);
        // Windows and Linux reset the bus once more.
        self.reset();
        assert_eq!(self.transfer([0, 5, address, 0, 0, 0, 0, 0], &[]), Outcome::Done(Vec::new()));
        // The host waits here for 2 ms at least.
        self.settle();
        assert_eq!(self.port().bus().address(), address);

        let device = self.answer(DEVICE, 0, 18);
        assert_eq!(first, device);
        let [vendor, product] = VENDOR_AND_PRODUCT.map(u16::to_le_bytes);
        assert_eq!(device[..8], [18, 1, 0x10, 0x02, 2, 0, 0, 64]);
        assert_eq!(device[8..12], [vendor, product].concat());
        assert_eq!(device[14..], [1, 2, 3, 1]);
        let capabilities = self.answer(CAPABILITIES, 0, 5);
        let length = capabilities[2];
        assert_eq!(self.answer(CAPABILITIES, 0, length).len(), usize::from(length));
        let start = self.answer(CONFIGURATION, 0, 9);
        let configuration = self.answer(CONFIGURATION, 0, start[2]);
        assert_eq!(configuration[..9], start);
        check_configuration(&configuration);
        assert_eq!(self.answer(STRING, 0, 255), [4, STRING, 0x09, 0x04]);
        for (index, text) in [(1, MANUFACTURER), (2, PRODUCT), (3, number)] {
            let mut expected = vec![2 + 2 * text.len() as u8, STRING];
            expected.extend(text.encode_utf16().flat_map(u16::to_le_bytes));
            assert_eq!(self.answer(STRING, index, 255), expected);
        }

        assert_eq!(self.transfer([0, 9, 1, 0, 0, 0, 0, 0], &[]), Outcome::Done(Vec::new()));
        self.settle();
        assert!(self.port().is_up() && !self.port().is_open());
        assert_eq!(self.transfer(SET_LINE_CODING, &LINE_CODING), Outcome::Done(Vec::new()));
        let coding = self.transfer([0xA1, 0x21, 0, 0, 0, 0, 7, 0], &[]);
        assert_eq!(coding, Outcome::Done(LINE_CODING.to_vec()));
        let open = self.transfer([0x21, 0x22, 3, 0, 0, 0, 0, 0], &[]);
        assert_eq!(open, Outcome::Done(Vec::new()));
        self.settle();
        assert!(self.port().is_open());
        self.exchange();
    }

    /// Sends a line to the port and another one back.
    fn exchange(&mut self) {
        self.drain();
        self.twins.forget_received();
        self.accepted.clear();
        let line = self.pattern(100);
        for packet in line.chunks(PACKET) {
            assert_eq!(self.give(packet), Handshake::Ack);
            self.settle();
        }
        assert_eq!(self.port().received, line, "the port has not received the line");
        let reply = self.pattern(2 * PACKET);
        self.twins.write(&reply);
        self.settle();
        // A host waits for further packets until one is not full.
        let (mut heard, mut is_over) = (Vec::new(), true);
        while !is_over || heard.len() < reply.len() {
            let packet = self.ask(FROM_PORT).expect("the rest of the reply");
            is_over = packet.len() < PACKET;
            heard.extend(packet);
            self.settle();
        }
        assert_eq!(heard, reply, "the host has not received the reply");
    }

    /// Asks for a descriptor, which the device must have.
    fn answer(&mut self, kind: u8, index: u8, length: u8) -> Vec<u8> {
        let language = if kind == STRING && index > 0 { [0x09, 0x04] } else { [0, 0] };
        let request = [0x80, 6, index, kind, language[0], language[1], length, 0];
        match self.transfer(request, &[]) {
            Outcome::Done(answer) => answer,
            outcome => panic!("descriptor {kind} {index}: {outcome:?}"),
        }
    }
}

/// Checks that a configuration is whole, and that of a serial port.
fn check_configuration(configuration: &[u8]) {
    assert_eq!(usize::from(configuration[2]), configuration.len());
    assert_eq!(configuration[3..6], [0, 2, 1], "two interfaces in configuration 1");
    let (mut rest, mut parts) = (configuration, Vec::new());
    while let [length, kind, ..] = *rest {
        let (part, behind) = rest.split_at(length.into());
        rest = behind;
        match kind {
            4 => parts.push([part[2], part[4], part[5], part[6]].to_vec()),
            5 => parts.push(part[2..6].to_vec()),
            _ => {}
        }
    }
    assert!(rest.is_empty());
    // The interface of control with its endpoint, and that of data with those of the port.
    let expected =
        [[0, 1, 2, 2], [0x81, 3, 8, 0], [1, 2, 10, 0], [0x82, 2, 64, 0], [0x01, 2, 64, 0]];
    assert_eq!(parts, expected);
}
