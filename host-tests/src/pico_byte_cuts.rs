//! Cuts of the emulated Pico's power before every byte that it writes to its flash.
//!
//! A run without a cut is recorded once: what is done to the flash, and what the pins draw. Each
//! cut is then a start with the flash as it was at some point of the record. So thousands of cuts
//! take minutes, and none of them depends on when a line arrives.
//!
//! Between two operations, the start shows the state that the operations before have brought about:
//! what the board says and answers. A start from within an operation must show the state before it
//! or the one behind it, and nothing else. What the states must be is checked by each scenario.
//!
//! The file is longer than 500 lines, because recording, cutting and judging work on one record.

mod computed_again;
mod power_cut;
mod scenarios;

pub use computed_again::{ComputedAgain, Missing};
pub use power_cut::PowerCut;
pub use scenarios::{KeptJob, OldOrNew, SentDrawing, UploadedModel};

use crate::cut_jobs::strokes_of;
use crate::emulated_jobs::Line;
use crate::pico_cuts::Run;
use crate::random::Random;
use penup_client::emulator::{EmulatedBoard as _, FlashOperation, Pico, PinChange, image_path};
use power_cut::{cuts_within, name_of};
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::time::Duration;

type Result<T = ()> = std::result::Result<T, Box<dyn Error>>;
/// How long a sector is erased, and how long a page is written.
const OPERATION_TIME: [Duration; 2] = [Duration::from_micros(400), Duration::from_millis(45)];

/// What a board shows when it has started: its messages, how far a job has come, and the answers to
/// the questions of a scenario.
pub type Shown = Vec<String>;

/// How often something has been done.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Starts behind a cut, by what was written.
    pub cuts: BTreeMap<&'static str, u32>,
    /// Starts behind a cut at a random instant of a job.
    pub instants: u32,
    /// Jobs that were completed and whose ink was compared.
    pub completed: u32,
}

impl Tally {
    /// Adds what another board has done.
    pub fn add(&mut self, other: &Self) {
        for (name, count) in &other.cuts {
            *self.cuts.entry(name).or_default() += count;
        }
        self.instants += other.instants;
        self.completed += other.completed;
    }

    /// All starts behind a cut.
    pub fn all(&self) -> u32 {
        self.cuts.values().sum::<u32>() + self.instants
    }
}

/// What is tried.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Each how manyth byte of a page the power goes before; 1 for every byte.
    pub bytes: u32,
    /// The number of cuts at random instants.
    pub instants: u32,
    /// The number of cuts of each page and sector after which bits at random have changed.
    pub scattered: usize,
    /// Whether the first cut of each operation and outcome is completed.
    pub completes_each: bool,
    /// One cut in so many is completed besides.
    pub complete: i32,
    /// Of the cuts, numbered from 0, those are tried that are the first number more than a multiple
    /// of the second one. Several boards share the cuts so.
    pub share: [u32; 2],
}

/// A board whose power is cut at points of a record.
pub struct RecordedPico {
    line: Line<Pico>,
    /// The operations of the record.
    pub operations: Vec<FlashOperation>,
    /// The changes of the pins in the recorded run, until nothing moved any more.
    changes: Vec<PinChange>,
    /// The number of cuts so far, those included that another board tries.
    cuts: u32,
    /// What has been done.
    pub tally: Tally,
}

/// What a scenario asks of a board that has started, and how it judges what is drawn then.
pub trait Scenario {
    /// The lines that are sent after a start, whose answers belong to what is shown.
    fn questions(&self) -> &[&str];

    /// Checks what is shown between the operations: before the first one, behind the first one, and
    /// so on.
    ///
    /// # Panics
    /// Panics if it is not as it must be.
    fn judge(&self, operations: &[FlashOperation], states: &[Shown]);

    /// What a cut has brought about, by the number of operations that are done and by what is
    /// shown. Of each outcome, the first cut is completed.
    fn outcome(&self, done: u32, shown: &Shown) -> (u32, Shown) {
        (done, shown.clone())
    }

    /// Completes on a board that has started what has been begun, and judges all that has been
    /// drawn. `drawn` are the strokes before the cut. Returns whether there was anything to do.
    ///
    /// # Errors
    /// The emulator fails, or the board answers what it must not.
    ///
    /// # Panics
    /// Panics if what is drawn is not what it must be.
    fn complete(&mut self, board: &mut RecordedPico, shown: &Shown, drawn: Run) -> Result<bool>;
}

impl RecordedPico {
    /// Starts the board.
    ///
    /// # Errors
    /// It does not start.
    pub fn start() -> Result<Self> {
        let line = Line::to(Box::new(Pico::start(&image_path("pico"))?))?;
        let (operations, changes) = (Vec::new(), Vec::new());
        Ok(Self { line, operations, changes, cuts: 0, tally: Tally::default() })
    }

