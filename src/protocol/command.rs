//! Lines to typed commands.

use super::{EscapedText, GCode, Refusal};
use crate::curve::CurveError;
use crate::fixed::{Decimal, Millimetres};
use crate::model::{self, Edit, ModelError, PEN_LIMIT, Part, PenName};
use crate::order;
use crate::view::{Direction, Lens};

/// What a line asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum Command<'a> {
    /// An empty line, a comment, or a keyword of OBJ that changes nothing here.
    Nothing,
    /// `v x y z`
    Vertex([Decimal; 3]),
    /// `f a b c …`
    Face(Numbers<'a>),
    /// `l a b …`
    Polyline(Numbers<'a>),
    /// `deg n`
    Degree(u8),
    /// `curv u0 u1 a b …`
    Curve {
        /// Where it begins and ends.
        ends: [Decimal; 2],
        /// Its control points.
        control: Numbers<'a>,
    },
    /// `parm u k1 k2 …`
    Knots(Decimals<'a>),
    /// `end`
    EndCurve,
    /// `usemtl NAME` or `g NAME …`
    Pen {
        /// Whether it is `usemtl`.
        by_material: bool,
        /// What it names; a number may be past the last pen.
        name: PenName,
    },
    /// `$`
    Help,
    /// `$I`
    BuildInfo,
    /// `$$`
    Settings,
    /// `$name=value` or `$number=value` for a setting of the machine.
    Setting {
        /// Name or number.
        name: &'a str,
        /// What it shall be.
        value: &'a str,
    },
    /// `$name=value` for what is drawn and how.
    Option(PlotOption),
    /// `$title=TEXT`
    Title(EscapedText<'a>),
    /// `$options`
    Options,
    /// `$model`
    Model,
    /// `$clear`
    Clear,
    /// `$delete=…` and others: changes the model.
    Edit(Edit),
    /// `$list=PART,FIRST,LAST`
    List(Part, model::Numbers),
    /// `$undo`
    Undo,
    /// `$plot`
    Plot,
    /// `$again`
    Again,
    /// `$X`
    Unlock,
    /// `$H`
    Home,
    /// `$C`
    Check,
    /// `$SLP`
    Sleep,
    /// `$J=…`: a move by hand.
    Jog(GCode<'a>),
    /// `G…`, `M…`, `X…`
    GCode(GCode<'a>),
}

/// What is drawn, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlotOption {
    /// `$eye=x,y,z`
    Eye(Direction),
    /// `$at=x,y,z`
    At(Direction),
    /// `$up=x,y,z`
    Up(Direction),
    /// `$angles=α,β,γ`: Harrison's rotation, in degrees.
    Angles(Direction),
    /// `$view=auto`: forget eye, at, up and angles.
    AutomaticView,
    /// `$projection=…`
    Projection(ProjectionChoice),
    /// `$behind=clip|refuse`: what is behind the eye is cut off (`true`), or an error.
    ClipBehind(bool),
    /// `$see=faces|wire|vertices|edges`
    See(WayToSee),
    /// `$hidden=erased|dotted|dashed|shown`
    Hidden(HiddenLines),
    /// `$seams=on|off`: where faces pass through each other.
    Seams(bool),
    /// `$blocks=separate|merged`: whether blocks that touch are one shape (`true`).
    MergedBlocks(bool),
    /// `$crease=DEGREES`: edges less sharp are not drawn.
    Crease(f64),
    /// `$pens=auto|one`: whether one pen draws all (`true`).
    OnePen(bool),
    /// `$page=WIDTHxHEIGHT` in mm
    Page {
        /// Along x.
        width: Millimetres,
        /// Along y.
        height: Millimetres,
    },
    /// `$margin=MM`
    Margin(Millimetres),
    /// `$title-size=MM`
    TitleSize(Millimetres),
    /// `$fit=on|off`
    Fit(bool),
    /// `$order=auto|greedy|exact`
    Order(order::Method),
    /// `$cycle=on|off`: whether the pen returns to where it began.
    Cycle(bool),
    /// `$effort=N`
    Effort(u32),
    /// `$lift=MM`
    Lift(Millimetres),
}

/// How the model comes onto the page.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProjectionChoice {
    /// From the eye, through a lens.
    Lens(Lens),
    /// Parallel, from a direction in degrees; eye and angles are not used.
    Axonometric {
        /// From the x axis towards y: -90 is in front.
        azimuth: f64,
        /// Above the xy plane.
        elevation: f64,
    },
}

impl Default for ProjectionChoice {
    fn default() -> Self {
        Self::Lens(Lens::Perspective)
    }
}

impl ProjectionChoice {
    const CHOICES: &str = "perspective, orthographic, cavalier, cabinet, oblique,ANGLE,RATIO, isometric, \
                           dimetric, trimetric or axonometric,AZIMUTH,ELEVATION";

    fn parse(value: &str) -> Result<Self, Refusal> {
        let (name, numbers) = match value.split_once(',') {
            Some((name, numbers)) => (name.trim(), Some(numbers)),
            None => (value, None),
        };
        let oblique = |angle, ratio| Self::Lens(Lens::Oblique { angle, ratio });
        let axonometric = |azimuth, elevation| Self::Axonometric { azimuth, elevation };
        Ok(match (name, numbers) {
            ("perspective", None) => Self::Lens(Lens::Perspective),
            ("orthographic", None) => Self::Lens(Lens::Orthographic),
            ("cavalier", None) => oblique(45.0, 1.0),
            ("cabinet", None) => oblique(45.0, 0.5),
            ("oblique", Some(numbers)) => {
                let [angle, ratio] = values(numbers)?;
                if !(0.0..=2.0).contains(&ratio) || libm::fabs(angle) > 360.0 {
                    return Err(Refusal::NumberOutOfRange);
                }
                oblique(angle, ratio)
            }
            // All three axes are foreshortened alike: the elevation is atan(1 / sqrt 2).
            ("isometric", None) => axonometric(-45.0, 35.264_389_682_754_654),
            // The two axes that are foreshortened alike lie at 7 and 42 degrees: 1, 1 and 1/2.
            ("dimetric", None) => axonometric(-69.295_188_945_364_57, 19.471_220_634_490_69),
            ("trimetric", None) => axonometric(-60.0, 25.0),
            ("dimetric" | "trimetric" | "axonometric", Some(numbers)) => {
                let [azimuth, elevation] = values(numbers)?;
                if libm::fabs(azimuth) > 360.0 || libm::fabs(elevation) > 90.0 {
                    return Err(Refusal::NumberOutOfRange);
                }
                axonometric(azimuth, elevation)
            }
            _ => return Err(Refusal::NotAChoice { choices: Self::CHOICES }),
        })
    }
}

/// How it is found out what is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WayToSee {
    /// Any faces hide what is behind them.
    #[default]
    Faces,
    /// Nothing hides anything: a wire frame.
    Wire,
    /// The vertices alone are those of one convex solid.
    Vertices,
    /// The vertices and edges are those of one convex solid.
    Edges,
}

/// What becomes of the hidden lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HiddenLines {
    /// Left out.
    #[default]
    Erased,
    /// Drawn dotted.
    Dotted,
    /// Drawn dashed.
    Dashed,
    /// Drawn like visible ones: a wire frame.
    Shown,
    /// Drawn with this pen, from 0.
    Pen(u8),
}

impl HiddenLines {
    const CHOICES: &str = "erased, dotted, dashed, shown, pen or pen,NUMBER";

    fn parse(value: &str) -> Result<Self, Refusal> {
        Ok(match value {
            "erased" => Self::Erased,
            "dotted" => Self::Dotted,
            "dashed" => Self::Dashed,
            "shown" => Self::Shown,
            // The first pen draws what is seen.
            "pen" => Self::Pen(1),
            _ => {
                let number = value.strip_prefix("pen,");
                let number = number.ok_or(Refusal::NotAChoice { choices: Self::CHOICES })?;
                match whole(number)? {
                    number @ 1..=PENS => Self::Pen(number as u8 - 1),
                    _ => return Err(Refusal::NumberOutOfRange),
                }
            }
        })
    }
}

/// How many pens there are.
const PENS: i32 = PEN_LIMIT as i32;

/// The `$` commands and what each does, as `$` lists them.
pub const HELP: &[(&str, &str)] = &[
    ("$", "this list"),
    ("$I", "version, board and limits"),
    ("$$", "settings of the machine; $NAME=VALUE changes one"),
    ("$options", "what is drawn and how, as it stands"),
    ("$eye=X,Y,Z", "where you look from"),
    ("$at=X,Y,Z", "what you look at"),
    ("$up=X,Y,Z", "which way is up"),
    ("$angles=A,B,C", "look along z after turning by C about z, B about y, A about x, in degrees"),
    ("$view=auto", "forget eye, at, up and angles: a three-quarter view"),
    (
        "$projection=perspective|orthographic|cavalier|cabinet|oblique,ANGLE,RATIO",
        "how lines of sight run",
    ),
    (
        "$projection=isometric|dimetric|trimetric|axonometric,AZIMUTH,ELEVATION",
        "a parallel view by its direction",
    ),
    ("$behind=clip|refuse", "what becomes of what is behind the eye"),
    (
        "$see=faces|wire|vertices|edges",
        "any faces hide; nothing hides; one convex solid from its vertices, or its edges",
    ),
    ("$hidden=erased|dotted|dashed|shown|pen|pen,NUMBER", "what becomes of hidden lines"),
    ("$seams=on|off", "whether the lines are drawn where faces pass through each other"),
    ("$blocks=separate|merged", "whether blocks that touch are drawn as one shape"),
    ("$crease=DEGREES", "leave out edges between faces that bend less; 0 draws every edge"),
    ("$pens=auto|one", "whether usemtl, or else g, chooses pens, or one draws all"),
    ("$page=WIDTHxHEIGHT", "size of the sheet in mm"),
    ("$margin=MM", "what stays free on each side of the sheet"),
    ("$title=TEXT", "what stands below the drawing, the rest of the line; nothing for none"),
    ("$title-size=MM", "height of its capitals, 1 to 100"),
    ("$fit=on|off", "scale a plan to the page, or draw it at true size"),
    ("$order=auto|greedy|exact", "how the moves between strokes are chosen"),
    ("$cycle=on|off", "whether the pen returns to where it began"),
    (
        "$effort=NUMBER",
        "distances tried for each move with the pen up to improve it; 0 takes the nearest next",
    ),
    ("$lift=MM", "how much longer a way with the pen up may be for one lift less, 0 to 1000"),
    ("$model", "size of the model against the limits"),
    ("$clear", "forget the model"),
    (
        "$list=v|l|f|c,FIRST,LAST",
        "vertices, bars, faces or curves with their numbers; without numbers all",
    ),
    ("$delete=v|l|f|c,FIRST,LAST", "take some out; the numbers above fall"),
    ("$plug=v|l|f|c,NUMBER", "take one out; the last takes its number"),
    ("$move=NUMBER,X,Y,Z", "move a vertex to a place"),
    ("$translate=X,Y,Z,FIRST,LAST", "shift vertices; without numbers all, here and below"),
    ("$scale=X,Y,Z,FIRST,LAST", "multiply coordinates"),
    ("$rotate=x|y|z,DEGREES,FIRST,LAST", "turn about an axis"),
    (
        "$mirror=A,B,C,FIRST,LAST",
        "add the image about the plane of three vertices, joined on the plane",
    ),
    ("$reflect=A,B,C,FIRST,LAST", "move to the image about the plane of three vertices"),
    ("$undo", "take back the last change of the model, unless a plot came after"),
    ("$plot", "draw it"),
    ("$again", "draw the last job again, also after a loss of power"),
    ("$X", "unlock after an alarm"),
    ("$H", "find the limit switches"),
    ("$J=G91 X.. Y.. F..", "move by hand with the pen up; byte 0x85 ends it"),
    ("$C", "begin or end to check only: nothing moves"),
    ("$SLP", "switch the motors off; $X wakes"),
    (
        "G0 | G1 | G2 | G3 | G4 | G20 | G21 | G28 | G90 | G91",
        "move, arc, wait, inches, mm, park, absolute, relative",
    ),
    ("X1 | Y1 | I1 | J1 | R1 | P1 | F1 | Z1", "numbers of the former; Z0 and below is pen down"),
    ("M0 | M2 | M3 | M5", "pause until ~, end, pen down, pen up"),
];

impl<'a> Command<'a> {
    /// Understands one line.
    ///
    /// # Errors
    /// A [`Refusal`] that names the word at fault.
    ///
    /// ```
    /// use penup::protocol::Command;
    /// assert_eq!(Command::parse("# a comment"), Ok(Command::Nothing));
    /// assert_eq!(Command::parse("$plot"), Ok(Command::Plot));
    /// assert!(Command::parse("v 1 2").is_err());
    /// ```
    #[inline(never)] // Its frame must not lie under the stages'.
    pub fn parse(line: &'a str) -> Result<Self, Refusal> {
        if let Some(text) = title(line) {
            return EscapedText::new(text).map(Self::Title);
        }
        let line = line.split('#').next().unwrap_or("").trim();
        if let Some(dollar) = line.strip_prefix('$') {
            return Self::parse_dollar(dollar.trim());
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
            "cstype" if rest.trim() == "bspline" => Ok(Self::Nothing),
            "cstype" => Err(Refusal::NotAChoice { choices: "bspline" }),
            "deg" => match whole(rest)? {
                degree @ 1..=5 => Ok(Self::Degree(degree as u8)),
                _ => Err(Refusal::Model(ModelError::Curve(CurveError::Order))),
            },
            "curv" => curve(rest),
            "parm" => match split_word(rest) {
                ("u", knots) => Decimals::new(knots).map(Self::Knots),
                _ => Err(Refusal::NotAChoice { choices: "u" }),
            },
            "end" => Ok(Self::EndCurve),
            _ => Err(Refusal::UnknownCommand),
        }
    }

    #[inline(never)] // Its frame must not lie under the stages'.
    fn parse_dollar(text: &'a str) -> Result<Self, Refusal> {
        if let Some((name, value)) = text.split_once('=') {
            let (name, value) = (name.trim(), value.trim());
            if let Some(command) = parse_edit(name, value)? {
                return Ok(command);
            }
            if name == "J" {
                return GCode::new(value).map(Self::Jog);
            }
            return match PlotOption::parse(name, value)? {
                Some(option) => Ok(Self::Option(option)),
                None => Ok(Self::Setting { name, value }),
            };
        }
        match text {
            "" => Ok(Self::Help),
            "$" => Ok(Self::Settings),
            "I" => Ok(Self::BuildInfo),
            "X" => Ok(Self::Unlock),
            "H" => Ok(Self::Home),
            "C" => Ok(Self::Check),
            "SLP" => Ok(Self::Sleep),
            "options" => Ok(Self::Options),
            "model" => Ok(Self::Model),
            "clear" => Ok(Self::Clear),
            "undo" => Ok(Self::Undo),
            "plot" => Ok(Self::Plot),
            "again" => Ok(Self::Again),
            _ => Err(Refusal::UnknownSystemCommand),
        }
    }
}

impl PlotOption {
    /// `None` if no option has this name.
    fn parse(name: &str, value: &str) -> Result<Option<Self>, Refusal> {
        let option = match name {
            "eye" => Self::Eye(direction(value)?),
            "at" => Self::At(direction(value)?),
            "up" => Self::Up(direction(value)?),
            "view" => match value {
                "auto" => Self::AutomaticView,
                _ => return Err(Refusal::NotAChoice { choices: "auto" }),
            },
            "angles" => Self::Angles(direction(value)?),
            "projection" => Self::Projection(ProjectionChoice::parse(value)?),
            "behind" => Self::ClipBehind(match value {
                "clip" => true,
                "refuse" => false,
                _ => return Err(Refusal::NotAChoice { choices: "clip or refuse" }),
            }),
            "see" => Self::See(match value {
                "faces" => WayToSee::Faces,
                "wire" => WayToSee::Wire,
                "vertices" => WayToSee::Vertices,
                "edges" => WayToSee::Edges,
                _ => {
                    return Err(Refusal::NotAChoice { choices: "faces, wire, vertices or edges" });
                }
            }),
            "hidden" => Self::Hidden(HiddenLines::parse(value)?),
            "pens" => Self::OnePen(match value {
                "one" => true,
                "auto" => false,
                _ => return Err(Refusal::NotAChoice { choices: "auto or one" }),
            }),
            "page" => {
                let (width, height) = value.split_once(['x', 'X']).ok_or(Refusal::NotAPage)?;
                Self::Page { width: positive(width)?, height: positive(height)? }
            }
            "margin" | "lift" => {
                let length =
                    number(value)?.to_millimetres().map_err(|_| Refusal::NumberOutOfRange)?;
                match name {
                    _ if length < 0 => return Err(Refusal::NumberOutOfRange),
                    "margin" => Self::Margin(length),
                    _ if length > 1000 => return Err(Refusal::NumberOutOfRange),
                    _ => Self::Lift(length),
                }
            }
            "title-size" => {
                let size = positive(value)?;
                if !(1..=100).contains(&size) {
                    return Err(Refusal::NumberOutOfRange);
                }
                Self::TitleSize(size)
            }
            "fit" => Self::Fit(on_or_off(value)?),
            "order" => Self::Order(match value {
                "auto" => order::Method::Auto,
                "greedy" => order::Method::Greedy,
                "exact" => order::Method::Exact,
                _ => return Err(Refusal::NotAChoice { choices: "auto, greedy or exact" }),
            }),
            "cycle" => Self::Cycle(on_or_off(value)?),
            "effort" => {
                Self::Effort(u32::try_from(whole(value)?).map_err(|_| Refusal::NumberOutOfRange)?)
            }
            "seams" => Self::Seams(on_or_off(value)?),
            "blocks" => Self::MergedBlocks(match value {
                "merged" => true,
                "separate" => false,
                _ => return Err(Refusal::NotAChoice { choices: "separate or merged" }),
            }),
            "crease" => {
                let [degrees] = values(value)?;
                if !(0.0..=180.0).contains(&degrees) {
                    return Err(Refusal::NumberOutOfRange);
                }
                Self::Crease(degrees)
            }
            _ => return Ok(None),
        };
        Ok(Some(option))
    }
}

/// The text of a `$title=` line as it stands, with its spaces and whatever else a title may hold.
#[inline(never)] // Its frame must not lie under the stages'.
fn title(line: &str) -> Option<&str> {
    let (name, text) = line.trim_start().strip_prefix('$')?.split_once('=')?;
    (name.trim() == "title").then_some(text)
}

/// The pen that one of the words numbers, as in `pen3` or `3`, else all of the text by a hash. Without a
/// name it is the first pen.
#[inline(never)] // Its frame must not lie under the stages'.
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
            // No pen has this number; without the word it is a name like others.
            None if is_number && is_pen => Some(u8::MAX),
            _ => None,
        }
    });
    let text = text.trim_ascii();
    match numbered {
        Some(pen) => PenName::Number(pen),
        None if text.is_empty() => PenName::Number(0),
        // Fowler, Noll and Vo's, 32 bits.
        None => PenName::Other(
            text.bytes()
                .fold(0x811C_9DC5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)),
        ),
    }
}

