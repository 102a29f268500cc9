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
//! [`tape`] records a job as single motor steps, and [`motion_plot`] plots its speed. [`words`]
//! translates the plotter's messages into the terms of the command line.

pub mod board;
pub mod cli;
pub mod emulator;
pub mod error;
pub mod fake;
pub mod fit;
pub mod formats;
pub mod interrupt;
pub mod keyboard;
pub mod job;
pub mod lines;
pub mod link;
pub mod machine_settings;
pub mod machines;
pub mod manual;
pub mod motion_plot;
pub mod operate;
pub mod outcome;
pub mod output;
pub mod page;
pub mod picture;
pub mod ports;
pub mod preview;
pub mod progress;
pub mod protocol;
pub mod results;
pub mod room;
pub mod run;
pub mod sender;
pub mod tape;
pub mod twin;
pub mod watch;
pub mod words;
pub mod workspace;

use penup::board_table as table;
