//! The end of the flash, where a model and records survive a loss of power.
//!
//! The code runs from the same flash, which cannot be read while it is erased or written. So the
//! functions of the boot ROM do this work, called from RAM with interrupts masked: 45 ms for a
//! sector, half a millisecond for a page. Meanwhile the bytes of the serial lines wait: those of
//! the UART in RAM, where DMA stores them, and those of USB at the host. Steps would continue only
//! as long as their words last, so callers ensure that nothing moves. Behind each stroke of a job a
//! page is written while the pen is raised and no step waits.
//!
//! A worn flash reports no error; its cells simply no longer change. So what was erased or written
//! is read back, and the error is [`VerifyError`] if it is not as expected.

use core::fmt::Write;
use core::ptr;
#[cfg(feature = "tiles")]
use core::sync::atomic::AtomicU32;

use embedded_storage::nor_flash::{
    ErrorType, MultiwriteNorFlash, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use heapless::String;
use penup::plotter::Layout;
use penup::storage::PAGE_BYTES;
#[cfg(feature = "tiles")]
use penup::storage::area::{Area, AreaFlash, NotWritten};
use rp2040_hal::rom_data;

use super::registers::{Get, IO_QSPI, Put, SSI};
use super::{BOOT_2, ROW, critical, emergency, usb};

/// The address at which the flash is mapped to memory, so that it can be read.
const MAPPED_AT: usize = ROW.flash.start as usize;
/// The address at which the flash is mapped past its cache, which is neither asked nor changed
/// (data sheet, 2.6.3.1). Only words can be read there in the emulator.
const UNCACHED_AT: usize = MAPPED_AT + 0x0300_0000;
/// The memory map reserves the flash from here on for this module: first for a model that is too
/// large for the memory, if the board's row gives it some.
const START: u32 = ROW.budget.flash as u32;
/// Where the records begin. This must not change, because a new version of the firmware finds what
/// an older one has kept.
const RECORDS: u32 = START + ROW.model_flash as u32;
const _: () = assert!(RECORDS == 1760 << 10);
/// The number of bytes in the flash chip, and so the offset at which it ends.
const END: u32 = ROW.flash.size as u32;
/// The unit in which flash is erased.
const SECTOR_BYTES: usize = 4096;
/// Room for all of the working memory, with a page before it and less than a sector of figures.
const JOB_BYTES: u32 = (128 << 10) + SECTOR_BYTES as u32;
/// Where in the flash each record lies.
pub const LAYOUT: Layout = Layout::from(RECORDS, JOB_BYTES);
const _: () = assert!(LAYOUT.end() == END);

/// The flash in which records are kept. Addresses count from its beginning.
pub struct Flash(());

/// The functions of the boot ROM, and the boot loader that sets up the flash for reading at full
/// speed.
struct Rom {
    /// Connects the flash to its serial line.
    connect: unsafe extern "C" fn(),
    /// Ends the mode in which the flash is mapped to memory.
    leave_mapping: unsafe extern "C" fn(),
    /// Erases a range of the flash: its start, its size, and the size and the command of a larger
    /// block.
    erase: unsafe extern "C" fn(u32, usize, u32, u8),
    /// Writes to the flash: where, from which address in memory, and how many bytes.
    write: unsafe extern "C" fn(u32, *const u8, usize),
    /// Empties the flash's cache.
    flush_cache: unsafe extern "C" fn(),
    /// Runs the boot loader, which sets up the flash for reading at full speed.
    boot_2: unsafe extern "C" fn(),
}

/// A piece of work on the flash, during which nothing can be read from it.
enum Work<'p> {
    /// Erases whole sectors.
    Erase {
        /// Where the first sector begins, in bytes from the beginning of the flash.
        from: u32,
        /// How much is erased: a multiple of [`SECTOR_BYTES`].
        bytes: usize,
    },
    /// Writes a page, which is in RAM.
    Write {
        /// Where the page lies, in bytes from the beginning of the flash.
        to: u32,
        /// The bytes that are written to the page.
        page: &'p [u8; PAGE_BYTES],
    },
    /// Asks the chip for its unique number, which follows the bytes of the command.
    Number {
        /// The bytes that are sent to the chip. Each is replaced by the byte that comes back
        /// meanwhile.
        exchanged: &'p mut [u8; NUMBER_COMMAND],
    },
}

