//! A drawing that this computer has computed, as lines that a plotter draws while they come.
//!
//! The strokes are those that the same library computes on a board, in whole steps of the page.
//! They become lines of strokes (see `docs/protocol.md`), or lines of G-code for a plotter whose
//! firmware knows no others. Either way the lines are made once and lie in one text, which takes
//! some five bytes a point as strokes.

use penup::checksum::Crc32;
use penup::drawing::{LineType, PagePoint};
use penup::fixed::Decimal;
use penup::machine::{JobSize, Machine, MachineError, Path, PulserState, Settings};
use penup::motion::Block;
use penup::plotter::to_steps;
use penup::protocol::{StreamHeader, StreamedTarget, StrokeWriter};
use penup_readers::lines::{JobLine, Lines};
use std::fmt::Write as _;

/// The length after which a line of strokes ends. Two such lines with their numbers and checksums
/// fit in the receive window, so that one arrives while the other is carried out.
const LINE_BYTES: usize = 92;

/// The format in which strokes are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// As lines of strokes.
    Strokes,
    /// As G-code, a move in each line.
    GCode,
}

/// Why a drawing cannot be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamError {
    /// The machine refuses the drawing.
    Machine(MachineError),
    /// G-code has no dotted or dashed lines.
    LineType,
    /// The drawing has more targets than lines can be numbered.
    TooLong,
}

/// A drawing as lines, of which the first begins it.
#[derive(Debug)]
pub struct StreamedJob {
    /// The format in which the strokes are written.
    form: Form,
    /// All lines, one behind the other.
    text: String,
    /// Where each line begins.
    begins: Vec<LineBegin>,
    /// The lines of G-code behind which the machine waits for a pen.
    pen_lines: Vec<usize>,
    /// These pens, counted from 1.
    pens: Vec<u8>,
    /// The pen that is in at the beginning, counted from 1.
    first_pen: u8,
    /// The header that is sent before the strokes.
    header: StreamHeader,
    /// The number of lines after the first one that are not sent, because the plotter already has
    /// them.
    skipped: usize,
}

/// Where a line begins.
#[derive(Debug, Clone, Copy)]
struct LineBegin {
    /// Where in the text.
    at: usize,
    /// What came before the line.
    before: Counts,
}

/// A part of a drawing, counted.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    targets: u32,
    /// The strokes that have begun.
    strokes: u32,
    /// The pen of the last target, if it is down there.
    lowered: Option<u8>,
}

impl Counts {
    fn add(&mut self, StreamedTarget { target, pen }: &StreamedTarget) {
        let lowered = target.ink.map(|_| *pen);
        self.strokes += u32::from(lowered.is_some() && lowered != self.lowered);
        self.lowered = lowered;
        self.targets += 1;
    }
}

/// Reads a path and the pen of each of its targets.
fn for_each(path: &mut dyn Path, visit: &mut dyn FnMut(StreamedTarget)) {
    path.rewind();
    while let Some(target) = path.next_target() {
        visit(StreamedTarget { target, pen: path.pen() });
    }
    path.rewind();
}

impl StreamedJob {
    /// The lines by which a machine with these `settings` draws `path`.
    ///
    /// # Errors
    /// See [`StreamError`].
    pub fn new(settings: &Settings, path: &mut dyn Path, form: Form) -> Result<Self, StreamError> {
        let size = measure(settings, path).map_err(StreamError::Machine)?;
        let (least, greatest) = (PagePoint { x: i32::MAX, y: i32::MAX }, PagePoint { x: 0, y: 0 });
        let steps = settings.page_steps().map(|steps| steps.to_bits());
        let (id, targets, points) = (0, 0, 0);
        let mut header =
            StreamHeader { steps, id, targets, least, greatest, size, pens: 0, points };
        let mut pens = 0u32;
        for_each(path, &mut |StreamedTarget { target, pen }| {
            pens |= 1u32.checked_shl(pen.into()).unwrap_or(0);
            let PagePoint { x, y } = target.point;
            let StreamHeader { least, greatest, targets, .. } = &mut header;
            (least.x, least.y) = (least.x.min(x), least.y.min(y));
            (greatest.x, greatest.y) = (greatest.x.max(x), greatest.y.max(y));
            *targets = targets.saturating_add(1);
        });
        header.pens = pens.count_ones();
        if header.targets == 0 {
            header.least = header.greatest;
        }
        let (text, begins) = (String::new(), Vec::new());
        let (pen_lines, pens) = (Vec::new(), Vec::new());
        let (first_pen, skipped) = (1, 0);
        let mut job = Self { form, text, begins, pen_lines, pens, first_pen, header, skipped };
        match form {
            Form::Strokes => job.write_strokes(path),
            Form::GCode => job.write_gcode(settings, path)?,
        }
        // Lines are numbered by an i32 of at most nine digits.
        if job.begins.len() > 999_999_000 {
            return Err(StreamError::TooLong);
        }
        Ok(job)
    }

