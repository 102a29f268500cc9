//! Tests of the interpreter and of the session: bytes in, actions and answers out.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

use super::parser::Mode;
use super::{
    Action, Beginning, DAMAGED, Dialect, Interpreter, Point, RECEIVED_BYTES, Rectangle, Session,
    Token, UNIT,
};
use std::format;
use std::string::String;
use std::vec::Vec;

/// The limits: a travel of 400 mm by 300 mm.
const LIMITS: Rectangle =
    Rectangle { least: Point { x: 0, y: 0 }, most: Point { x: 16000 * UNIT, y: 12000 * UNIT } };

fn units(Point { x, y }: Point) -> String {
    let unit = |coordinate: i64| {
        let hundredths = (coordinate * 100 + UNIT / 2).div_euclid(UNIT);
        let number = hundredths as f64 / 100.0;
        format!("{number}")
    };
    format!("{},{}", unit(x), unit(y))
}

fn shown(action: &Action) -> String {
    match action {
        Action::Nothing => String::from("nothing"),
        Action::Initialize => String::from("init"),
        Action::Line([from, to]) => format!("{}>{}", units(*from), units(*to)),
        Action::Dot(at) => format!("dot {}", units(*at)),
        Action::Go(to) => format!("go {}", units(*to)),
        Action::Pen(pen) => format!("pen {pen}"),
        Action::Sheet => String::from("sheet"),
        Action::Answer(answer) => format!("'{answer}'"),
    }
}

fn interpreter() -> Interpreter {
    let mut interpreter = Interpreter::new();
    interpreter.initialize(Point::default(), LIMITS);
    interpreter
}

/// All actions of some bytes.
fn actions_of(interpreter: &mut Interpreter, bytes: &[u8]) -> Vec<Action> {
    let mut actions = Vec::new();
    for byte in bytes {
        interpreter.push(*byte);
        while let Some(action) = interpreter.next_action() {
            actions.push(action);
        }
    }
    actions
}

fn actions(bytes: &[u8]) -> String {
    let actions = actions_of(&mut interpreter(), bytes);
    actions.iter().map(shown).collect::<Vec<_>>().join(" ")
}

#[test]
fn instructions_end_with_a_semicolon_a_line_or_the_next_letter() {
    for text in [
        "PU10,20;PD30,40,50,60;",
        "PU10,20PD30,40 50 60;",
        "pu10 20\npd30,40,\n50,60;",
        "PU10,20;PD;PA30,40,50,60;",
        "PU\r\n10,20;PD\r\n30,40\r\n50,60;",
        "PU10,20;PD;PA\n 30,40,50,60;",
    ] {
        let found = actions(text.as_bytes()).replace(" dot 10,20", "");
        assert_eq!(found, "go 10,20 10,20>30,40 30,40>50,60", "{text}");
    }
}

#[test]
fn pd_at_the_end_of_a_line_makes_a_dot_unless_coordinates_follow() {
    for end in ["PU;", "\nPU;", ";", "\r\nPA50,60;"] {
        let found = actions(format!("PU10,20;PD\n{end}").as_bytes());
        assert!(found.starts_with("go 10,20 dot 10,20"), "{end}: {found}");
    }
    for end in ["30,40;", "+30,40;", " 30,40;", ".5,40;"] {
        let found = actions(format!("PU10,20;PD\n{end}OE;").as_bytes());
        assert!(!found.contains("dot") && found.ends_with("'0'"), "{end}: {found}");
    }
}

#[test]
fn names_in_quotation_marks_are_no_instructions() {
    let drawn = "go 10,20 10,20>30,20 '0'";
    for name in [
        "BP;BP1,\"SPLAT\";",
        "BP1,\"LB\",2,\"PE?;!\"",
        "bp 1.5\"CO\"2.5;",
        "MG\"SPEED\";",
        "MG;MG \"LB\"",
        // A line ends a name that has no end.
        "BP1,\"LB\n",
        "MG\"LB\r\n",
    ] {
        let found = actions(format!("{name}PU10,20;PD30,20;OE;").as_bytes());
        assert_eq!(found, drawn, "{name}");
    }
    // Behind other names, and behind the end of the instruction, it is no name.
    for text in ["SP1,\"PU7,8", "BP;\"PU7,8", "BP\n\"PU7,8", "BP1PU\"7,8"] {
        let found = actions(format!("{text};").as_bytes());
        assert!(found.ends_with("go 7,8"), "{text}: {found}");
    }
    // Of a damaged name, all is left out up to the end of the instruction.
    for name in [&b"BP1,\"A\xFFLB\";"[..], b"BP1,\"LB\xFF;", b"MG\"\xFF\",PE;"] {
        let found = actions(&[name, b"PU10,20;PD30,20;"].concat());
        assert_eq!(found.replace("pen 0 ", ""), "go 10,20 10,20>30,20", "{}", name.escape_ascii());
    }
}

