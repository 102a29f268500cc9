//! Emulates a Raspberry Pi Pico in rp2040js through the script `pico.mjs`, which describes the
//! protocol between both.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeWriter, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Duration;
use std::{fmt, fs, thread};

use object::{Object, ObjectSymbol};

use super::process::quitting_with_parent;
use super::running::{Running, Shared};
use super::stack::{self, Stack};
use super::{EmulatedBoard, EmulatorError, Pin, PinChange, log};

const PROGRAM: &str = "node";
const SCRIPT: &str = include_str!("pico.mjs");
/// The modules that the script imports: the name in the import, and the text.
const MODULES: &[(&str, &str)] = &[
    ("./pico/core_cycles.mjs", include_str!("pico/core_cycles.mjs")),
    ("./pico/flash_chip.mjs", include_str!("pico/flash_chip.mjs")),
    ("./pico/late_alarm.mjs", include_str!("pico/late_alarm.mjs")),
    ("./pico/resets.mjs", include_str!("pico/resets.mjs")),
    ("./pico/slow_contacts.mjs", include_str!("pico/slow_contacts.mjs")),
    ("./pico/uart.mjs", include_str!("pico/uart.mjs")),
    ("./pico/usb_host.mjs", include_str!("pico/usb_host.mjs")),
    ("./pico/worn_flash.mjs", include_str!("pico/worn_flash.mjs")),
    ("./pico/xip_cache.mjs", include_str!("pico/xip_cache.mjs")),
];
/// The directory in which `cargo xtask set-up` installs rp2040js, relative to the workspace's root.
const RP2040JS: &str = "target/rp2040js/node_modules/rp2040js";
/// The length of a core cycle in nanoseconds, at 125 MHz.
const CYCLE_NANOS: u64 = 8;
/// The number of level changes of a bouncing contact.
const BOUNCES: u64 = 16;
/// The number of cycles by which the emulator's clock may be ahead of the last record received: 20
/// ms.
const CYCLES_AHEAD: u64 = 2_500_000;
/// The number of the emulator's own lines that are kept.
const SAID_LINES: usize = 20;

/// A running Pico. Dropping this ends the emulator's process.
pub struct Pico {
    running: Running,
    input: ChildStdin,
    shared: Arc<Shared<State>>,
    /// The size of the stack in bytes.
    stack: usize,
}

/// The errors that a UART can detect in a byte, as the bits above the byte in the data register of
/// a PL011.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UartError {
    /// The stop bit is missing.
    Framing = 1 << 8,
    /// The parity is wrong.
    Parity = 1 << 9,
    /// The line stays low for longer than a byte.
    Break = 1 << 8 | 1 << 10,
    /// Bytes before it were lost.
    Overrun = 1 << 11,
}

#[derive(Default)]
struct State {
    serial: VecDeque<u8>,
    usb: VecDeque<u8>,
    timed: Vec<(u8, u64)>,
    pins: Vec<PinChange>,
    cycles: u64,
    /// The number of unused bytes of the stack, the answer to the last query.
    unused_stack: Option<u64>,
    /// Whether the boot ROM shows its drive and waits for an image.
    shows_drive: bool,
    /// The serial number that the USB host has read.
    usb_serial_number: String,
    log: Vec<String>,
    said: VecDeque<String>,
    ended: bool,
}

impl fmt::Debug for Pico {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.running.fmt(f)
    }
}

