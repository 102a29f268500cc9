//! What the page reads that is not loaded with it: the large formats, and all plans that are
//! arranged.
//!
//! The page loads this program when it is needed, and in a worker of its own, which ends if a
//! nested file takes too much stack. A [`Reading`] is what it hands on: the lines to send, and what
//! the page must know about the file. Without the feature `readers` there is what the page and the
//! program share, which reads files for the page that it serves: the `Reading`, and the options.

mod options;
mod reading;
#[cfg(feature = "readers")]
mod readers;

pub use options::arrangement;
#[cfg(feature = "readers")]
pub use readers::{file_extensions, file_names, read};
pub use reading::{ReadLines, Reading};