    /// Counts the next cut. Returns whether this board tries it.
    fn is_next_mine(&mut self, effort: Effort) -> bool {
        let number = self.cuts;
        self.cuts += 1;
        let [first, boards] = effort.share;
        number % boards.max(1) == first
    }

    /// Sends a line and returns the lines of the answer, the last of which is `ok` or an error.
    ///
    /// # Errors
    /// The emulator fails.
    pub fn ask(&mut self, text: &str) -> Result<Vec<String>> {
        let mut heard = vec![self.line.ask(text)?];
        while heard.last().is_some_and(|last| last != "ok" && !last.starts_with("error:")) {
            heard.push(self.line.hear()?);
        }
        heard.retain(|line| !line.is_empty());
        Ok(heard)
    }

    /// Sends lines, each of which must be accepted.
    ///
    /// # Errors
    /// The emulator fails, or a line is refused.
    pub fn order<'l>(&mut self, lines: impl IntoIterator<Item = &'l str>) -> Result {
        for text in lines {
            let answer = self.ask(text)?;
            if answer.last().is_none_or(|last| last != "ok") {
                return Err(format!("{text}: {answer:?}").into());
            }
        }
        Ok(())
    }

    /// Sends lines that the board takes at once, some at a time, each of which must be accepted.
    ///
    /// # Errors
    /// As [`RecordedPico::order`].
    pub fn order_many(&mut self, lines: &[String]) -> Result {
        for some in lines.chunks(8) {
            self.line.emulator.send(format!("{}\n", some.join("\n")).as_bytes())?;
            for text in some {
                let mut answer = self.line.hear()?;
                while answer.starts_with('[') {
                    answer = self.line.hear()?;
                }
                if answer != "ok" {
                    return Err(format!("{text}: {answer}").into());
                }
            }
        }
        Ok(())
    }

    /// Cuts the power and restores it, with the flash as it is.
    ///
    /// # Errors
    /// The board does not start.
    pub fn restart(&mut self) -> Result {
        self.line.emulator.cut_power()?;
        self.line.hear_greeting()
    }

    /// Waits until nothing moves any more.
    ///
    /// # Errors
    /// The emulator fails, or the board restarts or reports what it must not.
    pub fn finish(&mut self) -> Result {
        loop {
            let status = self.line.status()?;
            if status.starts_with("<Idle") && !status.contains("|Stage:") {
                return Ok(());
            }
            let is_status = status.starts_with('<');
            if status.starts_with("Grbl") || status.starts_with("ALARM") {
                return Err(format!("while a job is drawn: {status}").into());
            }
            if is_status && status.contains("|Late:") {
                return Err(format!("the queue ran empty while steps were due: {status}").into());
            }
        }
    }

    /// The strokes that the pins have drawn since they were asked for last.
    ///
    /// # Errors
    /// The emulator fails.
    pub fn drawn(&mut self) -> Result<Run> {
        Ok(strokes_of(self.line.emulator.pin_changes()?))
    }

    /// Records what is done to the flash while `work` is done, and until nothing moves any more.
    ///
    /// # Errors
    /// The emulator fails, or the work does.
    pub fn record(&mut self, work: impl FnOnce(&mut Self) -> Result) -> Result {
        self.line.emulator.pin_changes()?;
        self.line.emulator.record_flash()?;
        work(self)?;
        self.finish()?;
        self.operations = self.line.emulator.end_flash_record()?;
        self.changes = self.line.emulator.pin_changes()?;
        Ok(())
    }

    /// The strokes of the record up to an instant.
    fn drawn_until(&self, instant: Duration) -> Run {
        strokes_of(self.changes.iter().take_while(|change| change.at < instant).copied())
    }

    /// When the power goes at a cut: at the beginning of the operation, because the machine stands
    /// while it lasts.
    fn instant(&self, cut: PowerCut) -> Duration {
        let operation = self.operations.get(cut.done() as usize);
        operation.map_or(Duration::MAX, |operation| operation.began)
    }

    /// Starts the board behind a cut, and returns what it shows.
    fn boot(&mut self, cut: PowerCut, questions: &[&str]) -> Result<Shown> {
        self.line.forget();
        let emulator = &mut self.line.emulator;
        match cut {
            PowerCut::Between(done) => emulator.boot_within(done, 0, 0)?,
            PowerCut::Within(number, bytes, mask) => emulator.boot_within(number, bytes, mask)?,
            PowerCut::Scattered(number, share, seed) => {
                emulator.boot_scattered(number, share, seed)?
            }
        }
        self.line.hear_greeting()?;
        self.line.emulator.send(b"?")?;
        let mut shown = Shown::new();
        loop {
            let heard = self.line.hear()?;
            if !heard.starts_with('<') {
                shown.push(heard);
                continue;
            }
            let state = heard.trim_start_matches('<').split('|').next().unwrap_or_default();
            let stopped = heard.split('|').find(|field| field.starts_with("Stopped:"));
            shown.push(state.to_owned());
            shown.extend(stopped.map(|field| field.trim_end_matches('>').to_owned()));
            break;
        }
        for question in questions {
            shown.extend(self.ask(question)?);
        }
        shown.retain(|line| !line.is_empty());
        Ok(shown)
    }

    /// Cuts the power at all points of the record that `effort` asks for, and judges what is shown
    /// and drawn.
    ///
    /// # Errors
    /// The emulator fails, or the board answers what it must not.
    ///
    /// # Panics
    /// Panics if something is not as it must be.
    pub fn try_all(
        &mut self,
        scenario: &mut dyn Scenario,
        effort: Effort,
        random: &mut Random,
    ) -> Result {
        let operations = self.operations.clone();
        let questions: Vec<String> =
            scenario.questions().iter().map(|text| (*text).to_owned()).collect();
        let questions: Vec<&str> = questions.iter().map(String::as_str).collect();
        let mut states: Vec<Shown> = Vec::new();
        for done in 0..=operations.len() as u32 {
            states.push(self.boot(PowerCut::Between(done), &questions)?);
            let last = operations.len() - 1;
            let place = operations.get(done as usize).unwrap_or(&operations[last]);
            // Every board needs these states, and one counts each.
            if self.is_next_mine(effort) {
                *self.tally.cuts.entry(name_of(place)).or_default() += 1;
            }
        }
        scenario.judge(&operations, &states);
        let mut seen = BTreeSet::new();
        // All boards that share the cuts must number the same ones.
        let of_cuts = &mut Random::new(random.next_number());
        let front = operations.iter().map(|operation| operation.offset).min().unwrap_or_default();
        for (number, operation) in (0..).zip(&operations) {
            for cut in cuts_within(number, operation, front, effort, of_cuts) {
                if !self.is_next_mine(effort) {
                    continue;
                }
                self.try_one(scenario, cut, &states, &mut seen, effort, random)?;
                *self.tally.cuts.entry(name_of(operation)).or_default() += 1;
            }
        }
        // What was done before the last operation, and behind it.
        for cut in [PowerCut::Between(0), PowerCut::Between(operations.len() as u32)] {
            self.try_one(scenario, cut, &states, &mut seen, effort, random)?;
        }
        Ok(())
    }

    /// Cuts the power at random instants of the record, a third of them within an operation, and
    /// judges what is shown and drawn.
    ///
    /// # Errors
    /// As [`RecordedPico::try_all`].
    ///
    /// # Panics
    /// As [`RecordedPico::try_all`].
    pub fn try_instants(
        &mut self,
        scenario: &mut dyn Scenario,
        effort: Effort,
        random: &mut Random,
    ) -> Result {
        let mut states = vec![None; self.operations.len() + 1];
        let begin = self.operations[0].began;
        let end = self.changes.last().map_or(begin, |change| change.at);
        let of_cuts = &mut Random::new(random.next_number());
        for _ in 0..effort.instants {
            let instant = if of_cuts.once_in(3) {
                self.instant_of_a_write(of_cuts)
            } else {
                begin + share_of(end - begin, of_cuts)
            };
            if !self.is_next_mine(effort) {
                continue;
            }
            self.try_instant(scenario, instant, &[], &mut states, effort, random)?;
        }
        Ok(())
    }

    /// As [`RecordedPico::try_instants`], but each instant is within an operation, and the
    /// scenario's questions are asked. It is for what changes by operations alone.
    ///
    /// # Errors
    /// As [`RecordedPico::try_all`].
    ///
    /// # Panics
    /// As [`RecordedPico::try_all`].
    pub fn try_instants_of_writes(
        &mut self,
        scenario: &mut dyn Scenario,
        effort: Effort,
        random: &mut Random,
    ) -> Result {
        let questions: Vec<String> =
            scenario.questions().iter().map(|text| (*text).to_owned()).collect();
        let questions: Vec<&str> = questions.iter().map(String::as_str).collect();
        let mut states = vec![None; self.operations.len() + 1];
        let of_cuts = &mut Random::new(random.next_number());
        for _ in 0..effort.instants {
            let instant = self.instant_of_a_write(of_cuts);
            if !self.is_next_mine(effort) {
                continue;
            }
            self.try_instant(scenario, instant, &questions, &mut states, effort, random)?;
        }
        Ok(())
    }

    /// A random instant at which a page is written or a sector erased.
    fn instant_of_a_write(&self, random: &mut Random) -> Duration {
        let operation = self.operations[random.below(self.operations.len() as u64) as usize];
        operation.began + share_of(OPERATION_TIME[usize::from(operation.is_erasure)], random)
    }

    /// Cuts the power at an instant. `states` are those between the operations, as far as they are
    /// known.
    fn try_instant(
        &mut self,
        scenario: &mut dyn Scenario,
        instant: Duration,
        questions: &[&str],
        states: &mut [Option<Shown>],
        effort: Effort,
        random: &mut Random,
    ) -> Result {
        let begun = self.operations.iter().take_while(|it| it.began <= instant).count();
        let cut = match begun.checked_sub(1).map(|last| (last as u32, self.operations[last])) {
            Some((number, last)) => {
                let lasts = OPERATION_TIME[usize::from(last.is_erasure)].as_micros();
                let passed = (instant - last.began).as_micros();
                if passed < lasts {
                    let share = (256 * passed / lasts) as u8;
                    PowerCut::Scattered(number, share, random.below(1 << 24) as u32)
                } else {
                    PowerCut::Between(number + 1)
                }
            }
            None => PowerCut::Between(0),
        };
        for done in [cut.done(), (cut.done() + 1).min(self.operations.len() as u32)] {
            if states[done as usize].is_none() {
                let state = self.boot(PowerCut::Between(done), questions)?;
                states[done as usize] = Some(state);
            }
        }
        let shown = self.boot(cut, questions)?;
        assert_shown(cut, &shown, |at| states[at as usize].as_ref());
        self.tally.instants += 1;
        if random.once_in(effort.complete) {
            self.boot(cut, &[])?;
            self.line.emulator.pin_changes()?;
            let drawn = self.drawn_until(instant);
            if scenario.complete(self, &shown, drawn)? {
                self.tally.completed += 1;
            }
        }
        Ok(())
    }

    /// Cuts the power once. A cut whose outcome is new for its operation is completed, and so are
    /// some others.
    fn try_one(
        &mut self,
        scenario: &mut dyn Scenario,
        cut: PowerCut,
        states: &[Shown],
        seen: &mut BTreeSet<(u32, Shown)>,
        effort: Effort,
        random: &mut Random,
    ) -> Result {
        let questions: Vec<String> =
            scenario.questions().iter().map(|text| (*text).to_owned()).collect();
        let questions: Vec<&str> = questions.iter().map(String::as_str).collect();
        let shown = self.boot(cut, &questions)?;
        assert_shown(cut, &shown, |at| states.get(at as usize));
        let is_new = seen.insert(scenario.outcome(cut.done(), &shown));
        if (is_new && effort.completes_each) || random.once_in(effort.complete) {
            self.boot(cut, &[])?;
            self.line.emulator.pin_changes()?;
            let drawn = self.drawn_until(self.instant(cut));
            let completed = scenario.complete(self, &shown, drawn);
            if completed.map_err(|error| format!("behind {cut:?}: {error}"))? {
                self.tally.completed += 1;
            }
        }
        Ok(())
    }
}

