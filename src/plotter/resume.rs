//! Jobs that go on where a loss of power, a reset or a fault has stopped them: `$resume`.
//!
//! The strokes of a job are kept before the pen moves (`records`). While they are drawn, the
//! board keeps how many are done, and what the drawing depends on: the version of the firmware, the
//! settings that decide where ink falls, and the model. If one of these has changed, the job is not
//! continued, because its parts would not fit together.
//!
//! Of a job that a computer sends while it is drawn, the strokes are not kept, but how many of them
//! are drawn and by which number its sender knows it. `$stream` tells both, so that the sender can
//! go on there.
//!
//! Of a drawing that is computed and drawn part by part, what it is computed from is kept, and how
//! many strokes are drawn. Its parts are computed again, and those that are drawn are left out.
//!
//! After a restart the machine does not know where the pen is. It must be homed, or the user puts
//! the pen at the origin by hand and says so. A job that began at an origin set by hand does not go
//! on in the coordinates of a machine that has been homed since: they begin elsewhere.
//!
//! Without the feature `resume` nothing of this takes space in an image.

#[cfg(feature = "resume")]
mod with_feature;
#[cfg(not(feature = "resume"))]
mod without_feature;

#[cfg(feature = "resume")]
pub(super) use with_feature::StoppedJob;
#[cfg(feature = "tiles")]
pub(super) use with_feature::{KeptParts, are_noted_at_once};

/// What is known of a job that can be resumed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Resumption {
    /// How many strokes of the kept job are drawn, and how many there are: `u32::MAX` as long as
    /// that is not known. `None` if there is no job of which that is kept.
    #[cfg(feature = "resume")]
    progress: Option<[u32; 2]>,
    /// How many strokes are noted at once, less one: more than one stroke in jobs that are sent
    /// and have more strokes than the flash notes.
    #[cfg(feature = "resume")]
    more_at_once: u32,
    /// Whether the strokes of the job are sent, so that its sender has the rest.
    #[cfg(feature = "resume")]
    is_sent: bool,
    /// The number of strokes that were drawn before the job was resumed, of a job that is sent or
    /// that is computed part by part.
    #[cfg(feature = "resume")]
    drawn_before: u32,
    /// Whether the job is computed part by part.
    #[cfg(feature = "tiles")]
    in_parts: bool,
    /// How the plotter knows where the pen is.
    #[cfg(feature = "resume")]
    origin: Origin,
}

/// How the plotter knows where the pen is, and thus from where it counts coordinates.
#[cfg(feature = "resume")]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Origin {
    /// The user has put the pen at the origin, or has drawn from where it was.
    #[default]
    ByHand,
    /// The machine has been homed with settings of this checksum ([`with_feature`]).
    Homed(u32),
    /// Nobody has told it since a start, an alarm or `$SLP`.
    Lost,
}
