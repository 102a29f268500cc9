//! The errors of the `penup` command. Each message also tells the user what to do about it.
//!
//! The file is longer than 500 lines, because most of it is one table: each variant with its
//! message.

use crate::files::name;
use crate::fit::FitError;
use crate::interrupt::EXIT_CODE;
use crate::machine_settings::NoSuchMachine;
use crate::operate::SettingsFileError;
use penup::protocol::{CommandError, alarm_entries};
use penup_job::protocol::{RECEIVE_WINDOW, strokes_drawn};
use penup_readers::ReadError;
use penup_readers::lines::{JobLine, Origin};
use penup_readers::words::{as_option, explained, for_client};
use std::io;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The reason why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file to draw cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file cannot be read from the disk.
    #[error("cannot read {file}: {source}")]
    File {
        /// The path as the user wrote it.
        file: String,
        /// The operating system's error.
        source: io::Error,
    },
    /// The file's polylines cannot be fitted.
    #[error("{}", not_fitted(file, source))]
    Fit {
        /// The path or device as the user wrote it.
        file: String,
        /// The reason why fitting failed.
        source: FitError,
    },
    /// A tape contains a four-bit code that is no instruction.
    #[error("{file}: row {row} of the tape holds {code}, which is no instruction")]
    Tape {
        /// The path or device as the user wrote it.
        file: String,
        /// The row of the tape, counted from 0.
        row: u32,
        /// The invalid code, 12 to 15.
        code: u8,
    },
    /// The serial port cannot be opened.
    #[error(
        "cannot open {device}: {source}\nIs it the right port, is the plotter plugged in, may you \
         use the port \
         (on Linux: group dialout)?"
    )]
    Port {
        /// The path or device as the user wrote it.
        device: String,
        /// The error of the serial port library.
        source: serialport::Error,
    },
    /// The system cannot list its serial ports.
    #[error("cannot look for serial ports: {source}\nName the port by --port")]
    Ports {
        /// The error of the serial port library.
        source: serialport::Error,
    },
    /// No plotter was found.
    #[error("there is no plotter: {}\nName its port by --port if it has one", looked_at(looked))]
    NoPlotter {
        /// The ports that were looked at, with what was found there.
        looked: Vec<String>,
    },
    /// No plotter answers, and ports that may lead to one are used by other programs.
    #[error(
        "another program uses {}: close it there, or let it end, and try again",
        devices.join(" and ")
    )]
    PortsHeld {
        /// The ports.
        devices: Vec<String>,
    },
    /// More than one plotter was found.
    #[error("there are {} plotters: choose one by --port {}", devices.len(), devices.join(" or "))]
    SeveralPlotters {
        /// Their ports.
        devices: Vec<String>,
    },
    /// The machine does nothing that the order would change.
    #[error("there is nothing to {order}: the plotter reports {state}")]
    NothingToDo {
        /// The order, as a verb.
        order: &'static str,
        /// The state that the plotter reports.
        state: String,
    },
    /// The plotter did not confirm an order.
    #[error("the plotter did not confirm that it obeyed ({order}): look after it")]
    Unconfirmed {
        /// The order, as a verb.
        order: &'static str,
    },
    /// The machine stands, as it was told to, and is locked after an alarm.
    #[error("the machine stands with the pen up, and stays locked after {}", locked(*alarm))]
    Locked {
        /// The `N` of its `ALARM:N`, if it reports that.
        alarm: Option<u16>,
    },
    /// The user, or the end of the input, has broken the setup off.
    #[error("the setup is broken off; {changes}")]
    SetupBrokenOff {
        /// Which settings were changed until then.
        changes: String,
        /// Whether it was broken off by Ctrl-C.
        is_interrupted: bool,
    },
    /// The plotter's memory is too small for the model.
    #[error(
        "the model has {count} {what}, and this plotter takes {limit}\nLeave something out, or \
         `penup fit` makes curves of traced lines"
    )]
    TooLarge {
        /// What there is too much of: vertices or corners.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many the plotter takes.
        limit: usize,
    },
    /// The drawing cannot be computed by this computer and sent while it is drawn.
    #[error("cannot compute it here: {reason}")]
    NotStreamed {
        /// The reason, and what to do.
        reason: String,
    },
    /// A drawing that has stopped cannot go on.
    #[error("cannot go on: {reason}")]
    NotResumed {
        /// The reason, and what to do.
        reason: String,
    },
    /// The plotter has stopped this drawing, and would draw it over what is drawn of it.
    #[error(
        "the plotter has stopped this drawing after {}: {}, or --from 0 to draw all of it anew",
        strokes_drawn(*done, *all),
        if *is_repeated { "say --resume in place of --multipass to go on with it" }
        else { "add --resume to go on with it" }
    )]
    StoppedBefore {
        /// The number of strokes that are drawn.
        done: u64,
        /// The number of all strokes.
        all: u64,
        /// Whether several passes were asked for.
        is_repeated: bool,
    },
    /// Strokes were to be left out by their number in this computer's order, and the plotter has
    /// stopped a drawing that it has computed itself.
    #[error(
        "the plotter has stopped a drawing that it computed itself, after {}: `penup resume` goes \
         on with it\nIt draws in another order than this computer, in which --from counts; if it \
         is this computer's first {left_out} strokes that are drawn, add --compute host",
        strokes_drawn(*done, *all)
    )]
    StoppedByPlotter {
        /// The number of strokes that are drawn.
        done: u64,
        /// The number of all strokes; 0 if it is not known.
        all: u64,
        /// How many strokes were to be left out.
        left_out: u32,
    },
    /// The pen cannot be lowered where it stands.
    #[error("cannot lower the pen: {reason}")]
    NotLowered {
        /// The reason, and what to do.
        reason: String,
    },
    /// The motion of a machine that is not Cartesian is not plotted.
    #[error("the motion is plotted for machines with setting 230=0 only: leave out --motion")]
    MotionOfOtherMachine,
    /// There is no machine with these settings.
    #[error("{0}")]
    NoSuchMachine(#[from] NoSuchMachine),
    /// A file holds no settings of a machine.
    #[error("{file}: {source}")]
    SettingsFile {
        /// The path as the user wrote it.
        file: String,
        /// What is wrong with it.
        source: SettingsFileError,
    },
    /// The machine reports another value of a setting than it was sent and has accepted.
    #[error("setting {number} did not take: does another program change it at the same time?")]
    NotSet {
        /// The number of the setting.
        number: u16,
    },
    /// The command line gives a setting twice.
    #[error(
        "setting {number} is given twice, as {} and as {}: give it once",
        values[0],
        values[1]
    )]
    SettingTwice {
        /// The number of the setting.
        number: u16,
        /// Its values, in the order of the command line.
        values: [String; 2],
    },
    /// The plotter's library, running on this computer, refuses to draw the model.
    #[error("cannot draw it: {}", explained(refusal.number(), &[refusal.to_string()]))]
    NotDrawn {
        /// The error that the library reports.
        refusal: CommandError,
    },
    /// In a preview, the memory of a board does not hold a model, which it draws all the same.
    #[error(
        "{source}\nThe memory of {board} does not hold this model, but `penup plot` draws it: it \
         sends the strokes{}. A preview without --board shows them.",
        if *keeps { ", or with --compute board the model, which the board keeps in its flash" }
        else { "" }
    )]
    BeyondMemory {
        /// The refusal of the board.
        source: Box<Self>,
        /// The board's name.
        board: String,
        /// Whether it keeps larger models in its flash.
        keeps: bool,
    },
    /// A file cannot be drawn.
    #[error("{file}: {source}")]
    OfFile {
        /// The path as the user wrote it.
        file: String,
        /// The reason, which does not name the file.
        source: Box<Self>,
    },
    /// The emulator ended, or closed its connection, in the middle of the work.
    #[error(
        "the emulator of the {board} board broke: it {how}\n\
         Run it once more, and `cargo xtask set-up` if it breaks again{}",
        details_in(details.as_deref())
    )]
    EmulatorBroke {
        /// The board's name.
        board: String,
        /// How it ended, as part of a sentence.
        how: String,
        /// The file that holds the last output of the emulator, if that could be saved.
        details: Option<PathBuf>,
    },
    /// The emulated board could not be started.
    #[error("cannot start the {board} board: {reason}")]
    Board {
        /// The board's name.
        board: String,
        /// The reason.
        reason: String,
    },
    /// The plotter sent no byte at all.
    #[error(
        "the plotter does not answer ({} s without a byte{})\nIs it powered, is it the right \
         port, and does it run \
         penup at 115200 baud?", timeout.as_secs_f32(), waiting_for(line.as_deref())
    )]
    Silent {
        /// How long the sender waited.
        timeout: Duration,
        /// The line that was not answered; `None` if the plotter had not answered anything yet.
        line: Option<Box<JobLine>>,
    },
    /// Something answers, but not with the messages of penup firmware.
    #[error(
        "what answers is not penup{}\nIs it the right port, and does the plotter run penup at \
         115200 baud?",
        said(heard)
    )]
    NotPenup {
        /// The last line that was received; may be empty.
        heard: String,
    },
    /// The plotter is in a state in which it cannot start a job.
    #[error("the plotter is not ready: it reports {state}\n{}", remedy(state))]
    NotReady {
        /// The state that it reports.
        state: String,
    },
    /// The plotter answers status queries but did not answer a line.
    #[error(
        "the plotter is alive but never answered{}: bytes were lost on the line\nCheck the cable, \
         and that nothing \
         else uses the port; a penup plotter takes {RECEIVE_WINDOW} bytes without a \
         pause", waiting_for(line.as_deref())
    )]
    LostLine {
        /// The line that was not answered.
        line: Option<Box<JobLine>>,
    },
    /// The plotter refused a line.
    #[error("{}", refusal(line, *number, messages))]
    Refused {
        /// The refused line.
        line: Box<JobLine>,
        /// The `N` of its `error:N`.
        number: u16,
        /// The messages that it sent just before.
        messages: Vec<String>,
    },
    /// The machine stopped with an alarm.
    #[error("{}", alarmed(*number, messages))]
    Alarm {
        /// The `N` of its `ALARM:N`.
        number: u16,
        /// The messages that it sent just before.
        messages: Vec<String>,
    },
    /// The plotter was reset or aborted in the middle of the job.
    #[error(
        "the plotter gave up in the middle of the job and started again\nEither it was sent \
         ctrl-X, at another \
         port or by a byte that was damaged on the line, or it was reset: check the cable and the \
         power supply"
    )]
    Restarted,
    /// A job that was followed has stopped before its end.
    #[error(
        "the job has stopped after {}: it was given up, or the plotter was reset or lost its \
         power\n`penup resume` goes on with it, or says which command does",
        strokes_drawn(*done, *all)
    )]
    JobStopped {
        /// The number of strokes that are drawn.
        done: u64,
        /// The number of all strokes; 0 if it is not known.
        all: u64,
    },
    /// A job that was followed is over before its end, and the plotter keeps nothing of it.
    #[error(
        "the job is over before its end{}: it was given up or refused, or the plotter was reset or \
         lost its power\nIt does not keep how far it came, so `penup resume` cannot go on: look at \
         the sheet, and plot it anew",
        drawn.map_or(String::new(), |(done, all)| format!(", after {}", strokes_drawn(done, all)))
    )]
    JobUnfinished {
        /// The numbers of strokes that were begun, and of all, if the plotter still knows them.
        drawn: Option<(u64, u64)>,
    },
    /// A pass was drawn to its end whose beginning another program has sent.
    #[error(
        "one of the {passes} passes is drawn to its end, and this program cannot tell which: draw \
         those that are missing by --multipass N in place of --multipass {passes}, without --from; \
         they are {} at most", passes - 1
    )]
    PassesLeft {
        /// The number of all passes.
        passes: u32,
    },
    /// The drawing whose rest was to be sent is no longer drawn.
    #[error(
        "the drawing that the plotter drew has ended, or was given up, before its rest could be \
         sent\nLook after it: `penup status` says whether a job has stopped, and the same command \
         with --resume goes on with that"
    )]
    EndedMeanwhile,
    /// The serial line corrupts so many bytes that a line of the job never arrives intact.
    #[error(
        "the line to the plotter damages too many bytes: {times} times a line did not arrive \
         whole{}\nUse a \
         shorter or better cable, and keep it away from the motors", waiting_for(line.as_deref())
    )]
    Damaged {
        /// The line that did not arrive.
        line: Option<Box<JobLine>>,
        /// How often it was sent again.
        times: u32,
    },
    /// The plotter answers, but its firmware does not support line numbers and checksums.
    #[error(
        "the plotter's firmware is older than this program: it does not know lines with \
         checksums\nWrite the \
         firmware of this version to the board first: see docs/building.md"
    )]
    WithoutNumbers,
    /// After the whole job was sent, the plotter reports a different checksum of the model or of
    /// the options.
    #[error(
        "the plotter holds something else than was sent to it, so nothing is drawn\nDoes another \
         program send to \
         it at the same time, or is its firmware of another version than this program?"
    )]
    OtherContents,
    /// The machine is in feed hold, and nobody resumed it in time.
    #[error(
        "the machine holds in the middle of the drawing, with the pen up: somebody pressed hold \
         at another port, or a \
         byte was damaged on the line\nSend ~ to the plotter to let it go on, or ctrl-X to give \
         the drawing up"
    )]
    Held,
    /// The machine waits for a pen, and nobody can say that it is in.
    #[error(
        "the machine waits for pen {pen}, and nobody can press Enter here, because standard input \
         is no terminal\nPut pen {pen} in, then let the plotter go on by `penup resume`"
    )]
    WaitsForPen {
        /// The number of the pen, counted from 1.
        pen: u8,
    },
    /// Reading from or writing to the link failed.
    #[error("the line to the plotter broke: {0}")]
    Link(#[from] io::Error),
    /// An output file cannot be written.
    #[error("cannot write {file}: {source}")]
    Write {
        /// The path or device as the user wrote it.
        file: String,
        /// The operating system's error.
        source: io::Error,
    },
    /// An output file is the same file as the input.
    #[error(
        "{output} is the file to read: give the result another name, so that it is not overwritten"
    )]
    OutputIsInput {
        /// The path or device as the user wrote it.
        output: String,
    },
    /// Two outputs name the same file.
    #[error("{first} and {second} are one file: give each result a file of its own")]
    OutputTwice {
        /// The path or device as the user wrote it.
        first: String,
        /// As the user named it the second time.
        second: String,
    },
    /// The picture cannot be rendered.
    #[error("cannot make the picture: {0}")]
    Picture(String),
    /// The page has not been built.
    #[error("there is no page in {}: build it with `cargo xtask page`", folder.display())]
    PageNotBuilt {
        /// The folder in which it should be.
        folder: PathBuf,
    },
    /// The page cannot be served.
    #[error("cannot serve the page: {reason}\nIs another program at this port? Choose another one")]
    PageNotServed {
        /// The reason.
        reason: String,
    },
    /// The file to show is larger than the page opens.
    #[error(
        "{file} is larger than {} MB, which the page opens at most, and which is more than any \
         plotter holds",
        limit >> 20
    )]
    PageFileTooLarge {
        /// The path as the user wrote it.
        file: String,
        /// The largest size in bytes.
        limit: u64,
    },
    /// The user cancelled the job, and the plotter confirmed that it stopped.
    #[error("given up: the plot was stopped and the pen is up")]
    Interrupted,
    /// The user cancelled the job, but the plotter did not confirm that it stopped.
    #[error("given up, but the plotter did not confirm that it stopped: look after it")]
    InterruptedUnconfirmed,
}

