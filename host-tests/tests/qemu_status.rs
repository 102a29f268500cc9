//! Tests that the serial line is served while hidden lines are computed: `?` is answered within 20
//! ms of the board's time.
#![cfg(feature = "emulator")]

use penup_client::emulator::{EmulatedBoard, Emulator, Options, image_path};
use penup_host_tests::whole_jobs::job_lines;
use std::error::Error;
use std::time::Duration;

#[test]
fn a_status_request_waits_less_than_20_ms_while_a_job_is_computed() -> Result<(), Box<dyn Error>> {
    longest_wait("lattice3.obj", &["$page=60x80", "$margin=5"])
}

#[test]
fn and_while_the_largest_job_is_computed() -> Result<(), Box<dyn Error>> {
    longest_wait("lattice5.obj", &["$eye=-15.37,-20.71,25.13", "$at=4.5,4.5,4.5", "$up=0,0,1"])
}

fn longest_wait(scene: &str, settings: &[&str]) -> Result<(), Box<dyn Error>> {
    let mut emulator = Emulator::start(&image_path("lm3s6965"), Options::default())?;
    let mut heard = String::new();
    let mut hear = |emulator: &mut Emulator, end: &str| -> Result<String, Box<dyn Error>> {
        let mut buffer = [0; 256];
        while !heard.contains(end) {
            let count = emulator.receive(&mut buffer, Duration::from_secs(60))?;
            if count == 0 {
                return Err(format!("silent after {heard:?}").into());
            }
            heard.push_str(&String::from_utf8_lossy(&buffer[..count]));
        }
        let end = heard.find(end).unwrap_or_default() + end.len();
        Ok(heard.drain(..end).collect())
    };
    hear(&mut emulator, "help]\r\n")?;
    let lines = job_lines(scene, settings);
    let (plot, model) = lines.split_last().ok_or("an empty job")?;
    for line in model {
        emulator.send(format!("{line}\n").as_bytes())?;
        assert!(hear(&mut emulator, "\r\n")?.starts_with("ok"), "{line}");
    }
    emulator.log_lines();
    emulator.send(format!("{plot}\n").as_bytes())?;
    let mut stages = Vec::new();
    loop {
        emulator.send(b"?")?;
        let answer = hear(&mut emulator, ">\r\n")?;
        if answer.contains("error:") {
            return Err(format!("{scene} was refused: {answer}").into());
        }
        if answer.contains("ok\r\n") {
            break;
        }
        let stage = answer.split("|Stage:").nth(1).unwrap_or_default();
        stages.push(stage.trim_end_matches(">\r\n").to_owned());
    }
    for stage in ["visibility", "order"] {
        assert!(stages.iter().any(|seen| seen == stage), "{stage} was never seen: {stages:?}");
    }
    let waits: Vec<u64> = emulator
        .log_lines()
        .iter()
        .filter_map(|line| line.split("status after ").nth(1)?.split(' ').next()?.parse().ok())
        .collect();
    assert!(waits.len() >= stages.len(), "{waits:?}");
    let longest = waits.iter().max().ok_or("no wait was logged")?;
    println!("{} requests, the longest wait {longest} us", waits.len());
    assert!(*longest < 20_000, "a status request waited {longest} us");
    Ok(())
}
