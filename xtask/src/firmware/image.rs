//! The functions of a linked image for the Cortex-M0+, their branches and their constants.
//!
//! The checks of the Pico's image read it: they decode the branches of each function and follow
//! them through the linker's veneers.

use std::collections::BTreeMap;

use anyhow::Result;
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use rustc_demangle::demangle;

/// The parts of an image that the check needs.
#[derive(Default)]
pub struct Image {
    /// The bytes of each section, by its address.
    pub memory: BTreeMap<u64, Vec<u8>>,
    /// The name and end address of each function, by its address.
    pub functions: BTreeMap<u64, (String, u64)>,
    /// The addresses from which on there is code (`true`) or data.
    pub marks: BTreeMap<u64, bool>,
}

impl Image {
    /// Reads the sections, functions and marks of an ELF file.
    pub fn read(elf: &object::File) -> Result<Self> {
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
    pub fn half(&self, address: u64) -> Option<u32> {
        let (start, bytes) = self.memory.range(..=address).next_back()?;
        let at = usize::try_from(address - start).ok()?;
        let half = bytes.get(at..at + 2)?;
        Some(u32::from(u16::from_le_bytes(half.try_into().ok()?)))
    }

    /// The word at an address.
    pub fn word(&self, address: u64) -> Option<u64> {
        Some(u64::from(self.half(address)? | self.half(address + 2)? << 16))
    }

    /// Whether there is code, not data, at an address.
    pub fn is_code(&self, address: u64) -> bool {
        self.marks.range(..=address).next_back().is_none_or(|(_, is_code)| *is_code)
    }

    /// The target of a branch to this address, which may be a veneer of the linker: `PUSH {r0,
    /// r1}`, `LDR r0, [PC, #4]`, `STR r0, [SP, #4]`, `POP {r0, PC}`, and the target.
    pub fn past_veneer(&self, address: u64) -> u64 {
        /// The instructions of the linker by which code in RAM calls a function in flash.
        const VENEER: [u32; 4] = [0xB403, 0x4801, 0x9001, 0xBD01];
        let is_veneer = (0..)
            .zip(VENEER)
            .all(|(index, half)| self.half(address + 2 * index).is_some_and(|found| found == half));
        match self.word(address + 8) {
            Some(target) if is_veneer => target & !1,
            _ => address,
        }
    }

    /// The effect of each instruction of the function from `start` to `end`.
    pub fn effects(&self, start: u64, end: u64) -> impl Iterator<Item = Effect> {
        let mut at = start;
        std::iter::from_fn(move || {
            while at < end && !self.is_code(at) {
                at += 2;
            }
            let first = self.half(at).filter(|_| at < end)?;
            let (length, effect) = decode(at, first, self.half(at + 2).unwrap_or(0));
            at += length;
            Some(effect)
        })
    }

    /// The name of the function at an address, or the address.
    pub fn name(&self, address: u64) -> String {
        match self.functions.range(..=address).next_back() {
            Some((_, (name, end))) if address < *end => name.clone(),
            _ => format!("{address:#010x}"),
        }
    }
}

/// Whether the function of this name divides: the compiler's functions for division, and those of
/// the core library that divide step by step.
pub fn divides(name: &str) -> bool {
    name.starts_with("__") && name.contains("div") || name.contains("div_rem")
}

/// The effects of an instruction that matter to the check.
#[derive(Debug, PartialEq, Eq)]
pub enum Effect {
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

/// Images made by hand, for the tests of the checks.
#[cfg(test)]
pub mod by_hand {
    use super::Image;

    pub const RAM: u64 = 0x2000_0000;
    pub const FLASH: u64 = 0x1000_0000;
    pub const RETURN: u16 = 0x4770;

    /// An image of functions given by name, address and half words. Data begins at the first half
    /// word that is 0.
    pub fn image(functions: &[(&str, u64, &[u16])]) -> Image {
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

    /// Half words of a call from one address to another.
    pub fn call(from: u64, to: u64) -> [u16; 2] {
        let offset = (to.wrapping_sub(from + 4) as u32) >> 1;
        let sign = offset >> 23 & 1;
        let [high, low] = [offset >> 22, offset >> 21].map(|bit| !(bit ^ sign) & 1);
        let first = 0xF000 | sign << 10 | offset >> 11 & 0x3FF;
        [first as u16, (0xD000 | high << 13 | low << 11 | offset & 0x7FF) as u16]
    }
}

#[cfg(test)]
mod tests {
    use super::by_hand::call;
    use super::*;

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
}
