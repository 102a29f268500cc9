//! What of the chip lies in the memory of WebAssembly.

use crate::cache::Cache;

/// The address of RAM.
pub const RAM: u32 = 0x2000_0000;
/// The size of RAM in bytes.
pub const RAM_BYTES: usize = 264 * 1024;
/// The size of the window in which flash lies, in bytes.
pub const FLASH_BYTES: usize = 16 << 20;

/// What both interpreters read and write beside RAM and flash: words of 32 bits, in the order in
/// which `quick_core.mjs` names them.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Shared {
    /// The registers R0 to R15.
    pub registers: [u32; 16],
    /// The flags N, Z, C and V, each 0 or 1.
    pub flags: [u32; 4],
    /// Whether PRIMASK masks all interrupts: 0 or 1.
    pub is_masked: u32,
    /// The number of cycles for which the core has still to wait.
    pub stalled: u32,
    /// The address of the line of flash from which the last instruction came, if the cache still
    /// holds it.
    pub line: u32,
    /// The offset in flash from which on flash may return garbage.
    pub garbage_from: u32,
    /// The number of reads before one returns garbage, or all ones if none does.
    pub garbage_after: u32,
    /// The number of reads there.
    pub reads: u32,
    /// Whether flash has returned garbage since this was last set to 0.
    pub has_garbled: u32,
    /// The number of cycles that a POP of the program counter takes beyond what rp2040js counts.
    pub call_cycles: u32,
}

/// Instructions before which execution stops: a count of each address. Addresses that differ in
/// upper bits share one, so that it may stop before others as well.
#[derive(Debug)]
pub struct Marks {
    counts: Box<[u8; Self::COUNTS]>,
    total: u32,
}

impl Marks {
    const COUNTS: usize = 1 << 16;

    /// Returns no marks, or nothing if there is no memory for them.
    fn new() -> Option<Self> {
        Some(Self { counts: zeroed()?, total: 0 })
    }

    /// Adds one mark, or removes one.
    pub fn change(&mut self, address: u32, adds: bool) {
        let count = &mut self.counts[address as usize >> 1 & (Self::COUNTS - 1)];
        if adds {
            *count = count.saturating_add(1);
            self.total += 1;
        } else if *count > 0 {
            *count -= 1;
            self.total -= 1;
        }
    }

    /// Whether an address, or one that shares its count, has a mark.
    #[inline(always)]
    pub fn contain(&self, address: u32) -> bool {
        self.total != 0 && self.counts[address as usize >> 1 & (Self::COUNTS - 1)] != 0
    }
}

/// The divider of the block SIO, which rp2040js models.
pub trait Divider {
    /// Reads the register at an offset within SIO.
    fn read(&mut self, offset: u32) -> u32;
    /// Writes the register at an offset within SIO.
    fn write(&mut self, offset: u32, value: u32);
}

/// A core with its memories.
#[derive(Debug)]
pub struct Chip {
    /// The registers, and what else is shared.
    pub shared: Shared,
    /// RAM.
    pub ram: Box<[u8; RAM_BYTES]>,
    /// Flash.
    pub flash: Box<[u8; FLASH_BYTES]>,
    /// The cache in front of flash.
    pub cache: Cache,
    /// The instructions before which execution stops.
    pub marks: Marks,
}

impl Chip {
    /// Returns a chip whose memories are zero, or nothing if there is no memory for them.
    pub fn new() -> Option<Self> {
        Some(Self {
            shared: Shared { garbage_after: u32::MAX, ..Shared::default() },
            ram: zeroed()?,
            flash: zeroed()?,
            cache: Cache::default(),
            marks: Marks::new()?,
        })
    }
}

/// Returns so many bytes that are zero.
fn zeroed<const BYTES: usize>() -> Option<Box<[u8; BYTES]>> {
    vec![0; BYTES].into_boxed_slice().try_into().ok()
}
