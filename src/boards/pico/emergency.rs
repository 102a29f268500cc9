//! The watchdog, the reason for the board's start, and the handling of panics and faults (see
//! [`fault`]).
//!
//! After a panic, the pen and the drivers are made safe first. Then the board keeps the message in
//! RAM that no start clears, and restarts by the watchdog, so that both ports can be told. If the
//! program panics or hangs again and again as soon as it has started, the result is
//! [`Start::Rescue`]: the plotter no longer runs, but both ports answer (see
//! [`rescue`](super::rescue)). If even that panics, the handler waits for ctrl-X on UART0.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use rp2040_hal::rom_data;

use super::registers::{Get, PSM, Put, UART0, WATCHDOG};
use super::{Pico, clock, pen, steps};
use crate::boards::fault::{self, Fault};
use crate::boards::pl011::Uart;

// The scratch register 4 keeps its word through a restart by the watchdog; any other reset clears
// it. The boot ROM writes 0 to it when it starts an image that was copied onto its drive, and
// another word when it is to begin elsewhere.

/// The bit of the watchdog's control register that restarts the chip.
const TRIGGER: u32 = 1 << 31;
/// The bit of the reason register for a watchdog that was not fed.
const TIMED_OUT: u32 = 1;
/// What a restart by the watchdog resets: everything but the two oscillators.
const ALL_BUT_OSCILLATORS: u32 = 0x1_FFFC;

/// The word in the scratch register while this program's watchdog runs. It is the SDK's own word
/// for this, so that its tools show the reason too.
const OURS: u32 = 0x6AB7_3121;
/// The word in the scratch register when this program restarts itself.
const FAULT: u32 = 0x6661_756C;
/// The timeout of the watchdog. It is longer than the longest event, 0.67 s, and than erasing a
/// sector. The chip counts two per microsecond.
const WATCHDOG_TIMEOUT: u32 = 2 * 3_000_000;

/// The number of consecutive faults, each soon after the start, after which the plotter is not run
/// again.
const FAULTS: u8 = 3;
/// The number of consecutive faults after which the board is not restarted at all.
const LAST_FAULT: u8 = 2 * FAULTS;
/// The time in microseconds after which a program counts as started.
const START_TIME: u32 = 5_000_000;

/// The greatest length of a message in bytes; a longer one is cut.
const TEXT_BYTES: usize = 192;
/// The message of a fault: one line of printable ASCII characters.
pub type Cause = heapless::String<TEXT_BYTES>;

/// The reason why the board started, which decides whether the plotter runs.
#[derive(Debug)]
pub enum Start {
    /// The board was started by power, the pin RUN, a new image, or a command of the user.
    Fresh,
    /// A fault ended the previous run of the program; this is its message.
    AfterFault(Cause),
    /// Faults have ended the program too often, so the plotter must not be run.
    Rescue(Cause),
}

/// What is kept of a fault through a reset, so that it can be reported afterwards.
#[derive(Clone, Copy)]
#[repr(C)]
struct Stored {
    /// The checksum over everything that follows, because RAM holds arbitrary data after a loss of
    /// power.
    sum: u32,
    /// The number of faults one after the other, without a proper run between them.
    faults: u8,
    /// The length of the message, in bytes.
    length: u8,
    /// The message that says what the fault was, followed by zeros.
    text: [u8; TEXT_BYTES],
}

/// The memory of the stored fault, which a reset leaves as it is.
struct StoredCell(UnsafeCell<MaybeUninit<Stored>>);

// SAFETY: it is used in the main loop and, with interrupts off, by the handler of a fault, after
// which the main loop does not go on.
unsafe impl Sync for StoredCell {}

/// The data is not cleared at the start (`.uninit`), and the boot ROM does not write there either
/// (see `boards/pico.x`).
#[unsafe(link_section = ".uninit.kept")]
static STORED: StoredCell = StoredCell(UnsafeCell::new(MaybeUninit::uninit()));

impl Stored {
    /// Makes the data after this many consecutive faults, the last of them with the message
    /// `cause`, which is ASCII and at most [`TEXT_BYTES`] long. Without a fault the message is
    /// empty.
    fn new(faults: u8, cause: &str) -> Self {
        let mut stored = Self { sum: 0, faults, length: cause.len() as u8, text: [0; TEXT_BYTES] };
        for (slot, byte) in stored.text.iter_mut().zip(cause.bytes()) {
            *slot = byte;
        }
        stored.sum = stored.own_sum();
        stored
    }

    /// Returns the checksum of all fields but the checksum itself.
    fn own_sum(&self) -> u32 {
        static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
        let mut digest = CRC.digest();
        digest.update(&[self.faults, self.length]);
        digest.update(&self.text);
        digest.finalize()
    }

    /// Writes the fault to where the next start of the board finds it.
    fn store(self) {
        // SAFETY: nobody else uses it now (see `StoredCell`). Volatile, for nothing in this run may
        // read it again.
        unsafe { STORED.0.get().write_volatile(MaybeUninit::new(self)) };
    }

