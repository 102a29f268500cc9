//! Packets of a USB host, in any order.

use crate::usb_firmware::driver::PACKET;
use crate::usb_host::{FROM_PORT, Host};
use crate::usb_twins::Twins;

/// Requests that real hosts make, and some that they might make.
pub const REQUESTS: [[u8; 8]; 16] = [
    [0x80, 6, 0, 1, 0, 0, 64, 0], // 0: the device descriptor, before its length is known
    [0x80, 6, 0, 1, 0, 0, 18, 0], // 1: the device descriptor
    [0x00, 5, 7, 0, 0, 0, 0, 0],  // 2: set address
    [0x80, 6, 0, 2, 0, 0, 9, 0],  // 3: the configuration descriptor's beginning
    [0x80, 6, 0, 2, 0, 0, 255, 0], // 4: the configuration descriptor
    [0x80, 6, 0, 3, 0, 0, 255, 0], // 5: the languages
    [0x80, 6, 3, 3, 9, 4, 255, 0], // 6: the serial number
    [0x00, 9, 1, 0, 0, 0, 0, 0],  // 7: set configuration
    [0x21, 0x20, 0, 0, 0, 0, 7, 0], // 8: set line coding
    [0xA1, 0x21, 0, 0, 0, 0, 7, 0], // 9: get line coding
    [0x21, 0x22, 3, 0, 0, 0, 0, 0], // : a program opens the port
    [0x21, 0x22, 0, 0, 0, 0, 0, 0], // ; a program closes the port
    [0x02, 3, 0, 0, 0x82, 0, 0, 0], // < halt the port's endpoint to the host
    [0x02, 1, 0, 0, 0x82, 0, 0, 0], // = lift that halt
    [0x80, 0, 0, 0, 0, 0, 2, 0],  // > get status
    [0x21, 0x00, 0, 0, 0, 0, 100, 0], // ? a request with more than one packet of data
];

/// Lets a host do what the input says, and then find the device, as real hosts do. It does the same
/// to the reference device, from which the Pico's must not differ.
///
/// The first byte is the number of digits of the serial number (the Pico's has 16; others make
/// answers of whole packets); if its seventh bit is set, the host that finds the device at the end
/// does not wait for it. Each further byte is an action, by its lower four bits, so that letters
/// serve. Behind a capital letter the device does not get to work before the next action.
///
/// | letter | action | bytes behind it |
/// |---|---|---|
/// | p | nothing | |
/// | a | the bus is reset | |
/// | b | a packet is sent to the port | its length |
/// | c | a SETUP packet | the number of the request in `REQUESTS` |
/// | d | a packet is sent to endpoint 0 | its length |
/// | e | a whole control transfer | the number of the request |
/// | f | a whole control transfer | the request |
/// | g | endpoint 0 is asked for a packet | |
/// | h | another endpoint is asked for a packet | its number |
/// | i | the port is asked for all it has | |
/// | j | the queue of the line becomes full, or empty again | |
/// | k | the bus is suspended | |
/// | l | the bus is resumed | |
/// | m | the port is to send bytes | their number |
/// | n | a SETUP packet | the request |
/// | o | a whole control transfer with another length | the number of the request, the length |
pub fn fuzz(input: &[u8]) {
    let Some((first, rest)) = input.split_first() else { return };
    let number: String = (0..first % 64).map(|digit| char::from(b'0' + digit % 10)).collect();
    let bus = Twins::allocator();
    let mut host = Host::new(Twins::new(&bus, &number));
    let mut rest = rest.iter().copied();
    while let Some(action) = rest.next() {
        host.is_hasty = action & 0x20 == 0;
        act(&mut host, action, &mut rest);
        host.pause();
    }
    host.is_hasty = first & 0x40 != 0;
    host.drain();
    host.enumerate(5, &number);
}

/// Lets the host do one thing.
fn act(host: &mut Host<'_>, action: u8, rest: &mut impl Iterator<Item = u8>) {
    let mut byte = || rest.next().unwrap_or(0);
    match action % 16 {
        1 => host.reset(),
        2 => {
            let packet = host.pattern(usize::from(byte()) % (PACKET + 1));
            host.give(&packet);
        }
        3 => host.set_up(known(byte())),
        4 => {
            let packet = host.pattern(usize::from(byte()) % (PACKET + 1));
            host.give_control(&packet);
        }
        5 => transfer(host, known(byte())),
        6 => transfer(host, std::array::from_fn(|_| byte())),
        7 => drop(host.ask_control()),
        8 => drop(host.ask(1 + usize::from(byte()) % 15)),
        9 => {
            while host.ask(FROM_PORT).is_ok() {
                host.pause();
            }
        }
        10 => host.twins.set_line_full(!host.twins.is_line_full()),
        11 => host.suspend(),
        12 => host.resume(),
        13 => {
            let bytes = host.pattern(byte().into());
            host.twins.write(&bytes);
        }
        14 => host.set_up(std::array::from_fn(|_| byte())),
        15 => {
            let mut request = known(byte());
            request[6] = byte();
            transfer(host, request);
        }
        _ => {}
    }
}

/// A request of `REQUESTS`.
fn known(number: u8) -> [u8; 8] {
    REQUESTS[usize::from(number) % REQUESTS.len()]
}

/// Makes a whole control transfer, with the data of which the request speaks.
fn transfer(host: &mut Host<'_>, request: [u8; 8]) {
    let is_in = request[0] & 0x80 != 0;
    let length = usize::from(u16::from_le_bytes([request[6], request[7]]));
    let data = host.pattern(if is_in { 0 } else { length });
    host.transfer(request, &data);
}
