//! Tests USB, the Raspberry Pi Pico's second serial port.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard, Pico, PicoByUsb, image_path};
use penup_host_tests::emulated_jobs::{
    Line, assert_same_as_on_the_host, begin_on, events_until_idle,
};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// Starts a board that answers over USB.
fn plugged_in() -> Result<Line<PicoByUsb>, Box<dyn Error>> {
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    Ok(line)
}

/// Returns all lines up to the reply to the line that was sent.
fn hear_all(line: &mut Line<PicoByUsb>) -> Result<Vec<String>, Box<dyn Error>> {
    let mut heard = Vec::new();
    loop {
        heard.push(line.hear()?);
        if heard.last().is_some_and(|last| last == "ok" || last.starts_with("error")) {
            return Ok(heard);
        }
    }
}

#[test]
fn a_job_that_comes_by_usb_is_the_same() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin_on(plugged_in()?, &lines)?;
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}

#[test]
fn replies_longer_than_a_packet_and_floods_lose_no_byte() -> TestResult {
    let mut line = plugged_in()?;
    line.emulator.send(b"$settings\n")?;
    let settings = hear_all(&mut line)?;
    assert!(settings.len() > 20, "{settings:?}");
    assert!(
        settings[..settings.len() - 1].iter().all(|line| line.starts_with('$')),
        "{settings:?}"
    );
    assert!(settings.iter().map(String::len).sum::<usize>() > 1000);
    // This is far more than any queue holds, and the sender ignores the window.
    let flood: String = (0..400).map(|n| format!("v {n}.125 {n} 0.5\n")).collect();
    line.emulator.send(flood.as_bytes())?;
    for _ in 0..400 {
        assert_eq!(line.hear()?, "ok");
    }
    line.emulator.send(b"$model\n")?;
    assert_eq!(hear_all(&mut line)?[0], "[MODEL:vertices 400 of 4096]");
    Ok(())
}

#[test]
fn real_time_bytes_act_while_a_job_computes_and_runs() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let (plot, before) = lines.split_last().ok_or("no line")?;
    let mut line = begin_on(plugged_in()?, before)?;
    line.emulator.send(format!("{plot}\n").as_bytes())?;
    while !line.status()?.contains("|Stage:") {}
    line.emulator.send(b"?")?;
    while line.hear()? != "ok" {}
    assert!(line.status()?.starts_with("<Run"));
    line.emulator.send(b"!")?;
    while !line.status()?.starts_with("<Hold:0") {}
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    while !line.status()?.starts_with("<Idle") {}
    Ok(())
}

/// The host stops accepting data in the middle of a job, while more output is requested than any
/// queue holds. The job continues, the other port answers, and so does USB when the host is back.
#[test]
fn a_host_that_is_gone_keeps_nobody_waiting() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut usb = begin_on(plugged_in()?, &lines)?;
    usb.emulator.0.let_usb_take(false)?;
    for _ in 0..3 {
        usb.emulator.send(b"$$\n")?;
    }
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    let pins = events_until_idle(&mut uart)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    uart.emulator.send(b"$I\n")?;
    while !uart.hear()?.starts_with("[VER") {}
    uart.emulator.let_usb_take(true)?;
    let mut usb = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    // The data that was in transit arrives first; then the host is told that the rest is lost.
    while usb.hear()? != "[MSG:replies were lost: they were not read]" {}
    usb.emulator.send(b"?")?;
    while !usb.hear()?.starts_with("<Idle") {}
    Ok(())
}

#[test]
fn a_line_is_gone_on_with_whatever_the_other_port_sends() -> TestResult {
    let mut usb = plugged_in()?;
    usb.emulator.send(b"v 1 2 3\nv 4 5")?;
    assert_eq!(usb.hear()?, "ok");
    let mut uart = Line::silent(Box::new(usb.emulator.0));
    assert_eq!(uart.ask("$model")?, "[MODEL:vertices 1 of 4096]");
    while uart.hear()? != "ok" {}
    uart.emulator.send_by_usb(b" 6\n")?;
    assert_eq!(uart.hear()?, "ok");
    assert_eq!(uart.ask("$model")?, "[MODEL:vertices 2 of 4096]");
    Ok(())
}

fn take_host(line: Line<PicoByUsb>) -> Pico {
    line.emulator.0
}

fn by_usb(emulator: Pico) -> Line<PicoByUsb> {
    Line::silent(Box::new(PicoByUsb(emulator)))
}

