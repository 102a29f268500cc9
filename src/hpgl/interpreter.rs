//! The instructions of HP-GL, and the actions that come of them.

use super::coordinates::{Frame, Point, Rectangle, UNIT};
use super::encoded::Polyline;
use super::label::TextStyle;
use super::line_type::{DashPart, LineStyle, PatternLength, Stroke};
use super::number::Number;
use super::outline::ArcStep;
use super::parser::Mode;
use super::polygon::{FillStyle, Hatch, Polygon, PolygonBuffer, VERTICES, Vertex};
use crate::drawing::LetterStrokes;
use heapless::Deque;

/// The longest answer, in bytes.
pub const ANSWER_BYTES: usize = 64;

/// An answer, without its terminator.
pub type Answer = heapless::String<ANSWER_BYTES, u8>;

/// The most steps that one byte can cause.
const STEPS: usize = 8;

/// The actions that the interpreter asks of its owner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// There is nothing to do.
    Nothing,
    /// The interpreter is to be initialized, with the pen where it is.
    Initialize,
    /// A line is drawn. The pen first goes to its beginning if it is elsewhere.
    Line([Point; 2]),
    /// A dot is drawn.
    Dot(Point),
    /// The pen goes there without drawing.
    Go(Point),
    /// The pen with this number is needed, from 1; 0 puts the pen away.
    Pen(u8),
    /// The next sheet of paper is needed for what follows.
    Sheet,
    /// An answer is sent.
    Answer(Answer),
}

/// A part of what a byte asks for.
#[derive(Debug, Clone)]
pub(super) enum Step {
    Initialize,
    /// A line to a position.
    Line(Point),
    /// A move to a position with the pen up.
    Travel(Point),
    /// The pen counts as being at a position, to which it goes before it next draws.
    Place(Point),
    /// A dot where the pen is.
    Dot,
    Arc(ArcStep),
    /// The lines that fill the polygon.
    Fill,
    /// The edges of the polygon.
    Edges,
    /// A letter whose lower left corner, or whose middle if it is a symbol, is where the pen is.
    Letter(LetterStrokes, bool),
    Pen(u8),
    Answer(Answer),
}

/// The errors that `OE` tells by their number: those of the HP 7475A, and 7 of the HP 7550A.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorNumber {
    /// The instruction is not known.
    Unknown = 1,
    /// The number of parameters is wrong.
    WrongCount = 2,
    /// A parameter is out of its range.
    BadParameter = 3,
    /// The character set is not known.
    UnknownSet = 5,
    /// The position is beyond the range of coordinates.
    Overflow = 6,
    /// The polygon has more points than fit into its buffer.
    BufferOverflow = 7,
    /// Something was to be drawn while the machine was locked.
    Locked = 8,
}

impl ErrorNumber {
    /// All errors.
    const ALL: [Self; 7] = [
        Self::Unknown,
        Self::WrongCount,
        Self::BadParameter,
        Self::UnknownSet,
        Self::Overflow,
        Self::BufferOverflow,
        Self::Locked,
    ];
}

/// The interpreter. All its bits may be zero before [`Interpreter::initialize`].
///
/// The buffer holds the points of a polygon; that of a plotter has room for [`VERTICES`].
#[derive(Debug)]
pub struct Interpreter<B = [Vertex; VERTICES]> {
    /// How the next byte is interpreted.
    pub(super) mode: Mode,
    /// The first letter of an instruction, 0 if none has come.
    pub(super) letter: u8,
    /// The name of the instruction, 0 if there is none.
    pub(super) name: [u8; 2],
    /// The number that is being read.
    pub(super) number: Number,
    /// The numbers of the instruction that have come and are not used yet.
    pub(super) numbers: [i64; 8],
    /// The number of these numbers; more than 8 are not kept.
    pub(super) count: usize,
    /// Whether a pair of coordinates has been drawn.
    pub(super) has_pairs: bool,
    /// Whether a number was bad.
    pub(super) is_bad: bool,
    pub(super) polyline: Polyline,
    /// The bits of a letter so far, with all those of its first byte, and how many more bytes it
    /// has.
    pub(super) partial: (u32, u8),
    /// The byte that is to be taken once more when the steps are done.
    pub(super) again: Option<u8>,

