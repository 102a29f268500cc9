//! Senders that wait for the plotter, with a slow main loop.

use super::ink::{assert_same_ink, inked, plan};
use super::{chiplotle, gnuplot, tolerance, vpype};
use penup::machine::State;
use penup::motion::TICKS_PER_SECOND;
use penup::plotter::Board;
use penup_host_tests::whole_jobs::Bench;

/// How many bytes wait in the port at most, as on the boards. What comes beyond is lost.
const PORT_BYTES: usize = 255;

/// A port between a sender and a bench, whose main loop turns once a while only.
struct SlowPort {
    bench: Bench,
    /// The bytes that wait in the port.
    waiting: std::collections::VecDeque<u8>,
    heard: Vec<u8>,
    time: u32,
}

impl SlowPort {
    fn new() -> Self {
        Self { bench: Bench::small(), waiting: [].into(), heard: Vec::new(), time: 0 }
    }

    /// Sends a byte, which takes a tenth of a millisecond.
    fn send(&mut self, byte: u8) {
        assert!(self.waiting.len() < PORT_BYTES, "a byte is lost");
        self.waiting.push_back(byte);
        self.time += 1;
        if self.time.is_multiple_of(10) {
            self.pass();
        }
    }

    /// Lets a millisecond pass, in which the main loop takes a few bytes in every fifth one.
    fn pass(&mut self) {
        if self.time % 50 < 10 {
            // As long as the plotter waits, the bytes wait in the port.
            for _ in 0..60 {
                if self.bench.board.has_read_all()
                    && let Some(byte) = self.waiting.pop_front()
                {
                    self.bench.board.receive(&[byte]);
                }
                self.bench.plotter.poll(&mut self.bench.board);
            }
        }
        self.time += 10 - self.time % 10;
        self.bench.plotter.poll(&mut self.bench.board);
        self.bench.board.wait();
        self.heard.extend(self.bench.board.take_sent());
    }

    /// Waits for an answer that ends with CR.
    fn answer(&mut self) -> String {
        while !self.heard.contains(&b'\r') {
            self.pass();
        }
        let end = self.heard.iter().position(|byte| *byte == b'\r').unwrap_or(0);
        let answer: Vec<u8> = self.heard.drain(..=end).collect();
        String::from_utf8_lossy(&answer[..end]).into_owned()
    }

    fn finish(&mut self) {
        let mut idle = 0;
        while idle < 100 {
            self.pass();
            let machine = self.bench.plotter.machine();
            let is_idle = self.waiting.is_empty()
                && self.bench.board.has_read_all()
                && machine.state() == State::Idle
                && machine.is_stopped();
            idle = if is_idle { idle + 1 } else { 0 };
        }
    }
}

#[test]
fn a_sender_that_asks_for_room_loses_nothing() {
    for (name, file) in [("vpype", vpype()), ("chiplotle", chiplotle())] {
        let mut port = SlowPort::new();
        b"\x1B.(\x1B.R".iter().for_each(|byte| port.send(*byte));
        let mut least = usize::MAX;
        // Chiplotle sends in blocks, each when there is room for it.
        for block in file.chunks(200) {
            loop {
                b"\x1B.B".iter().for_each(|byte| port.send(*byte));
                let room: usize = port.answer().parse().expect("a number");
                least = least.min(room);
                if room >= block.len() {
                    break;
                }
                (0..20).for_each(|_| port.pass());
            }
            block.iter().for_each(|byte| port.send(*byte));
        }
        assert!(file.len() < 3000 || least < 200, "the sender had to wait: {least}");
        port.finish();
        b"OE;\x1B.E".iter().for_each(|byte| port.send(*byte));
        let answers = [port.answer(), port.answer()];
        assert!(answers.iter().all(|answer| answer == "0"), "{answers:?}");
        assert_same_ink(
            name,
            &inked(&port.bench),
            &plan(&file).expect("a valid file"),
            tolerance(name),
        );
    }
}

/// Turns of the main loop are longer than bytes of the line while circles, letters and short chords
/// are drawn: 0.6 ms against 87 µs. A sender may all the same send at once as much as it was told
/// that there is room for.
#[test]
fn a_sender_may_fill_the_room_at_once_however_long_turns_take() {
    let circles = "CI100;CI101;CI102;".repeat(80);
    let label = format!("LB{}", "Wq8&".repeat(300));
    let chords: String =
        (0..120).map(|at| format!(",{},{}", 2000 + at * 37 % 300, 2000 + at * 53 % 300)).collect();
    let dashes = format!("PD2000,2000{chords}");
    for (begin, drawn) in [
        ("IN;SP1;PU4000,4000;", circles),
        ("IN;SP1;SI0.1,0.15;PU1000,4000;", label),
        ("IN;SP1;LT2,1;PU2000,2000;", dashes),
    ] {
        let mut bench = Bench::small();
        bench.board.receive(begin.as_bytes());
        bench.work(10_000);
        assert_eq!(bench.say("\x1B.B"), "1024\r");
        let mut bytes = drawn.bytes().take(1024);
        loop {
            let came: Vec<u8> = bytes.by_ref().take(7).collect();
            bench.board.receive(&came);
            let waiting = bench.board.waiting();
            assert!(waiting <= PORT_BYTES, "{begin} {waiting} bytes wait in the port");
            bench.plotter.poll(&mut bench.board);
            bench.board.pass((TICKS_PER_SECOND / 1600).into());
            if came.is_empty() {
                break;
            }
        }
    }
}

#[test]
fn a_sender_that_obeys_xon_and_xoff_loses_nothing() {
    let setup = b"\x1B.Y\n\x1B.I81;;17:\x1B.N;19:\x1B.M500:\n";
    for (name, file) in [("vpype", vpype()), ("gnuplot", gnuplot())] {
        let mut port = SlowPort::new();
        let (mut may_send, mut stops) = (true, 0);
        for byte in setup.iter().chain(&file) {
            loop {
                for byte in std::mem::take(&mut port.heard) {
                    match byte {
                        0x11 => may_send = true,
                        0x13 => (may_send, stops) = (false, stops + 1),
                        byte => panic!("heard {byte}"),
                    }
                }
                if may_send {
                    break;
                }
                port.pass();
            }
            port.send(*byte);
        }
        assert!(stops > 0, "{name}: the sender was never stopped");
        port.finish();
        assert_same_ink(
            name,
            &inked(&port.bench),
            &plan(&file).expect("a valid file"),
            tolerance(name),
        );
    }
}
