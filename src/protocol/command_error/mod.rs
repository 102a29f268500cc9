//! The reasons why a line is not carried out: each has a number for programs and a sentence for
//! people.
//!
//! The table of errors is [`CommandError::explain`] and the functions that it calls: a row for each
//! error, with its number, its meaning, what the client says instead where the sentence for the
//! serial line would not help, and that sentence. A new error is a variant, its row, and a sample
//! of it in `samples.rs`; none of them can be forgotten, because the others then do not compile.
//!
//! The file is longer than 500 lines, because most of it is that one table.

mod of_blocks;
mod of_modules;
#[cfg(feature = "tiles")]
mod of_stored;
#[cfg(any(test, feature = "host"))]
mod samples;

#[cfg(any(test, feature = "host"))]
pub use samples::{error_entries, error_samples};

#[cfg(feature = "tiles")]
pub use of_stored::{Crowd, StoredModelError};

use super::BlockError;
use crate::convex::SolidError;
use crate::drawing::PageError;
#[cfg(feature = "resume")]
use crate::fixed::BinaryFraction;
use crate::host_only::HostOnly;
use crate::machine::{MachineError, Setting, SettingError, Value};
use crate::model::ModelError;
use crate::order::Leg;
use crate::stage::OutOfScratch;
use crate::step::ArcError;
use crate::view::ViewError;
use core::fmt;
use of_blocks::explain_block;
use of_modules::{
    explain_machine, explain_missing, explain_model, explain_page, explain_setting, explain_solid,
    explain_view,
};

/// Why a line was not carried out. The plotter's state is then unchanged, except where an error
/// says otherwise.
///
/// [`CommandError::number`] is the number in `error:N`. The text ([`fmt::Display`]) is sent before
/// it as a message and says what to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandError {
    /// No command begins like this line.
    UnknownCommand,
    /// A line of G-code has something else than letters with numbers.
    NotAWord,
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
    /// A jog is in progress.
    Jogging,
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
    /// A line of G-code was refused for its words.
    Block(BlockError),
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
        choices: &'static [&'static str],
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
    /// This is not done with a model that lies in flash.
    #[cfg(feature = "tiles")]
    Stored(StoredModelError),
    /// There is nothing to draw.
    NothingToPlot,
    /// The camera cannot show the model.
    View(ViewError),
    /// This firmware was built without the feature `convex`, which `$see=vertices` and `$see=edges`
    /// need.
    NoConvexSolids,
    /// This firmware was built without the feature `hpgl`, which HP-GL needs.
    NoHpGl,
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
    /// No job has stopped that could go on.
    NothingToResume,
    /// The rest of the job that has stopped is with the computer that sent the job.
    #[cfg(feature = "resume")]
    RestIsSent,
    /// The strokes of the last job are with the computer that sent them.
    #[cfg(all(feature = "stream", feature = "resume"))]
    StrokesAreSent,
    /// The position of the pen is not known, so a job cannot go on.
    PositionUnknown,
    /// The position of the pen is known, so it cannot be said to be the origin.
    PositionKnown,
    /// The job that has stopped was begun by another version of the firmware.
    OtherVersion,
    /// A setting has changed that decides where ink falls, so the job that has stopped cannot go
    /// on.
    OtherSetting {
        /// The setting that has changed.
        setting: Setting,
        /// The value that it had when the job began.
        before: Value,
    },
    /// The model is not that of the job that has stopped.
    OtherModel,
    /// The job that has stopped began at an origin set by hand, and the machine has been homed
    /// since.
    OtherOrigin,
    /// A line of strokes is not written as one.
    #[cfg(feature = "stream")]
    NotStrokes,
    /// No strokes are expected, or fewer than were sent.
    #[cfg(feature = "stream")]
    NoStream,
    /// A stroke leads beyond the bounds that were said before.
    #[cfg(feature = "stream")]
    BeyondBounds,
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

/// The number of an error and what it means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ErrorEntry {
    /// The number in `error:N`. Numbers below 100 have the same meaning as in Grbl 1.1.
    pub number: u16,
    /// The meaning, as `docs/errors.md` lists it. Empty if the error has the number of another.
    pub meaning: HostOnly<&'static str>,
    /// What the client says instead of the meaning and the sentence for the serial line, where
    /// those would not help its user.
    pub for_client: HostOnly<Option<&'static str>>,
}

/// Makes the entry of an error from its number and its meaning.
const fn error(number: u16, meaning: &'static str) -> ErrorEntry {
    let (meaning, for_client) = (HostOnly::new(meaning), HostOnly::new(None));
    ErrorEntry { number, meaning, for_client }
}

