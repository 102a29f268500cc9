//! What the device tells the host about itself (USB 2.0, section 9.6).
//!
//! The string descriptors are in English only.

use super::super::driver::{NOTICE, PACKET};

/// The USB number for tests and for projects without a number of their own:
/// <https://pid.codes/1209/0001>.
const VENDOR: [u8; 2] = 0x1209_u16.to_le_bytes();
/// See [`VENDOR`].
const PRODUCT: [u8; 2] = 0x0001_u16.to_le_bytes();
/// The version of the device, in binary-coded decimal: 0.10.
const RELEASE: [u8; 2] = [0x10, 0x00];
/// The version of USB with which descriptors of kind [`BOS`] came, 2.1, in binary-coded decimal.
const USB_VERSION: [u8; 2] = [0x10, 0x02];
/// The version of the class, 1.10, in binary-coded decimal.
const CDC_VERSION: [u8; 2] = [0x10, 0x01];

/// Kinds of descriptors: `bDescriptorType`.
mod kind {
    /// The device.
    pub const DEVICE: u8 = 1;
    /// The configuration, with its interfaces and endpoints.
    pub const CONFIGURATION: u8 = 2;
    /// A text, or the languages in which there are texts.
    pub const STRING: u8 = 3;
    /// An interface.
    pub const INTERFACE: u8 = 4;
    /// An endpoint.
    pub const ENDPOINT: u8 = 5;
    /// The Binary Object Store: the device's capabilities.
    pub const BOS: u8 = 15;
    /// A capability of the device.
    pub const DEVICE_CAPABILITY: u8 = 16;
    /// A descriptor of the class, for its interface.
    pub const CS_INTERFACE: u8 = 0x24;
}
use kind::BOS;

/// The classes of the device and of its interfaces: `bDeviceClass` and `bInterfaceClass`.
mod class {
    /// Communication.
    pub const CDC: u8 = 0x02;
    /// Data of a communication device.
    pub const CDC_DATA: u8 = 0x0A;
    /// The subclass: Abstract Control Model.
    pub const ACM: u8 = 0x02;
}

/// Kinds of descriptors of the class: `bDescriptorSubtype`.
mod cdc {
    /// The first one.
    pub const HEADER: u8 = 0;
    /// Calls are handled by the host alone.
    pub const CALL_MANAGEMENT: u8 = 1;
    /// The requests that the port takes.
    pub const ACM: u8 = 2;
    /// Which interfaces belong together.
    pub const UNION: u8 = 6;
}

/// The numbers of the string descriptors.
mod string {
    /// The languages.
    pub const LANGUAGES: u8 = 0;
    /// The maker.
    pub const MANUFACTURER: u8 = 1;
    /// The product.
    pub const PRODUCT: u8 = 2;
    /// The device's number.
    pub const SERIAL_NUMBER: u8 = 3;
}

/// The maker's name.
const MANUFACTURER_NAME: &str = "penup";
/// The product's name.
const PRODUCT_NAME: &str = "penup pen plotter";
/// The language of the strings: English of the United States.
const ENGLISH: u16 = 0x0409;

/// The interface to which the requests of the class go.
pub const CONTROL_INTERFACE: u16 = 0;
/// The interface to which the endpoints of the port belong.
pub const DATA_INTERFACE: u16 = 1;
/// The number of the only configuration: `bConfigurationValue`.
pub const CONFIGURATION: u16 = 1;

/// How the packets of an endpoint go: `bmAttributes`.
mod transfer {
    /// A stream of bytes.
    pub const BULK: u8 = 2;
    /// The host asks for them at intervals.
    pub const INTERRUPT: u8 = 3;
}

/// The device descriptor.
const DEVICE: [u8; 18] = [
    18,
    kind::DEVICE,
    USB_VERSION[0],
    USB_VERSION[1],
    class::CDC,
    0, // no subclass
    0, // no protocol
    PACKET as u8,
    VENDOR[0],
    VENDOR[1],
    PRODUCT[0],
    PRODUCT[1],
    RELEASE[0],
    RELEASE[1],
    string::MANUFACTURER,
    string::PRODUCT,
    string::SERIAL_NUMBER,
    1, // configuration
];

