//! Serves an emulated board at a pseudo-terminal, so that any program that uses a serial port can
//! use it, and judges what the pins ink. `cargo xtask senders` runs it.
//!
//! The argument is `lm3s6965`, `pico` (its UART) or `pico-usb`. The first line of the output is the
//! name of the terminal, which comes when the board has greeted: a program that opens the terminal
//! meets a board that runs, however slowly it has started. The greeting can be read there. Then
//! each line of the input is answered by one line: `forget` forgets the ink so far; `judge
//! TOLERANCE FILE` compares the ink since then with the lines of FILE, each of which is a polyline
//! of points `x,y` in steps, and answers `same` or what differs; `heard` prints what the board has
//! been sent since the last call, escaped. It ends with its input.

use std::error::Error;
use std::io::{BufRead as _, Read as _, Write as _};
use std::sync::mpsc::{self, TryRecvError};
use std::time::{Duration, Instant};

use penup_client::emulator::{EmulatedBoard, Emulator, Options, Pico, PicoByUsb, image_path};
use penup_host_tests::ink::{Ink, Segment, difference};
use serialport::{SerialPort as _, TTYPort};

fn boot(board: &str) -> Result<Box<dyn EmulatedBoard>, Box<dyn Error>> {
    Ok(match board {
        "lm3s6965" => Box::new(Emulator::start(&image_path(board), Options::default())?),
        "pico" => Box::new(Pico::start(&image_path("pico"))?),
        "pico-usb" => {
            let mut pico = Pico::start(&image_path("pico"))?;
            pico.plug_usb_in()?;
            Box::new(PicoByUsb(pico))
        }
        other => return Err(format!("no board {other}").into()),
    })
}

/// How long a board may take to greet.
const BOOT_LIMIT: Duration = Duration::from_secs(60);

/// Waits until the board has greeted, and returns the greeting.
fn greeting(board: &mut dyn EmulatedBoard) -> Result<Vec<u8>, Box<dyn Error>> {
    let deadline = Instant::now() + BOOT_LIMIT;
    let (mut heard, mut buffer) = (Vec::new(), [0; 256]);
    while !(heard.starts_with(b"\r\nGrbl ") && heard.ends_with(b"]\r\n")) {
        if Instant::now() > deadline {
            return Err(format!("no greeting, but `{}`", heard.escape_ascii()).into());
        }
        let count = board.receive(&mut buffer, Duration::from_millis(10))?;
        heard.extend_from_slice(buffer.get(..count).unwrap_or_default());
    }
    Ok(heard)
}

/// Reads the polylines of a file.
fn figure(file: &str) -> Result<Vec<Segment>, Box<dyn Error>> {
    let mut segments = Vec::new();
    for line in std::fs::read_to_string(file)?.lines() {
        let mut points = Vec::new();
        for point in line.split_whitespace() {
            let (x, y) = point.split_once(',').ok_or("a point is x,y")?;
            points.push([x.parse()?, y.parse()?]);
        }
        segments.extend(points.windows(2).filter_map(|ends| Some([*ends.first()?, *ends.last()?])));
    }
    Ok(segments)
}

/// How many bytes of the board may wait for the program at the terminal.
const MOST_UNREAD: usize = 1 << 20;

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).ok_or("the board is missing")?;
    let mut board = boot(&name)?;
    let (mut wire, terminal) = TTYPort::pair()?;
    wire.set_timeout(Duration::from_millis(1))?;
    wire.write_all(&greeting(board.as_mut())?)?;
    println!("{}", terminal.name().ok_or("the terminal has no name")?);
    let (sender, orders) = mpsc::channel();
    std::thread::spawn(move || {
        let lines = std::io::stdin().lock().lines();
        lines.map_while(Result::ok).all(|line| sender.send(line).is_ok())
    });
    // The other end stays open here, so that the programs may open and close it.
    let _terminal = terminal;
    let (mut ink, mut sent) = (Ink::default(), Vec::new());
    let (mut buffer, mut unread) = ([0; 256], Vec::new());
    loop {
        if let Ok(count) = wire.read(&mut buffer) {
            let bytes = buffer.get(..count).unwrap_or_default();
            sent.extend_from_slice(bytes);
            board.send(bytes)?;
        }
        let count = board.receive(&mut buffer, Duration::from_millis(1))?;
        // What the program does not read at once waits for it.
        unread.extend_from_slice(buffer.get(..count).unwrap_or_default());
        if !unread.is_empty()
            && let Ok(count) = wire.write(&unread)
        {
            unread.drain(..count);
        }
        if unread.len() > MOST_UNREAD {
            return Err("the program at the terminal does not read what the board sends".into());
        }
        for change in board.pin_changes()? {
            ink.change(change);
        }
        // The emulated Pico speaks only of what would be a fault on the board; QEMU also of itself.
        let said = board.said();
        if name != "lm3s6965" && !said.is_empty() {
            return Err(format!("the emulator says: {said}").into());
        }
        let order = match orders.try_recv() {
            Ok(order) => order,
            Err(TryRecvError::Empty) => continue,
            Err(TryRecvError::Disconnected) => return Ok(()),
        };
        match order.split_once(' ').unwrap_or((&order, "")) {
            ("forget", _) => {
                ink.forget();
                println!("forgotten");
            }
            ("judge", rest) => {
                let (tolerance, file) = rest.split_once(' ').ok_or("judge TOLERANCE FILE")?;
                let points: Vec<_> = ink.points().iter().map(|at| at.map(f64::from)).collect();
                let found = difference(&points, &figure(file)?, tolerance.parse()?);
                println!("{}", found.unwrap_or_else(|| "same".to_owned()));
            }
            ("heard", _) => println!("{}", std::mem::take(&mut sent).escape_ascii()),
            (order, _) => return Err(format!("no order {order}").into()),
        }
    }
}
