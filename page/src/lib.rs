//! The page: the plotter's own code in a browser.
//!
//! [`Sheet`] draws what a camera sees, fast enough to turn it. [`Board`] is an emulated plotter:
//! the firmware's own session behind a pipe of bytes. [`Session`] is the other end of such a pipe:
//! it sends a drawing to a plotter, emulated or real, and follows it. The module `options`
//! describes the controls, and files are read by the readers of the client.
//!
//! Nothing here reads a clock or waits. The front end in `page/www` passes bytes and time in, and
//! runs each of the three in a worker of its own, so that the page never freezes. Whatever is
//! refused comes back as a sentence for the user.

mod board;
mod delivery;
mod event;
mod number;
mod options;
mod phase;
mod session;
mod sheet;
mod source;
mod words;

pub use board::{Board, boards};
pub use options::{NamedValues, options, pages};
pub use session::Session;
pub use sheet::Sheet;
pub use source::needs_readers;

use std::sync::{Mutex, Once};
use wasm_bindgen::prelude::wasm_bindgen;

/// What the program said when it broke, if it has.
static FAULT: Mutex<String> = Mutex::new(String::new());

/// Notes from now on what the program says if it breaks, for [`fault`].
pub(crate) fn note_faults() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if let Ok(mut fault) = FAULT.lock() {
                *fault = panic.to_string();
            }
            print(panic);
        }));
    });
}

/// What the program said when it broke; empty if it has not.
#[wasm_bindgen]
pub fn fault() -> String {
    FAULT.lock().map(|fault| fault.clone()).unwrap_or_default()
}

/// The version of penup.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
