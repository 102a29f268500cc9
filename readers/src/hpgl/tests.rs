//! Tests of reading HP-GL.

use crate::lines::{JobLine, Lines as _};
use crate::page::Page;
use crate::tests::{notes, sent};
use crate::{Arrangement, SourceFile, Turn};

fn lines(text: &str) -> Vec<String> {
    sent("a.plt", text.as_bytes()).expect("HP-GL")
}

#[test]
fn strokes_pens_and_relative_moves_are_read_whatever_ends_an_instruction() {
    let expected = [
        "usemtl pen1",
        "v 1 1 0",
        "v 2 1 0",
        "v 2 2 0",
        "l 1 2 3",
        "usemtl pen3",
        "v 0 0 0",
        "v 1 0 0",
        "l 4 5",
    ];
    for text in [
        "IN;SP1;PU40,40;PD80,40,80,80;PU;SP3;PU0,0;PD;PR40,0;PU;SP0;",
        "in\nsp1\npu40 40pd80 40,80 80 pu\nsp3pa0,0pdpr40 0",
        "\x1B.(\x1B.I81;;17:\x1B.N;19:\x1B%0BINSP1PA40,40PDPA80,40PA80,80PUSP3PU0,0PD40,0",
    ] {
        assert_eq!(lines(text), expected, "{text:?}");
    }
    assert_eq!(sent("known by its beginning", b"IN;PD40,0;").map(|it| it.len()), Ok(4));
}

#[test]
fn lines_of_pjl_and_names_in_quotation_marks_are_passed_over() {
    let plain = lines("IN;PU40,40;PD80,40;");
    for text in [
        "\x1B%-12345X@PJL JOB NAME=\"PD1\"\r\n@PJL SET PD9,9\r\n\x1B%0BIN;PU40,40;PD80,40;",
        "IN;BP1,\"PD1\",2,\"PD9,9\";PU40,40;PD80,40;",
        "IN;MG\"LBSPEED\";PU40,40;PD80,40;\x1B%-12345X@PJL EOJ",
        ";IN;PU40,40;PD\r\n80,40;",
    ] {
        assert_eq!(lines(text), plain, "{text:?}");
        assert!(notes("a.plt", text.as_bytes()).is_empty(), "{text:?}");
    }
    let latin_1 = b"IN;BP1,\"\xFFLB\";PU40,40;PD80,40;";
    assert_eq!(sent("a.plt", latin_1).expect("HP-GL"), plain);
}

#[test]
fn a_name_without_an_end_is_told() {
    let told = "the name that begins in line 2 has no end (another \"): all that follows it in its \
                line is left out";
    assert_eq!(notes("a.plt", b"IN;\nBP1,\"LB;PD9,9;\nPU0,0;PD40,0;"), [told]);
    assert_eq!(notes("a.plt", b"PU0,0;PD40,0;\nBP1,\"LB;PD9,9;"), [told]);
    assert!(notes("a.plt", b"PU0,0;PD40,0;\nCO\"LB;\n\";BP1,\"\";").is_empty());
}

#[test]
fn default_corners_are_those_of_the_turned_page() {
    assert_eq!(lines("RO90;IP;SC0,1,0,1;PU0,0;PD1,0;"), lines("RO90;PU521,603;PD7721,603;"));
}

#[test]
fn scales_turns_arcs_and_outlines_are_drawn() {
    assert_eq!(lines("IP0,0,4000,4000;SC0,10,0,10;PU1,1;PD2,1;")[1..3], ["v 10 10 0", "v 20 10 0"]);
    assert_eq!(lines("RO90;PU40,0;PD80,0;")[1..3], ["v 0 1 0", "v 0 2 0"]);
    assert_eq!(lines("PU40,40;EA80,120;").last().map(String::as_str), Some("l 1 2 3 4 1"));
    let circle = lines("PU400,400;CI200;");
    let on_circle = |line: &&String| {
        let numbers: Vec<f64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
        ((numbers[0] - 10.0).hypot(numbers[1] - 10.0) - 5.0).abs() < 0.006
    };
    let vertices: Vec<&String> = circle.iter().filter(|line| line.starts_with("v ")).collect();
    assert!(vertices.len() > 30 && vertices.iter().all(on_circle), "{circle:?}");
    let arc = lines("PU400,0;PD;AA0,0,90;");
    assert_eq!(
        arc.iter().rev().find(|line| line.starts_with("v ")).map(String::as_str),
        Some("v 0 10 0")
    );
}

