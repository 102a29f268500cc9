//! Tests that `penup plot FILE --port DEVICE --resume` completes a drawing that the client sends
//! to the emulated Raspberry Pi Pico while it is drawn, and whose plotter loses its power: judged
//! by the ink that the pins leave.
#![cfg(all(feature = "emulator", unix))]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use clap::Parser as _;
use penup_client::cli::Cli;
use penup_client::emulator::{EmulatedBoard as _, Pico, image_path};
use penup_client::run::run;
use penup_client::workspace;
use penup_host_tests::cut_jobs::{Point, assert_one_drawing, ink, strokes_of};
use penup_host_tests::emulated_jobs::Line;
use penup_host_tests::pico_terminal::PicoTerminal;
use penup_host_tests::random::Random;
use penup_host_tests::wish::wish;
use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

type TestResult = Result<(), Box<dyn Error>>;

/// What the pins have drawn in one run: the points of each stroke.
type Run = Vec<Vec<Point>>;

/// A drawing and how the client is told to draw it.
struct Drawing {
    /// The name of a file of `scenes/`.
    scene: &'static str,
    options: &'static [&'static str],
}

/// A drawing that this computer is told to compute.
const SMALL: Drawing = Drawing {
    scene: "lattice2.obj",
    options: &["--page", "30x30", "--margin", "3", "--hidden", "erased", "--compute", "host"],
};

/// A drawing of some hundred strokes, which this computer is told to compute.
const LARGE: Drawing = Drawing {
    scene: "lattice4.obj",
    options: &["--page", "60x60", "--margin", "3", "--compute", "host"],
};

/// A board that has greeted, with a pen that takes little time.
fn plugged_in() -> Result<PicoTerminal, Box<dyn Error>> {
    let mut line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
    for setting in ["$212=30", "$213=30"] {
        assert_eq!(line.ask(setting)?, "ok", "{setting}");
    }
    Ok(PicoTerminal::new(*line.emulator)?)
}

impl Drawing {
    /// Runs `penup plot` with these further arguments. Returns what went wrong, as the user reads
    /// it.
    fn plot(&self, device: &str, arguments: &[&str]) -> Result<(), String> {
        let file = workspace::root().join("scenes").join(self.scene);
        let file = file.to_str().ok_or("a path in Unicode")?;
        let line = ["penup", "--quiet", "plot", file, "--port", device];
        let line = line.iter().chain(self.options).chain(arguments);
        let cli = Cli::try_parse_from(line).map_err(|error| error.to_string())?;
        run(&cli, &AtomicBool::new(false)).map(drop).map_err(|error| error.to_string())
    }

    /// The strokes of an undisturbed board, and how long its clock runs meanwhile.
    fn undisturbed(&self) -> Result<(Run, Duration), Box<dyn Error>> {
        let terminal = plugged_in()?;
        let begun = terminal.board().clock()?;
        self.plot(&terminal.device, &[])?;
        let mut board = terminal.board();
        Ok((strokes_of(board.pin_changes()?), board.clock()? - begun))
    }

    /// Draws with the power cut by `cut` in each run until it returns false. Returns the strokes of
    /// each run.
    fn with_cuts(
        &self,
        mut cut: impl FnMut(&mut Pico) -> Result<bool, Box<dyn Error>>,
    ) -> Result<Vec<Run>, Box<dyn Error>> {
        let terminal = plugged_in()?;
        let mut runs: Vec<Run> = Vec::new();
        loop {
            let has_begun = runs.iter().any(|run| !run.is_empty());
            if has_begun {
                let refused = self.plot(&terminal.device, &["--resume"]);
                let refused = refused.expect_err("nobody has said where the pen is");
                assert!(refused.contains("nobody has said where the pen is"), "{refused}");
            }
            let resets = terminal.board().resets();
            let cuts = cut(&mut terminal.board())?;
            let arguments: &[&str] = if has_begun { &["--resume", "--at-origin"] } else { &[] };
            let drawn = self.plot(&terminal.device, arguments);
            let mut board = terminal.board();
            runs.push(strokes_of(board.pin_changes()?));
            let was_cut = board.resets() > resets;
            match (drawn, was_cut, cuts) {
                // A cut may also come when all is drawn.
                (Ok(()), ..) => return Ok(runs),
                (Err(reason), true, true) => eprintln!("run {}: {reason}", runs.len()),
                (drawn, ..) => {
                    let run = runs.len();
                    return Err(format!("in run {run}, cut: {was_cut}: {drawn:?}").into());
                }
            }
        }
    }
}

#[test]
fn a_drawing_that_is_sent_goes_on_after_cuts() -> TestResult {
    let begun = Instant::now();
    let (whole, time) = SMALL.undisturbed()?;
    eprintln!("{} strokes, {time:?}, {:?}", whole.len(), begun.elapsed());
    let mut random = Random::new(2101);
    let mut most_runs = 0;
    // On a busy computer the power may fail before the client has opened the port, which then draws
    // as if nothing had been. Such a drawing is judged as well, but it is no test of going on.
    for _ in 0..5 {
        let mut cuts = 0;
        let runs = SMALL.with_cuts(|board| {
            cuts += 1;
            match cuts {
                1 | 3 => {
                    let after = time / 8 + time * random.below(100) as u32 / 2000;
                    board.cut_power_after(after)?;
                }
                // Each stroke clears bits of a page, and a page is 256 bytes.
                2 => board.cut_power_in_flash(3 * 256 + random.below(256))?,
                _ => {}
            }
            Ok(cuts <= 3)
        })?;
        let twice = assert_one_drawing(&whole, &runs);
        assert!(twice <= 3, "{twice}");
        assert_eq!(ink(runs.iter().flatten()), ink(&whole));
        most_runs = most_runs.max(runs.len());
        if most_runs >= 3 {
            break;
        }
    }
    assert!(most_runs >= 3, "two cuts and more");
    eprintln!("{:?}", begun.elapsed());
    Ok(())
}

/// Draws a larger drawing with ten cuts, again and again.
#[test]
#[ignore = "`cargo xtask power-soak --streamed` runs it for many minutes"]
fn soak() -> TestResult {
    let (minutes, seed) = (wish("PENUP_MINUTES", 10), wish("PENUP_SEED", 1));
    let mut random = Random::new(seed);
    let begun = Instant::now();
    let (whole, time) = LARGE.undisturbed()?;
    println!("{} strokes, {time:?}, {:?}", whole.len(), begun.elapsed());
    let mut all = 0;
    while begun.elapsed() < Duration::from_secs(60 * minutes) {
        let mut cuts = 0;
        let runs = LARGE
            .with_cuts(|board| {
                cuts += 1;
                if cuts <= 10 {
                    let after = time / 20 + time * random.below(1000) as u32 / 10_000;
                    board.cut_power_after(after)?;
                }
                Ok(cuts <= 10)
            })
            .map_err(|error| format!("seed {seed}: {error}"))?;
        let twice = assert_one_drawing(&whole, &runs);
        all += runs.len() - 1;
        println!("{} s: {all} cuts, {twice} strokes twice", begun.elapsed().as_secs());
    }
    Ok(())
}
