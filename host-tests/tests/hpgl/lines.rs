//! The list of lines, with what is answered and drawn.

use super::draw;
use super::ink::{inked, strokes};
use penup_host_tests::ink::difference;
use penup_host_tests::whole_jobs::Bench;

#[test]
fn lines_are_drawn_and_answered_as_listed() {
    let (mut count, mut faults) = (0, String::new());
    let text = include_str!("lines.txt");
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        count += 1;
        let fields: Vec<&str> = line.split(" | ").collect();
        let [sent, answers, drawn] = fields[..] else { panic!("three fields: {line}") };
        let mut bytes = b"IN;IP0,0,1000,1000;".to_vec();
        let mut rest = sent;
        while let Some(letter) = rest.chars().next() {
            rest = &rest[letter.len_utf8()..];
            match letter {
                '␃' => bytes.push(3),
                '␛' => bytes.push(0x1B),
                '⏎' => bytes.extend(b"\r\n"),
                '␈' => bytes.push(8),
                letter => bytes.extend(letter.encode_utf8(&mut [0; 4]).as_bytes()),
            }
        }
        bytes.extend(b";OE;");
        let mut bench = Bench::small();
        let heard = draw(&mut bench, &bytes).replace('\r', " ").replace('\n', "⏎");
        if heard.trim() != answers.trim() {
            faults += &format!("{line}\n    answered {heard}\n");
        }
        if let Some(difference) = difference(&inked(&bench), &strokes(drawn), 0.0) {
            faults += &format!("{line}\n    {difference}\n");
        }
    }
    assert!(count >= 100, "{count} lines");
    assert!(faults.is_empty(), "{faults}");
}
