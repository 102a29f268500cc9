//! The library of the `penup` command, which sends files to a plotter, emulates plotters and
//! previews drawings.
//!
//! A job passes through the modules in this order. [`cli`] reads the command line, [`files`] has
//! the file read by [`penup_readers`], and a [`Job`](penup_job::Job) joins both into the lines to
//! send. [`plot`] draws it, by a plotter that computes it, or by strokes of this computer, as
//! [`compute`] chooses. [`sender`] sends these lines over a [`link`] and follows the plotter's
//! replies with [`penup_job::protocol`] and [`progress`]. Behind the link is a serial port, an
//! [`emulator`] of one of the [`machines`], or the [`preview`] in memory. [`penup_job::watch`]
//! follows the pen, [`penup_job::picture`] renders its path, [`png`] the image of that,
//! [`penup_job::export`] writes it for other machines, and [`output`] writes the files.
//! [`penup_job::results`] are what is known about a job afterwards.
//!
//! [`operate`] are the commands for the machine itself, [`ports`] finds it, [`rejoin`] waits for it
//! when it is gone, [`keyboard`] are the keys that act while it draws, and [`typed`] are the
//! answers where there are none. Every command returns an [`outcome`]. [`penup_job::notes`] tells
//! which options change nothing.
//!
//! [`serve`] serves the page to a browser, which [`bridge`] joins to a plotter. [`tape`] records a
//! job as single motor steps, and [`motion_plot`] plots its speed.

pub mod board;
pub mod bridge;
pub mod cli;
pub mod compute;
pub mod emulator;
pub mod error;
pub mod fake;
pub mod files;
pub mod fit;
pub mod interrupt;
pub mod keyboard;
pub mod link;
pub mod machines;
pub mod manual;
pub mod motion_plot;
pub mod operate;
pub mod outcome;
pub mod output;
pub mod planned;
pub mod plot;
pub mod png;
pub mod ports;
pub mod preview;
pub mod progress;
pub mod rejoin;
pub mod run;
pub mod sender;
pub mod serve;
pub mod stderr;
pub mod tape;
pub mod typed;
pub mod workspace;

use penup::board_table as table;
use penup_job::machine_settings;
