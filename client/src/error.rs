//! What can go wrong between a file and its picture, in words that say what to do.

use crate::fit::FitError;
use crate::interrupt::EXIT_CODE;
use crate::protocol::RECEIVE_WINDOW;
use crate::source::{JobLine, Origin};
use crate::words::{asked, explained, told};
use penup::protocol::CommandError;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Why there is no drawing.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The file cannot be read.
    #[error("cannot read {file}: {source}")]
    File {
        /// As the user named it.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The file's name does not say that it is one that penup reads.
    #[error("{file}: penup reads Wavefront OBJ files, whose names end in .obj")]
    Extension {
        /// As the user named it.
        file: String,
    },
    /// The file's polylines cannot be fitted.
    #[error("{}", not_fitted(file, source))]
    Fit {
        /// As the user named it.
        file: String,
        /// Why.
        source: FitError,
    },
    /// Four holes of a tape that are no instruction.
    #[error("{file}: row {row} of the tape holds {code}, which is no instruction")]
    Tape {
        /// As the user named it.
        file: String,
        /// The row, from 0.
        row: u32,
        /// 12 to 15.
        code: u8,
    },
    /// A file must not command the machine.
    #[error("{}:{}: a file cannot hold commands for the plotter\n    {}", origin.file, origin.line, origin.shown())]
    CommandInFile {
        /// Where it stands.
        origin: Origin,
    },
    /// A line that no plotter takes.
    #[error(
        "{}:{}: {}\n    {}", origin.file, origin.line,
        explained(refusal.number(), &[refusal.to_string()]), origin.shown()
    )]
    BadLine {
        /// Where it stands.
        origin: Origin,
        /// What the plotter would say of it.
        refusal: CommandError,
    },
    /// A line of the file has more bytes than a plotter takes.
    #[error(
        "{}:{}: the line has {length} bytes, and a line may have at most {limit}\n    {}",
        origin.file, origin.line, origin.shown()
    )]
    LineTooLong {
        /// Where it stands.
        origin: Origin,
        /// Bytes of the line.
        length: usize,
        /// The most that it may have.
        limit: usize,
    },
    /// A line of the file holds a NUL byte.
    #[error(
        "{}:{}: this is no text, and an OBJ file is: is it another file under this name?",
        origin.file, origin.line
    )]
    NotText {
        /// Where it stands.
        origin: Origin,
    },
    /// The file is UTF-16.
    #[error("{file}: this is UTF-16 text: save it as UTF-8")]
    Utf16 {
        /// As the user named it.
        file: String,
    },
    /// The file has more bytes than penup counts.
    #[error("{file}: the file is larger than 4 GB, which is more than any plotter takes")]
    FileTooLarge {
        /// As the user named it.
        file: String,
    },
    /// The port cannot be opened.
    #[error(
        "cannot open {device}: {source}\nIs it the right port, is the plotter plugged in, may you use the port \
         (on Linux: group dialout), and does no other program hold it?"
    )]
    Port {
        /// As the user named it.
        device: String,
        /// What the system says.
        source: serialport::Error,
    },
    /// The library refuses the drawing on this computer.
    #[error("cannot draw it: {}", explained(refusal.number(), &[refusal.to_string()]))]
    NotDrawn {
        /// Why.
        refusal: CommandError,
    },
    /// The emulator ended in the middle of the work.
    #[error(
        "the emulator of the {board} board broke: it {how}\n\
         Run it once more, and `cargo xtask set-up` if it breaks again{}", kept(details.as_deref())
    )]
    EmulatorBroke {
        /// The board's name.
        board: String,
        /// What became of it.
        how: String,
        /// The file with what the emulator said last.
        details: Option<PathBuf>,
    },
    /// The emulated board or the board in memory could not be started.
    #[error("cannot start the {board} board: {reason}")]
    Board {
        /// Its name.
        board: String,
        /// Why.
        reason: String,
    },
    /// Nothing was heard.
    #[error(
        "the plotter does not answer ({} s without a byte{})\nIs it powered, is it the right port, and does it run \
         penup at 115200 baud?", patience.as_secs_f32(), waiting_for(line.as_deref())
    )]
    Silent {
        /// How long was waited.
        patience: Duration,
        /// The line that it did not answer, if it had been answering before.
        line: Option<Box<JobLine>>,
    },
    /// Bytes come, but not penup's.
    #[error(
        "what answers is not penup{}\nIs it the right port, and does the plotter run penup at 115200 baud?",
        said(heard)
    )]
    NotPenup {
        /// The last thing that it said.
        heard: String,
    },
    /// It is doing something else.
    #[error("the plotter is not ready: it reports {state}\n{}", remedy(state))]
    NotReady {
        /// Its state.
        state: String,
    },
    /// It answers status queries, but a line's answer never came.
    #[error(
        "the plotter is alive but never answered{}: bytes were lost on the line\nCheck the cable, and that nothing \
         else uses the port; a penup plotter takes {RECEIVE_WINDOW} bytes without a pause", waiting_for(line.as_deref())
    )]
    LostLine {
        /// The line that was not answered.
        line: Option<Box<JobLine>>,
    },
    /// It refused a line.
    #[error("{}", refusal(line, *number, messages))]
    Refused {
        /// The line.
        line: Box<JobLine>,
        /// Its `error:N`.
        number: u16,
        /// What it said just before.
        messages: Vec<String>,
    },
    /// The machine stopped by itself.
    #[error("the plotter stopped with alarm {number}{}\nSee docs/protocol.md for the alarm's meaning", said(&told(&messages.join("; "))))]
    Alarm {
        /// Its `ALARM:N`.
        number: u16,
        /// What it said just before.
        messages: Vec<String>,
    },
    /// It started again in the middle of the job.
    #[error(
        "the plotter gave up in the middle of the job and started again\nEither it was sent ctrl-X, at another \
         port or by a byte that was damaged on the line, or it was reset: check the cable and the power supply"
    )]
    Restarted,
    /// The line damages so many bytes that a line of the job never arrives.
    #[error(
        "the line to the plotter damages too many bytes: {times} times a line did not arrive whole{}\nUse a \
         shorter or better cable, and keep it away from the motors", waiting_for(line.as_deref())
    )]
    Damaged {
        /// The line.
        line: Option<Box<JobLine>>,
        /// How often it was sent.
        times: u32,
    },
    /// It answers, but not to lines with numbers and checksums.
    #[error(
        "the plotter's firmware is older than this program: it does not know lines with checksums\nWrite the \
         firmware of this version to the board first: see docs/building.md"
    )]
    WithoutNumbers,
    /// After everything was sent the plotter holds another model, or other options.
    #[error(
        "the plotter holds something else than was sent to it, so nothing is drawn\nDoes another program send to \
         it at the same time, or is its firmware of another version than this program?"
    )]
    OtherContents,
    /// The machine holds, and nobody lets it go on.
    #[error(
        "the machine holds in the middle of the drawing, with the pen up: somebody pressed hold at another port, or a \
         byte was damaged on the line\nSend ~ to the plotter to let it go on, or ctrl-X to give the drawing up"
    )]
    Held,
    /// The link broke.
    #[error("the line to the plotter broke: {0}")]
    Link(#[from] io::Error),
    /// A result cannot be written.
    #[error("cannot write {file}: {source}")]
    Write {
        /// As the user named it.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// A result would replace the file that it is made from.
    #[error(
        "{output} is the file to read: give the result another name, so that it is not overwritten"
    )]
    OutputIsInput {
        /// As the user named it.
        output: String,
    },
    /// Two results would go into one file.
    #[error("{first} and {second} are one file: give each result a file of its own")]
    OutputTwice {
        /// As the user named it.
        first: String,
        /// As the user named it the second time.
        second: String,
    },
    /// A picture cannot be made.
    #[error("cannot make the picture: {0}")]
    Picture(String),
    /// The user gave the job up.
    #[error("given up: the plot was stopped and the pen is up")]
    Interrupted,
    /// The user gave the job up, and the plotter did not confirm that it stopped.
    #[error("given up, but the plotter did not confirm that it stopped: look after it")]
    InterruptedUnconfirmed,
}