    fn push_line(&mut self, line: &str, before: Counts) {
        self.begins.push(LineBegin { at: self.text.len(), before });
        self.text.push_str(line);
    }

    fn write_strokes(&mut self, path: &mut dyn Path) {
        let (mut writer, mut count) = (StrokeWriter::default(), Counts::default());
        let mut before = count;
        for_each(path, &mut |target| {
            count.add(&target);
            writer.push(target);
            if writer.bytes() >= LINE_BYTES {
                self.push_line(&writer.end_line(), before);
                before = count;
            }
        });
        if before.targets < count.targets {
            self.push_line(&writer.end_line(), before);
        }
        // The number does not depend on where the pen is when it begins.
        let mut sum = Crc32::new();
        sum.update(self.text.as_bytes());
        self.header.steps.iter().for_each(|steps| sum.update(&steps.to_le_bytes()));
        self.header.id = sum.finalize();
        let header = self.header.line();
        // The first line is the header.
        self.text.insert_str(0, &header);
        self.begins.iter_mut().for_each(|begin| begin.at += header.len());
        self.begins.insert(0, LineBegin { at: 0, before: Counts::default() });
    }

    fn write_gcode(&mut self, settings: &Settings, path: &mut dyn Path) -> Result<(), StreamError> {
        let steps = settings.page_steps();
        let mut failure = None;
        let (mut pen, mut motion, mut count) = (None, "", Counts::default());
        // The modes are set to millimetres, absolute positions, speeds in mm/min and the usual
        // plane, whatever an earlier program has left.
        self.push_line("G21G90G94G17", count);
        for_each(path, &mut |streamed| {
            let StreamedTarget { target, pen: number } = streamed;
            if pen.is_some_and(|pen| pen != number) {
                self.push_line(&format!("T{}M6", number + 1), count);
                self.pen_lines.push(self.begins.len() - 1);
                self.pens.push(number + 1);
            }
            if pen.is_none() {
                self.first_pen = number + 1;
            }
            pen = Some(number);
            match target.ink {
                None | Some(LineType::Full) => {}
                Some(_) => failure = Some(StreamError::LineType),
            }
            // A plotter that waits for a second takes the program to be at its end, and G1 would
            // then draw nothing if it came alone without M3.
            let next = if target.ink.is_some() { "G1M3" } else { "G0M5" };
            // Each block is in the machine's own coordinates, whatever coordinate system is chosen.
            let mut line = String::from("G53");
            if next != motion {
                line += next;
                motion = next;
            }
            let [x, y] = steps;
            for (letter, step, steps) in [('X', target.point.x, x), ('Y', target.point.y, y)] {
                line.push(letter);
                let exact = f64::from(step) / steps.to_num::<f64>();
                let written = (0..8).map(|decimals| format!("{exact:.decimals$}")).find(|text| {
                    let read = Decimal::parse(text).ok().and_then(|mm| mm.to_millimetres().ok());
                    read.is_some_and(|mm| to_steps(mm, steps) == step)
                });
                // Steps are no finer than 1/4000 mm, so five decimals suffice to name each of them.
                let _ = write!(line, "{}", written.unwrap_or_else(|| format!("{exact:.6}")));
            }
            self.push_line(&line, count);
            count.add(&streamed);
        });
        self.push_line("M2", count);
        failure.map_or(Ok(()), Err)
    }

    /// The format in which the strokes are written.
    pub fn form(&self) -> Form {
        self.form
    }

    /// The strokes, lengths and time of the whole drawing.
    pub fn size(&self) -> JobSize {
        self.header.size
    }

