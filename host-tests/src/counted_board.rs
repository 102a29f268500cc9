//! Counts the instructions of the interrupt handlers of the LM3S6965, by the numbers of their
//! exceptions.
//!
//! QEMU runs the firmware instruction by instruction and logs each of them, and the exceptions. A
//! count of instructions is not a time, but it is the same on every computer.

use penup_client::emulator::image_path;
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
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

/// Counts the instructions of each exception, without those of exceptions that interrupt it.
fn count(mut log: impl BufRead) -> io::Result<BTreeMap<u32, Calls>> {
    let (mut counts, mut active) = (BTreeMap::<u32, Calls>::new(), Vec::<(u32, usize)>::new());
    let mut line = Vec::new();
    while log.read_until(b'\n', &mut line)? > 0 {
        let text = String::from_utf8_lossy(&line);
        let last_number =
            || text.split_ascii_whitespace().last().and_then(|word| word.parse().ok());
        if text.starts_with("Trace ") {
            active.iter_mut().rev().take(1).for_each(|(_, count)| *count += 1);
        } else if text.starts_with("cpu_io_recompile") {
            // What it ran last had no effect: it is run again.
            active.iter_mut().rev().take(1).for_each(|(_, count)| *count -= 1);
        } else if text.starts_with("...taking pending") {
            active.extend(last_number().map(|number| (number, 0)));
        } else if text.starts_with("Exception return")
            && let Some((number, count)) = active.pop()
        {
            assert_eq!(last_number(), Some(number), "{text}");
            *counts.entry(number).or_default().entry(count).or_default() += 1;
        }
        line.clear();
    }
    Ok(counts)
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
    counter: JoinHandle<io::Result<BTreeMap<u32, Calls>>>,
}

impl Counted {
    /// Boots the board.
    ///
    /// # Errors
    /// The emulator does not start, or the board does not answer.
    pub fn boot() -> Result<Self, Box<dyn Error>> {
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
        let counter = thread::spawn(move || count(BufReader::new(log)));
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

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
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

    /// Ends the emulator and returns the counts by the numbers of the exceptions.
    ///
    /// # Errors
    /// The log makes no sense.
    pub fn end(self) -> Result<BTreeMap<u32, Calls>, Box<dyn Error>> {
        drop(self.qemu);
        Ok(self.counter.join().map_err(|_| "the log makes no sense")??)
    }
}
