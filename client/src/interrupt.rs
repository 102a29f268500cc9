//! Handling of Ctrl-C, which ends the program at once unless a plotter must be stopped first.
//!
//! While a [`MovingPlotter`] exists, the first Ctrl-C only sets a flag.
//! [`Sender`](crate::sender::Sender) polls this flag, stops the machine with the pen up and makes
//! the program end with an error. At any other time, and at the second Ctrl-C, [`ctrl_c`] exits the
//! process itself, even in the middle of a computation or a wait.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The exit code that shells report for a program that Ctrl-C ended.
pub const EXIT_CODE: u8 = 130;

static MOVING: AtomicUsize = AtomicUsize::new(0);
/// How many of them guard an emulated plotter, which ends with the program.
static EMULATED: AtomicUsize = AtomicUsize::new(0);
/// The file that is being written and is deleted if the program ends early.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// A guard: while at least one exists, a plotter may be moving and must be stopped before the
/// program ends.
#[derive(Debug)]
pub struct MovingPlotter {
    is_emulated: bool,
}

impl MovingPlotter {
    /// Marks a plotter as possibly moving until the guard is dropped.
    pub fn new() -> Self {
        MOVING.fetch_add(1, Ordering::SeqCst);
        Self { is_emulated: false }
    }

    /// Does the same for an emulated plotter.
    pub fn emulated() -> Self {
        EMULATED.fetch_add(1, Ordering::SeqCst);
        MOVING.fetch_add(1, Ordering::SeqCst);
        Self { is_emulated: true }
    }
}

impl Default for MovingPlotter {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for MovingPlotter {
    fn drop(&mut self) {
        MOVING.fetch_sub(1, Ordering::SeqCst);
        if self.is_emulated {
            EMULATED.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

/// Runs `work`, which writes the temporary `file` and then renames or removes it. If Ctrl-C ends
/// the program meanwhile, the temporary file is deleted.
pub fn while_unfinished<T>(file: &Path, work: impl FnOnce() -> T) -> T {
    let note = |file| *UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner) = file;
    note(Some(file.to_owned()));
    let result = work();
    note(None);
    result
}

/// The handler of Ctrl-C. `interrupt` is the flag that the sender polls. If the user wants quiet,
/// it does not say that a plotter is being stopped.
pub fn ctrl_c(interrupt: &AtomicBool, is_quiet: bool) {
    let is_first = !interrupt.swap(true, Ordering::SeqCst);
    let moving = MOVING.load(Ordering::SeqCst);
    let is_real = moving > EMULATED.load(Ordering::SeqCst);
    if is_first && moving > 0 {
        if is_real && !is_quiet {
            crate::stderr::say("penup: stopping the plotter; Ctrl-C again does not wait for that");
        }
        return;
    }
    // The lock is held until the process exits, so that no other file can be started.
    let unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(file) = &*unfinished {
        // The error is ignored: the file may just have been renamed.
        let _ = fs::remove_file(file);
    }
    crate::keyboard::restore();
    crate::stderr::say(match is_real {
        true => {
            "penup: given up, without waiting until the plotter stopped: it may still be moving\n\
             Look after it: `penup status` says what it does, and `penup abort` stops it"
        }
        false => "penup: ended by Ctrl-C",
    });
    std::process::exit(i32::from(EXIT_CODE));
}
