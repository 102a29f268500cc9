//! The words of the line: what is sent to a plotter and what may come back.
//!
//! Everything that the client knows by name of the plotter's language stands here.
//! `docs/protocol.md` describes the language itself.

use penup::checksum::CRC_16;
use penup::protocol::MEANINGS;
use std::fmt::Write as _;

/// Forget the model.
pub const CLEAR: &str = "$clear";
/// Tell how large the model is, the checksums of the model and of the options, and what came of the
/// last job.
pub const MODEL: &str = "$model";
/// Draw the model with the present settings.
pub const PLOT: &str = "$plot";

/// Let the plotter choose the camera. Later camera settings replace its choice one by one.
pub const VIEW_AUTO: &str = "$view=auto";
/// The point that the eye is at.
pub const EYE: &str = "$eye";
/// The point that the eye looks at.
pub const AT: &str = "$at";
/// The direction that is up in the picture.
pub const UP: &str = "$up";
/// Harrison's rotation.
pub const ANGLES: &str = "$angles";
/// What becomes of what is behind the eye.
pub const BEHIND: &str = "$behind";
/// Whether faces that pass through each other show where.
pub const SEAMS: &str = "$seams";
/// Whether blocks that touch are one shape.
pub const BLOCKS: &str = "$blocks";
/// Edges that bend less are left out.
pub const CREASE: &str = "$crease";
/// How far coordinates may be off.
pub const PRECISION: &str = "$precision";
/// Perspective or another.
pub const PROJECTION: &str = "$projection";
/// How it is found out what is seen.
pub const SEE: &str = "$see";
/// How the moves between strokes are chosen.
pub const ORDER: &str = "$order";
/// Whether the pen returns to where it began.
pub const CYCLE: &str = "$cycle";
/// Work to improve the order.
pub const EFFORT: &str = "$effort";
/// What a lift is worth, in millimetres.
pub const LIFT: &str = "$lift";
/// What is done with hidden lines.
pub const HIDDEN: &str = "$hidden";
/// Width x height of the page in millimetres.
pub const PAGE: &str = "$page";
/// What stays free on each side, in millimetres.
pub const MARGIN: &str = "$margin";
/// Whether the file chooses pens.
pub const PENS: &str = "$pens";
/// What stands below the drawing.
pub const TITLE: &str = "$title";
/// Height of its capitals, in millimetres.
pub const TITLE_SIZE: &str = "$title-size";
/// `on`: scale to the page; `off`: scale solids only and leave plans at true size.
pub const FIT: &str = "$fit";

/// With a number: sets the number of the last line. Without: asks for it.
pub const LAST_NUMBER: &str = "M110";
/// Ends the obligation to send numbers and checksums.
pub const END: &str = "M2";

/// A line with its number and its checksum, without the line end.
///
/// ```
/// use penup_client::protocol::numbered;
/// assert_eq!(numbered(Some(17), "v 0 1 0"), "N17 v 0 1 0*D673");
/// assert_eq!(numbered(None, "M110"), "M110*21B8");
/// ```
pub fn numbered(number: Option<i32>, text: &str) -> String {
    let head = match number {
        Some(number) => format!("N{number} {text}"),
        None => text.to_owned(),
    };
    format!("{head}*{:04X}", CRC_16.checksum(head.as_bytes()))
}

/// Asks for a status report; answered at once, between two lines.
pub const STATUS_QUERY: u8 = b'?';
/// Go on.
pub const RESUME: u8 = b'~';
/// Give up whatever is going on, pen up, answer with the greeting.
pub const ABORT: u8 = 0x18;

/// Bytes that the plotter may be sent before it has answered for them: a little less than its
/// receive queue of 256 holds, so that a status query always fits.
pub const RECEIVE_WINDOW: usize = 240;

/// Whether `letter` acts at once wherever it stands, or ends a line, so that no line may hold it.
pub fn acts_at_once(letter: char) -> bool {
    matches!(letter, '?' | '!' | '~') || letter.is_ascii_control() && letter != '\t'
}

/// Whether the greeting, Grbl's with the firmware's own name in brackets, is that of a penup.
pub fn is_penup(greeting: &str) -> bool {
    greeting.starts_with("Grbl ") && greeting.contains("[penup ")
}

/// What `error:number` means.
///
/// ```
/// use penup_client::protocol::meaning;
/// assert_eq!(meaning(9999), "a reason that this client does not know");
/// ```
pub fn meaning(number: u16) -> &'static str {
    let known = MEANINGS.iter().find(|(known, _)| *known == number);
    known.map_or("a reason that this client does not know", |(_, text)| text)
}

