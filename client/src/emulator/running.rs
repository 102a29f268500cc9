//! A process that runs, and what the threads that read from it tell.

use std::process::{Child, ExitStatus};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use std::{fmt, io};

use super::EmulatorError;
use super::process::NOT_FOUND;

/// What reading threads tell, whole records or lines at a time.
#[derive(Default)]
pub struct Shared<S> {
    state: Mutex<S>,
    changed: Condvar,
}

impl<S> Shared<S> {
    /// A reader that panicked has left nothing half done.
    pub fn lock(&self) -> MutexGuard<'_, S> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits while `waits`, up to `patience`.
    pub fn wait_while(
        &self,
        patience: Duration,
        waits: impl FnMut(&mut S) -> bool,
    ) -> MutexGuard<'_, S> {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, waits);
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Wakes who waits.
    pub fn tell(&self) {
        self.changed.notify_all();
    }
}

/// A process and the threads that read what it prints. Dropping it ends them.
pub struct Running {
    child: Child,
    readers: Vec<JoinHandle<()>>,
}

impl Running {
    /// The threads end when the process does.
    pub fn new(child: Child, readers: Vec<JoinHandle<()>>) -> Self {
        Self { child, readers }
    }

    /// The process number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has ended by itself.
    ///
    /// # Errors
    /// [`EmulatorError::NotInstalled`] if that was because there is no such program.
    pub fn has_ended(&mut self, program: &'static str) -> Result<bool, EmulatorError> {
        let ended = self.child.try_wait()?;
        if ended.is_some_and(|status| status.code() == Some(NOT_FOUND)) {
            let source = io::ErrorKind::NotFound.into();
            return Err(EmulatorError::NotInstalled { program, source });
        }
        Ok(ended.is_some())
    }

    /// How it has ended by itself; `None` if it still runs.
    pub fn how_it_ended(&mut self) -> Option<ExitStatus> {
        // Its lines close a little before it has ended.
        for _ in 0..100 {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            thread::sleep(Duration::from_millis(5));
        }
        None
    }

    /// Ends it; all that it has said is in then.
    pub fn end(&mut self) {
        // Both fail only if it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
        for reader in self.readers.drain(..) {
            // A reader's panic has been printed, and there is nothing left to read.
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
