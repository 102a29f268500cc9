//! Draws a solid that is larger than the memory of the emulated Raspberry Pi Pico by the very image
//! that is flashed, and compares each step and each move of the pen with those of the host with the
//! Pico's memory: `cargo xtask bunny` and `cargo xtask mesh` build the image and run this.
//!
//! The argument is an OBJ file, or `mesh` for one of 10,000 faces that is made here. A page of 60
//! mm and a quick pen make the drawing short; they do not change what is computed.

use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard, Machine, Pico, PicoByUsb, image_path};
use penup_host_tests::emulated_jobs::{Line, STAGES_IN_TILES, assert_same_as_on_the_host};
use std::error::Error;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The page, the pen and the effort for the order.
const SETTINGS: [&str; 7] =
    ["$212=20", "$213=20", "$110=6000", "$111=6000", "$page=60x60", "$margin=5", "$effort=20"];

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).ok_or("name an OBJ file, or mesh")?;
    let text = if name == "mesh" { mesh() } else { std::fs::read_to_string(&name)? };
    let is_model = |line: &&str| line.starts_with("v ") || line.starts_with("f ");
    let mut lines: Vec<String> = text.lines().filter(is_model).map(str::to_owned).collect();
    let counts = ["v ", "f "].map(|kind| lines.iter().filter(|l| l.starts_with(kind)).count());
    println!("{name}: {} vertices, {} faces", counts[0], counts[1]);
    lines.splice(0..0, SETTINGS.map(str::to_owned));

    let image = image_path("pico");
    let mut uart = Line::to(Box::new(Pico::start(&image)?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    let began = Instant::now();
    // USB holds back data for which there is no room.
    for some in lines.chunks(64) {
        let all: String = some.iter().map(|text| format!("{text}\n")).collect();
        line.emulator.send(all.as_bytes())?;
        for text in some {
            let mut answer = line.hear()?;
            while answer.starts_with("[MSG:") {
                println!("{answer}");
                answer = line.hear()?;
            }
            if answer != "ok" {
                return Err(format!("{text}: {answer}").into());
            }
        }
    }
    println!("sent in {} s of this computer", began.elapsed().as_secs());
    for (number, (name, _)) in (0..).zip(STAGES_IN_TILES) {
        line.emulator.0.time_function(&image, name, number)?;
    }
    line.emulator.pin_changes()?;
    line.emulator.send(b"$plot\n")?;
    loop {
        let heard = line.status()?;
        if heard.starts_with("[MSG:") {
            println!("{heard}");
            refuse_restart(&heard)?;
        } else if heard == "ok" {
            break;
        } else if heard.starts_with("error") {
            return Err(heard.into());
        }
        sleep(Duration::from_millis(500));
    }
    println!("the first part was there after {} s of this computer", began.elapsed().as_secs());
    let (mut cycles, mut calls) = ([0; STAGES_IN_TILES.len()], [0; STAGES_IN_TILES.len()]);
    let (mut machine, mut events) = (Machine::default(), Vec::new());
    let (mut late, mut deepest) = (String::new(), 0);
    loop {
        let status = line.status()?;
        if status.starts_with("[MSG:") {
            println!("{status}");
            refuse_restart(&status)?;
            continue;
        }
        if let Some((_, rest)) = status.split_once("|Late:") {
            late = rest.split('|').next().unwrap_or_default().to_owned();
        }
        for change in line.emulator.pin_changes()? {
            if let Some(event) = machine.change(change) {
                events.push(event.kind);
            }
        }
        for (number, count) in line.emulator.0.take_timed() {
            if let (Some(sum), Some(calls)) =
                (cycles.get_mut(usize::from(number)), calls.get_mut(usize::from(number)))
            {
                *sum += count;
                *calls += 1;
            }
        }
        if status.starts_with("<Idle") {
            break;
        }
        let now = line.emulator.0.stack()?.deepest;
        if now > deepest {
            deepest = now;
            println!("after {} parts the stack has been used to {deepest} bytes", calls[1]);
        }
        sleep(Duration::from_secs(1));
    }
    events.extend(machine.last().map(|event| event.kind));
    for ((_, what), (cycles, calls)) in STAGES_IN_TILES.iter().zip(cycles.iter().zip(calls)) {
        let seconds = *cycles as f64 / 125e6;
        println!("{what}: {calls} calls, {cycles} cycles, {seconds:.1} s at 125 MHz");
    }
    let seen = (cycles[0] + cycles[1]) as f64 / 1e9;
    println!("view and hidden lines together: {seen:.2} G cycles; underruns: {late:?}");
    println!("{} steps and moves of the pen in {} s", events.len(), began.elapsed().as_secs());
    lines.push("$plot".to_owned());
    assert_same_as_on_the_host(&PICO, &lines, &events);
    println!("each step and each move of the pen is that of the host");
    Ok(())
}

/// Fails if the board says that it was started again: it then draws nothing more, and would be
/// waited for without end.
fn refuse_restart(message: &str) -> Result<(), Box<dyn Error>> {
    if message.starts_with("[MSG:started again") {
        return Err("the board was started again while it drew".into());
    }
    Ok(())
}

/// A bumpy ring of 10,000 triangles, with generic coordinates.
fn mesh() -> String {
    let (around, across) = (100, 50);
    let mut text = String::new();
    for at in 0..around * across {
        let turn = f64::from(at / across) / f64::from(around) * std::f64::consts::TAU;
        let side = f64::from(at % across) / f64::from(across) * std::f64::consts::TAU;
        let radius = 1.0 + 0.15 * (7.0 * turn + 3.0 * side).sin();
        let out = 3.0 + radius * side.cos();
        let [x, y, z] = [out * turn.cos(), out * turn.sin(), radius * side.sin()];
        text += &format!("v {x:.4} {y:.4} {z:.4}\n");
    }
    for at in 0..around * across {
        let (ring, spoke) = (at / across, at % across);
        let number = |ring: i32, spoke: i32| (ring % around) * across + spoke % across + 1;
        let corners = [
            number(ring, spoke),
            number(ring + 1, spoke),
            number(ring + 1, spoke + 1),
            number(ring, spoke + 1),
        ];
        let [a, b, c, d] = corners;
        text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
    }
    text
}