/// One line from the plotter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reply {
    /// The line with this number was carried out, and so were all before it that are not named as
    /// refused.
    Done(i32),
    /// The line with this number was refused with this error.
    Refused(i32, u16),
    /// This line is expected; the one that is answered was not accepted.
    Resend(i32),
    /// The last line that was accepted.
    Last(i32),
    /// The checksums of the model and of the options.
    Contents([u32; 2]),
    /// A line without a number was carried out.
    Ok,
    /// A line without a number was refused.
    Error(u16),
    /// The machine stopped by itself.
    Alarm(u16),
    /// It has started, or started again.
    Greeting(String),
    /// Answer to a status query.
    Status(Status),
    /// `[MSG:text]`, for people.
    Message(String),
    /// Anything else.
    Other(String),
}

/// `<State|Key:value|...>`
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// Idle, Run, Hold, Alarm and so on.
    pub state: String,
    /// `Strokes:done/all`, while a drawing is drawn.
    pub strokes: Option<(u64, u64)>,
    /// Whether it computes a picture, and so reads no line.
    pub is_computing: bool,
    /// `Alarm:number`, after an alarm.
    pub alarm: Option<u16>,
    /// `Pen:number`, if it stands and waits for that pen.
    pub pen_wanted: Option<u8>,
    /// Where it is, in its own words.
    pub position: String,
}

impl Status {
    /// Whether the machine holds, or slows down to do so.
    pub fn is_holding(&self) -> bool {
        self.state == "Hold"
    }

    /// Whether the plotter waits for work.
    pub fn is_idle(&self) -> bool {
        matches!(self.state.as_str(), "Idle" | "Sleep" | "Check")
    }
}

impl Reply {
    /// Reads a line without its line end.
    ///
    /// ```
    /// use penup_client::protocol::Reply;
    /// assert_eq!(Reply::parse("ok"), Reply::Ok);
    /// assert_eq!(Reply::parse("error:7"), Reply::Error(7));
    /// let Reply::Status(status) = Reply::parse("<Run|MPos:1.0,2.0|Strokes:3/12>") else { panic!() };
    /// assert_eq!((status.state.as_str(), status.strokes), ("Run", Some((3, 12))));
    /// ```
    pub fn parse(line: &str) -> Self {
        let numbered = |prefix| line.strip_prefix(prefix).and_then(|n: &str| n.parse().ok());
        let enclosed = |open, close: char| -> Option<&str> {
            line.strip_prefix::<&str>(open)?.strip_suffix(close)
        };
        if let Some(reply) = parse_checked(line) {
            reply
        } else if line == "ok" {
            Self::Ok
        } else if let Some(number) = numbered("error:") {
            Self::Error(number)
        } else if let Some(number) = numbered("ALARM:") {
            Self::Alarm(number)
        } else if line.starts_with("Grbl ") {
            Self::Greeting(line.to_owned())
        } else if let Some(text) = enclosed("[MSG:", ']') {
            Self::Message(text.to_owned())
        } else if let Some(contents) = enclosed("[MODEL:checksum ", ']').and_then(parse_contents) {
            Self::Contents(contents)
        } else if let Some(status) = enclosed("<", '>').and_then(parse_status) {
            Self::Status(status)
        } else {
            Self::Other(line.to_owned())
        }
    }
}

/// A reply with a checksum, if it is whole.
fn parse_checked(line: &str) -> Option<Reply> {
    let (head, sum) = line.rsplit_once('*')?;
    if sum.len() != 4 || u16::from_str_radix(sum, 16) != Ok(CRC_16.checksum(head.as_bytes())) {
        return None;
    }
    let number = |prefix| head.strip_prefix(prefix).and_then(|number: &str| number.parse().ok());
    let done = number("ok N").map(Reply::Done);
    let other = done.or_else(|| number("Resend: ").map(Reply::Resend));
    other.or_else(|| number("Line: ").map(Reply::Last)).or_else(|| {
        let (error, number) = head.strip_prefix("error:")?.split_once(" N")?;
        Some(Reply::Refused(number.parse().ok()?, error.parse().ok()?))
    })
}

/// `12345678, options 12345678`
fn parse_contents(text: &str) -> Option<[u32; 2]> {
    let (model, options) = text.split_once(", options ")?;
    let sum = |text: &str| (text.len() == 8).then(|| u32::from_str_radix(text, 16).ok())?;
    Some([sum(model)?, sum(options)?])
}