/// The configuration descriptor, and those that come with it.
#[rustfmt::skip]
const CONFIGURATION_DESCRIPTOR: [u8; 67] = [
    // The configuration: its whole length, two interfaces, its number, no name, powered by the bus,
    // 100 mA in steps of two.
    9, kind::CONFIGURATION, 67, 0, 2, CONFIGURATION as u8, 0, 0x80, 50,
    // The interface of control: its number, no other setting, one endpoint, its class, no name.
    9, kind::INTERFACE, CONTROL_INTERFACE as u8, 0, 1, class::CDC, class::ACM, 0, 0,
    5, kind::CS_INTERFACE, cdc::HEADER, CDC_VERSION[0], CDC_VERSION[1],
    4, kind::CS_INTERFACE, cdc::ACM, 0,
    5, kind::CS_INTERFACE, cdc::UNION, CONTROL_INTERFACE as u8, DATA_INTERFACE as u8,
    5, kind::CS_INTERFACE, cdc::CALL_MANAGEMENT, 0, DATA_INTERFACE as u8,
    // Its endpoint, for notices: every 255 ms.
    7, kind::ENDPOINT, 0x81, transfer::INTERRUPT, NOTICE as u8, 0, 255,
    // The interface of data: its number, no other setting, two endpoints, its class, no name.
    9, kind::INTERFACE, DATA_INTERFACE as u8, 0, 2, class::CDC_DATA, 0, 0, 0,
    // Its endpoints.
    7, kind::ENDPOINT, 0x82, transfer::BULK, PACKET as u8, 0, 0,
    7, kind::ENDPOINT, 0x01, transfer::BULK, PACKET as u8, 0, 0,
];

/// The capabilities: that of USB 2.0, with no further power saving.
#[rustfmt::skip]
const BINARY_OBJECT_STORE: [u8; 12] = [
    5, BOS, 12, 0, 1,
    7, kind::DEVICE_CAPABILITY, 2, 0, 0, 0, 0,
];

/// The languages of the strings.
const LANGUAGES: [u8; 4] = [4, kind::STRING, ENGLISH.to_le_bytes()[0], ENGLISH.to_le_bytes()[1]];

/// A descriptor.
pub enum Descriptor<'n> {
    /// Its bytes.
    Bytes(&'static [u8]),
    /// A string descriptor with this text.
    Text(&'n str),
}

/// The descriptor for which a request asks: by its `wValue`, which has the kind and the number of
/// the descriptor, and its `wIndex`, which has the language.
pub fn find(value: u16, index: u16, serial_number: &str) -> Option<Descriptor<'_>> {
    let [number, kind] = value.to_le_bytes();
    Some(match (kind, number) {
        (kind::DEVICE, _) => Descriptor::Bytes(&DEVICE),
        (kind::CONFIGURATION, _) => Descriptor::Bytes(&CONFIGURATION_DESCRIPTOR),
        (BOS, _) => Descriptor::Bytes(&BINARY_OBJECT_STORE),
        (kind::STRING, string::LANGUAGES) => Descriptor::Bytes(&LANGUAGES),
        (kind::STRING, _) if index != ENGLISH => return None,
        (kind::STRING, string::MANUFACTURER) => Descriptor::Text(MANUFACTURER_NAME),
        (kind::STRING, string::PRODUCT) => Descriptor::Text(PRODUCT_NAME),
        (kind::STRING, string::SERIAL_NUMBER) => Descriptor::Text(serial_number),
        _ => return None,
    })
}

/// The bytes of a string descriptor: UTF-16, behind its length and kind.
pub fn string_bytes(text: &str) -> impl Iterator<Item = u8> {
    let letters = text.encode_utf16();
    let length = 2 + 2 * letters.clone().count();
    [length as u8, kind::STRING].into_iter().chain(letters.flat_map(u16::to_le_bytes))
}
