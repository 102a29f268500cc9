//! The rescue mode, which runs instead of the plotter when the program faults again and again as
//! soon as it starts.
//!
//! Nothing moves, and the pen stays where the fault has raised it: its servo gets no pulses,
//! because no settings are read that say at what height it is raised. They would say, too, which
//! level switches the drivers off: the resistor at their enable pin does so, and nothing drives
//! that pin.
//!
//! Both ports answer: each line with the cause of the fault and `error:9`, `?` with a status, and
//! ctrl-X with another attempt to start. `$UF2` and the 1200-baud touch open the drive for a new
//! image.

use core::fmt::Write;

use penup::protocol::{CommandError, RealTime};

use super::emergency::{self, Cause};
use super::pins;
use super::ports::Ports;
use super::usb;

/// Answers both ports forever, without moving anything.
pub fn run(mut ports: Ports, cause: &Cause) -> ! {
    pins::release_enable();
    tell(&mut ports, cause);
    let mut line = heapless::String::<8>::new();
    loop {
        emergency::feed();
        usb::go_on();
        if usb::take_touched() {
            emergency::show_drive();
        }
        if usb::take_opened() {
            ports.reply_only_to_opened(true);
            tell(&mut ports, cause);
            ports.reply_only_to_opened(false);
        }
        let requests = ports.take_real_time();
        if requests.has(RealTime::ABORT) {
            emergency::restart_fresh();
        }
        if requests.has(RealTime::STATUS) {
            ports.write(b"<Alarm|MPos:0.000,0.000,0.000|Alarm:101>\r\n");
        }
        match ports.read_byte().map(|(_, byte)| byte) {
            Some(b'\n' | b'\r') if line.is_empty() => {}
            Some(b'\n' | b'\r') if line == "$UF2" => emergency::show_drive(),
            Some(b'\n' | b'\r') => {
                line.clear();
                tell(&mut ports, cause);
                let mut reply = Cause::new();
                // This never fails, because the reply is short.
                let _ = write!(reply, "error:{}\r\n", CommandError::Locked.number());
                ports.write(reply.as_bytes());
            }
            // A longer line is no command that matters here, so its end is dropped.
            Some(byte) => drop(line.push(char::from(byte))),
            None => cortex_m::asm::wfe(),
        }
    }
}

/// Writes the fault and its alarm to the ports, as a reply that a sender understands.
fn tell(ports: &mut Ports, cause: &Cause) {
    ports.write(b"\r\n[MSG:the program faults as soon as it starts, ctrl-X tries again: ");
    ports.write(cause.as_bytes());
    ports.write(b"]\r\nALARM:101\r\n");
}
