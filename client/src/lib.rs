//! What the `penup` command is made of: sending, emulating, previewing, picturing.
//!
//! In the order in which a job passes through: [`cli`] reads the command line, [`source`] the file,
//! [`job`] joins both into lines, [`sender`] sends them over a [`link`] and follows the plotter's
//! replies ([`protocol`], [`progress`]); behind the link are the plotters of [`machines`], an
//! [`emulator`] and the [`preview`] among them; [`picture`] shows what the pen did, [`output`] writes it.
//! [`tape`] keeps a job as single steps. [`words`] turns what the plotter says into this program's words.

pub mod cli;
pub mod emulator;
pub mod error;
pub mod fake;
pub mod interrupt;
pub mod job;
pub mod link;
pub mod machines;
pub mod output;
pub mod picture;
pub mod preview;
pub mod progress;
pub mod protocol;
pub mod run;
pub mod sender;
pub mod source;
pub mod tape;
pub mod twin;

pub mod fit;
pub mod watch;
pub mod words;
pub mod workspace;
