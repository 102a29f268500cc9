//! The keys that a user may press while the plotter draws.
//!
//! While a [`Keyboard`] exists, the terminal hands over each key at once and shows none. Ctrl-C
//! still interrupts. The terminal is as before when the keyboard is dropped, or when the program
//! ends by Ctrl-C. There is no keyboard where the standard input or the standard error is no
//! terminal, or where another program has the terminal because this one runs in the background.

use crate::link::UserRequest;

/// What the keys do, for the user.
pub const KEYS: &str = "space pauses and goes on, + and - change the speed, in a pause u and d set \
                        the lowered pen higher or lower, q gives up";

/// A key that was pressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    /// Enter, which answers a question.
    Enter,
    /// A key with a request.
    Request(UserRequest),
}

impl Key {
    /// The key that sends this byte; `None` if it has no meaning.
    fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            b'\n' | b'\r' => Self::Enter,
            b' ' => Self::Request(UserRequest::Pause),
            b'+' => Self::Request(UserRequest::Faster),
            b'-' => Self::Request(UserRequest::Slower),
            b'u' | b'U' => Self::Request(UserRequest::PenHigher),
            b'd' | b'D' => Self::Request(UserRequest::PenLower),
            b'q' | b'Q' => Self::Request(UserRequest::GiveUp),
            _ => return None,
        })
    }
}

#[cfg(unix)]
mod terminal {
    use super::Key;
    use rustix::process::getpgrp;
    use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};
    use std::io::{IsTerminal as _, Read as _, stderr, stdin};
    use std::sync::mpsc::{self, Receiver};
    use std::sync::{Mutex, PoisonError};
    use std::thread;

    /// The modes of the terminal before they were changed.
    static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

    /// The keys of the terminal; see the [module](super).
    #[derive(Debug)]
    pub struct Keyboard {
        keys: Receiver<Key>,
    }

    impl Keyboard {
        /// Takes the keys of the terminal; `None` if there is no terminal, or another program has
        /// it.
        pub fn take() -> Option<Self> {
            if !stdin().is_terminal() || !stderr().is_terminal() {
                return None;
            }
            // The system stops a program in the background that changes the modes.
            if tcgetpgrp(stdin()).is_ok_and(|foreground| foreground != getpgrp()) {
                return None;
            }
            let before = tcgetattr(stdin()).ok()?;
            let mut modes = before.clone();
            modes.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
            *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
            if tcsetattr(stdin(), OptionalActions::Now, &modes).is_err() {
                restore();
                return None;
            }
            let (sender, keys) = mpsc::channel();
            // The thread waits for a key until the program ends.
            thread::spawn(move || {
                let is_heard = |byte: u8| Key::of(byte).is_none_or(|key| sender.send(key).is_ok());
                stdin().lock().bytes().map_while(Result::ok).all(is_heard)
            });
            Some(Self { keys })
        }

        /// The next key that was pressed, if any.
        pub fn key(&mut self) -> Option<Key> {
            self.keys.try_recv().ok()
        }
    }

    impl Drop for Keyboard {
        fn drop(&mut self) {
            restore();
        }
    }

    /// Gives the terminal back as it was.
    pub fn restore() {
        let before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(before) = before {
            // Nothing can be done about a terminal that is gone.
            let _ = tcsetattr(stdin(), OptionalActions::Now, &before);
        }
    }
}

#[cfg(windows)]
mod terminal {
    use super::Key;
    use crossterm::event::{Event, KeyCode, KeyEventKind, read};
    use std::io::{IsTerminal as _, stderr, stdin};
    use std::sync::mpsc::{self, Receiver};
    use std::thread;

    /// The keys of the console; see the [module](super). Its modes are left alone: who reads keys
    /// rather than lines gets them at once, and Ctrl-C interrupts.
    #[derive(Debug)]
    pub struct Keyboard {
        keys: Receiver<Key>,
    }

    impl Keyboard {
        /// Takes the keys of the console; `None` if there is none.
        pub fn take() -> Option<Self> {
            if !stdin().is_terminal() || !stderr().is_terminal() {
                return None;
            }
            let (sender, keys) = mpsc::channel();
            // The thread waits for a key until the program ends.
            thread::spawn(move || {
                while let Ok(event) = read() {
                    let key = pressed(&event).and_then(Key::of);
                    if key.is_some_and(|key| sender.send(key).is_err()) {
                        break;
                    }
                }
            });
            Some(Self { keys })
        }

        /// The next key that was pressed, if any.
        pub fn key(&mut self) -> Option<Key> {
            self.keys.try_recv().ok()
        }
    }

    /// Returns the byte of the key that was pressed, if the event is a key press.
    fn pressed(event: &Event) -> Option<u8> {
        let Event::Key(key) = event else { return None };
        match key.code {
            _ if key.kind == KeyEventKind::Release => None,
            KeyCode::Enter => Some(b'\n'),
            KeyCode::Char(letter) => u8::try_from(letter).ok(),
            _ => None,
        }
    }

    /// Nothing was changed.
    pub fn restore() {}
}

#[cfg(not(any(unix, windows)))]
compile_error!("there is no keyboard for this system");

pub use terminal::{Keyboard, restore};
