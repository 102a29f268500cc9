//! The driver and the device of the Pico's USB port: the very files of the firmware.

#[path = "../../src/boards/pico/usb/device/mod.rs"]
pub mod device;
#[path = "../../src/boards/pico/usb/driver/mod.rs"]
pub mod driver;