#[test]
fn lines_of_pjl_are_no_instructions() {
    for lines in ["@PJL SET COPIES=1\r\n@PJL LBPE\n", "PU;@PJL CO\r", "@\n", "@PJL \"\r\n\r\n"] {
        let found = actions(format!("{lines}PU10,20;PD30,20;OE;").as_bytes());
        assert_eq!(found, "go 10,20 10,20>30,20 '0'", "{lines}");
    }
    // The line ends an instruction, and a label may have the letter.
    assert_eq!(actions(b"PD10,20@PJL\nPD30,20;"), "0,0>10,20 10,20>30,20");
    assert!(actions(b"LB@\x03PU10,20;").ends_with("go 10,20"));
    let damaged = b"@PJL LB\xFFLB;PU10,20;PD30,20;";
    assert_eq!(actions(damaged), "go 10,20 10,20>30,20");
}

/// The receive interrupt must not take for a command what the interpreter takes for text.
#[test]
fn dialect_and_interpreter_agree_which_bytes_are_text() {
    let mut state = 7u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let words = [
        &b"LB"[..],
        b"BL",
        b"WD",
        b"DT",
        b"SM",
        b"PE",
        b"CO",
        b"BP",
        b"MG",
        b"MG\"",
        b"BP1,\"",
        b"IN",
        b"DF",
        b"DT#",
        b"DT#,1",
        b"PU",
        b"B",
        b"P",
        b"\"",
        b"\"",
        b"@",
        b"@PJL",
        b"#",
        b"\x03",
        b";",
        b";",
        b";",
        b",",
        b" ",
        b"1",
        b"1.2.3",
        b"-",
        b"\n",
        b"\r\n",
        b"\xFF",
        b"\xC3",
        b"\xA9",
        b"\xE2",
        b"a",
        b"\0",
    ];
    let (mut texts, mut codes) = (0, 0);
    for _ in 0..2000 {
        let (mut dialect, mut interpreter) = (Dialect::new(), interpreter());
        for byte in b"IN;" {
            dialect.take(*byte);
        }
        let mut sent = Vec::new();
        for _ in 0..60 {
            for byte in words[random() as usize % words.len()] {
                sent.push(*byte);
                dialect.take(*byte);
                interpreter.push(*byte);
                while let Some(action) = interpreter.next_action() {
                    if action == Action::Initialize {
                        interpreter.initialize(Point::default(), LIMITS);
                    }
                }
                let is_text = interpreter.mode != Mode::Code;
                assert_eq!(dialect.is_in_text(), is_text, "{}", sent.escape_ascii());
                *if is_text { &mut texts } else { &mut codes } += 1;
            }
        }
    }
    assert!(texts > 10_000 && codes > 10_000, "{texts} {codes}");
}

