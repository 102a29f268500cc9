//! Parses QEMU's trace line by line to follow the pins, the clock and the bytes that the board
//! sent.
//!
//! These are the events in the format of QEMU 7.2:
//!
//! ```text
//! pl061_set_output /machine/unattached/device[9] setting output 4 to 1
//! systick_read systick read addr 0x8 data 0xffe72e size 4
//! systick_write systick write addr 0x8 data 0x0 size 4
//! systick_timer_tick systick reload
//! pl011_write addr 0x000 value 0x0000006f
//! ```
//!
//! The board's clock is SysTick, which counts down from 2^24 - 1 and wraps around. Every read of
//! the counter by the firmware updates the time here. Every wrap-around is traced, so no gap
//! between two reads is too long. The count stays at 0 for one cycle after the wrap-around has been
//! traced, so such a 0 still belongs to the period before.

use std::collections::VecDeque;
use std::time::Duration;

use super::BOARD;
use penup_job::pins::{Pin, PinChange};

/// The trace events that QEMU is asked for.
pub const EVENTS: [&str; 5] =
    ["pl061_set_output", "systick_read", "systick_write", "systick_timer_tick", "pl011_write"];

const CLOCK_BITS: u32 = 24;
const CYCLE: Duration = Duration::from_nanos(1_000_000_000 / BOARD.clock_hertz as u64);
/// The address of SysTick's current value register.
const CURRENT: u32 = 0x8;
/// The address of the UART's data register.
const DATA: u32 = 0;
/// The number of QEMU's own lines that are kept.
const SAID_LINES: usize = 20;

/// A line of the trace cannot be parsed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceError {
    /// The line.
    pub line: String,
}

/// The state of the board according to the trace so far.
#[derive(Debug, Default)]
pub struct Trace {
    pins: Vec<PinChange>,
    /// The GPIO port of the first change; the board uses only one.
    port: Option<String>,
    /// The number of cycles before SysTick was last cleared, which a start of the firmware does.
    cycles_before_start: u64,
    wraps: u64,
    /// Whether SysTick wrapped around and only counts of 0 have been read since.
    has_just_wrapped: bool,
    cycles: u64,
    sent: u64,
    said: VecDeque<String>,
}

impl Trace {
    /// Processes a line.
    pub fn line(&mut self, line: &str) -> Result<(), TraceError> {
        let mut words = line.split_ascii_whitespace();
        let understood = match words.next() {
            Some("pl061_set_output") => self.pin(words),
            Some("systick_read") => self.clock_read(words),
            Some("systick_write") => self.clock_write(words),
            Some("systick_timer_tick") => {
                self.wraps += 1;
                self.has_just_wrapped = true;
                Some(())
            }
            Some("pl011_write") => self.byte(words),
            _ => {
                self.say(line);
                Some(())
            }
        };
        understood.ok_or_else(|| TraceError { line: line.into() })
    }

    fn pin<'a>(&mut self, mut words: impl Iterator<Item = &'a str>) -> Option<()> {
        let port = words.next()?;
        if self.port.get_or_insert_with(|| port.into()) != port {
            return None;
        }
        let number = words.nth(2)?.parse().ok()?;
        let high = words.nth(1)? == "1";
        let pin = Pin::numbered(number, &BOARD.pins)?;
        let at = self.clock();
        self.pins.push(PinChange { pin, high, at });
        Some(())
    }

    fn clock_read<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Option<()> {
        let (register, count) = register_and_value(words, "addr", "data")?;
        if register == CURRENT {
            self.has_just_wrapped &= count == 0;
            let wraps = self.wraps - u64::from(self.has_just_wrapped);
            let passed = u64::from(!count & ((1 << CLOCK_BITS) - 1));
            self.cycles = self.cycles_before_start + (wraps << CLOCK_BITS) + passed;
        }
        Some(())
    }

    fn clock_write<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Option<()> {
        let (register, _) = register_and_value(words, "addr", "data")?;
        if register == CURRENT {
            self.cycles_before_start = self.cycles;
            self.wraps = 0;
            self.has_just_wrapped = false;
        }
        Some(())
    }

    fn byte<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Option<()> {
        let (register, _) = register_and_value(words, "addr", "value")?;
        self.sent += u64::from(register == DATA);
        Some(())
    }

    fn say(&mut self, line: &str) {
        if self.said.len() == SAID_LINES {
            self.said.pop_front();
        }
        self.said.push_back(line.into());
    }

    /// Returns the pin changes since the last call.
    pub fn take_pins(&mut self) -> Vec<PinChange> {
        std::mem::take(&mut self.pins)
    }

    /// The time of the last reading of the clock.
    pub fn clock(&self) -> Duration {
        Duration::from_nanos(self.cycles * CYCLE.as_nanos() as u64)
    }

    /// The number of bytes that the board has sent.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// The last lines that QEMU itself printed.
    pub fn said(&self) -> String {
        Vec::from(self.said.clone()).join("\n")
    }
}

