//! The program with a plotter at a serial port.

use super::*;
use penup_client::fake::{FakePlotter, Fault};
use penup_client::link::Link as _;
use serialport::{SerialPort as _, TTYPort};
use std::io::{Read as _, Write as _};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// A plotter at the other end of a pseudo-terminal.
struct Plugged {
    device: String,
    unplug: Arc<AtomicBool>,
    /// The plot command has come.
    drawing: Arc<AtomicBool>,
    thread: JoinHandle<FakePlotter>,
}

impl Plugged {
    fn new(mut plotter: FakePlotter) -> Self {
        let (mut wire, terminal) = TTYPort::pair().expect("a pseudo-terminal");
        wire.set_timeout(Duration::from_millis(1)).expect("set");
        let device = terminal.name().expect("a name");
        // Only one may hold it: the program.
        drop(terminal);
        let unplug = Arc::new(AtomicBool::new(false));
        let drawing = Arc::new(AtomicBool::new(false));
        let (unplugged, draws) = (unplug.clone(), drawing.clone());
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 64];
            while !unplugged.load(Ordering::Relaxed) {
                // An error says that the program does not hold its end yet, or no longer.
                if let Ok(count) = wire.read(&mut buffer) {
                    plotter.send(&buffer[..count]).expect("memory");
                }
                let last = plotter.lines.last().map(String::as_str);
                draws.store(last == Some("$plot"), Ordering::Relaxed);
                let count = plotter.receive(&mut buffer, Duration::from_millis(1)).expect("memory");
                // The program may have left: then nobody listens.
                let _ = wire.write_all(&buffer[..count]);
            }
            plotter
        });
        Self { device, unplug, drawing, thread }
    }

    fn unplug(self) -> FakePlotter {
        self.unplug.store(true, Ordering::Relaxed);
        self.thread.join().expect("the plotter ends")
    }
}

const CUBE: &str = include_str!("../../../scenes/cube.obj");

#[test]
fn a_file_is_sent_with_its_settings_and_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
    let plotter = Plugged::new(FakePlotter::new(Fault::None));
    let line = ["plot", "cube.obj", "--eye", "-3,-4,2.5", "--port", &plotter.device];
    let (code, stdout, stderr) = penup(folder.path(), &line);
    assert_eq!(
        (code, stdout.as_str()),
        (Some(0), "cube.obj is drawn; the model reaches from 0, 0, 0 to 1, 1, 1\n"),
        "{stderr}"
    );
    let lines = plotter.unplug().lines;
    let file = CUBE.lines().filter(|line| !line.starts_with('#'));
    let count = file.clone().count();
    // After `$clear`, at which the plotter forgets what came before.
    assert_eq!(lines[0], "$pens=auto");
    assert!(lines[1..=count].iter().eq(file));
    assert!(lines.contains(&"$eye=-3,-4,2.5".to_owned()));
    assert_eq!(lines.last().map(String::as_str), Some("$plot"));
}

#[test]
fn a_line_that_the_plotter_refuses_is_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
    let plotter = Plugged::new(FakePlotter::new(Fault::ErrorAt(3, 9999)));
    let line = ["plot", "cube.obj", "--port", &plotter.device];
    let (code, _, stderr) = penup(folder.path(), &line);
    assert_eq!(code, Some(4));
    assert!(stderr.contains("penup: cube.obj:3: "), "{stderr}");
    assert!(stderr.contains("    v 1 0 0\n"), "{stderr}");
    plotter.unplug();
}

/// A `penup plot` of `cube.obj` in this folder, once the plotter draws.
fn drawing(folder: &Path, plotter: &Plugged, stderr: Stdio) -> Child {
    let mut program = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(["plot", "cube.obj", "--port", &plotter.device])
        .current_dir(folder)
        .stderr(stderr)
        .spawn()
        .expect("the program runs");
    while !plotter.drawing.load(Ordering::Relaxed) {
        let ended = program.try_wait().expect("a state");
        assert_eq!(ended, None, "it ended before the drawing began");
        std::thread::sleep(Duration::from_millis(5));
    }
    program
}

/// Sends what Ctrl-C sends.
fn interrupt(program: &Child) {
    let number = program.id().to_string();
    let sent = Command::new("kill").args(["-INT", &number]).status().expect("a signal");
    assert!(sent.success());
}

#[test]
fn an_interrupt_stops_the_plotter() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
    let mut fake = FakePlotter::new(Fault::None);
    fake.strokes = 1_000_000;
    let plotter = Plugged::new(fake);
    let mut program = drawing(folder.path(), &plotter, Stdio::inherit());
    interrupt(&program);
    assert_eq!(program.wait().expect("it ends").code(), Some(130));
    assert_eq!(plotter.unplug().aborts, 2);
}

/// Whoever does not wait until the plotter has stopped is told that it may go on.
#[test]
fn a_second_interrupt_says_that_the_plotter_may_be_moving() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
    // It does not confirm that it stops, for which the program waits some seconds.
    let mut fake = FakePlotter::new(Fault::IgnoresAbort);
    fake.strokes = 1_000_000;
    let plotter = Plugged::new(fake);
    let program = drawing(folder.path(), &plotter, Stdio::piped());
    for _ in 0..2 {
        interrupt(&program);
        std::thread::sleep(Duration::from_millis(500));
    }
    let output = program.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("penup: stopping the plotter"), "{said}");
    assert!(said.contains("may still be moving"), "{said}");
    assert!(said.contains("`penup abort` stops it"), "{said}");
    plotter.unplug();
}

#[test]
fn a_model_that_the_plotter_cannot_hold_is_not_sent() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cube.obj"), CUBE).expect("written");
    let mut fake = FakePlotter::new(Fault::None);
    fake.most_vertices = 7;
    let plotter = Plugged::new(fake);
    let command = ["plot", "cube.obj", "--compute", "board", "--port", &plotter.device];
    let (code, _, stderr) = penup(folder.path(), &command);
    assert_eq!(code, Some(1));
    let reason = "penup: cube.obj: the model has 8 vertices, and this plotter takes 7\n";
    assert!(stderr.starts_with(reason), "{stderr}");
    assert_eq!(plotter.unplug().lines, [""; 0]);
}