/// The states that a machine can be in, of Grbl's those that penup has.
const STATES: &[&str] = &["Idle", "Run", "Hold", "Jog", "Home", "Alarm", "Check", "Sleep", "Door"];

/// A status report; `None` if it was damaged on the line.
fn parse_status(report: &str) -> Option<Status> {
    let mut fields = report.split('|');
    // Grbl says Hold:0, Door:1.
    let full_state = fields.next().unwrap_or_default();
    let state = full_state.split(':').next().filter(|state| STATES.contains(state))?.to_owned();
    let field = |name: &str| fields.clone().find_map(|field| field.strip_prefix(name));
    let strokes = field("Strokes:").and_then(|strokes| strokes.split_once('/'));
    let strokes = strokes.and_then(|(done, all)| Some((done.parse().ok()?, all.parse().ok()?)));
    let pen_wanted = field("Pen:").filter(|_| full_state == "Hold:0");
    Some(Status {
        state,
        strokes,
        is_computing: field("Stage:").is_some(),
        alarm: field("Alarm:").and_then(|alarm| alarm.parse().ok()),
        pen_wanted: pen_wanted.and_then(|pen| pen.parse().ok()),
        position: field("MPos:").unwrap_or_default().to_owned(),
    })
}

/// Bytes to replies. Lines that are longer than any reply are cut.
#[derive(Debug, Default)]
pub struct ReplyReader {
    partial: Vec<u8>,
}

impl ReplyReader {
    const LONGEST: usize = 512;

    /// Takes one byte; gives a reply if it ended a line that was not empty.
    pub fn push(&mut self, byte: u8) -> Option<Reply> {
        if byte != b'\n' && byte != b'\r' {
            if self.partial.len() < Self::LONGEST {
                self.partial.push(byte);
            }
            return None;
        }
        let line = std::mem::take(&mut self.partial);
        let text = String::from_utf8_lossy(&line);
        let text = text.trim();
        (!text.is_empty()).then(|| Reply::parse(text))
    }
}

/// `name=a,b,c` with plain decimals: the plotter reads no exponents.
///
/// ```
/// let line = penup_client::protocol::setting("$eye", &[-3.0, 1e-3, 2.5], ',');
/// assert_eq!(line, "$eye=-3,0.001,2.5");
/// ```
pub fn setting(name: &str, values: &[f64], separator: char) -> String {
    let mut line = format!("{name}=");
    for (i, value) in values.iter().enumerate() {
        if i > 0 {
            line.push(separator);
        }
        // Writing to a string cannot fail.
        let _ = write!(line, "{value}");
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replies(bytes: &[u8]) -> Vec<Reply> {
        let mut reader = ReplyReader::default();
        bytes.iter().filter_map(|&byte| reader.push(byte)).collect()
    }

    #[test]
    fn replies_end_with_any_line_end_and_empty_lines_are_none() {
        assert_eq!(
            replies(b"\r\nok\r\n\n\nerror:12\nok\rok"),
            [Reply::Ok, Reply::Error(12), Reply::Ok]
        );
    }

    #[test]
    fn noise_is_neither_an_answer_nor_a_crash() {
        for noise in [
            "okay",
            "OK",
            "error:",
            "error:x",
            "error:70000",
            "<Idle",
            "Idle>",
            "[MSG:",
            "<>",
            "<|Strokes:>",
            "<Run|Strokes:9>",
            "<Run|Strokes:a/b>",
        ] {
            let reply = Reply::parse(noise);
            assert!(
                !matches!(reply, Reply::Ok | Reply::Error(_) | Reply::Greeting(_)),
                "{noise} was taken for {reply:?}"
            );
        }
        assert_eq!(replies(&[0xFF; 3000]), []);
        let mut long = vec![b'x'; 3000];
        long.extend_from_slice(b"\nok\n");
        assert_eq!(replies(&long).last(), Some(&Reply::Ok));
    }

    #[test]
    fn a_status_gives_its_state_without_the_sub_state() {
        let Reply::Status(status) = Reply::parse("<Hold:0|MPos:1,2>") else {
            panic!("no status");
        };
        assert_eq!((status.state.as_str(), status.strokes), ("Hold", None));
        assert!(!status.is_idle());
        let pen = |line| match Reply::parse(line) {
            Reply::Status(status) => (status.pen_wanted, status.position),
            other => panic!("{other:?}"),
        };
        assert_eq!(pen("<Hold:0|MPos:1,2|Pen:3|Left:9>"), (Some(3), "1,2".to_owned()));
        assert_eq!(pen("<Hold:1|MPos:1,2|Pen:3|Left:9>").0, None, "it does not stand yet");
    }
}
