//! The ring of words that wait, and what its steps are in lengths.

use core::sync::atomic::AtomicU32;

use penup::motion::StepWay;

/// Words of the ring, a power of two.
pub const WORDS: u32 = 2048;
/// Of so many words, from a multiple of it on, there is a sum.
pub const GROUP: u32 = 16;

#[repr(align(8192))] // Its size, or the channel would not find around.
pub struct Ring([AtomicU32; WORDS as usize]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

static RING: Ring = Ring([const { AtomicU32::new(0) }; WORDS as usize]);
/// Of each word of the ring that is a step: `around` of [`StepWay`] in the lower half, `behind` in the
/// upper one; 0 for other words.
pub static WAYS: [AtomicU32; WORDS as usize] = [const { AtomicU32::new(0) }; WORDS as usize];

/// For each group of words how many units were queued up to its end; wraps.
static SUMS: [AtomicU32; (WORDS / GROUP) as usize] =
    [const { AtomicU32::new(0) }; (WORDS / GROUP) as usize];

pub fn place(word: u32) -> &'static AtomicU32 {
    &RING.0[(word % WORDS) as usize]
}

/// Up to `count` words from `word` on, as far as they lie in a row.
pub fn row(word: u32, count: u32) -> &'static [AtomicU32] {
    let start = word % WORDS;
    &RING.0[start as usize..(start + count).min(WORDS) as usize]
}

pub fn ring_address(word: u32) -> u32 {
    place(word).as_ptr() as u32
}

pub fn way(word: u32) -> &'static AtomicU32 {
    &WAYS[(word % WORDS) as usize]
}

/// The sum of the group that ends before `word`.
pub fn sum(word: u32) -> &'static AtomicU32 {
    &SUMS[(word / GROUP) as usize % SUMS.len()]
}

pub fn pack(way: StepWay) -> u32 {
    way.around | way.behind << 16
}

pub fn unpack(way: u32) -> StepWay {
    StepWay { around: way & 0xFFFF, behind: way >> 16 }
}
