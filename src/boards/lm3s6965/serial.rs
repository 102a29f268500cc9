//! The serial line: UART0.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use lm3s6965::{Interrupt, interrupt};
use penup::protocol::RealTime;

use super::registers::{GPIO_A, SYSTEM_CONTROL, UART0};
use super::{HAPPENED, clock, critical};
use crate::boards::handler::Owned;
use crate::boards::line::{self, ReceiveMerge, Shared};

/// The registers that are used here besides those of the UART, by their offset in bytes.
mod offset {
    use crate::boards::peripheral::Offset;

    /// The register of system control that switches the clocks of the UARTs on.
    pub const UART_CLOCKS: Offset = Offset::new(0x104);
    /// The register of system control that switches the clocks of the ports on.
    pub const GPIO_CLOCKS: Offset = Offset::new(0x108);
    /// The register that says, by one bit for each pin, which pins of port A a peripheral such as
    /// the UART uses.
    pub const ALTERNATE_FUNCTION: Offset = Offset::new(0x420);
    /// The register that says, by one bit for each pin, which pins of port A are digital.
    pub const DIGITAL_ENABLE: Offset = Offset::new(0x51C);
}
/// The bits of the two pins of the serial line, in port A.
const SERIAL_PINS: u32 = 0b11;

/// The time at which the last `?` came, in cycles modulo 2^24.
static STATUS_REQUESTED: AtomicU32 = AtomicU32::new(0);

/// The data that the handler and the main loop share.
static SHARED: Shared = Shared::new();
/// The end of the line into which the interrupt puts received bytes.
static RECEIVE_MERGE: Owned<ReceiveMerge> = Owned::empty();

/// The main loop's side of the line, from which it reads bytes.
pub struct Serial(line::SerialInput);

/// Sets up UART0 and its pins, and lets bytes be received.
pub fn set_up(nvic: &mut NVIC) -> Serial {
    SYSTEM_CONTROL.set_bits(offset::UART_CLOCKS, 1);
    SYSTEM_CONTROL.set_bits(offset::GPIO_CLOCKS, 1);
    // The port responds three cycles after its clock is on; this read takes longer.
    SYSTEM_CONTROL.read(offset::GPIO_CLOCKS);
    GPIO_A.set_bits(offset::ALTERNATE_FUNCTION, SERIAL_PINS);
    GPIO_A.set_bits(offset::DIGITAL_ENABLE, SERIAL_PINS);

    UART0.set_up(clock::HERTZ);
    UART0.interrupt_when_received();

    let (receive_merge, line) = SHARED.ends();
    // SAFETY: the interrupt is masked since reset, and this runs once (the queue's cell ensures
    // it).
    unsafe { RECEIVE_MERGE.fill(receive_merge) };
    critical::enable(nvic, Interrupt::UART0, critical::SERIAL_PRIORITY);
    UART0.enable();
    Serial(line)
}

impl Serial {
    /// Returns the next byte that is not a real-time byte: see [`line::SerialInput::read_byte`].
    pub fn read_byte(&mut self) -> Option<u8> {
        self.0.read_byte()
    }

    /// How many more bytes fit into the queue.
    pub fn receive_room(&self) -> usize {
        self.0.room()
    }

    /// Takes the real-time requests received since the last call (see [`line::take_real_time`]),
    /// and logs how long a request for the status has waited.
    pub fn take_real_time(&mut self) -> RealTime {
        let requests = line::take_real_time(core::slice::from_mut(&mut self.0));
        if requests.has(RealTime::STATUS) {
            let waited = clock::cycles_24().wrapping_sub(STATUS_REQUESTED.load(Ordering::Relaxed));
            let microseconds = (waited & clock::CYCLE_MASK) / (clock::HERTZ / 1_000_000);
            defmt::debug!("status after {=u32} us", microseconds);
        }
        requests
    }
}

/// The interrupt for received bytes. Real-time bytes act here; the others go into the queue.
#[interrupt]
fn UART0() {
    UART0.clear_interrupt();
    // SAFETY: this is the handler that owns it.
    if let Some(receive_merge) = unsafe { RECEIVE_MERGE.get() } {
        while let Some(data) = UART0.poll() {
            let requests = receive_merge.receiver.receive_from_uart(data);
            if requests.has(RealTime::STATUS) {
                STATUS_REQUESTED.store(clock::cycles_24(), Ordering::Relaxed);
            }
            line::ask(requests, core::slice::from_mut(receive_merge));
        }
    }
    HAPPENED.store(true, Ordering::Relaxed);
}
