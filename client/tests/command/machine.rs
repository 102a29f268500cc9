//! The commands for the machine, with the plotter's own library at a serial port.

use super::*;
use penup::boards::host::{CutFlash, LAYOUT};
use penup_client::link::Link as _;
use penup_client::preview::InMemory;
use penup_job::room::Room;
use rustix::io::ioctl_fionbio;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::io::{Read as _, Write as _};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
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
    /// Its cable is pulled, and plugged in again at another port behind the same name.
    replug: Arc<AtomicBool>,
    /// It neither hears nor answers.
    deaf: Arc<AtomicBool>,
    /// The number of bytes that it has heard.
    heard: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl Library {
    fn new() -> Self {
        let (wire, device) = pseudo_terminal();
        Self::behind(wire, device, None)
    }

    /// A plotter whose port has a name in `folder` that stays when it is plugged in again, and
    /// whose line damages a byte now and then.
    fn at_a_bad_line(folder: &Path) -> Self {
        let (wire, device) = pseudo_terminal();
        let name = folder.join("plotter");
        std::os::unix::fs::symlink(&device, &name).expect("linked");
        Self::behind(wire, name.to_string_lossy().into_owned(), Some(name))
    }

    fn behind(mut wire: fs::File, device: String, name: Option<PathBuf>) -> Self {
        let unplug = Arc::new(AtomicBool::new(false));
        let (drawing, slow) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let cut = Arc::new(AtomicBool::new(false));
        let (unplugged, draws, is_slow) = (unplug.clone(), drawing.clone(), slow.clone());
        let is_cut = cut.clone();
        let (replug, deaf) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let heard = Arc::new(AtomicUsize::new(0));
        let (is_replugged, is_deaf, counter) = (replug.clone(), deaf.clone(), heard.clone());
        let mut damaged = 0;
        let thread = std::thread::spawn(move || {
            let room = || Room::of_board(&penup::board_table::PICO);
            let flash = CutFlash::new(LAYOUT.end() as usize);
            let mut plotter = InMemory::<u16>::with_flash(room(), flash);
            let mut heard = Vec::new();
            let mut buffer = [0; 64];
            let is_bad = name.is_some();
            // Only what stands in lines is damaged: other bytes may stop the machine.
            let mut damage = |bytes: &mut [u8]| {
                for byte in bytes.iter_mut().filter(|byte| is_bad && byte.is_ascii_alphanumeric()) {
                    damaged += 1;
                    if damaged % 4999 == 0 {
                        *byte = b'_';
                    }
                }
            };
            while !unplugged.load(Ordering::Relaxed) {
                if is_cut.swap(false, Ordering::Relaxed) {
                    let flash = plotter.cut_power().expect("it has flash");
                    plotter = InMemory::with_flash(room(), flash.powered());
                }
                if let (true, Some(name)) = (is_replugged.load(Ordering::Relaxed), &name) {
                    fs::remove_file(name).expect("removed");
                    let (other, device) = pseudo_terminal();
                    // The client finds no port for a while.
                    drop(std::mem::replace(&mut wire, other));
                    for _ in 0..300 {
                        plotter.receive(&mut buffer, Duration::ZERO).expect("memory");
                        std::thread::sleep(Duration::from_millis(1));
                    }
                    std::os::unix::fs::symlink(device, name).expect("linked");
                    is_replugged.store(false, Ordering::Relaxed);
                }
                // An error says that the program does not hold its end.
                if let Ok(count) = wire.read(&mut buffer) {
                    counter.fetch_add(count, Ordering::Relaxed);
                    if is_deaf.load(Ordering::Relaxed) {
                        continue;
                    }
                    damage(&mut buffer[..count]);
                    plotter.send(&buffer[..count]).expect("memory");
                    heard.extend_from_slice(&buffer[..count]);
                    if heard.windows(5).any(|bytes| bytes == b"$plot") {
                        draws.store(true, Ordering::Relaxed);
                    }
                }
                std::thread::sleep(Duration::from_millis(1));
                let count = plotter.receive(&mut buffer, Duration::ZERO).expect("memory");
                if !is_deaf.load(Ordering::Relaxed) {
                    damage(&mut buffer[..count]);
                    let _ = wire.write_all(&buffer[..count]);
                }
                let pause = if is_slow.load(Ordering::Relaxed) { 20 } else { 1 };
                std::thread::sleep(Duration::from_millis(pause));
            }
        });
        Self { device, unplug, drawing, slow, cut, replug, deaf, heard, thread: Some(thread) }
    }

    /// Starts to plot a job of twelve metres, four minutes of the plotter's time.
    fn plot_rows(&self, folder: &Path, options: &[&str]) -> Child {
        let mut client = self.rows(folder, options);
        client.stderr(Stdio::piped()).spawn().expect("the program runs")
    }

    /// The program that plots this job.
    fn rows(&self, folder: &Path, options: &[&str]) -> Command {
        let rows: String =
            (0..120).map(|row| format!("v 50 {0} 0\nv 150 {0} 0\n", 50 + row)).collect();
        let lines: String =
            (0..120).map(|row| format!("l {} {}\n", 2 * row + 1, 2 * row + 2)).collect();
        fs::write(folder.join("rows.obj"), rows + &lines).expect("written");
        let mut client = Command::new(env!("CARGO_BIN_EXE_penup"));
        client
            .args(["plot", "rows.obj", "--port", &self.device])
            .args(options)
            .current_dir(folder)
            .stdout(Stdio::piped());
        client
    }

    /// Starts to plot 70 waves of 300 points, more than the plotter holds, computed by the client.
    fn plot_waves(&self, folder: &Path) -> Child {
        let (mut points, mut lines) = (String::new(), String::new());
        for wave in 0..70 {
            lines += "l";
            for n in 0..300 {
                let (x, y) = (20.0 + 0.4 * f64::from(n), f64::from(20 + 2 * wave + n % 2));
                points += &format!("v {x} {y} 0\n");
                lines += &format!(" {}", 300 * wave + n + 1);
            }
            lines.push('\n');
        }
        fs::write(folder.join("waves.obj"), points + &lines).expect("written");
        Command::new(env!("CARGO_BIN_EXE_penup"))
            .args(["plot", "waves.obj", "--port", &self.device, "--compute", "host"])
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs")
    }

    /// Waits until the plot command of this client has come.
    fn wait_for_drawing(&self, client: &mut Child) {
        while !self.drawing.load(Ordering::Relaxed) {
            assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// How many strokes it has drawn of its job.
    fn strokes(&self, folder: &Path) -> u64 {
        self.json(folder, &["status"]).1["strokes"]["done"].as_u64().unwrap_or(0)
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

/// A pseudo-terminal: the plotter's end, and the name of the other, which nobody holds.
///
/// No other program inherits the plotter's end, so the port is gone when that is closed.
fn pseudo_terminal() -> (fs::File, String) {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let wire = openpt(flags).expect("a pseudo-terminal");
    grantpt(&wire).and_then(|()| unlockpt(&wire)).expect("a terminal");
    let name = ptsname(&wire, Vec::new()).expect("a name").into_string().expect("text");
    let terminal = fs::File::open(&name).expect("opened");
    let mut modes = tcgetattr(&terminal).expect("modes");
    modes.make_raw();
    tcsetattr(&terminal, OptionalActions::Now, &modes).expect("set");
    ioctl_fionbio(&wire, true).expect("set");
    (wire.into(), name)
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
    // The plotter keeps more decimals than it shows.
    let (code, said, error) = run(&["set", "100=80.0003"]);
    assert_eq!((code, said), (Some(0), "1 setting is changed\n".into()), "{error}");
    // A polargraph and its anchors only fit each other together.
    let anchors = ["set", "230=2", "231=300", "232=100", "233=1200"];
    let (code, said, error) = run(&anchors);
    assert_eq!(code, Some(0), "{said}{error}");
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

#[test]
fn a_job_goes_on_after_a_loss_of_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    // It draws some strokes before its power is cut.
    while plotter.strokes(folder.path()) < 3 {}
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
fn a_drawing_that_is_sent_goes_on_after_a_loss_of_power() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &["--compute", "host"]);
    plotter.slow.store(true, Ordering::Relaxed);
    while plotter.heard.load(Ordering::Relaxed) < 700 {
        std::thread::sleep(Duration::from_millis(5));
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
    }
    // The plotter has room for all strokes, which come within a second.
    std::thread::sleep(Duration::from_secs(2));
    plotter.slow.store(false, Ordering::Relaxed);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    while plotter.strokes(folder.path()) < 3 {}
    plotter.cut.store(true, Ordering::Relaxed);
    while plotter.cut.load(Ordering::Relaxed) {}
    let (code, stopped) = plotter.json(folder.path(), &["status"]);
    let drawn = stopped["stopped"]["done"].as_u64().expect("a number");
    assert_eq!((code, &stopped["stopped"]["all"]), (Some(0), &120.into()));
    let (code, _, error) = plotter.run(folder.path(), &["resume", "--at-origin"]);
    assert_eq!((code, error.contains("--resume")), (Some(1), true), "{error}");
    let go_on = |options: &[&str]| {
        let output = plotter.rows(folder.path(), options).stderr(Stdio::piped()).output();
        let output = output.expect("the program runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, error) = go_on(&["--resume"]);
    assert_eq!((code, error.contains("--at-origin")), (Some(1), true), "{error}");
    let (code, error) = go_on(&["--resume", "--at-origin", "--scale", "0.9"]);
    assert_eq!((code, error.contains("another drawing")), (Some(1), true), "{error}");
    let (code, error) = go_on(&["--resume", "--at-origin"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(error.contains(&format!("{drawn} of 120 strokes are drawn")), "{error}");
    let (_, ended) = plotter.json(folder.path(), &["status"]);
    let rest = 120 - drawn;
    assert_eq!(ended["strokes"], serde_json::json!({ "done": rest, "all": rest }));
    assert_eq!(ended["stopped"], serde_json::Value::Null);
    let (code, error) = go_on(&["--resume"]);
    assert_eq!((code, error.contains("no drawing has stopped")), (Some(1), true), "{error}");
}

#[test]
fn a_job_goes_on_without_its_client_and_is_joined_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    // The port is the client's as long as it lives.
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    plotter.slow.store(true, Ordering::Relaxed);
    plotter.wait_for_drawing(&mut client);
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

/// What a program has said when it has ended: its exit code, its answer and its notes.
fn ended(client: Child) -> (Option<i32>, String, String) {
    let output = client.wait_with_output().expect("it ends");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_cable_that_is_pulled_costs_neither_the_upload_nor_the_job() {
    for bytes in [300, 1500, 4000, usize::MAX] {
        let folder = tempfile::tempdir().expect("a folder");
        let plotter = Library::at_a_bad_line(folder.path());
        let mut client = plotter.plot_rows(folder.path(), &[]);
        let is_due = || match bytes {
            usize::MAX => plotter.drawing.load(Ordering::Relaxed),
            bytes => plotter.heard.load(Ordering::Relaxed) >= bytes,
        };
        while !is_due() {
            assert_eq!(client.try_wait().expect("a state"), None, "it ended before");
            std::thread::sleep(Duration::from_millis(1));
        }
        plotter.replug.store(true, Ordering::Relaxed);
        let (code, said, noted) = ended(client);
        assert_eq!(code, Some(0), "{bytes}: {noted}");
        assert!(said.starts_with("rows.obj is drawn: 120 strokes, 12000.0 mm drawn"), "{said}");
        assert!(noted.contains("penup: the port of the plotter is gone: waiting up to 300 s"));
        assert!(noted.contains("penup: the plotter is back"), "{noted}");
    }
}

#[test]
fn a_plotter_that_falls_silent_is_watched_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::at_a_bad_line(folder.path());
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    plotter.deaf.store(true, Ordering::Relaxed);
    // Longer than a client waits for an answer that never comes.
    std::thread::sleep(Duration::from_secs(6));
    plotter.deaf.store(false, Ordering::Relaxed);
    let (code, _, noted) = ended(client);
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("penup: the plotter does not answer: waiting up to 300 s"), "{noted}");
    assert!(noted.contains("penup: the plotter is back"), "{noted}");
}

#[test]
fn a_port_that_stays_away_ends_the_waiting_in_time() {
    for (seconds, is_told) in [("1", true), ("0", false)] {
        let folder = tempfile::tempdir().expect("a folder");
        let plotter = Library::new();
        let mut client = plotter.plot_rows(folder.path(), &["--rejoin", seconds]);
        plotter.slow.store(true, Ordering::Relaxed);
        plotter.wait_for_drawing(&mut client);
        drop(plotter);
        let (code, _, noted) = ended(client);
        assert_eq!(code, Some(5), "{noted}");
        assert!(noted.contains("the line to the plotter broke: "), "{noted}");
        assert_eq!(noted.contains("waiting up to 1 s"), is_told, "{noted}");
    }
}

#[test]
fn a_job_that_a_loss_of_power_has_stopped_is_not_taken_for_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_rows(folder.path(), &[]);
    plotter.wait_for_drawing(&mut client);
    client.kill().expect("killed");
    client.wait().expect("it ends");
    plotter.slow.store(true, Ordering::Relaxed);
    while plotter.strokes(folder.path()) < 3 {}
    let watch = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["watch", "--port", &plotter.device])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let heard = plotter.heard.load(Ordering::Relaxed);
    while plotter.heard.load(Ordering::Relaxed) < heard + 5 {}
    plotter.cut.store(true, Ordering::Relaxed);
    let (code, _, noted) = ended(watch);
    assert_eq!(code, Some(5), "{noted}");
    assert!(noted.contains("again") || noted.contains("the job has stopped after "), "{noted}");
}

#[test]
fn strokes_that_stop_coming_come_again_from_the_same_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let mut client = plotter.plot_waves(folder.path());
    while plotter.heard.load(Ordering::Relaxed) < 30_000 {
        assert_eq!(client.try_wait().expect("a state"), None, "it ended before");
        std::thread::sleep(Duration::from_millis(1));
    }
    client.kill().expect("killed");
    client.wait().expect("it ends");
    // What has come is drawn, and then the machine waits with the pen up.
    let mut seen = (u64::MAX, 0);
    while seen.0 != seen.1 || seen.0 == 0 {
        std::thread::sleep(Duration::from_millis(500));
        seen = (plotter.strokes(folder.path()), seen.0);
    }
    assert!((1..70).contains(&seen.0), "{seen:?}");
    let (code, said, noted) = ended(plotter.plot_waves(folder.path()));
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("the plotter draws this already: the last "), "{noted}");
    assert!(said.starts_with("waves.obj is drawn: "), "{said}");
    let status = plotter.json(folder.path(), &["status"]).1;
    assert_eq!(status["state"], "Idle", "{status}");
}

#[test]
fn a_drawing_goes_on_at_the_stroke_that_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let file = "v 10 10 0\nv 60 10 0\nv 10 20 0\nv 60 20 0\nl 1 2\nl 3 4\n";
    fs::write(folder.path().join("a.obj"), file).expect("written");
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let plot = |from: &str| run(&["plot", "a.obj", "--port", "auto", "--from", from]);
    let (code, _, noted) = plot("1");
    assert_eq!(code, Some(0), "{noted}");
    assert!(noted.contains("1 strokes with 2 points are sent"), "{noted}");
    let (code, _, noted) = plot("2");
    assert_ne!(code, Some(0), "there is nothing behind the last stroke: {noted}");
}

#[test]
fn everything_is_drawn_so_many_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    fs::write(folder.path().join("a.obj"), "v 10 10 0\nv 60 10 0\nl 1 2\n").expect("written");
    let run = |arguments: &[&str]| plotter.run(folder.path(), arguments);
    let (code, said, error) = run(&["plot", "a.obj", "--port", "auto", "--multipass", "3"]);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.starts_with("a.obj is drawn 3 times: 1 strokes, 50.0 mm drawn"), "{said}");
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

