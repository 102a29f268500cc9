//! Finds the calls of panic functions that are left in a board's image.
//!
//! Each call is counted to the innermost function of the project in the chain of functions that the
//! compiler inlined there, which the DWARF sections tell. So a bounds check inside a function of
//! the core library counts to the module that called it. A function of a library that was not
//! inlined, and that calls a panic function, counts as one itself: each call of it by the project
//! is a call that may panic.

use addr2line::gimli::{Dwarf, EndianSlice, LittleEndian};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// A call of a panic function.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct PanicCall {
    /// The file of the project that causes it, such as `src/order/euler.rs`; of a call outside the
    /// project, the file of a dependency; empty if the image does not tell.
    pub file: String,
    /// The line in that file.
    pub line: u32,
    /// The panic function that is called.
    pub function: String,
}

/// Whether a function of this name is called only to panic.
fn panics(name: &str) -> bool {
    let is_core = name.starts_with("core::") || name.starts_with("heapless::");
    let function = name.rsplit("::").next().unwrap_or_default();
    is_core
        && (name.contains("::panicking::")
            || function.starts_with("panic_")
            || ["_fail", "_failed", "_fail_rt", "fail"].iter().any(|end| function.ends_with(end)))
}

/// Finds the calls of panic functions in an ELF file for a Cortex-M, in the order of the files. The
/// calls that panic functions make among themselves do not count.
///
/// # Errors
/// The file is no ELF file, or its debug information cannot be read.
pub fn panic_calls(elf: &[u8]) -> Result<Vec<PanicCall>, Box<dyn Error>> {
    let file = object::File::parse(elf)?;
    let lines =
        addr2line::Context::from_dwarf(Dwarf::load(|section| -> Result<_, Box<dyn Error>> {
            let data = file.section_by_name(section.name()).map(|section| section.data());
            Ok(EndianSlice::new(data.transpose()?.unwrap_or_default(), LittleEndian))
        })?)?;
    let functions = functions(&file)?;
    let code = Code::new(&file)?;
    let tails = panicking_tails(&functions, &code);
    let callee = |target: u64| {
        let (name, _) = functions.get(&target)?;
        if panics(name) { Some(name) } else { tails.get(&target) }
    };
    // Functions of libraries that call a panic function, or another such function.
    let mut libraries: BTreeMap<u64, String> = BTreeMap::new();
    loop {
        let known = libraries.len();
        let mut calls = Vec::new();
        for (start, (name, end)) in &functions {
            if panics(name) || tails.contains_key(start) {
                continue;
            }
            for (at, target) in code.branches(*start, *end) {
                let found = callee(target).or_else(|| libraries.get(&target));
                let Some(function) = found.cloned() else { continue };
                let (file, line) = cause(&lines, at, name)?;
                if !file.starts_with("src/") && !name.starts_with("firmware::") {
                    libraries.entry(*start).or_insert_with(|| name.clone());
                }
                calls.push(PanicCall { file, line, function });
            }
        }
        if libraries.len() == known {
            calls.sort();
            return Ok(calls);
        }
    }
}

/// The end of a check of bounds that has failed: instructions of the image from which on it panics,
/// whatever the registers are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailedCheck {
    /// The address of the first of these instructions.
    pub address: u32,
    /// Where the panic says that it was, as `file:line:column`.
    pub place: String,
}