/// The length of the exchange: the command, four bytes without meaning, and the answer.
const NUMBER_COMMAND: usize = 1 + 4 + 8;
/// The chip's command that asks for its unique number.
const READ_NUMBER: u8 = 0x4B;

/// The override of the level of the pin that selects the flash chip (data sheet, 2.19.6.2).
mod select {
    /// The bits that say whether and how the level is overridden.
    pub const OVERRIDE: u32 = 3 << 8;
    /// The override that makes the pin low, so that the flash chip listens.
    pub const LOW: u32 = 2 << 8;
    /// The pin is high, so the chip does not listen.
    pub const HIGH: u32 = 3 << 8;
}
/// Bits of the status of the serial line to the flash chip (data sheet, 4.10.13).
mod line {
    /// The bit that says that there is room for another byte to send.
    pub const HAS_PLACE: u32 = 1 << 1;
    /// The bit that says that a received byte can be read.
    pub const HAS_BYTE: u32 = 1 << 3;
}

/// Carries out the operation. It runs from RAM.
///
/// # Safety
/// Interrupts are masked, and nothing else reads the flash; the work is within it.
#[inline(never)]
#[unsafe(link_section = ".data.flash")]
unsafe extern "C" fn carry_out(rom: &Rom, work: &mut Work<'_>) {
    // SAFETY: the order of the data sheet, 2.8.3.1.3; all is in ROM or RAM.
    unsafe {
        (rom.connect)();
        (rom.leave_mapping)();
        match work {
            Work::Erase { from, bytes } => {
                const BLOCK_BYTES: u32 = 1 << 16;
                const ERASE_BLOCK: u8 = 0xD8;
                (rom.erase)(*from, *bytes, BLOCK_BYTES, ERASE_BLOCK);
            }
            Work::Write { to, page } => (rom.write)(*to, page.as_ptr(), PAGE_BYTES),
            Work::Number { exchanged } => {
                // The boot ROM has set up the line for single bytes. Each byte sent brings one byte
                // of the answer.
                let selects = IO_QSPI.gpio_qspiss().gpio_ctrl().get() & !select::OVERRIDE;
                IO_QSPI.gpio_qspiss().gpio_ctrl().put(selects | select::LOW);
                let ssi = SSI.registers();
                for byte in exchanged.iter_mut() {
                    while ssi.sr().get() & line::HAS_PLACE == 0 {}
                    ssi.dr0().put(*byte as u32);
                    while ssi.sr().get() & line::HAS_BYTE == 0 {}
                    *byte = ssi.dr0().get() as u8;
                }
                IO_QSPI.gpio_qspiss().gpio_ctrl().put(selects | select::HIGH);
            }
        }
        (rom.flush_cache)();
        (rom.boot_2)();
    }
}

/// Reads a byte of the flash as it is now. The cache is emptied whenever something is written.
fn byte_at(offset: u32) -> u8 {
    // SAFETY: the lower 16 MiB are mapped to flash, whatever its size, and reading it has no
    // effect. Volatile, for it changes behind the compiler's back.
    unsafe { ptr::read_volatile((MAPPED_AT + (offset as usize & 0xFF_FFFF)) as *const u8) }
}

/// Reads the word in which a byte of the flash lies, past the cache.
fn word_at(offset: u32) -> u32 {
    // SAFETY: as in `byte_at`; the address is that of a word.
    unsafe { ptr::read_volatile((UNCACHED_AT + (offset as usize & 0xFF_FFFC)) as *const u32) }
}

impl Flash {
    /// Creates the flash of the board, which is taken once.
    pub const fn new() -> Self {
        Self(())
    }

    /// The unique number of the flash chip, as 16 hexadecimal digits.
    pub fn number(&mut self) -> String<16> {
        let mut exchanged = [0; NUMBER_COMMAND];
        exchanged[0] = READ_NUMBER;
        self.work(Work::Number { exchanged: &mut exchanged });
        let [.., a, b, c, d, e, f, g, h] = exchanged;
        let mut digits = String::new();
        // This never fails, because the string is long enough.
        let _ = write!(digits, "{:016X}", u64::from_be_bytes([a, b, c, d, e, f, g, h]));
        digits
    }

