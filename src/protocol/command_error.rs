//! The reasons why a line is not carried out: each has a number for programs and a sentence for
//! people.

use crate::convex::SolidError;
use crate::curve::CurveError;
use crate::drawing::PageError;
use crate::fixed::{BinaryFraction, Length, Millimetres};
use crate::machine::{MachineError, SettingError, Value};
use crate::model::{ElementKind, ModelError, PEN_LIMIT};
use crate::order::Leg;
use crate::stage::OutOfScratch;
use crate::step::ArcError;
use crate::view::ViewError;
use core::fmt;

/// Why a line was not carried out. The plotter's state is then unchanged, except where an error
/// says otherwise.
///
/// [`CommandError::number`] is the number in `error:N`. The text ([`fmt::Display`]) is sent before
/// it as a message and says what to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandError {
    /// No command begins like this line.
    UnknownCommand,
    /// The text is not a number where one was expected.
    NotANumber,
    /// No `$` command has this name.
    UnknownSystemCommand,
    /// `$H` was sent while homing is switched off (`$22=0`).
    HomingOff,
    /// The plotter is not idle, as the command requires.
    Busy,
    /// The plotter is in alarm or asleep.
    Locked,
    /// The line has too many bytes.
    LineTooLong {
        /// The length of the longest line, in bytes.
        limit: usize,
    },
    /// The line is not UTF-8.
    NotText,
    /// Bytes of the line were lost or damaged.
    BytesLost,
    /// A word of G-code with this letter is not known: either the letter or its number.
    UnsupportedWord(u8),
    /// There is no such arc, for example because its ends are not equally far from its centre.
    Arc(ArcError),
    /// A number is outside the range that is allowed or can be stored.
    NumberOutOfRange,
    /// There are too few or too many numbers.
    WrongNumberCount {
        /// How many numbers are needed.
        needed: usize,
    },
    /// A corner is not written as `v`, `v/vt`, `v//vn` or `v/vt/vn` with whole numbers.
    NotAVertexNumber,
    /// The value is not one of the choices.
    NotAChoice {
        /// The list of choices.
        choices: &'static str,
    },
    /// The size of a page is not written as WIDTHxHEIGHT.
    NotAPage,
    /// A backslash in a title does not begin an escape.
    NotAnEscape,
    /// A title has a letter that the font lacks.
    NotInTheFont(char),
    /// The title is too long.
    TitleTooLong {
        /// The length of the longest title, in bytes of UTF-8.
        limit: usize,
    },
    /// The model refused the change.
    Model(ModelError),
    /// There is nothing to draw.
    NothingToPlot,
    /// The camera cannot show the model.
    View(ViewError),
    /// The vertices or edges are not those of a convex solid, or the eye is inside it.
    Solid(SolidError),
    /// The drawing or its title does not fit on the page.
    Page(PageError),
    /// The machine refused the move or command.
    Machine(MachineError),
    /// The value of the setting was refused.
    Setting(SettingError),
    /// There is not enough working memory for this drawing.
    DrawingTooLarge(OutOfScratch),
    /// The drawing has more lines than a tour can number.
    TooManyLines,
    /// There is no change of the model to take back, or a plot came after it.
    NothingToUndo,
    /// The user cancelled the job while it was computed.
    Aborted,
    /// The settings are in force, but the flash does not keep them.
    NotStored,
    /// No job is kept.
    NoJobKept,
    /// The kept job was computed for other steps per millimetre.
    OtherSteps,
    /// The line's checksum does not match its bytes.
    Damaged,
    /// Another line must come first.
    OutOfOrder {
        /// The number of that line.
        expected: i32,
    },
    /// The line has no number or no checksum where both are required.
    Unnumbered,
    /// A line with the same number was accepted before and then refused with this error.
    RefusedBefore(u16),
}

