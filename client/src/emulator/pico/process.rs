//! The process of the emulator of the Pico, and the threads that read its output.

use super::BOARD;
use super::call_gaps::CallGaps;
use super::flash::FlashOperation;
use super::interrupt_times::InterruptTimes;
use super::record::{
    ANSWERED, BOOTSEL, GAP, GARBLED, HANDLER_TOOK, INTERRUPTS_END, LOG, MASK_TOOK, OPERATION_BEGAN,
    OPERATION_CHANGES, OPERATIONS, PIN, RECORD_BYTES, RESET, RETURNED, Record, SERIAL,
    UNUSED_STACK, USB, USB_SERIAL, WERE_READ, at,
};
use super::servo::Servo;
use crate::emulator::EmulatorError;
use crate::emulator::PinChange;
use crate::emulator::heights::ToldHeights;
use crate::emulator::running::{Shared, quitting_with_parent};
use crate::table::{BoardRow, Pins};
use object::{Object, ObjectSymbol};
use std::collections::VecDeque;
use std::fs;
use std::io::{self, BufRead, BufReader, PipeWriter, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

pub(super) const PROGRAM: &str = "node";
/// Puts together what comes in several arguments, because a single one may have at most 128 KiB:
/// the script, and the names and texts of its modules. Each import by name becomes one by a `data:`
/// URL (RFC 2397), and so does the script.
const LOADER: &str = "
    const url = (text) =>
        'data:text/javascript;base64,' + Buffer.from(text).toString('base64');
    let [script, ...modules] = process.argv.slice(1, -5);
    for (; modules.length; modules.splice(0, 2)) {
        script = script.replace(modules[0], url(modules[1]));
    }
    await import(url(script));
";
const SCRIPT: &str = include_str!("../pico.mjs");
/// The modules that the script imports: the name in the import, and the text.
const MODULES: &[(&str, &str)] = &[
    ("./pico/aborted_dma.mjs", include_str!("aborted_dma.mjs")),
    ("./pico/core_cycles.mjs", include_str!("core_cycles.mjs")),
    ("./pico/flash_chip.mjs", include_str!("flash_chip.mjs")),
    ("./pico/flash_record.mjs", include_str!("flash_record.mjs")),
    ("./pico/held_in_reset.mjs", include_str!("held_in_reset.mjs")),
    ("./pico/call_gaps.mjs", include_str!("call_gaps.mjs")),
    ("./pico/interrupt_times.mjs", include_str!("interrupt_times.mjs")),
    ("./pico/joined_queue.mjs", include_str!("joined_queue.mjs")),
    ("./pico/late_alarm.mjs", include_str!("late_alarm.mjs")),
    ("./pico/mended_core.mjs", include_str!("mended_core.mjs")),
    ("./pico/quick_core.mjs", include_str!("quick_core.mjs")),
    ("./pico/resets.mjs", include_str!("resets.mjs")),
    ("./pico/slow_contacts.mjs", include_str!("slow_contacts.mjs")),
    ("./pico/uart.mjs", include_str!("uart.mjs")),
    ("./pico/usb_host.mjs", include_str!("usb_host.mjs")),
    ("./pico/worn_flash.mjs", include_str!("worn_flash.mjs")),
];
/// The directory in which `cargo xtask set-up` installs rp2040js, relative to the workspace's root.
const RP2040JS: &str = "target/rp2040js/node_modules/rp2040js";
/// The package `penup-emulated-core` as `cargo xtask set-up` compiles it, relative to the
/// workspace's root.
const CORE: &str = "target/wasm32-unknown-unknown/release/penup_emulated_core.wasm";
/// The number of the emulator's own lines that are kept.
const SAID_LINES: usize = 20;

/// Messages whose `cycle` is something other than the present cycle.
const NO_TIMES: [u8; 11] = [
    RETURNED,
    UNUSED_STACK,
    ANSWERED,
    WERE_READ,
    OPERATION_BEGAN,
    OPERATION_CHANGES,
    OPERATIONS,
    HANDLER_TOOK,
    MASK_TOOK,
    INTERRUPTS_END,
    GAP,
];

/// The state of the emulator, as the reader threads have learnt it.
#[derive(Default)]
pub(super) struct State {
    pub(super) serial: VecDeque<u8>,
    pub(super) usb: VecDeque<u8>,
    pub(super) timed: Vec<(u8, u64)>,
    pub(super) pins: Vec<PinChange>,
    pub(super) told: ToldHeights,
    pub(super) cycles: u64,
    /// The number of unused bytes of the stack, the answer to the last query.
    pub(super) unused_stack: Option<u64>,
    /// How often the chip was reset.
    pub(super) resets: u32,
    /// How long the status was waited for at the serial line, each time: up to the first byte of
    /// the answer, and up to its end.
    pub(super) waits: [Vec<Duration>; 2],
    /// How often what is kept in flash was read, the answer to the last query.
    pub(super) record_reads: Option<u64>,
    /// How often flash has returned garbage.
    pub(super) garbled: u32,
    /// The recorded operations of the flash, as they come.
    pub(super) operations: Vec<FlashOperation>,
    /// How many were recorded, when all have come.
    pub(super) operation_count: Option<u64>,
    /// The longest handlers and masks of interrupts, as they come.
    pub(super) interrupt_times: InterruptTimes,
    /// Whether all of them have come.
    pub(super) knows_interrupt_times: bool,
    /// The longest times between the calls of a function.
    pub(super) call_gaps: CallGaps,
    /// Whether the boot ROM shows its drive and waits for an image.
    pub(super) shows_drive: bool,
    /// The serial number that the USB host has read.
    pub(super) usb_serial_number: String,
    pub(super) log: Vec<String>,
    pub(super) said: VecDeque<String>,
    pub(super) ended: bool,
}

/// The address of the first function of `image` whose name satisfies `is_wanted`. `name` is for the
/// error message.
pub(super) fn function(
    image: &Path,
    is_wanted: impl Fn(&str) -> bool,
    name: &str,
) -> Result<u64, EmulatorError> {
    let bad = |reason: String| EmulatorError::BadImage { reason };
    let elf = fs::read(image).map_err(|_| EmulatorError::NoImage { path: image.into() })?;
    let elf = object::File::parse(&*elf).map_err(|error| bad(error.to_string()))?;
    let symbol = elf.symbols().find(|symbol| symbol.name().is_ok_and(&is_wanted));
    let symbol = symbol.ok_or_else(|| bad(format!("there is no function {name}")))?;
    Ok(symbol.address() & !1)
}

/// Checks that rp2040js is installed in the version that this program needs, and that the emulated
/// core is compiled.
pub(super) fn check_version(root: &Path) -> Result<(), EmulatorError> {
    const PROGRAM: &str = "rp2040js";
    let read = |text: &str, pointer: &str| {
        let value: serde_json::Value = serde_json::from_str(text).ok()?;
        value.pointer(pointer)?.as_str().map(str::to_owned)
    };
    let text = fs::read_to_string(root.join(RP2040JS).join("package.json"))
        .map_err(|source| EmulatorError::NotInstalled { program: PROGRAM, source })?;
    let found = read(&text, "/version").unwrap_or_else(|| "of no version".to_owned());
    let needed = read(include_str!("../rp2040js/package.json"), "/dependencies/rp2040js");
    match needed {
        Some(needed) if needed != found => {
            Err(EmulatorError::WrongVersion { program: PROGRAM, found, needed })
        }
        _ => fs::metadata(root.join(CORE))
            .map(drop)
            .map_err(|source| EmulatorError::NotInstalled { program: "the emulated core", source }),
    }
}

/// Creates the command line of the emulator.
pub(super) fn command(image: &Path, log_address: u64) -> Command {
    let mut command = quitting_with_parent(PROGRAM);
    command.args(["--input-type=module", "--eval", LOADER, "--", SCRIPT]);
    command.args(MODULES.iter().flat_map(|(name, text)| [name, text]));
    let root = crate::workspace::root();
    command.arg(root.join(RP2040JS)).arg(root.join(CORE));
    command.arg(image).arg(log_address.to_string()).arg(board());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // The emulator gets its own process group, so that Ctrl-C at the terminal reaches only this
    // process, which ends the emulator when it is done with it.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// What the script must know of the board, as JSON.
fn board() -> String {
    let BoardRow { clock_hertz, flash, ram, boot_loader, pins, budget, .. } = BOARD;
    let Pins { step_x, step_y, dir_x, dir_y, limit_x, limit_y, stop, .. } = pins;
    serde_json::json!({
        "clockHertz": clock_hertz,
        "flash": flash.start,
        "vectors": flash.start + boot_loader,
        "ram": ram.start,
        // The address in flash at which that begins what is kept: a model, and the records.
        "kept": budget.flash,
        "steps": [step_x, step_y],
        "directions": [dir_x, dir_y],
        "contacts": [limit_x, limit_y, stop],
    })
    .to_string()
}

/// The address of the log buffer in the image; 0 if there is none.
pub(super) fn log_address(elf: &[u8]) -> Result<u64, EmulatorError> {
    let elf = object::File::parse(elf)
        .map_err(|error| EmulatorError::BadImage { reason: error.to_string() })?;
    let symbol = elf.symbols().find(|symbol| symbol.name() == Ok("_SEGGER_RTT"));
    Ok(symbol.map_or(0, |symbol| symbol.address()))
}

type Spawned = io::Result<(Child, ChildStdin, ChildStderr)>;

pub(super) fn spawn_and_read(
    mut command: Command,
    sender: &mpsc::Sender<Spawned>,
    shared: &Shared<State>,
    log: PipeWriter,
) {
    let (spawned, stdout) = match spawn(&mut command) {
        Ok((child, input, stdout, stderr)) => (Ok((child, input, stderr)), Some(stdout)),
        Err(error) => (Err(error), None),
    };
    if sender.send(spawned).is_ok()
        && let Some(stdout) = stdout
    {
        read(stdout, shared, log);
    }
}

fn spawn(command: &mut Command) -> io::Result<(Child, ChildStdin, ChildStdout, ChildStderr)> {
    let mut child = command.spawn()?;
    match (child.stdin.take(), child.stdout.take(), child.stderr.take()) {
        (Some(stdin), Some(stdout), Some(stderr)) => Ok((child, stdin, stdout, stderr)),
        _ => Err(io::ErrorKind::BrokenPipe.into()),
    }
}

/// Keeps the last lines that the emulator prints.
pub(super) fn listen(stderr: ChildStderr, shared: &Shared<State>) {
    for line in BufReader::new(stderr).lines().map_while(Result::ok) {
        let mut state = shared.lock();
        if state.said.len() == SAID_LINES {
            state.said.pop_front();
        }
        state.said.push_back(line);
    }
}

/// Reads the emulator's messages until it ends.
fn read(mut stdout: ChildStdout, shared: &Shared<State>, mut log: PipeWriter) {
    let mut buffer = vec![0; 1 << 16];
    let mut filled = 0;
    let mut servo = Servo::default();
    loop {
        let count = stdout.read(&mut buffer[filled..]).unwrap_or(0);
        filled += count;
        let whole = filled - filled % RECORD_BYTES;
        let mut logged = Vec::new();
        let mut state = shared.lock();
        state.ended = count == 0;
        for bytes in buffer[..whole].as_chunks().0 {
            let record = Record::from_bytes(*bytes);
            if !NO_TIMES.contains(&record.what) {
                state.cycles = record.cycle;
            }
            match record.what {
                SERIAL => state.serial.push_back(record.value),
                RETURNED => state.timed.push((record.value, record.cycle)),
                UNUSED_STACK => state.unused_stack = Some(record.cycle),
                USB => state.usb.push_back(record.value),
                PIN => {
                    let change = servo.pin_change(&record, state.told.heights());
                    state.pins.extend(change);
                }
                LOG => logged.push(record.value),
                RESET => {
                    state.shows_drive = false;
                    state.resets += 1;
                }
                GARBLED => state.garbled += 1,
                WERE_READ => state.record_reads = Some(record.cycle),
                OPERATION_BEGAN => state.operations.push(FlashOperation {
                    began: at(record.cycle),
                    is_erasure: record.value == 1,
                    ..FlashOperation::default()
                }),
                OPERATION_CHANGES => {
                    if let Some(last) = state.operations.last_mut() {
                        last.offset = (record.cycle >> 16) as u32;
                        last.changes = (record.cycle & 0xFFFF) as u32;
                    }
                }
                OPERATIONS => state.operation_count = Some(record.cycle),
                HANDLER_TOOK => {
                    state.interrupt_times.handlers.insert(record.value, at(record.cycle));
                }
                MASK_TOOK => {
                    state.interrupt_times.masks.insert(record.value, at(record.cycle));
                }
                INTERRUPTS_END => state.knows_interrupt_times = true,
                GAP => {
                    let CallGaps { longest, longest_for_flash } = &mut state.call_gaps;
                    let kept = if record.value == 1 { longest_for_flash } else { longest };
                    *kept = (*kept).max(at(record.cycle));
                }
                ANSWERED => state.waits[usize::from(record.value & 1)].push(at(record.cycle)),
                BOOTSEL => state.shows_drive = true,
                USB_SERIAL if record.value == 0 => state.usb_serial_number.clear(),
                USB_SERIAL => state.usb_serial_number.push(char::from(record.value)),
                _ => {}
            }
        }
        drop(state);
        shared.notify();
        // The write cannot fail: the reader of the log ends only when this writer is dropped.
        let _ = log.write_all(&logged);
        if count == 0 {
            return;
        }
        buffer.copy_within(whole..filled, 0);
        filled -= whole;
    }
}
