//! The fonts in which texts are drawn.

use std::fmt;

/// The fonts that a caller knows, found when the first text asks for them.
///
/// A reader opens no file, so the caller has to look for fonts. Without any, the user is told to
/// convert texts to paths.
#[derive(Clone, Copy, Default)]
pub struct Fonts {
    #[cfg(feature = "text")]
    find: Option<fn() -> usvg::fontdb::Database>,
}

impl Fonts {
    /// No fonts: texts are not drawn.
    pub const NONE: Self = Self {
        #[cfg(feature = "text")]
        find: None,
    };

    /// The fonts that `find` finds. It is called once for each file with a text.
    #[cfg(feature = "text")]
    pub const fn found_by(find: fn() -> usvg::fontdb::Database) -> Self {
        Self { find: Some(find) }
    }

    /// Looks for the fonts.
    #[cfg(feature = "text")]
    pub(crate) fn find(self) -> Option<usvg::fontdb::Database> {
        self.find.map(|find| find())
    }
}

impl PartialEq for Fonts {
    fn eq(&self, other: &Self) -> bool {
        #[cfg(feature = "text")]
        return match (self.find, other.find) {
            (Some(one), Some(other)) => std::ptr::fn_addr_eq(one, other),
            (one, other) => one.is_none() && other.is_none(),
        };
        #[cfg(not(feature = "text"))]
        {
            let Self {} = other;
            true
        }
    }
}

impl fmt::Debug for Fonts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Fonts")
    }
}
