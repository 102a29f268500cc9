//! The errors as a list, for the host: the documents and the client's words are made from it.

use super::{CommandError, ErrorEntry};
#[cfg(feature = "tiles")]
use super::{Crowd, StoredModelError};
use crate::convex::SolidError;
use crate::curve::CurveError;
use crate::drawing::PageError;
use crate::machine::{MachineError, Setting, SettingError, State, Value};
use crate::model::{ElementKind, ModelError};
use crate::motion::LimitsError;
use crate::protocol::BlockError;
use crate::stage::OutOfScratch;
use crate::step::ArcError;
use crate::view::ViewError;
use std::vec::Vec;

/// The sizes that the samples of errors about missing memory name.
const MISSING: OutOfScratch = OutOfScratch { needed: 9, available: 8 };

/// The entries of all errors in the order of their numbers, each number once.
pub fn error_entries() -> Vec<ErrorEntry> {
    let mut entries: Vec<ErrorEntry> = error_samples().iter().map(CommandError::entry).collect();
    entries.retain(|entry| !entry.meaning.get().is_empty());
    entries.sort_by_key(|entry| entry.number);
    entries.dedup();
    entries
}

/// Lists a value of each variant of an enum, in the order given.
///
/// If a variant is missing, this does not compile, because the match has no other arm.
macro_rules! every_variant {
    ($enum:ident: $(
        $(#[$condition:meta])* $variant:ident $({ $($named:tt)* })? $(( $($plain:tt)* ))?
    ),* $(,)?) => {{
        let _is_complete = |value: &$enum| match value {
            $($(#[$condition])* $enum::$variant { .. } => (),)*
        };
        [$($(#[$condition])* $enum::$variant $({ $($named)* })? $(( $($plain)* ))?),*]
    }};
}

/// A sample of every error that a line can be refused with, so that each sentence is among them.
pub fn error_samples() -> Vec<CommandError> {
    let one = Value::from_num(1);
    let all = every_variant!(CommandError:
        UnknownCommand,
        NotAWord,
        NotANumber,
        UnknownSystemCommand,
        HomingOff,
        Busy,
        Locked,
        Jogging,
        LineTooLong { limit: 256 },
        NotText,
        BytesLost,
        UnsupportedWord(b'Q'),
        Block(BlockError::ModalGroup),
        Arc(ArcError::NoRadius),
        NumberOutOfRange,
        WrongNumberCount { needed: 3 },
        NotAVertexNumber,
        NotAChoice { choices: &["on", "off"] },
        NotAPage,
        NotAnEscape,
        NotInTheFont('→'),
        TitleTooLong { limit: 80 },
        Model(ModelError::NoPlane),
        #[cfg(feature = "tiles")]
        Stored(StoredModelError::Unchangeable),
        NothingToPlot,
        NoConvexSolids,
        NoHpGl,
        View(ViewError::NothingToSee),
        Solid(SolidError::AllInLine),
        Page(PageError::NoRoom),
        Machine(MachineError::State(State::Idle)),
        Setting(SettingError::Unknown),
        DrawingTooLarge(MISSING),
        TooManyLines,
        NothingToUndo,
        Aborted,
        NotStored,
        NoJobKept,
        OtherSteps,
        #[cfg(feature = "stream")]
        NotStrokes,
        #[cfg(feature = "stream")]
        NoStream,
        #[cfg(feature = "stream")]
        BeyondBounds,
        NothingToResume,
        RestIsSent,
        #[cfg(feature = "stream")]
        StrokesAreSent,
        PositionUnknown,
        PositionKnown,
        OtherVersion,
        OtherSetting { setting: Setting::DotLength, before: one },
        OtherModel,
        OtherOrigin,
        Damaged,
        OutOfOrder { expected: 17 },
        Unnumbered,
        RefusedBefore(1),
    );
    let model = every_variant!(ModelError:
        CoordinateTooLarge,
        TooManyVertices { limit: 9 },
        TooManyCorners { limit: 9, needed: 10 },
        UnknownVertex { number: 9, vertices: 8 },
        TooFewCorners { needed: 3 },
        RepeatedVertex { number: 3 },
        NoDegree,
        Curve(CurveError::Order),
        CurveUnfinished,
        NoCurve,
        KnotTooLarge,
        UnknownElement { part: ElementKind::Faces, number: 9, count: 8 },
        NoPlane,
        TooManyPens,
        #[cfg(feature = "tiles")]
        StoreFull { vertices: 9, corners: 20 },
        Scratch(MISSING),
    );
    #[cfg(feature = "tiles")]
    let stored = every_variant!(StoredModelError:
        Unchangeable,
        NoCurves,
        FacesOnly,
        Drawing,
        NotWritten,
        Damaged,
        TooDense(Crowd { needed: 5000, room: 4096, unit: "bytes" }),
    );
    let block = every_variant!(BlockError:
        Negative(b'F'),
        NotInAJog,
        ModalGroup,
        NoFeed,
        NotWhole(b'G'),
        AxisConflict,
        Repeated(b'X'),
        NoAxis,
        LineNumber,
        Missing(b'P'),
        NoSystem,
        Absolute,
        AxisAfterCancel,
        ArcNoAxis,
        ArcRadius,
        ArcNoOffset,
        Unused(b'P'),
        ToolAxis,
        ToolNumber,
        ArcPlane,
        InverseArc,
        ServoIsOff,
        NotAtStart,
    );
    let curve = every_variant!(CurveError:
        Order,
        TooFewControlPoints { needed: 4 },
        TooManyControlPoints { limit: 9 },
        UnknownPoint { number: 9 },
        WrongKnotCount { needed: 9, given: 8 },
        KnotDecreases { knot: 3 },
        KnotTooLarge { knot: 3 },
        KnotRepeated { knot: 3 },
        OutsideKnots,
    );
    let solid = every_variant!(SolidError:
        TooFewVertices { distinct: 3 },
        TooManyVertices,
        PositionOutOfRange { vertex: 1 },
        AllInLine,
        BadEye,
        EyeInside,
        VertexInside { vertex: 1, count: 2 },
        UnknownVertex { edge: 1 },
        OutlineBroken { vertex: 1 },
        Scratch(MISSING),
        SinkFull,
        Aborted,
    );
    let views = every_variant!(ViewError:
        NothingToSee,
        EyeAtTarget,
        UpAlongSight,
        NothingInFront,
        BehindEye { vertex: 3 },
    );
    let pages = every_variant!(PageError:
        NoRoom,
        TooManySteps,
        DoesNotFit { width: 10, height: 10, foot: one },
        TitleTooWide { width: one, free: one },
    );
    let machine = every_variant!(MachineError:
        State(State::Idle),
        BeyondTravel { target: 1, x: one, y: one },
        MoveTooLong { target: 1 },
        TooSlow,
    );
    let settings = every_variant!(SettingError:
        Unknown,
        OutOfRange(Setting::StepsPerMmX),
        Negative(Setting::StepsPerMmX),
        NotWhole(Setting::StepsPerMmX),
        Conflict(LimitsError::StepsPerMillimetre),
        Busy,
    );
    let upside_down = [SettingError::Conflict(LimitsError::PenUpsideDown)];
    let samples = all.into_iter();
    #[cfg(feature = "tiles")]
    let samples = samples.chain(stored.map(CommandError::Stored));
    samples
        .chain(model.map(CommandError::Model))
        .chain(curve.map(|error| CommandError::Model(ModelError::Curve(error))))
        .chain(block.map(CommandError::Block))
        .chain(solid.map(CommandError::Solid))
        .chain(views.map(CommandError::View))
        .chain(pages.map(CommandError::Page))
        .chain(machine.map(CommandError::Machine))
        .chain(settings.map(CommandError::Setting))
        .chain(upside_down.map(CommandError::Setting))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_one_meaning() {
        let entries = error_entries();
        let is_sorted = entries.is_sorted_by(|one, next| one.number < next.number);
        assert!(is_sorted, "{entries:?}");
    }
    #[test]
    fn each_error_is_told_in_a_sentence() {
        for error in error_samples() {
            let text = std::format!("{error}");
            assert!(text.len() > 8, "{error:?}: {text}");
            #[cfg(feature = "tiles")]
            if let CommandError::Stored(stored) = error {
                assert_eq!(std::format!("{stored}"), text);
            }
        }
    }
}