fn on_or_off(text: &str) -> Result<bool, Refusal> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(Refusal::NotAChoice { choices: "on or off" }),
    }
}

fn number(text: &str) -> Result<Decimal, Refusal> {
    Decimal::parse(text.trim()).map_err(|_| Refusal::NotANumber)
}

#[inline(never)] // Once is enough.
fn positive(text: &str) -> Result<Millimetres, Refusal> {
    let length = number(text)?.to_millimetres().map_err(|_| Refusal::NumberOutOfRange)?;
    if length > 0 { Ok(length) } else { Err(Refusal::NumberOutOfRange) }
}

fn direction(text: &str) -> Result<Direction, Refusal> {
    values(text)
}

/// Exactly N numbers with commas between, for angles and places only.
fn values<const N: usize>(text: &str) -> Result<[f64; N], Refusal> {
    let wrong_count = Refusal::WrongNumberCount { needed: N };
    let mut parts = text.split(',').map(number);
    let mut values = [0.0; N];
    for value in &mut values {
        *value = parts.next().unwrap_or(Err(wrong_count))?.to_f64();
    }
    if parts.next().is_some() {
        return Err(wrong_count);
    }
    // Past this range squares and quotients of lengths would overflow.
    if values.iter().any(|value| libm::fabs(*value) > 1e15) {
        return Err(Refusal::NumberOutOfRange);
    }
    Ok(values)
}

