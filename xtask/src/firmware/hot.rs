//! Checks that in the Pico's image every function is there that `boards/pico.x` wants side by side
//! or in RAM.
//!
//! The sections `.hot`, `.hot_with_jerk` and `.hot_in_ram` of that memory map list functions by
//! patterns over their mangled names, because the library forbids the attribute that would place
//! them. A pattern that matches nothing causes no error of the linker: the function then lies
//! elsewhere, and planning becomes slower. It happens when a module is renamed, or when the
//! compiler inlines the function. Nor does the linker know that the functions must fit into the
//! cache together.

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSection, ObjectSymbol};

/// The name of the section in flash, in the memory map and in the image.
const IN_FLASH: &str = ".hot";

/// The name of the section in flash with what a limit on jerk needs besides.
const WITH_JERK: &str = ".hot_with_jerk";

/// The name of the section in RAM, in the memory map and in the image.
const IN_RAM: &str = ".hot_in_ram";

/// The size of the flash's cache, in bytes (RP2040 data sheet, 2.6.3). It has two ways, so code of
/// this size that lies side by side has a place of its own there.
const CACHE_BYTES: u64 = 16 << 10;

/// Checks the sections of the image `elf` against the memory map `map`.
///
/// # Errors
/// The map lacks one of the sections or its patterns, a pattern matches no function in its section,
/// or a section in flash is larger than the cache.
pub fn check(elf: &object::File, map: &str) -> Result<()> {
    for name in [IN_FLASH, WITH_JERK, IN_RAM] {
        let section = elf.section_by_name(name);
        let section = section.with_context(|| format!("the image has no section {name}"))?;
        ensure!(
            name == IN_RAM || section.size() <= CACHE_BYTES,
            "the section {name} has {} bytes, more than the {CACHE_BYTES} of the flash's cache, so \
             that its functions drive each other out. Delete those from boards/pico.x that are run \
             the least.",
            section.size()
        );
        let range = section.address()..section.address() + section.size();
        let symbols = elf.symbols().filter(|symbol| range.contains(&(symbol.address() & !1)));
        let names: Vec<&str> = symbols.filter_map(|symbol| symbol.name().ok()).collect();
        every_pattern_matches(map, name, &names)?;
    }
    Ok(())
}

/// Checks that each pattern of `section` in `map` matches one of the `names` of functions.
fn every_pattern_matches(map: &str, section: &str, names: &[&str]) -> Result<()> {
    let patterns = patterns(map, section);
    ensure!(!patterns.is_empty(), "boards/pico.x lists no functions for the section {section}");
    for pattern in patterns {
        let (of_section, of_name) = pattern.split_at(pattern.len().min(".text.".len()));
        ensure!(of_section == ".text.", "{pattern} in boards/pico.x is no section of a function");
        ensure!(
            names.iter().any(|name| matches(of_name, name)),
            "the pattern {pattern} in boards/pico.x matches no function, so that what it means \
             lies elsewhere in flash, and planning becomes slower. Was its module renamed, or is \
             it inlined now? Correct the pattern or delete it."
        );
    }
    Ok(())
}

/// The patterns of the input sections that `map` puts into `section`.
fn patterns<'m>(map: &'m str, section: &str) -> Vec<&'m str> {
    let head = format!("\n  {section} ");
    let body = map.split_once(&head).and_then(|(_, rest)| rest.split_once("\n  }"));
    let lines = body.map_or("", |(body, _)| body).lines();
    let lists = lines.filter_map(|line| line.trim().strip_prefix("*(")?.strip_suffix(");"));
    lists.flat_map(str::split_whitespace).collect()
}

/// Whether the whole `name` matches `pattern`, in which `*` stands for any text.
fn matches(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == name,
        Some((before, after)) => name.strip_prefix(before).is_some_and(|rest| {
            (0..=rest.len()).any(|at| rest.get(at..).is_some_and(|rest| matches(after, rest)))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "
SECTIONS
{
  .hot : ALIGN(8)
  {
    *(.text.__aeabi_lmul .text.*7machine9segmenter*4push*);
    . = ALIGN(8);
  } > FLASH
  .hot_in_ram : ALIGN(4)
  {
    *(.text.*9Lookahead13entry_allowed*);
  } > RAM AT>FLASH
}
";
    const PUSH: &str = "_ZN5penup7machine9segmenter4push17h0123E";

    #[test]
    fn every_pattern_must_match_a_function() {
        assert!(every_pattern_matches(MAP, IN_FLASH, &["$t", "__aeabi_lmul", PUSH]).is_ok());
        let renamed = ["__aeabi_lmul", "_ZN5penup7machine7chopper4push17h0123E"];
        let refusal = every_pattern_matches(MAP, IN_FLASH, &renamed).unwrap_err().to_string();
        let expected = "the pattern .text.*7machine9segmenter*4push* in boards/pico.x matches no";
        assert!(refusal.starts_with(expected), "{refusal}");
        assert!(every_pattern_matches(MAP, IN_FLASH, &[PUSH]).is_err());
    }

    #[test]
    fn each_section_has_its_own_patterns() {
        let entry_allowed = "_ZN5penup6motion9lookahead9Lookahead13entry_allowed17h0123E";
        assert!(every_pattern_matches(MAP, IN_RAM, &[entry_allowed]).is_ok());
        assert!(every_pattern_matches(MAP, IN_RAM, &["__aeabi_lmul", PUSH]).is_err());
    }

    #[test]
    fn a_map_without_patterns_is_refused() {
        assert!(every_pattern_matches("SECTIONS { }", IN_FLASH, &[PUSH]).is_err());
    }

    #[test]
    fn the_map_of_the_board_is_understood() {
        let map = include_str!("../../../boards/pico.x");
        let in_flash = patterns(map, IN_FLASH);
        assert!(in_flash.contains(&".text.__aeabi_lmul"), "{in_flash:?}");
        assert!(in_flash.len() > 5, "{in_flash:?}");
        assert!(patterns(map, IN_RAM).len() > 2);
    }

    #[test]
    fn a_star_stands_for_any_text() {
        assert!(matches("a*b*", "axxbyy") && matches("*", "") && matches("ab", "ab"));
        assert!(!matches("a*b", "axbc") && !matches("ab", "abc") && !matches("a*b*c", "acb"));
    }
}
