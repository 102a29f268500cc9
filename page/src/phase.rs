//! What a session is doing.

/// What the session is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// There is no line to a plotter.
    Closed,
    /// Waits for a status.
    Finding,
    /// Waits for the greeting after ctrl-X.
    Greeting,
    /// Waits until line numbers begin.
    Numbering,
    /// Has nothing to do.
    Ready,
    /// Follows a job that somebody else began.
    Watching,
    /// The machine has an alarm, and waits for the user.
    Alarm,
    /// Delivers the lines of the drawing.
    Sending,
    /// Asks for the checksums of model and options.
    Comparing,
    /// Waits until the drawing is computed and begins.
    Starting,
    /// Follows the drawing.
    Drawing,
    /// Asks for the report on it.
    Reporting,
    /// Asks for the settings that tell what lowers the pen by hand.
    Asking,
    /// Delivers a line that the user sent by hand.
    Commanding,
}

impl Phase {
    /// The name by which the user knows the phase; `None` if it lasts a moment only.
    pub fn name(self) -> Option<&'static str> {
        Some(match self {
            Phase::Closed => "closed",
            Phase::Finding | Phase::Greeting | Phase::Numbering => "finding",
            Phase::Ready => "ready",
            Phase::Alarm => "alarm",
            Phase::Sending | Phase::Comparing => "sending",
            Phase::Starting => "computing",
            Phase::Drawing | Phase::Watching => "drawing",
            Phase::Reporting | Phase::Asking | Phase::Commanding => return None,
        })
    }
}