/// Runs `penup setup` with these answers.
fn set_up(plotter: &Library, answers: &str) -> (Option<i32>, serde_json::Value, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["setup", "--json", "--port", &plotter.device])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut typed = program.stdin.take().expect("a pipe");
    typed.write_all(answers.as_bytes()).expect("written");
    drop(typed);
    let (code, said, noted) = ended(program);
    (code, serde_json::from_str(&said).expect(&noted), noted)
}

#[test]
fn a_machine_is_set_up_by_questions() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    // x runs the other way, 100 mm are 98 and 101, and the pen is lowered less.
    let answers = "\nleft\nup\nbanana\nright\nup\n\n98\n\n101,0\n\n200\n90\n\n\nyes\n";
    let (code, said, noted) = set_up(&plotter, answers);
    assert_eq!(code, Some(0), "{noted}");
    let expected = serde_json::json!({ "3": 1.0, "100": 81.633, "101": 79.208, "211": 90.0 });
    assert_eq!(said["settings"], expected, "{noted}");
    assert!(noted.contains("Please type right, left, up, down, not at all."), "{noted}");
    assert!(noted.contains("Please type a number from 0 to 127."), "{noted}");
    assert!(noted.contains("both diagonals are the same"), "{noted}");
    let (_, shown, _) = plotter.run(folder.path(), &["settings", "show"]);
    for setting in ["  3 = 1 ", "100 = 81.633 ", "101 = 79.20", " 20 = 1 ", "211 = 90 "] {
        assert!(shown.contains(setting), "{setting}: {shown}");
    }
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
}

