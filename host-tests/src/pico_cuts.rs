//! Jobs of the emulated Raspberry Pi Pico whose power is cut at random instants and in random
//! writes of the flash, which may also return garbage once when the power comes back: judged by the
//! ink that the pins leave.

use crate::cut_jobs::{Point, assert_one_drawing, ink, strokes_of};
use crate::emulated_jobs::{Line, bench_like};
use crate::random::Random;
use penup::board_table::PICO;
use penup_client::emulator::{EmulatedBoard as _, Pico, PinChange, image_path};
use std::error::Error;
use std::time::Duration;

/// The strokes that the pins have drawn in one run.
pub type Run = Vec<Vec<Point>>;

/// The shortest time before a cut: by then the line behind it has arrived.
const SOONEST: Duration = Duration::from_millis(60);

/// More reads and writes than there ever are.
const NEVER: u64 = 1 << 40;

/// How often something has been done to the board.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Cuts of the power at an instant.
    pub instants: u32,
    /// Cuts of the power while flash was erased or written.
    pub in_flash: u32,
    /// Resets by the pin RUN.
    pub resets: u32,
    /// Starts at which flash has returned garbage.
    pub garbled: u32,
    /// Jobs that were completed.
    pub jobs: u32,
    /// Strokes of which a part was drawn twice.
    pub twice: usize,
}

/// What a job is, without a cut.
pub struct Job {
    /// Its lines, the last of which is `$plot`.
    pub lines: Vec<String>,
    /// Its strokes, as the host draws them.
    pub whole: Run,
    /// How long it takes.
    pub time: Duration,
    /// Whether it goes on within strokes (`$219`), or a line before the stroke that was interrupted
    /// (dots): then only the ink is compared.
    pub only_ink: bool,
}

impl Counts {
    /// How often the board was stopped.
    pub fn cuts(&self) -> u32 {
        self.instants + self.in_flash + self.resets
    }
}

impl Job {
    /// Draws the job on the host.
    ///
    /// # Panics
    /// Panics if a line is refused.
    pub fn new(lines: Vec<String>) -> Self {
        let mut bench = bench_like(&PICO);
        for line in &lines {
            let answer = bench.say(&format!("{line}\n"));
            assert!(answer.ends_with("ok\n"), "{line}: {answer}");
        }
        bench.finish();
        let trace = bench.board.trace();
        let changes: Vec<PinChange> = trace.changes().iter().map(PinChange::from).collect();
        let time = changes.last().map_or(Duration::ZERO, |change| change.at);
        let only_ink =
            lines.iter().any(|line| line.starts_with("$219=") || line == "$hidden=dotted");
        Self { whole: strokes_of(changes), time, only_ink, lines }
    }
}

/// How the board is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PowerCut {
    At(Duration),
    InFlash(u64),
    Reset(Duration),
}

/// A board whose power is cut.
pub struct CutPico {
    line: Line<Pico>,
    /// How often the last start has read the records in flash.
    reads: u64,
    counts: Counts,
}

impl CutPico {
    /// Starts the board.
    ///
    /// # Errors
    /// It does not start.
    pub fn start() -> Result<Self, Box<dyn Error>> {
        let line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
        Ok(Self { line, reads: 1, counts: Counts::default() })
    }

    /// What has been done to the board since its start.
    pub fn counts(&self) -> Counts {
        Counts { garbled: self.line.emulator.garbled(), ..self.counts }
    }

    /// Sends a line and returns the last line of the answer; a status that was asked for before may
    /// come first.
    fn ask(&mut self, text: &str) -> Result<String, Box<dyn Error>> {
        let mut answer = self.line.ask(text)?;
        while answer.starts_with(['[', '<']) {
            answer = self.line.hear()?;
        }
        Ok(answer)
    }

