//! Tests the Raspberry Pi Pico through a loss of power and with a hanging program.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{
    EmulatedBoard, Machine, MachineEventKind, Pico, PicoByUsb, image_path,
};
use penup_host_tests::emulated_jobs::{Line, assert_same_as_on_the_host, events_until_idle};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

fn start() -> Result<Line<Pico>, Box<dyn Error>> {
    Line::to(Box::new(Pico::start(&image_path("pico"))?))
}

/// Reads the value of setting 130.
fn travel(line: &mut Line<Pico>) -> Result<String, Box<dyn Error>> {
    line.emulator.send(b"$$\n")?;
    let mut travel = None;
    loop {
        let heard = line.hear()?;
        if heard == "ok" {
            return travel.ok_or_else(|| "there is no $130".into());
        }
        if let Some(value) = heard.strip_prefix("$130=") {
            travel = Some(value.to_owned());
        }
    }
}

#[test]
fn settings_outlive_the_power() -> TestResult {
    let mut line = start()?;
    assert_eq!(travel(&mut line)?, "420.000");
    assert_eq!(line.ask("$130=300")?, "ok");
    line.emulator.cut_power()?;
    line.hear_greeting()?;
    assert_eq!(travel(&mut line)?, "300.000");
    Ok(())
}

/// A board with a USB host, which is much faster than the other port. The UART is only read, to
/// detect a restart of the board; nothing is sent to it.
struct Watched(Line<PicoByUsb>);

/// The number of flash bytes that change when settings are saved: a sector is erased, and two pages
/// of payload and the header's page are written.
const SAVE_BYTES: u64 = 4096 + 2 * 256 + 256;
/// The number of bytes after which the payload is written, and the header up to the last byte of
/// its checksum.
const VALID_FROM: u64 = 4096 + 2 * 256 + 16;

impl Watched {
    fn start() -> Result<Self, Box<dyn Error>> {
        let mut uart = start()?;
        uart.emulator.plug_usb_in()?;
        let mut watched = Self(Line::silent(Box::new(PicoByUsb(*uart.emulator))));
        watched.0.hear_greeting()?;
        Ok(watched)
    }

    fn greet(&mut self) -> TestResult {
        self.0.emulator.send(b"\x18")?;
        self.0.hear_greeting()
    }

    /// Aborts the job.
    fn give_up(&mut self) -> TestResult {
        self.greet()?;
        while !self.0.status()?.starts_with("<Idle") {}
        Ok(())
    }

    /// All settings, as the lines that list them.
    fn settings(&mut self) -> Result<Vec<String>, Box<dyn Error>> {
        self.0.emulator.send(b"$$\n")?;
        let mut lines = Vec::new();
        loop {
            match self.0.hear()? {
                line if line == "ok" => return Ok(lines),
                line => lines.push(line),
            }
        }
    }

    /// Waits until the power is cut while a setting is changed, and returns which of the two states
    /// exists afterwards.
    ///
    /// # Panics
    /// Panics if it is neither.
    fn survive(&mut self, old: &[String], travel: u32) -> Result<bool, Box<dyn Error>> {
        self.0.emulator.send(format!("$130={travel}\n").as_bytes())?;
        self.hear_restart()?;
        let found = self.settings()?;
        if found == old {
            return Ok(false);
        }
        let new: Vec<String> = old.iter().map(|line| changed(line, travel)).collect();
        assert_eq!(found, new);
        Ok(true)
    }

    /// Waits until the board has restarted and the host has enumerated it.
    fn hear_restart(&mut self) -> TestResult {
        let mut heard = Vec::new();
        while !heard.windows(4).any(|four| four == b"Grbl") {
            let mut buffer = [0; 256];
            let count = self.0.emulator.0.receive(&mut buffer, Duration::from_secs(60))?;
            if count == 0 {
                let (resets, clock) = (self.0.emulator.0.resets(), self.0.emulator.clock()?);
                let [heard, said] = [&heard, &self.0.emulator.said().into_bytes()]
                    .map(|bytes| String::from_utf8_lossy(bytes).into_owned());
                let log = self.0.emulator.log_lines();
                return Err(format!(
                    "no restart in {clock:?} after {resets} resets: {heard:?}, {said}, {log:?}"
                )
                .into());
            }
            heard.extend_from_slice(&buffer[..count]);
        }
        while self.0.emulator.0.receive(&mut [0; 256], Duration::ZERO)? > 0 {}
        self.0.forget();
        // The host finds the device again and opens its port.
        self.0.hear_greeting()
    }
}