/// The number N of each `error:N` and its meaning, as `docs/protocol.md` lists them.
pub const MEANINGS: &[(u16, &str)] = &[
    (1, "unknown command"),
    (2, "not a number"),
    (3, "unknown $ command"),
    (5, "homing is off"),
    (8, "the plotter is busy"),
    (9, "locked after an alarm"),
    (11, "line too long"),
    (15, "beyond the travel"),
    (20, "unsupported G-code"),
    (33, "no such arc"),
    (100, "line is not text"),
    (101, "bytes of the line were lost or damaged"),
    (102, "number out of range"),
    (103, "wrong number of values"),
    (104, "not a vertex number"),
    (105, "not one of the choices"),
    (106, "not a page size"),
    (107, "not an escape"),
    (108, "not in the font"),
    (109, "title too long"),
    (110, "unknown vertex"),
    (111, "too few corners"),
    (112, "vertex repeated"),
    (113, "too many vertices"),
    (114, "too many corners"),
    (115, "coordinate too large"),
    (116, "not a curve"),
    (117, "curve out of order"),
    (118, "unknown bar, face or curve"),
    (119, "no plane"),
    (120, "nothing to plot"),
    (121, "eye at the point looked at"),
    (122, "up is along the line of sight"),
    (123, "vertex not in front of the eye"),
    (124, "nothing in front of the eye"),
    (125, "not a convex solid"),
    (126, "eye inside the solid"),
    (127, "too many pens"),
    (130, "margins leave no room on the page"),
    (131, "page has too many steps"),
    (132, "drawing is larger than the page"),
    (133, "title is wider than the page"),
    (140, "drawing too large for the memory"),
    (141, "given up"),
    (142, "too many lines"),
    (143, "nothing to undo"),
    (150, "setting out of range"),
    (151, "setting conflicts with another"),
    (152, "move too long"),
    (160, "in force, but not kept: the flash is worn out"),
    (161, "no job is kept"),
    (162, "the kept job is for other steps"),
    (170, "checksum does not match"),
    (171, "line out of order"),
    (172, "line without number and checksum"),
];

impl CommandError {
    /// The number in `error:N`. Numbers below 100 have the same meaning as in Grbl 1.1.
    pub const fn number(&self) -> u16 {
        match self {
            Self::UnknownCommand => 1,
            Self::NotANumber => 2,
            Self::UnknownSystemCommand => 3,
            Self::HomingOff => 5,
            Self::Busy => 8,
            Self::Locked => 9,
            Self::LineTooLong { .. } => 11,
            Self::UnsupportedWord(_) => 20,
            Self::Arc(_) => 33,
            Self::NotText => 100,
            Self::BytesLost => 101,
            Self::NumberOutOfRange => 102,
            Self::WrongNumberCount { .. } => 103,
            Self::NotAVertexNumber => 104,
            Self::NotAChoice { .. } => 105,
            Self::NotAPage => 106,
            Self::NotAnEscape => 107,
            Self::NotInTheFont(_) => 108,
            Self::TitleTooLong { .. } => 109,
            Self::Model(error) => match error {
                ModelError::UnknownVertex { .. } => 110,
                ModelError::TooFewCorners { .. } => 111,
                ModelError::RepeatedVertex { .. } => 112,
                ModelError::TooManyVertices { .. } => 113,
                ModelError::TooManyCorners { .. } => 114,
                ModelError::CoordinateTooLarge => 115,
                ModelError::Curve(CurveError::UnknownPoint { .. }) => 110,
                ModelError::Curve(_) => 116,
                ModelError::NoDegree | ModelError::CurveUnfinished | ModelError::NoCurve => 117,
                ModelError::KnotTooLarge => 102,
                ModelError::UnknownElement { .. } => 118,
                ModelError::NoPlane => 119,
                ModelError::TooManyPens => 127,
                ModelError::Scratch(_) => 140,
            },
            Self::NothingToPlot | Self::View(ViewError::NothingToSee) => 120,
            Self::View(ViewError::EyeAtTarget) => 121,
            Self::View(ViewError::UpAlongSight) => 122,
            Self::View(ViewError::BehindEye { .. }) => 123,
            Self::View(ViewError::NothingInFront) => 124,
            Self::Solid(SolidError::EyeInside | SolidError::BadEye) => 126,
            Self::Solid(_) => 125,
            Self::Page(PageError::NoRoom) => 130,
            Self::Page(PageError::TooManySteps) => 131,
            Self::Page(PageError::DoesNotFit { .. }) => 132,
            Self::Page(PageError::TitleTooWide { .. }) => 133,
            Self::Setting(SettingError::Busy) => 8,
            Self::Setting(SettingError::Unknown) => 3,
            Self::Setting(SettingError::OutOfRange(_) | SettingError::NotWhole(_)) => 150,
            Self::Setting(SettingError::Conflict(_)) => 151,
            Self::Machine(MachineError::State(_)) => 8,
            Self::Machine(MachineError::BeyondTravel { .. }) => 15,
            Self::Machine(MachineError::MoveTooLong { .. }) => 152,
            Self::DrawingTooLarge(_) => 140,
            Self::Aborted => 141,
            Self::NotStored => 160,
            Self::NoJobKept => 161,
            Self::OtherSteps => 162,
            Self::Damaged => 170,
            Self::OutOfOrder { .. } => 171,
            Self::Unnumbered => 172,
            Self::RefusedBefore(number) => *number,
            Self::TooManyLines => 142,
            Self::NothingToUndo => 143,
        }
    }
}

