//! The table of options: one row for each, in the order in which `$` and `$options` list them.

use super::row::{Flag, Kind, PlotOption};
use super::values::{HiddenLines, ProjectionChoice, VisibilityMode};
use super::{PlotOptions, set_precision, set_title};
use crate::array::MapEach;
use crate::fixed::{Length, Millimetres, SixDecimals};
use crate::host_only::HostOnly;
use crate::order::{Method, Shape};
use crate::protocol::{CommandError, Escape, meaning, numbers, positive};

/// The heading in the client's help of the options that say from where and how the model is seen.
const CAMERA: &str = "Camera";
/// The heading in the client's help of the options that say how the drawing lies on the page.
const PAGE: &str = "Page";
/// The heading in the client's help of the options that say in which order the strokes are drawn.
const ORDER: &str = "Order";

/// The words of an option that is on or off. The index of `on` is 0.
const ON_OFF: &[&str] = &["on", "off"];

/// What `on` and `off` mean, for the client's help.
const YES_NO: &[&str] = &["Yes", "No"];

/// The table of the options of a plot: one row for each.
pub const OPTIONS: &[PlotOption] = &[
    PlotOption {
        name: "eye",
        values: &["X,Y,Z"],
        help: meaning("where you look from"),
        kind: Kind::Position(|options| &mut options.eye),
        flag: client(Flag::new(CAMERA, "Where the eye is [default: a three-quarter view]")),
    },
    PlotOption {
        name: "at",
        values: &["X,Y,Z"],
        help: meaning("what you look at"),
        kind: Kind::Position(|options| &mut options.at),
        flag: client(Flag::new(
            CAMERA,
            "The point that the eye looks at [default: the middle of the model]",
        )),
    },
    PlotOption {
        name: "up",
        values: &["X,Y,Z"],
        help: meaning("which way is up"),
        kind: Kind::Position(|options| &mut options.up),
        flag: client(Flag::new(CAMERA, "The direction that is up in the picture [default: 0,0,1]")),
    },
    PlotOption {
        name: "angles",
        values: &["A,B,C"],
        help: meaning("look along z after turning by C about z, B about y, A about x, in degrees"),
        kind: Kind::Position(|options| &mut options.angles),
        flag: client(Flag::new(
            CAMERA,
            "Harrison's rotation in degrees: look along z after turning by C about z, B about y, \
             A about x",
        )),
    },
    PlotOption {
        name: "view",
        values: &["auto"],
        help: meaning("forget eye, at, up and angles: a three-quarter view"),
        kind: Kind::Reset(|options| {
            (options.eye, options.at, options.up, options.angles) = (None, None, None, None);
        }),
        flag: NO_FLAG,
    },
    PlotOption {
        name: "projection",
        values: ProjectionChoice::WORDS.split_at(5).0,
        help: meaning("how lines of sight run"),
        kind: Kind::Other {
            set: |options, text| {
                options.projection = ProjectionChoice::parse(text)?;
                Ok(())
            },
            show: |options, formatter| options.projection.show(formatter),
        },
        flag: client(Flag {
            range: "angles up to 360 degrees, elevations up to 90, a ratio of 0 to 2",
            ..Flag::new(
                CAMERA,
                "perspective, orthographic, cavalier, cabinet, oblique,ANGLE,RATIO, isometric, \
                 dimetric, trimetric or axonometric,AZIMUTH,ELEVATION",
            )
        }),
    },
    PlotOption {
        name: "projection",
        values: ProjectionChoice::WORDS.split_at(5).1,
        help: meaning("a parallel view by its direction"),
        kind: Kind::Continued,
        flag: NO_FLAG,
    },
    PlotOption {
        name: "behind",
        values: &["clip", "refuse"],
        help: meaning("what becomes of what is behind the eye"),
        kind: Kind::Choice {
            get: |options| usize::from(!options.clip_behind),
            set: |options, at| options.clip_behind = at == 0,
        },
        flag: client(Flag {
            choices: &["It is cut off", "Nothing is drawn"],
            ..Flag::new(CAMERA, "What becomes of what is behind the eye")
        }),
    },
    PlotOption {
        name: "see",
        values: &["faces", "wire", "vertices", "edges"],
        help: meaning(
            "any faces hide; nothing hides; one convex solid from its vertices, or its edges",
        ),
        kind: Kind::Choice {
            get: |options| options.see as usize,
            set: |options, at| {
                use VisibilityMode::{Edges, Faces, Vertices, Wire};
                options.see = pick(at, [Faces, Wire, Vertices, Edges]);
            },
        },
        flag: client(Flag {
            choices: &[
                "Faces hide what is behind them",
                "Nothing hides anything: a wire frame",
                "One convex solid, from its vertices alone",
                "One convex solid, from its vertices and edges",
            ],
            ..Flag::new(
                CAMERA,
                "What hides: any faces, or nothing; or one convex solid seen from its vertices or \
                 edges alone",
            )
        }),
    },
    PlotOption {
        name: "hidden",
        values: HiddenLines::WORDS,
        help: meaning("what becomes of hidden lines"),
        kind: Kind::Other {
            set: |options, text| {
                options.hidden = HiddenLines::parse(text)?;
                Ok(())
            },
            show: |options, formatter| options.hidden.show(formatter),
        },
        flag: client(Flag {
            range: "pens 1 to 32",
            ..Flag::new(
                CAMERA,
                "What to do with hidden lines: erased, dotted, dashed, shown, pen or pen,NUMBER",
            )
        }),
    },
    PlotOption {
        name: "seams",
        values: ON_OFF,
        help: meaning("whether the lines are drawn where faces pass through each other"),
        kind: Kind::Choice {
            get: |options| usize::from(!options.seams),
            set: |options, at| options.seams = at == 0,
        },
        flag: client(Flag {
            choices: YES_NO,
            ..Flag::new(CAMERA, "Whether the lines are drawn where faces pass through each other")
        }),
    },
    PlotOption {
        name: "blocks",
        values: &["separate", "merged"],
        help: meaning("whether blocks that touch are drawn as one shape"),
        kind: Kind::Choice {
            get: |options| usize::from(options.merged_blocks),
            set: |options, at| options.merged_blocks = at == 1,
        },
        flag: client(Flag {
            choices: &["Each has all its edges", "No line is drawn between two faces in one plane"],
            ..Flag::new(CAMERA, "Whether blocks that touch are drawn as one shape")
        }),
    },
    PlotOption {
        name: "crease",
        values: &["DEGREES"],
        help: meaning("leave out edges between faces that bend less; 0 draws every edge"),
        kind: Kind::Other {
            set: |options, text| {
                let [degrees] = numbers(text)?;
                if !(0.0..=180.0).contains(&degrees) {
                    return Err(CommandError::NumberOutOfRange);
                }
                options.crease = degrees;
                Ok(())
            },
            show: |options, formatter| write!(formatter, "{}", SixDecimals(options.crease)),
        },
        flag: client(Flag {
            range: "0 to 180 degrees",
            ..Flag::new(CAMERA, "Leave out edges between faces that bend less than so many degrees")
        }),
    },
    PlotOption {
        name: "precision",
        values: &["auto", "LENGTH"],
        help: meaning(
            "how far coordinates may be off: auto goes by their decimals, 0 takes them as they \
               stand",
        ),
        kind: Kind::Other {
            set: set_precision,
            show: |options, formatter| match options.precision {
                Some(precision) => write!(formatter, "{precision}"),
                None => formatter.write_str("auto"),
            },
        },
        flag: client(Flag {
            range: "auto, or 0 to 1e6",
            ..Flag::new(
                CAMERA,
                "How far coordinates may be off, in units of the model: half of the last of three \
                 or more decimals (auto), or a number; 0 takes them as they stand",
            )
        }),
    },
    PlotOption {
        name: "pens",
        values: &["auto", "one"],
        help: meaning("whether usemtl, or else g, chooses pens, or one draws all"),
        kind: Kind::Choice {
            get: |options| usize::from(options.one_pen),
            set: |options, at| options.one_pen = at == 1,
        },
        flag: client(Flag {
            choices: &["The file", "Nobody: one pen draws all"],
            ..Flag::new(
                PAGE,
                "Whether the file's usemtl, or else its groups, choose pens: pen1 to pen32, or by \
                 name",
            )
        }),
    },
    PlotOption {
        name: "page",
        values: &["WIDTHxHEIGHT"],
        help: meaning("size of the sheet in mm"),
        kind: Kind::Other {
            set: |options, text| {
                let (width, height) = text.split_once(['x', 'X']).ok_or(CommandError::NotAPage)?;
                let (width, height) = (positive(width)?, positive(height)?);
                (options.page.width, options.page.height) = (width, height);
                Ok(())
            },
            show: |options, formatter| {
                let [width, height] = [options.page.width, options.page.height].map_each(Length);
                write!(formatter, "{width}x{height}")
            },
        },
        flag: client(Flag {
            range: "each side up to 32767 mm",
            ..Flag::new(
                PAGE,
                "A0 to A6, Letter, Legal, Tabloid, or a size such as 300x200, 30cmx20cm or \
                 11x17in; an SVG file brings its own",
            )
        }),
    },
    PlotOption {
        name: "margin",
        values: &["MM"],
        help: meaning("what stays free on each side of the sheet"),
        kind: Kind::Length {
            least: Millimetres::ZERO,
            greatest: Millimetres::MAX,
            field: |options| &mut options.page.margin,
        },
        flag: client(Flag::new(
            PAGE,
            "What stays free on each side, in mm; nothing on the page of an SVG file",
        )),
    },
    PlotOption {
        name: "title",
        values: &["TEXT"],
        help: meaning("what stands below the drawing, the rest of the line; nothing for none"),
        kind: Kind::Other {
            set: set_title,
            show: |options, formatter| write!(formatter, "{}", Escape(options.title.as_str())),
        },
        flag: client(Flag::new(PAGE, "Write this below the drawing")),
    },
    PlotOption {
        name: "title-size",
        values: &["MM"],
        help: meaning("height of its capitals, 1 to 100"),
        kind: Kind::Length {
            least: Millimetres::ONE,
            greatest: Millimetres::const_from_int(100),
            field: |options| &mut options.title_size,
        },
        flag: client(Flag::new(PAGE, "Height of the title's capitals, 1 to 100 mm")),
    },
    PlotOption {
        name: "fit",
        values: ON_OFF,
        help: meaning("scale a plan to the page, or draw it at true size"),
        kind: Kind::Choice {
            get: |options| usize::from(!options.fit),
            set: |options, at| options.fit = at == 0,
        },
        flag: client(Flag {
            is_switch: true,
            ..Flag::new(
                PAGE,
                "Scale a plan to the page, too (solids always are; plans are drawn at true size)",
            )
        }),
    },
    PlotOption {
        name: "order",
        values: &["auto", "greedy", "exact"],
        help: meaning("how the moves between strokes are chosen"),
        kind: Kind::Choice {
            get: |options| options.method as usize,
            set: |options, at| {
                options.method = pick(at, [Method::Auto, Method::Greedy, Method::Exact]);
            },
        },
        flag: client(Flag {
            choices: &[
                "Exact where it fits in memory, else greedy",
                "Greedy with regret, then pair exchange",
                "At the least length",
            ],
            ..Flag::new(ORDER, "How the moves between strokes are chosen")
        }),
    },
    PlotOption {
        name: "cycle",
        values: ON_OFF,
        help: meaning("whether the pen returns to where it began"),
        kind: Kind::Choice {
            get: |options| usize::from(options.shape == Shape::OpenPath),
            set: |options, at| {
                options.shape = pick(at, [Shape::ClosedCycle, Shape::OpenPath]);
            },
        },
        flag: client(Flag {
            is_switch: true,
            ..Flag::new(ORDER, "Let the pen return to where it began, if one pen draws all")
        }),
    },
    PlotOption {
        name: "effort",
        values: &["auto", "NUMBER"],
        help: meaning(
            "work to improve the order: auto stops when it no longer saves time; or distances \
               tried for each move with the pen up, 0 takes the nearest next",
        ),
        kind: Kind::Whole(|options| &mut options.effort),
        flag: client(Flag::new(
            ORDER,
            "Work to improve the order of many parts: until a second of computing saves less than \
             one of drawing (auto), or distances tried for each move with the pen up; with 0 the \
             nearest part comes next",
        )),
    },
    PlotOption {
        name: "lift",
        values: &["MM"],
        help: meaning("extra pen-up travel in mm that is accepted to save one lift, 0 to 1000"),
        kind: Kind::Length {
            least: Millimetres::ZERO,
            greatest: Millimetres::const_from_int(1000),
            field: |options| &mut options.lift_cost,
        },
        flag: client(Flag::new(
            ORDER,
            "Extra pen-up travel that is accepted to save one pen lift, 0 to 1000 mm",
        )),
    },
];

