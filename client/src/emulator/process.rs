//! Runs the QEMU process and the threads that read its output.

use std::io::{self, BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use std::{fs, thread};

use super::BOARD;
use super::debugger::Debugger;
use super::running::{Running, Shared, quitting_with_parent};
use super::stack::{self, Stack};
use super::trace::{EVENTS, Trace, TraceError};
use super::{EmulatorError, Options, log};
use crate::table;

/// A running QEMU, which ends when this is dropped.
pub struct Process {
    running: Running,
    shared: Arc<Shared<State>>,
    /// The debugger connection and the size of the stack in bytes, if the stack is painted.
    debugger: Option<(Debugger, usize)>,
}

#[derive(Default)]
struct State {
    trace: Trace,
    log: Vec<String>,
    error: Option<TraceError>,
    ended: bool,
}

impl std::fmt::Debug for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.running.fmt(f)
    }
}

impl Process {
    /// Boots `image`. Returns the process and the connection to the board's serial line.
    pub fn start(
        image: &Path,
        options: Options,
        timeout: Duration,
    ) -> Result<(Self, TcpStream), EmulatorError> {
        let bytes = fs::read(image).map_err(|_| EmulatorError::NoImage { path: image.into() })?;
        let table = log::table(&bytes)?;
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let port = listener.local_addr()?.port();
        let shared = Arc::<Shared<State>>::default();

        let (sender, started) = mpsc::channel();
        let command = command(image, options, port);
        let traced = Arc::clone(&shared);
        // Linux ends QEMU together with the thread that started it, so that thread must outlive
        // QEMU.
        let tracer = thread::spawn(move || spawn_and_trace(command, &sender, &traced));
        let (child, stdout) = match started.recv() {
            Ok(Ok(spawned)) => spawned,
            Ok(Err(error)) => return Err(not_installed(error)),
            Err(_) => return Err(io::Error::from(io::ErrorKind::BrokenPipe).into()),
        };
        let logged = Arc::clone(&shared);
        let logger = thread::spawn(move || read_log(table.as_ref(), stdout, &logged));
        let running = Running::new(child, vec![tracer, logger]);
        let mut process = Self { running, shared, debugger: None };
        // The connections arrive in the order in which the command line names them.
        let line = process.connect(&listener, timeout)?;
        if options.paints_stack {
            let mut debugger = Debugger::new(process.connect(&listener, timeout)?);
            let size = stack::size(&bytes)?;
            debugger.write(stack::RAM, &vec![stack::PAINT; size])?;
            debugger.run()?;
            process.debugger = Some((debugger, size));
        }
        Ok((process, line))
    }

    /// The deepest use of the stack since the boot; `None` if the stack was not painted. The board
    /// is stopped while its memory is read.
    pub fn stack(&mut self) -> Result<Option<Stack>, EmulatorError> {
        let Some((debugger, size)) = &mut self.debugger else { return Ok(None) };
        debugger.stop()?;
        let bytes = debugger.read(stack::RAM, *size)?;
        debugger.run()?;
        Ok(Some(Stack::of(&bytes)))
    }

