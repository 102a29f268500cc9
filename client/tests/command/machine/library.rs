//! The plotter's own library at a serial port.

use penup::boards::host::{CutFlash, LAYOUT};
use penup_client::link::Link as _;
use penup_client::preview::InMemory;
use penup_job::room::Room;
use rustix::io::ioctl_fionbio;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Writes as many of the bytes as the wire takes, and forgets those that it took. Where no program
/// holds the other end, it forgets them all, as a serial line would.
fn say(wire: &mut fs::File, unread: &mut VecDeque<u8>) {
    match wire.write(unread.make_contiguous()) {
        Ok(count) => drop(unread.drain(..count)),
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
        Err(_) => unread.clear(),
    }
}

/// A plotter of the library at the other end of a pseudo-terminal. Its time passes some fifty times
/// as fast as ours, and only while it is plugged in.
pub struct Library {
    pub device: String,
    unplug: Arc<AtomicBool>,
    /// The plot command has come.
    pub drawing: Arc<AtomicBool>,
    /// Its time passes a tenth as fast.
    pub slow: Arc<AtomicBool>,
    /// Its power is cut, and comes back.
    pub cut: Arc<AtomicBool>,
    /// Its cable is pulled, and plugged in again at another port behind the same name.
    pub replug: Arc<AtomicBool>,
    /// It neither hears nor answers.
    pub deaf: Arc<AtomicBool>,
    /// The number of bytes that it has heard.
    pub heard: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl Library {
    pub fn new() -> Self {
        let (wire, device) = pseudo_terminal();
        Self::behind(wire, device, None)
    }

    /// A plotter whose port has a name in `folder` that stays when it is plugged in again, and
    /// whose line damages a byte now and then.
    pub fn at_a_bad_line(folder: &Path) -> Self {
        let (wire, device) = pseudo_terminal();
        let name = folder.join("plotter");
        std::os::unix::fs::symlink(&device, &name).expect("linked");
        Self::behind(wire, name.to_string_lossy().into_owned(), Some(name))
    }

    pub fn behind(mut wire: fs::File, device: String, name: Option<PathBuf>) -> Self {
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
            let mut unread = VecDeque::new();
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
                    // As at the USB port of a Pico, which greets whoever opens the port.
                    if draws.load(Ordering::Relaxed) {
                        unread.clear();
                        unread.extend(b"\r\nGrbl 1.1h [penup 0.1.0 '$' for help]\r\n");
                    }
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
                    unread.extend(&buffer[..count]);
                }
                say(&mut wire, &mut unread);
                let pause = if is_slow.load(Ordering::Relaxed) { 20 } else { 1 };
                std::thread::sleep(Duration::from_millis(pause));
            }
        });
        Self { device, unplug, drawing, slow, cut, replug, deaf, heard, thread: Some(thread) }
    }

    /// Starts to plot a job of twelve metres, four minutes of the plotter's time.
    pub fn plot_rows(&self, folder: &Path, options: &[&str]) -> Child {
        let mut client = self.rows(folder, options);
        client.stderr(Stdio::piped()).spawn().expect("the program runs")
    }

    /// The program that plots this job.
    pub fn rows(&self, folder: &Path, options: &[&str]) -> Command {
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
    pub fn plot_waves(&self, folder: &Path, options: &[&str]) -> Child {
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
            .args(options)
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program runs")
    }

    /// Waits until the plot command of this client has come.
    pub fn wait_for_drawing(&self, client: &mut Child) {
        while !self.drawing.load(Ordering::Relaxed) {
            assert_eq!(client.try_wait().expect("a state"), None, "it ended before the drawing");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// How many strokes it has drawn of its job.
    pub fn strokes(&self, folder: &Path) -> u64 {
        self.json(folder, &["status"]).1["strokes"]["done"].as_u64().unwrap_or(0)
    }

    /// Runs a command that finds this plotter by itself.
    pub fn run(&self, folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
        with_ports(folder, &[&self.device], arguments)
    }

    /// As [`Library::run`], with the answer as JSON.
    pub fn json(&self, folder: &Path, arguments: &[&str]) -> (Option<i32>, serde_json::Value) {
        let (code, said, error) = self.run(folder, &[arguments, &["--json"]].concat());
        let last = said.lines().last().unwrap_or_default();
        assert!(!last.is_empty(), "{error}");
        (code, serde_json::from_str(last).expect("JSON"))
    }
}

/// A pseudo-terminal: the plotter's end, and the name of the other, which nobody holds.
///
/// No other program inherits the plotter's end, so the port is gone when that is closed.
pub fn pseudo_terminal() -> (fs::File, String) {
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
pub fn with_ports(
    folder: &Path,
    ports: &[&str],
    arguments: &[&str],
) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_penup"))
        .args(arguments)
        .env("PENUP_PORTS", ports.join(","))
        .current_dir(folder)
        .output()
        .expect("the program runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}