/// Waits for this time on the board's own clock.
fn pass(line: &mut Line<PicoByUsb>, time: Duration) -> TestResult {
    let end = line.emulator.clock()? + time;
    while line.emulator.clock()? < end {
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

/// Erratum E15: the emulated controller hangs for good if a packet becomes available to the host in
/// the last 200 microseconds of a frame.
#[test]
fn no_packet_becomes_available_late_in_a_frame() -> TestResult {
    let mut line = plugged_in()?;
    for _ in 0..200 {
        assert!(line.status()?.starts_with("<Idle"));
    }
    for _ in 0..5 {
        line.emulator.send(b"$$\n")?;
        assert!(hear_all(&mut line)?.len() > 20);
    }
    Ok(())
}

/// While flash is erased or written, frames begin whose interrupts come late: they do not say how
/// far the present frame has come.
#[test]
fn no_packet_behind_work_on_the_flash_is_late_in_a_frame() -> TestResult {
    let mut line = plugged_in()?;
    for turn in 0..30 {
        for (text, lines) in [("$RST=$", 4), ("$X", 1), ("$120=500", 1), ("?$121=600", 2)] {
            line.emulator.send(format!("{text}\n").as_bytes())?;
            let (mut heard, mut buffer) = (0, [0; 256]);
            while heard < lines {
                let count = line.emulator.receive(&mut buffer, Duration::from_millis(100))?;
                heard += buffer[..count].iter().filter(|byte| **byte == b'\n').count();
                let said = line.emulator.said();
                assert!(said.is_empty(), "in turn {turn}, behind {text}: {said}");
            }
        }
    }
    Ok(())
}

#[test]
fn the_serial_number_is_that_of_the_flash_chip() -> TestResult {
    assert_eq!(plugged_in()?.emulator.0.usb_serial_number(), "E6605838835A2B2F");
    Ok(())
}

/// Erratum E5: other devices at the hub leave the bus no idle time after its reset.
#[test]
fn a_busy_bus_finds_the_board_while_a_job_runs() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut uart = begin_on(Line::to(Box::new(Pico::start(&image_path("pico"))?))?, &lines)?;
    uart.emulator.plug_usb_into_busy_bus()?;
    let mut usb = by_usb(*uart.emulator);
    usb.hear_greeting()?;
    // The job was not affected.
    let status = usb.status()?;
    assert!(status.starts_with("<Run") && !status.contains("|Late"), "{status}");
    let pins = events_until_idle(&mut usb)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}

/// To the controller, this looks like a reset of the bus that does not end.
#[test]
fn a_host_without_power_keeps_nobody_waiting() -> TestResult {
    let lines = job_lines("cube.obj", &["$page=60x60", "$margin=5"]);
    let mut uart = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    uart.emulator.plug_usb_into_dead_host()?;
    // This is longer than the timeout of the watchdog.
    let mut line = begin_on(uart, &lines)?;
    let end = line.emulator.clock()? + Duration::from_secs(4);
    while line.emulator.clock()? < end {
        let status = line.status()?;
        assert!(status.starts_with("<Run") && !status.contains("|Late"), "{status}");
    }
    Ok(())
}

/// More lines than the port's queue and a packet hold are in transit when the computer goes to
/// sleep.
#[test]
fn a_suspended_bus_loses_no_byte() -> TestResult {
    let mut line = plugged_in()?;
    // The move keeps the lines behind it waiting.
    for text in ["G91", "G1 X100 F600"] {
        assert_eq!(line.ask(text)?, "ok", "{text}");
    }
    assert_eq!(line.ask("M0")?, "[MSG:to go on, send ~]");
    assert_eq!(line.hear()?, "ok");
    let flood: String = (0..40).map(|n| format!("v {n}.125 {n} 0.5\n")).collect();
    line.emulator.send(b"G1 X1\nG1 X-1\nM0\n")?;
    line.emulator.send(flood.as_bytes())?;
    pass(&mut line, Duration::from_millis(300))?;
    line.emulator.0.suspend_usb(true)?;
    pass(&mut line, Duration::from_millis(100))?;
    line.emulator.0.suspend_usb(false)?;
    pass(&mut line, Duration::from_millis(100))?;
    line.emulator.send(b"~")?;
    let mut oks = 0;
    while oks < 43 {
        match line.hear()?.as_str() {
            "ok" => oks += 1,
            other => assert!(other.starts_with("[MSG:") || other.is_empty(), "{other}"),
        }
        line.emulator.send(b"~")?;
    }
    line.emulator.send(b"$model\n")?;
    assert_eq!(hear_all(&mut line)?[0], "[MODEL:vertices 40 of 4096]");
    Ok(())
}

/// A program requests much output and closes the port without reading it, in the middle of a line.
/// Another program then opens the port.
#[test]
fn a_port_that_is_opened_again_begins_anew_and_is_greeted_alone() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin_on(plugged_in()?, &lines)?;
    line.emulator.0.let_usb_take(false)?;
    line.emulator.send(b"$$\n$I\nv 1 2")?;
    pass(&mut line, Duration::from_millis(50))?;
    line.emulator.0.open_usb(false, 115_200)?;
    pass(&mut line, Duration::from_millis(50))?;
    line.emulator.0.let_usb_take(true)?;
    line.emulator.0.open_usb(true, 115_200)?;
    assert_eq!(line.hear()?, "");
    let greeting = line.hear()?;
    assert!(greeting.starts_with("Grbl"), "{greeting}");
    assert!(line.ask("$model")?.starts_with("[MODEL:vertices"));
    while line.hear()? != "ok" {}
    // The job continues, and the other port has received nothing of it.
    assert!(line.status()?.starts_with("<Run"));
    let mut uart = Line::silent(Box::new(take_host(line)));
    uart.emulator.send(b"?")?;
    while !uart.hear()?.starts_with('<') {}
    Ok(())
}