/// x y z, and then the weight or colour that some modellers write, which must be numbers too.
fn coordinates(text: &str) -> Result<[Decimal; 3], Refusal> {
    let mut words = text.split_ascii_whitespace().map(number);
    let mut next = || words.next().unwrap_or(Err(Refusal::WrongNumberCount { needed: 3 }));
    let coordinates = [next()?, next()?, next()?];
    for rest in words {
        rest?;
    }
    Ok(coordinates)
}

/// The values of an edit, with commas between.
struct Values<'a> {
    rest: Option<&'a str>,
    needed: usize,
}

impl<'a> Values<'a> {
    fn text(&mut self) -> Result<&'a str, Refusal> {
        let rest = self.rest.ok_or(Refusal::WrongNumberCount { needed: self.needed })?;
        let (value, rest) = match rest.split_once(',') {
            Some((value, rest)) => (value, Some(rest)),
            None => (rest, None),
        };
        self.rest = rest;
        Ok(value.trim())
    }

    fn three<T: Copy + Default>(
        &mut self,
        read: impl Fn(&str) -> Result<T, Refusal>,
    ) -> Result<[T; 3], Refusal> {
        let mut values = [T::default(); 3];
        for value in &mut values {
            *value = read(self.text()?)?;
        }
        Ok(values)
    }

    fn part(&mut self) -> Result<Part, Refusal> {
        match self.text()? {
            "v" => Ok(Part::Vertices),
            "l" => Ok(Part::Bars),
            "f" => Ok(Part::Faces),
            "c" => Ok(Part::Curves),
            _ => Err(Refusal::NotAChoice { choices: "v, l, f or c" }),
        }
    }

    /// First and last, or one number for both.
    fn numbers(&mut self) -> Result<[i32; 2], Refusal> {
        let first = whole(self.text()?)?;
        let last = if self.rest.is_some() { whole(self.text()?)? } else { first };
        Ok([first, last])
    }

    fn numbers_or_all(&mut self) -> Result<model::Numbers, Refusal> {
        if self.rest.is_some() { self.numbers().map(Some) } else { Ok(None) }
    }
}

