//! Tests that the emulated board asks for each pen and waits for it.
#![cfg(feature = "emulator")]

use penup::board_table::LM3S6965;
use penup_host_tests::emulated_jobs::begin;
use std::error::Error;

#[test]
fn a_job_of_three_pens_pauses_twice() -> Result<(), Box<dyn Error>> {
    let lines = [
        "v 10 10 0",
        "v 20 10 0",
        "v 20 20 0",
        "v 10 20 0",
        "usemtl blue",
        "l 1 2",
        "usemtl red",
        "l 2 3",
        "usemtl pen5",
        "l 3 4",
        "$plot",
    ];
    let mut line = begin(&LM3S6965, &lines.map(str::to_owned))?;
    for pen in [2, 5] {
        assert_eq!(line.hear()?, format!("[MSG:put in pen {pen}, then send ~]"));
        let status = line.status()?;
        assert!(
            status.starts_with("<Hold:0|") && status.contains(&format!("|Pen:{pen}|")),
            "{status}"
        );
        line.emulator.send(b"~")?;
    }
    loop {
        let status = line.status()?;
        if status.starts_with("<Idle") {
            assert!(status.contains("|Drawn:3/3|"), "{status}");
            return Ok(());
        }
        assert!(status.starts_with("<Run"), "{status}");
    }
}
