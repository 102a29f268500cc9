//! Checks that in the Pico's image every function that `boards/pico.x` wants side by side is there.
//!
//! The section `.hot` of that memory map lists functions by patterns over their mangled names,
//! because the library forbids the attribute that would place them. A pattern that matches nothing
//! causes no error of the linker: the function then lies elsewhere, and planning becomes slower. It
//! happens when a module is renamed, or when the compiler inlines the function. Nor does the linker
//! know that the functions must fit into the cache together.

use anyhow::{Context, Result, ensure};
use object::{Object, ObjectSection, ObjectSymbol};

/// The name of the section, in the memory map and in the image.
const SECTION: &str = ".hot";

/// The size of the flash's cache, in bytes (RP2040 data sheet, 2.6.3). It has two ways, so code of
/// this size that lies side by side has a place of its own there.
const CACHE_BYTES: u64 = 16 << 10;

/// Checks the section of the image `elf` against the memory map `map`.
///
/// # Errors
/// The map has no such section or no patterns, a pattern matches no function in the section, or the
/// section is larger than the cache.
pub fn check(elf: &object::File, map: &str) -> Result<()> {
    let section = elf.section_by_name(SECTION).context("the image has no section .hot")?;
    ensure!(
        section.size() <= CACHE_BYTES,
        "the section {SECTION} has {} bytes, more than the {CACHE_BYTES} of the flash's cache, so \
         that its functions drive each other out. Delete those from boards/pico.x that are run the \
         least.",
        section.size()
    );
    let range = section.address()..section.address() + section.size();
    let symbols = elf.symbols().filter(|symbol| range.contains(&(symbol.address() & !1)));
    let names: Vec<&str> = symbols.filter_map(|symbol| symbol.name().ok()).collect();
    every_pattern_matches(map, &names)
}

/// Checks that each pattern of the section in `map` matches one of the `names` of functions.
fn every_pattern_matches(map: &str, names: &[&str]) -> Result<()> {
    let patterns = patterns(map);
    ensure!(!patterns.is_empty(), "boards/pico.x lists no functions for the section {SECTION}");
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

/// The patterns of the input sections that `map` puts into the section.
fn patterns(map: &str) -> Vec<&str> {
    let body = map.split_once("\n  .hot ").and_then(|(_, rest)| rest.split_once("\n  }"));
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
}
";
    const PUSH: &str = "_ZN5penup7machine9segmenter4push17h0123E";

    #[test]
    fn every_pattern_must_match_a_function() {
        assert!(every_pattern_matches(MAP, &["$t", "__aeabi_lmul", PUSH]).is_ok());
        let renamed = ["__aeabi_lmul", "_ZN5penup7machine7chopper4push17h0123E"];
        let refusal = every_pattern_matches(MAP, &renamed).unwrap_err().to_string();
        let expected = "the pattern .text.*7machine9segmenter*4push* in boards/pico.x matches no";
        assert!(refusal.starts_with(expected), "{refusal}");
        assert!(every_pattern_matches(MAP, &[PUSH]).is_err());
    }

    #[test]
    fn a_map_without_patterns_is_refused() {
        assert!(every_pattern_matches("SECTIONS { }", &[PUSH]).is_err());
    }

    #[test]
    fn the_map_of_the_board_is_understood() {
        let patterns = patterns(include_str!("../../../boards/pico.x"));
        assert!(patterns.contains(&".text.__aeabi_lmul"), "{patterns:?}");
        assert!(patterns.len() > 5, "{patterns:?}");
    }

    #[test]
    fn a_star_stands_for_any_text() {
        assert!(matches("a*b*", "axxbyy") && matches("*", "") && matches("ab", "ab"));
        assert!(!matches("a*b", "axbc") && !matches("ab", "abc") && !matches("a*b*c", "acb"));
    }
}
