//! Harrison's tape: a job encoded as instructions of four bits, two to a byte.

use crate::motion_plot::plan;
use penup::drawing::PagePoint;
use penup::machine::{MachineError, Path, Settings};
use penup::motion::{EventQueue, StepEvent};
use penup::step::tape::{BadCode, Decoder, Instruction, TapeLines, encode};
use penup_job::path::Run;
use penup_job::picture::Picture;
use penup_job::straight::{TOLERANCE, straightened};
use penup_readers::page::Page;
use std::fmt::Write as _;

/// An event queue that records the instructions of a tape.
#[derive(Default)]
struct Recorder(Vec<Instruction>);

impl EventQueue for Recorder {
    fn room(&self) -> usize {
        usize::MAX
    }
    fn push(&mut self, event: StepEvent) -> Result<(), StepEvent> {
        self.0.extend(event.instruction());
        Ok(())
    }
}

/// Records a job, which starts at the page's origin, as a tape.
///
/// # Errors
/// The machine refuses the job.
pub fn record(settings: Settings, path: &mut dyn Path) -> Result<Vec<u8>, MachineError> {
    let mut recorder = Recorder::default();
    plan(settings, path, &mut recorder)?;
    Ok(encode(recorder.0).collect())
}

/// Decodes a tape into text, with one line for each run of equal instructions.
///
/// # Errors
/// The tape contains an invalid code; the error says where.
///
/// ```
/// let text = penup_client::tape::decode(&[0xA0, 0x00, 0x33, 0x23, 0xB0, 0x00])?;
/// assert_eq!(text, "pen down\nright 2\nup right\nright\n");
/// # Ok::<(), penup::step::tape::BadCode>(())
/// ```
pub fn decode(tape: &[u8]) -> Result<String, BadCode> {
    let instructions = instructions(tape)?;
    let mut text = String::new();
    for run in instructions.chunk_by(|a, b| a == b) {
        let name = match run[0] {
            Instruction::Nothing => "nothing".to_owned(),
            Instruction::PenUp => "pen up".to_owned(),
            Instruction::PenDown => "pen down".to_owned(),
            Instruction::Stop => "stop".to_owned(),
            Instruction::Move(direction) => words(&format!("{direction:?}")),
        };
        // Writing to a string cannot fail.
        let _ = match run.len() {
            1 => writeln!(text, "{name}"),
            count => writeln!(text, "{name} {count}"),
        };
    }
    Ok(text)
}

/// Returns the picture that a tape draws from the page's origin, and the number of its moves.
///
/// # Errors
/// The tape contains an invalid code; the error says where.
pub fn show(tape: &[u8], page: Page, steps_per_mm: f64) -> Result<(Picture, usize), BadCode> {
    let instructions = instructions(tape)?;
    let moves = instructions.iter().filter(|one| matches!(one, Instruction::Move(_))).count();
    let mm = |point: PagePoint| [point.x, point.y].map(|steps| f64::from(steps) / steps_per_mm);
    let mut at = PagePoint::default();
    let mut runs: Vec<Run> = Vec::new();
    for (end, pen_down) in TapeLines::new(at, instructions.into_iter()) {
        match runs.last_mut().filter(|run| run.pen_down == pen_down) {
            Some(run) => run.points.push(mm(end)),
            None => runs.push(Run { pen_down, pen: 1, points: vec![mm(at), mm(end)] }),
        }
        at = end;
    }
    for run in &mut runs {
        run.points = straightened(&run.points, TOLERANCE / steps_per_mm);
    }
    Ok((Picture { page, runs }, moves))
}

fn instructions(tape: &[u8]) -> Result<Vec<Instruction>, BadCode> {
    let mut decoder = Decoder::new(tape.iter().copied());
    let instructions = decoder.by_ref().collect();
    decoder.damage().map_or(Ok(instructions), Err)
}

/// Converts a name such as `UpRight` into `up right`.
fn words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_ascii_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.push(letter.to_ascii_lowercase());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use penup::drawing::LineType;
    use penup::machine::{Target, TargetList};

    #[test]
    fn what_is_recorded_is_shown() {
        let target = |x, y, inked: bool| Target {
            point: PagePoint { x, y },
            ink: inked.then_some(LineType::Full),
        };
        let targets = [target(80, 0, false), target(160, 80, true), target(0, 0, false)];
        let tape = record(Settings::default(), &mut TargetList::new(&targets)).expect("fits");
        let page = Page { width: 10.0, height: 10.0 };
        let (picture, moves) = show(&tape, page, 80.0).expect("whole");
        assert_eq!(moves, 80 + 80 + 160);
        let inked: Vec<_> = picture.runs.iter().filter(|run| run.pen_down).collect();
        assert_eq!(inked.len(), 1);
        assert_eq!(inked[0].points.first(), Some(&[1.0, 0.0]));
        assert_eq!(inked[0].points.last(), Some(&[2.0, 1.0]));
        let text = decode(&tape).expect("whole");
        assert!(text.starts_with("right 80\npen down\nup right 80\npen up\n"), "{text}");
    }

    #[test]
    fn damage_is_reported() {
        let damaged = [0x33, 0xF3];
        assert_eq!(decode(&damaged), Err(BadCode { row: 1, code: 15 }));
    }
}