    pub(super) frame: Frame,
    /// The position on the page, which may be beyond the limits.
    pub(super) at: Point,
    /// Whether the position is not known, because coordinates were beyond the range or lost.
    pub(super) is_lost: bool,
    pub(super) is_down: bool,
    pub(super) is_relative: bool,
    /// Whether the pen has been put away.
    pub(super) has_no_pen: bool,
    pub(super) text: TextStyle,
    pub(super) line: LineStyle,
    /// Whether the last number of arcs is how far a chord may be off, and not its angle (`CT1`).
    pub(super) bounds_deviation: bool,
    pub(super) fill: FillStyle,
    pub(super) polygon: Polygon<B>,
    pub(super) hatch: Hatch,
    /// The lengths of ticks in the positive and the negative direction, in percent.
    pub(super) ticks: [i64; 2],
    /// The speed with the pen down in cm/s, in units of 2^-16; 0 if none was chosen.
    pub(super) speed: i64,
    /// The number of the first error that `OE` has not reported yet, 0 if there was none.
    pub(super) error: u8,
    pub(super) is_initialized: bool,
    pub(super) has_new_corners: bool,

    /// The steps that are left to do for the last byte.
    steps: Deque<Step, STEPS>,
    /// The number of parts of the first step that are done.
    index: u32,
    /// The line that is being drawn in dashes.
    stroke: Option<Stroke>,

    /// Whether something has been drawn on the sheet.
    has_ink: bool,
    /// Whether the sheet is complete, so that what is drawn next needs another one.
    is_sheet_over: bool,
    /// What is to be drawn first on the next sheet; otherwise [`Action::Nothing`].
    first_of_sheet: Action,
}

impl Interpreter {
    /// Creates an interpreter that consists of zero bits. Before use it must be initialized.
    pub const fn new() -> Self {
        Self::with_buffer([Vertex::ZERO; VERTICES])
    }
}

impl<B: PolygonBuffer> Interpreter<B> {
    /// Keeps the points of polygons in this buffer. Before use it must be initialized.
    pub const fn with_buffer(buffer: B) -> Self {
        Self {
            mode: Mode::Code,
            letter: 0,
            name: [0; 2],
            number: Number::ZERO,
            numbers: [0; 8],
            count: 0,
            has_pairs: false,
            is_bad: false,
            polyline: Polyline::ZERO,
            partial: (0, 0),
            again: None,
            frame: Frame::ZERO,
            at: Point::ZERO,
            is_lost: false,
            is_down: false,
            is_relative: false,
            has_no_pen: false,
            text: TextStyle::ZERO,
            line: LineStyle::ZERO,
            bounds_deviation: false,
            fill: FillStyle::ZERO,
            polygon: Polygon::new(buffer),
            hatch: Hatch::ZERO,
            ticks: [0; 2],
            speed: 0,
            error: 0,
            is_initialized: false,
            has_new_corners: false,
            steps: Deque::new(),
            index: 0,
            stroke: None,
            has_ink: false,
            is_sheet_over: false,
            first_of_sheet: Action::Nothing,
        }
    }

    /// Sets the state that `IN` sets, with the pen at this position and these hard clip limits. The
    /// limits of a plotter begin at 0; `RO` turns the page within them.
    pub fn initialize(&mut self, at: Point, limits: Rectangle) {
        self.frame = Frame::new(limits);
        (self.at, self.is_lost, self.is_down) = (at, false, false);
        self.has_no_pen = false;
        (self.error, self.is_initialized, self.has_new_corners) = (0, true, false);
        self.speed = 0;
        self.set_defaults();
    }

    /// Makes the state that `DF` makes.
    pub(super) fn set_defaults(&mut self) {
        self.frame.set_default();
        self.is_relative = false;
        self.text = TextStyle::DEFAULT;
        (self.line, self.bounds_deviation) = (LineStyle::SOLID, false);
        self.fill = FillStyle::DEFAULT;
        self.polygon.clear();
        self.ticks = [UNIT / 2; 2];
    }

