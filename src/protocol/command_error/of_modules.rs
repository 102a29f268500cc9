//! The rows of the errors that other modules return.

use super::{BUSY, ErrorEntry, OUT_OF_RANGE, Row, UNKNOWN_SYSTEM_COMMAND, WAIT, error};
use crate::convex::SolidError;
use crate::curve::CurveError;
use crate::drawing::PageError;
use crate::fixed::{BinaryFraction, Length, Millimetres};
use crate::machine::{MachineError, SettingError};
use crate::model::{ElementKind, ModelError, PEN_LIMIT};
use crate::motion::LimitsError;
use crate::stage::OutOfScratch;
use crate::view::ViewError;
use core::fmt;

// The entries that several errors have in common.
/// The entry of the errors about a vertex that does not exist.
const UNKNOWN_VERTEX: ErrorEntry = error(110, "unknown vertex");
/// The entry of the errors about the degree, the knots or the control points of a curve.
const NOT_A_CURVE: ErrorEntry = error(116, "not a curve");
/// The entry of the errors about a line of a curve that comes before the line that it needs.
const CURVE_OUT_OF_ORDER: ErrorEntry = error(117, "curve out of order");
/// The entry of the errors about a model that has nothing to draw.
const NOTHING_TO_PLOT: ErrorEntry = error(120, "nothing to plot")
    .client("there is nothing to draw: no faces, lines or curves as long as a motor step");
/// The entry of the errors about working memory that is too small.
const DRAWING_TOO_LARGE: ErrorEntry = error(140, "drawing too large for the memory");
/// The entry of the errors about a value that a setting of the machine does not allow.
const SETTING_OUT_OF_RANGE: ErrorEntry = error(150, "setting out of range");

/// Passes to `row` the row of an error by which the model refused a change.
pub(super) fn explain_model(refusal: &ModelError, row: Row<'_>) {
    match refusal {
        ModelError::UnknownVertex { number, vertices } => row(
            UNKNOWN_VERTEX,
            format_args!("there is no vertex {number}: the model has {vertices}"),
        ),
        ModelError::TooFewCorners { needed } => {
            row(error(111, "too few corners"), format_args!("it takes {needed} vertices"))
        }
        ModelError::RepeatedVertex { number } => {
            row(error(112, "vertex repeated"), format_args!("vertex {number} comes twice in a row"))
        }
        ModelError::TooManyVertices { limit } => {
            row(error(113, "too many vertices"), format_args!("the limit is {limit} vertices"))
        }
        ModelError::TooManyCorners { limit, needed } => row(
            error(114, "too many corners"),
            format_args!(
                "the limit is {limit} corners of faces and ends of lines, this makes {needed}"
            ),
        ),
        ModelError::CoordinateTooLarge => {
            row(error(115, "coordinate too large"), format_args!("coordinates go up to 1073741824"))
        }
        ModelError::Curve(refusal) => explain_curve(refusal, row),
        ModelError::NoDegree => row(CURVE_OUT_OF_ORDER, format_args!("send deg first, 1 to 5")),
        ModelError::CurveUnfinished => {
            row(CURVE_OUT_OF_ORDER, format_args!("end the curve before: send end"))
        }
        ModelError::NoCurve => {
            row(CURVE_OUT_OF_ORDER, format_args!("begin a curve first: send curv"))
        }
        ModelError::KnotTooLarge => row(OUT_OF_RANGE, format_args!("{KNOTS}")),
        ModelError::UnknownElement { part, number, count } => {
            let name = match part {
                ElementKind::Vertices => "vertex",
                ElementKind::Bars => "bar",
                ElementKind::Faces => "face",
                ElementKind::Curves => "curve",
            };
            row(
                error(118, "unknown bar, face or curve"),
                format_args!("there is no {name} {number}: the model has {count}"),
            );
        }
        ModelError::NoPlane => row(
            error(119, "no plane"),
            format_args!("three vertices that are not in line make a plane"),
        ),
        ModelError::TooManyPens => row(
            error(127, "too many pens"),
            format_args!(
                "there are pens 1 to {PEN_LIMIT}, and other names take a free one each: \
                 send $pens=one to draw all with one"
            ),
        ),
        #[cfg(feature = "tiles")]
        ModelError::StoreFull { vertices, corners } => row(
            error(190, "flash for models full"),
            format_args!(
                "the flash holds these {vertices} vertices and {corners} corners, and no more"
            ),
        ),
        ModelError::Scratch(missing) => explain_missing(missing, row),
    }
}

/// The sentence that tells the user the range of knots.
const KNOTS: &str = "knots go up to 4194304";