    /// Does a piece of work on the flash, with interrupts masked.
    #[inline(never)] // `cargo xtask build` recognises it by its name: nothing moves meanwhile.
    fn work(&mut self, mut work: Work<'_>) {
        emergency::feed();
        // A copy of the boot loader's code in RAM, where it can run while the flash cannot be read.
        let boot_2: [u32; 64] = bytemuck::cast(BOOT_2);
        // SAFETY: it is Thumb code that begins with its first word, has no parameters and no
        // result, and returns to its caller if that is not the boot ROM.
        let boot_2 = unsafe {
            core::mem::transmute::<usize, unsafe extern "C" fn()>(boot_2.as_ptr() as usize | 1)
        };
        let rom = Rom {
            connect: rom_data::connect_internal_flash::ptr(),
            leave_mapping: rom_data::flash_exit_xip::ptr(),
            erase: rom_data::flash_range_erase::ptr(),
            write: rom_data::flash_range_program::ptr(),
            flush_cache: rom_data::flash_flush_cache::ptr(),
            boot_2,
        };
        critical::with_steps_masked(|| {
            // SAFETY: interrupts are masked, one core runs, and the channel of the steps reads RAM;
            // the callers check that the position is within the flash.
            unsafe { carry_out(&rom, &mut work) };
            usb::forget_frame();
        });
    }
}

/// The error when the flash does not hold what was written to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerifyError;

impl NorFlashError for VerifyError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Flash {
    type Error = VerifyError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    /// Reads what the flash itself returns now. From its cache, garbage that it returned while the
    /// voltage rose would be read again and again.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), VerifyError> {
        let mut word = [0; 4];
        let mut words = None;
        for (at, byte) in (offset..).zip(bytes) {
            if words != Some(at / 4) {
                words = Some(at / 4);
                word = word_at(at).to_le_bytes();
            }
            let [a, b, c, d] = word;
            *byte = match at % 4 {
                0 => a,
                1 => b,
                2 => c,
                _ => d,
            };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        END as usize
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = PAGE_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    /// Erases sectors in the part of the flash that is reserved for this module. Other sectors stay
    /// as they are, which normally gives [`VerifyError`].
    fn erase(&mut self, from: u32, to: u32) -> Result<(), VerifyError> {
        if from >= START && to <= END {
            self.work(Work::Erase { from, bytes: (to - from) as usize });
        }
        if (from..to).all(|at| byte_at(at) == 0xFF) { Ok(()) } else { Err(VerifyError) }
    }

    /// Writes whole pages in the same part of the flash. Bits that are clear stay clear.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), VerifyError> {
        for (to, bytes) in (offset..).step_by(PAGE_BYTES).zip(bytes.chunks_exact(PAGE_BYTES)) {
            if (START..END).contains(&to) {
                let mut page = [0; PAGE_BYTES];
                page.copy_from_slice(bytes);
                // The contents that the page should have afterwards.
                let mut expected = [0; PAGE_BYTES];
                for ((at, byte), expected) in (to..).zip(bytes).zip(&mut expected) {
                    *expected = byte_at(at) & byte;
                }
                self.work(Work::Write { to, page: &page });
                if (to..).zip(expected).all(|(at, byte)| byte_at(at) == byte) {
                    continue;
                }
            }
            return Err(VerifyError);
        }
        Ok(())
    }
}

impl MultiwriteNorFlash for Flash {}

/// The flash for a model, as it is read: through the cache, or past it.
#[cfg(feature = "tiles")]
pub fn model_area(past_cache: bool) -> Area<'static> {
    const WORDS: usize = (RECORDS - START) as usize / size_of::<AtomicU32>();
    let mapped_at = if past_cache { UNCACHED_AT } else { MAPPED_AT };
    let address = (mapped_at + START as usize) as *const AtomicU32;
    // SAFETY: this many words are mapped to flash there, for ever. They change while the flash is
    // erased or written, which atomic words may; nothing writes them through this slice.
    Area::new(unsafe { core::slice::from_raw_parts(address, WORDS) })
}

#[cfg(feature = "tiles")]
impl AreaFlash for Flash {
    fn erase_sector(&mut self, at: usize) -> Result<(), NotWritten> {
        let from = START + at as u32;
        if from >= RECORDS {
            return Err(NotWritten);
        }
        self.erase(from, from + SECTOR_BYTES as u32).map_err(|VerifyError| NotWritten)
    }

    fn write_page(&mut self, at: usize, page: &[u8; PAGE_BYTES]) -> Result<(), NotWritten> {
        let to = START + at as u32;
        if to >= RECORDS {
            return Err(NotWritten);
        }
        self.write(to, page).map_err(|VerifyError| NotWritten)
    }
}