/// Checks that a board shows the state before the operation of a cut, or the one behind it. Of an
/// operation that notes many strokes at once, some may be noted.
///
/// # Panics
/// Panics if it shows another one.
fn assert_shown<'s>(cut: PowerCut, shown: &Shown, state: impl Fn(u32) -> Option<&'s Shown>) {
    let before = state(cut.done());
    let behind = if matches!(cut, PowerCut::Between(_)) { None } else { state(cut.done() + 1) };
    let is_within = before.zip(behind).is_some_and(|(before, behind)| {
        let [(before, least), (shown, noted), (behind, most)] =
            [before, shown, behind].map(without_strokes);
        before == shown && shown == behind && least <= noted && noted <= most
    });
    assert!(
        Some(shown) == before || Some(shown) == behind || is_within,
        "behind {cut:?}: {shown:#?}, neither {before:#?} nor {behind:#?}"
    );
}

/// What a board shows without the number of drawn strokes of a job that has stopped, and that
/// number.
fn without_strokes(shown: &Shown) -> (Shown, Option<u32>) {
    let field = shown.iter().find_map(|line| line.strip_prefix("Stopped:")?.split_once('/'));
    let is_count = |line: &&String| {
        !line.starts_with("Stopped:") && !line.starts_with("[MSG:a job stopped at stroke ")
    };
    let all = field.map(|(_, all)| format!("Stopped:/{all}"));
    let others = shown.iter().filter(is_count).cloned().chain(all).collect();
    (others, field.and_then(|(done, _)| done.parse().ok()))
}

/// A random part of a time.
fn share_of(time: Duration, random: &mut Random) -> Duration {
    Duration::from_micros(random.below(time.as_micros() as u64 + 1))
}
