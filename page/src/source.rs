//! Reads files by the readers that the client uses, too: those that are small enough to be loaded
//! with the page, and what `penup-page-files` has read.

use crate::options::is_of_plans;
use crate::words::for_page;
use penup_job::user_choices::FilePage;
use penup_page_files::Reading;
use penup_readers::SourceFile;
use penup_readers::lines::Lines;
use std::path::Path;
use std::rc::Rc;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::options::NamedValues;

/// A file that was read.
#[derive(Debug, Clone)]
pub struct Source {
    /// The lines to send.
    pub lines: Rc<dyn Lines>,
    /// What the file says about its page. The sheet is that of the arrangement, if it was arranged.
    pub page: FilePage,
    /// The least and the greatest x and y of a plan, in mm.
    pub bounds: Option<[[f64; 2]; 2]>,
    /// What the user should know about the file: sentences without a full stop.
    pub notes: Vec<String>,
    /// Whether the page on which it is laid is chosen already.
    pub is_arranged: bool,
}

impl Source {
    /// Reads the file that the user calls `name`. If it `is_read`, the `bytes` are what
    /// `penup-page-files` made of it.
    ///
    /// # Errors
    /// A sentence for the user that says what is wrong with the file, and where.
    pub fn read(name: &str, bytes: Vec<u8>, is_read: bool) -> Result<Self, String> {
        if is_read {
            let reading: Reading = serde_json::from_slice(&bytes).map_err(|error| {
                format!("The page read the file in a wrong form: {error}. Reload the page.")
            })?;
            let (bounds, notes) = (reading.bounds(), reading.notes().to_vec());
            let (own, sheet) = reading.pages();
            let page = FilePage { own, sheet, is_plan: bounds.is_some() };
            let lines = Rc::new(reading.into_lines(name));
            return Ok(Self { lines, page, bounds, notes, is_arranged: true });
        }
        let file = SourceFile::new(name.to_owned(), bytes);
        let file = file.map_err(|error| for_page(&error.to_string()))?;
        let bounds = file.bounds();
        let page = FilePage { own: file.page(), sheet: file.sheet(), is_plan: bounds.is_some() };
        let notes = file.notes().to_vec();
        Ok(Self { lines: Rc::new(file), page, bounds, notes, is_arranged: false })
    }
}

impl Default for Source {
    fn default() -> Self {
        let sheet = penup_readers::page::A4;
        let page = FilePage { own: None, sheet, is_plan: false };
        Self {
            lines: Rc::new(Vec::new()),
            page,
            bounds: None,
            notes: Vec::new(),
            is_arranged: false,
        }
    }
}

/// Whether a file with this name, or these `options` (a JSON array of pairs of name and value),
/// must be read by `penup-page-files`.
///
/// # Errors
/// The options have a wrong form.
#[wasm_bindgen]
pub fn needs_readers(name: &str, options: &str) -> Result<bool, String> {
    let extension = Path::new(name).extension().unwrap_or_default().to_string_lossy();
    let is_small = penup_readers::extensions().any(|own| own.eq_ignore_ascii_case(&extension));
    let options = NamedValues::parse(options)?;
    Ok(!is_small || options.names().any(is_of_plans))
}
