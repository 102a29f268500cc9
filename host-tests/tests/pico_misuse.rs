//! Tests that the emulated Raspberry Pi Pico does not let pass what the chip would not bear: each
//! of these small programs is right but for one mistake, which must end the emulation.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

type TestResult = Result<(), Box<dyn Error>>;

/// The cycles of the emulated core in a second.
const HERTZ: u32 = 125_000_000;

/// What a program does in turn: five words, as the code in RAM reads them.
type Step = [u32; 5];

/// Writes a word to an address.
const fn write(address: u32, value: u32) -> Step {
    [1, address, value, 0, 0]
}

/// Reads the word at an address.
const fn read(address: u32) -> Step {
    [2, address, 0, 0, 0]
}

/// Calls a function with three arguments.
const fn call(function: u32, first: u32, second: u32, third: u32) -> Step {
    [3, function, first, second, third]
}

/// The addresses of functions of the emulated boot ROM, which stand in the order of its table.
mod rom {
    pub const CONNECT: u32 = 0x81;
    pub const EXIT_XIP: u32 = 0x85;
    pub const ERASE: u32 = 0x89;
    pub const PROGRAM: u32 = 0x8D;
    pub const FLUSH_CACHE: u32 = 0x91;
    pub const ENTER_XIP: u32 = 0x95;
}

/// Copies the code in RAM and the steps there, and jumps to that code. It stands behind the initial
/// stack pointer and the vector of the reset.
const START: [u16; 18] = [
    0x4805, // ldr r0, from where
    0x4906, // ldr r1, whereto
    0x4A06, // ldr r2, how many bytes
    0x3A04, // 1: subs r2, #4
    0x5883, // ldr r3, [r0, r2]
    0x508B, // str r3, [r1, r2]
    0xD1FB, // bne 1b
    0x3101, // adds r1, #1
    0x4708, // bx r1
    0, 0, 0, 0x0200, 0x1000, 0x0000, 0x2000, 0x0400, 0x0000,
];
/// Does the steps, which begin at the address 0x20000040.
const IN_RAM: [u16; 20] = [
    0x2701, // movs r7, #1
    0x077F, // lsls r7, #29
    0x3740, // adds r7, #0x40
    0xCF7C, // 1: ldmia r7!, {r2-r6}
    0x2A01, // cmp r2, #1
    0xD004, // beq 2f
    0x2A02, // cmp r2, #2
    0xD004, // beq 3f
    0x2A03, // cmp r2, #3
    0xD004, // beq 4f
    0xE7FE, // b .
    0x601C, // 2: str r4, [r3]
    0xE7F5, // b 1b
    0x681C, // 3: ldr r4, [r3]
    0xE7F3, // b 1b
    0x4620, // 4: mov r0, r4
    0x4629, // mov r1, r5
    0x4632, // mov r2, r6
    0x4798, // blx r3
    0xE7EE, // b 1b
];
/// The bytes that [`START`] copies, and where they lie in flash.
const COPIED: usize = 1024;
const COPIED_FROM: usize = 0x200;
const STEPS_FROM: usize = COPIED_FROM + 0x40;

/// The image of a program: what lies in flash from its beginning on, in blocks of 256 bytes that
/// say where they go (UF2).
fn image(program: &[Step]) -> Vec<u8> {
    let mut flash = vec![0; COPIED_FROM + COPIED];
    let mut put = |at: usize, bytes: &mut dyn Iterator<Item = u8>| {
        flash.iter_mut().skip(at).zip(bytes).for_each(|(place, byte)| *place = byte);
    };
    put(0x100, &mut [0x2000_1000_u32, 0x1000_0109].iter().flat_map(|word| word.to_le_bytes()));
    put(0x108, &mut START.iter().flat_map(|half| half.to_le_bytes()));
    put(COPIED_FROM, &mut IN_RAM.iter().flat_map(|half| half.to_le_bytes()));
    put(STEPS_FROM, &mut program.iter().flatten().flat_map(|word| word.to_le_bytes()));
    let block = |(number, bytes): (usize, &[u8])| {
        let target = 0x1000_0000 + 256 * number as u32;
        let mut block = vec![0; 512];
        block[12..16].copy_from_slice(&target.to_le_bytes());
        block[16..20].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
        block[32..32 + bytes.len()].copy_from_slice(bytes);
        block
    };
    flash.chunks(256).enumerate().flat_map(block).collect()
}

/// How the emulation of a program went.
#[derive(Debug, PartialEq)]
enum End {
    /// It sent this byte.
    Sent(u8),
    /// The emulator ended by itself and printed this.
    Ended(String),
    /// It has done neither for a second of its own time.
    Silent,
}

/// A file of its own, which is deleted at the end.
struct ImageFile(PathBuf);

