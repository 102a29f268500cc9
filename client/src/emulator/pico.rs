//! Emulates a Raspberry Pi Pico in rp2040js through the script `pico.mjs`, which describes the
//! protocol between both.
//!
//! The file is longer than 500 lines, because it is the list of what the script can be told to do
//! to a board: each method sends one order of that protocol.

mod flash;
mod call_gaps;
mod interrupt_times;
mod process;
mod record;
mod servo;

pub use call_gaps::CallGaps;
pub use flash::FlashOperation;
pub use interrupt_times::InterruptTimes;
use process::{
    PROGRAM, State, check_version, command, function, listen, log_address, spawn_and_read,
};
use record::{
    ASK_IN_CHANGES, CUT_FLASH, CUT_POWER, CYCLE_NANOS, DELAY_ALARM, ERASE_TIME, GARBLE, HANG, JUMP,
    PAGE_TIME, PIN, READS, RUN_PIN, Record, SERIAL, STACK, STALL, STAYS_HIGH, STAYS_LOW, SWITCH,
    SWITCH_ZERO, TIMED, UF2, USB, USB_HOST, USB_LINE, USB_RESETS, at,
};

use super::running::{Running, Shared};
use super::stack::{self, Stack};
use super::{EmulatedBoard, EmulatorError, PinChange, log};
use crate::table::{self, BoardRow};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{ChildStdin, ExitStatus};
use std::sync::{Arc, mpsc};
use std::time::Duration;
use std::{fmt, fs, thread};