impl core::error::Error for CommandError {}

impl fmt::Display for CommandError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownCommand => formatter.write_str(
                "a line begins with v, f, l, another OBJ keyword, G-code, or $; $ lists the commands",
            ),
            Self::NotANumber => formatter.write_str("a number is written like -12.5 or 3e-2"),
            Self::UnknownSystemCommand => formatter.write_str("$ lists the commands"),
            Self::HomingOff => formatter.write_str("connect limit switches, then set $22=1"),
            Self::UnsupportedWord(letter) => {
                write!(formatter, "this word {} is not known here", char::from(*letter))
            }
            Self::Arc(_) => formatter.write_str(
                "both ends of an arc lie equally far from its centre, at most 4194304 steps: check I and J, or R",
            ),
            Self::Busy => formatter.write_str("wait for the plot to end, or send ctrl-X"),
            Self::Locked => formatter.write_str("release the stop if it is pressed, then send $X to unlock"),
            Self::LineTooLong { limit } => write!(formatter, "a line has at most {limit} bytes"),
            Self::NotText => {
                formatter.write_str("a byte of the line is no text: check the baud rate")
            }
            Self::BytesLost => formatter.write_str(
                "bytes of the line were lost or damaged, perhaps a line end among them: \
                 check the cable, and keep fewer than 240 bytes unanswered",
            ),
            Self::NumberOutOfRange => {
                formatter.write_str("the number is too large, too small or has the wrong sign")
            }
            Self::WrongNumberCount { needed } => write!(formatter, "it takes {needed} numbers"),
            Self::NotAVertexNumber => {
                formatter.write_str("a corner is written 7, -1, 7/2, 7//3 or 7/2/3")
            }
            Self::NotAChoice { choices } => write!(formatter, "choose {choices}"),
            Self::NotAPage => formatter.write_str("a page is written 210x297, in mm"),
            Self::NotAnEscape => formatter.write_str(
                "a backslash begins \\xE9 or \\u{2013}, the letter's hexadecimal number, or \\\\ for itself",
            ),
            Self::NotInTheFont(letter) => {
                let shown = if letter.is_ascii_control() { ' ' } else { *letter };
                let number = u32::from(*letter);
                write!(formatter, "the font lacks {shown} (U+{number:04X}): leave it out")
            }
            Self::TitleTooLong { limit } => write!(
                formatter,
                "a title has at most {limit} bytes, letters beyond ASCII two or three: shorten it"
            ),
            Self::Model(error) => write_model_error(formatter, error),
            Self::NothingToPlot | Self::View(ViewError::NothingToSee) => {
                formatter.write_str("send vertices and faces or lines first")
            }
            Self::View(ViewError::EyeAtTarget) => formatter.write_str("move $eye away from $at"),
            Self::View(ViewError::UpAlongSight) => {
                formatter.write_str("choose another $up, not along the line of sight")
            }
            Self::View(ViewError::NothingInFront) => {
                formatter.write_str("the model is behind the eye: move or turn it")
            }
            Self::View(ViewError::BehindEye { vertex }) => {
                write!(formatter, "vertex {vertex} is beside or behind the eye: move $eye back")
            }
            Self::Solid(error) => write_solid_error(formatter, error),
            Self::Page(PageError::NoRoom) => {
                formatter.write_str("make $margin or $title-size smaller or $page larger")
            }
            Self::Page(PageError::TooManySteps) => {
                formatter.write_str("the page has more than 1048576 steps: make $page smaller")
            }
            Self::Page(PageError::DoesNotFit { width, height, foot }) => {
                let mm = |units: i64| BinaryFraction { units, fraction_bits: 16, places: 1 };
                write!(formatter, "the plan is {}x{} mm", mm(*width), mm(*height))?;
                if *foot > 0 {
                    write!(formatter, " and its title takes {} mm below it", mm(*foot))?;
                }
                formatter.write_str(": choose a larger $page, or $fit=on")
            }
            Self::Page(PageError::TitleTooWide { width, free }) => {
                let mm = |length: &Millimetres| BinaryFraction {
                    units: length.to_bits().into(),
                    fraction_bits: 16,
                    places: 1,
                };
                write!(
                    formatter,
                    "the title is {} mm wide where {} are free: shorten it, or make $title-size smaller",
                    mm(width),
                    mm(free)
                )
            }
            Self::DrawingTooLarge(missing) => write_missing(formatter, missing),
            Self::Setting(error) => write_setting_error(formatter, error),
            Self::Machine(error) => write_machine_error(formatter, error),
            Self::TooManyLines => write!(
                formatter,
                "a drawing has at most {} lines: send a smaller model",
                Leg::LIMIT
            ),
            Self::NothingToUndo => {
                formatter.write_str("only the last change can be taken back, and not after a plot")
            }
            Self::Aborted => formatter.write_str("the job was given up"),
            Self::NotStored => formatter.write_str("in force until power is lost: the flash does not keep it"),
            Self::NoJobKept => formatter.write_str("send a model and $plot; only boards with flash for it keep the job"),
            Self::OtherSteps => formatter.write_str("set $100 and $101 as they were, or $plot anew"),
            Self::Damaged => formatter.write_str("the line was damaged on its way: send it again"),
            Self::OutOfOrder { expected } => {
                write!(formatter, "line {expected} comes next; M110 N0 begins again with line 1")
            }
            Self::Unnumbered => {
                formatter.write_str("lines with checksums came before: send ctrl-X to go on without")
            }
            Self::RefusedBefore(_) => formatter.write_str("the line was refused when it came first"),
        }
    }
}