/// Finds failed checks of bounds in an ELF file for a Cortex-M, in the order of their addresses.
/// They are those whose last instructions load the place into the register of the third argument,
/// and move at most one other register, before they call the panic function.
///
/// # Errors
/// The file is no ELF file.
pub fn failed_checks(elf: &[u8]) -> Result<Vec<FailedCheck>, Box<dyn Error>> {
    /// `LDR R2, [PC, …]`, and `MOV R0, …` or `MOV R1, …`, without the bits that differ (ARMv6-M
    /// Architecture Reference Manual, A6.7.27 and A6.7.40).
    const LOAD_PLACE: u32 = 0x4A00;
    const MOVE: u32 = 0x4600;
    let file = object::File::parse(elf)?;
    let functions = functions(&file)?;
    let code = Code::new(&file)?;
    let mut checks = Vec::new();
    for (start, (_, end)) in &functions {
        for (call, target) in code.branches(*start, *end) {
            let Some((callee, _)) = functions.get(&target) else { continue };
            if !callee.ends_with("panicking::panic_bounds_check") {
                continue;
            }
            let loads = |at: u64| code.half(at).filter(|half| half & 0xFF00 == LOAD_PLACE);
            let moves = |at: u64| code.half(at).is_some_and(|half| half & 0xFF86 == MOVE);
            let Some((at, load)) = (loads(call - 2).map(|load| (call - 2, load)))
                .or_else(|| loads(call - 4).filter(|_| moves(call - 2)).map(|it| (call - 4, it)))
            else {
                continue;
            };
            // The place is a pointer to the name of a file, its length, the line and the column.
            let literal = ((at + 4) & !3) + u64::from(4 * (load & 0xFF));
            let word = |at: u64| Some(code.half(at)? | code.half(at + 2)? << 16);
            let words = word(literal).and_then(|place| {
                let place = u64::from(place);
                Some([word(place)?, word(place + 4)?, word(place + 8)?, word(place + 12)?])
            });
            let Some([name, length, line, column]) = words else { continue };
            let name = code.bytes(name.into(), length as usize).ok_or("no name")?;
            let name = String::from_utf8_lossy(name);
            let place = format!("{name}:{line}:{column}");
            checks.push(FailedCheck { address: at as u32, place });
        }
    }
    Ok(checks)
}

/// Finds the instructions that several functions share and that end in a call of a panic function,
/// with the name of that function, by their address. Where an image is made small, the compiler
/// stores such instructions once (its machine outliner); each call of them is a call of the panic.
fn panicking_tails(functions: &Functions, code: &Code<'_>) -> BTreeMap<u64, String> {
    let mut tails: BTreeMap<u64, String> = BTreeMap::new();
    // Shared instructions may call others.
    loop {
        let known = tails.len();
        for (start, (name, end)) in functions {
            if !name.starts_with("OUTLINED_FUNCTION_") {
                continue;
            }
            for (_, target) in code.branches(*start, *end) {
                let callee = functions.get(&target).map(|(name, _)| name);
                let panic = callee.filter(|name| panics(name)).or_else(|| tails.get(&target));
                if let Some(panic) = panic.cloned() {
                    tails.insert(*start, panic);
                }
            }
        }
        if tails.len() == known {
            return tails;
        }
    }
}

/// The name and end address of each function, by its address.
type Functions = BTreeMap<u64, (String, u64)>;

/// The functions of the image that have a size.
fn functions(file: &object::File<'_>) -> Result<Functions, Box<dyn Error>> {
    let mut functions = Functions::new();
    for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text) {
        let start = symbol.address() & !1;
        // The linker's jumps to functions that are far away count as the functions.
        let name = symbol.name()?;
        let name = name.split_once("Thunk_").map_or(name, |(_, target)| target);
        let name = format!("{:#}", rustc_demangle::demangle(name));
        // Functions with the same instructions are stored once, under several names.
        let entry = functions.entry(start).or_insert_with(|| (name.clone(), start + symbol.size()));
        if panics(&name) {
            entry.0 = name;
        }
    }
    Ok(functions)
}

/// The lines of a program by address.
type Lines<'e> = addr2line::Context<EndianSlice<'e, LittleEndian>>;