impl Drop for ImageFile {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// Runs a program until it sends a byte or the emulation ends. `heard` come at the serial line.
fn run(program: &[Step], heard: &[u8]) -> Result<End, Box<dyn Error>> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let name = format!("penup-misuse-{}-{number}.uf2", std::process::id());
    let file = ImageFile(std::env::temp_dir().join(name));
    fs::write(&file.0, image(program))?;
    let board = serde_json::json!({
        "clockHertz": HERTZ, "flash": 0x1000_0000, "vectors": 0x1000_0100,
        "ram": 0x2000_0000, "records": 0x1B_8000, "steps": [2, 3], "directions": [4, 5],
        "contacts": [8, 9, 10],
    });
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    let mut node = Command::new("node")
        .arg(project.join("client/src/emulator/pico.mjs"))
        .arg(project.join("target/rp2040js/node_modules/rp2040js"))
        .arg(project.join("target/wasm32-unknown-unknown/release/penup_emulated_core.wasm"))
        .arg(&file.0)
        .args(["0", &board.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    let mut input = node.stdin.take().ok_or("no input")?;
    let mut output = node.stdout.take().ok_or("no output")?;
    for byte in heard {
        input.write_all(&[0, *byte, 0, 0, 0, 0, 0, 0])?;
    }
    let mut record = [0; 8];
    while output.read_exact(&mut record).is_ok() {
        let [what, byte, a, b, c, d, ..] = record;
        let end = match what {
            0 => End::Sent(byte),
            2 if u32::from_le_bytes([a, b, c, d]) > HERTZ => End::Silent,
            _ => continue,
        };
        node.kill()?;
        node.wait()?;
        return Ok(end);
    }
    let mut said = String::new();
    node.stderr.take().ok_or("no messages")?.read_to_string(&mut said)?;
    node.wait()?;
    Ok(End::Ended(said))
}

/// Checks that a program sends a byte, and that each of some others ends the emulation with a
/// message that contains these words.
fn assert_only_right(right: &[Step], wrong: &[(Vec<Step>, &str)]) -> TestResult {
    assert_eq!(run(right, &[])?, End::Sent(BYTE as u8));
    for (program, words) in wrong {
        let end = run(program, &[])?;
        assert!(matches!(&end, End::Ended(said) if said.contains(words)), "{words}: {end:?}");
    }
    Ok(())
}

/// The program without one of its steps.
fn without(program: &[Step], step: Step) -> Vec<Step> {
    program.iter().copied().filter(|it| *it != step).collect()
}

/// The program with another step in place of one of its own.
fn with(program: &[Step], step: Step, other: Step) -> Vec<Step> {
    program.iter().map(|it| if *it == step { other } else { *it }).collect()
}

const RELEASE: Step = write(0x4000_F000, UART0 | USBCTRL | IO_BANK0 | PADS_BANK0);
const UART0: u32 = 1 << 22;
const USBCTRL: u32 = 1 << 24;
const IO_BANK0: u32 = 1 << 5;
const PADS_BANK0: u32 = 1 << 8;
const HOLD_UART: Step = write(0x4000_E000, UART0);
const SEE_RELEASED: Step = read(0x4000_C008);
/// The peripherals' clock is the crystal's of 12 MHz.
const START_CLOCK: Step = write(0x4000_8048, 1 << 11 | 4 << 5);
const ROUTE: Step = write(0x4001_400C, 2);
/// 115200 baud of 12 MHz.
const DIVIDER: Step = write(0x4003_4024, 6);
const FRACTION: Step = write(0x4003_4028, 33);
const EIGHT_BITS: Step = write(0x4003_402C, 0x70);
const ENABLE: Step = write(0x4003_4030, 0x301);
const BYTE: u32 = 0x41;
const SEND: Step = write(0x4003_4000, BYTE);
const UART: [Step; 9] =
    [START_CLOCK, RELEASE, SEE_RELEASED, ROUTE, DIVIDER, FRACTION, EIGHT_BITS, ENABLE, SEND];

#[test]
fn no_byte_leaves_at_another_rate_or_in_another_format() -> TestResult {
    let mut late_divider = without(&UART, DIVIDER);
    late_divider.insert(6, DIVIDER);
    let mut changed = UART.to_vec();
    changed.insert(8, EIGHT_BITS);
    let line_control = |value| with(&UART, EIGHT_BITS, write(EIGHT_BITS[1], value));
    let rate = "UART0 sends a byte at";
    assert_only_right(
        &UART,
        &[
            (with(&UART, DIVIDER, write(DIVIDER[1], 7)), "sends a byte at 99792 baud"),
            (without(&UART, FRACTION), rate),
            (without(&UART, EIGHT_BITS), "sends a byte at 0 baud"),
            // The divider is not taken over before the line control is written.
            (late_divider, rate),
            (changed, "while it is enabled"),
            // Seven bits, a parity, two stop bits, no FIFO.
            (line_control(0x50), "line control 0x50"),
            (line_control(0x72), "line control 0x72"),
            (line_control(0x78), "line control 0x78"),
            (line_control(0x60), "line control 0x60"),
        ],
    )
}

#[test]
fn no_byte_arrives_at_another_rate() -> TestResult {
    let receives = with(&without(&UART, SEND), DIVIDER, write(DIVIDER[1], 7));
    let end = run(&receives, b"v")?;
    assert!(
        matches!(&end, End::Ended(said) if said.contains("receives a byte at 99792")),
        "{end:?}"
    );
    Ok(())
}

#[test]
fn what_is_held_in_reset_or_has_no_clock_is_not_used() -> TestResult {
    let mut held_again = UART.to_vec();
    held_again.insert(8, HOLD_UART);
    let then = |steps: &[Step]| [&without(&UART, SEND), steps].concat();
    let start_ticks = write(0x4005_802C, 1 << 9 | 12);
    let crystal = write(0x4000_8030, 2);
    let timer = read(0x4005_4028);
    let usb_clock = write(0x4000_8054, 1 << 11);
    let usb = write(0x5011_0040, 1);
    let memory = read(0x5010_0000);
    let right = then(&[crystal, start_ticks, timer, usb_clock, usb, memory, SEND]);
    let only_uart = with(&right, RELEASE, write(RELEASE[1], UART0 | IO_BANK0));
    assert_only_right(
        &right,
        &[
            (without(&right, RELEASE), "uses IO_BANK0 at 0x4001400c, which is held in reset"),
            (without(&right, SEE_RELEASED), "before it has seen its bit in RESET_DONE"),
            (held_again, "uses UART0 at 0x40034000, which is held in reset"),
            (without(&right, START_CLOCK), "uses UART0 at 0x40034024, which has no clock"),
            (without(&right, start_ticks), "uses TIMER at 0x40054028, which has no clock"),
            (without(&right, crystal), "uses TIMER at 0x40054028, which has no clock"),
            (without(&right, usb_clock), "uses USBCTRL at 0x50110040, which has no clock"),
            (only_uart.clone(), "uses USBCTRL at 0x50110040, which is held in reset"),
            (without(&only_uart, usb), "at 0x50100000, which is held in reset"),
        ],
    )
}

/// Where the last sector of the flash begins, and the same as memory.
const SECTOR: u32 = 0x1F_F000;
const READ_FLASH: Step = read(0x1000_0000 + SECTOR);
/// A page in RAM.
const PAGE: u32 = 0x2000_0400;

#[test]
fn flash_is_used_only_as_the_chip_can_bear_it() -> TestResult {
    let connect = call(rom::CONNECT, 0, 0, 0);
    let exit = call(rom::EXIT_XIP, 0, 0, 0);
    let erase = call(rom::ERASE, SECTOR, 4096, 0);
    let program = call(rom::PROGRAM, SECTOR, PAGE, 256);
    let flush = call(rom::FLUSH_CACHE, 0, 0, 0);
    let enter = call(rom::ENTER_XIP, 0, 0, 0);
    let works = [connect, exit, erase, program, flush, enter, READ_FLASH];
    let right = [&works, &UART[..]].concat();
    let erases = |from, bytes| with(&right, erase, call(rom::ERASE, from, bytes, 0));
    let programs = |to, page, bytes| with(&right, program, call(rom::PROGRAM, to, page, bytes));
    let early = |place| {
        let mut early = right.clone();
        early.insert(place, READ_FLASH);
        early
    };
    let not_mapped = "flash is read at 0x101ff000 while it is not mapped to memory";
    assert_only_right(
        &right,
        &[
            (early(2), not_mapped),
            (early(5), not_mapped),
            (without(&right, enter), not_mapped),
            // The boot ROM still holds the pad that selects the chip.
            (without(&right, flush), not_mapped),
            (without(&right, exit), "erased, 4096 bytes from 0x1ff000 on, without flash_exit_xip"),
            (erases(SECTOR + 256, 4096), "whole units of 4096 bytes"),
            (erases(SECTOR, 256), "whole units of 4096 bytes"),
            (erases(SECTOR, 8192), "the chip ends at 0x200000"),
            (erases(0x10_0000, 1 << 16), "erased by a block at 0x100000"),
            (programs(SECTOR + 4, PAGE, 256), "whole units of 256 bytes"),
            (programs(SECTOR, PAGE, 100), "whole units of 256 bytes"),
            (programs(SECTOR, 0x1000_0000, 256), "flash is read at 0x10000000"),
            (with(&right, READ_FLASH, write(READ_FLASH[1], 0)), "written at 0x101ff000 as memory"),
        ],
    )
}