fn write_model_error(formatter: &mut fmt::Formatter<'_>, error: &ModelError) -> fmt::Result {
    match error {
        ModelError::CoordinateTooLarge => formatter.write_str("coordinates go up to 1073741824"),
        ModelError::TooManyVertices { limit } => write!(formatter, "the limit is {limit} vertices"),
        ModelError::TooManyCorners { limit, needed } => {
            write!(
                formatter,
                "the limit is {limit} corners of faces and ends of lines, this makes {needed}"
            )
        }
        ModelError::UnknownVertex { number, vertices } => {
            write!(formatter, "there is no vertex {number}: the model has {vertices}")
        }
        ModelError::TooFewCorners { needed } => write!(formatter, "it takes {needed} vertices"),
        ModelError::RepeatedVertex { number } => {
            write!(formatter, "vertex {number} comes twice in a row")
        }
        ModelError::NoDegree => formatter.write_str("send deg first, 1 to 5"),
        ModelError::CurveUnfinished => formatter.write_str("end the curve before: send end"),
        ModelError::NoCurve => formatter.write_str("begin a curve first: send curv"),
        ModelError::KnotTooLarge => formatter.write_str("knots go up to 4194304"),
        ModelError::Curve(error) => write_curve_error(formatter, error),
        ModelError::UnknownElement { part, number, count } => {
            let name = match part {
                ElementKind::Vertices => "vertex",
                ElementKind::Bars => "bar",
                ElementKind::Faces => "face",
                ElementKind::Curves => "curve",
            };
            write!(formatter, "there is no {name} {number}: the model has {count}")
        }
        ModelError::NoPlane => {
            formatter.write_str("three vertices that are not in line make a plane")
        }
        ModelError::TooManyPens => write!(
            formatter,
            "there are pens 1 to {PEN_LIMIT}, and other names take a free one each: send $pens=one to draw all with one"
        ),
        ModelError::Scratch(missing) => write_missing(formatter, missing),
    }
}

