//! Limit switches and emergency stop: each closes its input to ground.
//!
//! They are looked at every millisecond. A change counts when two of the last three looks have
//! shown it: what motors and cables induce in a single look is no switch. After it the contact may
//! bounce for [`BOUNCE_MILLISECONDS`], then it is looked at again.
//!
//! At power-up an open contact reads as closed until the pull-up of 50 to 80 kΩ has charged the
//! filter at the switch: 8 ms for 100 nF. So for [`SETTLE_MICROSECONDS`] nothing is looked at,
//! which is enough for 470 nF.

use core::sync::atomic::{AtomicU8, Ordering};

use penup::machine::Contacts;

use super::clock;
use super::registers::SIO;
use crate::boards::handler::Owned;

const BOUNCE_MILLISECONDS: u8 = 10;
/// The limit switch of x; those of y and of the emergency stop follow.
const FIRST_PIN: u32 = 8;
const COUNT: usize = 3;
const ALL: u8 = (1 << COUNT) - 1;
const LEVELS: usize = 0x004;

/// What follows the pull-ups until the contacts are looked at.
const SETTLE_MICROSECONDS: u32 = 50_000;
const LOOK_MICROSECONDS: u32 = 1000;

/// A bit for each contact that counts as closed.
static CLOSED: AtomicU8 = AtomicU8::new(0);
static LOOKS: Owned<Looks> = Owned::empty();

/// What the clock's handler remembers of the contacts.
struct Looks {
    /// A bit for each contact that was closed at the last two looks.
    last: [u8; 2],
    /// For how many looks each may bounce.
    bounces: [u8; COUNT],
}

impl Looks {
    /// What two of three looks have shown, this being the third.
    fn look(&mut self) -> u8 {
        let ([last, before], now) = (self.last, closed_now());
        self.last = [now, last];
        now & last | now & before | last & before
    }
}

fn closed_now() -> u8 {
    // Open inputs are pulled up.
    !(SIO.read(LEVELS) >> FIRST_PIN) as u8 & ALL
}

fn wait(time: u32) {
    let began = clock::microseconds();
    while clock::microseconds().wrapping_sub(began) < time {}
}

/// Looks at the contacts for the first time, before the clock calls. The pins are pulled up since
/// just now.
pub fn set_up() {
    wait(SETTLE_MICROSECONDS);
    let mut looks = Looks { last: [0; 2], bounces: [0; COUNT] };
    for _ in 0..3 {
        wait(LOOK_MICROSECONDS);
        CLOSED.store(looks.look(), Ordering::Relaxed);
    }
    // SAFETY: the clock's interrupt is still masked.
    unsafe { LOOKS.fill(looks) };
}

/// Looks at the contacts: in the clock's interrupt, every millisecond.
pub fn look() {
    // SAFETY: the clock's handler owns it, and is the only caller.
    let Some(looks) = (unsafe { LOOKS.get() }) else { return };
    let before = CLOSED.load(Ordering::Relaxed);
    let changed = looks.look() ^ before;
    let mut closed = before;
    for (number, left) in (0..).zip(&mut looks.bounces) {
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
