//! The commands for the machine, with the plotter's own library at a serial port.
//!
//! The file is longer than 500 lines, because it is a list of tests, which share a few short
//! functions.

mod going_on;
mod library;
mod questions;
mod setup;

use super::*;
use library::{Library, pseudo_terminal, with_ports};
use std::io::{Read as _, Write as _};
use std::process::{Child, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

#[test]
fn the_only_plotter_is_found_and_two_are_not_chosen_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_wire, silent_name) = pseudo_terminal();
    let (first, second) = (Library::new(), Library::new());
    let one = [first.device.as_str(), &silent_name, "/dev/none"];
    let (code, said, error) = with_ports(folder.path(), &one, &["ports"]);
    assert_eq!(code, Some(0), "{error}");
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines[0], format!("{}: penup, Idle", first.device));
    assert_eq!(lines[1], format!("{silent_name}: nothing answers"));
    assert!(lines[2].starts_with("/dev/none: cannot be opened: "), "{said}");
    let (code, said, error) = with_ports(folder.path(), &one, &["status"]);
    assert_eq!(code, Some(0), "{error}");
    assert_eq!(said, "it is idle\nthe pen is at 0, 0 mm\n");
    let both = [first.device.as_str(), &second.device];
    let (code, _, error) = with_ports(folder.path(), &both, &["status"]);
    assert_eq!(code, Some(3));
    assert!(error.contains("there are 2 plotters: choose one by --port"), "{error}");
    let (code, said, error) = with_ports(folder.path(), &[&silent_name], &["home", "--json"]);
    assert_eq!(code, Some(3));
    assert!(error.starts_with("penup: there is no plotter: "), "{error}");
    let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    assert_eq!(said["exit_code"], 3);
}

#[test]
fn a_port_that_another_program_uses_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_wire, silent_name) = pseudo_terminal();
    let plotter = Library::new();
    let other = serialport::new(&plotter.device, 115_200).open().expect("opened");
    let ports = [plotter.device.as_str(), &silent_name];
    let (code, said, error) = with_ports(folder.path(), &ports, &["ports"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.starts_with(&format!("{}: another program uses it\n", plotter.device)), "{said}");
    let in_use = format!(
        "penup: another program uses {}: close it there, or let it end, and try again\n",
        plotter.device
    );
    for arguments in [&["status"][..], &["status", "--port", &plotter.device]] {
        let (code, _, error) = with_ports(folder.path(), &ports, arguments);
        assert_eq!((code, error), (Some(3), in_use.clone()), "{arguments:?}");
    }
    drop(other);
    let (code, _, error) = with_ports(folder.path(), &ports, &["status"]);
    assert_eq!(code, Some(0), "{error}");
}

/// A program that is slow to read gets each byte of an answer that is longer than the buffer of the
/// pseudo-terminal.
#[test]
fn no_byte_is_lost_while_a_program_does_not_read() {
    let plotter = Library::new();
    let mut port = serialport::new(&plotter.device, 115_200).open().expect("opened");
    port.set_timeout(Duration::from_secs(60)).expect("set");
    let questions = 8;
    for _ in 0..questions {
        port.write_all(b"$$\n").expect("sent");
    }
    std::thread::sleep(Duration::from_secs(2));
    let (mut heard, mut bytes) = (String::new(), [0; 256]);
    while heard.matches("ok\r\n").count() < questions {
        let count = port.read(&mut bytes).expect("bytes");
        heard += std::str::from_utf8(&bytes[..count]).expect("text");
    }
    let settings = heard.lines().filter(|line| line.starts_with('$')).count();
    assert_eq!(settings, questions * penup::machine::SETTINGS.len());
}

