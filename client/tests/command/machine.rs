//! The commands for the machine, with the plotter's own library at a serial port.

use super::*;
use penup::boards::host::{CutFlash, LAYOUT};
use penup_client::link::Link as _;
use penup_client::preview::InMemory;
use penup_job::room::Room;
use serialport::{SerialPort as _, TTYPort};
use std::io::{Read as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A plotter of the library at the other end of a pseudo-terminal. Its time passes some fifty times
/// as fast as ours, and only while it is plugged in.
struct Library {
    device: String,
    unplug: Arc<AtomicBool>,
    /// The plot command has come.
    drawing: Arc<AtomicBool>,
    /// Its time passes a tenth as fast.
    slow: Arc<AtomicBool>,
    /// Its power is cut, and comes back.
    cut: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Library {
    fn new() -> Self {
        let (mut wire, terminal) = TTYPort::pair().expect("a pseudo-terminal");
        wire.set_timeout(Duration::from_millis(1)).expect("set");
        let device = terminal.name().expect("a name");
        drop(terminal);
        let unplug = Arc::new(AtomicBool::new(false));
        let (drawing, slow) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let cut = Arc::new(AtomicBool::new(false));
        let (unplugged, draws, is_slow) = (unplug.clone(), drawing.clone(), slow.clone());
        let is_cut = cut.clone();
        let thread = std::thread::spawn(move || {
            let room = || Room::of_board(&penup::board_table::PICO);
            let flash = CutFlash::new(LAYOUT.end() as usize);
            let mut plotter = InMemory::<u16>::with_flash(room(), flash);
            let mut heard = Vec::new();
            let mut buffer = [0; 64];
            while !unplugged.load(Ordering::Relaxed) {
                if is_cut.swap(false, Ordering::Relaxed) {
                    let flash = plotter.cut_power().expect("it has flash");
                    plotter = InMemory::with_flash(room(), flash.powered());
                }
                // An error says that the program does not hold its end.
                if let Ok(count) = wire.read(&mut buffer) {
                    plotter.send(&buffer[..count]).expect("memory");
                    heard.extend_from_slice(&buffer[..count]);
                    if heard.windows(5).any(|bytes| bytes == b"$plot") {
                        draws.store(true, Ordering::Relaxed);
                    }
                }
                let count = plotter.receive(&mut buffer, Duration::ZERO).expect("memory");
                let _ = wire.write_all(&buffer[..count]);
                let pause = if is_slow.load(Ordering::Relaxed) { 20 } else { 1 };
                std::thread::sleep(Duration::from_millis(pause));
            }
        });
        Self { device, unplug, drawing, slow, cut, thread: Some(thread) }
    }

    /// Runs a command that finds this plotter by itself.
    fn run(&self, folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
        with_ports(folder, &[&self.device], arguments)
    }

    /// As [`Library::run`], with the answer as JSON.
    fn json(&self, folder: &Path, arguments: &[&str]) -> (Option<i32>, serde_json::Value) {
        let (code, said, error) = self.run(folder, &[arguments, &["--json"]].concat());
        let last = said.lines().last().unwrap_or_default();
        assert!(!last.is_empty(), "{error}");
        (code, serde_json::from_str(last).expect("JSON"))
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        self.unplug.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(std::thread::panicking() || matches!(ended, Some(Ok(()))), "the plotter broke");
    }
}

/// Runs the program on a computer with these ports.
fn with_ports(folder: &Path, ports: &[&str], arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(arguments)
        .env("PENUP_PORTS", ports.join(","))
        .current_dir(folder)
        .output()
        .expect("the program runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_only_plotter_is_found_and_two_are_not_chosen_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_wire, silent) = TTYPort::pair().expect("a pseudo-terminal");
    let silent_name = silent.name().expect("a name");
    drop(silent);
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
    assert_eq!(run(&["set", "999=1"]).0, Some(4));
    let (code, said, error) = run(&["settings", "restore", "machine.toml"]);
    assert_eq!((code, said), (Some(0), "2 settings are changed\n".into()), "{error}");
    let (_, again, _) = run(&["settings", "save"]);
    assert_eq!(again, saved);
    let (code, said, _) = run(&["settings", "restore", "machine.toml"]);
    assert_eq!((code, said), (Some(0), "the machine has these settings already\n".into()));
    // A polargraph and its anchors only fit each other together.
    let anchors = ["set", "230=2", "231=300", "232=100", "233=1200"];
    let (code, said, error) = run(&anchors);
    assert_eq!(code, Some(0), "{said}{error}");
    fs::write(folder.path().join("bad.toml"), "[settings]\nspeed = 1\n").expect("written");
    let (code, _, error) = run(&["settings", "restore", "bad.toml"]);
    assert_eq!(code, Some(1));
    assert!(error.starts_with("penup: bad.toml: [settings] holds speed"), "{error}");
}

/// Writes a job of twelve metres, four minutes of the plotter's time, to rows.obj.
fn write_rows(folder: &Path) {
    let rows: String = (0..120).map(|row| format!("v 50 {0} 0\nv 150 {0} 0\n", 50 + row)).collect();
    let lines: String =
        (0..120).map(|row| format!("l {} {}\n", 2 * row + 1, 2 * row + 2)).collect();
    fs::write(folder.join("rows.obj"), rows + &lines).expect("written");
}

#[test]
fn a_job_goes_on_after_a_loss_of_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    write_rows(folder.path());
    let mut client = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["plot", "rows.obj", "--port", &plotter.device])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("the program runs");
    while !plotter.drawing.load(Ordering::Relaxed) {
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
        std::thread::sleep(Duration::from_millis(5));
    }
    client.kill().expect("killed");
    client.wait().expect("it ends");
    // It draws some strokes before its power is cut.
    let strokes = |status: &serde_json::Value| status["strokes"]["done"].as_u64().unwrap_or(0);
    while strokes(&plotter.json(folder.path(), &["status"]).1) < 3 {}
    plotter.cut.store(true, Ordering::Relaxed);
    while plotter.cut.load(Ordering::Relaxed) {}
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (_, said, _) = run(&["status"]);
    assert!(said.contains("a job has stopped after "), "{said}");
    let (code, _, error) = run(&["resume"]);
    assert_eq!(code, Some(4), "{error}");
    assert!(error.contains("penup resume --at-origin"), "{error}");
    let (code, stopped) = plotter.json(folder.path(), &["status"]);
    let drawn = stopped["stopped"]["done"].as_u64().expect("a number");
    assert_eq!((code, &stopped["stopped"]["all"]), (Some(0), &120.into()));
    assert!((2..120).contains(&drawn), "{stopped}");
    let (code, said, error) = run(&["resume", "--at-origin"]);
    assert_eq!((code, said.as_str()), (Some(0), "the rest of the job is drawn\n"), "{error}");
    let (_, drawn) = plotter.json(folder.path(), &["status"]);
    assert_eq!(drawn["strokes"], serde_json::json!({ "done": 120, "all": 120 }));
    assert_eq!(drawn["stopped"], serde_json::Value::Null);
    assert!(run(&["resume"]).2.contains("nothing to resume"));
}

#[test]
fn a_job_goes_on_without_its_client_and_is_joined_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    write_rows(folder.path());
    let mut client = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["plot", "rows.obj", "--port", &plotter.device])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("the program runs");
    // The port is the client's as long as it lives.
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    plotter.slow.store(true, Ordering::Relaxed);
    while !plotter.drawing.load(Ordering::Relaxed) {
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(client.try_wait().expect("a state"), None, "it has drawn already");
    let (code, _, _) = run(&["status"]);
    assert_eq!(code, Some(3), "two programs at one port");
    client.kill().expect("killed");
    client.wait().expect("it ends");
    let (code, paused) = plotter.json(folder.path(), &["pause"]);
    assert_eq!(
        (code, &paused["state"], &paused["standing"]),
        (Some(0), &"Hold".into(), &true.into())
    );
    let (code, said, _) = run(&["status"]);
    assert_eq!(code, Some(0));
    assert!(said.starts_with("it holds with the pen up"), "{said}");
    assert!(said.contains("of 120 strokes are drawn") && said.contains(" are left"), "{said}");
    let (code, _, error) = run(&["jog", "1", "1"]);
    assert_eq!(
        (code, error.contains("the plotter is not ready: it reports Hold")),
        (Some(4), true)
    );
    assert_eq!(run(&["resume"]).0, Some(0));
    plotter.slow.store(false, Ordering::Relaxed);
    let (code, ended) = plotter.json(folder.path(), &["watch"]);
    assert_eq!((code, &ended["state"]), (Some(0), &"Idle".into()));
    assert_eq!(ended["strokes"], serde_json::json!({ "done": 120, "all": 120 }));
    assert_eq!(run(&["watch"]).1, "nothing is being drawn\n");
}

#[test]
fn the_console_sends_lines_and_prints_the_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut console = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["console", "--port", &plotter.device])
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut typed = console.stdin.take().expect("a pipe");
    typed.write_all(b"$I\n$100=0\nG0 X5\nv 1 2\n?\n").expect("written");
    drop(typed);
    let output = console.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stdout).expect("text");
    assert!(said.contains("[VER:1.1h.penup"), "{said}");
    assert_eq!(said.matches("ok\r\n").count(), 2, "{said}");
    assert_eq!(said.matches("error:").count(), 2, "{said}");
    assert!(said.contains("|MPos:"), "{said}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["position_mm"][0], 5.0);
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
    let (code, _, error) = penup(folder.path(), &["preview", "a.obj", "--set", "100=1"]);
    assert_eq!(code, Some(1));
    assert!(error.contains("setting 100 cannot be 1: "), "{error}");
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
    assert!(said.starts_with("a.obj is drawn: 1 strokes, 270.0 mm drawn"), "{said}");
}
