//! Tests that the main loop of the Raspberry Pi Pico looks at what is asked in real time as often
//! as docs/reliability.md says, whatever input it works on. The heaviest jobs are in `stack`.
#![cfg(feature = "emulator")]

use penup_client::emulator::{CallGaps, EmulatedBoard as _, Pico, image_path};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::heaviest_jobs::LOOK;
use penup_host_tests::looks::{ALL_AT_ONCE, ANY, EDITS, POLYGONS, assert_bounded};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

type TestResult = Result<(), Box<dyn Error>>;

/// Sends a line and waits for its answer.
fn ask(line: &mut Line<Pico>, text: &str) -> TestResult {
    line.emulator.send(format!("{text}\n").as_bytes())?;
    loop {
        let answer = line.hear()?;
        if answer == "ok" || answer.starts_with("error:") {
            return Ok(());
        }
    }
}

/// Lets the board go on with what it has been told, and then ends that.
fn abort(line: &mut Line<Pico>, reports: usize) -> TestResult {
    for _ in 0..reports {
        line.status()?;
        sleep(Duration::from_millis(5));
    }
    line.emulator.send(b"\x18")?;
    line.hear_greeting()?;
    while !line.status()?.contains("<Idle") {}
    Ok(())
}

/// Checks the bound after a job, which has taken some time.
fn assert_looked(line: &mut Line<Pico>, row: &str, job: &str) {
    let gaps = line.emulator.take_call_gaps();
    assert_ne!(gaps, CallGaps::default(), "{job} took no time");
    assert_bounded(row, job, gaps);
}

fn start() -> Result<Line<Pico>, Box<dyn Error>> {
    let image = image_path("pico");
    let mut line = Line::to(Box::new(Pico::start(&image)?))?;
    line.emulator.time_between_calls(&image, LOOK)?;
    Ok(line)
}

#[test]
fn while_lines_are_carried_out_that_take_long() -> TestResult {
    let mut line = start()?;
    let digits = "0".repeat(100);
    let long = format!("G1X{digits}1.5Y{digits}2.5F9000");
    let corners: String = (1..=60).map(|corner| format!(" {corner}")).collect();
    let named = [
        ("lists", vec!["$", "$$", "$options", "$I", "$N", "$#", "$G"]),
        ("a long line of G-code", vec!["M3", &long, "G1X0Y0", "M5"]),
        ("arcs", vec!["M3", "G2X30Y0R100000", "G3X0Y0R90", "G3I20J0", "M5"]),
        ("what is not read", vec!["# xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx", "v 1 1e99 x"]),
    ];
    for (name, lines) in named {
        for text in lines {
            ask(&mut line, text)?;
        }
        abort(&mut line, 20)?;
        assert_looked(&mut line, ANY, name);
    }
    // The largest lattice that the memory holds, and changes of all of it.
    for text in job_lines("lattice7.obj", &[]).iter().filter(|text| *text != "$plot") {
        ask(&mut line, text)?;
    }
    ask(&mut line, &format!("f{corners}"))?;
    assert_looked(&mut line, ANY, "an upload");
    ask(&mut line, "$model")?;
    assert_looked(&mut line, ALL_AT_ONCE, "$model");
    for text in ["$list=v", "$list=f"] {
        ask(&mut line, text)?;
    }
    assert_looked(&mut line, ANY, "lists of a large model");
    let mut longest = Duration::ZERO;
    for edit in [
        "$translate=1,2,3",
        "$scale=2,2,2",
        "$rotate=z,30",
        "$reflect=1,2,3",
        "$undo",
        "$delete=f,1,1000",
        "$undo",
        "$mirror=1,2,3",
    ] {
        ask(&mut line, edit)?;
        let gaps = line.emulator.take_call_gaps();
        assert_bounded(EDITS, edit, gaps);
        longest = longest.max(gaps.longest);
    }
    // Less would mean that no edit was carried out.
    assert!(longest > Duration::from_millis(5), "{longest:?}");
    ask(&mut line, "$clear")
}

#[test]
fn while_a_job_is_drawn_again_and_resumed() -> TestResult {
    let mut line = start()?;
    for text in job_lines("isobars.obj", &["$page=40x40", "$margin=2", "$fit=on"]) {
        ask(&mut line, &text)?;
    }
    abort(&mut line, 100)?;
    assert_looked(&mut line, ANY, "curves");
    for command in ["$resume", "$again"] {
        ask(&mut line, command)?;
        abort(&mut line, 50)?;
        assert_looked(&mut line, ALL_AT_ONCE, command);
    }
    Ok(())
}

#[test]
fn while_hpgl_is_drawn() -> TestResult {
    let mut line = start()?;
    let label = "The quick brown fox jumps over the lazy dog. ".repeat(4);
    for (row, name, text) in [
        (
            POLYGONS,
            "filled polygons",
            "PM0;CI3000,2;PM1;PU;PD;CI1000,5;PM2;FT3,4;PT.1;FP;EP;".to_owned(),
        ),
        (
            POLYGONS,
            "filled wedges",
            "PT.1;FT4,8,45;WG3000,0,270,2;EW3000,0,270,2;CI3000,1;".to_owned(),
        ),
        (ANY, "labels", format!("SI.5,.8;DI1,1;SL.3;LB{label}\x03;LT2,1;LB{label}\x03")),
    ] {
        ask(&mut line, "$hpgl")?;
        line.emulator.send(format!("IN;SP1;PA4000,4000;PD;{text}\n").as_bytes())?;
        abort(&mut line, 150)?;
        assert_looked(&mut line, row, name);
    }
    Ok(())
}
