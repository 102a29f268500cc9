//! Tests jobs of the emulated Raspberry Pi Pico that go on after a loss of power, a reset and a
//! fault, judged by the ink that the pins leave.
#![cfg(feature = "emulator")]

use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard as _, Pico, PinChange, image_path};
use penup_host_tests::cut_jobs::{Point, assert_one_drawing, ink, strokes_of};
use penup_host_tests::emulated_jobs::{Line, bench_like};
use penup_host_tests::random::Random;
use penup_host_tests::whole_jobs::job_lines;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// What the pins have drawn in one run.
type Run = Vec<Vec<Point>>;

/// How the board is stopped in the middle of a job.
#[derive(Debug, Clone, Copy)]
enum PowerCut {
    /// The power is cut at any time.
    Power,
    /// The power is cut while a page of the log is written.
    InFlash,
    /// The pin RUN resets the board.
    Reset,
    /// The program hangs, and the watchdog restarts the board.
    Hang,
}

/// The lines of the job, with such a dwell of the pen in milliseconds.
fn job(dwell: &str) -> Vec<String> {
    let dwells = ["$212", "$213"].map(|setting| format!("{setting}={dwell}"));
    let options = ["$page=45x45", "$margin=3", "$hidden=erased"];
    let settings: Vec<&str> = dwells.iter().map(String::as_str).chain(options).collect();
    job_lines("lattice2.obj", &settings)
}

/// The changes of the pins on the host, which keeps nothing, for these lines.
fn on_the_host(lines: &[String]) -> Vec<PinChange> {
    let mut bench = bench_like(&PICO);
    for line in lines {
        bench.say(&format!("{line}\n"));
    }
    bench.finish();
    bench.board.trace().changes().iter().map(PinChange::from).collect()
}

/// The time from the first step to the last one.
fn duration(changes: &[PinChange]) -> Duration {
    let mut steps = changes.iter().filter(|change| change.is_step()).map(|change| change.at);
    let first = steps.next().unwrap_or_default();
    steps.next_back().unwrap_or_default().saturating_sub(first)
}

/// The number of strokes of the field of a status report with this name, as done and all.
fn strokes(status: &str, name: &str) -> Option<(u32, u32)> {
    let (_, rest) = status.split_once(name)?;
    let (done, all) = rest.split(['|', '>']).next()?.split_once('/')?;
    Some((done.parse().ok()?, all.parse().ok()?))
}

/// Sends a line and returns the last line of the answer.
fn ask(line: &mut Line<Pico>, text: &str) -> Result<String, Box<dyn Error>> {
    let mut answer = line.ask(text)?;
    while answer.starts_with('[') {
        answer = line.hear()?;
    }
    Ok(answer)
}

/// Waits until the board draws stroke number `stroke`, or is idle. Returns whether it is idle.
fn wait_for(line: &mut Line<Pico>, stroke: u32) -> Result<bool, Box<dyn Error>> {
    loop {
        let status = line.status()?;
        if status.starts_with("<Idle") {
            return Ok(true);
        }
        if strokes(&status, "|Drawn:").is_some_and(|(done, _)| done >= stroke) {
            return Ok(false);
        }
    }
}

