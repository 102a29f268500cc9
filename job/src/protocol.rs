//! The vocabulary of the serial protocol: the commands for a plotter and the replies that it may
//! send.
//!
//! All names of commands that the client uses are defined here; those of options are the library's.
//! `docs/protocol.md` describes the protocol itself.

use penup::checksum::CRC_16;

/// Deletes the model.
pub const CLEAR: &str = "$clear";
/// Queries the size of the model, the checksums of the model and of the options, and the report on
/// the last job.
pub const MODEL: &str = "$model";
/// Draws the model with the current settings.
pub const PLOT: &str = "$plot";
/// Draws the last job again, which the plotter has kept.
pub const AGAIN: &str = "$again";
/// Goes on with the job that a loss of power or a reset has stopped.
pub const GO_ON: &str = "$resume";
/// Does the same as [`GO_ON`], where the user has put the pen at the origin by hand.
pub const GO_ON_AT_ORIGIN: &str = "$resume=origin";
/// Queries how much of a drawing has come that a computer sends while it is drawn.
pub const STREAM: &str = "$stream";
/// Queries version, board and limits.
pub const BUILD: &str = "$I";
/// Lists the settings of the machine.
pub const SETTINGS: &str = "$$";
/// Finds the limit switches.
pub const HOME: &str = "$H";
/// Unlocks the machine after an alarm, and wakes it.
pub const UNLOCK: &str = "$X";
/// Lowers the pen, unless by the settings of the machine Z or S does it. The plotter raises it
/// again when no more lines come.
pub const PEN_DOWN: &str = "M3";
/// Raises the pen.
pub const PEN_UP: &str = "M5";

/// Lets the plotter choose the camera. Later camera settings override its choice one by one.
pub const VIEW_AUTO: &str = "$view=auto";
/// The name of the option that chooses who assigns pens. The names of the other options are those
/// of the library's table.
pub const PENS: &str = "pens";

/// With a line number of its own, sets the number of the last line to that; without one, queries
/// the number of the last accepted line.
pub const LAST_NUMBER: &str = "M110";
/// Ends the conversation with numbers and checksums, after which plain lines are accepted again.
pub const END: &str = "M2";

/// Formats a line with its number, if it has one, and its checksum, without the line end.
///
/// ```
/// use penup_job::protocol::numbered;
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

/// Queries a status report. The plotter answers at once, even between two lines.
pub const STATUS_QUERY: u8 = b'?';
/// Holds: the machine slows down on its path and raises the pen.
pub const HOLD: u8 = b'!';
/// Pauses at the end of the stroke that is being drawn.
pub const PAUSE_AFTER_STROKE: u8 = 0xFB;
/// Resumes after a feed hold.
pub const RESUME: u8 = b'~';
/// Lowers or raises all speeds by a tenth of those in the settings.
pub const SLOWER: u8 = 0x92;
/// See [`SLOWER`].
pub const FASTER: u8 = 0x91;
/// Sets all speeds to those in the settings.
pub const AS_SET: u8 = 0x90;
/// Aborts whatever is going on, raises the pen and makes the plotter answer with its greeting.
pub const ABORT: u8 = 0x18;

/// The maximum number of bytes that may be sent before the plotter has answered them. It is a
/// little less than the 256 bytes of its receive queue, so that a status query always fits.
pub const RECEIVE_WINDOW: usize = 240;

/// Whether a greeting comes from penup firmware: it is Grbl's greeting with the firmware's own name
/// in brackets.
pub fn is_penup(greeting: &str) -> bool {
    greeting.starts_with("Grbl ") && greeting.contains("[penup ")
}