/// A result of the program that a script can act on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExitCode {
    /// The exit code of the process.
    pub number: u8,
    /// When the program ends so.
    pub meaning: &'static str,
}

/// The exit codes of the program.
pub const EXIT_CODES: [ExitCode; 7] = [
    ExitCode { number: 0, meaning: "done" },
    ExitCode {
        number: NOT_DONE,
        meaning: "a file cannot be read, drawn or written, or the emulator fails",
    },
    ExitCode { number: NOT_UNDERSTOOD, meaning: "the command line is not understood" },
    ExitCode {
        number: NO_PLOTTER,
        meaning: "there is no plotter, its port is in use, or something else answers",
    },
    ExitCode { number: REFUSED, meaning: "the plotter is busy, or refuses what it was sent" },
    ExitCode { number: BROKEN_OFF, meaning: "the work broke off: alarm, restart, broken line" },
    ExitCode { number: EXIT_CODE, meaning: "given up by Ctrl-C" },
];

const NOT_DONE: u8 = 1;
/// The exit code with which clap refuses a command line, too.
const NOT_UNDERSTOOD: u8 = 2;
const NO_PLOTTER: u8 = 3;
const REFUSED: u8 = 4;
const BROKEN_OFF: u8 = 5;

/// The numbers of the errors by which a plotter refuses a drawing for a reason of its own, such as
/// an alarm or a line that was damaged.
const OF_PLOTTER: [RangeInclusive<u16>; 4] = [1..=14, 100..=101, 141..=141, 160..=169];

