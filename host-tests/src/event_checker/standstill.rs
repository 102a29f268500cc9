//! How long a pen stands still on the paper.

use penup::boards::host::{Change, Stamped};
use penup::machine::{Setting, Settings};
use penup::motion::TICKS_PER_SECOND;

/// A pause between two pulses of a stroke counts as standing from so many milliseconds on. A
/// machine that passes a corner slowly is faster, and so is one that begins a stroke, from its
/// first step to the next, with a jerk of 20 m/s³.
const PAUSE: f64 = 6.0;

/// For how long the pen stands still on the paper in one stroke, in ms: from pulse to pulse, so
/// half a step of braking and half a step of starting are in it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Standstill {
    /// Where the stroke begins.
    pub begin: f64,
    /// Within the stroke, in its corners.
    pub corners: f64,
    /// Where it ends.
    pub end: f64,
    /// How many steps of travels the pen made on the paper, before and behind the stroke.
    pub dragged: usize,
}

impl Standstill {
    /// All of it.
    pub fn sum(&self) -> f64 {
        self.begin + self.corners + self.end
    }
}

/// Where the pen is.
#[derive(Clone, Copy)]
enum Pen {
    /// It is on its way down: on the paper from the first time on, and ready from the second.
    Down(u64, u64),
    /// It draws.
    Ready,
    /// It is on its way up: off the paper from this time on.
    Up(u64),
}

/// Follows a pen whose height changes evenly for as long as its dwell says (`$212`, `$213`), and
/// that is on the paper for the part `contact` of its way which is next to it: 0 for a pen that is
/// there only when it has arrived. There must be no ramp (`$207`).
pub fn standstill(trace: &[Stamped], settings: &Settings, contact: f64) -> Vec<Standstill> {
    let dwell = |setting| f64::from(settings.milliseconds_as_ticks(setting));
    let (down, up) = (dwell(Setting::PenDownDwell), dwell(Setting::PenUpDwell));
    let milliseconds =
        |from: u64, to: u64| to.saturating_sub(from) as f64 * 1000.0 / f64::from(TICKS_PER_SECOND);
    let mut strokes = Vec::<Standstill>::new();
    let (mut height, mut pen, mut last) = (0, Pen::Up(0), 0);
    let (mut is_drawn, mut dragged) = (false, 0);
    for &Stamped { time, change } in trace {
        match change {
            Change::Pen(next) if next > height => {
                let on_paper = time + (down * (1.0 - contact)) as u64;
                (height, pen) = (next, Pen::Down(on_paper, time + down as u64));
            }
            Change::Pen(next) => {
                (height, pen) = (next, Pen::Up(time + (up * contact) as u64));
            }
            Change::StepX(true) | Change::StepY(true) => {
                match pen {
                    Pen::Down(on_paper, ready) if time >= ready => {
                        let begin = milliseconds(last.max(on_paper), time);
                        let dragged = std::mem::take(&mut dragged);
                        strokes.push(Standstill { begin, dragged, ..Standstill::default() });
                        (pen, is_drawn) = (Pen::Ready, true);
                    }
                    Pen::Down(on_paper, _) => dragged += usize::from(time >= on_paper),
                    Pen::Ready => {
                        let pause = milliseconds(last, time);
                        if let Some(stroke) = strokes.last_mut().filter(|_| pause >= PAUSE) {
                            stroke.corners += pause;
                        }
                    }
                    Pen::Up(off_paper) => {
                        if let Some(stroke) = strokes.last_mut() {
                            if std::mem::take(&mut is_drawn) {
                                stroke.end = milliseconds(last, time.min(off_paper));
                            }
                            stroke.dragged += usize::from(time < off_paper);
                        }
                    }
                }
                last = time;
            }
            _ => {}
        }
    }
    strokes
}
