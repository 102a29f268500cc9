//! The interrupt that hands the words to the DMA channel, block by block, and brakes the machine
//! where the ring runs empty.
//!
//! The interrupt comes when a block has ended. Until the next block begins, the state machine has
//! only the 8 words of its queue. So all functions here are in RAM: see [`critical`].

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};

use penup::motion::{Brake, StepEvent, TICKS_PER_SECOND};
use rp2040_hal::pac::interrupt;

use super::engine::{BUSY, CHANNEL, LEVEL, PULSE_TICKS, QUEUE_WORDS, TARGETS, WAIT_TICKS, target};
use super::word_ring::{GROUP, lengths, ring_address, slot, sum, unpack};
use super::{BRAKED_TICKS, STATE};
use crate::boards::handler::Owned;
use crate::boards::pico::critical;
use crate::boards::pico::registers::{DMA, Get, PIO0, Put};

/// The greatest number of words in a block that is sent as planned. They are examined in some 750
/// cycles, 45 for each of them. If they must be braked after all, that time comes on top, and the
/// queue of the state machine must last for both: 1,770 cycles at the greatest rate.
const CALM_WORDS: u32 = 8;
/// The greatest number of words in a block that is braked, which takes some 100 cycles per word.
/// The queue of the state machine is as long, and it lasts 2000 cycles at 500,000 steps per second.
const BRAKED_WORDS: u32 = 8;
/// The greatest number of groups in a block after which enough steps wait.
const FAR_GROUPS: u32 = 8;
/// Steps with fewer ticks than this are braked several at a time: above 200,000 per second.
const FAST_TICKS: u32 = TICKS_PER_SECOND / 200_000;

/// Memory for a block of words.
#[repr(align(64))] // Aligned to its size, it does not cross the end of a ring.
struct Block([AtomicU32; BRAKED_WORDS as usize]);
const _: () = assert!(align_of::<Block>() == size_of::<Block>());

/// The copy of a block whose steps the brake has lengthened. The ring keeps the planned ones.
static BRAKED: Block = Block([const { AtomicU32::new(0) }; BRAKED_WORDS as usize]);
/// The brake, which says how long each step must last where few steps wait. It belongs to the
/// channel's interrupt.
pub static BRAKE: Owned<Brake> = Owned::empty();
/// Whether the last block was braked. It is written where the channel's interrupt is masked.
static BRAKING: AtomicBool = AtomicBool::new(false);
/// The number of words put into the ring; it wraps. Only the main loop writes it.
pub static WRITTEN: AtomicU32 = AtomicU32::new(0);
/// The number of words that were handed over to the channel; it wraps. It is written where the
/// channel's interrupt is masked.
pub static HANDED_OVER: AtomicU32 = AtomicU32::new(0);
/// The number of words of an abandoned block that the channel's count still shows. It is written
/// where the channel's interrupt is masked.
pub static ABANDONED: AtomicU32 = AtomicU32::new(0);
/// Whether a block is being transferred. It is written where the channel's interrupt is masked.
pub static FEEDING: AtomicBool = AtomicBool::new(false);

// SAFETY of all sections `.data.in_ram` of this board: `boards/pico.x` places them in RAM, and
// `cortex-m-rt` copies them there with the data before `main`. Only functions lie there.

/// The number of words that have left the channel and the queue of the state machine.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn taken() -> u32 {
    // SAFETY: its registers are only read.
    let dma = unsafe { DMA.registers() };
    critical::with_steps_masked(|| {
        loop {
            let left = dma.ch(0).ch_trans_count().get();
            let waiting = PIO0.flevel().get() & LEVEL;
            if left == dma.ch(0).ch_trans_count().get() {
                let to_come = left - ABANDONED.load(Ordering::Relaxed) + waiting;
                return HANDED_OVER.load(Ordering::Relaxed).wrapping_sub(to_come);
            }
        }
    })
}

/// Starts the transfer of waiting words, unless one is in progress.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn start() {
    critical::with_steps_masked(|| {
        if !FEEDING.load(Ordering::Relaxed) {
            feed();
        }
    });
}