/// `PE` of the HP-GL/2 reference: pen up by (10, 5), then down by (10, 10) in base 64.
#[test]
fn encoded_polylines_are_drawn() {
    // 2 * 40 = 80 = 16 + 64, so the digits are 16 and 1.
    let text = [&b"IN;PE<"[..], &[63 + 16, 191 + 1, 63 + 16, 191 + 1, 63 + 16, 191 + 1, 191], b";"]
        .concat();
    let lines = sent("a.plt", &text).expect("HP-GL");
    assert_eq!(lines[1..], ["v 1 1 0", "v 2 1 0", "l 1 2"]);
}

#[test]
fn labels_and_fills_are_drawn_as_a_plotter_draws_them() {
    let fill = lines("FT3,40;PU40,50;RA120,130;");
    let expected = ["v 1 2 0", "v 3 2 0", "l 1 2", "v 3 3 0", "v 1 3 0", "l 3 4"];
    assert_eq!(fill[1..], expected, "there are two lines, and no outline");
    let triangle = lines("PU40,40;PM0;PD120,40,120,120;PM2;EP;");
    assert_eq!(triangle[1..], ["v 1 1 0", "v 3 1 0", "v 3 3 0", "l 1 2 3 1"]);
    assert!(lines("PU0,0;LBI\x03").len() > 3);
    assert_eq!(lines("PU0,0;LBI;")[..3], lines("PU0,0;LBI;\x03")[..3]);
    assert_eq!(
        notes("a.plt", b"PD40,0;SP0;PD80,0;PD;"),
        ["1 instruction draws nothing, because SP0 has put the pen away"]
    );
}

#[test]
fn dots_are_drawn_as_very_short_lines() {
    let expected = ["usemtl pen1", "v 1 1 0", "v 1.08 1 0", "l 1 2"];
    for text in ["IN;PU40,40;PD;PU;", "IN;PU40,40;PD40,40;PU;", "IN;PA40,40;PD;PD;SP0;"] {
        assert_eq!(lines(text), expected, "{text}");
        assert!(notes("a.plt", text.as_bytes()).is_empty(), "{text}");
    }
    // Where a line goes on there is no dot.
    assert_eq!(lines("PU40,40;PD;PD80,40;PU;")[1..], ["v 1 1 0", "v 2 1 0", "l 1 2"]);
}

/// A dot that is scaled with the drawing would be shorter than a step of the motors.
#[test]
fn dots_keep_their_length_on_the_paper() {
    let dots = b"IN;SP1;PU0,0;PD;PU40000,0;PD;PU0,40000;PD;PU;";
    let lengths = |arrangement: &Arrangement| -> Vec<f64> {
        let file = SourceFile::arranged("a.plt".to_owned(), dots.to_vec(), arrangement);
        let file = file.expect("read");
        let numbers = |line: JobLine| -> Option<f64> {
            line.sent.strip_prefix("v ")?.split(' ').next()?.parse().ok()
        };
        let x: Vec<f64> = file.in_order().filter_map(numbers).collect();
        x.chunks(2).map(|ends| ((ends[1] - ends[0]) * 1000.0).round() / 1000.0).collect()
    };
    let mut scaled = Arrangement::default();
    assert_eq!(lengths(&scaled), [0.08; 3]);
    for factor in ["0.1", "10"] {
        scaled.set("scale", factor).expect("a factor");
        assert_eq!(lengths(&scaled), [0.08; 3]);
    }
    // The plotter scales a square of a metre to a tenth of that.
    let page = Page { width: 110.0, height: 210.0 };
    let fitted = Arrangement::on(Some(page), Turn::AsItIs, Some(5.0)).fitted("", 5.0);
    assert_eq!(lengths(&fitted), [0.8; 3]);
    // And to twice its size.
    let page = Page { width: 2010.0, height: 2010.0 };
    let fitted = Arrangement::on(Some(page), Turn::AsItIs, Some(5.0)).fitted("", 5.0);
    assert_eq!(lengths(&fitted), [0.04; 3]);
}