/// `None` if no edit has this name.
#[inline(never)] // Its frame must not lie under the stages'.
fn parse_edit<'a>(name: &str, value: &str) -> Result<Option<Command<'a>>, Refusal> {
    let mut values = Values { rest: Some(value), needed: 3 };
    let edit = match name {
        "list" => {
            let part = values.part()?;
            let numbers = values.numbers_or_all()?;
            return Ok(Some(Command::List(part, numbers)));
        }
        "delete" => Edit::Delete(values.part()?, values.numbers()?),
        "plug" => Edit::Plug(values.part()?, whole(values.text()?)?),
        "move" => {
            values.needed = 4;
            Edit::Move(whole(values.text()?)?, values.three(number)?)
        }
        "translate" => Edit::Translate(values.three(number)?, values.numbers_or_all()?),
        "scale" => Edit::Scale(values.three(number)?, values.numbers_or_all()?),
        "rotate" => {
            let axis = match values.text()? {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => return Err(Refusal::NotAChoice { choices: "x, y or z" }),
            };
            values.needed = 2;
            let degrees = number(values.text()?)?.to_f64();
            if libm::fabs(degrees) > 36000.0 {
                return Err(Refusal::NumberOutOfRange);
            }
            Edit::Rotate(axis, degrees, values.numbers_or_all()?)
        }
        "mirror" => Edit::Mirror(values.three(whole)?, values.numbers_or_all()?),
        "reflect" => Edit::Reflect(values.three(whole)?, values.numbers_or_all()?),
        _ => return Ok(None),
    };
    match values.rest {
        None => Ok(Some(Command::Edit(edit))),
        Some(_) => Err(Refusal::WrongNumberCount { needed: values.needed }),
    }
}