    /// Forgets the instruction that has not ended and what is left of the last one.
    pub fn abandon(&mut self) {
        self.mode = Mode::Code;
        self.forget_instruction();
        self.letter = 0;
        self.clear_steps();
        (self.has_ink, self.is_sheet_over) = (false, false);
    }

    /// Forgets what is left to do for the last byte.
    pub fn clear_steps(&mut self) {
        self.steps.clear();
        (self.index, self.stroke, self.again) = (0, None, None);
        self.first_of_sheet = Action::Nothing;
    }

    /// Notes that the sheet is complete. Another one is needed before anything else is drawn, but
    /// not if nothing has been drawn on this one.
    pub(super) fn end_sheet(&mut self) {
        self.is_sheet_over |= core::mem::take(&mut self.has_ink);
    }

    /// Whether nothing is left to do for the bytes so far, and no instruction is incomplete.
    pub fn is_idle(&self) -> bool {
        self.steps.is_empty()
            && self.stroke.is_none()
            && self.again.is_none()
            && self.first_of_sheet == Action::Nothing
    }

    /// The speed that `VS` has chosen for lines, in cm/s, in units of 2^-16; `None` if it has not.
    pub fn speed(&self) -> Option<i64> {
        (self.speed > 0).then_some(self.speed)
    }

    /// Notes that something was to be drawn while the machine was locked.
    pub fn note_locked(&mut self) {
        self.fail(ErrorNumber::Locked);
    }

    /// Takes the first error since the last call or the last `OE`. The reader of a file reports it,
    /// because nobody can ask for it by `OE`.
    pub fn take_error(&mut self) -> Option<ErrorNumber> {
        let number = core::mem::take(&mut self.error);
        ErrorNumber::ALL.into_iter().find(|error| *error as u8 == number)
    }

    /// Notes an error, unless an earlier one has not been reported by `OE` yet.
    pub(super) fn fail(&mut self, error: ErrorNumber) {
        if self.error == 0 {
            self.error = error as u8;
        }
    }

    /// Notes that the position is beyond the range of coordinates.
    pub(super) fn overflow(&mut self) {
        self.is_lost = true;
        self.fail(ErrorNumber::Overflow);
    }

    /// Notes that bytes were lost. Nothing is drawn until both the pen and the position are known
    /// again.
    pub(super) fn lose(&mut self) {
        self.is_lost = true;
        self.is_down = false;
    }

    /// Adds a step. There is room, because a byte never causes more than [`STEPS`].
    pub(super) fn add(&mut self, step: Step) {
        let is_added = self.steps.push_back(step).is_ok();
        debug_assert!(is_added, "a byte makes too many steps");
    }

    /// Moves to coordinates in the current units, and draws if the pen is down.
    pub(super) fn go(&mut self, to: Point, is_relative: bool) {
        self.text.advanced = Point::default();
        if self.is_lost && is_relative {
            return;
        }
        let to = if is_relative {
            self.frame.distance(to).and_then(|distance| distance.plus(self.at))
        } else {
            self.frame.position(to)
        };
        let Some(to) = to else { return self.overflow() };
        let was_lost = core::mem::take(&mut self.is_lost);
        if self.polygon.is_open {
            return self.add_vertex(to);
        }
        self.add(if self.is_down && !was_lost { Step::Line(to) } else { Step::Travel(to) });
        if let Some(symbol) = Some(self.text.symbol).filter(|symbol| *symbol != 0) {
            self.add_letter(symbol.into(), true);
        }
    }

    /// Adds the strokes of a letter.
    pub(super) fn add_letter(&mut self, letter: char, is_symbol: bool) {
        for strokes in LetterStrokes::of(letter).into_iter().flatten() {
            self.add(Step::Letter(strokes, is_symbol));
        }
    }

    /// Whether a polygon (PM) has begun and has not ended, so that moves become its points.
    pub fn is_in_polygon(&self) -> bool {
        self.polygon.is_open
    }

