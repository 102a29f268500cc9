//! The pens of a program: what penup's own G-code says of them, or else its tools.
//!
//! penup writes `(pen 2)` where another pen begins. In other programs each tool is a pen, in the
//! order in which they first draw: that which `M6` has put in, or else, in a program without `M6`,
//! that of the last `T`. A pause alone, as for a pen that is changed by hand, is told.

use super::moves::Moves;
use super::signals::Inked;
use crate::counted;
use crate::plan::{MOST_PENS, Plan};
use std::collections::HashMap;

/// What has chosen the pen so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Choice {
    /// The pen in a comment of penup.
    named: Option<u32>,
    /// The tool of the last `T`.
    called: Option<i32>,
    /// The tool that the last `M6` has put in.
    held: Option<i32>,
}

/// How the whole program changes its pens.
#[derive(Debug, Default)]
pub(super) struct Changes {
    has_m6: bool,
    /// The lines of pauses, and of changes to a tool that is not told.
    pauses: Vec<usize>,
}

impl Changes {
    /// Counts a pause.
    pub fn pause(&mut self, line: usize) {
        self.pauses.push(line);
    }

    /// Carries out `M6`.
    pub fn put_in(&mut self, choice: &mut Choice, line: usize) {
        self.has_m6 = true;
        choice.held = choice.called;
        if choice.called.is_none() {
            self.pause(line);
        }
    }

    /// Draws the moves that draw, those of one pen that follow each other as one stroke, and dots
    /// where the pen is put down without a move. Says what the user should know of the pens.
    pub fn draw(&self, moves: &Moves, inked: Inked, text: &str, plan: &mut Plan) -> Vec<String> {
        let is_named = moves.iter().any(|it| it.signals.choice.named.is_some());
        let mut tools: HashMap<Option<i32>, u32> = HashMap::new();
        let mut pen = |choice: Choice| {
            if is_named {
                return choice.named.unwrap_or(1);
            }
            let next = u32::try_from(tools.len() + 1).unwrap_or(u32::MAX);
            let tool = if self.has_m6 { choice.held } else { choice.called };
            *tools.entry(tool).or_insert(next)
        };
        let mut touches = moves.touches().zip(inked.dots).peekable();
        let mut moved = (0..).zip(moves.iter().zip(inked.draws)).peekable();
        let mut is_down = false;
        let drawn = std::iter::from_fn(|| {
            let next = moved.peek().map_or(usize::MAX, |(number, _)| *number);
            let touch = touches.next_if(|((after, _), _)| *after <= next);
            let (it, draws) = match touch {
                Some(((_, touch), draws)) => (touch, draws),
                None => moved.next()?.1,
            };
            // At the end of a stroke a touch adds nothing.
            let is_new = draws && !(is_down && touch.is_some());
            is_down = draws;
            Some((it, is_new))
        });
        let drawn = drawn.filter(|(_, draws)| *draws);
        let mut pairs = drawn.map(|(it, _)| (it, pen(it.signals.choice))).peekable();
        let mut lines = (1..).zip(text.lines());
        // The lines of the first stroke and of the last.
        let mut inked: Option<[u32; 2]> = None;
        while let Some((first, pen)) = pairs.next() {
            let mut points = first.points.to_vec();
            while let Some((next, _)) =
                pairs.next_if(|(it, own)| *own == pen && points.last() == it.points.first())
            {
                points.extend(next.points.iter().skip(1));
            }
            let line = lines.find(|(number, _)| *number == first.line);
            plan.begin(first.line as usize, line.map_or("", |(_, text)| text));
            let pen = pen.min(MOST_PENS);
            match points[..] {
                [dot] => plan.draw_dot(dot, None, pen, pen),
                _ => plan.draw(points, None, pen),
            }
            inked = Some([inked.map_or(first.line, |[begin, _]| begin), first.line]);
        }
        drop(pairs);
        let tools = tools.len();
        let mut notes = Vec::new();
        if tools > MOST_PENS as usize {
            notes.push(format!(
                "the program draws with {tools} tools, and a plotter has {MOST_PENS} pens: pen \
                 {MOST_PENS} draws what the last of them do"
            ));
        }
        let is_between = |line: &&usize| {
            inked.is_some_and(|[first, last]| (first as usize..last as usize).contains(*line))
        };
        let mut pauses = self.pauses.iter().filter(is_between);
        let has_one_pen = plan.strokes.windows(2).all(|pair| pair[0].pen == pair[1].pen);
        if let Some(first) = pauses.next().filter(|_| has_one_pen) {
            let pauses = counted(pauses.count() + 1, ["pause is", "pauses are"]);
            notes.push(format!(
                "{pauses} not followed (from line {first} on): if the pen is changed there, draw \
                 the parts of the program as files of their own"
            ));
        }
        notes
    }
}

impl Choice {
    /// Follows a comment, if it is one of penup's.
    pub fn follow(&mut self, text: &str) {
        let number = || text.trim().strip_prefix("(pen ")?.strip_suffix(')')?.parse().ok();
        self.named = number().filter(|pen| (1..=MOST_PENS).contains(pen)).or(self.named);
    }

    /// Calls a tool, unless it is one that a command beside it means, such as the temperature of
    /// an extruder.
    pub fn call(&mut self, words: &[(char, f64)]) {
        let is_beside = |(letter, code): &(char, f64)| *letter == 'M' && *code >= 10.0;
        let tool = words.iter().find(|(letter, _)| *letter == 'T').map(|(_, tool)| *tool as i32);
        self.called = tool.filter(|_| !words.iter().any(is_beside)).or(self.called);
    }
}
