//! Jobs of which a part has to be computed again after a loss of power: with early ink the order of
//! the strokes, as long as it is not kept, and of a drawing in parts its strokes.

use super::scenarios::{same, stopped};
use super::{RecordedPico, Result, Scenario, Shown};
use crate::cut_jobs::{assert_one_drawing, ink};
use crate::pico_cuts::{Job, Run};
use penup_client::emulator::FlashOperation;

/// A job of which not all is kept before the pen moves. It is kept in place of a drawing that was
/// sent while it was drawn, which `$again` does not draw.
pub struct ComputedAgain {
    /// The job.
    pub job: Job,
    /// What is not kept of it.
    pub missing: Missing,
}

/// What is not kept of a job before the pen moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// The order of the strokes, which is added once it is known.
    Order,
    /// The strokes, which are never kept: they are computed from a model in flash.
    Strokes,
}

/// The beginning of the answer to `$again` as long as the last job is the one that was sent.
const WAS_SENT: &str = "[MSG:the last job was sent while it was drawn";

impl ComputedAgain {
    /// Whether a board that shows this keeps the new job.
    fn is_kept(&self, shown: &Shown) -> bool {
        let refused = match self.missing {
            Missing::Order => "error:162",
            Missing::Strokes => "error:167",
        };
        let is_new = shown.last().is_some_and(|last| last == refused);
        let is_old = shown.iter().any(|line| line.starts_with(WAS_SENT));
        assert!(is_new != is_old, "it is one of the jobs: {shown:?}");
        is_new
    }

    /// Checks how many strokes there are said to be while the job is drawn. `progress` has how
    /// many of them are drawn, too.
    fn judge_totals(&self, progress: &[(usize, usize)]) {
        let all = self.job.whole.len();
        let (next, _) = *progress.last().expect("it begins");
        match self.missing {
            Missing::Order => {
                assert_eq!(next + 1, all, "{progress:?}");
                // Until the order is kept there is an estimate.
                let (_, estimate) = progress[0];
                assert_ne!(estimate, all, "nothing would show when the order is kept");
                let ordered = progress.iter().position(|(_, found)| *found == all);
                let ordered = ordered.expect("the order becomes known");
                let (done, _) = progress[ordered];
                assert!(done > 0 && done == progress[ordered - 1].0, "{progress:?}");
                let (before, behind) = progress.split_at(ordered);
                assert!(before.iter().all(|(_, found)| *found == estimate), "{progress:?}");
                assert!(behind.iter().all(|(_, found)| *found == all), "{progress:?}");
            }
            Missing::Strokes => {
                // Nobody knows how many there are. That these were all may be noted later.
                assert!(next == all || next + 1 == all, "{next} of {all}");
                assert!(progress.iter().all(|(_, found)| *found == 0), "{progress:?}");
            }
        }
    }

    /// Draws the job that is kept from its beginning. Returns whether there is one.
    fn draw_again(&self, board: &mut RecordedPico) -> Result<bool> {
        let answer = board.ask("$again")?;
        if answer.iter().any(|line| line.starts_with(WAS_SENT)) {
            return Ok(false);
        }
        if answer.last().is_none_or(|last| last != "ok") {
            return Err(format!("$again: {answer:?}").into());
        }
        board.finish()?;
        assert!(same(&self.job, &board.drawn()?), "another job is drawn again");
        Ok(true)
    }
}

impl Scenario for ComputedAgain {
    fn questions(&self) -> &[&str] {
        // What would draw the new job again is refused before anything is computed: it is counted
        // in other steps, or its model is missing.
        match self.missing {
            Missing::Order => &["$100=81", "$again"],
            Missing::Strokes => &["$clear", "$again"],
        }
    }

    fn judge(&self, _: &[FlashOperation], states: &[Shown]) {
        let is_kept: Vec<bool> = states.iter().map(|state| self.is_kept(state)).collect();
        let kept = is_kept.iter().position(|is_kept| *is_kept).expect("the new job is kept");
        assert!(kept > 0 && is_kept[kept..].iter().all(|is_kept| *is_kept), "{is_kept:?}");
        let progress: Vec<_> = states.iter().map(stopped).collect();
        // The job is not begun before its log is.
        let begins = progress.iter().position(Option::is_some).expect("it begins");
        let ends = progress.iter().rposition(Option::is_some).expect("it begins");
        assert!(begins > kept && ends + 1 < progress.len(), "{progress:?}");
        let known: Vec<_> = progress[begins..=ends].iter().copied().flatten().collect();
        assert_eq!(known.len(), ends + 1 - begins, "it goes on until it ends: {progress:?}");
        assert_eq!(known[0].0, 0);
        assert!(known.windows(2).all(|pair| pair[1].0 - pair[0].0 <= 1), "{known:?}");
        self.judge_totals(&known);
    }

    fn outcome(&self, done: u32, shown: &Shown) -> (u32, Shown) {
        /// Of a job of many strokes, one in so many is completed.
        const STROKES: usize = 8;
        match (self.missing, stopped(shown)) {
            (Missing::Order, Some((drawn, all))) => {
                let class = format!("{} of {all}", drawn.div_ceil(STROKES));
                (0, vec![class])
            }
            _ => (done, shown.clone()),
        }
    }

    fn complete(&mut self, board: &mut RecordedPico, shown: &Shown, drawn: Run) -> Result<bool> {
        if stopped(shown).is_none() {
            let is_over = drawn.is_empty() || ink(&drawn) == ink(&self.job.whole);
            assert!(is_over, "there is more to draw: {shown:?}");
            let is_kept = self.draw_again(board)?;
            assert!(is_kept || drawn.is_empty(), "the job that was drawn is lost");
            return Ok(is_kept);
        }
        board.order(["$resume=origin"])?;
        board.finish()?;
        let twice = assert_one_drawing(&self.job.whole, &[drawn, board.drawn()?]);
        assert!(twice <= 1, "{twice} strokes are drawn twice");
        let answer = board.ask("$resume")?;
        assert!(answer.last().is_some_and(|last| last == "error:163"), "{answer:?}");
        // A job with few strokes is drawn once more behind its rest, from the origin.
        if self.missing == Missing::Strokes {
            board.restart()?;
            assert!(self.draw_again(board)?, "the job is lost behind its rest");
        }
        Ok(true)
    }
}
