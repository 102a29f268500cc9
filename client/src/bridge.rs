//! Joins a page in a browser to a plotter at a serial port, or to an emulated board, for browsers
//! that cannot use a port themselves.
//!
//! The page speaks by a WebSocket. A binary message holds bytes of the serial line, in either
//! direction. A text message of the page is a [`PageRequest`] to an emulated board; one to the page
//! is `{"path":[…]}`, what the pins of that board have drawn, as [`SampledPath`] describes it.
//!
//! One page at a time holds the plotter; another is refused, and told so. The plotter's line stays
//! open while no page is there, and what it says meanwhile is dropped, so a page that comes back
//! rejoins a job that runs. A message that is too long, or that no page of penup sends, closes the
//! page's connection with the reason, and nothing of it reaches the plotter.
//!
//! [`SampledPath`]: penup_job::sampled::SampledPath

use crate::error::Error;
use crate::link::Link;
use crate::machines::WatchedPlotter;
use serde::Deserialize;
use std::io;
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TryRecvError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use tungstenite::error::{CapacityError, ProtocolError};
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Error as SocketError, Message, WebSocket};

/// The most bytes of a message of the page. It sends a few lines at a time.
const LONGEST_MESSAGE: usize = 4096;
/// The number of messages of the page that may wait for the plotter. When so many wait, the page
/// waits, too.
const WAITING_MESSAGES: usize = 64;
/// The time for which each side is waited for before the other one is served.
const TURN: Duration = Duration::from_millis(5);
/// The code with which a page is closed that came while another held the plotter. Codes from 4000
/// on are for programs to choose.
const TAKEN: u16 = 4000;
/// The code with which a page is closed because the line to the plotter broke.
const BROKEN: u16 = 4001;

/// The plotter at the far end of the bridge.
pub enum FarEnd {
    /// A plotter at a serial port.
    Port(Box<dyn Link>),
    /// An emulated board.
    Board(Box<dyn WatchedPlotter>),
}

impl FarEnd {
    fn link(&mut self) -> &mut dyn Link {
        match self {
            Self::Port(link) => link.as_mut(),
            Self::Board(board) => board.as_mut(),
        }
    }
}

/// Opens the plotter at the far end.
pub type Open = Box<dyn Fn() -> Result<FarEnd, Error> + Send + Sync>;

/// What a page asks of an emulated board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum PageRequest {
    /// The pen with this number, from 1, is in from now on: `{"pen":2}`.
    Pen(u8),
    /// Another drawing begins: `"begin"`.
    Begin,
}

/// The messages from the page to the plotter.
#[derive(Debug, PartialEq, Eq)]
enum ToPlotter {
    Bytes(Vec<u8>),
    Request(PageRequest),
}

/// The messages from the plotter to the page.
#[derive(Debug)]
enum ToPage {
    Bytes(Vec<u8>),
    Path(Vec<f32>),
    Broken(String),
}

/// Where the page listens that holds the plotter, if there is one.
type Listener = Arc<Mutex<Option<Sender<ToPage>>>>;

/// A bridge between a plotter and the page that holds it.
pub struct Bridge {
    open: Arc<Open>,
    line: Mutex<Line>,
    listener: Listener,
    is_taken: AtomicBool,
}

/// The thread that has the plotter's line open.
struct Line {
    thread: JoinHandle<()>,
    to_plotter: SyncSender<ToPlotter>,
}

impl Bridge {
    /// Opens the plotter's line.
    ///
    /// # Errors
    /// That of `open`.
    pub fn new(open: Open) -> Result<Self, Error> {
        let (open, listener) = (Arc::new(open), Listener::default());
        let line = Mutex::new(Line::open(&open, &listener)?);
        Ok(Self { open, line, listener, is_taken: AtomicBool::new(false) })
    }