/// Passes to `row` the row of an error by which a curve was refused.
fn explain_curve(refusal: &CurveError, row: Row<'_>) {
    match refusal {
        CurveError::Order => row(NOT_A_CURVE, format_args!("a curve has degree 1 to 5")),
        CurveError::TooFewControlPoints { needed } => {
            row(NOT_A_CURVE, format_args!("a curve of this degree takes {needed} control points"))
        }
        CurveError::TooManyControlPoints { limit } => {
            row(NOT_A_CURVE, format_args!("a curve has at most {limit} control points"))
        }
        CurveError::UnknownPoint { number } => {
            row(UNKNOWN_VERTEX, format_args!("there is no vertex {}", *number + 1))
        }
        CurveError::WrongKnotCount { needed, given } => {
            row(NOT_A_CURVE, format_args!("the curve takes {needed} knots and has {given}"))
        }
        CurveError::KnotDecreases { knot } => {
            row(NOT_A_CURVE, format_args!("knot {} is less than the one before", knot + 1))
        }
        CurveError::KnotTooLarge { .. } => row(NOT_A_CURVE, format_args!("{KNOTS}")),
        CurveError::KnotRepeated { knot } => row(
            NOT_A_CURVE,
            format_args!("knot {} is repeated so often that the curve breaks there", knot + 1),
        ),
        CurveError::OutsideKnots => row(
            NOT_A_CURVE,
            format_args!(
                "a curve begins at knot degree + 1 or later, ends later, and not past the last but \
                 degree"
            ),
        ),
    }
}

/// Passes to `row` the row of an error because of which the camera cannot show the model.
pub(super) fn explain_view(refusal: &ViewError, row: Row<'_>) {
    match refusal {
        ViewError::NothingToSee => {
            row(NOTHING_TO_PLOT, format_args!("send vertices and faces or lines first"))
        }
        ViewError::EyeAtTarget => {
            row(error(121, "eye at the point looked at"), format_args!("move $eye away from $at"))
        }
        ViewError::UpAlongSight => row(
            error(122, "up is along the line of sight"),
            format_args!("choose another $up, not along the line of sight"),
        ),
        ViewError::BehindEye { vertex } => row(
            error(123, "vertex not in front of the eye"),
            format_args!("vertex {vertex} is beside or behind the eye: move $eye back"),
        ),
        ViewError::NothingInFront => row(
            error(124, "nothing in front of the eye"),
            format_args!("the model is behind the eye: move or turn it"),
        ),
    }
}

/// Passes to `row` the row of an error because of which the model is no convex solid.
pub(super) fn explain_solid(refusal: &SolidError, row: Row<'_>) {
    const NOT_CONVEX: ErrorEntry = error(125, "not a convex solid");
    match refusal {
        SolidError::EyeInside | SolidError::BadEye => {
            row(error(126, "eye inside the solid"), format_args!("move $eye out of the solid"))
        }
        SolidError::VertexInside { vertex, count } => row(
            NOT_CONVEX,
            format_args!(
                "{count} vertices, vertex {} first, lie inside what the others span: \
                 choose $see=faces",
                vertex + 1
            ),
        ),
        SolidError::OutlineBroken { vertex } => row(
            NOT_CONVEX,
            format_args!(
                "no edge leads on from vertex {}: send all edges, or choose $see=vertices",
                vertex + 1
            ),
        ),
        _ => row(
            NOT_CONVEX,
            format_args!("it takes four vertices at different positions, not all in line"),
        ),
    }
}

/// Passes to `row` the row of an error because of which the drawing or its title does not fit on
/// the page.
pub(super) fn explain_page(refusal: &PageError, row: Row<'_>) {
    let mm = |length: Millimetres| BinaryFraction {
        units: length.to_bits().into(),
        fraction_bits: 16,
        decimals: 1,
    };
    match refusal {
        PageError::NoRoom => row(
            error(130, "margins leave no room on the page"),
            format_args!("make $margin or $title-size smaller or $page larger"),
        ),
        PageError::TooManySteps => row(
            error(131, "page has too many steps"),
            format_args!("the page has more than 1048576 steps: make $page smaller"),
        ),
        PageError::DoesNotFit { width, height, foot } => {
            let entry = error(132, "drawing is larger than the page");
            let below = mm(*foot);
            let [width, height] = [width, height].map(|size| Tenths(*size));
            if *foot > 0 {
                row(
                    entry,
                    format_args!(
                        "the plan is {width}x{height} mm and its title takes {below} mm below it\
                         : choose a larger $page, or $fit=on"
                    ),
                );
            } else {
                row(
                    entry,
                    format_args!(
                        "the plan is {width}x{height} mm: choose a larger $page, or $fit=on"
                    ),
                );
            }
        }
        PageError::TitleTooWide { width, free } => {
            row(
                error(133, "title is wider than the page"),
                format_args!(
                    "the title is {} mm wide where {} are free: shorten it, or make $title-size \
                     smaller",
                    mm(*width),
                    mm(*free)
                ),
            );
        }
    }
}

