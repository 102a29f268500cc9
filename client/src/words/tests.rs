use super::*;
use crate::cli::Cli;
use clap::CommandFactory as _;
use penup::convex::SolidError;
use penup::curve::CurveError;
use penup::drawing::PageError;
use penup::machine::{MachineError, Setting, SettingError, State, Value};
use penup::model::{ModelError, Part};
use penup::motion::LimitsError;
use penup::protocol::{HELP, MEANINGS, Refusal};
use penup::stage::OutOfScratch;
use penup::step::ArcError;
use penup::view::ViewError;

const MISSING: OutOfScratch = OutOfScratch { needed: 9, available: 8 };

/// Every refusal that the library can make, with each of its texts.
fn refusals() -> Vec<Refusal> {
    let model = [
        ModelError::CoordinateTooLarge,
        ModelError::TooManyVertices { limit: 9 },
        ModelError::TooManyCorners { limit: 9, needed: 10 },
        ModelError::UnknownVertex { number: 9, vertices: 8 },
        ModelError::TooFewCorners { needed: 3 },
        ModelError::RepeatedVertex { number: 3 },
        ModelError::NoDegree,
        ModelError::CurveUnfinished,
        ModelError::NoCurve,
        ModelError::KnotTooLarge,
        ModelError::UnknownElement { part: Part::Faces, number: 9, count: 8 },
        ModelError::NoPlane,
        ModelError::TooManyPens,
        ModelError::Scratch(MISSING),
    ];
    let curve = [
        CurveError::Order,
        CurveError::TooFewControlPoints { needed: 4 },
        CurveError::TooManyControlPoints { limit: 9 },
        CurveError::UnknownPoint { number: 9 },
        CurveError::WrongKnotCount { needed: 9, given: 8 },
        CurveError::KnotDecreases { knot: 3 },
        CurveError::KnotTooLarge { knot: 3 },
        CurveError::KnotRepeated { knot: 3 },
        CurveError::OutsideKnots,
    ];
    let solid = [
        SolidError::TooFewVertices { distinct: 3 },
        SolidError::TooManyVertices,
        SolidError::PositionOutOfRange { vertex: 1 },
        SolidError::AllInLine,
        SolidError::BadEye,
        SolidError::EyeInside,
        SolidError::VertexInside { vertex: 1, count: 2 },
        SolidError::UnknownVertex { edge: 1 },
        SolidError::OutlineBroken { vertex: 1 },
    ];
    let views = [
        ViewError::NothingToSee,
        ViewError::EyeAtTarget,
        ViewError::UpAlongSight,
        ViewError::NothingInFront,
        ViewError::BehindEye { vertex: 3 },
    ];
    let one = Value::from_num(1);
    let pages = [
        PageError::NoRoom,
        PageError::TooManySteps,
        PageError::DoesNotFit { width: 1 << 16, height: 1 << 16, foot: 1 << 16 },
        PageError::TitleTooWide { width: one, free: one },
    ];
    let machine = [
        MachineError::State(State::Idle),
        MachineError::BeyondTravel { target: 1, x: one, y: one },
        MachineError::MoveTooLong { target: 1 },
    ];
    let settings = [
        SettingError::Unknown,
        SettingError::OutOfRange(Setting::StepsPerMmX),
        SettingError::NotWhole(Setting::StepsPerMmX),
        SettingError::Conflict(LimitsError::StepsPerMillimetre),
        SettingError::Busy,
    ];
    let plain = [
        Refusal::UnknownCommand,
        Refusal::NotANumber,
        Refusal::UnknownSystemCommand,
        Refusal::HomingOff,
        Refusal::Busy,
        Refusal::Locked,
        Refusal::LineTooLong { limit: 256 },
        Refusal::NotText,
        Refusal::BytesLost,
        Refusal::UnsupportedWord(b'Q'),
        Refusal::Arc(ArcError::NoRadius),
        Refusal::NumberOutOfRange,
        Refusal::WrongNumberCount { needed: 3 },
        Refusal::NotAVertexNumber,
        Refusal::NotAChoice { choices: "on or off" },
        Refusal::NotAPage,
        Refusal::NotAnEscape,
        Refusal::NotInTheFont('→'),
        Refusal::TitleTooLong { limit: 80 },
        Refusal::NothingToPlot,
        Refusal::DrawingTooLarge(MISSING),
        Refusal::TooManyLines,
        Refusal::NothingToUndo,
        Refusal::Aborted,
        Refusal::NotKept,
        Refusal::NoJobKept,
        Refusal::OtherSteps,
    ];
    plain
        .into_iter()
        .chain(model.map(Refusal::Model))
        .chain(curve.map(|error| Refusal::Model(ModelError::Curve(error))))
        .chain(solid.map(Refusal::Solid))
        .chain(views.map(Refusal::View))
        .chain(pages.map(Refusal::Page))
        .chain(machine.map(Refusal::Machine))
        .chain(settings.map(Refusal::Setting))
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