#[test]
fn a_pair_is_drawn_as_it_comes() {
    let mut interpreter = interpreter();
    let text = b"PD1,1,2,2,3,3";
    let drawn: Vec<usize> =
        text.iter().map(|byte| actions_of(&mut interpreter, &[*byte]).len()).collect();
    // Each is known to be over with the comma behind it.
    assert_eq!(drawn, [0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
}

#[test]
fn errors_have_the_numbers_of_the_7475() {
    for (text, number) in [
        ("", 0),
        ("XX;", 1),
        ("P1;", 1),
        ("5;", 1),
        ("PA5;", 2),
        ("PA1,2,3;", 2),
        ("AA1,2;", 2),
        ("SC1,2,3;", 2),
        ("SC1,1,2,3;", 3),
        ("PA99999999,0;", 3),
        ("SI0,1;", 3),
        ("LT9;", 3),
        ("CA10;", 5),
        ("SC0,1,0,1;PA8000000,0;", 6),
        ("FS3;AS4;PS4;VS10;", 0),
    ] {
        let found = actions(format!("{text}OE;OE;").as_bytes());
        let found: Vec<&str> = found.split(' ').filter(|action| action.starts_with('\'')).collect();
        assert_eq!(found, [format!("'{number}'").as_str(), "'0'"], "{text}");
    }
}

#[test]
fn lines_are_clipped_at_the_limits_and_at_the_window() {
    assert_eq!(
        actions(b"PU100,100;PD20100,100;PA100,200;"),
        "go 100,100 100,100>16000,100 16000,120.5>100,200"
    );
    assert_eq!(actions(b"PU-10,-10;PD-20,50;PA-5,-5;"), "");
    assert_eq!(actions(b"PU-100,100;PD100,-100;PA100,300;"), "0,0>0,0 100,0>100,300");
    assert_eq!(actions(b"IW100,100,200,200;PU0,150;PD300,150;"), "100,150>200,150");
    assert_eq!(actions(b"IW100,100,200,200;IW;PU0,150;PD300,150;"), "go 0,150 0,150>300,150");
}

#[test]
fn scales_and_turns() {
    assert_eq!(actions(b"IP0,0,1000,500;SC0,10,0,10;PU5,5;PD10,0;"), "go 500,250 500,250>1000,0");
    assert_eq!(actions(b"IP0,0,1000,500;SC10,0,0,10;PU1,1;"), "go 900,50");
    assert_eq!(actions(b"IP0,0,1000,500;SC0,10,0,10,1;PU5,5;PD10,0;"), "go 500,250 500,250>750,0");
    // The room that is left over is divided as the last two numbers say, in percent.
    let left = b"IP0,0,1000,500;SC0,10,0,10,1,0,0;PU5,5;PD10,0;";
    assert_eq!(actions(left), "go 250,250 250,250>500,0");
    let right = b"IP0,0,1000,500;SC0,10,0,10,1,100,50;PU5,5;PD10,0;";
    assert_eq!(actions(right), "go 750,250 750,250>1000,0");
    assert_eq!(actions(b"IP0,0,1000,500;SC1,2,1,2,2;PU11,1;"), "go 20,0");
    assert_eq!(actions(b"RO90;PU100,200;PR10,0;"), "go 15800,100 go 15800,110");
    assert_eq!(actions(b"RO180;PU100,200;"), "go 15900,11800");
    assert_eq!(
        actions(b"RO270;PU100,200;RO;PU100,200"),
        "go 200,11900 go 100,200".replace(" go 100,200", "")
    );
    assert_eq!(
        actions(b"RO90;PU100,200;OA;OC;OH;").split(" '").skip(1).collect::<Vec<_>>(),
        ["100,200,0'", "100,200,0'", "0,0,12000,16000'"]
    );
}

#[test]
fn answers() {
    for (text, expected) in [
        ("OI;", "'7475A'"),
        ("OS;OS;", "'24' '16'"),
        ("XX;OS;OE;OS;", "'56' '1' '16'"),
        // Labels that do not begin at the pen, and the size of letters in HP-GL/2.
        ("LO;LO1;OE;LO5;OE;SD1,21,4,5;OE;", "'0' '1' '1'"),
        // Whether the terminator is drawn, which it is not, is a number after it.
        ("DT#,1;LB#DT\x03;OE;", "'0'"),
        ("DT#,0;OE;DT#,1,1;OE;", "'3' '2'"),
        ("OP;", "'603,521,10603,7721'"),
        // The default corners are turned with the page, and stay when it turns later.
        ("RO90;IP;OP;RO;OP;", "'521,603,7721,10603' '521,603,7721,10603'"),
        ("RO270;IP;OP;", "'521,603,7721,10603'"),
        ("RO180;IP;OP;RO90;OP;", "'603,521,10603,7721' '603,521,10603,7721'"),
        ("IP1,2,3,4;OS;OP;OS;", "'26' '1,2,3,4' '16'"),
        ("OH;", "'0,0,16000,12000'"),
        ("OA;", "'0,0,0'"),
        ("OF;OO;", "'40,40' '0,1,0,0,1,0,0,0'"),
        ("OW;IW1,2,3,4;OW;", "'0,0,16000,12000' '1,2,3,4'"),
    ] {
        assert_eq!(actions(text.as_bytes()), expected, "{text}");
    }
    assert_eq!(actions(b"PD10,20OA;OC;OS;"), "0,0>10,20 '10,20,1' '10,20,1' '25'");
    assert_eq!(actions(b"SC0,1,0,1;PU0.5,0.25;OC;"), "go 5603,2321 '0.5000,0.2500,0'");
}

#[test]
fn a_circle_is_closed_and_within_an_eighth_of_a_unit() {
    let mut interpreter = interpreter();
    let found = actions_of(&mut interpreter, b"PU4000,4000;CI1000;");
    let lines: Vec<[Point; 2]> = found
        .iter()
        .filter_map(|action| match action {
            Action::Line(line) => Some(*line),
            _ => None,
        })
        .collect();
    let radius = |x: i64, y: i64| {
        let of = |coordinate: i64| coordinate as f64 / UNIT as f64 - 4000.0;
        of(x).hypot(of(y))
    };
    assert_eq!(lines.first().map(|line| line[0]), lines.last().map(|line| line[1]));
    assert!(lines.len() < 250, "{}", lines.len());
    for [a, b] in &lines {
        assert!((radius(a.x, a.y) - 1000.0).abs() < 0.01);
        assert!(radius((a.x + b.x) / 2, (a.y + b.y) / 2) > 999.87);
    }
    assert!(lines.windows(2).all(|pair| pair[0][1] == pair[1][0]));
    assert_eq!(actions(b"PU200,100;CI100,120;").split(' ').count(), 2 + 3, "a triangle");
    assert_eq!(
        actions(b"PU100,0;PD;AA0,0,90,90;AR0,-100,-90,90;").replace(" dot 100,0", ""),
        "go 100,0 100,0>0,100 0,100>100,0"
    );
    // A second turn draws the same again.
    assert_eq!(
        actions(b"PU100,100;PD;AA50,100,450,90;PU").split(' ').filter(|o| o.contains('>')).count(),
        5
    );
}

#[test]
fn outlines_and_ticks() {
    assert_eq!(
        actions(b"PU10,10;EA30,20;ER5,5;").split(' ').skip(2).collect::<Vec<_>>().join(" "),
        "10,10>30,10 30,10>30,20 30,20>10,20 10,20>10,10 10,10>15,10 15,10>15,15 15,15>10,15 \
         10,15>10,10"
    );
    assert_eq!(
        actions(b"PU100,100;EW10,0,90,90;"),
        "go 100,100 100,100>110,100 110,100>100,110 100,110>100,100"
    );
    assert_eq!(
        actions(b"IP0,0,1000,1000;TL1,2;PU100,100;XT;YT;TL3;XT;"),
        "go 100,100 100,80>100,110 80,100>110,100 100,100>100,130"
    );
}

#[test]
fn arcs_are_those_of_the_scales() {
    // Of the ellipse from 0 to 1000 by 500 around its centre, four points.
    let scaled = "IP0,0,1000,500;SC0,10,0,10;PU5,5;";
    let circle = format!("{scaled}CI5,90;");
    assert_eq!(
        actions(circle.as_bytes()),
        "go 500,250 1000,250>500,500 500,500>0,250 0,250>500,0 500,0>1000,250"
    );
    let arc = format!("{scaled}PU10,5;PD;AA5,5,90,90;PU5,5;EW5,90,90,90;");
    assert_eq!(
        actions(arc.as_bytes()).replace(" dot 1000,250", ""),
        "go 500,250 go 1000,250 1000,250>500,500 go 500,250 500,250>500,500 500,500>0,250 \
         0,250>500,250"
    );
    // Where an axis is mirrored, its arcs turn the other way.
    let mirrored = "IP0,0,1000,500;SC10,0,0,10;PU0,5;PD;AA5,5,90,90;";
    assert_eq!(
        actions(mirrored.as_bytes()).replace(" dot 1000,250", ""),
        "go 1000,250 1000,250>500,0"
    );
    let turned = format!("RO90;{circle}");
    assert!(actions(turned.as_bytes()).contains("15750,1000>15500,500"), "{turned}");
    let polygon = format!("{scaled}PM0;CI5,90;PM2;EP;");
    assert!(actions(polygon.as_bytes()).contains("1000,250>500,500"), "{polygon}");
}

#[test]
fn scales_follow_the_corners() {
    for kind in ["", ",0", ",1", ",2"] {
        let scale = if kind == ",2" { "SC0,40,0,40" } else { "SC0,10,0,10" };
        let before = format!("IP0,0,4000,4000;{scale}{kind};PU1,1;PD2,1;OE;");
        let behind = format!("{scale}{kind};IP0,0,4000,4000;PU1,1;PD2,1;OE;");
        assert_eq!(actions(before.as_bytes()), actions(behind.as_bytes()), "{kind}");
        assert!(actions(before.as_bytes()).ends_with("'0'"), "{kind}");
    }
}

#[test]
fn the_window_turns_with_the_page() {
    let drawn = "IW0,0,4000,2000;RO90;PU100,100;PD3000,100;";
    assert_eq!(actions(drawn.as_bytes()), "go 15900,100 15900,100>15900,3000");
    assert_eq!(actions(b"IW1,2,30,40;RO90;OW;"), "'1,2,30,40'");
}

#[test]
fn a_polygon_leaves_the_pen_where_and_as_it_was() {
    let polygon = "PM0;PD2000,1000,2000,2000;PM2;PA1500,900;";
    assert_eq!(actions(format!("PU1000,1000;{polygon}").as_bytes()), "go 1000,1000 go 1500,900");
    let down = actions(format!("PD1000,1000;{polygon}").as_bytes());
    assert_eq!(down, "0,0>1000,1000 1000,1000>1500,900");
}

#[test]
fn comments_end_with_their_quotation_mark_or_a_semicolon() {
    for comment in
        ["CO \"a;PD8000,8000\";", "CO\"scale 1; small parts\"", "CO a \"b;", "CO;", "CO \n;"]
    {
        let text = format!("{comment}PU10,20;PD30,20;OE;");
        assert_eq!(actions(text.as_bytes()), "go 10,20 10,20>30,20 '0'", "{comment}");
    }
}

#[test]
fn numbers_that_say_what_is_so_anyway_are_taken() {
    let triangle = "PM0;PA400,0,0,400;PM2;";
    assert_eq!(
        actions(format!("{triangle}FP0;OE;").as_bytes()),
        actions(format!("{triangle}FP;OE;").as_bytes())
    );
    assert!(actions(format!("{triangle}FP1;OE;").as_bytes()).ends_with("'3'"));
    assert_eq!(actions(b"LT2,4,0;PD300,0;OE;"), actions(b"LT2,4;PD300,0;OE;"));
    assert!(actions(b"LT2,4,2;OE;").ends_with("'3'"));
}

#[test]
fn labels() {
    // An I is one stroke in the middle of its width.
    let size = "SI0.5,0.525;";
    assert_eq!(
        actions(format!("{size}PU1000,1000;LBI\x03").as_bytes()),
        "go 1000,1000 1100,1210>1100,1000"
    );
    assert_eq!(
        actions(format!("{size}PU1000,1000;LBI I\r\nI\x03PD").as_bytes()),
        "go 1000,1000 1100,1210>1100,1000 1700,1210>1700,1000 1100,790>1100,580"
    );
    assert_eq!(
        actions(format!("{size}DI0,1;PU1000,1000;DT#;LBI#").as_bytes()),
        "go 1000,1000 790,1100>1000,1100"
    );
    assert_eq!(
        actions(format!("{size}SL1;PU1000,1000;LBI\x03").as_bytes()),
        "go 1000,1000 1310,1210>1100,1000"
    );
    assert_eq!(
        actions(format!("{size}PU1000,1000;LBI\x08I\x03CP;LBI\x03CP1,0.5;LBI\x03").as_bytes()),
        "go 1000,1000 1100,1210>1100,1000 1100,1210>1100,1000 1100,790>1100,580 1700,1000>1700,790"
    );
    assert_eq!(
        actions(format!("{size}SMI;PU1000,1000;SM;PU2000,1000;").as_bytes()),
        "go 1000,1000 1000,1105>1000,895 go 2000,1000"
    );
    // `;`, `?`, `!` and `~` are letters; what HP-GL would obey outside of a label is none.
    let mut interpreter = interpreter();
    let drawn = actions_of(&mut interpreter, b"LBPU;?!~ \xC3\xA9\x03OA;");
    assert!(drawn.len() > 20);
    let mut again = self::interpreter();
    assert_eq!(actions_of(&mut again, b"OE;").len(), 1);
}

#[test]
fn pens_and_put_away_pens() {
    assert_eq!(
        actions(b"SP1;PD9,0;SP0;PD18,0;SP2;PD27,0;SP;SP99;OE;"),
        "pen 1 0,0>9,0 pen 0 go 18,0 pen 2 18,0>27,0 pen 0 '3'"
    );
}

#[test]
fn encoded_polylines() {
    // (1, 1), (-2, 3), each number as base 64: 2·|n| plus the sign, 191 more for the last digit.
    let number = |value: i32| (191 + 2 * value.unsigned_abs() + u32::from(value < 0)) as u8;
    let bytes = [
        number(10),
        number(10),
        b'<',
        number(-2),
        number(3),
        b'<',
        b'=',
        number(5),
        number(6),
        number(1),
        number(0),
    ];
    let text = [&b"PU100,100;PE"[..], &bytes, b";PA0,0;"].concat();
    // The pen stays as the last move left it.
    assert_eq!(actions(&text), "go 100,100 100,100>110,110 go 108,113 go 5,6 5,6>6,6 6,6>0,0");
    assert_eq!(
        actions(b"PU10,10;PE;PA20,10;PD30,10;PE;PA40,10;"),
        "go 10,10 go 20,10 20,10>30,10 30,10>40,10"
    );
    let raised = [&b"PD;PE<"[..], &[number(5), number(0)], b";PA9,0;"].concat();
    assert_eq!(actions(&raised).replace("dot 0,0 ", ""), "go 5,0 go 9,0");
    // A flag may have its eighth bit set, and a digit that is none is an error.
    let flagged = [&b"PE"[..], &[b'=' | 0x80, number(5), number(6)], b";OE;"].concat();
    assert_eq!(actions(&flagged), "0,0>5,6 '0'");
    assert_eq!(actions(b"PE\x85;OE;"), "'3'");
    // The same pens as of `SP`.
    for (pen, found) in [(32, "pen 32 '0'"), (33, "'3'"), (255, "'3'"), (-1, "'3'")] {
        // 33 is 2 and 1 times 32, two digits of base 64; the sign is the lowest bit.
        let code = 2 * i32::abs(pen) as u32 + u32::from(pen < 0);
        let digits = [63 + (code % 64) as u8, 191 + (code / 64 % 64) as u8];
        assert_eq!(actions(&[b"PE:", &digits[..], b";OE;"].concat()), found, "{pen}");
    }
}

#[test]
fn lost_bytes_are_not_drawn_over() {
    let text =
        [&b"PU10,10;PD20,10,3"[..], &[DAMAGED], b"0,10,40,10;PD50,10;PU60,10;PD70,10;PR0,5;"]
            .concat();
    assert_eq!(actions(&text), "go 10,10 10,10>20,10 go 50,10 go 60,10 60,10>70,10 70,10>70,15");
    let relative =
        [&b"PR;PD5,5;"[..], &[DAMAGED], b"PD5,5,5,5;CI10;XT;LBA\x03PA100,100;PD110,100"].concat();
    assert_eq!(
        actions(&[&relative[..], b";"].concat()),
        "dot 0,0 0,0>5,5 go 100,100 100,100>110,100".replace("dot 0,0 ", "")
    );
}

#[test]
fn what_follows_lost_bytes_in_a_text_is_not_drawn() {
    for (text, drawn) in [
        (&b"LBI\xFFI\x03"[..], "200,310>200,100"),
        (b"LBI\xFFI\r\nI\x03PR;PD5,5;", "200,310>200,100"),
        (b"LBI\xC3\xFF\xA9I\x03", "200,310>200,100"),
        (b"LBI\xFFIPA5,5;PD6,6;", "200,310>200,100"),
        (b"LBI\xFFI\x03PD5,5,7,7;", "200,310>200,100 go 5,5 5,5>7,7"),
        (b"PD;WDI\xFF\x03PR5,5;", "dot 100,100"),
        (b"PD;CO\xFF;PR5,5;", "dot 100,100"),
        (b"PD;DT\xFFPR5,5;", "dot 100,100"),
        (b"PD;SM\xFFPR5,5;", "dot 100,100"),
    ] {
        let bytes = [b"SI0.5,0.525;PU100,100;", text].concat();
        assert_eq!(actions(&bytes), format!("go 100,100 {drawn}"), "{}", text.escape_ascii());
    }
}

#[test]
fn letters_of_labels_are_those_of_utf_8_or_of_latin_1() {
    let begin = b"SI0.5,0.525;PU100,100;LB";
    let label = |text: &[u8]| actions(&[&begin[..], text, b"\x03PD0,0;"].concat());
    for (latin_1, utf_8) in [
        (&b"M\xE4x\xE9"[..], "Mäxé"),
        (b"\xC4\xD6\xDC\xE4\xF6\xFC\xDF", "ÄÖÜäöüß"),
        (b"\xF8\xE5\xE5\r\n\xE9\x08\xE8", "øåå\r\né\u{8}è"),
        // A letter of UTF-8 that is broken off is a box.
        (b"\xE2\x82x", "\u{FFFD}x"),
        (b"\xF0\x9F\x98", "\u{FFFD}"),
        ("\u{4E2D}\u{1F600}".as_bytes(), "\u{FFFD}\u{FFFD}"),
    ] {
        assert_eq!(label(latin_1), label(utf_8.as_bytes()), "{utf_8}");
        let letters = utf_8.chars().filter(|letter| !letter.is_control()).count();
        let columns = 100 + 300 * letters;
        if !utf_8.contains('\r') {
            assert!(label(latin_1).ends_with(&format!(" {columns},100>0,0")), "{utf_8}");
        }
    }
}

#[test]
fn the_length_of_a_pattern_may_be_in_mm() {
    // As KiCad writes it: 4 mm are 160 units.
    assert_eq!(actions(b"LT -2 4 1;PD200,0;LT;PD0,0;"), "0,0>80,0 160,0>200,0 200,0>0,0");
    assert_eq!(actions(b"LT2,4,1;LT2;PD100,0;"), "0,0>80,0", "the length stays");
    assert_eq!(actions(b"IP0,0,300,400;LT2,4,1;LT2,32,0;PD100,0;"), "0,0>80,0");
    assert_eq!(actions(b"LT2,4,2;OE;"), "'3'");
}

#[test]
fn chords_may_be_chosen_by_how_far_they_are_off() {
    let count = |text: &str| actions(format!("PU5000,5000;{text}").as_bytes()).matches('>').count();
    for (radius, most) in [(1000, 1), (1000, 5), (1000, 30), (1000, 500), (40, 5), (300, 300)] {
        let chords = count(&format!("CT1;CI{radius},{most};"));
        let angle = std::f64::consts::TAU / chords as f64;
        let off = f64::from(radius) * (1.0 - (angle / 2.0).cos());
        assert!(chords > 2 && off <= f64::from(most), "{radius} {most}: {chords} {off}");
        assert!(f64::from(most) < off * 4.5, "{radius} {most}: {chords} {off}");
    }
    assert_eq!(count("CT1;SC0,100,0,100;CI10,1;SC;"), count("CT1;CI1000,100;"));
    // Angles are the default, and polygons follow, too.
    assert_eq!(count("CI1000,5;"), 72);
    assert_eq!(count("CT1;CT;CI1000,5;"), 72);
    assert_eq!(count("CT1;DF;CI1000,5;"), 72);
    assert_eq!(count("CT1;PM0;CI1000,5;PM2;EP;"), count("CT1;CI1000,5;"));
    assert_eq!(actions(b"CT2;OE;CT1,1;OE;"), "'3' '2'");
}

#[test]
fn no_bytes_make_it_panic_or_draw_outside() {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 8
    };
    let words: Vec<&[u8]> = std::vec![
        b"PU",
        b"PD",
        b"PA",
        b"PR",
        b"SC",
        b"IP",
        b"IW",
        b"RO",
        b"AA",
        b"AR",
        b"CI",
        b"EA",
        b"ER",
        b"EW",
        b"LB",
        b"DT",
        b"SI",
        b"SR",
        b"DI",
        b"DR",
        b"SL",
        b"CP",
        b"LT",
        b"SM",
        b"TL",
        b"XT",
        b"YT",
        b"PE",
        b"IN",
        b"DF",
        b"OA",
        b"OC",
        b"OW",
        b"\x03",
        b";",
        b",",
        b"-",
        b".",
        b"1",
        b"90",
        b"8388607.999",
        b"0.0001",
        b"-8388607",
        b"127",
        b"W~",
        b"\xFF",
        b"\n",
        b"VS",
        b"SP",
        b"LT2;",
    ];
    for _ in 0..300 {
        let mut interpreter = interpreter();
        for _ in 0..400 {
            let word = words[random() as usize % words.len()];
            for byte in word.iter().copied().chain((random() % 4 == 0).then_some(random() as u8)) {
                interpreter.push(byte);
                let mut count = 0;
                while let Some(action) = interpreter.next_action() {
                    let points = match action {
                        Action::Line(line) => line,
                        Action::Dot(at) | Action::Go(at) => [at; 2],
                        Action::Initialize => {
                            interpreter.initialize(Point::default(), LIMITS);
                            continue;
                        }
                        _ => continue,
                    };
                    assert!(points.iter().all(|point| LIMITS.contains(*point)), "{points:?}");
                    count += 1;
                    if count > 2000 {
                        interpreter.clear_steps();
                    }
                }
            }
        }
    }
}

/// A session, with the sender's side of a line.
struct Line {
    dialect: Dialect,
    session: Session,
}

impl Line {
    fn new() -> Self {
        Self { dialect: Dialect::new(), session: Session::new() }
    }

    /// Sends bytes. Returns what is answered before any of them is carried out.
    fn send(&mut self, bytes: &[u8]) -> String {
        for byte in bytes {
            match self.dialect.take(*byte) {
                Token::Begins(beginning) => {
                    self.session.begin(beginning, *byte, Point::default(), LIMITS);
                    assert_ne!(beginning, Beginning::Command);
                }
                Token::Line | Token::Leaves => {}
                token => self.session.receive(*byte, token),
            }
        }
        self.heard()
    }

    fn heard(&mut self) -> String {
        let heard = String::from_utf8_lossy(self.session.output()).into_owned();
        self.session.clear_output();
        heard
    }

    /// Carries out at most this many actions. Returns them and the answers.
    fn work(&mut self, most: usize) -> String {
        let mut actions = Vec::new();
        while !self.session.is_idle() && actions.len() < most {
            let action = self.session.action().clone();
            match &action {
                Action::Nothing => continue,
                Action::Answer(answer) => self.session.answer(answer),
                Action::Initialize => self.session.initialize(Point::default(), LIMITS),
                action => actions.push(shown(action)),
            }
            self.session.end_action();
        }
        format!("{}|{}", actions.join(" "), self.heard())
    }
}

#[test]
fn questions_to_the_interface_are_answered_at_once() {
    let mut line = Line::new();
    assert_eq!(line.send(b"\x1B.B"), "1024\r");
    assert_eq!(line.send(b"IN;PD1,1;"), "");
    assert_eq!(line.send(b"\x1B.B\x1B.O\x1B.E"), "1015\r0\r0\r");
    assert_eq!(line.send(b"\x1B.L"), "", "it waits for the end");
    assert_eq!(line.work(9), "0,0>1,1|1024\r");
    assert_eq!(line.send(b"\x1B.O\x1B.X\x1B.E\x1B.E"), "8\r11\r0\r");
    assert_eq!(line.send(b"\x1B.M;;;10;13:OI;"), "");
    assert_eq!(line.work(9), "|7475A\n\r");
    assert_eq!(line.send(b"\x1B.R\x1B.B"), "1024\r");
    assert_eq!(line.send(b"\x1B.@100;1:\x1B.(\x1B.)\x1B.Y\x1B.Z\x1B.J\x1B.E"), "0\r");
    assert_eq!(
        line.send(b"\x1B.M300:\x1B.I9999:\x1B.E\x1B.I1;2;3;4;5;6;7;8;9;10;11;12;13;14:\x1B.E"),
        "13\r14\r"
    );
    assert_eq!(line.send(b"\x1B.I81PU\x1B.E"), "12\r");
}

#[test]
fn instructions_to_the_interface_may_stand_anywhere_and_escape_k_forgets() {
    let mut line = Line::new();
    line.send(b"IN;PD1,\x1B.B2");
    assert_eq!(line.send(b"\x1B.B;"), "1016\r");
    assert_eq!(line.work(9), "0,0>1,2|");
    line.send(b"PD3,3;LBabc\x1B.KPU4,4;");
    assert_eq!(line.work(9), "go 4,4|");
}

#[test]
fn the_sender_is_stopped_and_goes_on() {
    let mut line = Line::new();
    assert_eq!(line.send(b"\x1B.I81;;17:\x1B.N;19:IN;PD"), "");
    let mut sent = 5;
    let mut heard = String::new();
    while heard.is_empty() {
        heard = line.send(b"1,2,");
        sent += 4;
    }
    assert_eq!(heard, "\x13");
    assert_eq!(line.session.room(), RECEIVED_BYTES - sent);
    assert!((78..=81).contains(&line.session.room()), "{}", line.session.room());
    assert!(line.work(10).ends_with('|'));
    assert!(line.work(1000).ends_with("|\x11"));
    // Enquire and acknowledge.
    assert_eq!(line.send(b"\x1B.H500;5;6:"), "");
    assert_eq!(line.send(b"\x05"), "\x06");
    for _ in 0..150 {
        line.send(b"1,2,");
    }
    assert_eq!(line.send(b"\x05"), "");
    assert!(line.work(1000).ends_with("|\x06"));
}

#[test]
fn a_sheet_that_is_drawn_on_is_followed_by_another_one() {
    assert_eq!(
        actions(b"PG;PD40,0;PU;PG;AF;PA0,80;PD40,80,0,0;PG;"),
        "0,0>40,0 go 0,80 sheet 0,80>40,80 40,80>0,0"
    );
    // It may begin with `IN`, and with a dot.
    assert_eq!(actions(b"PD40,0;FR;IN;PU;PD;"), "0,0>40,0 init sheet dot 40,0");
    let mut session = interpreter();
    let mut shown_of = |bytes: &[u8]| {
        actions_of(&mut session, bytes).iter().map(shown).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(shown_of(b"PD40,0;PG;"), "0,0>40,0");
    session.abandon();
    assert_eq!(actions_of(&mut session, b"PD0,0;").len(), 1, "what has been given up is over");
}
