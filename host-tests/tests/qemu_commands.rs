//! Tests the client's commands for the machine with an emulated board at a serial port.
#![cfg(all(feature = "emulator", unix))]

use clap::Parser as _;
use penup_client::cli::Cli;
use penup_client::emulator::{EmulatedBoard as _, Emulator, Options, image_path};
use penup_client::run::run;
use serde_json::{Value, json};
use serialport::{SerialPort as _, TTYPort};
use std::error::Error;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Runs the emulated board at the other end of a pseudo-terminal until `is_over`.
fn serve(mut wire: TTYPort, is_over: &AtomicBool) -> Result<(), String> {
    let said = |error: &dyn Error| error.to_string();
    let board = Emulator::start(&image_path("lm3s6965"), Options::default());
    let mut board = board.map_err(|error| said(&error))?;
    let mut buffer = [0; 256];
    while !is_over.load(Ordering::Relaxed) {
        // An error says that no program holds the port.
        if let Ok(count) = wire.read(&mut buffer) {
            board.send(&buffer[..count]).map_err(|error| said(&error))?;
        }
        let count = board.receive(&mut buffer, Duration::from_millis(1));
        let count = count.map_err(|error| said(&error))?;
        let _ = wire.write_all(&buffer[..count]);
    }
    Ok(())
}

#[test]
fn the_commands_for_the_machine_move_and_set_an_emulated_board() -> Result<(), Box<dyn Error>> {
    let (mut wire, terminal) = TTYPort::pair()?;
    wire.set_timeout(Duration::from_millis(1))?;
    let device = terminal.name().ok_or("no name")?;
    drop(terminal);
    let is_over = AtomicBool::new(false);
    thread::scope(|scope| {
        let board = scope.spawn(|| serve(wire, &is_over));
        let done = use_plotter(&device);
        is_over.store(true, Ordering::Relaxed);
        board.join().map_err(|_| "the board's thread broke")??;
        done
    })
}

fn use_plotter(device: &str) -> Result<(), Box<dyn Error>> {
    let try_run = |arguments: &[&str]| {
        let line = [&["penup"], arguments, &["--port", device]].concat();
        Ok::<_, Box<dyn Error>>(run(&Cli::try_parse_from(line)?, &AtomicBool::new(false)))
    };
    let run = |arguments: &[&str]| -> Result<Value, Box<dyn Error>> {
        Ok(try_run(arguments)?.map_err(|error| format!("{arguments:?}: {error}"))?.json)
    };
    assert_eq!(run(&["status"])?["state"], "Idle");
    assert_eq!(run(&["jog", "12.5", "3"])?["position_mm"], json!([12.5, 3.0, 0.0]));
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("machine.toml").display().to_string();
    run(&["settings", "save", &file])?;
    assert_eq!(run(&["set", "110=1500", "3=1"])?["settings"], json!({ "3": 1.0, "110": 1500.0 }));
    let restored = run(&["settings", "restore", &file])?;
    assert_eq!(restored["settings"]["110"], 6000.0);
    run(&["pen", "down"])?;
    for (arguments, code) in [(&["home"][..], 4), (&["jog", "-100", "0"], 4), (&["resume"], 4)] {
        let error = try_run(arguments)?.err().ok_or("it was not refused")?;
        assert_eq!(error.exit_code(), code, "{error}");
    }
    // The board keeps no job, but what was sent is drawn and then reported.
    let scene = penup_client::workspace::root().join("scenes/cube.obj").display().to_string();
    run(&["plot", &scene, "--page", "60x60"])?;
    let status = run(&["status"])?;
    assert_eq!(status["strokes"]["done"], status["strokes"]["all"]);
    assert!(status["ink_mm"]["all"].as_u64().is_some_and(|ink| ink > 100), "{status}");
    Ok(())
}