#[test]
fn a_label_without_an_end_is_told() {
    let told = "the label that begins in line 2 has no end (the byte 3): all that follows it is \
                drawn as text";
    assert_eq!(notes("a.plt", b"IN;PU0,0;\nLBa;PU0,0;PD40,0;"), [told]);
    assert!(notes("a.plt", b"IN;PU0,0;LBa\x03;").is_empty());
    let told = "the comment that begins in line 2 has no end (another \"): all that follows it is \
                left out";
    assert_eq!(notes("a.plt", b"IN;PU0,0;PD9,9;\nCO\"a;PU0,0;PD40,0;"), [told]);
    assert!(notes("a.plt", b"IN;PU0,0;PD9,9;CO a").is_empty());
}

#[test]
fn a_polygon_without_an_end_is_told() {
    let line = "IN;PU0,0;PD400,0;\n";
    let told = "the polygon that begins in line 2 has no end (PM2): all moves that follow it are \
                its points, and are not drawn";
    assert_eq!(notes("a.plt", format!("{line}PM0;PD400,400,\n0,400;").as_bytes()), [told]);
    let whole = format!("{line}PM0;PD400,400,0,400;PM2;EP;");
    assert!(notes("a.plt", whole.as_bytes()).is_empty());
}

#[test]
fn of_several_sheets_the_first_is_drawn_and_the_others_are_told() {
    let first = "IN;PG;PD40,0;PU;";
    let rest = "PG;IN;PU0,40;PD40,40;PU;PG;PU0,80;PD;PG;";
    assert_eq!(lines(&[first, rest].concat()), lines(first));
    let told = "the file fills 3 sheets of paper (PG), and only the first one is drawn: make a \
                file of each";
    assert_eq!(notes("a.plt", [first, rest].concat().as_bytes()), [told]);
    assert!(notes("a.plt", [first, "PG;"].concat().as_bytes()).is_empty());
}

#[test]
fn what_is_not_drawn_is_counted_or_refused() {
    assert_eq!(
        notes("a.plt", b"IN;PD40,0;UC1,2;BLx\x03UC;FT9;"),
        [
            "1 instruction BL is not obeyed",
            "1 instruction FT is not obeyed",
            "2 instructions UC are not obeyed"
        ]
    );
    // A plotter takes these without an error, and draws as if they were not there.
    let silent = b"IN;UL;UL2,50,50;SG2;sg 3;RP 2;RF1,2,2,0,1;SV1,2;SV;CT1;PD40,0;PB;";
    assert_eq!(
        notes("a.plt", silent),
        [
            "1 instruction PB is not obeyed",
            "1 instruction RF is not obeyed",
            "1 instruction RP is not obeyed",
            "2 instructions SG are not obeyed",
            "1 instruction SV is not obeyed",
            "1 instruction UL is not obeyed",
        ]
    );
    let points = "0,40,40,0,".repeat(500_000);
    let polygon = format!("PU0,0;PM0;\nPD{points}0,0;PM2;FP;");
    for (text, reason) in [
        ("IN;\nPD1,x", "a.plt:2: error 2 of HP-GL: PD has a wrong number of parameters"),
        ("IN;\nPD1,2.3.4;", "a.plt:2: error 2 of HP-GL: PD has a wrong number of parameters"),
        ("IN;PD1,2,3;", "a.plt:1: error 2 of HP-GL: PD has"),
        ("IN;PU1,1;", "a.plt: there is nothing to draw"),
        ("IN;PD;SC1,1,0,1;", "a.plt:1: error 3 of HP-GL: a parameter of SC"),
        ("IN;PD;PR8000000,0,8000000,0;", "a.plt:1: error 6 of HP-GL: PR leads beyond 8388608"),
        ("IN;PD1,9;\n$120=5\n", "a.plt:2: a line that begins with $ ends HP-GL"),
        (&polygon, "a.plt:2: error 7 of HP-GL: the polygon has more than 1000000 points"),
    ] {
        let error = sent("a.plt", text.as_bytes()).expect_err("refused");
        assert!(error.starts_with(reason), "{error}");
    }
    let error = sent("a.plt", b"IN;PD1,9;\n\xFFPD5,5;").expect_err("refused");
    assert!(error.starts_with("a.plt:2: the byte 0xFF"), "{error}");
}

