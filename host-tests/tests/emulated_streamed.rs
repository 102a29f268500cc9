//! Sends drawings that this computer has computed to emulated boards, stroke by stroke, and
//! compares their pins with the preview.
#![cfg(feature = "emulator")]

use penup::board_table::{BoardRow, LM3S6965, PICO};
use penup::machine::Settings;
use penup_client::machines::emulate;
use penup_client::plot::draw;
use penup_client::preview::InMemory;
use penup_client::progress::{Progress, Quiet};
use penup_client::sender::{Sender, Timeouts};
use penup_host_tests::whole_jobs::job_lines;
use penup_job::path::Run;
use penup_job::protocol::Status;
use penup_job::room::Room;
use penup_job::streamed::Form;
use penup_readers::lines::JobLine;
use std::error::Error;
use std::sync::atomic::AtomicBool;

/// Notes the greatest counts of strokes that are reported.
#[derive(Default)]
struct Strokes((u64, u64));

impl Progress for Strokes {
    fn lines_sent(&mut self, _: usize, _: usize) {}
    fn drawn(&mut self, status: &Status) {
        self.0 = status.strokes.map_or(self.0, |strokes| self.0.max(strokes));
    }
    fn state(&mut self, _: &str) {}
}

/// The points of what is drawn, each run from where the pen goes down.
fn inked(runs: Vec<Run>) -> Vec<(u8, Vec<[f64; 2]>)> {
    let drawn = runs.into_iter().filter(|run| run.pen_down && run.points.len() > 1);
    drawn.map(|run| (run.pen, run.points)).collect()
}

/// Draws a scene by `board` from strokes in this `form`, and compares the ink with the preview's.
fn draws_as_previewed(board: &'static BoardRow, form: Form) -> Result<(), Box<dyn Error>> {
    let options = ["$page=40x40", "$margin=5", "$hidden=pen,2"];
    let mut lines = job_lines("interpen.obj", &options);
    assert_eq!(lines.pop().as_deref(), Some("$plot"));
    let job: Vec<JobLine> = ["$clear".to_owned(), "$view=auto".to_owned()]
        .into_iter()
        .chain(lines)
        .map(JobLine::command)
        .collect();
    let interrupt = AtomicBool::new(false);
    let mut preview = InMemory::<u32>::new(Room::for_job(&job), Settings::default());
    draw(&mut preview, &job, Timeouts::simulated(), &interrupt, &mut Quiet)?;
    let previewed = inked(preview.drawn().runs);
    let mut host = InMemory::<u32>::new(Room::for_job(&job), Settings::default());
    assert!(host.take(&job));
    let (streamed, _) = host.streamed(form, 0)?;
    let mut emulated = emulate(board)?;
    let mut strokes = Strokes::default();
    let mut sender = Sender::open(emulated.as_mut(), Timeouts::default(), &interrupt)?;
    assert_eq!(sender.form(&Settings::default())?, form);
    sender.draw_streamed(&streamed, &mut strokes)?;
    sender.end();
    assert_eq!(inked(emulated.pen_runs()?), previewed);
    let all = u64::from(streamed.size().strokes);
    // What is still planned when the last line of G-code is taken is not told.
    let done = if form == Form::Strokes { all } else { strokes.0.0 };
    assert_eq!(strokes.0, (done, all));
    Ok(())
}

#[test]
fn the_pico_draws_strokes_as_they_come() -> Result<(), Box<dyn Error>> {
    draws_as_previewed(&PICO, Form::Strokes)
}

#[test]
fn the_lm3s6965_draws_them_as_gcode() -> Result<(), Box<dyn Error>> {
    draws_as_previewed(&LM3S6965, Form::GCode)
}