/// Draws a job on the emulated board, which is stopped in each of these ways, and returns what the
/// pins draw in each run.
fn draw_with_cuts(lines: &[String], cuts: &[PowerCut]) -> Result<Vec<Run>, Box<dyn Error>> {
    let mut random = Random::new(1801);
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for text in lines {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    let all = strokes(&line.status()?, "|Drawn:").ok_or("no job")?.1;
    let mut runs = Vec::new();
    for (number, cut) in (1..).zip(cuts) {
        let stroke = all * number / (cuts.len() as u32 + 1);
        assert!(!wait_for(&mut line, stroke)?, "the job is over before cut {number}");
        match cut {
            PowerCut::Power => {
                line.emulator.cut_power_after(Duration::from_micros(random.below(300_000)))?;
            }
            PowerCut::InFlash => line.emulator.cut_power_in_flash(1 + random.below(254))?,
            PowerCut::Reset => line.emulator.pull_run_low()?,
            PowerCut::Hang => line.emulator.hang()?,
        }
        line.hear_greeting()?;
        let mut message = line.hear()?;
        if matches!(cut, PowerCut::Hang) {
            assert!(message.contains("the program hung"), "{message}");
            message = line.hear()?;
        }
        let expected = "[MSG:a job stopped at stroke ";
        assert!(message.starts_with(expected), "after {cut:?}: {message}");
        if matches!(cut, PowerCut::Hang) {
            while !line.hear()?.starts_with("ALARM:101") {}
            assert_eq!(ask(&mut line, "$resume")?, "error:9");
            while !line.unlock()? {}
        }
        let (done, found) = strokes(&line.status()?, "|Stopped:").ok_or("no job has stopped")?;
        assert!(found == all && done + 1 >= stroke, "{done} of {found}, after {stroke} of {all}");
        runs.push(strokes_of(line.emulator.pin_changes()?));
        // Nobody has said yet where the pen is.
        assert_eq!(ask(&mut line, "$resume")?, "error:164");
        assert_eq!(ask(&mut line, "$resume=origin")?, "ok");
    }
    wait_for(&mut line, u32::MAX)?;
    runs.push(strokes_of(line.emulator.pin_changes()?));
    assert_eq!(ask(&mut line, "$resume")?, "error:163");
    let late = line.status()?.contains("|Late:");
    assert!(!late, "the queue ran empty while the machine moved");
    Ok(runs)
}

#[test]
fn a_job_goes_on_after_a_cut_a_reset_and_a_fault() -> TestResult {
    let lines = job("30");
    let whole = strokes_of(on_the_host(&lines));
    let cuts =
        [PowerCut::Power, PowerCut::InFlash, PowerCut::Reset, PowerCut::Hang, PowerCut::Power];
    let runs = draw_with_cuts(&lines, &cuts)?;
    let twice = assert_one_drawing(&whole, &runs);
    assert!(twice <= cuts.len());
    assert_eq!(ink(runs.iter().flatten()), ink(&whole));
    Ok(())
}

/// The messages of a start behind the greeting, and the dwell of the pen that the flash keeps.
fn start_again(line: &mut Line<Pico>) -> Result<(String, Option<String>), Box<dyn Error>> {
    line.emulator.cut_power()?;
    line.hear_greeting()?;
    let (mut said, mut dwell) = (String::new(), None);
    line.emulator.garble_flash(1 << 40, false)?;
    line.emulator.send(b"$$\n")?;
    loop {
        match line.hear()? {
            end if end == "ok" => return Ok((said, dwell)),
            setting if setting.starts_with("$212=") => dwell = Some(setting),
            message if message.starts_with("[MSG:") => said += &message,
            setting if setting.starts_with('$') => {}
            other => return Err(other.into()),
        }
    }
}

/// While the voltage rises, flash returns garbage once, which its cache then keeps.
#[test]
fn a_start_with_garbage_from_the_flash_finds_everything() -> TestResult {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for text in &job("30") {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    assert!(!wait_for(&mut line, 3)?);
    let found = start_again(&mut line)?;
    assert!(found.0.starts_with("[MSG:a job stopped at stroke "), "{found:?}");
    assert!(found.1.is_some(), "{found:?}");
    let reads = line.emulator.record_reads()?;
    assert!(reads > 100, "{reads}");
    let starts = wish("PENUP_GARBLED", 12);
    let mut random = Random::new(2102);
    for number in 0..starts {
        // The records begin with the settings, whose header is read first.
        let read = if number < 4 { number } else { random.below(reads) };
        line.emulator.garble_flash(read, true)?;
        assert_eq!(start_again(&mut line)?, found, "garbage at read {read} of {reads}");
    }
    assert!(u64::from(line.emulator.garbled()) >= starts - 1, "{}", line.emulator.garbled());
    Ok(())
}

#[test]
fn a_start_with_garbage_from_the_flash_finds_a_model_there() -> TestResult {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for _ in 0..PICO.memory.vertices / 8 + 1 {
        line.emulator.send(&b"v 1 1 1\n".repeat(8))?;
        for _ in 0..8 {
            let mut answer = line.hear()?;
            while answer.starts_with('[') {
                answer = line.hear()?;
            }
            assert_eq!(answer, "ok");
        }
    }
    // What is asked for completes the model.
    assert_eq!(ask(&mut line, "$model")?, "ok");
    let found = start_again(&mut line)?;
    assert!(found.0.starts_with("[MSG:the flash keeps a model of "), "{found:?}");
    let reads = line.emulator.record_reads()?;
    let mut random = Random::new(2103);
    let starts = wish("PENUP_GARBLED", 12);
    for _ in 0..starts {
        // The record of the model is what is read last: 64 words, twice.
        let read = reads - 1 - random.below(128);
        line.emulator.garble_flash(read, true)?;
        assert_eq!(start_again(&mut line)?, found, "garbage at read {read} of {reads}");
    }
    assert_eq!(u64::from(line.emulator.garbled()), starts);
    Ok(())
}

/// A spiral of one stroke, with rests after each 40 mm of it.
#[test]
fn a_job_goes_on_within_its_only_stroke() -> TestResult {
    let vertices = (0..200).map(|index| {
        let (turn, radius) = (f64::from(index) * 0.2, 2.0 + f64::from(index) / 20.0);
        format!("v {:.3} {:.3} 0", radius * turn.cos(), radius * turn.sin())
    });
    let settings = ["$212=30", "$213=30", "$219=0.04", "$page=30x30", "$margin=3"];
    let lines: Vec<String> = vertices
        .chain((1..200).map(|from| format!("l {from} {}", from + 1)))
        .chain(settings.into_iter().chain(["$plot"]).map(str::to_owned))
        .collect();
    let whole = strokes_of(on_the_host(&lines));
    assert_eq!(whole.len(), 1);
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for text in &lines {
        assert_eq!(ask(&mut line, text)?, "ok", "{text}");
    }
    let time = duration(&on_the_host(&lines));
    let mut runs = Vec::new();
    for _ in 0..4 {
        line.emulator.cut_power_after(time / 6)?;
        line.hear_greeting()?;
        let message = line.hear()?;
        assert!(message.starts_with("[MSG:a job stopped at stroke 1 of 1"), "{message}");
        runs.push(strokes_of(line.emulator.pin_changes()?));
        assert_eq!(ask(&mut line, "$resume=origin")?, "ok");
    }
    wait_for(&mut line, u32::MAX)?;
    runs.push(strokes_of(line.emulator.pin_changes()?));
    assert!(!line.status()?.contains("|Late:"), "the queue ran empty while the machine moved");
    assert_eq!(ink(runs.iter().flatten()), ink(&whole));
    let steps = |run: &Run| run.iter().map(|stroke| stroke.len() - 1).sum::<usize>();
    let twice = runs.iter().map(steps).sum::<usize>() - steps(&whole);
    // 40 mm of 80 steps, of which slanting chords have up to twice as many, and a chord.
    assert!(twice <= 4 * 2 * 80 * 44, "{twice} steps are drawn twice");
    Ok(())
}

/// Prints how long it takes to write to the flash while a job is drawn, and by how much that delays
/// the job.
#[test]
fn a_page_is_written_behind_each_stroke() -> TestResult {
    for dwell in ["150", "30", "1"] {
        let lines = job(dwell);
        let image = image_path("pico");
        let mut line = Line::to(Box::new(Pico::start(&image)?))?;
        for text in &lines {
            assert_eq!(ask(&mut line, text)?, "ok", "{text}");
        }
        line.emulator.time_function(&image, "5flash5Flash4work", 0)?;
        wait_for(&mut line, u32::MAX)?;
        let timed = line.emulator.take_timed();
        let cycles: Vec<u64> = timed.iter().map(|(_, cycles)| *cycles).collect();
        let (changes, planned) = (line.emulator.pin_changes()?, on_the_host(&lines));
        let [took, planned_time] = [&changes, &planned].map(|changes| duration(changes));
        eprintln!(
            "dwell {dwell} ms: {} pages, at most {:?} cycles; {took:?}, planned {planned_time:?}",
            cycles.len(),
            cycles.iter().max(),
        );
        let drawn = strokes_of(changes);
        // Pulses for the servo come every 20 ms, so with less the pin shows the pen late.
        assert!(dwell == "1" || drawn == strokes_of(planned), "other strokes");
        // The first ones may have been written before the functions were timed.
        assert!(cycles.len() + 1 >= drawn.len(), "{} {}", cycles.len(), drawn.len());
        assert!(!line.status()?.contains("|Late:"), "the queue ran empty while steps were due");
    }
    Ok(())
}
