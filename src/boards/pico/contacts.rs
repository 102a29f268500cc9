//! Limit switches and emergency stop: each closes its input to ground.
//!
//! They are looked at every millisecond. A change counts at once; after it the contact may bounce for
//! [`BOUNCE_MILLISECONDS`], then it is looked at again.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::machine::Contacts;

use super::registers::SIO;
use crate::boards::handler::Owned;

const BOUNCE_MILLISECONDS: u8 = 10;
/// The limit switch of x; those of y and of the emergency stop follow.
const FIRST_PIN: u32 = 8;
const COUNT: usize = 3;
const ALL: u8 = (1 << COUNT) - 1;
const LEVELS: usize = 0x004;

/// A bit for each contact that counts as closed.
static CLOSED: AtomicU8 = AtomicU8::new(0);
static BOUNCES: Owned<[u8; COUNT]> = Owned::empty();

fn closed_now() -> u8 {
    // Open inputs are pulled up.
    !(SIO.read(LEVELS) >> FIRST_PIN) as u8 & ALL
}

/// Looks at the contacts for the first time, before the clock calls.
pub fn set_up() {
    CLOSED.store(closed_now(), Ordering::Relaxed);
    // SAFETY: the clock's interrupt is still masked.
    unsafe { BOUNCES.fill([0; COUNT]) };
}

/// Looks at the contacts: in the clock's interrupt, every millisecond.
pub fn look() {
    // SAFETY: the clock's handler owns it, and is the only caller.
    let Some(bounces) = (unsafe { BOUNCES.get() }) else { return };
    let before = CLOSED.load(Ordering::Relaxed);
    let changed = closed_now() ^ before;
    let mut closed = before;
    for (number, left) in (0..).zip(bounces) {
        if *left > 0 {
            *left -= 1;
        } else if changed & 1 << number != 0 {
            closed ^= 1 << number;
            *left = BOUNCE_MILLISECONDS;
        }
    }
    CLOSED.store(closed, Ordering::Relaxed);
}

/// Which count as closed.
pub fn closed() -> Contacts {
    let closed = CLOSED.load(Ordering::Relaxed);
    Contacts { x: closed & 1 != 0, y: closed & 2 != 0, stop: closed & 4 != 0 }
}