/// A line that the plotter sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reply {
    /// The line with this number was executed, and so were all earlier lines that are not reported
    /// as refused.
    Done(i32),
    /// The line with this number was refused with this error number.
    Refused(i32, u16),
    /// The plotter expects the line with this number; the line that it answers was not accepted.
    Resend(i32),
    /// The number of the last line that was accepted.
    Last(i32),
    /// The checksums of the model and of the options that the plotter holds.
    Contents([u32; 2]),
    /// A line without a number was executed.
    Ok,
    /// A line without a number was refused with this error number.
    Error(u16),
    /// The machine stopped with this alarm number.
    Alarm(u16),
    /// The greeting, which the plotter sends when it starts and after an abort.
    Greeting(String),
    /// The answer to a status query.
    Status(Status),
    /// The text of `[MSG:text]`, a message for the user.
    Message(String),
    /// Any other line.
    Other(String),
}

/// How many strokes of all are drawn, in words; `all` is 0 if that is not known.
pub fn strokes_drawn(done: u64, all: u64) -> String {
    let noun = |count: u64| if count == 1 { "stroke" } else { "strokes" };
    match all {
        0 => format!("{done} {}", noun(done)),
        _ => format!("{done} of {all} {}", noun(all)),
    }
}

/// A status report, `<State|Key:value|...>`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Status {
    /// The state without its sub-state: Idle, Run, Hold, Alarm and so on.
    pub state: String,
    /// Whether the machine is at rest in a feed hold (`Hold:0`), no longer slowing down.
    pub is_standing: bool,
    /// The numbers of `Drawn:done/all`, which is reported during a drawing.
    pub strokes: Option<(u64, u64)>,
    /// The numbers of `Stopped:done/all`, if a job has stopped that can go on. The second is 0 as
    /// long as nobody knows it.
    pub stopped: Option<(u64, u64)>,
    /// The lengths of `Ink:done/all`, drawn and to draw, in whole mm.
    pub ink: Option<(u64, u64)>,
    /// The numbers of `Stream:taken/all,room`, if strokes are drawn while they are sent: the
    /// targets that have come, all of them, and for how many more there is room.
    pub stream: Option<[u32; 3]>,
    /// The seconds of `Left:seconds` until the end of the job.
    pub seconds_left: Option<u64>,
    /// The stage that the plotter computes: view, visibility or order.
    pub stage: Option<String>,
    /// The speeds in percent of those in the settings. Most reports do not tell them.
    pub percent: Option<u16>,
    /// The letters of the contacts that are pressed: X, Y, and E for the emergency stop.
    pub contacts: String,
    /// Whether the plotter is computing a picture, during which it reads no lines.
    pub is_computing: bool,
    /// The number of `Alarm:number`, which is reported after an alarm.
    pub alarm: Option<u16>,
    /// The number of `Pen:number`, if the machine has stopped and waits for that pen.
    pub pen_wanted: Option<u8>,
    /// The machine position in mm; empty if the report does not tell it.
    pub position: String,
    /// What the report tells in the coordinates of a program, if anything.
    pub work: Option<Box<WorkCoordinates>>,
}

/// What a status report tells in the coordinates of a program, in mm.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct WorkCoordinates {
    /// The position; empty if the report does not tell it.
    pub position: String,
    /// Where the origin of these coordinates is; empty in most reports.
    pub offset: String,
}

impl Status {
    /// Whether the machine is in feed hold or decelerates for one.
    pub fn is_holding(&self) -> bool {
        self.state == "Hold"
    }

    /// Whether the machine is locked after an alarm.
    pub fn is_alarm(&self) -> bool {
        self.state == "Alarm"
    }

    /// Takes what the report does not tell from an `earlier` one: the speeds, and what the position
    /// depends on. The plotter reports both anew as soon as they change.
    pub fn complete(&mut self, earlier: &Self) {
        self.percent = self.percent.or(earlier.percent);
        let work = self.work.get_or_insert_default();
        if let Some(earlier) = &earlier.work
            && work.offset.is_empty()
        {
            work.offset.clone_from(&earlier.offset);
        }
        let [at, from] = [&work.position, &work.offset].map(|text| numbers(text));
        if self.position.is_empty() && !from.is_empty() {
            let sums = at.into_iter().zip(from).map(|(at, from)| at + from);
            self.position = in_words(sums);
        }
    }

