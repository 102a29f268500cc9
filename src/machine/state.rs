//! What the machine is doing: the states that others see, and the data that each of them needs.

use super::homing::Homing;
use super::{Axis, Target, Value};

/// What the machine is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// The machine is at rest and ready for a command.
    Idle,
    /// The machine draws a path, or moves that are sent one by one.
    Run,
    /// A feed hold: the machine slows down along the path, or it has stopped with the pen raised.
    Hold {
        /// Whether the machine has stopped. `false` while it still slows down.
        stopped: bool,
    },
    /// The machine slows down to cancel the job; [`State::Idle`] follows.
    Abort,
    /// The machine makes moves that the user commands by hand (jogging).
    Jog,
    /// The machine is homing: it searches for the limit switches.
    Home,
    /// Check mode: jobs are measured, but not drawn.
    Check,
    /// The machine has stopped because of an alarm. [`Machine::unlock`](super::Machine::unlock)
    /// ends the alarm.
    Alarm(Alarm),
    /// The motors are switched off. [`Machine::unlock`](super::Machine::unlock) ends this state.
    Sleep,
}

/// The reason for an alarm, in which the machine takes no moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Alarm {
    /// The emergency stop was pressed.
    EmergencyStop,
    /// A limit switch was pressed during a move.
    HardLimit,
    /// A line of G-code led beyond the travel. The moves before it are done, and the position is
    /// known.
    SoftLimit,
    /// The machine has just started and does not know its position.
    /// [`Machine::home`](super::Machine::home) finds the position.
    NotHomed,
    /// Homing did not find the switch of this axis, or the switch stayed pressed.
    HomingFailed(Axis),
    /// The queue refused an event although it had reported room. This is a bug in the firmware.
    Queue,
    /// The watchdog restarted the board. This is a bug in the firmware.
    Restarted,
}

/// The reasons why the machine refuses a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MachineError {
    /// The command is not allowed in this state.
    State(State),
    /// A target lies beyond the travel.
    BeyondTravel {
        /// The index of the target, counted from 0.
        target: u32,
        /// How far the target lies beyond the travel of x, in millimetres; negative if it lies
        /// below 0.
        x: Value,
        /// How far the target lies beyond the travel of y, in millimetres; negative if it lies
        /// below 0.
        y: Value,
    },
    /// A move is longer than the motion planner can plan: 16 m.
    MoveTooLong {
        /// The index of the target, counted from 0.
        target: u32,
    },
    /// A move is slower than [`SpeedLimit::LEAST_FEED`](crate::motion::SpeedLimit::LEAST_FEED).
    TooSlow,
}

/// What the machine is doing: a [`State`] with the data that only this state needs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Activity {
    /// The machine is at rest and ready for the next command.
    Idle,
    /// Draws a job, whose moves come from this source.
    Run(Source),
    /// Slows down or has stopped for a feed hold of a job.
    Hold {
        /// Whether the machine has come to rest.
        stopped: bool,
        /// Where the moves come from when the job continues.
        source: Source,
    },
    /// The machine slows down to cancel the job.
    Abort,
    /// Makes moves that the user commands by hand.
    Jog,
    /// The machine searches for the limit switches.
    Home(Homing),
    /// The machine only checks moves, and makes none.
    Check,
    /// The machine has stopped because of an alarm.
    Alarm(Alarm),
    /// The motors are off, or are about to be switched off.
    Sleep {
        /// Whether the motor drivers are still switched on.
        drivers_on: bool,
    },
}

/// Where the moves of a job come from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source {
    /// The moves come from a path that is being read.
    Path,
    /// From a path, which was read up to a change of the pen.
    PenChange {
        /// The number of the pen to be inserted, counted from 0.
        pen: u8,
        /// The first target to which the new pen draws.
        first: Target,
    },
    /// From a path whose next targets have not come yet. The machine is at rest with the pen
    /// raised.
    #[cfg(any(feature = "stream", feature = "early-ink"))]
    PendingTarget(super::PendingTarget),
    /// The moves come from a path that was read to its end.
    PathEnd,
    /// The moves are sent one by one.
    Stream,
}

impl Activity {
    /// Returns the state as others see it, without its data.
    #[inline(never)] // Inlining it at every call would cost too much flash.
    pub(super) const fn state(&self) -> State {
        match *self {
            Self::Idle => State::Idle,
            Self::Run(_) => State::Run,
            Self::Hold { stopped, .. } => State::Hold { stopped },
            Self::Abort => State::Abort,
            Self::Jog => State::Jog,
            Self::Home(_) => State::Home,
            Self::Check => State::Check,
            Self::Alarm(alarm) => State::Alarm(alarm),
            Self::Sleep { .. } => State::Sleep,
        }
    }

    /// Whether there is a job with a path that is still being read.
    pub(super) const fn reads_path(&self) -> bool {
        matches!(self, Self::Run(Source::Path) | Self::Hold { source: Source::Path, .. })
    }

    /// Whether there is a job whose moves are sent one by one.
    pub(super) const fn is_stream(&self) -> bool {
        matches!(self, Self::Run(Source::Stream) | Self::Hold { source: Source::Stream, .. })
    }

    /// Changes where the moves of the job come from. Without a job nothing happens.
    pub(super) const fn set_source(&mut self, new: Source) {
        if let Self::Run(source) | Self::Hold { source, .. } = self {
            *source = new;
        }
    }

    /// Whether the machine may still have moves to plan in this state.
    pub(super) const fn is_moving(&self) -> bool {
        match self {
            Self::Run(_) | Self::Hold { stopped: false, .. } | Self::Abort | Self::Jog => true,
            Self::Home(homing) => !homing.is_stopped,
            _ => false,
        }
    }
}