/// Parses the two hexadecimal numbers that follow the words `register` and `value`.
fn register_and_value<'a>(
    mut words: impl Iterator<Item = &'a str>,
    register: &str,
    value: &str,
) -> Option<(u32, u32)> {
    let mut after = |name: &str| {
        words.find(|&word| word == name)?;
        u32::from_str_radix(words.next()?.strip_prefix("0x")?, 16).ok()
    };
    Some((after(register)?, after(value)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traced(lines: &str) -> Trace {
        let mut trace = Trace::default();
        for line in lines.lines() {
            assert_eq!(trace.line(line), Ok(()));
        }
        trace
    }

    #[test]
    fn pins_bear_the_last_reading_of_the_clock() {
        let mut trace = traced(
            "systick_write systick write addr 0x8 data 0x0 size 4\n\
             systick_read systick read addr 0x8 data 0xfffffe size 4\n\
             pl061_set_output /machine/unattached/device[9] setting output 5 to 1\n\
             systick_timer_tick systick reload\n\
             systick_read systick read addr 0x8 data 0xffffff size 4\n\
             pl061_set_output /machine/unattached/device[9] setting output 0 to 0\n",
        );
        let pen_down = PinChange { pin: Pin::Pen, high: true, at: CYCLE };
        let step_over = PinChange { pin: Pin::StepX, high: false, at: CYCLE * (1 << 24) };
        assert_eq!(trace.take_pins(), [pen_down, step_over]);
        assert_eq!(trace.take_pins(), []);
    }

    #[test]
    fn a_count_of_0_ends_its_period_whether_or_not_the_next_is_traced() {
        let wrap = "systick_timer_tick systick reload\n";
        let zero = "systick_read systick read addr 0x8 data 0x0 size 4\n";
        let last_of_period = CYCLE * ((1 << 24) - 1);
        assert_eq!(traced(&[zero, wrap].concat()).clock(), last_of_period);
        assert_eq!(traced(&[wrap, zero].concat()).clock(), last_of_period);
        assert_eq!(traced(&[wrap, zero, zero].concat()).clock(), last_of_period);
        let first = "systick_read systick read addr 0x8 data 0xffffff size 4\n";
        assert_eq!(traced(&[wrap, zero, first].concat()).clock(), CYCLE * (1 << 24));
        let next_period = traced(&[wrap, first, wrap, zero].concat()).clock();
        assert_eq!(next_period, CYCLE * ((2 << 24) - 1));
    }

    #[test]
    fn time_goes_on_over_a_reset() {
        let trace = traced(
            "systick_read systick read addr 0x8 data 0xfffff0 size 4\n\
             systick_write systick write addr 0x8 data 0x0 size 4\n\
             systick_read systick read addr 0x8 data 0xfffff0 size 4\n",
        );
        assert_eq!(trace.clock(), CYCLE * 30);
    }

    #[test]
    fn only_data_counts_as_sent() {
        let trace = traced(
            "pl011_write addr 0x030 value 0x00000301\n\
             pl011_write addr 0x000 value 0x0000006f\n\
             pl011_write addr 0x000 value 0x0000006b reg DR\n",
        );
        assert_eq!(trace.sent(), 2);
    }

    #[test]
    fn other_lines_are_what_the_emulator_says() {
        let lines: Vec<_> = (0..30).map(|number| format!("warning {number}")).collect();
        let said = traced(&lines.join("\n")).said();
        assert!(said.starts_with("warning 10\n") && said.ends_with("warning 29"));
    }

    #[test]
    fn what_cannot_be_read_is_refused() {
        for line in [
            "pl061_set_output",
            "pl061_set_output /machine/x setting output 8 to 1",
            "pl061_set_output /machine/x setting output five to 1",
            "systick_read systick read addr 0x8 data",
            "systick_read systick read addr 0x8 data 12",
            "pl011_write value 0x1 addr 0x0",
        ] {
            let refused = TraceError { line: line.into() };
            assert_eq!(Trace::default().line(line), Err(refused), "{line}");
        }
        let mut trace = traced("pl061_set_output /machine/b setting output 0 to 1");
        let other_port = "pl061_set_output /machine/a setting output 0 to 1";
        assert!(trace.line(other_port).is_err());
    }
}