    /// Whether the report tells the machine position and the speeds.
    pub fn is_complete(&self) -> bool {
        self.percent.is_some() && !self.position.is_empty()
    }

    /// Whether the plotter is ready for a job.
    pub fn is_idle(&self) -> bool {
        matches!(self.state.as_str(), "Idle" | "Sleep" | "Check")
    }
}

impl Reply {
    /// Parses a line without its line end.
    ///
    /// ```
    /// use penup_job::protocol::Reply;
    /// assert_eq!(Reply::parse("ok"), Reply::Ok);
    /// assert_eq!(Reply::parse("error:7"), Reply::Error(7));
    /// let Reply::Status(status) = Reply::parse("<Run|MPos:1.0,2.0|Drawn:3/12>") else { panic!()
    /// }; assert_eq!((status.state.as_str(), status.strokes), ("Run", Some((3, 12))));
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

/// Parses a reply that carries a checksum; `None` if it has none or was corrupted.
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

/// Parses two checksums of the form `12345678, options 12345678`.
fn parse_contents(text: &str) -> Option<[u32; 2]> {
    let (model, options) = text.split_once(", options ")?;
    let sum = |text: &str| (text.len() == 8).then(|| u32::from_str_radix(text, 16).ok())?;
    Some([sum(model)?, sum(options)?])
}

/// The machine states: those of Grbl that penup uses.
const STATES: &[&str] = &["Idle", "Run", "Hold", "Jog", "Home", "Alarm", "Check", "Sleep", "Door"];

/// Coordinates as numbers, up to the first that is none.
fn numbers(text: &str) -> Vec<f64> {
    text.split(',').map_while(|number| number.parse().ok()).collect()
}

/// Writes coordinates in mm as a plotter does.
fn in_words(coordinates: impl Iterator<Item = f64>) -> String {
    // A sum with zero has no negative zero.
    let rounded = coordinates.map(|mm| (mm * 1000.0).round() / 1000.0 + 0.0);
    rounded.map(|mm| format!("{mm:.3}")).collect::<Vec<_>>().join(",")
}

/// Coordinates of a report, in mm. Those in inches have four decimals, all others three.
fn in_mm(text: &str) -> String {
    let decimals = |number: &str| number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    match text.split(',').all(|number| decimals(number) == 4) {
        true => in_words(numbers(text).into_iter().map(|inches| inches * 25.4)),
        false => text.to_owned(),
    }
}

/// Parses a status report; `None` if it was corrupted on the line.
fn parse_status(report: &str) -> Option<Status> {
    let mut fields = report.split('|');
    // Grbl reports states with sub-states, such as `Hold:0` and `Door:1`.
    let full_state = fields.next().unwrap_or_default();
    let state = full_state.split(':').next().filter(|state| STATES.contains(state))?.to_owned();
    let field = |name: &str| fields.clone().find_map(|field| field.strip_prefix(name));
    let done_of_all = |name| {
        let (done, all): (&str, &str) = field(name)?.split_once('/')?;
        Some((done.parse().ok()?, all.parse().ok()?))
    };
    let stream = || -> Option<[u32; 3]> {
        let (counts, room) = field("Stream:")?.split_once(',')?;
        let (taken, all) = counts.split_once('/')?;
        Some([taken.parse().ok()?, all.parse().ok()?, room.parse().ok()?])
    };
    let percent = field("Ov:").and_then(|percents| percents.split(',').next()?.parse().ok());
    let is_standing = full_state == "Hold:0";
    let pen_wanted = field("Pen:").filter(|_| is_standing);
    let stage = field("Stage:");
    let coordinates = |name| field(name).map(in_mm).unwrap_or_default();
    let mut status = Status {
        state,
        is_standing,
        strokes: done_of_all("Drawn:"),
        stopped: done_of_all("Stopped:"),
        stream: stream(),
        ink: done_of_all("Ink:"),
        seconds_left: field("Left:").and_then(|seconds| seconds.parse().ok()),
        stage: stage.map(str::to_owned),
        percent,
        contacts: field("Pn:").unwrap_or_default().to_owned(),
        is_computing: stage.is_some(),
        alarm: field("Alarm:").and_then(|alarm| alarm.parse().ok()),
        pen_wanted: pen_wanted.and_then(|pen| pen.parse().ok()),
        position: coordinates("MPos:"),
        work: Some(Box::new(WorkCoordinates {
            position: coordinates("WPos:"),
            offset: coordinates("WCO:"),
        })),
    };
    status.complete(&Status::default());
    Some(status)
}

/// Assembles received bytes into replies. Lines that are longer than any reply are truncated.
#[derive(Debug, Default)]
pub struct ReplyReader {
    partial: Vec<u8>,
}

impl ReplyReader {
    const LONGEST: usize = 512;

