//! The watchdog, why the board started, and what becomes of a panic or a fault (see [`fault`]).
//!
//! A panic is not left to stand: the board keeps its message in RAM that no start clears, and
//! starts again by the watchdog, so that both ports can be told. Pen and drivers are made safe
//! before. If the program panics or hangs again and again as soon as it has started,
//! [`Start::Rescue`] is what is left: the plotter is not run any more, but both ports answer (see
//! [`rescue`](super::rescue)). If even that panics, the handler waits for ctrl-X on UART0.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use rp2040_hal::rom_data;

use super::registers::{PSM, UART0, WATCHDOG};
use super::{clock, pen, steps};
use crate::boards::fault::{self, Fault};

mod watchdog {
    pub const CONTROL: usize = 0x0;
    pub const LOAD: usize = 0x4;
    pub const REASON: usize = 0x8;
    /// Keeps its word through a restart by the watchdog; any other reset clears it. The boot ROM
    /// writes 0 to it when it starts an image that was copied onto its drive, and another word when
    /// it is to begin elsewhere.
    pub const SCRATCH_4: usize = 0x1C;
    pub const TRIGGER: u32 = 1 << 31;
    pub const TIMED_OUT: u32 = 1;
    /// What a restart by the watchdog resets: everything but the two oscillators.
    pub const PSM_CHOICE: usize = 0x8;
    pub const ALL_BUT_OSCILLATORS: u32 = 0x1_FFFC;
}
/// In the scratch register while this program's watchdog runs. The SDK's own word for it, so that
/// its tools tell the reason too.
const OURS: u32 = 0x6AB7_3121;
/// In the scratch register when this program starts itself again.
const FAULT: u32 = 0x6661_756C;
/// Longer than the longest event, 0.67 s, and than erasing a sector; the chip counts two in a
/// microsecond.
const PATIENCE: u32 = 2 * 3_000_000;

/// Faults in a row, each soon after the start, after which the plotter is not run again.
const FAULTS: u8 = 3;
/// After so many the board is not started again at all.
const LAST_FAULT: u8 = 2 * FAULTS;
/// A program that runs so long, in microseconds, has started.
const SOON: u32 = 5_000_000;

/// Bytes of a message; what is longer is cut.
const TEXT_BYTES: usize = 192;
/// The message of a fault: letters, digits and the like, in one line.
pub type Cause = heapless::String<TEXT_BYTES>;

/// Why the board started.
#[derive(Debug)]
pub enum Start {
    /// Power, the pin RUN, a new image, or the user's own wish.
    Fresh,
    /// A fault ended the program before; this is its message.
    AfterFault(Cause),
    /// The same too often: the plotter is not to be run.
    Rescue(Cause),
}

/// What outlives a reset.
#[derive(Clone, Copy)]
#[repr(C)]
struct Stored {
    /// Over all that follows: RAM holds anything after a loss of power.
    sum: u32,
    /// Faults in a row.
    faults: u8,
    length: u8,
    text: [u8; TEXT_BYTES],
}

struct KeptPlace(UnsafeCell<MaybeUninit<Stored>>);

// SAFETY: it is used in the main loop and, with interrupts off, by the handler of a fault, after
// which the main loop does not go on.
unsafe impl Sync for KeptPlace {}

/// Not cleared at the start (`.uninit`); the boot ROM does not write there either (see
/// `boards/pico.x`).
#[unsafe(link_section = ".uninit.kept")]
static KEPT: KeptPlace = KeptPlace(UnsafeCell::new(MaybeUninit::uninit()));

impl Stored {
    fn new(faults: u8, cause: &str) -> Self {
        let mut kept = Self { sum: 0, faults, length: cause.len() as u8, text: [0; TEXT_BYTES] };
        for (place, byte) in kept.text.iter_mut().zip(cause.bytes()) {
            *place = byte;
        }
        kept.sum = kept.own_sum();
        kept
    }

    fn own_sum(&self) -> u32 {
        static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
        let mut digest = CRC.digest();
        digest.update(&[self.faults, self.length]);
        digest.update(&self.text);
        digest.finalize()
    }

    fn store(self) {
        // SAFETY: nobody else uses it now (see `KeptPlace`). Volatile, for nothing in this run may
        // read it again.
        unsafe { KEPT.0.get().write_volatile(MaybeUninit::new(self)) };
    }

    /// What was stored, if it is whole.
    fn load() -> Option<Self> {
        // SAFETY: nobody else uses it now, and every pattern of bits is a value of these integers.
        let kept = unsafe { KEPT.0.get().read_volatile().assume_init() };
        (kept.sum == kept.own_sum()).then_some(kept)
    }

    fn cause(&self) -> Cause {
        let mut cause = Cause::new();
        for &byte in self.text.iter().take(self.length.into()) {
            let _ = cause.push(char::from(byte)); // ASCII, and as long as the text at most.
        }
        cause
    }
}