/// The line that changes the travel of x.
fn changed(line: &str, travel: u32) -> String {
    if line.starts_with("$130=") { format!("$130={travel}.000") } else { line.to_owned() }
}

/// The number of power cuts: `PENUP_CUTS`, or else 100.
fn cut_count() -> u64 {
    wish("PENUP_CUTS", 100)
}

#[test]
fn after_a_cut_at_any_instant_the_settings_are_the_old_or_the_new_ones() -> TestResult {
    let mut watched = Watched::start()?;
    let mut settings = watched.settings()?;
    let mut random = Random::new(1971);
    let mut kept = 0;
    for number in 0..cut_count() {
        // A line takes microseconds to transmit, and saving takes 46 ms.
        let after = Duration::from_micros(random.below(120_000));
        watched.0.emulator.0.cut_power_after(after)?;
        let travel = 100 + (number % 300) as u32;
        if watched.survive(&settings, travel)? {
            settings = settings.iter().map(|line| changed(line, travel)).collect();
            kept += 1;
        }
    }
    assert!(kept > 0 && kept < cut_count(), "{kept}");
    Ok(())
}

/// The power is cut at the ends of every erasure and every page, around the last byte that matters,
/// and at random bytes. With as many cuts as bytes, it is cut before every byte.
#[test]
fn after_a_cut_in_any_write_of_the_flash_the_settings_are_the_old_or_the_new_ones() -> TestResult {
    let mut watched = Watched::start()?;
    // Both slots are in use.
    for line in ["$131=300\n", "$131=301\n"] {
        watched.0.emulator.send(line.as_bytes())?;
        assert_eq!(watched.0.hear()?, "ok");
    }
    let mut settings = watched.settings()?;
    let edges = [0, 4096, 4096 + 256, 4096 + 2 * 256, VALID_FROM, SAVE_BYTES];
    let edges = edges.into_iter().flat_map(|edge| edge.saturating_sub(1)..=edge + 1);
    let mut offsets: Vec<u64> = edges.filter(|&offset| offset < SAVE_BYTES).collect();
    if cut_count() >= SAVE_BYTES {
        offsets = (0..SAVE_BYTES).collect();
    } else {
        let mut random = Random::new(2026);
        offsets.extend((0..cut_count()).map(|_| random.below(SAVE_BYTES)));
    }
    for (number, offset) in (0u32..).zip(offsets) {
        watched.0.emulator.0.cut_power_in_flash(offset)?;
        let travel = 100 + number % 300;
        let is_new = watched.survive(&settings, travel)?;
        assert_eq!(is_new, offset >= VALID_FROM, "cut after {offset} bytes");
        if is_new {
            settings = settings.iter().map(|line| changed(line, travel)).collect();
        }
    }
    Ok(())
}

#[test]
fn a_hanging_program_is_started_again_in_alarm() -> TestResult {
    let mut line = start()?;
    for text in job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]) {
        assert_eq!(line.ask(&text)?, "ok", "{text}");
    }
    line.emulator.hang()?;
    line.hear_greeting()?;
    let message = line.hear()?;
    assert!(message.starts_with("[MSG:started again after a fault: the program hung"), "{message}");
    let message = line.hear()?;
    assert!(message.starts_with("[MSG:a job stopped at stroke 1 of "), "{message}");
    assert_eq!(line.hear()?, "[MSG:'$H'|'$X' to unlock]");
    assert_eq!(line.hear()?, "ALARM:101");
    assert!(line.status()?.contains("|Alarm:101"));
    let mut machine = Machine::default();
    let mut drivers_on = false;
    for change in line.emulator.pin_changes()? {
        if let Some(MachineEventKind::Drivers { on }) =
            machine.change(change).map(|event| event.kind)
        {
            drivers_on = on;
        }
    }
    if let Some(MachineEventKind::Drivers { on }) = machine.last().map(|event| event.kind) {
        drivers_on = on;
    }
    assert!(!drivers_on && !machine.pen_is_down());
    assert!(line.unlock()?);
    Ok(())
}