/// A comb of this many teeth of 1 mm by 10 mm, 1 mm apart, as a polygon of four points a tooth.
fn comb(teeth: usize) -> String {
    let tooth = |index: usize| {
        let (left, right) = (80 * index, 80 * index + 40);
        format!("{left},400,{right},400,{right},0,{},0", right + 40)
    };
    let teeth: Vec<String> = (0..teeth).map(tooth).collect();
    format!("PU0,0;PM0;PD{};PM2;", teeth.join(","))
}

/// The positions of all strokes, in mm.
fn strokes(text: &str) -> Vec<Vec<[f64; 2]>> {
    let (mut vertices, mut strokes) = (Vec::new(), Vec::<Vec<[f64; 2]>>::new());
    for line in lines(text) {
        let words: Vec<&str> = line.split(' ').collect();
        match words.as_slice() {
            ["v", x, y, _] => vertices.push([x, y].map(|word| word.parse().expect("a number"))),
            ["l", numbers @ ..] => {
                let number = |word: &&str| word.parse::<usize>().expect("a number");
                let mut points = numbers.iter().map(|word| vertices[number(word) - 1]);
                // A long stroke takes several lines.
                match strokes.last_mut() {
                    Some(last) if last.last() == vertices.get(number(&numbers[0]) - 1) => {
                        last.extend(points.by_ref().skip(1));
                    }
                    _ => strokes.push(points.collect()),
                }
            }
            _ => {}
        }
    }
    strokes
}

#[test]
fn polygons_larger_than_a_plotters_buffer_are_filled_and_edged() {
    for teeth in [10, 65, 2000, 40_000] {
        let comb = comb(teeth);
        // Lines 2.5 mm apart cross each tooth at 0, 2.5, 5 and 7.5 mm, in turn to the right and
        // back. The upper end of an edge does not belong to it.
        let mut expected = Vec::new();
        for (row, y) in [0.0, 2.5, 5.0, 7.5].into_iter().enumerate() {
            let tooth = |index: usize| [2.0 * index as f64, 2.0 * index as f64 + 1.0];
            let mut forth: Vec<_> =
                (0..teeth).map(|index| tooth(index).map(|x| [x, y]).to_vec()).collect();
            if row % 2 == 1 {
                forth.reverse();
                forth.iter_mut().for_each(|line| line.reverse());
            }
            expected.extend(forth);
        }
        assert_eq!(strokes(&format!("{comb}FT3,100;FP;")), expected, "{teeth} teeth");

        let mut edges = vec![[0.0, 0.0]];
        for index in 0..teeth {
            let left = 2.0 * index as f64;
            edges.extend([[left, 10.0], [left + 1.0, 10.0], [left + 1.0, 0.0], [left + 2.0, 0.0]]);
        }
        edges.push([0.0, 0.0]);
        assert_eq!(strokes(&format!("{comb}EP;")), [edges], "{teeth} teeth");
    }
}

#[test]
fn a_polygon_of_few_points_is_filled_as_by_a_plotter() {
    let mut state = 1_u32;
    let mut below = |bound: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % bound
    };
    for case in 0..200 {
        let mut text = String::from("PU100,100;");
        for _ in 0..2 {
            // A coarse grid lets edges meet, lie on lines of the fill, and lie on each other.
            let grid = [1, 40, 160][below(3) as usize];
            text += "PM0;PD";
            for _ in 0..1 + below(3) {
                for _ in 0..2 + below(30) {
                    text +=
                        &format!("{},{},", below(1600) / grid * grid, below(1600) / grid * grid);
                }
                text += ["PM1;", "PM1;CI200,30;PM1;", "AA800,800,200,20;PM1;"][below(3) as usize];
                text += "PD";
            }
            let angle = [0, 45, 90, 30][below(4) as usize];
            let kind = 1 + below(4);
            text += &format!("PM2;FT{kind},{},{angle};FP;EP;", 20 + below(60));
            text += "RR400,300;WG200,10,100;";
        }
        let limits = super::LIMITS;
        let mut plotter = Box::new(super::Interpreter::new());
        plotter.initialize(super::Point::default(), limits);
        let mut reader = super::Reader::new().interpreter;
        for byte in text.bytes() {
            plotter.push(byte);
            reader.push(byte);
            loop {
                let (expected, found) = (plotter.next_action(), reader.next_action());
                assert_eq!(found, expected, "{case}: {text}");
                if found.is_none() {
                    break;
                }
            }
        }
        assert_eq!(reader.take_error(), None, "{case}: {text}");
    }
}

