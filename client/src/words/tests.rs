use super::*;
use crate::cli::Cli;
use clap::CommandFactory as _;
use penup::convex::SolidError;
use penup::curve::CurveError;
use penup::drawing::PageError;
use penup::machine::{MachineError, Setting, SettingError, State, Value};
use penup::model::{ElementKind, ModelError};
use penup::motion::LimitsError;
use penup::protocol::{CommandError, HELP, MEANINGS};
use penup::stage::OutOfScratch;
use penup::step::ArcError;
use penup::view::ViewError;

const MISSING: OutOfScratch = OutOfScratch { needed: 9, available: 8 };

/// Lists a value of each variant of an enum, in the order given.
///
/// If a variant is missing, this does not compile, because the match has no other arm.
macro_rules! every_variant {
    ($enum:ident: $($variant:ident $({ $($named:tt)* })? $(( $($plain:tt)* ))?),* $(,)?) => {{
        let _is_complete = |value: &$enum| match value {
            $($enum::$variant { .. } => (),)*
        };
        [$($enum::$variant $({ $($named)* })? $(( $($plain)* ))?),*]
    }};
}

/// Every refusal that the library can return, with each of its texts.
fn refusals() -> Vec<CommandError> {
    let one = Value::from_num(1);
    let all = every_variant!(CommandError:
        UnknownCommand,
        NotANumber,
        UnknownSystemCommand,
        HomingOff,
        Busy,
        Locked,
        LineTooLong { limit: 256 },
        NotText,
        BytesLost,
        UnsupportedWord(b'Q'),
        Arc(ArcError::NoRadius),
        NumberOutOfRange,
        WrongNumberCount { needed: 3 },
        NotAVertexNumber,
        NotAChoice { choices: "on or off" },
        NotAPage,
        NotAnEscape,
        NotInTheFont('→'),
        TitleTooLong { limit: 80 },
        Model(ModelError::NoPlane),
        NothingToPlot,
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
        Scratch(MISSING),
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
        DoesNotFit { width: 1 << 16, height: 1 << 16, foot: 1 << 16 },
        TitleTooWide { width: one, free: one },
    );
    let machine = every_variant!(MachineError:
        State(State::Idle),
        BeyondTravel { target: 1, x: one, y: one },
        MoveTooLong { target: 1 },
    );
    let settings = every_variant!(SettingError:
        Unknown,
        OutOfRange(Setting::StepsPerMmX),
        NotWhole(Setting::StepsPerMmX),
        Conflict(LimitsError::StepsPerMillimetre),
        Busy,
    );
    all.into_iter()
        .chain(model.map(CommandError::Model))
        .chain(curve.map(|error| CommandError::Model(ModelError::Curve(error))))
        .chain(solid.map(CommandError::Solid))
        .chain(views.map(CommandError::View))
        .chain(pages.map(CommandError::Page))
        .chain(machine.map(CommandError::Machine))
        .chain(settings.map(CommandError::Setting))
        .collect()
}

#[test]
fn no_refusal_of_the_library_shows_a_word_of_the_line() {
    let refusals = refusals();
    for (number, _) in MEANINGS {
        assert!(refusals.iter().any(|refusal| refusal.number() == *number), "no error {number}");
    }
    for refusal in refusals {
        let text = refusal.to_string();
        let reason = explained(refusal.number(), std::slice::from_ref(&text));
        assert!(!reason.contains('$') && !reason.contains("ctrl-X"), "{text}: {reason}");
        if !SENTENCES.iter().any(|(number, _)| *number == refusal.number()) {
            let words = text.split('$').skip(1).map(|part| split_after(part, |c| c == '-').0);
            words.for_each(|word| assert!(form(word).is_some(), "${word} is in no table: {text}"));
            assert!(!reason.contains("send --"), "{reason}");
        }
    }
}

#[test]
fn the_table_and_the_options_are_the_same() {
    let help = Cli::command().find_subcommand_mut("preview").expect("a command").render_help();
    let help = help.to_string();
    for (name, form) in OPTIONS {
        let is_option =
            help.contains(&format!("--{name} ")) || help.contains(&format!("--{name}\n"));
        assert_eq!(is_option, !matches!(form, Form::Words(_)), "{name}");
        if is_option {
            let is_known = |(usage, _): &(&str, &str)| usage.starts_with(&format!("${name}="));
            assert!(HELP.iter().any(is_known), "the plotter does not know ${name}");
        }
    }
}

#[test]
fn switches_and_unknown_words_are_told() {
    assert_eq!(asked("$fit=on"), "--fit");
    assert_eq!(asked("$cycle=off"), "no --cycle");
    assert_eq!(asked("v 1 2 3"), "v 1 2 3");
    assert_eq!(
        told("choose $see=faces, or set $130 and $131"),
        "choose --see faces, or set the travel along x (setting 130 of the machine) and along y (setting 131)"
    );
    assert_eq!(told("a $newer=thing and $999 or $"), "a newer thing and 999 or ");
}