impl Pico {
    /// Boots the UF2 file beside `image`. The ELF file `image` itself provides the log table and
    /// the addresses.
    ///
    /// # Errors
    /// See [`EmulatorError`]. No process is left running after an error.
    pub fn start(image: &Path) -> Result<Self, EmulatorError> {
        let flashed = image.with_extension("uf2");
        let elf = fs::read(image).map_err(|_| EmulatorError::NoImage { path: image.into() })?;
        if !flashed.exists() {
            return Err(EmulatorError::NoImage { path: flashed });
        }
        check_version(&crate::workspace::root())?;
        let table = log::table(&elf)?;
        let command = command(&flashed, log_address(&elf)?);
        let shared = Arc::<Shared<State>>::default();
        let (log_reader, log_writer) = io::pipe()?;
        let logged = Arc::clone(&shared);
        let logger = thread::spawn(move || {
            if let Some(table) = table {
                log::decode(&table, log_reader, |line| logged.lock().log.push(line));
            }
        });

        let (sender, started) = mpsc::channel();
        let told = Arc::clone(&shared);
        // Linux ends the process together with the thread that started it, so that thread must
        // outlive the process.
        let reader = thread::spawn(move || spawn_and_read(command, &sender, &told, log_writer));
        let (child, input, stderr) = match started.recv() {
            Ok(Ok(spawned)) => spawned,
            Ok(Err(source)) => {
                return Err(EmulatorError::NotInstalled { program: PROGRAM, source });
            }
            Err(_) => return Err(io::Error::from(io::ErrorKind::BrokenPipe).into()),
        };
        let listened = Arc::clone(&shared);
        let listener = thread::spawn(move || listen(stderr, &listened));
        let running = Running::new(child, vec![logger, reader, listener]);
        let mut pico = Self { running, input, shared, stack: stack::size(&elf)? };
        pico.wait_for_boot()?;
        Ok(pico)
    }

