//! Checks that in the Pico's image the step interrupt never waits for flash and never divides.
//!
//! The RP2040 runs code from flash through a cache, and each miss costs some 50 cycles. Between two
//! blocks of steps, the state machine is fed from a queue of 8 words, which lasts 2000 cycles at
//! the highest rate. Therefore the handlers of the steps, the functions that mask all interrupts,
//! and everything that these call must lie in RAM, together with the constants that they read. In
//! addition, the handlers must not divide, because the chip's divider holds the state of the
//! division that they interrupt (`src/boards/pico/divider.rs`).
//!
//! The check follows the branches of each function, and looks at the addresses that lie among the
//! code. It cannot follow calls by pointer; they are refused unless [`INDIRECT`] lists their
//! possible targets.

use std::collections::BTreeSet;
use std::ops::Range;

use anyhow::{Context, Result, bail, ensure};

use super::image::{Effect, Image, divides};

/// The interrupt handlers of the steps and of the events that share their queue.
pub const HANDLERS: [&str; 2] = ["DMA_IRQ_0", "PIO0_IRQ_0"];

/// Parts of the names of functions that may mask all interrupts although they lie in flash, because
/// nothing moves while they run.
const MASK_AT_REST: [&str; 4] = [
    // Set-up, before interrupts are enabled.
    "pico::take",
    // Erasing and writing flash. Callers do so only while the machine is stopped, because flash
    // cannot be read meanwhile.
    "pico::flash",
    "NorFlash>",
    // Panics and faults, after which nothing moves.
    "fault::make_safe",
];

