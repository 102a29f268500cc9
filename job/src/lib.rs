//! What a program on a computer and the page in a browser share about a job: what is sent to a
//! plotter, what the plotter answers, and what it then draws.
//!
//! A [`Job`] joins the lines of a file and the [`Settings`] into the lines to send. [`protocol`]
//! has the words of the serial line, and reads the replies. [`user_choices`] turns the choices of
//! the user and the properties of a file into settings, and [`view`] says from where a model is
//! seen. [`notes`] tells what is drawn otherwise than the file says, and which options do nothing.
//! [`twin`] computes what the plotter must then contain, and [`room`] the memory that takes.
//! [`machine_settings`] makes the machine that a computer simulates, and [`pen_lines`] tells what
//! lowers the pen of a machine. [`streamed`] makes lines of what this computer has computed, and
//! [`relooped`] lets their closed strokes begin elsewhere.
//! [`pins`] and [`watch`] follow the pen to its [`path`], whose steps [`straight`] makes lines of,
//! and of which [`sampled`] keeps what a page shows. [`strokes`] and [`results`] tell what was
//! drawn, [`picture`] shows it, and [`export`] writes it for other machines.
//!
//! Nothing here opens a file or a port, starts a thread, or reads a clock.

pub mod export;
mod job;
pub mod machine_settings;
pub mod notes;
pub mod path;
pub mod picture;
pub mod pen_lines;
pub mod pins;
pub mod protocol;
#[cfg(feature = "stream")]
pub mod relooped;
pub mod results;
pub mod room;
pub mod sampled;
pub mod straight;
#[cfg(feature = "stream")]
pub mod streamed;
pub mod strokes;
pub mod twin;
pub mod view;
pub mod watch;
pub mod user_choices;

pub use job::{Job, Settings};