/// A program with the rights to the device, or a wrong driver, can send such a request. If nobody
/// took its data, the controller would interrupt the job for ever.
#[test]
fn a_request_with_too_much_data_is_refused_while_a_job_runs() -> TestResult {
    let lines = job_lines("lattice2.obj", &["$page=60x80", "$margin=5"]);
    let mut line = begin_on(plugged_in()?, &lines)?;
    while !line.status()?.starts_with("<Run") {}
    for _ in 0..3 {
        line.emulator.0.send_too_much_by_usb()?;
        pass(&mut line, Duration::from_millis(200))?;
        assert_eq!(line.emulator.said(), "");
        assert!(line.status()?.starts_with("<Run"));
    }
    let pins = events_until_idle(&mut line)?;
    assert_same_as_on_the_host(&PICO, &lines, &pins);
    Ok(())
}

/// Virtual machines and programs with libusb configure the device again; some drivers lift halts
/// when a program opens the port. The host then expects packets to begin anew with DATA0.
#[test]
fn a_host_that_begins_anew_without_a_reset_loses_no_packet() -> TestResult {
    let mut line = plugged_in()?;
    for turn in 0..8 {
        // With one packet each way, and sometimes another, either data toggle is next.
        for _ in 0..1 + turn % 2 {
            assert!(line.status()?.starts_with("<Idle"), "in turn {turn}");
        }
        // Sometimes a packet waits for the host.
        let waits = turn >= 4;
        if waits {
            line.emulator.0.let_usb_take(false)?;
            line.emulator.send(b"$G\n")?;
            pass(&mut line, Duration::from_millis(10))?;
        }
        if turn % 4 < 2 {
            line.emulator.0.configure_usb_again()?;
        } else {
            line.emulator.0.lift_usb_halts()?;
        }
        pass(&mut line, Duration::from_millis(10))?;
        if waits {
            line.emulator.0.let_usb_take(true)?;
            assert!(line.hear()?.starts_with("[GC:"), "in turn {turn}");
            assert_eq!(line.hear()?, "ok", "in turn {turn}");
        }
        assert!(line.status()?.starts_with("<Idle"), "in turn {turn}");
        assert_eq!(line.emulator.said(), "", "in turn {turn}");
    }
    Ok(())
}

#[test]
fn a_stop_acts_behind_all_that_a_sender_may_have_on_its_way() -> TestResult {
    let lines = job_lines("lattice3.obj", &["$page=60x80", "$margin=5"]);
    let (plot, before) = lines.split_last().ok_or("no line")?;
    let mut line = begin_on(plugged_in()?, before)?;
    line.emulator.send(format!("{plot}\n").as_bytes())?;
    while !line.status()?.contains("|Stage:") {}
    // Three times as many as are allowed; none is read while the picture is computed.
    let flood: String = (0..48).map(|_| "v 1.125 2.0 0.5\n").collect();
    line.emulator.send(flood.as_bytes())?;
    line.emulator.send(b"\xFD")?;
    while line.hear()? != "ALARM:10" {}
    Ok(())
}

#[test]
fn a_fault_is_reported_at_an_open_port_too() -> TestResult {
    let mut line = plugged_in()?;
    line.emulator.0.jump_to_function(&image_path("pico"), "main", false)?;
    line.hear_greeting()?;
    let message = line.hear()?;
    assert!(message.contains("a part of the board was set up twice"), "{message}");
    assert_eq!(line.hear()?, "[MSG:'$H'|'$X' to unlock]");
    assert_eq!(line.hear()?, "ALARM:101");
    assert!(line.unlock()?);
    Ok(())
}

fn wait_for_drive(line: &mut Line<PicoByUsb>) -> TestResult {
    for _ in 0..6000 {
        if line.emulator.0.shows_drive() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Err("the board shows no drive".into())
}

#[test]
fn the_command_leads_to_the_drive_and_not_while_the_machine_moves() -> TestResult {
    let mut line = plugged_in()?;
    for text in ["G91", "G1 X20 F600"] {
        assert_eq!(line.ask(text)?, "ok", "{text}");
    }
    assert!(line.ask("$UF2")?.starts_with("[MSG:"));
    assert_eq!(line.hear()?, "error:8");
    while !line.status()?.starts_with("<Idle") {}
    assert_eq!(line.ask("$UF2")?, "ok");
    wait_for_drive(&mut line)?;
    line.emulator.0.copy_image()?;
    line.hear_greeting()?;
    assert!(line.status()?.starts_with("<Idle"));
    Ok(())
}

#[test]
fn so_does_a_touch_at_1200_baud() -> TestResult {
    let mut line = plugged_in()?;
    line.emulator.0.open_usb(true, 1200)?;
    line.emulator.0.open_usb(false, 1200)?;
    wait_for_drive(&mut line)
}
