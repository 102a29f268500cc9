//! The interrupt that hands the words over to the DMA channel, block by block, and brakes where the ring runs dry.
//!
//! It comes when a block has ended, and the state machine lives on the 8 words of its queue until
//! the next one begins. So all functions here lie in RAM: see [`critical`].

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};

use penup::motion::{Brake, StepEvent, TICKS_PER_SECOND};
use rp2040_hal::pac::interrupt;

use super::engine::{
    BUSY, CHANNEL, LEVEL, PULSE_TICKS, TARGETS, WAIT_TICKS, channel, machine, target,
};
use super::word_ring::{GROUP, place, ring_address, sum, unpack, way};
use super::{BRAKED_TICKS, STATE};
use crate::boards::handler::Owned;
use crate::boards::pico::critical;
use crate::boards::pico::registers::{DMA, PIO0};

/// Words in a block that goes as planned, at most: the state machine's queue lasts while they are
/// looked at, some 45 cycles each.
const CALM_WORDS: u32 = 16;
/// Words in a block that is braked, at most: some 100 cycles each. The state machine's queue is as long, and
/// lasts 2000 cycles at 500,000 steps a second.
const BRAKED_WORDS: u32 = 8;
/// Groups in a block behind which enough waits, at most.
const FAR_GROUPS: u32 = 8;
/// Steps with fewer ticks are braked some at a time: above 200,000 a second.
const FAST_TICKS: u32 = TICKS_PER_SECOND / 200_000;

#[repr(align(64))] // Its size, so that the channel finds no end of a ring in it.
struct Block([AtomicU32; BRAKED_WORDS as usize]);
const _: () = assert!(align_of::<Block>() == size_of::<Block>());

/// The block that is braked.
static BRAKED: Block = Block([const { AtomicU32::new(0) }; BRAKED_WORDS as usize]);
pub static BRAKE: Owned<Brake> = Owned::empty();
/// The last block was braked. Written where the channel's interrupt is masked.
static BRAKING: AtomicBool = AtomicBool::new(false);
/// Words put into the ring; wraps. The main loop alone writes it.
pub static WRITTEN: AtomicU32 = AtomicU32::new(0);
/// Words that the channel was told to take; wraps. Written where the channel's interrupt is masked.
pub static TOLD: AtomicU32 = AtomicU32::new(0);
/// Words of a block that was given up, which the channel's count still shows. Written where the channel's interrupt
/// is masked.
pub static GIVEN_UP: AtomicU32 = AtomicU32::new(0);
/// A block is under way. Written where the channel's interrupt is masked.
pub static FEEDING: AtomicBool = AtomicBool::new(false);

/// How many words have left the channel and the state machine's queue.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn taken() -> u32 {
    critical::with_steps_masked(|| {
        loop {
            let left = DMA.read(channel::COUNT);
            let waiting = PIO0.read(machine::FIFO_LEVEL) & LEVEL;
            if left == DMA.read(channel::COUNT) {
                let to_come = left - GIVEN_UP.load(Ordering::Relaxed) + waiting;
                return TOLD.load(Ordering::Relaxed).wrapping_sub(to_come);
            }
        }
    })
}

/// Lets words that wait begin, unless some are under way.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn start() {
    critical::with_steps_masked(|| {
        if !FEEDING.load(Ordering::Relaxed) {
            feed();
        }
    });
}

/// Stops state machine and channel at once. The channel's interrupt does not come any more, until
/// [`let_interrupt_come`].
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
pub fn stop() {
    critical::with_steps_masked(|| {
        PIO0.write(machine::CONTROL, 0);
        DMA.write(channel::INTERRUPT_ENABLE, 0);
        DMA.write(channel::ABORT, CHANNEL);
        while DMA.read(channel::CONTROL) & BUSY != 0 {}
        DMA.write(channel::INTERRUPT, CHANNEL);
    });
}

/// The channel's interrupt comes again when a block has ended.
pub fn let_interrupt_come() {
    DMA.write(channel::INTERRUPT_ENABLE, CHANNEL);
}