/// The board that rp2040js emulates here.
const BOARD: &BoardRow = &table::PICO;
/// The number of level changes of a bouncing contact.
const BOUNCES: u64 = 16;
/// The number of cycles by which the emulator's clock may be ahead of the last record received: 20
/// ms.
const CYCLES_AHEAD: u64 = 2_500_000;
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
        self.send(PIN, number | u8::from(high) << 7, 0)
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
            self.send(PIN, number | u8::from(level) << 7, start + turn * cycles / BOUNCES)?;
        }
        self.send(PIN, number | u8::from(high) << 7, start + cycles)
    }

    /// Attaches a limit switch to pin 8 (x) or 9 (y). It is closed while the axis is at `position`
    /// or below, in steps from its position when the emulator started. It bounces for 5 ms.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn fit_switch(&mut self, number: u8, position: i32) -> io::Result<()> {
        self.send(SWITCH, number, (SWITCH_ZERO + i64::from(position)) as u64)
    }

    /// Cuts the power and restores it. The contents of the flash are preserved.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power(&mut self) -> io::Result<()> {
        self.send(CUT_POWER, 0, 0)
    }

    /// Cuts the power as [`Pico::cut_power`] does, after `time` has passed.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power_after(&mut self, time: Duration) -> io::Result<()> {
        let cycles = time.as_nanos() as u64 / CYCLE_NANOS;
        let cycle = self.shared.lock().cycles + cycles;
        self.send(CUT_POWER, 0, cycle)
    }

    /// Cuts the power as [`Pico::cut_power`] does, when `bytes` more bytes of flash have been
    /// erased or written.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn cut_power_in_flash(&mut self, bytes: u64) -> io::Result<()> {
        self.send(CUT_FLASH, 0, bytes)
    }

    /// How often the board was reset so far: by a loss of power, by the watchdog, by the pin RUN.
    pub fn resets(&self) -> u32 {
        self.shared.lock().resets
    }

    /// Lets flash return garbage once, as in a brown-out: when `reads` more have gone to what
    /// it keeps, counted from now on, or from the next reset on.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn garble_flash(&mut self, reads: u64, behind_reset: bool) -> io::Result<()> {
        self.send(GARBLE, u8::from(behind_reset), reads)
    }

    /// How long the status was waited for at the serial line since the last call, each time that it
    /// was asked for: from the end of the byte that asks to the end of the first byte of the
    /// answer, and to the end of the answer.
    pub fn take_status_waits(&mut self) -> [Vec<Duration>; 2] {
        std::mem::take(&mut self.shared.lock().waits)
    }

    /// How often what flash keeps was read since the board last started, each time that the
    /// flash itself was asked, and not its cache.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn record_reads(&mut self) -> Result<u64, EmulatorError> {
        self.shared.lock().record_reads = None;
        self.send(READS, 0, 0)?;
        let waits = |state: &mut State| state.record_reads.is_none() && !state.ended;
        let reads = self.shared.wait_while(super::TIMEOUT, waits).record_reads;
        reads.ok_or_else(|| EmulatorError::Ended { said: self.said() })
    }

    /// How often flash has returned garbage.
    pub fn garbled(&self) -> u32 {
        self.shared.lock().garbled
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
        Ok(self.send(TIMED, number, address)?)
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
        self.send(RUN_PIN, 0, 0)
    }

    /// Pulls the pin RUN low as [`Pico::pull_run_low`] does, after `time` has passed.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn pull_run_low_after(&mut self, time: Duration) -> io::Result<()> {
        let cycles = time.as_nanos() as u64 / CYCLE_NANOS;
        let cycle = self.shared.lock().cycles + cycles;
        self.send(RUN_PIN, 0, cycle)
    }

    /// Connects the board with BOOTSEL held and copies the image onto the drive that it shows. The
    /// boot ROM then restarts the board by the watchdog.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn copy_image(&mut self) -> io::Result<()> {
        self.send(UF2, 0, 0)
    }

    /// Makes bits of a byte of flash defective. From its next change on, the bits in `mask` of the
    /// byte at offset `offset` stay high or low.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn wear_flash(&mut self, offset: u32, mask: u8, high: bool) -> io::Result<()> {
        self.send(if high { STAYS_HIGH } else { STAYS_LOW }, mask, u64::from(offset))
    }

    /// Makes the firmware's main loop continue at another address, with its stack as it is or
    /// exhausted.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn jump_to(&mut self, address: u32, uses_stack_up: bool) -> io::Result<()> {
        self.send(JUMP, u8::from(uses_stack_up), u64::from(address))
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
        self.send(HANG, 0, 0)
    }

    /// Stalls the firmware's main loop for `hundredths` of a second, while interrupts continue,
    /// when x reaches `position`, in steps from its position when the emulator started. Several
    /// positions are used in the order in which they are given.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn stall_at(&mut self, position: u32, hundredths: u8) -> io::Result<()> {
        self.send(STALL, hundredths, u64::from(position))
    }

    /// Pre-empts the clock's interrupt handler for this time just before it sets its next alarm.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn delay_alarm(&mut self, milliseconds: u8) -> io::Result<()> {
        self.send(DELAY_ALARM, milliseconds, 0)
    }

    /// Connects a USB host, which enumerates the device.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_in(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 1, 0)
    }

    /// Sets whether the USB host accepts the data that the board sends.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn let_usb_take(&mut self, takes: bool) -> io::Result<()> {
        self.send(USB_HOST, if takes { 3 } else { 2 }, 0)
    }

    /// Connects a USB host whose bus is never idle, because other devices at the same hub are busy.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_into_busy_bus(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 7, 0)
    }

    /// Connects a USB host without power, which pulls both wires low.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn plug_usb_into_dead_host(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 8, 0)
    }

    /// Makes the USB host suspend the bus, as a computer that goes to sleep does, or resume it.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn suspend_usb(&mut self, suspends: bool) -> io::Result<()> {
        self.send(USB_HOST, if suspends { 4 } else { 5 }, 0)
    }

    /// Makes the USB host send a request with more data than the device has room for. If the device
    /// does not refuse it within 100 ms, the emulator says so.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send_too_much_by_usb(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 9, 0)
    }

    /// Makes the USB host configure the device again without a reset, so that packets begin anew
    /// with DATA0 each way.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn configure_usb_again(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 10, 0)
    }

    /// Makes the USB host lift the halts of both endpoints of the port, so that packets begin anew
    /// with DATA0 each way.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn lift_usb_halts(&mut self) -> io::Result<()> {
        self.send(USB_HOST, 11, 0)
    }

    /// Makes the USB host reset the bus `count` times (at most 255), each for 10 microseconds to 20
    /// milliseconds and 20 microseconds to 100 milliseconds after the one before, and then find the
    /// device again. `seed` decides the times. What was sent and the device has not taken is lost.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn reset_usb(&mut self, count: u8, seed: u32) -> io::Result<()> {
        self.send(USB_RESETS, count, u64::from(seed))
    }

    /// Makes a program on the USB host open or close the port (DTR) at `rate` baud. The host opens
    /// it at 115200 baud after it has enumerated the device.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn open_usb(&mut self, opens: bool, rate: u32) -> io::Result<()> {
        self.send(USB_LINE, u8::from(opens), u64::from(rate))
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
    pub fn receive_by_usb(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.receive_from(|state| &mut state.usb, buffer, timeout)
    }

    /// Sends a byte over the serial line in which the UART detects `error`.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn send_damaged(&mut self, byte: u8, error: UartError) -> io::Result<()> {
        self.send(SERIAL, byte, error as u64)
    }

    /// Sets the time that erasing a sector of flash takes from now on. It is 45 ms at first, the
    /// typical value; the maximum is 400 ms.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn set_erase_time(&mut self, time: Duration) -> io::Result<()> {
        self.send(ERASE_TIME, 0, time.as_micros() as u64)
    }

    /// Sets the time that writing a page of flash takes from now on. It is 0.4 ms at first, the
    /// typical value; the maximum is 3 ms.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn set_page_time(&mut self, time: Duration) -> io::Result<()> {
        self.send(PAGE_TIME, 0, time.as_micros() as u64)
    }

    /// Asks for the status at the serial line whenever an erasure of flash or the writing of a page
    /// begins while no answer is awaited, from now on or no longer. The question comes in the
    /// board's own time, however late the computer is.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn ask_in_flash_changes(&mut self, asks: bool) -> io::Result<()> {
        self.send(ASK_IN_CHANGES, u8::from(asks), 0)
    }

    /// Sends bytes to one of the serial lines of the board.
    fn send_to(&mut self, port: u8, bytes: &[u8]) -> io::Result<()> {
        self.shared.lock().told.hear(bytes);
        let record = |&byte| Record { what: port, value: byte, cycle: 0 }.to_bytes();
        let records: Vec<u8> = bytes.iter().flat_map(record).collect();
        self.input.write_all(&records)?;
        self.input.flush()
    }

    fn receive_from(
        &mut self,
        port: impl Fn(&mut State) -> &mut VecDeque<u8>,
        buffer: &mut [u8],
        timeout: Duration,
    ) -> io::Result<usize> {
        let waits = |state: &mut State| port(state).is_empty() && !state.ended;
        let mut state = self.shared.wait_while(timeout, waits);
        if port(&mut state).is_empty() && state.ended {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        port(&mut state).read(buffer)
    }

    /// Sends one record to the emulator.
    fn send(&mut self, what: u8, value: u8, cycle: u64) -> io::Result<()> {
        self.input.write_all(&Record { what, value, cycle }.to_bytes())?;
        self.input.flush()
    }

    /// Waits until the emulator's clock runs.
    fn wait_for_boot(&mut self) -> Result<(), EmulatorError> {
        let waits = |state: &mut State| state.cycles == 0 && !state.ended;
        if self.shared.wait_while(super::TIMEOUT, waits).cycles > 0 {
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
        self.send(STACK, 0, 0)?;
        let waits = |state: &mut State| state.unused_stack.is_none() && !state.ended;
        let unused = self.shared.wait_while(super::TIMEOUT, waits).unused_stack;
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

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.receive_by_usb(buffer, timeout)
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

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.receive_from(|state| &mut state.serial, buffer, timeout)
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