    /// Returns the next action that results from the bytes so far. Take all actions before the next
    /// byte comes.
    pub fn next_action(&mut self) -> Option<Action> {
        let first = core::mem::replace(&mut self.first_of_sheet, Action::Nothing);
        if first != Action::Nothing {
            return Some(first);
        }
        let action = self.next_of_steps()?;
        if matches!(action, Action::Line(_) | Action::Dot(_)) {
            self.has_ink = true;
            if core::mem::take(&mut self.is_sheet_over) {
                self.first_of_sheet = action;
                return Some(Action::Sheet);
            }
        }
        Some(action)
    }

    /// Returns the next action of the steps that are left.
    fn next_of_steps(&mut self) -> Option<Action> {
        loop {
            if let Some(action) = self.continue_stroke() {
                return Some(action);
            }
            if self.stroke.is_some() {
                continue;
            }
            let Some(step) = self.steps.front().cloned() else {
                let byte = self.again.take()?;
                self.push(byte);
                continue;
            };
            let index = self.index;
            self.index += 1;
            let action = match step {
                Step::Initialize => Some(Action::Initialize),
                Step::Fill => match self.next_of_fill(index == 0) {
                    Some(action) => return Some(action),
                    None => None,
                },
                Step::Edges => match self.polygon_edge(index) {
                    Some((true, to)) => {
                        self.draw_to(to);
                        continue;
                    }
                    Some((false, to)) => {
                        self.at = to;
                        continue;
                    }
                    None => None,
                },
                Step::Arc(arc) => match arc.chord(index, &self.frame) {
                    Some(to) => {
                        self.draw_to(to);
                        continue;
                    }
                    None => None,
                },
                Step::Letter(strokes, is_symbol) => match strokes.line(index as usize) {
                    Some(Some(line)) => {
                        let line = line.map(|point| {
                            let point = self.text.letter_point(&self.frame, point, is_symbol);
                            Point { x: self.at.x + point.x, y: self.at.y + point.y }
                        });
                        match self.ink(line) {
                            Some(action) => return Some(action),
                            None => continue,
                        }
                    }
                    Some(None) => continue,
                    None => None,
                },
                Step::Line(to) => {
                    self.draw_to(to);
                    None
                }
                Step::Travel(to) => {
                    self.at = to;
                    self.frame.contains(to).then_some(Action::Go(to))
                }
                Step::Place(at) => {
                    self.at = at;
                    None
                }
                Step::Dot => self.ink([self.at; 2]),
                Step::Pen(pen) => {
                    self.has_no_pen = pen == 0;
                    Some(Action::Pen(pen))
                }
                Step::Answer(answer) => Some(Action::Answer(answer)),
            };
            self.steps.pop_front();
            self.index = 0;
            if action.is_some() {
                return action;
            }
        }
    }

    /// Begins a line in the current style.
    pub(super) fn draw_to(&mut self, to: Point) {
        let from = core::mem::replace(&mut self.at, to);
        self.stroke = Some(Stroke::new(from, to));
    }

    /// Returns the next part of the line that is being drawn. `None` if nothing of this part is
    /// drawn, or if the line has ended, which is then forgotten.
    fn continue_stroke(&mut self) -> Option<Action> {
        let mut stroke = self.stroke.take()?;
        if self.line.number.is_none() {
            return self.ink([stroke.from, stroke.to]);
        }
        let pattern = match self.line.length {
            PatternLength::Percent(percent) => self.frame.percent(percent),
            PatternLength::Units(units) => units,
        };
        let part = self.line.next_part(&mut stroke, pattern)?;
        self.stroke = Some(stroke);
        match part {
            DashPart::Dash(line) => self.ink(line),
            DashPart::Dot(point) => self.ink([point; 2]),
            DashPart::Gap => None,
        }
    }

    /// The action for a line or a dot, as far as it lies within the window.
    pub(super) fn ink(&self, line: [Point; 2]) -> Option<Action> {
        if self.is_lost {
            return None;
        }
        let is_dot = line[0] == line[1];
        let line = self.frame.clip(line)?;
        Some(if self.has_no_pen {
            Action::Go(line[1])
        } else if is_dot {
            Action::Dot(line[0])
        } else {
            Action::Line(line)
        })
    }
}

impl Default for Interpreter {
    fn default() -> Self {
        Self::new()
    }
}