/// Tells the channel what to take next. Called where its interrupt is masked.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn feed() {
    let told = TOLD.load(Ordering::Relaxed);
    let count = WRITTEN.load(Ordering::Acquire).wrapping_sub(told);
    FEEDING.store(count != 0, Ordering::Relaxed);
    // SAFETY: this is the handler that owns it, or the handler is masked.
    let Some(brake) = (unsafe { BRAKE.get() }) else { return };
    if count == 0 {
        return;
    }
    let (mut address, mut words) = (ring_address(told), count);
    if STATE.brake().is_on() {
        words = far_words(brake, told, count);
        // What had to be braked goes on so, and is not looked at twice.
        if words == 0 && !BRAKING.load(Ordering::Relaxed) {
            words = calm_words(brake, told, count);
        }
        if words == 0 {
            words = brake_evenly(brake, told, count);
            if words == 0 {
                words = brake_words(brake, told, count);
            }
            address = BRAKED.0.as_ptr() as u32;
        }
    }
    TOLD.store(told.wrapping_add(words), Ordering::Relaxed);
    GIVEN_UP.store(0, Ordering::Relaxed);
    // The channel reads what was written to the block and to the ring, and the compiler knows of no
    // reader.
    fence(Ordering::Release);
    DMA.write(channel::READ_ADDRESS, address);
    DMA.write(channel::START, words);
}

/// How many of the `count` words from `told` on go as planned, since enough waits behind them, whatever they are.
#[inline(always)]
fn far_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let group = told / GROUP;
    for groups in [FAR_GROUPS, 1] {
        let end = group.wrapping_add(groups).wrapping_mul(GROUP);
        let words = end.wrapping_sub(told);
        if words <= count && brake.pass_far(sum(end).load(Ordering::Relaxed), STATE.brake()) {
            return words;
        }
    }
    0
}

/// How many of the `count` words from `told` on go as planned, with one look at all of them; 0 if they
/// have to be looked at one by one.
#[inline(never)] // On its own it stays in the core's registers.
#[unsafe(link_section = ".data.in_ram")]
fn calm_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let (mut words, mut ticks) = (0, 0);
    let (mut around, mut longest, mut shortest) = (0, 0, u32::MAX);
    while words < count.min(CALM_WORDS) && ticks <= BRAKED_TICKS {
        let at = told.wrapping_add(words);
        let step = way(at).load(Ordering::Relaxed);
        let planned = place(at).load(Ordering::Relaxed) >> 8;
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

/// Copies a block of the `count` words from `told` on, with the same least ticks for all: far from rest, where there is little
/// time. Says how many they are; 0 if that will not do.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn brake_evenly(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let is_fast = place(told).load(Ordering::Relaxed) >> 8 < FAST_TICKS;
    if count < BRAKED_WORDS || !is_fast {
        return 0;
    }
    let (mut around, mut longest) = (0, 0);
    for number in 0..BRAKED_WORDS {
        let step = way(told.wrapping_add(number)).load(Ordering::Relaxed);
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
        let mut word = place(told.wrapping_add(number)).load(Ordering::Relaxed);
        if word >> 8 < least {
            word = least << 8 | word & 0xFF;
            is_braked = true;
        }
        braked.store(word, Ordering::Relaxed);
    }
    BRAKING.store(is_braked, Ordering::Relaxed);
    BRAKED_WORDS
}

/// Copies the first of the `count` words from `told` on, each step with as many ticks as it takes at
/// least. Says how many.
#[inline(never)]
#[unsafe(link_section = ".data.in_ram")]
fn brake_words(brake: &mut Brake, told: u32, count: u32) -> u32 {
    let beyond = PULSE_TICKS + STATE.pulse_ticks();
    let (mut words, mut ticks, mut more) = (0, 0, 0);
    for (number, braked) in (0..count).zip(&BRAKED.0) {
        let at = told.wrapping_add(number);
        let mut word = place(at).load(Ordering::Relaxed);
        let step = way(at).load(Ordering::Relaxed);
        if step != 0 {
            let mut least = brake.step(unpack(step), STATE.brake());
            let planned = (word >> 8) + beyond;
            if least > planned && number + 1 < count {
                // What follows may be a wait between two steps.
                let next = place(at.wrapping_add(1)).load(Ordering::Relaxed);
                if next & TARGETS == target::WAIT {
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

#[interrupt]
#[unsafe(link_section = ".data.in_ram")]
fn DMA_IRQ_0() {
    DMA.write(channel::INTERRUPT, CHANNEL);
    feed();
}