impl Error {
    /// Names `file`, which was to be drawn, if the error is about its drawing and does not name it.
    #[must_use]
    pub fn of_file(self, file: &Path) -> Self {
        let is_of_drawing = match &self {
            Self::NotDrawn { .. }
            | Self::TooLarge { .. }
            | Self::NotStreamed { .. }
            | Self::BeyondMemory { .. } => true,
            Self::Refused { line, number, .. } => {
                line.origin.is_none() && !OF_PLOTTER.iter().any(|range| range.contains(number))
            }
            _ => false,
        };
        match is_of_drawing {
            true => Self::OfFile { file: name(file), source: Box::new(self) },
            false => self,
        }
    }

    /// The exit code of the process, one of [`EXIT_CODES`].
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::OfFile { source, .. } => source.exit_code(),
            Self::Interrupted
            | Self::InterruptedUnconfirmed
            | Self::SetupBrokenOff { is_interrupted: true, .. } => EXIT_CODE,
            Self::SettingTwice { .. } => NOT_UNDERSTOOD,
            Self::Port { .. }
            | Self::Ports { .. }
            | Self::NoPlotter { .. }
            | Self::PortsHeld { .. }
            | Self::SeveralPlotters { .. }
            | Self::NotPenup { .. }
            | Self::Silent { line: None, .. } => NO_PLOTTER,
            Self::NotReady { .. }
            | Self::NothingToDo { .. }
            | Self::Locked { .. }
            | Self::WithoutNumbers
            | Self::NotSet { .. }
            | Self::BeyondMemory { .. }
            | Self::NotLowered { .. }
            | Self::Refused { .. } => REFUSED,
            Self::Silent { line: Some(_), .. }
            | Self::LostLine { .. }
            | Self::Alarm { .. }
            | Self::Restarted
            | Self::JobStopped { .. }
            | Self::JobUnfinished { .. }
            | Self::EndedMeanwhile
            | Self::PassesLeft { .. }
            | Self::Damaged { .. }
            | Self::OtherContents
            | Self::Held
            | Self::WaitsForPen { .. }
            | Self::Unconfirmed { .. }
            | Self::SetupBrokenOff { is_interrupted: false, .. }
            | Self::Link(_) => BROKEN_OFF,
            Self::Read(_)
            | Self::File { .. }
            | Self::Fit { .. }
            | Self::Tape { .. }
            | Self::SettingsFile { .. }
            | Self::NotDrawn { .. }
            | Self::TooLarge { .. }
            | Self::NotStreamed { .. }
            | Self::NotResumed { .. }
            | Self::StoppedBefore { .. }
            | Self::StoppedByPlotter { .. }
            | Self::NoSuchMachine(_)
            | Self::MotionOfOtherMachine
            | Self::Board { .. }
            | Self::EmulatorBroke { .. }
            | Self::Write { .. }
            | Self::OutputIsInput { .. }
            | Self::OutputTwice { .. }
            | Self::PageNotBuilt { .. }
            | Self::PageNotServed { .. }
            | Self::PageFileTooLarge { .. }
            | Self::Picture(_) => NOT_DONE,
        }
    }
}

