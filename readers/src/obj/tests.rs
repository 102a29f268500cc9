use super::*;

fn read(bytes: &[u8]) -> Result<ObjLines, ReadError> {
    ObjLines::new("f.obj".to_owned(), bytes.to_owned())
}

fn sent(bytes: &[u8]) -> Vec<(usize, String)> {
    let file = read(bytes).expect("a file that can be sent");
    let lines: Vec<JobLine> = (0..file.count()).filter_map(|index| file.line(index)).collect();
    assert_eq!((lines.len(), file.line(file.count())), (file.count(), None));
    assert!(file.in_order().eq(lines.iter().cloned()));
    // In any other order they are the same.
    for step in [1, 7, 17, 100] {
        for index in (0..lines.len()).rev().flat_map(|index| [index, index + step]) {
            assert_eq!(file.line(index).as_ref(), lines.get(index), "{index}");
        }
    }
    let number = |line: &JobLine| line.origin.as_ref().expect("from the file").line;
    lines.into_iter().map(|line| (number(&line), line.sent)).collect()
}

fn refusal(bytes: &[u8]) -> String {
    read(bytes).expect_err("refused").to_string()
}

#[test]
fn blank_lines_and_comments_stay_at_home_and_numbers_count_them() {
    assert_eq!(
        sent(b"\xEF\xBB\xBF# cube\r\n\r\nv 0 0 0\r\n  # again\n\tf  1 2\t3  # mine\n"),
        [(3, "v 0 0 0".into()), (5, "f 1 2 3".into())]
    );
    assert_eq!(sent("usemtl Würfel".as_bytes()), [(1, "usemtl Würfel".into())]);
    assert_eq!(sent(b""), []);
    assert_eq!(sent(b"v 1 2 3"), [(1, "v 1 2 3".into())]);
    assert_eq!(sent(b"\rv 1 2 3\rf 1 2 3#\r"), [(2, "v 1 2 3".into()), (3, "f 1 2 3".into())]);
}

#[test]
fn many_lines_are_the_same_in_any_order() {
    let text: String = (0..60).map(|n| format!("v {n} 0 0\n# {n}\n")).collect();
    let expected: Vec<_> = (0..60).map(|n| (2 * n + 1, format!("v {n} 0 0"))).collect();
    assert_eq!(sent(text.as_bytes()), expected);
}

#[test]
fn what_changes_nothing_is_not_sent_however_long_it_is() {
    let long = format!("o {}\nmtllib {}\nv 1 2 3\n", "x".repeat(300), "a b ".repeat(300));
    assert_eq!(sent(long.as_bytes()), [(3, "v 1 2 3".into())]);
    assert_eq!(sent(b"vn 0 0 1\nvt 0 0\ns off\no x\nmtllib C:\\dir\\\nv 1 2 3\n").len(), 1);
}

#[test]
fn a_line_goes_on_after_a_backslash() {
    let text = b"v 1 2 3\nf 1 \\\n 2\\\r\n 3\nv 1 2 \\";
    assert_eq!(sent(&text[..21]), [(1, "v 1 2 3".into()), (2, "f 1 2 3".into())]);
    assert!(refusal(text).starts_with("f.obj:5: "), "{}", refusal(text));
}

#[test]
fn no_byte_of_a_file_acts_at_once() {
    let other = |byte: &u8| !matches!(byte, b'\n' | b'\r' | b'#');
    for bytes in [1..=127, 128..=191, 192..=255] {
        let bytes: Vec<u8> = bytes.filter(other).collect();
        let lines = sent(&[b"g ".as_slice(), &bytes, b" end"].concat());
        let [(1, sent)] = lines.as_slice() else {
            panic!("one line expected: {lines:?}");
        };
        assert!(!sent.chars().any(acts_at_once), "{sent}");
        assert!(sent.starts_with("g ") && sent.ends_with(" end"), "{sent}");
    }
}

#[test]
fn names_that_are_not_utf_8_stay_different() {
    let names = sent(b"usemtl r\xE9d\nusemtl r\xE8d\n");
    assert_ne!(names[0].1, names[1].1);
}

#[test]
fn a_command_in_a_file_is_refused() {
    for line in ["$plot", "$page=10x10", "$nonsense", "G1 X10", "M3", "G99", "X5", "$"] {
        let error = refusal(format!("v 0 0 0\n  {line}\n").as_bytes());
        assert!(error.starts_with("f.obj:2: a file cannot hold commands"), "{line}: {error}");
    }
}

#[test]
fn a_line_is_shown_without_what_acts_on_a_terminal() {
    let shown = |bytes: &[u8]| match read(bytes) {
        Err(ReadError::Line { origin, .. }) => origin.shown(),
        other => panic!("{other:?}"),
    };
    assert_eq!(shown(b"f \x1b[2J\x07 Z\xff\n"), "f ·[2J· Zÿ");
    let long = shown(format!("f {}", "ü".repeat(101)).as_bytes());
    assert_eq!((long.chars().count(), long.chars().last()), (101, Some('…')));
}