    /// Serves a page that has asked for a WebSocket and was answered; `tail` is what came behind
    /// its request. Returns when the page has gone or was refused.
    pub fn serve(&self, stream: TcpStream, tail: Vec<u8>) -> io::Result<()> {
        stream.set_read_timeout(Some(TURN))?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE));
        let mut socket = WebSocket::from_partially_read(stream, tail, Role::Server, Some(config));
        let (code, reason) = match self.converse(&mut socket) {
            Ok(()) => return Ok(()),
            Err(refusal) => refusal,
        };
        let frame = CloseFrame { code, reason: reason.into() };
        let closed = socket.close(Some(frame)).and_then(|()| {
            // The rest of the refused data is read, because otherwise closing would discard the
            // reason before the page receives it.
            let stream = socket.get_mut();
            stream.set_read_timeout(Some(Duration::from_secs(2)))?;
            io::copy(stream, &mut io::sink())?;
            Ok(())
        });
        // A page that has gone misses nothing.
        drop(closed);
        Ok(())
    }

    /// Hands messages on between the plotter and a page until the page goes.
    ///
    /// # Errors
    /// The page is refused, with this code and this reason.
    fn converse(&self, socket: &mut WebSocket<TcpStream>) -> Result<(), (CloseCode, String)> {
        let refused = |code: u16, reason: &str| Err((code.into(), reason.to_owned()));
        let taken = "Another page holds the plotter: close that page, then connect again.";
        let Some(_seat) = PageLock::take(self) else { return refused(TAKEN, taken) };
        let (to_plotter, from_plotter) = match self.line() {
            Ok(line) => line,
            Err(error) => return refused(BROKEN, &shortened(&error.to_string())),
        };
        loop {
            loop {
                let message = match from_plotter.try_recv() {
                    Ok(ToPage::Bytes(bytes)) => Message::binary(bytes),
                    Ok(ToPage::Path(path)) => {
                        Message::text(serde_json::json!({ "path": path }).to_string())
                    }
                    Ok(ToPage::Broken(reason)) => return refused(BROKEN, &shortened(&reason)),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        return refused(BROKEN, "The line to the plotter is closed.");
                    }
                };
                if socket.send(message).is_err() {
                    return Ok(());
                }
            }
            let sent = match socket.read() {
                Ok(Message::Binary(bytes)) => match bytes.iter().all(|byte| is_sent(*byte)) {
                    true => ToPlotter::Bytes(bytes.into()),
                    false => {
                        let reason = "These bytes are no lines for a plotter: nothing was sent.";
                        return refused(CloseCode::Unsupported.into(), reason);
                    }
                },
                Ok(Message::Text(text)) => match serde_json::from_str(&text) {
                    Ok(request) => ToPlotter::Request(request),
                    Err(_) => {
                        let reason = "This text is no order for a plotter: nothing was done.";
                        return refused(CloseCode::Unsupported.into(), reason);
                    }
                },
                Ok(Message::Close(_)) => return Ok(()),
                Ok(_) => continue,
                Err(SocketError::Io(error)) if is_timeout(&error) => continue,
                Err(SocketError::Capacity(CapacityError::MessageTooLong { size, .. })) => {
                    let reason = format!(
                        "A message of {size} bytes is too long: {LONGEST_MESSAGE} are taken. \
                         Nothing was sent."
                    );
                    return Err((CloseCode::Size, reason));
                }
                Err(SocketError::Protocol(ProtocolError::ResetWithoutClosingHandshake)) => {
                    return Ok(());
                }
                Err(SocketError::Protocol(_) | SocketError::Utf8(_)) => {
                    return refused(CloseCode::Protocol.into(), "This is no WebSocket message.");
                }
                Err(_) => return Ok(()),
            };
            if to_plotter.send(sent).is_err() {
                // The reason has come, or comes at once.
                thread::sleep(TURN);
            }
        }
    }

    /// Both ends of the plotter's line, which is opened again if it broke.
    fn line(&self) -> Result<(SyncSender<ToPlotter>, Receiver<ToPage>), Error> {
        let (sender, receiver) = mpsc::channel();
        let mut line = locked(&self.line);
        if line.thread.is_finished() {
            *line = Line::open(&self.open, &self.listener)?;
        }
        *locked(&self.listener) = Some(sender);
        Ok((line.to_plotter.clone(), receiver))
    }
}