/// Lists the ports that were looked at.
fn looked_at(looked: &[String]) -> String {
    match looked.is_empty() {
        true => "this computer has no serial port on USB".to_owned(),
        false => looked.join("; "),
    }
}

/// Names the file with the last words of the emulator, if there is one.
fn details_in(details: Option<&Path>) -> String {
    let what = |file: &Path| format!("; what it said last is in {}", file.display());
    details.map(what).unwrap_or_default()
}

/// Formats a fitting error; a line is cited as `file:number`, as in every other message.
fn not_fitted(file: &str, error: &FitError) -> String {
    match error {
        FitError::Line { number, reason } => format!("{file}:{number}: {reason}"),
        error => format!("{file}: {error}"),
    }
}

fn said(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!(": it said \"{text}\"") }
}

/// Names the line that was not answered.
fn waiting_for(line: Option<&JobLine>) -> String {
    match line.map(|line| (&line.sent, &line.origin)) {
        None => String::new(),
        Some((_, Some(origin))) => format!(", at line {} of {}", origin.line, origin.file),
        Some((sent, None)) => format!(", asked for {}", as_option(sent)),
    }
}

/// The cause of an alarm, and what to do about it; `None` if this program does not know it.
fn alarm(number: u16) -> Option<(&'static str, String)> {
    let entry = alarm_entries().into_iter().find(|entry| u16::from(entry.number) == number)?;
    Some((entry.cause.get(), sentence(entry.for_client.get())))
}

