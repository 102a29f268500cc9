//! What is cut: settings, jobs, drawings that are sent, and models, and how each is judged.

use super::{RecordedPico, Result, Scenario, Shown};
use crate::cut_jobs::{Point, assert_one_drawing, ink};
use crate::pico_cuts::{Job, Run};
use crate::streamed_drawing::StreamedDrawing;
use penup_client::emulator::FlashOperation;
use penup_readers::lines::Lines as _;

/// Settings or parameters, of which there are the old ones or the new ones.
pub struct OldOrNew {
    /// The line that lists them.
    pub list: [&'static str; 1],
    /// What is in the list before, and what behind.
    pub values: [&'static str; 2],
}

impl Scenario for OldOrNew {
    fn questions(&self) -> &[&str] {
        &self.list
    }

    fn judge(&self, _: &[FlashOperation], states: &[Shown]) {
        let has = |state: &Shown, value| state.iter().any(|line| line.starts_with(value));
        let [old, new] = self.values;
        let is_new: Vec<bool> = states.iter().map(|state| has(state, new)).collect();
        for (state, is_new) in states.iter().zip(&is_new) {
            assert!(has(state, old) != *is_new, "{state:?}");
        }
        // Old ones first; the last operation is what makes the new ones count.
        let last = is_new.len() - 1;
        assert!(is_new[last] && is_new[..last].iter().all(|is_new| !is_new), "{is_new:?}");
    }

    fn complete(&mut self, _: &mut RecordedPico, _: &Shown, _: Run) -> Result<bool> {
        Ok(false)
    }
}

/// A job that is kept in place of another one and drawn.
pub struct KeptJob {
    /// The job before, whose drawing has ended.
    pub old: Job,
    /// The job that is recorded.
    pub new: Job,
}

/// How far a job has come: the strokes that are drawn, and all of them.
pub(super) fn stopped(shown: &Shown) -> Option<(usize, usize)> {
    let field = shown.iter().find_map(|line| line.strip_prefix("Stopped:"))?;
    let (done, all) = field.split_once('/')?;
    Some((done.parse().ok()?, all.parse().ok()?))
}

impl Scenario for KeptJob {
    fn questions(&self) -> &[&str] {
        // Which of the jobs is kept is shown by its lengths, once it is drawn.
        &["$again", "$model"]
    }

    fn judge(&self, operations: &[FlashOperation], states: &[Shown]) {
        let all = self.new.whole.len();
        let job_of = |state: &Shown| state.iter().find(|line| line.starts_with("[JOB:")).cloned();
        let jobs: Vec<_> = states.iter().map(job_of).collect();
        assert!(jobs.iter().all(Option::is_some), "there is always a job: {jobs:?}");
        let kept = jobs.iter().position(|job| *job != jobs[0]).expect("the new job is kept");
        assert!(jobs[kept..].iter().all(|job| *job == jobs[kept]), "{jobs:?}");
        // Until the new job is kept, the old one is over. It is not begun before its log is.
        let progress: Vec<_> = states.iter().map(stopped).collect();
        assert!(progress[..kept].iter().all(Option::is_none), "{progress:?}");
        let mut next = 0;
        for (state, progress) in states.iter().zip(&progress).skip(kept) {
            match *progress {
                Some((done, found)) => {
                    assert!(found == all && (done == next || done == next + 1), "{state:?}");
                    assert!(self.new.only_ink || done >= next);
                    next = done;
                }
                None => assert!(next == 0 || next + 1 == all, "{next} of {all}: {state:?}"),
            }
        }
        let last = progress.last().expect("states");
        assert!(last.is_none() && next + 1 == all, "{progress:?}");
        assert!(operations.len() > 4 + all, "{}", operations.len());
    }

    fn complete(&mut self, board: &mut RecordedPico, shown: &Shown, drawn: Run) -> Result<bool> {
        let has_stopped = stopped(shown).is_some();
        board.order([if has_stopped { "$resume=origin" } else { "$again" }])?;
        board.finish()?;
        let rest = board.drawn()?;
        if !has_stopped {
            let is_over = !drawn.is_empty();
            assert!(!is_over || ink(&drawn) == ink(&self.new.whole), "the ink differs");
            let whole = [&self.old, &self.new].into_iter().find(|job| same(job, &rest));
            assert!(whole.is_some(), "neither the old job nor the new one is drawn again");
            return Ok(true);
        }
        let runs = [drawn, rest];
        if self.new.only_ink {
            assert_eq!(ink(runs.iter().flatten()), ink(&self.new.whole), "the ink differs");
        } else {
            let twice = assert_one_drawing(&self.new.whole, &runs);
            assert!(twice <= 1, "{twice} strokes are drawn twice");
        }
        Ok(true)
    }
}

/// A drawing that is sent stroke by stroke.
pub struct SentDrawing {
    /// It, on the computer that sends it.
    pub drawing: StreamedDrawing,
    /// Its strokes.
    pub whole: Run,
}

impl SentDrawing {
    /// The lines from stroke number `from` on.
    pub fn lines(&mut self, from: u32) -> Vec<String> {
        self.drawing.rest(from, 0).in_order().map(|line| line.sent).collect()
    }
}

/// The second and third number of `[STOPPED:id,drawn,all,lost,points]`, if that was answered.
fn sent(shown: &Shown) -> Option<(usize, usize)> {
    let numbers = shown.iter().find_map(|line| line.strip_prefix("[STOPPED:"))?;
    let mut numbers = numbers.trim_end_matches(']').split(',').skip(1);
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

impl Scenario for SentDrawing {
    fn questions(&self) -> &[&str] {
        &["$stream"]
    }

    fn judge(&self, operations: &[FlashOperation], states: &[Shown]) {
        let all = self.whole.len();
        let progress: Vec<_> = states.iter().map(sent).collect();
        let begins = progress.iter().position(Option::is_some).expect("it begins");
        let last = progress.len() - 1;
        assert!(progress[0].is_none() && progress[last].is_none(), "{progress:?}");
        for (at, progress) in progress.iter().enumerate().skip(begins).take(last - begins) {
            let (done, found) = progress.expect("it has not ended");
            assert_eq!(stopped(&states[at]), Some((done, found)));
            // Each operation behind the beginning is a stroke.
            assert_eq!((done, found), (at - begins, all), "{:?}", states[at]);
        }
        assert_eq!(last - begins, all, "{operations:?}");
    }

    fn complete(&mut self, board: &mut RecordedPico, shown: &Shown, drawn: Run) -> Result<bool> {
        let Some((done, _)) = stopped(shown) else {
            let is_whole = drawn.is_empty() || ink(&drawn) == ink(&self.whole);
            assert!(is_whole, "there is more to draw: {shown:?}, {drawn:?}, {:?}", self.whole);
            return Ok(false);
        };
        board.order(["$resume=origin"])?;
        let lines = self.lines(done as u32);
        board.order(lines.iter().map(String::as_str))?;
        board.finish()?;
        let twice = assert_one_drawing(&self.whole, &[drawn, board.drawn()?]);
        assert!(twice <= 1, "{twice} strokes are drawn twice");
        Ok(true)
    }
}

/// A model in flash that is removed, and another one that is uploaded and drawn.
pub struct UploadedModel {
    /// The number of vertices of each.
    pub vertices: [usize; 2],
    /// What is sent before `$plot`, once a model is there.
    pub options: Vec<String>,
    /// The drawings of both.
    pub jobs: [Job; 2],
}

impl UploadedModel {
    /// The number of vertices of the model in flash; 0 if there is none.
    fn vertices(shown: &Shown) -> Option<usize> {
        let line = shown.iter().find_map(|line| line.strip_prefix("[FLASH:"))?;
        let Some(line) = line.strip_prefix("vertices ") else { return Some(0) };
        line.split(',').next()?.parse().ok()
    }
}

impl Scenario for UploadedModel {
    fn questions(&self) -> &[&str] {
        &["$model"]
    }

    fn judge(&self, operations: &[FlashOperation], states: &[Shown]) {
        let [old, new] = self.vertices;
        let mut found: Vec<usize> =
            states.iter().map(|state| Self::vertices(state).expect("a number")).collect();
        found.dedup();
        assert_eq!(found, [old, 0, new]);
        assert!(operations.len() > 150, "{}", operations.len());
    }

    fn outcome(&self, _: u32, shown: &Shown) -> (u32, Shown) {
        (0, shown.clone())
    }

    fn complete(&mut self, board: &mut RecordedPico, shown: &Shown, _: Run) -> Result<bool> {
        let found = Self::vertices(shown).ok_or("no model")?;
        let Some(which) = self.vertices.iter().position(|vertices| *vertices == found) else {
            let answer = board.ask("$plot")?;
            assert!(answer.last().is_some_and(|last| last.starts_with("error:")), "{answer:?}");
            return Ok(false);
        };
        board.order(self.options.iter().map(String::as_str))?;
        board.order(["$plot"])?;
        board.finish()?;
        let drawn = board.drawn()?;
        assert!(same(&self.jobs[which], &drawn), "the ink differs");
        Ok(true)
    }
}

/// Whether the ink of strokes is that of a job.
pub(super) fn same(job: &Job, strokes: &[Vec<Point>]) -> bool {
    ink(strokes) == ink(&job.whole)
}