    /// Processes one byte; returns a reply if the byte ended a line that is not empty.
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
            "<|Drawn:>",
            "<Run|Drawn:9>",
            "<Run|Drawn:a/b>",
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
    fn a_status_tells_ink_time_and_speed() {
        let status = |line| match Reply::parse(line) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        };
        let run = "<Run|MPos:1.000,2.000,0.000|Ov:120,100,100|Pn:XE|Drawn:3/12|Ink:40/90|Left:75>";
        let run = status(run);
        assert_eq!(
            (run.strokes, run.ink, run.seconds_left),
            (Some((3, 12)), Some((40, 90)), Some(75))
        );
        assert_eq!(
            (run.percent, run.contacts.as_str(), run.stage.as_deref()),
            (Some(120), "XE", None)
        );
        assert!(
            status("<Hold:0|MPos:1,2>").is_standing && !status("<Hold:1|MPos:1,2>").is_standing
        );
        let stopped = status("<Idle|MPos:0,0,0|Stopped:4/9|Drawn:0/0>");
        assert_eq!((stopped.stopped, run.stopped), (Some((4, 9)), None));
        assert_eq!([strokes_drawn(4, 9), strokes_drawn(4, 0)], ["4 of 9 strokes", "4 strokes"]);
        assert_eq!([strokes_drawn(0, 1), strokes_drawn(1, 0)], ["0 of 1 stroke", "1 stroke"]);
        let computing = status("<Run|MPos:0,0,0|Stage:order>");
        assert_eq!(
            (computing.stage.as_deref(), computing.ink, computing.percent),
            (Some("order"), None, None)
        );
    }

    #[test]
    fn a_position_is_that_of_the_machine_in_millimetres() {
        let status = |line| match Reply::parse(line) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        };
        let with_offset =
            status("<Idle|WPos:1.500,-7.000,0.000|WCO:5.000,7.000,0.000|Ov:90,100,100>");
        assert_eq!(
            (with_offset.position.as_str(), with_offset.is_complete()),
            ("6.500,0.000,0.000", true)
        );
        for (report, position) in [
            ("<Idle|MPos:7.500,20.500,0.000>", "7.500,20.500,0.000"),
            ("<Idle|MPos:0.2953,-0.8071,0.0000>", "7.501,-20.500,0.000"),
            ("<Idle|WPos:1.000,2.000,0.000>", "6.000,9.000,0.000"),
            ("<Idle|WPos:0.0984,0.0000,0.0000|WCO:0.1969,0.2756,0.0000>", "7.500,7.000,0.000"),
        ] {
            let mut status = status(report);
            status.complete(&with_offset);
            assert_eq!(
                (status.position.as_str(), status.percent),
                (position, Some(90)),
                "{report}"
            );
        }
        assert!(status("<Idle|WPos:1.000,2.000,0.000>").position.is_empty());
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