    /// The number by which a plotter knows the drawing again.
    pub fn id(&self) -> u32 {
        self.header.id
    }

    /// Tells the plotter that these are the rest of the drawing `whole`, and that it begins behind
    /// so many points within strokes at which the machine has rested. G-code does not say that.
    pub fn set_rest_of(&mut self, whole: &Self, points: u32) {
        let (Form::Strokes, Some(&LineBegin { at: end, .. })) = (self.form, self.begins.get(1))
        else {
            return;
        };
        let StreamHeader { id, pens, .. } = whole.header;
        self.header = StreamHeader { id, pens, points, ..self.header };
        let header = self.header.line();
        self.text.replace_range(..end, &header);
        for begin in self.begins.iter_mut().skip(1) {
            begin.at = begin.at + header.len() - end;
        }
    }

    /// Has the machine wait for the first pen, because another one is in. Strokes name their pens,
    /// so this is needed for G-code only, and only if there are several pens.
    pub fn ask_for_first_pen(&mut self) {
        let Some(begin) = self.begins.get(1).copied().filter(|_| !self.pens.is_empty()) else {
            return;
        };
        let change = format!("T{}M6", self.first_pen);
        self.text.insert_str(begin.at, &change);
        self.begins.iter_mut().skip(1).for_each(|begin| begin.at += change.len());
        self.begins.insert(1, begin);
        self.pen_lines.iter_mut().for_each(|line| *line += 1);
        self.pen_lines.insert(0, 1);
        self.pens.insert(0, self.first_pen);
    }

    /// The number of targets: of points, those to which the pen moves without drawing among them.
    pub fn targets(&self) -> u32 {
        self.header.targets
    }

    /// The number of bytes of all lines, without numbers and checksums.
    pub fn bytes(&self) -> usize {
        self.text.len()
    }

    /// The pens, counted from 1, that the machine waits for behind the first `lines` lines of
    /// G-code.
    pub fn pens_in_lines(&self, lines: usize) -> &[u8] {
        let count = self.pen_lines.partition_point(|line| *line < lines);
        self.pens.get(..count).unwrap_or_default()
    }

    /// Returns the share of the targets of the drawing that the first `lines` lines contain, 0 to
    /// 1.
    pub fn share(&self, lines: usize) -> f64 {
        let begin = self.begins.get(lines + self.skipped);
        let targets = begin.map_or(self.targets(), |begin| begin.before.targets);
        f64::from(targets) / f64::from(self.targets().max(1))
    }

    /// Returns the number of strokes of which the first `lines` lines contain a part.
    pub fn strokes_begun(&self, lines: usize) -> u32 {
        let begin = self.begins.get(lines + self.skipped);
        begin.map_or(self.header.size.strokes, |begin| begin.before.strokes)
    }

    /// Leaves out the header and the lines with the first `targets` targets, which the plotter has.
    /// Returns whether these are whole lines.
    #[must_use]
    pub fn skip(&mut self, targets: u32) -> bool {
        if self.form != Form::Strokes {
            return false;
        }
        let is_all = targets == self.targets();
        // The header has no targets either.
        let found = self.begins.iter().skip(1).position(|begin| begin.before.targets == targets);
        match found {
            Some(line) => self.skipped = line + 1,
            None if is_all => self.skipped = self.begins.len(),
            None => return false,
        }
        true
    }
}

impl Lines for StreamedJob {
    fn count(&self) -> usize {
        self.begins.len() - self.skipped
    }

    fn line(&self, index: usize) -> Option<JobLine> {
        let index = index.checked_add(self.skipped)?;
        let begin = self.begins.get(index)?.at;
        let end = self.begins.get(index + 1).map_or(self.text.len(), |next| next.at);
        self.text.get(begin..end).map(JobLine::command)
    }
}

/// Measures a path that begins at the origin of the page, and checks all of its targets.
fn measure(settings: &Settings, path: &mut dyn Path) -> Result<JobSize, MachineError> {
    let (pins, mut blocks) = (PulserState::new(), [Block::EMPTY; 4]);
    let mut machine = Machine::new(*settings, &mut blocks, &pins, u32::MAX);
    // A machine that must be homed first is measured all the same.
    let _ = machine.unlock();
    machine.start(path)
}