#[test]
fn a_line_that_is_too_long_is_named_with_its_length_and_the_limit() {
    let face = format!("v 0 0 0\nf{}\n", " 1".repeat(200));
    for text in [face, format!("v 0 0 0\nf {}", "1".repeat(399))] {
        let error = refusal(text.as_bytes());
        let expected = "f.obj:2: the line has 401 bytes, and a line may have at most 256";
        assert!(error.starts_with(expected), "{error}");
    }
    // The longest line that is sent.
    let fits = format!("f 11{}", " 1".repeat(126));
    assert_eq!((fits.len(), sent(fits.as_bytes()).len()), (256, 1));
    assert!(read(format!("{fits} ").as_bytes()).is_ok());
    assert!(read(format!("{fits}1").as_bytes()).is_err());
}

#[test]
fn a_long_polyline_is_sent_as_several_that_share_a_vertex() {
    let numbers: Vec<String> = (1..=1000).map(|number| number.to_string()).collect();
    for (text, last_line) in [
        (format!("v 0 0 0\nl {}\nv 1 1 1\n", numbers.join(" ")), 3),
        (format!("v 0 0 0\nl {}\nv 1 1 1\n", numbers.join(" \\\n")), 1002),
    ] {
        let lines = sent(text.as_bytes());
        let (parts, ends) = (&lines[1..lines.len() - 1], (&lines[0], &lines[lines.len() - 1]));
        assert_eq!(ends, (&(1, "v 0 0 0".into()), &(last_line, "v 1 1 1".into())));
        let mut chain: Vec<&str> = Vec::new();
        for (_, part) in parts {
            assert!(part.len() <= LINE_LIMIT, "{part}");
            let mut words = part.split(' ');
            assert_eq!(words.next(), Some("l"));
            if let Some(shared) = chain.pop() {
                assert_eq!(words.clone().next(), Some(shared));
            }
            chain.extend(words);
        }
        assert_eq!(chain, numbers);
        assert!(parts.len() < 20);
    }
}

#[test]
fn what_is_no_text_is_refused() {
    let error = refusal(b"v 0 0 0\nv 0 \0 0\n");
    assert!(error.starts_with("f.obj:2: this is no text"), "{error}");
    assert!(refusal(&[0; 5000]).starts_with("f.obj:1: this is no text"));
    assert!(refusal(b"\xFF\xFEv\0 \x000\0").contains("save it as UTF-8"));
}

#[test]
fn what_no_plotter_takes_is_refused_before_anything_is_sent() {
    for line in ["v 1 2", "v nan 0 0", "v 0 inf 0", "f 1 2 x", "hello", "deg 9", "cstype bezier"] {
        let error = refusal(format!("v 0 0 0\n\n{line}\n").as_bytes());
        assert!(error.starts_with("f.obj:3: "), "{line}: {error}");
        assert!(error.ends_with(line), "{line}: {error}");
    }
}

#[test]
fn the_bounds_of_a_plan_are_those_of_what_is_drawn() {
    let bounds = |text: &str| {
        let file = Obj.read("f.obj".to_owned(), text.into(), &Arrangement::default());
        file.expect("a file that can be sent").bounds
    };
    let square = "v 10.1 10 7\nv 30.1 10 7\nv 30.1 30 7\nv 10.1 30 7\n";
    let drawn = |lines: &str| bounds(&format!("{square}{lines}"));
    assert_eq!(drawn("l 1 2 3\n"), Some([[10.1, 10.0], [30.1, 30.0]]));
    assert_eq!(drawn("l -4 -3\n"), Some([[10.1, 10.0], [30.1, 10.0]]));
    // Lines that a plotter does not understand make it no solid.
    assert_eq!(drawn("p 1\nl 1 2\n"), Some([[10.1, 10.0], [30.1, 10.0]]));
    assert_eq!(bounds(&format!("l 1 2 3\n{square}")), Some([[10.1, 10.0], [30.1, 30.0]]));
    // A cubic from the first to the last vertex bulges to three quarters of the way.
    let bezier = drawn("usemtl red\ndeg 3\ncurv 0 1 1 2 3 4\nparm u 0 0 0 0 1 1 1 1\nend\n");
    let Some([[left, low], [right, high]]) = bezier else { return assert_eq!(bezier, None) };
    let is_near = |value: f64, expected: f64| (value - expected).abs() < 0.01;
    assert!(is_near(left, 10.1) && is_near(low, 10.0) && is_near(high, 30.0), "{bezier:?}");
    assert!(is_near(right, 25.1), "{bezier:?}");
    for no_plan in ["", "p 1\n", "f 1 2 3\n", "l 1 2\nf 1 2 3\n", "v 0 0 8\nl 1 2\n"] {
        assert_eq!(drawn(no_plan), None, "{no_plan}");
    }
}