/// The motors of a polargraph are 1000 mm apart; the left one runs the wrong way.
#[test]
fn a_polargraph_is_set_up_by_its_own_measures() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (code, _, error) = plotter.run(folder.path(), &["set", "230=2"]);
    assert_eq!(code, Some(0), "{error}");
    let measures = "1000\n1200\n250\n650\n500\n900\n600\n40\n3200\n";
    let rest = "\nup\nright\nright\nup\n\n90\n\nyes\n";
    let (code, said, noted) = set_up(&plotter, &format!("{measures}{rest}"));
    assert_eq!(code, Some(0), "{noted}");
    let expected = serde_json::json!({
        "3": 1.0, "130": 500.0, "131": 600.0, "211": 90.0, "231": 1000.0, "232": 250.0,
        "233": 650.0,
    });
    assert_eq!(said["settings"], expected, "80 steps in a mm are the default: {noted}");
    assert!(noted.contains("Please type a number from 0 to 1000."), "{noted}");
    assert!(noted.contains("Please type a number from 1 to 649."), "{noted}");
    let parts: Vec<&str> = noted.lines().filter(|line| line.contains(" of 5: ")).collect();
    assert_eq!(parts.len(), 5, "{noted}");
    assert!(parts.iter().zip(1..).all(|(part, number)| part.starts_with(&format!("{number} of"))));
    assert!(!noted.contains("steps in a mm.\n"), "the axes have no steps: {noted}");
    assert!(noted.contains("both diagonals are the same"), "{noted}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
}

