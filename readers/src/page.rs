//! The page that a drawing lies on.

/// The size of a page, in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Page {
    /// The width of the page.
    pub width: f64,
    /// The height of the page.
    pub height: f64,
}

/// The page that is used if none is named.
pub const A4: Page = Page { width: 210.0, height: 297.0 };

/// The pages that have names, in lower case.
pub const NAMED_PAGES: [(&str, Page); 10] = [
    ("A4", A4),
    ("A0", Page { width: 841.0, height: 1189.0 }),
    ("A1", Page { width: 594.0, height: 841.0 }),
    ("A2", Page { width: 420.0, height: 594.0 }),
    ("A3", Page { width: 297.0, height: 420.0 }),
    ("A5", Page { width: 148.0, height: 210.0 }),
    ("A6", Page { width: 105.0, height: 148.0 }),
    ("Letter", Page { width: 215.9, height: 279.4 }),
    ("Legal", Page { width: 215.9, height: 355.6 }),
    ("Tabloid", Page { width: 279.4, height: 431.8 }),
];
