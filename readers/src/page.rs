//! The page that a drawing lies on.

use penup::protocol::CommandError;

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

/// The units of lengths, with their lengths in mm.
const UNITS: [(&str, f64); 3] = [("mm", 1.0), ("cm", 10.0), ("in", 25.4)];

impl Page {
    /// Parses the size of a page: its name, or its width and height with or without a unit, which
    /// is mm.
    ///
    /// # Errors
    /// A sentence for the user that says what a page may be.
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some((_, page)) =
            NAMED_PAGES.iter().find(|(name, _)| name.eq_ignore_ascii_case(text))
        {
            return Ok(*page);
        }
        let names: Vec<&str> = NAMED_PAGES.iter().map(|(name, _)| *name).collect();
        let names = names.join(", ");
        let text = text.to_ascii_lowercase();
        let (width, height) = text.split_once('x').ok_or_else(|| {
            format!(
                "it is none of {names}, or width x height such as 300x200, 30cmx20cm or 11x17in"
            )
        })?;
        // A unit behind the height is that of both.
        let (height, unit) = length(height, 1.0)?;
        let (width, _) = length(width, unit)?;
        Ok(Self { width, height })
    }
}

/// Parses a length with or without its unit. Returns it in mm, and the length of the unit, which is
/// `unit` where none is written.
fn length(text: &str, unit: f64) -> Result<(f64, f64), String> {
    let text = text.trim();
    let named = UNITS.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit)));
    let (value, unit) = named.unwrap_or((text, unit));
    let value: Option<f64> = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let value = value.ok_or_else(|| CommandError::NotANumber.to_string())?;
    // What single steps cannot show is rounded away.
    Ok(((value * unit * 1000.0).round() / 1000.0, unit))
}
