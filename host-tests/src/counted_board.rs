//! Counts the instructions of the interrupt handlers of the LM3S6965, by the numbers of their
//! exceptions, and those for which it masks interrupts.
//!
//! QEMU runs the firmware instruction by instruction and logs each of them, and the exceptions. A
//! count of instructions is not a time, but it is the same on every computer.
//!
//! A mask begins and ends with instructions of its own, which are looked up in the image. While the
//! core sleeps with interrupts masked, it executes none, and the first interrupt that comes wakes
//! it. So the whole mask around a sleep is counted as if the core did not sleep, which is what an
//! interrupt waits for that comes at the mask's beginning.

use object::{Object, ObjectSection};
use penup_client::emulator::image_path;
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

type TestResult = Result<(), Box<dyn Error>>;

/// Of the tick of the clock.
pub const CLOCK: u32 = 15;
/// Of received bytes, and of room for bytes to send.
pub const SERIAL: u32 = 21;
/// Of an event.
pub const EVENT: u32 = 37;
/// Of the end of its pulses.
pub const END_OF_PULSES: u32 = 39;
/// Of a piece of the brake's work.
pub const PIECE_OF_BRAKE: u32 = 36;

/// How long the board may be silent on a busy computer. Its log makes it some hundred times slower
/// than it is, and its answer to a line may come only when the moves before it are done.
const TIMEOUT: Duration = Duration::from_secs(900);

/// The bytes that the board can receive ahead of its main loop.
const RECEIVE_QUEUE: usize = 255;

/// The calls of a handler: the number of calls for each number of instructions.
pub type Calls = BTreeMap<usize, usize>;

/// What was counted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Counts {
    /// The calls of each handler, by the number of its exception. The instructions of handlers that
    /// interrupt it do not count.
    pub handlers: BTreeMap<u32, Calls>,
    /// The masks of all interrupts, by PRIMASK.
    pub all_masked: Calls,
    /// The masks of all interrupts but those of the steps, by BASEPRI. The instructions of handlers
    /// that interrupt them count, too.
    pub all_but_steps_masked: Calls,
}

/// What an instruction does to the masks of interrupts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MaskChange {
    /// `CPSID i`: PRIMASK masks all interrupts. A section begins, which has read PRIMASK before.
    SetAll,
    /// `MSR` writes PRIMASK: the section ends with what it has read. Sections can be nested.
    RestoreAll,
    /// `MRS` reads BASEPRI: a section begins, which will write its mask and at last what it has
    /// read. Sections can be nested.
    ReadPriority,
    /// `MSR` writes BASEPRI.
    WritePriority,
    /// An instruction whose effect on the masks cannot be followed.
    Unknown,
}

/// The instructions of an image.
struct Code {
    start: u32,
    bytes: Vec<u8>,
}

impl Code {
    fn of(elf: &[u8]) -> Result<Self, Box<dyn Error>> {
        let elf = object::File::parse(elf)?;
        let text = elf.section_by_name(".text").ok_or("the image has no code")?;
        Ok(Self { start: u32::try_from(text.address())?, bytes: text.data()?.to_vec() })
    }

    fn half_word(&self, address: u32) -> Option<u16> {
        let at = address.checked_sub(self.start)? as usize;
        Some(u16::from_le_bytes(*self.bytes.get(at..)?.first_chunk()?))
    }

    /// What the instruction at this address does to the masks (Arm DDI 0403, B5.2).
    fn mask_change(&self, address: u32) -> Option<MaskChange> {
        let first = self.half_word(address)?;
        match first {
            0xB672 => return Some(MaskChange::SetAll),
            // Other forms of CPS.
            0xB660..=0xB67F => return Some(MaskChange::Unknown),
            _ => {}
        }
        let (is_read, is_write) = (first == 0xF3EF, first & 0xFFF0 == 0xF380);
        if !is_read && !is_write {
            return None;
        }
        // The number of the special register: BASEPRI, PRIMASK, BASEPRI_MAX or FAULTMASK.
        match self.half_word(address + 2)? & 0xFF {
            0x11 if is_read => Some(MaskChange::ReadPriority),
            0x11 => Some(MaskChange::WritePriority),
            0x10 if is_write => Some(MaskChange::RestoreAll),
            0x12 | 0x13 if is_write => Some(MaskChange::Unknown),
            _ => None,
        }
    }
}