/// The file and line of the innermost function of the project at this address, which is in the
/// function `name`. An instruction that the compiler made of several lines has line 0, and often
/// the file of another function. Then the file is that of the outermost module in the function's
/// name.
fn cause(lines: &Lines<'_>, address: u64, name: &str) -> Result<(String, u32), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("no project")?;
    let mut outermost = (String::new(), 0);
    let mut frames = lines.find_frames(address).skip_all_loads()?;
    while let Some(frame) = frames.next()? {
        let Some(location) = frame.location else { continue };
        let (file, line) = (location.file.unwrap_or_default(), location.line.unwrap_or(0));
        let own = Path::new(file).strip_prefix(root).ok().filter(|own| own.starts_with("src"));
        match (own, line) {
            (Some(_), 0) => {
                let inlined = frame.function.map(|name| name.demangle().map(Cow::into_owned));
                let inlined = inlined.transpose()?.unwrap_or_default();
                if let Some(module) = module(&inlined).or_else(|| module(name)) {
                    let file = format!("src/{module}.rs");
                    let is_file = root.join(&file).is_file();
                    return Ok((if is_file { file } else { format!("src/{module}") }, 0));
                }
            }
            (Some(own), line) => return Ok((own.to_string_lossy().into_owned(), line)),
            (None, _) => {}
        }
        outermost = (own.unwrap_or(Path::new(file)).to_string_lossy().into_owned(), line);
    }
    // A function of a library that was made for the project's types or closures.
    if let Some(module) = module(name) {
        return Ok((format!("src/{module}"), 0));
    }
    Ok(outermost)
}

/// The outermost module in the name of a function of the library.
fn module(name: &str) -> Option<&str> {
    name.split("penup::").nth(1)?.split("::").next()
}

/// The instructions of an image.
struct Code<'e> {
    /// The bytes of each section, by its address.
    sections: BTreeMap<u64, &'e [u8]>,
    /// The addresses from which on there is code (`true`) or data.
    marks: BTreeMap<u64, bool>,
}

impl<'e> Code<'e> {
    fn new(file: &object::File<'e>) -> Result<Self, Box<dyn Error>> {
        let mut sections = BTreeMap::new();
        for section in file.sections().filter(|section| section.address() != 0) {
            sections.insert(section.address(), section.data()?);
        }
        let mut marks = BTreeMap::new();
        for symbol in file.symbols() {
            match symbol.name()?.as_bytes() {
                [b'$', b't', ..] => _ = marks.insert(symbol.address() & !1, true),
                [b'$', b'd', ..] => _ = marks.insert(symbol.address(), false),
                _ => {}
            }
        }
        Ok(Self { sections, marks })
    }

    /// So many bytes from an address on.
    fn bytes(&self, address: u64, count: usize) -> Option<&'e [u8]> {
        let (start, bytes) = self.sections.range(..=address).next_back()?;
        let at = usize::try_from(address - start).ok()?;
        bytes.get(at..at.checked_add(count)?)
    }

    /// The half word at an address.
    fn half(&self, address: u64) -> Option<u32> {
        let half = self.bytes(address, 2)?;
        Some(u32::from(u16::from_le_bytes(half.try_into().ok()?)))
    }

    /// The addresses and targets of the instructions `BL` and `B.W` from `start` to `end` (ARMv7-M
    /// Architecture Reference Manual, A7.7.12 and A7.7.18).
    fn branches(&self, start: u64, end: u64) -> Vec<(u64, u64)> {
        let mut branches = Vec::new();
        let mut at = start;
        while at < end {
            let is_code = self.marks.range(..=at).next_back().is_none_or(|(_, is_code)| *is_code);
            let (Some(first), Some(second)) = (self.half(at), self.half(at + 2)) else { break };
            if !is_code || first >> 11 < 0b11101 {
                at += 2;
                continue;
            }
            if first >> 11 == 0b11110 && second & 0x9000 == 0x9000 {
                let sign = first >> 10 & 1;
                let [high, low] = [second >> 13, second >> 11].map(|bit| !(bit ^ sign) & 1);
                let offset = sign << 24
                    | high << 23
                    | low << 22
                    | (first & 0x3FF) << 12
                    | (second & 0x7FF) << 1;
                let offset = i64::from((offset << 7).cast_signed() >> 7);
                branches.push((at, (at + 4).wrapping_add_signed(offset) & !1));
            }
            at += 4;
        }
        branches
    }
}
