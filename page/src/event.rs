//! What a session tells its user.

use serde::Serialize;

/// Something that the user should see.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Event {
    /// What the session is doing: `closed`, `finding`, `ready`, `sending`, `computing`, `drawing`,
    /// or `alarm`.
    Phase { name: &'static str },
    /// So many lines of the drawing have arrived.
    Sent { done: usize, all: usize },
    /// The plotter's state, the position of the pen in mm, the strokes begun and all, the length
    /// of ink drawn and all in mm, and the seconds left.
    Status {
        state: String,
        position: Vec<f64>,
        strokes: Option<(u64, u64)>,
        ink: Option<(f64, f64)>,
        left: Option<f64>,
        /// The speeds in percent of those in the settings.
        percent: u16,
        /// Whether the machine is at rest in a hold, and not because it waits for a pen: the user
        /// holds it, or its pen needs ink.
        is_held: bool,
        /// The strokes done and all of a job that has stopped and can go on.
        stopped: Option<(u64, u64)>,
    },
    /// The plotter waits for this pen.
    Pen { pen: u8 },
    /// A message of the plotter.
    Note { text: String },
    /// What was begun has failed, and what to do about it.
    Failed { text: String },
    /// The user has given the drawing up; the pen is up.
    Stopped,
    /// The drawing is done, and this many strokes and mm were drawn.
    Drawn { report: Option<String> },
    /// The answer to a question, such as a list of settings.
    Reply { text: String },
}
