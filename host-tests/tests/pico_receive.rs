//! Tests reception by the Raspberry Pi Pico's UART: nothing is lost while flash is written, and no
//! line that lost a byte is executed.
#![cfg(feature = "emulator")]

use penup_client::emulator::{EmulatedBoard, Pico, PicoByUsb, UartError, image_path};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::whole_jobs::job_lines;
use std::collections::VecDeque;
use std::error::Error;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// The number of unanswered bytes that a sender may have sent.
const WINDOW: usize = 240;
/// The maximum time to erase a sector of flash.
const SLOWEST_ERASE: Duration = Duration::from_millis(400);
/// The maximum time to write a page of flash.
const SLOWEST_PAGE: Duration = Duration::from_millis(3);
/// How long a status may take beside an erasure.
const ANSWER: Duration = Duration::from_millis(20);

fn start() -> Result<Line<Pico>, Box<dyn Error>> {
    Line::to(Box::new(Pico::start(&image_path("pico"))?))
}

/// Starts a board whose flash takes as long as it may for each change.
fn start_with_slowest_flash() -> Result<Line<Pico>, Box<dyn Error>> {
    let mut line = start()?;
    line.emulator.set_erase_time(SLOWEST_ERASE)?;
    line.emulator.set_page_time(SLOWEST_PAGE)?;
    Ok(line)
}

/// The output before the reply to a line, and the reply.
fn hear_all<E: EmulatedBoard>(line: &mut Line<E>) -> Result<Vec<String>, Box<dyn Error>> {
    let mut heard = Vec::new();
    loop {
        heard.push(line.hear()?);
        if heard.last().is_some_and(|last| last == "ok" || last.starts_with("error")) {
            return Ok(heard);
        }
    }
}

fn ask_all<E: EmulatedBoard>(
    line: &mut Line<E>,
    text: &str,
) -> Result<Vec<String>, Box<dyn Error>> {
    line.emulator.send(format!("{text}\n").as_bytes())?;
    hear_all(line)
}

/// Sends the lines with a full window and queries the status in between. Each line must be answered
/// with `ok`.
fn stream(line: &mut Line<Pico>, lines: &[String]) -> TestResult {
    let (mut unanswered, mut bytes) = (VecDeque::new(), 0);
    let hear = |line: &mut Line<Pico>, unanswered: &mut VecDeque<String>| loop {
        let heard = line.hear()?;
        if heard == "ok" {
            return unanswered
                .pop_front()
                .ok_or_else(|| Box::<dyn Error>::from("too many replies"));
        }
        assert!(heard.starts_with(['<', '[']), "{heard} after {unanswered:?}");
    };
    for (number, text) in lines.iter().enumerate() {
        let text = format!("{text}\n");
        while bytes + text.len() > WINDOW {
            bytes -= hear(line, &mut unanswered)?.len();
        }
        line.emulator.send(text.as_bytes())?;
        if number % 8 == 0 {
            line.emulator.send(b"?")?;
        }
        bytes += text.len();
        unanswered.push_back(text);
    }
    while !unanswered.is_empty() {
        hear(line, &mut unanswered)?;
    }
    Ok(())
}

/// Settings and a job are saved while a full window is in transit, by the slowest flash.
#[test]
fn a_full_window_across_every_flash_write_loses_no_byte() -> TestResult {
    let mut line = start_with_slowest_flash()?;
    let mut lines: Vec<String> = (0..3).map(|number| format!("$130={}", 300 + number)).collect();
    lines.extend(job_lines("cube.obj", &["$page=60x60", "$margin=5", "$100=160", "$101=160"]));
    // These lines follow the job's own line, which computes the job and saves it in flash.
    lines.extend((0..60).map(|number| format!("v {number}.125 {number} 0.5")));
    stream(&mut line, &lines)?;
    // The list of the settings is refused while steps run.
    while !line.status()?.starts_with("<Idle") {}
    let settings = ask_all(&mut line, "$$")?;
    for kept in ["$130=302.000", "$100=160.000", "$101=160.000"] {
        assert!(settings.iter().any(|line| line.starts_with(kept)), "{kept}: {settings:?}");
    }
    let vertices = lines.iter().filter(|line| line.starts_with('v')).count();
    let model = ask_all(&mut line, "$model")?;
    assert_eq!(model[0], format!("[MODEL:vertices {vertices} of 4096]"));
    Ok(())
}