    /// Waits until QEMU opens a connection.
    fn connect(
        &mut self,
        listener: &TcpListener,
        timeout: Duration,
    ) -> Result<TcpStream, EmulatorError> {
        listener.set_nonblocking(true)?;
        let deadline = Instant::now() + timeout;
        loop {
            match listener.accept() {
                Ok((line, _)) => {
                    line.set_nonblocking(false)?;
                    return Ok(line);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error.into()),
            }
            if self.running.has_ended(PROGRAM)? || Instant::now() > deadline {
                self.running.end();
                return Err(EmulatorError::Ended { said: self.said() });
            }
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits up to `timeout` until `ready` is true of the trace, then runs `work` on it.
    pub fn with_trace<T>(
        &self,
        timeout: Duration,
        ready: impl Fn(&Trace) -> bool,
        work: impl FnOnce(&mut Trace) -> T,
    ) -> Result<T, EmulatorError> {
        let waits =
            |state: &mut State| state.error.is_none() && !state.ended && !ready(&state.trace);
        let mut state = self.shared.wait_while(timeout, waits);
        if let Some(error) = state.error.take() {
            return Err(error.into());
        }
        if !ready(&state.trace) {
            let said = state.trace.said();
            return Err(EmulatorError::Ended { said });
        }
        Ok(work(&mut state.trace))
    }

    pub fn take_log(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.lock().log)
    }

    pub fn said(&self) -> String {
        self.shared.lock().trace.said()
    }

    pub fn how_it_ended(&mut self) -> Option<ExitStatus> {
        self.running.how_it_ended()
    }

    pub fn id(&self) -> u32 {
        self.running.id()
    }
}

const PROGRAM: &str = "qemu-system-arm";
const MACHINE: &str = match BOARD.emulator {
    table::Emulator::Qemu { machine } => machine,
    table::Emulator::Rp2040js => panic!("this is no machine of QEMU"),
};

fn not_installed(source: io::Error) -> EmulatorError {
    EmulatorError::NotInstalled { program: PROGRAM, source }
}

/// Creates QEMU's command line: the serial line is connected to `port`, the log goes to the
/// standard output and the trace to the standard error.
fn command(image: &Path, options: Options, port: u16) -> Command {
    let mut command = quitting_with_parent(PROGRAM);
    command
        .args(["-machine", MACHINE, "-display", "none", "-monitor", "none"])
        .arg("-icount")
        .arg(format!("shift={},sleep=off", options.instruction_shift))
        .arg("-chardev")
        .arg(format!("socket,id=uart,host=127.0.0.1,port={port},server=off,nodelay=on"))
        .args(["-serial", "chardev:uart"])
        .args(["-chardev", "stdio,id=log,signal=off"])
        .args(["-semihosting-config", "enable=on,target=native,chardev=log"]);
    for event in EVENTS {
        command.args(["-trace", event]);
    }
    command.arg("-kernel").arg(image);
    if options.paints_stack {
        // The processor is stopped until the debugger starts it.
        command
            .arg("-S")
            .arg("-chardev")
            .arg(format!("socket,id=gdb,host=127.0.0.1,port={port},server=off,nodelay=on"))
            .args(["-gdb", "chardev:gdb"]);
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // QEMU gets its own process group, so that Ctrl-C at the terminal reaches only this process,
    // which ends QEMU when it is done with it.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

type Spawned = io::Result<(Child, ChildStdout)>;

fn spawn_and_trace(mut command: Command, sender: &mpsc::Sender<Spawned>, shared: &Shared<State>) {
    let (spawned, stderr) = match spawn(&mut command) {
        Ok((child, stdout, stderr)) => (Ok((child, stdout)), Some(stderr)),
        Err(error) => (Err(error), None),
    };
    if sender.send(spawned).is_ok()
        && let Some(stderr) = stderr
    {
        read_trace(stderr, shared);
    }
}

fn spawn(command: &mut Command) -> io::Result<(Child, ChildStdout, ChildStderr)> {
    let mut child = command.spawn()?;
    match (child.stdout.take(), child.stderr.take()) {
        (Some(stdout), Some(stderr)) => Ok((child, stdout, stderr)),
        _ => Err(io::ErrorKind::BrokenPipe.into()),
    }
}

/// The pause before more of the trace is read. QEMU writes each line by itself, and would wake the
/// thread that reads at every line, which would cost several times as much as all else that QEMU
/// does. Its pipe holds the lines of several milliseconds.
const TRACE_PAUSE: Duration = Duration::from_micros(250);

/// Reads the trace until QEMU ends.
fn read_trace(stderr: ChildStderr, shared: &Shared<State>) {
    let mut lines = BufReader::with_capacity(1 << 16, stderr);
    let mut line = String::new();
    loop {
        line.clear();
        // A line that is not UTF-8 ends the trace, as the end of QEMU does.
        let count = lines.read_line(&mut line).unwrap_or(0);
        let mut state = shared.lock();
        if count == 0 {
            state.ended = true;
        } else if let Err(error) = state.trace.line(line.trim_end()) {
            state.error.get_or_insert(error);
        }
        drop(state);
        // Waiting threads are woken only when no further complete line is buffered, because waking
        // them at every line would cost more than reading it.
        if count == 0 || !lines.buffer().contains(&b'\n') {
            shared.notify();
            if count == 0 {
                return;
            }
            thread::sleep(TRACE_PAUSE);
        }
    }
}

/// Reads the log until QEMU ends. Without a table the log is read and discarded, because QEMU would
/// block otherwise.
fn read_log(table: Option<&defmt_decoder::Table>, mut stdout: ChildStdout, shared: &Shared<State>) {
    match table {
        Some(table) => log::decode(table, stdout, |line| shared.lock().log.push(line)),
        None => {
            let mut nowhere = [0; 1024];
            while stdout.read(&mut nowhere).is_ok_and(|count| count > 0) {}
        }
    }
}