    /// Draws a job that is cut `cuts` times at most, then to its end, and judges the ink.
    ///
    /// # Errors
    /// The emulator fails, or the board answers what it must not.
    ///
    /// # Panics
    /// Panics if the drawing is not whole.
    pub fn draw(
        &mut self,
        job: &Job,
        cuts: u32,
        random: &mut Random,
    ) -> Result<(), Box<dyn Error>> {
        // The pen begins at the origin, wherever it ended.
        self.line.emulator.cut_power()?;
        self.line.hear_greeting()?;
        self.line.emulator.garble_flash(NEVER, false)?;
        let mut runs: Vec<Run> = Vec::new();
        let mut stopped = false;
        for number in 0..=cuts {
            let trigger = if stopped {
                "$resume=origin"
            } else {
                // Nothing has been drawn, or the job is over.
                if runs.iter().any(|run| !run.is_empty()) {
                    break;
                }
                let (plot, model) = job.lines.split_last().ok_or("a job")?;
                for text in [String::from("$clear")].iter().chain(model) {
                    let answer = self.ask(text)?;
                    if answer != "ok" {
                        return Err(format!("{text}: {answer}").into());
                    }
                }
                plot.as_str()
            };
            self.line.emulator.pin_changes()?;
            let writes_job = !stopped;
            let cut = (number < cuts).then(|| some_cut(job, cuts, writes_job, random));
            stopped = self.run(trigger, cut, random)?;
            runs.push(strokes_of(self.line.emulator.pin_changes()?));
        }
        if stopped {
            return Err("the last run has no cut, and yet the job has stopped".into());
        }
        let before = self.counts.twice;
        if job.only_ink {
            assert_eq!(ink(runs.iter().flatten()), ink(&job.whole), "the ink differs");
        } else {
            self.counts.twice += assert_one_drawing(&job.whole, &runs);
        }
        assert!(self.counts.twice - before <= runs.len(), "strokes are drawn twice");
        self.counts.jobs += 1;
        Ok(())
    }

    /// Sends the line that starts the machine, and cuts the power. Returns whether a job has
    /// stopped then.
    fn run(
        &mut self,
        trigger: &str,
        cut: Option<PowerCut>,
        random: &mut Random,
    ) -> Result<bool, Box<dyn Error>> {
        let resets = self.line.emulator.resets();
        if cut.is_some() {
            let reads = if random.once_in(2) { random.below(self.reads) } else { NEVER };
            self.line.emulator.garble_flash(reads, true)?;
        }
        match cut {
            None => {}
            Some(PowerCut::At(after)) => self.line.emulator.cut_power_after(after)?,
            Some(PowerCut::InFlash(bytes)) => self.line.emulator.cut_power_in_flash(bytes)?,
            Some(PowerCut::Reset(after)) => self.line.emulator.pull_run_low_after(after)?,
        }
        let mut answer = self.line.ask(trigger)?;
        let mut is_over = false;
        // The status is asked for until the board has started again or is idle.
        loop {
            if answer.starts_with("Grbl") {
                break;
            }
            if answer.starts_with("error") || answer.starts_with("ALARM") {
                return Err(format!("{trigger}: {answer}").into());
            }
            if answer.starts_with("<Idle") && !answer.contains("|Stage:") {
                is_over = true;
                break;
            }
            if answer.contains("|Late:") {
                return Err(format!("the queue ran empty while steps were due: {answer}").into());
            }
            answer = if answer.starts_with('<') || answer == "ok" {
                self.line.status()?
            } else {
                self.line.hear()?
            };
        }
        if is_over {
            // What was to cut the power does not any more, or has just done so.
            self.line.emulator.cut_power_in_flash(NEVER)?;
            if let Some(PowerCut::At(_) | PowerCut::Reset(_)) = cut {
                self.line.hear_greeting()?;
            } else {
                return Ok(false);
            }
        }
        // The voltage is steady again.
        self.line.emulator.garble_flash(NEVER, false)?;
        self.reads = self.line.emulator.record_reads()?.max(1);
        if self.line.emulator.resets() == resets {
            return Err("the board started again by itself".into());
        }
        match cut {
            Some(PowerCut::At(_)) => self.counts.instants += 1,
            Some(PowerCut::InFlash(_)) => self.counts.in_flash += 1,
            _ => self.counts.resets += 1,
        }
        // Nobody has said yet where the pen is.
        match self.ask("$resume")?.as_str() {
            "error:163" => Ok(false),
            "error:164" => Ok(true),
            other => Err(format!("behind {cut:?}: $resume: {other}").into()),
        }
    }
}

/// A cut. All `cuts` together, each of which may be the last moment of its share of the job, leave
/// a share for the rest, so each of them happens.
fn some_cut(job: &Job, cuts: u32, writes_job: bool, random: &mut Random) -> PowerCut {
    let share = job.time / (cuts + 1);
    let after = SOONEST + Duration::from_micros(random.below(share.as_micros() as u64 + 1));
    match random.below(5) {
        0 | 1 => PowerCut::At(after),
        2 => PowerCut::Reset(after),
        _ => {
            let strokes = job.whole.len() as u64;
            // Saving a small job erases two sectors and writes some pages; each stroke writes one.
            let saving = if writes_job { 40 } else { 1 };
            PowerCut::InFlash(random.below(256 * (strokes / (u64::from(cuts) + 1) + saving)))
        }
    }
}