#[test]
fn the_machine_moves_is_set_and_refuses_in_its_words() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (code, moved) = plotter.json(folder.path(), &["jog", "10", "20.5"]);
    assert_eq!(code, Some(0));
    assert_eq!(moved["position_mm"], serde_json::json!([10.0, 20.5, 0.0]));
    let (code, moved) = plotter.json(folder.path(), &["jog", "-2.5", "0", "--speed", "600"]);
    assert_eq!((code, &moved["position_mm"][0]), (Some(0), &serde_json::json!(7.5)));
    let (code, _, error) = run(&["jog", "-50", "0"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("beyond the travel"), "{error}");
    // After a refusal the next command works.
    assert_eq!(run(&["pen", "down"]).0, Some(0));
    assert_eq!(run(&["pen", "up"]), (Some(0), "the pen is up\n".into(), String::new()));
    assert_eq!(run(&["pen", "up", "--quiet"]), (Some(0), String::new(), String::new()));
    let (code, _, error) = run(&["home"]);
    assert_eq!(code, Some(4));
    assert!(error.contains("homing is off"), "{error}");
    assert_eq!(run(&["unlock"]).1, "the machine is not locked\n");
    let (code, _, error) = run(&["resume"]);
    assert_eq!((code, error.contains("nothing to resume")), (Some(4), true), "{error}");
    let (code, _, error) = run(&["again"]);
    assert_eq!(code, Some(4), "{error}");
    assert_eq!(
        run(&["abort"]),
        (Some(0), "given up: the machine stands with the pen up\n".into(), String::new())
    );
}

/// Most reports do not tell the speeds.
#[test]
fn the_speeds_are_told_at_any_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut port = serialport::new(&plotter.device, 115_200).open().expect("opened");
    port.write_all(b"\x91").expect("sent");
    while plotter.heard.load(Ordering::Relaxed) == 0 {}
    drop(port);
    for _ in 0..3 {
        let (_, status) = plotter.json(folder.path(), &["status"]);
        assert_eq!(status["speed_percent"], 110, "{status}");
    }
}

/// A laser is on only while it moves.
#[test]
fn a_pen_that_nothing_lowers_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    assert_eq!(run(&["set", "32=1"]).0, Some(0));
    let (code, _, error) = run(&["pen", "down"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("cannot lower the pen") && error.contains("set 32=0"), "{error}");
}

/// Reports may be in inches, and in the coordinates of a program alone.
#[test]
fn positions_are_millimetres_whatever_the_plotter_reports() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    // A startup line chooses inches, and the origin of programs is elsewhere.
    console(&plotter, "$N0=G20\n");
    console(&plotter, "G21G10L2P1X5Y7\n");
    for settings in [["10=3", "13=0"], ["10=3", "13=1"], ["10=2", "13=0"], ["10=0", "13=1"]] {
        let (code, _, error) = plotter.run(folder.path(), &[&["set"], &settings[..]].concat());
        assert_eq!(code, Some(0), "{error}");
        for (by, expected) in [(["10", "20.5"], [10.0, 20.5]), (["-10", "-20.5"], [0.0, 0.0])] {
            let (code, moved) = plotter.json(folder.path(), &["jog", by[0], by[1]]);
            assert_eq!(code, Some(0), "{settings:?}: {moved}");
            for told in [moved, plotter.json(folder.path(), &["status"]).1] {
                for (axis, expected) in expected.iter().enumerate() {
                    let at = told["position_mm"][axis].as_f64().expect("a number");
                    assert!((at - expected).abs() < 0.003, "{settings:?}: {told}");
                }
            }
        }
    }
}

/// The emergency stop is pressed by the real-time byte 0xFD.
#[test]
fn an_abort_says_that_the_machine_is_locked() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let mut port = serialport::new(&plotter.device, 115_200).open().expect("opened");
    port.write_all(b"\xFD").expect("sent");
    while plotter.heard.load(Ordering::Relaxed) == 0 {}
    drop(port);
    let (code, _, error) = run(&["abort"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("stays locked after alarm 10: the emergency stop"), "{error}");
    assert!(error.contains("`penup unlock`"), "{error}");
    assert_eq!(run(&["unlock"]).1, "the machine is unlocked\n");
    assert_eq!(run(&["abort"]).0, Some(0));
}

#[test]
fn a_refusal_of_a_drawing_names_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("points.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n").expect("written");
    let plotter = Library::new();
    let port = plotter.device.as_str();
    let nothing = "there is nothing to draw: no faces, lines or curves as long as a motor step \
                   (error 120)\n";
    for (arguments, reason) in [
        (&["preview", "points.obj"][..], "the plotter refuses the drawing: "),
        (&["preview", "points.obj", "--board", "pico"], "the plotter refuses the drawing: "),
        (&["plot", "points.obj", "--port", port], "cannot draw it: "),
        (&["plot", "points.obj", "--port", port, "--compute", "host"], "cannot draw it: "),
        (&["tape", "encode", "points.obj"], "cannot draw it: "),
    ] {
        let (code, _, error) = plotter.run(folder.path(), arguments);
        assert!(matches!(code, Some(1 | 4)), "{arguments:?}: {code:?}");
        assert_eq!(
            error.lines().last(),
            Some(format!("penup: points.obj: {reason}{nothing}").trim_end())
        );
    }
    // What is not about the drawing does not name the file.
    let (_, _, error) = plotter.run(folder.path(), &["set", "100=1"]);
    assert!(error.starts_with("penup: the plotter refuses the steps per mm"), "{error}");
}

