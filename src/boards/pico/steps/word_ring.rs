//! The ring buffer of the words that wait, and the lengths of their steps.

use core::sync::atomic::{AtomicU32, Ordering};

use penup::motion::StepDistances;

/// The number of words in the ring, a power of two.
pub const WORDS: u32 = 2048;
/// The number of words in a group, which begins at a multiple of this number and has one sum.
pub const GROUP: u32 = 16;

/// The words, in the order in which the channel reads them.
#[repr(align(8192))] // The channel wraps around only if the ring is aligned to its size.
pub struct Ring([AtomicU32; WORDS as usize]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

/// The ring of the words that wait. It lies where its alignment leaves no gap (`boards/pico.x`),
/// and nothing gives it a value before [`clear`].
// SAFETY: nothing else lies in this section, which is in RAM and may hold anything at the start.
// Atomic words may hold any value.
#[unsafe(link_section = ".ring")]
static RING: Ring = Ring([const { AtomicU32::new(0) }; WORDS as usize]);
/// For each word of the ring that is a step: `around` of [`StepDistances`] in the lower half and
/// `behind` in the upper one. For other words: 0.
pub static LENGTHS: [AtomicU32; WORDS as usize] = [const { AtomicU32::new(0) }; WORDS as usize];

/// For each group of words, the number of length units that were queued up to its end; it wraps.
static SUMS: [AtomicU32; (WORDS / GROUP) as usize] =
    [const { AtomicU32::new(0) }; (WORDS / GROUP) as usize];

/// Sets all words of the ring to 0, as they have no value when the board starts.
pub fn clear() {
    for word in &RING.0 {
        word.store(0, Ordering::Relaxed);
    }
}

/// Returns the slot of the ring for word number `word`.
pub fn slot(word: u32) -> &'static AtomicU32 {
    &RING.0[(word % WORDS) as usize]
}

/// Up to `count` consecutive slots from `word` on, cut off at the end of the ring.
pub fn row(word: u32, count: u32) -> &'static [AtomicU32] {
    let (_, row) = RING.0.split_at((word % WORDS) as usize);
    row.get(..count as usize).unwrap_or(row)
}

/// Returns the address of the slot for word number `word`, where the DMA channel is to read.
pub fn ring_address(word: u32) -> u32 {
    slot(word).as_ptr() as u32
}

/// Returns the slot for the packed lengths of the step in word number `word`.
pub fn lengths(word: u32) -> &'static AtomicU32 {
    &LENGTHS[(word % WORDS) as usize]
}

/// Returns the slot for the sum of the group that ends before `word`.
pub fn sum(word: u32) -> &'static AtomicU32 {
    &SUMS[(word / GROUP) as usize % SUMS.len()]
}

/// Packs both lengths of a step into one word, so that they can be stored in an atomic.
pub fn pack(step: StepDistances) -> u32 {
    step.around | step.behind << 16
}

/// Returns the way of a step that [`pack`] has packed.
pub fn unpack(lengths: u32) -> StepDistances {
    StepDistances { around: lengths & 0xFFFF, behind: lengths >> 16 }
}