    /// Sets the level of input pin `number` of the chip.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn drive(&mut self, number: u8, high: bool) -> io::Result<()> {
        self.tell(PIN, number | u8::from(high) << 7, 0)
    }

    /// Sets the level of an input pin as [`Pico::drive`] does, but lets it bounce for `time` first.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn bounce(&mut self, number: u8, high: bool, time: Duration) -> io::Result<()> {
        // The bouncing starts after everything that was received so far, because the emulator's
        // clock is ahead of it.
        let start = self.shared.lock().cycles + CYCLES_AHEAD;
        let cycles = time.as_nanos() as u64 / CYCLE_NANOS;
        for turn in 0..BOUNCES {
            let level = high ^ (turn % 2 == 1);
            self.tell(PIN, number | u8::from(level) << 7, start + turn * cycles / BOUNCES)?;
        }
        self.tell(PIN, number | u8::from(high) << 7, start + cycles)
    }

    /// Attaches a limit switch to pin 8 (x) or 9 (y). It is closed while the axis is at `place` or
    /// below, in steps from its position when the emulator started. It bounces for 5 ms.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn fit_switch(&mut self, number: u8, place: i32) -> io::Result<()> {
        self.tell(SWITCH, number, (SWITCH_ZERO + i64::from(place)) as u64)
    }

    /// Cuts the power and restores it. The contents of the flash are preserved.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power(&mut self) -> io::Result<()> {
        self.tell(CUT_POWER, 0, 0)
    }

    /// Cuts the power as [`Pico::cut_power`] does, after `time` has passed.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power_after(&mut self, time: Duration) -> io::Result<()> {
        let cycles = time.as_nanos() as u64 / CYCLE_NANOS;
        let cycle = self.shared.lock().cycles + cycles;
        self.tell(CUT_POWER, 0, cycle)
    }

    /// Cuts the power as [`Pico::cut_power`] does, when `bytes` more bytes of flash have been
    /// erased or written.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power_in_flash(&mut self, bytes: u64) -> io::Result<()> {
        self.tell(CUT_FLASH, 0, bytes)
    }

    /// From now on, measures the cycles of each call of a function of `image`, including
    /// interrupts: the first function whose mangled name contains `name`. [`Pico::take_timed`]
    /// returns the results together with `number`.
    ///
    /// # Errors
    /// [`EmulatorError::BadImage`] if there is no such function, or another error if the emulator
    /// has ended.
    pub fn time_function(
        &mut self,
        image: &Path,
        name: &str,
        number: u8,
    ) -> Result<(), EmulatorError> {
        let address = function(image, |found| found.contains(name), name)?;
        Ok(self.tell(TIMED, number, address)?)
    }

    /// Returns the calls of measured functions that have returned since the last call: the
    /// function's number and its cycles.
    pub fn take_timed(&mut self) -> Vec<(u8, u64)> {
        std::mem::take(&mut self.shared.lock().timed)
    }

    /// Pulls the pin RUN low for a moment, which resets the chip while the power stays on.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn pull_run_low(&mut self) -> io::Result<()> {
        self.tell(RUN_PIN, 0, 0)
    }

    /// Connects the board with BOOTSEL held and copies the image onto the drive that it shows. The
    /// boot ROM then restarts the board by the watchdog.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn copy_image(&mut self) -> io::Result<()> {
        self.tell(UF2, 0, 0)
    }

    /// Makes bits of a byte of flash defective. From its next change on, the bits in `mask` of the
    /// byte at offset `place` stay high or low.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn wear_flash(&mut self, place: u32, mask: u8, high: bool) -> io::Result<()> {
        self.tell(if high { STAYS_HIGH } else { STAYS_LOW }, mask, u64::from(place))
    }

    /// Makes the firmware's main loop continue at another address, with its stack as it is or
    /// exhausted.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn jump_to(&mut self, address: u32, uses_stack_up: bool) -> io::Result<()> {
        self.tell(JUMP, u8::from(uses_stack_up), u64::from(address))
    }

    /// Makes the main loop continue, as [`Pico::jump_to`] does, at the function of `image` that has
    /// exactly this name.
    ///
    /// # Errors
    /// As [`Pico::time_function`].
    pub fn jump_to_function(
        &mut self,
        image: &Path,
        name: &str,
        uses_stack_up: bool,
    ) -> Result<(), EmulatorError> {
        let address = function(image, |found| found == name, name)?;
        Ok(self.jump_to(address as u32, uses_stack_up)?)
    }

    /// Whether the board currently shows the drive of its boot ROM.
    pub fn shows_drive(&self) -> bool {
        self.shared.lock().shows_drive
    }

    /// Makes the firmware's main loop hang.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn hang(&mut self) -> io::Result<()> {
        self.tell(HANG, 0, 0)
    }

    /// Stalls the firmware's main loop for `hundredths` of a second, while interrupts continue,
    /// when x reaches `place`, in steps from its position when the emulator started. Several
    /// positions are used in the order in which they are given.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn stall_at(&mut self, place: u32, hundredths: u8) -> io::Result<()> {
        self.tell(STALL, hundredths, u64::from(place))
    }

    /// Pre-empts the clock's interrupt handler for this time just before it sets its next alarm.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn delay_alarm(&mut self, milliseconds: u8) -> io::Result<()> {
        self.tell(DELAY_ALARM, milliseconds, 0)
    }

    /// Connects a USB host, which enumerates the device.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_in(&mut self) -> io::Result<()> {
        self.tell(USB_HOST, 1, 0)
    }

    /// Sets whether the USB host accepts the data that the board sends.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn let_usb_take(&mut self, takes: bool) -> io::Result<()> {
        self.tell(USB_HOST, if takes { 3 } else { 2 }, 0)
    }

    /// Connects a USB host whose bus is never idle, because other devices at the same hub are busy.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_into_busy_bus(&mut self) -> io::Result<()> {
        self.tell(USB_HOST, 7, 0)
    }

    /// Connects a USB host without power, which pulls both wires low.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_into_dead_host(&mut self) -> io::Result<()> {
        self.tell(USB_HOST, 8, 0)
    }

    /// Makes the USB host suspend the bus, as a computer that goes to sleep does, or resume it.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn suspend_usb(&mut self, suspends: bool) -> io::Result<()> {
        self.tell(USB_HOST, if suspends { 4 } else { 5 }, 0)
    }

    /// Makes a program on the USB host open or close the port (DTR) at `rate` baud. The host opens
    /// it at 115200 baud after it has enumerated the device.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn open_usb(&mut self, opens: bool, rate: u32) -> io::Result<()> {
        self.tell(USB_LINE, u8::from(opens), u64::from(rate))
    }

    /// The serial number that the USB host has read from the device; empty before that.
    pub fn usb_serial_number(&self) -> String {
        self.shared.lock().usb_serial_number.clone()
    }

    /// Does the same as [`EmulatedBoard::send`], over USB.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send_by_usb(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.send_to(USB, bytes)
    }

    /// Does the same as [`EmulatedBoard::receive`], over USB.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] if the emulator has ended.
    pub fn receive_by_usb(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.receive_from(|state| &mut state.usb, buffer, patience)
    }

    /// Sends a byte over the serial line in which the UART detects `error`.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send_damaged(&mut self, byte: u8, error: UartError) -> io::Result<()> {
        self.tell(SERIAL, byte, error as u64)
    }

    /// Sets the time that erasing a sector of flash takes from now on. It is 45 ms at first, the
    /// typical value; the maximum is 400 ms.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn set_erase_time(&mut self, time: Duration) -> io::Result<()> {
        self.tell(ERASE_TIME, 0, time.as_micros() as u64)
    }

    fn send_to(&mut self, port: u8, bytes: &[u8]) -> io::Result<()> {
        let record = |&byte| Record { what: port, value: byte, cycle: 0 }.to_bytes();
        let records: Vec<u8> = bytes.iter().flat_map(record).collect();
        self.input.write_all(&records)?;
        self.input.flush()
    }

    fn receive_from(
        &mut self,
        port: impl Fn(&mut State) -> &mut VecDeque<u8>,
        buffer: &mut [u8],
        patience: Duration,
    ) -> io::Result<usize> {
        let waits = |state: &mut State| port(state).is_empty() && !state.ended;
        let mut state = self.shared.wait_while(patience, waits);
        if port(&mut state).is_empty() && state.ended {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        port(&mut state).read(buffer)
    }

    fn tell(&mut self, what: u8, value: u8, cycle: u64) -> io::Result<()> {
        self.input.write_all(&Record { what, value, cycle }.to_bytes())?;
        self.input.flush()
    }

    /// Waits until the emulator's clock runs.
    fn wait_for_boot(&mut self) -> Result<(), EmulatorError> {
        let waits = |state: &mut State| state.cycles == 0 && !state.ended;
        if self.shared.wait_while(super::PATIENCE, waits).cycles > 0 {
            return Ok(());
        }
        self.running.has_ended(PROGRAM)?;
        self.running.end();
        Err(EmulatorError::Ended { said: self.said() })
    }

    /// The deepest use of the stack since the board last started.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn stack(&mut self) -> Result<Stack, EmulatorError> {
        self.shared.lock().unused_stack = None;
        self.tell(STACK, 0, 0)?;
        let waits = |state: &mut State| state.unused_stack.is_none() && !state.ended;
        let unused = self.shared.wait_while(super::PATIENCE, waits).unused_stack;
        let unused = unused.ok_or_else(|| EmulatorError::Ended { said: self.said() })?;
        Ok(Stack { size: self.stack, deepest: self.stack - (unused as usize).min(self.stack) })
    }
}