/// Says what an alarm means and what to do about it.
fn alarmed(number: u16, messages: &[String]) -> String {
    let said = said(&for_client(&messages.join("; ")));
    match alarm(number) {
        Some((cause, cure)) => {
            format!("the plotter stopped with alarm {number}: {cause}{said}\n{cure}")
        }
        None => format!(
            "the plotter stopped with alarm {number}, which this program does not know{said}\n\
             Its firmware is of another version than this program"
        ),
    }
}

/// Names the alarm after which a machine is locked, and says what to do.
fn locked(number: Option<u16>) -> String {
    let Some(number) = number else { return format!("an alarm\n{}", remedy("Alarm")) };
    match alarm(number) {
        Some((cause, cure)) => format!("alarm {number}: {cause}\n{cure}"),
        None => format!("alarm {number}\n{}", remedy("Alarm")),
    }
}

/// The text with a capital letter at its beginning.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

/// Says what the user can do about a state of the machine.
fn remedy(state: &str) -> &'static str {
    match state {
        "Alarm" => "Free the machine, then home or unlock it",
        "Hold" => "It waits in the middle of a job: resume or abort that first",
        _ => "Wait until it has finished, or abort its job",
    }
}

/// Explains why the plotter refused a line.
fn refusal(line: &JobLine, number: u16, messages: &[String]) -> String {
    let reason = explained(number, messages);
    match &line.origin {
        Some(origin) => {
            let Origin { file, line, .. } = origin;
            format!("{file}:{line}: {reason}\n    {}", origin.shown())
        }
        None => format!("the plotter refuses {}: {reason}", as_option(&line.sent)),
    }
}