/// The settings that are named in a sentence, such as `3=1 (inverted directions)`.
fn settings_in(said: &str) -> Vec<(String, f64)> {
    let words = said.split([' ', '\n', ',']).filter_map(|word| word.split_once('='));
    words.filter_map(|(number, value)| Some((number.to_owned(), value.parse().ok()?))).collect()
}

/// Checks that what differs from a new machine is what was told, and that soft limits are on.
fn assert_told(plotter: &Library, folder: &Path, told: &[(String, f64)]) {
    let (_, now) = plotter.json(folder, &["settings", "show"]);
    let (_, new) = Library::new().json(folder, &["settings", "show"]);
    let (now, new) = (now["settings"].as_object().expect("a table"), &new["settings"]);
    let differs: Vec<(&String, f64)> = now
        .iter()
        .filter(|(number, value)| new[number.as_str()] != **value)
        .map(|(number, value)| (number, value.as_f64().expect("a number")))
        .collect();
    assert_eq!(differs.len(), told.len(), "{differs:?} {told:?}");
    for (number, value) in differs {
        let (_, told) = told.iter().find(|(told, _)| told == number).expect("it is told");
        assert!((told - value).abs() < 0.001, "{number}: {told} {value}");
    }
    assert_eq!(now["20"], 1.0, "soft limits are on as before");
}

