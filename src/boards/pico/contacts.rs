//! The limit switches and the emergency stop; each closes its input to ground.
//!
//! The contacts are sampled every millisecond. A change counts when two of the last three samples
//! have shown it, so interference from motors and cables in a single sample is not taken for a
//! switch. After a change the contact may bounce for [`BOUNCE_MILLISECONDS`]; then it is sampled
//! again.
//!
//! At power-up an open contact reads as closed until the pull-up of 50 to 80 kΩ has charged the
//! filter at the switch, which takes 8 ms for 100 nF. So nothing is sampled for
//! [`SETTLE_MICROSECONDS`], which is enough for 470 nF.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::machine::Contacts;

use super::registers::{Get, SIO};
use super::{ROW, clock};
use crate::boards::handler::Owned;

/// The number of milliseconds after a change of a contact in which its further changes are ignored.
const BOUNCE_MILLISECONDS: u8 = 10;
/// The pin of the limit switch of x. Those of y and of the emergency stop follow.
const FIRST_PIN: u8 = ROW.pins.limit_x;
const _: () = assert!(ROW.pins.limit_y == FIRST_PIN + 1 && ROW.pins.stop == FIRST_PIN + 2);
/// The number of contacts: two limit switches and the emergency stop.
const COUNT: usize = 3;
/// The bits of all contacts, bit 0 for the limit switch of x.
const ALL: u8 = (1 << COUNT) - 1;

/// The time from switching the pull-ups on to the first sample, in microseconds.
const SETTLE_MICROSECONDS: u32 = 50_000;
/// The time between the samples that are taken at the start, in microseconds.
const SAMPLE_MICROSECONDS: u32 = 1000;

/// The contacts that count as closed, one bit for each. The clock's handler writes it.
static CLOSED: AtomicU8 = AtomicU8::new(0);
/// The samples so far, which belong to the clock's handler.
static SAMPLES: Owned<Samples> = Owned::empty();

/// What the clock's handler remembers between two samples of the contacts.
struct Samples {
    /// One bit for each contact that was closed in the last two samples.
    last: [u8; 2],
    /// The number of samples for which each contact may still bounce.
    bounces: [u8; COUNT],
}

impl Samples {
    /// Takes a sample. Returns the contacts that at least two of the last three samples have shown
    /// closed.
    fn sample(&mut self) -> u8 {
        let ([last, before], now) = (self.last, closed_now());
        self.last = [now, last];
        now & last | now & before | last & before
    }
}

/// Returns a bit for each contact that reads closed at this instant.
fn closed_now() -> u8 {
    // Open inputs are pulled up, so they read high.
    !(SIO.gpio_in().get() >> FIRST_PIN) as u8 & ALL
}

/// Does nothing for `time` microseconds.
fn wait(time: u32) {
    let began = clock::microseconds();
    while clock::microseconds().wrapping_sub(began) < time {}
}

/// Samples the contacts for the first time, before the clock's interrupt runs. It expects the
/// pull-ups to have been switched on just now.
pub fn set_up() {
    wait(SETTLE_MICROSECONDS);
    let mut samples = Samples { last: [0; 2], bounces: [0; COUNT] };
    for _ in 0..3 {
        wait(SAMPLE_MICROSECONDS);
        CLOSED.store(samples.sample(), Ordering::Relaxed);
    }
    // SAFETY: the clock's interrupt is still masked.
    unsafe { SAMPLES.fill(samples) };
}

/// Samples the contacts. The clock's interrupt calls it every millisecond.
pub fn sample() {
    // SAFETY: the clock's handler owns it, and is the only caller.
    let Some(samples) = (unsafe { SAMPLES.get() }) else { return };
    let before = CLOSED.load(Ordering::Relaxed);
    let changed = samples.sample() ^ before;
    let mut closed = before;
    for (number, left) in (0..).zip(&mut samples.bounces) {
        if *left > 0 {
            *left -= 1;
        } else if changed & 1 << number != 0 {
            closed ^= 1 << number;
            *left = BOUNCE_MILLISECONDS;
        }
    }
    CLOSED.store(closed, Ordering::Relaxed);
}

/// Returns the contacts that count as closed, because two of the last three samples have shown it.
pub fn closed() -> Contacts {
    let closed = CLOSED.load(Ordering::Relaxed);
    Contacts { x: closed & 1 != 0, y: closed & 2 != 0, stop: closed & 4 != 0 }
}
