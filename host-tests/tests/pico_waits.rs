//! Waits on the Raspberry Pi Pico that are a single tick longer than one word of its ring: the
//! machine must go on behind them.
#![cfg(feature = "emulator")]

use penup_host_tests::emulated_jobs::Line;
use std::error::Error;
use std::time::Duration;

/// Waits until the machine is idle, for ten seconds of the board's time at most. Returns the
/// status.
fn rest(line: &mut Line) -> Result<String, Box<dyn Error>> {
    let end = line.emulator.clock()? + Duration::from_secs(10);
    loop {
        let status = line.status()?;
        if status.starts_with("<Idle") || line.emulator.clock()? > end {
            return Ok(status);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The dwell leaves a wait of 50,001 ticks, where a word takes 50,000.
#[test]
fn a_dwell_of_any_length_ends() -> Result<(), Box<dyn Error>> {
    let mut line = Line::open(&penup::board_table::PICO)?;
    for dwell in ["G4 P1.344", "G4 P1.34418"] {
        assert_eq!(line.ask(dwell)?, "ok", "{dwell}");
        let status = rest(&mut line)?;
        assert!(status.starts_with("<Idle"), "{dwell}: {status}");
    }
    Ok(())
}

/// From rest, the first step of the second jog comes behind a wait of 50,001 ticks.
#[test]
fn a_move_whose_first_step_takes_its_time_ends() -> Result<(), Box<dyn Error>> {
    let mut line = Line::open(&penup::board_table::PICO)?;
    for setting in ["$100=160", "$101=160", "$120=2000", "$121=2000"] {
        assert_eq!(line.ask(setting)?, "ok", "{setting}");
    }
    for jog in ["$J=G91 X0.9 Y0.73125 F3000", "$J=G91 X0.9125 Y0.73125 F3000"] {
        assert_eq!(line.ask(jog)?, "ok", "{jog}");
        let status = rest(&mut line)?;
        assert!(status.starts_with("<Idle"), "{jog}: {status}");
    }
    assert_eq!(line.ask("G1 X10 Y10 F3000")?, "ok");
    assert!(rest(&mut line)?.contains("MPos:10.000,10.000"), "{}", line.status()?);
    Ok(())
}
