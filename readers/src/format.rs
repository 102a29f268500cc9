//! What each file format implements.

use super::error::ReadError;
use crate::arrange::Arrangement;
use crate::lines::Lines;
use crate::page::Page;
use crate::plan::Plan;
use std::fmt::Debug;

/// The size in bytes from which a file is refused, whatever its format. At 11 kB/s it would take
/// days to send.
pub const SIZE_LIMIT: u64 = 1 << 32;

/// The drawing in a file.
#[derive(Debug)]
pub(super) enum Body {
    /// The lines that are sent.
    Lines(Box<dyn Lines + Send>),
    #[cfg_attr(not(feature = "plans"), allow(dead_code, reason = "no format is a plan"))]
    /// A plan, of which the lines are made once it is arranged.
    Plan(Plan),
}

/// The contents of a file.
#[derive(Debug)]
pub(super) struct Contents {
    /// What is drawn.
    pub(super) body: Body,
    /// The page on which the file lays its plan; `None` if the file has no page.
    pub(super) page: Option<Page>,
    /// The least and the greatest x and y, in mm, of lines that form a plan; `None` if they form
    /// none.
    pub(super) bounds: Option<[[f64; 2]; 2]>,
    /// Sentences for the user about what is not drawn as the file says, without a full stop.
    pub(super) notes: Vec<String>,
}

impl Contents {
    /// The contents of a file that holds nothing but `lines`.
    pub(super) fn of(lines: impl Lines + Send + 'static) -> Self {
        Self { body: Body::Lines(Box::new(lines)), page: None, bounds: None, notes: Vec::new() }
    }
}

/// A file format.
pub(super) trait Format: Debug + Sync {
    /// The name of the format in messages, for example `Wavefront OBJ`.
    fn name(&self) -> &'static str;

    /// The extensions of the names of such files, in lower case and without the dot.
    fn extensions(&self) -> &'static [&'static str];

    /// Whether a file with this `beginning` has this format. The beginning is the whole file, or
    /// its first 64 KiB. It is asked only where the extension leaves the format open.
    fn recognises(&self, beginning: &[u8]) -> bool;

    /// Whether a file of this format that begins so may hold other bytes than text.
    fn may_be_binary(&self, _: &[u8]) -> bool {
        false
    }

    /// Whether reading takes more stack the deeper the file is nested, up to 256 MiB.
    fn nests(&self) -> bool {
        false
    }

    /// Turns `bytes`, the contents of the file that the user calls `file`, into lines to send.
    /// There are fewer bytes than [`SIZE_LIMIT`]. The lines hold geometry and pens, but no command
    /// that acts on the machine. What the format drops is counted in the notes. A plan is arranged
    /// by the caller; of the `arrangement` a format only learns what it must find out for that.
    ///
    /// # Errors
    /// The file contains something that no plotter accepts, or that this format does not allow.
    fn read(
        &self,
        file: String,
        bytes: Vec<u8>,
        arrangement: &Arrangement,
    ) -> Result<Contents, ReadError>;
}
