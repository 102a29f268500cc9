//! The limit switches and the emergency stop; each closes its input to ground.
//!
//! The contacts are sampled every millisecond. A change counts when two of the last three samples
//! have shown it, so interference from motors and cables in a single sample is not taken for a
//! switch. After a change the contact may bounce for [`BOUNCE_MILLISECONDS`]; then it is sampled
//! again.
//!
//! At power-up an open contact reads as closed until the pull-up of 50 to 80 kΩ has charged the
//! filter at the switch, which takes 8 ms for 100 nF. So nothing is sampled for
//! [`SETTLE_MILLISECONDS`], which is enough for 470 nF.

use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

use penup::machine::Contacts;

use super::ROW;
use super::registers::{Get, SIO};
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

/// The time from switching the pull-ups on to the first sample, in milliseconds.
const SETTLE_MILLISECONDS: u8 = 50;
/// The number of samples that are taken before the contacts are known for the first time.
const FIRST_SAMPLES: u8 = 3;

/// The contacts that count as closed, one bit for each. The clock's handler writes it.
static CLOSED: AtomicU8 = AtomicU8::new(0);
/// Whether the contacts are known. The clock's handler sets it.
static ARE_KNOWN: AtomicBool = AtomicBool::new(false);
/// The samples so far, which belong to the clock's handler.
static SAMPLES: Owned<Samples> = Owned::empty();

/// What the clock's handler remembers between two samples of the contacts.
struct Samples {
    /// The number of milliseconds until the contacts are known for the first time.
    unknown_for: u8,
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

/// Has the clock's interrupt sample the contacts. It expects the pull-ups to have been switched on
/// just now, and the interrupt to be masked.
pub fn set_up() {
    let unknown_for = SETTLE_MILLISECONDS + FIRST_SAMPLES;
    // SAFETY: the clock's interrupt is still masked.
    unsafe { SAMPLES.fill(Samples { unknown_for, last: [0; 2], bounces: [0; COUNT] }) };
}

/// Sleeps until the contacts are known. The clock's interrupt must run.
pub fn wait_until_known() {
    while !ARE_KNOWN.load(Ordering::Acquire) {
        cortex_m::asm::wfe();
    }
}

/// Samples the contacts. The clock's interrupt calls it every millisecond.
pub fn sample() {
    // SAFETY: the clock's handler owns it, and is the only caller.
    let Some(samples) = (unsafe { SAMPLES.get() }) else { return };
    if samples.unknown_for > 0 {
        samples.unknown_for -= 1;
        if samples.unknown_for < FIRST_SAMPLES {
            CLOSED.store(samples.sample(), Ordering::Relaxed);
        }
        ARE_KNOWN.store(samples.unknown_for == 0, Ordering::Release);
        return;
    }
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