/// A Pico whose serial line as an [`EmulatedBoard`] is the USB port.
#[derive(Debug)]
pub struct PicoByUsb(pub Pico);

impl EmulatedBoard for PicoByUsb {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.send_by_usb(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.0.receive_by_usb(buffer, patience)
    }

    fn pin_changes(&mut self) -> Result<Vec<PinChange>, EmulatorError> {
        self.0.pin_changes()
    }

    fn clock(&mut self) -> Result<Duration, EmulatorError> {
        self.0.clock()
    }

    fn log_lines(&mut self) -> Vec<String> {
        self.0.log_lines()
    }

    fn said(&self) -> String {
        self.0.said()
    }

    fn how_it_ended(&mut self) -> Option<ExitStatus> {
        self.0.how_it_ended()
    }
}

impl EmulatedBoard for Pico {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.send_to(SERIAL, bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.receive_from(|state| &mut state.serial, buffer, patience)
    }

    fn pin_changes(&mut self) -> Result<Vec<PinChange>, EmulatorError> {
        Ok(std::mem::take(&mut self.shared.lock().pins))
    }

    fn clock(&mut self) -> Result<Duration, EmulatorError> {
        Ok(at(self.shared.lock().cycles))
    }

    fn log_lines(&mut self) -> Vec<String> {
        std::mem::take(&mut self.shared.lock().log)
    }

    fn said(&self) -> String {
        Vec::from(self.shared.lock().said.clone()).join("\n")
    }

    fn how_it_ended(&mut self) -> Option<ExitStatus> {
        self.running.how_it_ended()
    }
}