/// Stops the state machine and the channel at once, and returns the number of words that have been
/// [`taken`]. The channel's interrupt does not come again until [`let_interrupt_come`].
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn stop() -> u32 {
    /// More often than the channel needs to fill the queue.
    const OFTEN: u32 = 1000;
    // SAFETY: the channel ends.
    let dma = unsafe { DMA.registers() };
    let is_busy = || dma.ch(0).ch_al1_ctrl().get() & BUSY != 0;
    critical::with_steps_masked(|| {
        PIO0.ctrl().put(0);
        // Aborting clears the channel's count (data sheet, 2.5.5.3). So it is read before, as soon
        // as the channel rests because the queue is full or the block has ended.
        let is_moving = || is_busy() && PIO0.flevel().get() & LEVEL != QUEUE_WORDS;
        for _ in 0..OFTEN {
            if !is_moving() {
                break;
            }
        }
        let taken = taken();
        dma.inte0().put(0);
        dma.chan_abort().put(CHANNEL);
        while is_busy() {}
        dma.ints0().put(CHANNEL);
        taken
    })
}

/// Lets the channel's interrupt come again, which [`stop`] prevents.
pub fn let_interrupt_come() {
    // SAFETY: only an interrupt is let come.
    unsafe { DMA.registers() }.inte0().put(CHANNEL);
}

/// Tells the channel what to transfer next. It is called where the channel's interrupt is masked.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn feed() {
    let handed_over = HANDED_OVER.load(Ordering::Relaxed);
    let count = WRITTEN.load(Ordering::Acquire).wrapping_sub(handed_over);
    FEEDING.store(count != 0, Ordering::Relaxed);
    // SAFETY: this is the handler that owns it, or the handler is masked.
    let Some(brake) = (unsafe { BRAKE.get() }) else { return };
    if count == 0 {
        return;
    }
    let (mut address, mut words) = (ring_address(handed_over), count);
    if STATE.brake().is_on() {
        words = far_words(brake, handed_over, count);
        // If the last block had to be braked, this one is braked without another examination first.
        if words == 0 && !BRAKING.load(Ordering::Relaxed) {
            words = calm_words(brake, handed_over, count);
        }
        if words == 0 {
            words = brake_evenly(brake, handed_over, count);
            if words == 0 {
                words = brake_words(brake, handed_over, count);
            }
            address = BRAKED.0.as_ptr() as u32;
        }
    }
    HANDED_OVER.store(handed_over.wrapping_add(words), Ordering::Relaxed);
    ABANDONED.store(0, Ordering::Relaxed);
    // The fence is needed because the channel reads what was written to the block and to the ring,
    // and the compiler does not know of this reader.
    fence(Ordering::Release);
    // SAFETY: the address is in the ring, at whose end the channel wraps, or that of the block,
    // which has this many words. Both are atomics.
    let dma = unsafe { DMA.registers() };
    dma.ch(0).ch_read_addr().put(address);
    // Writing the count here starts the channel.
    dma.ch(0).ch_al1_trans_count_trig().put(words);
}

/// The number of the `count` words from `handed_over` on that can be sent as planned because enough
/// steps wait after them, whatever these words are.
#[inline(always)]
fn far_words(brake: &mut Brake, handed_over: u32, count: u32) -> u32 {
    let group = handed_over / GROUP;
    for groups in [FAR_GROUPS, 1] {
        let end = group.wrapping_add(groups).wrapping_mul(GROUP);
        let words = end.wrapping_sub(handed_over);
        if words <= count && brake.pass_far(sum(end).load(Ordering::Relaxed), STATE.brake()) {
            return words;
        }
    }
    0
}