/// Why the board started. Called once, before the watchdog is started.
pub fn start() -> Start {
    let (reason, word) = (WATCHDOG.read(watchdog::REASON), WATCHDOG.read(watchdog::SCRATCH_4));
    let kept = Stored::load();
    let (faults, cause) = match word {
        FAULT if reason != 0 => match kept {
            Some(kept) => (kept.faults, kept.cause()),
            None => (1, text("a fault whose message is lost")),
        },
        OURS if reason & watchdog::TIMED_OUT != 0 => {
            let faults = kept.map_or(0, |kept| kept.faults).saturating_add(1);
            (faults, text("the program hung, and the watchdog ended it"))
        }
        _ => (0, Cause::new()),
    };
    Stored::new(faults, "").store();
    WATCHDOG.write(watchdog::SCRATCH_4, OURS);
    match faults {
        0 => Start::Fresh,
        1..FAULTS => Start::AfterFault(cause),
        _ => Start::Rescue(cause),
    }
}

fn text(text: &str) -> Cause {
    let mut cause = Cause::new();
    let _ = cause.push_str(text); // There is a place: the texts are short.
    cause
}

/// Notes that the program runs, so many microseconds after its start: faults from now on do not count
/// as faults at the start.
pub fn note_running(microseconds: u32) {
    static HAS_STARTED: AtomicBool = AtomicBool::new(false);
    if microseconds > SOON && !HAS_STARTED.load(Ordering::Relaxed) {
        HAS_STARTED.store(true, Ordering::Relaxed);
        Stored::new(0, "").store();
    }
}

/// Feeds the watchdog.
pub fn feed() {
    WATCHDOG.write(watchdog::LOAD, PATIENCE);
}

/// No interrupt, no step, pen up, drivers off.
pub fn make_safe() {
    cortex_m::interrupt::disable();
    UART0.receive_by_dma(false);
    steps::release();
    pen::set_height(0);
}

/// Starts the board again. The core's own request would leave its peripherals as they are.
fn restart(word: u32) -> ! {
    WATCHDOG.write(watchdog::SCRATCH_4, word);
    PSM.write(watchdog::PSM_CHOICE, watchdog::ALL_BUT_OSCILLATORS);
    loop {
        WATCHDOG.write(watchdog::CONTROL, watchdog::TRIGGER);
        cortex_m::asm::nop();
    }
}

/// Starts the board as the user has asked for it: nothing is to be reported then.
pub fn restart_fresh() -> ! {
    make_safe();
    restart(0)
}

/// Raises the pen, switches the drivers off and gives the board to the boot ROM, which shows the
/// drive for a new image. Takes half a second; nothing else goes on.
pub fn show_drive() -> ! {
    /// The servo has time to raise the pen: nothing tells it to afterwards. In microseconds.
    const RAISING: u32 = 400_000;
    make_safe();
    feed();
    let began = clock::microseconds();
    while clock::microseconds().wrapping_sub(began) < RAISING {}
    // The boot ROM restarts itself by the watchdog. It does not show the activity at a pin, and
    // leaves no interface out.
    rom_data::reset_to_usb_boot(0, 0)
}

struct Pico;

impl Fault for Pico {
    fn make_safe() {
        make_safe();
    }

    /// Keeps the cause and starts again, but for a program that cannot even report.
    fn report(cause: fmt::Arguments) {
        let mut line = OneLine(Cause::new());
        let _ = line.write_fmt(cause); // Fails never.
        let faults = Stored::load().map_or(0, |kept| kept.faults).saturating_add(1);
        if faults < LAST_FAULT {
            Stored::new(faults, &line.0).store();
            restart(FAULT)
        }
        fault::say::<Self>(cause);
    }

    fn write(bytes: &[u8]) {
        UART0.write(bytes);
    }

    fn begin_to_wait() {
        WATCHDOG.write(watchdog::CONTROL, 0);
    }

    fn poll() -> Option<u8> {
        UART0.poll().map(|data| data as u8)
    }

    fn reset() -> ! {
        restart(0)
    }
}

/// Takes what is printable ASCII, with other characters as spaces; leaves the rest when it is full.
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

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    fault::panic::<Pico>(info)
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Goes to [`report_fault`] with the address of the fault, on a fresh stack: the fault may be that
/// the stack is used up, and then nothing can be put onto it.
///
/// # Safety
/// Called by the core alone, on a fault.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mrs r1, msp",
        "ldr r2, ={end}",
        "movs r0, #0",
        "mvns r0, r0", // fault::STACK_USED_UP
        "cmp r1, r2",
        "blo 1f",
        "ldr r0, [r1, #24]", // the program counter that the core has put there
        "1: ldr r1, ={start}",
        "msr msp, r1",
        "ldr r1, ={report_fault}",
        "bx r1",
        end = sym _stack_end,
        start = sym _stack_start,
        report_fault = sym report_fault,
    )
}

extern "C" fn report_fault(address: u32) -> ! {
    fault::hard_fault::<Pico>(address)
}
