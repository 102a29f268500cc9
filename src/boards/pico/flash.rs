//! The end of the flash, where records outlive a loss of power.
//!
//! The code runs from the same flash, which cannot be read while it is erased or written. So this is
//! done by the boot ROM's functions, called from RAM with interrupts masked: 45 ms for a sector, half
//! a millisecond for a page, in which bytes of the serial line beyond its FIFO's 32 are lost. Steps
//! would go on for as long as their words last; callers see to it that nothing moves.
//!
//! A worn flash says nothing by itself: its cells no longer change. So what was erased or written is read back, and
//! [`Worn`] is the error if it is not what it should be.

use core::ptr;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use penup::plotter::Record;
use penup::storage::{PAGE_BYTES, Slots};
use rp2040_hal::rom_data;

use super::{BOOT_2, critical, emergency};

/// Where the flash is read.
const MAPPED_AT: usize = 0x1000_0000;
/// The memory map leaves what follows to this module.
const START: u32 = 1760 << 10;
const END: u32 = 2048 << 10;
const SECTOR_BYTES: usize = 4096;
/// For all of the working memory, with a page before it and less than a sector of figures.
const JOB_BYTES: u32 = (128 << 10) + SECTOR_BYTES as u32;

/// Where a record lies.
pub const fn slots(record: Record) -> Slots {
    match record {
        Record::Settings => Slots { start: START, bytes: SECTOR_BYTES as u32 },
        Record::Job => Slots { start: START + 0x2000, bytes: JOB_BYTES },
    }
}
const _: () = assert!(slots(Record::Job).start + 2 * slots(Record::Job).bytes <= END);

/// The flash. Addresses are from its beginning.
pub struct Flash(());

/// The boot ROM's functions, and what sets the flash up for reading at full speed.
struct Rom {
    connect: unsafe extern "C" fn(),
    leave_mapping: unsafe extern "C" fn(),
    erase: unsafe extern "C" fn(u32, usize, u32, u8),
    write: unsafe extern "C" fn(u32, *const u8, usize),
    flush_cache: unsafe extern "C" fn(),
    boot_2: unsafe extern "C" fn(),
}

/// What is to be done.
enum Work<'p> {
    Erase {
        from: u32,
        bytes: usize,
    },
    /// The page is in RAM.
    Write {
        to: u32,
        page: &'p [u8; PAGE_BYTES],
    },
}

/// Does it, out of RAM.
///
/// # Safety
/// Interrupts are masked, and nothing else reads the flash; the work is within it.
#[inline(never)]
#[unsafe(link_section = ".data.flash")]
unsafe extern "C" fn carry_out(rom: &Rom, work: &Work<'_>) {
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
        }
        (rom.flush_cache)();
        (rom.boot_2)();
    }
}

/// A byte of the flash as it is now: the cache forgets all when something is written.
fn byte_at(offset: u32) -> u8 {
    // SAFETY: the lower 16 MiB are mapped to flash, whatever its size, and reading it has no effect. Volatile, for it
    // changes behind the compiler's back.
    unsafe { ptr::read_volatile((MAPPED_AT + (offset as usize & 0xFF_FFFF)) as *const u8) }
}

impl Flash {
    /// The flash of the board, which is taken once.
    pub const fn new() -> Self {
        Self(())
    }

    fn work(&mut self, work: &Work<'_>) {
        emergency::feed();
        // The boot loader's code, where it can be run while the flash cannot.
        let boot_2: [u32; 64] = bytemuck::cast(BOOT_2);
        // SAFETY: it is Thumb code that begins with its first word, takes nothing, gives nothing back
        // and returns to its caller if that is not the boot ROM.
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
            // SAFETY: interrupts are masked, one core runs, and the channel of the steps reads RAM; the
            // callers check the place.
            unsafe { carry_out(&rom, work) };
        });
    }
}

/// The flash does not hold what was written to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Worn;

impl NorFlashError for Worn {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for Flash {
    type Error = Worn;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Worn> {
        for (at, byte) in (offset..).zip(bytes) {
            *byte = byte_at(at);
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

    /// Erases sectors that lie in what is left to this module; others stay as they are, which is [`Worn`] too.
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Worn> {
        if from >= START && to <= END {
            self.work(&Work::Erase { from, bytes: (to - from) as usize });
        }
        if (from..to).all(|at| byte_at(at) == 0xFF) { Ok(()) } else { Err(Worn) }
    }

    /// Writes whole pages, with the same condition.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Worn> {
        for (to, bytes) in (offset..).step_by(PAGE_BYTES).zip(bytes.chunks_exact(PAGE_BYTES)) {
            if (START..END).contains(&to) {
                let mut page = [0; PAGE_BYTES];
                page.copy_from_slice(bytes);
                self.work(&Work::Write { to, page: &page });
            }
            if !(to..).zip(bytes).all(|(at, &byte)| byte_at(at) == byte) {
                return Err(Worn);
            }
        }
        Ok(())
    }
}