/// The first word, and what comes after it.
fn split_word(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    text.split_once([' ', '\t']).unwrap_or((text, ""))
}

/// One whole number.
fn whole(text: &str) -> Result<i32, Refusal> {
    number(text)?.to_whole().map_err(|_| Refusal::NumberOutOfRange)
}

/// u0 u1 a b …
fn curve(text: &str) -> Result<Command<'_>, Refusal> {
    let (from, rest) = split_word(text);
    let (to, rest) = split_word(rest);
    Ok(Command::Curve { ends: [number(from)?, number(to)?], control: Numbers::new(rest)? })
}

/// Numbers with spaces between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimals<'a> {
    text: &'a str,
}

impl<'a> Decimals<'a> {
    /// Checks every word, so that [`Decimals::iter`] cannot fail.
    fn new(text: &'a str) -> Result<Self, Refusal> {
        for word in text.split_ascii_whitespace() {
            number(word)?;
        }
        Ok(Self { text })
    }

    /// The numbers in order.
    pub fn iter(&self) -> impl Iterator<Item = Decimal> + Clone + use<'a> {
        self.text.split_ascii_whitespace().filter_map(|word| number(word).ok())
    }
}

/// The vertex numbers of a face, polyline or curve: `7`, `-1`, `7/2`, `7//3` or `7/2/3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Numbers<'a> {
    text: &'a str,
}