#[test]
fn a_setup_that_is_broken_off_says_what_is_stored() {
    let all = "\nleft\nup\nright\nup\n\n98\n\n101\n\n90\n\n\n";
    let ends = all.match_indices('\n').map(|(at, _)| at + 1);
    let folder = tempfile::tempdir().expect("a folder");
    for end in std::iter::once(0).chain(ends) {
        let plotter = Library::new();
        let (code, said, noted) = set_up(&plotter, &all[..end]);
        assert_eq!(code, Some(5), "{noted}");
        let error = said["error"].as_str().expect("an error");
        assert!(error.starts_with("the setup is broken off; "), "{error}");
        assert_told(&plotter, folder.path(), &settings_in(error));
    }
}

/// Ctrl-C breaks the setup off wherever it comes: at a question, or while the pen moves.
#[test]
fn a_setup_is_broken_off_by_ctrl_c() {
    let folder = tempfile::tempdir().expect("a folder");
    for (answers, question) in
        [("", "Press Enter when it is there"), ("\nleft\nup\nright\nup\n\n", "How many mm did")]
    {
        let plotter = Library::new();
        plotter.slow.store(true, Ordering::Relaxed);
        let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
            .args(["setup", "--port", &plotter.device])
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let mut typed = program.stdin.take().expect("a pipe");
        typed.write_all(answers.as_bytes()).expect("written");
        let mut noted = String::new();
        let mut said = program.stderr.take().expect("a pipe");
        let mut bytes = [0; 256];
        while !noted.contains(question) {
            let count = said.read(&mut bytes).expect("text");
            assert!(count > 0, "it ended: {noted}");
            noted += &String::from_utf8_lossy(&bytes[..count]);
        }
        let interrupted = Command::new("kill").args(["-INT", &program.id().to_string()]).status();
        assert!(interrupted.expect("kill runs").success());
        said.read_to_string(&mut noted).expect("text");
        assert_eq!(program.wait().expect("it ends").code(), Some(130), "{noted}");
        let (_, told) = noted.split_once("penup: the setup is broken off; ").expect(&noted);
        plotter.slow.store(false, Ordering::Relaxed);
        assert_told(&plotter, folder.path(), &settings_in(told));
    }
}