impl Line {
    /// Opens the plotter's line in a thread of its own: an emulator ends with the thread that
    /// started it.
    fn open(open: &Arc<Open>, listener: &Listener) -> Result<Self, Error> {
        let (to_plotter, messages) = mpsc::sync_channel(WAITING_MESSAGES);
        let (opened, is_open) = mpsc::channel();
        let (open, listener) = (Arc::clone(open), Arc::clone(listener));
        let thread = thread::spawn(move || match open() {
            Ok(mut far) => {
                // Whoever opens it waits for the answer.
                let _ = opened.send(Ok(()));
                let reason = carry(&mut far, &messages, &listener);
                tell(&listener, ToPage::Broken(reason));
            }
            Err(error) => {
                let _ = opened.send(Err(error));
            }
        });
        let reason = || Error::PageNotServed { reason: "its thread ended".to_owned() };
        is_open.recv().unwrap_or_else(|_| Err(reason()))?;
        Ok(Self { thread, to_plotter })
    }
}

/// Carries bytes in both directions until the line breaks. Returns why it broke.
fn carry(far: &mut FarEnd, messages: &Receiver<ToPlotter>, listener: &Listener) -> String {
    let mut buffer = [0; 4096];
    loop {
        let mut turn = || -> Result<bool, Error> {
            loop {
                match messages.try_recv() {
                    Ok(ToPlotter::Bytes(bytes)) => {
                        far.link().send(&bytes).map_err(Error::Link)?;
                    }
                    Ok(ToPlotter::Request(request)) => {
                        if let FarEnd::Board(board) = far {
                            match request {
                                PageRequest::Pen(pen) => {
                                    board.change_pen(pen).map_err(Error::Link)?;
                                }
                                PageRequest::Begin => board.begin_again()?,
                            }
                        }
                    }
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return Ok(false),
                }
            }
            let count = far.link().receive(&mut buffer, TURN).map_err(Error::Link)?;
            if let FarEnd::Board(board) = far {
                let path = board.take_path()?;
                if !path.is_empty() {
                    tell(listener, ToPage::Path(path));
                }
            }
            if count > 0 {
                tell(listener, ToPage::Bytes(buffer.get(..count).unwrap_or_default().to_vec()));
            }
            Ok(true)
        };
        match turn() {
            Ok(true) => {}
            Ok(false) => return "The bridge is closed.".to_owned(),
            Err(error) => {
                let error = match far {
                    FarEnd::Board(board) => board.explain(error),
                    FarEnd::Port(_) => error,
                };
                return error.to_string();
            }
        }
    }
}

/// Sends news to the page that holds the plotter. Without a page, they are dropped.
fn tell(listener: &Listener, news: ToPage) {
    if let Some(page) = locked(listener).as_ref() {
        let _ = page.send(news);
    }
}

/// Marks the plotter as held by a page. Dropping it releases the plotter.
struct PageLock<'a>(&'a Bridge);

impl<'a> PageLock<'a> {
    fn take(bridge: &'a Bridge) -> Option<Self> {
        let was_taken = bridge.is_taken.swap(true, Ordering::SeqCst);
        // This must not be `then_some`, which would drop the lock, and so release the plotter, if
        // another page holds it.
        (!was_taken).then(|| Self(bridge))
    }
}

impl Drop for PageLock<'_> {
    fn drop(&mut self) {
        *locked(&self.0.listener) = None;
        self.0.is_taken.store(false, Ordering::SeqCst);
    }
}

impl std::fmt::Debug for Bridge {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Bridge").field("is_taken", &self.is_taken).finish_non_exhaustive()
    }
}

/// A page never sends other bytes: text, ends of lines, ctrl-X and what acts at once.
fn is_sent(byte: u8) -> bool {
    matches!(byte, b'\t' | b'\n' | b'\r' | 0x18 | b' '..=b'~' | 0x80..=0xFD)
}

fn is_timeout(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

/// A close frame has room for 123 bytes.
fn shortened(reason: &str) -> String {
    let reason = reason.replace('\n', " ");
    let cut = (0..=reason.len().min(120)).rev().find(|&at| reason.is_char_boundary(at));
    match reason.get(..cut.unwrap_or(0)) {
        Some(beginning) if beginning.len() < reason.len() => format!("{beginning}…"),
        _ => reason,
    }
}

/// A thread that panicked leaves nothing half changed here.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