impl<'a> Numbers<'a> {
    /// Checks every word, so that [`Numbers::iter`] cannot fail.
    fn new(text: &'a str) -> Result<Self, Refusal> {
        for word in text.split_ascii_whitespace() {
            vertex_number(word).ok_or(Refusal::NotAVertexNumber)?;
        }
        Ok(Self { text })
    }

    /// The numbers in order.
    pub fn iter(&self) -> impl Iterator<Item = i32> + Clone + use<'a> {
        self.text.split_ascii_whitespace().filter_map(vertex_number)
    }
}

/// The first part of `v`, `v/vt`, `v//vn`, `v/vt/vn`, if every part is a whole number.
fn vertex_number(word: &str) -> Option<i32> {
    let mut parts = word.split('/');
    let vertex = parts.next()?.parse().ok()?;
    let texture = parts.next();
    let normal = parts.next();
    let whole = |text: &str| text.parse::<i32>().is_ok();
    let texture_is_right = match texture {
        None => true,
        Some("") => normal.is_some(),
        Some(text) => whole(text),
    };
    if texture_is_right && normal.is_none_or(whole) && parts.next().is_none() {
        Some(vertex)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn numbers(line: &str) -> Result<Vec<i32>, Refusal> {
        match Command::parse(line)? {
            Command::Face(numbers) | Command::Polyline(numbers) => Ok(numbers.iter().collect()),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_form_of_a_corner_is_read() {
        assert_eq!(numbers("f 1 2/5 3//6 -1/7/8"), Ok(std::vec![1, 2, 3, -1]));
        assert_eq!(numbers("l\t4  5 # six"), Ok(std::vec![4, 5]));
        assert_eq!(numbers("f"), Ok(std::vec![]));
        for word in ["1/", "1//", "/1", "1/2/3/4", "1.5", "x", "1/x", "99999999999", "1/2/"] {
            assert_eq!(
                numbers(&std::format!("f 1 2 {word}")),
                Err(Refusal::NotAVertexNumber),
                "{word}"
            );
        }
    }

    #[test]
    fn vertices_need_three_numbers_and_may_have_more() {
        for line in ["v 1 2 3", "v  1 2 3 1.0", "v 1 2 3 0.5 0.5 0.5", " v 1 2 3 "] {
            assert!(matches!(Command::parse(line), Ok(Command::Vertex(_))), "{line}");
        }
        assert_eq!(Command::parse("v 1 2"), Err(Refusal::WrongNumberCount { needed: 3 }));
        assert_eq!(Command::parse("v 1 2 z"), Err(Refusal::NotANumber));
        assert_eq!(Command::parse("v 1 2 3 z"), Err(Refusal::NotANumber));
        assert_eq!(Command::parse("v"), Err(Refusal::WrongNumberCount { needed: 3 }));
    }

    #[test]
    fn pens_have_numbers_or_names() {
        let pen = |line| match Command::parse(line) {
            Ok(Command::Pen { by_material, name }) => (by_material, name),
            other => panic!("{other:?}"),
        };
        for (line, by_material, number) in [
            ("usemtl pen1", true, 0),
            ("usemtl  Pen32 # blue", true, 31),
            ("g PEN07", false, 6),
            ("g cube 3", false, 2),
            ("g", false, 0),
            ("usemtl", true, 0),
            ("usemtl pen0", true, 255),
            ("usemtl pen33", true, 255),
            ("usemtl 32", true, 31),
            ("g 1001 2", false, 1),
        ] {
            assert_eq!(pen(line), (by_material, PenName::Number(number)), "{line}");
        }
        let names =
            ["red", "Red", "pen", "penx", "pen3b", "rot grün", "grün", "-1", "+1", "0", "33"];
        let names: Vec<PenName> = names.iter().map(|name| pen_name(name)).collect();
        for (at, name) in names.iter().enumerate() {
            assert!(matches!(name, PenName::Other(_)) && !names[..at].contains(name), "{at}");
        }
        assert_eq!(pen("g  red "), (false, names[0]));
    }

    #[test]
    fn what_is_no_command_is_refused() {
        for line in ["vv 1 2 3", "hello", "G1 = 2", "ff"] {
            assert_eq!(Command::parse(line), Err(Refusal::UnknownCommand), "{line}");
        }
        for line in ["$nothing", "$plo", "$ plot it"] {
            assert_eq!(Command::parse(line), Err(Refusal::UnknownSystemCommand), "{line}");
        }
    }

    #[test]
    fn options_are_read_with_their_values() {
        let option = |line| match Command::parse(line) {
            Ok(Command::Option(option)) => Ok(option),
            Ok(other) => panic!("{other:?}"),
            Err(refusal) => Err(refusal),
        };
        assert_eq!(option("$eye=-1, 2.5 ,3e1"), Ok(PlotOption::Eye([-1.0, 2.5, 30.0])));
        let projection = |value| match option(value) {
            Ok(PlotOption::Projection(choice)) => Ok(choice),
            Ok(other) => panic!("{other:?}"),
            Err(refusal) => Err(refusal),
        };
        assert_eq!(
            projection("$projection = orthographic"),
            Ok(ProjectionChoice::Lens(Lens::Orthographic))
        );
        assert_eq!(projection("$projection=cabinet"), projection("$projection=oblique, 45,0.5"));
        assert_eq!(projection("$projection=oblique,45,3"), Err(Refusal::NumberOutOfRange));
        assert_eq!(
            projection("$projection=oblique,45"),
            Err(Refusal::WrongNumberCount { needed: 2 })
        );
        assert_eq!(
            projection("$projection=trimetric,10,20"),
            projection("$projection=axonometric,10,20")
        );
        assert!(matches!(projection("$projection=isometric,1,2"), Err(Refusal::NotAChoice { .. })));
        assert_eq!(
            option("$page=210x297"),
            Ok(PlotOption::Page {
                width: Millimetres::from_num(210),
                height: Millimetres::from_num(297)
            })
        );
        assert_eq!(option("$eye=1,2"), Err(Refusal::WrongNumberCount { needed: 3 }));
        assert_eq!(option("$eye=1,2,3,4"), Err(Refusal::WrongNumberCount { needed: 3 }));
        assert_eq!(option("$eye=1,2,"), Err(Refusal::NotANumber));
        assert_eq!(option("$eye=1,2,1e300"), Err(Refusal::NumberOutOfRange));
        assert_eq!(option("$page=210"), Err(Refusal::NotAPage));
        assert_eq!(option("$page=0x297"), Err(Refusal::NumberOutOfRange));
        assert_eq!(option("$margin=-1"), Err(Refusal::NumberOutOfRange));
        assert_eq!(
            option("$hidden=gone"),
            Err(Refusal::NotAChoice {
                choices: "erased, dotted, dashed, shown, pen or pen,NUMBER"
            })
        );
        assert_eq!(Command::parse("$110=5"), Ok(Command::Setting { name: "110", value: "5" }));
    }

    #[test]
    fn every_command_of_the_help_is_one() {
        for (usage, _) in HELP {
            let line = usage.split_once('=').map_or(*usage, |(name, _)| name);
            let with_value = usage.contains('=');
            let all_are = |line: &str| line.split(" | ").all(|one| Command::parse(one).is_ok());
            assert!(with_value || all_are(line), "{usage}");
            if with_value {
                let set = std::format!("{line}=?");
                assert!(!matches!(Command::parse(&set), Ok(Command::Setting { .. })), "{usage}");
            }
        }
    }
}