/// Parts of the names of functions that call by pointer, each with parts of the names of the
/// functions that it may reach that way.
type Indirect<'l> = &'l [(&'l str, &'l [&'l str])];
const INDIRECT: Indirect = &[];

/// What to do about a function or constant in flash; the end of several messages.
const ADVICE: &str = "The step interrupt must not wait for flash. Place the function in RAM, by \
    #[unsafe(link_section = \".data.in_ram\")], or let it be inlined into its caller, by \
    #[inline(always)].";

/// Checks the image of a Pico whose RAM and flash have these addresses.
///
/// # Errors
/// A function or constant that must lie in RAM lies in flash, a handler divides, or a call by
/// pointer is not listed.
pub fn check(image: &Image, ram: Range<u64>, flash: Range<u64>) -> Result<()> {
    Graph { image, ram, flash, indirect: INDIRECT }.check()
}

/// The call graph of an image, with the rules for it.
struct Graph<'i> {
    image: &'i Image,
    ram: Range<u64>,
    flash: Range<u64>,
    indirect: Indirect<'i>,
}

impl Graph<'_> {
    /// Checks the handlers, and every function that masks all interrupts.
    fn check(&self) -> Result<()> {
        let mut done = BTreeSet::new();
        let functions = &self.image.functions;
        for handler in HANDLERS {
            let found = functions.iter().find(|(_, (name, _))| name == handler);
            let (start, _) = found.with_context(|| format!("there is no handler {handler}"))?;
            self.follow(*start, &mut Vec::new(), &mut done)?;
        }
        for (start, (name, end)) in functions {
            let may = MASK_AT_REST.iter().any(|part| name.contains(part));
            if !may && self.image.effects(*start, *end).any(|effect| effect == Effect::Mask) {
                self.follow(*start, &mut Vec::new(), &mut done).with_context(|| {
                    format!("{name} masks all interrupts, that of the steps too")
                })?;
            }
        }
        Ok(())
    }

    /// Checks the function at this address, which the last of `callers` calls, and all that it
    /// calls.
    fn follow(
        &self,
        start: u64,
        callers: &mut Vec<String>,
        done: &mut BTreeSet<u64>,
    ) -> Result<()> {
        let start = self.image.past_veneer(start);
        if !done.insert(start) {
            return Ok(());
        }
        let name = self.image.name(start);
        let through = match &callers[..] {
            [] => String::new(),
            callers => format!(", called by {}", callers.join(" > ")),
        };
        ensure!(
            !divides(&name),
            "{name}{through}: it divides, and the divider may be in the middle of another \
             division. \
            Let a handler of the steps shift or multiply instead."
        );
        ensure!(self.ram.contains(&start), "{name} lies in flash{through}. {ADVICE}");
        let Some((_, end)) = self.image.functions.get(&start) else {
            bail!("{start:#010x}{through} is no function. Let branches lead to functions.");
        };
        for address in (start.next_multiple_of(4)..*end).step_by(4) {
            let constant = self.image.word(address).filter(|_| !self.image.is_code(address));
            if let Some(constant) = constant.filter(|constant| self.flash.contains(constant)) {
                bail!(
                    "{name}{through} uses {} at {constant:#010x} in flash. {ADVICE} Constants \
                    that it reads lie in RAM if they are atomic.",
                    self.image.name(constant)
                );
            }
        }
        callers.push(name.clone());
        for effect in self.image.effects(start, *end) {
            match effect {
                Effect::Branch(target) if !(start..*end).contains(&target) => {
                    self.follow(target, callers, done)?;
                }
                Effect::Indirect => self.follow_indirect(&name, callers, done)?,
                _ => {}
            }
        }
        callers.pop();
        Ok(())
    }

    /// Checks everything that [`INDIRECT`] lists as reachable by pointer from the function `name`.
    fn follow_indirect(
        &self,
        name: &str,
        callers: &mut Vec<String>,
        done: &mut BTreeSet<u64>,
    ) -> Result<()> {
        let listed = self.indirect.iter().find(|(part, _)| name.contains(part));
        let (_, targets) = listed.with_context(|| {
            format!(
                "{} calls or jumps by a pointer, so that nobody knows whether that leads to flash. \
                Call directly, or list what it may reach in xtask/src/firmware/in_ram.rs.",
                callers.join(" > ")
            )
        })?;
        for target in *targets {
            let mut found =
                self.image.functions.iter().filter(|(_, (name, _))| name.contains(target));
            let (start, _) =
                found.next().with_context(|| format!("there is no function {target}"))?;
            self.follow(*start, callers, done)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::image::by_hand::{FLASH, RAM, RETURN, call, image};

    fn checked_with(functions: &[(&str, u64, &[u16])], indirect: Indirect) -> Result<(), String> {
        let (ram, flash) = (RAM..RAM + 0x1000, FLASH..FLASH + 0x1000);
        let image = image(functions);
        let graph = Graph { image: &image, ram, flash, indirect };
        graph.check().map_err(|error| format!("{error:#}"))
    }

    fn checked(functions: &[(&str, u64, &[u16])]) -> Result<(), String> {
        checked_with(functions, &[])
    }

    #[test]
    fn a_handler_in_ram_with_what_it_calls_passes() {
        let [first, second] = call(RAM + 2, RAM + 0x100);
        let handler = [0xB500, first, second, 0xBD00];
        let data = [RETURN, 0, 0, 0, 0x000C, 0x5000];
        assert_eq!(checked(&[("DMA_IRQ_0", RAM, &handler), ("feed", RAM + 0x100, &data)]), Ok(()));
    }

    #[test]
    fn a_handler_in_flash_is_refused() {
        let refusal = checked(&[("DMA_IRQ_0", FLASH, &[RETURN])]).unwrap_err();
        assert!(refusal.starts_with("DMA_IRQ_0 lies in flash. The step"), "{refusal}");
    }

    #[test]
    fn what_is_called_in_flash_by_way_of_a_veneer_is_refused_and_its_caller_named() {
        let [first, second] = call(RAM, RAM + 0x80);
        let [again, once_more] = call(RAM + 0x80, RAM + 0x100);
        let target = FLASH + 0x200 + 1;
        let veneer = [0xB403, 0x4801, 0x9001, 0xBD01, target as u16, (target >> 16) as u16];
        let refusal = checked(&[
            ("DMA_IRQ_0", RAM, &[first, second, RETURN]),
            ("feed", RAM + 0x80, &[again, once_more, RETURN]),
            ("veneer", RAM + 0x100, &veneer),
            ("pass_evenly", FLASH + 0x200, &[RETURN]),
        ]);
        let refusal = refusal.unwrap_err();
        assert!(
            refusal.starts_with("pass_evenly lies in flash, called by DMA_IRQ_0 > feed. "),
            "{refusal}"
        );
        assert!(refusal.contains("link_section"), "{refusal}");
    }

    #[test]
    fn a_branch_without_return_counts_as_a_call() {
        // To `feed`, which calls by a pointer.
        let branch = ("DMA_IRQ_0", RAM, &[0xE07E][..]);
        let refusal = checked(&[branch, ("feed", RAM + 0x100, &[0x4798, RETURN])]);
        assert!(refusal.unwrap_err().starts_with("DMA_IRQ_0 > feed calls or jumps"));
    }

    #[test]
    fn a_constant_in_flash_is_refused() {
        let data = [0x4800, RETURN, 0, 0, 0x0300, 0x1000];
        let refusal = checked(&[("DMA_IRQ_0", RAM, &data), ("TABLE", FLASH + 0x300, &[1, 2])]);
        let refusal = refusal.unwrap_err();
        assert!(refusal.starts_with("DMA_IRQ_0 uses TABLE at 0x10000300 in flash"), "{refusal}");
    }

    #[test]
    fn division_is_refused_in_ram_too() {
        let [first, second] = call(RAM, RAM + 0x80);
        let handler = ("DMA_IRQ_0", RAM, &[first, second][..]);
        let refusal = checked(&[handler, ("__aeabi_uidivmod", RAM + 0x80, &[RETURN])]);
        assert!(refusal.unwrap_err().contains("it divides"));
    }

    #[test]
    fn calls_by_pointer_are_refused_unless_listed() {
        let blx = [0x4798, RETURN];
        for jump in [blx, [0x4718, RETURN], [0x469F, RETURN], [0x449F, RETURN]] {
            let refusal = checked(&[("DMA_IRQ_0", RAM, &jump)]).unwrap_err();
            assert!(refusal.contains("by a pointer"), "{refusal}");
        }
        let functions =
            |position| [("DMA_IRQ_0", RAM, &blx[..]), ("work", position, &[RETURN][..])];
        let listed: Indirect = &[("DMA_IRQ_0", &["work"])];
        assert_eq!(checked_with(&functions(RAM + 0x80), listed), Ok(()));
        assert!(checked_with(&functions(FLASH), listed).is_err());
    }

    #[test]
    fn who_masks_all_interrupts_lies_in_ram_unless_nothing_moves_then() {
        let handler = ("DMA_IRQ_0", RAM, &[RETURN][..]);
        let masks = [0xB672, RETURN];
        let refusal = checked(&[handler, ("taken", FLASH, &masks)]).unwrap_err();
        assert!(refusal.starts_with("taken masks all interrupts"), "{refusal}");
        assert_eq!(checked(&[handler, ("taken", RAM + 0x80, &masks)]), Ok(()));
        assert_eq!(checked(&[handler, ("firmware::boards::pico::take", FLASH, &masks)]), Ok(()));
    }
}
