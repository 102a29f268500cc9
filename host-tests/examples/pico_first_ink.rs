//! How long the emulated Raspberry Pi Pico takes from `$plot` to the first ink at its pins, by the
//! very image that is flashed, and for how long at most nothing moves in the 30 s after that,
//! while the order of the strokes is found and improved: `pico_first_ink [SCENE]...`. The image is
//! built by `cargo xtask build --board pico`; `PENUP_IMAGE` names another one.
//!
//! A short jog comes before the job, which begins when that has ended. So both times are those of
//! pins.

use penup_client::emulator::{
    EmulatedBoard, Machine, MachineEventKind, Pico, PicoByUsb, image_path,
};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

const SCENES: [(&str, &str); 4] = [
    ("text300", "$view=auto"),
    ("lattice5", "$eye=-15.37,-20.71,25.13"),
    ("lattice6", "$eye=-18.37,-24.71,30.13"),
    ("lattice7", "$eye=-21.37,-28.71,35.13"),
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("| scene | first ink, s | longest rest, s |");
    println!("|---|---|---|");
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    for (scene, eye) in SCENES {
        if wanted.is_empty() || wanted.iter().any(|name| name == scene) {
            let [ink, rest] = measure(scene, eye)?.map(|time| time.as_secs_f64());
            println!("| {scene} | {ink:.2} | {rest:.2} |");
        }
    }
    Ok(())
}

/// The number of steps of the jog: a tenth of a millimetre. What moves behind it is the job.
const JOG_STEPS: u32 = 8;

/// The time for which the drawing is watched.
const WATCHED: Duration = Duration::from_secs(30);

/// The time from `$plot` to the first ink, and the longest time after that between two changes of
/// the pins.
fn measure(scene: &str, eye: &str) -> Result<[Duration; 2], Box<dyn Error>> {
    let image = std::env::var_os("PENUP_IMAGE").map_or_else(|| image_path("pico"), Into::into);
    let mut uart = Line::to(Box::new(Pico::start(&image)?))?;
    uart.emulator.plug_usb_in()?;
    let mut line = Line::silent(Box::new(PicoByUsb(*uart.emulator)));
    line.hear_greeting()?;
    let lines = job_lines(&format!("{scene}.obj"), &[eye]);
    let (_, model) = lines.split_last().ok_or("an empty scene")?;
    let text: String = model.iter().map(|text| format!("{text}\n")).collect();
    line.emulator.send(text.as_bytes())?;
    for text in model {
        let answer = line.hear()?;
        if answer != "ok" {
            return Err(format!("{text}: {answer}").into());
        }
    }
    line.emulator.send(b"$J=G91 X0.1 F600\n$plot\n")?;
    let (mut machine, mut begun, mut first_ink) =
        (Machine::default(), None::<Duration>, None::<Duration>);
    let (mut last, mut longest_rest) = (None::<Duration>, Duration::ZERO);
    let (mut told, mut steps) = (false, 0);
    while first_ink.zip(last).is_none_or(|(ink, last)| last < ink + WATCHED) {
        line.status()?;
        if let Some((ink, begun)) = first_ink.zip(begun).filter(|_| !told) {
            told = true;
            let took = ink.saturating_sub(begun);
            eprintln!("{scene}: first ink after {took:.1?}; watching it for 30 s (some minutes)");
        }
        for change in line.emulator.pin_changes()? {
            let at = change.at;
            if first_ink.is_some() {
                let rest = last.map_or(Duration::ZERO, |last| at.saturating_sub(last));
                longest_rest = longest_rest.max(rest);
                last = Some(at);
            }
            match machine.change(change).map(|event| event.kind) {
                Some(MachineEventKind::Step { .. }) if steps < JOG_STEPS => {
                    steps += 1;
                    begun = Some(at);
                }
                Some(MachineEventKind::Pen { down: true }) => first_ink = first_ink.or(Some(at)),
                _ => {}
            }
        }
    }
    let took = first_ink.zip(begun).map(|(ink, begun)| ink.saturating_sub(begun));
    Ok([took.ok_or("no ink")?, longest_rest])
}