/// What the core does: the main loop or a handler.
#[derive(Debug, Default)]
struct Active {
    /// The number of the exception; 0 in the main loop.
    number: u32,
    /// The instructions so far.
    count: usize,
    /// Whether a section that masks by BASEPRI has begun and not written its mask yet.
    begins_section: bool,
}

/// Counts what a log contains.
struct Counter {
    code: Code,
    counts: Counts,
    /// The address of the instruction that was logged last. It is executed, unless the next line
    /// says that QEMU has stopped before it, and will log it again.
    last: Option<u32>,
    /// The main loop, and the handlers that are active, the last one on top.
    active: Vec<Active>,
    /// The number of sections that mask by PRIMASK, and the instructions since the first one.
    all_sections: usize,
    all_masked: usize,
    /// The number of sections that mask by BASEPRI, and the instructions since the first one.
    sections: usize,
    all_but_steps_masked: usize,
}

impl Counter {
    fn new(code: Code) -> Self {
        Self {
            code,
            counts: Counts::default(),
            last: None,
            active: vec![Active::default()],
            all_sections: 0,
            all_masked: 0,
            sections: 0,
            all_but_steps_masked: 0,
        }
    }

    /// The instruction that was logged last was executed.
    fn execute(&mut self) {
        let (Some(address), Some(active)) = (self.last.take(), self.active.last_mut()) else {
            return;
        };
        active.count += 1;
        self.all_masked += 1;
        self.all_but_steps_masked += 1;
        let begin = |sections: &mut usize, count: &mut usize| {
            if *sections == 0 {
                *count = 0;
            }
            *sections += 1;
        };
        let end = |sections: &mut usize, count: usize, masks: &mut Calls| {
            *sections = sections.checked_sub(1).expect("a section ends that has begun");
            if *sections == 0 {
                *masks.entry(count).or_default() += 1;
            }
        };
        match self.code.mask_change(address) {
            None => {}
            Some(MaskChange::SetAll) => begin(&mut self.all_sections, &mut self.all_masked),
            Some(MaskChange::RestoreAll) => {
                end(&mut self.all_sections, self.all_masked, &mut self.counts.all_masked);
            }
            Some(MaskChange::ReadPriority) => active.begins_section = true,
            Some(MaskChange::WritePriority) if active.begins_section => {
                active.begins_section = false;
                begin(&mut self.sections, &mut self.all_but_steps_masked);
            }
            Some(MaskChange::WritePriority) => {
                let masks = &mut self.counts.all_but_steps_masked;
                end(&mut self.sections, self.all_but_steps_masked, masks);
            }
            Some(MaskChange::Unknown) => panic!("{address:#x} changes the masks in another way"),
        }
    }

    /// A handler has returned.
    fn leave(&mut self, number: Option<u32>) {
        assert!(self.active.len() > 1, "a handler returns that was not called");
        let Some(Active { number: last, count, .. }) = self.active.pop() else { return };
        assert_eq!(number, Some(last), "another handler returns");
        *self.counts.handlers.entry(last).or_default().entry(count).or_default() += 1;
    }
}

/// The address of the instruction that a line such as `Trace 0: 0x7f… [00800400/00000110/…]` tells.
fn address(line: &str) -> Option<u32> {
    let (_, state) = line.split_once('[')?;
    u32::from_str_radix(state.split('/').nth(1)?, 16).ok()
}

/// Counts the instructions of the handlers and of the masks.
fn count(mut log: impl BufRead, code: Code) -> io::Result<Counts> {
    let mut counter = Counter::new(code);
    let mut line = Vec::new();
    // The last line may be cut off.
    while log.read_until(b'\n', &mut line)? > 0 && line.ends_with(b"\n") {
        let text = String::from_utf8_lossy(&line);
        let last_number =
            || text.split_ascii_whitespace().last().and_then(|word| word.parse().ok());
        if text.starts_with("Trace ") {
            counter.execute();
            counter.last = Some(address(&text).expect("the log tells the address"));
        } else if text.starts_with("cpu_io_recompile") || text.starts_with("Stopped execution") {
            counter.last = None;
        } else if text.starts_with("...taking pending") {
            counter.execute();
            let active = |number| Active { number, ..Active::default() };
            counter.active.extend(last_number().map(active));
        } else if text.starts_with("Exception return") {
            counter.execute();
            counter.leave(last_number());
        }
        line.clear();
    }
    Ok(counter.counts)
}