#[test]
fn labels_of_latin_1_are_drawn_as_those_of_utf_8() {
    let label = |text: &[u8]| sent("a.plt", &[b"PU40,40;LB", text, b"\x03CO\xFF\xE4;"].concat());
    let expected = label("Mäxéÿ".as_bytes()).expect("HP-GL");
    assert_eq!(label(b"M\xE4x\xE9\xFF"), Ok(expected));
    let error = sent("a.plt", b"PU40,40;PE\xFF;PD5,5;").expect_err("refused");
    assert!(error.contains("the byte 0xFF"), "{error}");
}

#[test]
fn patterns_in_mm_and_chords_by_their_distance_are_drawn() {
    let dashes = lines("PU0,0;LT -2 4 1;PD400,0;");
    assert_eq!(dashes.iter().filter(|line| line.starts_with("l ")).count(), 3);
    let count = |text: &str| lines(text).iter().filter(|line| line.starts_with("v ")).count();
    assert!(count("PU400,400;CT1;CI200,100;") < 6);
    assert_eq!(count("PU400,400;CI200,10;"), 36);
}

#[test]
fn a_size_that_depends_on_the_plotter_is_told_once() {
    let told =
        ["the size depends on P1 and P2, which the file does not set (IP): they are taken to \
                 be those of an HP 7475A with A4 paper"];
    for text in [
        "IN;SP1;SC0,100,0,100;PU10,10;PD20,20;PU;PD30,30;",
        "IN;IP0,0,4000,4000;IP;SC0,10,0,10;PU1,1;PD2,1;",
        "IP0,0,400,400;IN;SC0,10,0,10;PU1,1;PD2,1;",
        "SR1,2;PU40,40;LBa\x03;PU;LBb\x03",
    ] {
        assert_eq!(notes("a.plt", text.as_bytes()), told, "{text}");
    }
    for text in [
        "IN;IP0,0,4000,4000;SC0,10,0,10;PU1,1;PD2,1;",
        "IN;SC0,10,0,10;IP0,0,4000,4000;PU1,1;PD2,1;",
        "IN;SC0,10,0,10;PU1,1;SC;PD200,100;",
        "SR1,2;PU40,40;PD80,40;",
        "SR1,2;SI;PU40,40;LBa\x03",
    ] {
        assert_eq!(notes("a.plt", text.as_bytes()), [""; 0], "{text}");
    }
}

#[test]
fn what_is_drawn_without_a_pen_is_told() {
    let line = "IN;SP1;PU40,40;PD80,40;PU;SP0;";
    for end in ["", "PU0,0;", "PA0,0;PU;", "SP2;PD40,80;", "IN;PD9,9;"] {
        assert_eq!(notes("a.plt", format!("{line}{end}").as_bytes()), [""; 0], "{end}");
    }
    for (end, count) in [
        ("PD400,400;", "1 instruction draws"),
        ("PD;PA9,9,80,80;", "2 instructions draw"),
        ("PU400,400;CI40;PU;LBabc\x03PU0,0", "2 instructions draw"),
    ] {
        let told = format!("{count} nothing, because SP0 has put the pen away");
        assert_eq!(notes("a.plt", format!("{line}{end}").as_bytes()), [told.as_str()], "{end}");
        let error = sent("a.plt", format!("IN;SP0;{end}").as_bytes()).expect_err("nothing");
        assert!(error.ends_with(&format!("nothing to draw in this HP-GL; {told}")), "{error}");
    }
}
