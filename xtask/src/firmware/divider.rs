//! Checks that in the Pico's image no interrupt handler disturbs a division of the main loop.
//!
//! The chip's divider is a peripheral: its operands and results lie in registers that the main loop
//! and the handlers share. A handler that divides must restore them, by
//! `divider::keep_during` (`src/boards/pico/divider.rs`). Forgetting that gives a wrong quotient
//! once in some millions of interrupts, which no test finds.
//!
//! The check follows every branch from each handler that the vector table names, except into
//! `keep_during`, and refuses a way to a division. A call by pointer may lead to a division, so it
//! is refused too. The handlers of the steps may not divide at all: see [`super::in_ram`].

use std::collections::BTreeSet;

use anyhow::{Result, ensure};

use super::image::{Effect, Image, divides};
use super::in_ram;

/// A part of the name of the function that restores the divider after what it calls.
const KEEPS: &str = "divider::keep_during";

/// Exceptions that never return to what they have interrupted.
const NEVER_RETURN: [&str; 3] = ["Reset", "HardFault", "DefaultHandler_"];

/// Parts of the names of functions from which the program never goes on.
const PANICS: [&str; 4] = ["panicking::", "unwrap_failed", "expect_failed", "slice_index_fail"];

/// Checks the handlers in the vector table `vectors`, whose first word is the stack pointer.
///
/// # Errors
/// A handler divides, or calls by a pointer, without keeping the divider.
pub fn check(image: &Image, vectors: &[u8]) -> Result<()> {
    let (words, _) = vectors.as_chunks::<4>();
    let handlers = words.iter().skip(1).map(|word| u64::from(u32::from_le_bytes(*word)) & !1);
    for handler in handlers.filter(|address| *address != 0).collect::<BTreeSet<_>>() {
        let name = image.name(handler);
        if ![&NEVER_RETURN[..], &in_ram::HANDLERS].concat().contains(&&*name) {
            follow(image, handler, &mut Vec::new(), &mut BTreeSet::new())?;
        }
    }
    Ok(())
}

/// Checks the function at this address, which the last of `callers` calls, and all that it calls.
fn follow(
    image: &Image,
    start: u64,
    callers: &mut Vec<String>,
    done: &mut BTreeSet<u64>,
) -> Result<()> {
    let start = image.past_veneer(start);
    let name = image.name(start);
    let ends = name.contains(KEEPS) || PANICS.iter().any(|part| name.contains(part));
    if ends || !done.insert(start) {
        return Ok(());
    }
    callers.push(name.clone());
    let call_path = callers.join(" > ");
    const ADVICE: &str = "and the main loop may be in the middle of a division. Do the work of \
        the handler in divider::keep_during.";
    ensure!(!divides(&name), "{call_path}: the handler divides, {ADVICE}");
    let end = image.functions.get(&start).map_or(start, |(_, end)| *end);
    for effect in image.effects(start, end) {
        match effect {
            Effect::Branch(target) if !(start..end).contains(&target) => {
                follow(image, target, callers, done)?;
            }
            Effect::Indirect => {
                ensure!(
                    false,
                    "{call_path}: the handler calls by a pointer, which may divide, {ADVICE}"
                );
            }
            _ => {}
        }
    }
    callers.pop();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::image::by_hand::{FLASH, RETURN, call, image};

    /// Checks an image whose vector table names the function at the start of flash.
    fn checked(functions: &[(&str, u64, &[u16])]) -> Result<(), String> {
        let vectors = [0x2000_3000, FLASH as u32 | 1, 0, FLASH as u32 | 1];
        let vectors: Vec<u8> = vectors.iter().flat_map(|word| word.to_le_bytes()).collect();
        check(&image(functions), &vectors).map_err(|error| format!("{error:#}"))
    }

    #[test]
    fn a_handler_that_divides_is_refused_unless_it_keeps_the_divider() {
        let to_work = call(FLASH, FLASH + 0x40);
        let to_division = call(FLASH + 0x40, FLASH + 0x80);
        let image = |handler, work| {
            checked(&[
                (handler, FLASH, &to_work),
                (work, FLASH + 0x40, &to_division),
                ("__aeabi_uidivmod", FLASH + 0x80, &[RETURN]),
            ])
        };
        let refusal = image("UART0_IRQ", "serve").unwrap_err();
        let expected = "UART0_IRQ > serve > __aeabi_uidivmod: the handler divides, and the main";
        assert!(refusal.starts_with(expected), "{refusal}");
        assert_eq!(image("UART0_IRQ", "firmware::boards::pico::divider::keep_during"), Ok(()));
        assert_eq!(image("UART0_IRQ", "core::panicking::panic_bounds_check"), Ok(()));
        assert_eq!(image("HardFault", "serve"), Ok(()));
    }

    #[test]
    fn a_handler_that_calls_by_pointer_is_refused_unless_it_keeps_the_divider() {
        let to_work = call(FLASH, FLASH + 0x40);
        let by_pointer = [0x4798, RETURN];
        let image =
            |work| checked(&[("USBCTRL_IRQ", FLASH, &to_work), (work, FLASH + 0x40, &by_pointer)]);
        assert!(image("serve").unwrap_err().contains("by a pointer"));
        assert_eq!(image("firmware::boards::pico::divider::keep_during::<serve>"), Ok(()));
    }

    #[test]
    fn a_handler_without_division_passes() {
        assert_eq!(checked(&[("TIMER_IRQ_0", FLASH, &[RETURN])]), Ok(()));
    }
}
