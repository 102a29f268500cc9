//! Speed profile with look-ahead; step events for the interrupt.
//!
//! The ordered drawing comes in as straight [`Block`]s. A [`Lookahead`] determines how fast each
//! junction may be passed, and a [`Profile`] plans the speed within one block. The [`Runner`] turns
//! both into [`StepEvent`]s, which wait in an [`EventQueue`] for the step interrupt.
//!
//! Speed is planned as *stopping distance*, v²/2a, in millimetres: a block of length L raises or
//! lowers it by at most L, and an arc of radius r allows r/2. So the look-ahead only adds and
//! compares lengths, exactly; a square root is taken when a block begins, if at all. When a block
//! is appended, what it allows is passed on to the blocks before it, so that nothing has to be
//! searched when a block begins. Within a block, time is divided into slices of [`SLICE_TICKS`], or
//! longer ones while the speed stays the same. The speed is constant within a slice, so its moves
//! are evenly spaced (a [`StepTrain`]), and every slice begins on the exact parabola.
//!
//! With a limit on jerk, another planner (`smooth`) takes over: at intervals it determines how far
//! the acceleration may rise such that all known limits ahead can still be kept.
//!
//! The pulses leave when the plan is half a step from the new position: the pins are never more
//! than half a step from where the plan is.
//!
//! Measured on a Cortex-M3, built for size, everything between target and queue included: 39
//! instructions for each event of a line at 100,000 moves a second, and 62 to 150 with a limit on
//! jerk; for chords of five moves at 5,000 a second 364, and 373 to 404. The step interrupt is not
//! counted in that. `cargo xtask bench --motion` counts both.
//!
//! The module `machine` is responsible for the limits of travel, the heights of the pen, and the
//! states.

mod brake;
mod course;
mod curvature;
mod emitter;
pub(crate) mod event;
mod junction;
mod lift;
mod limits;
mod long_move;
mod lookahead;
mod profile;
mod runner;
#[cfg(feature = "input-shaping")]
mod shaper;
#[cfg(feature = "input-shaping")]
mod shaping;
mod smooth;
mod speed_limit;
mod steady;

pub use brake::{Brake, BrakeOrders, BrakeRule, StepBrake, StepDistances, StepLength};
pub use emitter::Emitter;
pub use event::{EventKind, EventQueue, StepEvent, StepTrain};
pub use lift::LiftRule;
pub use limits::{Limits, LimitsError, MotionSettings};
pub use lookahead::{Block, Lookahead};
pub use profile::Profile;
#[cfg(feature = "pen-overlap")]
pub use runner::PenOverlap;
#[cfg(feature = "spread-backlash")]
pub use runner::{BacklashTakeUp, Reversal};
pub use runner::{Chord, Move, PenPositions, Progress, PushError, RunLengths, Runner};
#[cfg(feature = "input-shaping")]
pub use shaping::{Resonance, ShaperKind, Shaping};
pub use speed_limit::SpeedLimit;
pub use steady::SteadySpeed;

/// The unit of time of every step event: 40 ns. A divisor of both boards' clocks.
pub const TICKS_PER_SECOND: u32 = 25_000_000;

/// The speed changes at most once in this many ticks (164 µs), by at most acceleration times that.
pub const SLICE_TICKS: u32 = 4096;

/// A length along the path: 0 to 16384 mm in units of 2^-18 mm (4 nm).
pub type PathLength = ::fixed::types::U14F18;

/// A speed in millimetres per slice, below 1 (6.1 m/s), in units of 2^-32.
pub type SliceSpeed = ::fixed::types::U0F32;