impl ErrorEntry {
    /// Returns the entry with `text` as what the client says instead of the meaning.
    const fn client(self, text: &'static str) -> Self {
        Self { for_client: HostOnly::new(Some(text)), ..self }
    }
}

// The entries that several errors have in common. `of_modules.rs` has more.
/// The entry of the errors about a `$` command or a setting that does not exist.
const UNKNOWN_SYSTEM_COMMAND: ErrorEntry = error(3, "unknown $ command").client(
    "the plotter does not know this: its firmware and this program are of different versions",
);
/// The entry of the errors about a command that has to wait until the plotter is idle.
const BUSY: ErrorEntry = error(8, "the plotter is busy")
    .client("the plotter is busy: wait until its plot ends, or reset it");
/// The entry of the errors about a number outside the range that is allowed or can be stored.
const OUT_OF_RANGE: ErrorEntry = error(102, "number out of range");

/// What to do while the plotter is busy, which it is in check mode and where it is locked, too.
const WAIT: &str = "wait for the plot to end, or send ctrl-X; $C ends a check, and $X a lock";

/// Receives the row of an error: its entry, and the sentence that tells the user what to do.
type Row<'a> = &'a mut dyn FnMut(ErrorEntry, fmt::Arguments<'_>);

impl CommandError {
    /// Returns the number of the error, which the reply `error:N` names.
    pub fn number(&self) -> u16 {
        self.entry().number
    }

    /// Returns the number and the meaning of the error.
    #[inline(never)] // Its callers share one copy of the code.
    pub fn entry(&self) -> ErrorEntry {
        let mut found = UNKNOWN_SYSTEM_COMMAND;
        self.explain(&mut |entry, _| found = entry);
        found
    }

    /// The table of errors. Passes the row of this error to `row`.
    #[inline(never)] // Its callers share one copy of the code.
    fn explain(&self, row: Row<'_>) {
        match self {
            Self::UnknownCommand => row(
                error(1, "unknown command").client(
                    "penup reads the OBJ keywords v, f, l, o, g, s, usemtl, mtllib, vn, vt, \
                     cstype, deg, curv, parm and end",
                ),
                format_args!(
                    "a line begins with v, f, l, another OBJ keyword, G-code, or $; $ lists the \
                     commands"
                ),
            ),
            Self::NotAWord => row(
                error(1, ""),
                format_args!("G-code is letters with numbers: X-12.5, or a comment in (...)"),
            ),
            Self::NotANumber => {
                row(error(2, "not a number"), format_args!("a number is written like -12.5"))
            }
            Self::UnknownSystemCommand => {
                row(UNKNOWN_SYSTEM_COMMAND, format_args!("$ lists the commands"))
            }
            Self::HomingOff => row(
                error(5, "homing is off").client(
                    "the plotter has no limit switches, or its homing is off (setting 22 of the \
                     machine)",
                ),
                format_args!("connect limit switches, then set $22=1"),
            ),
            Self::Busy => row(BUSY, format_args!("{WAIT}")),
            Self::Locked => row(
                error(9, "locked after an alarm").client(
                    "the plotter is locked after an alarm: release its stop if it is pressed, \
                     then unlock it",
                ),
                format_args!("release the stop if it is pressed, then send $X to unlock"),
            ),
            Self::Jogging => row(
                error(9, ""),
                format_args!("a jog is on its way: wait for its end, or send the byte 0x85"),
            ),
            Self::LineTooLong { limit } => {
                row(error(11, "line too long"), format_args!("a line has at most {limit} bytes"))
            }
            Self::UnsupportedWord(letter) => row(
                error(20, "unsupported G-code"),
                format_args!("this word {} is not known here", char::from(*letter)),
            ),
            Self::Block(error) => explain_block(error, row),
            Self::Arc(_) => row(
                error(33, "no such arc"),
                format_args!(
                    "both ends of an arc lie equally far from its centre, at most 4194304 steps: \
                     check I and J, or R"
                ),
            ),
            Self::NotText => row(
                error(100, "line is not text"),
                format_args!("a byte of the line is no text: check the baud rate"),
            ),
            Self::BytesLost => row(
                error(101, "bytes of the line were lost or damaged").client(
                    "bytes were lost on the line: check the cable, and that nothing else uses the \
                     port",
                ),
                format_args!(
                    "bytes of the line were lost or damaged, perhaps a line end among them: check \
                     the cable, and keep fewer than 240 bytes unanswered"
                ),
            ),
            Self::NumberOutOfRange => row(
                OUT_OF_RANGE,
                format_args!("the number is too large, too small or has the wrong sign"),
            ),
            Self::WrongNumberCount { needed } => {
                row(error(103, "wrong number of values"), format_args!("it takes {needed} numbers"))
            }
            Self::NotAVertexNumber => row(
                error(104, "not a vertex number"),
                format_args!("a corner is written 7, -1, 7/2, 7//3 or 7/2/3"),
            ),
            Self::NotAChoice { choices } => {
                row(error(105, "not one of the choices"), format_args!("{}", Choices(choices)))
            }
            Self::NotAPage => {
                row(error(106, "not a page size"), format_args!("a page is written 210x297, in mm"))
            }
            Self::NotAnEscape => row(
                error(107, "not an escape"),
                format_args!(
                    "a backslash begins \\xE9 or \\u{{2013}}, the letter's hexadecimal number, or \
                     \\\\ for itself"
                ),
            ),
            Self::NotInTheFont(letter) => {
                let shown = if letter.is_ascii_control() { ' ' } else { *letter };
                let number = u32::from(*letter);
                row(
                    error(108, "not in the font"),
                    format_args!("the font lacks {shown} (U+{number:04X}): leave it out"),
                );
            }
            Self::TitleTooLong { limit } => row(
                error(109, "title too long"),
                format_args!(
                    "a title has at most {limit} bytes, letters beyond ASCII two or three: \
                     shorten it"
                ),
            ),
            Self::Model(error) => explain_model(error, row),
            #[cfg(feature = "tiles")]
            Self::Stored(error) => of_stored::explain_stored(*error, row),
            Self::NothingToPlot => explain_view(&ViewError::NothingToSee, row),
            Self::View(error) => explain_view(error, row),
            Self::NoConvexSolids => row(
                error(128, "convex solids are left out of this firmware")
                    .client("the plotter's firmware was built without convex solids"),
                format_args!("send faces and choose $see=faces, or $see=wire for all edges"),
            ),
            Self::NoHpGl => row(
                error(129, "no HP-GL in this firmware")
                    .client("the plotter's firmware was built without HP-GL"),
                format_args!("send G-code"),
            ),
            Self::Solid(error) => explain_solid(error, row),
            Self::Page(error) => explain_page(error, row),
            Self::DrawingTooLarge(missing) => explain_missing(missing, row),
            Self::Setting(error) => explain_setting(error, row),
            Self::Machine(error) => explain_machine(error, row),
            Self::Aborted => row(error(141, "given up"), format_args!("the job was given up")),
            Self::TooManyLines => row(
                error(142, "too many lines"),
                format_args!("a drawing has at most {} lines: send a smaller model", <Leg>::LIMIT),
            ),
            Self::NothingToUndo => row(
                error(143, "nothing to undo"),
                format_args!("only the last change can be taken back, and not after a plot"),
            ),
            Self::NotStored => row(
                error(160, "in force, but not kept: the flash is worn out"),
                format_args!("in force until power is lost: the flash does not keep it"),
            ),
            Self::NoJobKept => row(
                error(161, "no job is kept").client("the plotter keeps no job"),
                format_args!("send a model and $plot; only boards with flash for it keep the job"),
            ),
            Self::OtherSteps => row(
                error(162, "the kept job is for other steps")
                    .client("the kept job is counted in other steps"),
                format_args!("set $100 and $101 as they were, or $plot anew"),
            ),
            #[cfg(feature = "resume")]
            Self::NothingToResume => row(
                error(163, "no job has stopped")
                    .client("no job has stopped: there is nothing to go on with"),
                format_args!("no job has stopped: $again draws the last one from its beginning"),
            ),
            #[cfg(feature = "resume")]
            Self::RestIsSent => row(
                error(163, ""),
                format_args!("the job was sent while it was drawn: its sender sends the rest"),
            ),
            #[cfg(all(feature = "stream", feature = "resume"))]
            Self::StrokesAreSent => row(
                error(161, ""),
                format_args!("the last job was sent while it was drawn: its sender sends it again"),
            ),
            #[cfg(feature = "resume")]
            Self::PositionUnknown => row(
                error(164, "the plotter does not know where the pen is").client(
                    "the plotter does not know where the pen is: `penup home` finds it; without \
                     limit switches put the pen at the origin by hand, then `penup resume \
                     --at-origin`",
                ),
                format_args!(
                    "$H finds the pen; without limit switches put it at the origin by hand, then \
                     $resume=origin"
                ),
            ),
            #[cfg(feature = "resume")]
            Self::OtherVersion => row(
                error(165, "the job was begun by another version of the firmware").client(
                    "the firmware has changed since the job began: `penup again` draws it from \
                     its beginning",
                ),
                format_args!(
                    "the firmware has changed since the job began: $again draws it from its \
                     beginning"
                ),
            ),
            #[cfg(feature = "resume")]
            Self::OtherSetting { setting, before } => row(
                error(166, "a setting has changed since the job began").client(
                    "a setting has changed since the job began that decides where ink falls: set \
                     it back, or begin anew by `penup again`",
                ),
                format_args!(
                    "${0} has changed since the job began: set ${0}={1}, or begin anew by $again",
                    setting.info().number(),
                    BinaryFraction {
                        units: before.to_bits().into(),
                        fraction_bits: 16,
                        decimals: 3
                    }
                ),
            ),
            #[cfg(feature = "resume")]
            Self::OtherModel => row(
                error(167, "the model is not that of the job").client(
                    "the plotter holds another model than that of the job: `penup plot` begins \
                     anew with a model of yours",
                ),
                format_args!(
                    "another model came since the job began: $resume after $clear, or begin anew \
                     by $plot; a drawing of a model in flash needs that model: send it again"
                ),
            ),
            #[cfg(feature = "resume")]
            Self::OtherOrigin => row(
                error(169, "the job began at an origin set by hand").client(
                    "the job began at an origin set by hand, and the machine was homed since: put \
                     the pen at that origin (`penup jog` moves it), switch the plotter off and on, \
                     then `penup unlock` and `penup resume --at-origin`",
                ),
                format_args!(
                    "$H found another origin than the one at which the job began: move the pen to \
                     that one, then send $SLP, ctrl-X, $X and $resume=origin"
                ),
            ),
            #[cfg(feature = "resume")]
            Self::PositionKnown => row(
                error(168, "the plotter knows where the pen is").client(
                    "the plotter knows where the pen is: leave out --at-origin; if the pen was \
                     moved by hand, switch the plotter off and on first",
                ),
                format_args!(
                    "$resume goes on from where the pen is; if it was moved by hand, send $SLP and \
                     ctrl-X first"
                ),
            ),
            #[cfg(not(feature = "resume"))]
            Self::NothingToResume
            | Self::PositionUnknown
            | Self::PositionKnown
            | Self::OtherVersion
            | Self::OtherSetting { .. }
            | Self::OtherModel
            | Self::OtherOrigin => Self::NoJobKept.explain(row),
            #[cfg(feature = "stream")]
            Self::NotStrokes => row(
                error(180, "not a line of strokes"),
                format_args!("a program writes such a line: docs/protocol.md tells how"),
            ),
            #[cfg(feature = "stream")]
            Self::NoStream => row(
                error(181, "no strokes are expected").client(
                    "the plotter draws no strokes of this program: the job was given up, or \
                     another program has begun one",
                ),
                format_args!("$stream=… comes first, and says how many targets follow"),
            ),
            #[cfg(feature = "stream")]
            Self::BeyondBounds => row(
                error(182, "a stroke leads beyond the bounds of its job")
                    .client("the strokes that came are not those that were announced: begin anew"),
                format_args!("$stream=… has said that all strokes lie elsewhere: begin anew"),
            ),
            Self::Damaged => row(
                error(170, "checksum does not match").client(
                    "a line was damaged on its way: check the cable, and keep it away from the \
                     motors",
                ),
                format_args!("the line was damaged on its way: send it again"),
            ),
            Self::OutOfOrder { expected } => row(
                error(171, "line out of order").client(
                    "a line was lost on its way: check the cable, and that nothing else uses the \
                     port",
                ),
                format_args!("line {expected} comes next; M110 N0 begins again with line 1"),
            ),
            Self::Unnumbered => row(
                error(172, "line without number and checksum").client(
                    "a line lost its number on its way: check the cable, and that nothing else \
                     uses the port",
                ),
                format_args!("lines with checksums came before: send ctrl-X to go on without"),
            ),
            Self::RefusedBefore(number) => {
                row(error(*number, ""), format_args!("the line was refused when it came first"))
            }
        }
    }
}

impl core::error::Error for CommandError {}

impl fmt::Display for CommandError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut outcome = Ok(());
        self.explain(&mut |_, sentence| outcome = formatter.write_fmt(sentence));
        outcome
    }
}

/// Shows the words from which the user can choose, as `choose a, b or c`.
struct Choices(&'static [&'static str]);

impl fmt::Display for Choices {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("choose ")?;
        for (at, choice) in self.0.iter().enumerate() {
            let left = self.0.len() - at;
            formatter.write_str(choice)?;
            formatter.write_str(match left {
                1 => "",
                2 => " or ",
                _ => ", ",
            })?;
        }
        Ok(())
    }
}