/// The log and each sector of a job are erased one after the other. In between the status is
/// answered, so nobody waits for more than one of them.
#[test]
fn the_status_waits_for_one_sector_at_most() -> TestResult {
    let mut line = start_with_slowest_flash()?;
    let lines = job_lines("lattice3.obj", &["$page=60x60", "$margin=5"]);
    let (plot, model) = lines.split_last().ok_or("a job")?;
    stream(&mut line, model)?;
    line.emulator.ask_in_flash_changes(true)?;
    line.emulator.take_status_waits();
    line.emulator.send(format!("{plot}\n").as_bytes())?;
    loop {
        let heard = line.status()?;
        if heard.starts_with("<Run") && !heard.contains("|Stage:") {
            break;
        }
    }
    let [_, answered] = line.emulator.take_status_waits();
    let longest = answered.into_iter().max().unwrap_or_default();
    eprintln!("the longest wait: {longest:?}");
    assert!(longest > SLOWEST_ERASE / 2, "{longest:?}");
    assert!(longest < SLOWEST_ERASE + ANSWER, "{longest:?}");
    Ok(())
}

/// A page is written behind each stroke. The answer begins in time; the one to the question before
/// may still be leaving.
#[test]
fn the_status_comes_in_time_while_pages_are_written() -> TestResult {
    let mut line = start_with_slowest_flash()?;
    stream(&mut line, &job_lines("lattice2.obj", &["$page=45x45", "$margin=3", "$212=1"]))?;
    while line.status()?.contains("|Stage:") {}
    line.emulator.ask_in_flash_changes(true)?;
    line.emulator.take_status_waits();
    while !line.status()?.starts_with("<Idle") {}
    let waits = line.emulator.take_status_waits();
    let [first_byte, whole] = waits.map(|waits| waits.into_iter().max().unwrap_or_default());
    eprintln!("the longest wait: {first_byte:?}, for the whole answer {whole:?}");
    assert!(first_byte > SLOWEST_PAGE, "{first_byte:?}");
    assert!(first_byte < ANSWER, "{first_byte:?}");
    Ok(())
}

/// The defaults of two records are kept, each in a sector of its own.
#[test]
fn so_it_does_while_defaults_are_restored() -> TestResult {
    let mut line = start()?;
    for text in ["$130=300", "G10 L2 P1 X5"] {
        assert_eq!(ask_all(&mut line, text)?, ["ok"], "{text}");
    }
    line.emulator.set_erase_time(SLOWEST_ERASE)?;
    line.emulator.set_page_time(SLOWEST_PAGE)?;
    line.emulator.ask_in_flash_changes(true)?;
    line.emulator.take_status_waits();
    let begun = line.emulator.clock()?;
    line.emulator.send(b"$RST=*\n")?;
    while line.status()? != "ok" {}
    assert!(line.emulator.clock()? - begun > 2 * SLOWEST_ERASE, "two sectors are erased");
    line.hear_greeting()?;
    let [_, answered] = line.emulator.take_status_waits();
    let longest = answered.into_iter().max().unwrap_or_default();
    eprintln!("the longest wait: {longest:?}");
    assert!(longest > SLOWEST_ERASE / 2, "{longest:?}");
    assert!(longest < SLOWEST_ERASE + ANSWER, "{longest:?}");
    line.emulator.ask_in_flash_changes(false)?;
    // Ctrl-X between both leaves nothing that is in force, but not kept.
    line.emulator.send(b"$130=300\nG10 L2 P1 X5\n$RST=*\n")?;
    while !line.hear()?.starts_with("[MSG:Restoring defaults") {}
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    line.emulator.cut_power()?;
    line.hear_greeting()?;
    let settings = ask_all(&mut line, "$$")?;
    assert!(settings.iter().any(|line| line == "$130=420.000"), "{settings:?}");
    let systems = ask_all(&mut line, "$#")?;
    assert!(systems.iter().any(|line| line.starts_with("[G54:0.000,")), "{systems:?}");
    Ok(())
}

/// A sender that ignores the window overruns the ring of the DMA and the queue.
#[test]
fn bytes_beyond_every_window_are_refused_not_mistaken() -> TestResult {
    const LINES: usize = 1200;
    let mut line = start_with_slowest_flash()?;
    let mut flood = String::from("$130=300\n");
    (0..LINES).for_each(|number| flood.push_str(&format!("v {number:04}\n")));
    // Each wrong line is refused with its own number, so two lines that were merged are detected,
    // too.
    line.emulator.send(flood.as_bytes())?;
    assert_eq!(line.hear()?, "ok");
    let (mut lost, mut whole) = (0, 0);
    while lost == 0 || whole + lost < 2 {
        match hear_all(&mut line)?.last().map(String::as_str) {
            Some("error:101") => lost += 1,
            Some("error:103") => whole += 1,
            other => return Err(format!("{other:?}").into()),
        }
    }
    // When the line is idle again, everything works normally.
    while line.emulator.receive(&mut [0; 256], Duration::from_millis(500))? > 0 {}
    line.forget();
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    assert_eq!(ask_all(&mut line, "v 1 2 3")?, ["ok"]);
    Ok(())
}