/// Stands in a row of the table for an option of which the client has no flag.
const NO_FLAG: HostOnly<Option<Flag>> = HostOnly::new(None);

/// Makes the entry of a row for a flag that the client has.
const fn client(flag: Flag) -> HostOnly<Option<Flag>> {
    HostOnly::new(Some(flag))
}

/// The value with index `at`, where the row has as many words as there are `values`.
fn pick<T: Copy, const N: usize>(at: usize, values: [T; N]) -> T {
    // No row has an empty list, so `N` is at least 1.
    values[at.min(N - 1)]
}

impl PlotOptions {
    /// Sets the option with this name to the value that `text` says. Returns `false` if no option
    /// has this name.
    ///
    /// # Errors
    /// The [`CommandError`] that names what is wrong with the value. The options stay as they were.
    #[inline(never)] // Inlined, its frame would take stack while a job is computed.
    pub fn set(&mut self, name: &str, text: &str) -> Result<bool, CommandError> {
        if !cfg!(feature = "convex") && name == "see" && matches!(text, "vertices" | "edges") {
            return Err(CommandError::NoConvexSolids);
        }
        match OPTIONS.iter().find(|option| option.name == name) {
            Some(option) => option.set(self, text).map(|()| true),
            None => Ok(false),
        }
    }
}