    /// Returns what was stored, if its checksum is right.
    fn load() -> Option<Self> {
        // SAFETY: nobody else uses it now, and every pattern of bits is a value of these integers.
        let stored = unsafe { STORED.0.get().read_volatile().assume_init() };
        (stored.sum == stored.own_sum()).then_some(stored)
    }

    /// Returns the stored message of the fault.
    fn cause(&self) -> Cause {
        let mut cause = Cause::new();
        for &byte in self.text.iter().take(self.length.into()) {
            let _ = cause.push(char::from(byte)); // It is ASCII, and at most as long as the text.
        }
        cause
    }
}

/// Returns why the board started. It is called once, before the watchdog is started.
pub fn start() -> Start {
    let (reason, word) = (WATCHDOG.reason().get(), WATCHDOG.scratch4().get());
    let stored = Stored::load();
    let (faults, cause) = match word {
        FAULT if reason != 0 => match stored {
            Some(stored) => (stored.faults, stored.cause()),
            None => (1, text("a fault whose message is lost")),
        },
        OURS if reason & TIMED_OUT != 0 => {
            let faults = stored.map_or(0, |stored| stored.faults).saturating_add(1);
            (faults, text("the program hung, and the watchdog ended it"))
        }
        _ => (0, Cause::new()),
    };
    Stored::new(faults, "").store();
    WATCHDOG.scratch4().put(OURS);
    match faults {
        0 => Start::Fresh,
        1..FAULTS => Start::AfterFault(cause),
        _ => Start::Rescue(cause),
    }
}

/// Makes the message of a fault from a short text.
fn text(text: &str) -> Cause {
    let mut cause = Cause::new();
    let _ = cause.push_str(text); // There is room, because the texts are short.
    cause
}

/// Records that the program runs, `microseconds` after its start. Faults after [`START_TIME`] do
/// not count as faults at the start.
pub fn note_running(microseconds: u32) {
    static HAS_STARTED: AtomicBool = AtomicBool::new(false);
    if microseconds > START_TIME && !HAS_STARTED.load(Ordering::Relaxed) {
        HAS_STARTED.store(true, Ordering::Relaxed);
        Stored::new(0, "").store();
    }
}

/// Tells the watchdog that the program still runs, so that it does not restart the board.
pub fn feed() {
    WATCHDOG.load().put(WATCHDOG_TIMEOUT);
}

/// Restarts the board by the watchdog. A reset request of the core would leave its peripherals as
/// they are.
fn restart(word: u32) -> ! {
    WATCHDOG.scratch4().put(word);
    PSM.wdsel().put(ALL_BUT_OSCILLATORS);
    loop {
        WATCHDOG.ctrl().put(TRIGGER);
        cortex_m::asm::nop();
    }
}

/// Restarts the board because the user has asked for it. Nothing is reported then.
pub fn restart_fresh() -> ! {
    fault::make_safe();
    restart(0)
}

/// Raises the pen, switches the drivers off and hands the board over to the boot ROM, which shows
/// the drive for a new image. It takes half a second, in which nothing else runs.
pub fn show_drive() -> ! {
    fault::make_safe();
    wait_until_raised();
    // The boot ROM restarts itself by the watchdog. The arguments mean that it shows no activity at
    // a pin and disables no interface.
    rom_data::reset_to_usb_boot(0, 0)
}

/// Waits as long as the servo takes to raise the pen. A restart ends its pulses, and the first one
/// with the height that was set last begins up to 20 ms after that.
fn wait_until_raised() {
    /// The time in which the servo raises the pen, in microseconds.
    const RAISING: u32 = 400_000;
    feed();
    let began = clock::microseconds();
    while clock::microseconds().wrapping_sub(began) < RAISING {}
}

impl Fault for Pico {
    const UART: Uart = UART0;

    fn release() {
        UART0.receive_by_dma(false);
        steps::release();
        pen::set_height(steps::STATE.up_height());
    }

    fn cause(info: &PanicInfo, _: usize) -> impl fmt::Display {
        info
    }

    /// Keeps the cause, and restarts the board when the pen is up, unless the program faults before
    /// it can even report.
    fn report(cause: fmt::Arguments) {
        let mut line = OneLine(Cause::new());
        let _ = line.write_fmt(cause); // This never fails.
        let faults = Stored::load().map_or(0, |stored| stored.faults).saturating_add(1);
        if faults < LAST_FAULT {
            Stored::new(faults, &line.0).store();
            if pen::is_driven() {
                wait_until_raised();
            }
            restart(FAULT)
        }
        fault::say(fault::WAITS, cause);
    }

    fn begin_to_wait() {
        WATCHDOG.ctrl().put(0);
    }

    fn reset() -> ! {
        restart(0)
    }
}

/// Accepts printable ASCII characters and replaces others by spaces. It ignores the rest when it is
/// full.
struct OneLine(Cause);

impl Write for OneLine {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars() {
            let is_printable = letter.is_ascii_graphic() && letter != '[' && letter != ']';
            let _ = self.0.push(if is_printable { letter } else { ' ' });
        }
        Ok(())
    }
}