/// Has the plotter carry out lines as they are.
fn console(plotter: &Library, lines: &str) -> String {
    let mut console = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["console", "--port", &plotter.device])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut typed = console.stdin.take().expect("a pipe");
    typed.write_all(lines.as_bytes()).expect("written");
    drop(typed);
    let output = console.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn the_test_square_depends_on_no_earlier_job_and_changes_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let job = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n$projection=isometric\n$hidden=dashed\n\
               $page=100x90\n$title=old\n$eye=3,4,5\n$margin=7\n";
    let all = |said: &str| said.split("ok").collect::<Vec<_>>().join("");
    let said = console(&plotter, job);
    assert_eq!(said.matches("ok\r\n").count(), 10, "{said}");
    let before = all(&console(&plotter, "$options\n$model\n"));
    let (code, _, noted) = set_up(&plotter, "\nright\nup\n\n\n\n\n\n\n\nyes\n");
    assert_eq!(code, Some(0), "{noted}");
    let (_, status) = plotter.json(folder.path(), &["status"]);
    assert_eq!(status["strokes"], serde_json::json!({ "done": 1, "all": 1 }));
    assert_eq!(status["ink_mm"], serde_json::json!({ "done": 160, "all": 160 }), "{status}");
    let after = all(&console(&plotter, "$options\n$model\n"));
    let kept = |said: &str| {
        let lines = said.lines().filter(|line| line.contains('=') || line.contains("MODEL:"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(before.contains("title=old") && before.contains("vertices 3 "), "{before}");
    assert_eq!(kept(&after), kept(&before));
}

/// A plotter that was left elsewhere has no room for the moves of the setup.
#[test]
fn a_setup_says_where_its_moves_have_no_room() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let (_, settings) = plotter.json(folder.path(), &["settings", "show"]);
    let travel = settings["settings"]["130"].as_f64().expect("a number");
    assert_eq!(plotter.run(folder.path(), &["jog", &(travel - 50.0).to_string(), "0"]).0, Some(0));
    let (code, _, noted) = set_up(&plotter, "\n");
    assert_eq!(code, Some(5), "{noted}");
    assert!(noted.contains("Switch it off and on"), "{noted}");
}

#[test]
fn the_console_sends_lines_and_prints_the_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let plotter = Library::new();
    let said = console(&plotter, "$I\n$100=0\nG0 X5\nv 1 2\n?\n");
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
