//! What is left of the board when the program faults again and again as soon as it starts.
//!
//! Nothing moves, the drivers are off, the pen is up. Both ports answer: each line with the cause and `error:9`, `?`
//! with a status, ctrl-X with another try.

use core::fmt::Write;

use penup::protocol::{RealTime, Refusal};

use super::emergency::{self, Cause};
use super::ports::Ports;

/// Answers for ever.
pub fn run(mut ports: Ports, cause: &Cause) -> ! {
    tell(&mut ports, cause);
    let mut is_empty = true;
    loop {
        emergency::feed();
        let asked = ports.take_real_time();
        if asked.has(RealTime::ABORT) {
            emergency::restart_fresh();
        }
        if asked.has(RealTime::STATUS) {
            ports.write(b"<Alarm|MPos:0.000,0.000,0.000|Alarm:101>\r\n");
        }
        match ports.read_byte() {
            Some(b'\n' | b'\r') if is_empty => {}
            Some(b'\n' | b'\r') => {
                is_empty = true;
                tell(&mut ports, cause);
                let mut line = Cause::new();
                let _ = write!(line, "error:{}\r\n", Refusal::Locked.number());
                ports.write(line.as_bytes());
            }
            Some(_) => is_empty = false,
            None => cortex_m::asm::wfe(),
        }
    }
}

fn tell(ports: &mut Ports, cause: &Cause) {
    ports.write(b"\r\n[MSG:the program faults as soon as it starts, ctrl-X tries again: ");
    ports.write(cause.as_bytes());
    ports.write(b"]\r\nALARM:101\r\n");
}
