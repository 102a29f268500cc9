//! An emulated Raspberry Pi Pico at a pseudo-terminal, so that the client's own commands use it as
//! a plotter at a serial port.

use penup_client::emulator::{EmulatedBoard, Pico};
use serialport::{SerialPort as _, TTYPort};
use std::io::{self, Read as _, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// A Pico at the other end of a pseudo-terminal. The terminal stays while the board loses its
/// power, as that of an adapter does that the computer supplies.
pub struct PicoTerminal {
    /// The name of the terminal, for `--port`.
    pub device: String,
    board: Arc<Mutex<Pico>>,
    is_over: Arc<AtomicBool>,
    pump: Option<JoinHandle<io::Result<()>>>,
}

impl PicoTerminal {
    /// Connects a board that has started.
    ///
    /// # Errors
    /// There is no pseudo-terminal.
    pub fn new(board: Pico) -> io::Result<Self> {
        let (mut wire, terminal) = TTYPort::pair()?;
        wire.set_timeout(Duration::from_millis(1))?;
        let device = terminal.name().ok_or_else(|| io::Error::other("no name"))?;
        // Only one may hold it: the client.
        drop(terminal);
        let board = Arc::new(Mutex::new(board));
        let is_over = Arc::new(AtomicBool::new(false));
        let (served, over) = (Arc::clone(&board), Arc::clone(&is_over));
        let pump = thread::spawn(move || {
            let mut buffer = [0; 256];
            while !over.load(Ordering::Relaxed) {
                // An error says that no program holds the other end.
                let count = wire.read(&mut buffer).unwrap_or(0);
                let bytes = buffer.get(..count).unwrap_or_default().to_vec();
                let mut board = lock(&served);
                board.send(&bytes)?;
                let count = board.receive(&mut buffer, Duration::from_millis(1))?;
                drop(board);
                // So does this one: then nobody listens.
                let _ = wire.write_all(buffer.get(..count).unwrap_or_default());
            }
            Ok(())
        });
        Ok(Self { device, board, is_over, pump: Some(pump) })
    }

    /// The board, which hears and says nothing as long as this is held.
    pub fn board(&self) -> MutexGuard<'_, Pico> {
        lock(&self.board)
    }
}

fn lock(board: &Mutex<Pico>) -> MutexGuard<'_, Pico> {
    board.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for PicoTerminal {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(pump) = self.pump.take() {
            // What went wrong there was seen by the client.
            let _ = pump.join();
        }
    }
}
