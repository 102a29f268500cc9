//! penup is the firmware of a pen plotter that does the thinking itself.
//!
//! A computer sends it a solid, a frame of bars, a curve or a line drawing over a serial line. On
//! the microcontroller it projects the model, removes the hidden lines, chooses the pen-up moves,
//! orders the strokes, plans the speed, and pulses the stepper motors and the pen. It needs no
//! heap, it decides nothing in floating point, and it gives the same bits on every machine.
//!
//! The modules are listed in the order in which the data passes through them. A module uses only
//! modules that are listed above it.
//!
//! # Examples
//! Each stage can be used by itself. It borrows its working memory from the caller, and it asks the
//! caller at short intervals whether it is to end. This orders the two parts of a drawing so that
//! the pen is lifted once:
//!
//! ```
//! use penup::drawing::{Drawing, PagePoint, Segment};
//! use penup::order::{Leg, Options, order};
//! use penup::stage::{NeverCancel, Scratch};
//!
//! let points = [(0, 0), (800, 0), (0, 400), (800, 400)].map(|(x, y)| PagePoint { x, y });
//! let segments = [[0, 1], [2, 3]].map(|[from, to]| Segment::new(from, to));
//! let drawing = Drawing { points: &points, segments: &segments };
//!
//! let mut memory = vec![0; 1024];
//! let mut tour = [Leg::new(0u16, false); 2];
//! let scratch = Scratch::new(&mut memory);
//! let report = order(drawing, Options::default(), scratch, &mut NeverCancel, &mut tour)?;
//!
//! assert_eq!(report.lifts, 1);
//! assert_eq!(report.pen_up, 256 * 400); // in 1/256 of a motor step
//! assert_ne!(tour[0].reversed(), tour[1].reversed());
//! # Ok::<(), penup::order::OrderError>(())
//! ```
//!
//! The folder `examples` has three more: `hidden_lines` draws a cube as an SVG, `order_drawing`
//! prints the strokes of a drawing in their order, `plan_path` plans the motion along a path.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "host"))]
extern crate std;

pub mod array;
pub mod board_table;
pub mod byte_queue;
pub mod checksum;
pub mod fixed;
pub mod host_only;
pub mod index;
pub mod stage;
mod text;

pub mod storage;
pub mod geometry;
pub mod curve;
pub mod model;
pub mod view;
pub mod visibility;
#[cfg(feature = "tiles")]
pub mod tiles;
pub mod convex;
pub mod drawing;
pub mod order;
pub mod step;
pub mod motion;
pub mod machine;
#[cfg(feature = "hpgl")]
pub mod hpgl;
pub mod protocol;
pub mod plotter;

/// The board made of plain memory. The code of those made of silicon belongs to the firmware
/// binary.
pub mod boards {
    #[cfg(feature = "host")]
    pub mod host;
}