/// The board's answer to a query of one line, up to `ok` or the error.
fn ask_all(line: &mut Line<PicoByUsb>, text: &str) -> Result<Vec<String>, Box<dyn Error>> {
    line.emulator.send(format!("{text}\n").as_bytes())?;
    let mut heard = Vec::new();
    loop {
        match line.hear()? {
            // Said with the greeting.
            message if message.starts_with("[MSG:a job stopped") => continue,
            answer => heard.push(answer),
        }
        if heard.last().is_some_and(|last| last == "ok" || last.starts_with("error")) {
            return Ok(heard);
        }
    }
}

/// Identifies the job by its lengths.
fn job(line: &mut Line<PicoByUsb>) -> Result<Vec<String>, Box<dyn Error>> {
    let answer = ask_all(line, "$model")?;
    Ok(answer.into_iter().filter(|line| line.starts_with("[JOB:")).collect())
}

#[test]
fn the_last_job_is_drawn_again_after_a_loss_of_power() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = Watched::start()?.0;
    assert_eq!(ask_all(&mut line, "$again")?.last().map(String::as_str), Some("error:161"));
    for text in &lines {
        assert_eq!(ask_all(&mut line, text)?, ["ok"], "{text}");
    }
    let plotted = job(&mut line)?;
    let mut watched = Watched(line);
    watched.0.emulator.0.cut_power()?;
    watched.hear_restart()?;
    let mut line = watched.0;
    // The job cannot be drawn while the steps per mm differ, because its size would be different.
    assert_eq!(ask_all(&mut line, "$100=160")?, ["ok"]);
    assert_eq!(ask_all(&mut line, "$again")?.last().map(String::as_str), Some("error:162"));
    assert_eq!(ask_all(&mut line, "$100=80")?, ["ok"]);
    line.emulator.pin_changes()?;
    assert_eq!(ask_all(&mut line, "$again")?, ["ok"]);
    assert_eq!(job(&mut line)?, plotted);
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}

#[test]
fn after_a_cut_while_a_job_is_kept_it_is_the_old_one_or_the_new_one() -> TestResult {
    /// A sector is erased, and that of the log. Then a page of figures and strokes is written, and
    /// the header's.
    const JOB_BYTES: u64 = 2 * 4096 + 2 * 256;
    const VALID_FROM: u64 = 2 * 4096 + 256 + 16;
    let mut watched = Watched::start()?;
    let page = ["$page=60x60", "$margin=5"];
    let lines = [job_lines("cube.obj", &page), job_lines("octahedron.obj", &page)];
    let mut jobs = Vec::new();
    for lines in &lines {
        for text in [String::from("$clear")].iter().chain(lines) {
            assert_eq!(ask_all(&mut watched.0, text)?, ["ok"], "{text}");
        }
        jobs.push(job(&mut watched.0)?);
        watched.give_up()?;
    }
    let mut random = Random::new(1834);
    let (mut kept, mut changes) = (1, 0);
    for number in 0..cut_count().div_ceil(10) {
        let (plot, model) = lines[1 - kept].split_last().ok_or("no line")?;
        for text in [String::from("$clear")].iter().chain(model) {
            assert_eq!(ask_all(&mut watched.0, text)?, ["ok"], "{text}");
        }
        // Every other time when it counts already.
        let offset = if number % 2 == 0 { 0 } else { VALID_FROM };
        let offset = offset + random.below(JOB_BYTES - offset);
        watched.0.emulator.0.cut_power_in_flash(offset)?;
        watched.0.emulator.send(format!("{plot}\n").as_bytes())?;
        watched.hear_restart()?;
        assert_eq!(ask_all(&mut watched.0, "$again")?, ["ok"]);
        let found = job(&mut watched.0)?;
        let now = jobs.iter().position(|job| *job == found).ok_or("neither")?;
        assert_eq!(now != kept, offset >= VALID_FROM, "cut after {offset} bytes");
        changes += usize::from(now != kept);
        kept = now;
        watched.give_up()?;
    }
    assert!(changes > 0);
    Ok(())
}