/// The number of the `count` words from `handed_over` on that can be sent as planned according to
/// one check of all of them; 0 if they must be examined one by one.
#[inline(never)] // As a function of its own it needs only the core's registers.
#[unsafe(link_section = ".data.in_ram")]
fn calm_words(brake: &mut Brake, handed_over: u32, count: u32) -> u32 {
    let (mut words, mut ticks) = (0, 0);
    let (mut around, mut longest, mut shortest) = (0, 0, u32::MAX);
    while words < count.min(CALM_WORDS) && ticks <= BRAKED_TICKS {
        let at = handed_over.wrapping_add(words);
        let step = lengths(at).load(Ordering::Relaxed);
        let planned = slot(at).load(Ordering::Relaxed) >> 8;
        if step != 0 {
            around += step & 0xFFFF;
            longest = longest.max(step >> 16);
            shortest = shortest.min(planned);
        }
        ticks += planned;
        words += 1;
    }
    if brake.pass(around, longest, shortest, STATE.brake()) { words } else { 0 }
}

/// Copies a block of the `count` words from `handed_over` on and applies the same least ticks to
/// all. This is used at high speed, where there is little time. Returns the number of words; 0 if
/// it is not possible.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn brake_evenly(brake: &mut Brake, handed_over: u32, count: u32) -> u32 {
    let is_fast = slot(handed_over).load(Ordering::Relaxed) >> 8 < FAST_TICKS;
    if count < BRAKED_WORDS || !is_fast {
        return 0;
    }
    let (mut around, mut longest) = (0, 0);
    for number in 0..BRAKED_WORDS {
        let step = lengths(handed_over.wrapping_add(number)).load(Ordering::Relaxed);
        if step == 0 {
            return 0;
        }
        around += step & 0xFFFF;
        longest = longest.max(step >> 16);
    }
    let Some(least) = brake.pass_evenly(around, longest, STATE.brake()) else { return 0 };
    let least = least.saturating_sub(PULSE_TICKS + STATE.pulse_ticks()).min(StepEvent::MAX_TICKS);
    let mut is_braked = false;
    for (number, braked) in (0..).zip(&BRAKED.0) {
        let mut word = slot(handed_over.wrapping_add(number)).load(Ordering::Relaxed);
        if word >> 8 < least {
            word = least << 8 | word & 0xFF;
            is_braked = true;
        }
        braked.store(word, Ordering::Relaxed);
    }
    BRAKING.store(is_braked, Ordering::Relaxed);
    BRAKED_WORDS
}

/// Copies the first of the `count` words from `handed_over` on, and lengthens each step to the
/// least ticks that it needs. Returns the number of words.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn brake_words(brake: &mut Brake, handed_over: u32, count: u32) -> u32 {
    let beyond = PULSE_TICKS + STATE.pulse_ticks();
    let (mut words, mut ticks, mut more) = (0, 0, 0);
    for (number, braked) in (0..count).zip(&BRAKED.0) {
        let at = handed_over.wrapping_add(number);
        let mut word = slot(at).load(Ordering::Relaxed);
        let step = lengths(at).load(Ordering::Relaxed);
        if step != 0 {
            let mut least = brake.step(unpack(step), STATE.brake());
            let planned = (word >> 8) + beyond;
            if least > planned && number + 1 < count {
                // The next word may be a wait between two steps, or move the pen there: then its
                // ticks count as well.
                let next = slot(at.wrapping_add(1)).load(Ordering::Relaxed);
                if next & TARGETS != target::PULSE {
                    least = least.saturating_sub((next >> 8) + WAIT_TICKS);
                }
            }
            more |= least.saturating_sub(planned);
            word += least.saturating_sub(planned).min(StepEvent::MAX_TICKS - (word >> 8)) << 8;
        }
        braked.store(word, Ordering::Relaxed);
        words += 1;
        ticks += word >> 8;
        if ticks > BRAKED_TICKS {
            break;
        }
    }
    BRAKING.store(more != 0, Ordering::Relaxed);
    words
}

/// The interrupt at the end of a block: hands the next one over to the channel.
#[interrupt]
#[unsafe(link_section = ".data.in_ram")]
fn DMA_IRQ_0() {
    // SAFETY: only an interrupt is ended.
    unsafe { DMA.registers() }.ints0().put(CHANNEL);
    feed();
}
