//! Checks that in the Pico's image the step interrupt never waits for flash and never divides.
//!
//! The RP2040 runs code from flash through a cache, and each miss costs some 50 cycles. Between two
//! blocks of steps, the state machine is fed from a queue of 8 words, which lasts 2000 cycles at
//! the highest rate. Therefore the handlers of the steps, the functions that mask all interrupts,
//! and everything that these call must lie in RAM, together with the constants that they read. In
//! addition, the handlers must not divide, because the chip's divider holds the state of the
//! division that they interrupt (`src/boards/pico/divider.rs`).
//!
//! The check reads the linked image. It decodes the branches of each function, follows them through
//! the linker's veneers, and looks at the addresses that lie among the code. It cannot follow calls
//! by pointer; they are refused unless [`INDIRECT`] lists their possible targets.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use rustc_demangle::demangle;

/// The interrupt handlers of the steps and of the events that share their queue.
const HANDLERS: [&str; 2] = ["DMA_IRQ_0", "PIO0_IRQ_0"];

/// Parts of the names of functions that may mask all interrupts although they lie in flash, because
/// nothing moves while they run.
const MASK_AT_REST: [&str; 6] = [
    // Set-up, before interrupts are enabled.
    "pico::take",
    // Erasing and writing flash. Callers do so only while the machine is stopped, because flash
    // cannot be read meanwhile.
    "pico::flash",
    "NorFlash>",
    // Handlers of emergencies and faults, after which nothing moves.
    "pico::emergency",
    "fault::hard_fault",
    "fault::panic",
];

