use super::*;
use std::vec::Vec;

fn numbers(line: &str) -> Result<Vec<i32>, CommandError> {
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
            Err(CommandError::NotAVertexNumber),
            "{word}"
        );
    }
}

#[test]
fn vertices_need_three_numbers_and_may_have_more() {
    for line in ["v 1 2 3", "v  1 2 3 1.0", "v 1 2 3 0.5 0.5 0.5", " v 1 2 3 "] {
        assert!(matches!(Command::parse(line), Ok(Command::Vertex(_))), "{line}");
    }
    assert_eq!(Command::parse("v 1 2"), Err(CommandError::WrongNumberCount { needed: 3 }));
    assert_eq!(Command::parse("v 1 2 z"), Err(CommandError::NotANumber));
    assert_eq!(Command::parse("v 1 2 3 z"), Err(CommandError::NotANumber));
    assert_eq!(Command::parse("v"), Err(CommandError::WrongNumberCount { needed: 3 }));
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
    let names = ["red", "Red", "pen", "penx", "pen3b", "rot grün", "grün", "-1", "+1", "0", "33"];
    let names: Vec<PenName> = names.iter().map(|name| pen_name(name)).collect();
    for (at, name) in names.iter().enumerate() {
        assert!(matches!(name, PenName::Other(_)) && !names[..at].contains(name), "{at}");
    }
    assert_eq!(pen("g  red "), (false, names[0]));
}

#[test]
fn what_is_no_command_is_refused() {
    assert_eq!(Command::parse("G1 = 2"), Err(CommandError::NotAWord));
    for line in ["vv 1 2 3", "hello", "ff"] {
        assert_eq!(Command::parse(line), Err(CommandError::UnknownCommand), "{line}");
    }
    for line in ["$nothing", "$plo", "$ plot it"] {
        assert_eq!(Command::parse(line), Err(CommandError::UnknownSystemCommand), "{line}");
    }
}

#[test]
fn every_command_of_the_help_is_one() {
    for (usage, _) in HELP.concat() {
        let line = usage.split_once('=').map_or(usage, |(name, _)| name);
        let with_value = usage.contains('=');
        let all_are = |line: &str| line.split(" | ").all(|one| Command::parse(one).is_ok());
        assert!(with_value || all_are(line), "{usage}");
        if with_value {
            let set = std::format!("{line}=?");
            assert!(!matches!(Command::parse(&set), Ok(Command::Assign { .. })), "{usage}");
        }
    }
}

#[test]
fn names_of_pens_are_numbers_or_their_hashes() {
    // As the authors of the hash publish it.
    assert_eq!(pen_name(" a "), PenName::Other(0xE40C_292C));
    assert_eq!(pen_name("foobar"), PenName::Other(0xBF9C_F968));
    assert_eq!(pen_name("the PEN3"), PenName::Number(2));
    assert_eq!(pen_name("2"), PenName::Number(1));
    assert_eq!(pen_name("pen99"), PenName::Number(u8::MAX));
    assert_eq!(pen_name(""), PenName::Number(0));
}

#[test]
fn a_title_keeps_its_text() {
    assert_eq!(title(" $title= A  b "), Some(" A  b "));
    assert_eq!([title("$page=3"), title("title=a"), title("$title")], [None; 3]);
}

#[test]
fn curves_of_another_type_are_refused() {
    assert!(matches!(Command::parse("cstype bspline"), Ok(Command::Nothing)));
    let refused = Command::parse("cstype bezier");
    assert!(matches!(refused, Err(CommandError::NotAChoice { .. })), "{refused:?}");
}