/// A length in units of 0.1 mm, shown in mm with one decimal.
struct Tenths(u32);

impl fmt::Display for Tenths {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}.{}", self.0 / 10, self.0 % 10)
    }
}

/// Passes to `row` the row of the error that working memory is missing, with the sizes.
pub(super) fn explain_missing(missing: &OutOfScratch, row: Row<'_>) {
    let OutOfScratch { needed, available } = missing;
    row(
        DRAWING_TOO_LARGE,
        format_args!("{needed} bytes are needed where {available} are free: send a smaller model"),
    );
}

/// Passes to `row` the row of an error by which the value of a setting was refused.
pub(super) fn explain_setting(refusal: &SettingError, row: Row<'_>) {
    match refusal {
        SettingError::Unknown => row(UNKNOWN_SYSTEM_COMMAND, format_args!("$$ lists the settings")),
        SettingError::OutOfRange(setting) => {
            let info = setting.info();
            let (name, unit) = (info.name, info.unit());
            let [least, greatest] = [info.least, info.greatest].map(Length);
            row(
                SETTING_OUT_OF_RANGE,
                format_args!("{name} goes from {least} to {greatest} {unit}"),
            );
        }
        SettingError::Negative(setting) => {
            row(error(4, ""), format_args!("{} is not negative", setting.info().name))
        }
        SettingError::NotWhole(setting) => {
            row(SETTING_OUT_OF_RANGE, format_args!("{} is a whole number", setting.info().name))
        }
        SettingError::Conflict(LimitsError::PenUpsideDown) => row(
            error(151, "setting conflicts with another"),
            format_args!(
                "a motor raises the pen upward: set $210 below $211, and 4 in $3 turns it"
            ),
        ),
        SettingError::Conflict(LimitsError::Anchors) => row(
            error(151, "setting conflicts with another"),
            format_args!(
                "anchors are above the page ($233 > $131), and at most 2097152 steps away"
            ),
        ),
        #[cfg(feature = "pen-overlap")]
        SettingError::Conflict(LimitsError::PenByMotor) => row(
            error(151, "setting conflicts with another"),
            format_args!("a motor moves the pen at rest only: set $224=0 and $225=0, or $209=0"),
        ),
        #[cfg(feature = "spread-backlash")]
        SettingError::Conflict(LimitsError::BacklashOfBelts) => row(
            error(151, "setting conflicts with another"),
            format_args!("belts take slack up at rest only: set $237=0, or $230=0 or 1"),
        ),
        #[cfg(feature = "input-shaping")]
        SettingError::Conflict(LimitsError::ShapingConflict) => row(
            error(151, "setting conflicts with another"),
            format_args!(
                "shaped motion takes $203=1, $224=0, $225=0, $230=0 or 1, and $237=0: set these, \
                 or $226=0"
            ),
        ),
        #[cfg(feature = "input-shaping")]
        SettingError::Conflict(LimitsError::ShapingFrequency { least }) => row(
            error(151, "setting conflicts with another"),
            format_args!(
                "such a shaper works from {}.{:02} Hz on: set $227 and $228 to that or 0, or \
                 $226=1",
                least / 100,
                least % 100
            ),
        ),
        #[cfg(feature = "input-shaping")]
        SettingError::Conflict(LimitsError::ShapedSteps { possible }) => row(
            error(151, "setting conflicts with another"),
            format_args!(
                "at most {possible} steps a second are shaped: set lesser speeds, or $226=0"
            ),
        ),
        SettingError::Conflict(_) => row(
            error(151, "setting conflicts with another"),
            format_args!("with it the steps would come too fast or the ramps too slow"),
        ),
        SettingError::Busy => row(BUSY, format_args!("{WAIT}")),
    }
}

/// Passes to `row` the row of an error by which the machine refused a move or a command.
pub(super) fn explain_machine(refusal: &MachineError, row: Row<'_>) {
    match refusal {
        MachineError::State(_) => row(BUSY, format_args!("{WAIT}")),
        MachineError::BeyondTravel { x, y, .. } => {
            let [x, y] = [x, y].map(|value| BinaryFraction {
                units: value.to_bits().into(),
                fraction_bits: 16,
                decimals: 3,
            });
            row(
                error(15, "beyond the travel"),
                format_args!(
                    "it would go {x},{y} mm beyond the travel: choose a smaller $page, or set \
                     $130 and $131 (1048576 steps at most)"
                ),
            );
        }
        MachineError::MoveTooLong { .. } => {
            row(error(152, "move too long"), format_args!("a single move is at most 16 m long"))
        }
        MachineError::TooSlow => {
            row(error(22, ""), format_args!("the least speed of a move is 0.1 mm/min"))
        }
    }
}
