//! The files to which a file refers.

use std::fmt;
use std::sync::Arc;

/// Reads the file at a path, as it stands in a file that refers to it.
type Read = dyn Fn(&str) -> Option<Vec<u8>> + Send + Sync;

/// The files to which a file may refer, as an SVG refers to images.
///
/// A reader opens no file, so the caller has to. Without any, the user is told what is not drawn.
#[derive(Clone, Default)]
pub struct Files {
    read: Option<Arc<Read>>,
}

impl Files {
    /// The files that `read` reads by their paths. It is given a path as it stands in the file, and
    /// returns `None` where there is no such file.
    pub fn read_by(read: impl Fn(&str) -> Option<Vec<u8>> + Send + Sync + 'static) -> Self {
        Self { read: Some(Arc::new(read)) }
    }

    /// The contents of a file; `None` if it cannot be read.
    #[cfg_attr(not(feature = "svg"), expect(dead_code, reason = "only SVG refers to files"))]
    pub(crate) fn read(&self, path: &str) -> Option<Vec<u8>> {
        self.read.as_ref().and_then(|read| read(path))
    }
}

impl PartialEq for Files {
    fn eq(&self, other: &Self) -> bool {
        match (&self.read, &other.read) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        }
    }
}

impl fmt::Debug for Files {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Files")
    }
}