#[test]
fn every_error_of_the_uart_voids_its_line_which_gets_one_reply() -> TestResult {
    let mut line = start()?;
    let errors = [UartError::Framing, UartError::Parity, UartError::Break, UartError::Overrun];
    assert_eq!(ask_all(&mut line, "v 1 1 1")?, ["ok"]);
    for error in errors {
        line.emulator.send(b"v 1 2 ")?;
        line.emulator.send_damaged(b'3', error)?;
        line.emulator.send(b"4\nv 1 2 4\n")?;
        assert_eq!(hear_all(&mut line)?.last().map(String::as_str), Some("error:101"), "{error:?}");
        assert_eq!(hear_all(&mut line)?, ["ok"], "{error:?}");
    }
    // Between lines it is not answered by itself.
    line.emulator.send_damaged(0, UartError::Break)?;
    line.emulator.send(b"?")?;
    assert!(line.hear()?.starts_with("<Idle"));
    assert_eq!(ask_all(&mut line, "v 1 2 5")?.last().map(String::as_str), Some("error:101"));
    // ctrl-X forgets it.
    line.emulator.send_damaged(0, UartError::Break)?;
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    assert_eq!(ask_all(&mut line, "v 1 2 5")?, ["ok"]);
    assert_eq!(ask_all(&mut line, "$model")?[0], "[MODEL:vertices 6 of 4096]");
    Ok(())
}

/// With nothing connected to the UART, USB receives what it asked for and nothing else, and nothing
/// is sent on the UART after the greeting. A stray byte on the floating input changes nothing.
#[test]
fn an_open_uart_input_is_no_sender() -> TestResult {
    let mut uart = start()?;
    uart.emulator.plug_usb_in()?;
    let mut usb = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    usb.hear_greeting()?;
    assert_eq!(ask_all(&mut usb, "v 1 2 3")?, ["ok"]);
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    let mut said = [0; 256];
    assert_eq!(uart.emulator.receive(&mut said, Duration::from_millis(200))?, 0, "{said:?}");
    uart.emulator.send_damaged(0xF0, UartError::Framing)?;
    uart.emulator.send(b"?")?;
    assert!(uart.hear()?.starts_with("<Idle"));
    assert_eq!(ask_all(&mut uart, "v 1 2 4")?, ["ok"]);
    Ok(())
}

/// Each port has its own state: neither a multi-byte letter nor a line that began on one port is
/// continued on the other.
#[test]
fn a_stray_byte_on_one_port_leaves_the_other_port_alone() -> TestResult {
    let mut uart = start()?;
    uart.emulator.plug_usb_in()?;
    let mut usb = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    usb.emulator.send(b"\x18")?;
    usb.hear_greeting()?;
    // Half a line, and the first byte of a letter of four.
    usb.emulator.send(b"(\xF0")?;
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    assert_eq!(uart.ask("v 1 2 3")?, "ok");
    assert_eq!(uart.ask("$J=G91X10F100")?, "ok");
    uart.emulator.send(b"\x85")?;
    while !uart.status()?.starts_with("<Idle|MPos:") {}
    let status = uart.status()?;
    let x: f64 = status.split([':', ',']).nth(1).and_then(|x| x.parse().ok()).ok_or("no x")?;
    assert!(x < 9.0, "{status}");
    let mut usb = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    while usb.emulator.receive(&mut [0; 256], Duration::from_millis(200))? > 0 {}
    usb.emulator.send(b"\x9F\x98\x80)\n")?;
    assert_eq!(usb.hear()?, "ok");
    Ok(())
}

/// Two DMA channels take turns, each for 16,384 bytes. Nothing is lost at the change from one to
/// the other.
#[test]
fn more_bytes_than_a_turn_of_a_dma_channel_come_one_by_one() -> TestResult {
    const TURNS: usize = 2 * 16_384 + 4_096;
    let mut line = start()?;
    let text = format!("({})", "x".repeat(230));
    let count = TURNS / (text.len() + 1);
    stream(&mut line, &vec![text; count])?;
    assert_eq!(ask_all(&mut line, "v 1 2 3")?, ["ok"]);
    Ok(())
}
