//! Reads files by the client's readers. A format that the client's table gains is read here, too,
//! if it is among those that build for a browser.

use penup_client::formats::{self, SourceFile};
use penup_client::lines::Lines;
use std::rc::Rc;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::words::for_page;

/// Reads a file that the user calls `name`.
///
/// # Errors
/// A sentence for the user that says what is wrong with the file, and where.
pub fn read(name: &str, bytes: Vec<u8>) -> Result<Rc<dyn Lines>, String> {
    let file = SourceFile::new(name.to_owned(), bytes);
    let file = file.map_err(|error| for_page(&error.to_string()))?;
    Ok(Rc::new(file))
}

/// The formats that are read, with their extensions, for people.
#[wasm_bindgen]
pub fn file_names() -> String {
    formats::list()
}

/// The extensions of the files that are read, each with its dot, with commas between them.
#[wasm_bindgen]
pub fn file_extensions() -> String {
    formats::extensions().map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(",")
}
