//! Tests what the LM3S6965 reports after a panic. No input makes the firmware panic, so the test
//! modifies an image: an interrupt goes directly to the panic handler.
#![cfg(feature = "emulator")]

use std::error::Error;
use std::fs;
use std::time::Duration;

use object::{Object, ObjectSection, ObjectSymbol};
use penup_client::emulator::{EmulatedBoard, Emulator, Options, image_path};

type TestResult<T = ()> = Result<T, Box<dyn Error>>;

/// The number of UART0's interrupt.
const SERIAL: u64 = 5;
/// The number of the interrupt in which the brake works, which comes when steps begin.
const BRAKE: u64 = 20;

/// The line that ends the greeting.
const GREETED: &str = "for help]\r\n";
/// What follows the greeting after a fault.
const AFTER_FAULT: [&str; 3] =
    ["[MSG:started again after a fault: told before]", "[MSG:'$H'|'$X' to unlock]", "ALARM:101"];

/// Starts an image in which this interrupt causes a panic.
fn start(name: &str, interrupt: u64) -> TestResult<Emulator> {
    let mut bytes = fs::read(image_path("lm3s6965"))?;
    let elf = object::File::parse(&*bytes)?;
    let handler = elf
        .symbols()
        .find(|symbol| symbol.name().is_ok_and(|name| name.contains("rust_begin_unwind")))
        .ok_or("the image has no panic handler")?;
    let vectors = elf.section_by_name(".vector_table").ok_or("the image has no vectors")?;
    let (start, _) = vectors.file_range().ok_or("the vectors are not in the file")?;
    // The interrupts follow the 16 exceptions of the core.
    let index = usize::try_from(start + 4 * (16 + interrupt))?;
    // Bit 0 says that it is Thumb code, as all of it is.
    let address = u32::try_from(handler.address())? | 1;
    bytes[index..index + 4].copy_from_slice(&address.to_le_bytes());
    let image = std::env::temp_dir().join(format!("penup-{name}-{}.elf", std::process::id()));
    fs::write(&image, bytes)?;
    let mut emulator = Emulator::start(&image, Options::default())?;
    // It has been read when the board answers.
    let greeting = heard_until(&mut emulator, GREETED)?;
    fs::remove_file(&image)?;
    assert!(!greeting.contains("fault"), "{greeting}");
    Ok(emulator)
}

/// The output of the board until `end` arrives or nothing more does.
fn heard_until(emulator: &mut Emulator, end: &str) -> TestResult<String> {
    let mut heard = Vec::new();
    while !heard.ends_with(end.as_bytes()) {
        let mut buffer = [0; 1];
        if emulator.receive(&mut buffer, Duration::from_secs(10))? == 0 {
            return Err(format!("heard only {:?}", String::from_utf8_lossy(&heard)).into());
        }
        heard.extend_from_slice(&buffer);
    }
    Ok(String::from_utf8_lossy(&heard).into_owned())
}

/// The report of a fault, which says what comes `next`: the addresses of the calls.
fn reported(emulator: &mut Emulator, next: &str) -> TestResult<Vec<u32>> {
    let report = heard_until(emulator, "]\r\n")?;
    let calls = report
        .trim()
        .strip_prefix(&format!("[MSG:stopped by a fault, {next}: panic, called from "))
        .and_then(|calls| calls.strip_suffix(']'))
        .ok_or_else(|| report.clone())?;
    let address = |call: &str| u32::from_str_radix(call.trim_start_matches("0x"), 16);
    Ok(calls.split(' ').map(address).collect::<Result<_, _>>()?)
}

/// Waits for the start after a fault. The greeting follows the report at once.
fn restarted(emulator: &mut Emulator) -> TestResult {
    heard_until(emulator, GREETED)?;
    let alarm = heard_until(emulator, "ALARM:101\r\n")?;
    assert_eq!(alarm.lines().collect::<Vec<_>>(), AFTER_FAULT);
    Ok(())
}

/// Sends a line that is accepted.
fn say(emulator: &mut Emulator, line: &str) -> TestResult {
    emulator.send(format!("{line}\n").as_bytes())?;
    let answer = heard_until(emulator, "\r\n")?;
    assert!(answer == "ok\r\n" || answer.starts_with("[MSG:"), "{line}: {answer}");
    if answer != "ok\r\n" {
        assert_eq!(heard_until(emulator, "\r\n")?, "ok\r\n", "{line}");
    }
    Ok(())
}

#[test]
fn a_panic_tells_from_where_it_was_called_and_the_board_restarts() -> TestResult {
    let mut emulator = start("panic", SERIAL)?;
    emulator.send(b"x")?;
    let calls = reported(&mut emulator, "starts again")?;
    // The core itself called the handler; what it interrupted was called from `main`, in flash.
    let [_, interrupted @ ..] = &calls[..] else { return Err("no calls".into()) };
    let in_flash = interrupted.iter().all(|call| *call < 256 << 10);
    assert!(!interrupted.is_empty() && in_flash, "{calls:x?}");
    restarted(&mut emulator)
}

#[test]
fn after_three_faults_soon_after_the_start_the_board_waits_for_ctrl_x() -> TestResult {
    let mut emulator = start("loop", SERIAL)?;
    // Ctrl-X ends the row: after it, the same happens again.
    for _ in 0..2 {
        for _ in 0..2 {
            emulator.send(b"x")?;
            reported(&mut emulator, "starts again")?;
            restarted(&mut emulator)?;
        }
        emulator.send(b"x")?;
        reported(&mut emulator, "ctrl-X resets")?;
        // It hears nothing else.
        emulator.send(b"?x\n\x18")?;
        // The user has asked for this start, so it is none after a fault.
        let start = heard_until(&mut emulator, GREETED)?;
        assert_eq!(start.lines().filter(|line| !line.is_empty()).count(), 1, "{start}");
    }
    Ok(())
}

#[test]
fn faults_long_after_the_start_do_not_count_as_a_row() -> TestResult {
    let mut emulator = start("row", BRAKE)?;
    for fault in 0..4 {
        if fault > 0 {
            say(&mut emulator, "$X")?;
            // The board counts the time in which it is awake.
            say(&mut emulator, "G4P15")?;
        }
        emulator.send(b"G1X5F1000\n")?;
        while heard_until(&mut emulator, "\r\n")? == "ok\r\n" {}
        reported(&mut emulator, "starts again")?;
        restarted(&mut emulator)?;
    }
    Ok(())
}