/// The same is told whoever computes the drawing: this computer, the plotter, or a preview.
#[test]
fn faces_that_are_left_out_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let solid = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\nv 18 0 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n";
    fs::write(folder.path().join("a.obj"), solid).expect("written");
    let plots =
        ["host", "board"].map(|by| vec!["plot", "a.obj", "--port", "auto", "--compute", by]);
    let others = [vec!["preview", "a.obj", "--svg", "a.svg"], vec!["tape", "encode", "a.obj"]];
    for arguments in plots.into_iter().chain(others) {
        let (code, _, noted) = plotter.run(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{noted}");
        assert!(noted.contains("have no area") || noted.contains("has no area"), "{noted}");
    }
}

#[test]
fn a_page_beyond_the_travel_is_told_with_both_sizes() {
    let folder = tempfile::tempdir().expect("a folder");
    let svg = |width: u32| {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"100mm\" \
             viewBox=\"0 0 {width} 100\"><path stroke=\"red\" d=\"M5 50H425M5 60H{}\"/></svg>",
            width - 1
        )
    };
    fs::write(folder.path().join("wide.svg"), svg(600)).expect("written");
    let plotter = Library::new();
    for options in [&[][..], &["--compute", "host"]] {
        let all = [&["plot", "wide.svg", "--port", plotter.device.as_str()][..], options].concat();
        let (code, _, error) = plotter.run(folder.path(), &all);
        assert_eq!(code, Some(1), "{error}");
        let sizes = "the page of 600 x 100 mm is larger than the travel of the machine, which is \
                     420 x 420 mm\n";
        assert!(error.contains(&format!("note: wide.svg: {sizes}")), "{error}");
        assert!(error.contains("penup: wide.svg: cannot draw it: beyond the travel"), "{error}");
    }
}

#[test]
fn settings_are_saved_changed_and_restored() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (code, said, error) = run(&["settings", "save", "machine.toml"]);
    assert_eq!(
        (code, said),
        (Some(0), format!("machine.toml: {} settings\n", penup::machine::SETTINGS.len())),
        "{error}"
    );
    let saved = fs::read_to_string(folder.path().join("machine.toml")).expect("readable");
    assert!(saved.contains("\n100 = 80.000 # steps per mm of x\n"), "{saved}");
    let (code, said, error) = run(&["set", "100=88.9", "$3=1"]);
    assert_eq!((code, said), (Some(0), "2 settings are changed\n".into()), "{error}");
    let (_, shown, _) = run(&["settings", "show"]);
    assert!(shown.contains("100 = 88.900     steps per mm of x\n"), "{shown}");
    let (code, _, error) = run(&["set", "100=1"]);
    assert_eq!(code, Some(4));
    assert!(error.contains("100"), "{error}");
    let (code, _, error) = run(&["set", "999=1"]);
    assert_eq!(code, Some(4));
    assert!(error.contains("refuses setting 999 of the machine to 1: "), "{error}");
    let (code, said, error) = run(&["settings", "restore", "machine.toml"]);
    assert_eq!((code, said), (Some(0), "2 settings are changed\n".into()), "{error}");
    let (_, again, _) = run(&["settings", "save"]);
    assert_eq!(again, saved);
    let (code, said, _) = run(&["settings", "restore", "machine.toml"]);
    assert_eq!((code, said), (Some(0), "the machine has these settings\n".into()));
    // More than three decimals are saved and restored, too.
    let (code, said, error) = run(&["set", "100=80.0003"]);
    assert_eq!((code, said), (Some(0), "1 setting is changed\n".into()), "{error}");
    assert_eq!(run(&["settings", "save", "fine.toml"]).0, Some(0));
    assert_eq!(run(&["set", "100=80"]).0, Some(0));
    let (code, said, error) = run(&["settings", "restore", "fine.toml"]);
    assert_eq!((code, said), (Some(0), "1 setting is changed\n".into()), "{error}");
    let (_, shown, _) = run(&["settings", "show"]);
    assert!(shown.contains("100 = 80.00031   steps per mm of x\n"), "{shown}");
    // A polargraph and its anchors only fit each other together.
    let anchors = ["set", "230=2", "231=300", "232=100", "233=1200"];
    let (code, said, error) = run(&anchors);
    assert_eq!(code, Some(0), "{said}{error}");
    // A setting that is given twice is meant once: nothing is set.
    let (_, before, _) = run(&["settings", "show"]);
    let (code, _, error) = run(&["set", "101=81", "100=90", "$100=91"]);
    assert_eq!(code, Some(2), "{error}");
    assert!(error.contains("setting 100 is given twice, as 90 and as 91"), "{error}");
    assert_eq!(run(&["settings", "show"]).1, before);
    fs::write(folder.path().join("bad.toml"), "[settings]\nspeed = 1\n").expect("written");
    let (code, _, error) = run(&["settings", "restore", "bad.toml"]);
    assert_eq!(code, Some(1));
    assert!(error.starts_with("penup: bad.toml: [settings] holds speed"), "{error}");
}

