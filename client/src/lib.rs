//! The library of the `penup` command, which sends files to a plotter, emulates plotters and
//! previews drawings.
//!
//! A job passes through the modules in this order. [`cli`] reads the command line, [`formats`]
//! reads the file, and [`job`] joins both into the [`lines`] to send. [`sender`] sends these lines
//! over a [`link`] and follows the plotter's replies with [`protocol`] and [`progress`]. Behind the
//! link is a serial port, an [`emulator`] of one of the [`machines`], or the [`preview`] in memory.
//! [`watch`] follows the pen, [`picture`] renders its path on the [`page`], and [`output`] writes
//! the files. [`results`] are what is known about a job afterwards.
//!
//! [`operate`] are the commands for the machine itself, [`ports`] finds it, and [`keyboard`] are
//! the keys that act while it draws. Every command returns an [`outcome`].
//!
//! [`serve`] serves the page to a browser. [`tape`] records a job as single motor steps, and
//! [`motion_plot`] plots its speed. [`words`] translates the plotter's messages into the terms of
//! the command line.

#[cfg(feature = "native")]
pub mod board;
#[cfg(feature = "native")]
pub mod cli;
#[cfg(feature = "native")]
pub mod emulator;
#[cfg(feature = "native")]
pub mod error;
#[cfg(feature = "native")]
pub mod fake;
#[cfg(feature = "native")]
pub mod fit;
pub mod formats;
#[cfg(feature = "native")]
pub mod interrupt;
#[cfg(feature = "native")]
pub mod keyboard;
pub mod job;
pub mod lines;
#[cfg(feature = "native")]
pub mod link;
#[cfg(feature = "native")]
pub mod machine_settings;
#[cfg(feature = "native")]
pub mod machines;
#[cfg(feature = "native")]
pub mod manual;
pub mod motion_plot;
#[cfg(feature = "native")]
pub mod operate;
#[cfg(feature = "native")]
pub mod outcome;
#[cfg(feature = "native")]
pub mod output;
pub mod page;
pub mod picture;
pub mod pins;
#[cfg(feature = "native")]
pub mod ports;
#[cfg(feature = "native")]
pub mod preview;
#[cfg(feature = "native")]
pub mod progress;
pub mod protocol;
pub mod results;
pub mod room;
#[cfg(feature = "native")]
pub mod run;
#[cfg(feature = "native")]
pub mod sender;
#[cfg(feature = "native")]
pub mod serve;
pub mod strokes;
#[cfg(feature = "native")]
pub mod tape;
pub mod twin;
pub mod watch;
pub mod words;
#[cfg(feature = "native")]
pub mod workspace;

#[cfg(feature = "native")]
use penup::board_table as table;
