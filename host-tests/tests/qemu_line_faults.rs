//! Tests the firmware of the LM3S6965 in QEMU behind a line that corrupts one byte in a hundred in
//! both directions: the drawing must be the one that was sent.
#![cfg(feature = "emulator")]
#![allow(clippy::expect_used, reason = "a test fails with the words of what it expected")]

use penup::board_table::LM3S6965;
use penup_client::link::{Answer, Link};
use penup_client::machines::{WatchedPlotter, emulate};
use penup_client::progress::Quiet;
use penup_client::sender::{Sender, Timeouts};
use penup_host_tests::damage::damaged;
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_job::path::Run;
use penup_readers::lines::JobLine;
use std::error::Error;
use std::io;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A plotter at the end of a line that corrupts one byte in this many.
struct DamagedLine {
    plotter: Box<dyn WatchedPlotter>,
    one_in: Option<u64>,
    random: Random,
    damaged: u32,
}

impl DamagedLine {
    /// The bytes that arrive: some are lost, doubled or replaced, but never by a real-time command.
    fn damage(&mut self, bytes: &[u8]) -> Vec<u8> {
        let fault = |byte, random: &mut Random, arrived: &mut Vec<u8>| match random.below(3) {
            0 => {}
            1 => arrived.extend([byte; 2]),
            _ => arrived.push(b'0' + random.below(10) as u8),
        };
        let (arrived, count) = damaged(bytes, self.one_in, &mut self.random, fault);
        self.damaged += count;
        arrived
    }
}

impl Link for DamagedLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = self.damage(bytes);
        self.plotter.send(&bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        // A doubled byte needs a place.
        let mut heard = vec![0; buffer.len() / 2];
        let count = self.plotter.receive(&mut heard, timeout)?;
        let bytes = self.damage(&heard[..count]);
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn change_pen(&mut self, pen: u8) -> io::Result<Answer> {
        self.plotter.change_pen(pen)
    }
}

/// The drawing of a scene over such a line, and the number of corrupted bytes.
fn draw(scene: &str, one_in: Option<u64>) -> Result<(Vec<Run>, u32), Box<dyn Error>> {
    let plotter = emulate(&LM3S6965)?;
    let mut line = DamagedLine { plotter, one_in, random: Random::new(3), damaged: 0 };
    let mut job = vec!["$clear".to_owned()];
    job.extend(job_lines(scene, &["$page=60x80", "$margin=5"]));
    job.pop();
    let job: Vec<JobLine> = job.into_iter().map(JobLine::command).collect();
    let interrupt = AtomicBool::new(false);
    let mut sender = Sender::open(&mut line, Timeouts::default(), &interrupt)?;
    sender.stream(&job, &mut Quiet)?;
    sender.plot(&mut Quiet)?;
    sender.end();
    Ok((line.plotter.pen_runs()?, line.damaged))
}

#[test]
fn a_job_arrives_although_one_byte_in_a_hundred_is_damaged() -> Result<(), Box<dyn Error>> {
    let (expected, _) = draw("lattice2.obj", None)?;
    let (drawn, damaged) = draw("lattice2.obj", Some(100))?;
    assert!(expected.len() > 20, "{} runs are no drawing", expected.len());
    assert!(damaged > 30, "{damaged} bytes were damaged");
    assert!(drawn == expected, "another drawing");
    Ok(())
}