#[test]
fn keys_pause_the_drawing_and_move_the_lowered_pen() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    plotter.slow.store(true, Ordering::Relaxed);
    let (mut keys, name) = pseudo_terminal();
    let terminal = || fs::OpenOptions::new().read(true).write(true).open(&name).expect("opened");
    let mut client = plotter.rows(folder.path(), &[]);
    client.stdin(terminal()).stderr(terminal());
    let mut client = client.spawn().expect("the program runs");
    let mut said = String::new();
    // Each key is pressed once the program has said what comes before it.
    for (key, answer) in [
        ("", "in a pause u and d set the lowered pen higher or lower"),
        ("d", "the pen's height can be changed in a pause alone: press space"),
        (" ", "Held"),
        ("u", "the lowered pen is at height 125 of 127 now"),
        ("u", "the lowered pen is at height 123 of 127 now"),
        ("d", "the lowered pen is at height 125 of 127 now"),
        (" ", "Drawing"),
    ] {
        let mut buffer = [0; 256];
        if key == "d" && answer.starts_with("the pen's") {
            // The terminal holds 4 KB: who does not read it stops the program.
            while !plotter.drawing.load(Ordering::Relaxed) {
                assert_eq!(client.try_wait().expect("a state"), None, "it ended: {said}");
                let _ = keys.read(&mut buffer);
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        let before = said.len();
        keys.write_all(key.as_bytes()).expect("pressed");
        while !said[before..].contains(answer) {
            assert_eq!(client.try_wait().expect("a state"), None, "{answer}: {said}");
            if let Ok(count) = keys.read(&mut buffer) {
                said += &String::from_utf8_lossy(&buffer[..count]);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    plotter.slow.store(false, Ordering::Relaxed);
    let mut buffer = [0; 256];
    while client.try_wait().expect("a state").is_none() {
        let _ = keys.read(&mut buffer);
        std::thread::sleep(Duration::from_millis(1));
    }
    let (code, drawn, _) = ended(client);
    assert_eq!(code, Some(0), "{said}");
    assert!(drawn.starts_with("rows.obj is drawn: 120 strokes, 12000.0 mm drawn"), "{drawn}");
    let (_, settings, _) = plotter.run(folder.path(), &["settings", "show"]);
    assert!(settings.contains("211 = 125"), "{settings}");
}

/// The system stops a program in the background that changes the modes of the terminal.
#[cfg(target_os = "linux")]
#[test]
fn a_plot_in_the_background_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nl 1 2\n").expect("written");
    let (mut terminal, name) = pseudo_terminal();
    let open = || fs::OpenOptions::new().read(true).write(true).open(&name).expect("opened");
    let job = format!(
        "set -m; '{}' plot a.obj --port {} & wait $!; echo it ends: $?",
        env!("CARGO_BIN_EXE_penup"),
        plotter.device
    );
    let mut shell = Command::new("setsid")
        .args(["--ctty", "--wait", "sh", "-c", &job])
        .current_dir(folder.path())
        .stdin(open())
        .stdout(open())
        .stderr(open())
        .spawn()
        .expect("the shell runs");
    let (mut said, mut buffer, begin) = (String::new(), [0; 256], Instant::now());
    while !said.contains("it ends: ") && begin.elapsed() < Duration::from_secs(60) {
        if let Ok(count) = terminal.read(&mut buffer) {
            said += &String::from_utf8_lossy(&buffer[..count]);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    // A hangup ends what is left of the job.
    drop(terminal);
    shell.wait().expect("it ends");
    assert!(said.contains("a.obj is drawn") && said.contains("it ends: 0"), "{said}");
}

/// What a program has said when it has ended: its exit code, its answer and its notes.
fn ended(client: Child) -> (Option<i32>, String, String) {
    let output = client.wait_with_output().expect("it ends");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn everything_is_drawn_so_many_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nl 1 2\n").expect("written");
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (code, said, error) = run(&["plot", "a.obj", "--port", "auto", "--multipass", "3"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.starts_with("a.obj is drawn 3 times: 1 stroke, 50.0 mm drawn"), "{said}");
}

#[test]
fn closed_lines_begin_at_random_points_if_the_user_wishes() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut rows = String::new();
    for number in 0..20_u32 {
        let (x, first) = (10 + 4 * number, 4 * number + 1);
        let corners = [[x, 10], [x + 3, 10], [x + 3, 60], [x, 60]];
        corners.iter().for_each(|[x, y]| rows.push_str(&format!("v {x} {y} 0\n")));
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| first + corner);
        rows.push_str(&format!("l {a} {b} {c} {d} {a}\n"));
    }
    fs::write(folder.path().join("rows.obj"), rows).expect("written");
    let plot = |options: &[&str]| {
        let all = [&["plot", "rows.obj", "--port", "auto", "--json"], options].concat();
        let (code, said, error) = plotter.run(folder.path(), &all);
        assert_eq!(code, Some(0), "{error}");
        let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");
        let length = |name: &str| said["drawn"][name].as_f64().expect("a number");
        assert_eq!(length("pen_down_mm"), 2120.0);
        length("pen_up_mm")
    };
    let (short, scattered) = (plot(&["--compute", "host"]), plot(&["--reloop"]));
    assert!(short < 80.0 && scattered > 200.0, "{short} {scattered}");
    // The rest of the drawing is that of the whole.
    assert_eq!(plot(&["--reloop", "--from", "19"]), scattered);
    // A preview shows that drawing, with its length and its time, in each of its results.
    let preview = |options: &[&str]| {
        let all = [
            &["preview", "rows.obj", "--json", "r.json", "--gcode", "r.gcode", "--svg", "r.svg"],
            options,
        ];
        let (code, _, error) = plotter.run(folder.path(), &all.concat());
        assert_eq!(code, Some(0), "{error}");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("readable");
        let result: serde_json::Value = serde_json::from_str(&read("r.json")).expect("JSON");
        let number = |value: &serde_json::Value| value.as_f64().expect("a number");
        let (own, told) = (number(&result["pen_up_mm"]), number(&result["drawn"]["pen_up_mm"]));
        assert!((own - told).abs() < 0.1, "{own} {told}");
        assert_eq!(number(&result["drawn"]["pen_down_mm"]), 2120.0);
        let begins = |text: &str, word: &str| {
            let x = |line: &str| line.split_once(word).map(|(_, rest)| rest.to_owned());
            text.lines().filter_map(x).collect::<Vec<_>>()
        };
        let gcode = begins(&read("r.gcode"), "G0 X");
        (told, gcode, read("r.svg"), number(&result["duration_s"]), number(&result["steps"]))
    };
    let (usual, looped) = (preview(&["--effort", "100"]), preview(&["--reloop"]));
    assert!(usual.0 < 80.0 && looped.0 == scattered, "{usual:?} {looped:?}");
    assert!(looped.1 != usual.1 && looped.2 != usual.2);
    assert!(looped.3 > usual.3 && looped.4 > usual.4, "{} {}", looped.3, usual.3);
    assert_eq!(preview(&["--reloop", "--board", "pico"]), looped);
    let twice = preview(&["--reloop", "--multipass", "2"]);
    assert!(twice.3 > 1.9 * looped.3 && twice.3 < 2.1 * looped.3, "{} {}", twice.3, looped.3);
    let refused = ["plot", "rows.obj", "--port", "auto", "--reloop", "--compute", "board"];
    let (code, _, error) = plotter.run(folder.path(), &refused);
    assert_eq!(code, Some(1));
    assert!(error.contains("--reloop need this computer: leave out --compute board"), "{error}");
}

/// Has the plotter carry out lines as they are.
fn console(plotter: &Library, lines: impl AsRef<[u8]>) -> String {
    let mut console = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["console", "--port", &plotter.device])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut typed = console.stdin.take().expect("a pipe");
    typed.write_all(lines.as_ref()).expect("written");
    drop(typed);
    let output = console.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn the_console_sends_lines_and_prints_the_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    // The comment is in Latin-1.
    let said = console(&plotter, b"$I\n$100=0\n(caf\xE9)\r\nG0 X5\nv 1 2\n?\n");
    assert!(said.contains("[VER:1.1h.penup"), "{said}");
    assert_eq!(said.matches("ok\r\n").count(), 3, "{said}");
    assert_eq!(said.matches("error:").count(), 2, "{said}");
    assert!(said.contains("|MPos:"), "{said}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["position_mm"][0], 5.0, "{status}");
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let folder = tempfile::tempdir().expect("a folder");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (code, said, _) = penup(folder.path(), &["completions", shell]);
        assert_eq!(code, Some(0));
        assert!(said.contains("after-stroke"), "{shell}");
    }
    let (code, said, _) = penup(folder.path(), &["man"]);
    assert_eq!(code, Some(0));
    assert!(said.contains(".TH penup 1") && said.contains("Exit codes"), "{said}");
    let (code, said, error) = penup(folder.path(), &["man", "pages"]);
    assert_eq!(code, Some(0), "{error}");
    let pages = files(&folder.path().join("pages"));
    assert_eq!(said, format!("pages: {} pages\n", pages.len()));
    for page in ["penup.1", "penup-plot.1", "penup-settings-save.1", "penup-watch.1"] {
        assert!(pages.iter().any(|name| name == page), "{page}");
    }
}

#[test]
fn a_preview_tells_how_long_the_machine_draws() {
    let folder = tempfile::tempdir().expect("a folder");
    // 600 mm at 50 mm/s are 12 s, and some for the pen and the speeding up.
    fs::write(
        folder.path().join("a.obj"),
        "v 10 10 0\nv 10 210 0\nv 210 210 0\nv 210 10 0\nl 1 2 3 4\n",
    )
    .expect("written");
    let seconds = |arguments: &[&str]| {
        let all = [&["preview", "a.obj", "--page", "A3", "--json", "a.json"], arguments].concat();
        let (code, said, error) = penup(folder.path(), &all);
        assert_eq!(code, Some(0), "{error}");
        let json = fs::read_to_string(folder.path().join("a.json")).expect("readable");
        let result: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        let seconds = result["duration_s"].as_f64().expect("a number");
        let (minutes, rest) = ((seconds.round() / 60.0).floor(), seconds.round() % 60.0);
        assert!(said.ends_with(&format!(", {minutes}:{rest:02} to draw\n")), "{said}");
        seconds
    };
    let usual = seconds(&[]);
    assert!((12.0..15.0).contains(&usual), "{usual}");
    // Changes of pens take as long as the user takes, which is not counted.
    fs::write(
        folder.path().join("pens.obj"),
        "v 10 10 0\nv 60 10 0\nv 60 60 0\nusemtl pen1\nl 1 2\nusemtl pen2\nl 2 3\n",
    )
    .expect("written");
    let (_, said, _) = penup(folder.path(), &["preview", "pens.obj", "--page", "A5"]);
    assert!(said.ends_with(", 0:03 to draw\n"), "{said}");
    let slow = seconds(&["--set", "201=600"]);
    assert!((60.0..63.0).contains(&slow), "{slow}");
    fs::write(folder.path().join("slow.toml"), "[settings]\n201 = 600\n22 = 1\n").expect("written");
    assert_eq!(seconds(&["--machine", "slow.toml"]), slow);
    // The picture of a machine whose motors move by belts is that of the page.
    let polargraph = ["--set=230=2", "--set=231=900", "--set=232=300", "--set=233=700"];
    assert!(seconds(&polargraph) > 12.0);
    let picture = |machine: &[&str]| {
        let arguments = ["preview", "a.obj", "--page", "A3", "--svg", "a.svg"];
        let (code, _, error) = penup(folder.path(), &[&arguments[..], machine].concat());
        assert_eq!(code, Some(0), "{error}");
        fs::read_to_string(folder.path().join("a.svg")).expect("readable")
    };
    assert_eq!(picture(&polargraph), picture(&[]));
    let (code, _, error) = penup(
        folder.path(),
        &["preview", "a.obj", "--page", "A3", "--set", "204=20", "--set", "204=30"],
    );
    assert_eq!(code, Some(2), "{error}");
    assert!(error.contains("setting 204 is given twice, as 20 and as 30"), "{error}");
    let (code, _, error) = penup(folder.path(), &["preview", "a.obj", "--set", "100=1"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("setting 100 cannot be 1: "), "{error}");
}

/// Somebody without a machine sees a large page; whoever says what theirs is hears the refusal.
#[test]
fn a_preview_of_a_large_page_needs_no_large_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" width="594mm" height="841mm"
        viewBox="0 0 594 841"><rect x="10" y="10" width="570" height="820"/></svg>"#;
    std::fs::write(folder.path().join("a1.svg"), svg).expect("written");
    let preview = |options: &[&str]| {
        let arguments = [&["preview", "a1.svg", "--svg", "out.svg"], options].concat();
        let (code, _, error) = penup(folder.path(), &arguments);
        (code, error)
    };
    let (code, error) = preview(&[]);
    assert_eq!(code, Some(0), "{error}");
    assert_eq!(
        error,
        "penup: note: a1.svg: the page of 594 x 841 mm is larger than the travel of the default \
         machine, which is 420 x 420 mm, so the preview is of a machine with 594 x 841 mm: say \
         what yours has by --machine FILE, or by --set 130=594 --set 131=841\n"
    );
    let picture = std::fs::read_to_string(folder.path().join("out.svg")).expect("a picture");
    assert!(picture.contains("594mm") && picture.contains("841mm"), "{picture}");
    let (code, error) = preview(&["--quiet"]);
    assert_eq!((code, error.as_str()), (Some(0), ""));
    assert_eq!(preview(&["--set", "130=594", "--set", "131=841"]), (Some(0), String::new()));
    for own in ["130=594", "131=420"] {
        let (code, error) = preview(&["--set", own]);
        assert_eq!(code, Some(4), "{error}");
        assert!(error.contains("(error 15)"), "{error}");
    }
    // Another setting says nothing of the travel.
    let (code, error) = preview(&["--set", "204=20"]);
    assert_eq!(code, Some(0), "{error}");
    // No machine has such a travel.
    let (code, error) = preview(&["--page", "9000x200", "--fit"]);
    assert_ne!(code, Some(0), "{error}");
    let plotter = Library::new();
    let (code, _, error) =
        penup(folder.path(), &["plot", "a1.svg", "--port", &plotter.device, "--page", "594x841"]);
    assert_eq!(code, Some(1), "{error}");
    assert!(error.contains("error 15"), "{error}");
}

#[test]
fn what_the_machine_cannot_draw_is_told_before_it_is_sent() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 280 10 0\nl 1 2\n").expect("written");
    let plotter = Library::new();
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    assert_eq!(run(&["set", "130=250"]).0, Some(0));
    let (code, _, error) = run(&["plot", "a.obj", "--page", "A3", "--port", "auto"]);
    assert_eq!(code, Some(1), "{error}");
    assert!(error.contains("beyond the travel"), "{error}");
    assert_eq!(run(&["set", "130=420"]).0, Some(0));
    let (code, said, error) = run(&["plot", "a.obj", "--page", "A3", "--port", "auto"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.starts_with("a.obj is drawn: 1 stroke, 270.0 mm drawn"), "{said}");
}

#[test]
fn squares_show_how_the_machine_shakes() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (_, said) = plotter.json(folder.path(), &["shake"]);
    // The defaults are 50 mm/s and 800 mm/s².
    assert_eq!(said["speed"], 50.0, "{said}");
    assert_eq!(said["run_up"], 1.5625, "{said}");
    assert_eq!(said["shaped"], false, "{said}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 3, "all": 3 }));
    let (code, _, error) = plotter.run(folder.path(), &["set", "226=1", "227=20", "228=25"]);
    assert_eq!(code, Some(0), "{error}");
    let (code, said, error) = plotter.run(folder.path(), &["shake"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("frequency = 50 x wiggles / mm"), "{said}");
    assert!(said.contains("Motion is shaped ($226)"), "{said}");
    // An own frequency that the shaper cannot have is refused by the one that it can.
    let (code, _, error) = plotter.run(folder.path(), &["set", "227=2"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("such a shaper works from 3."), "{error}");
}
