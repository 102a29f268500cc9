//! A running child process, and the state that its reader threads share with it.

use std::path::Path;
use std::process::{Child, Command, ExitStatus};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{fmt, io};

use super::EmulatorError;

/// The exit code of setpriv, as of a shell, if there is no such program.
const NOT_FOUND: i32 = 127;

/// Creates a command that on Linux the kernel kills when the thread that started it ends.
pub fn quitting_with_parent(program: &str) -> Command {
    const SETPRIV: &str = "/usr/bin/setpriv";
    if cfg!(target_os = "linux") && Path::new(SETPRIV).exists() {
        let mut command = Command::new(SETPRIV);
        command.args(["--pdeathsig", "KILL", program]);
        return command;
    }
    Command::new(program)
}

/// State that reader threads update with whole records or lines, and that other threads can wait
/// for.
#[derive(Default)]
pub struct Shared<S> {
    state: Mutex<S>,
    changed: Condvar,
}

impl<S> Shared<S> {
    /// Locks the state. A poisoned lock is accepted, because a reader that panicked leaves no
    /// partial update.
    pub fn lock(&self) -> MutexGuard<'_, S> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits while `waits` returns true, but at most for `timeout`, and returns the locked state.
    pub fn wait_while(
        &self,
        timeout: Duration,
        waits: impl FnMut(&mut S) -> bool,
    ) -> MutexGuard<'_, S> {
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, waits);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Wakes all waiting threads.
    pub fn notify(&self) {
        self.changed.notify_all();
    }
}

/// A process and the threads that read its output. Dropping this ends the process.
pub struct Running {
    child: Child,
    readers: Vec<JoinHandle<()>>,
}

impl Running {
    /// Takes over `child` and its `readers`. These threads must end when the process does.
    pub fn new(child: Child, readers: Vec<JoinHandle<()>>) -> Self {
        Self { child, readers }
    }

    /// The process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether the process has ended by itself.
    ///
    /// # Errors
    /// [`EmulatorError::NotInstalled`] if it ended because there is no such program.
    pub fn has_ended(&mut self, program: &'static str) -> Result<bool, EmulatorError> {
        let ended = self.child.try_wait()?;
        if ended.is_some_and(|status| status.code() == Some(NOT_FOUND)) {
            let source = io::ErrorKind::NotFound.into();
            return Err(EmulatorError::NotInstalled { program, source });
        }
        Ok(ended.is_some())
    }

    /// The exit status of a process that ended by itself; `None` if it still runs after half a
    /// second.
    pub fn how_it_ended(&mut self) -> Option<ExitStatus> {
        // The pipes and sockets of a process close shortly before it has ended.
        for _ in 0..100 {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            thread::sleep(Duration::from_millis(5));
        }
        None
    }

    /// Ends the process and waits until all its output has been read.
    pub fn end(&mut self) {
        // Both calls fail only if the process has already ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
        for reader in self.readers.drain(..) {
            // If a reader panicked, the panic was already printed and there is nothing left to
            // read.
            let _ = reader.join();
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}

impl fmt::Debug for Running {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Running").field(&self.id()).finish()
    }
}