impl Error {
    /// What the process ends with: 130, as shells have it, after Ctrl-C, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted | Self::InterruptedUnconfirmed => EXIT_CODE,
            _ => 1,
        }
    }
}

fn kept(details: Option<&Path>) -> String {
    let what = |file: &Path| format!("; what it said last is in {}", file.display());
    details.map(what).unwrap_or_default()
}

/// A line is named as in every other message.
fn not_fitted(file: &str, error: &FitError) -> String {
    match error {
        FitError::Line { number, reason } => format!("{file}:{number}: {reason}"),
        error => format!("{file}: {error}"),
    }
}

fn said(text: &str) -> String {
    if text.is_empty() { String::new() } else { format!(": it said \"{text}\"") }
}

fn waiting_for(line: Option<&JobLine>) -> String {
    match line.map(|line| (&line.sent, &line.origin)) {
        None => String::new(),
        Some((_, Some(origin))) => format!(", at line {} of {}", origin.line, origin.file),
        Some((sent, None)) => format!(", asked for {}", asked(sent)),
    }
}

fn remedy(state: &str) -> &'static str {
    match state {
        "Alarm" => "Free the machine, then home or unlock it",
        "Hold" => "It waits in the middle of a job: resume or abort that first",
        _ => "Wait until it has finished, or abort its job",
    }
}

fn refusal(line: &JobLine, number: u16, messages: &[String]) -> String {
    let reason = explained(number, messages);
    match &line.origin {
        Some(origin) => {
            let Origin { file, line, .. } = origin;
            format!("{file}:{line}: {reason}\n    {}", origin.shown())
        }
        None => format!("the plotter refuses {}: {reason}", asked(&line.sent)),
    }
}
