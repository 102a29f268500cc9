//! Tests that the step interrupt of the LM3S6965 takes no more instructions than documented
//! (`src/boards/lm3s6965/steps.rs`).
//!
//! QEMU runs the firmware instruction by instruction and logs each of them, and the exceptions. A
//! count of instructions is not a time, but it is the same on every computer.
#![cfg(feature = "emulator")]

use penup_client::emulator::image_path;
use penup_host_tests::emulated_jobs::PEN_ON_A_MOTOR;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

type TestResult = Result<(), Box<dyn Error>>;

/// The interrupt handlers, by the numbers of their exceptions.
const EVENT: u32 = 37;
const END_OF_PULSES: u32 = 39;
const PIECE_OF_BRAKE: u32 = 36;

/// How long the board may be silent on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// The calls of a handler: the number of calls for each number of instructions.
type Calls = BTreeMap<usize, usize>;

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
struct Counted {
    qemu: Qemu,
    line: BufReader<TcpStream>,
    counter: JoinHandle<io::Result<BTreeMap<u32, Calls>>>,
}

impl Counted {
    fn boot() -> Result<Self, Box<dyn Error>> {
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
        let deadline = Instant::now() + PATIENCE;
        let line = loop {
            match listener.accept() {
                Ok((line, _)) => break line,
                Err(error) if Instant::now() > deadline => return Err(error.into()),
                Err(_) => thread::sleep(Duration::from_millis(5)),
            }
        };
        line.set_nonblocking(false)?;
        line.set_read_timeout(Some(PATIENCE))?;
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

    fn ask(&mut self, line: &str) -> TestResult {
        self.send(format!("{line}\n").as_bytes())?;
        self.hear_until("ok")
    }

    /// Sends a real-time command and waits for a line that begins with `begin`.
    fn order(&mut self, byte: u8, begin: &str) -> TestResult {
        self.send(&[byte])?;
        self.hear_until(begin)
    }

    fn wait_for(&mut self, state: &str) -> TestResult {
        loop {
            self.send(b"?")?;
            let status = self.hear()?;
            if status.starts_with(state) {
                return Ok(());
            }
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends the emulator and returns the counts.
    fn end(self) -> Result<BTreeMap<u32, Calls>, Box<dyn Error>> {
        drop(self.qemu);
        Ok(self.counter.join().map_err(|_| "the log makes no sense")??)
    }
}

const CHORDS: [&str; 6] = ["M3", "G1X8Y3F15000", "G1X8.05Y3.02", "G1X8.1Y3.06", "G1X8.1Y0", "M5"];

/// Draws chords with these settings, sends a part of a line, and stops at once. No call for an
/// event may take more than `event` instructions.
fn no_call_takes_more(settings: &[&str], event: usize) -> TestResult {
    let mut board = Counted::boot()?;
    for line in settings.iter().chain(&CHORDS) {
        board.ask(line)?;
    }
    board.wait_for("<Idle")?;
    for line in ["M3", "G1X20Y30"] {
        board.ask(line)?;
    }
    board.order(0x18, "Grbl")?;
    let counts = board.end()?;
    for (number, most) in [(EVENT, event), (END_OF_PULSES, 51), (PIECE_OF_BRAKE, 59)] {
        let calls = counts.get(&number).ok_or("a handler was not called")?;
        assert!(calls.values().sum::<usize>() > 700, "{number}: {calls:?}");
        let worst = calls.last_key_value().map(|(worst, _)| *worst);
        // Far less were no count.
        assert!(worst.is_some_and(|worst| (40..=most).contains(&worst)), "{number}: {calls:?}");
    }
    Ok(())
}

#[test]
fn a_move_takes_no_more_instructions_than_the_source_says() -> TestResult {
    // First few steps wait, then the queue holds the stopping distance.
    no_call_takes_more(&["$110=20000", "$111=20000", "$120=2000", "$121=2000"], 59)
}

#[test]
fn steps_of_the_pen_and_of_slack_take_no_more_instructions_than_the_source_says() -> TestResult {
    no_call_takes_more(&[&PEN_ON_A_MOTOR[..], &["$235=0.2", "$236=0.2"]].concat(), 76)
}
