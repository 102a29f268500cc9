//! The list of lines, with what is answered and drawn.

use super::draw;
use super::ink::{inked, places, plan, strokes};
use penup_host_tests::ink::difference;
use penup_host_tests::whole_jobs::Bench;

/// The lines of the list, and of each what is sent, the answers, and what is drawn.
fn rows() -> impl Iterator<Item = (&'static str, [&'static str; 3])> {
    let lines = include_str!("lines.txt").lines();
    lines.filter(|line| !line.is_empty() && !line.starts_with('#')).map(|line| {
        let fields: Vec<&str> = line.split(" | ").collect();
        let [sent, answers, drawn] = fields[..] else { panic!("three fields: {line}") };
        (line, [sent, answers, drawn])
    })
}

/// The bytes of a line, behind what sets the scaling points.
fn bytes(sent: &str) -> Vec<u8> {
    let mut bytes = b"IN;IP0,0,1000,1000;".to_vec();
    for letter in sent.chars() {
        match letter {
            '␃' => bytes.push(3),
            '␛' => bytes.push(0x1B),
            '⏎' => bytes.extend(b"\r\n"),
            '␈' => bytes.push(8),
            letter => bytes.extend(letter.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    bytes
}

#[test]
fn lines_are_drawn_and_answered_as_listed() {
    let (mut count, mut faults) = (0, String::new());
    for (line, [sent, answers, drawn]) in rows() {
        count += 1;
        let bytes = [&bytes(sent)[..], b";OE;"].concat();
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

/// What a plotter refuses with an error number, the reader of files refuses with a sentence. It
/// does not know the travel, so of what lies beyond it draws more; and `ESC.K`, which empties the
/// buffer of a port, has nothing to empty in a file.
#[test]
fn lines_are_drawn_from_a_file_as_by_the_plotter() {
    /// A dot is drawn from a file as a line of 0.02 mm, in steps.
    const DOT: f64 = 0.08 * 80.0;
    let (mut drawn_alike, mut refused, mut faults) = (0, 0, String::new());
    for (line, [sent, answers, drawn]) in rows().filter(|(line, _)| !line.contains("␛.K")) {
        let expected = strokes(drawn);
        match plan(&bytes(sent)) {
            Ok(segments) => {
                let ink = places(&segments);
                if segments.iter().flatten().flatten().any(|position| *position < 0.0) {
                    let is_near = |place: &[f64; 2]| {
                        ink.iter().any(|it| (it[0] - place[0]).hypot(it[1] - place[1]) < 1.0)
                    };
                    if !places(&expected).iter().all(is_near) {
                        faults += &format!("{line}\n    there should be more ink\n");
                    }
                    continue;
                }
                drawn_alike += 1;
                if let Some(difference) = difference(&ink, &expected, DOT + 0.5) {
                    faults += &format!("{line}\n    {difference}\n");
                }
            }
            Err(reason) => {
                refused += 1;
                let is_empty = expected.is_empty() && reason.contains("there is nothing to draw");
                let error = answers.split_whitespace().last().unwrap_or_default();
                if !is_empty && !reason.contains(&format!("error {error} of HP-GL")) {
                    faults += &format!("{line}\n    {reason}\n");
                }
            }
        }
    }
    assert!(drawn_alike >= 100 && refused >= 20, "{drawn_alike} drawn, {refused} refused");
    assert!(faults.is_empty(), "{faults}");
}
