//! The cycles that the emulated Raspberry Pi Pico takes for each stage of a job, by the very image
//! that is flashed: `cargo xtask bench --board pico` builds it and runs this; the names of scenes,
//! as arguments of this, leave out the others.
//!
//! Jobs are sent by USB and given up when they are computed. A function of each stage is timed from
//! its call to its return, interrupts counted in. Lines are drawn longer than they are, so that the
//! pen does not begin before the order is known.

use penup_client::emulator::{EmulatedBoard, Pico, PicoByUsb, image_path};
use penup_host_tests::emulated_jobs::{Line, STAGES};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

const SCENES: [(&str, &str); 9] = [
    ("eighteen", "$view=auto"),
    ("text300", "$view=auto"),
    ("lattice1", "$eye=-3.37,-4.71,5.13"),
    ("lattice2", "$eye=-6.37,-8.71,10.13"),
    ("lattice3", "$eye=-9.37,-12.71,15.13"),
    ("lattice4", "$eye=-12.37,-16.71,20.13"),
    ("lattice5", "$eye=-15.37,-20.71,25.13"),
    ("lattice6", "$eye=-18.37,-24.71,30.13"),
    ("lattice7", "$eye=-21.37,-28.71,35.13"),
];

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "| scene | view | hidden lines | together at 125 MHz, s | odd points | paired | improved \
         | order | at 125 MHz, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    for (scene, eye) in SCENES {
        if !wanted.is_empty() && !wanted.iter().any(|name| name == scene) {
            continue;
        }
        let (odd, [view, hidden, paired, improved, order]) = measure(scene, eye)?;
        let seconds = [view + hidden, order].map(|cycles| cycles as f64 / 125e6);
        let [seen, ordered] = seconds;
        println!(
            "| {scene} | {view} | {hidden} | {seen:.3} | {odd} | {paired} | {improved} | {order} \
             | {ordered:.2} |"
        );
    }
    Ok(())
}

/// The odd points of a scene, and the cycles of each function.
fn measure(scene: &str, eye: &str) -> Result<(String, [u64; 5]), Box<dyn Error>> {
    let image = image_path("pico");
    let mut uart = Line::to(Box::new(Pico::start(&image)?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    let lines = job_lines(&format!("{scene}.obj"), &[eye, "$222=1"]);
    let (plot, model) = lines.split_last().ok_or("an empty scene")?;
    for text in model {
        let answer = line.ask(text)?;
        if answer != "ok" {
            return Err(format!("{text}: {answer}").into());
        }
    }
    for (number, name) in (0..).zip(STAGES) {
        line.emulator.0.time_function(&image, name, number)?;
    }
    line.emulator.send(format!("{plot}\n").as_bytes())?;
    while line.status()? != "ok" {
        sleep(Duration::from_millis(100));
    }
    let mut cycles = [0; 5];
    for (number, count) in line.emulator.0.take_timed() {
        if let Some(sum) = cycles.get_mut(usize::from(number)) {
            *sum += count;
        }
    }
    line.emulator.send(b"$model\n")?;
    let odd = loop {
        let heard = line.hear()?;
        if let Some(rest) = heard.strip_prefix("[JOB:odd points ") {
            break rest.split(',').next().unwrap_or_default().to_owned();
        }
    };
    Ok((odd, cycles))
}