/// Parts of the names of functions that call by pointer, each with parts of the names of the
/// functions that it may reach that way.
type Indirect<'l> = &'l [(&'l str, &'l [&'l str])];
const INDIRECT: Indirect = &[];

/// What to do about a function or constant in flash; the end of several messages.
const ADVICE: &str = "The step interrupt must not wait for flash. Place the function in RAM, by \
    #[unsafe(link_section = \".data.in_ram\")], or let it be inlined into its caller, by #[inline(always)].";

/// Checks the image of a Pico whose RAM and flash have these addresses.
///
/// # Errors
/// A function or constant that must lie in RAM lies in flash, a handler divides, or a call by
/// pointer is not listed.
pub fn check(elf: &object::File, ram: Range<u64>, flash: Range<u64>) -> Result<()> {
    let image = Image::read(elf)?;
    Graph { image: &image, ram, flash, indirect: INDIRECT }.check()
}

/// The parts of an image that the check needs.
#[derive(Default)]
struct Image {
    /// The bytes of each section, by its address.
    memory: BTreeMap<u64, Vec<u8>>,
    /// The name and end address of each function, by its address.
    functions: BTreeMap<u64, (String, u64)>,
    /// The addresses from which on there is code (`true`) or data.
    marks: BTreeMap<u64, bool>,
}

impl Image {
    /// Reads the sections, functions and marks of an ELF file.
    fn read(elf: &object::File) -> Result<Self> {
        let mut image = Self::default();
        for section in elf.sections().filter(|section| section.address() != 0) {
            image.memory.insert(section.address(), section.data().unwrap_or_default().to_vec());
        }
        for symbol in elf.symbols() {
            let (name, address) = (symbol.name()?, symbol.address());
            match name.as_bytes() {
                [b'$', b't', ..] => _ = image.marks.insert(address & !1, true),
                [b'$', b'd', ..] => _ = image.marks.insert(address, false),
                _ if symbol.kind() == SymbolKind::Text => {
                    let (start, name) = (address & !1, format!("{:#}", demangle(name)));
                    image.functions.insert(start, (name, start + symbol.size()));
                }
                _ => {}
            }
        }
        image.end_functions();
        Ok(image)
    }

    /// Gives functions written in assembly, which have no size, an end: the start of the next
    /// function, or the end of their section.
    fn end_functions(&mut self) {
        let starts: Vec<u64> = self.functions.keys().copied().collect();
        for (index, start) in starts.iter().enumerate() {
            let section = self.memory.range(..=*start).next_back();
            let end = section.map_or(*start, |(from, bytes)| from + bytes.len() as u64);
            let next = starts.get(index + 1).copied().unwrap_or(end).min(end);
            if let Some((_, end)) = self.functions.get_mut(start)
                && end == start
            {
                *end = next;
            }
        }
    }

    /// The half word at an address.
    fn half(&self, address: u64) -> Option<u32> {
        let (start, bytes) = self.memory.range(..=address).next_back()?;
        let at = usize::try_from(address - start).ok()?;
        let half = bytes.get(at..at + 2)?;
        Some(u32::from(u16::from_le_bytes(half.try_into().ok()?)))
    }

    /// The word at an address.
    fn word(&self, address: u64) -> Option<u64> {
        Some(u64::from(self.half(address)? | self.half(address + 2)? << 16))
    }

    /// Whether there is code, not data, at an address.
    fn is_code(&self, address: u64) -> bool {
        self.marks.range(..=address).next_back().is_none_or(|(_, is_code)| *is_code)
    }

    /// The target of a branch to this address, which may be a veneer of the linker: `PUSH {r0,
    /// r1}`, `LDR r0, [PC, #4]`, `STR r0, [SP, #4]`, `POP {r0, PC}`, and the target.
    fn past_veneer(&self, address: u64) -> u64 {
        const VENEER: [u32; 4] = [0xB403, 0x4801, 0x9001, 0xBD01];
        let is_veneer = (0..)
            .zip(VENEER)
            .all(|(index, half)| self.half(address + 2 * index).is_some_and(|found| found == half));
        match self.word(address + 8) {
            Some(target) if is_veneer => target & !1,
            _ => address,
        }
    }

    /// The name of the function at an address, or the address.
    fn name(&self, address: u64) -> String {
        match self.functions.range(..=address).next_back() {
            Some((_, (name, end))) if address < *end => name.clone(),
            _ => format!("{address:#010x}"),
        }
    }
}

/// The effects of an instruction that matter to the check.
#[derive(Debug, PartialEq, Eq)]
enum Effect {
    Nothing,
    /// A branch or a call to this address.
    Branch(u64),
    /// A call or a jump to the address in a register.
    Indirect,
    /// The instruction masks all interrupts.
    Mask,
}

/// Decodes the instruction at this address, of one or two half words (ARMv6-M Architecture
/// Reference Manual, A5). Returns its length in bytes and its effect.
fn decode(address: u64, first: u32, second: u32) -> (u64, Effect) {
    /// The lower `bits` of a value, sign-extended.
    fn signed(value: u32, bits: u32) -> i64 {
        i64::from((value << (32 - bits)).cast_signed() >> (32 - bits))
    }
    let target = |offset: i64| Effect::Branch((address + 4).wrapping_add_signed(offset));
    if first >> 11 >= 0b11101 {
        let is_call = first >> 11 == 0b11110 && second & 0xD000 == 0xD000;
        if !is_call {
            return (4, Effect::Nothing);
        }
        let sign = first >> 10 & 1;
        let [high, low] = [second >> 13, second >> 11].map(|bit| !(bit ^ sign) & 1);
        let upper = sign << 24 | high << 23 | low << 22;
        return (4, target(signed(upper | (first & 0x3FF) << 12 | (second & 0x7FF) << 1, 25)));
    }
    const LINK: u32 = 14;
    let effect = match first {
        0xB672 => Effect::Mask,
        // BX, BLX, and MOV and ADD to the program counter. BX to the link register is a return.
        _ if first & 0xFF87 == 0x4700 && first >> 3 & 15 == LINK => Effect::Nothing,
        _ if [0x4700, 0x4780, 0x4687, 0x4487].contains(&(first & 0xFF87)) => Effect::Indirect,
        _ if first >> 11 == 0b11100 => target(signed(first << 1, 12)),
        _ if first >> 12 == 0b1101 && first >> 9 & 7 != 0b111 => target(signed(first << 1, 9)),
        _ => Effect::Nothing,
    };
    (2, effect)
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
            if !may && self.effects(*start, *end).any(|effect| effect == Effect::Mask) {
                self.follow(*start, &mut Vec::new(), &mut done).with_context(|| {
                    format!("{name} masks all interrupts, that of the steps too")
                })?;
            }
        }
        Ok(())
    }

    /// The effect of each instruction of a function.
    fn effects(&self, start: u64, end: u64) -> impl Iterator<Item = Effect> {
        let mut at = start;
        std::iter::from_fn(move || {
            while at < end && !self.image.is_code(at) {
                at += 2;
            }
            let first = self.image.half(at).filter(|_| at < end)?;
            let (length, effect) = decode(at, first, self.image.half(at + 2).unwrap_or(0));
            at += length;
            Some(effect)
        })
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
        let by_way_of = match &callers[..] {
            [] => String::new(),
            callers => format!(", called by {}", callers.join(" > ")),
        };
        let is_intrinsic = name.starts_with("__") && name.contains("div");
        let divides = is_intrinsic || name.contains("div_rem");
        ensure!(
            !divides,
            "{name}{by_way_of}: it divides, and the divider may be in the middle of another division. \
            Let a handler of the steps shift or multiply instead."
        );
        ensure!(self.ram.contains(&start), "{name} lies in flash{by_way_of}. {ADVICE}");
        let Some((_, end)) = self.image.functions.get(&start) else {
            bail!("{start:#010x}{by_way_of} is no function. Let branches lead to functions.");
        };
        for address in (start.next_multiple_of(4)..*end).step_by(4) {
            let constant = self.image.word(address).filter(|_| !self.image.is_code(address));
            if let Some(constant) = constant.filter(|constant| self.flash.contains(constant)) {
                bail!(
                    "{name}{by_way_of} uses {} at {constant:#010x} in flash. {ADVICE} Constants \
                    that it reads lie in RAM if they are atomic.",
                    self.image.name(constant)
                );
            }
        }
        callers.push(name.clone());
        for effect in self.effects(start, *end) {
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
                Call directly, or list what it may reach in xtask/src/in_ram.rs.",
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

    const RAM: u64 = 0x2000_0000;
    const FLASH: u64 = 0x1000_0000;
    const RETURN: u16 = 0x4770;

    /// An image of functions given by name, address and half words. Data begins at the first half
    /// word that is 0.
    fn image(functions: &[(&str, u64, &[u16])]) -> Image {
        let mut image = Image::default();
        let idle = ("PIO0_IRQ_0", RAM + 0xF00, &[RETURN][..]);
        for (name, start, halves) in functions.iter().chain([&idle]) {
            let bytes: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
            image.functions.insert(*start, ((*name).to_owned(), start + bytes.len() as u64));
            image.marks.insert(*start, true);
            if let Some(data) = halves.iter().position(|half| *half == 0) {
                image.marks.insert(start + 2 * data as u64, false);
            }
            image.memory.insert(*start, bytes);
        }
        image
    }

    fn checked_with(functions: &[(&str, u64, &[u16])], indirect: Indirect) -> Result<(), String> {
        let (ram, flash) = (RAM..RAM + 0x1000, FLASH..FLASH + 0x1000);
        let image = image(functions);
        let graph = Graph { image: &image, ram, flash, indirect };
        graph.check().map_err(|error| format!("{error:#}"))
    }

    fn checked(functions: &[(&str, u64, &[u16])]) -> Result<(), String> {
        checked_with(functions, &[])
    }

    /// Half words of a call from one address to another.
    fn call(from: u64, to: u64) -> [u16; 2] {
        let offset = (to.wrapping_sub(from + 4) as u32) >> 1;
        let sign = offset >> 23 & 1;
        let [high, low] = [offset >> 22, offset >> 21].map(|bit| !(bit ^ sign) & 1);
        let first = 0xF000 | sign << 10 | offset >> 11 & 0x3FF;
        [first as u16, (0xD000 | high << 13 | low << 11 | offset & 0x7FF) as u16]
    }

    #[test]
    fn branches_lead_where_the_manual_says() {
        // As assembled by LLVM: BL forwards and backwards, B, BNE.
        let cases = [
            (0x1000_043A, 0xF00F, 0xFFE5, 0x1001_0408),
            (0x1001_04C0, 0xF7FF, 0xFE42, 0x1001_0148),
            (0x2000_0010, 0xE7FE, 0, 0x2000_0010),
            (0x2000_0010, 0xD1FB, 0, 0x2000_000A),
        ];
        for (address, first, second, target) in cases {
            assert_eq!(decode(address, first, second).1, Effect::Branch(target));
        }
        let [first, second] = call(0x1000_043A, 0x1001_0408);
        assert_eq!((first, second), (0xF00F, 0xFFE5));
        assert_eq!(decode(0, 0xDF00, 0), (2, Effect::Nothing), "SVC is no branch");
        assert_eq!(decode(0, 0xF3BF, 0x8F5F), (4, Effect::Nothing), "nor is DMB");
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
        let functions = |place| [("DMA_IRQ_0", RAM, &blx[..]), ("work", place, &[RETURN][..])];
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
