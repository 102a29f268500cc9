//! Tests a USB host that resets the bus of the Raspberry Pi Pico again and again: before and while
//! it finds the device, in the middle of lines, of an upload and of a job.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard as _, Pico, image_path};
use penup_host_tests::emulated_jobs::{
    Line, assert_same_as_on_the_host, begin_on, events_until_idle,
};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::time::Duration;

type TestResult<T = ()> = Result<T, Box<dyn Error>>;

/// The longest time for which the port may be silent.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A board whose USB port is open, and what was heard there.
struct Plugged {
    uart: Line<Pico>,
    heard: Vec<u8>,
}

impl Plugged {
    fn start() -> TestResult<Self> {
        let uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
        let mut plugged = Self { uart, heard: Vec::new() };
        plugged.uart.emulator.plug_usb_in()?;
        plugged.hear_greeting()?;
        Ok(plugged)
    }

    /// The next line that comes by USB.
    fn hear(&mut self) -> TestResult<String> {
        loop {
            if let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                return Ok(String::from_utf8(line)?.trim().to_owned());
            }
            let mut buffer = [0; 256];
            let count = self.uart.emulator.receive_by_usb(&mut buffer, TIMEOUT)?;
            if count == 0 {
                return Err("the port is silent".into());
            }
            self.heard.extend_from_slice(&buffer[..count]);
        }
    }

    fn hear_greeting(&mut self) -> TestResult {
        while !self.hear()?.starts_with("Grbl") {}
        Ok(())
    }

    /// Sends a line by USB, and returns the lines of the answer.
    fn ask(&mut self, text: &str) -> TestResult<Vec<String>> {
        self.uart.emulator.send_by_usb(format!("{text}\n").as_bytes())?;
        let mut heard = Vec::new();
        while heard.last().is_none_or(|last: &String| last != "ok" && !last.starts_with("error")) {
            heard.push(self.hear()?);
        }
        Ok(heard)
    }

    /// Resets the bus so often, and waits until the port has been opened again. Returns what was
    /// heard before.
    fn storm(&mut self, count: u8, seed: u64) -> TestResult<Vec<String>> {
        self.uart.emulator.reset_usb(count, seed as u32)?;
        // The port is opened when the host has found the device, perhaps several times.
        self.wait(Duration::from_millis(130) * u32::from(count) + Duration::from_millis(100))?;
        self.uart.emulator.send_by_usb(b"$G\n")?;
        let mut heard = Vec::new();
        loop {
            let line = self.hear()?;
            if line.starts_with("[GC:") {
                break;
            }
            heard.push(line);
        }
        assert_eq!(self.hear()?, "ok");
        let said = self.uart.emulator.said();
        assert!(said.is_empty(), "{said}");
        Ok(heard)
    }

    /// Waits for this time on the board's own clock.
    fn wait(&mut self, time: Duration) -> TestResult {
        let end = self.uart.emulator.clock()? + time;
        while self.uart.emulator.clock()? < end {
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(())
    }
}

#[test]
fn a_job_is_drawn_as_ever_while_the_bus_is_reset() -> TestResult {
    let lines = job_lines("cube.obj", &["$page=40x40", "$margin=5"]);
    let mut plugged = Plugged::start()?;
    let mut random = Random::new(2105);
    plugged.uart = begin_on(plugged.uart, &lines)?;
    // The times are the board's: most resets come while the steps run.
    for _ in 0..wish("PENUP_STORMS", 4) {
        plugged.uart.emulator.reset_usb(20, random.below(1 << 24) as u32)?;
        plugged.wait(Duration::from_millis(1500))?;
    }
    let pins = events_until_idle(&mut plugged.uart)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    assert!(!plugged.uart.status()?.contains("|Late:"), "the queue ran empty");
    plugged.storm(1, 1)?;
    assert_eq!(plugged.ask("v 1 2 3")?, ["ok"]);
    Ok(())
}

/// Lines come while the bus is reset. What is accepted is what was sent: no line lacks its end, and
/// none is made of two.
#[test]
fn no_line_is_cut_short_or_joined_by_a_reset() -> TestResult {
    let mut plugged = Plugged::start()?;
    let mut random = Random::new(2106);
    let mut sent = Vec::new();
    let mut acknowledged = 0;
    for round in 0..wish("PENUP_STORMS", 10) {
        let mut text = String::new();
        // Each line without its last digits would be another vertex.
        for number in 0..10 {
            let line = format!("v {round}.1234 {number}.2345 5.{}", 1000 + random.below(9000));
            text += &format!("{line}\n");
            sent.push(line);
        }
        // The last line has not ended.
        let ends = random.once_in(3);
        let cut = if ends { text.len() } else { text.len() - 1 - random.below(7) as usize };
        plugged.uart.emulator.send_by_usb(&text.as_bytes()[..cut])?;
        plugged.wait(Duration::from_micros(random.below(3000)))?;
        let heard = plugged.storm(1 + random.below(6) as u8, random.below(1 << 24))?;
        acknowledged += heard.iter().filter(|line| *line == "ok").count();
    }
    let count = plugged.ask("$model")?;
    let count: usize = count[0]
        .trim_start_matches("[MODEL:vertices ")
        .split(' ')
        .next()
        .ok_or("no count")?
        .parse()?;
    assert!(count >= acknowledged, "{count} of {acknowledged} that were acknowledged");
    assert!(count > 0 && count < sent.len(), "{count} of {}", sent.len());
    let kept = plugged.ask(&format!("$list=v,1,{count}"))?;
    let kept: Vec<&String> = kept.iter().filter(|line| line.contains("v ")).collect();
    assert_eq!(kept.len(), count, "{kept:?}");
    let mut rest = sent.iter();
    for vertex in kept {
        let is_sent = rest.any(|line| coordinates(line) == coordinates(vertex));
        assert!(is_sent, "{vertex} was not sent, or not in this order");
    }
    Ok(())
}

/// The coordinates of a vertex, as it was sent or as it is listed.
fn coordinates(line: &str) -> Vec<f64> {
    let vertex = line.trim_end_matches(']').rsplit(' ').take(3);
    vertex.filter_map(|word| word.parse().ok()).collect()
}
