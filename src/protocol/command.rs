//! Parses lines into typed commands.

use super::edit::parse_edit;
use super::gcode::before_hash;
use super::values::{Decimals, PENS, coordinates, number, split_word, trim, trim_start, whole};
use super::{CommandError, GCode, Numbers, Significant, next_number};
use crate::curve::CurveError;
use crate::fixed::Decimal;
use crate::model::{self, Edit, ElementKind, ModelError, PenName};
use crate::text::{split_once, strip_first};

/// What a line asks the plotter to do, with its values already parsed.
#[derive(Debug, Clone, PartialEq)]
pub enum Command<'a> {
    /// An empty line, a comment, or a keyword of OBJ that changes nothing here.
    Nothing,
    /// `v x y z`: adds a vertex.
    Vertex([Decimal; 3]),
    /// `f a b c …`: adds a face.
    Face(Numbers<'a>),
    /// `l a b …`: adds a polyline of bars.
    Polyline(Numbers<'a>),
    /// `deg n`: sets the degree of the curves that follow.
    Degree(u8),
    /// `curv u0 u1 a b …`: begins a curve.
    Curve {
        /// The parameters at which the curve begins and ends.
        ends: [Decimal; 2],
        /// The vertex numbers of its control points.
        control: Numbers<'a>,
    },
    /// `parm u k1 k2 …`: adds knots to the curve that has begun.
    Knots(Decimals<'a>),
    /// `end`: completes the curve.
    EndCurve,
    /// `usemtl NAME` or `g NAME …`: chooses the pen of what follows.
    Pen {
        /// Whether the keyword is `usemtl`, and not `g`. Once there is a `usemtl`, pens are chosen
        /// by it alone.
        by_material: bool,
        /// The pen or name that follows the keyword. A number may be greater than that of the last
        /// pen.
        name: PenName,
    },
    /// `$`: lists the commands.
    Help,
    /// `$I`: reports version, board and limits.
    BuildInfo,
    /// `$$` and `$settings`: list the settings of the machine.
    Settings {
        /// Whether their names and units are listed as well: `$settings`.
        named: bool,
    },
    /// `$name=value`: sets an option of the plot, or a setting of the machine.
    Assign {
        /// The text before the equals sign. What is neither the name of an option nor the number
        /// of a setting is refused later.
        name: &'a str,
        /// The text of the new value. That of `$title=` is the rest of the line, unchanged.
        value: &'a str,
    },
    /// `$G`: reports the modes of G-code.
    Modes,
    /// `$#`: reports the coordinate systems and kept positions.
    Parameters,
    /// `$N`: lists the lines of G-code that are carried out at the start.
    StartupLines,
    /// `$N0=line` or `$N1=line`: sets such a line.
    SetStartupLine {
        /// The index of the line, 0 or 1.
        index: usize,
        /// The line.
        line: GCode<'a>,
    },
    /// `$I=text`: sets the text that `$I` reports.
    SetInfo(&'a str),
    /// `$RST=…`: restores defaults.
    Restore {
        /// Whether to reset the settings.
        settings: bool,
        /// Whether to reset the parameters of the coordinate systems.
        parameters: bool,
        /// Whether to reset the startup lines and the text of `$I`.
        texts: bool,
    },
    /// `$options`: lists the options of the plot.
    Options,
    /// `$model`: reports the size of the model.
    Model,
    /// `$clear`: removes the whole model.
    Clear,
    /// `$delete=…` and others: edits the model.
    Edit(Edit),
    /// `$list=PART,FIRST,LAST`: lists elements of the model.
    List(ElementKind, model::Numbers),
    /// `$undo`: takes back the last change of the model.
    Undo,
    /// `$plot`: computes and draws the model.
    Plot,
    /// `$again`: draws the last job again.
    Again,
    /// `$resume`: goes on with the job that has stopped.
    Resume {
        /// Whether the user has put the pen at the origin by hand: `$resume=origin`.
        at_origin: bool,
    },
    /// `$stream=…`: begins a job whose strokes will be sent.
    #[cfg(feature = "stream")]
    BeginStream(&'a str),
    /// `$s=…`: strokes of such a job.
    #[cfg(feature = "stream")]
    Strokes(&'a str),
    /// `$stream`: reports how much of such a job has come.
    #[cfg(feature = "stream")]
    Stream,
    /// `$X`: unlocks the plotter after an alarm, or wakes it.
    Unlock,
    /// `$H`: looks for the limit switches.
    Home,
    /// `$C`: begins or ends check mode, in which nothing moves.
    Check,
    /// `$SLP`: switches the motors off.
    Sleep,
    /// `$UF2`: becomes the drive onto which a new image is copied.
    ShowDrive,
    /// `$hpgl`: begins HP-GL, where the line has a number, spaces or a comment. Alone on its line
    /// the command is taken before it gets here.
    #[cfg(feature = "hpgl")]
    HpGl,
    /// `$J=…`: a jog, which moves with the pen up.
    Jog(GCode<'a>),
    /// `G…`, `M…`, `X…`: a line of G-code.
    GCode(GCode<'a>),
}

/// What a command means, for the list of `$`. On a board without room for these texts it is empty.
pub(crate) const fn meaning(text: &'static str) -> &'static str {
    if cfg!(feature = "command-help") { text } else { "" }
}

/// The `$` commands and G-code words, each with its meaning, as `$` lists them. It lists the
/// options of a plot between the two parts.
pub const HELP: [&[(&str, &str)]; 2] = [
    &[
        ("$", meaning("this list")),
        ("$I", meaning("version, board and limits; $I=TEXT adds a text of yours")),
        ("$$", meaning("settings of the machine; $NUMBER=VALUE changes one")),
        ("$settings", meaning("the same with their names and units")),
        ("$#", meaning("coordinate systems, kept positions and offsets")),
        ("$G", meaning("modes of G-code")),
        ("$N", meaning("G-code at the start, such as G20; $N0=LINE and $N1=LINE set it")),
        ("$RST=$|#|*", meaning("defaults again: settings, coordinates, or these and the texts")),
        ("$options", meaning("what is drawn and how, as it stands")),
    ],
    &[
        ("$model", meaning("size of the model against the limits")),
        ("$clear", meaning("forget the model")),
        (
            "$list=v|l|f|c,FIRST,LAST",
            meaning("vertices, bars, faces or curves with their numbers; without numbers all"),
        ),
        ("$delete=v|l|f|c,FIRST,LAST", meaning("take some out; the numbers above fall")),
        ("$plug=v|l|f|c,NUMBER", meaning("take one out; the last takes its number")),
        ("$move=NUMBER,X,Y,Z", meaning("move a vertex to a position")),
        (
            "$translate=X,Y,Z,FIRST,LAST",
            meaning("shift vertices; without numbers all, here and below"),
        ),
        ("$scale=X,Y,Z,FIRST,LAST", meaning("multiply coordinates")),
        ("$rotate=x|y|z,DEGREES,FIRST,LAST", meaning("turn about an axis")),
        (
            "$mirror=A,B,C,FIRST,LAST",
            meaning("add the image about the plane of three vertices, joined on the plane"),
        ),
        (
            "$reflect=A,B,C,FIRST,LAST",
            meaning("move to the image about the plane of three vertices"),
        ),
        ("$undo", meaning("take back the last change of the model, unless a plot came after")),
        ("$plot", meaning("draw it")),
        ("$again", meaning("draw the last job again, also after a loss of power")),
        (
            "$resume",
            meaning("go on with the job that a loss of power or a reset stopped, after $H"),
        ),
        ("$resume=origin", meaning("the same where you have put the pen at the origin by hand")),
        #[cfg(feature = "stream")]
        (
            "$stream=…",
            meaning("draw strokes that a computer sends by $s=…; $stream tells how many came"),
        ),
        ("$X", meaning("unlock after an alarm")),
        ("$H", meaning("find the limit switches")),
        (
            "$J=G91 X.. Y.. F..",
            meaning("move by hand with the pen up, F is needed; byte 0x85 ends it"),
        ),
        ("$C", meaning("begin or end to check only: nothing moves")),
        ("$SLP", meaning("switch the motors off; $X wakes")),
        #[cfg(feature = "hpgl")]
        ("$hpgl", meaning("HP-GL from now on, until ctrl-X or a line that begins with $")),
        (
            "$UF2",
            meaning("become the drive onto which a new image is copied, where the board has one"),
        ),
        (
            "G0 | G1 | G2 | G3 | G4 | G20 | G21 | G28 | G90 | G91",
            meaning("move, arc, wait, inches, mm, park, absolute, relative"),
        ),
        (
            "G10 | G53 | G54 | G92 | G28.1 | G30 | G30.1 | G43.1",
            meaning("coordinate systems and kept positions"),
        ),
        (
            "X1 | Y1 | I1 | J1 | R1 | P1 | F1 | Z1",
            meaning("numbers of the former; Z0 and below is pen down, see $206"),
        ),
        ("M0 | M2 | M3 | M5", meaning("pause until ~, end, pen down, pen up")),
    ],
];

impl<'a> Command<'a> {
    /// Parses one line.
    ///
    /// # Errors
    /// A [`CommandError`] that names the word at fault.
    ///
    /// ```
    /// use penup::protocol::Command;
    /// assert_eq!(Command::parse("# a comment"), Ok(Command::Nothing));
    /// assert_eq!(Command::parse("$plot"), Ok(Command::Plot));
    /// assert!(Command::parse("v 1 2").is_err());
    /// ```
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn parse(line: &'a str) -> Result<Self, CommandError> {
        #[cfg(feature = "stream")]
        if let Some(strokes) = line.strip_prefix(super::STROKES_KEYWORD) {
            return Ok(Self::Strokes(strokes));
        }
        if let Some(value) = title(line) {
            return Ok(Self::Assign { name: "title", value });
        }
        let line = trim(line);
        if let Some(dollar) = strip_first(line, b'$') {
            return Self::parse_dollar(trim(dollar));
        }
        let line = trim(match GCode::begins(line) {
            true => before_hash(line),
            false => split_once(line, b'#').map_or(line, |(before, _)| before),
        });
        #[cfg(not(feature = "hpgl"))]
        if line.starts_with("IN;") {
            return Err(CommandError::NoHpGl);
        }
        if GCode::begins(line) {
            return GCode::new(line).map(Self::GCode);
        }
        let (keyword, rest) = split_word(line);
        match keyword {
            "" | "o" | "s" | "mtllib" | "vn" | "vt" => Ok(Self::Nothing),
            "usemtl" | "g" => {
                Ok(Self::Pen { by_material: keyword == "usemtl", name: pen_name(rest) })
            }
            "v" => Ok(Self::Vertex(coordinates(rest)?)),
            "f" => Numbers::new(rest).map(Self::Face),
            "l" => Numbers::new(rest).map(Self::Polyline),
            "cstype" if trim(rest) == "bspline" => Ok(Self::Nothing),
            "cstype" => Err(CommandError::NotAChoice { choices: &["bspline"] }),
            "deg" => match whole(rest)? {
                degree @ 1..=5 => Ok(Self::Degree(degree as u8)),
                _ => Err(CommandError::Model(ModelError::Curve(CurveError::Order))),
            },
            "curv" => curve(rest),
            "parm" => match split_word(rest) {
                ("u", knots) => Decimals::new(knots).map(Self::Knots),
                _ => Err(CommandError::NotAChoice { choices: &["u"] }),
            },
            "end" => Ok(Self::EndCurve),
            _ => Err(CommandError::UnknownCommand),
        }
    }

    /// Parses the text after `$`.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    fn parse_dollar(text: &'a str) -> Result<Self, CommandError> {
        if let Some(command) = Self::parse_grbl(text) {
            return command;
        }
        // A `#` begins a comment where a space stands before it.
        let comment = text.as_bytes().windows(2).position(|pair| pair == b" #");
        let text = trim(comment.and_then(|at| text.get(..at)).unwrap_or(text));
        if let Some((name, value)) = split_once(text, b'=') {
            let (name, value) = (trim(name), trim(value));
            if name == "resume" {
                return match value {
                    "origin" => Ok(Self::Resume { at_origin: true }),
                    _ => Err(CommandError::NotAChoice { choices: &["origin"] }),
                };
            }
            #[cfg(feature = "stream")]
            if name == "stream" {
                return Ok(Self::BeginStream(value));
            }
            if let Some(command) = parse_edit(name, value)? {
                return Ok(command);
            }
            if name.is_empty() {
                return Err(CommandError::NotANumber);
            }
            return Ok(Self::Assign { name, value });
        }
        match text {
            "UF2" => Ok(Self::ShowDrive),
            "settings" => Ok(Self::Settings { named: true }),
            "options" => Ok(Self::Options),
            "model" => Ok(Self::Model),
            "clear" => Ok(Self::Clear),
            "undo" => Ok(Self::Undo),
            "plot" => Ok(Self::Plot),
            "again" => Ok(Self::Again),
            "resume" => Ok(Self::Resume { at_origin: false }),
            #[cfg(feature = "stream")]
            "stream" => Ok(Self::Stream),
            #[cfg(feature = "hpgl")]
            "hpgl" => Ok(Self::HpGl),
            #[cfg(not(feature = "hpgl"))]
            "hpgl" => Err(CommandError::NoHpGl),
            "" => Ok(Self::Help),
            _ => Err(CommandError::UnknownSystemCommand),
        }
    }

    /// Parses one of Grbl's commands, in which neither case nor spaces nor comments count. `None`
    /// for other commands.
    #[inline(never)] // Keeps its frame off the stack while the stages run.
    fn parse_grbl(text: &'a str) -> Option<Result<Self, CommandError>> {
        let (name, value) = split_once(text, b'=').map_or((text, None), |(n, v)| (n, Some(v)));
        let is = |text: &'a str, expected: &str| Significant(text.bytes()).eq(expected.bytes());
        let Some(value) = value else {
            let commands = [
                ("", Self::Help),
                ("$", Self::Settings { named: false }),
                ("#", Self::Parameters),
                ("G", Self::Modes),
                ("I", Self::BuildInfo),
                ("N", Self::StartupLines),
                ("X", Self::Unlock),
                ("H", Self::Home),
                ("C", Self::Check),
                ("SLP", Self::Sleep),
            ];
            return commands
                .into_iter()
                .find(|(expected, _)| is(name, expected))
                .map(|(_, c)| Ok(c));
        };
        if is(name, "J") {
            return Some(GCode::new(value).map(Self::Jog));
        }
        if is(name, "I") {
            return Some(Ok(Self::SetInfo(trim(value))));
        }
        if is(name, "RST") {
            let [settings, parameters] = ["$", "#"].map(|letter| is(value, letter));
            let all = is(value, "*");
            return Some(if settings || parameters || all {
                let (settings, parameters) = (settings || all, parameters || all);
                Ok(Self::Restore { settings, parameters, texts: all })
            } else {
                Err(CommandError::UnknownSystemCommand)
            });
        }
        let mut name = Significant(name.bytes());
        if name.next() != Some(b'N') {
            return None;
        }
        let index = match next_number(&mut name)?.to_whole() {
            Ok(index @ 0..=1) if name.next().is_none() => index as usize,
            _ => return Some(Err(CommandError::UnknownSystemCommand)),
        };
        Some(GCode::new(value).map(|line| Self::SetStartupLine { index, line }))
    }
}

/// The text of a `$title=` line, unchanged, with its spaces and any other characters. `None` for
/// other lines.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
fn title(line: &str) -> Option<&str> {
    let (name, text) = split_once(strip_first(trim_start(line), b'$')?, b'=')?;
    (trim(name) == "title").then_some(text)
}

/// The pen that one of the words gives by number, as in `pen3` or `3`. If there is none, the whole
/// text counts as a name, represented by its hash. An empty text means the first pen.
#[inline(never)] // Inlined, its frame would take stack while a job is computed.
fn pen_name(text: &str) -> PenName {
    let mut words = text.split_ascii_whitespace();
    let numbered = words.find_map(|word| {
        let (head, tail) = word.split_at_checked(3).unwrap_or(("", word));
        let is_pen = head.eq_ignore_ascii_case("pen");
        let digits = if is_pen { tail } else { word };
        let is_number = digits.bytes().all(|byte| byte.is_ascii_digit()) && !digits.is_empty();
        let number = digits.parse::<i32>().ok().filter(|number| (1..=PENS).contains(number));
        match number {
            Some(number) if is_number => Some(number as u8 - 1),
            // No pen has this number. Without the word `pen`, such a number is a name like any
            // other.
            None if is_number && is_pen => Some(u8::MAX),
            _ => None,
        }
    });
    let text = text.trim_ascii();
    match numbered {
        Some(pen) => PenName::Number(pen),
        None if text.is_empty() => PenName::Number(0),
        // The hash of Fowler, Noll and Vo (FNV-1a), 32 bits.
        None => PenName::Other(
            text.bytes()
                .fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)),
        ),
    }
}

/// Parses `u0 u1 a b …`.
fn curve(text: &str) -> Result<Command<'_>, CommandError> {
    let (from, rest) = split_word(text);
    let (to, rest) = split_word(rest);
    Ok(Command::Curve { ends: [number(from)?, number(to)?], control: Numbers::new(rest)? })
}

#[cfg(test)]
mod tests;
