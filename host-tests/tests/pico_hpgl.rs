//! Draws HP-GL on the Raspberry Pi Pico, judged by its pins: by USB, where the host waits while the
//! board takes nothing, and by the UART with a sender that asks for room.
#![cfg(feature = "emulator")]

#[allow(dead_code, reason = "the board in memory uses the rest")]
#[path = "hpgl/ink.rs"]
mod ink;

use penup_client::emulator::{
    EmulatedBoard, Machine, MachineEventKind, Pico, PicoByUsb, image_path,
};
use penup_host_tests::emulated_jobs::Line;
use std::error::Error;
use std::fmt::Write as _;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// Starts a board that a host has plugged in, and opens the port.
fn plugged_in() -> Result<Line<PicoByUsb>, Box<dyn Error>> {
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    Ok(line)
}

/// A spiral in one `PD` without a line end, as vpype writes it.
fn spiral() -> Vec<u8> {
    let mut text = String::from("IN;DF;PS4;SP1;PU1000,1000;PD");
    for index in 0..400 {
        let (angle, radius) = (f64::from(index) * 0.2, f64::from(index) * 0.4);
        let (x, y) = (1000.0 + radius * angle.cos(), 1000.0 + radius * angle.sin());
        let _ = write!(text, "{}{x:.2},{y:.2}", if index > 0 { "," } else { "" });
    }
    text += ";PU1100,1100;CI40;SP0;";
    text.into_bytes()
}

/// The positions at which ink comes onto the page until the board is idle.
fn inked<E: EmulatedBoard + ?Sized>(line: &mut Line<E>) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    let (mut machine, mut at, mut is_down) = (Machine::default(), [0i32; 2], false);
    let mut points = Vec::new();
    loop {
        let is_idle = line.status()?.starts_with("<Idle");
        for change in line.emulator.pin_changes()? {
            match machine.change(change).map(|event| event.kind) {
                Some(MachineEventKind::Step { x, y }) => {
                    at = [at[0] + i32::from(x), at[1] + i32::from(y)];
                }
                Some(MachineEventKind::Pen { down }) => is_down = down,
                _ => continue,
            }
            if is_down {
                points.push(at);
            }
        }
        if is_idle {
            points.sort_unstable();
            points.dedup();
            return Ok(points.iter().map(|point| point.map(f64::from)).collect());
        }
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Returns what the board answers up to CR.
fn answer<E: EmulatedBoard + ?Sized>(emulator: &mut E) -> Result<String, Box<dyn Error>> {
    let mut heard = Vec::new();
    while !heard.ends_with(b"\r") {
        let mut buffer = [0; 1];
        if emulator.receive(&mut buffer, Duration::from_secs(60))? == 0 {
            return Err("the board is silent".into());
        }
        heard.extend_from_slice(&buffer);
    }
    Ok(String::from_utf8(heard)?.trim().to_owned())
}

#[test]
fn by_usb_the_host_waits_and_nothing_is_lost() -> TestResult {
    let mut line = plugged_in()?;
    let file = spiral();
    line.emulator.send(&file)?;
    line.emulator.send(b"OE;")?;
    assert_eq!(answer(&mut *line.emulator)?, "0");
    // The chords of the client's plan of a circle are up to 0.4 steps off.
    ink::assert_same_ink(
        "spiral",
        &inked(&mut line)?,
        &ink::plan(&file).expect("a valid file"),
        0.4,
    );
    Ok(())
}

/// The error of the transmission that the next program finds after this file was sent and the port
/// was closed.
fn error_behind(file: &str) -> Result<String, Box<dyn Error>> {
    let mut line = plugged_in()?;
    line.emulator.send(format!("IN;OA;{file}").as_bytes())?;
    assert_eq!(answer(&mut *line.emulator)?, "0,0,0");
    let wait = || std::thread::sleep(Duration::from_millis(200));
    wait();
    line.emulator.0.open_usb(false, 115_200)?;
    wait();
    line.emulator.0.open_usb(true, 115_200)?;
    wait();
    line.emulator.send(b"\x1B.E")?;
    // A greeting comes first.
    loop {
        let answer = answer(&mut *line.emulator)?;
        if answer.parse::<u8>().is_ok() {
            return Ok(answer);
        }
    }
}

#[test]
fn a_port_that_is_closed_behind_an_instruction_has_lost_nothing() -> TestResult {
    assert_eq!(error_behind("PU1000,1000;PD1500,1000;")?, "0");
    assert_eq!(error_behind("PU1000,1000;PD15")?, "15");
    Ok(())
}

/// HP-GL has no ends of lines, and the host sends all of it without a pause.
#[test]
fn the_other_port_is_answered_while_hpgl_comes() -> TestResult {
    let mut line = plugged_in()?;
    line.emulator.send(&spiral())?;
    let mut uart = Line::silent(Box::new(line.emulator.0));
    uart.emulator.send(b"$model\n")?;
    while !uart.hear()?.starts_with("error:8") {}
    // All of the file has come much later.
    assert!(uart.status()?.starts_with("<Run"));
    Ok(())
}

#[test]
fn by_the_uart_a_sender_asks_for_room() -> TestResult {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    let file = spiral();
    for block in file.chunks(200) {
        loop {
            line.emulator.send(b"\x1B.B")?;
            if answer(&mut *line.emulator)?.parse::<usize>()? >= block.len() {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        line.emulator.send(block)?;
    }
    line.emulator.send(b"OE;\x1B.E")?;
    let answers = [answer(&mut *line.emulator)?, answer(&mut *line.emulator)?];
    assert_eq!(answers, ["0", "0"]);
    ink::assert_same_ink(
        "spiral",
        &inked(&mut line)?,
        &ink::plan(&file).expect("a valid file"),
        0.4,
    );
    Ok(())
}

/// The sender of each burst has been told that there is room for all of it. Bytes come faster than
/// chords, letters and dashes are drawn.
#[test]
fn by_the_uart_bursts_that_there_is_room_for_lose_nothing() -> TestResult {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    let circles = "CI100;CI101;".repeat(80);
    let label = format!("SI0.1,0.15;LB{}\x03", "Wq8&".repeat(240));
    let chords: String =
        (0..95).map(|at| format!(",{},{}", 2000 + at * 37 % 300, 2000 + at * 53 % 300)).collect();
    let dashes = format!("LT2,1;PD2000,2000{chords};");
    // A polygon of many points, whose fill takes long to compute, with circles behind it.
    let corners: String =
        (0..76).map(|at| format!(",{},{}", 100 * at, 500 - at % 2 * 400)).collect();
    let fill = format!("LT;PU0,0;PM0;PD0,500{corners};PM2;FP;{}", "CI100;".repeat(40));
    line.emulator.send(b"IN;SP1;PU4000,4000;")?;
    for burst in [circles, label, dashes, fill] {
        line.emulator.send(b"\x1B.L")?;
        assert_eq!(answer(&mut *line.emulator)?, "1024");
        assert!(burst.len() > 800 && burst.len() <= 1024, "{}", burst.len());
        line.emulator.send(burst.as_bytes())?;
        line.emulator.send(b"\x1B.E")?;
        assert_eq!(answer(&mut *line.emulator)?, "0", "{burst}");
        line.emulator.send(b"\x1B.K")?;
    }
    Ok(())
}