/// A process that is ended when its owner is dropped.
struct Qemu(Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        // Both fail only if it has ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A board whose instructions are counted.
pub struct Counted {
    qemu: Qemu,
    line: BufReader<TcpStream>,
    counter: JoinHandle<io::Result<Counts>>,
}

impl Counted {
    /// Boots the board.
    ///
    /// # Errors
    /// The emulator does not start, or the board does not answer.
    pub fn boot() -> Result<Self, Box<dyn Error>> {
        let code = Code::of(&fs::read(image_path("lm3s6965"))?)?;
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let child = Command::new("qemu-system-arm")
            .args(["-machine", "lm3s6965evb", "-display", "none", "-monitor", "none"])
            .args(["-icount", "shift=4,sleep=off", "-singlestep", "-d", "exec,nochain,int"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(["-serial", &format!("tcp:{}", listener.local_addr()?), "-kernel"])
            .arg(image_path("lm3s6965"))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let mut qemu = Qemu(child);
        let log = qemu.0.stderr.take().ok_or("no log")?;
        let counter = thread::spawn(move || count(BufReader::new(log), code));
        listener.set_nonblocking(true)?;
        let deadline = Instant::now() + TIMEOUT;
        let line = loop {
            match listener.accept() {
                Ok((line, _)) => break line,
                Err(error) if Instant::now() > deadline => return Err(error.into()),
                Err(_) => thread::sleep(Duration::from_millis(5)),
            }
        };
        line.set_nonblocking(false)?;
        line.set_read_timeout(Some(TIMEOUT))?;
        let mut board = Self { qemu, line: BufReader::new(line), counter };
        board.hear_until("Grbl")?;
        Ok(board)
    }

    fn hear(&mut self) -> Result<String, Box<dyn Error>> {
        let mut line = String::new();
        if self.line.read_line(&mut line)? == 0 {
            return Err("the board has ended".into());
        }
        Ok(line.trim().to_owned())
    }

    /// Sends bytes, whatever they are.
    ///
    /// # Errors
    /// The board has ended.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.get_mut().write_all(bytes)
    }

    /// Waits for a line that begins with `begin`.
    fn hear_until(&mut self, begin: &str) -> TestResult {
        loop {
            let line = self.hear()?;
            assert!(!line.starts_with("error"), "{line}");
            if line.starts_with(begin) {
                return Ok(());
            }
        }
    }

    /// Sends a line and waits for its `ok`.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn ask(&mut self, line: &str) -> TestResult {
        self.send(format!("{line}\n").as_bytes())?;
        self.hear_until("ok")
    }

    /// Sends lines, so many ahead of their answers as the board has room for, and waits for the
    /// `ok` of each.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn stream(&mut self, lines: impl IntoIterator<Item = String>) -> TestResult {
        let mut unanswered = VecDeque::new();
        for line in lines {
            let line = line + "\n";
            while unanswered.iter().sum::<usize>() + line.len() > RECEIVE_QUEUE {
                self.hear_until("ok")?;
                unanswered.pop_front();
            }
            self.send(line.as_bytes())?;
            unanswered.push_back(line.len());
        }
        unanswered.into_iter().try_for_each(|_| self.hear_until("ok"))
    }

    /// Sends a real-time command and waits for a line that begins with `begin`.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn order(&mut self, byte: u8, begin: &str) -> TestResult {
        self.send(&[byte])?;
        self.hear_until(begin)
    }

    /// Waits for a state.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn wait_for(&mut self, state: &str) -> TestResult {
        loop {
            self.send(b"?")?;
            let status = self.hear()?;
            if status.starts_with(state) {
                return Ok(());
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends the emulator and returns what was counted.
    ///
    /// # Errors
    /// The log makes no sense.
    pub fn end(self) -> Result<Counts, Box<dyn Error>> {
        drop(self.qemu);
        Ok(self.counter.join().map_err(|_| "the log makes no sense")??)
    }
}
