//! Ctrl-C: at once, but for a plotter that must be stopped first.
//!
//! While a [`MovingPlotter`] lives, [`ctrl_c`] only sets the flag that [`Sender`](crate::sender::Sender)
//! looks at: the sender stops the machine with the pen up and ends the program. At every other place,
//! and at the second Ctrl-C, [`ctrl_c`] ends the program itself, whatever it computes or waits for.

use std::fs;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// What a shell says of a program that Ctrl-C ended.
pub const EXIT_CODE: u8 = 130;

static MOVING: AtomicUsize = AtomicUsize::new(0);
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// As long as it lives a plotter may be moving.
#[derive(Debug)]
pub struct MovingPlotter(());

impl MovingPlotter {
    /// From now on.
    pub fn new() -> Self {
        MOVING.fetch_add(1, Ordering::SeqCst);
        Self(())
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
    }
}

/// Does `work`, which writes `file` and renames it; if Ctrl-C ends the program meanwhile, no part of the
/// file stays.
pub fn while_unfinished<T>(file: &Path, work: impl FnOnce() -> T) -> T {
    let note = |file| *UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner) = file;
    note(Some(file.to_owned()));
    let result = work();
    note(None);
    result
}

/// What Ctrl-C does; `interrupt` is the flag that the sender looks at.
pub fn ctrl_c(interrupt: &AtomicBool) {
    let is_first = !interrupt.swap(true, Ordering::SeqCst);
    if is_first && MOVING.load(Ordering::SeqCst) > 0 {
        return;
    }
    // Kept to the end, so that no other file is begun.
    let unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(file) = &*unfinished {
        // It may have got its name just now.
        let _ = fs::remove_file(file);
    }
    let mut stderr = io::stderr();
    // In place of a progress bar.
    let clear = if stderr.is_terminal() { "\r\x1b[2K" } else { "" };
    let _ = writeln!(stderr, "{clear}penup: given up");
    std::process::exit(i32::from(EXIT_CODE));
}