fn write_solid_error(formatter: &mut fmt::Formatter<'_>, error: &SolidError) -> fmt::Result {
    match error {
        SolidError::EyeInside | SolidError::BadEye => {
            formatter.write_str("move $eye out of the solid")
        }
        SolidError::VertexInside { vertex, count } => write!(
            formatter,
            "{count} vertices, vertex {} first, lie inside what the others span: choose $see=faces",
            vertex + 1
        ),
        SolidError::OutlineBroken { vertex } => write!(
            formatter,
            "no edge leads on from vertex {}: send all edges, or choose $see=vertices",
            vertex + 1
        ),
        _ => formatter.write_str("it takes four vertices at different places, not all in line"),
    }
}

/// Writes how much working memory is missing.
fn write_missing(formatter: &mut fmt::Formatter<'_>, missing: &OutOfScratch) -> fmt::Result {
    let OutOfScratch { needed, available } = missing;
    write!(formatter, "{needed} bytes are needed where {available} are free: send a smaller model")
}

fn write_curve_error(formatter: &mut fmt::Formatter<'_>, error: &CurveError) -> fmt::Result {
    match error {
        CurveError::Order => formatter.write_str("a curve has degree 1 to 5"),
        CurveError::TooFewControlPoints { needed } => {
            write!(formatter, "a curve of this degree takes {needed} control points")
        }
        CurveError::TooManyControlPoints { limit } => {
            write!(formatter, "a curve has at most {limit} control points")
        }
        CurveError::UnknownPoint { number } => {
            write!(formatter, "there is no vertex {}", u32::from(*number) + 1)
        }
        CurveError::WrongKnotCount { needed, given } => {
            write!(formatter, "the curve takes {needed} knots and has {given}")
        }
        CurveError::KnotDecreases { knot } => {
            write!(formatter, "knot {} is less than the one before", knot + 1)
        }
        CurveError::KnotTooLarge { .. } => formatter.write_str("knots go up to 4194304"),
        CurveError::KnotRepeated { knot } => {
            write!(formatter, "knot {} is repeated so often that the curve breaks there", knot + 1)
        }
        CurveError::OutsideKnots => {
            formatter.write_str("a curve begins at knot degree + 1 or later, ends later, and not past the last but degree")
        }
    }
}

fn write_setting_error(formatter: &mut fmt::Formatter<'_>, error: &SettingError) -> fmt::Result {
    match error {
        SettingError::Unknown => formatter.write_str("$$ lists the settings"),
        SettingError::OutOfRange(setting) => {
            let info = setting.info();
            write!(
                formatter,
                "{} goes from {} to {} {}",
                info.name,
                Length(info.least),
                Length(info.greatest),
                info.unit
            )
        }
        SettingError::NotWhole(setting) => {
            write!(formatter, "{} is a whole number", setting.info().name)
        }
        SettingError::Conflict(_) => {
            formatter.write_str("with it the steps would come too fast or the ramps too slow")
        }
        SettingError::Busy => formatter.write_str("wait for the plot to end, or send ctrl-X"),
    }
}

fn write_machine_error(formatter: &mut fmt::Formatter<'_>, error: &MachineError) -> fmt::Result {
    match error {
        MachineError::State(_) => formatter.write_str("wait for the plot to end, or send ctrl-X"),
        MachineError::BeyondTravel { x, y, .. } => {
            let mm = |value: &Value| BinaryFraction {
                units: value.to_bits().into(),
                fraction_bits: 16,
                places: 3,
            };
            write!(
                formatter,
                "it would go {},{} mm beyond the travel: choose a smaller $page, or set $130 and $131",
                mm(x),
                mm(y)
            )
        }
        MachineError::MoveTooLong { .. } => {
            formatter.write_str("a single move is at most 16 m long")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meanings_are_sorted_and_unique() {
        assert!(MEANINGS.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