/// The address of the first function of `image` whose name satisfies `is_wanted`. `name` is for the
/// error message.
fn function(
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

fn at(cycle: u64) -> Duration {
    Duration::from_nanos(cycle * CYCLE_NANOS)
}

/// Embeds the modules in the script: each import by name becomes one by a `data:` URL (RFC 2397).
fn script() -> String {
    let mut script = SCRIPT.to_owned();
    for (name, text) in MODULES {
        let mut address = String::from("data:text/javascript,");
        for byte in text.bytes() {
            match byte {
                b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' => address.push(char::from(byte)),
                _ => address.push_str(&format!("%{byte:02X}")),
            }
        }
        script = script.replace(name, &address);
    }
    script
}

/// Checks that rp2040js is installed in the version that this program needs.
fn check_version(root: &Path) -> Result<(), EmulatorError> {
    const PROGRAM: &str = "rp2040js";
    let read = |text: &str, pointer: &str| {
        let value: serde_json::Value = serde_json::from_str(text).ok()?;
        value.pointer(pointer)?.as_str().map(str::to_owned)
    };
    let text = fs::read_to_string(root.join(RP2040JS).join("package.json"))
        .map_err(|source| EmulatorError::NotInstalled { program: PROGRAM, source })?;
    let found = read(&text, "/version").unwrap_or_else(|| "of no version".to_owned());
    let needed = read(include_str!("rp2040js/package.json"), "/dependencies/rp2040js");
    match needed {
        Some(needed) if needed != found => {
            Err(EmulatorError::WrongVersion { program: PROGRAM, found, needed })
        }
        _ => Ok(()),
    }
}

/// Creates the command line of the emulator.
fn command(image: &Path, log_address: u64) -> Command {
    let mut command = quitting_with_parent(PROGRAM);
    command.args(["--input-type=module", "--eval", &script(), "--"]);
    command.arg(crate::workspace::root().join(RP2040JS)).arg(image).arg(log_address.to_string());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // The emulator gets its own process group, so that Ctrl-C at the terminal reaches only this
    // process, which ends the emulator when it is done with it.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

/// The address of the log buffer in the image; 0 if there is none.
fn log_address(elf: &[u8]) -> Result<u64, EmulatorError> {
    let elf = object::File::parse(elf)
        .map_err(|error| EmulatorError::BadImage { reason: error.to_string() })?;
    let symbol = elf.symbols().find(|symbol| symbol.name() == Ok("_SEGGER_RTT"));
    Ok(symbol.map_or(0, |symbol| symbol.address()))
}

type Spawned = io::Result<(Child, ChildStdin, ChildStderr)>;

fn spawn_and_read(
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
fn listen(stderr: ChildStderr, shared: &Shared<State>) {
    for line in BufReader::new(stderr).lines().map_while(Result::ok) {
        let mut state = shared.lock();
        if state.said.len() == SAID_LINES {
            state.said.pop_front();
        }
        state.said.push_back(line);
    }
}

/// A message from or to the emulator. The meaning of `value` and `cycle` depends on `what`.
struct Record {
    what: u8,
    value: u8,
    cycle: u64,
}

const RECORD_BYTES: usize = 8;
const SERIAL: u8 = 0;
const PIN: u8 = 1;
const LOG: u8 = 3;
const CUT_POWER: u8 = 2;
const CUT_FLASH: u8 = 3;
const HANG: u8 = 4;
const USB: u8 = 5;
const USB_HOST: u8 = 6;
const SWITCH: u8 = 7;
const TIMED: u8 = 8;
const RETURNED: u8 = 6;
const STACK: u8 = 9;
const UNUSED_STACK: u8 = 7;
const STALL: u8 = 10;
const ERASE_TIME: u8 = 12;
const DELAY_ALARM: u8 = 48;
const RESET: u8 = 4;
const RUN_PIN: u8 = 32;
const UF2: u8 = 33;
const STAYS_LOW: u8 = 34;
const STAYS_HIGH: u8 = 35;
const JUMP: u8 = 36;
const USB_LINE: u8 = 37;
const BOOTSEL: u8 = 32;
const USB_SERIAL: u8 = 33;
/// The emulator's number for the starting position of an axis.
const SWITCH_ZERO: i64 = 1 << 40;

impl Record {
    fn from_bytes([what, value, cycle @ ..]: [u8; RECORD_BYTES]) -> Self {
        let [a, b, c, d, e, f] = cycle;
        Self { what, value, cycle: u64::from_le_bytes([a, b, c, d, e, f, 0, 0]) }
    }

    fn to_bytes(&self) -> [u8; RECORD_BYTES] {
        let [a, b, c, d, e, f, ..] = self.cycle.to_le_bytes();
        [self.what, self.value, a, b, c, d, e, f]
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
            if record.what != RETURNED && record.what != UNUSED_STACK {
                state.cycles = record.cycle;
            }
            match record.what {
                SERIAL => state.serial.push_back(record.value),
                RETURNED => state.timed.push((record.value, record.cycle)),
                UNUSED_STACK => state.unused_stack = Some(record.cycle),
                USB => state.usb.push_back(record.value),
                PIN => state.pins.extend(servo.pin_change(&record)),
                LOG => logged.push(record.value),
                RESET => state.shows_drive = false,
                BOOTSEL => state.shows_drive = true,
                USB_SERIAL if record.value == 0 => state.usb_serial_number.clear(),
                USB_SERIAL => state.usb_serial_number.push(char::from(record.value)),
                _ => {}
            }
        }
        drop(state);
        shared.tell();
        // The write cannot fail: the reader of the log ends only when this writer is dropped.
        let _ = log.write_all(&logged);
        if count == 0 {
            return;
        }
        buffer.copy_within(whole..filled, 0);
        filled -= whole;
    }
}

/// Derives from the width of the servo's pulses whether the pen is down.
#[derive(Default)]
struct Servo {
    rose_at: u64,
    down: bool,
}

impl Servo {
    const PIN: u8 = 7;
    /// The length in cycles of the pulse at half of the pen's height, about 1.5 ms.
    const HALF: u64 = 1_508_000 / CYCLE_NANOS;

    /// Translates a new level of a pin. The state of the pen changes at the end of a pulse.
    fn pin_change(&mut self, record: &Record) -> Option<PinChange> {
        let (number, high) = (record.value & 0x7F, record.value >= 0x80);
        let at = at(record.cycle);
        let pin = match number {
            2 => Pin::StepX,
            3 => Pin::StepY,
            4 => Pin::DirX,
            5 => Pin::DirY,
            6 => Pin::Enable,
            11 => Pin::StepZ,
            12 => Pin::DirZ,
            Self::PIN if high => {
                self.rose_at = record.cycle;
                return None;
            }
            Self::PIN => {
                let down = record.cycle - self.rose_at >= Self::HALF;
                let changed = std::mem::replace(&mut self.down, down) != down;
                return changed.then_some(PinChange { pin: Pin::Pen, high: down, at });
            }
            _ => return None,
        };
        Some(PinChange { pin, high, at })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(number: u8, high: bool, microsecond: u64) -> Record {
        Record { what: PIN, value: number | u8::from(high) << 7, cycle: microsecond * 125 }
    }

    #[test]
    fn records_are_eight_bytes() {
        let bytes = [1, 0x83, 6, 5, 4, 3, 2, 1];
        let record = Record::from_bytes(bytes);
        assert_eq!((record.what, record.value, record.cycle), (1, 0x83, 0x0102_0304_0506));
        assert_eq!(record.to_bytes(), bytes);
    }

    #[test]
    fn the_pen_is_where_the_servo_was_told() {
        let mut servo = Servo::default();
        let mut told = Vec::new();
        for (start, width) in [(0, 1000), (20_000, 2000), (40_000, 1512), (60_000, 1504)] {
            for record in [record(7, true, start), record(7, false, start + width)] {
                told.extend(servo.pin_change(&record));
            }
        }
        let pen = |high, at| PinChange { pin: Pin::Pen, high, at: Duration::from_micros(at) };
        assert_eq!(told, [pen(true, 22_000), pen(false, 61_504)]);
    }

    #[test]
    fn other_pins_are_what_they_are() {
        let change = Servo::default().pin_change(&record(5, true, 8));
        let up = PinChange { pin: Pin::DirY, high: true, at: Duration::from_micros(8) };
        assert_eq!(change, Some(up));
        assert_eq!(Servo::default().pin_change(&record(0, true, 8)), None);
    }
}
